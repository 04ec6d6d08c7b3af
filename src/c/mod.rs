//! The C interface: `glint.h`, function by function. A shared or static library of it comes from `tools/c-library`.
//!
//! Every function returns 0, or a code: 1 for what the machine could not do, 2 for what it was given. [`glint_last_error`] then says
//! what, for the thread that asked. No panic leaves a function. Handles are made and destroyed by functions of one name; a null handle
//! is refused, and destroying one does nothing. A structure that may grow begins with its size, by which one of another header is refused.

mod types;

use std::{
    cell::RefCell,
    ffi::{CStr, CString, c_char, c_void},
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    ptr, slice,
    sync::{Arc, OnceLock},
};

use ash::vk::{self, Handle};
use glam::DVec3;

pub use types::*;

use crate::{
    Error, Result,
    data::{Dropped, check_scene, parse_scene, read_scene, read_scene_leniently},
    gpu::{
        BorrowedDevice, Context, ContextOptions, Feature, FeatureChain, Kept, KernelInfo, Memory, QueueLock, Recorder,
    },
    pipelines::{
        frames::{Frame, FrameView, Frames, Instance, Limits},
        model::{Model, Room, Segment, Upload},
        plan::Held,
        render::Needs,
    },
    scene::{Scene, Supplement},
    stages::ALL,
};

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Runs `act`; what goes wrong is kept for [`glint_last_error`].
fn guarded(act: impl FnOnce() -> Result<()>) -> i32 {
    let (code, message) = match catch_unwind(AssertUnwindSafe(act)) {
        Ok(Ok(())) => return 0,
        Ok(Err(e)) => (i32::from(e.exit_code()), e.to_string()),
        Err(_) => (1, "a fault within glint: please report it".to_owned()),
    };
    say(message);
    code
}

/// Keeps a message for [`glint_last_error`].
fn say(message: String) {
    let text: Vec<u8> = message.into_bytes().into_iter().filter(|&byte| byte != 0).collect();
    LAST.with_borrow_mut(|last| *last = CString::new(text).unwrap_or_default());
}

fn null(what: &str) -> Error {
    Error::Usage(format!("{what} is null"))
}

/// # Safety
/// `handle` is null or a live handle of that kind.
unsafe fn of<'a, T>(handle: *const T, what: &str) -> Result<&'a T> {
    // SAFETY: by the contract above.
    unsafe { handle.as_ref() }.ok_or_else(|| null(what))
}

/// A structure that begins with its size.
///
/// # Safety
/// `from` is null or points to one of as many bytes as it says.
unsafe fn sized<'a, T>(from: *const T, what: &str) -> Result<&'a T> {
    // SAFETY: by the contract above the size is there, and with it the rest.
    unsafe {
        let got = *of(from.cast::<u32>(), what)? as usize;
        match got == size_of::<T>() {
            true => of(from, what),
            false => {
                let want = size_of::<T>();
                Err(Error::Usage(format!(
                    "the size of {what} is {got}, expected {want}: set it, and take this library's header"
                )))
            }
        }
    }
}

/// Fills such a structure.
///
/// # Safety
/// As for [`sized`], and writable.
unsafe fn fill<T>(to: *mut T, what: &str, value: T) -> Result<()> {
    // SAFETY: by the contract above.
    unsafe {
        sized(to.cast_const(), what)?;
        to.write(value);
    }
    Ok(())
}

/// `size` of a structure.
const fn size<T>() -> u32 {
    size_of::<T>() as u32
}

/// # Safety
/// `out` is null or writable.
unsafe fn put<T>(out: *mut *mut T, value: T) -> Result<()> {
    if out.is_null() {
        return Err(null("where the handle goes"));
    }
    // SAFETY: by the contract above.
    unsafe { *out = Box::into_raw(Box::new(value)) };
    Ok(())
}

/// # Safety
/// `handle` is null or came from [`put`], and is not used again.
unsafe fn destroy<T>(handle: *mut T) {
    if !handle.is_null() {
        // SAFETY: by the contract above.
        let owned = unsafe { Box::from_raw(handle) };
        let _ = catch_unwind(AssertUnwindSafe(|| drop(owned)));
    }
}

/// # Safety
/// `list` has `count` elements, or `count` is 0.
unsafe fn list<'a, T>(list: *const T, count: u32, what: &str) -> Result<&'a [T]> {
    match (count, list.is_null()) {
        (0, _) => Ok(&[]),
        (_, true) => Err(null(what)),
        // SAFETY: by the contract above.
        _ => Ok(unsafe { slice::from_raw_parts(list, count as usize) }),
    }
}

/// The version of the header: functions and structures of one number fit.
#[unsafe(no_mangle)]
pub extern "C" fn glint_version() -> u32 {
    GLINT_VERSION
}

/// What went wrong last in this thread, until the next function that fails.
#[unsafe(no_mangle)]
pub extern "C" fn glint_last_error() -> *const c_char {
    LAST.with_borrow(|last| last.as_ptr())
}

/// Name `index` of the device extensions that a device must be made with; null beyond the last.
#[unsafe(no_mangle)]
pub extern "C" fn glint_required_extension(index: u32) -> *const c_char {
    Context::requirements().extensions.get(index as usize).map_or(ptr::null(), |name| name.as_ptr())
}

/// Name `index` of the limits that a device must allow, as Vulkan has it, and how much; null beyond the last.
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

/// What a device must have beside extensions, features and limits.
///
/// # Safety
/// A writable structure that has its size.
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

/// Name `index` of the features that a device may be made with, and the extension that it comes with, or null; null beyond the last.
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

/// Name `index` of the features that a device must be made with; null beyond the last.
#[unsafe(no_mangle)]
pub extern "C" fn glint_required_feature(index: u32) -> *const c_char {
    static NAMES: OnceLock<Vec<CString>> = OnceLock::new();
    let names = NAMES.get_or_init(|| Context::requirements().features.iter().map(|f| feature_name(*f)).collect());
    names.get(index as usize).map_or(ptr::null(), |name| name.as_ptr())
}

fn feature_name(feature: Feature) -> CString {
    CString::new(feature.name()).unwrap_or_default()
}

/// Bit k is optional feature k.
fn optional(bits: u32) -> impl Iterator<Item = Feature> {
    let all = Context::requirements().optional.into_iter().enumerate();
    all.filter(move |(k, _)| bits >> k & 1 != 0).map(|(_, feature)| feature)
}

/// The features that a device must be made with, and of the optional ones those of these bits: a chain that begins with
/// VkPhysicalDeviceFeatures2, for VkDeviceCreateInfo::pNext. It is never freed.
#[unsafe(no_mangle)]
pub extern "C" fn glint_feature_chain(bits: u32) -> *const c_void {
    // Of a chain each structure points to the next, so it must not move; one is made for a device, so what leaks is little.
    let features = Context::requirements().features.into_iter().chain(optional(bits));
    let chain = Box::leak(Box::new(FeatureChain::new(features)));
    let first: &'static vk::PhysicalDeviceFeatures2<'static> = Box::leak(Box::new(chain.link()));
    ptr::from_ref(first).cast()
}

/// # Safety
/// A live instance and its loader.
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
/// A live instance and its loader, `wanted` null or a string, and writable places.
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

/// What a physical device is to glint, before a device is made of it.
///
/// # Safety
/// A live instance, its loader and a physical device of it; `out` is null or writable.
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
/// Null, or a handle that is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_physical_destroy(physical: *mut glint_physical) {
    // SAFETY: by the contract above.
    unsafe { destroy(physical) };
}

/// # Safety
/// As for [`Context::borrow`]; `device` and `out` point to what they say.
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

/// What is called with the queue's lock; the caller says that any thread may.
struct User(*mut c_void);

// SAFETY: the caller's functions are called from whatever thread submits, as the header says.
unsafe impl Send for User {}
// SAFETY: as above.
unsafe impl Sync for User {}

/// # Safety
/// Null, or a handle that is not used again. What was made from it keeps what it needs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_context_destroy(context: *mut glint_context) {
    // SAFETY: by the contract above.
    unsafe { destroy(context) };
}

/// # Safety
/// A live handle, and a writable structure that has its size.
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

/// Pipeline `index` of those that a context has made; 2 beyond the last.
///
/// # Safety
/// A live handle, and a writable structure that has its size.
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

/// # Safety
/// `path` is a string of UTF-8.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_scene_read(path: *const c_char, out: *mut *mut glint_scene) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        let path = unsafe { path_of(path) }?;
        // SAFETY: by the contract above.
        unsafe { put(out, glint_scene(read_scene(path)?)) }
    })
}

/// Reads what is sound; `dropped` becomes how many Gaussians were not, and [`glint_last_error`] says what was wrong with the first.
///
/// # Safety
/// `path` is a string of UTF-8, `dropped` null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_scene_read_lenient(
    path: *const c_char,
    out: *mut *mut glint_scene,
    dropped: *mut u32,
) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let (scene, Dropped { base, supplementary, first }) = read_scene_leniently(path_of(path)?)?;
            put(out, glint_scene(scene))?;
            if let Some(dropped) = dropped.as_mut() {
                *dropped = (base + supplementary) as u32;
            }
            if let Some(first) = first {
                say(first);
            }
        }
        Ok(())
    })
}

/// Copies a scene from arrays; `supplement` may be null.
///
/// # Safety
/// Structures that have their size, whose arrays are as long as they say, and a writable place.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_scene_from_arrays(
    base: *const glint_gaussians,
    supplement: *const glint_gaussians,
    out: *mut *mut glint_scene,
) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let base = sized(base, "base")?.gaussians()?;
            let supplement = match supplement.is_null() {
                true => None,
                false => {
                    let arrays = sized(supplement, "supplement")?;
                    Some(Supplement { gaussians: arrays.gaussians()?, lobes: arrays.lobes()? })
                }
            };
            let scene = Scene { base, supplement };
            check_scene(&scene)?;
            put(out, glint_scene(scene))
        }
    })
}

/// # Safety
/// `bytes` has `len` bytes; `name`, which errors name, is a string of UTF-8.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_scene_parse(
    bytes: *const u8,
    len: usize,
    name: *const c_char,
    out: *mut *mut glint_scene,
) -> i32 {
    guarded(|| {
        if bytes.is_null() {
            return Err(null("bytes"));
        }
        // SAFETY: by the contract above.
        unsafe { put(out, glint_scene(parse_scene(slice::from_raw_parts(bytes, len), path_of(name)?)?)) }
    })
}

/// # Safety
/// `path` is null or a string.
unsafe fn path_of<'a>(path: *const c_char) -> Result<&'a Path> {
    if path.is_null() {
        return Err(null("path"));
    }
    // SAFETY: by the contract above.
    let text = unsafe { CStr::from_ptr(path) }.to_str();
    text.map(Path::new).map_err(|e| Error::Usage(format!("a path is no UTF-8: {e}")))
}

/// # Safety
/// A live handle, and a writable structure that has its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_scene_info(scene: *const glint_scene, out: *mut glint_scene_counts) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        let Scene { base, supplement } = unsafe { &of(scene, "scene")?.0 };
        let counts = glint_scene_counts {
            size: size::<glint_scene_counts>(),
            base: base.len() as u32,
            supplement: supplement.as_ref().map_or(0, |s| s.gaussians.len() as u32),
            sh_degree: base.sh_degree,
        };
        // SAFETY: by the contract above.
        unsafe { fill(out, "counts", counts) }
    })
}

/// # Safety
/// Null, or a handle that is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_scene_destroy(scene: *mut glint_scene) {
    // SAFETY: by the contract above.
    unsafe { destroy(scene) };
}

fn room(half: u32) -> Room {
    Room { half: half != 0, ..Default::default() }
}

/// Device memory that a model of the scene will take, bytes; 0 where a handle is null.
///
/// # Safety
/// Live handles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_upload_bytes(
    physical: *const glint_physical,
    scene: *const glint_scene,
    half: u32,
) -> u64 {
    // SAFETY: by the contract above.
    bytes(|| unsafe { Ok(Model::plan(&of(physical, "physical")?.0, &of(scene, "scene")?.0, room(half)).bytes()) })
}

/// Host memory that the scene's upload will take until it is loaded, bytes; 0 where a handle is null.
///
/// # Safety
/// Live handles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_upload_staging_bytes(
    physical: *const glint_physical,
    scene: *const glint_scene,
    half: u32,
) -> u64 {
    // SAFETY: by the contract above.
    bytes(|| unsafe { Ok(Upload::plan(&of(physical, "physical")?.0, &of(scene, "scene")?.0, room(half)).bytes()) })
}

/// What `plan` says; 0 where it fails.
fn bytes(plan: impl FnOnce() -> Result<u64>) -> u64 {
    let mut bytes = 0;
    guarded(|| {
        bytes = plan()?;
        Ok(())
    });
    bytes
}

/// # Safety
/// Live handles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_upload_create(
    context: *const glint_context,
    scene: *const glint_scene,
    origin: *const f64,
    half: u32,
    out: *mut *mut glint_upload,
) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above; null is the world's origin.
        unsafe {
            let origin = if origin.is_null() { &[0.0; 3] } else { &*origin.cast::<[f64; 3]>() };
            let room = room(half);
            let (context, scene) = (&of(context, "context")?.0, &of(scene, "scene")?.0);
            let upload = Upload::prepare(context, DVec3::from_array(*origin), scene, room)?;
            put(out, glint_upload { upload, context: context.clone(), kept: Kept::default() })
        }
    })
}

/// # Safety
/// As for [`Recorder::borrow`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_upload_record(upload: *mut glint_upload, commands: *mut c_void) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let u = upload.as_mut().ok_or_else(|| null("upload"))?;
            if commands.is_null() {
                return Err(null("the command buffer"));
            }
            let commands = vk::CommandBuffer::from_raw(commands as u64);
            let mut recorder = Recorder::borrow(&u.context, commands, std::mem::take(&mut u.kept));
            u.upload.record(&mut recorder)?;
            u.kept = recorder.finish();
        }
        Ok(())
    })
}

/// # Safety
/// A live handle, which is gone after this unless it fails.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_upload_finish(upload: *mut glint_upload, out: *mut *mut glint_model) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            if !of(upload, "upload")?.upload.is_recorded() {
                return Err(Error::Usage("the upload was not recorded".into()));
            }
            if out.is_null() {
                return Err(null("where the model goes"));
            }
            put(out, glint_model(Box::from_raw(upload).upload.finish()?))
        }
    })
}

/// # Safety
/// Null, or a handle that is not used again. Its commands have run.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_upload_destroy(upload: *mut glint_upload) {
    // SAFETY: by the contract above.
    unsafe { destroy(upload) };
}

/// # Safety
/// Null, or a handle that is not used again. No frame in flight shows it but through slots that are recorded anew before they are gone.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_model_destroy(model: *mut glint_model) {
    // SAFETY: by the contract above.
    unsafe { destroy(model) };
}

/// # Safety
/// `out` is null or writable, and has its size.
unsafe fn put_held(held: &[Held], index: u32, out: *mut glint_buffer) -> Result<()> {
    let found = held.get(index as usize);
    let held = found.ok_or_else(|| Error::Usage(format!("there are {} buffers, not number {index}", held.len())))?;
    let mut name = [0; 32];
    put_name(&mut name, held.name);
    let (size, buffer, bytes) = (size::<glint_buffer>(), held.buffer.as_raw(), held.bytes);
    // SAFETY: by the contract above.
    unsafe { fill(out, "buffer", glint_buffer { size, reserved: 0, buffer, bytes, name }) }
}

/// Buffer `index` of a model; 2 beyond the last.
///
/// # Safety
/// A live handle, and a writable structure that has its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_model_buffer(model: *const glint_model, index: u32, out: *mut glint_buffer) -> i32 {
    // SAFETY: by the contract above.
    guarded(|| unsafe { put_held(&of(model, "model")?.0.held(), index, out) })
}

/// How many Gaussians a model has of each segment, and how many numbers it takes in a frame.
///
/// # Safety
/// A live handle, and a writable structure that has its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_model_info(model: *const glint_model, out: *mut glint_model_counts) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let model = &of(model, "model")?.0;
            let counts = glint_model_counts {
                size: size::<glint_model_counts>(),
                base: model.count_of(Segment::Base),
                supplement: model.count_of(Segment::Supplement),
                capacity: model.capacity(),
                sh_degree: model.sh_degree,
                half: model.is_half().into(),
            };
            fill(out, "counts", counts)
        }
    })
}

/// Limits for one view and one instance of all of a scene, before there is a model of it.
///
/// # Safety
/// Live handles, and a writable structure that has its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_limits_for(
    scene: *const glint_scene,
    half: u32,
    width: u32,
    height: u32,
    out: *mut glint_limits,
) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let needs = Needs::of_scene(&of(scene, "scene")?.0, half != 0);
            fill(out, "limits", glint_limits::from(&Limits::for_needs(needs, width, height)))
        }
    })
}

/// Limits for one view and one instance of all of a model.
///
/// # Safety
/// Live handles, and a writable structure that has its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_limits_of(
    model: *const glint_model,
    width: u32,
    height: u32,
    out: *mut glint_limits,
) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let limits = Limits::of(&of(model, "model")?.0, width, height);
            fill(out, "limits", glint_limits::from(&limits))
        }
    })
}

/// # Safety
/// Live handles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_create(
    context: *const glint_context,
    limits: *const glint_limits,
    out: *mut *mut glint_frames,
) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let limits = sized(limits, "limits")?.limits()?;
            let views = Vec::with_capacity(limits.views.min(MOST_VIEWS) as usize);
            let frames = Frames::new(&of(context, "context")?.0, limits)?;
            put(out, glint_frames { frames, views })
        }
    })
}

/// Device memory that frames of these limits take beside their models, bytes; 0 where the limits make no sense.
///
/// # Safety
/// Live handles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_bytes(physical: *const glint_physical, limits: *const glint_limits) -> u64 {
    // SAFETY: by the contract above.
    bytes(|| unsafe { Ok(sized(limits, "limits")?.limits()?.plan(&of(physical, "physical")?.0)?.bytes()) })
}

/// # Safety
/// As for [`Frames::record`]; the lists have the lengths that the frame says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_record(
    frames: *mut glint_frames,
    commands: *mut c_void,
    frame: *const glint_frame,
) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let glint_frames { frames, views } = frames.as_mut().ok_or_else(|| null("frames"))?;
            let f = sized(frame, "frame")?;
            let instances = list(f.instances, f.instance_count, "instances")?;
            views.clear();
            for view in list(f.views, f.view_count, "views")? {
                views.push(FrameView::try_from(sized(view, "a view")?)?);
            }
            // More than there is room for are refused below, as one too many.
            let mut placed: [Option<Instance<'_>>; INSTANCES] = [None; INSTANCES];
            if instances.len() > INSTANCES {
                let count = instances.len();
                return Err(Error::Usage(format!("a frame of {count} instances, made for {INSTANCES} at most")));
            }
            for (to, from) in placed.iter_mut().zip(instances) {
                let from = sized(from, "an instance")?;
                *to = Some(from.instance(&of(from.model, "an instance's model")?.0)?);
            }
            // The first fills what is left, as a list needs something there.
            let Some(first) = placed[0] else {
                let frame = Frame { slot: f.slot, instances: &[], views };
                return frames.record(vk::CommandBuffer::from_raw(commands as u64), &frame);
            };
            let filled = placed.map(|instance| instance.unwrap_or(first));
            let frame = Frame { slot: f.slot, instances: &filled[..instances.len()], views };
            frames.record(vk::CommandBuffer::from_raw(commands as u64), &frame)
        }
    })
}

/// Instances of a frame at most, through this interface.
const INSTANCES: usize = 64;

/// Views that memory is taken for in advance.
const MOST_VIEWS: u32 = 4096;

/// # Safety
/// A live handle, and a writable structure that has its size; the slot's commands have run.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_report(frames: *const glint_frames, slot: u32, out: *mut glint_report) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let report = of(frames, "frames")?.frames.report(slot)?;
            let value = glint_report {
                size: size::<glint_report>(),
                needed: report.needed.unwrap_or(0),
                visible: report.visible,
                intersections: report.intersections,
            };
            fill(out, "report", value)
        }
    })
}

/// # Safety
/// Live handles; `times` is null or has room for `*count`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_times(
    frames: *const glint_frames,
    slot: u32,
    times: *mut glint_stage_time,
    count: *mut u32,
) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let stages = of(frames, "frames")?.frames.times(slot)?;
            let count = count.as_mut().ok_or_else(|| null("count"))?;
            let room = if times.is_null() { 0 } else { *count as usize };
            *count = stages.len() as u32;
            for (i, stage) in stages.iter().take(room).enumerate() {
                let mut name = [0; 32];
                put_name(&mut name, stage.name);
                times.add(i).write(glint_stage_time { name, seconds: stage.time.as_secs_f64() });
            }
        }
        Ok(())
    })
}

/// # Safety
/// A live handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_reserve(frames: *mut glint_frames, intersections: u32) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe { frames.as_mut().ok_or_else(|| null("frames"))?.frames.reserve(intersections) }
    })
}

/// Intersections that fit; 0 where the handle is null.
///
/// # Safety
/// A live handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_capacity(frames: *const glint_frames) -> u32 {
    // SAFETY: by the contract above.
    unsafe { frames.as_ref() }.map_or(0, |f| f.frames.capacity())
}

/// Working buffer `index` of frames; 2 beyond the last.
///
/// # Safety
/// A live handle, and a writable structure that has its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_buffer(frames: *const glint_frames, index: u32, out: *mut glint_buffer) -> i32 {
    // SAFETY: by the contract above.
    guarded(|| unsafe { put_held(&of(frames, "frames")?.frames.held(), index, out) })
}

/// # Safety
/// Null, or a handle that is not used again. All its slots' commands have run.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_destroy(frames: *mut glint_frames) {
    // SAFETY: by the contract above.
    unsafe { destroy(frames) };
}

/// A kernel's, as the header has them.
struct Interface {
    bindings: Vec<glint_binding>,
    constants: Vec<glint_constant>,
    features: Vec<*const c_char>,
    /// What `features` points to.
    _names: Vec<CString>,
}

/// Of all kernels.
struct Interfaces(Vec<Interface>);

// SAFETY: the names in it are constants of the program, or lie in it and never change.
unsafe impl Send for Interfaces {}
// SAFETY: as above.
unsafe impl Sync for Interfaces {}

/// Kernel `index` of all: its SPIR-V and its interface, which live as long as the library. Returns 2 beyond the last.
///
/// # Safety
/// A writable structure that has its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_kernel(index: u32, out: *mut glint_kernel_info) -> i32 {
    static INTERFACES: OnceLock<Interfaces> = OnceLock::new();
    guarded(|| {
        let all = INTERFACES.get_or_init(|| {
            let of = |k: &KernelInfo| {
                let names: Vec<CString> = k.features.iter().map(|f| feature_name(*f)).collect();
                Interface {
                    bindings: k.bindings.iter().map(glint_binding::from).collect(),
                    constants: k.constants.iter().map(glint_constant::from).collect(),
                    features: names.iter().map(|name| name.as_ptr()).collect(),
                    _names: names,
                }
            };
            Interfaces(ALL.iter().map(of).collect())
        });
        let (Some(kernel), Some(Interface { bindings, constants, features, .. })) =
            (ALL.get(index as usize), all.0.get(index as usize))
        else {
            return Err(Error::Usage(format!("there are {} kernels, not number {index}", ALL.len())));
        };
        let info = glint_kernel_info {
            size: size::<glint_kernel_info>(),
            unit: kernel.unit as u32,
            name: kernel.label.as_ptr(),
            code: kernel.spirv.as_ptr().cast(),
            code_bytes: kernel.spirv.len(),
            bindings: bindings.as_ptr(),
            constants: constants.as_ptr(),
            binding_count: bindings.len() as u32,
            constant_count: constants.len() as u32,
            push_bytes: kernel.push_bytes,
            subgroups: kernel.subgroups.into(),
            features: features.as_ptr(),
            feature_count: features.len() as u32,
            barriers: kernel.barriers.into(),
        };
        // SAFETY: by the contract above.
        unsafe { fill(out, "kernel", info) }
    })
}
