//! Twin of `lift_append.comp`: appends lifts to the supplement, compacted, in the order of their 2D
//! Gaussians.

use super::lift_pca::Lift;
use crate::scene::{
    Supplement,
    layout::{self, GEOMETRY_PLANES, LOBE_DIRECTION, LOBE_PLANES, LOBE_WIDTH, LOG_SCALE, MEAN, OPACITY, QUAT},
};

/// Appends a Gaussian and its lobe for every lift, up to `capacity` Gaussians. Returns the number there would
/// be without that limit. All coefficients of SH but the first are 0, and so is the sharpness.
pub fn lift_append(lifts: &[Lift], capacity: usize, supplement: &mut Supplement) -> usize {
    let first = supplement.gaussians.len();
    let there = || lifts.iter().filter(|lift| lift.cluster_size > 0);
    for lift in there().take(capacity.saturating_sub(first)) {
        let mut geometry = [0.0; GEOMETRY_PLANES];
        geometry[MEAN..MEAN + 3].copy_from_slice(&lift.mean);
        geometry[LOG_SCALE..LOG_SCALE + 3].copy_from_slice(&lift.log_scale);
        geometry[QUAT..QUAT + 4].copy_from_slice(&lift.quat);
        geometry[OPACITY] = lift.opacity;
        let mut lobe = [0.0; LOBE_PLANES];
        lobe[LOBE_DIRECTION..LOBE_WIDTH].copy_from_slice(&lift.lobe_dir);
        lobe[LOBE_WIDTH] = lift.lobe_width;
        let sh = |p: usize| lift.dc.get(p).map_or(0.0, |&dc| dc as f32);
        layout::push(&mut supplement.gaussians, |p| geometry[p] as f32, sh);
        layout::push_lobe(&mut supplement.lobes, |p| lobe[p] as f32);
    }
    first + there().count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Gaussians;

    #[test]
    fn lifts_close_up_in_order_behind_what_is_there() {
        let lift = |v: f64| Lift { mean: [v; 3], dc: [v; 3], lobe_width: v, cluster_size: 3, ..Default::default() };
        let lifts = [lift(1.0), Lift::default(), lift(2.0), Lift::default(), lift(3.0)];
        let gaussians = Gaussians { sh_degree: 1, ..Default::default() };
        let mut supplement = Supplement { gaussians, ..Default::default() };
        lift_append(&[lift(9.0)], 4, &mut supplement);
        assert_eq!(lift_append(&lifts, 3, &mut supplement), 4);
        // The third does not fit.
        assert_eq!(supplement.gaussians.means, [[9.0; 3], [1.0; 3], [2.0; 3]]);
        assert_eq!(supplement.gaussians.sh.len(), 3 * 4);
        assert_eq!(supplement.gaussians.sh[4..6], [[1.0; 3], [0.0; 3]]);
        assert_eq!((supplement.lobes.widths, supplement.lobes.sharpness), (vec![9.0, 1.0, 2.0], vec![0.0; 3]));
    }
}
