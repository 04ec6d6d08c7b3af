//! A scene on the window's device, and the ways to look at it.

use crate::{
    Result,
    data::Image,
    gpu::Context,
    pipelines::{
        frames::{Frames, Instance, Limits, Texel},
        model::{Model, Room, Segment},
        session::Policy,
    },
    report::{decompose::decompose, page::FULL_ERROR, sidebyside::error_map},
    scene::{Camera, Gaussians, Scene, Supplement},
};
use glam::DVec3;
use image::{RgbImage, imageops};

use super::{
    super::picture::{Content, Picture},
    screen::{self, Drawn, IN_FLIGHT, Screen, Shown, Wanted},
};

/// What is shown.
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
    /// In the order of their keys, from 1 on.
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

    /// From a photograph's camera only.
    pub(super) fn of_photograph(self) -> bool {
        matches!(self, Mode::Photograph | Mode::Error)
    }
}

/// A photograph in the middle of the window.
pub(super) struct Fitted {
    /// 3 bytes a pixel of the window, black around the photograph.
    rgb: Vec<u8>,
    /// By pixel, whether the photograph says something of it.
    counts: Vec<bool>,
}

impl Fitted {
    /// As [`Camera::fitted`] has it.
    pub(super) fn new(image: &Image, [width, height]: [u32; 2]) -> Self {
        let (w, h) = (image.width, image.height);
        let scale = (f64::from(width) / f64::from(w)).min(f64::from(height) / f64::from(h));
        let side = |own: u32| ((scale * f64::from(own)).round() as u32).max(1);
        let margin = |side: u32, own: u32| ((f64::from(side) - scale * f64::from(own)) / 2.0).round() as u32;
        let (left, top) = (margin(width, w), margin(height, h));
        let whole = RgbImage::from_raw(w, h, image.rgb.clone()).unwrap_or_default();
        // Of the same size it is the same image.
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

/// From where it is seen, and what beside the scene there is.
pub(super) struct Look<'a> {
    pub(super) camera: Camera,
    /// sRGB.
    pub(super) background: [f32; 3],
    /// The photograph of this camera.
    pub(super) photo: Option<&'a Fitted>,
}

/// What frames were made for, where it changes.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Purpose {
    size: [u32; 2],
    /// For numbers.
    wide: bool,
    depth: bool,
}

/// A scene on the window's device.
pub(super) struct Scenery {
    whole: Model,
    /// The supplementary Gaussians, until their model is made.
    supplement: Option<Supplement>,
    lobes: Option<Model>,
    frames: Option<(Purpose, Frames)>,
    policy: Policy,
    /// Base and supplement.
    pub(super) counts: [usize; 2],
}

impl Scenery {
    /// Waits.
    pub(super) fn new(context: &Context, scene: Scene, origin: DVec3, policy: Policy) -> Result<Self> {
        let whole = Model::upload_around(context, origin, &scene, Room::default())?;
        let counts = [scene.base.len(), scene.supplement.as_ref().map_or(0, |s| s.gaussians.len())];
        let supplement = scene.supplement.filter(|s| !s.gaussians.is_empty());
        Ok(Scenery { whole, supplement, lobes: None, frames: None, policy, counts })
    }

    /// Why `mode` shows nothing, where that is so.
    pub(super) fn lacks(&self, mode: Mode, at_photo: bool) -> Option<&'static str> {
        match mode {
            Mode::Photograph | Mode::Error if !at_photo => {
                Some("no photograph was taken from here: n and p go to one's camera")
            }
            Mode::Supplement if self.counts[1] == 0 => Some("the scene has no supplement"),
            Mode::Specular if self.counts[1] == 0 && self.whole.sh_degree == 0 => {
                Some("the scene looks the same from everywhere: it has no specular part")
            }
            _ => None,
        }
    }

    /// Draws a frame. With `save` waits for it and gives the window's pixels.
    pub(super) fn show(&mut self, screen: &mut Screen, mode: Mode, look: &Look<'_>, save: bool) -> Result<Drawn> {
        let Camera { width, height, .. } = look.camera;
        if mode == Mode::Supplement {
            self.make_lobes(screen.context())?;
        }
        let wide = matches!(mode, Mode::Diffuse | Mode::Specular | Mode::Error);
        self.make_frames(screen, Purpose { size: [width, height], wide, depth: mode == Mode::Depth })?;
        let picture = |content| Picture { width, height, content }.rgb();
        let rgb = match mode {
            Mode::Augmented | Mode::Base | Mode::Supplement => {
                let Some(scene) = self.scene(mode, look) else { return Ok(Drawn { shown: false, pixels: None }) };
                return screen.show(Shown::Scene(Box::new(scene)), save);
            }
            Mode::Diffuse | Mode::Specular => {
                let whole = self.numbers(screen, Mode::Augmented, look, Wanted::Color)?;
                let parts = decompose(&whole, &self.numbers(screen, Mode::Diffuse, look, Wanted::Color)?);
                picture(Content::Linear(if mode == Mode::Diffuse { parts.diffuse } else { parts.specular }))
            }
            Mode::Depth => picture(Content::Depth(self.numbers(screen, Mode::Augmented, look, Wanted::Depth)?)),
            Mode::Photograph => look.photo.map(|photo| photo.rgb.clone()).unwrap_or_default(),
            Mode::Error => match look.photo {
                Some(photo) => {
                    let whole = self.numbers(screen, Mode::Augmented, look, Wanted::Color)?;
                    let mut map = error_map(&whole, &photo.rgb, FULL_ERROR);
                    for (pixel, _) in map.chunks_exact_mut(3).zip(&photo.counts).filter(|(_, counts)| !**counts) {
                        pixel.fill(128);
                    }
                    map
                }
                None => Vec::new(),
            },
        };
        screen.show(Shown::Picture(&rgb), save)
    }

    /// Makes room for what the last frame had none for; whether it should be drawn again. Waits.
    pub(super) fn make_room(&mut self, screen: &mut Screen) -> Result<bool> {
        match &mut self.frames {
            Some((_, frames)) => screen.make_room(frames),
            None => Ok(false),
        }
    }

    /// How long each stage takes, the slowest first. Draws a frame for it, and waits.
    pub(super) fn stages(
        &mut self,
        screen: &mut Screen,
        mode: Mode,
        look: &Look<'_>,
    ) -> Result<Vec<(&'static str, std::time::Duration)>> {
        match self.scene(mode, look) {
            Some(scene) => screen.stages(&scene),
            None => Ok(Vec::new()),
        }
    }

    fn numbers(&mut self, screen: &mut Screen, mode: Mode, look: &Look<'_>, wanted: Wanted) -> Result<Vec<f32>> {
        match self.scene(mode, look) {
            Some(mut scene) => screen.numbers(&mut scene, wanted),
            None => Ok(Vec::new()),
        }
    }

    /// What of the scene the device draws for a mode: of diffuse light the base with its constant harmonic, of what is made of the
    /// whole scene the whole. `None` before there are frames.
    fn scene(&mut self, mode: Mode, look: &Look<'_>) -> Option<screen::Scene<'_>> {
        let all = Instance::of(&self.whole);
        let instance = match mode {
            Mode::Base => Instance { upto: Segment::Base, ..all },
            Mode::Diffuse => Instance { upto: Segment::Base, degree: 0, ..all },
            Mode::Supplement => self.lobes.as_ref().map_or(all, Instance::of),
            _ => all,
        };
        let (_, frames) = self.frames.as_mut()?;
        Some(screen::Scene { frames, instance, camera: look.camera, background: look.background })
    }

    /// The supplement is drawn without the base by a model of its own, made when it is first asked for.
    fn make_lobes(&mut self, context: &Context) -> Result<()> {
        let Some(supplement) = self.supplement.take_if(|_| self.lobes.is_none()) else { return Ok(()) };
        let base = Gaussians { sh_degree: self.whole.sh_degree, ..Default::default() };
        let scene = Scene { base, supplement: Some(supplement) };
        self.lobes = Some(Model::upload_around(context, self.whole.origin, &scene, Room::default())?);
        Ok(())
    }

    fn make_frames(&mut self, screen: &mut Screen, wanted: Purpose) -> Result<()> {
        if self.frames.as_ref().is_some_and(|(purpose, _)| *purpose == wanted) {
            return Ok(());
        }
        // What the old ones drew may still run.
        screen.finish()?;
        self.frames = None;
        let [width, height] = wanted.size;
        let mut degrees = vec![self.whole.sh_degree, 0];
        degrees.dedup();
        let limits = Limits {
            in_flight: IN_FLIGHT,
            texel: if wanted.wide { Texel::Rgba32F } else { Texel::Rgba8 },
            degrees,
            depth_out: wanted.depth,
            policy: self.policy,
            ..Limits::of(&self.whole, width, height)
        };
        self.frames = Some((wanted, Frames::new(screen.context(), limits)?));
        Ok(())
    }
}
