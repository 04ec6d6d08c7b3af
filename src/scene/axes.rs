//! Principal axes of symmetric matrices.

use glam::DVec3;

/// Each sweep squares what is left off the diagonal.
const SWEEPS: u32 = 8;

fn turn(value: &mut [f64; 3], off: &mut [[f64; 3]; 3], axes: &mut [DVec3; 3], p: usize, q: usize) {
    let r = 3 - p - q;
    let pq = off[p][q];
    let counts = pq.abs() > 1e-30;
    if !counts {
        return;
    }
    let ratio = (value[q] - value[p]) / (2.0 * pq);
    let tangent = if ratio.abs() < 1e15 {
        (if ratio < 0.0 { -1.0 } else { 1.0 }) / (ratio.abs() + (ratio * ratio + 1.0).sqrt())
    } else {
        0.5 / ratio
    };
    let c = 1.0 / (tangent * tangent + 1.0).sqrt();
    let s = tangent * c;
    value[p] -= tangent * pq;
    value[q] += tangent * pq;
    let (rp, rq) = (off[r][p], off[r][q]);
    for (a, b, v) in [(p, q, 0.0), (r, p, c * rp - s * rq), (r, q, s * rp + c * rq)] {
        off[a][b] = v;
        off[b][a] = v;
    }
    (axes[p], axes[q]) = (c * axes[p] - s * axes[q], s * axes[p] + c * axes[q]);
}

/// Eigenvalues, descending, and unit axes of the symmetric matrix (xx, yy, zz, xy, xz, yz), by cyclic Jacobi rotations.
/// The axes are orthonormal but of either handedness. A matrix of trace 0 (or less, or NaN) has eigenvalues 0.
pub fn eigen(matrix: [f64; 6]) -> ([f64; 3], [DVec3; 3]) {
    let mut axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let [xx, yy, zz, xy, xz, yz] = matrix;
    let trace = xx + yy + zz;
    let spread = trace > 0.0;
    if !spread {
        return ([0.0; 3], axes);
    }
    let mut value = [xx / trace, yy / trace, zz / trace];
    let (xy, xz, yz) = (xy / trace, xz / trace, yz / trace);
    let mut off = [[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]];
    for _ in 0..SWEEPS {
        turn(&mut value, &mut off, &mut axes, 0, 1);
        turn(&mut value, &mut off, &mut axes, 0, 2);
        turn(&mut value, &mut off, &mut axes, 1, 2);
    }
    for (a, b) in [(0, 1), (1, 2), (0, 1)] {
        if value[a] < value[b] {
            value.swap(a, b);
            axes.swap(a, b);
        }
    }
    (value.map(|v| v * trace), axes)
}
