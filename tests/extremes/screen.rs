//! Extreme inputs of the screen phase.

use glint::{
    gpu::Buffer,
    pipelines::screen::{
        batch::ScreenSizes,
        rig::{LEARNED, SCREEN_PLANES, Screen},
    },
    reference::{
        Background, Intersections, NONE, Options,
        blend::blend,
        blend_backward::blend_backward,
        screen_backward::screen_backward,
        screen_project::{ScreenGaussian, screen_project},
        tiles::Tiling,
    },
    stages::types::{Frame, Quota, View},
};

use super::{
    common::{Gpu, session},
    probe::{BACKGROUND, ripple},
};

/// One frame of 2D Gaussians: image, gradients, and planes after a step, planes × places.
struct Flat<'a> {
    gpu: &'a Gpu,
    screen: Screen,
}

const PLACES: usize = 24;
const FLAT: (u32, u32) = (40, 30);

fn rig(gpu: &Gpu, (width, height): (u32, u32), places: u32) -> Screen {
    let frame = Frame { image_first: 0, target_first: 0, width, height };
    // No loss is computed here, and that of a 4K image does not fit on llvmpipe.
    let sizes = ScreenSizes { loss_tiles: 1, ..ScreenSizes::of_frames(&[frame], places) };
    let mut screen = Screen::new(gpu, sizes, session(gpu).policy).unwrap();
    screen.begin(&[frame], &[View::default()], &[Quota { view: 0, first: 0, budget: places }]).unwrap();
    screen
}

impl<'a> Flat<'a> {
    fn new(gpu: &'a Gpu) -> Self {
        let screen = rig(gpu, FLAT, PLACES as u32);
        let [r, g, b] = BACKGROUND;
        screen.raster.buffers.backdrop.upload(0, &[[r, g, b, 1.0]; (FLAT.0 * FLAT.1) as usize]).unwrap();
        Flat { gpu, screen }
    }

    fn run(
        &self,
        gaussians: &[ScreenGaussian],
        frames: &[u32],
        depths: &[f32],
        image_grad: &[[f64; 3]],
    ) -> (Vec<[f32; 4]>, Vec<f32>, Vec<f32>) {
        let (screen, b) = (&self.screen, &self.screen.buffers);
        let columns: Vec<f32> = (0..SCREEN_PLANES * PLACES).map(|k| gaussians[k % PLACES][k / PLACES] as f32).collect();
        b.screen_planes.upload(0, &columns).unwrap();
        b.screen_frames.upload(0, frames).unwrap();
        b.depths.upload(0, depths).unwrap();
        b.screen_ages.upload(0, &[0; PLACES]).unwrap();
        b.screen_moments.upload(0, &[0.0; 2 * LEARNED * PLACES]).unwrap();
        let flat: Vec<f32> = image_grad.iter().flatten().map(|&g| g as f32).collect();
        screen.raster.buffers.image_grad.upload(0, &flat).unwrap();
        let gradients = Buffer::<f32>::zeroed(self.gpu, "gradients", 2 * LEARNED * PLACES).unwrap();
        let status = screen.status().unwrap();
        let mut recorder = self.gpu.recorder("flat").unwrap();
        screen.record_render(&mut recorder, &status);
        screen.record_blend_backward(&mut recorder);
        screen.record_gradients(&mut recorder, &gradients, &status);
        screen.record_step(&mut recorder, &status);
        recorder.submit().unwrap().wait().unwrap();
        let gradients = gradients.download().unwrap();
        let gradients = (0..LEARNED * PLACES).map(|k| gradients[k / PLACES * 2 * PLACES + k % PLACES]).collect();
        (screen.raster.buffers.image.download().unwrap(), gradients, b.screen_planes.download().unwrap())
    }
}

fn flat_gaussians() -> Vec<ScreenGaussian> {
    (0..PLACES)
        .map(|i| {
            let (x, y) = ((i * 17 % 40) as f64 + 0.25, (i * 11 % 30) as f64 + 0.75);
            let rgb = |k: usize| ((i * k % 7) as f64 / 7.0) as f32 as f64;
            [x, y, rgb(2), rgb(3), rgb(4), -1.0, 0.5, 1.25, 0.5, 0.0]
        })
        .collect()
}

fn flat_depths() -> Vec<f32> {
    (0..FLAT.0 * FLAT.1).map(|p| 2.0 + (p * 37 % 101) as f32 / 50.0).collect()
}

#[test]
fn extreme_2d_gaussians_have_the_twins_gradients() {
    let gpu = Gpu::new();
    let flat = Flat::new(&gpu);
    let cap = f64::from(0.7f32.ln());
    // (what, logit, log scales, angle, centre); steps cap scales at 0.01 (W + H) = 0.7 px, kernels do not.
    let cases = [
        ("logit 20", 20.0, [0.5, 1.25], 0.5, [20.25, 15.75]),
        ("logit 30", 30.0, [0.5, 1.25], 0.5, [20.25, 15.75]),
        ("logit 100", 100.0, [0.5, 1.25], 0.5, [20.25, 15.75]),
        ("at the cap", 1.0, [cap, cap], 0.5, [20.25, 15.75]),
        ("a needle of 1 : 400", 3.0, [4.0, -2.0], 0.7, [20.25, 15.75]),
        ("a needle on a diagonal", 6.0, [3.9, -1.0], 0.785, [20.25, 15.75]),
        ("a needle near the horizontal", 6.0, [3.9, -1.0], 0.4, [20.25, 15.75]),
        ("thinner than a pixel", 6.0, [-1.5, -1.5], 0.7, [20.25, 15.75]),
        ("filling the image", 0.0, [6.0, 5.5], 0.7, [20.25, 15.75]),
        ("wider than all", 0.0, [15.0, 15.5], 0.7, [20.25, 15.75]),
        ("in the first corner", 1.0, [0.5, 1.25], 0.5, [0.0, 0.0]),
        ("in the last corner", 1.0, [0.5, 1.25], 0.5, [40.0, 30.0]),
        ("turned 300 times", 1.0, [0.5, 1.25], 300.5, [20.25, 15.75]),
    ];
    let options = Options {
        tile_width: flat.screen.raster.tile.width,
        tile_height: flat.screen.raster.tile.height,
        ..Default::default()
    };
    for (what, logit, log_scale, angle, centre) in cases {
        let mut planes = flat_gaussians();
        planes[5] = [centre[0], centre[1], 0.75, 0.5, 0.25, logit, log_scale[0], log_scale[1], angle, 0.0];
        planes.iter_mut().flatten().for_each(|x| *x = f64::from(*x as f32));
        let mut twin = planes.clone();
        let depths: Vec<f64> = flat_depths().iter().map(|&z| f64::from(z)).collect();
        let projected = screen_project(&mut twin, &depths, FLAT.0, FLAT.1, &options);
        let isects = Intersections::new(&projected, Tiling::new(FLAT.0, FLAT.1, &options));
        let blended = blend(&projected.splats, &isects, Background::Color(BACKGROUND.map(f64::from)), 0.0);
        let grads: Vec<[f64; 3]> = (0..blended.image.len())
            .map(|p| {
                let m = &blended.margins[p];
                if m.alpha.min(m.transmittance).min(m.clamp) > 1e-4 { ripple(p) } else { [0.0; 3] }
            })
            .collect();
        let records = blend_backward(&projected.splats, &isects, &blended.image, &grads);
        let want = screen_backward(&twin, &projected.tile_counts, &isects, &records);
        let (image, got, stepped) = flat.run(&planes, &[0; PLACES], &flat_depths(), &grads);
        let worst = image.iter().zip(&blended.image).zip(&grads).filter(|(_, g)| **g != [0.0; 3]);
        let worst = worst.flat_map(|((a, b), _)| (0..4).map(|c| (f64::from(a[c]) - b[c]).abs())).fold(0.0, f64::max);
        assert!(worst < 2e-5, "{what}: image off by {worst}");
        let mut line = Vec::new();
        for p in 0..9 {
            let pairs: Vec<(f64, f64)> = (0..PLACES).map(|i| (f64::from(got[p * PLACES + i]), want[i][p])).collect();
            // The extreme one's gradient alone, since it may dwarf the others' or be dwarfed by them.
            for pairs in [&pairs[5..6], &pairs[..]] {
                let size = pairs.iter().map(|(_, w)| w * w).sum::<f64>().sqrt();
                let d = pairs.iter().map(|(g, w)| (g - w).powi(2)).sum::<f64>().sqrt();
                line.push(format!("{:.0e}", d / size));
                // Single gradients are sums that partly cancel; an angle in float32 has 3e-5 rad at 300, 1e-3
                // of the ellipse.
                let bound = if angle > 100.0 { 1e-2 } else { 1e-3 };
                assert!(d <= bound * size + 1e-6, "{what}: plane {p} off by {d} of {size}");
            }
        }
        println!("{what}: image {worst:.0e}, gradients {line:?}");
        if (20.0..=30.0).contains(&logit) {
            assert!(
                got[5 * PLACES + 5] != 0.0 && (f64::from(stepped[5 * PLACES + 5]) - logit).abs() > 0.01,
                "{what} cannot recover"
            );
        }
        assert!(stepped.iter().all(|x| x.is_finite()), "{what}");
        // Half a turn does not change an ellipse.
        assert!(stepped[8 * PLACES + 5].abs() < 1.6, "{what}: turned to {}", stepped[8 * PLACES + 5]);
    }
}

#[test]
fn a_2d_gaussian_that_is_nan_stays_alone() {
    let gpu = Gpu::new();
    let flat = Flat::new(&gpu);
    let grads: Vec<_> = (0..(FLAT.0 * FLAT.1) as usize).map(ripple).collect();
    let mut frames = [0; PLACES];
    frames[5] = NONE;
    let others = |(image, gradients, planes): (Vec<[f32; 4]>, Vec<f32>, Vec<f32>)| {
        let kept = |v: Vec<f32>| {
            v.into_iter().enumerate().filter(|(k, _)| k % PLACES != 5).map(|(_, x)| x.to_bits()).collect::<Vec<_>>()
        };
        (image, kept(gradients), kept(planes))
    };
    let without = others(flat.run(&flat_gaussians(), &frames, &flat_depths(), &grads));
    let with = others(flat.run(&flat_gaussians(), &[0; PLACES], &flat_depths(), &grads));
    assert!(without.0 != with.0);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for p in 0..9 {
            let mut planes = flat_gaussians();
            planes[5][p] = bad;
            // A logit of +∞ is an opacity of 1.
            if p == 5 && bad == f64::INFINITY {
                continue;
            }
            planes[5][9] = 7.0;
            let result = flat.run(&planes, &[0; PLACES], &flat_depths(), &grads);
            assert_eq!(flat.screen.raster.buffers.tile_counts.download().unwrap()[5], 0, "{bad} in plane {p} is seen");
            // A non-finite centre reads no pixel's depth.
            assert!(p >= 2 || result.2[9 * PLACES + 5] == 7.0, "{bad} in plane {p}");
            assert!(others(result) == without, "{bad} in plane {p}");
        }
        // A NaN in the depth map: after all valid ones.
        let mut depths = flat_depths();
        let at = (flat_gaussians()[5][1] as u32 * FLAT.0 + flat_gaussians()[5][0] as u32) as usize;
        depths[at] = bad as f32;
        let (image, gradients, planes) = flat.run(&flat_gaussians(), &[0; PLACES], &depths, &grads);
        assert!(
            image.iter().flatten().chain(&gradients).all(|x| x.is_finite())
                && planes[..9 * PLACES].iter().all(|x| x.is_finite()),
            "depth {bad}"
        );
        assert!(bad > 0.0 || planes[9 * PLACES + 5] == 0.0, "depth {bad} is kept");
    }
}

/// Only the last pixels of an image of 3840 × 2160 have a loss: they must be drawn, by a kernel that makes
/// five passes over all pixels.
#[test]
fn pixels_at_the_end_of_a_4k_image_can_be_drawn() {
    let gpu = Gpu::new();
    let (width, height) = (3840u32, 2160u32);
    let screen = rig(&gpu, (width, height), 20);
    let mut loss = vec![0f32; (width * height) as usize];
    let end = loss.len();
    loss[end - 50..].fill(0.5);
    screen.loss.loss_map().upload(0, &loss).unwrap();
    let mut recorder = gpu.recorder("draw").unwrap();
    recorder.fill(&screen.raster.buffers.image, 0);
    screen.record_draw(&mut recorder, 1, 1, 0, &screen.status().unwrap());
    recorder.submit().unwrap().wait().unwrap();
    let b = &screen.buffers;
    let taken = b.screen_frames.download().unwrap().iter().filter(|&&f| f == 0).count();
    assert_eq!((taken, b.screen_states.download().unwrap()[0].count), (4, 4));
    let planes = b.screen_planes.download().unwrap();
    for i in 0..4 {
        let (x, y) = (planes[i], planes[20 + i]);
        assert!(y == 2159.5 && x > 3840.0 - 50.0, "({x}, {y})");
    }
}

/// In the screen phase, Adam must also move by its rate if the gradient's square overflows.
#[test]
fn a_2d_gradient_whose_square_overflows_moves_a_parameter_by_its_rate() {
    let gpu = Gpu::new();
    let flat = Flat::new(&gpu);
    let pixels = (FLAT.0 * FLAT.1) as usize;
    let steep: Vec<_> = (0..pixels).map(|p| ripple(p).map(|g| g * 1e22)).collect();
    let (_, gradients, stepped) = flat.run(&flat_gaussians(), &[0; PLACES], &flat_depths(), &steep);
    let logit = 5 * PLACES..6 * PLACES;
    for (g, new) in gradients[logit.clone()].iter().zip(&stepped[logit]) {
        assert!(g.abs() > 1e19 && ((new + 1.0).abs() - 0.02).abs() < 1e-5, "{g:e}: −1 → {new}");
    }
    let (_, _, stepped) = flat.run(&flat_gaussians(), &[0; PLACES], &flat_depths(), &vec![[f64::NAN; 3]; pixels]);
    for (i, plane) in flat_gaussians().iter().enumerate() {
        assert!((0..9).all(|p| stepped[p * PLACES + i] == plane[p] as f32), "{i}");
    }
}
