//! Records stages as commands: descriptors, push constants, barriers from declared access, labels,
//! timestamps.

use std::{
    collections::HashMap,
    ffi::{CStr, CString},
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{Arc, Once, atomic::Ordering},
    time::Duration,
};

use ash::vk;
use bytemuck::Pod;

use super::{
    Access, Buffer, Check, Context, GpuError, HostBuffer, Judge, Kernel, KernelInfo, Pipeline, RawBuffer, Shadowed,
    Twin, TwinCall, Workgroups, needs,
    pipeline::RawPipeline,
    pools::{CommandSlot, Pools, Sets, StageTime, Stamps, make_slot, recycle},
};

/// Vulkan's guaranteed minimum of maxComputeWorkGroupCount in each dimension.
const MAX_GROUPS: u32 = 65_535;

/// Records stages into a command buffer, its own or the caller's.
pub struct Recorder {
    context: Context,
    slot: Option<CommandSlot>,
    pub(super) commands: vk::CommandBuffer,
    kept: Kept,
    /// Stages are timed, with the slot's timestamps or those in `kept`.
    timed: bool,
    /// The error of a twin that could not replace its kernel; returned by `submit`.
    failed: Option<GpuError>,
}

/// Buffers that recorded commands use, which keep the context and its pipelines alive: they must outlive the
/// commands. Pass it to [`Recorder::borrow`] again once the commands have run, to reuse its memory.
#[derive(Default)]
pub struct Kept {
    /// Buffers used since the last barrier: true if written, false if only read.
    touched: HashMap<vk::Buffer, bool>,
    buffers: HashMap<vk::Buffer, Arc<RawBuffer>>,
    pools: Option<Pools>,
}

impl Kept {
    /// An empty `Kept` with which every recorded stage is timed, except on devices without timestamps.
    ///
    /// # Errors
    /// The device has no memory for the queries.
    pub fn timed(context: &Context) -> Result<Self, GpuError> {
        let stamps = match context.info().timestamp_period > 0.0 {
            true => Some(Stamps::new(&context.0.device)?),
            false => None,
        };
        let pools = Pools { context: context.clone(), stamps, sets: Sets::default() };
        Ok(Kept { pools: Some(pools), ..Kept::default() })
    }

    /// Times of the stages, in order; empty unless it was made by [`timed`](Kept::timed).
    ///
    /// # Errors
    /// The commands have not run, or the device is lost.
    pub fn times(&self) -> Result<Vec<StageTime>, GpuError> {
        let Some((context, stamps)) = self.pools.as_ref().and_then(|p| Some((&p.context, p.stamps.as_ref()?))) else {
            return Ok(vec![]);
        };
        stamps.read(context)
    }

    /// Reserves memory for `buffers` buffers: recording with no more allocates nothing from the heap.
    pub fn reserve(&mut self, buffers: usize) {
        self.touched.reserve(buffers);
        self.buffers.reserve(buffers);
    }

    fn keep(&mut self, buffer: &Arc<RawBuffer>) {
        self.buffers.entry(buffer.handle).or_insert_with(|| buffer.clone());
    }

    /// Releases all buffers, and keeps the memory of the lists.
    pub fn clear(&mut self) {
        self.touched.clear();
        self.buffers.clear();
    }

    /// Number of buffers.
    pub fn len(&self) -> usize {
        self.buffers.len()
    }

    /// True if no buffer is kept.
    pub fn is_empty(&self) -> bool {
        self.buffers.is_empty()
    }
}

/// Twins that run with a kernel.
struct Twins {
    /// Replaces the kernel.
    stand_in: Option<Twin>,
    /// Checks the kernel.
    judge: Option<(Twin, Judge)>,
}

/// Number of workgroups.
enum Count<'a> {
    Of(u32),
    /// Words `3·slot..3·slot+3` of a buffer.
    Indirect(&'a Buffer<u32>, u32),
}

/// A dispatch without its kernel's types.
struct Call<'a> {
    kernel: &'static KernelInfo,
    pipeline: RawPipeline,
    workgroup_size: u32,
    spec: &'a [(u32, u32)],
    /// A buffer for each of the kernel's bindings.
    raw: &'a [&'a Arc<RawBuffer>],
    /// Push constants.
    constants: &'a [u8],
    count: Count<'a>,
}

impl Call<'_> {
    /// Copies the kernel's buffers to the host.
    fn download(&self) -> Result<Vec<HostBuffer>, GpuError> {
        self.raw.iter().map(|buffer| Ok(HostBuffer::new(&buffer.bytes().download()?))).collect()
    }

    /// Uploads a twin's results to the buffers that its kernel writes.
    fn upload(&self, now: &[HostBuffer]) -> Result<(), GpuError> {
        let mut bound = self.raw.iter().zip(self.kernel.bindings).zip(now);
        bound.try_for_each(|((raw, binding), now)| match binding.access.writes() && !raw.unused {
            true => raw.bytes().upload(0, now.bytes()),
            false => Ok(()),
        })
    }
}

/// Submitted work. Dropping it waits.
pub struct Submission {
    context: Context,
    slot: Option<CommandSlot>,
    kept: Kept,
}

impl Recorder {
    pub(super) fn new(context: &Context, label: &str) -> Result<Self, GpuError> {
        let inner = &context.0;
        let free = inner.free_slots.lock().ok().and_then(|mut l| l.pop());
        let slot = match free {
            Some(slot) => slot,
            None => make_slot(context)?,
        };
        let commands = slot.commands;
        let recorder = Recorder {
            context: context.clone(),
            slot: Some(slot),
            commands,
            kept: Kept::default(),
            timed: false,
            failed: None,
        };
        recorder.begin(&CString::new(label).unwrap_or_default())?;
        Ok(recorder)
    }

    fn begin(&self, label: &CStr) -> Result<(), GpuError> {
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the slot is free, so its buffer is not pending; its pool was reset, or never used.
        unsafe { self.context.0.device.begin_command_buffer(self.commands, &begin) }.check("vkBeginCommandBuffer")?;
        self.label(label);
        Ok(())
    }

    /// Records into the caller's command buffer, which must be in the recording state and of the context's queue family.
    /// The recorder inserts barriers between its own stages only. Before its first stage the caller must have made its
    /// writes to shared buffers available to `COMPUTE_SHADER` (`SHADER_READ | SHADER_WRITE`), and `TRANSFER` for copies
    /// and fills; after the last stage results must be awaited from `COMPUTE_SHADER`/`SHADER_WRITE`.
    ///
    /// The recorder changes the bound compute pipeline, descriptor set 0 of compute and the push constants.
    ///
    /// Twins replace no kernel here: the commands before it would have to run first, and only the caller can
    /// submit them.
    ///
    /// `kept` is that of an earlier recording whose commands have run, or a new one. [`Recorder::finish`]
    /// returns it with the buffers that the caller must keep alive until the commands have run.
    ///
    /// # Safety
    /// The command buffer stays in the recording state while the recorder lives.
    pub unsafe fn borrow(context: &Context, commands: vk::CommandBuffer, mut kept: Kept) -> Self {
        kept.clear();
        let (device, mut timed, mut failed) = (&context.0.device, false, None);
        if context.0.push_descriptor.is_none() && kept.pools.is_none() {
            kept.pools = Some(Pools { context: context.clone(), stamps: None, sets: Sets::default() });
        }
        if let Some(Pools { stamps, sets, .. }) = &mut kept.pools {
            // SAFETY: what was recorded with `kept` has run; the command buffer is recording.
            unsafe {
                failed = sets.reset(device).check("vkResetDescriptorPool").err();
                if let Some(stamps) = stamps {
                    timed = true;
                    stamps.reset(device);
                    stamps.begin(device, commands);
                }
            }
        }
        Recorder { context: context.clone(), slot: None, commands, kept, timed, failed }
    }

    /// The context for which it records.
    pub fn context(&self) -> &Context {
        &self.context
    }

    pub(super) fn device(&self) -> &ash::Device {
        &self.context.0.device
    }

    /// Times every stage from here on (own command buffers on devices with timestamps only; for a caller's
    /// see [`Kept::timed`]). The time of a stage that a twin replaces is wall time, from the last command
    /// before it to the first after it, including copies and waiting.
    pub fn time_stages(&mut self) {
        if let Some(slot) = &self.slot
            && !self.timed
            && self.context.info().timestamp_period > 0.0
        {
            self.timed = true;
            // SAFETY: the command buffer is recording; the slot was reset when it was last given back.
            unsafe { slot.stamps.begin(&self.context.0.device, self.commands) };
        }
    }

    /// Runs `kernel` on `groups` workgroups; does nothing for 0.
    pub fn dispatch<K: Kernel>(
        &mut self,
        pipeline: &Pipeline<K>,
        buffers: &K::Buffers<'_>,
        push: &K::Push,
        groups: u32,
    ) {
        // guard: dispatches of nothing
        if groups > 0 {
            self.call(pipeline, buffers, push, Count::Of(groups));
        }
    }

    /// Runs `kernel` on the number of workgroups in words `3·slot..3·slot+3` of `args`.
    pub fn dispatch_indirect<K: Kernel>(
        &mut self,
        pipeline: &Pipeline<K>,
        buffers: &K::Buffers<'_>,
        push: &K::Push,
        args: &Buffer<u32>,
        slot: u32,
    ) {
        self.call(pipeline, buffers, push, Count::Indirect(args, slot));
    }

    fn call<K: Kernel>(&mut self, pipeline: &Pipeline<K>, buffers: &K::Buffers<'_>, push: &K::Push, count: Count<'_>) {
        K::raw_buffers(buffers, |raw| {
            let call = Call {
                kernel: const { &KernelInfo::of::<K>() },
                pipeline: pipeline.raw,
                workgroup_size: pipeline.workgroup_size,
                spec: &pipeline.spec,
                raw,
                constants: bytemuck::bytes_of(push),
                count,
            };
            match self.twins(call.kernel.name) {
                Some(twins) => self.run_alone(twins, &call),
                None => drop(self.run_kernel(&call)),
            }
        });
    }

    /// False if it could not be recorded.
    fn run_kernel(&mut self, call: &Call<'_>) -> bool {
        if !self.bind(call) {
            return false;
        }
        let device = &self.context.0.device;
        // SAFETY: the pipeline, its descriptors and constants are bound; kernels bound-check folded indices themselves.
        // Nothing checked the slot, which stages derive from their own layout.
        unsafe {
            match call.count {
                Count::Of(groups) => {
                    let x = groups.min(MAX_GROUPS);
                    device.cmd_dispatch(self.commands, x, groups.div_ceil(x), 1);
                }
                Count::Indirect(args, slot) => {
                    device.cmd_dispatch_indirect(self.commands, args.raw().handle, u64::from(slot) * 12);
                }
            }
        }
        self.close(call.kernel.name);
        true
    }

    /// Sets every word of a buffer to `word`.
    pub fn fill<T: Pod>(&mut self, buffer: &Buffer<T>, word: u32) {
        self.access([(&**buffer.raw(), Access::Write)].into_iter());
        self.keep_buffer(buffer);
        // SAFETY: the buffer is kept until the work is done; its size is a multiple of 4 as all elements are.
        unsafe { self.context.0.device.cmd_fill_buffer(self.commands, buffer.raw().handle, 0, vk::WHOLE_SIZE, word) };
        self.close("fill");
    }

    /// Copies `count` elements, or fewer if either buffer ends earlier.
    pub fn copy<T: Pod>(&mut self, from: &Buffer<T>, from_first: usize, to: &Buffer<T>, to_first: usize, count: usize) {
        let count = count.min(from.len().saturating_sub(from_first)).min(to.len().saturating_sub(to_first));
        if count == 0 {
            return;
        }
        self.access([(&**from.raw(), Access::Read), (&**to.raw(), Access::Write)].into_iter());
        self.keep_buffer(from);
        self.keep_buffer(to);
        let size = size_of::<T>() as u64;
        let region = [vk::BufferCopy {
            src_offset: from_first as u64 * size,
            dst_offset: to_first as u64 * size,
            size: count as u64 * size,
        }];
        // SAFETY: the region lies within both buffers, see above.
        unsafe { self.context.0.device.cmd_copy_buffer(self.commands, from.raw().handle, to.raw().handle, &region) };
        self.close("copy");
    }

    /// Ends recording and hands the work to the queue without waiting.
    ///
    /// # Errors
    /// [`GpuError::Twin`] if a twin could not replace its kernel; later stages were not run then.
    pub fn submit(mut self) -> Result<Submission, GpuError> {
        if let Some(why) = self.failed.take() {
            return Err(why);
        }
        let Some(slot) = self.slot.take() else {
            return Err(GpuError::NotOurs);
        };
        if let Err(e) = self.end(&slot) {
            self.slot = Some(slot);
            return Err(e);
        }
        Ok(Submission { context: self.context.clone(), slot: Some(slot), kept: std::mem::take(&mut self.kept) })
    }

    /// Ends recording into the slot and submits it.
    fn end(&self, slot: &CommandSlot) -> Result<(), GpuError> {
        // Makes results visible to the host, which reads them after the wait.
        self.host_barrier();
        let inner = &self.context.0;
        // SAFETY: the command buffer is recording; the queue is used under its lock; the slot stays until the work is done.
        unsafe {
            if let Some(debug) = &inner.debug {
                debug.cmd_end_debug_utils_label(slot.commands);
            }
            inner.device.end_command_buffer(slot.commands).check("vkEndCommandBuffer")?;
            let commands = [slot.commands];
            let info = [vk::SubmitInfo::default().command_buffers(&commands)];
            let mut result = Err(GpuError::NotSubmitted);
            inner.with_queue(|queue| {
                result = inner.device.queue_submit(queue, &info, slot.fence).check("vkQueueSubmit")
            });
            result?;
        }
        inner.counts.submissions.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }

    /// Twins of the kernel, if there are any.
    fn twins(&self, stage: &str) -> Option<Twins> {
        let inner = &self.context.0;
        let of = |twins: &[Twin]| twins.iter().find(|twin| twin.stage == stage).copied();
        let stand_in = of(&inner.own.twins);
        let judge = inner.own.judge.as_ref().and_then(|judge| Some((of(&judge.twins)?, judge.clone())));
        if stand_in.is_none() && judge.is_none() {
            return None;
        }
        if self.slot.is_none() {
            static TOLD: Once = Once::new();
            TOLD.call_once(|| tracing::warn!("twins stand in for no stage of a caller's command buffer: {stage} runs"));
            return None;
        }
        Some(Twins { stand_in, judge })
    }

    /// Runs the commands recorded so far, then the kernel or its twin by itself, and resumes recording.
    fn run_alone(&mut self, twins: Twins, call: &Call<'_>) {
        if self.failed.is_some() {
            return;
        }
        let outcome = self.run_with_twins(twins, call);
        // The next command needs a command buffer even if this failed.
        self.failed = outcome.and(self.begin_again()).err();
        self.kept.clear();
        self.label(call.kernel.label);
        self.close(call.kernel.name);
    }

    /// Submits the commands recorded so far and waits for them.
    fn finish_recorded(&self) -> Result<(), GpuError> {
        let Some(slot) = &self.slot else { return Err(GpuError::NotOurs) };
        self.end(slot)?;
        let inner = &self.context.0;
        inner.counts.waits.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the fence belongs to the slot, which was submitted.
        unsafe { inner.device.wait_for_fences(&[slot.fence], true, u64::MAX) }.check("vkWaitForFences")
    }

    /// Begins the command buffer again after [`Recorder::finish_recorded`].
    fn begin_again(&self) -> Result<(), GpuError> {
        let Some(slot) = &self.slot else { return Err(GpuError::NotOurs) };
        let device = &self.context.0.device;
        // SAFETY: the device is done with the slot. Timestamps stay: later ones go to other queries.
        unsafe {
            device.reset_command_pool(slot.pool, vk::CommandPoolResetFlags::empty()).check("vkResetCommandPool")?;
            device.reset_fences(&[slot.fence]).check("vkResetFences")?;
        }
        self.begin(c"after a twin")
    }

    fn run_with_twins(&mut self, twins: Twins, call: &Call<'_>) -> Result<(), GpuError> {
        self.finish_recorded()?;
        let groups = match call.count {
            Count::Of(groups) => [groups, 1, 1],
            Count::Indirect(args, slot) => {
                let words = args.download_range(3 * slot as usize, 3)?;
                [0, 1, 2].map(|d| words.get(d).copied().unwrap_or(0))
            }
        };
        let lanes = self.context.info().subgroup_size;
        let workgroups = Workgroups { count: groups, size: call.workgroup_size, lanes };
        if workgroups.groups() == 0 {
            return Ok(());
        }
        let before = call.download()?;
        let twin_call = || TwinCall {
            workgroups,
            spec: call.spec.to_vec(),
            push: call.constants.to_vec(),
            bindings: before.clone(),
        };
        let time = match twins.stand_in {
            Some(twin) => {
                let mut stand_in = twin_call();
                run_twin(twin, &mut stand_in).map_err(|what| GpuError::Twin { stage: twin.stage, what })?;
                self.context.0.counts.twins.fetch_add(1, Ordering::Relaxed);
                call.upload(&stand_in.bindings)?;
                None
            }
            None => {
                // The first run warms up: a CPU device compiles the kernel in it.
                self.run_timed(call)?;
                call.upload(&before)?;
                self.run_timed(call)?
            }
        };
        if let Some((twin, Judge { judge, .. })) = twins.judge {
            let (mut twin_call, kernel) = (twin_call(), call.download()?);
            let failed = run_twin(twin, &mut twin_call).err();
            judge(&Shadowed {
                stage: call.kernel.name,
                bindings: call.kernel.bindings,
                constants: call.kernel.constants,
                twin: &twin_call,
                kernel: &kernel,
                before: &before,
                failed,
                time,
            });
        }
        Ok(())
    }

    /// Runs the kernel alone, with nothing else submitted. Returns its time on the device, if there are
    /// timestamps.
    fn run_timed(&mut self, call: &Call<'_>) -> Result<Option<Duration>, GpuError> {
        self.begin_again()?;
        self.kept.clear();
        self.time_alone();
        if !self.run_kernel(call) {
            return self.failed.take().map_or(Ok(None), Err);
        }
        self.finish_recorded()?;
        match &self.slot {
            Some(slot) if self.timed => Ok(slot.stamps.read(&self.context)?.first().map(|stage| stage.time)),
            _ => Ok(None),
        }
    }

    /// Times only the next stage, if possible; times of earlier ones are lost.
    fn time_alone(&mut self) {
        if let Some(slot) = &mut self.slot
            && self.context.info().timestamp_period > 0.0
        {
            self.timed = true;
            // SAFETY: the device is done with the slot, whose command buffer is recording again.
            unsafe {
                slot.stamps.reset(&self.context.0.device);
                slot.stamps.begin(&self.context.0.device, self.commands);
            }
        }
    }

    /// Ends recording into a borrowed command buffer. Returns the buffers that must outlive the commands,
    /// which keep the context and its pipelines alive.
    ///
    /// Without push descriptors, a stage is skipped if there is no memory for its descriptors, and so are all
    /// later stages; an error is logged.
    pub fn finish(mut self) -> Kept {
        if let Some(why) = &self.failed {
            tracing::error!("stages are missing from the caller's command buffer: {why}");
        }
        std::mem::take(&mut self.kept)
    }

    /// Returns false if that failed, now or before: nothing may be dispatched.
    fn bind(&mut self, call: &Call<'_>) -> bool {
        if self.failed.is_none() {
            self.failed = self.bind_buffers(call).err();
        }
        if self.failed.is_some() {
            return false;
        }
        self.label(call.kernel.label);
        let device = &self.context.0.device;
        // SAFETY: all handles are alive and kept; layout, bindings and constants come from the kernel's own reflection.
        unsafe {
            device.cmd_bind_pipeline(self.commands, vk::PipelineBindPoint::COMPUTE, call.pipeline.handle);
            if !call.constants.is_empty() {
                let stage = vk::ShaderStageFlags::COMPUTE;
                device.cmd_push_constants(self.commands, call.pipeline.layout, stage, 0, call.constants);
            }
        }
        true
    }

    /// Binds descriptors, after a barrier if needed. Nothing is allocated from the heap once `kept` has held
    /// this number of buffers.
    fn bind_buffers(&mut self, call: &Call<'_>) -> Result<(), GpuError> {
        let raw = call.raw;
        let args = match call.count {
            Count::Of(_) => None,
            Count::Indirect(args, _) => Some(args),
        };
        let used = raw.iter().map(|b| &***b).zip(call.kernel.bindings.iter().map(|b| b.access));
        self.access(used.chain(args.map(|a| (&**a.raw(), Access::Read))));
        raw.iter().for_each(|buffer| self.kept.keep(buffer));
        args.into_iter().for_each(|args| self.keep_buffer(args));
        const MOST: usize = needs::STORAGE_BUFFERS as usize;
        let mut infos = [vk::DescriptorBufferInfo { range: vk::WHOLE_SIZE, ..Default::default() }; MOST];
        infos.iter_mut().zip(raw).for_each(|(info, buffer)| info.buffer = buffer.handle);
        let mut writes = [vk::WriteDescriptorSet::default(); MOST];
        for (binding, (write, info)) in writes.iter_mut().zip(&infos).enumerate() {
            *write = write
                .dst_binding(binding as u32)
                .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                .buffer_info(std::slice::from_ref(info));
        }
        let (layout, point) = (call.pipeline.layout, vk::PipelineBindPoint::COMPUTE);
        let writes = &mut writes[..raw.len()];
        if let Some(push) = &self.context.0.push_descriptor {
            // SAFETY: the buffers are kept; the layout has as many bindings as the kernel's own reflection.
            unsafe { push.cmd_push_descriptor_set(self.commands, point, layout, 0, writes) };
            return Ok(());
        }
        let device = &self.context.0.device;
        let sets = match &mut self.slot {
            Some(slot) => Some(&mut slot.sets),
            None => self.kept.pools.as_mut().map(|pools| &mut pools.sets),
        };
        let set = sets.ok_or(GpuError::NotOurs)?.allocate(device, call.pipeline.set_layout)?;
        writes.iter_mut().for_each(|write| write.dst_set = set);
        // SAFETY: as above; the set is new, so nothing uses it.
        unsafe {
            device.update_descriptor_sets(writes, &[]);
            device.cmd_bind_descriptor_sets(self.commands, point, layout, 0, &[set], &[]);
        }
        Ok(())
    }

    /// Records a barrier if a buffer is about to be read after a write, or written after any use, since the
    /// last barrier.
    pub(super) fn access<'a>(&mut self, used: impl Iterator<Item = (&'a RawBuffer, Access)> + Clone) {
        let used = used.filter(|(b, _)| !b.unused).map(|(b, a)| (b.memory(), a.writes()));
        let touched = &self.kept.touched;
        if used.clone().any(|(b, writes)| touched.get(&b).is_some_and(|written| *written || writes)) {
            self.barrier();
        }
        for (buffer, writes) in used {
            *self.kept.touched.entry(buffer).or_insert(false) |= writes;
        }
    }

    /// Later commands wait for all work recorded or submitted before, and see its writes.
    pub fn barrier(&mut self) {
        let everything = [vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE)
            .dst_access_mask(
                vk::AccessFlags::SHADER_READ
                    | vk::AccessFlags::SHADER_WRITE
                    | vk::AccessFlags::TRANSFER_READ
                    | vk::AccessFlags::TRANSFER_WRITE
                    | vk::AccessFlags::INDIRECT_COMMAND_READ,
            )];
        let stages = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
        // SAFETY: the command buffer is recording.
        unsafe {
            self.context.0.device.cmd_pipeline_barrier(
                self.commands,
                stages,
                stages | vk::PipelineStageFlags::DRAW_INDIRECT,
                vk::DependencyFlags::empty(),
                &everything,
                &[],
                &[],
            );
        }
        self.kept.touched.clear();
    }

    pub(super) fn keep_buffer<T: Pod>(&mut self, buffer: &Buffer<T>) {
        self.kept.keep(buffer.raw());
    }

    fn label(&self, name: &CStr) {
        if let Some(debug) = &self.context.0.debug {
            let info = vk::DebugUtilsLabelEXT::default().label_name(name);
            // SAFETY: the command buffer is recording; every label is closed by `close` or `submit`.
            unsafe { debug.cmd_begin_debug_utils_label(self.commands, &info) };
        }
    }

    pub(super) fn close(&mut self, name: &'static str) {
        if let (Some(debug), true) = (&self.context.0.debug, !["fill", "copy", "update"].contains(&name)) {
            // SAFETY: closes the label that `bind` opened.
            unsafe { debug.cmd_end_debug_utils_label(self.commands) };
        }
        if self.timed
            && let Some(stamps) = match &mut self.slot {
                Some(slot) => Some(&mut slot.stamps),
                None => self.kept.pools.as_mut().and_then(|pools| pools.stamps.as_mut()),
            }
        {
            // SAFETY: the command buffer is recording.
            unsafe { stamps.stamp(&self.context.0.device, self.commands, name) };
        }
    }
}

fn run_twin(twin: Twin, call: &mut TwinCall) -> Result<(), String> {
    // If an earlier stage left invalid data, a twin that uses it may index out of bounds.
    catch_unwind(AssertUnwindSafe(|| (twin.run)(call))).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        Err(text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("it panicked").to_owned())
    })
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if let Some(slot) = self.slot.take() {
            // Never submitted: resetting the pool discards the recording.
            recycle(&self.context, slot);
        }
    }
}

impl Submission {
    /// True once the device is done, without waiting.
    pub fn is_done(&self) -> bool {
        // SAFETY: the fence belongs to the slot.
        self.slot.as_ref().is_none_or(|s| unsafe { self.context.0.device.get_fence_status(s.fence) }.unwrap_or(true))
    }

    /// Waits for the work and returns the times of its stages, in order, if timing was on.
    pub fn wait(mut self) -> Result<Vec<StageTime>, GpuError> {
        self.block()?;
        let inner = &self.context.0;
        if inner.own.lost_after.is_some_and(|count| inner.counts.submissions.load(Ordering::Relaxed) > count) {
            return Err(vk::Result::ERROR_DEVICE_LOST).check("vkWaitForFences");
        }
        let mut times = Vec::new();
        if let Some(slot) = self.slot.take() {
            times = slot.stamps.read(&self.context)?;
            recycle(&self.context, slot);
        }
        self.kept.clear();
        Ok(times)
    }

    fn block(&self) -> Result<(), GpuError> {
        let Some(slot) = &self.slot else { return Ok(()) };
        let inner = &self.context.0;
        // SAFETY: the fence belongs to this submission.
        unsafe {
            if inner.device.get_fence_status(slot.fence).unwrap_or(false) {
                return Ok(());
            }
            inner.counts.waits.fetch_add(1, Ordering::Relaxed);
            inner.device.wait_for_fences(&[slot.fence], true, u64::MAX).check("vkWaitForFences")
        }
    }
}

impl Drop for Submission {
    fn drop(&mut self) {
        let _ = self.block();
        if let Some(slot) = self.slot.take() {
            recycle(&self.context, slot);
        }
    }
}
