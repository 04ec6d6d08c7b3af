#version 460
// Turns the chosen candidates into Gaussians, largest gain first: those with a lobe for the supplement, the
// others for the base.
//
// One thread takes one rank. order (candidates by falling gain; kept[kept_index] entries), candidates, fits,
// gain_keys -> lifts and flags of each kind, 0 if the rank is not used. Stops at `most` Gaussians, at gains
// below `least_gain`, and if the price of earlier ranks (spent, by rank) plus the candidate's own exceeds
// `budget`.
// candidate's own price are more than `budget`.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/pursuit.glsl"
#include "../shared/lift.glsl"
#include "../shared/saturate.glsl"

layout(push_constant, scalar) uniform Push {
    uint count; // ranks
    uint most;  // maximum number of Gaussians
    uint budget; // NONE: no limit
    uint kept_index;
    float least_gain;
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Kept { uint kept[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Order { uint order[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Candidates { Candidate candidates[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Fits { Fit fits[]; };
layout(set = 0, binding = 4, scalar) readonly buffer GainKeys { uint gain_keys[]; };
layout(set = 0, binding = 5, scalar) writeonly buffer Lifts { Lift lifts[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer LiftFlags { uint lift_flags[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer PlainFlags { uint plain_flags[]; };
layout(set = 0, binding = 8, scalar) readonly buffer Prices { uint prices[]; };
layout(set = 0, binding = 9, scalar) readonly buffer Spent { uint spent[]; };

void main() {
    uint rank = thread_index();
    if (rank >= push.count) return;
    bool some = rank < min(push.most, kept[push.kept_index]);
    Lift lift = Lift(vec3(0.0), vec3(0.0), vec4(0.0), vec3(0.0), 0.0, vec3(0.0), 0.0, 0.0, 0u);
    if (some) {
        uint i = order[rank];
        Candidate c = candidates[i];
        Fit fit = fits[i];
        some = uintBitsToFloat(~gain_keys[i]) >= push.least_gain;
        if (push.budget != NONE) some = some && saturating_add(spent[rank], prices[i]) <= push.budget;
        if (some) {
            lift = Lift(c.mean, vec3(log(fit.sigma)), vec4(1.0, 0.0, 0.0, 0.0), (fit.color - 0.5) / SH_C0,
                        log(fit.opacity / (1.0 - fit.opacity)), c.toward, fit.width, c.theta_bar, 1u);
        }
    }
    lifts[rank] = lift;
    lift_flags[rank] = uint(some && lift.lobe_width > 0.0);
    plain_flags[rank] = uint(some && !(lift.lobe_width > 0.0));
}
