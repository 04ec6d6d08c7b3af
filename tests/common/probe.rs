//! One view of a scene with its gradients and one Adam step: on the device, and by the float64 twin.

#![allow(dead_code, reason = "each test file uses its part")]

use crate::common::Gpu;
use glam::DVec3;
use glint::{
    gpu::Buffer,
    pipelines::{
        learn::{Learner, Lesson, Rates, Seen},
        model::{Model, Room, Segment},
        raster::TileShape,
        render::{Needs, RenderOptions, Renderer, Show},
        session::{Policy, Reduction},
        views::Views,
    },
    reference::{self, Background, Options, Params, random_camera},
    scene::{
        Camera, Gaussians, Lobes, Scene, Supplement,
        layout::{self, Array},
    },
    stages::status,
};

pub const BACKGROUND: [f32; 3] = [0.1, 0.2, 0.3];

/// Rates of the step, all different, so that a swap shows.
pub const RATES: Rates = Rates {
    mean: 1e-4,
    log_scale: 5e-3,
    quat: 1e-3,
    opacity: 2.5e-2,
    dc: 2.5e-3,
    sh: 1.25e-4,
    direction: 1.5e-3,
    width: 2e-4,
    sharpness: 2e-3,
    mean_opacity: 0.0,
    mean_scale: 0.0,
    newton: 0.3,
};

#[derive(Clone, Copy)]
pub struct Setup {
    pub compensate: bool,
    pub degree: u32,
    /// Only opacities step; then `gradients` is meaningless.
    pub opacity_only: bool,
    pub tile: Option<TileShape>,
    pub origin: DVec3,
    pub reduction: Reduction,
    /// Moments and gradient records are packed.
    pub packed: bool,
    /// Maximum number of Gaussians per page.
    pub page: Option<u32>,
}

impl Default for Setup {
    fn default() -> Self {
        Setup {
            compensate: false,
            degree: 0,
            opacity_only: false,
            tile: None,
            origin: DVec3::ZERO,
            reduction: Reduction::Deterministic,
            packed: false,
            page: None,
        }
    }
}

/// Result of a view of a scene.
#[derive(Clone)]
pub struct Shot {
    pub image: Vec<[f32; 4]>,
    pub depth: Vec<f32>,
    pub tile_counts: Vec<u32>,
    /// Gradients in the twin's layout.
    pub gradients: Params,
    /// Scene after one Adam step.
    pub stepped: Scene,
}

impl Shot {
    /// All numbers as bits, for exact comparison.
    pub fn bits(&self) -> Vec<u64> {
        let p = &self.gradients;
        let s = Params::from_scene(&self.stepped).unwrap();
        let image = self.image.iter().flatten().chain(&self.depth).map(|&x| f64::from(x));
        let rest = [&p.geometry, &p.sh, &p.lobes, &s.geometry, &s.sh, &s.lobes].into_iter().flatten().copied();
        image.chain(rest).map(f64::to_bits).chain(self.tile_counts.iter().map(|&t| u64::from(t))).collect()
    }

    pub fn is_finite(&self) -> bool {
        self.bits().into_iter().all(|b| f64::from_bits(b).is_finite())
    }
}

pub struct Probe {
    pub renderer: Renderer,
    setup: Setup,
    // Dropped last.
    gpu: Gpu,
}

impl Probe {
    /// For up to `gaussians` Gaussians and images up to the size of `largest`.
    pub fn new(gaussians: u32, largest: &Camera, setup: Setup) -> Self {
        let gpu = Gpu::new();
        let views = Views::upload(&gpu, &[*largest], &[]).unwrap();
        let Setup { compensate, tile, reduction, degree, packed, .. } = setup;
        let policy = Policy { reduction, compensate, tile, packed };
        let options = RenderOptions { policy, depth: true, backward: true, ..Default::default() };
        let needs = Needs { gaussians, degrees: vec![degree], lobe_degrees: vec![degree], half: false };
        Probe { renderer: Renderer::new(&gpu, needs, &views, options).unwrap(), setup, gpu }
    }

    /// The twin's options for the same computation.
    pub fn options(&self) -> Options {
        let tile = self.renderer.raster.tile;
        Options {
            active_degree: self.setup.degree,
            compensate: self.setup.compensate,
            tile_width: tile.width,
            tile_height: tile.height,
            median_threshold: 0.5,
        }
    }

    pub fn shoot(&mut self, scene: &Scene, camera: &Camera, image_grad: &[[f64; 3]]) -> Shot {
        let gpu = &self.gpu;
        let origin = self.setup.origin;
        let views = Views::upload_around(gpu, origin, &[*camera], &[]).unwrap();
        let room = Room { page: self.setup.page, ..Default::default() };
        let model = Model::upload_around(gpu, origin, scene, room).unwrap();
        let show = Show { degree: self.setup.degree, ..Show::all(&model, BACKGROUND) };
        let image = self.renderer.render_shown(&model, &views, 0, &show).unwrap();
        let raster = &self.renderer.raster;
        let flat: Vec<f32> = image_grad.iter().flatten().map(|&g| g as f32).collect();
        raster.buffers.image_grad.upload(0, &flat).unwrap();
        let grid = raster.grid(0, 1, camera.width, camera.height);
        let status = Buffer::<u32>::zeroed(gpu, "status", status::WORDS).unwrap();
        let mut recorder = gpu.recorder("probe").unwrap();
        raster.record_blend_backward(&mut recorder, &grid, &views.frames, &model.population, 0);
        let seen = Seen { model: &model, views: &views, view: 0, raster, degree: self.setup.degree, status: &status };
        let n = model.count() as usize;
        let mut out = Params::zeros(n, model.count_of(Segment::Base) as usize, model.sh_degree);
        let segments = Segment::ALL.into_iter().filter(|&s| model.count_of(s) > 0);
        let learners: Vec<_> = segments
            .map(|segment| {
                let Setup { opacity_only, compensate, packed, degree: least_degree, .. } = self.setup;
                let lesson = Lesson { opacity_only, compensate, packed, least_degree, ..Lesson::new(segment) };
                [true, false].map(|accumulate| Learner::new(&model, lesson, accumulate).unwrap())
            })
            .collect();
        for [gradients, _] in &learners {
            gradients.record_begin(&mut recorder);
            gradients.record_add(&mut recorder, &seen);
        }
        // The first step has the length of the rate, whatever the gradient.
        for [_, step] in &learners {
            step.record_step(&mut recorder, &seen, &RATES, 0);
        }
        recorder.submit().unwrap().wait().unwrap();
        for [learner, _] in learners.iter().filter(|_| !self.setup.opacity_only) {
            let segment = learner.lesson.segment;
            let first = if segment.has_lobes() { out.lobe_first } else { 0 };
            let count = model.count_of(segment) as usize;
            let got = learner.gradients().unwrap();
            let fill = |array: &mut [f64], planes: Vec<Vec<f32>>, stride: usize, first: usize| {
                for (plane, got) in array.chunks_mut(stride.max(1)).zip(planes) {
                    (0..count).for_each(|i| plane[first + i] = f64::from(got[i]));
                }
            };
            fill(&mut out.geometry, got.geometry.download().unwrap(), n, first);
            fill(&mut out.sh, got.sh.download().unwrap(), n, first);
            fill(&mut out.lobes, got.lobes.download().unwrap(), out.lobe_stride, 0);
        }
        let pixels = image.color.chunks(3).zip(&image.transmittance);
        Shot {
            image: pixels.map(|(c, &t)| [c[0], c[1], c[2], t]).collect(),
            depth: image.depth,
            tile_counts: raster.buffers.tile_counts.download_range(0, n).unwrap(),
            gradients: out,
            stepped: model.download().unwrap(),
        }
    }

    /// The twin's result for the same view, and a gradient of the image. The gradient is smooth and differs
    /// by channel; it is 0 at pixels closer than `calm` (relative) to a threshold, where float32 may decide
    /// differently.
    pub fn twin(&self, scene: &Scene, camera: &Camera, calm: f64) -> Twin {
        let params = Params::from_scene(scene).unwrap();
        let view = reference::View::from_camera(camera).rounded();
        let options = self.options();
        let rendered = reference::render(&params, &view, &options, Background::Color(BACKGROUND.map(f64::from)));
        let image_grad: Vec<[f64; 3]> = (0..camera.pixels() as usize)
            .map(|p| match rendered.blended.margins[p].gradient() > calm {
                true => ripple(p),
                false => [0.0; 3],
            })
            .collect();
        let gradients = rendered.backward(&params, &view, &options, &image_grad).params;
        Twin { rendered, gradients, image_grad }
    }
}

/// A smooth gradient of the image that differs by channel. Its mean is not 0; otherwise sums over wide
/// Gaussians would cancel and leave nothing to measure their error against.
pub fn ripple(pixel: usize) -> [f64; 3] {
    [0.0, 1.0, 2.0].map(|c: f64| f64::from((0.5 + (pixel as f64 * 0.013 + c).sin()) as f32))
}

pub struct Twin {
    pub rendered: reference::Rendered,
    pub gradients: Params,
    pub image_grad: Vec<[f64; 3]>,
}

/// Differences between the device and the twin.
#[derive(Debug, Default)]
pub struct Distance {
    /// Largest difference of a calm pixel, relative to the largest color if that is above 1.
    pub image: f64,
    /// Fraction of calm pixels.
    pub calm: f64,
    /// Relative L2 error and cosine for each group of parameters with a gradient.
    pub groups: Vec<(&'static str, f64, f64)>,
}

impl Distance {
    pub fn worst(&self) -> f64 {
        self.groups.iter().map(|g| g.1).fold(0.0, f64::max)
    }
}

/// Compares image and gradients; pixels are calm if their image gradient is not 0.
pub fn distance(shot: &Shot, twin: &Twin) -> Distance {
    let blended = &twin.rendered.blended;
    let scale = blended.image.iter().flatten().fold(1.0f64, |a, &b| a.max(b));
    let (mut image, mut calm) = (0.0f64, 0);
    for (p, want) in blended.image.iter().enumerate() {
        if twin.image_grad[p] != [0.0; 3] {
            calm += 1;
            image = (0..4)
                .map(|c| (f64::from(shot.image[p][c]) - want[c]).abs() / scale)
                .fold(image, |a, b| if b >= a || b.is_nan() { b } else { a });
        }
    }
    let mut out = Distance { image, calm: f64::from(calm) / blended.image.len().max(1) as f64, groups: Vec::new() };
    let (got, want) = (&shot.gradients, &twin.gradients);
    for group in layout::groups(want.sh_degree) {
        let first = if group.array == Array::Lobes { want.lobe_first } else { 0 };
        let of = |p: &Params| p.group(&group, first, want.count - first).collect::<Vec<_>>();
        let pairs: Vec<(f64, f64)> = of(got).into_iter().zip(of(want)).collect();
        let norm = |f: fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>().sqrt();
        let (difference, size, other) = (norm(|(g, w)| (g - w).powi(2)), norm(|(_, w)| w * w), norm(|(g, _)| g * g));
        // Values that float32 flushes to 0 have no relative error.
        if size > 1e-35 || other > 1e-35 {
            let cosine = pairs.iter().map(|(g, w)| g * w).sum::<f64>() / (size * other);
            out.groups.push((group.name, difference / size, cosine));
        }
    }
    out
}

/// Parameters of one Gaussian.
#[derive(Debug, Clone, Copy)]
pub struct Blob {
    pub mean: DVec3,
    pub scale: [f64; 3],
    pub quat: [f32; 4],
    pub logit: f32,
    pub rgb: [f32; 3],
}

impl Default for Blob {
    fn default() -> Self {
        Blob { mean: DVec3::ZERO, scale: [0.1; 3], quat: [0.9, 0.2, -0.3, 0.4], logit: 0.0, rgb: [0.8, 0.5, 0.2] }
    }
}

/// Base Gaussians of degree 0.
pub fn base(blobs: &[Blob]) -> Gaussians {
    const DC: f32 = 0.282_094_79;
    Gaussians {
        sh_degree: 0,
        means: blobs.iter().map(|b| b.mean.as_vec3().to_array()).collect(),
        log_scales: blobs.iter().map(|b| b.scale.map(|s| s.ln() as f32)).collect(),
        quats: blobs.iter().map(|b| b.quat).collect(),
        opacities: blobs.iter().map(|b| b.logit).collect(),
        sh: blobs.iter().map(|b| b.rgb.map(|c| (c - 0.5) / DC)).collect(),
    }
}

pub fn scene(blobs: &[Blob]) -> Scene {
    Scene { base: base(blobs), ..Default::default() }
}

/// A base, and supplementary Gaussians, each with a lobe (direction, width, sharpness).
pub fn with_lobes(plain: &[Blob], lobed: &[(Blob, [f32; 3], f32, f32)]) -> Scene {
    let lobes = Lobes {
        directions: lobed.iter().map(|l| l.1).collect(),
        widths: lobed.iter().map(|l| l.2).collect(),
        sharpness: lobed.iter().map(|l| l.3).collect(),
    };
    let gaussians = base(&lobed.iter().map(|l| l.0).collect::<Vec<_>>());
    Scene { base: base(plain), supplement: Some(Supplement { gaussians, lobes }), ..Default::default() }
}

/// A rotated camera at `eye` with a horizontal field of view of 60°; use `unproject` to place objects in its
/// view.
pub fn camera_at(eye: DVec3, width: u32, height: u32) -> Camera {
    let (camera, focal) = (random_camera(width, height), f64::from(width) * 0.866);
    Camera { fx: focal, fy: focal * 1.05, translation: -(camera.rotation * eye), ..camera }
}
