//! Variants of kernels: shapes of tiles, and how gradient records are accumulated.

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

/// Method of accumulating the gradient records of a Gaussian's intersections.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Reduction {
    /// [`Reduction::Deterministic`] while its records fit the device, then [`Reduction::Atomic`] if
    /// supported.
    #[default]
    Auto,
    /// In a fixed order, with the same bits every run. Takes 36 bytes per intersection, or 16 if packed;
    /// sorting reuses a part of it.
    Deterministic,
    /// By float atomics in any order. Takes 36 bytes per Gaussian.
    Atomic,
}

impl Reduction {
    /// The reductions that a device supports, without `Auto`.
    pub fn offered(context: &Context) -> Vec<Reduction> {
        let mut all = vec![Reduction::Deterministic];
        if context.info().float_atomics {
            all.push(Reduction::Atomic);
        }
        all
    }
}

/// Shape of a tile, and the pixels of each lane of its subgroup; see `glsl/shared/tile.glsl` for the
/// constraints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileShape {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Pixels per lane.
    pub pixels: u32,
}

impl TileShape {
    /// 8×8 for subgroups of 8 and 16 lanes, 8×16 for 32 and 64. One subgroup covers a tile: large enough to
    /// share the cost of broadcasting a splat, small enough to keep tile lists short.
    pub fn for_subgroup(lanes: u32) -> Self {
        let height = if lanes <= 16 { 8 } else { 16 };
        TileShape { width: 8, height, pixels: 8 * height / lanes }
    }

    /// Tiles of `width` × `height` pixels; `None` if a subgroup of `lanes` lanes cannot cover them.
    pub fn new(width: u32, height: u32, lanes: u32) -> Option<Self> {
        let area = width.checked_mul(height)?;
        let fits = width > 0 && lanes.is_multiple_of(width) && area > 0 && area.is_multiple_of(lanes);
        // The unfinished pixels of a lane are bits of one word.
        // guard: tiles that a subgroup covers
        (fits && area / lanes <= 32).then(|| TileShape { width, height, pixels: area / lanes })
    }

    /// The common shapes that a subgroup of `lanes` lanes can cover.
    pub fn choices(lanes: u32) -> Vec<Self> {
        [(8, 8), (8, 16), (16, 16)].into_iter().filter_map(|(width, height)| Self::new(width, height, lanes)).collect()
    }
}

impl std::fmt::Display for TileShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}×{}", self.width, self.height)
    }
}
