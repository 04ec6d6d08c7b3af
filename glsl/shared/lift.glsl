// A supplementary Gaussian as inverse splatting creates it (method, section 4), in world space.
struct Lift {
    vec3 mean;
    vec3 log_scale;    // ln of the standard deviations, descending
    vec4 quat;         // (w, x, y, z), unit
    vec3 dc;           // constant SH coefficient of each channel
    float opacity;     // logit
    vec3 lobe_dir;     // unit, from the Gaussian to the source camera
    float lobe_width;  // T, 0.01 to 1
    float theta_bar;   // angle to the nearest other training view, radians
    uint cluster_size; // points of the prime group; 0: no lift, and all other members are 0 too
};
