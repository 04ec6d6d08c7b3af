//! Gaussians at new numbers.

use super::NONE;

/// Element t of the result is what `sources[t]` says, 0 for [`NONE`]: of a plane, or of a quad of planes.
pub fn gather<T: Copy + Default>(from: &[T], sources: &[u32]) -> Vec<T> {
    sources.iter().map(|&source| if source == NONE { T::default() } else { from[source as usize] }).collect()
}
