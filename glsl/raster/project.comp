#version 460
// Projects Gaussians into one view: culls them and writes splats, depth keys and tile counts.
//
// One thread takes one Gaussian of a page.
// population, geometry, sh, lobes (by place), views -> splats, splat_colors or packed_splats, depth_keys, tile_counts (by Gaussian index)
// EWA splatting (Zwicker 2001) as in 3DGS (Kerbl 2023); opacity lobe of AuGS (2026), section 1 of the method.
// Limits: culled if camera z is not beyond the view's near plane, opacity < 1/255, no pixel centre is
// reached, or any value is NaN.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/population.glsl"
#include "../shared/view.glsl"
#include "../shared/splat.glsl"
#include "../shared/packed_splat.glsl"

layout(constant_id = 1) const uint TILE_WIDTH = 8;
layout(constant_id = 2) const uint TILE_HEIGHT = 8;
layout(constant_id = 3) const bool COMPENSATE = false; // opacity *= sqrt(det0 / det), as in Mip-Splatting
layout(constant_id = 4) const bool HAS_LOBES = false;  // the segment is the supplement
layout(constant_id = 12) const bool PACKED_SPLATS = false;

layout(push_constant, scalar) uniform Push {
    uint segment;
    uint page_first; // number in the segment of the page's first Gaussian
    uint stride;     // the page's capacity
    uint view;       // index in views
    uint splat_first; // Gaussian index of the model's first Gaussian: several models can share one order
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Population { uint segment_first[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Views { View views[]; };
#define GEOMETRY 2
#define SH 3
#define LOBES 4
#define MODEL_LOADS
#define HALVES
#include "../shared/model.glsl"
layout(set = 0, binding = 5, scalar) writeonly buffer Splats { Splat splats[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer SplatColors { vec3 splat_colors[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer DepthKeys { uint depth_keys[]; };
layout(set = 0, binding = 8, scalar) writeonly buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 9, scalar) writeonly buffer PackedSplats { PackedSplat packed_splats[]; };

#include "../shared/gaussian.glsl"
#include "../shared/color.glsl"

void main() {
    View view = views[push.view]; // the same for all threads: read before they diverge, so that a CPU reads it once
    uint place = thread_index();
    uint i = segment_first[push.segment] + push.page_first + place; // Gaussian index in the model
    if (place >= push.stride || i >= segment_first[push.segment + 1]) return;
    i += push.splat_first;
    depth_keys[i] = NONE;
    tile_counts[i] = 0;

    vec3 mean = load_geometry3(MEAN, place);
    vec3 p = to_camera(view, mean);
    if (!(p.z > view.near && p.z <= FLOAT_MAX)) return; // guard: near plane; camera z within float32

    float logit = load_geometry(OPACITY, place), opacity = sigmoid(logit);
    if (HAS_LOBES) {
        Lobe lobe = eval_lobe(load_lobe_direction(place), load_lobe(LOBE_WIDTH, place), load_lobe(LOBE_SHARPNESS, place),
                              normalize(view.eye - mean));
        opacity *= lobe.factor;
    }
    // exp(NaN) may be a number, so test the logit itself, and the log scale below.
    if (!(opacity >= ALPHA_MIN && logit >= -FLOAT_MAX)) return;

    vec4 q;
    vec3 log_scale;
    load_form(place, q, log_scale);
    if (!(to_unit(q) > 0.0)) return; // guard: rotation without a direction
    Projection e = project_covariance(view, p, q, exp(log_scale));
    if (!(e.det <= FLOAT_MAX && all(lessThanEqual(log_scale, vec3(FLOAT_MAX))))) return; // guard: determinant within float32
    if (COMPENSATE) {
        opacity *= sqrt(e.det0 / e.det);
        if (!(opacity >= ALPHA_MIN)) return;
    }

    precise Splat s; // precise: emit reads it from memory and must see the value counted here
    float a = e.a + DILATION, c = e.c + DILATION;
    s.shape.z = inversesqrt(c);
    s.shape.x = sqrt(c / e.det);
    s.shape.y = -e.b * s.shape.z * inversesqrt(e.det);
    s.shape.w = PACKED_SPLATS ? opacity_of(opacity_word(opacity)) : opacity;
    s.centre = vec2(view.fx, view.fy) * p.xy * e.inv_z + vec2(view.cx, view.cy);
    uint tiles = tile_count(s, uvec2(TILE_WIDTH, TILE_HEIGHT), uvec2(view.width, view.height));
    if (tiles == 0) return;

    vec3 color = color_of(color_at(normalize(mean - view.eye), place), place);
    vec3 size = abs(color);
    if (!(size.r <= FLOAT_MAX && size.g <= FLOAT_MAX && size.b <= FLOAT_MAX)) return; // guard: color within float32

    if (PACKED_SPLATS) {
        packed_splats[i] = pack_splat(s, max(color, vec3(0.0)));
    } else {
        splats[i] = s;
        splat_colors[i] = max(color, vec3(0.0));
    }
    depth_keys[i] = floatBitsToUint(p.z);
    tile_counts[i] = tiles;
}
