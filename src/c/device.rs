//! C functions for requirements, devices and contexts.

use std::{
    ffi::{CStr, CString, c_char, c_void},
    ptr,
    sync::{Arc, OnceLock},
};

use ash::vk::{self, Handle};

use super::{
    destroy, fill, glint_context, glint_device, glint_memory, glint_physical, glint_pipeline, glint_requirements,
    guarded, null, of, put, size, sized,
};
use crate::{
    Error, Result,
    gpu::{BorrowedDevice, Context, ContextOptions, Feature, FeatureChain, Memory, QueueLock},
};

/// Name `index` of the required device extensions; null beyond the last.
#[unsafe(no_mangle)]
pub extern "C" fn glint_required_extension(index: u32) -> *const c_char {
    Context::requirements().extensions.get(index as usize).map_or(ptr::null(), |name| name.as_ptr())
}

/// Vulkan's name of required limit `index`, and its least value; null beyond the last.
///
/// # Safety
/// `least` is null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_required_limit(index: u32, least: *mut u32) -> *const c_char {
    static NAMES: OnceLock<Vec<CString>> = OnceLock::new();
    let limits = Context::requirements().limits;
    let names = NAMES.get_or_init(|| limits.iter().map(|l| CString::new(l.name).unwrap_or_default()).collect());
    let (Some(limit), Some(name)) = (limits.get(index as usize), names.get(index as usize)) else { return ptr::null() };
    // SAFETY: by the contract above.
    if let Some(least) = unsafe { least.as_mut() } {
        *least = limit.least;
    }
    name.as_ptr()
}

/// Required API version and subgroup properties of a device.
///
/// # Safety
/// `out` is a writable structure with its size set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_required(out: *mut glint_requirements) -> i32 {
    guarded(|| {
        let needed = Context::requirements();
        let [least_lanes, most_lanes] = needed.subgroup_lanes;
        let (api_version, subgroup_operations) = (needed.api_version, needed.subgroup_operations.as_raw());
        let size = size::<glint_requirements>();
        let value = glint_requirements { size, api_version, subgroup_operations, least_lanes, most_lanes };
        // SAFETY: by the contract above.
        unsafe { fill(out, "requirements", value) }
    })
}

/// Name `index` of the optional features, and the extension to enable with it, or null; null beyond the last.
///
/// # Safety
/// `extension` is null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_optional_feature(index: u32, extension: *mut *const c_char) -> *const c_char {
    static NAMES: OnceLock<Vec<CString>> = OnceLock::new();
    let optional = Context::requirements().optional;
    let names = NAMES.get_or_init(|| optional.iter().map(|f| feature_name(*f)).collect());
    let (Some(feature), Some(name)) = (optional.get(index as usize), names.get(index as usize)) else {
        return ptr::null();
    };
    // SAFETY: by the contract above.
    if let Some(extension) = unsafe { extension.as_mut() } {
        *extension = feature.extension().map_or(ptr::null(), CStr::as_ptr);
    }
    name.as_ptr()
}

/// Name `index` of the required features; null beyond the last.
#[unsafe(no_mangle)]
pub extern "C" fn glint_required_feature(index: u32) -> *const c_char {
    static NAMES: OnceLock<Vec<CString>> = OnceLock::new();
    let names = NAMES.get_or_init(|| Context::requirements().features.iter().map(|f| feature_name(*f)).collect());
    names.get(index as usize).map_or(ptr::null(), |name| name.as_ptr())
}

pub(super) fn feature_name(feature: Feature) -> CString {
    CString::new(feature.name()).unwrap_or_default()
}

/// The optional features whose bits are set: bit k is optional feature k.
fn optional(bits: u32) -> impl Iterator<Item = Feature> {
    let all = Context::requirements().optional.into_iter().enumerate();
    all.filter(move |(k, _)| bits >> k & 1 != 0).map(|(_, feature)| feature)
}

/// The required features and the optional ones of these bits: a chain that starts with
/// VkPhysicalDeviceFeatures2, for VkDeviceCreateInfo::pNext. It is never freed.
#[unsafe(no_mangle)]
pub extern "C" fn glint_feature_chain(bits: u32) -> *const c_void {
    // Structures of a chain point to each other and must not move. Leaking is acceptable, as there is one
    // chain per device.
    let features = Context::requirements().features.into_iter().chain(optional(bits));
    let chain = Box::leak(Box::new(FeatureChain::new(features)));
    let first: &'static vk::PhysicalDeviceFeatures2<'static> = Box::leak(Box::new(chain.link()));
    ptr::from_ref(first).cast()
}

/// # Safety
/// A live instance, and its loader.
unsafe fn instance_of(
    get_instance_proc_addr: Option<vk::PFN_vkGetInstanceProcAddr>,
    instance: *mut c_void,
) -> Result<(ash::Entry, ash::Instance)> {
    let Some(get_instance_proc_addr) = get_instance_proc_addr else { return Err(null("get_instance_proc_addr")) };
    if instance.is_null() {
        return Err(null("instance"));
    }
    // SAFETY: by the contract above.
    unsafe {
        let entry = ash::Entry::from_static_fn(ash::StaticFn { get_instance_proc_addr });
        let instance = ash::Instance::load(entry.static_fn(), vk::Instance::from_raw(instance as u64));
        Ok((entry, instance))
    }
}

/// # Safety
/// A live instance, and its loader; `wanted` is null or a string; the outputs are writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_device_choose(
    get_instance_proc_addr: Option<vk::PFN_vkGetInstanceProcAddr>,
    instance: *mut c_void,
    wanted: *const c_char,
    physical: *mut *mut c_void,
    bits: *mut u32,
) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let (entry, instance) = instance_of(get_instance_proc_addr, instance)?;
            let device = match wanted.is_null() {
                true => None,
                false => Some(CStr::from_ptr(wanted).to_string_lossy().into_owned()),
            };
            let (found, offered) =
                Context::choose(&entry, &instance, &ContextOptions { device, ..Default::default() })?;
            let (Some(physical), Some(bits)) = (physical.as_mut(), bits.as_mut()) else {
                return Err(null("where the device goes"));
            };
            let all = Context::requirements().optional.into_iter().enumerate();
            *bits = all.filter(|(_, feature)| offered.contains(feature)).map(|(k, _)| 1 << k).sum();
            *physical = found.as_raw() as *mut c_void;
        }
        Ok(())
    })
}

/// Describes a physical device for plans of memory, before a device is made.
///
/// # Safety
/// A live instance, its loader, and one of its physical devices; `out` is null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_describe(
    get_instance_proc_addr: Option<vk::PFN_vkGetInstanceProcAddr>,
    instance: *mut c_void,
    physical: *mut c_void,
    out: *mut *mut glint_physical,
) -> i32 {
    guarded(|| {
        if physical.is_null() {
            return Err(null("physical_device"));
        }
        // SAFETY: by the contract above.
        unsafe {
            let (entry, instance) = instance_of(get_instance_proc_addr, instance)?;
            let info = Context::describe(&entry, &instance, vk::PhysicalDevice::from_raw(physical as u64))?;
            put(out, glint_physical(info))
        }
    })
}

/// # Safety
/// Null, or a live handle that is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_physical_destroy(physical: *mut glint_physical) {
    // SAFETY: by the contract above.
    unsafe { destroy(physical) };
}

/// # Safety
/// The contract of [`Context::borrow`]; `device` and `out` point to valid structures.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_context_create(device: *const glint_device, out: *mut *mut glint_context) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        let d = unsafe { sized(device, "device") }?;
        for (what, handle) in [("physical_device", d.physical_device), ("device", d.device), ("queue", d.queue)] {
            if handle.is_null() {
                return Err(null(what));
            }
        }
        // SAFETY: by the contract above.
        unsafe {
            let (entry, instance) = instance_of(d.get_instance_proc_addr, d.instance)?;
            let device = ash::Device::load(instance.fp_v1_0(), vk::Device::from_raw(d.device as u64));
            let user = User(d.user);
            let queue_lock = match (d.lock_queue, d.unlock_queue) {
                (Some(lock), Some(unlock)) => Some(QueueLock(Arc::new(move |act: &mut dyn FnMut()| {
                    let user = &user;
                    lock(user.0);
                    act();
                    unlock(user.0);
                }))),
                _ => None,
            };
            let borrowed = BorrowedDevice {
                entry,
                physical_device: vk::PhysicalDevice::from_raw(d.physical_device as u64),
                queue_family: d.queue_family,
                queue: vk::Queue::from_raw(d.queue as u64),
                optional: optional(d.optional).collect(),
                pipeline_cache: vk::PipelineCache::from_raw(d.pipeline_cache),
                queue_lock,
                labels: d.labels != 0,
                memory_budget: (d.memory_budget > 0).then_some(d.memory_budget),
                instance,
                device,
            };
            put(out, glint_context(Context::borrow(borrowed)?))
        }
    })
}

/// Argument of the queue's lock functions; the caller promises that any thread may call these.
struct User(*mut c_void);

// SAFETY: the caller's functions are called from whatever thread submits, as the header says.
unsafe impl Send for User {}

// SAFETY: as above.
unsafe impl Sync for User {}

/// # Safety
/// Null, or a live handle that is not used again. Objects made from it keep the parts they need.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_context_destroy(context: *mut glint_context) {
    // SAFETY: by the contract above.
    unsafe { destroy(context) };
}

/// # Safety
/// A live handle, and a writable structure with its size set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_context_memory(context: *const glint_context, out: *mut glint_memory) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let Memory { used, budget, taken, .. } = of(context, "context")?.0.memory();
            let size = size::<glint_memory>();
            fill(out, "memory", glint_memory { size, reserved: 0, used, budget, taken })
        }
    })
}

/// Pipeline `index` among those that a context has made; returns 2 beyond the last.
///
/// # Safety
/// A live handle, and a writable structure with its size set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_context_pipeline(
    context: *const glint_context,
    index: u32,
    out: *mut glint_pipeline,
) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        let made = unsafe { of(context, "context")?.0.pipelines() };
        let Some(pipeline) = made.get(index as usize) else {
            return Err(Error::Usage(format!("there are {} pipelines, not number {index}", made.len())));
        };
        // SAFETY: by the contract above.
        unsafe { fill(out, "pipeline", pipeline.into()) }
    })
}
