// One number's Adam step (Kingma 2014) with the settings of 3DGS.
const float BETA1 = 0.9, BETA2 = 0.999, EPSILON = 1e-15;

// The change that one step makes.
// A gradient is cut off where its square, times 1/(1 - BETA2), would leave float32: v would stay infinite for ever. The step is
// at most (1 - BETA1) / sqrt((1 - BETA2) (1 - BETA1^2 / BETA2)) = 7.3 rates whatever the gradients (Cauchy and Schwarz).
const float GRADIENT_MAX = 1e17;
float adam(float g, float rate, inout float m, inout float v, float c1, float c2) {
    g = clamp(g, -GRADIENT_MAX, GRADIENT_MAX); // guard: gradients above 1e17
    m = mix(g, m, BETA1);
    v = mix(g * g, v, BETA2);
    return -rate * (m * c1) / (sqrt(v * c2) + EPSILON);
}
