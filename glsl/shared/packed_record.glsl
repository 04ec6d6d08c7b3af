// A gradient record (shared/records.glsl) packed into four words instead of nine.
//
// Words 0 to 2 are centre, shape and color: three numbers of 10 bits each, in units of a power of two
// derived from the largest of the three, so each is exact to a 512th of the largest. Word 3 has the exponents
// of these units, biased like float32's, a byte each: of the centre's first two numbers, of the shape, of the
// color and of the opacity. The opacity is the centre's third number and has its own magnitude.
// Bit 30 of word 0 marks a Gaussian that learns only its opacity, in place of the centre's first number.
// Numbers below 2^-118 become 0; numbers that are not finite stay not finite.
layout(constant_id = 11) const bool PACKED_RECORDS = false; // records of intersections only

const uint OPACITY_MARK = 1u << 30;

// Exponent of the unit of numbers up to the largest of these, by its bits: those of NaN and infinity have the largest exponent.
uint record_unit(vec3 part) {
    uvec3 sizes = floatBitsToUint(part) & 0x7FFFFFFFu;
    uint exponent = max(max(sizes.x, sizes.y), sizes.z) >> 23;
    if (exponent == 255) return 255; // what clamp makes of NaN is undefined
    return exponent > 8 ? exponent - 8 : 0;
}

uint record_code(float x, uint unit) {
    if (unit == 255) return 1; // times an infinite unit
    return uint(int(clamp(roundEven(x * uintBitsToFloat((254u - unit) << 23)), -511.0, 511.0))) & 0x3FFu;
}
uint record_codes(vec3 part, uvec3 units) {
    return record_code(part.x, units.x) | record_code(part.y, units.y) << 10 | record_code(part.z, units.z) << 20;
}

uvec4 pack_record(vec3 centre, vec3 shape, vec3 color, bool opacity_only) {
    if (opacity_only) centre.x = 0.0;
    uint of_centre = record_unit(vec3(centre.xy, 0.0)), of_opacity = record_unit(vec3(centre.z, 0.0, 0.0));
    uint of_shape = record_unit(shape), of_color = record_unit(color);
    return uvec4(record_codes(centre, uvec3(of_centre, of_centre, of_opacity)) | (opacity_only ? OPACITY_MARK : 0),
                 record_codes(shape, uvec3(of_shape)), record_codes(color, uvec3(of_color)),
                 of_centre | of_shape << 8 | of_color << 16 | of_opacity << 24);
}

vec3 record_part(uint codes, uvec3 units) {
    vec3 numbers = vec3(bitfieldExtract(int(codes), 0, 10), bitfieldExtract(int(codes), 10, 10), bitfieldExtract(int(codes), 20, 10));
    return numbers * uintBitsToFloat(units << 23);
}
void unpack_record(uvec4 words, out vec3 centre, out vec3 shape, out vec3 color) {
    uvec4 units = uvec4(words.w) >> uvec4(0, 8, 16, 24) & 0xFFu;
    centre = record_part(words.x, units.xxw);
    if ((words.x & OPACITY_MARK) != 0) centre.x = 1.0;
    shape = record_part(words.y, units.yyy);
    color = record_part(words.z, units.zzz);
}
