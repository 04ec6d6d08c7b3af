// What the kernels of exposure correction agree on: each training photograph has an affine map of colours, c' = M c + b, that the
// blended image goes through before it is compared (3DGS, "exposure compensation", 2024).
#include "frame.glsl"

// Numbers of a map: rows of (M | b), so entry 4 row + column, and of that b is column 3.
const uint MAP = 12;
// Beside a map lie MOMENTS numbers: the first moments of its entries, the second ones, and both of a gradient that is always 1, which
// are 1 - BETA1^t and 1 - BETA2^t after t steps: what Adam's bias correction divides by.
const uint FIRST = 0;
const uint SECOND = 12;
const uint CORRECTIONS = 24;
const uint MOMENTS = 26;
// Pixels over which one subgroup sums a map's gradient. A multiple of every subgroup's size.
const uint SUM_PIXELS = 1024;
