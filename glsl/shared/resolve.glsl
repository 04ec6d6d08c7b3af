// How a rendered view goes into a caller's image.
// Texels.
const uint RGBA8 = 0;   // a word, R in the low byte
const uint BGRA8 = 1;   // a word, B in the low byte
const uint RGBA16F = 2; // two words
const uint RGBA32F = 3; // four words
// What becomes of that which lies behind.
const uint OPAQUE = 0;        // a background colour
const uint PREMULTIPLIED = 1; // nothing: rgb is weighed by alpha
const uint OVER = 2;          // what the target holds
const float HALF_MAX = 65504.0; // of a half
