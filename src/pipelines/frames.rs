//! Frames of a renderer that owns the device, the queue and the loop: scenes in its images, beside its meshes.
//!
//! [`Frames::record`] only writes commands. It allocates nothing, submits nothing and waits for nothing; cameras, sizes and instances
//! may differ in every frame. What a caller owes:
//!
//! - **Slots.** To record slot k says that what was recorded in slot k before has run. Slots are all that frames in flight need: the
//!   working buffers are shared, and frames follow each other on one queue.
//! - **Images and buffers of the caller's** are only copied from and to. Before the commands they are available to
//!   [`SYNC_READ`] or [`SYNC_WRITTEN`], in the layout that their [`ImageRegion`](crate::gpu::ImageRegion) says; after them they are in the same layout, and
//!   whoever reads what was written waits for [`SYNC_WRITTEN`].
//! - **Everything of glint's** is glint's affair, from one frame to the next and from [`Upload::record`](super::model::Upload::record) on.
//!
//! Gaussians count as points at their centre where a mesh hides them, and in the order in which they are blended. Where intersections
//! find no room, the nearest Gaussians of a view are drawn right and those farther are missing; [`Report::needed`] says how much room it
//! would have taken, and [`Frames::reserve`] makes it.

use ash::vk;
use glam::{DMat3, DMat4, DQuat, DVec3};

use super::{
    model::{Model, Segment},
    plan::{Held, Plan, buffers},
    raster::{Grid, Raster, RasterOptions, SplatCount},
    render::{MEDIAN_THRESHOLD, ModelStages, Needs, Placed, RenderOptions},
    session::Policy,
};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, BufferRange, Context, DeviceInfo, GpuError, Kept, Location, Pixels, Recorder, StageTime},
    scene::Camera,
    stages::{
        WORKGROUP,
        blocks::{groups_for, items_per_group},
        constants::{
            constants::{NEAR, NONE},
            resolve as numbers,
        },
        resolve,
        status::{self, Resource, Status},
        types::{self, View},
    },
};

/// Where glint reads a caller's image or buffer.
pub const SYNC_READ: (vk::PipelineStageFlags, vk::AccessFlags) =
    (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_READ);

/// Where glint writes a caller's image or buffer; of [`Blend::Over`] it is read there too, as by [`SYNC_READ`].
pub const SYNC_WRITTEN: (vk::PipelineStageFlags, vk::AccessFlags) =
    (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_WRITE);

/// Of images with depths: 32-bit floats, as copies take texels as they are. Depths of 16 or 24 bits go through a buffer of the caller's.
pub const DEPTH_FORMATS: [vk::Format; 3] =
    [vk::Format::D32_SFLOAT, vk::Format::D32_SFLOAT_S8_UINT, vk::Format::R32_SFLOAT];

/// Of images with numbers of Gaussians.
pub const ID_FORMATS: [vk::Format; 1] = [vk::Format::R32_UINT];

/// Room for intersections of Gaussians and tiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Room {
    /// Four for each Gaussian and three for each pixel: enough for most views of most scenes.
    Usual,
    /// So many.
    Intersections(u32),
    /// As many as take so many bytes.
    Bytes(u64),
}

/// Bytes of an intersection in the lists that are sorted.
const INTERSECTION_BYTES: u64 = 16;

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
    /// Slots.
    pub in_flight: u32,
    /// Beyond them a view shows what is near only.
    pub intersections: Room,
    /// The widest texels of any target.
    pub texel: Texel,
    /// Bands of harmonics that bases are rendered with, a pipeline for each number; 0 to 3, or [`BETAS`](crate::scene::layout::BETAS).
    pub degrees: Vec<u32>,
    /// The same of supplements; empty where no model has one.
    pub lobe_degrees: Vec<u32>,
    /// Models have harmonics of half width, see [`model::Room::half`](super::model::Room::half).
    pub half: bool,
    /// Views have depths that hide Gaussians.
    pub depth_in: bool,
    /// Depths and numbers of Gaussians will be asked for.
    pub depth_out: bool,
    /// Every stage has timestamps, see [`Frames::times`].
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

    fn pixels(&self) -> u32 {
        self.width.saturating_mul(self.height)
    }

    fn isects(&self) -> u32 {
        match self.intersections {
            Room::Usual => self.gaussians.saturating_mul(4).saturating_add(self.pixels().saturating_mul(3)),
            Room::Intersections(count) => count,
            Room::Bytes(bytes) => (bytes / INTERSECTION_BYTES).min(u32::MAX.into()) as u32,
        }
        .max(1)
    }

    fn raster(&self, device: &DeviceInfo) -> RasterOptions {
        let tile = self.policy.tile(device);
        RasterOptions {
            splats: self.gaussians.max(1),
            pixels: self.pixels(),
            tiles: Grid::new(tile, 0, 1, self.width, self.height).tiles(),
            isects: self.isects(),
            batch: false,
            background_image: false,
            median: self.depth_out,
            occluded: self.depth_in,
            backward: false,
            policy: self.policy,
        }
    }

    /// What frames of these limits hold on a device, beside the models.
    pub fn plan(&self, device: &DeviceInfo) -> Plan {
        Raster::plan(&self.raster(device)).and(FrameBuffers::plan(self))
    }
}

buffers! {
    /// What is beside the raster.
    struct FrameBuffers(l: Limits) {
        views: View = l.views * l.instances.max(1),
        frames: types::Frame = l.views,
        splat_total: u32 = 1,
        splat_args: u32 = 3,
        status: u32 = status::WORDS,
        target: u32 = l.texel.words() * l.pixels(),
        depths: f32 = if l.depth_out { l.pixels() } else { 1 },
        depth_target: f32 = if l.depth_out { l.pixels() } else { 1 },
    }
}

/// A texel of a target. Images with a format of the `_SRGB` kind hold encoded values: name them [`Light::Encoded`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Texel {
    /// 4 bytes, R first.
    Rgba8 = numbers::RGBA8 as isize,
    /// 4 bytes, B first.
    Bgra8 = numbers::BGRA8 as isize,
    /// 8 bytes.
    Rgba16F = numbers::RGBA16F as isize,
    /// 16 bytes.
    Rgba32F = numbers::RGBA32F as isize,
}

impl Texel {
    /// That of an image's format.
    pub fn of(format: vk::Format) -> Option<Self> {
        Some(match format {
            vk::Format::R8G8B8A8_UNORM | vk::Format::R8G8B8A8_SRGB => Texel::Rgba8,
            vk::Format::B8G8R8A8_UNORM | vk::Format::B8G8R8A8_SRGB => Texel::Bgra8,
            vk::Format::R16G16B16A16_SFLOAT => Texel::Rgba16F,
            vk::Format::R32G32B32A32_SFLOAT => Texel::Rgba32F,
            _ => return None,
        })
    }

    /// Words of 4 bytes.
    pub fn words(self) -> u32 {
        match self {
            Texel::Rgba8 | Texel::Bgra8 => 1,
            Texel::Rgba16F => 2,
            Texel::Rgba32F => 4,
        }
    }
}

/// What a target's numbers are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Light {
    /// sRGB-encoded, as photographs are: what Gaussians are trained and blended in.
    Encoded,
    /// Linear, as a renderer's light is before its tone mapping.
    Linear,
}

/// What becomes of that which Gaussians do not cover.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Blend {
    /// This colour, sRGB-encoded, 0 to 1; alpha is 1.
    Opaque([f32; 3]),
    /// Nothing: colours are weighed by alpha.
    Premultiplied,
    /// What the target holds, blended in encoded values whatever the target's are.
    Over,
}

/// The colours of a view.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// Where they go.
    pub pixels: Pixels,
    /// Of the image, or of the buffer.
    pub texel: Texel,
    /// What its numbers are.
    pub light: Light,
    /// What becomes of that which lies behind.
    pub blend: Blend,
    /// Factor of the Gaussians' linear light; 1 leaves them as they are.
    pub exposure: f32,
}

impl Target {
    /// Opaque over black, as the scene was trained.
    pub fn new(pixels: Pixels, texel: Texel) -> Self {
        Target { pixels, texel, light: Light::Encoded, blend: Blend::Opaque([0.0; 3]), exposure: 1.0 }
    }
}

/// How camera z and a depth buffer's numbers belong together: depth = a + b / z. All perspective projections are of this form,
/// reversed or not, with a far plane or without.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthForm {
    /// The depth at infinity.
    pub a: f64,
    /// Scene units.
    pub b: f64,
}

impl DepthForm {
    /// 1 at the near plane, falling to 0 at infinity.
    pub fn reversed_infinite(near: f64) -> Self {
        DepthForm { a: 0.0, b: near }
    }

    /// 0 at the near plane, 1 at the far plane.
    pub fn standard(near: f64, far: f64) -> Self {
        DepthForm { a: far / (far - near), b: -far * near / (far - near) }
    }

    fn array(self) -> [f32; 2] {
        [self.a as f32, self.b as f32]
    }
}

/// One view of a frame.
#[derive(Debug, Clone, Copy)]
pub struct FrameView {
    /// In the world in which instances stand. Its size is that of the targets.
    pub camera: Camera,
    /// Camera z, scene units of the world; Gaussians whose centre is not beyond are left out.
    pub near: f64,
    /// Of `depth_in` and `depth_out`.
    pub depth_form: DepthForm,
    /// Where colours go, if they are wanted.
    pub color: Option<Target>,
    /// Float32 depths of what is there already: what lies behind is hidden. An image is of [`DEPTH_FORMATS`].
    pub depth_in: Option<Pixels>,
    /// Float32 depths of the Gaussians: of each pixel where transmittance falls below one half, else `depth_form.a`. An image is of
    /// [`DEPTH_FORMATS`].
    pub depth_out: Option<Pixels>,
    /// Numbers of the same Gaussians (u32), counted through the capacities of all instances; `u32::MAX` where there is none. An image is
    /// of [`ID_FORMATS`].
    pub ids: Option<Pixels>,
}

impl FrameView {
    /// Without targets yet, and 3DGS's near plane.
    pub fn new(camera: Camera) -> Self {
        FrameView {
            camera,
            near: NEAR.into(),
            depth_form: DepthForm::reversed_infinite(NEAR.into()),
            color: None,
            depth_in: None,
            depth_out: None,
            ids: None,
        }
    }

    /// From a renderer's matrices: world to view, and view to Vulkan's clip space (y down, depth 0 to 1) of a viewport of
    /// `width` × `height` pixels. Depths are those that the projection makes.
    ///
    /// # Errors
    /// [`Error::Usage`] where the projection is no perspective one, is skewed, or the view is more than rotation and translation.
    pub fn from_matrices(view: DMat4, projection: DMat4, width: u32, height: u32) -> Result<Self> {
        let p = projection;
        let bad = |what: &str| Err(Error::Usage(format!("{what}: {:?}", p.to_cols_array())));
        let forward = p.z_axis.w;
        // How far a float32 matrix may be from what it is meant to be.
        let off = 1e-5;
        if !(forward.abs() - 1.0).abs().lt(&off) || p.x_axis.w != 0.0 || p.y_axis.w != 0.0 || p.w_axis.w != 0.0 {
            return bad("expected a perspective projection, whose w is the distance along the view's axis");
        }
        if p.y_axis.x != 0.0 || p.x_axis.y != 0.0 || p.w_axis.x != 0.0 || p.w_axis.y != 0.0 {
            return bad("expected a projection without skew");
        }
        let rotation = DMat3::from_mat4(view);
        let unit = rotation.transpose() * rotation;
        if !(0..3).all(|c| (unit.col(c) - DMat3::IDENTITY.col(c)).length() < off) {
            return Err(Error::Usage(format!(
                "expected a view of rotation and translation: {:?}",
                view.to_cols_array()
            )));
        }
        // Camera axes: x right, y down in the image, z forward. A view space of another handedness or with y up is mirrored here.
        let signs = DVec3::new(p.x_axis.x.signum(), p.y_axis.y.signum(), forward.signum());
        let axes = DMat3::from_diagonal(signs);
        let (w, h) = (f64::from(width), f64::from(height));
        let camera = Camera {
            width,
            height,
            fx: p.x_axis.x.abs() * w / 2.0,
            fy: p.y_axis.y.abs() * h / 2.0,
            cx: (signs.z * p.z_axis.x + 1.0) * w / 2.0,
            cy: (signs.z * p.z_axis.y + 1.0) * h / 2.0,
            rotation: axes * rotation,
            translation: axes * view.w_axis.truncate(),
        };
        let depth_form = DepthForm { a: signs.z * p.z_axis.z, b: p.w_axis.z };
        Ok(FrameView { depth_form, ..FrameView::new(camera) })
    }
}

/// Where a model stands in the world: turned, then scaled, then moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    /// Of unit length.
    pub rotation: DQuat,
    /// Of all axes alike.
    pub scale: f64,
    /// Where the model's origin goes, scene units of the world.
    pub translation: DVec3,
}

impl Transform {
    /// The world is the model's own.
    pub const IDENTITY: Self = Transform { rotation: DQuat::IDENTITY, scale: 1.0, translation: DVec3::ZERO };
}

/// A model in a frame.
#[derive(Clone, Copy)]
pub struct Instance<'a> {
    /// Any number of instances may be of one model.
    pub model: &'a Model,
    /// Where it stands.
    pub transform: Transform,
    /// The last segment that is shown.
    pub upto: Segment,
    /// Bands of harmonics, at most the model's; of spherical betas all are shown from 1 on.
    pub degree: u32,
}

impl<'a> Instance<'a> {
    /// All of it, where it is.
    pub fn of(model: &'a Model) -> Self {
        Instance { model, transform: Transform::IDENTITY, upto: Segment::Supplement, degree: model.sh_degree }
    }
}

/// What is recorded at once.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    /// Which of the frames in flight it takes the place of; what was recorded in it before has run.
    pub slot: u32,
    /// In one common order by depth.
    pub instances: &'a [Instance<'a>],
    /// One after the other.
    pub views: &'a [FrameView],
}

/// How a frame went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Report {
    /// Intersections of the view that has most, where there was no room for them.
    pub needed: Option<u32>,
    /// Gaussians that the last view saw, and their intersections with its tiles.
    pub visible: u32,
    /// Of those that found room.
    pub intersections: u32,
}

/// Words of a slot's report: the status, then the raster's counts.
const COUNTS: usize = 4;

struct Slot {
    kept: Kept,
    report: Buffer<u32>,
}

/// Pipelines, working buffers and slots. Make one for each queue that draws; pipelines are shared with all else of the context.
pub struct Frames {
    context: Context,
    limits: Limits,
    raster: Raster,
    stages: ModelStages,
    resolve: resolve::Stage,
    buffers: FrameBuffers,
    slots: Vec<Slot>,
}

impl Frames {
    /// # Errors
    /// [`Error::Usage`] for limits of 0, else what the device lacks.
    pub fn new(context: &Context, limits: Limits) -> Result<Self> {
        let positive = [
            ("width", limits.width),
            ("height", limits.height),
            ("views", limits.views),
            ("in_flight", limits.in_flight),
            ("degrees", limits.degrees.len() as u32),
        ];
        if let Some((name, _)) = positive.into_iter().find(|(_, value)| *value == 0) {
            return Err(Error::Usage(format!("frames for 0 {name}, expected at least 1")));
        }
        if limits.width.checked_mul(limits.height).is_none() {
            return Err(Error::Usage(format!("frames of {} × {} pixels are too large", limits.width, limits.height)));
        }
        let needs = Needs {
            gaussians: limits.gaussians,
            degrees: limits.degrees.clone(),
            lobe_degrees: limits.lobe_degrees.clone(),
            half: limits.half,
        };
        let options = RenderOptions { depth: limits.depth_out, policy: limits.policy, ..Default::default() };
        let slot = |_| {
            let report = Buffer::new(context, "report", status::WORDS + COUNTS, Location::Readback)?;
            let kept = if limits.timings { Kept::timed(context)? } else { Kept::default() };
            Ok(Slot { kept, report })
        };
        Ok(Frames {
            raster: Raster::new(context, limits.raster(context.info()))?,
            stages: ModelStages::new(context, needs, &options)?,
            resolve: resolve::Stage::new(context, &resolve::Spec { workgroup_size: WORKGROUP })?,
            buffers: FrameBuffers::new(context, &limits)?,
            slots: (0..limits.in_flight).map(slot).collect::<Result<_, GpuError>>()?,
            context: context.clone(),
            limits,
        })
    }

    /// What they were made for.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Intersections that fit.
    pub fn capacity(&self) -> u32 {
        self.raster.capacity()
    }

    /// The working buffers that all slots share, as [`Limits::plan`] lists them. Of intersections they are others after
    /// [`Frames::reserve`].
    pub fn held(&self) -> Vec<Held> {
        [self.raster.held(), self.buffers.held()].concat()
    }

    /// Room for at least so many intersections. Frames in flight keep the buffers that they were recorded with until their slot is
    /// recorded again.
    ///
    /// # Errors
    /// Where the device's memory does not suffice; what there was is kept then.
    pub fn reserve(&mut self, intersections: u32) -> Result<()> {
        match intersections > self.capacity() {
            true => Ok(self.raster.grow(intersections)?),
            false => Ok(()),
        }
    }

    /// Records a frame into the caller's command buffer.
    ///
    /// # Errors
    /// [`Error::Usage`] where the frame is beyond the limits or makes no sense; nothing is recorded then.
    ///
    /// # Safety
    /// `commands` is recording, on the context's queue family, and outside a render pass; images and buffers of the views are live, of
    /// the size and in the layout that is said, and synchronised as the module says. What slot `frame.slot` had recorded before has run.
    pub unsafe fn record(&mut self, commands: vk::CommandBuffer, frame: &Frame<'_>) -> Result<()> {
        self.check(frame)?;
        let kept = std::mem::take(&mut self.slots[frame.slot as usize].kept);
        // SAFETY: by the contract above.
        let mut recorder = unsafe { Recorder::borrow(&self.context, commands, kept) };
        // SAFETY: by the contract above.
        unsafe { self.record_into(&mut recorder, frame) }?;
        let report = &self.slots[frame.slot as usize].report;
        recorder.copy(&self.buffers.status, 0, report, 0, status::WORDS);
        recorder.copy(&self.raster.buffers.count, 0, report, status::WORDS, COUNTS);
        recorder.host_barrier();
        self.slots[frame.slot as usize].kept = recorder.finish();
        Ok(())
    }

    /// What [`Frames::record`] records, into a recorder of glint's own or of the caller's, without a report and in no slot.
    ///
    /// # Errors
    /// As there.
    ///
    /// # Safety
    /// As there.
    pub unsafe fn record_into(&self, recorder: &mut Recorder, frame: &Frame<'_>) -> Result<()> {
        self.check(frame)?;
        // The frame before may still read and write the buffers that all share.
        recorder.barrier();
        recorder.fill(&self.buffers.status, 0);
        let total: u32 = frame.instances.iter().map(|i| i.model.capacity()).sum();
        recorder.update(&self.buffers.splat_total, 0, &[total]);
        recorder.update(&self.buffers.splat_args, 0, &groups_for(total, items_per_group(self.context.info())));
        for (v, view) in (0..).zip(frame.views) {
            // SAFETY: by the contract above.
            unsafe { self.record_view(recorder, frame.instances, v, view) };
        }
        Ok(())
    }

    /// How the frame that was recorded in `slot` last went. Not before its commands have run.
    ///
    /// # Errors
    /// [`Error::Usage`] where there is no such slot, or nothing was recorded in it.
    pub fn report(&self, slot: u32) -> Result<Report> {
        let found = self.slots.get(slot as usize).filter(|slot| !slot.kept.is_empty());
        let Some(slot) = found else { return Err(Error::Usage(format!("nothing was recorded in slot {slot}"))) };
        let words = slot.report.mapped();
        let (status, counts) = words.split_at(status::WORDS.min(words.len()));
        let count = |index: u32| counts.get(index as usize).copied().unwrap_or(0);
        Ok(Report {
            needed: Status::read(status).needed(Resource::Intersections),
            visible: count(super::raster::VISIBLE),
            intersections: count(super::raster::ISECTS),
        })
    }

    /// What each stage of the frame that was recorded in `slot` last took, in order; nothing where [`Limits::timings`] are off or the
    /// device has no timestamps.
    ///
    /// # Errors
    /// As for [`Frames::report`], where its commands have not run, and where the device is lost.
    pub fn times(&self, slot: u32) -> Result<Vec<StageTime>> {
        self.report(slot)?;
        Ok(self.slots[slot as usize].kept.times()?)
    }

    fn check(&self, frame: &Frame<'_>) -> Result<()> {
        let limits = &self.limits;
        let within = |what: &str, has: u64, most: u64| match has <= most {
            true => Ok(()),
            false => Err(Error::Usage(format!("a frame of {has} {what}, made for {most}"))),
        };
        within("slots", u64::from(frame.slot) + 1, limits.in_flight.into())?;
        within("instances", frame.instances.len() as u64, limits.instances.into())?;
        within("views", frame.views.len() as u64, limits.views.into())?;
        within(
            "Gaussians",
            frame.instances.iter().map(|i| u64::from(i.model.capacity())).sum(),
            limits.gaussians.into(),
        )?;
        for instance in frame.instances {
            let Instance { model, transform: t, upto, degree } = *instance;
            self.stages.check(model, upto, degree)?;
            if !model.context().is_same(&self.context) {
                return Err(Error::Usage("a model of another context".into()));
            }
            if degree > model.sh_degree {
                return Err(Error::Usage(format!("harmonics of degree {degree} of a model of {}", model.sh_degree)));
            }
            let finite = t.rotation.is_finite() && t.translation.is_finite() && t.scale.is_finite();
            // Numbers of float32 are within 1e-6 of a unit quaternion's.
            if !(finite && t.scale > 0.0 && (t.rotation.length() - 1.0).abs() < 1e-5) {
                return Err(Error::Usage(format!(
                    "a transform of {t:?}, expected finite numbers, a scale above 0 and a rotation of unit length"
                )));
            }
        }
        for view in frame.views {
            let Camera { width, height, fx, fy, cx, cy, rotation, translation } = view.camera;
            within("pixels in a row", width.into(), limits.width.into())?;
            within("rows", height.into(), limits.height.into())?;
            let numbers = [fx, fy, cx, cy, view.near, view.depth_form.a, view.depth_form.b];
            let finite = numbers.iter().all(|v| v.is_finite()) && rotation.is_finite() && translation.is_finite();
            if !(finite && width > 0 && height > 0 && fx > 0.0 && fy > 0.0 && view.near > 0.0) {
                return Err(Error::Usage(format!(
                    "a view of {:?}, near plane {}, depths {:?}: expected finite numbers, and sizes, focal lengths and near plane above 0",
                    view.camera, view.near, view.depth_form
                )));
            }
            if let Some(target) = view.color {
                within("words for a texel", target.texel.words().into(), limits.texel.words().into())?;
                if !(target.exposure >= 0.0 && target.exposure.is_finite()) {
                    return Err(Error::Usage(format!("an exposure of {}, expected 0 or more", target.exposure)));
                }
                if let Blend::Opaque(colour) = target.blend
                    && !colour.iter().all(|channel| channel.is_finite())
                {
                    return Err(Error::Usage(format!("a background of {colour:?}, expected finite numbers")));
                }
            }
            if view.depth_in.is_some() && !limits.depth_in {
                return Err(Error::Usage("depths hide Gaussians in a view, frames were made without depth_in".into()));
            }
            if (view.depth_out.is_some() || view.ids.is_some()) && !limits.depth_out {
                return Err(Error::Usage("a view asks for depths or ids, frames were made without depth_out".into()));
            }
            let format = |pixels: Option<Pixels>| match pixels {
                Some(Pixels::Image(region)) => Some(region.format),
                _ => None,
            };
            if let (Some(target), Some(has)) = (view.color, format(view.color.map(|c| c.pixels)))
                && Texel::of(has) != Some(target.texel)
            {
                return Err(Error::Usage(format!(
                    "a target of format {has:?}, whose texels are not {:?}",
                    target.texel
                )));
            }
            let depths = [("depths that hide Gaussians", view.depth_in), ("depths of Gaussians", view.depth_out)];
            let depths = depths.map(|(what, pixels)| (what, pixels, &DEPTH_FORMATS[..]));
            for (what, pixels, formats) in
                depths.into_iter().chain([("numbers of Gaussians", view.ids, &ID_FORMATS[..])])
            {
                if let Some(has) = format(pixels).filter(|has| !formats.contains(has)) {
                    return Err(Error::Usage(format!(
                        "an image of format {has:?} for {what}, expected one of {formats:?}"
                    )));
                }
            }
            let ranges = [view.color.map(|c| c.pixels), view.depth_in, view.depth_out, view.ids];
            for range in ranges.into_iter().flatten() {
                if let Pixels::Buffer(BufferRange { offset, .. }) = range
                    && offset % 4 != 0
                {
                    return Err(Error::Usage(format!(
                        "a buffer's part begins at byte {offset}, expected a multiple of 4"
                    )));
                }
            }
        }
        Ok(())
    }

    /// # Safety
    /// As for [`Frames::record`], of a view that was checked.
    unsafe fn record_view(&self, recorder: &mut Recorder, instances: &[Instance<'_>], v: u32, view: &FrameView) {
        let (camera, raster, b) = (&view.camera, &self.raster, &self.buffers);
        let (size, pixels) = ([camera.width, camera.height], camera.pixels());
        let frame = types::Frame { image_first: 0, target_first: 0, width: size[0], height: size[1] };
        recorder.update(&b.frames, v as usize, &[frame]);
        // A model may have room for more than it shows, and what it does not show was left by others.
        // guard: what other instances left
        recorder.fill(&raster.buffers.depth_keys, NONE);
        let place = |i: usize, splat_first: u32| {
            let Instance { model, transform, upto, degree } = instances[i];
            let (view, scale) = (v * self.limits.instances + i as u32, transform.scale as f32);
            Placed { model, splat_first, views: &b.views, view, upto, degree, scale }
        };
        let mut splat_first = 0;
        for (i, instance) in instances.iter().enumerate() {
            let placed = place(i, splat_first);
            let seen = instance_view(camera, &instance.transform, instance.model.origin, view.near);
            recorder.update(&b.views, placed.view as usize, &[seen]);
            self.stages.record_project(recorder, raster, &placed);
            splat_first += instance.model.capacity();
        }
        let grid = raster.grid(v, 1, size[0], size[1]);
        let splats = SplatCount { count: &b.splat_total, index: 0, args: &b.splat_args, dispatch: 0 };
        raster.record_order(recorder, splats, &grid, &b.frames, None, &b.status);
        let depth_form = view.depth_form.array();
        if self.limits.depth_in {
            let scene_depths = &raster.buffers.scene_depths;
            match view.depth_in {
                // SAFETY: by the contract above.
                Some(from) => unsafe { recorder.bring(&from, scene_depths, size, 1) },
                None => recorder.fill(scene_depths, depth_form[0].to_bits()),
            }
        }
        let background = match view.color.map(|c| c.blend) {
            Some(Blend::Opaque(colour)) => colour,
            _ => [0.0; 3],
        };
        raster.record_blend_occluded(recorder, &grid, &b.frames, background, MEDIAN_THRESHOLD, depth_form);
        if view.depth_out.is_some() {
            splat_first = 0;
            // Pixels without a Gaussian are the first instance's; without any there is none to write them.
            recorder.fill(&b.depths, 0);
            for (i, instance) in instances.iter().enumerate() {
                self.stages.record_depths(recorder, raster, &b.depths, &place(i, splat_first), pixels);
                splat_first += instance.model.capacity();
            }
        }
        if view.color.is_some() || view.depth_out.is_some() {
            // SAFETY: by the contract above.
            unsafe { self.record_resolve(recorder, view) };
        }
        // SAFETY: by the contract above.
        unsafe {
            if let Some(target) = view.color {
                recorder.hand(&b.target, &target.pixels, size, target.texel.words());
            }
            if let Some(to) = view.depth_out {
                recorder.hand(&b.depth_target, &to, size, 1);
            }
            if let Some(to) = view.ids {
                recorder.hand(&raster.buffers.median_ids, &to, size, 1);
            }
        }
    }

    /// # Safety
    /// As for [`Frames::record_view`].
    unsafe fn record_resolve(&self, recorder: &mut Recorder, view: &FrameView) {
        let b = &self.buffers;
        // Where only depths are wanted, the texels of nobody's target are written.
        let nobodys = BufferRange { buffer: vk::Buffer::null(), offset: 0 };
        let target = view.color.unwrap_or(Target::new(Pixels::Buffer(nobodys), Texel::Rgba8));
        if target.blend == Blend::Over {
            // SAFETY: by the contract above.
            unsafe {
                recorder.bring(&target.pixels, &b.target, [view.camera.width, view.camera.height], target.texel.words())
            };
        }
        let push = resolve::Push {
            pixels: view.camera.pixels(),
            format: target.texel as u32,
            blend: match target.blend {
                Blend::Opaque(_) => numbers::OPAQUE,
                Blend::Premultiplied => numbers::PREMULTIPLIED,
                Blend::Over => numbers::OVER,
            },
            linear: u32::from(target.light == Light::Linear),
            depth: u32::from(view.depth_out.is_some()),
            exposure: target.exposure,
            depth_form: view.depth_form.array(),
        };
        let buffers = resolve::Buffers {
            image: &self.raster.buffers.image,
            depths: &b.depths,
            target: &b.target,
            depth_target: &b.depth_target,
        };
        self.resolve.record(recorder, &buffers, &push, push.pixels);
    }
}

/// What a camera of the world sees of a model that stands in it: camera axes of the world, in its units, from where the camera is
/// among the model's own Gaussians. So covariances, depths, harmonics and lobes all come out turned and scaled.
fn instance_view(camera: &Camera, transform: &Transform, origin: DVec3, near: f64) -> View {
    let Transform { rotation, scale, translation } = *transform;
    let turned = camera.rotation * DMat3::from_quat(rotation);
    // guard: instances around their origin
    let moved = camera.translation + camera.rotation * (translation + scale * (rotation * origin));
    let eye = -(turned.transpose() * moved) / scale;
    let row = |i: usize| {
        let r = scale * turned.row(i);
        [r.x, r.y, r.z, moved[i]].map(|x| x as f32)
    };
    View {
        row_x: row(0),
        row_y: row(1),
        row_z: row(2),
        eye: eye.as_vec3().to_array(),
        near: near as f32,
        ..super::views::view(camera, 0)
    }
}
