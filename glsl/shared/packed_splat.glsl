// A splat and its colour in 28 bytes, where nothing learns from them. Include shared/splat.glsl before.
//
// Factor of the conic and centre keep their bits: what an error of theirs does grows with the splat. Colours are half floats. The opacity is
// a number of units of which ALPHA_MIN is 256, so that rounding takes none below it: off by 8e-6 at most.
struct PackedSplat {
    uvec4 first; // bits of l11, l12, l22 and the centre's x
    uvec3 rest;  // bits of the centre's y; opacity, and above it red; green, and above it blue
};

const float OPACITY_STEP = 1.53186275e-5; // 1 / 65280, which is ALPHA_MIN / 256
const float MOST_HALF = 65504.0;          // the largest that a half holds

// The opacity as it is packed, and what that stands for. `precise`: projection counts tiles by it, as emit reads it from memory.
uint opacity_word(float opacity) { return uint(min(opacity / OPACITY_STEP + 0.5, 65535.0)); }
float opacity_of(uint word) {
    precise float opacity = float(word & 0xffffu) * OPACITY_STEP;
    return opacity;
}

PackedSplat pack_splat(Splat s, vec3 colour) {
    // Rounded here, to the nearest: Vulkan leaves open what packing does, but for what a half can hold.
    vec3 c = uintBitsToFloat((floatBitsToUint(min(colour, vec3(MOST_HALF))) + 0x1000u) & ~0x1fffu);
    return PackedSplat(uvec4(floatBitsToUint(s.shape.xyz), floatBitsToUint(s.centre.x)),
                       uvec3(floatBitsToUint(s.centre.y), packHalf2x16(vec2(0.0, c.r)) | opacity_word(s.shape.w), packHalf2x16(c.gb)));
}

Splat unpack_splat(PackedSplat p) {
    return Splat(vec4(uintBitsToFloat(p.first.xyz), opacity_of(p.rest.y)), vec2(uintBitsToFloat(p.first.w), uintBitsToFloat(p.rest.x)));
}

vec3 unpack_colour(PackedSplat p) { return vec3(unpackHalf2x16(p.rest.y).y, unpackHalf2x16(p.rest.z)); }
