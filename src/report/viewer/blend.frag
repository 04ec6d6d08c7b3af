// One Gaussian's light and alpha at one pixel, premultiplied: the inner loop of glsl/raster/blend.comp.
//
// Blending adds it over what lies behind (rgb) and multiplies what gets through (alpha of the target, the transmittance). Unlike the
// kernel's pixels, which go front to back, these cannot stop at a transmittance of 1e-4.
flat in vec2 centre;
flat in vec4 shape;
flat in vec3 colour;

uniform vec2 image_size; // px

out vec4 light;

void main() {
    // Rows of WebGL count from below.
    float dx = gl_FragCoord.x - centre.x, dy = (image_size.y - gl_FragCoord.y) - centre.y;
    float u = shape.x * dx + shape.y * dy, v = shape.z * dy;
    float alpha = min(ALPHA_MAX, shape.w * exp(-0.5 * (u * u + v * v)));
    if (!(alpha >= ALPHA_MIN)) discard;
    light = vec4(alpha * colour, alpha);
}
