//! The 2D stage from splats to steps, and as a whole; its kernels one by one are `glint verify`'s.

mod common;

use common::Gpu;
use glint::{
    gpu::{Buffer, Location},
    pipelines::{
        model::Model,
        plane::{PlaneStage, Schedule, base_losses, budgets},
        raster::{Raster, RasterOptions, Reduction, WORKGROUP},
        render::{RenderOptions, Renderer},
        views::Views,
    },
    reference::{
        Background, Intersections, Options, Splat,
        blend::blend,
        blend_backward::blend_backward,
        plane_backward::{PlaneMoments, plane_backward, plane_step},
        plane_project::plane_project,
        plane_prune::covered,
        plane_tiles::{WINDOW_RADIUS, plane_tiles},
        tiles::Tiling,
    },
    scene::{Camera, Gaussians, Scene},
    stages::{
        self,
        plane_backward::PlaneBackward,
        plane_draw::PlaneDraw,
        plane_project::PlaneProject,
        plane_prune::PlanePrune,
        plane_tiles::PlaneTiles,
        ssim_forward,
        types::{Frame, PlaneState, Quota},
    },
    verify::plane::{SMALL_FRAMES, Scattered, pixels_of},
};
use rand::RngExt;

const NONE: u32 = u32::MAX;
const FRAMES: [Frame; 2] = SMALL_FRAMES;
const PIXELS: usize = 61 * 43 + 50 * 70;

fn close(got: f32, expected: f64, tolerance: f64, what: &str) {
    let error = (f64::from(got) - expected).abs();
    assert!(error <= tolerance * (1.0 + expected.abs()), "{what}: {got} for {expected}");
}

#[test]
fn splats_images_gradients_and_steps_are_the_twins() {
    let gpu = Gpu::new();
    let count = 120;
    let (scene, mut rng) = Scattered::new(&FRAMES, 3, count);
    let options = RasterOptions {
        splats: count as u32,
        pixels: PIXELS as u32,
        tiles: 2 * 8 * 9,
        isects: 1 << 14,
        batch: true,
        background_image: true,
        median: false,
        backward: true,
        reduction: Reduction::Deterministic,
    };
    let raster = Raster::new(&gpu, options).unwrap();
    let tile = raster.tile;
    let backdrop: Vec<[f32; 4]> = (0..PIXELS).map(|_| [0; 4].map(|_| rng.random_range(0.0..1.0))).collect();
    raster.backdrop.upload(0, &backdrop).unwrap();
    let frames = Buffer::from_slice(&gpu, "frames", &FRAMES).unwrap();
    let plane_frames = Buffer::from_slice(&gpu, "plane frames", &scene.frames).unwrap();
    let states = Buffer::from_slice(&gpu, "states", &[PlaneState { count: 0, stepping: 1 }; 2]).unwrap();
    let depths = Buffer::from_slice(&gpu, "depths", &scene.depths).unwrap();
    let plane = Buffer::from_slice(&gpu, "plane", &scene.columns()).unwrap();
    let status = Buffer::<u32>::zeroed(&gpu, "status", 2).unwrap();
    let spec =
        stages::plane_project::Spec { workgroup_size: WORKGROUP, tile_width: tile.width, tile_height: tile.height };
    let project = PlaneProject::new(&gpu, &spec).unwrap();
    let grid = raster.grid(0, 2, 61, 70);
    let tiles = PlaneTiles::new(&gpu, WORKGROUP).unwrap();
    let words = |len: usize| Buffer::<u32>::new(&gpu, "words", len, Location::Device).unwrap();
    let (tile_marks, tile_count, lists) = (words(24), words(2), [words(12), words(12)]);
    let mut recorder = gpu.recorder("forward").unwrap();
    let buffers = stages::plane_project::Buffers {
        frames: &frames,
        plane_frames: &plane_frames,
        plane_states: &states,
        depths: &depths,
        plane: &plane,
        splats: &raster.splats,
        depth_keys: &raster.depth_keys,
        tile_counts: &raster.tile_counts,
    };
    let push = stages::plane_project::Push { count: count as u32, stride: count as u32 };
    project.record(&mut recorder, &buffers, &push);
    raster.record_order(&mut recorder, count as u32, &grid, &frames, &plane_frames, &status);
    raster.record_blend(&mut recorder, &grid, &frames, [0.0; 3], 0.0);
    let buffers = stages::plane_tiles::Buffers {
        frames: &frames,
        plane_frames: &plane_frames,
        tile_counts: &raster.tile_counts,
        splats: &raster.splats,
        tile_marks: &tile_marks,
        count: &tile_count,
        forward_tiles: &lists[0],
        backward_tiles: &lists[1],
    };
    tiles.record(&mut recorder, &buffers, &stages::plane_tiles::Push { slots: count as u32, tiles_per_frame: 6 });
    recorder.submit().unwrap().wait().unwrap();
    assert_eq!(status.download().unwrap()[0], 0);
    let (splats, keys) = (raster.splats.download().unwrap(), raster.depth_keys.download().unwrap());
    let tile_counts = raster.tile_counts.download().unwrap();
    let image = raster.image.download().unwrap();

    let options = Options { tile_width: tile.width, tile_height: tile.height, ..Default::default() };
    let depths64: Vec<f64> = scene.depths.iter().map(|&z| f64::from(z)).collect();
    let mut image_grad = vec![0f32; 3 * PIXELS];
    let mut twins = Vec::new();
    let listed_tiles: Vec<Vec<u32>> = lists
        .iter()
        .zip(tile_count.download().unwrap())
        .map(|(list, n)| {
            let mut tiles = list.download_range(0, n as usize).unwrap();
            tiles.sort_unstable();
            tiles
        })
        .collect();
    let (mut visible, mut listed, mut listed_twin) = (0, 0, 0);
    for (f, &Frame { width, height, .. }) in FRAMES.iter().enumerate() {
        let (mut planes, slots) = scene.of_frame(f as u32);
        let projected = plane_project(&mut planes, pixels_of(&depths64, &FRAMES[f]), width, height, &options);
        for (j, &i) in slots.iter().enumerate() {
            if (keys[i] == NONE) != (projected.tile_counts[j] == 0) {
                // An ellipse between pixel centres: the two list tiles with margins of their own.
                assert_eq!(covered(&planes[j], width, height), 0);
                continue;
            }
            if keys[i] == NONE {
                continue;
            }
            visible += 1;
            listed += tile_counts[i];
            listed_twin += projected.tile_counts[j];
            let z = planes[j][9];
            assert_eq!(keys[i], if z > 0.0 { (z as f32).to_bits() } else { 0x7F80_0000 });
            let (s, t): (_, Splat) = (splats[i], projected.splats[j]);
            let pairs =
                [(s.x, t.x), (s.y, t.y), (s.l11, t.l11), (s.l12, t.l12), (s.l22, t.l22), (s.opacity, t.opacity)];
            for (got, expected) in pairs.into_iter().chain([(s.r, t.r), (s.g, t.g), (s.b, t.b), (s.z, t.z)]) {
                // A dozen roundings of 6e-8, and sine and cosine within 1e-6.
                close(got, expected, 5e-6, "splat");
            }
        }
        for (list, halo) in listed_tiles.iter().zip([WINDOW_RADIUS, 0.0]) {
            // At least the exact ones, at most those of boxes a hundredth of a pixel wider.
            let (first, tile) = (6 * f as u32, ssim_forward::TILE);
            let twin = |halo| plane_tiles(&projected.splats, &projected.tile_counts, width, height, tile, halo);
            let got: Vec<u32> = list.iter().filter(|t| (first..first + 6).contains(t)).map(|t| t - first).collect();
            assert!(got.is_sorted_by(|a, b| a < b), "a tile twice: {got:?}");
            assert!(twin(halo).iter().all(|t| got.contains(t)), "{got:?}");
            assert!(got.iter().all(|t| twin(halo + 0.01).contains(t)), "{got:?}");
        }
        let isects = Intersections::new(&projected, Tiling::new(width, height, &options));
        let behind: Vec<[f64; 3]> =
            pixels_of(&backdrop, &FRAMES[f]).iter().map(|p| [p[0], p[1], p[2]].map(f64::from)).collect();
        let blended = blend(&projected.splats, &isects, Background::Image(&behind), 0.0);
        let mut grads = vec![[0.0; 3]; behind.len()];
        let mut unsure = 0;
        for (pixel, (got, expected)) in pixels_of(&image, &FRAMES[f]).iter().zip(&blended.image).enumerate() {
            // Float32 may decide otherwise within its own error of a threshold; those pixels pull at nothing below. The order
            // is not in doubt: depths are the map's own, and equal ones go by index.
            let margin = blended.margins[pixel];
            if margin.alpha.min(margin.transmittance).min(margin.clamp) <= 1e-4 {
                unsure += 1;
                continue;
            }
            (0..4).for_each(|c| close(got[c], expected[c], 1e-5, "image"));
            grads[pixel] = [0; 3].map(|_| f64::from(rng.random_range(-1.0..1.0f32)));
            let at = 3 * (FRAMES[f].image_first as usize + pixel);
            (0..3).for_each(|c| image_grad[at + c] = grads[pixel][c] as f32);
        }
        assert!(unsure * 10 < behind.len(), "{unsure} pixels of {}", behind.len());
        let records = blend_backward(&projected.splats, &isects, &blended.image, &grads);
        let grads = plane_backward(&planes, &projected.tile_counts, &isects, &records);
        twins.push((planes, slots, grads));
    }
    // The kernel's and the twin's margins around an ellipse differ by less than a hundredth of a pixel.
    assert!(visible > 60 && listed.abs_diff(listed_twin) * 50 < listed_twin, "{listed} for {listed_twin}");

    raster.image_grad.upload(0, &image_grad).unwrap();
    let start: Vec<f32> = (0..18 * count)
        .map(|k| if k / count % 2 == 0 { rng.random_range(-0.1..0.1) } else { rng.random_range(0.001..0.01) })
        .collect();
    let ages: Vec<u32> = (0..count as u32).map(|i| [0, 1, 5, 80, 1500][i as usize % 5]).collect();
    let plane_ages = Buffer::from_slice(&gpu, "ages", &ages).unwrap();
    let moments = Buffer::from_slice(&gpu, "moments", &start).unwrap();
    let gradients = Buffer::<f32>::zeroed(&gpu, "gradients", 18 * count).unwrap();
    let mut recorder = gpu.recorder("backward").unwrap();
    raster.record_blend_backward(&mut recorder, &grid, &frames, 0);
    for (gradients_only, into) in [(true, &gradients), (false, &moments)] {
        let spec = stages::plane_backward::Spec { workgroup_size: WORKGROUP, gradients: gradients_only };
        let buffers = stages::plane_backward::Buffers {
            status: &status,
            frames: &frames,
            plane_frames: &plane_frames,
            plane_states: &states,
            tile_counts: &raster.tile_counts,
            first_slot: &raster.first_slot,
            records: &raster.records,
            plane: &plane,
            plane_ages: &plane_ages,
            plane_moments: into,
        };
        let push = stages::plane_backward::Push { count: count as u32, stride: count as u32, by_gaussian: 0 };
        PlaneBackward::new(&gpu, &spec).unwrap().record(&mut recorder, &buffers, &push);
    }
    recorder.submit().unwrap().wait().unwrap();
    let (gradients, moments) = (gradients.download().unwrap(), moments.download().unwrap());
    let (after, new_ages) = (plane.download().unwrap(), plane_ages.download().unwrap());
    for (f, (mut planes, slots, grads)) in twins.into_iter().enumerate() {
        // What cancels in a sum over pixels is judged by the largest gradient of its plane.
        let largest: [f64; 9] = std::array::from_fn(|p| grads.iter().map(|g| g[p].abs()).fold(0.0, f64::max));
        for (j, &i) in slots.iter().enumerate() {
            for p in 0..9 {
                let (got, expected) = (f64::from(gradients[2 * p * count + i]), grads[j][p]);
                let error = (got - expected).abs();
                assert!(error < 2e-4 * expected.abs() + 2e-5 * largest[p], "plane {p}: {got} for {expected}");
            }
        }
        // The step is judged by the kernel's own gradients.
        let own: Vec<[f64; 9]> =
            slots.iter().map(|&i| std::array::from_fn(|p| f64::from(gradients[2 * p * count + i]))).collect();
        let mut state: Vec<PlaneMoments> = slots
            .iter()
            .map(|&i| PlaneMoments {
                first: std::array::from_fn(|p| f64::from(start[2 * p * count + i])),
                second: std::array::from_fn(|p| f64::from(start[(2 * p + 1) * count + i])),
                age: ages[i],
            })
            .collect();
        plane_step(&mut planes, &own, &mut state, FRAMES[f].width, FRAMES[f].height);
        for (j, &i) in slots.iter().enumerate() {
            assert_eq!(new_ages[i], state[j].age);
            for p in 0..9 {
                close(moments[2 * p * count + i], state[j].first[p], 1e-6, "first moment");
                close(moments[(2 * p + 1) * count + i], state[j].second[p], 1e-5, "second moment");
                close(after[p * count + i], planes[j][p], 1e-5, "stepped plane");
            }
        }
    }
    // Empty slots are as they were.
    for i in (0..count).filter(|&i| scene.frames[i] == NONE) {
        assert_eq!((keys[i], tile_counts[i], new_ages[i]), (NONE, 0, ages[i]));
        assert!((0..9).all(|p| after[p * count + i] == scene.planes[i][p] as f32));
    }
}

/// A few small 2D Gaussians in two large images: the loss is made where it can change, and nowhere else.
#[test]
fn tiles_without_2d_gaussians_near_are_not_listed() {
    let gpu = Gpu::new();
    let frame = |image_first, width, height| Frame { image_first, target_first: image_first, width, height };
    let frames = [frame(0, 403, 301), frame(403 * 301, 280, 333)];
    let count = 28;
    let (mut scene, _) = Scattered::new(&frames, 12, count);
    // One beside an edge of tiles by 4 px, which the window crosses and the ellipse does not; one that is seen by nobody.
    scene.planes[0][..9].copy_from_slice(&[156.0, 144.0, 0.5, 0.5, 0.5, -3.0, -0.5, -0.5, 0.0]);
    scene.planes[1][..9].copy_from_slice(&[380.0, 16.0, 0.5, 0.5, 0.5, -9.0, 0.0, 0.0, 0.0]);
    let raster = Raster::new(
        &gpu,
        RasterOptions {
            splats: count as u32,
            pixels: 1,
            tiles: 1,
            isects: 1,
            batch: true,
            background_image: false,
            median: false,
            backward: false,
            reduction: Reduction::Deterministic,
        },
    )
    .unwrap();
    let frame_list = Buffer::from_slice(&gpu, "frames", &frames).unwrap();
    let plane_frames = Buffer::from_slice(&gpu, "plane frames", &scene.frames).unwrap();
    let (tile_width, tile_height) = (raster.tile.width, raster.tile.height);
    let spec = stages::plane_project::Spec { workgroup_size: WORKGROUP, tile_width, tile_height };
    // 13 × 10 tiles of the loss and 9 × 11.
    let per_frame = 130;
    let words = |len: usize| Buffer::<u32>::zeroed(&gpu, "words", len).unwrap();
    let (tile_marks, tile_count, lists) =
        (words(4 * per_frame), words(2), [words(2 * per_frame), words(2 * per_frame)]);
    let mut recorder = gpu.recorder("tiles").unwrap();
    PlaneProject::new(&gpu, &spec).unwrap().record(
        &mut recorder,
        &stages::plane_project::Buffers {
            frames: &frame_list,
            plane_frames: &plane_frames,
            plane_states: &Buffer::from_slice(&gpu, "states", &[PlaneState { count: 0, stepping: 1 }; 2]).unwrap(),
            depths: &Buffer::from_slice(&gpu, "depths", &scene.depths).unwrap(),
            plane: &Buffer::from_slice(&gpu, "plane", &scene.columns()).unwrap(),
            splats: &raster.splats,
            depth_keys: &raster.depth_keys,
            tile_counts: &raster.tile_counts,
        },
        &stages::plane_project::Push { count: count as u32, stride: count as u32 },
    );
    PlaneTiles::new(&gpu, WORKGROUP).unwrap().record(
        &mut recorder,
        &stages::plane_tiles::Buffers {
            frames: &frame_list,
            plane_frames: &plane_frames,
            tile_counts: &raster.tile_counts,
            splats: &raster.splats,
            tile_marks: &tile_marks,
            count: &tile_count,
            forward_tiles: &lists[0],
            backward_tiles: &lists[1],
        },
        &stages::plane_tiles::Push { slots: count as u32, tiles_per_frame: per_frame as u32 },
    );
    recorder.submit().unwrap().wait().unwrap();
    let counts = tile_count.download().unwrap();
    let options = Options { tile_width, tile_height, ..Default::default() };
    let depths: Vec<f64> = scene.depths.iter().map(|&z| f64::from(z)).collect();
    let mut listed = [0, 0];
    for ((which, list), halo) in lists.iter().enumerate().zip([WINDOW_RADIUS, 0.0]) {
        let mut all = list.download_range(0, counts[which] as usize).unwrap();
        all.sort_unstable();
        for (f, &Frame { width, height, .. }) in frames.iter().enumerate() {
            let (mut planes, _) = scene.of_frame(f as u32);
            let p = plane_project(&mut planes, pixels_of(&depths, &frames[f]), width, height, &options);
            let twin = |halo| plane_tiles(&p.splats, &p.tile_counts, width, height, ssim_forward::TILE, halo);
            let first = (f * per_frame) as u32;
            let own = first..first + per_frame as u32;
            let got: Vec<u32> = all.iter().filter(|t| own.contains(t)).map(|t| t - first).collect();
            assert!(got.is_sorted_by(|a, b| a < b), "a tile twice: {got:?}");
            assert!(twin(halo).iter().all(|t| got.contains(t)), "{got:?}");
            assert!(got.iter().all(|t| twin(halo + 0.01).contains(t)), "{got:?}");
            // Nothing is within a hundredth of a pixel of another tile, so the twin's list is the only one.
            assert_eq!(twin(halo), twin(halo + 0.01));
            listed[which] += got.len();
        }
    }
    println!("{listed:?} tiles of {}", 13 * 10 + 9 * 11);
    assert!(listed[1] > 20 && listed[1] < listed[0] && listed[0] < 180);
}

/// A draw into 20 empty slots of a view of 64 × 48 pixels; which pixels were drawn.
fn drawn(gpu: &Gpu, loss: &[f32], overflow: u32) -> Vec<usize> {
    let frame = Frame { image_first: 0, target_first: 0, width: 64, height: 48 };
    let slots = 20u32;
    let words = |name: &str, len: usize| Buffer::<u32>::zeroed(gpu, name, len).unwrap();
    let floats = |name: &str, len: usize| Buffer::<f32>::zeroed(gpu, name, len).unwrap();
    let plane_frames = Buffer::from_slice(gpu, "plane frames", &[NONE; 20]).unwrap();
    let plane = floats("plane", 10 * 20);
    let mut recorder = gpu.recorder("draw").unwrap();
    PlaneDraw::new(gpu, &stages::plane_draw::Spec { workgroup_size: 256 }).unwrap().record(
        &mut recorder,
        &stages::plane_draw::Buffers {
            status: &Buffer::from_slice(gpu, "status", &[overflow, 0]).unwrap(),
            frames: &Buffer::from_slice(gpu, "frames", &[frame]).unwrap(),
            quotas: &Buffer::from_slice(gpu, "quotas", &[Quota { view: 0, first: 0, budget: slots }]).unwrap(),
            loss_map: &Buffer::from_slice(gpu, "loss map", loss).unwrap(),
            image: &Buffer::<[f32; 4]>::zeroed(gpu, "image", loss.len()).unwrap(),
            drawn_pixels: &words("drawn", 20),
            plane_states: &Buffer::<PlaneState>::zeroed(gpu, "states", 1).unwrap(),
            plane_frames: &plane_frames,
            plane: &plane,
            plane_ages: &words("ages", 20),
            plane_moments: &floats("moments", 18 * 20),
        },
        &stages::plane_draw::Push { frame_count: 1, stride: slots, round: 1, seed: 1 },
    );
    recorder.submit().unwrap().wait().unwrap();
    let (taken, plane) = (plane_frames.download().unwrap(), plane.download().unwrap());
    (0..20).filter(|&i| taken[i] == 0).map(|i| plane[20 + i] as usize * 64 + plane[i] as usize).collect()
}

#[test]
fn pixels_without_a_usable_loss_are_never_drawn() {
    let gpu = Gpu::new();
    let bad = [0.0, -0.5, 1e-19, 1e-30, 1e19, 1e30, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let mut loss: Vec<f32> = (0..64 * 48).map(|p| bad[p % bad.len()]).collect();
    assert!(drawn(&gpu, &loss, 0).is_empty());
    for p in [700, 2000] {
        loss[p] = 0.25;
    }
    assert_eq!(drawn(&gpu, &loss, 0), [700, 2000]);
}

#[test]
fn waiting_views_and_overflow_leave_everything_alone() {
    let gpu = Gpu::new();
    let count = 40;
    let (scene, _) = Scattered::new(&FRAMES, 8, count);
    let frames = Buffer::from_slice(&gpu, "frames", &FRAMES).unwrap();
    let prune = PlanePrune::new(&gpu, &stages::plane_prune::Spec { workgroup_size: WORKGROUP }).unwrap();
    let plane = Buffer::from_slice(&gpu, "plane", &scene.columns()).unwrap();
    for (overflow, stepping) in [(1, 1), (0, 0)] {
        let plane_frames = Buffer::from_slice(&gpu, "plane frames", &scene.frames).unwrap();
        let states = Buffer::from_slice(&gpu, "states", &[PlaneState { count: 0, stepping }; 2]).unwrap();
        let status = Buffer::from_slice(&gpu, "status", &[overflow, 0]).unwrap();
        let mut recorder = gpu.recorder("prune").unwrap();
        let buffers = stages::plane_prune::Buffers {
            status: &status,
            frames: &frames,
            plane_states: &states,
            plane: &plane,
            plane_frames: &plane_frames,
        };
        let push = stages::plane_prune::Push { count: count as u32, stride: count as u32 };
        prune.record(&mut recorder, &buffers, &push);
        recorder.submit().unwrap().wait().unwrap();
        assert_eq!(plane_frames.download().unwrap(), scene.frames);
    }
    let loss = vec![0.5; 64 * 48];
    assert_eq!((drawn(&gpu, &loss, 0).len(), drawn(&gpu, &loss, 1).len()), (4, 0));
}

/// A wall of a few wide Gaussians, and photographs of it with stripes that the wall lacks.
fn striped_wall(views: usize) -> (Scene, Vec<Camera>, Vec<Vec<u8>>) {
    let mut base = Gaussians { sh_degree: 0, ..Default::default() };
    for (i, j) in (0..5).flat_map(|i| (0..5).map(move |j| (i, j))) {
        base.means.push([i as f32 - 2.0, j as f32 - 2.0, 4.0]);
        base.log_scales.push([-0.4, -0.4, -4.0]);
        base.quats.push([1.0, 0.0, 0.0, 0.0]);
        base.opacities.push(4.0);
        base.sh.push([0.3, -0.2, 0.5]);
    }
    let (width, height) = (180, 160);
    let camera = |v: usize| Camera {
        width,
        height,
        fx: 200.0,
        fy: 200.0,
        cx: 90.0,
        cy: 80.0,
        rotation: glam::DMat3::IDENTITY,
        translation: glam::DVec3::new(0.1 * v as f64, 0.0, 0.0),
    };
    let photograph = |v: usize| {
        (0..width * height)
            .flat_map(|p| {
                let (x, y) = (p % width, p / width);
                let stripe = ((x + 5 * v as u32) / 12).is_multiple_of(3) && y > 40;
                if stripe { [220, 200, 60] } else { [150, 115, 165] }
            })
            .collect()
    };
    (Scene { base, supplement: None }, (0..views).map(camera).collect(), (0..views).map(photograph).collect())
}

const BLACK: [f32; 3] = [0.0; 3];
const SCHEDULE: Schedule = Schedule { round_steps: 180, final_steps: 60, max_rounds: 3 };

fn refine(
    gpu: &Gpu,
    views: usize,
    budgets: &[u32],
    isects: Option<u32>,
) -> (Vec<glint::pipelines::plane::Plane>, glint::pipelines::plane::Refined) {
    let (scene, cameras, photographs) = striped_wall(views);
    let photographs: Vec<&[u8]> = photographs.iter().map(Vec::as_slice).collect();
    let views = Views::upload(gpu, &cameras, &photographs).unwrap();
    let model = Model::upload(gpu, &scene, 0).unwrap();
    let options = RenderOptions { depth: true, ..Default::default() };
    let mut renderer = Renderer::new(gpu, model.count(), &views, options).unwrap();
    let mut stage = PlaneStage::new(gpu, &views, budgets, SCHEDULE, 1, Reduction::Deterministic).unwrap();
    assert!(stage.batches().iter().eq([&(0..cameras.len())]));
    if let Some(isects) = isects {
        stage.raster.borrow_mut().grow(isects).unwrap();
    }
    let losses = base_losses(&mut renderer, &model, &views, BLACK).unwrap();
    let mut heard = 0;
    let refined = stage.refine(&mut renderer, &model, &views, 0, BLACK, |p| {
        assert!(p.step <= p.steps && p.count <= p.budget);
        heard += 1;
    });
    let refined = refined.unwrap();
    assert!(heard > 0);
    for (of_base, of_stage) in losses.iter().zip(&refined.base_losses) {
        // Sums of the same numbers in another order.
        close(*of_stage, *of_base, 1e-6, "base loss");
    }
    (stage.download(0).unwrap(), refined)
}

#[test]
fn refined_views_lose_less_whatever_their_batch_and_however_small_the_buffers() {
    let gpu = Gpu::new();
    let (planes, refined) = refine(&gpu, 2, &[60, 31], None);
    for v in 0..2 {
        assert!(refined.losses[v] < 0.99 * refined.base_losses[v], "{refined:?}");
        assert!(refined.counts[v] <= [60, 31][v]);
        assert_eq!(planes.iter().filter(|p| p.view == v as u32).count() as u32, refined.counts[v]);
    }
    assert!(refined.counts[0] >= 20 && refined.rounds <= SCHEDULE.max_rounds, "{refined:?}");
    for p in &planes {
        assert!((0.0..=180.0).contains(&p.centre[0]) && (0.0..=160.0).contains(&p.centre[1]));
        assert!(p.colour.iter().all(|c| (0.0..=1.0).contains(c)));
        assert!(p.log_scale.iter().all(|s| *s <= 3.4f32.ln() + 1e-6));
        // The wall's own z, but for pixels that see past it.
        assert!(p.depth == 0.0 || (p.depth - 4.0).abs() < 0.2, "{p:?}");
    }

    let (alone, one) = refine(&gpu, 1, &[60], None);
    assert_eq!(one.losses[0], refined.losses[0]);
    assert!(alone.iter().eq(planes.iter().filter(|p| p.view == 0)));

    let (cramped, small) = refine(&gpu, 2, &[60, 31], Some(20));
    assert!(small.grown > 0);
    assert_eq!(cramped, planes);
    assert_eq!(small.losses, refined.losses);
}

#[test]
fn budgets_are_shared_out_by_loss() {
    assert_eq!(budgets(&[0.1, 0.3, 0.0, f64::NAN], 1000, 0.1), [25, 75, 0, 0]);
    assert_eq!(budgets(&[0.2, 0.2, 0.2], 100, 0.1), [4, 4, 4]);
    assert_eq!(budgets(&[0.0, 0.0], 100, 0.1), [0, 0]);
    assert!(budgets(&[], 100, 0.1).is_empty());
}
