//! Renders scenes into the images of a renderer that owns the device, the queue and the loop, together with
//! its meshes.
//!
//! [`Frames::record`] only writes commands: from the first frame on it does not allocate, submit or wait.
//! Cameras, sizes and instances may differ in every frame. (One exception: if a model was made with small
//! pages, or a frame uses more than 65,536 buffers, a slot's lists grow when they first see that number.) The
//! caller's duties:
//!
//! - **Slots.** Recording slot k asserts that the commands last recorded in slot k have run. A slot is all
//!   that a frame in flight needs: working buffers are shared, and frames follow each other on one queue.
//! - **The caller's images and buffers** are only copied from and to. Before the commands, the caller makes
//!   them available to [`SYNC_READ`] or [`SYNC_WRITTEN`], in the layout that their
//!   [`ImageRegion`](crate::gpu::ImageRegion) names. Afterwards they are in the same layout, and the caller's
//!   readers wait for [`SYNC_WRITTEN`].
//! - **State of the command buffer.** Recording changes the bound compute pipeline, descriptor set 0 of
//!   compute and the push constants, so bind again before other dispatches. All other state stays.
//! - **Lifetimes.** A slot keeps the buffers that its frame uses, also those of models, until it is recorded
//!   again. So a [`Model`](super::model::Model) may be dropped while frames that show it are in flight.
//!   [`Frames`] and a slot's memory may be dropped only after the commands of all slots have run.
//!   [`Frames::record_into`] leaves the buffers to the [`Kept`] of the caller's recorder.
//! - **glint's own resources** are synchronised by glint, from one frame to the next and from
//!   [`Upload::record`](super::model::Upload::record) on.
//!
//! For occlusion by meshes and for the blending order, a Gaussian counts as a point at its centre. If the
//! intersections do not fit, the nearest Gaussians of a view are drawn correctly and farther ones are
//! missing. [`Report::needed`] then returns the required number, and [`Frames::reserve`] makes room for it.

mod check;
mod limits;
mod view;

use ash::vk;

use super::{
    plan::{Held, bind},
    raster::Raster,
    render::{MEDIAN_THRESHOLD, ModelStages, Needs, Placed, RenderOptions},
    sort::Extent,
};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, BufferRange, Context, GpuError, Kept, Location, Pixels, Recorder, StageTime},
    stages::{
        WORKGROUP,
        blocks::{groups_for, items_per_group},
        constants::{constants::NONE, resolve as numbers},
        resolve,
        status::{self, Resource, Status},
        types,
    },
};

pub use check::{DEPTH_FORMATS, ID_FORMATS};
pub use limits::{Limits, Room};
pub use view::{Blend, DepthForm, Frame, FrameView, Instance, Light, Target, Texel, Transform};

use limits::FrameBuffers;
use view::instance_view;

/// Stage and access of glint's reads of a caller's image or buffer.
pub const SYNC_READ: (vk::PipelineStageFlags, vk::AccessFlags) =
    (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_READ);

/// Stage and access of glint's writes to a caller's image or buffer. [`Blend::Over`] also reads it, as by
/// [`SYNC_READ`].
pub const SYNC_WRITTEN: (vk::PipelineStageFlags, vk::AccessFlags) =
    (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_WRITE);

/// Result of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Report {
    /// If intersections did not fit: the number that the most demanding view needs.
    pub needed: Option<u32>,
    /// Visible Gaussians of the last view; `intersections` counts their pairs with its tiles.
    pub visible: u32,
    /// Intersections that fitted.
    pub intersections: u32,
}

/// Words of a slot's report: the status, then the raster's counts.
const COUNTS: usize = 4;

/// Buffers of a frame outside all lists: the report, and one for unused bindings.
const OTHERS: usize = 2;

struct Slot {
    kept: Kept,
    report: Buffer<u32>,
}

/// Pipelines, working buffers and slots. Make one for each queue that draws; all users of a context share its
/// pipelines. Drop it only after the commands recorded in its slots have run.
pub struct Frames {
    context: Context,
    limits: Limits,
    raster: Raster,
    stages: ModelStages,
    /// Without and with sRGB conversion.
    resolve: [resolve::Stage; 2],
    buffers: FrameBuffers,
    slots: Vec<Slot>,
}

fn resolve_stage(context: &Context, curves: bool) -> Result<resolve::Stage, GpuError> {
    resolve::Stage::new(context, &resolve::Spec { workgroup_size: WORKGROUP, curves })
}

impl Frames {
    /// # Errors
    /// [`Error::Usage`] if a limit is 0 or too large to count; otherwise an error of the device.
    pub fn new(context: &Context, limits: Limits) -> Result<Self> {
        limits.check()?;
        let needs = Needs {
            gaussians: limits.gaussians,
            degrees: limits.degrees.clone(),
            lobe_degrees: limits.lobe_degrees.clone(),
            half: limits.half,
        };
        let options = RenderOptions { depth: limits.depth_out, policy: limits.policy, ..Default::default() };
        let raster = Raster::new(context, limits.raster(context.info()))?;
        let buffers = FrameBuffers::new(context, &limits)?;
        let held = raster.held().len() + buffers.held().len() + OTHERS + limits.model_buffers(context.info());
        let slot = |_| {
            let report = Buffer::new(context, "report", status::WORDS + COUNTS, Location::Host)?;
            let mut kept = if limits.timings { Kept::timed(context)? } else { Kept::default() };
            kept.reserve(held);
            Ok(Slot { kept, report })
        };
        Ok(Frames {
            stages: ModelStages::new(context, needs, &options)?,
            resolve: [resolve_stage(context, false)?, resolve_stage(context, true)?],
            raster,
            buffers,
            slots: (0..limits.in_flight).map(slot).collect::<Result<_, GpuError>>()?,
            context: context.clone(),
            limits,
        })
    }

    /// The limits it was made with.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Number of intersections that fit.
    pub fn capacity(&self) -> u32 {
        self.raster.capacity()
    }

    /// The working buffers that all slots share, as [`Limits::plan`] lists them, then each slot's report in
    /// host memory. A report has the words of [`Status`], then the raster's counts: visible splats and
    /// intersections among them. [`Frames::reserve`] replaces the buffers of intersections.
    pub fn held(&self) -> Vec<Held> {
        let reports = self.slots.iter().map(|slot| Held::of("report", &slot.report)).collect();
        [self.raster.held(), self.buffers.held(), reports].concat()
    }

    /// Makes room for at least `intersections`, and up to a quarter more if that fits. Frames in flight keep
    /// their buffers until their slot is recorded again.
    ///
    /// # Errors
    /// If the device's memory does not suffice; the old room then stays.
    pub fn reserve(&mut self, intersections: u32) -> Result<()> {
        match intersections > self.capacity() {
            true => Ok(self.raster.grow(intersections)?),
            false => Ok(()),
        }
    }

    /// Records a frame into the caller's command buffer.
    ///
    /// # Errors
    /// [`Error::Usage`] if the frame exceeds the limits or is invalid, or a handle is null; then nothing is
    /// recorded.
    ///
    /// # Safety
    /// `commands` is recording, on the context's queue family, and outside a render pass. Images and buffers
    /// of the views are live, have the stated size and layout, and are synchronised as the module requires.
    /// The commands last recorded in slot `frame.slot` have run.
    pub unsafe fn record(&mut self, commands: vk::CommandBuffer, frame: &Frame<'_>) -> Result<()> {
        self.check(frame)?;
        if commands == vk::CommandBuffer::null() {
            return Err(Error::Usage("a command buffer that is null".into()));
        }
        let kept = std::mem::take(&mut self.slots[frame.slot as usize].kept);
        // SAFETY: by the contract above.
        let mut recorder = unsafe { Recorder::borrow(&self.context, commands, kept) };
        // SAFETY: by the contract above.
        unsafe { self.record_checked(&mut recorder, frame) };
        let report = &self.slots[frame.slot as usize].report;
        recorder.copy(&self.buffers.status, 0, report, 0, status::WORDS);
        recorder.copy(&self.raster.buffers.count, 0, report, status::WORDS, COUNTS);
        recorder.host_barrier();
        self.slots[frame.slot as usize].kept = recorder.finish();
        Ok(())
    }

    /// Records the frame of [`Frames::record`] into any recorder, without a slot and without a report.
    ///
    /// # Errors
    /// Those of [`Frames::record`], and [`Error::Usage`] if the recorder is of another context.
    ///
    /// # Safety
    /// The contract of [`Frames::record`].
    pub unsafe fn record_into(&self, recorder: &mut Recorder, frame: &Frame<'_>) -> Result<()> {
        self.check(frame)?;
        if !recorder.context().is_same(&self.context) {
            return Err(Error::Usage("a recorder of another context than the frames'".into()));
        }
        // SAFETY: by the contract above.
        unsafe { self.record_checked(recorder, frame) };
        Ok(())
    }

    /// # Safety
    /// The contract of [`Frames::record`], for a checked frame.
    unsafe fn record_checked(&self, recorder: &mut Recorder, frame: &Frame<'_>) {
        // The previous frame may still use the shared buffers.
        recorder.barrier();
        recorder.fill(&self.buffers.status, 0);
        let total: u32 = frame.instances.iter().map(|i| i.model.capacity()).sum();
        recorder.update(&self.buffers.splat_total, 0, &[total]);
        recorder.update(&self.buffers.splat_args, 0, &groups_for(total, items_per_group(self.context.info())));
        for (v, view) in (0..).zip(frame.views) {
            // SAFETY: by the contract above.
            unsafe { self.record_view(recorder, frame.instances, v, view) };
        }
    }

    /// Result of the frame last recorded in `slot`. Call it only after its commands have run.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no such slot, or nothing was recorded in it.
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

    /// Time of each stage of the frame last recorded in `slot`, in order. Empty if [`Limits::timings`] is off
    /// or the device has no timestamps.
    ///
    /// # Errors
    /// Those of [`Frames::report`], and an error if its commands have not run or the device is lost.
    pub fn times(&self, slot: u32) -> Result<Vec<StageTime>> {
        self.report(slot)?;
        Ok(self.slots[slot as usize].kept.times()?)
    }

    /// # Safety
    /// The contract of [`Frames::record`], for a checked view.
    unsafe fn record_view(&self, recorder: &mut Recorder, instances: &[Instance<'_>], v: u32, view: &FrameView) {
        let (camera, raster, b) = (&view.camera, &self.raster, &self.buffers);
        let (size, pixels) = ([camera.width, camera.height], camera.pixels());
        let frame = types::Frame { image_first: 0, target_first: 0, width: size[0], height: size[1] };
        recorder.update(&b.frames, v as usize, &[frame]);
        // A model may have room for more Gaussians than it shows; entries beyond are left from other
        // instances.
        // guard: what other instances left (3 lines)
        if let Some(depth_keys) = raster.depth_keys() {
            recorder.fill(depth_keys, NONE);
        }
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
        let splats = Extent { count: &b.splat_total, index: 0, args: &b.splat_args, dispatch: 0 };
        raster.record_order(recorder, splats, &grid, &b.frames, None, &b.status);
        let depth_form = view.depth_form.array();
        if self.limits.depth_in {
            let scene_depths = &raster.buffers.scene_depths;
            match view.depth_in {
                // SAFETY: by the contract above.
                Some(from) => unsafe { recorder.bring(&from, scene_depths, size, 1) },
                None => recorder.fill(scene_depths, view.depth_form.empty().to_bits()),
            }
        }
        // With an exposure, the background is blended later.
        let background = match view.color {
            Some(Target { blend: Blend::Opaque(color), exposure: 1.0, .. }) => color,
            _ => [0.0; 3],
        };
        raster.record_blend_occluded(recorder, &grid, &b.frames, background, MEDIAN_THRESHOLD, depth_form);
        if view.depth_out.is_some() {
            splat_first = 0;
            // The first instance also writes the pixels without a Gaussian; without instances, nobody does.
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
    /// The contract of [`Frames::record_view`].
    unsafe fn record_resolve(&self, recorder: &mut Recorder, view: &FrameView) {
        let b = &self.buffers;
        // If only depths are wanted, a dummy target fills in the push constants; nothing is copied to it.
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
            background: if let Blend::Opaque(color) = target.blend { color } else { [0.0; 3] },
        };
        let buffers = bind!(resolve { self.raster.buffers => image; b => depths, target, depth_target; });
        let curves = target.light == Light::Linear || target.exposure != 1.0;
        self.resolve[usize::from(curves)].record(recorder, &buffers, &push, push.pixels);
    }
}
