//! Tests that downscaled photos in other folders are used if, and only if, they have the requested size.

use std::fs;
use std::path::Path;

use glint::data::{Dataset, DatasetOptions, PixelSource, Reduce};
use image::{Rgba, RgbaImage};

use crate::variants::{self, Plain};

/// Nine photos of 40 × 30, each of one color and listed as PNG; in COLMAP's form, or in transforms.json.
fn write(root: &Path, colmap: bool) {
    let names = (0..9).map(|i| format!("p/{i}.png")).collect();
    let plain = Plain { names, photos: Vec::new(), ..Plain::new(9, [40, 30], [36.0; 2], "p", 1) };
    let _ = variants::write(&plain, root, if colmap { "COLMAP text" } else { "nerfstudio" });
    photos(&root.join("images"), "png", [40, 30]);
}

fn photos(folder: &Path, ending: &str, size: [u32; 2]) {
    (0..9).for_each(|i| photo(folder, &format!("{i}.{ending}"), size));
}

/// A photo, with an alpha channel if its ending allows one.
fn photo(folder: &Path, name: &str, [width, height]: [u32; 2]) {
    fs::create_dir_all(folder.join("p")).unwrap();
    let image = image::DynamicImage::from(RgbaImage::from_pixel(width, height, Rgba([40, 90, 200, 255])));
    let path = folder.join("p").join(name);
    if name.ends_with("png") { image.save(path) } else { image.into_rgb8().save(path) }.unwrap();
}

/// The folder of all photos, their size, and the note about it.
fn opened(root: &Path, options: &DatasetOptions) -> (String, [u32; 2], Option<String>) {
    let data = Dataset::open(root, options).unwrap();
    assert_eq!(data.photos.len(), 9);
    let of = |photo: &glint::data::Photo| {
        let PixelSource::File(file) = &photo.pixels else { panic!("{photo:?}") };
        let folder = file.path.parent().unwrap().parent().unwrap().file_name().unwrap().to_str().unwrap().to_owned();
        (folder, [photo.camera.width, photo.camera.height])
    };
    let (folder, size) = of(&data.photos[0]);
    for photo in &data.photos {
        assert_eq!(of(photo), (folder.clone(), size));
        // The field of view is the same for all sizes.
        let camera = &photo.camera;
        assert!((camera.fx / f64::from(camera.width) - 0.9).abs() < 1e-12, "{camera:?}");
        let image = photo.load([0.0; 3]).unwrap();
        assert_eq!([image.width, image.height], size);
    }
    (folder, size, data.notes.into_iter().find(|note| note.contains("in place of those in full")))
}

fn at(max_size: u32) -> DatasetOptions {
    DatasetOptions { max_size: Some(max_size), reduced_folders: true, ..Default::default() }
}

#[test]
fn photos_that_are_there_at_the_size_asked_for_are_not_reduced_once_more() {
    for colmap in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        write(root, colmap);
        photos(&root.join("images_2"), "png", [20, 15]);
        photos(&root.join("images_4"), "png", [10, 7]);
        // Some tools round 7.5 rows to 7, others to 8; a difference of one pixel is accepted.
        for (size, place, had) in [
            (9, "images_4", [10, 7]),
            (10, "images_4", [10, 7]),
            (11, "images_4", [10, 7]),
            (20, "images_2", [20, 15]),
            (12, "images", [12, 9]),
            (40, "images", [40, 30]),
        ] {
            let (folder, found, note) = opened(root, &at(size));
            assert_eq!((&folder[..], found), (place, had), "--max-size {size}");
            assert_eq!(note.is_some(), place != "images", "--max-size {size}");
            assert!(note.is_none_or(|note| note.contains(place)), "--max-size {size}");
        }
        // The same for a file path as for a folder.
        if !colmap {
            assert_eq!(opened(&root.join("transforms.json"), &at(20)).0, "images_2");
        }
        let full = |options: &DatasetOptions| opened(root, options).0;
        assert_eq!(full(&DatasetOptions { reduced_folders: false, ..at(20) }), "images");
        assert_eq!(full(&DatasetOptions { images: Some("images".into()), ..at(20) }), "images");
        assert_eq!(full(&DatasetOptions { max_size: None, ..at(20) }), "images");
        assert_eq!(full(&DatasetOptions { reduce: Reduce::Bicubic, ..at(20) }), "images_2");
    }
}

#[test]
fn a_reduced_folder_that_is_not_the_same_photos_is_passed_over() {
    let with = |change: &dyn Fn(&Path)| {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        write(root, true);
        photos(&root.join("images_2"), "png", [20, 15]);
        change(root);
        opened(root, &at(20)).0
    };
    assert_eq!(with(&|_| ()), "images_2");
    let is_full = |what: &str, change: &dyn Fn(&Path)| assert_eq!(with(change), "images", "{what}");
    is_full("one is missing", &|root| fs::remove_file(root.join("images_2/p/5.png")).unwrap());
    is_full("one is of another size", &|root| photo(&root.join("images_2"), "5.png", [22, 17]));
    is_full("one is of another aspect", &|root| photo(&root.join("images_2"), "5.png", [20, 20]));
    is_full("one is no image", &|root| fs::write(root.join("images_2/p/5.png"), "none").unwrap());
    is_full("it is a file", &|root| {
        fs::remove_dir_all(root.join("images_2")).unwrap();
        fs::write(root.join("images_2"), "").unwrap();
    });
    is_full("transparency is lost", &|root| {
        fs::remove_dir_all(root.join("images_2")).unwrap();
        photos(&root.join("images_2"), "jpg", [20, 15]);
    });
    is_full("masks are lost", &|root| {
        let mask = |folder: &str| {
            fs::create_dir_all(root.join(folder).join("p")).unwrap();
            image::GrayImage::from_pixel(40, 30, image::Luma([255])).save(root.join(folder).join("p/3.png")).unwrap();
        };
        mask("masks");
        fs::create_dir_all(root.join("masks_2")).unwrap();
    });
    // Endings may differ.
    let renamed = with(&|root| {
        for folder in ["images", "images_2"] {
            fs::remove_dir_all(root.join(folder)).unwrap();
        }
        photos(&root.join("images"), "JPG", [40, 30]);
        photos(&root.join("images_2"), "bmp", [20, 15]);
    });
    assert_eq!(renamed, "images_2");
}
