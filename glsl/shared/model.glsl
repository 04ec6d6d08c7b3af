// Where the parameters of a Gaussian lie: the one owner of planes, loads, stores and precision of geometry, SH and lobes, and
// of what goes with them plane by plane (moments, gradients). The host has the numbers from here, see `scene::layout`.
//
// A segment (base or supplement) lies in pages, each with buffers of its own. In a page plane p of the Gaussian at `place` is
// element p * stride + place; the stride is the page's capacity. SH coefficient k of channel c is plane 3k + c of `sh`.
//
// A kernel declares `push.stride`, defines the binding of each array it uses (GEOMETRY, SH, LOBES, GEOMETRY_MOMENTS,
// SH_MOMENTS, LOBE_MOMENTS) and MODEL_LOADS, MODEL_STORES or both, then includes this file.

const uint MEAN = 0;           // 3 planes: x, y, z, scene units from the model's origin
const uint LOG_SCALE = 3;      // 3 planes: natural logarithms of the standard deviations
const uint QUAT = 6;           // 4 planes: w, x, y, z, of any length
const uint OPACITY = 10;       // logit
const uint GEOMETRY_PLANES = 11;
const uint LOBE_DIRECTION = 0; // 3 planes, of any length
const uint LOBE_WIDTH = 3;     // T, 0.01 to 1
const uint LOBE_SHARPNESS = 4; // beta
const uint LOBE_PLANES = 5;

#if defined(MODEL_LOADS) && defined(MODEL_STORES)
#define MODEL_ACCESS
#elif defined(MODEL_LOADS)
#define MODEL_ACCESS readonly
#else
#define MODEL_ACCESS writeonly
#endif

#ifdef GEOMETRY
layout(set = 0, binding = GEOMETRY, scalar) MODEL_ACCESS buffer Geometry { float geometry[]; };
#ifdef MODEL_LOADS
float load_geometry(uint p, uint place) { return geometry[p * push.stride + place]; }
vec3 load_geometry3(uint p, uint place) {
    return vec3(load_geometry(p, place), load_geometry(p + 1, place), load_geometry(p + 2, place));
}
vec4 load_quat(uint place) { return vec4(load_geometry(QUAT, place), load_geometry3(QUAT + 1, place)); }
#endif
#ifdef MODEL_STORES
void store_geometry(uint p, uint place, float value) { geometry[p * push.stride + place] = value; }
void store_geometry3(uint p, uint place, vec3 value) {
    for (uint c = 0; c < 3; ++c) store_geometry(p + c, place, value[c]);
}
void store_quat(uint place, vec4 value) {
    for (uint c = 0; c < 4; ++c) store_geometry(QUAT + c, place, value[c]);
}
#endif
#endif

#ifdef SH
layout(set = 0, binding = SH, scalar) MODEL_ACCESS buffer Sh { float sh[]; };
#ifdef MODEL_LOADS
#ifdef SH_HALVES
layout(constant_id = 11) const bool HALF_SH = false; // for rendering alone: planes 2p and 2p + 1 are the halves of the words of plane p
float load_sh(uint p, uint place) {
    if (!HALF_SH) return sh[p * push.stride + place];
    vec2 pair = unpackHalf2x16(floatBitsToUint(sh[(p >> 1) * push.stride + place]));
    return (p & 1u) == 0 ? pair.x : pair.y;
}
#else
float load_sh(uint p, uint place) { return sh[p * push.stride + place]; }
#endif
vec3 load_sh3(uint k, uint place) {
    return vec3(load_sh(3 * k, place), load_sh(3 * k + 1, place), load_sh(3 * k + 2, place));
}
#endif
#ifdef MODEL_STORES
void store_sh(uint p, uint place, float value) { sh[p * push.stride + place] = value; }
#endif
#endif

#ifdef LOBES
layout(set = 0, binding = LOBES, scalar) MODEL_ACCESS buffer Lobes { float lobes[]; };
#ifdef MODEL_LOADS
float load_lobe(uint p, uint place) { return lobes[p * push.stride + place]; }
vec3 load_lobe_direction(uint place) { return vec3(load_lobe(0, place), load_lobe(1, place), load_lobe(2, place)); }
#endif
#ifdef MODEL_STORES
void store_lobe(uint p, uint place, float value) { lobes[p * push.stride + place] = value; }
void store_lobe_direction(uint place, vec3 value) {
    for (uint c = 0; c < 3; ++c) store_lobe(LOBE_DIRECTION + c, place, value[c]);
}
#endif
#endif

// The moments of plane p are planes 2p and 2p + 1, or plane p where both are packed in a word; gradients that wait for a step are plane p.
#ifdef GEOMETRY_MOMENTS
layout(set = 0, binding = GEOMETRY_MOMENTS, scalar) buffer GeometryMoments { float geometry_moments[]; };
layout(set = 0, binding = SH_MOMENTS, scalar) buffer ShMoments { float sh_moments[]; };
layout(set = 0, binding = LOBE_MOMENTS, scalar) buffer LobeMoments { float lobe_moments[]; };
#endif
#ifdef GEOMETRY_GRADS
layout(set = 0, binding = GEOMETRY_GRADS, scalar) buffer GeometryGrads { float geometry_grads[]; };
layout(set = 0, binding = SH_GRADS, scalar) buffer ShGrads { float sh_grads[]; };
layout(set = 0, binding = LOBE_GRADS, scalar) buffer LobeGrads { float lobe_grads[]; };
#endif
