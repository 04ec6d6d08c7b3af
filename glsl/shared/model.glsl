// Memory layout of the parameters of a Gaussian: the one owner of planes, loads, stores and precision of
// geometry, SH and lobes, and of the moments and gradients that share their planes. The host takes the
// numbers from here, see `scene::layout`.
//
// A segment (base or supplement) lies in pages, each with its own buffers. Four planes are interleaved, so
// that a thread reads and writes 16 bytes at once: plane p of the Gaussian at `place` of a page is component
// p % 4 of quad (p / 4) * stride + place. The stride is the page's capacity. SH coefficient k of channel c is
// plane 3k + c of `sh`, so four coefficients are three quads.
//
// A kernel declares `push.stride`, defines the binding of each array it uses (GEOMETRY, SH, LOBES,
// GEOMETRY_MOMENTS, SH_MOMENTS, LOBE_MOMENTS) and MODEL_LOADS, MODEL_STORES or both, then includes this file.
// A kernel that renders also defines HALVES, and has no stores.
//
// With half width, for rendering only, geometry has two quads. The first is unchanged: mean and opacity. The
// second has four words:
// - Word k below 3 has log scale k in its upper bits, signed, in units of LOG_SCALE_STEP. Its lower bits are
//   the upper ROTATION_LOW_BITS of part k of the rotation.
// - The last word has the lower bits of the three parts, the first part lowest. The two bits above say which
//   component of the unit quaternion is omitted: the largest, taken to be positive.
// A part is a component in units of ROTATION_STEP, plus ROTATION_ZERO. If projection would cull a Gaussian for
// its rotation or its scales, its packed opacity is NaN (`scene::layout::pack_geometry`).

const uint MEAN = 0;           // 3 planes: x, y, z, scene units from the model's origin
const uint OPACITY = 3;        // logit
const uint QUAT = 4;           // 4 planes: w, x, y, z, of any length
const uint LOG_SCALE = 8;      // 3 planes: natural logarithms of the standard deviations
const uint GEOMETRY_PLANES = 11;
const uint LAST_STEP = 11;     // of the first moments only: number of the last Newton step, from 1
const uint HALF_GEOMETRY_PLANES = 8;          // at half width, see above
const float LOG_SCALE_STEP = 1.52587890625e-5; // 2^-16: 22 bits reach from -32 to 32, with an error of 8e-6 of a scale
const uint ROTATION_LOW_BITS = 10;            // of a part's 20 bits
const uint ROTATION_ZERO = 524288;            // 2^19
const float ROTATION_STEP = 1.3487017e-6;     // sqrt(1/2) / (2^19 - 1): only the largest component can exceed sqrt(1/2)
const uint LOBE_DIRECTION = 0; // 3 planes, of any length
const uint LOBE_WIDTH = 3;     // T, 0.01 to 1
const uint LOBE_SHARPNESS = 4; // beta
const uint LOBE_PLANES = 5;

uint quad_of(uint p, uint place) { return p / 4 * push.stride + place; }

#if defined(MODEL_LOADS) && defined(MODEL_STORES)
#define MODEL_ACCESS
#elif defined(MODEL_LOADS)
#define MODEL_ACCESS readonly
#else
#define MODEL_ACCESS writeonly
#endif

#ifdef MODEL_LOADS
#ifdef HALVES
layout(constant_id = 11) const bool HALF_WIDTH = false; // geometry as above; the words of plane p of `sh` hold planes 2p and 2p + 1
#else
const bool HALF_WIDTH = false;
#endif
#endif

#ifdef GEOMETRY
layout(set = 0, binding = GEOMETRY, scalar) MODEL_ACCESS buffer Geometry { vec4 geometry[]; };
#ifdef MODEL_LOADS
float load_geometry(uint p, uint place) { return geometry[quad_of(p, place)][p % 4]; }
// Means or log scales.
vec3 load_geometry3(uint p, uint place) { return geometry[quad_of(p, place)].xyz; }
vec4 load_quat(uint place) { return geometry[quad_of(QUAT, place)]; }
#ifdef HALVES
// Rotation and log scales at either width; half width takes one access.
void load_form(uint place, out vec4 quat, out vec3 log_scale) {
    if (!HALF_WIDTH) {
        quat = load_quat(place);
        log_scale = load_geometry3(LOG_SCALE, place);
        return;
    }
    uvec4 words = floatBitsToUint(geometry[quad_of(QUAT, place)]);
    log_scale = LOG_SCALE_STEP * vec3(ivec3(words.xyz) >> ROTATION_LOW_BITS);
    const uint LOW = (1u << ROTATION_LOW_BITS) - 1;
    uvec3 low = words.www >> uvec3(0, ROTATION_LOW_BITS, 2 * ROTATION_LOW_BITS) & LOW;
    vec3 parts = ROTATION_STEP * vec3(ivec3((words.xyz & LOW) << ROTATION_LOW_BITS | low) - int(ROTATION_ZERO));
    float largest = sqrt(max(1.0 - dot(parts, parts), 0.0));
    uint missing = words.w >> 3 * ROTATION_LOW_BITS;
    quat = missing < 2 ? missing == 0 ? vec4(largest, parts) : vec4(parts.x, largest, parts.yz)
                       : missing == 2 ? vec4(parts.xy, largest, parts.z) : vec4(parts, largest);
}
#endif
#endif
#ifdef MODEL_STORES
void store_geometry(uint p, uint place, float value) { geometry[quad_of(p, place)][p % 4] = value; }
void store_geometry3(uint p, uint place, vec3 value) { geometry[quad_of(p, place)].xyz = value; }
void store_quat(uint place, vec4 value) { geometry[quad_of(QUAT, place)] = value; }
#endif
#endif

#ifdef SH
layout(set = 0, binding = SH, scalar) MODEL_ACCESS buffer Sh { vec4 sh[]; };
#ifdef MODEL_LOADS
// Planes 12g to 12g + 11 (coefficients 4g to 4g + 3); planes from `planes` on are 0.
void load_sh12(uint g, uint planes, uint place, out vec4 quads[3]) {
    [[unroll]] for (uint q = 0; q < 3; ++q) {
        uint p = 12 * g + 4 * q;
        quads[q] = vec4(0.0);
        if (p >= planes) continue;
        if (!HALF_WIDTH) {
            quads[q] = sh[quad_of(p, place)];
            continue;
        }
        vec4 words = sh[quad_of(p / 2, place)];
        uvec2 two = floatBitsToUint(p / 2 % 4 == 0 ? words.xy : words.zw);
        quads[q] = vec4(unpackHalf2x16(two.x), unpackHalf2x16(two.y));
    }
}
#endif
#ifdef MODEL_STORES
void store_sh(uint p, uint place, float value) { sh[quad_of(p, place)][p % 4] = value; }
#endif
#endif
// Coefficient j of the four that three quads hold.
vec3 coefficient_of(vec4 quads[3], uint j) {
    uint n = 3 * j;
    return vec3(quads[n / 4][n % 4], quads[(n + 1) / 4][(n + 1) % 4], quads[(n + 2) / 4][(n + 2) % 4]);
}
void set_coefficient(inout vec4 quads[3], uint j, vec3 value) {
    [[unroll]] for (uint c = 0; c < 3; ++c) quads[(3 * j + c) / 4][(3 * j + c) % 4] = value[c];
}

#ifdef LOBES
layout(set = 0, binding = LOBES, scalar) MODEL_ACCESS buffer Lobes { vec4 lobes[]; };
#ifdef MODEL_LOADS
float load_lobe(uint p, uint place) { return lobes[quad_of(p, place)][p % 4]; }
vec3 load_lobe_direction(uint place) { return lobes[quad_of(LOBE_DIRECTION, place)].xyz; }
#endif
#ifdef MODEL_STORES
void store_lobe(uint p, uint place, float value) { lobes[quad_of(p, place)][p % 4] = value; }
void store_lobe_direction(uint place, vec3 value) { lobes[quad_of(LOBE_DIRECTION, place)].xyz = value; }
#endif
#endif

// The first moments of quad q are quad 2q and the second ones quad 2q + 1, or both are quad q if packed in
// one word. Gradients that wait for a step are quad q. The harmonics have more planes, see adam.glsl.
#ifdef GEOMETRY_MOMENTS
layout(set = 0, binding = GEOMETRY_MOMENTS, scalar) buffer GeometryMoments { vec4 geometry_moments[]; };
layout(set = 0, binding = SH_MOMENTS, scalar) buffer ShMoments { vec4 sh_moments[]; };
layout(set = 0, binding = LOBE_MOMENTS, scalar) buffer LobeMoments { vec4 lobe_moments[]; };
#endif
#ifdef GEOMETRY_GRADS
layout(set = 0, binding = GEOMETRY_GRADS, scalar) readonly buffer GeometryGrads { vec4 geometry_grads[]; };
layout(set = 0, binding = SH_GRADS, scalar) readonly buffer ShGrads { vec4 sh_grads[]; };
layout(set = 0, binding = LOBE_GRADS, scalar) readonly buffer LobeGrads { vec4 lobe_grads[]; };
#endif
