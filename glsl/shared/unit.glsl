// The range of float32, and normalisation of vectors of any length in it.
const float FLOAT_MIN = 1.17549435e-38; // smallest normal number: devices may flush smaller ones to 0
const float FLOAT_MAX = 3.402823466e38;

// Replaces a vector by its direction and returns its length, also where squares leave float32 (components of
// 1e20 or 1e-25). If there is no direction (zero, denormal, infinite or NaN), the length is not above 0.
float to_unit(inout vec4 v) {
    vec4 a = abs(v);
    float largest = max(max(a.x, a.y), max(a.z, a.w));
    if (!(largest >= FLOAT_MIN && largest <= FLOAT_MAX)) return 0.0; // guard: no direction in what has none
    // guard: length through the largest component (4 lines)
    v /= largest;
    float length_of = length(v);
    v /= length_of;
    return largest * length_of;
}

// The length of a quaternion or lobe direction has no meaning, but a step of fixed size turns a short one
// wildly and a long one not at all. A vector outside these bounds is normalised before it steps.
const float LENGTH_MIN = 0.01, LENGTH_MAX = 100.0;
bool wants_unit(float length_of) { return !(length_of >= LENGTH_MIN && length_of <= LENGTH_MAX); }
