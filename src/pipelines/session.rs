//! Shared settings of everything that runs on a device: kernel variants, background, extent and seed.

pub use super::raster::{Policy, Reduction};
use crate::gpu::Context;

/// A device and the common settings of its runs. Cheap to clone.
#[derive(Clone)]
pub struct Session {
    /// The device.
    pub context: Context,
    /// Variants of the stages.
    pub policy: Policy,
    /// sRGB, 0 to 1.
    pub background: [f32; 3],
    /// 1.1 × the largest camera distance from their mean, scene units. Position rates are relative to it.
    pub extent: f32,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Session {
    /// Default policy, black background, an extent of 1 and seed 0.
    pub fn new(context: &Context) -> Self {
        Session { context: context.clone(), policy: Policy::default(), background: [0.0; 3], extent: 1.0, seed: 0 }
    }
}
