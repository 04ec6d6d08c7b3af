//! Finds the nearest patch in each cell of each photo.

use glam::DVec3;
use rayon::prelude::*;

use super::patches::Patch;
use crate::data::{NEAR, Photo};
use crate::scene::Camera;

/// Cells of the longer side of a picture: about the distance between sparse points.
const CELLS: u32 = 32;
/// A cell that shows no patch.
const NOTHING: u32 = u32::MAX;
/// Patches of a block, which follow each other and so are close to each other.
const BLOCK: usize = 16;
/// Balls are larger by this share, so that rounding leaves nothing out.
const MARGIN: f64 = 1e-9;

/// A photo in cells.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Look {
    /// By cell, the nearest patch, or the patch of the nearest cell that has one. All [`NOTHING`] if the photo shows none.
    pub(super) patches: Vec<u32>,
}

impl Look {
    /// Whether the photo shows a patch; then every cell has one.
    pub(super) fn shows_any(&self) -> bool {
        self.patches.first().is_some_and(|&patch| patch != NOTHING)
    }

    /// Patches that are shown, in order, each with its number of cells.
    pub(super) fn shown(&self) -> Vec<(u32, usize)> {
        let mut patches: Vec<u32> = self.patches.iter().copied().filter(|&patch| patch != NOTHING).collect();
        patches.sort_unstable();
        patches.chunk_by(|a, b| a == b).map(|same| (same[0], same.len())).collect()
    }
}

/// Looks of `photos`, in their order.
pub(super) fn looks(photos: &[Photo], patches: &[Patch]) -> Vec<Look> {
    let balls = balls(patches);
    photos.par_iter().map(|photo| look(&photo.camera, patches, &balls)).collect()
}

/// Center (world) and radius.
type Ball = (DVec3, f64);

/// Balls around blocks of patches, then around pairs of these balls, and so on up to one.
fn balls(patches: &[Patch]) -> Vec<Vec<Ball>> {
    let of = |patch: &Patch| (patch.center, patch.radius);
    let blocks = patches.chunks(BLOCK).map(|block| ball(&block.iter().map(of).collect::<Vec<_>>()));
    let mut levels = vec![blocks.collect::<Vec<_>>()];
    while let Some(last) = levels.last().filter(|last| last.len() > 1) {
        levels.push(last.chunks(2).map(ball).collect());
    }
    levels
}

/// A ball around others.
fn ball(of: &[Ball]) -> Ball {
    let center = of.iter().map(|(center, _)| center).sum::<DVec3>() / of.len() as f64;
    let radius = of.iter().map(|(at, radius)| at.distance(center) + radius).fold(0.0, f64::max);
    (center, radius * (1.0 + MARGIN))
}

fn look(camera: &Camera, patches: &[Patch], balls: &[Vec<Ball>]) -> Look {
    let longer = f64::from(camera.width.max(camera.height));
    let side = |pixels: u32| (f64::from(pixels) * f64::from(CELLS) / longer).round().max(1.0) as u32;
    let small = camera.resized(side(camera.width), side(camera.height));
    let cells = small.pixels() as usize;
    let mut picture = Picture { camera: small, nearest: vec![(f64::INFINITY, NOTHING); cells], patches, balls };
    let last = balls.len() - 1;
    (0..balls[last].len()).for_each(|ball| picture.draw(last, ball));
    let mut patches: Vec<u32> = picture.nearest.into_iter().map(|(_, patch)| patch).collect();
    fill(&mut patches, small.width as usize);
    Look { patches }
}

/// A picture with a pixel for each cell.
struct Picture<'a> {
    camera: Camera,
    /// By cell, depth and number of the nearest patch.
    nearest: Vec<(f64, u32)>,
    patches: &'a [Patch],
    balls: &'a [Vec<Ball>],
}

impl Picture<'_> {
    /// Draws the patches in a ball, the nearer half first. Balls that are not in sight are left out.
    fn draw(&mut self, level: usize, number: usize) {
        let ball = self.balls[level][number];
        if !sees(&self.camera, ball) || self.hides(ball) {
            return;
        }
        if level == 0 {
            let first = number * BLOCK;
            (first..self.patches.len().min(first + BLOCK)).for_each(|patch| self.draw_patch(patch));
            return;
        }
        let below = &self.balls[level - 1];
        let depth = |number: &usize| self.camera.project(below[*number].0).2;
        let mut halves: Vec<usize> = (2 * number..below.len().min(2 * number + 2)).collect();
        halves.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
        halves.into_iter().for_each(|number| self.draw(level - 1, number));
    }

    fn draw_patch(&mut self, number: usize) {
        let Patch { center, radius, .. } = self.patches[number];
        let (x, y, z) = self.camera.project(center);
        if z <= NEAR {
            return;
        }
        let across = radius * self.focal() / z;
        // Whole cells within the disk, and the cell of its center.
        let cells =
            |at: f64| ((at - across + 0.5).floor().min(at.floor()), (at + across - 0.5).floor().max(at.floor()));
        for cell in self.cells([cells(x), cells(y)]) {
            let nearest = &mut self.nearest[cell];
            // Among equally near patches the first counts.
            if (z, number as u32) < *nearest {
                *nearest = (z, number as u32);
            }
        }
    }

    /// Whether all patches in a ball are behind those that were drawn.
    fn hides(&self, (center, radius): Ball) -> bool {
        let Camera { rotation, translation, fx, fy, cx, cy, .. } = self.camera;
        let at = rotation * center + translation;
        let (near, far) = (at.z - radius, at.z + radius);
        if near <= NEAR {
            return false;
        }
        // Disks are drawn with the larger focal length.
        let cells = |across: f64, focal: f64, middle: f64| {
            let more = (self.focal() - focal) * radius;
            let (low, high) = (focal * (across - radius) - more, focal * (across + radius) + more);
            let (low, high) = (low / if low < 0.0 { near } else { far }, high / if high > 0.0 { near } else { far });
            ((low + middle).floor(), (high + middle).floor())
        };
        self.cells([cells(at.x, fx, cx), cells(at.y, fy, cy)]).all(|cell| self.nearest[cell].0 < near)
    }

    fn focal(&self) -> f64 {
        self.camera.fx.max(self.camera.fy)
    }

    /// The cells from the first to the last column and row that are in the picture.
    fn cells(&self, [columns, rows]: [(f64, f64); 2]) -> impl Iterator<Item = usize> + use<> {
        let clamped = |(first, last): (f64, f64), side: u32| {
            first.max(0.0) as usize..(last + 1.0).clamp(0.0, f64::from(side)) as usize
        };
        let (columns, width) = (clamped(columns, self.camera.width), self.camera.width as usize);
        clamped(rows, self.camera.height).flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }
}

/// Whether a ball may be in the picture: no plane through the eye and an edge has it wholly outside.
fn sees(camera: &Camera, (center, radius): Ball) -> bool {
    let at = camera.rotation * center + camera.translation;
    let inside = |across: f64, focal: f64, middle: f64, side: u32| {
        [(focal, middle), (-focal, f64::from(side) - middle)]
            .iter()
            .all(|&(x, z)| x * across + z * at.z >= -radius * x.hypot(z))
    };
    at.z > NEAR - radius
        && inside(at.x, camera.fx, camera.cx, camera.width)
        && inside(at.y, camera.fy, camera.cy, camera.height)
}

/// Gives cells without a patch that of the nearest cell with one.
fn fill(cells: &mut [u32], columns: usize) {
    let rows = cells.len() / columns;
    while cells.contains(&NOTHING) {
        let before = cells.to_vec();
        for (at, cell) in cells.iter_mut().enumerate().filter(|(_, cell)| **cell == NOTHING) {
            let (row, column) = (at / columns, at % columns);
            let beside = [
                (column > 0).then(|| at - 1),
                (row > 0).then(|| at - columns),
                (column + 1 < columns).then_some(at + 1),
                (row + 1 < rows).then_some(at + columns),
            ];
            *cell = beside.iter().flatten().map(|&at| before[at]).find(|&patch| patch != NOTHING).unwrap_or(NOTHING);
        }
        if cells == before {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera::new(320, 160, 160.0);

    fn patch(x: f64, y: f64, z: f64, radius: f64) -> Patch {
        Patch { center: DVec3::new(x, y, z), radius, points: 1 }
    }

    fn seen(patches: &[Patch]) -> Look {
        look(&CAMERA, patches, &balls(patches))
    }

    #[test]
    fn a_near_patch_hides_a_far_one_and_empty_cells_follow_their_neighbours() {
        // Cells of 10 pixels. The first patch is behind the second, the third behind the camera, the fourth beside the picture.
        let found = seen(&[
            patch(0.0, 0.0, 20.0, 5.0),
            patch(0.0, 0.0, 4.0, 0.3),
            patch(0.0, 0.0, -4.0, 1.0),
            patch(90.0, 0.0, 20.0, 1.0),
        ]);
        assert_eq!(found.patches.len(), 32 * 16);
        let at = |column: usize, row: usize| found.patches[32 * row + column];
        // The near one covers 16 ± 1.2 cells, the far one 16 ± 4.
        assert_eq!([at(16, 8), at(15, 8), at(18, 8), at(13, 8)], [1, 1, 0, 0]);
        assert_eq!([at(0, 0), at(31, 15), at(16, 0)], [0; 3]);
        assert!(seen(&[patch(0.0, 0.0, -1.0, 0.1)]).patches.iter().all(|&patch| patch == NOTHING));
        assert!(seen(&[]).patches.iter().all(|&patch| patch == NOTHING));
    }

    #[test]
    fn balls_leave_out_only_what_is_not_in_sight() {
        // Three walls of patches around the camera: with the balls, and with all blocks drawn in order.
        let turn = |i: u32| f64::from(i) * std::f64::consts::TAU / 200.0;
        let walls: Vec<Patch> = (0..3)
            .flat_map(|wall| (0..4000).map(move |i| (10.0 + 3.0 * f64::from(wall), i)))
            .map(|(far, i)| patch(far * turn(i).cos(), f64::from(i / 200) * 0.4 - 4.0, far * turn(i).sin(), 0.4))
            .collect();
        let everywhere = vec![vec![(DVec3::ZERO, f64::INFINITY); walls.len().div_ceil(BLOCK)]];
        let found = seen(&walls);
        assert_eq!(found, look(&CAMERA, &walls, &everywhere));
        // The nearest wall covers the picture but for a few gaps.
        assert!(found.shown().len() > 100 && found.shown().iter().all(|(patch, _)| *patch < 8000));
        // Once the nearest wall is drawn, most blocks of the others are hidden.
        let balls = balls(&walls);
        let nearest = vec![(10.0, 0); 32 * 16];
        let picture = Picture { camera: CAMERA.resized(32, 16), nearest, patches: &walls, balls: &balls };
        let hidden =
            |blocks: std::ops::Range<usize>| balls[0][blocks].iter().filter(|ball| picture.hides(**ball)).count();
        assert_eq!([hidden(500..750) > 0, hidden(0..250) > 0], [true, false]);
    }
}
