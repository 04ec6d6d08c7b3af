//! Cameras, and the photographs they took, on the device.

use glam::DVec3;

use crate::{
    gpu::{Buffer, Context, GpuError},
    scene::Camera,
    stages::types::{Frame, View},
};

/// 1.3 tan(fov/2) is where 3DGS clamps the Jacobian's x/z and y/z.
const JACOBIAN_LIMIT: f64 = 1.3;

/// Views 0..V, written once.
#[derive(Clone)]
pub struct Views {
    pub views: Buffer<View>,
    /// Frame v is view v alone: its image begins at pixel 0 of the working image, its target where its photograph does.
    pub frames: Buffer<Frame>,
    /// 8-bit RGBA of all photographs; one unused word where there are none.
    pub targets: Buffer<u32>,
    /// In coordinates that count from `origin`.
    pub cameras: Vec<Camera>,
    /// Where the device's coordinates begin, in the world. A model must be uploaded around the same.
    pub origin: DVec3,
}

/// Distance from the world's origin, in spreads of the cameras, beyond which coordinates are counted from their middle.
/// Below it float32 keeps 24 − 4 bits of the spread: 1e-6, a thousandth of a pixel.
const FAR: f64 = 16.0;

/// Where coordinates on the device should begin: the world's origin, or, for scenes far from it (georeferenced ones), the
/// middle of the cameras. At 1e6 units float32 has steps of 0.06, too coarse for poses and for learning.
pub fn origin_for(cameras: &[Camera]) -> DVec3 {
    let eyes: Vec<DVec3> = cameras.iter().map(Camera::eye).filter(|eye| eye.is_finite()).collect();
    let middle = eyes.iter().sum::<DVec3>() / eyes.len().max(1) as f64;
    let spread = eyes.iter().map(|eye| eye.distance(middle)).fold(0.0, f64::max);
    if middle.length() > FAR * spread { middle } else { DVec3::ZERO }
}

impl Views {
    /// `photographs` are 8-bit RGB, row-major, one for each camera and of its size, or none at all.
    pub fn upload(context: &Context, cameras: &[Camera], photographs: &[&[u8]]) -> Result<Self, GpuError> {
        Self::upload_around(context, DVec3::ZERO, cameras, photographs)
    }

    /// In coordinates that count from `origin` (world, float64), see [`origin_for`].
    pub fn upload_around(
        context: &Context,
        origin: DVec3,
        cameras: &[Camera],
        photographs: &[&[u8]],
    ) -> Result<Self, GpuError> {
        let cameras: Vec<Camera> = cameras.iter().map(|camera| camera.around(origin)).collect();
        let mut views = Vec::with_capacity(cameras.len());
        let mut frames = Vec::with_capacity(cameras.len());
        let mut first = 0;
        for camera in &cameras {
            views.push(view(camera, first));
            frames.push(Frame { image_first: 0, target_first: first, width: camera.width, height: camera.height });
            first += camera.pixels();
        }
        let mut targets = Vec::with_capacity(first as usize);
        for rgb in photographs {
            targets.extend(rgb.chunks_exact(3).map(|p| u32::from_le_bytes([p[0], p[1], p[2], 255])));
        }
        Ok(Views {
            views: Buffer::from_slice(context, "views", &views)?,
            frames: Buffer::from_slice(context, "frames", &frames)?,
            targets: Buffer::from_slice(context, "targets", &targets)?,
            cameras,
            origin,
        })
    }

    /// Largest number of pixels of a view.
    pub fn max_pixels(&self) -> u32 {
        self.cameras.iter().map(Camera::pixels).max().unwrap_or(0)
    }
}

/// The device's form of a camera whose pixels begin at `pixel_first` of buffers that pack all views.
pub fn view(camera: &Camera, pixel_first: u32) -> View {
    let (r, t, eye) = (camera.rotation, camera.translation, camera.eye());
    let row = |i: usize| [r.row(i).x, r.row(i).y, r.row(i).z, t[i]].map(|x| x as f32);
    View {
        row_x: row(0),
        row_y: row(1),
        row_z: row(2),
        eye: eye.as_vec3().to_array(),
        fx: camera.fx as f32,
        fy: camera.fy as f32,
        cx: camera.cx as f32,
        cy: camera.cy as f32,
        limit_x: (JACOBIAN_LIMIT * f64::from(camera.width) / (2.0 * camera.fx)) as f32,
        limit_y: (JACOBIAN_LIMIT * f64::from(camera.height) / (2.0 * camera.fy)) as f32,
        width: camera.width,
        height: camera.height,
        pixel_first,
    }
}
