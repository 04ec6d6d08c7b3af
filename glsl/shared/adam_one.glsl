// The step of one number: Adam's (Kingma 2014) with the settings of 3DGS, or Newton's.
const float BETA1 = 0.9, BETA2 = 0.999, EPSILON = 1e-15;

// An exponential moving average after `x`. mix() would not do: a driver may compute it as x + kept * (mean -
// x), which rounds by a unit of x. The second moment takes a thousandth of x, so it would be off by 6e-5 of
// itself.
float mean_with(float x, float mean, float kept) { return (1.0 - kept) * x + kept * mean; }

// Returns the change of one Adam step.
// Gradients are clamped to GRADIENT_MAX: the square of a larger one, times 1/(1 - BETA2), would leave
// float32, and v would stay infinite for ever. A step is at most (1 - BETA1) / sqrt((1 - BETA2) (1 - BETA1^2
// / BETA2)) = 7.3 rates for any gradients (Cauchy and Schwarz).
const float GRADIENT_MAX = 1e17;
float adam(float g, float rate, inout float m, inout float v, float c1, float c2) {
    g = clamp(g, -GRADIENT_MAX, GRADIENT_MAX); // guard: gradients above 1e17
    m = mean_with(g, m, BETA1);
    v = mean_with(g * g, v, BETA2);
    return -rate * (m * c1) / (sqrt(v * c2) + EPSILON);
}

// Returns a number's estimated curvature after a probe with the gradient g (method, section 5): an
// exponential moving average that the first probe initialises.
const float CURVATURE_DECAY = 0.95;
float curvature(float g, float d) {
    g = clamp(g, -GRADIENT_MAX, GRADIENT_MAX);
    return d > 0.0 ? mean_with(g * g, d, CURVATURE_DECAY) : g * g;
}

// Returns the change of one Newton step, each number by itself: `part` of the way to the point where the mean
// gradient would be 0, at most NEWTON_REACH rates. 0 before the first probe of the number.
const float NEWTON_REACH = 3.0;
float newton(float g, float rate, float part, inout float m, float d) {
    g = clamp(g, -GRADIENT_MAX, GRADIENT_MAX);
    m = mean_with(g, m, BETA1);
    float bound = NEWTON_REACH * rate;
    return d > 0.0 ? clamp(-part * m / d, -bound, bound) : 0.0; // guard: curvature that is not known
}
