//! C function that returns the kernels: SPIR-V and interfaces.

use std::{
    ffi::{CString, c_char},
    sync::OnceLock,
};

use super::{device::feature_name, fill, glint_binding, glint_constant, glint_kernel_info, guarded, size};
use crate::{Error, gpu::KernelInfo, stages::ALL};

/// A kernel's interface in the header's types.
struct Interface {
    bindings: Vec<glint_binding>,
    constants: Vec<glint_constant>,
    features: Vec<*const c_char>,
    /// Owns the strings that `features` points to.
    _names: Vec<CString>,
}

/// The interfaces of all kernels.
struct Interfaces(Vec<Interface>);

// SAFETY: the names in it are constants of the program, or lie in it and never change.
unsafe impl Send for Interfaces {}

// SAFETY: as above.
unsafe impl Sync for Interfaces {}

/// Kernel `index`: its SPIR-V and its interface, which live as long as the library. Returns 2 beyond the
/// last.
///
/// # Safety
/// `out` is a writable structure with its size set.
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
