//! The C interface: `glint.h`, function by function. A shared or static library of it comes from `tools/c-library`.
//!
//! Every function returns 0, or a code: 1 for what the machine could not do, 2 for what it was given. [`glint_last_error`] then says
//! what, for the thread that asked. No panic leaves a function. Handles are made and destroyed by functions of one name; a null handle
//! is refused, and destroying one does nothing.

mod types;

use std::{
    cell::RefCell,
    ffi::{CStr, CString, c_char, c_void},
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    ptr, slice,
    sync::Arc,
};

use ash::vk::{self, Handle};
use glam::DVec3;

pub use types::*;

use crate::{
    Error, Result,
    data::{parse_scene, read_scene},
    gpu::{BorrowedDevice, Context, FeatureChain, Kept, QueueLock, Recorder},
    pipelines::{
        frames::{Frame, FrameView, Frames, Instance},
        model::{Room, Upload},
    },
    scene::Scene,
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
    let text: Vec<u8> = message.into_bytes().into_iter().filter(|&byte| byte != 0).collect();
    LAST.with_borrow_mut(|last| *last = CString::new(text).unwrap_or_default());
    code
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

/// The features that a device must be made with: a chain that begins with VkPhysicalDeviceFeatures2, for VkDeviceCreateInfo::pNext. It
/// is never freed.
#[unsafe(no_mangle)]
pub extern "C" fn glint_required_features() -> *const c_void {
    // Of a chain each structure points to the next, so it must not move; one is made for a device, so what leaks is little.
    let chain = Box::leak(Box::new(FeatureChain::new(Context::requirements().features)));
    let first: &'static vk::PhysicalDeviceFeatures2<'static> = Box::leak(Box::new(chain.link()));
    ptr::from_ref(first).cast()
}

/// # Safety
/// As for [`Context::borrow`]; `device` and `out` point to what they say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_context_create(device: *const glint_device, out: *mut *mut glint_context) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        let d = unsafe { of(device, "device") }?;
        if d.size as usize != size_of::<glint_device>() {
            let (got, want) = (d.size, size_of::<glint_device>());
            return Err(Error::Usage(format!("glint_device::size is {got}, expected {want}: the header is another's")));
        }
        let Some(get) = d.get_instance_proc_addr else { return Err(null("get_instance_proc_addr")) };
        // SAFETY: by the contract above.
        unsafe {
            let entry = ash::Entry::from_static_fn(ash::StaticFn { get_instance_proc_addr: get });
            let instance = ash::Instance::load(entry.static_fn(), vk::Instance::from_raw(d.instance as u64));
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
                optional: Default::default(),
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
/// A live handle, and writable numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_scene_info(scene: *const glint_scene, out: *mut glint_scene_counts) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        let Scene { base, supplement } = unsafe { &of(scene, "scene")?.0 };
        let counts = glint_scene_counts {
            base: base.len() as u32,
            supplement: supplement.as_ref().map_or(0, |s| s.gaussians.len() as u32),
            sh_degree: base.sh_degree,
        };
        if out.is_null() {
            return Err(null("counts"));
        }
        // SAFETY: by the contract above.
        unsafe { *out = counts };
        Ok(())
    })
}

/// # Safety
/// Null, or a handle that is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_scene_destroy(scene: *mut glint_scene) {
    // SAFETY: by the contract above.
    unsafe { destroy(scene) };
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
            let room = Room { half: half != 0, ..Default::default() };
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
            let commands = vk::CommandBuffer::from_raw(commands as u64);
            let mut recorder = Recorder::borrow(&u.context, commands, std::mem::take(&mut u.kept));
            u.upload.record(&mut recorder);
            u.kept = recorder.finish();
        }
        Ok(())
    })
}

/// # Safety
/// A live handle, which is gone after this, also where it fails.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_upload_finish(upload: *mut glint_upload, out: *mut *mut glint_model) -> i32 {
    guarded(|| {
        if upload.is_null() {
            return Err(null("upload"));
        }
        // SAFETY: by the contract above.
        unsafe { put(out, glint_model(Box::from_raw(upload).upload.finish())) }
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

/// Limits for one view and one instance of all of a model.
///
/// # Safety
/// Live handles.
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
            let out = out.as_mut().ok_or_else(|| null("limits"))?;
            *out = glint_limits::of(&of(model, "model")?.0, width, height);
        }
        Ok(())
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
            let limits = of(limits, "limits")?.limits()?;
            let frames = Frames::new(&of(context, "context")?.0, limits)?;
            put(out, glint_frames { frames, views: Vec::new() })
        }
    })
}

/// Device memory that frames of these limits take beside their models, bytes; 0 where the limits make no sense.
///
/// # Safety
/// Live handles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_bytes(context: *const glint_context, limits: *const glint_limits) -> u64 {
    let mut bytes = 0;
    guarded(|| {
        // SAFETY: by the contract above.
        bytes = unsafe { of(limits, "limits")?.limits()?.plan(&of(context, "context")?.0).bytes() };
        Ok(())
    });
    bytes
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
            let f = of(frame, "frame")?;
            let instances = list(f.instances, f.instance_count, "instances")?;
            views.clear();
            for view in list(f.views, f.view_count, "views")? {
                views.push(FrameView::try_from(view)?);
            }
            // More than there is room for are refused below, as one too many.
            let mut placed: [Option<Instance<'_>>; INSTANCES] = [None; INSTANCES];
            if instances.len() > INSTANCES {
                let count = instances.len();
                return Err(Error::Usage(format!("a frame of {count} instances, made for {INSTANCES} at most")));
            }
            for (to, from) in placed.iter_mut().zip(instances) {
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

/// # Safety
/// Live handles; the slot's commands have run.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_report(frames: *const glint_frames, slot: u32, out: *mut glint_report) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let report = of(frames, "frames")?.frames.report(slot)?;
            let out = out.as_mut().ok_or_else(|| null("report"))?;
            *out = glint_report {
                needed: report.needed.unwrap_or(0),
                visible: report.visible,
                intersections: report.intersections,
            };
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

/// # Safety
/// Null, or a handle that is not used again. All its slots' commands have run.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_destroy(frames: *mut glint_frames) {
    // SAFETY: by the contract above.
    unsafe { destroy(frames) };
}

/// Kernel `index` of all: its name and SPIR-V, which live as long as the library. Returns 2 beyond the last.
///
/// # Safety
/// Writable pointers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_kernel(
    index: u32,
    name: *mut *const c_char,
    code: *mut *const u32,
    bytes: *mut usize,
) -> i32 {
    guarded(|| {
        let kernel = ALL.get(index as usize);
        let kernel = kernel.ok_or_else(|| Error::Usage(format!("there are {} kernels, not {index}", ALL.len())))?;
        if name.is_null() || code.is_null() || bytes.is_null() {
            return Err(null("where a kernel goes"));
        }
        // SAFETY: by the contract above.
        unsafe {
            *name = kernel.label.as_ptr();
            *code = kernel.spirv.as_ptr().cast();
            *bytes = kernel.spirv.len();
        }
        Ok(())
    })
}
