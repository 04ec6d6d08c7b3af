// How many Gaussians there are. The numbers are on the device, so that stages can change them and dispatches follow; the host
// learns of them late.
//
// The Gaussian index, by which splats, keys and lists go, counts through base and supplement without a gap: the Gaussian at
// `place` of the page that begins with number `page_first` of segment s has index segment_first[s] + page_first + place. The
// buffer Population holds segment_first: SEGMENTS words, and the number of all Gaussians after them.
const uint BASE = 0;       // segment
const uint SUPPLEMENT = 1; // segment
const uint SEGMENTS = 2;

// A page of a segment.
struct Page {
    uint segment;
    uint first;    // number in the segment of its first Gaussian
    uint capacity; // Gaussians
};
