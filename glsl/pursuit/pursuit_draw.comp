#version 460
// Draws pixels of all views in proportion to their squared error, by stratified sampling, and places a
// candidate on the base's surface at each.
//
// The total is cut into `count` equal parts, with one draw from each. One thread makes one candidate if its
// block is in this page, and leaves the others unchanged. quanta, their prefix sum quanta_firsts and its
// total, error_sums, errors, surface_depths -> candidates. A part smaller than a quantum and a block whose
// errors are 0 give no candidate. Two draws of one pixel are neighbours; pursuit_fit drops the second.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/pursuit.glsl"

layout(push_constant, scalar) uniform Push {
    uint count;
    uint seed;
    uint view_first, view_end; // of the page
    uint view_count;           // of all
    uint block_first, block_end;
    uint total_index; // of quanta_total
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Views { View views[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Plots { Plot plots[]; };
layout(set = 0, binding = 2, scalar) readonly buffer QuantaTotal { uint quanta_total[]; };
layout(set = 0, binding = 3, scalar) readonly buffer QuantaFirsts { uint quanta_firsts[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Quanta { uint quanta[]; };
layout(set = 0, binding = 5, scalar) readonly buffer ErrorSums { float error_sums[]; };
layout(set = 0, binding = 6, scalar) readonly buffer Errors { float errors[]; };
layout(set = 0, binding = 7, scalar) readonly buffer SurfaceDepths { float surface_depths[]; };
layout(set = 0, binding = 8, scalar) writeonly buffer Candidates { Candidate candidates[]; };

// pcg2d (Jarzynski and Olano, "Hash functions for GPU rendering", 2020), the second word.
uint hash(uvec2 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * 1664525u;
    v.y += v.x * 1664525u;
    v ^= v >> 16;
    v.x += v.y * 1664525u;
    v.y += v.x * 1664525u;
    return v.y ^ v.y >> 16;
}

void main() {
    uint i = thread_index();
    if (i >= push.count) return;
    uint total = quanta_total[push.total_index], each = total / push.count, rest = total % push.count;
    uint length_of_part = each + uint(i < rest);
    if (length_of_part == 0) return;
    uint quantum = i * each + min(i, rest) + hash(uvec2(i, push.seed)) % length_of_part;

    // The last block that begins at or before the quantum.
    if (push.block_first >= push.block_end || quantum < quanta_firsts[push.block_first]) return;
    uint low = push.block_first, high = push.block_end;
    while (high - low > 1) {
        uint middle = (low + high) / 2;
        if (quanta_firsts[middle] <= quantum) low = middle;
        else high = middle;
    }
    uint into = quantum - quanta_firsts[low];
    if (into >= quanta[low]) return; // in a later page
    uint v = push.view_first, v_end = push.view_end;
    while (v_end - v > 1) {
        uint middle = (v + v_end) / 2;
        if (plots[middle].block_first <= low) v = middle;
        else v_end = middle;
    }
    View view = views[v];
    Plot plot = plots[v];
    uint first = (low - plot.block_first) * ERROR_BLOCK, last = min(first + ERROR_BLOCK, view.width * view.height);
    // The pixel at which the running sum of errors passes the same share of the block's sum.
    float wanted = (float(into) + 0.5) / float(quanta[low]) * error_sums[low], sum = 0.0;
    uint pixel = NONE;
    for (uint p = first; p < last && !(sum > wanted); ++p) {
        float error = errors[plot.pixel_first + p];
        if (!(error > 0.0)) continue;
        sum += error;
        pixel = p;
    }
    if (pixel == NONE) return;

    Candidate c;
    float z = surface_depths[plot.pixel_first + pixel];
    vec2 slope = (vec2(pixel % view.width, pixel / view.width) + 0.5 - vec2(view.cx, view.cy)) / vec2(view.fx, view.fy);
    vec3 ray = slope.x * view.row_x.xyz + slope.y * view.row_y.xyz + view.row_z.xyz;
    c.mean = view.eye + z * ray;
    c.toward = -normalize(ray);
    c.px = z / view.fx;
    float nearest = 4.0; // above pi
    for (uint u = 0; u < push.view_count; ++u) {
        vec3 at;
        if (u == v || !project_point(views[u], c.mean, at)) continue;
        nearest = min(nearest, angle_between(c.toward, views[u].eye - c.mean));
    }
    c.theta_bar = nearest < 4.0 ? nearest : 0.5 * PI;
    c.view = v;
    c.pixel = pixel;
    if (max(abs(c.mean.x), max(abs(c.mean.y), abs(c.mean.z))) <= FLOAT_MAX) candidates[i] = c;
}
