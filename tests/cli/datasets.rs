//! Tests messages about datasets, and the options for reading them.

use std::fs;

use glint::data::write_scene;
use glint::reference::sample::random_scene;

use super::{NAMES, Work};

impl Work {
    /// Edits a file's text.
    pub(super) fn edit(&self, name: &str, change: impl Fn(&str) -> String) {
        let text = fs::read_to_string(self.path(name)).unwrap();
        fs::write(self.path(name), change(&text)).unwrap();
    }

    pub(super) fn notes(&self, arguments: &str) -> String {
        self.said(arguments).lines().filter(|line| line.starts_with("note: ")).collect::<Vec<_>>().join("\n")
    }
}

#[test]
fn photos_folder_model_and_split_can_be_chosen() {
    let work = Work::new();
    let counts = |arguments: &str| {
        let info = work.json(&format!("info data --json {arguments}"));
        [&info["train"], &info["test"]].map(|n| n.as_u64().unwrap())
    };
    assert_eq!(counts(""), [7, 2]);
    assert_eq!(counts("--holdout 3"), [6, 3]);
    assert_eq!(counts("--holdout none"), [9, 0]);
    // Nine cameras on an arc: the sector is the end that starts with a.png.
    assert_eq!(counts("--holdout sector"), [7, 2]);
    work.ok("train data -o sector.ply --iterations 2 --holdout sector");
    let views = work.json("eval sector.ply data --holdout sector --json");
    let names: Vec<&str> = views["views"].as_array().unwrap().iter().map(|v| v["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["a.png", "b/c.png"]);
    // All photos are for training, so nothing is left to evaluate.
    assert_eq!(work.json("train data -o all.ply --iterations 2 --holdout none --json")["photos"], 9);
    work.refused("eval all.ply data --holdout none", &["the test split has no photos", "9 in all"]);
    ["0", "1", "x"].iter().for_each(|bad| work.misused(&format!("info data --holdout {bad}"), "--holdout"));

    fs::rename(work.path("data/images"), work.path("data/pictures")).unwrap();
    work.refused("info data", &["images", "--images"]);
    assert_eq!(counts("--images pictures"), [7, 2]);
    fs::rename(work.path("data/pictures"), work.path("elsewhere")).unwrap();
    assert_eq!(counts("--images elsewhere"), [7, 2]);
    work.refused("info data --images nowhere", &["nowhere", "no folder"]);

    fs::rename(work.path("elsewhere"), work.path("data/input")).unwrap();
    fs::create_dir(work.path("data/sparse/1")).unwrap();
    for file in ["cameras.txt", "images.txt"] {
        fs::copy(work.path("data/sparse/0").join(file), work.path("data/sparse/1").join(file)).unwrap();
    }
    let notes = work.notes("info data");
    assert!(notes.contains("also sparse/1") && notes.contains("input"), "{notes}");
    assert_eq!(work.json("info data --json")["points"], 300);
    assert!(work.json("info data --json --model sparse/1")["points"].is_null());
    work.refused("train data -o x.ply --model sparse/2", &["sparse/2", "sparse/0, sparse/1"]);
}

/// The folder is used if its size matches, unless the user selects the photos or the method of downscaling.
#[test]
fn a_reduced_folder_is_taken_where_its_size_is_asked_for() {
    let work = Work::new();
    for name in NAMES {
        let path = work.path("data/images_2").join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        image::open(work.path("data/images").join(name)).unwrap().thumbnail(16, 12).save(path).unwrap();
    }
    let taken = |options: &str| {
        let notes = work.notes(&format!("train data -o x.ply --force --iterations 2 {options}"));
        notes.contains("the photos in images_2 have the size asked for")
    };
    assert!(taken("--max-size 16"));
    // Neither these nor the full-size photos are overwritten.
    for folder in ["images", "images_2"] {
        let render = format!("render x.ply data --max-size 16 -o data/{folder} --force");
        work.refused(&render, &["data", folder, "read"]);
    }
    for options in ["", "--max-size 12", "--max-size 16 --images images", "--max-size 16 --reduce area"] {
        assert!(!taken(options), "{options}");
    }
}

#[test]
fn missing_photos_are_left_out_with_a_note() {
    let work = Work::new();
    fs::remove_file(work.path("data/images/e.png")).unwrap();
    let notes = work.notes("train data -o x.ply --iterations 2");
    assert!(notes.contains("1 photo of 9 left out") && notes.contains("`e.png`"), "{notes}");
    // The other photos keep their split.
    let views = work.json("eval x.ply data --json");
    let names: Vec<&str> = views["views"].as_array().unwrap().iter().map(|v| v["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["a.png", "i.png"]);
}

/// A regression test: the loss stayed constant, a PLY was written, and the exit code was 0.
#[test]
fn a_dataset_of_which_nothing_can_be_seen_is_refused_before_training() {
    let scaled = |scale: f64| {
        let work = Work::new();
        for (list, position, end) in [("images", 5..8, "\n\n"), ("points3D", 1..4, "\n")] {
            work.edit(&format!("data/sparse/0/{list}.txt"), |text| {
                let moved = |line: &str| {
                    let mut words: Vec<String> = line.split(' ').map(str::to_owned).collect();
                    let place = &mut words[position.clone()];
                    place.iter_mut().for_each(|word| *word = (scale * word.parse::<f64>().unwrap()).to_string());
                    words.join(" ") + end
                };
                text.lines().filter(|line| !line.is_empty()).map(moved).collect()
            });
        }
        work
    };
    scaled(1.0).ok("train data -o x.ply --iterations 1");
    let work = scaled(1e-4);
    work.refused("train data -o x.ply", &["no training photo sees a Gaussian", "near plane", "0.2", "e-4"]);
    let mut base = random_scene(1, 50, 0, 0);
    base.base.means.iter_mut().flatten().for_each(|v| *v *= 1e-4);
    write_scene(work.path("base.ply"), &base).unwrap();
    work.refused("enhance data --base base.ply -o x.ply", &["no training photo sees a Gaussian", "belongs to it"]);
    // A scene behind most cameras: a note reports that those see nothing.
    let work = Work::new();
    let turned = |text: &str| {
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        // The fourth photo looks away: its axes are rotated by π about y.
        let mut words: Vec<String> = lines[6].split(' ').map(str::to_owned).collect();
        let [w, x, y, z] = [1, 2, 3, 4].map(|i| words[i].clone());
        let minus = |v: String| v.strip_prefix('-').map_or(format!("-{v}"), str::to_owned);
        for (i, v) in [minus(y), z, w, minus(x)].into_iter().enumerate() {
            words[i + 1] = v;
        }
        [5, 7].into_iter().for_each(|i| words[i] = minus(words[i].clone()));
        lines[6] = words.join(" ");
        lines.join("\n") + "\n"
    };
    work.edit("data/sparse/0/images.txt", turned);
    let notes = work.notes("train data -o x.ply --iterations 1");
    assert!(notes.contains("1 of 7 training photos see no Gaussian"), "{notes}");
}

/// A fully masked photo is left out of evaluations; if all are masked, training and evaluation are errors.
#[test]
fn photos_that_masks_hide_whole_are_left_out() {
    let work = Work::new();
    let black = image::GrayImage::new(32, 24);
    let hide = |name: &str| {
        let path = work.path("data/masks").join(format!("{name}.png"));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        black.save(path).unwrap();
    };
    work.ok("train data -o base.ply --iterations 20");
    let all = work.json("eval base.ply data --json");
    hide("a.png");
    for command in ["eval base.ply data", "report data base=base.ply -o page"] {
        let notes = work.notes(command);
        assert!(notes.contains("1 photo left out"), "{command}: {notes}");
    }
    let found = work.json("eval base.ply data --json");
    assert_eq!(found["views"], serde_json::json!([all["views"][1]]));
    assert_eq!(found["base"], all["views"][1]["base"]);
    let page = fs::read_to_string(work.path("page/index.html")).unwrap();
    assert!(page.contains("render of i.png") && !page.contains("a.png"));
    hide("i.png");
    work.refused("eval base.ply data", &["nothing to compare", "2 photos"]);
    hide(NAMES[1]);
    for command in
        ["train data -o some.ply --iterations 20", "enhance data --base base.ply -o some.ply --force --ratio 0.05"]
    {
        let notes = work.notes(command);
        assert!(notes.contains("1 photo left out"), "{command}: {notes}");
        assert_eq!(notes.contains("nothing to compare"), command.starts_with("enhance"), "{command}: {notes}");
    }
    NAMES.iter().for_each(|name| hide(name));
    work.refused("train data -o none.ply --iterations 20", &["no pixel of the training photos counts"]);
    work.refused("enhance data --base base.ply -o none.ply", &["no pixel of the training photos counts"]);
    assert!(!work.path("none.ply").exists());
}

/// A third of each training photo is masked noise: the result is better than training on the noise.
#[test]
fn masks_keep_what_they_hide_out_of_the_scene() {
    let work = Work::new();
    for name in NAMES {
        let file = work.path("data/images").join(name);
        let mut photo = image::open(&file).unwrap().into_rgb8();
        let (mut mask, mut state) = (image::GrayImage::from_pixel(32, 24, image::Luma([255])), 1u32);
        for (x, y, pixel) in photo.enumerate_pixels_mut() {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // At different places in each photo, so that others show the hidden part.
            if (x + y / 2 + u32::from(name.as_bytes()[0])) % 12 < 4 {
                pixel.0 = [(); 3].map(|()| (state >> 24) as u8);
                mask.put_pixel(x, y, image::Luma([0]));
            }
        }
        // The test photos stay unchanged.
        if name != "a.png" && name != "i.png" {
            photo.save_with_format(&file, image::ImageFormat::Png).unwrap();
            let path = work.path("data/masks").join(format!("{name}.png"));
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            mask.save(path).unwrap();
        }
    }
    let psnr = |scene: &str| work.json(&format!("eval {scene} data --json"))["augmented"]["psnr"].as_f64().unwrap();
    let notes = work.notes("train data -o masked.ply --iterations 300");
    assert!(notes.contains("7 photos of 9"), "{notes}");
    assert_eq!(work.json("info data --json")["masked"], 7);
    // The comparison with a masked photo only covers the unmasked part.
    let judged = work.json("eval masked.ply data --split train --json");
    fs::rename(work.path("data/masks"), work.path("unused")).unwrap();
    work.ok("train data -o noisy.ply --iterations 300");
    let (masked, noisy) = (psnr("masked.ply"), psnr("noisy.ply"));
    assert!(masked > noisy + 1.0, "{masked} dB with masks, {noisy} dB without");
    let unmasked = work.json("eval masked.ply data --split train --json");
    let of = |v: &serde_json::Value| v["augmented"]["psnr"].as_f64().unwrap();
    assert!(of(&judged) > of(&unmasked) + 3.0, "{judged} {unmasked}");
}

#[test]
fn files_of_other_kinds_are_called_what_they_are() {
    let work = Work::new();
    fs::write(work.path("x.ksplat"), [7; 64]).unwrap();
    fs::write(work.path("x.safetensors"), b"\x40\x01\0\0\0\0\0\0{\"a\"").unwrap();
    work.refused("info x.ksplat", &["x.ksplat", ".ksplat scene", "expected a scene"]);
    work.refused("eval x.ksplat data", &["x.ksplat", ".ksplat scene", "not a scene"]);
    for (file, word) in [("x.ksplat", ".ksplat scene"), ("x.safetensors", "safetensors")] {
        work.refused(&format!("train {file} -o x.ply"), &[file, word, "COLMAP"]);
    }
    // Faults of a scene are reported by its reader.
    fs::write(work.path("x.splat"), [7; 65]).unwrap();
    fs::write(work.path("x.spz"), b"\x1f\x8b\x08\0\0\0").unwrap();
    fs::write(work.path("y.spz"), b"NGSP\x04\0\0\0").unwrap();
    fs::write(work.path("x.sog"), b"PK\x03\x04").unwrap();
    for (file, word) in [
        ("x.splat", "32 bytes"),
        ("x.spz", "gzip"),
        ("y.spz", "SPZ scene"),
        ("x.sog", "ZIP archive"),
        ("x.safetensors", "not a valid safetensors file"),
    ] {
        for command in [format!("info {file}"), format!("eval {file} data"), format!("convert {file} x.ply")] {
            work.refused(&command, &[file, word]);
        }
        work.refused(&format!("train {file} -o x.ply"), &[file, "COLMAP"]);
    }
    work.refused("info data/images/a.png", &["a.png", "is an image"]);
}

/// Common mistakes of new users. The message is part of the contract.
#[test]
fn mistakes_get_the_next_step() {
    let work = Work::new();
    let base = random_scene(4, 60, 0, 0);
    write_scene(work.path("base.ply"), &base).unwrap();
    fs::create_dir_all(work.path("photos/images")).unwrap();
    for name in ["a.png", "d.png"] {
        fs::copy(work.path("data/images").join(name), work.path("photos/images").join(name)).unwrap();
    }
    fs::write(work.path("clip.mov"), b"\0\0\0\x14ftypqt  ").unwrap();
    fs::write(work.path("x.zip"), b"PK\x03\x04").unwrap();
    fs::create_dir(work.path("features")).unwrap();
    fs::write(work.path("features/database.db"), "").unwrap();
    fs::create_dir(work.path("above")).unwrap();
    fs::rename(work.path("data"), work.path("above/data")).unwrap();
    // Every command that takes a dataset.
    for command in ["train {} -o x.ply", "enhance {} --base base.ply -o x.ply", "eval base.ply {}", "info {}"] {
        let refused = |path: &str, words: &[&str]| work.refused(&command.replace("{}", path), words);
        refused(
            "photos",
            &["photos: found 2 photos but no camera poses; run COLMAP to find them, see docs/datasets.md"],
        );
        refused("features", &["features: found a COLMAP database but no model", "run COLMAP's mapper, see docs"]);
        refused("above", &["above: no dataset here, but one folder deeper: give above/data"]);
        refused("above/data/images", &["no dataset here, but in the folder above: give ", "above/data"]);
        refused("~/data", &["~/data: the shell has not expanded `~`", "write \"$HOME/data\" instead"]);
        let video = "clip.mov: is a video; extract photos from it with ffmpeg and find their poses with COLMAP, see docs/datasets.md";
        refused("clip.mov", &[video]);
        if !command.starts_with("info") {
            refused("x.zip", &["x.zip: is a ZIP archive, not a dataset; expected a folder with a COLMAP model"]);
            refused("base.ply", &["base.ply: is a PLY file, not a dataset", "the scene comes before the dataset"]);
        }
    }
    fs::rename(work.path("above/data"), work.path("data")).unwrap();
    work.refused("eval data base.ply", &["data: is a folder", "the scene comes before the dataset"]);
    fs::write(work.path("transforms.json"), "{\"frames\": []}").unwrap();
    work.refused(
        "eval transforms.json base.ply",
        &["is a JSON file, not a scene", "the scene comes before the dataset"],
    );
    for ending in ["spz", "splat", "glb", "sog", "compressed.ply"] {
        let then = format!("expected a name such as a.ply; then `glint convert a.ply a.{ending}`");
        for command in ["train data -o", "enhance data --base base.ply -o"] {
            work.refused(&format!("{command} a.{ending}"), &["the output is a PLY scene", &then]);
        }
    }
    for (option, meant) in
        [("--iteration", "--iterations"), ("--sh", "--sh-degree"), ("--num-gaussians", "--gaussians")]
    {
        let similar = format!("a similar argument exists: '{meant}'");
        work.misused(&format!("train data -o x.ply {option} 3"), &similar);
    }
    work.refused("train data -o ~/x.ply", &["~/x.ply: the shell has not expanded `~`"]);
    work.refused("train data -o x.ply --init=~/x.ply", &["the shell has not expanded `~`"]);
}

/// A regression test: it aborted, since there was no memory for that many random points.
#[test]
fn absurd_numbers_are_refused_before_there_is_room_for_them() {
    let work = Work::new();
    let refused = |options: &str, words: &[&str]| work.refused(&format!("train data -o x.ply {options}"), words);
    let most = ["memory holds", "expected no more"];
    for strategy in ["", "--strategy mcmc", "--precision half"] {
        refused(&format!("--gaussians 3000000000 {strategy}"), &[&["--gaussians 3000000000"], &most[..]].concat());
    }
    // The number of points is limited by the existing ones.
    work.ok("train data -o y.ply --points 3000000000 --iterations 1");
    // Photos are never enlarged.
    work.ok("train data -o z.ply --max-size 4294967295 --iterations 1");
    fs::remove_file(work.path("data/sparse/0/points3D.txt")).unwrap();
    refused("--points 4294967295", &[&["--points 4294967295"], &most[..]].concat());
    refused("--gaussians 3000000000", &most);
    work.misused("train data -o x.ply --iterations 4294967295", "--iterations");
}
