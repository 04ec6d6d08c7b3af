// Numbers on which several kernels, or kernels and the host, must agree. glsl/generate.rs hands every plain
// constant of glsl/shared/ to the host as `kernels::constants::FILE::NAME`, so none is written twice.
const uint NONE = 0xFFFFFFFFu; // no Gaussian, no view; as a depth key: not in this view
const float PI = 3.14159265358979;
const float SH_C0 = 0.28209479177387814; // 1 / (2 sqrt(pi)), the constant band
const float DILATION = 0.3; // px^2, added to the diagonal of every 2D covariance (3DGS)
const float NEAR = 0.2; // scene units (3DGS): a Gaussian is culled unless its camera z is beyond this
