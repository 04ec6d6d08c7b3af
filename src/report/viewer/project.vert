// Projects one Gaussian and places a corner of the quad that covers its ellipse.
//
// An instance is a Gaussian, a vertex is a corner of its quad. This is glsl/raster/project.comp for WebGL2.
// The page inserts that kernel's shared source before this line (View, to_camera, to_unit,
// project_covariance, eval_lobe, sh_basis and their constants), so both always agree.
// geometry, harmonics, lobes (by Gaussian, see pack.rs), view -> centre, shape, color
// Limits: culled as in the kernel, except for Gaussians that reach no pixel center; rasterization drops
// these.
layout(location = 0) in uint gaussian; // index in the scene, the base first

uniform highp usampler2D geometry;  // two texels for each Gaussian
uniform highp usampler2D harmonics; // SH_TEXELS for each Gaussian
uniform highp usampler2D lobes;     // one texel for each Gaussian of the supplement
uniform View view;
uniform vec2 log_scale_range; // range of the quantized log scales
uniform uint supplement_first;
uniform uint harmonics_end;    // Gaussians from here on have only the constant band
uniform bool compensate;      // opacity *= sqrt(det0 / det), as in Mip-Splatting
uniform vec2 image_size;      // px

flat out vec2 centre; // px, y down
flat out vec4 shape;  // l11, l12, l22 of shared/splat.glsl, opacity
flat out vec3 color;

// Vertices are snapped to 1/16 px or less. A quad larger by this margin still contains every pixel center
// of the ellipse.
const float PAD = 1.0 / 16.0; // px

uvec4 fetch(highp usampler2D data, uint at) {
    return texelFetch(data, ivec2(at % uint(TEXTURE_WIDTH), at / uint(TEXTURE_WIDTH)), 0);
}

vec2 shorts(uint word) { return vec2(word & 0xFFFFu, word >> 16); }

// Unpacks three components of 15 bits. The largest component of the quaternion (w, x, y, z) is positive and
// left out.
vec4 unpack_rotation(uint a, uint b, uint c) {
    vec3 three = (vec3(a & 0x7FFFu, b & 0x7FFFu, c & 0x7FFFu) / 32767.0 - 0.5) * sqrt(2.0);
    float largest = sqrt(max(1.0 - dot(three, three), 0.0));
    uint which = (a >> 15) | (b >> 15) << 1;
    return which == 0u ? vec4(largest, three)
         : which == 1u ? vec4(three.x, largest, three.yz)
         : which == 2u ? vec4(three.xy, largest, three.z)
                       : vec4(three, largest);
}

#if SH_DEGREE > 0
// Byte `at` of the Gaussian's harmonics, as a signed number.
float signed_byte(uint words[4 * SH_TEXELS], int at) {
    return float(int(words[at >> 2] << (24 - 8 * (at & 3))) >> 24);
}

// Color from the bands above the constant one, in a unit direction.
vec3 view_dependent(uint i, vec3 direction) {
    uint words[4 * SH_TEXELS];
    for (int t = 0; t < SH_TEXELS; ++t) {
        uvec4 four = fetch(harmonics, i * uint(SH_TEXELS) + uint(t));
        words[4 * t] = four.x;
        words[4 * t + 1] = four.y;
        words[4 * t + 2] = four.z;
        words[4 * t + 3] = four.w;
    }
    float basis[16];
    sh_basis(direction, basis);
    vec3 sum = vec3(0.0);
    for (int k = 1; k < (SH_DEGREE + 1) * (SH_DEGREE + 1); ++k) {
        int at = 2 + 3 * (k - 1); // after the scale
        sum += basis[k] * vec3(signed_byte(words, at), signed_byte(words, at + 1), signed_byte(words, at + 2));
    }
    return sum * (unpackHalf2x16(words[0]).x / 127.0);
}
#endif

void main() {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // outside the clip volume, for early returns
    centre = vec2(0.0);
    shape = vec4(0.0);
    color = vec3(0.0);

    uvec4 first = fetch(geometry, 2u * gaussian), second = fetch(geometry, 2u * gaussian + 1u);
    vec3 mean = uintBitsToFloat(first.xyz);
    vec3 p = to_camera(view, mean);
    if (!(p.z > view.near && p.z <= FLOAT_MAX)) return;

    vec2 opacity_and_x = shorts(first.w), y_and_z = shorts(second.x);
    float opacity = opacity_and_x.x / 65535.0;
#ifdef HAS_LOBES
    if (gaussian >= supplement_first) {
        uvec4 texel = fetch(lobes, gaussian - supplement_first);
        // The length of a lobe's direction has no meaning, so it encodes the width.
        vec3 direction = uintBitsToFloat(texel.xyz);
        opacity *= eval_lobe(direction, length(direction), uintBitsToFloat(texel.w), normalize(view.eye - mean)).factor;
    }
#endif
    if (!(opacity >= ALPHA_MIN)) return;

    vec3 log_scale = mix(log_scale_range.xxx, log_scale_range.yyy, vec3(opacity_and_x.y, y_and_z) / 65535.0);
    vec4 q = unpack_rotation(second.y & 0xFFFFu, second.y >> 16, second.z & 0xFFFFu);
    if (!(to_unit(q) > 0.0)) return;
    Projection e = project_covariance(view, p, q, exp(log_scale));
    if (!(e.det <= FLOAT_MAX)) return;
    if (compensate) {
        opacity *= sqrt(e.det0 / e.det);
        if (!(opacity >= ALPHA_MIN)) return;
    }

    float a = e.a + DILATION, c = e.c + DILATION;
    float l22 = inversesqrt(c);
    float l11 = sqrt(c / e.det);
    float l12 = -e.b * l22 * inversesqrt(e.det);
    centre = vec2(view.fx, view.fy) * p.xy * e.inv_z + vec2(view.cx, view.cy);
    shape = vec4(l11, l12, l22, opacity);

    vec3 constant = vec3(unpackHalf2x16(second.z).y, unpackHalf2x16(second.w));
    color = 0.5 + SH_C0 * constant;
#if SH_DEGREE > 0
    if (gaussian < harmonics_end) color += view_dependent(gaussian, normalize(mean - view.eye));
#endif
    color = max(color, vec3(0.0));

    // alpha >= 1/255 is |w|^2 <= t. The square |u|, |v| <= sqrt(t) around that circle becomes a
    // parallelogram in pixels, with the same area as the tightest rectangle.
    float t = 2.0 * log(255.0 * opacity);
    float radius = sqrt(max(t + 1e-4 * (1.0 + abs(t)), 0.0));
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    float dy = corner.y * (radius / l22 + PAD);
    float dx = (corner.x * (radius + PAD * (l11 + abs(l12))) - l12 * dy) / l11;
    vec2 at = (centre + vec2(dx, dy)) / image_size;
    gl_Position = vec4(2.0 * at.x - 1.0, 1.0 - 2.0 * at.y, 0.0, 1.0);
}
