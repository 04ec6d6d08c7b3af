//! Cameras and their photographs on the device.

use glam::DVec3;

use super::photographs::{Photographs, Storage};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Context, Recorder},
    scene::Camera,
    stages::{
        constants::constants::NEAR,
        types::{Frame, View},
    },
};

/// 3DGS clamps the Jacobian's x/z and y/z at 1.3 tan(fov/2): this multiple of half the image, from the
/// image's middle.
pub(crate) const JACOBIAN_LIMIT: f64 = 1.3;

/// Views 0..V, uploaded once.
pub struct Views {
    /// The cameras in the kernels' format.
    pub views: Buffer<View>,
    /// Frame v is view v alone: its image starts at pixel 0 of the working image, its target at its
    /// photograph in the buffer of [`Views::record_photograph`].
    pub frames: Buffer<Frame>,
    /// Copy of `frames` on the host.
    pub frame_list: Vec<Frame>,
    photographs: Photographs,
    /// Cameras, in coordinates relative to `origin`.
    pub cameras: Vec<Camera>,
    /// Number of photographs, 0 if there are none: view v + k · `photos` is view v < `photos` with its sides
    /// halved k times.
    pub photos: u32,
    /// World position of the device's coordinate origin. Models must use the same one.
    pub origin: DVec3,
}

/// Distance from the world's origin, in spreads of the cameras, beyond which coordinates are relative to the
/// cameras' middle. Within it float32 keeps 24 − 4 bits of the spread: 1e-6, a thousandth of a pixel.
const FAR: f64 = 16.0;

/// Coordinate origin for the device: the world's origin, or the middle of the cameras for scenes far from it
/// (georeferenced ones). At 1e6 units float32 has steps of 0.06, too coarse for poses and for learning.
pub fn origin_for(cameras: &[Camera]) -> DVec3 {
    let eyes: Vec<DVec3> = cameras.iter().map(Camera::eye).filter(|eye| eye.is_finite()).collect();
    let middle = eyes.iter().sum::<DVec3>() / eyes.len().max(1) as f64;
    let spread = eyes.iter().map(|eye| eye.distance(middle)).fold(0.0, f64::max);
    origin_around(middle, spread)
}

/// [`origin_for`] for cameras within `spread` of `middle`.
pub fn origin_around(middle: DVec3, spread: f64) -> DVec3 {
    // guard: origin of a far scene; origin of a near scene
    if middle.length() > FAR * spread { middle } else { DVec3::ZERO }
}

/// Origin for the means of a scene seen by these cameras ([`Scene::origin`](crate::scene::Scene::origin)). It
/// is [`origin_for`], except that the world's origin is used as long as float32 keeps 16 bits of the spread
/// there: other programs know no other origin.
pub fn scene_origin_for(cameras: &[Camera]) -> DVec3 {
    let origin = origin_for(cameras);
    let spread =
        cameras.iter().map(|camera| camera.eye().distance(origin)).filter(|d| d.is_finite()).fold(0.0, f64::max);
    if origin.length() > 16.0 * FAR * spread { origin } else { DVec3::ZERO }
}

/// The camera of an image with sides halved `halvings` times, rounded, at least one pixel.
pub(super) fn halved(camera: &Camera, halvings: u32) -> Camera {
    let side = |pixels: u32| ((f64::from(pixels) / 2f64.powi(halvings as i32)).round() as u32).max(1);
    camera.resized(side(camera.width), side(camera.height))
}

impl Views {
    /// Uploads cameras and `photographs`: 8-bit RGB, row-major, one per camera and of its size, or none at
    /// all. Waits.
    pub fn upload(context: &Context, cameras: &[Camera], photographs: &[&[u8]]) -> Result<Self> {
        Self::upload_around(context, DVec3::ZERO, cameras, photographs)
    }

    /// [`Views::upload`] in coordinates relative to `origin` (world, float64), see [`origin_for`].
    pub fn upload_around(context: &Context, origin: DVec3, cameras: &[Camera], photographs: &[&[u8]]) -> Result<Self> {
        let views = Self::without_photographs(context, origin, cameras, !photographs.is_empty())?;
        for (v, rgb) in photographs.iter().enumerate() {
            views.upload_photograph(v, &pack(rgb))?;
        }
        Ok(views)
    }

    /// Makes room for photographs at several sizes, stored by [`Views::upload_photograph`]: those of
    /// `cameras`, then all of them with sides halved once, and so on, `halvings` times. With `background` they are transparent, and their
    /// colors lie over it.
    ///
    /// # Errors
    /// Those of [`Views::without_photographs`].
    pub fn halved(
        context: &Context,
        origin: DVec3,
        cameras: &[Camera],
        halvings: u32,
        storage: Storage,
        background: Option<[f32; 3]>,
    ) -> Result<Self> {
        let smaller = |halvings: u32| cameras.iter().map(move |camera| halved(camera, halvings));
        let all: Vec<Camera> = (0..=halvings).flat_map(smaller).collect();
        Ok(Views { photos: cameras.len() as u32, ..Self::make(context, origin, &all, Some(storage), background)? })
    }

    /// Maximum number of halvings of the photographs.
    pub fn halvings(&self) -> u32 {
        (self.cameras.len() as u32).checked_div(self.photos).map_or(0, |sizes| sizes - 1)
    }

    /// Uploads cameras, with optional room for photographs in device memory; [`Views::upload_photograph`] uploads
    /// these.
    ///
    /// # Errors
    /// [`GpuError::BufferTooLarge`](crate::gpu::GpuError::BufferTooLarge) if a single photograph exceeds the
    /// device's limit for one buffer.
    pub fn without_photographs(
        context: &Context,
        origin: DVec3,
        cameras: &[Camera],
        photographs: bool,
    ) -> Result<Self> {
        Self::make(context, origin, cameras, photographs.then_some(Storage::Device), None)
    }

    fn make(
        context: &Context,
        origin: DVec3,
        cameras: &[Camera],
        storage: Option<Storage>,
        background: Option<[f32; 3]>,
    ) -> Result<Self> {
        // guard: views around the origin
        let cameras: Vec<Camera> = cameras.iter().map(|camera| camera.around(origin)).collect();
        let photographs = Photographs::new(context, &cameras, storage, background)?;
        let frame = |(v, camera): (usize, &Camera)| Frame {
            image_first: 0,
            target_first: photographs.first(v),
            width: camera.width,
            height: camera.height,
        };
        let frames: Vec<Frame> = cameras.iter().enumerate().map(frame).collect();
        let list: Vec<View> = cameras.iter().map(|camera| view(camera, 0)).collect();
        Ok(Views {
            views: Buffer::from_slice(context, "views", &list)?,
            frames: Buffer::from_slice(context, "frames", &frames)?,
            photographs,
            frame_list: frames,
            photos: cameras.len() as u32,
            cameras,
            origin,
        })
    }

    /// Stores the photograph of view `v`, packed by [`pack`], with alpha 0 for masked pixels. Waits.
    pub fn upload_photograph(&self, v: usize, packed: &[u32]) -> Result<()> {
        self.photographs.write(v, packed)
    }

    /// Photographs of which no pixel is transparent are read where they lie, without compositing. Waits.
    pub fn drop_opacities(&mut self) -> Result<()> {
        if self.photographs.drop_opacities() {
            let firsts = self.frame_list.iter_mut().enumerate();
            firsts.for_each(|(v, frame)| frame.target_first = self.photographs.first(v));
            self.frames.upload(0, &self.frame_list)?;
        }
        Ok(())
    }

    /// Reads the photograph of view `v` back. Waits.
    pub fn download_photograph(&self, v: usize) -> Result<Vec<u32>> {
        self.photographs.read(v)
    }

    /// The buffer from which the next commands can read the photograph of view `v`; if it is transparent, over `background` (sRGB bytes) or
    /// else the data set's. Unless it lies in device memory as it is needed, records a copy, which replaces the photograph of the view before.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read.
    pub fn record_photograph(
        &self,
        recorder: &mut Recorder,
        v: u32,
        background: Option<[u8; 3]>,
    ) -> Result<&Buffer<u32>> {
        self.photographs.record(recorder, v as usize, background)
    }

    /// Whether the photographs are transparent, so that steps may choose a background.
    pub fn are_transparent(&self) -> bool {
        self.photographs.are_transparent()
    }

    /// Maximum number of views per submission: host memory for those in flight is limited.
    pub fn views_at_once(&self) -> u32 {
        self.photographs.views_at_once()
    }

    /// The page with the photograph of view `v`, for work on several views at once.
    ///
    /// # Errors
    /// [`Error::Usage`] unless photographs lie in device memory.
    pub fn targets(&self, v: usize) -> Result<&Buffer<u32>> {
        let error = || Error::Usage("work on several views at once needs photographs in device memory".into());
        self.photographs.on_device(v).ok_or_else(error)
    }

    /// Number of views from `v` on, itself included, whose photographs lie in the same page.
    pub fn same_page(&self, v: usize) -> usize {
        self.photographs.same_page(v)
    }

    /// Maximum number of pixels of a view.
    pub fn max_pixels(&self) -> u32 {
        self.cameras.iter().map(Camera::pixels).max().unwrap_or(0)
    }
}

/// Packs 8-bit RGB into the device's format: RGBA, R in the low byte, A 255.
pub fn pack(rgb: &[u8]) -> Vec<u32> {
    rgb.chunks_exact(3).map(|p| u32::from_le_bytes([p[0], p[1], p[2], 255])).collect()
}

/// Limits of the Jacobian's x/z for a side of `pixels`. They follow the picture's own sides, not its
/// principal point (gsplat, PR 305), so a Gaussian in a crop has the same shape as in the whole picture.
fn slopes(pixels: u32, focal: f64, principal: f64) -> [f32; 2] {
    let middle = (f64::from(pixels) / 2.0 - principal) / focal;
    let reach = JACOBIAN_LIMIT * f64::from(pixels) / (2.0 * focal);
    [(middle - reach) as f32, (middle + reach) as f32]
}

/// The kernels' format of a camera; `pixel_first` is the start of its pixels in buffers that pack all views.
pub fn view(camera: &Camera, pixel_first: u32) -> View {
    let (r, t, eye) = (camera.rotation, camera.translation, camera.eye());
    let row = |i: usize| [r.row(i).x, r.row(i).y, r.row(i).z, t[i]].map(|x| x as f32);
    let [low_x, high_x] = slopes(camera.width, camera.fx, camera.cx);
    let [low_y, high_y] = slopes(camera.height, camera.fy, camera.cy);
    View {
        row_x: row(0),
        row_y: row(1),
        row_z: row(2),
        eye: eye.as_vec3().to_array(),
        fx: camera.fx as f32,
        fy: camera.fy as f32,
        cx: camera.cx as f32,
        cy: camera.cy as f32,
        slope_low: [low_x, low_y],
        slope_high: [high_x, high_y],
        width: camera.width,
        height: camera.height,
        pixel_first,
        near: NEAR,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_cameras_are_counted_from_their_middle() {
        let at = |eye: DVec3| Camera { translation: -eye, ..Camera::new(8, 8, 9.0) };
        let middle = DVec3::new(6e5, -2e5, 40.0);
        let around = |middle: DVec3| [at(middle + DVec3::X), at(middle - DVec3::X), at(middle)];
        assert!(origin_for(&around(middle)).distance(middle) < 1e-6);
        assert_eq!(origin_for(&around(DVec3::new(9.0, 0.0, -9.0))), DVec3::ZERO);
        assert_eq!(origin_for(&[]), DVec3::ZERO);
        // Files keep world coordinates as long as float32 has enough bits.
        assert!(scene_origin_for(&around(middle)).distance(middle) < 1e-6);
        assert_eq!(scene_origin_for(&around(DVec3::new(0.0, 200.0, 0.0))), DVec3::ZERO);
        assert_eq!(origin_for(&around(DVec3::new(0.0, 200.0, 0.0))), DVec3::new(0.0, 200.0, 0.0));
        assert_eq!(scene_origin_for(&[]), DVec3::ZERO);
    }
}
