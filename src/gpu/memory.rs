//! Typed storage buffers, and the budget of device memory that they share.

use std::{
    marker::PhantomData,
    sync::{
        Arc,
        atomic::{AtomicU32, AtomicU64, Ordering},
    },
};

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::{
    MemoryLocation,
    vulkan::{Allocation, AllocationCreateDesc, AllocationScheme},
};

use super::{Check, Context, GpuError, device::Physical, features::has_extension};

/// The memory in which a buffer lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Location {
    /// Device memory; filled by [`Buffer::upload`] or by kernels.
    Device,
    /// Host memory that the device accesses over the bus: staging, status words, and what does not fit the device.
    Host,
}

impl Location {
    const ALL: [Self; 2] = [Location::Device, Location::Host];

    /// The allocator's location. With [`MemoryLocation::CpuToGpu`] it would use device memory, if the host can
    /// write to it.
    fn kind(self) -> MemoryLocation {
        match self {
            Location::Device => MemoryLocation::GpuOnly,
            Location::Host => MemoryLocation::GpuToCpu,
        }
    }

    /// The heap from which the allocator takes it: that of the first memory type with all preferred flags,
    /// else with all required ones. `types` are the memory types that buffers can use.
    fn heap(self, memory: &vk::PhysicalDeviceMemoryProperties, types: u32) -> Option<usize> {
        use vk::MemoryPropertyFlags as Flags;
        let host = Flags::HOST_VISIBLE | Flags::HOST_COHERENT;
        let wanted = match self {
            Location::Device => [Flags::DEVICE_LOCAL; 2],
            Location::Host => [host | Flags::HOST_CACHED, host],
        };
        let list = &memory.memory_types[..memory.memory_type_count as usize];
        let find = |flags| (0..).zip(list).find(|(i, t)| types >> i & 1 != 0 && t.property_flags.contains(flags));
        wanted.into_iter().find_map(find).map(|(_, found): (u32, _)| found.heap_index as usize)
    }
}

/// Bytes of the memory blocks that small buffers share. A larger buffer has its own memory, returned to the
/// device with it. This is the smallest block that gpu-allocator makes: with its default of 256 and 64 MiB a
/// scene of 1 MiB would keep that much from the host application.
pub(super) const BLOCK: u64 = 4 << 20;

/// Device memory, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Memory {
    /// The largest `used` and `taken` that the context's buffers can reach now: their present share plus the
    /// memory still free.
    pub budget: u64,
    /// Bytes that the buffers use.
    pub used: u64,
    /// Largest `used` so far, or since [`Context::count_most_anew`].
    pub most_used: u64,
    /// Bytes allocated from the device for them: buffers of up to 4 MiB share blocks of that size.
    pub taken: u64,
    /// Bytes of buffers in the host's memory; part of `used` if the device has none of its own.
    pub host: u64,
}

/// Keeps buffers within the device's memory. A driver may move an excess to the host's memory, where
/// everything runs a hundred times slower, so it must be refused first.
pub(super) struct Budget {
    /// Index of the heap that device buffers use.
    heap: usize,
    /// The heap's bytes, or fewer if the caller sets a limit.
    most: u64,
    /// `VK_EXT_memory_budget` reports what other programs leave of it.
    shared: bool,
    /// By location: true if its memory is in that heap. This includes the host's memory if there is only one
    /// heap, or the host sees no other.
    counted: [bool; Location::ALL.len()],
    /// Bytes of the heap of [`Location::Host`], if it is another one.
    staging: Option<u64>,
    used: AtomicU64,
    most_used: AtomicU64,
    host: AtomicU64,
    /// Changes only with the allocator, under its lock.
    taken: AtomicU64,
    /// Changes likewise. Bit l: a block was made for buffers of location l, and the last one stays.
    blocks: AtomicU32,
}

impl Budget {
    /// `types` are the memory types that buffers can use.
    pub fn new(physical: &Physical, types: u32, cap: Option<u64>) -> Self {
        let heaps = &physical.memory.memory_heaps[..physical.memory.memory_heap_count as usize];
        let heap = Location::Device.heap(&physical.memory, types).unwrap_or(0);
        let mut most = heaps.get(heap).map_or(u64::MAX, |heap| heap.size);
        let counted = Location::ALL.map(|location| location.heap(&physical.memory, types) == Some(heap));
        let staging = Location::Host.heap(&physical.memory, types).filter(|&of| of != heap);
        let staging = staging.and_then(|of| heaps.get(of)).map(|heap| heap.size);
        let shared = has_extension(&physical.extensions, ash::ext::memory_budget::NAME);
        if physical.device_type == vk::PhysicalDeviceType::CPU && !shared {
            most = host_memory().unwrap_or(most);
        }
        let most = cap.map_or(most, |cap| cap.min(most));
        let [used, most_used, host, taken] = [const { AtomicU64::new(0) }; 4];
        Budget { heap, most, shared, counted, staging, used, most_used, host, taken, blocks: AtomicU32::new(0) }
    }

    fn counts(&self, location: Location) -> bool {
        self.counted[location as usize]
    }
}

/// A CPU device's memory is the host's, regardless of its heap: lavapipe reports 2 GiB on every machine.
pub(super) fn host_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let kib = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?.trim().strip_suffix(" kB")?;
    kib.parse::<u64>().ok()?.checked_mul(1024)
}

/// The memory budget of a context that has taken `taken` bytes, at most `most`. The driver gives the process
/// `heap_budget`, of which it uses `heap_usage` already, including memory that is not glint's.
fn budget(most: u64, taken: u64, heap_budget: u64, heap_usage: u64) -> u64 {
    most.min(taken.saturating_add(heap_budget.saturating_sub(heap_usage)))
}

impl Context {
    /// Bytes that this context's buffers can use if no other program uses any: constant.
    pub fn memory_at_most(&self) -> u64 {
        self.0.budget.most
    }

    /// Bytes of the host memory that the device copies from; `None` if it is the device's own memory.
    pub fn staging_memory(&self) -> Option<u64> {
        self.0.budget.staging
    }

    /// This context's memory budget and its use, bytes. Other programs and the caller's own memory count if
    /// the device has `VK_EXT_memory_budget`.
    pub fn memory(&self) -> Memory {
        let Budget { heap, most, shared, ref used, ref most_used, ref host, ref taken, .. } = self.0.budget;
        let [used, most_used, host, taken] = [used, most_used, host, taken].map(|bytes| bytes.load(Ordering::Relaxed));
        let memory = Memory { budget: most, used, most_used, taken, host };
        if !shared {
            return memory;
        }
        let mut heaps = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
        let mut properties = vk::PhysicalDeviceMemoryProperties2::default().push_next(&mut heaps);
        // SAFETY: a query of live handles; the device knows the extension; the chain lives for the call.
        unsafe { self.0.instance.get_physical_device_memory_properties2(self.0.physical, &mut properties) };
        Memory { budget: budget(most, taken, heaps.heap_budget[heap], heaps.heap_usage[heap]), ..memory }
    }

    /// Resets [`Memory::most_used`] to the present use.
    pub fn count_most_anew(&self) {
        let Budget { used, most_used, .. } = &self.0.budget;
        most_used.store(used.load(Ordering::Relaxed), Ordering::Relaxed);
    }
}

/// A part of the budget, given back on drop.
struct Share {
    bytes: u64,
    /// Bytes in the host's memory.
    host: u64,
    context: Context,
}

impl Share {
    fn take(context: &Context, name: &str, bytes: u64, location: Location) -> Result<Self, GpuError> {
        let host = if location == Location::Host { bytes } else { 0 };
        context.0.budget.host.fetch_add(host, Ordering::Relaxed);
        let bytes = if context.0.budget.counts(location) { bytes } else { 0 };
        let Memory { budget, .. } = context.memory();
        let used = context.0.budget.used.fetch_add(bytes, Ordering::Relaxed);
        // Dropped, and so returned, if it was too much.
        let share = Share { bytes, host, context: context.clone() };
        if bytes > 0 && used.saturating_add(bytes) > budget {
            return Err(GpuError::OverBudget { name: name.into(), bytes, used, budget });
        }
        Ok(share)
    }

    /// Counts the share in `most_used` once it has memory: until then it may be refused.
    fn is_used(&self) {
        let Budget { used, most_used, .. } = &self.context.0.budget;
        most_used.fetch_max(used.load(Ordering::Relaxed), Ordering::Relaxed);
    }
}

impl Drop for Share {
    fn drop(&mut self) {
        self.context.0.budget.used.fetch_sub(self.bytes, Ordering::Relaxed);
        self.context.0.budget.host.fetch_sub(self.host, Ordering::Relaxed);
    }
}

/// An untyped buffer and its memory, freed with the last reference.
pub struct RawBuffer {
    pub(super) handle: vk::Buffer,
    pub(super) bytes: u64,
    /// Fills a binding that a variant of a kernel does not access: it causes no hazard.
    pub(super) unused: bool,
    name: String,
    allocation: Option<Allocation>,
    /// Its memory counts in the budget.
    counts: bool,
    /// The buffer whose memory it shares and its first byte there, if it has no memory of its own.
    over: Option<(Arc<RawBuffer>, u64)>,
    context: Context,
    _share: Share,
}

/// Fills bindings that a variant of a kernel does not access: every binding needs a buffer.
pub struct Unused(Arc<RawBuffer>);

impl Unused {
    /// A buffer large enough for one element of any kernel's binding.
    pub fn new(context: &Context) -> Result<Self, GpuError> {
        // 256 bytes: more than the largest element of any kernel.
        Ok(Unused(Buffer::<u32>::create(context, "unused", 64, Location::Device, true)?.raw))
    }

    /// The buffer, typed for any binding.
    pub fn of<T: Pod>(&self) -> Buffer<T> {
        Buffer { raw: self.0.clone(), len: 1, element: PhantomData }
    }
}

impl RawBuffer {
    /// The Vulkan buffer, with usage storage, indirect and transfer both ways. It lives as long as `self`.
    pub fn handle(&self) -> vk::Buffer {
        self.handle
    }

    /// Its size in bytes.
    pub fn bytes_len(&self) -> u64 {
        self.bytes
    }

    /// Identifies its memory: buffers that share memory have the same.
    pub(super) fn memory(&self) -> vk::Buffer {
        self.over.as_ref().map_or(self.handle, |(over, _)| over.handle)
    }

    /// Sets its name, for debuggers.
    fn label(&self) {
        if let (Some(debug), Ok(name)) = (&self.context.0.debug, std::ffi::CString::new(self.name.as_str())) {
            let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(self.handle).object_name(&name);
            // SAFETY: the handle is live.
            let _ = unsafe { debug.set_debug_utils_object_name(&info) };
        }
    }

    /// The buffer, typed as bytes.
    pub(super) fn bytes(self: &Arc<Self>) -> Buffer<u8> {
        Buffer { raw: self.clone(), len: self.bytes as usize, element: PhantomData }
    }
}

/// `len` elements of type `T` in one storage buffer. Cloning shares it.
pub struct Buffer<T> {
    raw: Arc<RawBuffer>,
    len: usize,
    element: PhantomData<T>,
}

impl<T> Clone for Buffer<T> {
    fn clone(&self) -> Self {
        Buffer { raw: self.raw.clone(), len: self.len, element: PhantomData }
    }
}

impl<T: Pod> Buffer<T> {
    /// An uninitialised buffer of `len` elements (at least one: Vulkan has no empty buffers).
    ///
    /// # Errors
    /// [`GpuError::BufferTooLarge`] and [`GpuError::OverBudget`] before any call of the driver.
    pub fn new(context: &Context, name: &str, len: usize, location: Location) -> Result<Self, GpuError> {
        Self::create(context, name, len, location, false)
    }

    fn create(context: &Context, name: &str, len: usize, location: Location, unused: bool) -> Result<Self, GpuError> {
        // guard: buffers of nothing
        let bytes = (len.max(1) as u64).saturating_mul(size_of::<T>() as u64);
        let limit = context.info().max_storage_bytes;
        // guard: buffers that the device cannot bind
        if bytes > limit {
            return Err(GpuError::BufferTooLarge { name: name.into(), bytes, limit });
        }
        let share = Share::take(context, name, bytes, location)?;
        let device = &context.0.device;
        let handle = without_memory(context, bytes)?;
        // SAFETY: the handle was made above; it is destroyed here on failure and in Drop otherwise.
        unsafe {
            let allocation = match allocate(context, handle, name, location) {
                Ok(allocation) => allocation,
                Err(error) => {
                    device.destroy_buffer(handle, None);
                    return Err(error);
                }
            };
            share.is_used();
            let bound = device.bind_buffer_memory(handle, allocation.memory(), allocation.offset());
            let raw = RawBuffer {
                handle,
                bytes,
                unused,
                name: name.into(),
                allocation: Some(allocation),
                counts: context.0.budget.counts(location),
                over: None,
                context: context.clone(),
                _share: share,
            };
            bound.check("vkBindBufferMemory")?;
            raw.label();
            Ok(Buffer { raw: Arc::new(raw), len, element: PhantomData })
        }
    }

    /// Makes a buffer of `len` elements, at least one, in the memory of `parent` from byte `first` on, for
    /// data that is not needed at the same time. The recorder treats a use of either as a use of both. The
    /// buffer gets its own memory if `parent` has no such bytes, or the device does not allow a buffer at
    /// that offset.
    ///
    /// # Errors
    /// Those of [`Buffer::new`].
    pub fn over<P: Pod>(
        context: &Context,
        name: &str,
        parent: &Buffer<P>,
        first: u64,
        len: usize,
    ) -> Result<Self, GpuError> {
        let bytes = (len.max(1) as u64).saturating_mul(size_of::<T>() as u64);
        let within = first.checked_add(bytes).is_some_and(|end| end <= parent.raw.bytes);
        // If `parent` itself shares another buffer's memory.
        let (root, first) = match &parent.raw.over {
            Some((root, begin)) => (root, begin + first),
            None => (&parent.raw, first),
        };
        // Dedicated memory cannot hold another buffer.
        let Some(allocation) = root.allocation.as_ref().filter(|a| within && !a.is_dedicated()) else {
            return Self::new(context, name, len, Location::Device);
        };
        let device = &context.0.device;
        let raw = RawBuffer {
            handle: without_memory(context, bytes)?,
            bytes,
            unused: false,
            name: name.into(),
            allocation: None,
            counts: false,
            over: Some((root.clone(), first)),
            context: context.clone(),
            _share: Share::take(context, name, 0, Location::Device)?,
        };
        // SAFETY: the handle was made above, and is destroyed when `raw` is dropped.
        let needs = unsafe { device.get_buffer_memory_requirements(raw.handle) };
        // SAFETY: as above.
        let roots = unsafe { device.get_buffer_memory_requirements(root.handle) };
        let offset = allocation.offset() + first;
        // Handles any alignment or type that the device demands, though no tested device demands one.
        if !offset.is_multiple_of(needs.alignment)
            || first + needs.size > roots.size
            || roots.memory_type_bits & !needs.memory_type_bits != 0
        {
            return Self::new(context, name, len, Location::Device);
        }
        // SAFETY: both are live, and the memory as long as `raw` holds `root`; offset, size and type of the memory were asked above.
        unsafe { device.bind_buffer_memory(raw.handle, allocation.memory(), offset) }.check("vkBindBufferMemory")?;
        raw.label();
        Ok(Buffer { raw: Arc::new(raw), len, element: PhantomData })
    }

    /// A device buffer that holds `data`.
    pub fn from_slice(context: &Context, name: &str, data: &[T]) -> Result<Self, GpuError> {
        let buffer = Self::new(context, name, data.len(), Location::Device)?;
        buffer.upload(0, data)?;
        Ok(buffer)
    }

    /// A device buffer of zero bits.
    pub fn zeroed(context: &Context, name: &str, len: usize) -> Result<Self, GpuError> {
        let buffer = Self::new(context, name, len, Location::Device)?;
        let mut recorder = context.recorder("zero")?;
        recorder.fill(&buffer, 0);
        recorder.submit()?.wait()?;
        Ok(buffer)
    }

    /// Number of elements.
    pub fn len(&self) -> usize {
        self.len
    }

    /// True if it was made for 0 elements.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Its name, which debuggers show.
    pub fn name(&self) -> &str {
        &self.raw.name
    }

    /// The Vulkan buffer, which the recorder keeps alive until its work is done.
    pub fn raw(&self) -> &Arc<RawBuffer> {
        &self.raw
    }

    /// Copies `data` to the elements from `first` on, and waits. Not for loops.
    ///
    /// # Panics
    /// Never: elements beyond the buffer's end are the caller's error and are cut off.
    pub fn upload(&self, first: usize, data: &[T]) -> Result<(), GpuError> {
        let data = &data[..data.len().min(self.len.saturating_sub(first))];
        if data.is_empty() {
            return Ok(());
        }
        let context = &self.raw.context;
        // Staged through pieces of at most 64 MiB, so that a large upload does not double the memory.
        let piece = ((64 << 20) / size_of::<T>()).max(1);
        let staging = Buffer::<T>::new(context, "staging", data.len().min(piece), Location::Host)?;
        for (i, part) in data.chunks(piece).enumerate() {
            staging.write_mapped(part);
            let mut recorder = context.recorder("upload")?;
            recorder.copy(&staging, 0, self, first + i * piece, part.len());
            recorder.submit()?.wait()?;
        }
        Ok(())
    }

    /// Reads all elements back, and waits. Not for loops.
    pub fn download(&self) -> Result<Vec<T>, GpuError> {
        self.download_range(0, self.len)
    }

    /// Reads `count` elements from `first` on back, and waits. Not for loops.
    pub fn download_range(&self, first: usize, count: usize) -> Result<Vec<T>, GpuError> {
        let count = count.min(self.len.saturating_sub(first));
        let mut out = Vec::with_capacity(count);
        if count == 0 {
            return Ok(out);
        }
        let context = &self.raw.context;
        let piece = ((64 << 20) / size_of::<T>()).max(1);
        let staging = Buffer::<T>::new(context, "staging", count.min(piece), Location::Host)?;
        let mut at = 0;
        while at < count {
            let n = piece.min(count - at);
            let mut recorder = context.recorder("download")?;
            recorder.copy(self, first + at, &staging, 0, n);
            recorder.submit()?.wait()?;
            out.extend_from_slice(&staging.mapped()[..n]);
            at += n;
        }
        Ok(out)
    }

    /// The contents of a [`Location::Host`] buffer; empty for device memory. Read it only after waiting for
    /// the submission that wrote it.
    pub fn mapped(&self) -> &[T] {
        let bytes = self.raw.allocation.as_ref().and_then(|a| a.mapped_slice()).unwrap_or(&[]);
        let bytes = &bytes[..bytes.len().min(self.len * size_of::<T>())];
        bytemuck::try_cast_slice(bytes).unwrap_or(&[])
    }

    /// Writes the first elements of a [`Location::Host`] buffer; does nothing for device memory. No submission
    /// that uses the buffer may be in flight.
    pub fn write_mapped(&self, data: &[T]) {
        let Some(pointer) = self.raw.allocation.as_ref().and_then(|a| a.mapped_ptr()) else { return };
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let n = bytes.len().min(self.raw.bytes as usize);
        // SAFETY: the mapping covers `raw.bytes` bytes and lives as long as the allocation; `data` is host memory of
        // ours, so the two do not overlap. Host-coherent memory is what gpu-allocator gives for this location.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), pointer.as_ptr().cast::<u8>(), n) };
    }
}

/// The memory types that buffers can use: Vulkan guarantees the same ones for all buffers of one usage.
pub(super) fn types_of_buffers(device: &ash::Device) -> Result<u32, GpuError> {
    // SAFETY: a live device; the buffer is destroyed at once.
    unsafe {
        let buffer = device.create_buffer(&description(256), None).check("vkCreateBuffer")?;
        let types = device.get_buffer_memory_requirements(buffer).memory_type_bits;
        device.destroy_buffer(buffer, None);
        Ok(types)
    }
}

/// Makes a buffer without memory.
fn without_memory(context: &Context, bytes: u64) -> Result<vk::Buffer, GpuError> {
    // SAFETY: a live device and a structure that lives for the call.
    unsafe { context.0.device.create_buffer(&description(bytes), None) }.check("vkCreateBuffer")
}

fn description(bytes: u64) -> vk::BufferCreateInfo<'static> {
    vk::BufferCreateInfo::default().size(bytes).usage(
        vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::INDIRECT_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST,
    )
}

/// Allocates within the budget: if a new block would exceed it and the buffer alone would not, the buffer
/// gets its own memory.
///
/// # Safety
/// `handle` is a live buffer of the context's device without memory.
unsafe fn allocate(
    context: &Context,
    handle: vk::Buffer,
    name: &str,
    location: Location,
) -> Result<Allocation, GpuError> {
    // SAFETY: by the contract above.
    let requirements = unsafe { context.0.device.get_buffer_memory_requirements(handle) };
    let bytes = requirements.size;
    let failed = |source| GpuError::Allocation { name: name.into(), bytes, source };
    let internal = |what: &str| failed(gpu_allocator::AllocationError::Internal(what.into()));
    let most = context.memory().budget;
    let mut guard = context.0.allocator.lock().map_err(|_| internal("allocator poisoned"))?;
    let Some(allocator) = guard.as_mut() else { return Err(internal("the device is gone")) };
    let Budget { taken, blocks, .. } = &context.0.budget;
    let counts = context.0.budget.counts(location);
    let has_taken = || taken.load(Ordering::Relaxed);
    let fits = |more: u64| !counts || has_taken().saturating_add(more) <= most;
    let over = || GpuError::OverBudget { name: name.into(), bytes, used: has_taken(), budget: most };
    let here = 1 << location as u32;
    let made = blocks.load(Ordering::Relaxed);
    // The first block of a kind of memory stays once it is made, so it must not exceed the budget. A buffer
    // of another location may already have made one of the same kind.
    let first = made & here == 0 && !fits(BLOCK);
    if (bytes > BLOCK || first && made == 0) && !fits(bytes) {
        return Err(over());
    }
    let before = allocator.capacity();
    let count = |more: u64| if counts { taken.fetch_add(more, Ordering::Relaxed) } else { 0 };
    let mut description = AllocationCreateDesc {
        name,
        requirements,
        location: location.kind(),
        linear: true,
        allocation_scheme: AllocationScheme::GpuAllocatorManaged,
    };
    if !(first && fits(bytes)) {
        let allocation = allocator.allocate(&description).map_err(failed)?;
        let more = allocator.capacity().saturating_sub(before);
        if more == 0 || fits(more) {
            count(more);
            if bytes <= BLOCK {
                blocks.store(made | here, Ordering::Relaxed);
            }
            return Ok(allocation);
        }
        allocator.free(allocation).map_err(failed)?;
        // Counts any memory that stays all the same.
        count(allocator.capacity().saturating_sub(before));
        if !fits(bytes) {
            return Err(over());
        }
    }
    description.allocation_scheme = AllocationScheme::DedicatedBuffer(handle);
    let before = allocator.capacity();
    let allocation = allocator.allocate(&description).map_err(failed)?;
    count(allocator.capacity().saturating_sub(before));
    Ok(allocation)
}

impl Drop for RawBuffer {
    fn drop(&mut self) {
        // SAFETY: submissions hold an Arc of every buffer they use until they are waited for, so the device is done with it.
        unsafe { self.context.0.device.destroy_buffer(self.handle, None) };
        if let (Some(allocation), Ok(mut guard)) = (self.allocation.take(), self.context.0.allocator.lock())
            && let Some(allocator) = guard.as_mut()
        {
            let before = allocator.capacity();
            let _ = allocator.free(allocation);
            if self.counts {
                let less = before.saturating_sub(allocator.capacity());
                // A block made by a buffer that does not count may be freed with one that does, if both use
                // one kind of memory.
                let left = |taken: u64| Some(taken.saturating_sub(less));
                let _ = self.context.0.budget.taken.fetch_update(Ordering::Relaxed, Ordering::Relaxed, left);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A device's memory: heaps by size, and the flags and heap of each type.
    fn memory(heaps: &[u64], types: &[(vk::MemoryPropertyFlags, u32)]) -> vk::PhysicalDeviceMemoryProperties {
        let mut memory = vk::PhysicalDeviceMemoryProperties {
            memory_heap_count: heaps.len() as u32,
            memory_type_count: types.len() as u32,
            ..Default::default()
        };
        memory.memory_heaps.iter_mut().zip(heaps).for_each(|(heap, &size)| heap.size = size);
        for (to, &(property_flags, heap_index)) in memory.memory_types.iter_mut().zip(types) {
            *to = vk::MemoryType { property_flags, heap_index };
        }
        memory
    }

    #[test]
    fn what_is_staged_counts_where_it_lies_in_the_devices_heap() {
        use vk::MemoryPropertyFlags as F;
        let (local, host) = (F::DEVICE_LOCAL, F::HOST_VISIBLE | F::HOST_COHERENT);
        let cached = host | F::HOST_CACHED;
        let heaps = |memory: &vk::PhysicalDeviceMemoryProperties, types| {
            Location::ALL.map(|location| location.heap(memory, types))
        };
        // A graphics card with all of its memory visible to the host: staging still uses host memory.
        let card = memory(&[24 << 30, 32 << 30], &[(local, 0), (host, 1), (cached, 1), (local | host, 0)]);
        assert_eq!(heaps(&card, !0), [Some(0), Some(1)]);
        // A card with only a window visible.
        let window = memory(&[24 << 30, 32 << 30, 256 << 20], &[(host, 1), (local, 0), (cached, 1), (local | host, 2)]);
        assert_eq!(heaps(&window, !0), [Some(0), Some(1)]);
        // One memory for all, and a device whose host sees only device memory.
        assert_eq!(heaps(&memory(&[16 << 30], &[(local | cached, 0)]), !0), [Some(0); 2]);
        let only = memory(&[8 << 30, 8 << 30], &[(local, 1), (local | host, 1), (local, 0)]);
        assert_eq!(heaps(&only, !0), [Some(1); 2]);
        // Memory types that buffers cannot use are skipped.
        assert_eq!(heaps(&card, 0b1011), [Some(0), Some(1)]);
        assert_eq!(heaps(&card, 0b1001), [Some(0); 2]);
        assert_eq!(heaps(&card, 0b0110)[0], None);
    }

    /// No CPU device here has `VK_EXT_memory_budget`.
    #[test]
    fn others_memory_is_left_to_them() {
        // Alone: 10 of 10; others have 3; with 4 of our own in the process's usage.
        assert_eq!([budget(10, 0, 10, 0), budget(10, 0, 7, 0), budget(10, 4, 7, 4)], [10, 7, 7]);
        // The caller's own 2 count too; memory that others took meanwhile never gives more than the total.
        assert_eq!([budget(10, 4, 7, 6), budget(10, 4, 3, 6)], [5, 4]);
        assert_eq!((budget(5, 4, 10, 4), budget(u64::MAX, 4, u64::MAX, 0)), (5, u64::MAX));
    }
}
