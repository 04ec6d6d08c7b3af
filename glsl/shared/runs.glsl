// How the kernels that filter along rows cut them, and how the partial derivatives lie that one leaves to the other.

// Consecutive pixels of a row that one thread filters. Each run begins with the border's pixels, so the longer the fewer are read,
// and the fewer threads there are.
layout(constant_id = 8) const uint RUN = 4;
const uint RUNS = TILE / RUN;
// Rows that pass through shared memory at a time; STRIP * RUNS is TILE at most.
layout(constant_id = 9) const uint STRIP = 4;
// Steps along a run that are written out: all of a short one, so that of the filter's sums only those of the run are in registers.
const uint PIECE = RUN < TILE ? RUN : 1;

// The partial derivatives of a pixel's channel lie together, in strips of TILE * STRIP pixels, a plane for each channel, and within
// a plane the place in the run is the slowest: the threads of a strip, each filtering its run, then read and write side by
// side. A frame has room for tiles_per_frame tiles.
const uint STRIP_PIXELS = TILE * STRIP;
const uint STRIP_SIZE = 3 * STRIP_PIXELS;

uint partial_index(Frame frame, uint frame_index, uint tiles_per_frame, uint channel, ivec2 at) {
    uint strip = frame_index * tiles_per_frame * (TILE / STRIP)
        + uint(at.y) / STRIP * tiles_across(frame) + uint(at.x) / TILE;
    uint run = uint(at.x) % TILE / RUN;
    return strip * STRIP_SIZE + channel * STRIP_PIXELS
        + uint(at.x) % RUN * (RUNS * STRIP) + run * STRIP + uint(at.y) % STRIP;
}
