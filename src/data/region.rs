//! Finds the region that a dataset's cameras look at: the scene's extent, and random first points if there
//! are none.

use glam::{DMat3, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::dataset::load_photos;
use super::photo::Image;
use super::photo::{Dataset, DatasetKind, Photo, Split};
use super::points::PointCloud;
use crate::Result;
use crate::scene::Camera;

/// Half the side of the cube around NeRF Synthetic scenes (3DGS draws its first points there).
const BLENDER_HALF: f64 = 1.3;
/// Nearest rendered distance (method, section 1), scene units.
pub const NEAR: f64 = 0.2;
/// Maximum distance of cameras from the cube, in half sides. Beyond it, with the lens of those scenes (fov
/// 40°), the cube would fill at most a third of a picture.
const BLENDER_REACH: f64 = 8.0;
/// See [`Dataset::extent`]. Cameras that stand around an object are about as far from each other's mean as from
/// it. The path of cameras along a street is longer than that by any factor, and positions that learn in
/// proportion to it would jump over all that a photo shows.
const SIGHTS: f64 = 1.5;
/// Maximum number of cameras and of points in the sample of [`Dataset::sight`].
const SIGHT_CAMERAS: usize = 256;
const SIGHT_POINTS: usize = 4096;
/// Maximum longer side of the silhouettes for carving points, px.
const SILHOUETTE_SIDE: u32 = 256;
/// The search is given up if less than one in this number of random points is inside the region.
const FOUND_NTH: usize = 1000;
/// Training cameras that must see a random point: two give depth, the third separates a surface from a
/// coincidence.
const WITNESSES: usize = 3;

/// A ball around the common target of the cameras.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Focus {
    /// World position.
    pub center: DVec3,
    /// Median distance of the cameras from the centre, scene units.
    pub radius: f64,
}

impl Dataset {
    /// The training cameras, or all cameras if none is for training.
    fn viewpoints(&self) -> Vec<Camera> {
        let training: Vec<Camera> = self.split(Split::Train).map(|(_, photo)| photo.camera).collect();
        if training.is_empty() { self.photos.iter().map(|photo| photo.camera).collect() } else { training }
    }

    /// 1.1 × the largest distance of a training camera from the mean of their centres (3DGS), but at most 1.5 ×
    /// the typical distance of what a camera sees, if there are sparse points; 0 if all cameras are at one place.
    pub fn extent(&self) -> f64 {
        let extent = 1.1 * spread(&self.viewpoints()).1;
        self.sight().map_or(extent, |sight| extent.min(SIGHTS * sight))
    }

    /// Typical distance of the sparse points that a training camera sees, scene units: the median over cameras
    /// of their medians. At most [`SIGHT_CAMERAS`] and [`SIGHT_POINTS`] are sampled. `None` if no camera sees a point.
    fn sight(&self) -> Option<f64> {
        let points = &self.points.as_ref()?.positions;
        let cameras = self.viewpoints();
        let points: Vec<DVec3> = spaced(points, SIGHT_POINTS).map(|&p| DVec3::from_array(p)).collect();
        let of_camera = |camera: &Camera| {
            let seen = points.iter().filter(|&&p| sees(camera, p));
            median(seen.map(|&p| p.distance(camera.eye())).collect())
        };
        median(spaced(&cameras, SIGHT_CAMERAS).filter_map(of_camera).collect())
    }

    /// The common target of the training cameras; `None` for a dataset without photos.
    pub fn focus(&self) -> Option<Focus> {
        let cameras = self.viewpoints();
        if cameras.is_empty() {
            return None;
        }
        let (mean_eye, spread) = spread(&cameras);
        let n = cameras.len() as f64;
        let forward = cameras.iter().map(axis).sum::<DVec3>() / n;
        // Parallel axes do not determine the depth. Then use a guess: the depth at which the outermost camera
        // still shares half of its picture with one in the middle. For a single camera it is one scene unit.
        let half_width = |c: &Camera| 0.5 * c.width as f64 / c.fx;
        let slope = cameras.iter().map(half_width).sum::<f64>() / n;
        let depth = if spread > 0.0 { spread / slope } else { 1.0 };
        let guess = mean_eye + depth * forward.normalize_or_zero();
        // Least squares over the squared distances to all axes; the guess has the weight of axes that differ
        // by √1e-3 radian = 1.8°. Below that angle their depth is mostly error.
        let weight = 1e-3;
        let (mut a, mut b) = (DMat3::from_diagonal(DVec3::splat(weight)), weight * guess);
        for camera in &cameras {
            let d = axis(camera);
            let across = DMat3::IDENTITY - DMat3::from_cols(d * d.x, d * d.y, d * d.z);
            a += across * (1.0 / n);
            b += across * camera.eye() / n;
        }
        // Positive definite: at least `weight` in every direction.
        let meeting = a.inverse() * b;
        let in_front = cameras.iter().filter(|c| c.project(meeting).2 > 0.0).count();
        // The axes of cameras that look outward meet behind them.
        let center = if 2 * in_front > cameras.len() { meeting } else { guess };
        let radius = median(cameras.iter().map(|c| c.eye().distance(center)).collect())?;
        Some(Focus { center, radius })
    }

    /// Whether the training cameras surround the cube of NeRF Synthetic scenes and look at it.
    pub(super) fn surrounds_the_blender_cube(&self) -> bool {
        self.focus().is_some_and(|Focus { center, radius }| {
            center.abs().max_element() <= BLENDER_HALF
                && (BLENDER_HALF..=BLENDER_REACH * BLENDER_HALF).contains(&radius)
        })
    }

    /// Number of training photos that see at least one of `points` (relative to `origin`): beyond the near
    /// plane and within the picture.
    pub fn seeing(&self, origin: DVec3, points: &[[f32; 3]]) -> usize {
        let world = |p: [f32; 3]| origin + DVec3::from_array(p.map(f64::from));
        let sees_one = |photo: &Photo| points.iter().any(|&p| sees(&photo.camera, world(p)));
        let photos: Vec<&Photo> = self.split(Split::Train).map(|(_, photo)| photo).collect();
        photos.par_iter().filter(|photo| sees_one(photo)).count()
    }

    /// `n` mid-grey random points for the first scene; the same seed gives the same points on every machine.
    /// For NeRF Synthetic they are uniform in its cube. Otherwise they are uniform in the part of the focus
    /// ball that at least three training cameras (all, if there are fewer) see. If that is nearly empty,
    /// because the cameras look outward, they lie along random pixels' rays instead. Without photos there are
    /// none.
    pub fn random_points(&self, n: usize, seed: u64) -> PointCloud {
        let cameras = self.viewpoints();
        let seen = |p: DVec3, by: usize| cameras.iter().filter(|c| sees(c, p)).take(by).count() == by;
        // The scene may fill the whole cube.
        let anywhere = self.kind == DatasetKind::Blender;
        self.draw(n, seed, |p, by| (anywhere || seen(p, by)).then_some([128; 3]))
    }

    /// [`Dataset::random_points`], carved by transparency: a point is dropped if a training photo is wholly
    /// transparent there. It gets the median color of the photos that are opaque there, at least three (all,
    /// if there are fewer). Pixels outside of a mask or lens prove nothing either way; with
    /// [`Alpha::Mask`](super::Alpha::Mask), transparent pixels are such pixels. `None` if no photo is
    /// transparent, or if the carved region is too small to find `n` points.
    ///
    /// # Errors
    /// Errors of the photos.
    pub fn carved_points(&self, n: usize, seed: u64) -> Result<Option<PointCloud>> {
        let photos: Vec<&Photo> = self.split(Split::Train).map(|(_, photo)| photo).collect();
        // Most datasets are opaque: skip decoding them.
        if !photos.iter().any(|photo| photo.shows_background()) {
            return Ok(None);
        }
        let silhouettes = silhouettes(&photos)?;
        if !silhouettes.iter().any(Silhouette::is_seen_through) {
            return Ok(None);
        }
        // Two are not enough along rays either: close to a camera, much of the space is only seen by the
        // camera opposite.
        let witnesses = WITNESSES.min(photos.len());
        let cloud = self.draw(n, seed, |p, _| shown(&silhouettes, p, witnesses));
        Ok((cloud.positions.len() == n).then_some(cloud))
    }

    /// Draws `n` random points, with colors from `judge`; fewer if it rejects nearly all. Its arguments are
    /// a world position, and the number of cameras that should see it, possibly 0.
    fn draw(&self, n: usize, seed: u64, judge: impl Fn(DVec3, usize) -> Option<[u8; 3]>) -> PointCloud {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut signed = move || 2.0 * rng.random::<f64>() - 1.0;
        let mut cloud = PointCloud { positions: Vec::with_capacity(n), colors: Vec::with_capacity(n) };
        let take = |p: DVec3, by: usize, cloud: &mut PointCloud| {
            if let Some(color) = judge(p, by) {
                cloud.positions.push(p.to_array());
                cloud.colors.push(color);
            }
        };
        let cameras = self.viewpoints();
        let witnesses = WITNESSES.min(cameras.len());
        if self.kind == DatasetKind::Blender {
            for _ in 0..n.saturating_mul(FOUND_NTH) {
                if cloud.positions.len() == n {
                    break;
                }
                take(BLENDER_HALF * DVec3::new(signed(), signed(), signed()), witnesses, &mut cloud);
            }
        } else if let Some(Focus { center, radius }) = self.focus() {
            // A hundred tries per point suffice for regions down to 1 % of the ball.
            for _ in 0..n.saturating_mul(100) {
                if cloud.positions.len() == n {
                    break;
                }
                let in_ball = DVec3::new(signed(), signed(), signed());
                if in_ball.length_squared() <= 1.0 {
                    take(center + radius * in_ball, witnesses, &mut cloud);
                }
            }
            let reach = radius.max(spread(&cameras).1).max(NEAR);
            for tries in 1..=n.saturating_mul(FOUND_NTH) {
                if cloud.positions.len() == n {
                    break;
                }
                let unit = |signed: f64| 0.5 + 0.5 * signed;
                let camera = &cameras[((unit(signed()) * cameras.len() as f64) as usize).min(cameras.len() - 1)];
                let (x, y) = (unit(signed()) * camera.width as f64, unit(signed()) * camera.height as f64);
                let p = camera.unproject(x, y, NEAR + 2.0 * reach * unit(signed()));
                // If after many tries no two cameras share anything, a single one must do.
                let by = if tries > n.saturating_mul(100) { 0 } else { 2.min(cameras.len()) };
                take(p, by, &mut cloud);
            }
        }
        cloud
    }
}

/// A photo without its background.
struct Silhouette {
    camera: Camera,
    /// 8-bit sRGB times alpha.
    rgb: Vec<u8>,
    /// `None` for masked pixels.
    alpha: Vec<Option<u8>>,
}

impl Silhouette {
    fn is_seen_through(&self) -> bool {
        self.alpha.contains(&Some(0))
    }
}

fn silhouettes(photos: &[&Photo]) -> Result<Vec<Silhouette>> {
    let over = |background| -> Result<Vec<Image>> {
        let mut small = Vec::with_capacity(photos.len());
        let reduced = |_: &Photo, image: Image| {
            image.reduced(super::images::fit([image.width, image.height], Some(SILHOUETTE_SIDE)))
        };
        load_photos(photos, background, reduced, |image| {
            small.push(image);
            Ok(())
        })?;
        Ok(small)
    };
    let pairs = over([0.0; 3])?.into_iter().zip(over([1.0; 3])?);
    let silhouette = |((black, white), photo): ((Image, Image), &&Photo)| {
        let counts = |i: usize| black.mask.as_ref().is_none_or(|mask| mask[i]);
        let reds = black.rgb.iter().zip(&white.rgb).step_by(3).enumerate();
        Silhouette {
            camera: photo.camera.resized(black.width, black.height),
            // Over white, a pixel is brighter in proportion to its transparency.
            alpha: reds.map(|(i, (&b, &w))| counts(i).then(|| 255 - w.saturating_sub(b))).collect(),
            rgb: black.rgb,
        }
    };
    Ok(pairs.zip(photos).map(silhouette).collect())
}

/// The channel-wise median color at a point, over the photos that are opaque there: at least `by`, which
/// must not be 0. `None` if a photo shows empty space there, or if too few are opaque.
fn shown(silhouettes: &[Silhouette], p: DVec3, by: usize) -> Option<[u8; 3]> {
    let mut seen: [Vec<u8>; 3] = Default::default();
    for Silhouette { camera, rgb, alpha } in silhouettes.iter().filter(|silhouette| sees(&silhouette.camera, p)) {
        let (x, y, _) = camera.project(p);
        let pixel = y as usize * camera.width as usize + x as usize;
        match alpha[pixel] {
            Some(0) => return None,
            Some(a) if a >= 128 => {
                for (seen, &value) in seen.iter_mut().zip(&rgb[3 * pixel..]) {
                    seen.push((u32::from(value) * 255 / u32::from(a)).min(255) as u8);
                }
            }
            _ => {}
        }
    }
    let median = |mut values: Vec<u8>| {
        values.sort_unstable();
        values[values.len() / 2]
    };
    (seen[0].len() >= by).then(|| seen.map(median))
}

/// The optical axis in world space, a unit vector.
fn axis(camera: &Camera) -> DVec3 {
    camera.rotation.row(2)
}

/// Mean of the centres, and the largest distance from it. Distances below a billionth of the coordinates
/// count as 0: that is rounding, and a hundredth of float32's resolution.
fn spread(cameras: &[Camera]) -> (DVec3, f64) {
    let mean = cameras.iter().map(Camera::eye).sum::<DVec3>() / cameras.len().max(1) as f64;
    let farthest = cameras.iter().map(|c| c.eye().distance(mean)).fold(0.0, f64::max);
    let largest = cameras.iter().map(|c| c.eye().abs().max_element()).fold(0.0, f64::max);
    (mean, if farthest > 1e-9 * largest { farthest } else { 0.0 })
}

/// At most `most` of these, evenly spaced.
fn spaced<T>(all: &[T], most: usize) -> impl Iterator<Item = &T> {
    all.iter().step_by(all.len().div_ceil(most).max(1))
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

fn sees(camera: &Camera, world: DVec3) -> bool {
    let (x, y, z) = camera.project(world);
    z > NEAR && x > 0.0 && x < camera.width as f64 && y > 0.0 && y < camera.height as f64
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::photo::PixelSource;
    use super::*;

    fn look(eye: DVec3, at: DVec3) -> Camera {
        let z = (at - eye).normalize();
        let x = z.cross(if z.y.abs() > 0.9 { DVec3::X } else { -DVec3::Y }).normalize();
        let rotation = DMat3::from_cols(x, z.cross(x), z).transpose();
        Camera { rotation, translation: -(rotation * eye), ..Camera::new(40, 30, 35.0) }
    }

    fn dataset(cameras: Vec<Camera>) -> Dataset {
        let image = Arc::new(Image { width: 40, height: 30, rgb: vec![0; 3600], mask: None });
        let photos = cameras.into_iter().enumerate().map(|(i, camera)| Photo {
            name: i.to_string(),
            camera,
            split: Split::Train,
            pixels: PixelSource::Memory(image.clone()),
        });
        Dataset { photos: photos.collect(), ..Dataset::default() }
    }

    fn witnesses(data: &Dataset, p: [f64; 3]) -> usize {
        data.photos.iter().filter(|photo| sees(&photo.camera, DVec3::from_array(p))).count()
    }

    fn ring(center: DVec3, radius: f64) -> Vec<DVec3> {
        let at = |i: usize| {
            let (sin, cos) = (i as f64 * std::f64::consts::TAU / 24.0).sin_cos();
            center + DVec3::new(radius * cos, 0.1 * (i % 3) as f64, radius * sin)
        };
        (0..24).map(at).collect()
    }

    /// A street of 400 units, with houses 5 to 15 units from its middle.
    #[test]
    fn the_extent_of_a_street_is_that_of_a_photo() {
        let eye = |i: u32| DVec3::new(f64::from(i) * 2.0, 0.0, 0.0);
        let mut street = dataset((0..200).map(|i| look(eye(i), eye(i) + DVec3::Z)).collect());
        assert!((street.extent() - 1.1 * 199.0).abs() < 1e-9, "no point is known: {}", street.extent());
        let house = |i: u32| [f64::from(i) * 0.1, 0.0, 5.0 + f64::from(i * 7 % 11)];
        let cloud = |positions: Vec<[f64; 3]>| Some(PointCloud { colors: vec![[0; 3]; positions.len()], positions });
        street.points = cloud((0..4000).map(house).collect());
        // The median of distances between 5 and 15 and a fifth more, as far as a photo is wide.
        assert!((1.5 * 9.0..1.5 * 13.0).contains(&street.extent()), "{}", street.extent());
        street.points = cloud(vec![[0.0, 0.0, -5.0]]);
        assert!(street.extent() > 200.0, "a point that no camera sees");
    }

    #[test]
    fn cameras_around_an_object_meet_in_it() {
        let center = DVec3::new(5.0, -2.0, 7.0);
        let data = dataset(ring(center, 4.0).into_iter().map(|eye| look(eye, center)).collect());
        let focus = data.focus().unwrap();
        // The guess, off by at most four units, has a weight of 1e-3 against more than a third.
        assert!(focus.center.distance(center) < 0.02, "{focus:?}");
        assert!((focus.radius - 4.0).abs() < 0.05);
        assert!((data.extent() - 4.4).abs() < 0.1, "{}", data.extent());
        let known =
            Dataset { points: Some(PointCloud { positions: vec![center.to_array()], colors: vec![[0; 3]] }), ..data };
        assert!((known.extent() - 4.4).abs() < 0.1, "{}", known.extent());
        let data = known;
        let cloud = data.random_points(2000, 1);
        assert_eq!((cloud.positions.len(), cloud.colors.len()), (2000, 2000));
        assert!(cloud.positions.iter().all(|&p| witnesses(&data, p) >= 3));
        assert_eq!(cloud, data.random_points(2000, 1));
        assert_ne!(cloud, data.random_points(2000, 2));
    }

    #[test]
    fn cameras_that_share_nothing_have_points_of_their_own_all_over_their_pictures() {
        let axes = [DVec3::X, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Z];
        let data = dataset(axes.into_iter().map(|axis| look(5.0 * axis, 9.0 * axis)).collect());
        let cloud = data.random_points(400, 3);
        for photo in &data.photos {
            let seen = cloud.positions.iter().map(|&p| photo.camera.project(DVec3::from_array(p)));
            let seen: Vec<f64> =
                seen.filter(|&(x, y, z)| z > NEAR && x.min(y) > 0.0 && x < 40.0 && y < 30.0).map(|at| at.0).collect();
            // A quarter of 400 each; of those a quarter in the outer eighths of the picture: 100 ± 8.7 and 25
            // ± 4.3.
            assert!((60..140).contains(&seen.len()), "{}", seen.len());
            assert!(seen.iter().filter(|&&x| !(5.0..35.0).contains(&x)).count() > 10);
        }
    }

    #[test]
    fn only_cameras_around_the_cube_are_blenders() {
        let around = |center, radius| {
            dataset(ring(center, radius).into_iter().map(|eye| look(eye, center)).collect())
                .surrounds_the_blender_cube()
        };
        assert!(around(DVec3::ZERO, 4.03) && around(DVec3::new(1.0, -1.0, 0.5), 2.0));
        assert!(!around(DVec3::ZERO, 1.0) && !around(DVec3::ZERO, 4.03e-4) && !around(DVec3::ZERO, 40.0));
        assert!(!around(DVec3::new(2.0, 0.0, 0.0), 4.0));
        assert!(!dataset(Vec::new()).surrounds_the_blender_cube());
    }

    #[test]
    fn photos_that_see_nothing_are_counted() {
        let data = dataset(ring(DVec3::ZERO, 4.0).into_iter().map(|eye| look(eye, DVec3::ZERO)).collect());
        assert_eq!(data.seeing(DVec3::ZERO, &[[0.0; 3]]), 24);
        assert_eq!(data.seeing(DVec3::ZERO, &[[0.0, 90.0, 0.0], [0.0; 3]]), 24);
        assert_eq!(data.seeing(DVec3::ZERO, &[[0.0, 90.0, 0.0]]), 0);
        assert_eq!(data.seeing(DVec3::ZERO, &[]), 0);
        // In front of and just beyond a camera's near plane; the nine cameras opposite see it too.
        let at = |distance: f32| data.seeing(DVec3::ZERO, &[[4.0 - distance, 0.0, 0.0]]);
        assert_eq!((at(0.19), at(0.21)), (9, 10));
        let near = ring(DVec3::ZERO, 4.0).into_iter().map(|eye| look(1e-4 * eye, DVec3::ZERO));
        let near = dataset(near.collect());
        assert_eq!(near.seeing(DVec3::ZERO, &[[0.0; 3]]), 0);
    }

    #[test]
    fn points_lie_before_the_cameras_in_every_arrangement() {
        let center = DVec3::new(1.0, 2.0, 3.0);
        let forward: Vec<Camera> = (0..20)
            .map(|i| DVec3::new((i % 5) as f64 * 0.3, (i / 5) as f64 * 0.3, 0.0))
            .map(|eye| look(eye, eye + DVec3::Z))
            .collect();
        let outward = ring(center, 0.5).into_iter().map(|eye| look(eye, eye + (eye - center))).collect();
        let same_place = (0..9).map(|i| look(center, center + DVec3::new(1.0, 0.0, 0.1 * i as f64))).collect();
        let single = vec![look(center, DVec3::ZERO)];
        let opposite = vec![look(DVec3::ZERO, -DVec3::Z), look(DVec3::Z, 2.0 * DVec3::Z)];
        for (cameras, least) in [(forward, 3), (outward, 2), (same_place, 2), (single, 1), (opposite, 1)] {
            let data = dataset(cameras);
            let cloud = data.random_points(300, 7);
            assert_eq!(cloud.positions.len(), 300);
            for &p in &cloud.positions {
                assert!(witnesses(&data, p) >= least, "{p:?} is seen by {}", witnesses(&data, p));
            }
        }
        assert_eq!(dataset(Vec::new()).random_points(10, 0), PointCloud::default());
        assert_eq!(dataset(Vec::new()).extent(), 0.0);
        // The rounding error in the mean of seven equal places is not a distance.
        let place = DVec3::new(0.1, 0.7, -3.3);
        let turned = |i| look(place, place + DVec3::new(1.0, 0.1 * f64::from(i), 0.0));
        assert_eq!(dataset((0..7).map(turned).collect()).extent(), 0.0);
    }
}
