// Projects one Gaussian: project.vert for WebGPU, except for the quad's corners, which blend.wgsl places.
// The functions copy those of glsl/shared/gaussian.glsl, unit.glsl and view.glsl, which explain them;
// sh_basis is generated from the kernels' own.
// geometry, harmonics, lobes (by Gaussian, see pack.rs), frame -> splats, pairs for the sort, number of
// drawn Gaussians
// Limits: 65,535 workgroups, which is sixteen million Gaussians, more than a page holds.
override SH_DEGREE: u32;
override SUPPLEMENT_FIRST: u32;
override HARMONICS_END: u32; // Gaussians from here on have only the constant band
override LOG_SCALE_LOW: f32; // range of the quantized log scales
override LOG_SCALE_HIGH: f32;
override COMPENSATE: bool; // opacity *= sqrt(det0 / det), as in Mip-Splatting

// Layout of drawIndirect.
struct Draw {
    vertices: u32,
    instances: atomic<u32>,
    first_vertex: u32,
    first_instance: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> geometry: array<vec4u>; // two for each Gaussian
@group(0) @binding(2) var<storage, read> harmonics: array<u32>;  // 4 SH_DEGREE words for each Gaussian
@group(0) @binding(3) var<storage, read> lobes: array<vec4u>;    // one for each Gaussian of the supplement
@group(0) @binding(4) var<storage, read_write> splats: array<Splat>;
@group(0) @binding(5) var<storage, read_write> pairs: array<vec2u>; // sort key, Gaussian
@group(0) @binding(6) var<storage, read_write> drawn: Draw;

var<workgroup> seen: atomic<u32>;

fn shorts(word: u32) -> vec2f { return vec2f(f32(word & 0xFFFFu), f32(word >> 16)); }

// Unpacks three components of 15 bits. The largest component of the quaternion (w, x, y, z) is positive and
// left out.
fn unpack_rotation(a: u32, b: u32, c: u32) -> vec4f {
    let three = (vec3f(vec3u(a, b, c) & vec3u(0x7FFFu)) / 32767.0 - 0.5) * sqrt(2.0);
    let largest = sqrt(max(1.0 - dot(three, three), 0.0));
    switch ((a >> 15) | ((b >> 15) << 1)) {
        case 0u: { return vec4f(largest, three); }
        case 1u: { return vec4f(three.x, largest, three.yz); }
        case 2u: { return vec4f(three.xy, largest, three.z); }
        default: { return vec4f(three, largest); }
    }
}

// Byte `at` of the harmonics that begin at word `row`, as a signed number.
fn signed_byte(row: u32, at: u32) -> f32 {
    return f32(extractBits(bitcast<i32>(harmonics[row + (at >> 2)]), 8 * (at & 3), 8));
}

// Color from the bands above the constant one, in a unit direction.
fn view_dependent(gaussian: u32, direction: vec3f) -> vec3f {
    let row = 4 * SH_DEGREE * gaussian;
    var basis = sh_basis(direction);
    var sum = vec3f(0.0);
    for (var k = 1u; k < (SH_DEGREE + 1) * (SH_DEGREE + 1); k++) {
        let at = 2 + 3 * (k - 1); // after the scale
        sum += basis[k] * vec3f(signed_byte(row, at), signed_byte(row, at + 1), signed_byte(row, at + 2));
    }
    return sum * (unpack2x16float(harmonics[row]).x / 127.0);
}

// Direction of a vector; zero if it has none.
fn unit_of(v: vec4f) -> vec4f {
    let a = abs(v);
    let largest = max(max(a.x, a.y), max(a.z, a.w));
    if (!(largest >= FLOAT_MIN && largest <= FLOAT_MAX)) { return vec4f(0.0); }
    let scaled = v / largest;
    return scaled / length(scaled);
}

fn rotation(q: vec4f) -> mat3x3f {
    let w = q.x;
    let x = q.y;
    let y = q.z;
    let z = q.w;
    return mat3x3f(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
                   2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
                   2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
}

struct Covariance {
    a: f32, // without dilation
    b: f32,
    c: f32,
    det0: f32, // without and with dilation
    det: f32,
}

fn project_covariance(p: vec3f, q: vec4f, scale: vec3f) -> Covariance {
    let inv_z = 1.0 / p.z;
    let t = clamp(p.xy * inv_z, vec2f(frame.slope_low_x, frame.slope_low_y), vec2f(frame.slope_high_x, frame.slope_high_y));
    let axes = rotation(q);
    let m1 = (frame.fx * inv_z * (frame.row_x.xyz - t.x * frame.row_z.xyz)) * axes * scale;
    let m2 = (frame.fy * inv_z * (frame.row_y.xyz - t.y * frame.row_z.xyz)) * axes * scale;
    let n = cross(m1, m2);
    var e: Covariance;
    e.a = dot(m1, m1);
    e.b = dot(m1, m2);
    e.c = dot(m2, m2);
    e.det0 = dot(n, n);
    e.det = e.det0 + DILATION * (e.a + e.c) + DILATION * DILATION;
    return e;
}

// Factor of the opacity by the lobe, in the direction `v`, a unit vector from the Gaussian to the eye.
fn lobe_factor(direction: vec3f, width: f32, sharpness: f32, v: vec3f) -> f32 {
    let axis = unit_of(vec4f(direction, 0.0)).xyz;
    let theta = atan2(length(cross(axis, v)), dot(axis, v));
    let psi = theta / width;
    if (!(any(axis != vec3f(0.0)) && psi < PI)) { return 0.0; }
    let x = 0.5 * psi;
    let log_cos = select(log(max(cos(x), 1e-30)), -x * x * (0.5 + x * x / 12.0), x < 0.03);
    return exp(2.0 * exp(sharpness) * log_cos);
}

// Writes the Gaussian's splat and returns its sort key: smaller if it is farther away, and NONE if it is
// not visible.
fn place(gaussian: u32) -> u32 {
    let head = geometry[2 * gaussian];
    let tail = geometry[2 * gaussian + 1];
    let mean = bitcast<vec3f>(head.xyz);
    let p = vec3f(dot(frame.row_x.xyz, mean), dot(frame.row_y.xyz, mean), dot(frame.row_z.xyz, mean)) +
            vec3f(frame.row_x.w, frame.row_y.w, frame.row_z.w);
    if (!(p.z > frame.near && p.z <= FLOAT_MAX)) { return NONE; }

    let opacity_and_x = shorts(head.w);
    var opacity = opacity_and_x.x / 65535.0;
    if (gaussian >= SUPPLEMENT_FIRST) {
        let lobe = lobes[gaussian - SUPPLEMENT_FIRST];
        // The length of a lobe's direction has no meaning, so it encodes the width.
        let direction = bitcast<vec3f>(lobe.xyz);
        opacity *= lobe_factor(direction, length(direction), bitcast<f32>(lobe.w), normalize(frame.eye - mean));
    }
    if (!(opacity >= ALPHA_MIN)) { return NONE; }

    let log_scale = mix(vec3f(LOG_SCALE_LOW), vec3f(LOG_SCALE_HIGH), vec3f(opacity_and_x.y, shorts(tail.x)) / 65535.0);
    let q = unit_of(unpack_rotation(tail.y & 0xFFFFu, tail.y >> 16, tail.z & 0xFFFFu));
    if (!any(q != vec4f(0.0))) { return NONE; }
    let e = project_covariance(p, q, exp(log_scale));
    if (!(e.det <= FLOAT_MAX)) { return NONE; }
    if (COMPENSATE) {
        opacity *= sqrt(e.det0 / e.det);
        if (!(opacity >= ALPHA_MIN)) { return NONE; }
    }

    var splat: Splat;
    let c = e.c + DILATION;
    let l22 = inverseSqrt(c);
    splat.shape = vec4f(sqrt(c / e.det), -e.b * l22 * inverseSqrt(e.det), l22, opacity);
    splat.centre = vec2f(frame.fx, frame.fy) * p.xy / p.z + vec2f(frame.cx, frame.cy);
    let constant = vec3f(unpack2x16float(tail.z).y, unpack2x16float(tail.w));
    var color = 0.5 + SH_C0 * constant;
    if (gaussian < HARMONICS_END) { color += view_dependent(gaussian, normalize(mean - frame.eye)); }
    splat.color = max(color, vec3f(0.0));
    splats[gaussian] = splat;
    return ~bitcast<u32>(p.z);
}

@compute @workgroup_size(256)
fn project(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) lane: u32) {
    if (id.x < frame.last - frame.first) {
        // From the last to the first: the sort is stable, so of equal depths the last is drawn first, as in
        // sort.js.
        let gaussian = frame.last - 1 - id.x;
        let key = place(gaussian);
        pairs[id.x] = vec2u(key, gaussian);
        if (key != NONE) { atomicAdd(&seen, 1u); }
    }
    workgroupBarrier();
    if (lane == 0) { atomicAdd(&drawn.instances, atomicLoad(&seen)); }
}
