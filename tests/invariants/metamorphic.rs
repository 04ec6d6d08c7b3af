//! Changes of scene and camera with a known effect on image and gradients, tested without a twin.
//!
//! For other subgroup sizes, also run with LP_NATIVE_VECTOR_WIDTH=512 (llvmpipe: 16 lanes instead of 8); the
//! tests do not depend on it.

use glam::{DMat3, DQuat, DVec3, EulerRot};
use glint::{
    pipelines::raster::TileShape,
    reference::{Params, random_camera, random_scene},
    scene::{
        Camera, Gaussians, Scene,
        layout::{self, Array},
    },
};

use super::{
    common::Gpu,
    probe::{Blob, Probe, Setup, Shot, base, ripple},
};

const WIDTH: u32 = 96;
const HEIGHT: u32 = 72;
/// Degree of the harmonics. It is 0 in tests that rotate the world, which would rotate coefficients too.
const DEGREE: u32 = 2;

fn ripples(camera: &Camera) -> Vec<[f64; 3]> {
    (0..camera.pixels() as usize).map(ripple).collect()
}

fn setup() -> Setup {
    Setup { degree: DEGREE, ..Default::default() }
}

/// Picks Gaussians of both parts: the new i is the old `base[i]` or `extra[i]`.
fn pick_scene(scene: &Scene, base: &[usize], extra: &[usize]) -> Scene {
    let mut out = Scene { base: scene.base.reordered(base), ..scene.clone() };
    if let (Some(to), Some(from)) = (&mut out.supplement, &scene.supplement) {
        to.gaussians = from.gaussians.reordered(extra);
        to.lobes.directions = extra.iter().map(|&i| from.lobes.directions[i]).collect();
        to.lobes.widths = extra.iter().map(|&i| from.lobes.widths[i]).collect();
        to.lobes.sharpness = extra.iter().map(|&i| from.lobes.sharpness[i]).collect();
    }
    out
}

/// Gradients of Gaussian i by parameter: geometry, then SH, then lobe.
fn gradient_of(p: &Params, i: usize) -> Vec<f64> {
    let planes = |a: &[f64], stride: usize, i: usize| {
        (0..a.len() / stride.max(1)).map(|q| a[q * stride + i]).collect::<Vec<_>>()
    };
    let mut all = [planes(&p.geometry, p.stride, i), planes(&p.sh, p.stride, i)].concat();
    if i >= p.lobe_first {
        all.extend(planes(&p.lobes, p.lobe_stride, i - p.lobe_first));
    }
    all
}

/// Relative L2 error of the worst group of parameters.
fn apart(a: &Params, b: &Params) -> f64 {
    let mut worst = 0.0f64;
    for group in layout::groups(a.sh_degree) {
        let first = if group.array == Array::Lobes { a.lobe_first } else { 0 };
        let of = |p: &Params| p.group(&group, first, p.count - first).collect::<Vec<_>>();
        let (x, y) = (of(a), of(b));
        let size = y.iter().map(|v| v * v).sum::<f64>().sqrt();
        let difference = x.iter().zip(&y).map(|(u, v)| (u - v).powi(2)).sum::<f64>().sqrt();
        assert!(difference.is_finite());
        if size > 0.0 {
            worst = worst.max(difference / size);
        }
    }
    worst
}

/// Fraction of pixels that differ by more than `tolerance`, and the largest difference of the others.
fn images_apart(a: &Shot, b: &Shot, tolerance: f64) -> (f64, f64) {
    let (mut beyond, mut worst) = (0, 0.0f64);
    for (x, y) in a.image.iter().zip(&b.image) {
        let d = x.iter().zip(y).map(|(u, v)| f64::from((u - v).abs())).fold(0.0, f64::max);
        if d > tolerance { beyond += 1 } else { worst = worst.max(d) }
    }
    (f64::from(beyond) / a.image.len() as f64, worst)
}

/// Without ties in depth the order of blending is the same, and so is every bit; only slots differ.
#[test]
fn the_order_in_which_gaussians_are_stored_changes_nothing() {
    let camera = random_camera(WIDTH, HEIGHT);
    let scene = random_scene(21, 700, 200, DEGREE);
    let shuffle = |n: usize, step: usize| (0..n).map(|i| (i * step + 11) % n).collect::<Vec<_>>();
    let (base, extra) = (shuffle(700, 33), shuffle(200, 77));
    let mut probe = Probe::new(900, &camera, setup());
    let before = probe.shoot(&scene, &camera, &ripples(&camera));
    let after = probe.shoot(&pick_scene(&scene, &base, &extra), &camera, &ripples(&camera));
    assert_eq!(before.image, after.image);
    assert_eq!(before.depth, after.depth);
    for (i, &from) in base.iter().chain(&extra).enumerate() {
        let from = if i < 700 { from } else { 700 + from };
        assert_eq!(gradient_of(&after.gradients, i), gradient_of(&before.gradients, from), "Gaussian {i}");
    }
}

/// Behind the camera, outside the image, too faint to see, behind two walls of α = 0.99 each: everything is
/// equal to the last bit.
#[test]
fn hidden_and_unseen_gaussians_change_nothing() {
    let camera = random_camera(WIDTH, HEIGHT);
    let mut scene = random_scene(22, 400, 100, 0);
    scene.supplement = None;
    let wall = |z: f64| Blob {
        mean: camera.unproject(48.0, 36.0, z),
        scale: [1e4, 1e4, 1e4],
        logit: 9.0,
        ..Default::default()
    };
    let walls = base(&[wall(13.0), wall(13.1), wall(13.2)]);
    let thing = Blob { scale: [0.3; 3], logit: 3.0, ..Default::default() };
    let unseen = base(&[
        Blob { mean: camera.unproject(48.0, 36.0, -3.0), ..thing },
        Blob { mean: camera.unproject(4000.0, 36.0, 3.0), ..thing },
        Blob { mean: camera.unproject(48.0, -2000.0, 3.0), ..thing },
        Blob { mean: camera.unproject(48.0, 36.0, 3.0), logit: -7.0, ..thing },
        Blob { mean: camera.unproject(48.0, 36.0, 14.0), scale: [5.0; 3], ..thing },
        Blob { mean: camera.unproject(20.0, 30.0, 20.0), scale: [50.0; 3], ..thing },
    ]);
    let join = |parts: &[&Gaussians]| {
        let mut all = Gaussians::default();
        parts.iter().for_each(|&part| all.append(part.clone()));
        Scene { base: all, ..Default::default() }
    };
    let mut probe = Probe::new(512, &camera, Setup::default());
    let bare = probe.shoot(&join(&[&scene.base, &walls]), &camera, &ripples(&camera));
    let full = probe.shoot(&join(&[&scene.base, &walls, &unseen]), &camera, &ripples(&camera));
    // The walls do stop every pixel, and Gaussians behind them are in its tiles.
    assert!(bare.image.iter().all(|p| p[3] < 0.02) && full.tile_counts[407] > 0 && full.tile_counts[408] > 0);
    assert_eq!(bare.image, full.image);
    assert_eq!(bare.depth, full.depth);
    for i in 0..403 {
        assert_eq!(gradient_of(&bare.gradients, i), gradient_of(&full.gradients, i), "Gaussian {i}");
    }
    for i in 403..409 {
        assert!(gradient_of(&full.gradients, i).iter().all(|&g| g == 0.0), "Gaussian {i}");
    }
}

/// Gaussians with an unclamped Jacobian in the picture of `camera`: up to 0.15 of its sides beyond them.
fn unclamped(g: &Gaussians, camera: &Camera) -> Vec<usize> {
    let (w, h) = (f64::from(camera.width), f64::from(camera.height));
    let within = |&i: &usize| {
        let (x, y, _) = camera.project(DVec3::from_array(g.means[i].map(f64::from)));
        (-0.15 * w..1.15 * w).contains(&x) && (-0.15 * h..1.15 * h).contains(&y)
    };
    (0..g.len()).filter(within).collect()
}

/// A crop is a camera with a principal point off its middle, or outside. For Gaussians that neither picture
/// clamps, it shows the same as the whole picture, with the same gradients.
#[test]
fn crops_are_the_image_and_have_its_gradients() {
    let camera = random_camera(WIDTH, HEIGHT);
    let all = random_scene(23, 1200, 400, DEGREE);
    let mut probe = Probe::new(1600, &camera, setup());
    let (mut seen, mut beyond, mut off_centre) = (0, 0, 0);
    for (x, y, w, h) in [(0, 0, 40, 32), (40, 0, 56, 32), (0, 32, 33, 40), (33, 32, 63, 40), (72, 48, 24, 24)] {
        let crop = Camera { width: w, height: h, cx: camera.cx - f64::from(x), cy: camera.cy - f64::from(y), ..camera };
        let lobed = &all.supplement.as_ref().unwrap().gaussians;
        let scene = pick_scene(&all, &unclamped(&all.base, &crop), &unclamped(lobed, &crop));
        let inside = |r: u32, c: u32| (y..y + h).contains(&r) && (x..x + w).contains(&c);
        let all_pixels = || (0..HEIGHT).flat_map(|r| (0..WIDTH).map(move |c| (r, c)));
        let ripple_of = |(r, c): (u32, u32)| ripple((r * WIDTH + c) as usize);
        let grad =
            all_pixels().map(|(r, c)| if inside(r, c) { ripple_of((r, c)) } else { [0.0; 3] }).collect::<Vec<_>>();
        let part: Vec<_> = all_pixels().filter(|&(r, c)| inside(r, c)).map(ripple_of).collect();
        let whole = probe.shoot(&scene, &camera, &grad);
        let shot = probe.shoot(&scene, &crop, &part);
        // Limits about the principal point would have clamped these.
        let tangent = 1.3 * f64::from(w) / (2.0 * camera.fx);
        let ahead = |mean: &[f32; 3]| camera.rotation * DVec3::from_array(mean.map(f64::from)) + camera.translation;
        let clamped = |(i, mean)| shot.tile_counts[i] > 0 && (ahead(mean).x / ahead(mean).z).abs() > tangent;
        off_centre += scene.base.means.iter().enumerate().filter(|&of| clamped(of)).count();
        for (r, c) in all_pixels().filter(|&(r, c)| inside(r, c)) {
            let (a, b) = (shot.image[((r - y) * w + c - x) as usize], whole.image[(r * WIDTH + c) as usize]);
            seen += 1;
            // x − cx is rounded differently: 1e-6 px of centre, 1e-5 of color, or an α at its threshold.
            beyond += u32::from((0..4).any(|k| (a[k] - b[k]).abs() > 2e-5));
        }
        let d = apart(&shot.gradients, &whole.gradients);
        println!("{w} × {h} at {x}, {y}: gradients differ by {d:.1e}");
        // One pixel in a hundred may be at a threshold; taking α = 1/255 or not is 4e-3 of a pixel's
        // gradients, hence 1e-3 of all.
        assert!(d < 1e-3, "{w} × {h} at {x}, {y}: {d}");
    }
    println!(
        "crops: {beyond} of {seen} pixels differ, {off_centre} Gaussians lie beyond limits about the principal point"
    );
    assert!(seen == WIDTH * HEIGHT + 24 * 24 && beyond < seen / 100 && off_centre > 50);
}

/// The image is equal to the last bit, gradients up to the order of summing tiles.
#[test]
fn the_shape_of_tiles_changes_nothing() {
    let gpu = Gpu::new();
    let lanes = gpu.info().subgroup_size;
    let camera = random_camera(WIDTH, HEIGHT);
    let scene = random_scene(24, 900, 300, DEGREE);
    let mut shots: Vec<(TileShape, Shot)> = Vec::new();
    for (w, h) in [(8, 8), (8, 16), (4, 16), (2, 32), (1, 64), (8, 4), (8, 1), (16, 8), (16, 16), (32, 4)] {
        let Some(tile) = TileShape::new(w, h, lanes) else { continue };
        let mut probe = Probe::new(1200, &camera, Setup { tile: Some(tile), ..setup() });
        shots.push((tile, probe.shoot(&scene, &camera, &ripples(&camera))));
    }
    assert!(shots.len() >= 5, "{lanes} lanes");
    let (first, want) = &shots[0];
    for (tile, shot) in &shots[1..] {
        assert!(shot.image == want.image && shot.depth == want.depth, "{tile:?} against {first:?}");
        // Some hundred terms in another order: 1e-6 of their size; a tenth of that size may remain in the
        // sum.
        let d = apart(&shot.gradients, &want.gradients);
        println!("{tile:?}: gradients differ by {d:.1e}");
        assert!(d < 2e-5, "{tile:?}: {d}");
    }
    // Shapes that a subgroup cannot cover are refused.
    for (w, h) in [(0, 8), (8, 0), (3, 8), (5, 5), (128, 1), (8, 8 * lanes), (u32::MAX, u32::MAX)] {
        assert_eq!(TileShape::new(w, h, lanes), None, "{w} × {h}");
    }
}

/// Needles half a pixel wide that start 3e5 px outside the image: their spans have a rounding of 0.1 px, and
/// must cover every pixel that the blend takes, for any tiles.
#[test]
fn needles_from_far_away_have_all_their_tiles() {
    let camera = random_camera(WIDTH, HEIGHT);
    let blobs: Vec<Blob> = (0..120)
        .map(|i| {
            let angle = 0.05236 * f64::from(i) + 0.01;
            let (x, y) = (f64::from(i * 37 % 96), f64::from(i * 29 % 72));
            let reach = 3e5;
            let mean = camera.unproject(x + reach * angle.cos(), y + reach * angle.sin(), 4.0);
            let along = camera.unproject(x, y, 4.0) - mean;
            let q = DQuat::from_rotation_arc(DVec3::X, along.normalize());
            // Across the image near the ellipse's middle, at nearly full width.
            let scale = [along.length(), 1e-4, 1e-4];
            Blob { mean, scale, quat: [q.w, q.x, q.y, q.z].map(|v| v as f32), logit: 1.0, ..Default::default() }
        })
        .collect();
    assert_tiles_hold_every_pixel(&blobs);
}

/// Discs of 1e6 px with edges through the image: α = 1/255 is located to within a pixel at best.
#[test]
fn discs_from_far_away_have_all_their_tiles() {
    let camera = random_camera(WIDTH, HEIGHT);
    let q = DQuat::from_mat3(&camera.rotation.transpose());
    let blobs: Vec<Blob> = (0..240)
        .map(|i| {
            // Half of them from straight above and below.
            let angle =
                if i < 120 { 0.05236 * f64::from(i) + 0.01 } else { (f64::from(i) + 0.5) * std::f64::consts::PI };
            let logit = 1.0 + 0.02 * i as f32;
            // The distance in standard deviations at which α is 1/255.
            let reach = (2.0 * (255.0 / (1.0 + (-f64::from(logit)).exp())).ln()).sqrt();
            let (x, y) = (f64::from(i * 37 % 96), 0.1 * f64::from(i * 29 % 720));
            let mean = camera.unproject(x + 1e6 * reach * angle.cos(), y + 1e6 * reach * angle.sin(), 4.0);
            let scale = [4e6 / camera.fx, 4e6 / camera.fy, 1e-4];
            Blob { mean, scale, quat: [q.w, q.x, q.y, q.z].map(|v| v as f32), logit, ..Default::default() }
        })
        .collect();
    assert_tiles_hold_every_pixel(&blobs);
}

/// A pixel that the blend takes but a tile does not list differs for another tile shape.
fn assert_tiles_hold_every_pixel(blobs: &[Blob]) {
    let gpu = Gpu::new();
    let lanes = gpu.info().subgroup_size;
    let camera = random_camera(WIDTH, HEIGHT);
    let scene = Scene { base: base(blobs), ..Default::default() };
    let shots: Vec<Shot> = [(8, 8), (8, 16), (2, 32), (1, 64), (8, 1)]
        .into_iter()
        .filter_map(|(w, h)| TileShape::new(w, h, lanes))
        .map(|tile| {
            let mut probe = Probe::new(256, &camera, Setup { tile: Some(tile), ..Default::default() });
            probe.shoot(&scene, &camera, &ripples(&camera))
        })
        .collect();
    assert!(shots.len() >= 4 && shots[0].tile_counts.iter().filter(|&&t| t > 0).count() > 60);
    for shot in &shots[1..] {
        let off = shot.image.iter().zip(&shots[0].image).filter(|(a, b)| a != b).count();
        assert!(off == 0, "{off} pixels differ");
    }
}

/// World and camera moved, rotated and scaled together: p ↦ s (Q p + t).
struct Similarity {
    turn: DQuat,
    shift: DVec3,
    scale: f64,
}

impl Similarity {
    fn camera(&self, c: &Camera) -> Camera {
        let rotation = c.rotation * DMat3::from_quat(self.turn).transpose();
        let eye = self.scale * (self.turn * c.eye() + self.shift);
        Camera { rotation, translation: -(rotation * eye), ..*c }
    }

    fn scene(&self, scene: &Scene) -> Scene {
        let mut out = scene.clone();
        let supplement = out.supplement.as_mut().unwrap();
        for d in &mut supplement.lobes.directions {
            *d = (self.turn * DVec3::from_array(d.map(f64::from))).as_vec3().to_array();
        }
        for g in [&mut out.base, &mut supplement.gaussians] {
            for m in &mut g.means {
                let moved = self.scale * (self.turn * DVec3::from_array(m.map(f64::from)) + self.shift);
                *m = moved.as_vec3().to_array();
            }
            for q in &mut g.quats {
                let [w, x, y, z] = q.map(f64::from);
                let turned = self.turn * DQuat::from_xyzw(x, y, z, w);
                *q = [turned.w, turned.x, turned.y, turned.z].map(|v| v as f32);
            }
            g.log_scales.iter_mut().flatten().for_each(|s| *s += self.scale.ln() as f32);
        }
        out
    }

    /// Converts gradients of the moved scene to the first: covectors rotate by Q and shrink by s.
    fn back(&self, p: &Params) -> Params {
        let mut out = p.clone();
        let back = self.turn.inverse();
        for i in 0..p.count {
            let m = self.scale * (back * p.mean(i));
            (0..3).for_each(|k| out.geometry[(layout::MEAN + k) * p.stride + i] = m[k]);
            // Left multiplication by a unit quaternion rotates the four components.
            let [w, x, y, z] = p.quat(i);
            let q = back * DQuat::from_xyzw(x, y, z, w);
            [q.w, q.x, q.y, q.z]
                .into_iter()
                .enumerate()
                .for_each(|(k, v)| out.geometry[(layout::QUAT + k) * p.stride + i] = v);
            if let Some((d, ..)) = p.lobe(i) {
                let d = back * d;
                (0..3).for_each(|k| out.lobes[k * p.lobe_stride + i - p.lobe_first] = d[k]);
            }
        }
        out
    }
}

#[test]
fn moving_turning_and_scaling_the_world_with_its_camera_moves_the_gradients_alike() {
    let camera = random_camera(WIDTH, HEIGHT);
    let mut scene = random_scene(25, 500, 150, 0);
    // The near plane is at 0.2 units for any scale: nothing may be near it.
    let near = |g: &Gaussians| {
        (0..g.len())
            .filter(|&i| {
                let z = camera.project(DVec3::from_array(g.means[i].map(f64::from))).2;
                !(0.0..1.0).contains(&z)
            })
            .collect::<Vec<_>>()
    };
    scene = pick_scene(&scene, &near(&scene.base), &near(&scene.supplement.as_ref().unwrap().gaussians));
    let mut probe = Probe::new(650, &camera, Setup::default());
    let none = Similarity { turn: DQuat::IDENTITY, shift: DVec3::ZERO, scale: 1.0 };
    let turn = DQuat::from_euler(EulerRot::XYZ, 0.7, -1.9, 2.6);
    let cases = [
        ("moved by 50", Similarity { shift: DVec3::new(30.0, -40.0, 5.0), ..none }),
        ("turned", Similarity { turn, ..none }),
        ("twice as large", Similarity { scale: 2.0, ..none }),
        ("400 times as large", Similarity { scale: 400.0, ..none }),
        ("0.3 times as large", Similarity { scale: 0.3, ..none }),
        ("all three", Similarity { turn, shift: DVec3::new(5.0, 9.0, -7.0), scale: 7.0 }),
    ];
    let want = probe.shoot(&scene, &camera, &ripples(&camera));
    for (what, similarity) in cases {
        let got = probe.shoot(&similarity.scene(&scene), &similarity.camera(&camera), &ripples(&camera));
        // Means of size 50 are rounded to 4e-6; with depths from 1 and a focal length of 83 px that is 2e-4
        // px, or 1e-4 of color.
        let (share, worst) = images_apart(&got, &want, 5e-4);
        let d = apart(&similarity.back(&got.gradients), &want.gradients);
        println!("{what}: {share:.4} of the pixels meet a threshold, others by {worst:.1e}, gradients by {d:.1e}");
        assert!(share < 0.01 && d < 5e-3, "{what}");
    }
}

/// Twice the pixels in each direction, twice the focal length: a pixel of the small image lies among four of
/// the large one. The dilation of 0.3 px² is in pixels, so Gaussians must be wide: then the mean of the four
/// equals the pixel, to second order.
#[test]
fn doubling_the_resolution_shows_the_same_picture() {
    let camera = random_camera(WIDTH, HEIGHT);
    let double = camera.resized(2 * WIDTH, 2 * HEIGHT);
    let blobs: Vec<_> = (0..40)
        .map(|i| {
            let (x, y) = (f64::from(i * 37 % 96), f64::from(i * 29 % 72));
            let z = 2.0 + 0.2 * f64::from(i);
            // 12 px and more: 0.3 px² is 0.1 % of the variance.
            let s = 14.0 * z / camera.fx;
            Blob {
                mean: camera.unproject(x, y, z),
                scale: [s, 1.3 * s, 0.9 * s],
                logit: -1.0,
                rgb: [0.3, x as f32 / 96.0, y as f32 / 72.0],
                ..Default::default()
            }
        })
        .collect();
    let scene = Scene { base: base(&blobs), ..Default::default() };
    let mut small = Probe::new(64, &camera, Setup::default());
    let mut large = Probe::new(64, &double, Setup::default());
    let grad = ripples(&camera);
    let fine: Vec<[f64; 3]> = (0..double.pixels() as usize)
        .map(|p| {
            let (x, y) = (p % (2 * WIDTH as usize), p / (2 * WIDTH as usize));
            grad[y / 2 * WIDTH as usize + x / 2].map(|g| 0.25 * g)
        })
        .collect();
    let (a, b) = (small.shoot(&scene, &camera, &grad), large.shoot(&scene, &double, &fine));
    let mut worst = 0.0f32;
    for (p, want) in a.image.iter().enumerate() {
        let (x, y) = (p % WIDTH as usize, p / WIDTH as usize);
        for (c, want) in want.iter().enumerate() {
            let at = |dx: usize, dy: usize| b.image[(2 * y + dy) * 2 * WIDTH as usize + 2 * x + dx][c];
            worst = worst.max((0.25 * (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1)) - want).abs());
        }
    }
    let d = apart(&b.gradients, &a.gradients);
    println!("twice the resolution: image by {worst:.1e}, gradients by {d:.1e}");
    // An α of 1/255 ends at another half pixel: 4e-3; the dilation is 0.3 of 196 px² against 0.3 of 784.
    assert!(worst < 5e-3 && d < 1e-2);
}

/// File that receives a child process's results.
const CHILD: &str = "GLINT_METAMORPHIC_CHILD";

/// The size of subgroups, then the image and the gradients of a scene.
fn seen() -> Vec<f64> {
    let gpu = Gpu::new();
    let camera = random_camera(WIDTH, HEIGHT);
    let mut probe = Probe::new(1200, &camera, setup());
    let shot = probe.shoot(&random_scene(24, 900, 300, DEGREE), &camera, &ripples(&camera));
    let image = shot.image.iter().flatten().chain(&shot.depth).map(|&x| f64::from(x));
    let p = &shot.gradients;
    let gradients = [&p.geometry[..], &p.sh, &p.lobes].concat();
    std::iter::once(f64::from(gpu.info().subgroup_size)).chain(image).chain(gradients).collect()
}

/// Run by `the_size_of_subgroups_changes_nothing` in a separate process.
#[test]
fn child() {
    if let Some(path) = std::env::var_os(CHILD) {
        std::fs::write(path, bytemuck::cast_slice(&seen())).unwrap();
    }
}

/// llvmpipe's subgroups follow its vector width, set by the environment; other drivers run the same twice.
#[test]
fn the_size_of_subgroups_changes_nothing() {
    let a = seen();
    let file = tempfile::NamedTempFile::new().unwrap();
    let mut child = std::process::Command::new(std::env::current_exe().unwrap());
    let child = child.args(["--exact", "metamorphic::child"]).env(CHILD, file.path());
    let output = child.env("LP_NATIVE_VECTOR_WIDTH", if a[0] == 16.0 { "256" } else { "512" }).output().unwrap();
    assert!(output.status.success());
    let b = bytemuck::pod_collect_to_vec::<u8, f64>(&std::fs::read(file.path()).unwrap());
    let pixels = 1 + 5 * (WIDTH * HEIGHT) as usize;
    println!("{} and {} lanes", a[0], b[0]);
    assert_eq!(a.len(), b.len());
    // A pixel is computed by one lane, whatever the subgroup.
    assert!(a[1..pixels] == b[1..pixels]);
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    let size = norm(&mut a[pixels..].iter().copied());
    let difference = norm(&mut a[pixels..].iter().zip(&b[pixels..]).map(|(x, y)| x - y));
    println!("gradients differ by {:.1e}", difference / size);
    assert!(difference < 2e-5 * size);
}
