// A Gaussian projected into one view, without its color (`splat_colors`) and depth (`depth_keys`), and the
// tiles that its ellipse covers.
struct Splat {
    vec4 shape;  // factor of the conic (l11, l12, l22): w = (l11 dx + l12 dy, l22 dy), exponent -|w|^2/2; opacity: sigmoid(logit) *
                 // lobe * compensation
    vec2 centre; // px
};

const float ALPHA_MIN = 1.0 / 255.0; // below it a Gaussian contributes nothing (3DGS)
const float ALPHA_MAX = 0.99;        // 3DGS
const float T_MIN = 1e-4;            // transmittance at which a pixel is finished (3DGS)

// Columns of tiles that the splat touches in tile row `row`, as (first, last); first > last if none.
//
// alpha >= 1/255 holds in the ellipse |w|^2 <= t with t = 2 ln(255 opacity). Over the band of pixel centres
// of the row its right end is at dy = -l12 sqrt(t) / (l22 sqrt(l12^2 + l22^2)), its left end at minus that,
// each clamped to the band.
// `t` is wider than exact by 1e-4 (1 + t) and the span by 1e-3 px: over ten times the rounding of float32 on
// t <= 11 and on coordinates up to 2^13. In x the span is also wider by 16 roundings of the distance of the
// splat's centre and ends. So a tile may be listed in vain but is never omitted. In y the wider t is enough:
// it adds 5e-5 of the half height, and a splat in view is not much farther off.
// `precise`: projection counts the tiles that emit lists, so both kernels must compute the same ones.
const float SPAN_PAD = 1e-3, SPAN_PAD_RELATIVE = 1.0 / 1048576.0;

ivec2 tile_span(Splat s, int row, uvec2 tile, uvec2 size) {
    precise float t = 2.0 * log(255.0 * s.shape.w);
    // guard: wider columns (2 lines)
    t += 1e-4 * (1.0 + abs(t));
    precise float root = sqrt(max(t, 0.0)), slant = sqrt(s.shape.y * s.shape.y + s.shape.z * s.shape.z); // `length` is not kept precise
    precise float half_height = root / s.shape.z + SPAN_PAD;
    // guard: padding of columns
    precise float pad = SPAN_PAD + SPAN_PAD_RELATIVE * (slant * root / (s.shape.x * s.shape.z) + abs(s.centre.x));
    precise float top = float(row * int(tile.y)) + 0.5 - s.centre.y;
    precise float bottom = float(min((row + 1) * int(tile.y), int(size.y))) - 0.5 - s.centre.y;
    if (!(top <= half_height && bottom >= -half_height)) return ivec2(1, 0);
    top = max(top, -half_height);
    bottom = min(bottom, half_height);
    precise float dy_right = -s.shape.y * root / (s.shape.z * slant);
    precise float dy_r = clamp(dy_right, top, bottom);
    precise float dy_l = clamp(-dy_right, top, bottom);
    precise float w_r = s.shape.z * dy_r, w_l = s.shape.z * dy_l;
    precise float right = s.centre.x + (sqrt(max(t - w_r * w_r, 0.0)) - s.shape.y * dy_r) / s.shape.x + pad;
    precise float left = s.centre.x - (sqrt(max(t - w_l * w_l, 0.0)) + s.shape.y * dy_l) / s.shape.x - pad;
    // Clamped to within one pixel of the image before the conversion: huge floats have no int.
    // guard: columns of huge splats (2 lines)
    precise float first = ceil(clamp(left - 0.5, -1.0, float(size.x)));
    precise float last = floor(clamp(right - 0.5, -1.0, float(size.x)));
    int x0 = max(int(first), 0), x1 = min(int(last), int(size.x) - 1);
    if (!(left <= right) || x0 > x1) return ivec2(1, 0); // guard: tile spans of NaN
    return ivec2(x0 / int(tile.x), x1 / int(tile.x));
}

// Rows of tiles that the splat may touch, as (first, last); first > last if none.
ivec2 tile_rows(Splat s, uvec2 tile, uvec2 size) {
    precise float t = 2.0 * log(255.0 * s.shape.w);
    // guard: wider rows (2 lines)
    t += 1e-4 * (1.0 + abs(t));
    precise float half_height = sqrt(max(t, 0.0)) / s.shape.z + SPAN_PAD;
    // guard: rows of huge splats (2 lines)
    precise float first = ceil(clamp(s.centre.y - half_height - 0.5, -1.0, float(size.y)));
    precise float last = floor(clamp(s.centre.y + half_height - 0.5, -1.0, float(size.y)));
    int y0 = max(int(first), 0), y1 = min(int(last), int(size.y) - 1);
    return y0 > y1 ? ivec2(1, 0) : ivec2(y0 / int(tile.y), y1 / int(tile.y));
}

uint tile_count(Splat s, uvec2 tile, uvec2 size) {
    ivec2 rows = tile_rows(s, tile, size);
    uint count = 0;
    for (int row = rows.x; row <= rows.y; ++row) {
        ivec2 span = tile_span(s, row, tile, size);
        count += uint(max(span.y - span.x + 1, 0));
    }
    return count;
}
