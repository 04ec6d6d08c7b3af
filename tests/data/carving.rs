//! Tests the first points of runs without sparse points: transparency excludes regions, masks do not.

use std::fs;
use std::path::Path;

use glam::{DMat3, DQuat, DVec3};
use glint::data::{Alpha, Dataset, DatasetKind, DatasetOptions, Holdout};
use image::{GrayImage, Luma, Rgba, RgbaImage};
use serde_json::json;

const SIZE: [u32; 2] = [40, 30];
const FOCAL: f64 = 35.0;

/// Whether a pixel is in the photo's disc.
fn is_disc(x: u32, y: u32) -> bool {
    (f64::from(x) - 19.5).hypot(f64::from(y) - 14.5) < 5.0
}

/// Axes of a camera four units out on an axis that looks back: right, down and ahead.
fn axes(eye: DVec3) -> DMat3 {
    let ahead = -eye.normalize();
    let right = ahead.cross(if ahead.y.abs() > 0.9 { DVec3::X } else { -DVec3::Y }).normalize();
    DMat3::from_cols(right, ahead.cross(right), ahead)
}

/// Six photos of a disc from all sides, with this alpha around it, as a dataset of this kind.
fn write(root: &Path, kind: DatasetKind, around: u8) {
    let eyes = [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z].map(|axis| 4.0 * axis);
    fs::create_dir_all(root.join("images")).unwrap();
    let [width, height] = SIZE;
    for i in 0..eyes.len() {
        let pixel = |x, y| if is_disc(x, y) { Rgba([200, 40, 0, 255]) } else { Rgba([9, 9, 9, around]) };
        RgbaImage::from_fn(width, height, pixel).save(root.join(format!("images/{i}.png"))).unwrap();
    }
    if kind == DatasetKind::Colmap {
        let pose = |(i, eye): (usize, &DVec3)| {
            let rotation = axes(*eye).transpose();
            let (q, t) = (DQuat::from_mat3(&rotation), -(rotation * *eye));
            format!("{} {} {} {} {} {} {} {} 1 {i}.png\n\n", i + 1, q.w, q.x, q.y, q.z, t.x, t.y, t.z)
        };
        fs::create_dir_all(root.join("sparse/0")).unwrap();
        let camera = format!("1 PINHOLE {width} {height} {FOCAL} {FOCAL} 20 15\n");
        fs::write(root.join("sparse/0/cameras.txt"), camera).unwrap();
        fs::write(root.join("sparse/0/images.txt"), eyes.iter().enumerate().map(pose).collect::<String>()).unwrap();
        return;
    }
    let frame = |(i, eye): (usize, &DVec3)| {
        let (turn, mask) = (axes(*eye), root.join(format!("apart/{i}.png")));
        let row = |k: usize| json!([turn.x_axis[k], -turn.y_axis[k], -turn.z_axis[k], eye[k]]);
        let mut frame =
            json!({"file_path": format!("images/{i}.png"), "transform_matrix": [row(0), row(1), row(2), [0, 0, 0, 1]]});
        if mask.is_file() {
            frame["mask_path"] = format!("apart/{i}.png").into();
        }
        frame
    };
    let frames: Vec<_> = eyes.iter().enumerate().map(frame).collect();
    let (name, file) = match kind {
        DatasetKind::Blender => {
            let angle = 2.0 * (0.5 * f64::from(width) / FOCAL).atan();
            ("transforms_train.json", json!({"camera_angle_x": angle, "frames": frames}))
        }
        _ => ("transforms.json", json!({"fl_x": FOCAL, "frames": frames})),
    };
    fs::write(root.join(name), file.to_string()).unwrap();
}

/// A mask of each photo, black inside the disc or outside.
fn mask(folder: &Path, black_disc: bool) {
    fs::create_dir_all(folder).unwrap();
    let pixel = |x, y| Luma([if is_disc(x, y) == black_disc { 0 } else { 255 }]);
    (0..6).for_each(|i| GrayImage::from_fn(SIZE[0], SIZE[1], pixel).save(folder.join(format!("{i}.png"))).unwrap());
}

fn open(root: &Path, alpha: Alpha) -> Dataset {
    let options = DatasetOptions { alpha, holdout: Holdout::Nothing, ..Default::default() };
    Dataset::open(root, &options).unwrap()
}

const KINDS: [DatasetKind; 3] = [DatasetKind::Blender, DatasetKind::Transforms, DatasetKind::Colmap];

/// Carving once worked for NeRF Synthetic only; elsewhere points filled the cameras' view.
#[test]
fn random_points_lie_where_no_photo_is_transparent_wherever_photos_come_from() {
    for kind in KINDS {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), kind, 0);
        let data = open(folder.path(), Alpha::Background);
        assert_eq!((data.kind, data.points.is_none()), (kind, true));
        let cloud = data.carved_points(500, 1).unwrap().unwrap();
        assert_eq!(cloud.colors, [[200, 40, 0]; 500]);
        // Five pixels are 4/7 of a unit at the middle, and 0.66 on its far side.
        let inside = |p: &[f64; 3]| (0..3).all(|axis| p[axis].hypot(p[(axis + 1) % 3]) < 0.67);
        assert!(cloud.positions.len() == 500 && cloud.positions.iter().all(inside), "{kind:?}");
        assert!(cloud.positions.iter().any(|p| p[0].hypot(p[1]) > 0.45), "{kind:?}");
        // They are not all on one side.
        let mean = cloud.positions.iter().map(|&p| glam::DVec3::from(p)).sum::<glam::DVec3>() / 500.0;
        assert!(mean.length() < 0.1, "{kind:?}: {mean}");
        assert_eq!(cloud, data.carved_points(500, 1).unwrap().unwrap());
        assert_ne!(cloud, data.carved_points(500, 2).unwrap().unwrap());
    }
}

#[test]
fn photos_that_nothing_shines_through_carve_nothing() {
    for kind in KINDS {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), kind, 255);
        assert_eq!(open(folder.path(), Alpha::Background).carved_points(5, 1).unwrap(), None, "{kind:?}");
        // Nearly transparent does not count as transparent.
        write(folder.path(), kind, 3);
        assert_eq!(open(folder.path(), Alpha::Background).carved_points(5, 1).unwrap(), None, "{kind:?}");
        // One photo is enough, even the last.
        let pixel = |x, _| Rgba([9, 9, 9, if x < 20 { 0 } else { 255 }]);
        RgbaImage::from_fn(SIZE[0], SIZE[1], pixel).save(folder.path().join("images/5.png")).unwrap();
        assert!(open(folder.path(), Alpha::Background).carved_points(5, 1).unwrap().is_some(), "{kind:?}");
    }
}

/// A mask is not a silhouette: the hidden part may be an object, such as a passer-by, or empty.
#[test]
fn masks_carve_nothing_and_show_nothing() {
    for kind in KINDS {
        for apart in [false, true] {
            // COLMAP has no `mask_path`.
            if apart && kind == DatasetKind::Colmap {
                continue;
            }
            let carved = |around: u8, black_disc: bool, alpha: Alpha| {
                let folder = tempfile::tempdir().unwrap();
                mask(&folder.path().join(if apart { "apart" } else { "masks" }), black_disc);
                write(folder.path(), kind, around);
                let data = open(folder.path(), alpha);
                assert!(data.notes.iter().any(|note| note.contains("with a mask")), "{:?}", data.notes);
                data.carved_points(50, 1).unwrap()
            };
            // All valid pixels are opaque, with and without transparent masked pixels.
            assert_eq!(carved(255, false, Alpha::Background), None, "{kind:?}");
            assert_eq!(carved(0, false, Alpha::Background), None, "{kind:?}");
            // All valid pixels are empty.
            assert_eq!(carved(0, true, Alpha::Background), None, "{kind:?}");
            assert_eq!(carved(0, true, Alpha::Mask), None, "{kind:?}");
        }
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), kind, 0);
        assert_eq!(open(folder.path(), Alpha::Mask).carved_points(5, 1).unwrap(), None, "{kind:?}: --alpha mask");
    }
}
