// 2D Gaussians in image space (method, section 3): their planes, their ellipses, and the per-view state that
// host and kernels exchange.
//
// A 2D Gaussian is a column of `screen_planes` (planes x stride): 0,1 centre (px), 2..4 rgb, 5 opacity logit, 6,7 log scale (px),
// 8 angle (rad), 9 depth (camera z, 0 = none; sampled, not learned). Planes 0..8 have moments: the first moment of plane p is plane
// 2p of `screen_moments`, the second 2p + 1. `screen_frames` has the position of its view in the batch, or NONE if the slot is
// empty.
#include "trig.glsl"

const uint CENTRE = 0, COLOR = 2, LOGIT = 5, LOG_SCALE = 6, ANGLE = 8, DEPTH = 9;
const uint LEARNED = 9; // planes that have moments
const uint SCREEN_PLANES = 10;

// The slots of a view: first..first + budget.
struct Quota {
    uint view; // index in the dataset, so that a view's draws do not depend on its batch
    uint first;
    uint budget;
};

// Phase of a view's Gaussians. After a draw that fills the budget come one more round of steps and one more
// prune.
const uint WAITING = 0; // not rendered, and unchanged
const uint DRAWING = 1; // rendered, stepped and pruned, and more are drawn
const uint FILLED = 2;  // rendered, stepped and pruned for one more round, without a draw at its end

struct ScreenState {
    uint count; // slots taken after the last draw
    uint mode;
};

struct ScreenShape {
    vec2 variance;       // undilated, along the axes (cosine, sine) and (-sine, cosine), px^2
    float cosine, sine;
    float l11, l12, l22; // factor of the inverse of S + 0.3 I, as in Splat
    float compensation;  // sqrt(det S / det(S + 0.3 I))
};


// Standard deviations, px (method, section 3): 0.005 of the shorter side at first, at most 50 and 0.01 of
// width + height. In images of less than 120 pixels the first would be below the dilation's own sqrt(0.3):
// compensation makes such a Gaussian invisible at its opacity of 0.02, and it never learns. It therefore
// starts at 0.6 px at least, and may grow to twice that.
const float FIRST_SCALE_MIN = 0.6;
float first_scale(uint width, uint height) { return clamp(0.005 * float(min(width, height)), FIRST_SCALE_MIN, 50.0); }
float scale_max(uint width, uint height) {
    return max(min(50.0, 0.01 * (float(width) + float(height))), 2.0 * FIRST_SCALE_MIN);
}

// S = Rot diag(variance) Rot^T. The eigenvalues of S + 0.3 I are the variances plus 0.3, so its determinant and the
// compensation are products: nothing cancels, and neither depends on the angle.
ScreenShape screen_shape(vec2 log_scale, float angle) {
    ScreenShape e;
    e.variance = exp(2.0 * log_scale);
    vec2 turn = cos_sin(angle);
    e.cosine = turn.x;
    e.sine = turn.y;
    vec2 dilated = e.variance + DILATION;
    // guard: determinant of 2D needles (3 lines)
    float det = dilated.x * dilated.y;
    float b = e.cosine * e.sine * (e.variance.x - e.variance.y);
    float c = e.sine * e.sine * dilated.x + e.cosine * e.cosine * dilated.y;
    e.l22 = inversesqrt(c);
    e.l11 = sqrt(c / det);
    e.l12 = -b * e.l22 * inversesqrt(det);
    e.compensation = sqrt(e.variance.x / dilated.x * (e.variance.y / dilated.y));
    return e;
}
