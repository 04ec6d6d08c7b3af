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
