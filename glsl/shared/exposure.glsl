// Layout shared by the kernels of exposure correction. Each training photograph has an affine map of colors,
// c' = M c + b, applied to the blended image before the comparison (3DGS, "exposure compensation", 2024).
#include "frame.glsl"

// Numbers of a map: rows of (M | b). Entry 4 row + column; column 3 is b.
const uint MAP = 12;
// Next to a map lie MOMENTS numbers: the first moments of its entries, the second ones, and both moments of a
// gradient that is always 1. After t steps these two are 1 - BETA1^t and 1 - BETA2^t, the divisors of Adam's
// bias correction.
const uint FIRST = 0;
const uint SECOND = 12;
const uint CORRECTIONS = 24;
const uint MOMENTS = 26;
// Pixels over which one subgroup sums a map's gradient: a multiple of every subgroup size.
const uint SUM_PIXELS = 1024;
