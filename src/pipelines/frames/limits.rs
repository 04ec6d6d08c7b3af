//! Limits of frames, and the memory that they take.

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

/// Room for intersections of Gaussians with tiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Room {
    /// Four per Gaussian and three per pixel, up to the device's limit for one list. Enough for most views of
    /// most scenes.
    Usual,
    /// This number.
    Intersections(u32),
    /// The number that fits into this number of bytes, up to the device's limit for one list.
    Bytes(u64),
}

/// Bytes of an intersection in the four sorted lists.
const INTERSECTION_BYTES: u64 = 4 * LIST_BYTES;

/// Maximum number of model buffers that space is reserved for.
const MOST_BUFFERS: u64 = 1 << 16;
/// Maximum number of slots, more than any renderer has frames in flight.
const SLOTS: u32 = 64;

/// Limits of frames: sizes, scene, room and outputs.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Pixels of the largest view.
    pub width: u32,
    /// Pixels of the largest view.
    pub height: u32,
    /// Gaussians of all instances of a frame: the sum of their models' [`Model::capacity`].
    pub gaussians: u32,
    /// Maximum instances of a frame.
    pub instances: u32,
    /// Maximum views of a frame, such as eyes or faces of a cube.
    pub views: u32,
    /// Number of slots, up to 64.
    pub in_flight: u32,
    /// Beyond this number, a view misses its farthest Gaussians.
    pub intersections: Room,
    /// The widest texel of any target.
    pub texel: Texel,
    /// Bands of harmonics of rendered bases, one pipeline per entry; 0 to 3, or
    /// [`BETAS`](crate::scene::color::BETAS).
    pub degrees: Vec<u32>,
    /// Bands of harmonics of rendered supplements; empty if no model has one.
    pub lobe_degrees: Vec<u32>,
    /// Models have half width, see [`model::Room::half`](super::super::model::Room::half).
    pub half: bool,
    /// Views have depths that occlude Gaussians.
    pub depth_in: bool,
    /// Views may have depths or Gaussian numbers as outputs.
    pub depth_out: bool,
    /// Timestamps for every stage, see [`Frames::times`](super::Frames::times).
    pub timings: bool,
    /// Variants of the stages; a frame ignores the reduction, as it has no gradients.
    pub policy: Policy,
}

impl Limits {
    /// Limits for one view and one instance of `model`, with two slots.
    pub fn of(model: &Model, width: u32, height: u32) -> Self {
        Limits::for_needs(Needs::of(model), width, height)
    }

    /// Limits for one view and one instance, from the needs of a model that may not exist yet.
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

    /// Buffers of all instances of a frame together, if their pages are as large as the device allows.
    pub(super) fn model_buffers(&self, device: &DeviceInfo) -> usize {
        let all = self.degrees.iter().chain(&self.lobe_degrees).copied();
        let page = Extra::default().page_limit(device, all.max().unwrap_or(0));
        // Each segment of each model starts a new page of geometry, colors and lobes; add the population and
        // its dispatches.
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
            median: self.depth_out,
            occluded: self.depth_in,
            packed_splats: self.half,
            policy: self.policy,
            ..RasterOptions::default()
        }
    }

    /// Buffers of frames with these limits on a device, not counting the models.
    ///
    /// # Errors
    /// [`Error::Usage`] if the limits are invalid.
    pub fn plan(&self, device: &DeviceInfo) -> Result<Plan> {
        self.check()?;
        Ok(Raster::plan(&self.raster(device)).and(FrameBuffers::plan(self)))
    }

    /// Validates the limits: kernels count pixels, words and views in 32 bits.
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
    /// Buffers other than the raster's.
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
