//! Gaussians at new numbers.

use super::NONE;

/// Plane by plane: element t of the result is what `sources[t]` says, 0 for [`NONE`].
pub fn gather(plane: &[f32], sources: &[u32]) -> Vec<f32> {
    sources.iter().map(|&source| if source == NONE { 0.0 } else { plane[source as usize] }).collect()
}
