//! Scene on the window's device, and the modes to show it.

use std::{collections::BTreeMap, time::Duration};

use crate::{
    Result,
    data::Image,
    gpu::Context,
    pipelines::{
        frames::{Frames, Instance, Limits, Texel},
        model::{Model, Room, Segment},
        render::Needs,
        session::Policy,
    },
    report::{decompose::decompose, pictures::error_map},
    scene::{Camera, Gaussians, Scene, Supplement},
};
use glam::DVec3;
use image::{RgbImage, imageops};

use super::{
    super::picture::{Content, Picture},
    screen::{self, Drawn, IN_FLIGHT, PATIENCE, Screen, Shown, Wanted},
};

/// Content of the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    Photograph,
    Augmented,
    Base,
    Supplement,
    Diffuse,
    Specular,
    Depth,
    Error,
}

impl Mode {
    /// All modes in the order of their keys, from 1 on.
    pub(super) const ALL: [Mode; 8] = [
        Mode::Photograph,
        Mode::Augmented,
        Mode::Base,
        Mode::Supplement,
        Mode::Diffuse,
        Mode::Specular,
        Mode::Depth,
        Mode::Error,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Mode::Photograph => "photograph",
            Mode::Augmented => "augmented",
            Mode::Base => "base",
            Mode::Supplement => "supplement",
            Mode::Diffuse => "diffuse",
            Mode::Specular => "specular",
            Mode::Depth => "depth",
            Mode::Error => "error",
        }
    }

    /// Whether the mode works only from a photo's camera.
    pub(super) fn of_photograph(self) -> bool {
        matches!(self, Mode::Photograph | Mode::Error)
    }
}

/// Photo in the middle of the window.
pub(super) struct Fitted {
    /// Pixels of the window, 3 bytes each; black around the photo.
    rgb: Vec<u8>,
    /// Whether the photo counts, for each pixel.
    counts: Vec<bool>,
}

impl Fitted {
    /// Fits the photo into the window as [`Camera::fitted`] does.
    pub(super) fn new(image: &Image, [width, height]: [u32; 2]) -> Self {
        let (w, h) = (image.width, image.height);
        let scale = (f64::from(width) / f64::from(w)).min(f64::from(height) / f64::from(h));
        let side = |own: u32| ((scale * f64::from(own)).round() as u32).max(1);
        let margin = |side: u32, own: u32| ((f64::from(side) - scale * f64::from(own)) / 2.0).round() as u32;
        let (left, top) = (margin(width, w), margin(height, h));
        let whole = RgbImage::from_raw(w, h, image.rgb.clone()).unwrap_or_default();
        // Resizing to the same size copies the image.
        let near = imageops::resize(&whole, side(w), side(h), imageops::FilterType::Triangle);
        let mut rgb = vec![0; 3 * (width * height) as usize];
        let mut counts = vec![false; (width * height) as usize];
        for (x, y, pixel) in near.enumerate_pixels().filter(|(x, y, _)| left + x < width && top + y < height) {
            let at = ((top + y) * width + left + x) as usize;
            rgb[3 * at..][..3].copy_from_slice(&pixel.0);
            let own = |i: u32, side: u32, own: u32| (u64::from(i) * u64::from(own) / u64::from(side)) as usize;
            let from = own(y, near.height(), h) * w as usize + own(x, near.width(), w);
            counts[at] = image.mask.as_ref().is_none_or(|mask| mask[from]);
        }
        Fitted { rgb, counts }
    }
}

/// Camera, background and photo of a frame.
pub(super) struct Look<'a> {
    pub(super) camera: Camera,
    /// Background, sRGB.
    pub(super) background: [f32; 3],
    /// Photo of this camera.
    pub(super) photo: Option<&'a Fitted>,
}

/// Properties for which frames were made; they are made again if one changes.
#[derive(Clone, PartialEq, Eq)]
struct Purpose {
    size: [u32; 2],
    /// Whether colors are read as numbers.
    wide: bool,
    depth: bool,
    /// Whether every stage is timed.
    timed: bool,
    /// Needs of the model.
    needs: Needs,
}

/// Ways to draw a scene, and resources other than its model.
pub(super) struct Scenery {
    /// Supplementary Gaussians, until their model is made.
    supplement: Option<Supplement>,
    lobes: Option<Model>,
    frames: Option<(Purpose, Frames)>,
    policy: Policy,
    /// Gaussians of base and supplement; unknown for a scene that trains.
    pub(super) counts: Option<[usize; 2]>,
    /// Whether stages are timed.
    pub(super) timed: bool,
}

impl Scenery {
    /// Uploads a scene and returns its model. Waits.
    pub(super) fn new(context: &Context, scene: Scene, origin: DVec3, policy: Policy) -> Result<(Self, Model)> {
        let whole = Model::upload_around(context, origin, &scene, Room::default())?;
        let counts = [scene.base.len(), scene.supplement.as_ref().map_or(0, |s| s.gaussians.len())];
        let supplement = scene.supplement.filter(|s| !s.gaussians.is_empty());
        Ok((Scenery { supplement, counts: Some(counts), ..Scenery::learning(policy) }, whole))
    }

    /// Scenery of a model that trains while it is shown.
    pub(super) fn learning(policy: Policy) -> Self {
        Scenery { supplement: None, lobes: None, frames: None, policy, counts: None, timed: false }
    }

    /// Reason why `mode` shows nothing, if so.
    pub(super) fn lacks(&self, model: &Model, mode: Mode, at_photo: bool) -> Option<&'static str> {
        let drawn = matches!(mode, Mode::Photograph | Mode::Augmented | Mode::Base);
        match (mode, self.counts) {
            (_, None) if !drawn => Some("not shown during training: use glint view afterwards"),
            (Mode::Photograph | Mode::Error, _) if !at_photo => {
                Some("no photograph was taken from here: n and p jump to the camera of one")
            }
            (Mode::Supplement, Some([_, 0])) => Some("the scene has no supplement"),
            (Mode::Specular, Some([_, 0])) if model.sh_degree == 0 => {
                Some("the scene looks the same from everywhere: it has no specular part")
            }
            _ => None,
        }
    }

    /// Draws a frame. With `save`, waits for it and returns the window's pixels.
    pub(super) fn show(
        &mut self,
        screen: &mut Screen,
        model: &Model,
        mode: Mode,
        look: &Look<'_>,
        save: bool,
    ) -> Result<Drawn> {
        let Camera { width, height, .. } = look.camera;
        if mode == Mode::Supplement {
            self.make_lobes(screen.context(), model)?;
        }
        let wide = matches!(mode, Mode::Diffuse | Mode::Specular | Mode::Error);
        let (depth, timed) = (mode == Mode::Depth, self.timed);
        let needs = Needs::of(model);
        self.make_frames(screen, Purpose { size: [width, height], wide, depth, timed, needs })?;
        // A training run does not wait for its window.
        let patience = if self.counts.is_some() { PATIENCE } else { Duration::ZERO };
        let picture = |content| Picture { width, height, content }.rgb();
        let rgb = match mode {
            Mode::Augmented | Mode::Base | Mode::Supplement => {
                let Some(scene) = self.scene(model, mode, look) else {
                    return Ok(Drawn { shown: false, pixels: None });
                };
                return screen.show(Shown::Scene(Box::new(scene)), save, patience);
            }
            Mode::Diffuse | Mode::Specular => {
                let whole = self.numbers(screen, model, Mode::Augmented, look, Wanted::Color)?;
                let parts = decompose(&whole, &self.numbers(screen, model, Mode::Diffuse, look, Wanted::Color)?);
                picture(Content::Linear(if mode == Mode::Diffuse { parts.diffuse } else { parts.specular }))
            }
            Mode::Depth => {
                picture(Content::Depth(self.numbers(screen, model, Mode::Augmented, look, Wanted::Depth)?))
            }
            Mode::Photograph => look.photo.map(|photo| photo.rgb.clone()).unwrap_or_default(),
            Mode::Error => match look.photo {
                Some(photo) => {
                    let whole = self.numbers(screen, model, Mode::Augmented, look, Wanted::Color)?;
                    let mut map = error_map(&whole, &photo.rgb);
                    for (pixel, _) in map.chunks_exact_mut(3).zip(&photo.counts).filter(|(_, counts)| !**counts) {
                        pixel.fill(128);
                    }
                    map
                }
                None => Vec::new(),
            },
        };
        screen.show(Shown::Picture(&rgb), save, patience)
    }

    /// Grows buffers that overflowed in the last frame. Returns whether to draw it again. Waits.
    pub(super) fn make_room(&mut self, screen: &mut Screen) -> Result<bool> {
        match &mut self.frames {
            Some((_, frames)) => screen.make_room(frames),
            None => Ok(false),
        }
    }

    /// Duration of each stage in the last frame, slowest first; empty if they are not timed. The frame must
    /// be done.
    pub(super) fn stages(&self, screen: &Screen) -> Result<Vec<(&'static str, Duration)>> {
        let Some((_, frames)) = &self.frames else { return Ok(Vec::new()) };
        let mut sums = BTreeMap::<&'static str, Duration>::new();
        for stage in screen.stages(frames)? {
            *sums.entry(stage.name).or_default() += stage.time;
        }
        let mut stages: Vec<_> = sums.into_iter().collect();
        stages.sort_by_key(|(_, time)| std::cmp::Reverse(*time));
        Ok(stages)
    }

    fn numbers(
        &mut self,
        screen: &mut Screen,
        model: &Model,
        mode: Mode,
        look: &Look<'_>,
        wanted: Wanted,
    ) -> Result<Vec<f32>> {
        match self.scene(model, mode, look) {
            Some(mut scene) => screen.numbers(&mut scene, wanted),
            None => Ok(Vec::new()),
        }
    }

    /// Part of the scene that a mode draws: for diffuse light the base with its constant harmonic, for
    /// other modes made from the whole scene the whole. `None` before there are frames.
    fn scene<'a>(&'a mut self, model: &'a Model, mode: Mode, look: &Look<'_>) -> Option<screen::Scene<'a>> {
        let all = Instance::of(model);
        let instance = match mode {
            Mode::Base => Instance { upto: Segment::Base, ..all },
            Mode::Diffuse => Instance { upto: Segment::Base, degree: 0, ..all },
            Mode::Supplement => self.lobes.as_ref().map_or(all, Instance::of),
            _ => all,
        };
        let (_, frames) = self.frames.as_mut()?;
        Some(screen::Scene { frames, instance, camera: look.camera, background: look.background })
    }

    /// Makes the model of the supplement without the base, on first use.
    fn make_lobes(&mut self, context: &Context, model: &Model) -> Result<()> {
        let Some(supplement) = self.supplement.take_if(|_| self.lobes.is_none()) else { return Ok(()) };
        let base = Gaussians { sh_degree: model.part(Segment::Base).sh_degree, ..Default::default() };
        let scene = Scene { base, supplement: Some(supplement), origin: model.scene_origin, ..Scene::default() };
        self.lobes = Some(Model::upload_around(context, model.origin, &scene, Room::default())?);
        Ok(())
    }

    fn make_frames(&mut self, screen: &mut Screen, wanted: Purpose) -> Result<()> {
        if self.frames.as_ref().is_some_and(|(purpose, _)| *purpose == wanted) {
            return Ok(());
        }
        // Earlier frames may still be running.
        screen.finish()?;
        screen.forget();
        self.frames = None;
        let [width, height] = wanted.size;
        let mut needs = wanted.needs.clone();
        if !needs.degrees.contains(&0) {
            needs.degrees.push(0);
        }
        let limits = Limits {
            in_flight: IN_FLIGHT,
            texel: if wanted.wide { Texel::Rgba32F } else { Texel::Rgba8 },
            depth_out: wanted.depth,
            timings: wanted.timed,
            policy: self.policy,
            ..Limits::for_needs(needs, width, height)
        };
        self.frames = Some((wanted, Frames::new(screen.context(), limits)?));
        Ok(())
    }
}
