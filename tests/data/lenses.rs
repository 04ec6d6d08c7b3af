//! Tests every camera model: pictures of a sky, made with each lens, must become pinhole pictures of that
//! sky. The lenses here map pixels to rays, by separate formulas; glint maps rays to pixels.

use std::path::Path;

use glam::{DMat3, DQuat, DVec2, DVec3};
use glint::data::{Dataset, DatasetOptions, Split};
use image::{Rgb, RgbImage};

use crate::variants::put;

const WIDTH: u32 = 96;
const HEIGHT: u32 = 72;

/// Rounding to bytes twice is 1/255; the same again for sampling between pixels and at edges (0.0048 in all
/// measured). Leaving out a coefficient of 0.01 would give 0.01.
const TOLERANCE: f64 = 2.0 / 255.0;

/// A color by direction that changes slowly: by at most 1.5 per radian.
fn sky(d: DVec3) -> [f64; 3] {
    [0.5 + 0.3 * (2.0 * d.x + d.y).sin(), 0.5 + 0.3 * (2.0 * d.y - d.z).cos(), 0.5 + 0.3 * (1.5 * d.z + d.x).sin()]
}

/// The root of a function that grows from 0, up to `far`.
fn inverse(value: f64, far: f64, f: impl Fn(f64) -> f64) -> Option<f64> {
    let (mut low, mut high) = (0.0, far);
    if f(far) < value {
        return None;
    }
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if f(middle) < value { low = middle } else { high = middle }
    }
    Some(0.5 * (low + high))
}

/// The ray at an angle θ from the axis in the direction of `p`.
fn at_angle(p: DVec2, angle: f64) -> DVec3 {
    let side = p.normalize_or_zero() * angle.sin();
    DVec3::new(side.x, side.y, angle.cos())
}

/// Solves distort(q) = p by Newton's method with finite differences.
fn newton(p: DVec2, distort: impl Fn(DVec2) -> DVec2) -> Option<DVec2> {
    let mut q = p;
    for _ in 0..50 {
        let (here, h) = (distort(q), 1e-6);
        let by_x = (distort(q + DVec2::new(h, 0.0)) - here) / h;
        let by_y = (distort(q + DVec2::new(0.0, h)) - here) / h;
        q += glam::DMat2::from_cols(by_x, by_y).inverse() * (p - here);
    }
    (distort(q) - p).length().lt(&1e-9).then_some(q)
}

fn tangential(q: DVec2, to_y: f64, to_x: f64) -> DVec2 {
    let r2 = q.length_squared();
    DVec2::new(
        2.0 * to_y * q.x * q.y + to_x * (r2 + 2.0 * q.x * q.x),
        to_y * (r2 + 2.0 * q.y * q.y) + 2.0 * to_x * q.x * q.y,
    )
}

type Unproject = fn(DVec2) -> Option<DVec3>;

/// A model, its parameters without focal length and principal point, the number of focal lengths, their value
/// in pixels, and the ray at a position in focal lengths from the principal point.
const LENSES: [(&str, &[f64], usize, f64, Unproject); 17] = [
    ("SIMPLE_PINHOLE", &[], 1, 70.0, |p| Some(p.extend(1.0))),
    ("PINHOLE", &[], 2, 70.0, |p| Some(p.extend(1.0))),
    ("SIMPLE_RADIAL", &[-0.12], 1, 70.0, |p| {
        let r = inverse(p.length(), 1.6, |r| r * (1.0 - 0.12 * r * r))?;
        Some((p.normalize_or_zero() * r).extend(1.0))
    }),
    // A quarter of the picture is beyond the file's edge.
    ("SIMPLE_RADIAL", &[0.6], 1, 70.0, |p| {
        let r = inverse(p.length(), 3.0, |r| r * (1.0 + 0.6 * r * r))?;
        Some((p.normalize_or_zero() * r).extend(1.0))
    }),
    ("RADIAL", &[0.1, -0.02], 1, 70.0, |p| {
        let r = inverse(p.length(), 1.5, |r| r * (1.0 + 0.1 * r * r - 0.02 * r.powi(4)))?;
        Some((p.normalize_or_zero() * r).extend(1.0))
    }),
    ("OPENCV", &[0.06, -0.02, 0.01, -0.004], 2, 70.0, |p| {
        let distort = |q: DVec2| {
            let r2 = q.length_squared();
            q * (1.0 + 0.06 * r2 - 0.02 * r2 * r2) + tangential(q, 0.01, -0.004)
        };
        newton(p, distort).map(|q| q.extend(1.0))
    }),
    ("OPENCV_FISHEYE", &[0.02, -0.01, 0.004, -0.001], 2, 45.0, |p| {
        let bent = |t: f64| t * (1.0 + 0.02 * t * t - 0.01 * t.powi(4) + 0.004 * t.powi(6) - 0.001 * t.powi(8));
        inverse(p.length(), 1.7, bent).map(|angle| at_angle(p, angle))
    }),
    ("FULL_OPENCV", &[0.3, -0.05, 0.003, -0.002, 0.01, 0.2, -0.02, 0.004], 2, 70.0, |p| {
        let distort = |q: DVec2| {
            let r2 = q.length_squared();
            let above = 1.0 + 0.3 * r2 - 0.05 * r2 * r2 + 0.01 * r2.powi(3);
            let below = 1.0 + 0.2 * r2 - 0.02 * r2 * r2 + 0.004 * r2.powi(3);
            q * (above / below) + tangential(q, 0.003, -0.002)
        };
        newton(p, distort).map(|q| q.extend(1.0))
    }),
    ("FOV", &[0.9], 2, 60.0, |p| {
        let r = (p.length() * 0.9).tan() / (2.0 * 0.45f64.tan());
        (p.length() * 0.9 < 1.5).then(|| (p.normalize_or_zero() * r).extend(1.0))
    }),
    ("SIMPLE_RADIAL_FISHEYE", &[0.03], 1, 45.0, |p| {
        inverse(p.length(), 2.0, |t| t * (1.0 + 0.03 * t * t)).map(|angle| at_angle(p, angle))
    }),
    ("RADIAL_FISHEYE", &[0.03, -0.004], 1, 45.0, |p| {
        inverse(p.length(), 2.0, |t| t * (1.0 + 0.03 * t * t - 0.004 * t.powi(4))).map(|angle| at_angle(p, angle))
    }),
    ("THIN_PRISM_FISHEYE", &[0.02, -0.003, 0.004, -0.003, 0.001, -2e-4, 0.006, -0.005], 2, 45.0, |p| {
        let distort = |q: DVec2| {
            let r2 = q.length_squared();
            let radial = 1.0 + 0.02 * r2 - 0.003 * r2 * r2 + 0.001 * r2.powi(3) - 2e-4 * r2.powi(4);
            q * radial + tangential(q, 0.004, -0.003) + r2 * DVec2::new(0.006, -0.005)
        };
        newton(p, distort).map(|q| at_angle(q, q.length()))
    }),
    (
        "RAD_TAN_THIN_PRISM_FISHEYE",
        &[0.02, -0.003, 0.001, -2e-4, 1e-5, -1e-6, 0.004, -0.003, 0.006, 5e-4, -0.005, 3e-4],
        2,
        45.0,
        |p| {
            let distort = |q: DVec2| {
                let t2 = q.length_squared();
                let k = [0.02, -0.003, 0.001, -2e-4, 1e-5, -1e-6];
                let factor: f64 = 1.0 + (1..).zip(k).map(|(i, k)| k * t2.powi(i)).sum::<f64>();
                let m = q * factor;
                let r2 = m.length_squared();
                // Its p0 = 0.004 multiplies x², its p1 = −0.003 multiplies y².
                let prism = DVec2::new(0.006 * r2 + 5e-4 * r2 * r2, -0.005 * r2 + 3e-4 * r2 * r2);
                m + tangential(m, -0.003, 0.004) + prism
            };
            newton(p, distort).map(|q| at_angle(q, q.length()))
        },
    ),
    ("SIMPLE_DIVISION", &[-0.25], 1, 60.0, |p| Some((p / (1.0 - 0.25 * p.length_squared())).extend(1.0))),
    ("DIVISION", &[0.15], 2, 60.0, |p| Some((p / (1.0 + 0.15 * p.length_squared())).extend(1.0))),
    ("FISHEYE", &[], 2, 45.0, |p| Some(at_angle(p, p.length()))),
    ("EUCM", &[0.6, 1.2], 2, 50.0, |p| {
        // Khomutenko et al. 2016, equation of the unprojection.
        let (alpha, beta, r2) = (0.6, 1.2, p.length_squared());
        let root = 1.0 - (2.0 * alpha - 1.0) * beta * r2;
        let z = (1.0 - beta * alpha * alpha * r2) / (alpha * root.sqrt() + 1.0 - alpha);
        (root > 0.0).then(|| p.extend(z))
    }),
];

fn turns() -> [DMat3; 3] {
    [(0.3, -0.2, 0.5), (-0.8, 0.4, 0.1), (0.1, 0.9, -0.6)]
        .map(|(x, y, z)| DMat3::from_quat(DQuat::from_xyzw(x, y, z, 1.0).normalize()))
}

fn picture(width: u32, height: u32, rotation: DMat3, ray: impl Fn(DVec2) -> Option<DVec3>) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let ray = ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
        // White outside of the lens's image.
        let color = ray.map_or([1.0; 3], |ray| sky(rotation.transpose() * ray.normalize()));
        Rgb(color.map(|v| (v * 255.0).round() as u8))
    })
}

/// Writes a dataset of three photos in COLMAP's text form.
fn write(folder: &Path, camera: &str, photo: impl Fn(DMat3) -> RgbImage) {
    let mut images = String::new();
    for (i, rotation) in turns().iter().enumerate() {
        let q = DQuat::from_mat3(rotation);
        images += &format!("{i} {} {} {} {} {i} 0.5 1 1 p{i}.png\n\n", q.w, q.x, q.y, q.z);
        std::fs::create_dir_all(folder.join("images")).unwrap();
        photo(*rotation).save(folder.join(format!("images/p{i}.png"))).unwrap();
    }
    put(&folder.join("sparse/0/cameras.txt"), camera);
    put(&folder.join("sparse/0/images.txt"), images);
}

/// The largest error of a valid pixel, and the fraction of masked pixels.
fn judge(data: &Dataset) -> (f64, f64) {
    let (mut worst, mut left_out, mut all) = (0.0f64, 0usize, 0usize);
    for (photo, image) in data.photos.iter().zip(data.load_images().unwrap()) {
        for (i, rgb) in image.rgb.chunks_exact(3).enumerate() {
            all += 1;
            if image.mask.as_ref().is_some_and(|mask| !mask[i]) {
                left_out += 1;
                continue;
            }
            let (x, y) = (i % image.width as usize, i / image.width as usize);
            let at = photo.camera.unproject(x as f64 + 0.5, y as f64 + 0.5, 1.0) - photo.camera.eye();
            let truth = sky(at.normalize());
            let error = |c: usize| (f64::from(rgb[c]) / 255.0 - truth[c]).abs();
            worst = (0..3).map(error).fold(worst, f64::max);
        }
    }
    (worst, left_out as f64 / all as f64)
}

#[test]
fn every_lens_is_taken_out() {
    for (model, rest, focals, focal, unproject) in LENSES {
        let folder = tempfile::tempdir().unwrap();
        let (f, c) = (DVec2::new(focal, if focals == 2 { 1.07 * focal } else { focal }), DVec2::new(49.5, 34.0));
        let focal = if focals == 2 { vec![f.x, f.y] } else { vec![f.x] };
        let params: Vec<String> = focal.iter().chain(&[c.x, c.y]).chain(rest).map(|v| v.to_string()).collect();
        let camera = format!("1 {model} {WIDTH} {HEIGHT} {}\n", params.join(" "));
        write(folder.path(), &camera, |rotation| picture(WIDTH, HEIGHT, rotation, |at| unproject((at - c) / f)));
        let data = Dataset::open(folder.path(), &DatasetOptions::default()).unwrap();
        let (worst, left_out) = judge(&data);
        eprintln!("{model} {rest:?}: {worst:.4}, {:.1} % left out, {:?}", 100.0 * left_out, data.notes);
        let camera = data.photos[0].camera;
        assert_eq!([camera.fx, camera.fy, camera.cx, camera.cy], [f.x, f.y, c.x, c.y], "{model}");
        assert!(worst < TOLERANCE, "{model} {rest:?}: {worst}");
        let some_left_out = model == "SIMPLE_RADIAL" && rest[0] > 0.0;
        assert!(if some_left_out { (0.15..0.5).contains(&left_out) } else { left_out < 0.2 }, "{model}: {left_out}");
        let text = data.notes.join("; ");
        assert_eq!(text.contains("does not count"), data.outside > 0.01, "{model}: {text}");
        assert_eq!(text.contains("3 fisheye photos"), model.contains("FISHEYE"), "{model}: {text}");
        let across = 2.0 * (0.5 * f64::from(WIDTH) / f.x).atan().to_degrees();
        assert_eq!(text.contains(&format!(", {across:.0}° across")), model.contains("FISHEYE"), "{model}: {text}");
        assert_eq!(data.undistorted, !model.contains("PINHOLE"));
        // Downscaled too: a pixel becomes the mean of its part of the sky.
        let small = DatasetOptions { max_size: Some(WIDTH / 2), ..Default::default() };
        let (worst, _) = judge(&Dataset::open(folder.path(), &small).unwrap());
        assert!(worst < TOLERANCE, "{model} {rest:?}, reduced: {worst}");
    }
}

#[test]
fn a_panorama_becomes_the_faces_of_a_cube() {
    use std::f64::consts::{PI, TAU};
    let folder = tempfile::tempdir().unwrap();
    let (width, height) = (200, 100);
    write(folder.path(), "1 EQUIRECTANGULAR 200 100 200 100\n", |rotation| {
        picture(width, height, rotation, |at| {
            let (longitude, latitude) = ((at.x / 200.0 - 0.5) * TAU, (0.5 - at.y / 100.0) * PI);
            // Longitude 0 is forward, latitude above the horizon is up, which is −y.
            Some(DVec3::new(latitude.cos() * longitude.sin(), -latitude.sin(), latitude.cos() * longitude.cos()))
        })
    });
    let options = DatasetOptions { holdout: glint::data::Holdout::Every(2), ..Default::default() };
    let data = Dataset::open(folder.path(), &options).unwrap();
    let names: Vec<&str> = data.photos.iter().map(|photo| &photo.name[..]).collect();
    let faces = ["front", "right", "back", "left", "up", "down"];
    let expected: Vec<String> = (0..3).flat_map(|i| faces.map(|face| format!("p{i}-{face}.png"))).collect();
    assert_eq!(names, expected);
    // All faces of a photo are in the same split.
    assert_eq!(data.split(Split::Test).map(|(i, _)| i).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5, 12, 13, 14, 15, 16, 17]);
    assert!(data.notes[0].contains("3 photos of the whole sphere"), "{:?}", data.notes);
    let eyes: Vec<DVec3> = data.photos[..6].iter().map(|photo| photo.camera.eye()).collect();
    assert!(eyes.iter().all(|eye| eye.distance(eyes[0]) < 1e-12));
    // A face is 64 pixels wide, with 2 units: in its middle it has the panorama's pixels per radian.
    assert!(data.photos.iter().all(|photo| photo.camera.width == 64 && photo.camera.fx == 32.0));
    let (worst, left_out) = judge(&data);
    assert!(worst < TOLERANCE, "{worst}");
    assert_eq!(left_out, 0.0);
}
