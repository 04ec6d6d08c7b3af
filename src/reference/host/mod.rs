//! The twins as stand-ins for their kernels ([`crate::gpu::Twin`]): from the buffers of a dispatch to the twin's float64, and back to
//! float32.
//!
//! An adapter does what the kernel does with the buffers, in every variant: it takes no more items than the dispatch has threads for, leaves
//! alone what the kernel leaves alone, and does not look at what the variant does not use. What it computes with them is the twin's.

mod density;
mod learn;
mod lift;
mod loss;
mod model;
mod pursuit;
mod raster;
mod screen;
mod sort;

use glam::{DMat3, DVec3, DVec4};

use super::{Params, View};
use crate::{
    gpu::Twin,
    scene::Camera,
    stages::{
        kernels,
        status::Status,
        types::{self, Frame},
    },
};

/// What an adapter says: nothing, or why the twin cannot stand in.
type Outcome = Result<(), String>;

macro_rules! twins {
    ($($pipeline:ident: $($kernel:ident),+;)+) => {
        /// All twins that can stand in.
        const TWINS: &[Twin] = &[$($(Twin {
            stage: stringify!($kernel),
            run: |call| $pipeline::$kernel(kernels::$kernel::Host::new(call)),
        }),+),+];
    };
}

// Not fma_rate: it measures a rate, which the host's is not.
twins! {
    density: density_apply, density_draw, density_image, density_noise, density_place, density_plan, density_score,
        density_weigh;
    learn: adam, project_backward, step_done;
    lift: lift_append, lift_count, lift_groups, lift_join, lift_pca, lift_points;
    loss: loss_sum, ssim_backward, ssim_forward;
    model: gather, recount;
    pursuit: pursuit_attenuate, pursuit_blur, pursuit_claim, pursuit_draw, pursuit_fit, pursuit_gain, pursuit_place, pursuit_quanta,
        pursuit_residual, pursuit_score;
    raster: blend, blend_backward, blend_backward_atomic, emit, median_depth, project, tile_ranges;
    screen: screen_backward, screen_draw, screen_project, screen_prune, screen_tiles;
    sort: dispatch_args, radix_downsweep, radix_spine, radix_upsweep, scan_apply, scan_reduce, scan_spine;
}

/// The twins of all stages but those that compute nothing.
pub fn twins() -> &'static [Twin] {
    TWINS
}

/// The twin of a stage.
pub fn twin(stage: &str) -> Option<Twin> {
    TWINS.iter().find(|twin| twin.stage == stage).copied()
}

fn wide(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&v| f64::from(v)).collect()
}

fn wide_rows<const N: usize>(rows: &[[f32; N]]) -> Vec<[f64; N]> {
    rows.iter().map(|row| row.map(f64::from)).collect()
}

fn failed(status: &[u32]) -> bool {
    Status::read(status).failed()
}

/// Index of the first Gaussian of a page and how many of its Gaussians the dispatch takes.
fn page(population: &[u32], segment: u32, page_first: u32, stride: u32, threads: usize) -> (usize, usize) {
    let first = population[segment as usize] + page_first;
    let there = population[segment as usize + 1].saturating_sub(first).min(stride);
    (first as usize, threads.min(there as usize))
}

/// Where the gradient records of a Gaussian are; `records_of` of `glsl/shared/records.glsl`.
fn records_of(i: usize, by_gaussian: bool, tile_counts: &[u32], first_slot: &[u32]) -> std::ops::Range<usize> {
    match (by_gaussian, tile_counts[i] as usize) {
        (true, _) => i..i + 1,
        // Of what is not seen the first slot means nothing.
        (false, 0) => 0..0,
        (false, tiles) => first_slot[i] as usize..first_slot[i] as usize + tiles,
    }
}

/// The Gaussians of a page, by place.
fn params(planes: [&[f32]; 3], count: usize, stride: u32, has_lobes: bool, sh_degree: u32) -> Params {
    let [geometry, sh, lobes] = planes.map(wide);
    let stride = stride as usize;
    let lobe_first = if has_lobes { 0 } else { stride };
    Params { geometry, sh, lobes, count, stride, lobe_first, lobe_stride: stride, sh_degree }
}

fn row(row: [f32; 4]) -> DVec4 {
    DVec4::from_array(row.map(f64::from))
}

fn view(v: &types::View) -> View {
    let [fx, fy, cx, cy, limit_x, limit_y] = [v.fx, v.fy, v.cx, v.cy, v.limit_x, v.limit_y].map(f64::from);
    View {
        row_x: row(v.row_x),
        row_y: row(v.row_y),
        row_z: row(v.row_z),
        eye: DVec3::from_array(v.eye.map(f64::from)),
        fx,
        fy,
        cx,
        cy,
        limit_x,
        limit_y,
        width: v.width,
        height: v.height,
    }
}

fn camera(v: &types::View) -> Camera {
    let rows = [v.row_x, v.row_y, v.row_z].map(row);
    let [fx, fy, cx, cy] = [v.fx, v.fy, v.cx, v.cy].map(f64::from);
    let [x, y, z] = rows.map(DVec4::truncate);
    let rotation = DMat3::from_cols(x, y, z).transpose();
    let translation = DVec3::from_array(rows.map(|row| row.w));
    Camera { width: v.width, height: v.height, fx, fy, cx, cy, rotation, translation }
}

/// The pixels of a frame in a buffer of a batch.
fn pixels(frame: &Frame) -> std::ops::Range<usize> {
    let first = frame.image_first as usize;
    first..first + frame.width as usize * frame.height as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::NAMES;

    #[test]
    fn every_stage_but_the_measure_of_rates_has_a_twin_that_stands_in() {
        let missing: Vec<_> = NAMES.iter().filter(|stage| twin(stage).is_none()).collect();
        assert_eq!(missing, [&"fma_rate"]);
        assert_eq!(twins().len(), NAMES.len() - 1);
    }
}
