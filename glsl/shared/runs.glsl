// Runs and strips of the SSIM kernels, which filter along rows, and the layout of the partial derivatives
// that ssim_forward writes for ssim_backward.

// Consecutive pixels of a row that one thread filters. Each run first reads the border's pixels, so longer
// runs read fewer pixels but use fewer threads.
layout(constant_id = 8) const uint RUN = 4;
const uint RUNS = TILE / RUN;
// Rows that pass through shared memory at a time; STRIP * RUNS is TILE at most.
layout(constant_id = 9) const uint STRIP = 4;
// Steps of a run that are unrolled: all of a short run, so that only the run's own sums of the filter are in
// registers.
const uint PIECE = RUN < TILE ? RUN : 1;

// Layout of the partial derivatives: strips of TILE * STRIP pixels, within a strip a plane for each channel,
// and within a plane the position in the run is the slowest index. The threads of a strip, each filtering its
// run, thus access adjacent words. A frame has room for tiles_per_frame tiles.
const uint STRIP_PIXELS = TILE * STRIP;
const uint STRIP_SIZE = 3 * STRIP_PIXELS;

uint partial_index(Frame frame, uint frame_index, uint tiles_per_frame, uint channel, ivec2 at) {
    uint strip = frame_index * tiles_per_frame * (TILE / STRIP)
        + uint(at.y) / STRIP * tiles_across(frame) + uint(at.x) / TILE;
    uint run = uint(at.x) % TILE / RUN;
    return strip * STRIP_SIZE + channel * STRIP_PIXELS
        + uint(at.x) % RUN * (RUNS * STRIP) + run * STRIP + uint(at.y) % STRIP;
}
