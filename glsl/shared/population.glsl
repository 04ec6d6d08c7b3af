// The number of Gaussians, which lives on the device so that stages can change it and dispatches follow. The
// host reads it later.
//
// The Gaussian index, used by splats, keys and lists, counts through all segments without a gap. The Gaussian at `place` of the page that begins with number `page_first` of segment s has index
// segment_first[s] + page_first + place. The buffer Population holds segment_first: SEGMENTS words, followed
// by the number of all Gaussians.
const uint BASE = 0;       // segment
const uint BANDED = 1;     // segment: Gaussians of the base with bands, if the others have none
const uint SUPPLEMENT = 2; // segment
const uint SEGMENTS = 3;

// A page of a segment.
struct Page {
    uint segment;
    uint first;    // number, in the segment, of its first Gaussian
    uint capacity; // Gaussians
};
