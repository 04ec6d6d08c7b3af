//! A pinhole camera in OpenCV axes: x right, y down, z forward, pixel centres at +0.5.

use glam::{DMat3, DVec3};

/// Intrinsics in pixels, pose as world-to-camera: `x_camera = rotation · x_world + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Focal length in x, pixels.
    pub fx: f64,
    /// Focal length in y, pixels.
    pub fy: f64,
    /// Principal point in x, pixels from the image's left edge.
    pub cx: f64,
    /// Principal point in y, pixels from the image's upper edge.
    pub cy: f64,
    /// From world axes to camera axes.
    pub rotation: DMat3,
    /// The world's origin in camera axes, scene units.
    pub translation: DVec3,
}

impl Camera {
    /// A camera at the origin that looks along z, with square pixels and its principal point in the middle.
    pub const fn new(width: u32, height: u32, focal: f64) -> Camera {
        let (cx, cy) = (width as f64 / 2.0, height as f64 / 2.0);
        Camera { width, height, fx: focal, fy: focal, cx, cy, rotation: DMat3::IDENTITY, translation: DVec3::ZERO }
    }

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

    /// The camera in coordinates relative to `origin`.
    pub fn around(&self, origin: DVec3) -> Camera {
        Camera { translation: self.translation + self.rotation * origin, ..*self }
    }

    /// The camera of the same pose for an image of another size.
    pub fn resized(&self, width: u32, height: u32) -> Camera {
        let (sx, sy) = (width as f64 / self.width as f64, height as f64 / self.height as f64);
        Camera { width, height, fx: self.fx * sx, fy: self.fy * sy, cx: self.cx * sx, cy: self.cy * sy, ..*self }
    }

    /// The camera of the same pose for an image of another size, which contains all of this one's image in
    /// its middle, as large as it fits. Returns the same camera for the same size.
    pub fn fitted(&self, width: u32, height: u32) -> Camera {
        let scale = (f64::from(width) / f64::from(self.width)).min(f64::from(height) / f64::from(self.height));
        // Whole pixels, so that the inner image's edge lies on a pixel edge.
        let margin = |side: u32, own: u32| ((f64::from(side) - scale * f64::from(own)) / 2.0).round();
        Camera {
            width,
            height,
            fx: self.fx * scale,
            fy: self.fy * scale,
            cx: self.cx * scale + margin(width, self.width),
            cy: self.cy * scale + margin(height, self.height),
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;

    fn camera() -> Camera {
        let rotation = DMat3::from_rotation_y(0.3) * DMat3::from_rotation_x(-0.2);
        let translation = DVec3::new(0.5, -1.0, 2.0);
        Camera { width: 40, height: 20, fx: 50.0, fy: 45.0, cx: 19.0, cy: 11.0, rotation, translation }
    }

    #[test]
    fn a_camera_around_another_origin_sees_the_same() {
        let (camera, origin, point) = (camera(), DVec3::new(3.0, 5.0, -7.0), DVec3::new(0.2, 0.4, 5.0));
        let (a, b) = (camera.project(point), camera.around(origin).project(point - origin));
        assert!((a.0 - b.0).abs() + (a.1 - b.1).abs() + (a.2 - b.2).abs() < 1e-9, "{a:?} and {b:?}");
        let (x, y, z) = a;
        assert!(camera.unproject(x, y, z).distance(point) < 1e-9);
    }

    #[test]
    fn another_size_has_all_of_the_image_in_its_middle() {
        let camera = camera();
        assert_eq!(camera.fitted(40, 20), camera);
        // Twice as large, with (101 − 80)/2 pixels to the left, rounded away from 0, and none above.
        let large = camera.fitted(101, 40);
        let found = [large.fx, large.fy, large.cx, large.cy];
        assert_eq!((large.width, large.height, found), (101, 40, [100.0, 90.0, 49.0, 22.0]));
        assert_eq!((large.rotation, large.translation), (camera.rotation, camera.translation));
        // Half as large, limited by the width.
        let high = camera.fitted(20, 30);
        assert_eq!([high.fx, high.fy, high.cx, high.cy], [25.0, 22.5, 9.5, 15.5]);
        let resized = camera.resized(20, 60);
        let found = [resized.fx, resized.fy, resized.cx, resized.cy];
        assert_eq!((resized.width, resized.height, found), (20, 60, [25.0, 135.0, 9.5, 33.0]));
    }
}
