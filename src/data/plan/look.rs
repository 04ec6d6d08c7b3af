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
/// Patches that are tested for sight together; they follow each other, and so are close to each other.
const BLOCK: usize = 64;

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
    let balls: Vec<(DVec3, f64)> = patches.chunks(BLOCK).map(ball).collect();
    photos.par_iter().map(|photo| look(&photo.camera, patches, &balls)).collect()
}

/// A ball around patches.
fn ball(of: &[Patch]) -> (DVec3, f64) {
    let center = of.iter().map(|patch| patch.center).sum::<DVec3>() / of.len() as f64;
    (center, of.iter().map(|patch| patch.center.distance(center) + patch.radius).fold(0.0, f64::max))
}

fn look(camera: &Camera, patches: &[Patch], balls: &[(DVec3, f64)]) -> Look {
    let longer = f64::from(camera.width.max(camera.height));
    let side = |pixels: u32| (f64::from(pixels) * f64::from(CELLS) / longer).round().max(1.0) as u32;
    let size = [side(camera.width), side(camera.height)];
    let small = camera.resized(size[0], size[1]);
    let focal = small.fx.max(small.fy);
    let [columns, rows] = size.map(|cells| cells as usize);
    let mut nearest = vec![(f64::INFINITY, NOTHING); columns * rows];
    let mut draw = |center: DVec3, radius: f64, patch: u32| {
        let (x, y, z) = small.project(center);
        if z <= NEAR {
            return;
        }
        let across = radius * focal / z;
        // Whole cells within the disk, and the cell of its center.
        let cells = |at: f64, most: usize| {
            let (first, last) =
                ((at - across + 0.5).floor().min(at.floor()), (at + across - 0.5).floor().max(at.floor()));
            first.max(0.0) as usize..(last + 1.0).clamp(0.0, most as f64) as usize
        };
        for row in cells(y, rows) {
            for column in cells(x, columns) {
                let at = &mut nearest[row * columns + column];
                if z < at.0 {
                    *at = (z, patch);
                }
            }
        }
    };
    for (block, (center, radius)) in balls.iter().enumerate() {
        if sees(&small, *center, *radius) {
            let first = block * BLOCK;
            for (i, patch) in patches[first..].iter().take(BLOCK).enumerate() {
                draw(patch.center, patch.radius, (first + i) as u32);
            }
        }
    }
    let mut patches: Vec<u32> = nearest.into_iter().map(|(_, patch)| patch).collect();
    fill(&mut patches, columns);
    Look { patches }
}

/// Whether a ball may be in the picture: no plane through the eye and an edge has it wholly outside.
fn sees(camera: &Camera, center: DVec3, radius: f64) -> bool {
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
        look(&CAMERA, patches, &patches.chunks(BLOCK).map(ball).collect::<Vec<_>>())
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
    fn blocks_leave_out_only_what_is_not_in_sight() {
        // Patches around the camera in all directions, in order of their angle: with and without blocks of 64.
        let ring: Vec<Patch> = (0..1000)
            .map(|i| {
                let angle = f64::from(i) * 0.00628;
                patch(10.0 * angle.cos(), f64::from(i % 7) - 3.0, 10.0 * angle.sin(), 0.05)
            })
            .collect();
        let everywhere = vec![(DVec3::ZERO, f64::INFINITY); ring.len().div_ceil(BLOCK)];
        assert_eq!(seen(&ring), look(&CAMERA, &ring, &everywhere));
        let blocks: Vec<_> = ring.chunks(BLOCK).map(ball).filter(|(at, radius)| sees(&CAMERA, *at, *radius)).collect();
        assert!((2..10).contains(&blocks.len()), "{}", blocks.len());
    }
}
