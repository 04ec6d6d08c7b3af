//! C functions for scenes, uploads and models.

use std::{
    ffi::{CStr, c_char, c_void},
    path::Path,
    slice,
};

use ash::vk::{self, Handle};
use glam::DVec3;

use super::{
    bytes, destroy, fill, glint_buffer, glint_context, glint_gaussians, glint_model, glint_model_counts,
    glint_physical, glint_scene, glint_scene_counts, glint_upload, guarded, null, of, put, put_held, say, size, sized,
};
use crate::{
    Error, Result,
    data::{Dropped, check_scene, make_finite, parse_scene, read_scene, read_scene_leniently},
    gpu::{Kept, Recorder},
    pipelines::model::{Model, Room, Segment, Upload},
    scene::{Scene, Supplement},
};

/// # Safety
/// `path` is a UTF-8 string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_scene_read(path: *const c_char, out: *mut *mut glint_scene) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        let path = unsafe { path_of(path) }?;
        // SAFETY: by the contract above.
        unsafe { put(out, glint_scene(read_scene(path)?)) }
    })
}

/// Reads a scene without its invalid Gaussians. `dropped` receives their number, and `glint_last_error`
/// describes the first.
///
/// # Safety
/// `path` is a UTF-8 string; `dropped` is null or writable.
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
/// Structures with their size set and arrays of the stated length, and a writable output.
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
            let mut scene = Scene { base, supplement, ..Default::default() };
            make_finite(&mut scene);
            check_scene(&scene)?;
            put(out, glint_scene(scene))
        }
    })
}

/// # Safety
/// `bytes` has `len` bytes; `name`, used in errors, is a UTF-8 string.
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
/// A live handle, and a writable structure with its size set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_scene_info(scene: *const glint_scene, out: *mut glint_scene_counts) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        let Scene { base, supplement, .. } = unsafe { &of(scene, "scene")?.0 };
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
/// Null, or a live handle that is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_scene_destroy(scene: *mut glint_scene) {
    // SAFETY: by the contract above.
    unsafe { destroy(scene) };
}

fn room(half: u32) -> Room {
    Room { half: half != 0, ..Default::default() }
}

/// Bytes of device memory that a model of the scene will take; 0 if a handle is null.
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

/// Bytes of host memory that the scene's upload will take until it is loaded; 0 if a handle is null.
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
        // SAFETY: by the contract above; null is the scene's origin.
        unsafe {
            let room = room(half);
            let (context, scene) = (&of(context, "context")?.0, &of(scene, "scene")?.0);
            let origin = origin.cast::<[f64; 3]>().as_ref().map_or(scene.origin, |&origin| DVec3::from_array(origin));
            let upload = Upload::prepare(context, origin, scene, room)?;
            put(out, glint_upload { upload, context: context.clone(), kept: Kept::default() })
        }
    })
}

/// # Safety
/// The contract of [`Recorder::borrow`].
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
/// A live handle; it is consumed unless the function fails.
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
/// Null, or a live handle that is not used again. Its commands have run.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_upload_destroy(upload: *mut glint_upload) {
    // SAFETY: by the contract above.
    unsafe { destroy(upload) };
}

/// # Safety
/// Null, or a live handle that is not used again. Frames in flight may still show it, if their slots are
/// recorded again before being destroyed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_model_destroy(model: *mut glint_model) {
    // SAFETY: by the contract above.
    unsafe { destroy(model) };
}

/// Buffer `index` of a model; returns 2 beyond the last.
///
/// # Safety
/// A live handle, and a writable structure with its size set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_model_buffer(model: *const glint_model, index: u32, out: *mut glint_buffer) -> i32 {
    // SAFETY: by the contract above.
    guarded(|| unsafe { put_held(&of(model, "model")?.0.held(), index, out) })
}

/// Numbers of Gaussians in each segment of a model, and the range of ids that it takes in a frame.
///
/// # Safety
/// A live handle, and a writable structure with its size set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_model_info(model: *const glint_model, out: *mut glint_model_counts) -> i32 {
    guarded(|| {
        // SAFETY: by the contract above.
        unsafe {
            let model = &of(model, "model")?.0;
            let counts = glint_model_counts {
                size: size::<glint_model_counts>(),
                base: model.base_count(),
                supplement: model.count_of(Segment::Supplement),
                capacity: model.capacity(),
                sh_degree: model.sh_degree,
                half: model.is_half().into(),
            };
            fill(out, "counts", counts)
        }
    })
}
