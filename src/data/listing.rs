//! A dataset as its files list it, before any photo is looked up: what the readers of COLMAP and transforms.json return.

use std::path::PathBuf;

use glam::{DMat3, DVec3};

use super::lens::{Distortion, Frame};
use super::photo::Split;
use super::points::PointCloud;

/// A photo as listed in a dataset's files.
pub(super) struct Entry {
    /// Listing name, with `/` between folders.
    pub(super) name: String,
    /// `None` if there is no such file.
    pub(super) path: Option<PathBuf>,
    /// Expected path, for errors.
    pub(super) expected: PathBuf,
    /// Whether the file's case, ending or folder differs from the name.
    pub(super) respelled: bool,
    pub(super) mask: Option<PathBuf>,
    /// The file that lists it, for errors.
    pub(super) listed_in: PathBuf,
    pub(super) camera: SourceCamera,
    /// World to camera, OpenCV axes.
    pub(super) rotation: DMat3,
    pub(super) translation: DVec3,
    /// Reason why it has no pose or no intrinsics.
    pub(super) lost: Option<String>,
    pub(super) split: Option<Split>,
}

/// Returns a note if there is a folder of masks and no entry has one.
pub(super) fn unused_masks(there: bool, entries: &[Entry]) -> Option<String> {
    let unused = there && entries.iter().all(|entry| entry.mask.is_none());
    let name =
        entries.first().map(|entry| entry.name.strip_prefix("images/").unwrap_or(&entry.name)).filter(|_| unused);
    name.map(|name| {
        format!(
            "there is a folder of masks, but no file in it is named after a photo; expected `{name}` or `{name}.png`"
        )
    })
}

/// The contents of a dataset's files, before any photo is looked up.
pub(super) struct Listing {
    pub(super) entries: Vec<Entry>,
    pub(super) points: Option<PointCloud>,
    /// The files that were read.
    pub(super) sources: Vec<PathBuf>,
    pub(super) notes: Vec<String>,
}

/// A focal length in pixels, or as fields of view in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Focal {
    Pixels([f64; 2]),
    Angles {
        x: f64,
        y: Option<f64>,
    },
    /// The image is the whole sphere: its size determines the focal length.
    Sphere,
}

/// Intrinsics as given in a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SourceCamera {
    /// Image size that they refer to; if missing, the file's own.
    pub(super) size: Option<[f64; 2]>,
    pub(super) focal: Focal,
    /// Principal point; if missing, the middle.
    pub(super) center: Option<[f64; 2]>,
    pub(super) distortion: Distortion,
}

impl SourceCamera {
    /// Checks the numbers, before any image is known.
    pub(super) fn check(&self) -> Result<(), String> {
        // guard: focal lengths
        let positive = |v: &f64| v.is_finite() && *v > 0.0;
        let angle = |v: &f64| *v > 0.0 && *v < std::f64::consts::PI;
        if let Some(size) = self.size.filter(|size| !size.iter().all(positive)) {
            return Err(format!("the image size {size:?} is not valid"));
        }
        match self.focal {
            Focal::Pixels(focal) if !focal.iter().all(positive) => {
                return Err(format!("the focal lengths {focal:?} are not positive numbers"));
            }
            Focal::Angles { x, y } if ![Some(x), y].iter().flatten().all(angle) => {
                let y = y.map(|y| format!(" and {y}")).unwrap_or_default();
                return Err(format!("the field of view {x}{y} is not between 0 and π"));
            }
            _ => {}
        }
        // guard: principal points
        if let Some(center) = self.center.filter(|center| !center.iter().all(|v| v.is_finite())) {
            return Err(format!("the principal point {center:?} is not finite"));
        }
        if !self.distortion.is_finite() {
            return Err(format!("the distortion {:?} is not finite", self.distortion));
        }
        match self.distortion {
            Distortion::Unified { alpha, beta } if !((0.0..=1.0).contains(&alpha) && beta > 0.0) => {
                Err(format!("EUCM's alpha {alpha} and beta {beta} are not in 0 to 1 and above 0"))
            }
            _ => Ok(()),
        }
    }

    /// Whether the principal point fits better to an image with both sides swapped; only if no size is given.
    pub(super) fn seems_turned(&self, size: [u32; 2]) -> bool {
        let (None, Some([cx, cy])) = (self.size, self.center) else { return false };
        let off = |[w, h]: [f64; 2]| (cx / w - 0.5).abs().max((cy / h - 0.5).abs());
        let [w, h] = size.map(f64::from);
        off([h, w]) < off([w, h])
    }

    /// The intrinsics for an image file of this size, which may be a downscaled copy of the original.
    pub(super) fn for_image(&self, [width, height]: [u32; 2]) -> Result<Frame, String> {
        let (disk_w, disk_h) = (width as f64, height as f64);
        let [w, h] = self.size.unwrap_or([disk_w, disk_h]);
        let (scale_x, scale_y) = (disk_w / w, disk_h / h);
        // A downscaled size is rounded to whole pixels, in either direction.
        if (disk_w - w * scale_y).abs() > 1.0 && (disk_h - h * scale_x).abs() > 1.0 {
            let turned = if width != height && disk_w == h && disk_h == w {
                " (it is turned: rotate the photo, or remove it)"
            } else {
                ""
            };
            return Err(format!(
                "the image is {width} × {height}, but its camera is for {w} × {h}, of another aspect{turned}"
            ));
        }
        let [fx, fy] = match self.focal {
            Focal::Pixels(focal) => focal,
            Focal::Angles { x, y } => {
                let fx = 0.5 * w / (0.5 * x).tan();
                [fx, y.map_or(fx, |y| 0.5 * h / (0.5 * y).tan())]
            }
            Focal::Sphere => [w, h],
        };
        let [cx, cy] = self.center.unwrap_or([0.5 * w, 0.5 * h]);
        // Real principal points are within a few percent of the middle; that of an image twice as large is at
        // the edge.
        let far = |c: f64, size: f64| (c - 0.5 * size).abs() > 0.25 * size;
        if self.size.is_none() && (far(cx, w) || far(cy, h)) {
            return Err(format!(
                "the principal point ({cx}, {cy}) is far from the middle of the image, which is {width} × {height}, and the size \
                 that the camera is for is not given; if the images were reduced, add `w` and `h`"
            ));
        }
        let (fx, fy, cx, cy) = (fx * scale_x, fy * scale_y, cx * scale_x, cy * scale_y);
        Ok(Frame { width, height, fx, fy, cx, cy })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(size: Option<[f64; 2]>) -> SourceCamera {
        let (focal, center) = (Focal::Pixels([4000.0, 4100.0]), Some([2400.0, 1700.0]));
        SourceCamera { size, focal, center, distortion: Distortion::default() }
    }

    #[test]
    fn intrinsics_follow_the_size_of_the_file() {
        // Mip-NeRF 360: 4946 × 3286, with 4 times smaller copies of 1237 × 822.
        let frame = camera(Some([4946.0, 3286.0])).for_image([1237, 822]).unwrap();
        let (sx, sy) = (1237.0 / 4946.0, 822.0 / 3286.0);
        assert_eq!([frame.fx, frame.fy, frame.cx, frame.cy], [4000.0 * sx, 4100.0 * sy, 2400.0 * sx, 1700.0 * sy]);
        let error = camera(Some([4946.0, 3286.0])).for_image([1237, 825]).unwrap_err();
        assert!(error.contains("1237 × 825") && error.contains("4946 × 3286"), "{error}");
        let of_vga = |size| camera(Some([640.0, 480.0])).for_image(size).unwrap_err();
        assert!(of_vga([480, 640]).contains("turned"));
        assert!([[480, 600], [500, 640], [300, 200]].iter().all(|&size| !of_vga(size).contains("turned")));
        // It suffices that one side matches up to rounding by a whole pixel.
        assert!(camera(Some([1000.0, 10.0])).for_image([500, 4]).is_ok());
        assert!(camera(Some([10.0, 1000.0])).for_image([4, 500]).is_ok());
        assert_eq!(camera(None).for_image([4800, 3400]).unwrap().fx, 4000.0);
        assert!(camera(None).seems_turned([3400, 4800]) && !camera(None).seems_turned([4800, 3400]));
        assert!(!camera(Some([640.0, 480.0])).seems_turned([3400, 4800]));
    }

    #[test]
    fn a_camera_for_larger_images_is_noticed_without_their_size() {
        for reduced in [2, 4, 8] {
            let error = camera(None).for_image([4800 / reduced, 3400 / reduced]).unwrap_err();
            assert!(error.contains("(2400, 1700)") && error.contains("`w` and `h`"), "{error}");
        }
        let off = |cx: f64, cy: f64| SourceCamera { center: Some([cx, cy]), ..camera(None) }.for_image([100, 60]);
        assert!(off(30.0, 20.0).is_ok() && off(74.0, 44.0).is_ok() && off(25.0, 15.0).is_ok());
        assert!(off(24.0, 30.0).is_err() && off(50.0, 46.0).is_err() && off(50.0, -500.0).is_err());
        // With a given size, the file is trusted.
        let sure = SourceCamera { size: Some([100.0, 60.0]), center: Some([-500.0, 30.0]), ..camera(None) };
        assert_eq!(sure.for_image([100, 60]).unwrap().cx, -500.0);
    }

    #[test]
    fn numbers_that_make_no_camera_are_named() {
        let sound = camera(Some([640.0, 480.0]));
        sound.check().unwrap();
        let bad = |camera: SourceCamera, part: &str| assert!(camera.check().unwrap_err().contains(part), "{camera:?}");
        bad(SourceCamera { size: Some([0.0, 480.0]), ..sound }, "image size");
        bad(SourceCamera { size: Some([640.0, f64::NAN]), ..sound }, "image size");
        bad(SourceCamera { focal: Focal::Pixels([1.0, -1.0]), ..sound }, "focal lengths");
        bad(SourceCamera { focal: Focal::Pixels([f64::INFINITY, 1.0]), ..sound }, "focal lengths");
        bad(SourceCamera { focal: Focal::Angles { x: 3.2, y: None }, ..sound }, "field of view");
        bad(SourceCamera { focal: Focal::Angles { x: std::f64::consts::PI, y: None }, ..sound }, "field of view");
        bad(SourceCamera { focal: Focal::Angles { x: 1.0, y: Some(0.0) }, ..sound }, "field of view");
        bad(SourceCamera { center: Some([f64::NAN, 1.0]), ..sound }, "principal point");
        bad(SourceCamera { distortion: Distortion::opencv(0.0, f64::NAN, 0.0, 0.0), ..sound }, "distortion");
        bad(SourceCamera { distortion: Distortion::Unified { alpha: 1.1, beta: 1.0 }, ..sound }, "alpha 1.1");
        bad(SourceCamera { distortion: Distortion::Unified { alpha: 0.5, beta: 0.0 }, ..sound }, "beta 0");
        SourceCamera { distortion: Distortion::Unified { alpha: 0.5, beta: 1.0 }, ..sound }.check().unwrap();
    }
}
