//! Twin of `blend_backward_atomic.comp`: the blend's gradient with each Gaussian's records added up.

use super::Intersections;
use super::blend_backward::Record;

/// Sums records by Gaussian, of which there are `gaussians`. `isect_grads` are by slot, from
/// [`blend_backward`](super::blend_backward::blend_backward).
pub fn blend_backward_atomic(isects: &Intersections, isect_grads: &[Record], gaussians: usize) -> Vec<Record> {
    let mut splat_grads = vec![[0.0; 9]; gaussians];
    for (&global, record) in isects.global_from_slot.iter().zip(isect_grads) {
        splat_grads[global as usize].iter_mut().zip(record).for_each(|(sum, part)| *sum += part);
    }
    splat_grads
}
