//! Twin of `gather.comp`: permutes Gaussians.

use super::NONE;

/// Element t of the result is `from[sources[t]]`, 0 for [`NONE`]. Elements are those of a plane, or of a quad
/// of planes.
pub fn gather<T: Copy + Default>(from: &[T], sources: &[u32]) -> Vec<T> {
    sources.iter().map(|&source| if source == NONE { T::default() } else { from[source as usize] }).collect()
}
