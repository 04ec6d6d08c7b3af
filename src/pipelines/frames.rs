//! Frames of a renderer that owns the device, the queue and the loop: scenes in its images, beside its meshes.
//!
//! [`Frames::record`] only writes commands. It allocates nothing, submits nothing and waits for nothing, from the first frame on;
//! cameras, sizes and instances may differ in every frame. (Of models whose pages were asked to be small, and beyond 65,536 buffers, a
//! slot's lists grow when they first see so many.) What a caller owes:
//!
//! - **Slots.** To record slot k says that what was recorded in slot k before has run. Slots are all that frames in flight need: the
//!   working buffers are shared, and frames follow each other on one queue.
//! - **Images and buffers of the caller's** are only copied from and to. Before the commands they are available to
//!   [`SYNC_READ`] or [`SYNC_WRITTEN`], in the layout that their [`ImageRegion`](crate::gpu::ImageRegion) says; after them they are in the same layout, and
//!   whoever reads what was written waits for [`SYNC_WRITTEN`].
//! - **State of the command buffer.** The compute pipeline that is bound, descriptor set 0 of compute and the push constants are others
//!   afterwards; whoever dispatches binds anew. All else stays.
//! - **Lifetimes.** Slots keep the buffers that their frames use, of models too, until they are recorded again: a
//!   [`Model`](super::model::Model) may be dropped while frames that show it are on their way. [`Frames`] may not, nor a slot's memory: only
//!   when the commands of all slots have run. What [`Frames::record_into`] records with a recorder of the caller's is kept by that one's
//!   [`Kept`].
//! - **Everything of glint's** is glint's affair, from one frame to the next and from [`Upload::record`](super::model::Upload::record) on.
//!
//! Gaussians count as points at their centre where a mesh hides them, and in the order in which they are blended. Where intersections
//! find no room, the nearest Gaussians of a view are drawn right and those farther are missing; [`Report::needed`] says how much room it
//! would have taken, and [`Frames::reserve`] makes it.

mod check;
mod limits;
mod view;

use ash::vk;

use super::{
    plan::Held,
    raster::{Raster, SplatCount},
    render::{MEDIAN_THRESHOLD, ModelStages, Needs, Placed, RenderOptions},
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

/// Where glint reads a caller's image or buffer.
pub const SYNC_READ: (vk::PipelineStageFlags, vk::AccessFlags) =
    (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_READ);

/// Where glint writes a caller's image or buffer; of [`Blend::Over`] it is read there too, as by [`SYNC_READ`].
pub const SYNC_WRITTEN: (vk::PipelineStageFlags, vk::AccessFlags) =
    (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_WRITE);

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

/// Buffers of a frame that nothing lists: the report, and one for bindings that nobody uses.
const OTHERS: usize = 2;

struct Slot {
    kept: Kept,
    report: Buffer<u32>,
}

/// Pipelines, working buffers and slots. Make one for each queue that draws; pipelines are shared with all else of the context. Drop it
/// only when what was recorded in its slots has run.
pub struct Frames {
    context: Context,
    limits: Limits,
    raster: Raster,
    stages: ModelStages,
    /// Without and with sRGB's curves.
    resolve: [resolve::Stage; 2],
    buffers: FrameBuffers,
    slots: Vec<Slot>,
}

fn resolve_stage(context: &Context, curves: bool) -> Result<resolve::Stage, GpuError> {
    resolve::Stage::new(context, &resolve::Spec { workgroup_size: WORKGROUP, curves })
}

impl Frames {
    /// # Errors
    /// [`Error::Usage`] for limits of 0 and such that cannot be counted, else what the device lacks.
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
            let report = Buffer::new(context, "report", status::WORDS + COUNTS, Location::Readback)?;
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

    /// What they were made for.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Intersections that fit.
    pub fn capacity(&self) -> u32 {
        self.raster.capacity()
    }

    /// The working buffers that all slots share, as [`Limits::plan`] lists them, and then the report of each slot, which the host reads:
    /// the words of [`Status`], visible splats and intersections among the raster's counts behind them. Of intersections they are others
    /// after [`Frames::reserve`].
    pub fn held(&self) -> Vec<Held> {
        let reports = self.slots.iter().map(|slot| Held::of("report", &slot.report)).collect();
        [self.raster.held(), self.buffers.held(), reports].concat()
    }

    /// Room for at least so many intersections, and for up to a quarter more where that fits. Frames in flight keep the buffers that
    /// they were recorded with until their slot is recorded again.
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
    /// [`Error::Usage`] where the frame is beyond the limits or makes no sense, or a handle is null; nothing is recorded then.
    ///
    /// # Safety
    /// `commands` is recording, on the context's queue family, and outside a render pass; images and buffers of the views are live, of
    /// the size and in the layout that is said, and synchronised as the module says. What slot `frame.slot` had recorded before has run.
    pub unsafe fn record(&mut self, commands: vk::CommandBuffer, frame: &Frame<'_>) -> Result<()> {
        self.check(frame)?;
        if commands == vk::CommandBuffer::null() {
            return Err(Error::Usage("a command buffer that is null".into()));
        }
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
    /// As there, and where the recorder is of another context.
    ///
    /// # Safety
    /// As there.
    pub unsafe fn record_into(&self, recorder: &mut Recorder, frame: &Frame<'_>) -> Result<()> {
        self.check(frame)?;
        if !recorder.context().is_same(&self.context) {
            return Err(Error::Usage("a recorder of another context than the frames'".into()));
        }
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

    /// # Safety
    /// As for [`Frames::record`], of a view that was checked.
    unsafe fn record_view(&self, recorder: &mut Recorder, instances: &[Instance<'_>], v: u32, view: &FrameView) {
        let (camera, raster, b) = (&view.camera, &self.raster, &self.buffers);
        let (size, pixels) = ([camera.width, camera.height], camera.pixels());
        let frame = types::Frame { image_first: 0, target_first: 0, width: size[0], height: size[1] };
        recorder.update(&b.frames, v as usize, &[frame]);
        // A model may have room for more than it shows, and what it does not show was left by others.
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
        let splats = SplatCount { count: &b.splat_total, index: 0, args: &b.splat_args, dispatch: 0 };
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
        // Where Gaussians are exposed, what lies behind comes after.
        let background = match view.color {
            Some(Target { blend: Blend::Opaque(colour), exposure: 1.0, .. }) => colour,
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
            background: if let Blend::Opaque(colour) = target.blend { colour } else { [0.0; 3] },
        };
        let buffers = resolve::Buffers {
            image: &self.raster.buffers.image,
            depths: &b.depths,
            target: &b.target,
            depth_target: &b.depth_target,
        };
        let curves = target.light == Light::Linear || target.exposure != 1.0;
        self.resolve[usize::from(curves)].record(recorder, &buffers, &push, push.pixels);
    }
}
