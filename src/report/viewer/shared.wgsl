// Uniforms of a frame, and the result of projecting a Gaussian. The page inserts the constants of the GLSL
// before this line.
struct Frame {
    row_x: vec4f, // to slope_high: the camera, as in glsl/shared/view.glsl
    row_y: vec4f,
    row_z: vec4f,
    eye: vec3f,
    fx: f32,
    fy: f32,
    cx: f32,
    cy: f32,
    slope_low_x: f32,
    slope_low_y: f32,
    slope_high_x: f32,
    slope_high_y: f32,
    near: f32,
    image_size: vec2f, // px
    // two numbers of padding
    background: vec3f,
    first: u32, // of the Gaussians to show
    last: u32,  // exclusive
}

struct Splat {
    shape: vec4f,  // l11, l12, l22 of glsl/shared/splat.glsl, opacity
    color: vec3f,
    centre: vec2f, // px, y down
}
