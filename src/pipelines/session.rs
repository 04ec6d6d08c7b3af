//! What everything that runs together shares.

pub use super::raster::Reduction;
use super::raster::TileShape;
use crate::gpu::{Context, DeviceInfo};

/// Which variant of the kernels runs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Policy {
    /// How gradient records are added up.
    pub reduction: Reduction,
    /// Mip-Splatting-style opacity compensation.
    pub compensate: bool,
    /// Both moments of a number in one word of 32 bits, in place of one each, and gradient records of intersections in four words in
    /// place of nine.
    pub packed: bool,
    /// What a subgroup covers; `None` is the shape that suits the device. The image does not depend on it.
    pub tile: Option<TileShape>,
}

impl Policy {
    /// The shape of a tile: what was asked for, or what suits the device's subgroups.
    pub fn tile(&self, device: &DeviceInfo) -> TileShape {
        self.tile.unwrap_or_else(|| TileShape::for_subgroup(device.subgroup_size))
    }
}

/// A device and what all runs on it have in common. Cheap to clone.
#[derive(Clone)]
pub struct Session {
    /// The device.
    pub context: Context,
    /// Which variants of the stages run.
    pub policy: Policy,
    /// sRGB, 0 to 1.
    pub background: [f32; 3],
    /// 1.1 × the largest camera distance from their mean, scene units: what position rates are relative to.
    pub extent: f32,
    /// Of whatever is drawn at random.
    pub seed: u64,
}

impl Session {
    /// The usual policy, black, an extent of 1 and seed 0.
    pub fn new(context: &Context) -> Self {
        Session { context: context.clone(), policy: Policy::default(), background: [0.0; 3], extent: 1.0, seed: 0 }
    }
}
