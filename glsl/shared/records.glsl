// The gradient record of an intersection, or of a Gaussian if blend_backward_atomic has added its records up.
// A record is nine sums over pixels in whitened coordinates (see docs/design-notes.md), split over three
// buffers so that each can hold three times as many.
// A Gaussian that learns only its opacity has just record_centres, with 1 in x if a pixel blends it.
// If the kernel has a binding RECORD_WORDS and PACKED_RECORDS is set, records of intersections are packed
// into that binding instead.
//
// The kernel declares push.by_gaussian (not 0: records are by Gaussian, added up already), tile_counts and
// first_slot, and the bindings RECORD_CENTRES, RECORD_SHAPES and RECORD_COLORS.
const uint RECORD = 9; // floats: sum g w_u, g w_v, d/d opacity; g w_u^2, g w_u w_v, g w_v^2; d/d rgb
layout(set = 0, binding = RECORD_CENTRES, scalar) readonly buffer RecordCentres { vec3 record_centres[]; };
layout(set = 0, binding = RECORD_SHAPES, scalar) readonly buffer RecordShapes { vec3 record_shapes[]; };
layout(set = 0, binding = RECORD_COLORS, scalar) readonly buffer RecordColors { vec3 record_colors[]; };
#ifdef RECORD_WORDS
#include "packed_record.glsl"
layout(set = 0, binding = RECORD_WORDS, scalar) readonly buffer RecordWords { uvec4 record_words[]; };
bool packed_records() { return PACKED_RECORDS && push.by_gaussian == 0; }
#endif

// The records of Gaussian i: first index and count. Those of its intersections are contiguous.
uvec2 records_of(uint i) {
    if (push.by_gaussian != 0) return uvec2(i, 1); // guard: consumers told of atomics
    uint count = tile_counts[i];
    return uvec2(count == 0 ? 0 : first_slot[i], count);
}

void add_record(uint at, bool all, inout float sums[RECORD]) {
    vec3 centre, shape = vec3(0.0), color = vec3(0.0);
#ifdef RECORD_WORDS
    if (packed_records()) {
        unpack_record(record_words[at], centre, shape, color);
    } else
#endif
    {
        centre = record_centres[at];
        if (all) {
            shape = record_shapes[at];
            color = record_colors[at];
        }
    }
    [[unroll]] for (uint c = 0; c < 3; ++c) {
        sums[c] += centre[c];
        if (!all) continue;
        sums[3 + c] += shape[c];
        sums[6 + c] += color[c];
    }
}
