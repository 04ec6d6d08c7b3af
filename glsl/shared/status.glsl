// Words of `status`, which the host reads late: after a submission is done, never inside a loop.
//
// If a resource is too small, its bit is set in FAILED, and the word NEEDED + resource is the size needed.
// dispatch_args records the demand even if it fits, so that the host can enlarge the resource in time. While
// FAILED is not 0 no stage changes parameters or moments: the host can enlarge the resource and resume from
// step `status[STATUS_STEPS]`.
const uint STATUS_FAILED = 0; // bit r: resource r was too small
const uint STATUS_STEPS = 1;  // steps completed
const uint STATUS_NEEDED = 2; // and the words after it: the largest demand for each resource, see above
// Resources.
const uint INTERSECTIONS = 0;         // of splats and tiles
const uint BASE_GAUSSIANS = 1;        // the base's capacity
const uint BANDED_GAUSSIANS = 2;      // the capacity of Gaussians with bands
const uint SUPPLEMENT_GAUSSIANS = 3;  // the supplement's capacity
const uint RESOURCES = 4;
const uint NO_RESOURCE = 0xFFFFFFFFu; // for dispatch_args: the count always fits, so nothing is reported
