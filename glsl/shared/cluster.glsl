// Decides which sets of points are still to be clustered.

const uint GROUP_MIN = 3; // points: PCA needs three
// tau grows by 1.5 at most this often: from 5 pixels' widths to 1.5^32 * 5 = 2 million. Points are farther
// apart only if depths differ a thousandfold at a focal length of 2000 pixels; such a set has no lift.
const uint MAX_GROWTHS = 32;

// A set is open until a round succeeds. tau^2 must be finite and not 0.
bool is_open(uint points, float tau, uint cluster_size) {
    // guard: sets of three points; τ within float32
    return cluster_size == 0 && points >= GROUP_MIN && tau > 0.0 && tau <= 1e18;
}
