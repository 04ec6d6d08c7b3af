//! Tests scene formats other than PLY: round trips, handmade files, damaged files, and renders of real
//! scenes.

mod far;
mod gltf;
mod packed_ply;
mod rad;
mod readers;
mod round_trips;
#[path = "../common/shared.rs"]
mod shared;
mod sog;
mod splat;
mod spz;
mod streamed;
mod usd;

use std::{
    fs,
    io::{Cursor, Write},
    path::{Path, PathBuf},
};

use glint::{
    data::{
        PartOf, SceneFile, SceneFormat, TrainedWith, parse_scene, read_scene, read_scene_file,
        read_scene_file_leniently, write_scene_as, write_scene_file,
    },
    reference::sample::random_scene,
    scene::{Gaussians, Lobes, Scene, Supplement},
};
use shared::shared;
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

/// Gaussians like those of a trained scene, without a supplement.
fn sample(seed: u64, count: usize, sh_degree: u32) -> Scene {
    random_scene(seed, count, 0, sh_degree)
}

/// A scene that other viewers show with lower opacities.
fn faded(scene: Scene) -> SceneFile {
    let mut shown = scene.base.clone();
    shown.opacities.iter_mut().for_each(|v| *v -= 0.5);
    SceneFile { shown: Some(shown), ..scene.into() }
}

/// The format of files with this name.
fn format(name: &str) -> SceneFormat {
    SceneFormat::of(Path::new(name)).unwrap()
}

fn spz(version: u8) -> SceneFormat {
    format("a.spz").in_version(version).unwrap()
}

/// The name of a scene in `folder`.
fn named(folder: &Path, stem: &str, format: SceneFormat) -> PathBuf {
    if format.levels.is_some() {
        folder.join(stem).join(format.ending)
    } else {
        folder.join(format!("{stem}.{}", format.ending))
    }
}

/// Writes `scene` as a file with this ending and reads it; returns the result and the file's bytes.
#[track_caller]
fn round_trip(scene: &Scene, ending: &str) -> (Scene, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("scene.{ending}"));
    write_scene_file(&path, &SceneFile::from(scene.clone())).unwrap();
    (read_scene(&path).unwrap(), fs::read(&path).unwrap())
}

/// Writes and reads a file; returns the result, and the notes of writing.
fn kept(file: &SceneFile, format: SceneFormat) -> (SceneFile, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let path = named(folder.path(), "a", format);
    let notes = write_scene_as(&path, format, file).unwrap();
    (read_scene_file(&path).unwrap(), notes)
}

/// An archive of compressed files.
fn archive(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        zip.start_file(*name, SimpleFileOptions::default().compression_method(CompressionMethod::Deflated)).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// Reads these bytes under this name.
fn read(name: &str, bytes: &[u8]) -> Result<SceneFile, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    read_scene_file(&path).map_err(|error| error.to_string())
}

/// Checks that these bytes are refused with an error that names the file and all of `words`.
#[track_caller]
fn refused(name: &str, bytes: &[u8], words: &[&str]) {
    says(read(name, bytes), &[&[name], words].concat());
}

/// Checks that a file was refused with an error that contains all of `words`.
#[track_caller]
fn says(result: Result<SceneFile, String>, words: &[&str]) {
    let message = result.map(drop).unwrap_err();
    assert!(words.iter().all(|word| message.contains(word)), "expected {words:?}: {message}");
}

/// Checks that the strict reader refuses the file by row, and that the lenient one drops `gone` Gaussians and
/// keeps `left`.
#[track_caller]
fn dropped(name: &str, bytes: &[u8], gone: usize, left: usize) {
    refused(name, bytes, &["row "]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    let (file, dropped) = read_scene_file_leniently(&path).unwrap();
    assert_eq!((dropped.base, file.scene.base.len()), (gone, left), "{name}");
    assert!(dropped.first.is_some_and(|first| first.starts_with("row ")));
}

/// Truncates a file at every length and changes every byte. Each must give a scene or an error that names the
/// file. A truncated file must be refused, unless its length is one of `whole`.
#[track_caller]
fn damage(name: &str, bytes: &[u8], whole: impl Fn(usize) -> bool) {
    for length in 0..bytes.len() {
        match parse_scene(&bytes[..length], Path::new(name)) {
            Ok(_) => assert!(whole(length), "{name} of {length} bytes is read"),
            Err(error) => assert!(error.to_string().contains(name) && !whole(length), "{length} bytes: {error}"),
        }
    }
    let mut changed = bytes.to_vec();
    for (at, change) in (0..bytes.len()).flat_map(|at| [(at, 0x01), (at, 0x80), (at, 0xff)]) {
        changed[at] ^= change;
        if let Err(error) = parse_scene(&changed, Path::new(name)) {
            assert!(error.to_string().contains(name), "{error}");
        }
        changed[at] = bytes[at];
    }
}

/// Largest difference of a quantity over all Gaussians.
fn largest(a: &Gaussians, b: &Gaussians, of: impl Fn(&Gaussians, usize) -> Vec<f64>) -> f64 {
    assert_eq!(a.len(), b.len());
    let pairs = (0..a.len()).flat_map(|i| of(a, i).into_iter().zip(of(b, i)).collect::<Vec<_>>());
    // NaN counts as an infinite difference.
    pairs.map(|(a, b)| if a.is_finite() && b.is_finite() { (a - b).abs() } else { f64::INFINITY }).fold(0.0, f64::max)
}

/// For each of `means`, the index of the nearest Gaussian of `all`.
fn nearest(all: &Gaussians, means: &[[f32; 3]]) -> Vec<usize> {
    let distance = |i: usize, mean: &[f32; 3]| -> f32 { (0..3).map(|k| (all.means[i][k] - mean[k]).powi(2)).sum() };
    let of = |mean| (0..all.len()).min_by(|&a, &b| distance(a, mean).total_cmp(&distance(b, mean))).unwrap();
    means.iter().map(of).collect()
}

/// Whether lists have equal lengths and numbers that are almost equal.
fn near(a: &[f32], b: &[f32]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5)
}

fn vector<const N: usize>(values: [f32; N]) -> Vec<f64> {
    values.map(f64::from).to_vec()
}

fn means(g: &Gaussians, i: usize) -> Vec<f64> {
    vector(g.means[i])
}

fn log_scales(g: &Gaussians, i: usize) -> Vec<f64> {
    vector(g.log_scales[i])
}

/// Opacity, 0 to 1.
fn opacity(g: &Gaussians, i: usize) -> Vec<f64> {
    vec![1.0 / (1.0 + (-f64::from(g.opacities[i])).exp())]
}

/// Coefficients of degree `degree`.
fn harmonics(degree: usize) -> impl Fn(&Gaussians, usize) -> Vec<f64> {
    move |g, i| {
        let k = g.sh_coefficients();
        g.sh[i * k..][degree * degree..(degree + 1) * (degree + 1)].iter().flat_map(|&rgb| vector(rgb)).collect()
    }
}

/// The largest angle between the rotations of two sets, radians.
fn turned(a: &Gaussians, b: &Gaussians) -> f64 {
    let unit = |q: [f32; 4]| {
        let q = q.map(f64::from);
        let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
        q.map(|v| v / length)
    };
    let angle = |(&a, &b): (&[f32; 4], &[f32; 4])| {
        let (a, b) = (unit(a), unit(b));
        let sign = if a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
        // From the chord: the cosine is insensitive to small angles.
        let chord = a.iter().zip(b).map(|(a, b)| (a - sign * b).powi(2)).sum::<f64>().sqrt();
        4.0 * (chord / 2.0).min(1.0).asin()
    };
    a.quats.iter().zip(&b.quats).map(angle).fold(0.0, f64::max)
}

/// Relative rounding error of float32.
const ROUNDING: f64 = 1e-6;

#[test]
fn a_name_says_what_is_written_and_others_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scene = SceneFile::from(sample(1, 3, 0));
    for name in ["scene", "scene.obj", "splat", "scene.ksplat"] {
        let refused = write_scene_file(folder.path().join(name), &scene).unwrap_err().to_string();
        assert!(refused.contains(name) && refused.contains("ending ply"), "{refused}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    assert_eq!(format("a/b.PLY").ending, "ply");
}

/// Formats keep the training settings, or a note names the missing ones.
#[test]
fn what_a_scene_was_trained_with_is_kept_or_missed() {
    let trained_with = TrainedWith {
        background: Some([1.0, 0.5, 0.0]),
        antialiased: Some(true),
        max_size: Some(400),
        exposure: Some(true),
        matte: Some(true),
        part: Some(PartOf { plan: 0xfe, part: 3, of: 8, complete: true }),
    };
    for &format in SceneFormat::ALL {
        let ending = format.ending;
        for supplementary in if format.keeps_lobes { &[0, 3][..] } else { &[0] } {
            let (back, notes) =
                kept(&SceneFile { trained_with, ..random_scene(1, 20, *supplementary, 1).into() }, format);
            let (found, said) = (back.trained_with, notes.join("; "));
            match ending {
                "rad" | "splat" => {
                    assert_eq!(found, TrainedWith::default());
                    assert!(said.contains("--background 1,0.5,0 --compensate --max-size 400"), "{said}");
                }
                _ => assert_eq!((found, &said[..]), (trained_with, ""), "{ending}"),
            }
        }
        // Missing defaults need no note.
        let plain = TrainedWith { background: Some([0.0; 3]), antialiased: Some(false), ..Default::default() };
        let (back, notes) = kept(&SceneFile { trained_with: plain, ..sample(1, 20, 1).into() }, format);
        assert_eq!(notes, [""; 0], "{ending}");
        let found = back.trained_with;
        assert!(found == if format.keeps_origin { plain } else { TrainedWith::default() }, "{ending}: {found:?}");
    }
}

/// A regression test: the smallest width of a lobe was rounded to one that is refused.
#[test]
fn numbers_at_the_ends_of_what_is_accepted_are_read_again() {
    let ends = [-f32::MAX, -1e6, -f32::MIN_POSITIVE, 0.0, f32::MIN_POSITIVE, 1e6, f32::MAX];
    type Change = fn(&mut Gaussians, &mut Lobes, usize, f32);
    let changes: [(&str, Change); 7] = [
        ("log_scales", |g, _, i, v| g.log_scales[i][i % 3] = v),
        ("quats", |g, _, i, v| g.quats[i] = [0.0, v, v, 1e-30]),
        ("opacities", |g, _, i, v| g.opacities[i] = v),
        ("sh", |g, _, i, v| g.sh[4 * i + i % 4] = [v, 0.5, v]),
        ("directions", |_, l, i, v| l.directions[i] = [v, 1e-30, v]),
        ("widths", |_, l, i, v| l.widths[i] = v.clamp(0.01, 1.0)),
        ("sharpness", |_, l, i, v| l.sharpness[i] = v),
    ];
    for (what, change) in changes {
        for &format in SceneFormat::ALL {
            let mut scene = random_scene(4, 2 * ends.len(), ends.len(), 1);
            let Supplement { gaussians, lobes } = scene.supplement.as_mut().unwrap();
            for (i, v) in ends.into_iter().enumerate() {
                change(&mut scene.base, &mut lobes.clone(), i, v);
                change(gaussians, lobes, i, v);
            }
            if !format.keeps_lobes {
                scene.supplement = None;
            }
            let count = |scene: &Scene| (scene.base.len(), scene.supplement.as_ref().map(|s| s.gaussians.len()));
            let (back, notes) = kept(&scene.clone().into(), format);
            assert_eq!(count(&back.scene), count(&scene), "{what} in {}: {notes:?}", format.ending);
        }
    }
}
