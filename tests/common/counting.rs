//! Wraps a device's functions with counters, like a layer: counts created and destroyed objects of each kind,
//! and records names and labels for debuggers.

use std::{
    ffi::{CStr, c_char, c_void},
    mem::transmute,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed},
    },
};

use ash::vk;

/// Functions that create and destroy each kind of handle.
const KINDS: [[&CStr; 2]; 9] = [
    [c"vkCreateBuffer", c"vkDestroyBuffer"],
    [c"vkAllocateMemory", c"vkFreeMemory"],
    [c"vkCreateDescriptorSetLayout", c"vkDestroyDescriptorSetLayout"],
    [c"vkCreatePipelineLayout", c"vkDestroyPipelineLayout"],
    [c"vkCreateShaderModule", c"vkDestroyShaderModule"],
    [c"vkCreateFence", c"vkDestroyFence"],
    [c"vkCreateCommandPool", c"vkDestroyCommandPool"],
    [c"vkCreateQueryPool", c"vkDestroyQueryPool"],
    [c"vkCreateComputePipelines", c"vkDestroyPipeline"],
];
const PIPELINES: usize = KINDS.len() - 1;
const ALLOCATIONS: usize = 1;

/// The original functions of each kind, and of debug utilities: from the driver or a layer.
static REAL: [[AtomicUsize; 2]; KINDS.len()] = [const { [const { AtomicUsize::new(0) }; 2] }; KINDS.len()];
static REAL_LABELS: [AtomicUsize; 3] = [const { AtomicUsize::new(0) }; 3];
static REAL_ADDRESSES: [AtomicUsize; 2] = [const { AtomicUsize::new(0) }; 2];
/// Numbers of created and destroyed objects.
static COUNTS: [[AtomicU64; 2]; KINDS.len()] = [const { [const { AtomicU64::new(0) }; 2] }; KINDS.len()];
static HEARD: Mutex<Vec<Told>> = Mutex::new(Vec::new());
/// Allocated memory handles and their sizes in bytes.
static MEMORY: Mutex<Vec<(u64, u64)>> = Mutex::new(Vec::new());

/// A call of debug utilities.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Told {
    Begin(String),
    End,
    /// Name of an object.
    Name(vk::ObjectType, String),
}

/// Totals since the program started: the creating function, created and destroyed objects.
pub fn counts() -> impl Iterator<Item = (&'static CStr, u64, u64)> {
    KINDS.iter().zip(&COUNTS).map(|([make, _], [made, gone])| (*make, made.load(Relaxed), gone.load(Relaxed)))
}

/// Calls of debug utilities since the program started.
#[allow(dead_code, reason = "not every test listens")]
pub fn heard() -> Vec<Told> {
    HEARD.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Bytes of device memory that are allocated now.
#[allow(dead_code, reason = "not every test looks at memory")]
pub fn memory() -> u64 {
    MEMORY.lock().unwrap_or_else(PoisonError::into_inner).iter().map(|(_, bytes)| bytes).sum()
}

/// Instance and device with counted functions. Only for one device at a time.
pub fn counted(entry: &ash::Entry, instance: &ash::Instance, device: &ash::Device) -> (ash::Instance, ash::Device) {
    REAL_ADDRESSES[0].store(entry.static_fn().get_instance_proc_addr as usize, Relaxed);
    REAL_ADDRESSES[1].store(instance.fp_v1_0().get_device_proc_addr as usize, Relaxed);
    unsafe {
        let instance = ash::Instance::load(&ash::StaticFn { get_instance_proc_addr }, instance.handle());
        let device = ash::Device::load(instance.fp_v1_0(), device.handle());
        (instance, device)
    }
}

type Function = unsafe extern "system" fn();

unsafe extern "system" fn get_instance_proc_addr(instance: vk::Instance, name: *const c_char) -> Option<Function> {
    unsafe {
        if CStr::from_ptr(name) == c"vkGetDeviceProcAddr" {
            return Some(transmute::<*const (), Function>(get_device_proc_addr as *const ()));
        }
        let real: vk::PFN_vkGetInstanceProcAddr = transmute(REAL_ADDRESSES[0].load(Relaxed));
        real(instance, name)
    }
}

unsafe extern "system" fn get_device_proc_addr(device: vk::Device, name: *const c_char) -> Option<Function> {
    unsafe {
        let real: vk::PFN_vkGetDeviceProcAddr = transmute(REAL_ADDRESSES[1].load(Relaxed));
        let found = real(device, name)?;
        let name = CStr::from_ptr(name);
        let instead = |kept: &AtomicUsize, ours: *const ()| {
            kept.store(found as usize, Relaxed);
            Some(transmute::<*const (), Function>(ours))
        };
        for (kind, names) in KINDS.iter().enumerate() {
            match names.iter().position(|n| *n == name) {
                Some(0) if kind == PIPELINES => return instead(&REAL[kind][0], make_pipelines as *const ()),
                Some(0) => return instead(&REAL[kind][0], MAKE[kind] as *const ()),
                Some(_) => return instead(&REAL[kind][1], DESTROY[kind] as *const ()),
                None => {}
            }
        }
        match name.to_bytes() {
            b"vkCmdBeginDebugUtilsLabelEXT" => instead(&REAL_LABELS[0], begin_label as *const ()),
            b"vkCmdEndDebugUtilsLabelEXT" => instead(&REAL_LABELS[1], end_label as *const ()),
            b"vkSetDebugUtilsObjectNameEXT" => instead(&REAL_LABELS[2], name_object as *const ()),
            _ => Some(found),
        }
    }
}

type Make = unsafe extern "system" fn(vk::Device, *const c_void, *const c_void, *mut u64) -> vk::Result;
type Destroy = unsafe extern "system" fn(vk::Device, u64, *const c_void);

const MAKE: [Make; PIPELINES] =
    [make::<0>, make::<1>, make::<2>, make::<3>, make::<4>, make::<5>, make::<6>, make::<7>];
const DESTROY: [Destroy; KINDS.len()] = [
    destroy::<0>,
    destroy::<1>,
    destroy::<2>,
    destroy::<3>,
    destroy::<4>,
    destroy::<5>,
    destroy::<6>,
    destroy::<7>,
    destroy::<8>,
];

unsafe extern "system" fn make<const KIND: usize>(
    device: vk::Device,
    info: *const c_void,
    callbacks: *const c_void,
    out: *mut u64,
) -> vk::Result {
    let real: Make = unsafe { transmute(REAL[KIND][0].load(Relaxed)) };
    let result = unsafe { real(device, info, callbacks, out) };
    COUNTS[KIND][0].fetch_add(u64::from(result == vk::Result::SUCCESS), Relaxed);
    if KIND == ALLOCATIONS && result == vk::Result::SUCCESS {
        let bytes = unsafe { (*info.cast::<vk::MemoryAllocateInfo<'_>>()).allocation_size };
        MEMORY.lock().unwrap_or_else(PoisonError::into_inner).push((unsafe { *out }, bytes));
    }
    result
}

unsafe extern "system" fn make_pipelines(
    device: vk::Device,
    cache: u64,
    count: u32,
    infos: *const c_void,
    callbacks: *const c_void,
    out: *mut u64,
) -> vk::Result {
    type Real = unsafe extern "system" fn(vk::Device, u64, u32, *const c_void, *const c_void, *mut u64) -> vk::Result;
    let real: Real = unsafe { transmute(REAL[PIPELINES][0].load(Relaxed)) };
    let result = unsafe { real(device, cache, count, infos, callbacks, out) };
    COUNTS[PIPELINES][0].fetch_add(if result == vk::Result::SUCCESS { count.into() } else { 0 }, Relaxed);
    result
}

unsafe extern "system" fn destroy<const KIND: usize>(device: vk::Device, handle: u64, callbacks: *const c_void) {
    let real: Destroy = unsafe { transmute(REAL[KIND][1].load(Relaxed)) };
    COUNTS[KIND][1].fetch_add(u64::from(handle != 0), Relaxed);
    if KIND == ALLOCATIONS {
        MEMORY.lock().unwrap_or_else(PoisonError::into_inner).retain(|(memory, _)| *memory != handle);
    }
    unsafe { real(device, handle, callbacks) };
}

fn hear(told: Told) {
    HEARD.lock().unwrap_or_else(PoisonError::into_inner).push(told);
}

unsafe fn text(text: *const c_char) -> String {
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

unsafe extern "system" fn begin_label(commands: vk::CommandBuffer, label: *const vk::DebugUtilsLabelEXT<'_>) {
    unsafe {
        hear(Told::Begin(text((*label).p_label_name)));
        let real: vk::PFN_vkCmdBeginDebugUtilsLabelEXT = transmute(REAL_LABELS[0].load(Relaxed));
        real(commands, label);
    }
}

unsafe extern "system" fn end_label(commands: vk::CommandBuffer) {
    hear(Told::End);
    unsafe {
        let real: vk::PFN_vkCmdEndDebugUtilsLabelEXT = transmute(REAL_LABELS[1].load(Relaxed));
        real(commands);
    }
}

unsafe extern "system" fn name_object(
    device: vk::Device,
    info: *const vk::DebugUtilsObjectNameInfoEXT<'_>,
) -> vk::Result {
    unsafe {
        hear(Told::Name((*info).object_type, text((*info).p_object_name)));
        let real: vk::PFN_vkSetDebugUtilsObjectNameEXT = transmute(REAL_LABELS[2].load(Relaxed));
        real(device, info)
    }
}
