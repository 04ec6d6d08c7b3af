//! Makes a point cloud like that of structure from motion.

use std::{
    collections::HashMap,
    f64::consts::{FRAC_1_SQRT_2, PI, TAU},
};

use glam::{DVec2, DVec3, dvec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::{
    BuiltinPhoto,
    studio::{FLOOR_RADIUS, Object, Studio},
};

/// Standard deviation of a surface point's error, scene units: 0.2 % of the extent (1.1 times the largest
/// distance of a training camera from their mean, 4.76), as in structure from motion.
const POINT_NOISE: f64 = 0.0095;
/// Points per area on the objects relative to the floor: detail attracts features.
const OBJECT_DENSITY: f64 = 3.0;
/// Least distance of the first points on the floor, scene units; leaves room for about a hundred points in
/// total.
const FIRST_SPACING: f64 = 0.5;
/// A point counts as visible in a photograph if it is at least this far from the border, pixels; below:
/// visible views that it needs.
const POINT_MARGIN: f64 = 1.0;
const POINT_VIEWS: usize = 3;

/// A point drawn on a surface, before and after noise.
struct Draw {
    point: DVec3,
    normal: DVec3,
    noisy: DVec3,
    on_object: bool,
}

/// Surface points of `studio` that at least [`POINT_VIEWS`] training photographs see, with their mean colors there.
///
/// Dart throwing: a draw is kept if no kept point is too near. The distance shrinks whenever too few draws
/// fit, so that every prefix covers everything.
pub(super) fn surface_points(
    studio: &Studio,
    seed: u64,
    photos: &[BuiltinPhoto],
    count: usize,
) -> (Vec<[f32; 3]>, Vec<[u8; 3]>) {
    let training: Vec<&BuiltinPhoto> = photos.iter().filter(|p| !p.is_test).collect();
    let mut kept = Darts::new(FIRST_SPACING);
    let (mut positions, mut colors) = (Vec::with_capacity(count.min(1 << 20)), Vec::with_capacity(count.min(1 << 20)));
    let mut next = 0u64;
    while positions.len() < count {
        let batch = positions.len().max(1024) as u64;
        let candidates: Vec<(Draw, [u8; 3])> = (next..next + batch)
            .into_par_iter()
            .filter_map(|k| draw(studio, seed, k))
            // Cheap test first, then the expensive visibility test.
            .filter(|draw| kept.has_room(draw))
            .filter_map(|draw| photographed(studio, &draw, &training).map(|color| (draw, color)))
            .collect();
        next += batch;
        let before = positions.len();
        for (draw, color) in candidates {
            if positions.len() < count && kept.has_room(&draw) {
                kept.insert(&draw);
                positions.push(draw.noisy.as_vec3().to_array());
                colors.push(color);
            }
        }
        // Lines that miss and hidden places fail too; a sixteenth is well below their share.
        if positions.len() - before < batch as usize / 16 {
            kept = kept.finer();
        }
    }
    (positions, colors)
}

/// Draw `k`, uniform by area except for [`OBJECT_DENSITY`]. Random lines through the bounding sphere of a
/// convex body enter it uniformly over its surface, and hit it in proportion to a quarter of its area
/// (Cauchy). `None` for a line that misses.
fn draw(studio: &Studio, seed: u64, k: u64) -> Option<Draw> {
    let objects = &studio.objects;
    // Every draw has its own random stream, so that draws can run in parallel.
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(1 + k);
    let disc = |o: &Object| PI * o.shape.bounding_radius().powi(2) * OBJECT_DENSITY;
    let floor = 0.25 * PI * FLOOR_RADIUS * FLOOR_RADIUS;
    let total = floor + objects.iter().map(disc).sum::<f64>();
    let u: [f64; 5] = rng.random();
    let circle = |u: f64| DVec2::from_angle(TAU * u);

    let mut pick = u[0] * total - floor;
    let (point, normal, on_object) = if pick < 0.0 {
        ((circle(u[2]) * FLOOR_RADIUS * u[1].sqrt()).extend(0.0), DVec3::Z, false)
    } else {
        let object = objects.iter().find(|o| {
            pick -= disc(o);
            pick < 0.0
        })?;
        let z = 2.0 * u[1] - 1.0;
        let d = (circle(u[2]) * (1.0 - z * z).sqrt()).extend(z);
        let (right, up) = d.any_orthonormal_pair();
        let radius = object.shape.bounding_radius();
        let off = circle(u[3]) * (radius * u[4].sqrt());
        let o = object.shape.centre() + right * off.x + up * off.y - d * (2.0 * radius);
        let (t, normal) = object.shape.enter(o, d)?;
        (o + t * d, normal, true)
    };
    let noisy = point + POINT_NOISE * dvec3(gauss(&mut rng), gauss(&mut rng), gauss(&mut rng));
    Some(Draw { point, normal, noisy, on_object })
}

/// The mean color of a drawn point in the photographs that see it; `None` if these are too few.
fn photographed(studio: &Studio, draw: &Draw, training: &[&BuiltinPhoto]) -> Option<[u8; 3]> {
    let (mut views, mut sum) = (0usize, DVec3::ZERO);
    for photo in training {
        let camera = &photo.camera;
        let inside = |(x, y, z): (f64, f64, f64)| {
            let within = |v: f64, size: u32| v >= POINT_MARGIN && v <= size as f64 - POINT_MARGIN;
            z > 0.0 && within(x, camera.width) && within(y, camera.height)
        };
        let seen = camera.project(draw.point);
        if !inside(seen) || !inside(camera.project(draw.noisy)) {
            continue;
        }
        let toward = (camera.eye() - draw.point).normalize();
        // A surface seen at less than 6° cannot be matched.
        if draw.normal.dot(toward) < 0.1 || studio.enter(draw.point + 1e-6 * draw.normal, toward).is_some() {
            continue;
        }
        let at = 3 * (seen.1 as usize * camera.width as usize + seen.0 as usize);
        sum += dvec3(photo.rgb[at] as f64, photo.rgb[at + 1] as f64, photo.rgb[at + 2] as f64);
        views += 1;
    }
    (views >= POINT_VIEWS).then(|| (sum / views as f64).round().to_array().map(|c| c as u8))
}

/// Kept points in a grid; a cell is as large as the least distance between points.
struct Darts {
    spacing: f64,
    cells: HashMap<[i32; 3], Vec<DVec3>>,
}

impl Darts {
    fn new(spacing: f64) -> Darts {
        Darts { spacing, cells: HashMap::new() }
    }

    fn cell(&self, p: DVec3) -> [i32; 3] {
        (p / self.spacing).floor().to_array().map(|v| v as i32)
    }

    fn has_room(&self, draw: &Draw) -> bool {
        let spacing = if draw.on_object { self.spacing / OBJECT_DENSITY.sqrt() } else { self.spacing };
        let [x, y, z] = self.cell(draw.point);
        (0..27).all(|k| {
            let cell = [x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1];
            self.cells.get(&cell).is_none_or(|points| points.iter().all(|p| p.distance(draw.point) >= spacing))
        })
    }

    fn insert(&mut self, draw: &Draw) {
        self.cells.entry(self.cell(draw.point)).or_default().push(draw.point);
    }

    /// Moves the points to a finer grid, with room for about twice their number.
    fn finer(self) -> Darts {
        let mut finer = Darts::new(self.spacing * FRAC_1_SQRT_2);
        for point in self.cells.into_values().flatten() {
            finer.cells.entry(finer.cell(point)).or_default().push(point);
        }
        finer
    }
}

/// A standard normal number (Box and Muller).
pub(super) fn gauss(rng: &mut ChaCha8Rng) -> f64 {
    let (a, b) = (1.0 - rng.random::<f64>(), rng.random::<f64>());
    (-2.0 * a.ln()).sqrt() * (TAU * b).cos()
}
