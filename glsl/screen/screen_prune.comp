#version 460
// Empties the slots of 2D Gaussians that are nearly transparent or cover too few pixels.
//
// One subgroup takes one slot; its lanes go through the pixels of the bounding box. Subgroups are
// independent.
// screen_planes, screen_frames, screen_states, frames -> screen_frames
// Method, section 3. A pixel is covered if alpha >= 1/255, regardless of Gaussians in front.
// Limits: slots of waiting views are unchanged; a Gaussian with NaN is pruned. Nothing changes once status
// says that a step did not fit.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/frame.glsl"
#include "../shared/status.glsl"
#include "../shared/footprint.glsl"
#include "../shared/screen.glsl"

layout(push_constant, scalar) uniform Push {
    uint count;  // slots
    uint stride; // of the planes
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Status { uint status[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 2, scalar) readonly buffer ScreenStates { ScreenState screen_states[]; };
layout(set = 0, binding = 3, scalar) readonly buffer ScreenPlanes { float screen_planes[]; };
layout(set = 0, binding = 4, scalar) buffer ScreenFrames { uint screen_frames[]; };

const float OPACITY_MIN = 0.005;

// The method's 25 pixels hold for images of 546 rows and more, the smallest of its data sets (Tanks and
// Temples). In smaller images new Gaussians start in proportion to the image (0.005 of its shorter side), and
// the number of pixels they must cover shrinks accordingly. Its minimum of 4 leaves inverse splatting one
// more than the 3 points it needs.
const float PAPER_SIDE = 546.0;
uint covered_min(Frame frame) {
    float side = float(min(frame.width, frame.height)) / PAPER_SIDE;
    return uint(clamp(ceil(25.0 * side * side), 4.0, 25.0));
}

float at(uint p, uint i) { return screen_planes[p * push.stride + i]; }

void main() {
    uint i = subgroup_index();
    if (i >= push.count) return;
    if (status[STATUS_FAILED] != 0) return; // guard: no pruning after an overflow
    uint f = screen_frames[i];
    if (f == NONE || screen_states[f].mode == WAITING) return;

    Frame frame = frames[f];
    float logit = at(LOGIT, i);
    Footprint e = make_footprint(vec2(at(CENTRE, i), at(CENTRE + 1, i)), logit,
                                 vec2(at(LOG_SCALE, i), at(LOG_SCALE + 1, i)), at(ANGLE, i),
                                 uvec2(frame.width, frame.height), true);
    uint pixels = e.size.x * e.size.y, covered = 0, enough = covered_min(frame);
    // Stop at `enough`: most Gaussians that stay have their pixels within the first rows.
    for (uint first = 0; first < pixels && covered < enough; first += gl_SubgroupSize) {
        uint k = first + gl_SubgroupInvocationID;
        bool hit = k < pixels && footprint_weight(e, e.low + uvec2(k % e.size.x, k / e.size.x)) > 0.0;
        covered += subgroupBallotBitCount(subgroupBallot(hit));
    }
    bool keep = 1.0 / (1.0 + exp(-logit)) >= OPACITY_MIN && covered >= enough;
    if (!keep && subgroupElect()) screen_frames[i] = NONE;
}
