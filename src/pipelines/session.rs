//! Shared settings of everything that runs on a device: kernel variants, background, extent and seed.

pub use super::raster::Reduction;
use super::raster::TileShape;
use crate::gpu::{Context, DeviceInfo};

/// Selects the variants of kernels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Policy {
    /// Method of accumulating gradient records.
    pub reduction: Reduction,
    /// Mip-Splatting-style opacity compensation.
    pub compensate: bool,
    /// Pack both moments of a parameter into one 32-bit word instead of two, and gradient records of
    /// intersections into four words instead of nine.
    pub packed: bool,
    /// Tile shape; `None` is the best one for the device. The image does not depend on it.
    pub tile: Option<TileShape>,
}

impl Policy {
    /// The tile shape: the requested one, or the best one for the device's subgroups.
    pub fn tile(&self, device: &DeviceInfo) -> TileShape {
        self.tile.unwrap_or_else(|| TileShape::for_subgroup(device.subgroup_size))
    }
}

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
