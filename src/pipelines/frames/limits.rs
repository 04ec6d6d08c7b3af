//! What frames are made for, and what that holds.

use super::{
    super::{
        model::{Model, Room as Extra},
        plan::{Plan, buffers},
        raster::{Grid, LIST_BYTES, Raster, RasterOptions},
        render::Needs,
        session::Policy,
    },
    view::Texel,
};
use crate::{
    error::{Error, Result},
    gpu::DeviceInfo,
    scene::color,
    stages::{
        status,
        types::{self, View},
    },
};

/// Room for intersections of Gaussians and tiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Room {
    /// Four for each Gaussian and three for each pixel, as far as the device binds lists of so many: enough for most views of most
    /// scenes.
    Usual,
    /// So many.
    Intersections(u32),
    /// As many as take so many bytes, as far as the device binds their lists.
    Bytes(u64),
}

/// Bytes of an intersection in the four lists that are sorted.
const INTERSECTION_BYTES: u64 = 4 * LIST_BYTES;

/// Buffers of models that memory is taken for in advance.
const MOST_BUFFERS: u64 = 1 << 16;
/// Slots at most: more than any renderer has frames in flight.
const SLOTS: u32 = 64;

/// What frames are made for.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Pixels of the largest view.
    pub width: u32,
    /// Pixels of the largest view.
    pub height: u32,
    /// Gaussians of all instances of a frame together: the sum of their models' [`Model::capacity`].
    pub gaussians: u32,
    /// Instances of a frame.
    pub instances: u32,
    /// Views of a frame: eyes, faces of a cube.
    pub views: u32,
    /// Slots, at most 64.
    pub in_flight: u32,
    /// Beyond them a view shows what is near only.
    pub intersections: Room,
    /// The widest texels of any target.
    pub texel: Texel,
    /// Bands of harmonics that bases are rendered with, a pipeline for each number; 0 to 3, or [`BETAS`](crate::scene::color::BETAS).
    pub degrees: Vec<u32>,
    /// The same of supplements; empty where no model has one.
    pub lobe_degrees: Vec<u32>,
    /// Models are of half width, see [`model::Room::half`](super::super::model::Room::half).
    pub half: bool,
    /// Views have depths that hide Gaussians.
    pub depth_in: bool,
    /// Depths and numbers of Gaussians will be asked for.
    pub depth_out: bool,
    /// Every stage has timestamps, see [`Frames::times`](super::Frames::times).
    pub timings: bool,
    /// Which variants of the stages run; sums of gradients are none of a frame's affair.
    pub policy: Policy,
}

impl Limits {
    /// One view, one instance and two slots, for all of `model`.
    pub fn of(model: &Model, width: u32, height: u32) -> Self {
        Limits::for_needs(Needs::of(model), width, height)
    }

    /// The same, before there is a model.
    pub fn for_needs(needs: Needs, width: u32, height: u32) -> Self {
        let Needs { gaussians, degrees, lobe_degrees, half } = needs;
        Limits {
            width,
            height,
            gaussians,
            instances: 1,
            views: 1,
            in_flight: 2,
            intersections: Room::Usual,
            texel: Texel::Rgba16F,
            degrees,
            lobe_degrees,
            half,
            depth_in: false,
            depth_out: false,
            timings: false,
            policy: Policy::default(),
        }
    }

    /// Buffers of all instances together that a frame is recorded with, where their pages are as large as the device lets them be.
    pub(super) fn model_buffers(&self, device: &DeviceInfo) -> usize {
        let all = self.degrees.iter().chain(&self.lobe_degrees).copied();
        let page = Extra::default().page_limit(device, all.max().unwrap_or(0));
        // Each segment of each model begins a page, of geometry, colours and lobes; then the population and its dispatches.
        let pages = u64::from(self.gaussians / page) + 2 * u64::from(self.instances);
        (3 * pages + 2 * u64::from(self.instances)).min(MOST_BUFFERS) as usize
    }

    fn pixels(&self) -> u32 {
        self.width.saturating_mul(self.height)
    }

    fn isects(&self, device: &DeviceInfo) -> u32 {
        let most = RasterOptions::most_isects(device, LIST_BYTES);
        match self.intersections {
            Room::Usual => self.gaussians.saturating_mul(4).saturating_add(self.pixels().saturating_mul(3)).min(most),
            Room::Intersections(count) => count,
            Room::Bytes(bytes) => (bytes / INTERSECTION_BYTES).min(most.into()) as u32,
        }
        .max(1)
    }

    pub(super) fn raster(&self, device: &DeviceInfo) -> RasterOptions {
        let tile = self.policy.tile(device);
        RasterOptions {
            splats: self.gaussians.max(1),
            pixels: self.pixels(),
            tiles: Grid::new(tile, 0, 1, self.width, self.height).tiles(),
            isects: self.isects(device),
            batch: false,
            background_image: false,
            median: self.depth_out,
            occluded: self.depth_in,
            backward: false,
            scores: false,
            packed_splats: self.half,
            policy: self.policy,
        }
    }

    /// What frames of these limits hold on a device, beside the models.
    ///
    /// # Errors
    /// [`Error::Usage`] where there can be no such frames.
    pub fn plan(&self, device: &DeviceInfo) -> Result<Plan> {
        self.check()?;
        Ok(Raster::plan(&self.raster(device)).and(FrameBuffers::plan(self)))
    }

    /// Whether there can be such frames: kernels count pixels, words and views in 32 bits.
    pub(super) fn check(&self) -> Result<()> {
        let positive = [
            ("width", self.width),
            ("height", self.height),
            ("views", self.views),
            ("in_flight", self.in_flight),
            ("degrees", self.degrees.len() as u32),
        ];
        if let Some((name, _)) = positive.into_iter().find(|(_, value)| *value == 0) {
            return Err(Error::Usage(format!("frames for 0 {name}, expected at least 1")));
        }
        let Limits { width, height, texel, views, instances, in_flight, .. } = *self;
        if width.checked_mul(height).and_then(|pixels| pixels.checked_mul(texel.words())).is_none() {
            return Err(Error::Usage(format!("frames of {width} × {height} pixels of {texel:?} are too large")));
        }
        if views.checked_mul(instances).is_none() {
            return Err(Error::Usage(format!("frames of {views} views of {instances} instances are too many")));
        }
        if in_flight > SLOTS {
            return Err(Error::Usage(format!("{in_flight} slots for frames in flight, expected at most {SLOTS}")));
        }
        let mut degrees = self.degrees.iter().chain(&self.lobe_degrees);
        degrees.try_for_each(|&degree| color::check(degree).map(drop).map_err(Error::Usage))
    }
}

buffers! {
    /// What is beside the raster.
    pub(super) struct FrameBuffers(l: Limits) {
        pub(super) views: View = u64::from(l.views) * u64::from(l.instances.max(1)),
        pub(super) frames: types::Frame = l.views,
        pub(super) splat_total: u32 = 1,
        pub(super) splat_args: u32 = 3,
        pub(super) status: u32 = status::WORDS,
        pub(super) target: u32 = u64::from(l.texel.words()) * u64::from(l.pixels()),
        pub(super) depths: f32 = if l.depth_out { l.pixels() } else { 1 },
        pub(super) depth_target: f32 = if l.depth_out { l.pixels() } else { 1 },
    }
}
