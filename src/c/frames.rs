//! C functions for limits and frames.

use std::ffi::c_void;

use ash::vk::{self, Handle};

use super::{
    bytes, destroy, fill, glint_buffer, glint_context, glint_frame, glint_frames, glint_limits, glint_model,
    glint_physical, glint_report, glint_scene, glint_stage_time, guarded, list, null, of, put, put_held, size, sized,
    types::put_name,
};
use crate::{
    Error,
    pipelines::{
        frames::{Frame, FrameView, Frames, Instance, Limits},
        render::Needs,
    },
};

/// Limits for one view and one instance of a whole scene, before it is uploaded.
///
/// # Safety
/// Live handles, and a writable structure with its size set.
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

/// Limits for one view and one instance of a whole model.
///
/// # Safety
/// Live handles, and a writable structure with its size set.
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

/// Bytes of device memory that frames with these limits take, not counting their models; 0 if the limits are
/// invalid.
///
/// # Safety
/// Live handles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_bytes(physical: *const glint_physical, limits: *const glint_limits) -> u64 {
    // SAFETY: by the contract above.
    bytes(|| unsafe { Ok(sized(limits, "limits")?.limits()?.plan(&of(physical, "physical")?.0)?.bytes()) })
}

/// # Safety
/// The contract of [`Frames::record`]; the lists have the lengths given in the frame.
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
            // A fixed array, since recording must not allocate.
            let mut placed: [Option<Instance<'_>>; INSTANCES] = [None; INSTANCES];
            if instances.len() > INSTANCES {
                let count = instances.len();
                return Err(Error::Usage(format!("a frame of {count} instances, made for {INSTANCES} at most")));
            }
            for (to, from) in placed.iter_mut().zip(instances) {
                let from = sized(from, "an instance")?;
                *to = Some(from.instance(&of(from.model, "an instance's model")?.0)?);
            }
            // The first instance also fills the unused entries.
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

/// Maximum number of instances per frame in this interface.
const INSTANCES: usize = 64;

/// Number of views that memory is reserved for in advance.
const MOST_VIEWS: u32 = 4096;

/// # Safety
/// A live handle, and a writable structure with its size set; the slot's commands have run.
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

/// Number of intersections that fit; 0 if the handle is null.
///
/// # Safety
/// A live handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_capacity(frames: *const glint_frames) -> u32 {
    // SAFETY: by the contract above.
    unsafe { frames.as_ref() }.map_or(0, |f| f.frames.capacity())
}

/// Working buffer `index` of frames; returns 2 beyond the last.
///
/// # Safety
/// A live handle, and a writable structure with its size set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_buffer(frames: *const glint_frames, index: u32, out: *mut glint_buffer) -> i32 {
    // SAFETY: by the contract above.
    guarded(|| unsafe { put_held(&of(frames, "frames")?.frames.held(), index, out) })
}

/// # Safety
/// Null, or a live handle that is not used again. All its slots' commands have run.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn glint_frames_destroy(frames: *mut glint_frames) {
    // SAFETY: by the contract above.
    unsafe { destroy(frames) };
}
