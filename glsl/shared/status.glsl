// Words of `status`, which the host reads late: after a submission is done, never inside a loop.
//
// While OVERFLOW is not 0 no kernel changes parameters or moments, so the host can grow the buffers and replay from
// step `status[STEPS]`.
const uint STATUS_OVERFLOW = 0; // the number of intersections that a view needed when it was more than the buffers hold
const uint STATUS_STEPS = 1;    // training steps completed
