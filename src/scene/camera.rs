//! A pinhole camera in OpenCV axes: x right, y down, z forward, pixel centres at +0.5.

use glam::{DMat3, DVec3};

/// Intrinsics in pixels, pose as world-to-camera: `x_camera = rotation · x_world + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Focal lengths, pixels.
    pub fx: f64,
    /// Focal length, pixels.
    pub fy: f64,
    /// Principal point, pixels from the image's upper left corner.
    pub cx: f64,
    /// Principal point, pixels.
    pub cy: f64,
    /// From world axes to camera axes.
    pub rotation: DMat3,
    /// The world's origin in camera axes, scene units.
    pub translation: DVec3,
}

impl Camera {
    /// The camera's centre in world space.
    pub fn eye(&self) -> DVec3 {
        -(self.rotation.transpose() * self.translation)
    }

    /// Width times height.
    pub fn pixels(&self) -> u32 {
        self.width * self.height
    }

    /// World point to pixel coordinates and camera z. No clipping.
    pub fn project(&self, world: DVec3) -> (f64, f64, f64) {
        let p = self.rotation * world + self.translation;
        (self.fx * p.x / p.z + self.cx, self.fy * p.y / p.z + self.cy, p.z)
    }

    /// Pixel coordinates and camera z to the world point.
    pub fn unproject(&self, x: f64, y: f64, z: f64) -> DVec3 {
        let p = DVec3::new((x - self.cx) / self.fx * z, (y - self.cy) / self.fy * z, z);
        self.rotation.transpose() * (p - self.translation)
    }

    /// The same camera in coordinates that count from `origin`.
    pub fn around(&self, origin: DVec3) -> Camera {
        Camera { translation: self.translation + self.rotation * origin, ..*self }
    }

    /// The camera of the same pose for an image of another size.
    pub fn resized(&self, width: u32, height: u32) -> Camera {
        let (sx, sy) = (width as f64 / self.width as f64, height as f64 / self.height as f64);
        Camera { width, height, fx: self.fx * sx, fy: self.fy * sy, cx: self.cx * sx, cy: self.cy * sy, ..*self }
    }
}
