// Covers a splat's ellipse with a quad, and computes its light and alpha at each pixel: the end of
// project.vert, and blend.frag, for WebGPU.
// frame, splats (by Gaussian), pairs (in drawing order) -> light, transmittance
@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> splats: array<Splat>;
@group(0) @binding(2) var<storage, read> pairs: array<vec2u>;

struct Corner {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) centre: vec2f,
    @location(1) @interpolate(flat) shape: vec4f,
    @location(2) @interpolate(flat) color: vec3f,
}

@vertex
fn cover(@builtin(instance_index) place: u32, @builtin(vertex_index) vertex: u32) -> Corner {
    let splat = splats[pairs[place].y];
    let l11 = splat.shape.x;
    let l12 = splat.shape.y;
    let l22 = splat.shape.z;
    let t = 2.0 * log(255.0 * splat.shape.w);
    let radius = sqrt(max(t + 1e-4 * (1.0 + abs(t)), 0.0));
    let corner = vec2f(f32(vertex & 1), f32(vertex >> 1)) * 2.0 - 1.0;
    let dy = corner.y * (radius / l22 + PAD);
    let dx = (corner.x * (radius + PAD * (l11 + abs(l12))) - l12 * dy) / l11;
    let at = (splat.centre + vec2f(dx, dy)) / frame.image_size;
    return Corner(vec4f(2.0 * at.x - 1.0, 1.0 - 2.0 * at.y, 0.0, 1.0), splat.centre, splat.shape, splat.color);
}

@fragment
fn light(in: Corner) -> @location(0) vec4f {
    let d = in.position.xy - in.centre;
    let u = in.shape.x * d.x + in.shape.y * d.y;
    let v = in.shape.z * d.y;
    let alpha = min(ALPHA_MAX, in.shape.w * exp(-0.5 * (u * u + v * v)));
    if (!(alpha >= ALPHA_MIN)) { discard; }
    return vec4f(alpha * in.color, alpha);
}
