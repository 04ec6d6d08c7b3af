//! Verifies the screen phase: batches of frames, and 2D Gaussians from draw to prune.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Bench;
use crate::{
    error::Result,
    gpu::Buffer,
    pipelines::{
        screen::{
            batch::ScreenSizes,
            rig::{LEARNED, SCREEN_PLANES, Screen},
        },
        session::{Policy, Reduction},
    },
    reference::{NONE, screen_project::ScreenGaussian},
    stages::{
        constants::screen::{DRAWING, FILLED},
        status::{self, Status},
        types::{Frame, Quota, ScreenState, View},
    },
};

pub(super) fn cases(bench: &Bench<'_>, quick: bool) -> Result<()> {
    let (frames, count) = if quick { (SMALL_FRAMES, 160) } else { (frames([(403, 301), (280, 333)]), 4000) };
    batch(bench, frames, count)?;
    listed(bench, frames, count)?;
    prune(bench, frames, if quick { 500 } else { 20_000 })?;
    draw(bench, frames, quick)
}

/// Two frames one after the other in memory.
pub const fn frames([a, b]: [(u32, u32); 2]) -> [Frame; 2] {
    [
        Frame { image_first: 0, target_first: 0, width: a.0, height: a.1 },
        Frame { image_first: a.0 * a.1, target_first: a.0 * a.1, width: b.0, height: b.1 },
    ]
}

/// Two frames of different sizes, neither of whole tiles.
pub const SMALL_FRAMES: [Frame; 2] = frames([(61, 43), (50, 70)]);

/// Number of pixels of all frames.
pub fn pixel_count(frames: &[Frame; 2]) -> usize {
    frames.iter().map(|f| (f.width * f.height) as usize).sum()
}

/// The slice of a frame in a buffer of all pixels.
pub fn pixels_of<'a, T>(all: &'a [T], frame: &Frame) -> &'a [T] {
    &all[frame.image_first as usize..][..(frame.width * frame.height) as usize]
}

/// Random 2D Gaussians whose places alternate between two frames; every seventh place is empty.
pub struct Scattered {
    /// 2D Gaussians by place.
    pub gaussians: Vec<ScreenGaussian>,
    /// Frame of each place, [`NONE`] if it is empty.
    pub frames: Vec<u32>,
    /// Depths by pixel of all frames, a tenth of these 0.
    pub depths: Vec<f32>,
}

impl Scattered {
    /// `count` places, and the random generator in its final state.
    pub fn new(all: &[Frame; 2], seed: u64, count: usize) -> (Self, ChaCha8Rng) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let frames: Vec<u32> = (0..count).map(|i| if i % 7 == 3 { NONE } else { (i / 2 % 2) as u32 }).collect();
        let gaussians = frames
            .iter()
            .map(|&f| {
                let frame = all[f.min(1) as usize];
                let mut gaussian = [0.0; 10];
                // Rounded to float32, so that both sides start with the same values.
                let mut set = |p: usize, x: f64| gaussian[p] = f64::from(x as f32);
                set(0, rng.random_range(0.0..frame.width as f64));
                set(1, rng.random_range(0.0..frame.height as f64));
                (2..5).for_each(|c| set(c, rng.random_range(0.0..1.0)));
                set(5, rng.random_range(-5.0..3.0));
                set(6, rng.random_range(-1.0..2.3));
                set(7, rng.random_range(-1.0..2.3));
                set(8, rng.random_range(-1.5..1.5));
                gaussian
            })
            .collect();
        let depth = |rng: &mut ChaCha8Rng| if rng.random_bool(0.1) { 0.0 } else { rng.random_range(1.0..9.0) };
        let depths = (0..pixel_count(all)).map(|_| depth(&mut rng)).collect();
        (Scattered { gaussians, frames, depths }, rng)
    }

    /// The values plane by plane, as on the device.
    pub fn columns(&self) -> Vec<f32> {
        let n = self.gaussians.len();
        (0..SCREEN_PLANES * n).map(|k| self.gaussians[k % n][k / n] as f32).collect()
    }

    /// The Gaussians of a frame, and their places.
    pub fn of_frame(&self, f: u32) -> (Vec<ScreenGaussian>, Vec<usize>) {
        let places: Vec<usize> = (0..self.gaussians.len()).filter(|&i| self.frames[i] == f).collect();
        (places.iter().map(|&i| self.gaussians[i]).collect(), places)
    }

    /// Uploads as the current batch of a rig of this size; all views take steps.
    pub fn upload(&self, screen: &mut Screen, all: &[Frame; 2]) -> Result<()> {
        let count = self.gaussians.len() as u32;
        // Quotas matter only for draws.
        screen.begin(all, &[View::default(); 2], &[Quota { view: 0, first: 0, budget: count }, Quota::default()])?;
        let b = &screen.buffers;
        b.screen_planes.upload(0, &self.columns())?;
        b.screen_frames.upload(0, &self.frames)?;
        Ok(b.depths.upload(0, &self.depths)?)
    }
}

/// Verifies projection, tile lists, blending and its backward pass of two frames at once, gradients and the
/// step.
fn batch(bench: &Bench<'_>, all: [Frame; 2], count: usize) -> Result<()> {
    let context = &bench.shadowed;
    let pixels = pixel_count(&all);
    let (scene, mut rng) = Scattered::new(&all, 3, count);
    let policy = Policy { reduction: Reduction::Deterministic, ..Default::default() };
    let mut screen = Screen::new(context, ScreenSizes::of_frames(&all, count as u32), policy)?;
    scene.upload(&mut screen, &all)?;
    let backdrop: Vec<[f32; 4]> = (0..pixels).map(|_| [0; 4].map(|_| rng.random_range(0.0..1.0))).collect();
    screen.raster.buffers.backdrop.upload(0, &backdrop)?;
    let status = screen.status()?;
    loop {
        bench.run(|recorder| screen.record_render(recorder, &status))?;
        match Status::read(&status.download()?).needs().next() {
            None => break,
            Some((_, needed)) => screen.raster.grow(needed)?,
        }
        status.upload(0, &[0; status::WORDS])?;
    }
    // With few Gaussians most tiles of the loss are unlisted, with all of them most are listed.
    let tile_counts = screen.raster.buffers.tile_counts.download()?;
    for some in [2, 5, 9, count] {
        let counts: Vec<u32> = tile_counts.iter().enumerate().map(|(i, &n)| if i < some { n } else { 0 }).collect();
        screen.raster.buffers.tile_counts.upload(0, &counts)?;
        bench.run(|recorder| screen.record_lists(recorder, &status))?;
    }
    let image_grad: Vec<f32> = (0..3 * pixels).map(|_| rng.random_range(-1.0..1.0)).collect();
    screen.raster.buffers.image_grad.upload(0, &image_grad)?;
    bench.run(|recorder| screen.record_blend_backward(recorder))?;
    let gradients = Buffer::<f32>::zeroed(context, "gradients", 2 * LEARNED * count)?;
    bench.run(|recorder| screen.record_gradients(recorder, &gradients, &status))?;
    let moments: Vec<f32> = (0..18 * count)
        .map(
            |k| if (k / count).is_multiple_of(2) { rng.random_range(-0.1..0.1) } else { rng.random_range(0.001..0.01) },
        )
        .collect();
    let ages: Vec<u32> = (0..count as u32).map(|i| [0, 1, 5, 80, 1500][i as usize % 5]).collect();
    screen.buffers.screen_moments.upload(0, &moments)?;
    screen.buffers.screen_ages.upload(0, &ages)?;
    bench.run(|recorder| screen.record_step(recorder, &status))
}

/// Verifies the list of blended tiles while 2D Gaussians are removed: first all are there, then fewer and
/// fewer.
fn listed(bench: &Bench<'_>, all: [Frame; 2], count: usize) -> Result<()> {
    let (scene, _) = Scattered::new(&all, 3, count);
    let mut screen = Screen::new(&bench.shadowed, ScreenSizes::of_frames(&all, count as u32), Policy::default())?;
    scene.upload(&mut screen, &all)?;
    let status = screen.status()?;
    for left in [count, count / 20, 9, 2, 0, 0] {
        let frames: Vec<u32> = scene.frames.iter().enumerate().map(|(i, &f)| if i < left { f } else { NONE }).collect();
        screen.buffers.screen_frames.upload(0, &frames)?;
        bench.run(|recorder| screen.record_render(recorder, &status))?;
    }
    Ok(())
}

fn prune(bench: &Bench<'_>, all: [Frame; 2], count: usize) -> Result<()> {
    let (mut scene, mut rng) = Scattered::new(&all, 4, count);
    for gaussian in &mut scene.gaussians {
        gaussian[5] = f64::from(rng.random_range(-6.0..2.0f32));
        gaussian[6] = f64::from(rng.random_range(-1.0..1.5f32));
    }
    scene.gaussians[1][0] = f64::NAN;
    scene.gaussians[2][5] = f64::NAN;
    let mut screen = Screen::new(&bench.shadowed, ScreenSizes::of_frames(&all, count as u32), Policy::default())?;
    scene.upload(&mut screen, &all)?;
    let status = screen.status()?;
    bench.run(|recorder| screen.record_prune(recorder, &status))
}

fn draw(bench: &Bench<'_>, all: [Frame; 2], quick: bool) -> Result<()> {
    const CASES: u32 = 6;
    const AGE: u32 = 3;
    let pixels = pixel_count(&all);
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let many = if quick { 900 } else { 20_000 };
    let sizes = ScreenSizes::of_frames(&all, 3600.max(many + 1));
    let mut screen = Screen::new(&bench.shadowed, sizes, Policy::default())?;
    let image: Vec<[f32; 4]> = (0..pixels).map(|_| [0; 4].map(|_| rng.random_range(-0.2..1.2))).collect();
    screen.raster.buffers.image.upload(0, &image)?;
    let status = screen.status()?;
    // Budgets; fraction of pixels with a loss; fraction of occupied places.
    for (round, (budgets, dense, taken)) in (1..).zip([
        ([100, 37], 1.0, 0.0),
        ([2, 0], 1.0, 0.0),
        ([600, 3000], 0.02, 0.1),
        ([50, 60], 0.0, 0.5),
        ([many, 1], 0.5, 0.3),
        ([40, 50], 0.5, 0.3),
    ]) {
        let places = (budgets[0] + budgets[1]) as usize;
        let losses: Vec<f32> = (0..pixels)
            .map(|_| if rng.random_bool(dense) { rng.random_range(0.0..1.2f32).powi(3) } else { 0.0 })
            .collect();
        let frames: Vec<u32> = (0..places)
            .map(|i| if rng.random_bool(taken) { u32::from(i >= budgets[0] as usize) } else { NONE })
            .collect();
        let quotas = [
            Quota { view: 11, first: 0, budget: budgets[0] },
            Quota { view: 12, first: budgets[0], budget: budgets[1] },
        ];
        screen.begin(&all, &[View::default(); 2], &quotas)?;
        // In the last case the second view has reached its budget and draws no more.
        let modes = [DRAWING, if round == CASES { FILLED } else { DRAWING }];
        screen.loss.loss_map().upload(0, &losses)?;
        let b = &screen.buffers;
        b.screen_frames.upload(0, &frames)?;
        b.screen_ages.upload(0, &vec![7; places])?;
        b.screen_states.upload(0, &modes.map(|mode| ScreenState { count: 9, mode }))?;
        b.screen_moments.upload(0, &vec![1.0; 2 * LEARNED * screen.sizes.places as usize])?;
        bench.run(|recorder| screen.record_draw(recorder, round, 5, AGE, &status))?;
    }
    Ok(())
}
