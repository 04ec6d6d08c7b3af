//! Renders a view and differentiates it: all stages of the forward and the backward pass in their order.

use super::blend::{Blended, blend};
use super::blend_backward::blend_backward;
use super::emit::{Emitted, emit};
use super::project::{Projected, project};
use super::project_backward::{Gradients, project_backward};
use super::sort::{sort_depth, sort_isects};
use super::tile_ranges::tile_ranges;
use super::tiles::Tiling;
use super::{Background, Params, View};

/// Rendering options of the twins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// What of the colors to evaluate, as [`part`](crate::scene::color::ColorModel::part) has it; coefficients beyond it get no gradient.
    pub active_degree: u32,
    /// Mip-Splatting's opacity compensation.
    pub compensate: bool,
    /// Width of a tile, pixels; 0 counts as 1.
    pub tile_width: u32,
    /// Height of a tile, pixels; 0 counts as 1.
    pub tile_height: u32,
    /// Transmittance below which a pixel has its median Gaussian.
    pub median_threshold: f64,
}

impl Default for Options {
    /// The method's defaults, on tiles of 16 × 16.
    fn default() -> Self {
        Options { active_degree: 3, compensate: false, tile_width: 16, tile_height: 16, median_threshold: 0.5 }
    }
}

/// Input of the blend; `docs/design-notes.md` names the buffers.
#[derive(Debug, Clone, PartialEq)]
pub struct Intersections {
    /// The grid of tiles.
    pub tiling: Tiling,
    /// Gaussian index by depth rank.
    pub global_from_rank: Vec<u32>,
    /// Tile of each intersection, sorted by tile, front to back in each.
    pub isect_tiles: Vec<u32>,
    /// Slot of each intersection, in the order of `isect_tiles`.
    pub isect_slots: Vec<u32>,
    /// Gaussian index by slot.
    pub global_from_slot: Vec<u32>,
    /// First slot by Gaussian index.
    pub first_slot: Vec<u32>,
    /// First and end of a tile's sorted intersections.
    pub tile_ranges: Vec<[u32; 2]>,
}

impl Intersections {
    /// No intersections.
    pub fn none(tiling: Tiling) -> Self {
        Intersections {
            tiling,
            global_from_rank: vec![],
            isect_tiles: vec![],
            isect_slots: vec![],
            global_from_slot: vec![],
            first_slot: vec![],
            tile_ranges: vec![],
        }
    }

    /// Sorts and lists the tiles of visible splats. Depths are ∞ for Gaussians that are not visible.
    pub fn new(projected: &Projected, tiling: Tiling) -> Self {
        let Projected { splats, depths, tile_counts, .. } = projected;
        let global_from_rank = sort_depth(depths);
        let Emitted { tile_of_slot, global_from_slot, first_slot } =
            emit(splats, tile_counts, &global_from_rank, &tiling);
        let (isect_tiles, isect_slots) = sort_isects(&tile_of_slot);
        let tile_ranges = tile_ranges(&isect_tiles, tiling.count());
        Intersections { tiling, global_from_rank, isect_tiles, isect_slots, global_from_slot, first_slot, tile_ranges }
    }

    /// (slot, Gaussian index) of the pixel's tile, front to back.
    pub fn of_pixel(&self, column: u32, row: u32) -> impl Iterator<Item = (u32, u32)> {
        let [begin, end] = self.tile_ranges[self.tiling.tile_of(column, row) as usize];
        let slots = &self.isect_slots[begin as usize..end as usize];
        slots.iter().map(|&slot| (slot, self.global_from_slot[slot as usize]))
    }
}

/// A view, with all intermediate results.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendered {
    /// Result of [`project`].
    pub projected: Projected,
    /// Intersections, in the order of the blend.
    pub isects: Intersections,
    /// The image, and the blend's other results.
    pub blended: Blended,
}

/// Renders one view, from parameters to image.
pub fn render(params: &Params, view: &View, options: &Options, background: Background) -> Rendered {
    let projected = project(params, view, options);
    let tiling = Tiling::new(view.width, view.height, options);
    let isects = Intersections::new(&projected, tiling);
    let blended = blend(&projected.splats, &isects, background, options.median_threshold);
    Rendered { projected, isects, blended }
}

impl Rendered {
    /// Gradients of the parameters. `image_grad` is ∂loss/∂RGB by pixel; the other arguments are those of
    /// [`render`].
    pub fn backward(&self, params: &Params, view: &View, options: &Options, image_grad: &[[f64; 3]]) -> Gradients {
        let splats = &self.projected.splats;
        let isect_grads = blend_backward(splats, &self.isects, &self.blended.image, image_grad);
        project_backward(params, view, options, splats, &self.projected.tile_counts, &self.isects, &isect_grads)
    }
}
