// Words of `status`, which the host reads late: after a submission is done, never inside a loop.
//
// Where something does not fit, its bit is set in FAILED and the word NEEDED + resource says how much was needed; dispatch_args
// says what was asked for where it fits, too, so that there is more room before it does not. While FAILED is not 0 no stage changes
// parameters or moments, so the host can make room and go on from step `status[STEPS]`.
const uint STATUS_FAILED = 0; // bit r: resource r was too small
const uint STATUS_STEPS = 1;  // steps completed
const uint STATUS_NEEDED = 2; // and the words after it: the most that each resource was asked for, see above
// Resources.
const uint INTERSECTIONS = 0;         // of splats and tiles
const uint BASE_GAUSSIANS = 1;        // the base's capacity
const uint SUPPLEMENT_GAUSSIANS = 2;  // the supplement's capacity
const uint RESOURCES = 3;
const uint NO_RESOURCE = 0xFFFFFFFFu; // for dispatch_args: of what always fits nothing is told
