// The color of a Gaussian toward a view, and its gradient: real spherical harmonics with 3DGS's signs (Kerbl
// 2023), or their constant band and spherical betas.
//
// Kernels call only color_at, color_of, direction_gradient and coefficient_gradient, and know that there
// are COEFFICIENTS coefficients of three channels. Another color model is another file and a choice here.
// The bands in use, or betas in their place, are a specialisation constant: bands that a scene lacks, or that
// training has not reached, are not in the pipeline.
#include "betas.glsl"
#include "harmonics.glsl"

const bool HAS_BETAS = SH_DEGREE == BETAS;
const uint HARMONICS = HAS_BETAS ? 1 : (SH_DEGREE + 1) * (SH_DEGREE + 1);
const uint COEFFICIENTS = HARMONICS + (HAS_BETAS ? 2 * BETA_LOBES : 0);
const uint GROUPS = (COEFFICIENTS + 3) / 4; // of four coefficients, read and written together

// Depends on the direction alone (the unit vector from the eye to the Gaussian), and on the Gaussian's betas.
struct ColorAt {
    vec3 direction;
    float basis[16];
    Beta betas[BETA_LOBES];
};
ColorAt color_at(vec3 direction, uint place) {
    ColorAt at;
    at.direction = direction;
    sh_basis(direction, at.basis);
    if (!HAS_BETAS) return at;
    vec4 quads[BETA_GROUPS][3];
    [[unroll]] for (uint g = 0; g < BETA_GROUPS; ++g) load_sh12(g, 3 * COEFFICIENTS, place, quads[g]);
    [[unroll]] for (uint m = 0; m < BETA_LOBES; ++m) {
        uint k = 1 + 2 * m, next = k + 1;
        at.betas[m] = beta_at(direction, coefficient_of(quads[k / 4], k % 4), coefficient_of(quads[next / 4], next % 4));
    }
    return at;
}

// The color before it is clamped at 0.
vec3 color_of(ColorAt at, uint place) {
    vec3 color = vec3(0.5);
    [[unroll]] for (uint g = 0; g < GROUPS; ++g) {
        vec4 quads[3];
        load_sh12(g, 3 * COEFFICIENTS, place, quads);
        [[unroll]] for (uint j = 0; j < 4; ++j) {
            if (4 * g + j < HARMONICS) color += at.basis[4 * g + j] * coefficient_of(quads, j);
        }
    }
    if (HAS_BETAS) {
        [[unroll]] for (uint m = 0; m < BETA_LOBES; ++m) color += at.betas[m].factor * at.betas[m].light;
    }
    return color;
}

// Coefficient k's part of the gradient by the direction, not yet made tangent to the sphere. A lobe's part
// comes with its color coefficient.
vec3 direction_gradient(ColorAt at, uint k, vec3 d_color, vec3 coefficient) {
    if (k < HARMONICS) return dot(d_color, coefficient) * sh_basis_gradient(at.direction, k);
    Beta l = at.betas[(k - 1) / 2];
    return k % 2 == 1 ? dot(d_color, l.light) * l.by_cosine * l.axis : vec3(0.0);
}

// The gradient by coefficient k.
vec3 coefficient_gradient(ColorAt at, uint k, vec3 d_color) {
    if (k < HARMONICS) return at.basis[k] * d_color;
    Beta l = at.betas[(k - 1) / 2];
    return k % 2 == 1 ? l.factor * l.slope * d_color : dot(d_color, l.light) * l.by_shape;
}
