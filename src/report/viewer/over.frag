// Lays the Gaussians' light over the background.
uniform highp sampler2D image; // rgb, transmittance
uniform vec3 background;

out vec4 shown;

void main() {
    vec4 light = texelFetch(image, ivec2(gl_FragCoord.xy), 0);
    shown = vec4(light.rgb + light.a * background, 1.0);
}
