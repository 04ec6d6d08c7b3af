#version 460
// Depth of each pixel from the Gaussian of median transmittance.
//
// One thread takes one pixel. A dispatch takes the pixels whose Gaussian is in one page; that of the first
// page also takes those without.
// median_ids, population, geometry, views -> depths (camera z; 0 if none)
// Method, section 4: z of the point of maximum response along the pixel's ray, in the Gaussian's own frame:
// z = -(o.d)/(d.d) with o = S^-1 R^T (eye - mean), d = S^-1 R^T ray. Both are multiplied by the smallest
// scale, so that thin Gaussians cause no overflow. If a model is scaled in the world, the ray is in the
// model's units and the view's rows contain the scale once more, so its point is at camera z scale^2 times z.
// Limits: if the point is not in front of the near plane, falls back to the centre's z.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/population.glsl"
#include "../shared/view.glsl"
#include "../shared/unit.glsl"

layout(constant_id = 1) const bool CENTRE = false; // take the z of the Gaussian's centre instead

layout(push_constant, scalar) uniform Push {
    uint segment;
    uint page_first;  // number in the segment of the page's first Gaussian
    uint stride;      // the page's capacity
    uint view;
    uint depth_first; // first index of this view's depths
    uint splat_first; // Gaussian index of the model's first Gaussian
    float scale;      // of the model in the world
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Population { uint segment_first[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Views { View views[]; };
#define GEOMETRY 2
#define MODEL_LOADS
#define HALVES
#include "../shared/model.glsl"
layout(set = 0, binding = 3, scalar) readonly buffer MedianIds { uint median_ids[]; };
layout(set = 0, binding = 4, scalar) writeonly buffer Depths { float depths[]; };

// Rotates by the conjugate of the unit quaternion (w, xyz).
vec3 unrotate(vec4 q, vec3 v) {
    vec3 t = 2.0 * cross(v, q.yzw);
    return v + q.x * t + cross(t, q.yzw);
}

void main() {
    View view = views[push.view];
    uint pixel = thread_index();
    if (pixel >= view.width * view.height) return;
    uint i = median_ids[pixel];
    if (i == NONE) {
        if (push.segment == 0 && push.page_first == 0 && push.splat_first == 0) depths[push.depth_first + pixel] = 0.0;
        return;
    }
    uint first = push.splat_first + segment_first[push.segment] + push.page_first, place = i - first;
    if (!(i >= first && place < push.stride && i < push.splat_first + segment_first[push.segment + 1])) return;
    vec3 mean = load_geometry3(MEAN, place);
    float z = to_camera(view, mean).z;
    if (!CENTRE) {
        vec2 px = vec2(pixel % view.width, pixel / view.width) + 0.5;
        vec2 slope = (px - vec2(view.cx, view.cy)) / vec2(view.fx, view.fy);
        vec3 ray = slope.x * view.row_x.xyz + slope.y * view.row_y.xyz + view.row_z.xyz;
        vec4 q;
        vec3 log_scale;
        load_form(place, q, log_scale);
        // guard: flat Gaussians' depth
        vec3 inverse = exp(min(log_scale.x, min(log_scale.y, log_scale.z)) - log_scale);
        to_unit(q); // a median Gaussian has a rotation, since it was projected
        vec3 o = inverse * unrotate(q, view.eye - mean), d = inverse * unrotate(q, ray);
        float best = -dot(o, d) / dot(d, d) * (push.scale * push.scale); // guard: depth of a scaled model
        if (best > view.near && best <= FLOAT_MAX) z = best; // guard: depth before the near plane
    }
    depths[push.depth_first + pixel] = z;
}
