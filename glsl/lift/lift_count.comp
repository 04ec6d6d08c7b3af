#version 460
// Counts the pixels with a depth that each 2D Gaussian covers (method, section 4.1).
//
// One subgroup takes one 2D Gaussian; its lanes go through the pixels of the bounding box. Subgroups are
// independent.
// screen_planes, screen_frames, views, depths -> point_counts (0 for an empty slot).
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/view.glsl"
#include "../shared/footprint.glsl"
#include "../shared/screen.glsl"

layout(set = 0, binding = 0, scalar) readonly buffer ScreenPlanes { float screen_planes[]; };
layout(set = 0, binding = 1, scalar) readonly buffer ScreenFrames { uint screen_frames[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Views { View views[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Depths { float depths[]; };
layout(set = 0, binding = 4, scalar) writeonly buffer PointCounts { uint point_counts[]; };

layout(push_constant, scalar) uniform Push {
    uint count;      // 2D Gaussians, including empty slots
    uint stride;     // of the planes
    uint view_count;
} push;

float at(uint p, uint i) { return screen_planes[p * push.stride + i]; }

void main() {
    uint item = subgroup_index();
    if (item >= push.count) return;
    uint covered = 0;
    uint v = screen_frames[item];
    if (v < push.view_count) {
        View view = views[v];
        Footprint f = make_footprint(vec2(at(CENTRE, item), at(CENTRE + 1, item)), at(LOGIT, item),
            vec2(at(LOG_SCALE, item), at(LOG_SCALE + 1, item)), at(ANGLE, item),
            uvec2(view.width, view.height), false);
        uint pixels = f.size.x * f.size.y;
        for (uint k = gl_SubgroupInvocationID; k < pixels; k += gl_SubgroupSize) {
            uvec2 pixel = f.low + uvec2(k % f.size.x, k / f.size.x);
            if (footprint_weight(f, pixel) > 0.0 && is_depth(depths[view.pixel_first + pixel.y * view.width + pixel.x])) {
                covered += 1;
            }
        }
    }
    covered = subgroupAdd(covered);
    if (subgroupElect()) point_counts[item] = covered;
}
