// Light and alpha of one Gaussian at one pixel, premultiplied: the inner loop of glsl/raster/blend.comp.
//
// Blending adds the light over the Gaussians behind (rgb) and multiplies the transmittance (alpha of the
// target). Pixels are blended back to front here and cannot stop at a transmittance of 1e-4, as the kernel
// does.
flat in vec2 centre;
flat in vec4 shape;
flat in vec3 color;

uniform vec2 image_size; // px

out vec4 light;

void main() {
    // WebGL counts rows from below.
    float dx = gl_FragCoord.x - centre.x, dy = (image_size.y - gl_FragCoord.y) - centre.y;
    float u = shape.x * dx + shape.y * dy, v = shape.z * dy;
    float alpha = min(ALPHA_MAX, shape.w * exp(-0.5 * (u * u + v * v)));
    if (!(alpha >= ALPHA_MIN)) discard;
    light = vec4(alpha * color, alpha);
}
