// Lays the Gaussians' light over the background, with a triangle that covers the image: over.vert and
// over.frag for WebGPU.
@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var image: texture_2d<f32>; // rgb, transmittance

@vertex
fn cover(@builtin(vertex_index) vertex: u32) -> @builtin(position) vec4f {
    return vec4f(select(-1.0, 3.0, vertex == 1), select(-1.0, 3.0, vertex == 2), 0.0, 1.0);
}

@fragment
fn shown(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let light = textureLoad(image, vec2i(at.xy), 0);
    return vec4f(light.rgb + light.a * frame.background, 1.0);
}
