//! Work folders know what they were made from.

use std::fs;

use super::{Work, files};

const ENHANCE: &str = "enhance data --base base.ply --method augs --preset quick --ratio 0.2 --work kept";

fn prepared() -> Work {
    let work = Work::new();
    work.ok("train data -o base.ply --iterations 60 --sh-degree 1");
    work.ok(&format!("{ENHANCE} -o first.ply"));
    work
}

impl Work {
    /// Going on from the folder must be refused with one line that says all of `words`.
    #[track_caller]
    fn stale(&self, options: &str, words: &[&str]) {
        self.refused(
            &format!("{ENHANCE} -o x.ply {options}"),
            &[&["kept/settings.json", "another --work"], words].concat(),
        );
    }
}

/// Inverted photographs of the same names and sizes were once taken for the ones before: 13.51 dB for 16.83.
#[test]
fn work_of_other_photos_lenses_and_bases_is_refused() {
    let work = prepared();
    let file = work.path("data/images/d.png");
    let original = fs::read(&file).unwrap();
    let mut photo = image::open(&file).unwrap().into_rgb8();
    image::imageops::invert(&mut photo);
    photo.save(&file).unwrap();
    work.stale("", &["`photos.d.png.pixels_crc32`"]);
    // Another file of the same pixels is the same photograph.
    fs::write(&file, &original).unwrap();
    image::open(&file).unwrap().into_rgba8().save(&file).unwrap();
    work.ok(&format!("{ENHANCE} -o again.ply"));
    fs::write(&file, &original).unwrap();

    let cameras = work.path("data/sparse/0/cameras.txt");
    let plain = fs::read_to_string(&cameras).unwrap();
    fs::write(&cameras, plain.replace("40 40 16 12", "40.5 40 16 12")).unwrap();
    work.stale("", &["camera_crc32"]);
    fs::write(&cameras, "1 RADIAL 32 24 40 16 12 0.02 0\n").unwrap();
    work.stale("", &["pixels_crc32"]);
    fs::write(&cameras, &plain).unwrap();

    let mask = image::GrayImage::from_fn(32, 24, |x, _| image::Luma([255 * u8::from(x > 9)]));
    fs::create_dir(work.path("data/masks")).unwrap();
    mask.save(work.path("data/masks/e.png")).unwrap();
    work.stale("", &["`photos.e.png.pixels_crc32`"]);
    fs::remove_dir_all(work.path("data/masks")).unwrap();
    fs::remove_file(work.path("data/images/f.png")).unwrap();
    work.stale("", &["photos.f.png", "null"]);
    fs::write(work.path("data/images/f.png"), fs::read(work.path("data/images/e.png")).unwrap()).unwrap();
    work.stale("", &["photos.f.png.pixels_crc32"]);

    work.ok("train data -o base.ply --iterations 61 --sh-degree 1 --force");
    work.stale("", &["`base."]);
}

/// Every option is in the settings unless it says that it is not, and is called by its name.
#[test]
fn work_of_other_options_is_refused_and_the_option_named() {
    let work = prepared();
    for (option, key) in [
        ("--seed 5", "`options.seed` was 0 and is 5"),
        ("--ratio 0.3", "`options.ratio` was 0.2 and is 0.3"),
        ("--preset paper", "`options.preset` was \"quick\" and is \"paper\""),
        ("--depth-threshold 0.7", "`options.depth-threshold`"),
        ("--cluster-failure smallest", "`options.cluster-failure`"),
        ("--pca-weights plain", "`options.pca-weights`"),
        ("--bias-correction", "`options.bias-correction` was false and is true"),
        ("--background white", "`resolved`"),
        ("--max-size 16", "`photos.b/c.png.camera_crc32`"),
        ("--holdout 3", "`photos."),
    ] {
        let words: Vec<&str> = option.split(' ').collect();
        // Options that the command has already are replaced.
        let base = ENHANCE.split(' ').collect::<Vec<_>>();
        let kept: Vec<&str> = match base.iter().position(|word| *word == words[0]) {
            Some(at) => [&base[..at], &base[at + 2..]].concat(),
            None => base,
        };
        let command = format!("{} -o x.ply {option}", kept.join(" "));
        work.refused(&command, &["kept/settings.json", key]);
    }
    // What changes nothing in the folder does not count.
    work.ok(&format!("{ENHANCE} -o again.ply --deterministic --lenient"));
    assert_eq!(fs::read(work.path("again.ply")).unwrap(), fs::read(work.path("first.ply")).unwrap());
}

#[test]
fn settings_that_are_gone_or_damaged_are_not_guessed() {
    let work = prepared();
    let settings = work.path("kept/settings.json");
    let text = fs::read_to_string(&settings).unwrap();
    fs::write(&settings, &text[..text.len() / 2]).unwrap();
    work.stale("", &["damaged"]);
    let version = concat!("\"glint\": \"", env!("CARGO_PKG_VERSION"), "\"");
    assert!(text.contains(version));
    fs::write(&settings, text.replace(version, "\"glint\": \"0.0.1\"")).unwrap();
    work.stale("", &["`glint` was \"0.0.1\""]);
    fs::remove_file(&settings).unwrap();
    work.refused(&format!("{ENHANCE} -o x.ply"), &["lifted.safetensors", "no settings.json", "another --work"]);
    fs::write(&settings, &text).unwrap();
    work.ok(&format!("{ENHANCE} -o x.ply"));
}

/// A truncated file was once an error until someone deleted it.
#[test]
fn damaged_pieces_are_made_again_with_a_note() {
    let work = prepared();
    let listing = files(&work.path("kept"));
    let piece = work.path("kept/d.lifted.safetensors");
    let whole = fs::read(&piece).unwrap();
    for damaged in [&whole[..whole.len() - 9], b"", b"no tensors at all"] {
        fs::write(&piece, damaged).unwrap();
        let output = work.run(&format!("{ENHANCE} -o again.ply --json --force"));
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success() && said.contains("note: ") && said.contains("d.lifted.safetensors"), "{said}");
        assert!(said.contains("done again"), "{said}");
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(report["photos_resumed"], 0);
        assert_eq!(fs::read(&piece).unwrap(), whole);
        assert_eq!(fs::read(work.path("again.ply")).unwrap(), fs::read(work.path("first.ply")).unwrap());
        assert_eq!(files(&work.path("kept")), listing);
    }
}
