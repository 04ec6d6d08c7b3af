#version 460
// Projects Gaussians into one view: culls, makes splats, depth keys and tile counts.
//
// One thread takes one Gaussian.
// geometry, sh, lobes, views -> splats, depth_keys, tile_counts (by Gaussian index)
// EWA splatting (Zwicker 2001) as in 3DGS (Kerbl 2023); opacity lobe of AuGS (2026), section 1 of the method.
// Limits: culled where camera z <= 0.2, opacity < 1/255, no pixel centre is reached, or anything is not a number.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/view.glsl"
#include "../shared/splat.glsl"

layout(constant_id = 1) const uint TILE_WIDTH = 8;
layout(constant_id = 2) const uint TILE_HEIGHT = 8;
layout(constant_id = 3) const bool COMPENSATE = false; // opacity *= sqrt(det0 / det), as in Mip-Splatting
layout(constant_id = 4) const bool LOBES = false;      // the scene has supplementary Gaussians

layout(push_constant, scalar) uniform Push {
    uint count;         // Gaussians
    uint stride;        // of the planes of geometry and sh
    uint lobe_first;    // index of the first supplementary Gaussian
    uint lobe_stride;   // of the planes of lobes
    uint view;          // index in views
    uint active_degree; // SH bands evaluated
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Views { View views[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Geometry { float geometry[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Sh { float sh[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Lobes { float lobes[]; };
layout(set = 0, binding = 4, scalar) writeonly buffer Splats { Splat splats[]; };
layout(set = 0, binding = 5, scalar) writeonly buffer DepthKeys { uint depth_keys[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer TileCounts { uint tile_counts[]; };

#include "../shared/gaussian.glsl"

uint count_tiles(Splat s, View view) {
    uvec2 tile = uvec2(TILE_WIDTH, TILE_HEIGHT), size = uvec2(view.width, view.height);
    ivec2 rows = tile_rows(s, tile, size);
    uint count = 0;
    for (int row = rows.x; row <= rows.y; ++row) {
        ivec2 span = tile_span(s, row, tile, size);
        count += uint(max(span.y - span.x + 1, 0));
    }
    return count;
}

void main() {
    uint i = thread_index();
    if (i >= push.count) return;
    depth_keys[i] = NONE;
    tile_counts[i] = 0;

    View view = views[push.view];
    vec3 mean = plane3(MEAN, i);
    vec3 p = to_camera(view, mean);
    if (!(p.z > NEAR && p.z <= FLOAT_MAX)) return;

    float opacity = sigmoid(plane(OPACITY, i));
    if (LOBES && i >= push.lobe_first) {
        uint j = i - push.lobe_first, s = push.lobe_stride;
        Lobe lobe = eval_lobe(vec3(lobes[j], lobes[s + j], lobes[2 * s + j]), lobes[LOBE_WIDTH * s + j],
                              lobes[LOBE_SHARPNESS * s + j], normalize(view.eye - mean));
        opacity *= lobe.factor;
    }
    if (!(opacity >= ALPHA_MIN)) return;

    vec4 q = vec4(plane(QUAT, i), plane3(QUAT + 1, i));
    if (!(to_unit(q) > 0.0)) return;
    Projection e = project_covariance(view, p, q, exp(plane3(LOG_SCALE, i)));
    if (!(e.det <= FLOAT_MAX)) return;
    if (COMPENSATE) {
        opacity *= sqrt(e.det0 / e.det);
        if (!(opacity >= ALPHA_MIN)) return;
    }

    precise Splat s; // emit, which reads it from memory, must see what is counted here
    float a = e.a + DILATION, c = e.c + DILATION;
    s.l22 = inversesqrt(c);
    s.l11 = sqrt(c / e.det);
    s.l12 = -e.b * s.l22 * inversesqrt(e.det);
    s.x = view.fx * p.x * e.inv_z + view.cx;
    s.y = view.fy * p.y * e.inv_z + view.cy;
    s.opacity = opacity;
    s.z = p.z;
    uint tiles = count_tiles(s, view);
    if (tiles == 0) return;

    float basis[16];
    sh_basis(normalize(mean - view.eye), push.active_degree, basis);
    vec3 colour = vec3(0.5);
    for (uint k = 0; k < (push.active_degree + 1) * (push.active_degree + 1); ++k) colour += basis[k] * sh_at(k, i);
    vec3 size = abs(colour);
    if (!(size.r <= FLOAT_MAX && size.g <= FLOAT_MAX && size.b <= FLOAT_MAX)) return;
    colour = max(colour, vec3(0.0));
    s.r = colour.r;
    s.g = colour.g;
    s.b = colour.b;

    splats[i] = s;
    depth_keys[i] = floatBitsToUint(p.z);
    tile_counts[i] = tiles;
}
