//! Tests the screen phase as a whole, and data that its kernels must not change; `glint verify` checks their
//! results.

use glint::{
    gpu::{Buffer, ContextOptions, Recorder},
    pipelines::{
        model::Model,
        raster::Raster,
        render::{Needs, RenderOptions, Renderer},
        screen::{Refined, Refiner, Schedule, ScreenGaussian, base_losses, batch::ScreenSizes, budgets, rig::Screen},
        session::{Policy, Session},
        views::Views,
    },
    reference::{
        Options,
        screen_project::screen_project,
        screen_tiles::{WINDOW_RADIUS, screen_tiles},
    },
    scene::{Camera, Scene},
    stages::{
        constants::{
            constants::NONE,
            screen::{DRAWING, WAITING},
        },
        ssim,
        status::{Resource, Status},
        types::{Frame, Quota, View},
    },
    verify::screen::{SMALL_FRAMES, Scattered, pixel_count, pixels_of},
};

use super::{
    common::{Gpu, session},
    plates,
};

fn close(got: f32, expected: f64, tolerance: f64, what: &str) {
    let error = (f64::from(got) - expected).abs();
    assert!(error <= tolerance * (1.0 + expected.abs()), "{what}: {got} for {expected}");
}

fn run(gpu: &Gpu, record: impl FnOnce(&mut Recorder)) {
    let mut recorder = gpu.recorder("test").unwrap();
    record(&mut recorder);
    recorder.submit().unwrap().wait().unwrap();
}

/// A few small 2D Gaussians in two large images: the loss is only computed at tiles that can change.
#[test]
fn tiles_without_2d_gaussians_near_are_not_listed() {
    let gpu = Gpu::new();
    let frame = |image_first, width, height| Frame { image_first, target_first: image_first, width, height };
    let frames = [frame(0, 403, 301), frame(403 * 301, 280, 333)];
    let count = 28;
    let (mut scene, _) = Scattered::new(&frames, 12, count);
    // One 4 px from an edge of tiles, crossed by the window but not by the ellipse; one outside of all views.
    scene.gaussians[0][..9].copy_from_slice(&[156.0, 144.0, 0.5, 0.5, 0.5, -3.0, -0.5, -0.5, 0.0]);
    scene.gaussians[1][..9].copy_from_slice(&[380.0, 16.0, 0.5, 0.5, 0.5, -9.0, 0.0, 0.0, 0.0]);
    let mut screen = Screen::new(&gpu, ScreenSizes::of_frames(&frames, count as u32), Policy::default()).unwrap();
    scene.upload(&mut screen, &frames).unwrap();
    let status = screen.status().unwrap();
    run(&gpu, |recorder| {
        screen.record_render(recorder, &status);
        screen.record_lists(recorder, &status);
    });
    let lists = [&screen.lists.forward_tiles, &screen.lists.backward_tiles];
    let counts = screen.lists.count.download().unwrap();
    let Raster { tile, .. } = screen.raster;
    let options = Options { tile_width: tile.width, tile_height: tile.height, ..Default::default() };
    let depths: Vec<f64> = scene.depths.iter().map(|&z| f64::from(z)).collect();
    // 13 × 10 tiles of the loss and 9 × 11.
    let (per_frame, mut listed) = (130, [0, 0]);
    for ((which, list), halo) in lists.into_iter().enumerate().zip([WINDOW_RADIUS, 0.0]) {
        let mut all = list.download_range(0, counts[which] as usize).unwrap();
        all.sort_unstable();
        for (f, &Frame { width, height, .. }) in frames.iter().enumerate() {
            let (mut gaussians, _) = scene.of_frame(f as u32);
            let p = screen_project(&mut gaussians, pixels_of(&depths, &frames[f]), width, height, &options);
            let twin = |halo| screen_tiles(&p.splats, &p.tile_counts, width, height, ssim::TILE, halo);
            let first = (f * per_frame) as u32;
            let own = first..first + per_frame as u32;
            let got: Vec<u32> = all.iter().filter(|t| own.contains(t)).map(|t| t - first).collect();
            // Nothing is within a hundredth of a pixel of another tile, so the twin's list is unambiguous.
            assert_eq!(twin(halo), twin(halo + 0.01));
            assert!(got.iter().eq(twin(halo).iter()), "{got:?}");
            listed[which] += got.len();
        }
    }
    println!("{listed:?} tiles of {}", 13 * 10 + 9 * 11);
    assert!(listed[1] > 20 && listed[1] < listed[0] && listed[0] < 180);
}

/// Earlier renders of a rig must not show in later ones: tiles without Gaussians show the backdrop again, and
/// so does the image of an empty batch.
#[test]
fn tiles_that_2d_gaussians_have_left_show_the_backdrop() {
    let gpu = Gpu::new();
    let count = 40;
    let (scene, _) = Scattered::new(&SMALL_FRAMES, 5, count);
    let pixels = pixel_count(&SMALL_FRAMES);
    let backdrop: Vec<[f32; 4]> = (0..pixels).map(|p| [0, 1, 2, 3].map(|c| (p * 7 + c) as f32 % 64.0 / 64.0)).collect();
    let rig = || {
        let mut screen =
            Screen::new(&gpu, ScreenSizes::of_frames(&SMALL_FRAMES, count as u32), Policy::default()).unwrap();
        scene.upload(&mut screen, &SMALL_FRAMES).unwrap();
        screen.raster.buffers.backdrop.upload(0, &backdrop).unwrap();
        let status = screen.status().unwrap();
        (screen, status)
    };
    let (screen, status) = rig();
    let image = |screen: &Screen, status: &Buffer<u32>, left: usize| {
        let frames: Vec<u32> = scene.frames.iter().enumerate().map(|(i, &f)| if i < left { f } else { NONE }).collect();
        screen.buffers.screen_frames.upload(0, &frames).unwrap();
        run(&gpu, |recorder| screen.record_render(recorder, status));
        screen.raster.buffers.image.download_range(0, pixels).unwrap()
    };
    let behind: Vec<[f32; 4]> = backdrop.iter().map(|&[r, g, b, _]| [r, g, b, 1.0]).collect();
    let mut changed = 0;
    for left in [count, 3, 12, 1, 0, 0] {
        let shown = image(&screen, &status, left);
        let (again, none) = rig();
        assert_eq!(shown, image(&again, &none, left), "{left} Gaussians");
        changed += shown.iter().zip(&behind).filter(|(a, b)| a != b).count();
    }
    assert_eq!(image(&screen, &status, 0), behind);
    assert!(changed > pixels / 2, "{changed}");

    // Another batch starts with arbitrary image contents.
    let mut screen = screen;
    screen.raster.buffers.image.upload(0, &vec![[9.0; 4]; pixels]).unwrap();
    scene.upload(&mut screen, &SMALL_FRAMES).unwrap();
    assert_eq!(image(&screen, &status, 0), behind);
}

/// The status of a step that did not fit.
fn failed() -> Status {
    let mut status = Status::default();
    status.fail(Resource::Intersections, 1);
    status
}

/// Draws into 20 empty places of a view of 64 × 48 pixels; returns the drawn pixels.
fn drawn(gpu: &Gpu, loss: &[f32], status: Status) -> Vec<usize> {
    let frame = Frame { image_first: 0, target_first: 0, width: 64, height: 48 };
    let mut screen = Screen::new(gpu, ScreenSizes::of_frames(&[frame], 20), Policy::default()).unwrap();
    screen.begin(&[frame], &[View::default()], &[Quota { view: 0, first: 0, budget: 20 }]).unwrap();
    screen.loss.loss_map().upload(0, loss).unwrap();
    screen.raster.buffers.image.upload(0, &vec![[0.0; 4]; loss.len()]).unwrap();
    let words = screen.status().unwrap();
    words.upload(0, &status.0).unwrap();
    run(gpu, |recorder| screen.record_draw(recorder, 1, 1, 0, &words));
    let b = &screen.buffers;
    let (taken, planes) = (b.screen_frames.download().unwrap(), b.screen_planes.download().unwrap());
    (0..20).filter(|&i| taken[i] == 0).map(|i| planes[20 + i] as usize * 64 + planes[i] as usize).collect()
}

#[test]
fn pixels_without_a_usable_loss_are_never_drawn() {
    let gpu = Gpu::new();
    let bad = [0.0, -0.5, 1e-19, 1e-30, 1e19, 1e30, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let mut loss: Vec<f32> = (0..64 * 48).map(|p| bad[p % bad.len()]).collect();
    assert!(drawn(&gpu, &loss, Status::default()).is_empty());
    for p in [700, 2000] {
        loss[p] = 0.25;
    }
    assert_eq!(drawn(&gpu, &loss, Status::default()), [700, 2000]);
}

#[test]
fn waiting_views_and_overflow_leave_everything_alone() {
    let gpu = Gpu::new();
    let (scene, _) = Scattered::new(&SMALL_FRAMES, 8, 40);
    let mut screen = Screen::new(&gpu, ScreenSizes::of_frames(&SMALL_FRAMES, 40), Policy::default()).unwrap();
    scene.upload(&mut screen, &SMALL_FRAMES).unwrap();
    let (words, b) = (screen.status().unwrap(), &screen.buffers);
    for (status, mode) in [(failed(), DRAWING), (Status::default(), WAITING)] {
        screen.set_mode(mode).unwrap();
        words.upload(0, &status.0).unwrap();
        run(&gpu, |recorder| screen.record_prune(recorder, &words));
        assert_eq!(b.screen_frames.download().unwrap(), scene.frames);
    }
    let loss = vec![0.5; 64 * 48];
    assert_eq!((drawn(&gpu, &loss, Status::default()).len(), drawn(&gpu, &loss, failed()).len()), (4, 0));
}

/// A wall of a few wide Gaussians, and photographs of it with stripes that the wall lacks.
fn striped(views: usize, width: u32, height: u32) -> (Scene, Vec<Camera>, Vec<Vec<u8>>) {
    let translation = |v: usize| glam::DVec3::new(0.1 * v as f64, 0.0, 0.0);
    let camera = |v| Camera { translation: translation(v), ..Camera::new(width, height, f64::from(width) / 0.9) };
    let photograph = |v: usize| {
        (0..width * height)
            .flat_map(|p| {
                let (x, y) = (p % width, p / width);
                let stripe = ((x + 5 * v as u32) / 12).is_multiple_of(3) && y > 40;
                if stripe { [220, 200, 60] } else { [150, 115, 165] }
            })
            .collect()
    };
    (
        Scene { base: plates([5, 5], 1.0, [-0.4, -0.4, -4.0], 4.0, [0.3, -0.2, 0.5]), ..Default::default() },
        (0..views).map(camera).collect(),
        (0..views).map(photograph).collect(),
    )
}

const SCHEDULE: Schedule = Schedule { round_steps: 60, final_steps: 20, max_rounds: 3, shared_steps: false };

fn refine(gpu: &Gpu, views: usize, budgets: &[u32], isects: Option<u32>) -> (Vec<ScreenGaussian>, Refined) {
    let (scene, cameras, photographs) = striped(views, 120, 100);
    let photographs: Vec<&[u8]> = photographs.iter().map(Vec::as_slice).collect();
    let views = Views::upload(gpu, &cameras, &photographs).unwrap();
    let model = Model::upload(gpu, &scene, 0).unwrap();
    let options = RenderOptions { depth: true, ..Default::default() };
    let mut renderer = Renderer::new(gpu, Needs::of(&model), &views, options).unwrap();
    let session = Session { seed: 1, ..session(gpu) };
    let losses = base_losses(&session, &mut renderer, &model, &views).unwrap();
    let mut refiner = Refiner::new(&session, &views, budgets, SCHEDULE).unwrap();
    assert!(refiner.batches().iter().eq([&(0..cameras.len())]));
    if let Some(isects) = isects {
        refiner.screen.raster.grow(isects).unwrap();
    }
    let mut heard = 0;
    let refined = refiner.refine(&mut renderer, &model, &views, 0, |p| {
        assert!(p.step <= p.steps && p.count <= p.budget);
        heard += 1;
    });
    let refined = refined.unwrap();
    assert!(heard > 0);
    for (of_base, of_phase) in losses.iter().zip(&refined.base_losses) {
        // Sums of the same numbers in another order.
        close(*of_phase, *of_base, 1e-6, "base loss");
    }
    (refiner.download().unwrap().into_iter().map(|(_, gaussian)| gaussian).collect(), refined)
}

#[test]
fn refined_views_lose_less_whatever_their_batch_and_however_small_the_buffers() {
    let gpu = Gpu::new();
    let (gaussians, refined) = refine(&gpu, 2, &[60, 31], None);
    for v in 0..2 {
        assert!(refined.losses[v] < 0.99 * refined.base_losses[v], "{refined:?}");
        assert!(refined.counts[v] <= [60, 31][v]);
        assert_eq!(gaussians.iter().filter(|p| p.view == v as u32).count() as u32, refined.counts[v]);
    }
    assert!(refined.counts[0] >= 20 && refined.rounds <= SCHEDULE.max_rounds, "{refined:?}");
    for p in &gaussians {
        assert!((0.0..=120.0).contains(&p.centre[0]) && (0.0..=100.0).contains(&p.centre[1]));
        assert!(p.color.iter().all(|c| (0.0..=1.0).contains(c)));
        assert!(p.log_scale.iter().all(|s| *s <= 2.2f32.ln() + 1e-6));
        // The wall's own z, except for pixels past its edge.
        assert!(p.depth == 0.0 || (p.depth - 4.0).abs() < 0.2, "{p:?}");
    }

    let (alone, one) = refine(&gpu, 1, &[60], None);
    assert_eq!(one.losses[0], refined.losses[0]);
    assert!(alone.iter().eq(gaussians.iter().filter(|p| p.view == 0)));

    let (cramped, small) = refine(&gpu, 2, &[60, 31], Some(20));
    assert!(small.grown > 0);
    assert_eq!(cramped, gaussians);
    assert_eq!(small.losses, refined.losses);
}

/// Two views whose working memory does not fit the budget together come one after the other, with the result that
/// they have together.
#[test]
fn batches_fit_the_memory_and_do_not_change_the_result() {
    let (scene, mut cameras, mut photographs) = striped(2, 480, 440);
    let (_, small, photograph) = striped(1, 144, 132);
    cameras.splice(..1, small);
    photographs.splice(..1, photograph);
    let photographs: Vec<&[u8]> = photographs.iter().map(Vec::as_slice).collect();
    let options = RenderOptions { depth: true, ..Default::default() };
    let schedule = Schedule { round_steps: 4, final_steps: 4, max_rounds: 2, shared_steps: false };
    let refined = |memory_budget| {
        let gpu = Gpu::with(ContextOptions { memory_budget, ..ContextOptions::from_env() });
        let views = Views::upload(&gpu, &cameras, &photographs).unwrap();
        let model = Model::upload(&gpu, &scene, 0).unwrap();
        let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, options).unwrap();
        let losses = base_losses(&session(&gpu), &mut renderer, &model, &views).unwrap();
        let mut refiner = Refiner::new(&session(&gpu), &views, &[20, 16], schedule).unwrap();
        let mut all: Vec<(f32, f32, Vec<ScreenGaussian>)> = Vec::new();
        for batch in 0..refiner.batches().len() {
            let of = refiner.refine(&mut renderer, &model, &views, batch, |_| ()).unwrap();
            let gaussians = refiner.download().unwrap();
            for (at, v) in refiner.views().enumerate() {
                let own = gaussians.iter().map(|(_, g)| *g).filter(|g| g.view == v as u32).collect();
                all.push((of.base_losses[at], of.losses[at], own));
                close(of.base_losses[at], losses[v], 1e-6, "base loss");
            }
        }
        (refiner.batches().len(), all)
    };
    let (together, expected) = refined(None);
    // Both views need 49 MB, with the quarter that is left free; one needs 29.
    let (apart, found) = refined(Some(38_000_000));
    assert_eq!([together, apart], [1, 2]);
    assert_eq!(found, expected);
    for (base, loss, gaussians) in &found {
        assert!(loss < base && gaussians.len() > 4, "{base} {loss} {}", gaussians.len());
    }
}

/// Every draw is followed by a round of steps and a prune, including the draw that fills the budget; then all
/// take the last steps. Without prunes 50 places fill in five draws of ten.
#[test]
fn what_is_drawn_last_has_a_round_too() {
    let gpu = Gpu::new();
    let (scene, cameras, photographs) = striped(1, 180, 160);
    let views = Views::upload(&gpu, &cameras, &[&photographs[0]]).unwrap();
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let options = RenderOptions { depth: true, ..Default::default() };
    let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, options).unwrap();
    for (shared_steps, want) in [(false, [120, 140, 160, 180, 200]), (true, [200; 5])] {
        let schedule = Schedule { round_steps: 20, final_steps: 100, max_rounds: 20, shared_steps };
        let mut refiner = Refiner::new(&session(&gpu), &views, &[50], schedule).unwrap();
        let refined = refiner.refine(&mut renderer, &model, &views, 0, |_| ()).unwrap();
        let b = &refiner.screen.buffers;
        let (frames, ages) = (b.screen_frames.download().unwrap(), b.screen_ages.download().unwrap());
        assert_eq!((refined.counts[0], refined.rounds, frames), (50, 5, vec![0; 50]), "something was pruned");
        for age in want {
            let times = want.iter().filter(|&&a| a == age).count();
            assert_eq!(ages.iter().filter(|&&a| a == age).count(), 10 * times, "{ages:?}");
        }
    }
}

#[test]
fn budgets_are_shared_out_by_loss() {
    assert_eq!(budgets(&[0.1, 0.3, 0.0, f64::NAN], 100), [25, 75, 0, 0]);
    assert_eq!(budgets(&[0.2, 0.2, 0.2], 10), [4, 4, 4]);
    assert_eq!(budgets(&[0.0, 0.0], 10), [0, 0]);
    assert!(budgets(&[], 10).is_empty());
}
