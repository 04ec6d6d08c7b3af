//! Opens or borrows a Vulkan device; everything on it is made from its [`Context`].

use std::{
    collections::BTreeSet,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
};

use ash::{ext, khr, vk};
use gpu_allocator::{
    AllocationSizes,
    vulkan::{Allocator, AllocatorCreateDesc},
};

use super::{
    DeviceInfo, Feature, GpuError, Judge, Recorder, Requirements, Twin,
    device::{self, Limits, Physical, Subgroups},
    functions::{check_device, check_instance, has_push_descriptors},
    instance::{create_instance, create_messenger},
    memory::{BLOCK, Budget, types_of_buffers},
    pipeline::Made,
    pools::{CommandSlot, destroy_slot},
};

/// How to open glint's own device.
#[derive(Debug, Clone, Default)]
pub struct ContextOptions {
    /// Index in [`Context::devices`] or a part of a device's name; `None` takes the first discrete GPU, else any device.
    pub device: Option<String>,
    /// Turn the Khronos validation layer on, with synchronisation validation. Messages are kept in
    /// [`Context::validation_messages`] and printed on stderr.
    pub validation: bool,
    /// Lanes of a subgroup: a power of two from 8 to 64 that the device offers. `None` takes the device's
    /// preferred size.
    pub subgroup_size: Option<u32>,
    /// Run subgroup operations through shared memory even if the device's own subgroups could be used, with subgroups of
    /// [`subgroup_size`](Self::subgroup_size) lanes (by default 32). For tests of sizes that the device does not have.
    pub software_subgroups: bool,
    /// Bytes of device memory that buffers may take together, if less than the device has. See
    /// [`Memory`](super::Memory).
    pub memory_budget: Option<u64>,
    /// Functions that replace kernels on the host. The recorder submits and waits at each stage with a twin,
    /// so this serves to find a stage that a driver miscompiles, not production work.
    pub twins: Vec<Twin>,
    /// Compares the results of kernels, or of twins that replace them, with those of twins from the same
    /// inputs. Each dispatch is then submitted on its own.
    pub judge: Option<Judge>,
    /// For tests: after this number of submissions every wait reports a lost device. A CPU device is never
    /// lost by itself.
    pub lost_after: Option<u64>,
}

impl ContextOptions {
    /// Options from the variables GLINT_DEVICE, GLINT_VALIDATION, GLINT_MEMORY_BUDGET (bytes),
    /// GLINT_SUBGROUP_SIZE, GLINT_SOFTWARE_SUBGROUPS and GLINT_LOST_AFTER; the latter three are for tests.
    pub fn from_env() -> Self {
        let text = |name| std::env::var(name).ok().filter(|value| !value.is_empty());
        ContextOptions {
            device: text("GLINT_DEVICE"),
            validation: text("GLINT_VALIDATION").is_some(),
            // An invalid number becomes 0, a size that no device offers, and is refused as such.
            subgroup_size: text("GLINT_SUBGROUP_SIZE").map(|size| size.parse().unwrap_or(0)),
            software_subgroups: text("GLINT_SOFTWARE_SUBGROUPS").is_some(),
            // An invalid number becomes a budget of 0: nothing fits, and the error reports its size.
            memory_budget: text("GLINT_MEMORY_BUDGET").map(|bytes| bytes.parse().unwrap_or(0)),
            twins: Vec::new(),
            judge: None,
            lost_after: text("GLINT_LOST_AFTER").and_then(|count| count.parse().ok()),
        }
    }
}

/// The caller's device. glint destroys none of it and submits to `queue` only through [`Recorder::submit`];
/// while glint uses the queue the caller must not (Vulkan's external synchronisation).
pub struct BorrowedDevice {
    /// The loader that `instance` was made with.
    pub entry: ash::Entry,
    /// Vulkan 1.2 or newer, as declared in its application info.
    pub instance: ash::Instance,
    /// The physical device of `device`.
    pub physical_device: vk::PhysicalDevice,
    /// Made with the extensions and features that [`Context::requirements`] names.
    pub device: ash::Device,
    /// Family of `queue`; it must support compute.
    pub queue_family: u32,
    /// Used for [`Recorder::submit`] only.
    pub queue: vk::Queue,
    /// Optional features that the device was made with, including their extensions.
    pub optional: BTreeSet<Feature>,
    /// Pipelines are made with it; null for none. The caller keeps, saves and destroys it.
    pub pipeline_cache: vk::PipelineCache,
    /// Gives glint exclusive use of the queue if others submit to it too; `None` if only glint uses it.
    pub queue_lock: Option<QueueLock>,
    /// Names kernels and buffers for debuggers: `VK_EXT_debug_utils` is enabled on the instance.
    pub labels: bool,
    /// Bytes of device memory that glint's buffers may take together, if less than the device has.
    pub memory_budget: Option<u64>,
}

/// Calls its argument once, while nobody else uses the queue.
type WithQueue = dyn Fn(&mut dyn FnMut()) + Send + Sync;

/// An engine's own lock of a queue that it shares with glint. The submitting thread takes it for each
/// submission: uploads that wait, downloads and [`Recorder::submit`].
/// [`Frames`](crate::pipelines::frames::Frames) and [`Upload`](crate::pipelines::model::Upload) do not
/// submit. A thread that already holds the lock must not call a function that submits: it would deadlock
/// unless the lock is reentrant.
#[derive(Clone)]
pub struct QueueLock(pub Arc<WithQueue>);

/// Counts of the host's calls to the device since the context was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Counters {
    /// Queue submissions.
    pub submissions: u64,
    /// Times the CPU blocked for the device.
    pub waits: u64,
    /// Times a twin replaced a kernel.
    pub twins: u64,
    /// Pipelines that were built, not shared with existing ones.
    pub pipelines: u64,
}

pub(super) struct Inner {
    pub device: ash::Device,
    /// None: ordinary descriptor sets are used instead.
    pub push_descriptor: Option<khr::push_descriptor::Device>,
    pub debug: Option<ext::debug_utils::Device>,
    pub queue: Queue,
    pub pipeline_cache: vk::PipelineCache,
    pub facts: Facts,
    pub allocator: Mutex<Option<Allocator>>,
    pub budget: Budget,
    pub free_slots: Mutex<Vec<CommandSlot>>,
    pub counts: Counts,
    pub own: Own,
    pub instance: ash::Instance,
    pub physical: vk::PhysicalDevice,
    // Keeps the Vulkan library loaded for as long as its functions are called.
    entry: ash::Entry,
}

/// The queue that a context submits to.
pub(super) struct Queue {
    handle: Mutex<vk::Queue>,
    lock: Option<QueueLock>,
    pub family: u32,
}

/// Properties of a context's device.
pub(super) struct Facts {
    pub info: DeviceInfo,
    pub limits: Limits,
    pub subgroups: Subgroups,
    pub features: BTreeSet<Feature>,
    /// Valid bits of a timestamp.
    pub timestamp_mask: u64,
}

/// [`Counters`] of a context.
#[derive(Default)]
pub(super) struct Counts {
    pub submissions: AtomicU64,
    pub waits: AtomicU64,
    pub twins: AtomicU64,
    pub pipelines: AtomicU64,
}

/// A device, its queue and its memory. Cheap to clone; everything made from it keeps it alive.
#[derive(Clone)]
pub struct Context(pub(super) Arc<Inner>);

/// Members that a borrowed device leaves at their defaults.
#[derive(Default)]
pub(super) struct Own {
    messages: Arc<Mutex<Vec<String>>>,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    owned: bool,
    pub twins: Vec<Twin>,
    pub judge: Option<Judge>,
    pub lost_after: Option<u64>,
    pub pipelines: Arc<Made>,
}

impl Context {
    /// The requirements of a device: [`Context::new`], [`Context::borrow`] and [`Context::devices`] check
    /// against this list.
    pub fn requirements() -> Requirements {
        Requirements::of_kernels()
    }

    /// All physical devices, in the loader's order; unusable ones with the reason.
    pub fn devices() -> Result<Vec<(DeviceInfo, Option<GpuError>)>, GpuError> {
        let (entry, instance, _) = create_instance(false, &[])?;
        let options = ContextOptions::default();
        let infos = device::all(&instance).map(|list| {
            let info = |p: &Physical| {
                let subgroups = p.check(&options, &p.offered);
                (p.info(subgroups.as_ref().ok().copied(), &p.offered, p.timestamp_bits()), subgroups.err())
            };
            list.iter().map(info).collect()
        });
        // SAFETY: nothing made from this instance is left.
        unsafe { instance.destroy_instance(None) };
        drop(entry);
        infos
    }

    /// The physical device that [`Context::new`] would open, from the caller's instance, and the features
    /// that it offers. Those that are not required may be named in [`BorrowedDevice::optional`].
    ///
    /// # Errors
    /// No device, or a need that the first candidate lacks. [`GpuError::Missing`] too if the instance is
    /// older than Vulkan 1.2 and lacks the functions to query this.
    pub fn choose(
        entry: &ash::Entry,
        instance: &ash::Instance,
        options: &ContextOptions,
    ) -> Result<(vk::PhysicalDevice, BTreeSet<Feature>), GpuError> {
        // SAFETY: both are live by the caller's contract.
        unsafe { check_instance(entry, instance) }?;
        device::pick(entry, instance, options).map(|(physical, _)| (physical.handle, physical.offered))
    }

    /// Describes a physical device of the caller's instance before a device is made from it. The memory that
    /// a scene takes there follows from the result, see [`Model::plan`](crate::pipelines::model::Model::plan)
    /// and [`Limits::plan`](crate::pipelines::frames::Limits::plan).
    ///
    /// # Errors
    /// Those that [`Context::borrow`] would return for it.
    ///
    /// # Safety
    /// `physical_device` comes from `instance`, and that from `entry`.
    pub unsafe fn describe(
        entry: &ash::Entry,
        instance: &ash::Instance,
        physical_device: vk::PhysicalDevice,
    ) -> Result<DeviceInfo, GpuError> {
        // SAFETY: by the contract above.
        let physical = unsafe {
            check_instance(entry, instance)?;
            Physical::query(instance, physical_device)
        };
        let subgroups = physical.check(&ContextOptions::default(), &physical.offered)?;
        Ok(physical.info(Some(subgroups), &physical.offered, physical.timestamp_bits()))
    }

    /// Opens glint's own device.
    pub fn new(options: &ContextOptions) -> Result<Self, GpuError> {
        let (entry, instance, debug) = create_instance(options.validation, &[])?;
        let messages = Arc::new(Mutex::new(Vec::new()));
        let messenger = if options.validation { Some(create_messenger(&entry, &instance, &messages)?) } else { None };
        let opened = device::pick(&entry, &instance, options).and_then(|(physical, subgroups)| {
            let family = physical.queue_family.ok_or_else(|| GpuError::NoDevice(" with a compute queue".into()))?.0;
            device::open(&instance, &physical, family).map(|device| (physical, subgroups, device, family))
        });
        let (physical, subgroups, device, queue_family) = match opened {
            Ok(opened) => opened,
            Err(e) => {
                // SAFETY: nothing but the messenger was made from this instance.
                unsafe {
                    if let Some((utils, messenger)) = &messenger {
                        utils.destroy_debug_utils_messenger(*messenger, None);
                    }
                    instance.destroy_instance(None);
                }
                return Err(e);
            }
        };
        // SAFETY: the family and index 0 were requested at creation.
        let queue = unsafe { device.get_device_queue(queue_family, 0) };
        let optional = physical.offered.clone();
        let borrowed = BorrowedDevice {
            entry,
            instance,
            physical_device: physical.handle,
            device,
            queue_family,
            queue,
            optional,
            pipeline_cache: vk::PipelineCache::null(),
            queue_lock: None,
            labels: debug,
            memory_budget: options.memory_budget,
        };
        let ContextOptions { twins, judge, lost_after, .. } = options.clone();
        let own = Own { messages, messenger, owned: true, twins, judge, lost_after, ..Own::default() };
        Self::assemble(borrowed, &physical, subgroups, own)
    }

    /// Opens another context on the same device. It takes turns with this one at the queue and keeps the
    /// device open. Memory budget, counters and twins are its own. Pipelines are shared if subgroups have the
    /// same size. The choice of a device and the validation layers stay the same.
    ///
    /// # Errors
    /// Those of [`Context::new`]: a subgroup size that the device does not have.
    pub fn again(&self, options: &ContextOptions) -> Result<Self, GpuError> {
        let inner = &self.0;
        // SAFETY: the handles are live, and the queue lock keeps them so.
        let physical = unsafe { Physical::query(&inner.instance, inner.physical) };
        let subgroups = physical.check(options, &inner.facts.features)?;
        let first = self.clone();
        let borrowed = BorrowedDevice {
            entry: inner.entry.clone(),
            instance: inner.instance.clone(),
            physical_device: inner.physical,
            device: inner.device.clone(),
            queue_family: inner.queue.family,
            queue: *inner.queue.handle.lock().unwrap_or_else(|e| e.into_inner()),
            optional: inner.facts.features.clone(),
            pipeline_cache: inner.pipeline_cache,
            queue_lock: Some(QueueLock(Arc::new(move |work| first.0.with_queue(|_| work())))),
            labels: inner.debug.is_some(),
            memory_budget: options.memory_budget,
        };
        let own = Own {
            messages: inner.own.messages.clone(),
            twins: options.twins.clone(),
            judge: options.judge.clone(),
            lost_after: options.lost_after,
            pipelines: if subgroups == inner.facts.subgroups { inner.own.pipelines.clone() } else { Arc::default() },
            ..Own::default()
        };
        Self::assemble(borrowed, &physical, subgroups, own)
    }

    /// Uses the caller's device.
    ///
    /// # Errors
    /// [`GpuError::Missing`] and [`GpuError::Limit`] name a feature or limit that the physical device lacks,
    /// or a Vulkan function that instance or device lack; [`GpuError::Null`] names a null handle. Features
    /// and extensions without functions that exist but were not enabled cannot be detected here: enable the
    /// list of [`Context::requirements`].
    ///
    /// # Safety
    /// The handles belong together, outlive every clone of the context and everything made from it, and
    /// nobody else uses the queue while glint submits. The device was made according to
    /// [`Context::requirements`] and `optional`.
    pub unsafe fn borrow(device: BorrowedDevice) -> Result<Self, GpuError> {
        for (what, is_null) in [
            ("the physical device", device.physical_device == vk::PhysicalDevice::null()),
            ("the device", device.device.handle() == vk::Device::null()),
            ("the queue", device.queue == vk::Queue::null()),
        ] {
            if is_null {
                return Err(GpuError::Null(what));
            }
        }
        // SAFETY: by the contract above.
        let physical = unsafe {
            check_instance(&device.entry, &device.instance)?;
            Physical::query(&device.instance, device.physical_device)
        };
        let subgroups = physical.check(&ContextOptions::default(), &device.optional)?;
        // An extension that is not enabled can only be detected by its missing functions.
        // SAFETY: by the contract above.
        unsafe { check_device(&device.instance, device.physical_device, &device.device, device.labels) }?;
        Self::assemble(device, &physical, subgroups, Own::default())
    }

    fn assemble(from: BorrowedDevice, physical: &Physical, subgroups: Subgroups, own: Own) -> Result<Self, GpuError> {
        let BorrowedDevice { entry, instance, physical_device, device, queue_family, queue, optional, .. } = from;
        let offered = |f: &Feature| physical.offered.contains(f);
        let features: BTreeSet<_> = optional.into_iter().chain(Feature::REQUIRED).filter(offered).collect();
        // SAFETY: a query on live handles.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical_device) };
        let timestamp_bits = families.get(queue_family as usize).map_or(0, |f| f.timestamp_valid_bits);
        let types = types_of_buffers(&device)?;
        // SAFETY: the handles are live and belong together.
        let pushes = physical.limits.push_descriptors() && unsafe { has_push_descriptors(&instance, &device) };
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.clone(),
            device: device.clone(),
            physical_device,
            debug_settings: Default::default(),
            buffer_device_address: false,
            allocation_sizes: AllocationSizes::new(BLOCK, BLOCK),
        })
        .map_err(|source| GpuError::Allocation { name: "allocator".into(), bytes: 0, source })?;
        let context = Context(Arc::new(Inner {
            push_descriptor: pushes.then(|| khr::push_descriptor::Device::new(&instance, &device)),
            debug: from.labels.then(|| ext::debug_utils::Device::new(&instance, &device)),
            queue: Queue { handle: Mutex::new(queue), lock: from.queue_lock, family: queue_family },
            pipeline_cache: from.pipeline_cache,
            facts: Facts {
                info: physical.info(Some(subgroups), &features, timestamp_bits),
                limits: physical.limits,
                subgroups,
                features,
                timestamp_mask: u64::MAX.checked_shr(64 - timestamp_bits.min(64)).unwrap_or(0),
            },
            allocator: Mutex::new(Some(allocator)),
            budget: Budget::new(physical, types, from.memory_budget),
            free_slots: Mutex::default(),
            counts: Counts::default(),
            own,
            device,
            instance,
            physical: physical_device,
            entry,
        }));
        let info = context.info();
        tracing::debug!(device = info.name, subgroup = info.subgroup_size, how = ?info.reconvergence, "device opened");
        Ok(context)
    }

    /// Opens another context on this device, with the same options and a judge.
    ///
    /// # Errors
    /// Those of [`Context::again`].
    pub fn judged(&self, judge: Judge) -> Result<Self, GpuError> {
        let (Own { twins, lost_after, .. }, subgroups) = (&self.0.own, self.0.facts.subgroups);
        self.again(&ContextOptions {
            twins: twins.clone(),
            judge: Some(judge),
            lost_after: *lost_after,
            subgroup_size: Some(subgroups.lanes),
            software_subgroups: subgroups.software,
            ..Default::default()
        })
    }

    /// True if both are the same context, or clones of it.
    pub fn is_same(&self, other: &Context) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Properties of the device.
    pub fn info(&self) -> &DeviceInfo {
        &self.0.facts.info
    }

    /// The features that kernels can rely on.
    pub fn features(&self) -> &BTreeSet<Feature> {
        &self.0.facts.features
    }

    /// The device's functions and handle, for calls that glint does not make.
    pub fn device(&self) -> &ash::Device {
        &self.0.device
    }

    /// The instance's functions and handle.
    pub fn instance(&self) -> &ash::Instance {
        &self.0.instance
    }

    /// The family of the queue that glint submits to, and of all command buffers.
    pub fn queue_family(&self) -> u32 {
        self.0.queue.family
    }

    /// The physical device, for queries that glint does not make.
    pub fn physical_device(&self) -> vk::PhysicalDevice {
        self.0.physical
    }

    /// Starts recording one of glint's own command buffers.
    pub fn recorder(&self, label: &str) -> Result<Recorder, GpuError> {
        Recorder::new(self, label)
    }

    /// Submissions, waits and twins so far.
    pub fn counters(&self) -> Counters {
        Counters {
            submissions: self.0.counts.submissions.load(Ordering::Relaxed),
            waits: self.0.counts.waits.load(Ordering::Relaxed),
            twins: self.0.counts.twins.load(Ordering::Relaxed),
            pipelines: self.0.counts.pipelines.load(Ordering::Relaxed),
        }
    }

    /// Messages of the validation layer so far; empty unless [`ContextOptions::validation`] is on and
    /// something is wrong.
    pub fn validation_messages(&self) -> Vec<String> {
        self.0.own.messages.lock().map(|m| m.clone()).unwrap_or_default()
    }
}

impl Inner {
    /// Calls `work` once, while nobody else uses the queue: neither another context of this device nor, if
    /// there is a lock, the queue's owner.
    pub(super) fn with_queue(&self, mut work: impl FnMut(vk::Queue)) {
        let queue = self.queue.handle.lock().unwrap_or_else(|e| e.into_inner());
        match &self.queue.lock {
            None => work(*queue),
            Some(lock) => (lock.0)(&mut || work(*queue)),
        }
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        // SAFETY: every buffer, pipeline and recorder holds an Arc of this, so none is left; work that a dropped
        // submission left behind is waited for first.
        unsafe {
            if self.own.owned {
                let _ = self.device.device_wait_idle();
            }
            if let Ok(mut slots) = self.free_slots.lock() {
                for slot in slots.drain(..) {
                    destroy_slot(&self.device, slot);
                }
            }
            // Another context on the device keeps the one that it came from, so the last one can always be
            // identified.
            if let Some(made) = Arc::get_mut(&mut self.own.pipelines) {
                let made = made.get_mut().unwrap_or_else(|e| e.into_inner());
                made.drain().for_each(|(_, pipeline)| pipeline.destroy(&self.device));
            }
            if let Ok(mut allocator) = self.allocator.lock() {
                drop(allocator.take());
            }
            if self.own.owned {
                self.device.destroy_device(None);
                if let Some((utils, messenger)) = &self.own.messenger {
                    utils.destroy_debug_utils_messenger(*messenger, None);
                }
                self.instance.destroy_instance(None);
            }
        }
    }
}
