// Types and helpers of residual pursuit (method, section 7), which places supplementary and plain Gaussians
// by their gain in all training views at once.
//
// The difference between photograph and render lies in a pyramid for each view: level k is blurred by
// FIRST_BLUR * 2^k px and has one texel for 2^k * 2^k pixels. Views lie in pages, since no device binds all
// of a large dataset at once.
#include "view.glsl"
#include "unit.glsl" // FLOAT_MAX
#include "trig.glsl"

const uint LEVELS = 3;
const float FIRST_BLUR = 0.7;   // px, standard deviation
const float NEXT_BLUR = 1.2124; // texels of the level below, so that variances add up to the double deviation: sqrt(3) * 0.7
const uint WIDTHS = 6;          // number of lobe widths tried; the last one means no lobe
const uint SUMS = 10;           // per size and lobe width, see pursuit_score
const uint ERROR_BLOCK = 256;   // pixels
const uint CELL = 2;            // px
const float REACH = 2.5;        // standard deviations within which a chosen candidate changes the residual
const float CORE = 0.5;         // standard deviations within which no other candidate is chosen in the same round
const float WINDOW_SLACK = 1e-3; // px: a whole number of pixels, such as 2.5 deviations of 2 px, is not rounded up for a rounding error
const float WHOLE = 65536.0;    // unit of `explained`: all of a residual is explained
const float WIDEST = 3.2;       // px: larger footprints are scored at this size

// First indices of a view in the buffers of its page, and of its errors among those of all views.
struct Plot {
    uint texel_first; // of level 0; the next levels follow
    uint pixel_first; // of surface_depths, errors and explained
    uint cell_first;
    uint block_first; // number of its first block of ERROR_BLOCK pixels, among those of all views
};

// Statistics of a view beneath a footprint, sRGB: means of photograph minus render and of the render, and
// their covariance and variance, summed over channels.
struct Beneath {
    vec3 difference;
    vec3 render;
    float covariance; // of difference and render
    float variance;   // of the render
};

// Beneath, packed into eight halves.
struct Texel {
    uint difference_rg;
    uint difference_b_render_r;
    uint render_gb;
    uint texture; // covariance, variance
};

Texel pack_texel(Beneath under) {
    return Texel(packHalf2x16(under.difference.rg), packHalf2x16(vec2(under.difference.b, under.render.r)), packHalf2x16(under.render.gb),
                 packHalf2x16(vec2(under.covariance, under.variance)));
}

Beneath unpack_texel(Texel t) {
    vec2 a = unpackHalf2x16(t.difference_rg), b = unpackHalf2x16(t.difference_b_render_r), c = unpackHalf2x16(t.render_gb);
    vec2 d = unpackHalf2x16(t.texture);
    return Beneath(vec3(a, b.x), vec3(b.y, c), d.x, d.y);
}

void add_texel(inout Beneath sum, float weight, Beneath under) {
    sum.difference += weight * under.difference;
    sum.render += weight * under.render;
    sum.covariance += weight * under.covariance;
    sum.variance += weight * under.variance;
}

// A drawn pixel's point on the surface that the base shows there.
struct Candidate {
    vec3 mean;       // from the model's origin, scene units
    vec3 toward;     // unit, to the camera of the view that it was drawn in
    float px;        // scene units that a pixel covers at its depth, in the view that it was drawn in
    float theta_bar; // angle to the nearest other training view, radians
    uint view;       // NONE: no candidate
    uint pixel;      // of that view
};

// The best Gaussian found for a candidate.
struct Fit {
    float sigma;   // standard deviation, scene units
    float opacity; // 0 to 1
    float width;   // T of the lobe; 0: no lobe, a plain Gaussian
    vec3 color;   // sRGB
    float gain;    // decrease of the squared error over all views, px; 0: none, or out after a round without a gain
    float support; // sum over views of the squared lobe factor times the footprint's area, px: C of pursuit_score
    float plain;   // gain of the best fit without a lobe, 0 if it gains nothing
};

// The texels of level k of a view: first, width, height.
uvec3 level_of(Plot plot, uint width, uint height, uint k) {
    uvec3 level = uvec3(plot.texel_first, width, height);
    for (uint j = 1; j <= k; ++j) {
        level.x += level.y * level.z;
        level.yz = uvec2((width + (1u << j) - 1) >> j, (height + (1u << j) - 1) >> j);
    }
    return level;
}

// Cosine lobe of sharpness 0 (method, section 1); 1 for width 0.
float lobe_factor(float theta, float width) {
    if (width == 0.0) return 1.0;
    float psi = theta / width;
    return psi < PI ? 0.5 * (cos_sin(psi).x + 1.0) : 0.0;
}

// T of width w of WIDTHS; 0 for no lobe. Tries half the paper's T = 7 theta_bar / pi (method, section 4),
// that T, its double, ...
float lobe_width(uint w, float theta_bar) {
    return w == WIDTHS - 1 ? 0.0 : clamp(exp2(float(w) - 1.0) * 7.0 * theta_bar / PI, 0.01, 1.0);
}

// Standard deviation, in scene units, of a Gaussian that covers `size` px, dilation included, if a pixel
// covers `px` scene units.
float sigma_of(float size, float px) { return sqrt(max(size * size - DILATION, 0.1)) * px; }

float angle_between(vec3 a, vec3 b) { return angle_of(length(cross(a, b)), dot(a, b)); }

// Projects a point into a view: pixels, and camera z. False outside of the image and in front of the near
// plane.
bool project_point(View view, vec3 mean, out vec3 at) {
    vec3 p = to_camera(view, mean);
    at = vec3(0.0);
    if (!(p.z > NEAR)) return false;
    at = vec3(view.fx * p.x / p.z + view.cx, view.fy * p.y / p.z + view.cy, p.z);
    return at.x >= 0.0 && at.y >= 0.0 && at.x < float(view.width) && at.y < float(view.height);
}

#ifdef PURSUIT_READS
layout(set = 0, binding = 0, scalar) readonly buffer Views { View views[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Plots { Plot plots[]; };
layout(set = 0, binding = 2, scalar) readonly buffer SurfaceDepths { float surface_depths[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Candidates { Candidate candidates[]; };

// A candidate as seen in one view.
struct Sight {
    vec2 at;       // px
    uint pixel;
    float z;       // camera z
    float theta;   // angle between this camera and the camera that it was drawn in
};

// False if the candidate is outside of the image, or hidden: SAME_DEPTH or more behind the view's own
// surface. A candidate in front of the surface is seen. The view that it was drawn in always sees it.
const float SAME_DEPTH = 0.05;
bool sees(uint v, View view, Candidate c, out Sight s) {
    vec3 at;
    bool inside = project_point(view, c.mean, at);
    s.at = at.xy;
    s.z = at.z;
    s.pixel = 0;
    s.theta = 0.0;
    if (!inside) return false;
    s.pixel = uint(at.y) * view.width + uint(at.x);
    float own = surface_depths[plots[v].pixel_first + s.pixel];
    if (v != c.view && own > 0.0 && at.z - own >= SAME_DEPTH * own) return false; // guard: pursuit: hidden candidates
    s.theta = v == c.view ? 0.0 : angle_between(c.toward, view.eye - c.mean);
    return true;
}

// Standard deviation, in a view's pixels, of a round Gaussian of `sigma` scene units.
float footprint_px(View view, float z, float sigma) {
    float px = sigma * view.fx / z;
    return min(sqrt(px * px + DILATION), WIDEST);
}

// The pixels within `px` of a candidate's pixel, rounded up to a whole number: first and last column and row,
// as (x, y, x, y).
uvec4 window_of(View view, Sight s, float px) {
    ivec2 centre = ivec2(s.pixel % view.width, s.pixel / view.width);
    int reach = int(ceil(px - WINDOW_SLACK));
    return uvec4(max(centre - reach, ivec2(0)), min(centre + reach, ivec2(view.width, view.height) - 1));
}
#endif

#ifdef PURSUIT_SIGHTS
layout(set = 0, binding = PURSUIT_SIGHTS, scalar) readonly buffer Sights { uint sights[]; };

// Whether the fit of candidate i shows in view v, see pursuit_sight; `words` for each candidate.
bool shows(uint i, uint words, uint v) { return (sights[i * words + v / 32] >> (v % 32) & 1u) != 0; }
#endif

#ifdef PURSUIT_TEXELS
layout(set = 0, binding = PURSUIT_TEXELS, scalar) readonly buffer Texels { Texel texels[]; };

// The view's statistics beneath a footprint of about `deviation` px: from the nearest level, interpolated
// between four texels.
Beneath look(Plot plot, View view, vec2 at, float deviation) {
    uint k = uint(clamp(floor(log2(deviation / FIRST_BLUR) + 0.5), 0.0, float(LEVELS - 1)));
    uvec3 level = level_of(plot, view.width, view.height, k);
    vec2 place = at / float(1u << k) - 0.5, low = floor(place), share = place - low;
    Beneath sum = Beneath(vec3(0.0), vec3(0.0), 0.0, 0.0);
    for (uint corner = 0; corner < 4; ++corner) {
        vec2 step = vec2(corner & 1, corner >> 1);
        uvec2 texel = uvec2(clamp(low + step, vec2(0.0), vec2(level.yz - 1)));
        vec2 weights = mix(1.0 - share, share, step);
        add_texel(sum, weights.x * weights.y, unpack_texel(texels[level.x + texel.y * level.y + texel.x]));
    }
    return sum;
}
#endif
