//! The 2D stage.

use glint::{
    gpu::Buffer,
    pipelines::raster::{Raster, RasterOptions, Reduction, WORKGROUP},
    reference::{
        Background, Intersections, Options, blend::blend, blend_backward::blend_backward,
        plane_backward::plane_backward as plane_backward_twin, plane_project::Plane,
        plane_project::plane_project as plane_project_twin, tiles::Tiling,
    },
    stages::{
        plane_backward::{self, PlaneBackward},
        plane_draw::{self, PlaneDraw},
        plane_project::{self, PlaneProject},
        types::{Frame, PlaneState, Quota},
    },
};

use super::{
    common::Gpu,
    probe::{BACKGROUND, ripple},
};

/// One frame of 2D Gaussians: image, gradients, and planes after a step, planes × slots.
struct Flat<'a> {
    gpu: &'a Gpu,
    raster: Raster,
    project: PlaneProject,
    backward: [PlaneBackward; 2],
}

const SLOTS: usize = 24;
const FLAT: (u32, u32) = (40, 30);

impl<'a> Flat<'a> {
    fn new(gpu: &'a Gpu) -> Self {
        let options = RasterOptions {
            splats: SLOTS as u32,
            pixels: FLAT.0 * FLAT.1,
            tiles: 5 * 4,
            isects: 1 << 12,
            batch: true,
            background_image: false,
            median: false,
            backward: true,
            reduction: Reduction::Deterministic,
        };
        let raster = Raster::new(gpu, options).unwrap();
        let (tile_width, tile_height) = (raster.tile.width, raster.tile.height);
        let spec = plane_project::Spec { workgroup_size: WORKGROUP, tile_width, tile_height };
        let backward = |gradients| {
            PlaneBackward::new(gpu, &plane_backward::Spec { workgroup_size: WORKGROUP, gradients }).unwrap()
        };
        Flat {
            gpu,
            project: PlaneProject::new(gpu, &spec).unwrap(),
            raster,
            backward: [backward(true), backward(false)],
        }
    }

    fn run(
        &self,
        planes: &[Plane],
        slots: &[u32],
        depths: &[f32],
        image_grad: &[[f64; 3]],
    ) -> (Vec<[f32; 4]>, Vec<f32>, Vec<f32>) {
        let (gpu, raster, n) = (self.gpu, &self.raster, SLOTS as u32);
        let columns: Vec<f32> = (0..10 * SLOTS).map(|k| planes[k % SLOTS][k / SLOTS] as f32).collect();
        let frame = Frame { image_first: 0, target_first: 0, width: FLAT.0, height: FLAT.1 };
        let frames = Buffer::from_slice(gpu, "frames", &[frame]).unwrap();
        let plane_frames = Buffer::from_slice(gpu, "plane frames", slots).unwrap();
        let states = Buffer::from_slice(gpu, "states", &[PlaneState { count: n, stepping: 1 }]).unwrap();
        let depths = Buffer::from_slice(gpu, "depths", depths).unwrap();
        let plane = Buffer::from_slice(gpu, "plane", &columns).unwrap();
        let status = Buffer::<u32>::zeroed(gpu, "status", 2).unwrap();
        let ages = Buffer::<u32>::zeroed(gpu, "ages", SLOTS).unwrap();
        let moments = [(); 2].map(|()| Buffer::<f32>::zeroed(gpu, "moments", 18 * SLOTS).unwrap());
        let flat: Vec<f32> = image_grad.iter().flatten().map(|&g| g as f32).collect();
        raster.image_grad.upload(0, &flat).unwrap();
        let grid = raster.grid(0, 1, FLAT.0, FLAT.1);
        let mut recorder = gpu.recorder("flat").unwrap();
        self.project.record(
            &mut recorder,
            &plane_project::Buffers {
                frames: &frames,
                plane_frames: &plane_frames,
                plane_states: &states,
                depths: &depths,
                plane: &plane,
                splats: &raster.splats,
                depth_keys: &raster.depth_keys,
                tile_counts: &raster.tile_counts,
            },
            &plane_project::Push { count: n, stride: n },
        );
        raster.record_order(&mut recorder, n, &grid, &frames, &plane_frames, &status);
        raster.record_blend(&mut recorder, &grid, &frames, BACKGROUND, 0.0);
        raster.record_blend_backward(&mut recorder, &grid, &frames, 0);
        for (stage, moments) in self.backward.iter().zip(&moments) {
            let buffers = plane_backward::Buffers {
                status: &status,
                frames: &frames,
                plane_frames: &plane_frames,
                plane_states: &states,
                tile_counts: &raster.tile_counts,
                first_slot: &raster.first_slot,
                records: &raster.records,
                plane: &plane,
                plane_ages: &ages,
                plane_moments: moments,
            };
            stage.record(&mut recorder, &buffers, &plane_backward::Push { count: n, stride: n, by_gaussian: 0 });
        }
        recorder.submit().unwrap().wait().unwrap();
        let gradients = moments[0].download().unwrap();
        let gradients = (0..9 * SLOTS).map(|k| gradients[k / SLOTS * 2 * SLOTS + k % SLOTS]).collect();
        (raster.image.download().unwrap(), gradients, plane.download().unwrap())
    }
}

fn flat_planes() -> Vec<Plane> {
    (0..SLOTS)
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
    // (what, logit, log scales, angle, centre); scales are capped at 0.01 (W + H) = 0.7 px by the steps, not by the kernels.
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
    let mut options =
        Options { tile_width: flat.raster.tile.width, tile_height: flat.raster.tile.height, ..Default::default() };
    options.active_degree = 0;
    for (what, logit, log_scale, angle, centre) in cases {
        let mut planes = flat_planes();
        planes[5] = [centre[0], centre[1], 0.75, 0.5, 0.25, logit, log_scale[0], log_scale[1], angle, 0.0];
        planes.iter_mut().flatten().for_each(|x| *x = f64::from(*x as f32));
        let mut twin = planes.clone();
        let depths: Vec<f64> = flat_depths().iter().map(|&z| f64::from(z)).collect();
        let projected = plane_project_twin(&mut twin, &depths, FLAT.0, FLAT.1, &options);
        let isects = Intersections::new(&projected, Tiling::new(FLAT.0, FLAT.1, &options));
        let blended = blend(&projected.splats, &isects, Background::Color(BACKGROUND.map(f64::from)), 0.0);
        let grads: Vec<[f64; 3]> = (0..blended.image.len())
            .map(|p| {
                let m = &blended.margins[p];
                if m.alpha.min(m.transmittance).min(m.clamp) > 1e-4 { ripple(p) } else { [0.0; 3] }
            })
            .collect();
        let records = blend_backward(&projected.splats, &isects, &blended.image, &grads);
        let want = plane_backward_twin(&twin, &projected.tile_counts, &isects, &records);
        let (image, got, stepped) = flat.run(&planes, &[0; SLOTS], &flat_depths(), &grads);
        let worst = image.iter().zip(&blended.image).zip(&grads).filter(|(_, g)| **g != [0.0; 3]);
        let worst = worst.flat_map(|((a, b), _)| (0..4).map(|c| (f64::from(a[c]) - b[c]).abs())).fold(0.0, f64::max);
        assert!(worst < 2e-5, "{what}: image off by {worst}");
        let mut line = Vec::new();
        for p in 0..9 {
            let pairs: Vec<(f64, f64)> = (0..SLOTS).map(|i| (f64::from(got[p * SLOTS + i]), want[i][p])).collect();
            // The extreme one's own gradient, beside whose size the others' would hide it or be hidden.
            for pairs in [&pairs[5..6], &pairs[..]] {
                let size = pairs.iter().map(|(_, w)| w * w).sum::<f64>().sqrt();
                let d = pairs.iter().map(|(g, w)| (g - w).powi(2)).sum::<f64>().sqrt();
                line.push(format!("{:.0e}", d / size));
                // Single gradients are sums that partly cancel; an angle in float32 has 3e-5 rad at 300, 1e-3 of the ellipse.
                let bound = if angle > 100.0 { 1e-2 } else { 1e-3 };
                assert!(d <= bound * size + 1e-6, "{what}: plane {p} off by {d} of {size}");
            }
        }
        println!("{what}: image {worst:.0e}, gradients {line:?}");
        if (20.0..=30.0).contains(&logit) {
            assert!(
                got[5 * SLOTS + 5] != 0.0 && (f64::from(stepped[5 * SLOTS + 5]) - logit).abs() > 0.01,
                "{what} cannot recover"
            );
        }
        assert!(stepped.iter().all(|x| x.is_finite()), "{what}");
        // Half a turn changes no ellipse.
        assert!(stepped[8 * SLOTS + 5].abs() < 1.6, "{what}: turned to {}", stepped[8 * SLOTS + 5]);
    }
}

#[test]
fn a_2d_gaussian_that_is_not_a_number_stays_alone() {
    let gpu = Gpu::new();
    let flat = Flat::new(&gpu);
    let grads: Vec<_> = (0..(FLAT.0 * FLAT.1) as usize).map(ripple).collect();
    let mut slots = [0; SLOTS];
    slots[5] = u32::MAX;
    let others = |(image, gradients, planes): (Vec<[f32; 4]>, Vec<f32>, Vec<f32>)| {
        let kept = |v: Vec<f32>| {
            v.into_iter().enumerate().filter(|(k, _)| k % SLOTS != 5).map(|(_, x)| x.to_bits()).collect::<Vec<_>>()
        };
        (image, kept(gradients), kept(planes))
    };
    let without = others(flat.run(&flat_planes(), &slots, &flat_depths(), &grads));
    let with = others(flat.run(&flat_planes(), &[0; SLOTS], &flat_depths(), &grads));
    assert!(without.0 != with.0);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for p in 0..9 {
            let mut planes = flat_planes();
            planes[5][p] = bad;
            // An opacity of 1 is one.
            if p == 5 && bad == f64::INFINITY {
                continue;
            }
            planes[5][9] = 7.0;
            let result = flat.run(&planes, &[0; SLOTS], &flat_depths(), &grads);
            assert_eq!(flat.raster.tile_counts.download().unwrap()[5], 0, "{bad} in plane {p} is seen");
            // A centre that is no place asks no pixel for its depth.
            assert!(p >= 2 || result.2[9 * SLOTS + 5] == 7.0, "{bad} in plane {p}");
            assert!(others(result) == without, "{bad} in plane {p}");
        }
        // A depth map with a hole that is no number: behind all others.
        let mut depths = flat_depths();
        let at = (flat_planes()[5][1] as u32 * FLAT.0 + flat_planes()[5][0] as u32) as usize;
        depths[at] = bad as f32;
        let (image, gradients, planes) = flat.run(&flat_planes(), &[0; SLOTS], &depths, &grads);
        assert!(
            image.iter().flatten().chain(&gradients).all(|x| x.is_finite())
                && planes[..9 * SLOTS].iter().all(|x| x.is_finite()),
            "depth {bad}"
        );
        assert!(bad > 0.0 || planes[9 * SLOTS + 5] == 0.0, "depth {bad} is kept");
    }
}

/// Only the last pixels of an image of 3840 × 2160 have a loss: they are drawn, by a kernel that goes through all of them five times.
#[test]
fn pixels_at_the_end_of_a_4k_image_can_be_drawn() {
    let gpu = Gpu::new();
    let (width, height, slots) = (3840u32, 2160u32, 20u32);
    let pixels = (width * height) as usize;
    let mut loss = vec![0f32; pixels];
    loss[pixels - 50..].fill(0.5);
    let words = |name: &str, len: usize| Buffer::<u32>::zeroed(&gpu, name, len).unwrap();
    let floats = |name: &str, len: usize| Buffer::<f32>::zeroed(&gpu, name, len).unwrap();
    let frame = Frame { image_first: 0, target_first: 0, width, height };
    let quota = Quota { view: 0, first: 0, budget: slots };
    let plane_frames = Buffer::from_slice(&gpu, "plane frames", &[u32::MAX; 20]).unwrap();
    let (plane, states) = (floats("plane", 10 * 20), Buffer::<PlaneState>::zeroed(&gpu, "states", 1).unwrap());
    let mut recorder = gpu.recorder("draw").unwrap();
    // The stage's own workgroup in the pipeline.
    PlaneDraw::new(&gpu, &plane_draw::Spec { workgroup_size: 256 }).unwrap().record(
        &mut recorder,
        &plane_draw::Buffers {
            status: &words("status", 2),
            frames: &Buffer::from_slice(&gpu, "frames", &[frame]).unwrap(),
            quotas: &Buffer::from_slice(&gpu, "quotas", &[quota]).unwrap(),
            loss_map: &Buffer::from_slice(&gpu, "loss map", &loss).unwrap(),
            image: &Buffer::<[f32; 4]>::zeroed(&gpu, "image", pixels).unwrap(),
            drawn_pixels: &words("drawn", 20),
            plane_states: &states,
            plane_frames: &plane_frames,
            plane: &plane,
            plane_ages: &words("ages", 20),
            plane_moments: &floats("moments", 18 * 20),
        },
        &plane_draw::Push { frame_count: 1, stride: slots, round: 1, seed: 1 },
    );
    recorder.submit().unwrap().wait().unwrap();
    let taken = plane_frames.download().unwrap().iter().filter(|&&f| f == 0).count();
    assert_eq!((taken, states.download().unwrap()[0].count), (4, 4));
    let planes = plane.download().unwrap();
    for i in 0..4 {
        let (x, y) = (planes[i], planes[20 + i]);
        assert!(y == 2159.5 && x > 3840.0 - 50.0, "({x}, {y})");
    }
}

/// The same of the 2D stage.
#[test]
fn a_2d_gradient_whose_square_overflows_moves_a_parameter_by_its_rate() {
    let gpu = Gpu::new();
    let flat = Flat::new(&gpu);
    let pixels = (FLAT.0 * FLAT.1) as usize;
    let steep: Vec<_> = (0..pixels).map(|p| ripple(p).map(|g| g * 1e22)).collect();
    let (_, gradients, stepped) = flat.run(&flat_planes(), &[0; SLOTS], &flat_depths(), &steep);
    let logit = 5 * SLOTS..6 * SLOTS;
    for (g, new) in gradients[logit.clone()].iter().zip(&stepped[logit]) {
        assert!(g.abs() > 1e19 && ((new + 1.0).abs() - 0.02).abs() < 1e-5, "{g:e}: −1 → {new}");
    }
    let (_, _, stepped) = flat.run(&flat_planes(), &[0; SLOTS], &flat_depths(), &vec![[f64::NAN; 3]; pixels]);
    for (i, plane) in flat_planes().iter().enumerate() {
        assert!((0..9).all(|p| stepped[p * SLOTS + i] == plane[p] as f32), "{i}");
    }
}
