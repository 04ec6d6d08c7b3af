// A splat and its color in 28 bytes, for rendering without gradients. Include shared/splat.glsl first.
//
// Conic factor and centre stay float32: the effect of an error in them grows with the splat. Colors are half
// floats. The opacity is in units of ALPHA_MIN / 256, so that rounding takes none below ALPHA_MIN: the error
// is at most 8e-6.
struct PackedSplat {
    uvec4 first; // bits of l11, l12, l22 and the centre's x
    uvec3 rest;  // bits of the centre's y; opacity, and above it red; green, and above it blue
};

const float OPACITY_STEP = 1.53186275e-5; // 1 / 65280, which is ALPHA_MIN / 256
const float MOST_HALF = 65504.0;          // largest half float

// The packed opacity, and its value. `precise`: projection counts tiles by this value, and emit reads it from
// memory.
uint opacity_word(float opacity) { return uint(min(opacity / OPACITY_STEP + 0.5, 65535.0)); }
float opacity_of(uint word) {
    precise float opacity = float(word & 0xffffu) * OPACITY_STEP;
    return opacity;
}

PackedSplat pack_splat(Splat s, vec3 color) {
    // Rounded to nearest here: Vulkan leaves the rounding of packing open, except for values that a half can
    // represent.
    vec3 c = uintBitsToFloat((floatBitsToUint(min(color, vec3(MOST_HALF))) + 0x1000u) & ~0x1fffu);
    return PackedSplat(uvec4(floatBitsToUint(s.shape.xyz), floatBitsToUint(s.centre.x)),
                       uvec3(floatBitsToUint(s.centre.y), packHalf2x16(vec2(0.0, c.r)) | opacity_word(s.shape.w), packHalf2x16(c.gb)));
}

Splat unpack_splat(PackedSplat p) {
    return Splat(vec4(uintBitsToFloat(p.first.xyz), opacity_of(p.rest.y)), vec2(uintBitsToFloat(p.first.w), uintBitsToFloat(p.rest.x)));
}

vec3 unpack_color(PackedSplat p) { return vec3(unpackHalf2x16(p.rest.y).y, unpackHalf2x16(p.rest.z)); }
