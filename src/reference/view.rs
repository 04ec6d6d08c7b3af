//! The camera parameters given to the kernels.

use glam::{DMat3, DVec3, DVec4};

use super::NEAR;
use crate::scene::Camera;

/// World-to-camera [R|t] by rows, OpenCV axes, pixel centres at +0.5.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// First row of world to camera: the rotation's, and the translation.
    pub row_x: DVec4,
    /// Second row.
    pub row_y: DVec4,
    /// Third row: camera z.
    pub row_z: DVec4,
    /// Camera centre, world.
    pub eye: DVec3,
    /// Focal length in x, px.
    pub fx: f64,
    /// Focal length in y, px.
    pub fy: f64,
    /// Principal point, x, px.
    pub cx: f64,
    /// Principal point, y, px.
    pub cy: f64,
    /// Smallest and largest x/z of the Jacobian (3DGS): those of the image's sides, and 0.15 of the width
    /// beyond each. If the principal point is the image's middle, ±1.3 tan(fov/2).
    pub slope_x: [f64; 2],
    /// Likewise y/z, by the height.
    pub slope_y: [f64; 2],
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Camera z; Gaussians not beyond it are culled.
    pub near: f64,
}

/// Clamping range of x/z for an image with `side` pixels across.
fn slopes(side: f64, focal: f64, principal: f64) -> [f64; 2] {
    [(-0.15 * side - principal) / focal, (1.15 * side - principal) / focal]
}

impl View {
    /// The view in float64; [`View::rounded`] is the device's.
    pub fn from_camera(camera: &Camera) -> Self {
        let row = |i: usize| camera.rotation.row(i).extend(camera.translation[i]);
        View {
            row_x: row(0),
            row_y: row(1),
            row_z: row(2),
            eye: camera.eye(),
            fx: camera.fx,
            fy: camera.fy,
            cx: camera.cx,
            cy: camera.cy,
            slope_x: slopes(camera.width.into(), camera.fx, camera.cx),
            slope_y: slopes(camera.height.into(), camera.fy, camera.cy),
            width: camera.width,
            height: camera.height,
            near: NEAR,
        }
    }

    /// Every number rounded to float32: the kernel's view, so that a comparison measures the kernel's
    /// arithmetic and not the rounding of its input.
    pub fn rounded(&self) -> Self {
        let f = |x: f64| x as f32 as f64;
        let row = |r: DVec4| DVec4::new(f(r.x), f(r.y), f(r.z), f(r.w));
        View {
            row_x: row(self.row_x),
            row_y: row(self.row_y),
            row_z: row(self.row_z),
            eye: DVec3::new(f(self.eye.x), f(self.eye.y), f(self.eye.z)),
            fx: f(self.fx),
            fy: f(self.fy),
            cx: f(self.cx),
            cy: f(self.cy),
            slope_x: self.slope_x.map(f),
            slope_y: self.slope_y.map(f),
            near: f(self.near),
            ..*self
        }
    }

    /// Camera coordinates of a point: x to the right, y down, z ahead.
    pub fn to_camera(&self, world: DVec3) -> DVec3 {
        let p = world.extend(1.0);
        DVec3::new(self.row_x.dot(p), self.row_y.dot(p), self.row_z.dot(p))
    }

    /// R, world to camera.
    pub fn rotation(&self) -> DMat3 {
        DMat3::from_cols(self.row_x.truncate(), self.row_y.truncate(), self.row_z.truncate()).transpose()
    }
}
