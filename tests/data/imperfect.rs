//! Tests datasets with missing, moved, rotated or doubly used parts: the usable parts are read, the rest is
//! reported.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use glint::data::{Dataset, DatasetKind, DatasetOptions, Holdout, Split};
use image::codecs::{jpeg::JpegEncoder, png::PngEncoder, webp::WebPEncoder};
use image::metadata::Orientation;
use image::{DynamicImage, GrayImage, ImageEncoder, Luma, Rgb, RgbImage};
use serde_json::json;

use crate::variants::{Plain, edit, put, ten, write};

fn open(root: &Path) -> Dataset {
    Dataset::open(root, &DatasetOptions::default()).unwrap()
}

fn error(root: &Path) -> String {
    Dataset::open(root, &DatasetOptions::default()).unwrap_err().to_string()
}

#[test]
fn photos_without_a_pose_are_left_out_and_move_no_other() {
    let (plain, folder, _) = ten("nerfstudio");
    let names = |data: &Dataset| data.split(Split::Test).map(|(_, photo)| photo.name.clone()).collect::<Vec<_>>();
    let (whole, sector) = (open(folder.path()), DatasetOptions { holdout: Holdout::Sector, ..Default::default() });
    assert_eq!(names(&whole), ["images/p01.png", "images/sub/p06.png"]);
    let path = folder.path().join("transforms.json");
    let lost = |frames: &[usize]| {
        edit(folder.path(), |file| frames.iter().for_each(|&i| file["frames"][i]["transform_matrix"] = json!("lost")));
        let text = fs::read_to_string(&path).unwrap().replace("\"lost\"", "[[NaN,-Infinity,0,0],[0,1,0,0],[0,0,1,0]]");
        put(&path, text);
    };
    lost(&[2]);
    let data = open(folder.path());
    assert_eq!((data.photos.len(), names(&data)), (9, names(&whole)));
    let note = "1 photo of 10 left out: `images/p04.png` has no usable camera: frame 2: `transform_matrix` holds a number that is not finite";
    assert_eq!(data.notes, [note]);
    assert_eq!(Dataset::open(folder.path(), &sector).unwrap().photos.len(), 9);
    write(&plain, folder.path(), "nerfstudio");
    lost(&[1, 2, 3, 4, 5, 6]);
    let notes = open(folder.path()).notes.join("; ");
    assert!(notes.contains("6 photos of 10 left out: `images/p02.png`"), "{notes}");
    assert!(notes.contains("(and 5 more: `images/p04.png`, `images/p05.png`, `images/p07.png`, …)"), "{notes}");
    write(&plain, folder.path(), "nerfstudio");
    lost(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
    let refused = error(folder.path());
    assert!(refused.contains("no photo is left: `images/p01.png` has no usable camera"), "{refused}");
    assert!(refused.contains("transforms.json") && refused.contains("(and 9 more: "), "{refused}");
}

#[test]
fn names_of_another_machine_find_the_files_of_this_one() {
    for before in ["/home/x/d/images/", "C:\\Users\\x\\d\\images\\", "scene_01/images/", "\\\\server\\d\\images/"] {
        let (plain, folder, _) = ten("nerfstudio");
        for name in &plain.names {
            let path = folder.path().join("outlines").join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            GrayImage::from_fn(8, 6, |x, _| Luma([if x < 4 { 255 } else { 0 }])).save(path).unwrap();
        }
        edit(folder.path(), |file| {
            for (frame, name) in file["frames"].as_array_mut().unwrap().iter_mut().zip(&plain.names) {
                frame["file_path"] = json!(format!("{before}{name}"));
                frame["mask_path"] = json!(format!("/home/x/d/outlines/{name}"));
            }
            file["ply_file_path"] = json!("/home/x/d/points.ply");
        });
        let data = open(folder.path());
        assert_eq!((data.photos.len(), data.points.as_ref()), (10, Some(&plain.points)), "{before}");
        assert!(data.notes.iter().any(|note| note.contains("10 photos found under another")), "{:?}", data.notes);
        for ((photo, image), pixels) in data.photos.iter().zip(data.load_images().unwrap()).zip(&plain.photos) {
            assert_eq!(image.rgb, *pixels.as_raw(), "{}", photo.name);
            assert_eq!(image.mask.unwrap()[..8], [true, true, true, true, false, false, false, false]);
        }
        // Two folders match.
        for copy in ["one", "two"] {
            plain.write_photos(&folder.path().join(copy).join("images"), str::to_owned);
        }
        assert_eq!(open(folder.path()).photos.len(), 10, "the dataset's own comes first");
        fs::remove_dir_all(folder.path().join("images")).unwrap();
        let both = error(folder.path());
        assert!(["one/images", "two/images", "frame 0", "--images"].iter().all(|part| both.contains(part)), "{both}");
        fs::remove_dir_all(folder.path().join("two")).unwrap();
        assert_eq!(open(folder.path()).photos.len(), 10);
    }
    // In COLMAP's lists too; a missing photo is not searched among others.
    let (plain, folder, _) = ten("COLMAP text");
    let lists = folder.path().join("sparse/0/images.txt");
    for before in ["images/", "scans/photos/", "D:\\scans\\images\\"] {
        put(&lists, plain.images_txt(|name| format!("{before}{}", name.replace('/', "\\")), "\n"));
        assert_eq!(open(folder.path()).photos.len(), 10, "{before}");
    }
    fs::remove_file(folder.path().join("images/p01.png")).unwrap();
    let data = open(folder.path());
    assert!(data.photos.len() == 9 && data.notes[0].contains("1 photo of 10 left out"), "{:?}", data.notes);
}

#[test]
fn masks_that_are_missing_are_told_and_their_photos_are_used_whole() {
    let (_, folder, _) = ten("nerfstudio");
    GrayImage::from_fn(8, 6, |x, _| Luma([255 * u8::from(x < 4)])).save(folder.path().join("there.png")).unwrap();
    edit(folder.path(), |file| {
        for (i, mask) in [(1, "gone/a.png"), (3, "gone/b.png"), (5, ""), (7, "there.png")] {
            file["frames"][i]["mask_path"] = json!(mask);
        }
    });
    let data = open(folder.path());
    let gone = folder.path().join("gone/a.png");
    let note = format!(
        "2 masks of 3 left out: {} of `images/p02.png` is missing (and 1 more: `images/p05.png`)",
        gone.display()
    );
    assert_eq!(data.notes[0], note);
    let masked: Vec<bool> = data.load_images().unwrap().iter().map(|image| image.mask.is_some()).collect();
    assert_eq!(masked, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9].map(|i| i == 7));
}

#[test]
fn letters_with_accents_are_the_same_composed_or_apart() {
    let [composed, apart] = ["S\u{e4}ule", "Sa\u{308}ule"];
    for [disk, list] in [[composed, apart], [apart, composed]] {
        for kind in ["COLMAP text", "nerfstudio"] {
            let mut plain = Plain::new(10, [8, 6], [9.0, 9.0], "sub", 1);
            plain.names.iter_mut().for_each(|name| *name = format!("{disk}/{name}"));
            let folder = tempfile::tempdir().unwrap();
            write(&plain, folder.path(), kind);
            for file in ["sparse/0/images.txt", "transforms.json"].map(|name| folder.path().join(name)) {
                if let Ok(text) = fs::read_to_string(&file) {
                    put(&file, text.replace(disk, list));
                }
            }
            let mask = folder.path().join("masks").join(&plain.names[3]);
            fs::create_dir_all(mask.parent().unwrap()).unwrap();
            GrayImage::from_pixel(8, 6, Luma([255])).save(mask).unwrap();
            if kind == "COLMAP text" {
                put(&folder.path().join("test.txt"), format!("{}\n{}\n", plain.names[2], plain.names[5]));
            }
            let data = open(folder.path());
            assert_eq!(data.photos.len(), 10, "{kind}");
            assert!(data.notes.iter().any(|note| note.contains("1 photo of 10 with a mask")), "{:?}", data.notes);
            assert_eq!(data.split(Split::Test).count(), 2);
            if kind == "COLMAP text" {
                assert!(data.notes.iter().all(|note| !note.contains("no photo")), "{:?}", data.notes);
            }
        }
    }
}

#[test]
fn one_file_is_not_the_photo_of_two_cameras() {
    let (plain, folder, _) = ten("nerfstudio");
    edit(folder.path(), |file| {
        for (i, frame) in file["frames"].as_array_mut().unwrap().iter_mut().enumerate() {
            frame["file_path"] = json!(format!("images/camera{}/{:04}.png", i % 2, i / 2));
        }
    });
    let flat = folder.path().join("flat");
    fs::create_dir(&flat).unwrap();
    (0..5).for_each(|i| plain.photos[i].save(flat.join(format!("{i:04}.png"))).unwrap());
    let options = DatasetOptions { images: Some("flat".into()), ..Default::default() };
    let refused = Dataset::open(folder.path(), &options).unwrap_err().to_string();
    let parts = ["`images/camera0/0000.png` and `images/camera1/0000.png`", "one file", "flat/0000.png"];
    assert!(parts.iter().all(|part| refused.contains(part)), "{refused}");
    // Under another spelling too.
    fs::rename(flat.join("0000.png"), flat.join("0000.PNG")).unwrap();
    let refused = Dataset::open(folder.path(), &options).unwrap_err().to_string();
    assert!(refused.contains("are both the one file") && refused.contains("0000."), "{refused}");
}

/// Points of a model that nerfstudio leaves behind; the world is rotated.
#[test]
fn points_of_a_model_beside_the_file_stand_in_the_frame_of_its_cameras() {
    let (plain, folder, _) = ten("model in colmap/sparse/0");
    write(&plain, folder.path(), "nerfstudio");
    fs::remove_file(folder.path().join("points.ply")).unwrap();
    edit(folder.path(), |file| {
        file.as_object_mut().unwrap().remove("ply_file_path");
        for frame in file["frames"].as_array_mut().unwrap() {
            frame["transform_matrix"].as_array_mut().unwrap()[..3].rotate_left(1);
        }
    });
    let data = open(folder.path());
    assert_eq!(data.kind, DatasetKind::Transforms);
    let points = data.points.unwrap();
    assert_eq!(points.colors, plain.points.colors);
    for (found, there) in points.positions.iter().zip(&plain.points.positions) {
        let [x, y, z] = there.map(f64::from);
        let expected = [y, z, x];
        assert!((0..3).all(|k| (found[k] - expected[k]).abs() < 1e-4), "{found:?} {expected:?}");
    }
    assert_eq!(
        data.notes,
        ["the points of the COLMAP model in colmap/sparse/0 are taken, in the frame of these cameras"]
    );
    assert!(data.sources.iter().any(|source| source.ends_with("colmap/sparse/0/points3D.txt")));
    // A model of another reconstruction, with other relative camera positions.
    edit(folder.path(), |file| file["frames"][4]["transform_matrix"][0][3] = json!(40.0));
    let data = open(folder.path());
    assert!(data.points.is_none());
    assert!(data.notes[0].contains("colmap/sparse/0 are left out: its cameras do not stand"), "{:?}", data.notes);
}

fn exif(orientation: u8) -> Vec<u8> {
    // A directory of one entry: tag 0x112, a 16-bit number.
    [&b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0"[..], &[orientation, 0, 0, 0], &[0; 4]].concat()
}

fn tagged(picture: &RgbImage, orientation: u8, ending: &str) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let (width, height) = picture.dimensions();
    let color = image::ExtendedColorType::Rgb8;
    let bytes = picture.as_raw();
    match ending {
        "png" => {
            let mut encoder = PngEncoder::new(&mut out);
            encoder.set_exif_metadata(exif(orientation)).unwrap();
            encoder.write_image(bytes, width, height, color).unwrap();
        }
        "webp" => {
            let mut encoder = WebPEncoder::new_lossless(&mut out);
            // Both forms that writers use.
            let marker = if orientation.is_multiple_of(4) { &b"Exif\0\0"[..] } else { b"" };
            encoder.set_exif_metadata([marker, &exif(orientation)].concat()).unwrap();
            encoder.write_image(bytes, width, height, color).unwrap();
        }
        _ => {
            let mut encoder = JpegEncoder::new_with_quality(&mut out, 100);
            encoder.set_exif_metadata(exif(orientation)).unwrap();
            encoder.write_image(bytes, width, height, color).unwrap();
        }
    }
    out.into_inner()
}

/// The stored pixels, which the tag rotates upright.
fn stored(upright: &RgbImage, orientation: u8) -> RgbImage {
    let back = match orientation {
        6 => 8,
        8 => 6,
        same => same,
    };
    let mut picture = DynamicImage::from(upright.clone());
    picture.apply_orientation(Orientation::from_exif(back).unwrap());
    picture.into_rgb8()
}

/// With cameras for the upright and for the stored picture, each photo shows its camera's view.
#[test]
fn a_photo_is_turned_by_its_tag_where_only_that_fits_its_camera() {
    // Smooth, so that JPEG preserves it; all corners differ.
    let upright = |[width, height]: [u32; 2]| {
        RgbImage::from_fn(width, height, |x, y| Rgb([(200 * x / width) as u8, (200 * y / height) as u8, 60]))
    };
    let open = |size: [u32; 2], bytes: &[u8], ending: &str| {
        let plain = Plain::new(1, size, [9.0, 9.0], "sub", 1);
        let folder = tempfile::tempdir().unwrap();
        write(&plain, folder.path(), "COLMAP text");
        fs::remove_dir_all(folder.path().join("images")).unwrap();
        put(&folder.path().join("images/sub/p00").with_extension(ending), bytes);
        let options = DatasetOptions { holdout: Holdout::Nothing, ..Default::default() };
        let data = Dataset::open(folder.path(), &options).map_err(|error| error.to_string())?;
        Ok::<_, String>((data.load_images().map_err(|error| error.to_string())?.remove(0), data.notes.join("; ")))
    };
    let near = |found: &[u8], expected: &RgbImage| {
        found.len() == expected.as_raw().len() && found.iter().zip(expected.as_raw()).all(|(a, b)| a.abs_diff(*b) < 12)
    };
    for ending in ["jpg", "png", "webp"] {
        for orientation in 1..=8 {
            let case = format!("{ending}, orientation {orientation}");
            let picture = upright([24, 32]);
            let file = stored(&picture, orientation);
            let bytes = tagged(&file, orientation, ending);
            // A camera of the upright picture: a quarter turn shows in the size.
            let (found, notes) = open([24, 32], &bytes, ending).unwrap_or_else(|what| panic!("{case}: {what}"));
            let expected = if orientation > 4 { &picture } else { &file };
            assert!(near(&found.rgb, expected), "{case}: {notes}");
            assert_eq!(notes.contains("1 photo turned by the EXIF orientation"), orientation > 4, "{case}: {notes}");
            // A camera of the stored picture, or a square one: nothing is rotated.
            let (found, notes) = open([file.width(), file.height()], &bytes, ending).unwrap();
            assert!(near(&found.rgb, &file) && !notes.contains("EXIF"), "{case}: {notes}");
            let square = stored(&upright([24, 24]), orientation);
            let (found, _) = open([24, 24], &tagged(&square, orientation, ending), ending).unwrap();
            assert!(near(&found.rgb, &square), "{case}");
        }
    }
    // Downscaled copies are rotated too.
    let small = stored(&upright([12, 16]), 6);
    let (found, _) = open([24, 32], &tagged(&small, 6, "png"), "png").unwrap();
    assert!((found.width, found.height) == (12, 16) && near(&found.rgb, &upright([12, 16])));
    // Without a size, the principal point decides the orientation.
    let plain = Plain::new(1, [24, 32], [9.0, 9.0], "sub", 1);
    let folder = tempfile::tempdir().unwrap();
    write(&plain, folder.path(), "nerfstudio");
    edit(folder.path(), |file| (file["w"], file["h"]) = Default::default());
    for (file, orientation) in [(plain.photos[0].clone(), 1), (stored(&plain.photos[0], 6), 6)] {
        put(&folder.path().join("images/sub/p00.png"), tagged(&file, orientation, "png"));
        assert_eq!(self::open(folder.path()).load_images().unwrap()[0].rgb, *plain.photos[0].as_raw());
    }
    // If the tag does not help, the error names it.
    for (orientation, size, words) in
        [(3, [24, 32], ["32 × 24", "orientation, 3,"]), (6, [20, 32], ["orientation, 6,", "makes it 24 × 32"])]
    {
        let refused = open(size, &tagged(&RgbImage::new(32, 24), orientation, "jpg"), "jpg").unwrap_err();
        assert!(words.iter().all(|word| refused.contains(word)), "{refused}");
    }
}

#[test]
fn jpeg_photos_without_their_end_are_told() {
    let (plain, folder, _) = ten("COLMAP text");
    for name in &plain.names {
        let path = folder.path().join("images").join(name);
        let bytes = tagged(&RgbImage::from_pixel(8, 6, Rgb([90, 120, 40])), 1, "jpg");
        put(&path, if name == "p04.png" { &bytes[..bytes.len() - 2] } else { &bytes });
    }
    let data = open(folder.path());
    assert_eq!(data.notes, ["1 JPEG photo without an end, whose missing rows do not count: `p04.png`"]);
    assert!(data.load_images().unwrap().iter().all(|image| image.mask.is_none()));
}
