// One image of a batch: its first pixel in the packed buffers, and its size. A dispatch over several frames
// gives each the same grid of tiles, that of the largest.
struct Frame {
    uint image_first;  // first pixel in `image`, `image_grad` and other per-batch buffers
    uint target_first; // first pixel in `targets` and other per-dataset buffers
    uint width, height; // px
};
