//! Adapters that let the twins replace their kernels ([`crate::gpu::Twin`]): from the buffers of a dispatch
//! to the twin's float64, and back to float32.
//!
//! An adapter treats the buffers like the kernel, in every variant. It takes no more items than the dispatch
//! has threads for, leaves unchanged what the kernel leaves unchanged, and does not read buffers that the
//! variant does not use. The twin does the computation.

use glam::{DMat3, DVec3, DVec4};

use super::{Params, View};
use crate::{
    gpu::Twin,
    scene::{Camera, layout},
    stages::{
        status::Status,
        types::{self, Frame},
    },
};

/// Result of an adapter: nothing, or why the twin cannot replace the kernel.
type Outcome = Result<(), String>;

/// The adapters of a module, each by its stage's name.
macro_rules! twins {
    ($($kernel:ident),+) => {
        pub(super) const TWINS: &[crate::gpu::Twin] = &[$(crate::gpu::Twin {
            stage: stringify!($kernel),
            run: |call| $kernel(crate::stages::kernels::$kernel::Host::new(call)),
        }),+];
    };
}

mod bands;
mod density;
mod exposure;
mod learn;
mod lift;
mod loss;
mod model;
mod pursuit;
mod raster;
mod screen;
mod sort;

/// The twins of all stages except fma_rate, which measures a rate that the host does not have.
pub fn twins() -> Vec<Twin> {
    [
        bands::TWINS,
        density::TWINS,
        exposure::TWINS,
        learn::TWINS,
        lift::TWINS,
        loss::TWINS,
        model::TWINS,
        pursuit::TWINS,
        raster::TWINS,
        screen::TWINS,
        sort::TWINS,
    ]
    .concat()
}

/// The twin of a stage.
pub fn twin(stage: &str) -> Option<Twin> {
    twins().into_iter().find(|twin| twin.stage == stage)
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

/// Index of the first Gaussian of a page, and the number of its Gaussians that the dispatch takes.
fn page(population: &[u32], segment: u32, page_first: u32, stride: u32, threads: usize) -> (usize, usize) {
    let first = population[segment as usize] + page_first;
    let there = population[segment as usize + 1].saturating_sub(first).min(stride);
    (first as usize, threads.min(there as usize))
}

/// Range of the gradient records of a Gaussian; `records_of` of `glsl/shared/records.glsl`.
fn records_of(i: usize, by_gaussian: bool, tile_counts: &[u32], first_slot: &[u32]) -> std::ops::Range<usize> {
    match (by_gaussian, tile_counts[i] as usize) {
        (true, _) => i..i + 1,
        // If a Gaussian is not visible its first slot is undefined.
        (false, 0) => 0..0,
        (false, tiles) => first_slot[i] as usize..first_slot[i] as usize + tiles,
    }
}

/// The Gaussians of a page, by place.
fn params(pages: [&[[f32; 4]]; 3], count: usize, stride: u32, has_lobes: bool, sh_degree: u32) -> Params {
    let stride = stride as usize;
    let [geometry, sh, lobes] = pages.map(|page| {
        let planes = 4 * page.len() / stride.max(1);
        layout::planes(page, planes, stride).map(f64::from).collect()
    });
    let lobe_first = if has_lobes { 0 } else { stride };
    Params { geometry, sh, lobes, count, stride, lobe_first, lobe_stride: stride, sh_degree }
}

fn row(row: [f32; 4]) -> DVec4 {
    DVec4::from_array(row.map(f64::from))
}

fn view(v: &types::View) -> View {
    let [fx, fy, cx, cy] = [v.fx, v.fy, v.cx, v.cy].map(f64::from);
    let [[low_x, low_y], [high_x, high_y]] = [v.slope_low, v.slope_high].map(|slope| slope.map(f64::from));
    View {
        row_x: row(v.row_x),
        row_y: row(v.row_y),
        row_z: row(v.row_z),
        eye: DVec3::from_array(v.eye.map(f64::from)),
        fx,
        fy,
        cx,
        cy,
        slope_x: [low_x, high_x],
        slope_y: [low_y, high_y],
        width: v.width,
        height: v.height,
        near: v.near.into(),
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
