// A camera on the GPU: world-to-camera [R|t] by rows, OpenCV axes, pixel centres at +0.5. For a model that is
// rotated, moved and scaled in the world, R is s W M and the eye is given in the model's coordinates, so that
// harmonics and lobes turn with it.
struct View {
    vec4 row_x, row_y, row_z;
    vec3 eye;              // camera centre, world
    float fx, fy, cx, cy;  // px
    vec2 slope_low, slope_high; // limits of the Jacobian's x/z and y/z: the image's sides and 0.15 of it beyond
    uint width, height;    // px
    uint pixel_first;      // first pixel of this view in buffers that pack all views
    float near;            // camera z; Gaussians not beyond it are culled
};

vec3 to_camera(View view, vec3 p) {
    return vec3(dot(view.row_x.xyz, p), dot(view.row_y.xyz, p), dot(view.row_z.xyz, p)) +
           vec3(view.row_x.w, view.row_y.w, view.row_z.w);
}
