// Texel formats and blend modes of resolve.comp, which writes a rendered view into a caller's image.
// Texel formats.
const uint RGBA8 = 0;   // a word, R in the low byte
const uint BGRA8 = 1;   // a word, B in the low byte
const uint RGBA16F = 2; // two words
const uint RGBA32F = 3; // four words
// Blend modes: what lies behind the Gaussians.
const uint OPAQUE = 0;        // a background color
const uint PREMULTIPLIED = 1; // nothing: rgb is multiplied by alpha
const uint OVER = 2;          // the target's content
const float HALF_MAX = 65504.0; // largest half float
