// Which sets of points are still to be clustered.

const uint GROUP_MIN = 3; // points: PCA needs three

// A set is open until a round succeeds. τ² must be finite and not 0.
bool is_open(uint points, float tau, uint cluster_size) {
    return cluster_size == 0 && points >= GROUP_MIN && tau > 0.0 && tau <= 1e18;
}
