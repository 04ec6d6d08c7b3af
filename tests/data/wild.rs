//! Tests datasets as found in the wild.

use std::fs;

use glint::data::{Dataset, DatasetKind, DatasetOptions, Split};
use proptest::prelude::*;

use crate::variants::{KINDS, Plain, edit, put, ten, write};

/// Rounding of poses that went through quaternions or matrices, and of focal lengths that were angles.
const CLOSE: f64 = 1e-11;

#[track_caller]
fn assert_same(kind: &str, data: &Dataset, plain: &Plain) {
    assert_eq!(data.photos.len(), plain.names.len(), "{kind}: {:?}", data.notes);
    assert_eq!(data.points.as_ref(), Some(&plain.points), "{kind}");
    let images = data.load_images().unwrap();
    for (i, (photo, image)) in data.photos.iter().zip(&images).enumerate() {
        // Names may have a leading folder, or lack their ending.
        let stem = plain.names[i].trim_end_matches(".png");
        let name = photo.name.strip_prefix("images/").unwrap_or(&photo.name);
        assert_eq!(name.trim_end_matches(".png"), stem, "{kind}");
        let (a, b) = (&photo.camera, &plain.cameras[i]);
        assert_eq!((a.width, a.height), (b.width, b.height), "{kind}");
        let numbers = |c: &glint::scene::Camera| {
            let pose = c.rotation.to_cols_array().into_iter().chain(c.translation.to_array());
            [c.fx, c.fy, c.cx, c.cy].into_iter().chain(pose).collect::<Vec<f64>>()
        };
        for (a, b) in numbers(a).into_iter().zip(numbers(b)) {
            assert!((a - b).abs() < CLOSE * b.abs().max(1.0), "{kind}: {a} for {b} in {}", photo.name);
        }
        assert!(image.rgb == *plain.photos[i].as_raw() && image.mask.is_none(), "{kind}: {}", photo.name);
        assert_eq!(photo.split, if i.is_multiple_of(8) { Split::Test } else { Split::Train }, "{kind}: {}", photo.name);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]
    #[test]
    fn every_kind_of_dataset_loads_to_the_same_cameras_and_pixels(
        (n, width, height) in (4..19usize, 5..17u32, 5..17u32),
        focal in 6.0..30.0f64,
        // Sorted before zz.png, the missing photo, which keeps its place in the order.
        folder in "[a-y][a-z]{0,7}( [a-z]{1,4})?",
        seed: u64,
    ) {
        let plain = Plain::new(n, [width, height], [focal, 1.1 * focal], &folder, seed);
        for (kind, write) in KINDS {
            let folder = tempfile::tempdir().unwrap();
            let (path, options) = write(&plain, folder.path());
            let data = Dataset::open(path, &options).unwrap_or_else(|error| panic!("{kind}: {error}"));
            assert_same(kind, &data, &plain);
        }
    }
}

/// Opens a kind by name; returns the dataset's notes.
fn notes(kind: &str) -> Vec<String> {
    let (_, _folder, (path, options)) = ten(kind);
    Dataset::open(path, &options).unwrap().notes
}

#[test]
fn what_was_done_to_load_a_dataset_is_told() {
    for (kind, parts) in [
        ("a second model", &["sparse/0 is read", "also sparse/1"][..]),
        ("model in sparse/1 only", &[]),
        ("photos in input", &["no folder images", "input"]),
        ("reduced photos in images_4", &["images_4"]),
        ("files in another case", &["10 photos found under another spelling"]),
        ("files with another ending", &["10 photos found under another spelling"]),
        ("a photo that is missing", &["1 photo of 11 left out", "`zz.png`", "zz.png is missing"]),
        ("opaque alpha", &["10 photos with an alpha channel", "--alpha mask"]),
        ("opaque alpha as a mask", &[]),
        ("white masks", &["10 photos of 10 with a mask"]),
        ("test.txt", &["2 photos for testing", "test.txt"]),
        ("train.txt and test.txt", &["2 photos for testing", "test.txt and", "train.txt"]),
        ("every 8th, said", &[]),
        ("COLMAP text", &[]),
        ("COLMAP binary", &[]),
        ("nerfstudio", &[]),
        ("nerfstudio's lists", &["2 photos for testing", "test_filenames"]),
        (
            "a file for training and one for testing, of which one photo is in both",
            &["transforms_val.json", "1 photo for training and for testing"],
        ),
    ] {
        let notes = notes(kind);
        assert_eq!(notes.is_empty(), parts.is_empty(), "{kind}: {notes:?}");
        let text = notes.join("; ");
        parts.iter().for_each(|part| assert!(text.contains(part), "{kind}: `{part}` is not in: {text}"));
        // No note is repeated, and there are no unexpected notes.
        let two = kind.contains("photo in input") || kind.contains("in both") || kind.contains("nerfstudio's lists");
        assert!(notes.len() <= 1 + usize::from(two), "{kind}: {notes:?}");
    }
}

#[test]
fn masks_that_belong_to_no_photo_are_told() {
    for kind in ["COLMAP text", "nerfstudio"] {
        let (_, folder, (path, options)) = ten(kind);
        let notes = || Dataset::open(&path, &options).unwrap().notes.join("; ");
        assert_eq!(notes(), "", "{kind}");
        let mask = image::GrayImage::from_pixel(8, 6, image::Luma([255]));
        fs::create_dir(folder.path().join("masks")).unwrap();
        mask.save(folder.path().join("masks/nobody.png")).unwrap();
        let note = "folder of masks, but no file in it is named after a photo; expected `p01.png` or `p01.png.png`";
        assert!(notes().contains(note), "{kind}: {}", notes());
        mask.save(folder.path().join("masks/p01.png")).unwrap();
        assert!(notes().contains("1 photo of 10 with a mask"), "{kind}: {}", notes());
    }
}

/// In a folder from nerfstudio, transforms.json is the dataset; the model in colmap/ is its source.
#[test]
fn of_a_model_and_a_transforms_file_the_one_that_is_the_datasets_own_is_read() {
    let (plain, folder, _) = ten("model in colmap/sparse/0");
    let write = |kind: &str| write(&plain, folder.path(), kind);
    let open = || Dataset::open(folder.path(), &DatasetOptions::default()).unwrap();
    assert_eq!(open().kind, DatasetKind::Colmap);
    write("nerfstudio");
    assert_eq!(open().kind, DatasetKind::Transforms);
    let options = DatasetOptions { model: Some("colmap/sparse/0".into()), ..Default::default() };
    assert_eq!(Dataset::open(folder.path(), &options).unwrap().kind, DatasetKind::Colmap);
    write("COLMAP text");
    let data = open();
    assert_eq!(data.kind, DatasetKind::Colmap);
    assert!(data.notes.join(" ").contains("transforms.json beside it is not"), "{:?}", data.notes);
}

/// A photo found under another spelling must not be the file of another name.
#[test]
fn two_names_do_not_share_a_file() {
    let (_, folder, _) = ten("COLMAP text");
    let images = folder.path().join("sparse/0/images.txt");
    let text = fs::read_to_string(&images).unwrap() + "98 1 0 0 0 0 0 0 1 P01.jpg\n\n99 1 0 0 0 0 0 0 1 none.jpg\n\n";
    put(&images, text);
    let data = Dataset::open(folder.path(), &DatasetOptions::default()).unwrap();
    assert_eq!(data.photos.len(), 10);
    assert!(data.notes[0].contains("2 photos of 12 left out"), "{:?}", data.notes);
}

#[test]
fn a_principal_point_that_is_nowhere_near_the_picture_is_said() {
    let (plain, folder, _) = ten("COLMAP text");
    put(&folder.path().join("sparse/0/cameras.txt"), plain.cameras_txt("PINHOLE", &[9.0, 9.0, -500.0, 3.0]));
    let notes = Dataset::open(folder.path(), &DatasetOptions::default()).unwrap().notes;
    assert!(
        notes[0].contains("10 photos") && notes[0].contains("(-500, 3)") && notes[0].contains("8 × 6"),
        "{notes:?}"
    );
    // Intrinsics of photos twice as large, without a size.
    let (_, folder, _) = ten("nerfstudio");
    edit(folder.path(), |file| {
        (file["w"], file["h"]) = Default::default();
        (file["cx"], file["cy"]) = (8.into(), 6.into());
    });
    let error = Dataset::open(folder.path(), &DatasetOptions::default()).unwrap_err().to_string();
    assert!(error.contains("(8, 6)") && error.contains("add `w` and `h`"), "{error}");
}

/// A regression test: it was taken for NeRF Synthetic, and points were drawn from a cube outside of all
/// views: 14.94 dB instead of 19.93.
#[test]
fn an_angle_for_a_focal_length_makes_no_blender_scene() {
    let folder = tempfile::tempdir().unwrap();
    let ring = |radius: f64, center: f64| {
        let frames: Vec<serde_json::Value> = (0..12)
            .map(|i| {
                let (sin, cos) = (f64::from(i) * 0.5).sin_cos();
                // OpenGL's camera looks along −z: toward the centre.
                let matrix = [
                    [-sin, 0.0, cos, center + radius * cos],
                    [cos, 0.0, sin, center + radius * sin],
                    [0.0, 1.0, 0.0, center],
                    [0.0, 0.0, 0.0, 1.0],
                ];
                serde_json::json!({"file_path": format!("{i:02}"), "transform_matrix": matrix})
            })
            .collect();
        for i in 0..12 {
            image::RgbImage::new(8, 8).save(folder.path().join(format!("{i:02}.png"))).unwrap();
        }
        serde_json::json!({"camera_angle_x": 0.7, "frames": frames}).to_string()
    };
    let kind = |name: &str, file: &str| {
        let _ = fs::remove_file(folder.path().join("transforms_train.json"));
        put(&folder.path().join(name), file);
        let data = Dataset::open(folder.path(), &DatasetOptions::default()).unwrap();
        let far = data.random_points(200, 1).positions.iter().flatten().fold(0.0, |far: f64, v| far.max(v.abs()));
        (data.kind, far, data.notes)
    };
    let (found, far, notes) = kind("transforms_train.json", &ring(4.0, 0.0));
    assert!(found == DatasetKind::Blender && far <= 1.3 && notes.is_empty(), "{notes:?}");
    let (found, far, notes) = kind("transforms_train.json", &ring(4.0, 10.0));
    assert!(found == DatasetKind::Transforms && far > 8.0 && notes[0].contains("cube"), "{far} {notes:?}");
    let (found, ..) = kind("transforms.json", &ring(4.0, 0.0));
    assert_eq!(found, DatasetKind::Transforms);
}

#[test]
fn photos_in_neither_list_are_left_out() {
    let (_, folder, (path, options)) = ten("train.txt and test.txt");
    put(&folder.path().join("train.txt"), "p02.png\np04.png\nnobody.png");
    let data = Dataset::open(&path, &options).unwrap();
    assert_eq!((data.split(Split::Train).count(), data.split(Split::Test).count()), (2, 2));
    let text = data.notes.join("; ");
    assert!(text.contains("6 photos left out") && text.contains("`nobody`"), "{text}");
}
