//! Tests SOG.

use std::{collections::BTreeMap, io::Cursor};

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder, codecs::webp::WebPEncoder};
use serde_json::{Value, json};

use super::*;

fn zip(files: &BTreeMap<String, Vec<u8>>) -> Vec<u8> {
    archive(&files.iter().map(|(name, bytes)| (&name[..], &bytes[..])).collect::<Vec<_>>())
}

fn webp(width: u32, pixels: &[[u8; 4]]) -> Vec<u8> {
    let mut out = Vec::new();
    let height = pixels.len() as u32 / width;
    let encoder = WebPEncoder::new_lossless(&mut out);
    encoder.encode(pixels.as_flattened(), width, height, ExtendedColorType::Rgba8).unwrap();
    out
}

/// Two Gaussians of degree 1, built from the format's description.
fn files() -> (Value, BTreeMap<String, Vec<u8>>) {
    let rest = [0; 4];
    let image = |first: [u8; 4], second: [u8; 4]| webp(4, &[first, second, rest, rest]);
    let codebook = |scale: f64| (0..256).map(|v| f64::from(v) * scale).collect::<Vec<_>>();
    let meta = json!({
        "version": 2,
        "asset": {"generator": "a test"},
        "count": 2,
        "means": {"mins": [0, -1, -2], "maxs": [1, 1, 2], "files": ["l.webp", "u.webp"]},
        "scales": {"codebook": codebook(1.0), "files": ["scales.webp"]},
        "quats": {"files": ["quats.webp"]},
        "sh0": {"codebook": codebook(1.0 / 256.0), "files": ["sh0.webp"]},
        "shN": {"count": 2, "bands": 1, "files": ["palette.webp", "labels.webp"],
                "codebook": codebook(-1.0)},
    });
    let mut palette = vec![[0, 0, 0, 255]; 64 * 3];
    palette[..6].copy_from_slice(&[1, 2, 3, 4, 5, 6].map(|v| [v, 10 * v, 20 * v, 255]));
    let files = [
        ("l.webp", image([0, 255, 0x55, 255], [255, 0, 0, 255])),
        ("u.webp", image([0, 255, 0x55, 255], [255, 0, 0x80, 255])),
        ("scales.webp", image([0, 7, 255, 255], [1, 2, 3, 255])),
        ("quats.webp", image([0, 255, 204, 253], [127, 127, 127, 252])),
        ("sh0.webp", image([0, 64, 128, 51], [1, 2, 3, 255])),
        ("labels.webp", image([1, 0, 0, 255], [0, 0, 0, 255])),
        ("palette.webp", webp(64 * 3, &palette)),
        ("meta.json", meta.to_string().into_bytes()),
    ];
    (meta, files.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect())
}

/// Reads the files after a change.
fn changed(change: impl FnOnce(&mut Value, &mut BTreeMap<String, Vec<u8>>)) -> Result<SceneFile, String> {
    let (mut meta, mut files) = files();
    change(&mut meta, &mut files);
    files.insert("meta.json".into(), meta.to_string().into_bytes());
    read("a.sog", &zip(&files))
}

#[test]
fn pixels_are_read_as_described() {
    let file = changed(|_, _| {}).unwrap();
    let base = &file.scene.base;
    assert_eq!((base.len(), base.sh_degree, file.trained_with.antialiased), (2, 1, None));
    // sign(v) (e^|v| − 1) of 0, 1, and −2 + 4/3; then of 1, −1 and −2 + 4 · 0x8000/65535.
    let value = |v: f64| v.signum() * (v.abs().exp() - 1.0);
    let wanted =
        [[0.0, value(1.0), value(-2.0 / 3.0)], [value(1.0), value(-1.0), value(-2.0 + 4.0 * 32768.0 / 65535.0)]];
    for (mean, wanted) in base.means.iter().zip(wanted) {
        assert!(vector(*mean).iter().zip(wanted).all(|(a, b)| (a - b).abs() < ROUNDING), "{mean:?} {wanted:?}");
    }
    assert_eq!(base.log_scales, [[0.0, 7.0, 255.0], [1.0, 2.0, 3.0]]);
    assert_eq!(base.sh[..4], [[0.0, 0.25, 0.5], [-4.0, -40.0, -80.0], [-5.0, -50.0, -100.0], [-6.0, -60.0, -120.0]]);
    assert_eq!(
        base.sh[4..],
        [[1.0, 2.0, 3.0].map(|v| v / 256.0), [-1.0, -10.0, -20.0], [-2.0, -20.0, -40.0], [-3.0, -30.0, -60.0]]
    );
    assert!((opacity(base, 0)[0] - 0.2).abs() < ROUNDING && opacity(base, 1)[0] > 0.998);
    let root = 0.5f64.sqrt();
    // Alpha 253: the second, x, is the largest; w, y and z are −√½, √½ and 0.6 √½, too long in total, so
    // nothing is left for x.
    assert!(vector(base.quats[0]).iter().zip([-root, 0.0, root, 0.6 * root]).all(|(a, b)| (a - b).abs() < ROUNDING));
    assert!(base.quats[1][0] > 0.999 && base.quats[1][1..].iter().all(|v| v.abs() < 0.003));
}

/// SuperSplat's format from before August 2025, according to its readers.
#[test]
fn version_1_has_ranges_in_the_place_of_codebooks() {
    let first = |version: Value| {
        changed(|meta, _| {
            let range = |mins: Value, maxs: Value, files: Value| json!({"shape": [2, 3], "dtype": "float32", "mins": mins, "maxs": maxs, "files": files});
            let quats = meta["quats"].clone();
            *meta = json!({
                "means": range(json!([0, -1, -2]), json!([1, 1, 2]), json!(["l.webp", "u.webp"])),
                "scales": range(json!([0, -5, -1]), json!([0, 5, 50]), json!(["scales.webp"])),
                "quats": {"shape": [2, 4], "dtype": "uint8", "encoding": "quaternion_packed", "files": quats["files"]},
                "sh0": range(json!([0, 0, -1, -5]), json!([2.55, 5.1, 1.55, 5.2]), json!(["sh0.webp"])),
                "shN": {"shape": [2, 9], "dtype": "float32", "mins": -2.55, "maxs": 2.55, "quantization": 8, "files": ["palette.webp", "labels.webp"]},
            });
            if !version.is_null() {
                meta["version"] = version;
            }
        })
    };
    let second = changed(|_, _| {}).unwrap().scene.base;
    let base = first(Value::Null).unwrap().scene.base;
    assert_eq!((base.len(), base.sh_degree), (2, 1));
    assert_eq!((&base.means, &base.quats), (&second.means, &second.quats));
    // Bytes 0, 7, 255 and 1, 2, 3.
    let scales = [0.0, -5.0 + 70.0 / 255.0, 50.0, 0.0, -5.0 + 20.0 / 255.0, -1.0 + 153.0 / 255.0];
    assert!(near(base.log_scales.as_flattened(), &scales), "{:?}", base.log_scales);
    // 0, 64, 128 and 1, 2, 3; opacities of 51 and 255 are logits.
    assert!(near(&base.sh[0], &[0.0, 1.28, 0.28]) && near(&base.sh[4], &[0.01, 0.04, -0.97]), "{:?}", base.sh);
    assert!(near(&base.opacities, &[-5.0 + 10.2 * 0.2, 5.2]), "{:?}", base.opacities);
    // The second entry: 4, 40, 80 of the 256 steps of 0.02.
    assert!(near(&base.sh[1], &[-2.55 + 0.08, -2.55 + 0.8, -2.55 + 1.6]), "{:?}", base.sh[1]);
    assert!(near(&base.sh[5], &[-2.55 + 0.02, -2.55 + 0.2, -2.55 + 0.4]), "{:?}", base.sh[5]);
    assert_eq!(first(json!(1)).unwrap().scene.base, base);
    says(first(json!(3)), &["version 3; 1 and 2 are read"]);
    let short = changed(|meta, _| {
        let quats = meta["quats"].clone();
        let one =
            |n: usize| json!({"shape": [2, n], "mins": vec![0; n], "maxs": vec![1; n], "files": ["l.webp", "u.webp"]});
        *meta = json!({"means": one(3), "scales": one(3), "quats": quats, "sh0": one(3)});
    });
    says(short, &["sh0 have `mins` and `maxs` of 3 channels"]);
}

#[test]
fn harmonics_without_bands_need_no_images() {
    let file = changed(|meta, _| meta["shN"] = json!({"count": 0, "bands": 0, "codebook": [], "files": []})).unwrap();
    let base = &file.scene.base;
    assert_eq!(
        (base.len(), base.sh_degree, &base.sh[..]),
        (2, 0, &[[0.0, 0.25, 0.5], [1.0, 2.0, 3.0].map(|v| v / 256.0)][..])
    );
}

#[test]
fn archives_and_folders_and_png_are_read_alike() {
    let wanted = changed(|_, _| {}).unwrap();
    let (mut meta, mut files) = files();
    let nested = files.iter().map(|(name, bytes)| (format!("scene/{name}"), bytes.clone())).collect();
    assert_eq!(read("nested.zip", &zip(&nested)).unwrap(), wanted);
    let mut png = Vec::new();
    let pixels = [[1, 0, 0, 255], [0, 0, 0, 255], [0; 4], [0; 4]];
    PngEncoder::new(&mut png).write_image(pixels.as_flattened(), 2, 2, ExtendedColorType::Rgba8).unwrap();
    files.insert("labels.png".into(), png);
    meta["shN"]["files"][1] = "labels.png".into();
    files.insert("meta.json".into(), meta.to_string().into_bytes());
    let folder = tempfile::tempdir().unwrap();
    files.iter().for_each(|(name, bytes)| fs::write(folder.path().join(name), bytes).unwrap());
    assert_eq!(read_scene_file(folder.path()).unwrap(), wanted);
    assert_eq!(read_scene_file(folder.path().join("meta.json")).unwrap(), wanted);
    for name in ["../x.webp", "/etc/passwd", "", "none.webp"] {
        meta["sh0"]["files"][0] = name.into();
        fs::write(folder.path().join("meta.json"), meta.to_string()).unwrap();
        let error = read_scene(folder.path()).unwrap_err().to_string();
        assert!(error.contains("meta.json") && error.contains(&format!("names `{name}`")), "{error}");
    }
}

#[test]
fn what_is_written_comes_back_within_half_a_step() {
    for (count, degree) in [(300, 3), (1, 0), (70, 1), (1000, 2)] {
        let scene = sample(17, count, degree);
        let (back, bytes) = round_trip(&scene, "sog");
        let b = &back.base;
        assert_eq!((b.len(), b.sh_degree), (count, degree));
        let a = &scene.base.reordered(&nearest(&scene.base, &b.means));
        let log =
            |g: &Gaussians, i: usize| means(g, i).iter().map(|v| v.signum() * v.abs().ln_1p()).collect::<Vec<_>>();
        let all = |of: &dyn Fn(usize) -> Vec<f64>| (0..count).flat_map(of).collect::<Vec<_>>();
        let range = |values: &[f64]| {
            values.iter().copied().fold(f64::MIN, f64::max) - values.iter().copied().fold(f64::MAX, f64::min)
        };
        // Half of 1/65,535 of an axis, at most the longest.
        assert!(largest(a, b, log) <= 0.5 * range(&all(&|i| log(a, i))) / 65535.0 + ROUNDING);
        assert!(largest(a, b, opacity) <= 0.5 / 255.0 + ROUNDING);
        // A codebook of 256 has at most the mean square error of even steps over the range.
        let coded = |of: &dyn Fn(&Gaussians, usize) -> Vec<f64>, what: &str| {
            let (a, b) = (all(&|i| of(a, i)), all(&|i| of(b, i)));
            let mean_square = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64;
            let step = range(&a) / 256.0;
            assert!(mean_square <= step * step / 12.0 + ROUNDING * ROUNDING, "{what}: {mean_square} {step}");
        };
        coded(&log_scales, "scales");
        coded(&harmonics(0), "colors");
        if degree > 0 {
            coded(&|g, i| (1..=degree as usize).flat_map(|band| harmonics(band)(g, i)).collect(), "harmonics");
        }
        // Half a step of √½/127.5 in each of three components, see SPZ's test.
        let worst = turned(a, b);
        assert!(worst <= 2.0 * 2.0 * 3f64.sqrt() * 0.5 * 0.5f64.sqrt() / 127.5, "{worst}");
        assert_eq!(round_trip(&scene, "sog").1, bytes, "the same scene is the same file");
    }
    // Other programs expect these names.
    let (_, bytes) = round_trip(&sample(1, 5, 1), "sog");
    let archive = zip::ZipArchive::new(Cursor::new(&bytes)).unwrap();
    let names: Vec<String> = archive.file_names().map(|name| name.unwrap().into_owned()).collect();
    for name in [
        "meta.json",
        "means_l.webp",
        "means_u.webp",
        "scales.webp",
        "quats.webp",
        "sh0.webp",
        "shN_centroids.webp",
        "shN_labels.webp",
    ] {
        assert!(names.iter().any(|found| found == name), "{name}: {names:?}");
    }
}

#[test]
fn what_is_not_understood_is_said() {
    type Change<'a> = &'a dyn Fn(&mut Value, &mut BTreeMap<String, Vec<u8>>);
    let says = |change: Change<'_>, words: &[&str]| says(changed(change), words);
    let set = |at: &str, value: Value| {
        let at = at.to_owned();
        move |meta: &mut Value, _: &mut BTreeMap<String, Vec<u8>>| *meta.pointer_mut(&at).unwrap() = value.clone()
    };
    says(&set("/version", json!(3)), &["SOG version 3"]);
    says(&|meta, _| drop(meta.as_object_mut().unwrap().remove("version")), &["no version", "not understood", "mins"]);
    says(&set("/count", json!(5)), &["`l.webp` has 4 pixels, expected 5 or more of means"]);
    says(&set("/count", json!(u64::MAX)), &["4 pixels"]);
    says(&set("/count", json!(-1)), &["`meta.json` is not understood"]);
    says(&set("/means/files", json!(["l.webp"])), &["names 1 images of means"]);
    says(&set("/means/mins", json!([1, 2])), &["`meta.json` is not understood"]);
    says(&set("/scales/codebook", json!([1, 2])), &["scales have entry 7 of a codebook of 2"]);
    says(&set("/sh0/files", json!(["none.webp"])), &["`none.webp` in the archive cannot be read"]);
    says(&set("/shN/bands", json!(4)), &["4 bands"]);
    says(&set("/shN/bands", json!(2)), &["192 pixels wide, expected 512 of 2 bands"]);
    says(&set("/shN/count", json!(1)), &["labels is 1, expected less than 1"]);
    says(&set("/shN/count", json!(65)), &["has 64 entries, expected 65"]);
    says(&set("/shN/codebook", json!([0])), &["shN have entry"]);
    says(&set("/means/mins", json!([1e300, 0, 0])), &["row 0", "`x` is not a finite number"]);
    let (mut meta, mut files) = files();
    // In x, the first is at the start of the range, the second at its end.
    meta["means"]["maxs"][0] = 1e300.into();
    files.insert("meta.json".into(), meta.to_string().into_bytes());
    dropped("a.sog", &zip(&files), 1, 1);
    says(
        &|_, files| drop(files.insert("sh0.webp".into(), b"RIFF\0\0\0\0WEBP".to_vec())),
        &["`sh0.webp` cannot be decoded"],
    );
    says(&|_, files| drop(files.insert("sh0.webp".into(), vec![7; 90])), &["`sh0.webp` is no WebP or PNG image"]);
    let quats = webp(4, &[[0, 0, 0, 251], [0; 4], [0; 4], [0; 4]]);
    says(&|_, files| drop(files.insert("quats.webp".into(), quats.clone())), &["pixel 0 of the quats has alpha 251"]);
    refused("a.zip", &zip(&BTreeMap::from([("a.txt".into(), vec![1])])), &["without `meta.json`", "not an SOG scene"]);
}

/// An image of nine million equal pixels takes a few kilobytes.
#[test]
fn images_that_are_far_larger_than_their_file_are_refused() {
    let side = 3000u32;
    let mut image = Vec::new();
    let pixels = vec![0; 4 * side as usize * side as usize];
    WebPEncoder::new_lossless(&mut image).encode(&pixels, side, side, ExtendedColorType::Rgba8).unwrap();
    let bomb = changed(|_, files| drop(files.insert("l.webp".into(), image)));
    says(bomb, &["3000 × 3000 pixels", "expected no more than"]);
}

#[test]
fn damage_is_an_error() {
    let (_, files) = files();
    damage("damaged.sog", &zip(&files), |_| false);
}

/// The archive's checksums shield its files from [`damage`], so these are changed before packing.
#[test]
fn damage_within_an_archives_files_is_an_error() {
    let (_, files) = files();
    for (name, whole) in &files {
        let judge = |bytes: Vec<u8>| {
            let mut files = files.clone();
            files.insert(name.clone(), bytes);
            if let Err(error) = parse_scene(&zip(&files), Path::new("a.sog")) {
                assert!(error.to_string().contains("a.sog"), "{error}");
            }
        };
        let places = || (0..whole.len()).step_by(whole.len().div_ceil(150));
        places().for_each(|length| judge(whole[..length].to_vec()));
        for (at, change) in places().flat_map(|at| [(at, 0x01), (at, 0x80), (at, 0xff)]) {
            let mut bytes = whole.clone();
            bytes[at] ^= change;
            judge(bytes);
        }
    }
}
