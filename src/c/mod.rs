//! The C interface: the functions of `glint.h`. `tools/c-library` builds it as a shared and a static library.
//!
//! Every function returns 0, or an error code: 1 if the machine failed, 2 for invalid arguments.
//! [`glint_last_error`] then returns the message for the calling thread. No panic leaves a function.
//! Functions of one name make and destroy a handle; a null handle is refused, and destroying one does
//! nothing. An extensible structure starts with its size, so that one from another header version is refused.

mod device;
mod frames;
mod kernels;
mod scene;
mod types;

use std::{
    cell::RefCell,
    ffi::{CString, c_char},
    panic::{AssertUnwindSafe, catch_unwind},
    slice,
};

use ash::vk::Handle;

pub use device::*;
pub use frames::*;
pub use kernels::*;
pub use scene::*;
pub use types::*;

use crate::{Error, Result, pipelines::plan::Held};

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Runs `act`; stores an error for [`glint_last_error`].
fn guarded(act: impl FnOnce() -> Result<()>) -> i32 {
    let (code, message) = match catch_unwind(AssertUnwindSafe(act)) {
        Ok(Ok(())) => return 0,
        Ok(Err(e)) => (i32::from(e.exit_code()), e.to_string()),
        Err(_) => (1, "a fault within glint: please report it".to_owned()),
    };
    say(message);
    code
}

/// Stores a message for [`glint_last_error`].
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

/// Checks a structure that starts with its size.
///
/// # Safety
/// `from` is null or points to a structure of the size it states.
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

/// Fills a structure that starts with its size.
///
/// # Safety
/// The contract of [`sized`]; `to` is writable.
unsafe fn fill<T>(to: *mut T, what: &str, value: T) -> Result<()> {
    // SAFETY: by the contract above.
    unsafe {
        sized(to.cast_const(), what)?;
        to.write(value);
    }
    Ok(())
}

/// The value of a structure's `size`.
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

/// Version of the header; functions and structures of the same version match.
#[unsafe(no_mangle)]
pub extern "C" fn glint_version() -> u32 {
    GLINT_VERSION
}

/// The last error message of this thread, valid until the next function that fails.
#[unsafe(no_mangle)]
pub extern "C" fn glint_last_error() -> *const c_char {
    LAST.with_borrow(|last| last.as_ptr())
}

/// The bytes of a plan; 0 if it fails.
fn bytes(plan: impl FnOnce() -> Result<u64>) -> u64 {
    let mut bytes = 0;
    guarded(|| {
        bytes = plan()?;
        Ok(())
    });
    bytes
}

/// # Safety
/// `out` is null, or writable with its size set.
unsafe fn put_held(held: &[Held], index: u32, out: *mut glint_buffer) -> Result<()> {
    let found = held.get(index as usize);
    let held = found.ok_or_else(|| Error::Usage(format!("there are {} buffers, not number {index}", held.len())))?;
    let mut name = [0; 32];
    put_name(&mut name, held.name);
    let (size, buffer, bytes) = (size::<glint_buffer>(), held.buffer.as_raw(), held.bytes);
    // SAFETY: by the contract above.
    unsafe { fill(out, "buffer", glint_buffer { size, reserved: 0, buffer, bytes, name }) }
}
