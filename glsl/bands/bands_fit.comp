#version 460
// Fits harmonics to the colors that views ask of each Gaussian, and estimates what they gain in views that
// were not fitted.
//
// One thread takes one Gaussian of a page. population, geometry, views, looks -> gains, fits
// With weights w and colors t of the views, less their mean, coefficients minimise sum w |t - Y c|^2 + RIDGE
// sum w |c|^2 over the bands (not the constant). By the leave-one-out identity of least squares the error in
// a view, had it been left out, is (t - Y c) / (1 - h), h = w Y^T A^-1 Y, A being the normal matrix. The gain
// is the sum of w |.|^2 of these errors with the mean alone, less that with the bands: a fall of the squared
// error, summed over pixels and channels. A view of leverage h near 1 gains nothing.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/population.glsl"
#include "../shared/view.glsl"
#include "../shared/harmonics.glsl"
#include "../shared/bands.glsl"

const uint COEFFICIENTS = (SH_DEGREE + 1) * (SH_DEGREE + 1);
const uint MOST = 16; // coefficients

layout(push_constant, scalar) uniform Push {
    uint segment;
    uint page_first;
    uint stride;
    uint view_count;
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Population { uint segment_first[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Views { View views[]; };
#define GEOMETRY 2
#define MODEL_LOADS
#include "../shared/model.glsl"
layout(set = 0, binding = 3, scalar) readonly buffer Looks { vec4 looks[]; };
layout(set = 0, binding = 4, scalar) writeonly buffer Gains { float gains[]; };
layout(set = 0, binding = 5, scalar) writeonly buffer Fits { vec3 fits[]; };

uint at_of(uint row, uint column) { return row * (row + 1) / 2 + column; }

void main() {
    uint place = thread_index();
    uint i = segment_first[push.segment] + push.page_first + place;
    if (!(place < push.stride && i < segment_first[push.segment + 1])) return;
    vec3 mean = load_geometry3(MEAN, place);

    vec4 sum = vec4(0.0);
    for (uint v = 0; v < push.view_count; ++v) {
        vec4 look = looks[v * push.stride + place];
        sum += vec4(look.w * look.rgb, look.w);
    }
    vec3 middle = sum.w > 0.0 ? sum.rgb / sum.w : vec3(0.0);
    float matrix[MOST * (MOST + 1) / 2];
    vec3 fit[MOST];
    for (uint k = 0; k < COEFFICIENTS; ++k) {
        fit[k] = vec3(0.0);
        for (uint m = 0; m <= k; ++m) matrix[at_of(k, m)] = 0.0;
    }
    for (uint v = 0; v < push.view_count; ++v) {
        vec4 look = looks[v * push.stride + place];
        if (!(look.w > 0.0)) continue;
        float basis[16];
        sh_basis(normalize(mean - views[v].eye), basis);
        for (uint k = 0; k < COEFFICIENTS; ++k) {
            float part = look.w * basis[k];
            fit[k] += part * (look.rgb - middle);
            for (uint m = 0; m <= k; ++m) matrix[at_of(k, m)] += part * basis[m];
        }
    }
    // Cholesky: A = L L^T, in place.
    bool sound = sum.w > 0.0;
    for (uint k = 0; k < COEFFICIENTS; ++k) {
        if (k > 0) matrix[at_of(k, k)] += RIDGE * sum.w;
        for (uint m = 0; m <= k; ++m) {
            float left = matrix[at_of(k, m)];
            for (uint n = 0; n < m; ++n) left -= matrix[at_of(k, n)] * matrix[at_of(m, n)];
            if (m < k) {
                matrix[at_of(k, m)] = left / matrix[at_of(m, m)];
            } else {
                sound = sound && left > 0.0;
                matrix[at_of(k, k)] = sqrt(max(left, 1e-30));
            }
        }
    }
    for (uint k = 0; k < COEFFICIENTS; ++k) {
        for (uint m = 0; m < k; ++m) fit[k] -= matrix[at_of(k, m)] * fit[m];
        fit[k] /= matrix[at_of(k, k)];
    }
    for (uint r = 0; r < COEFFICIENTS; ++r) {
        uint k = COEFFICIENTS - 1 - r;
        for (uint m = k + 1; m < COEFFICIENTS; ++m) fit[k] -= matrix[at_of(m, k)] * fit[m];
        fit[k] /= matrix[at_of(k, k)];
    }

    float gain = 0.0;
    for (uint v = 0; v < push.view_count; ++v) {
        vec4 look = looks[v * push.stride + place];
        if (!(look.w > 0.0)) continue;
        float basis[16], solved[16], length2 = 0.0;
        sh_basis(normalize(mean - views[v].eye), basis);
        vec3 left = look.rgb - middle, alone = left / (1.0 - look.w / sum.w);
        for (uint k = 0; k < COEFFICIENTS; ++k) {
            left -= basis[k] * fit[k];
            solved[k] = basis[k];
            for (uint m = 0; m < k; ++m) solved[k] -= matrix[at_of(k, m)] * solved[m];
            solved[k] /= matrix[at_of(k, k)];
            length2 += solved[k] * solved[k];
        }
        float leverage = look.w * length2;
        left /= 1.0 - leverage;
        gain += leverage < MOST_LEVERAGE ? look.w * (dot(alone, alone) - dot(left, left)) : 0.0;
    }
    gains[place] = sound ? gain : 0.0;
    // The constant holds the mean and the color's middle of 1/2.
    fit[0] += (middle - 0.5) / SH_C0;
    for (uint k = 0; k < COEFFICIENTS; ++k) fits[k * push.stride + place] = sound ? fit[k] : vec3(0.0);
}
