// A camera on the GPU: world-to-camera [R|t] by rows, OpenCV axes, pixel centres at +0.5. Of a model that stands in a world turned,
// moved and scaled, R is s W M and the eye is where it is among the model's Gaussians, so that harmonics and lobes turn with it.
struct View {
    vec4 row_x, row_y, row_z;
    vec3 eye;              // camera centre, world
    float fx, fy, cx, cy;  // px
    vec2 slope_low, slope_high; // between which the Jacobian's x/z and y/z are clamped: the image's sides and 0.15 of it beyond
    uint width, height;    // px
    uint pixel_first;      // first pixel of this view in buffers that pack all views
    float near;            // camera z; what is not beyond is culled
};

vec3 to_camera(View view, vec3 p) {
    return vec3(dot(view.row_x.xyz, p), dot(view.row_y.xyz, p), dot(view.row_z.xyz, p)) +
           vec3(view.row_x.w, view.row_y.w, view.row_z.w);
}
