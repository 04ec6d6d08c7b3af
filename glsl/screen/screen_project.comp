#version 460
// Makes splats from the 2D Gaussians of a batch of views, and takes their depths from the views' depth maps.
//
// One thread takes one slot.
// screen_planes, screen_frames, screen_states, frames, depths -> screen_planes (depth), splats, depth_keys, tile_counts (by slot)
// Method, section 3: covariance S + 0.3 I, opacity compensated. A Gaussian without a depth lies behind all
// that have one.
// Limits: a slot is skipped if it is empty, its view waits, opacity < 1/255, no pixel centre is reached, or
// any value is NaN.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/frame.glsl"
#include "../shared/splat.glsl"
#include "../shared/screen.glsl"

layout(constant_id = 1) const uint TILE_WIDTH = 8;
layout(constant_id = 2) const uint TILE_HEIGHT = 8;

layout(push_constant, scalar) uniform Push {
    uint count;  // slots
    uint stride; // of the planes
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 1, scalar) readonly buffer ScreenFrames { uint screen_frames[]; };
layout(set = 0, binding = 2, scalar) readonly buffer ScreenStates { ScreenState screen_states[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Depths { float depths[]; };
layout(set = 0, binding = 4, scalar) buffer ScreenPlanes { float screen_planes[]; };
layout(set = 0, binding = 5, scalar) writeonly buffer Splats { Splat splats[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer SplatColors { vec3 splat_colors[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer DepthKeys { uint depth_keys[]; };
layout(set = 0, binding = 8, scalar) writeonly buffer TileCounts { uint tile_counts[]; };

const uint FARTHEST = 0x7F800000u; // bits of +infinity

float at(uint p, uint i) { return screen_planes[p * push.stride + i]; }

void main() {
    uint i = thread_index();
    if (i >= push.count) return;
    depth_keys[i] = NONE;
    tile_counts[i] = 0;
    uint f = screen_frames[i];
    if (f == NONE || screen_states[f].mode == WAITING) return;

    Frame frame = frames[f];
    vec2 centre = vec2(at(CENTRE, i), at(CENTRE + 1, i));
    // Steps keep centres in the image; a NaN centre has no pixel.
    // guard: 2D: centres in the image
    if (!(centre.x >= 0.0 && centre.y >= 0.0 && centre.x <= float(frame.width) && centre.y <= float(frame.height))) return;
    uvec2 pixel = uvec2(clamp(centre, vec2(0.0), vec2(frame.width, frame.height) - 0.5));
    float z = depths[frame.image_first + pixel.y * frame.width + pixel.x];
    if (!(z > 0.0)) z = 0.0; // guard: 2D: depths that are none
    screen_planes[DEPTH * push.stride + i] = z;

    ScreenShape e = screen_shape(vec2(at(LOG_SCALE, i), at(LOG_SCALE + 1, i)), at(ANGLE, i));
    precise Splat s; // precise: emit reads it from memory and must see the value counted here
    s.centre = centre;
    s.shape = vec4(e.l11, e.l12, e.l22, e.compensation / (1.0 + exp(-at(LOGIT, i))));
    if (!(s.shape.w >= ALPHA_MIN)) return;
    uint tiles = tile_count(s, uvec2(TILE_WIDTH, TILE_HEIGHT), uvec2(frame.width, frame.height));
    if (tiles == 0) return;
    vec3 color = vec3(at(COLOR, i), at(COLOR + 1, i), at(COLOR + 2, i));
    float sum = color.r + color.g + color.b;
    if (isnan(sum) || isinf(sum)) return; // guard: 2D: colors
    splats[i] = s;
    splat_colors[i] = color;
    depth_keys[i] = z > 0.0 ? floatBitsToUint(z) : FARTHEST;
    tile_counts[i] = tiles;
}
