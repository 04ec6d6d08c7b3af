//! Opens devices, one context each, and makes cameras of numpy's matrices.

use std::{ffi::OsString, process, sync::Mutex};

use glam::{DMat3, DVec3};
use glint::{cli::embed, gpu::Context, scene::Camera};

use crate::{Failure, bad, noted};

/// Device, context and the process that opened it.
static OPEN: Mutex<Vec<(Option<String>, Context, u32)>> = Mutex::new(Vec::new());

/// The context of a device. The first call opens and checks the device.
///
/// # Errors
/// The command line's, and one in a forked process, which lacks the driver's threads.
pub fn context(device: Option<&str>) -> Result<Context, Failure> {
    let mut open = OPEN.lock().unwrap_or_else(|error| error.into_inner());
    if open.iter().any(|(.., process)| *process != process::id()) {
        return Err(bad(
            "a forked process cannot use the device that its parent has opened: start processes by `spawn`",
        ));
    }
    if let Some((_, context, _)) = open.iter().find(|(name, ..)| name.as_deref() == device) {
        return Ok(context.clone());
    }
    let arguments: Vec<OsString> = device.iter().map(|name| format!("--device={name}").into()).collect();
    let (context, _) = noted(|listener| embed::device(&arguments, listener))?;
    open.push((device.map(str::to_owned), context.clone(), process::id()));
    Ok(context)
}

/// Beyond this side a pixel's coordinate has fewer than 8 fractional bits.
const MAX_SIDE: u32 = 1 << 15;

/// A pinhole camera from the rows of its matrices: 3 × 3 in pixels, and 4 × 4 from the world to the camera.
pub fn camera(width: u32, height: u32, k: &[f64], viewmat: &[f64]) -> Result<Camera, Failure> {
    let (&[fx, skew, cx, k10, fy, cy, k20, k21, k22], Ok(view)) = (k, <&[f64; 16]>::try_from(viewmat)) else {
        return Err(bad(format!(
            "a camera: K and viewmat have {} and {} numbers, expected 3 × 3 and 4 × 4",
            k.len(),
            viewmat.len()
        )));
    };
    if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
        return Err(bad(format!("a camera: an image of {width} × {height} pixels, expected sides of 1 to {MAX_SIDE}")));
    }
    if [skew, k10, k20, k21, k22 - 1.0] != [0.0; 5] || !(fx > 0.0 && fy > 0.0) {
        return Err(bad(format!("a camera: K is {k:?}, expected rows fx 0 cx, 0 fy cy and 0 0 1")));
    }
    if !view.iter().chain(k).all(|number| number.is_finite()) || view[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(bad(format!("a camera: viewmat is {view:?}, expected finite numbers and a last row of 0 0 0 1")));
    }
    let row = |i: usize| DVec3::new(view[4 * i], view[4 * i + 1], view[4 * i + 2]);
    let rotation = DMat3::from_cols(row(0), row(1), row(2)).transpose();
    let off = (rotation * rotation.transpose() - DMat3::IDENTITY).to_cols_array().map(f64::abs);
    if off.into_iter().fold(0.0, f64::max) > 1e-3 || rotation.determinant() < 0.0 {
        return Err(bad(format!("a camera: viewmat is {view:?}, expected a rotation in its first 3 rows and columns")));
    }
    Ok(Camera { width, height, fx, fy, cx, cy, rotation, translation: DVec3::new(view[3], view[7], view[11]) })
}
