//! Error messages for paths that are not a dataset, with the next step.

use std::fs;
use std::path::{Path, PathBuf};

use super::formats::Kind;
use super::left_out::counted;
use super::names;
use super::scene_file::is_scene_folder;
use super::{folders, transforms};

/// The page that explains how to make a dataset.
const PAGE: &str = "see docs/datasets.md";
const ORDER: &str = "where both are arguments, the scene comes before the dataset";
/// How many folders a message names.
const NAMED: usize = 3;

/// The message for a file that is not a transforms.json.
pub(super) fn of_file(kind: Kind) -> String {
    let expected = "expected a folder with a COLMAP model or transforms.json, or such a JSON file";
    match kind {
        Kind::Video => {
            format!("is a video; extract photos from it with ffmpeg and find their poses with COLMAP, {PAGE}")
        }
        kind if kind.may_be_scene() => format!("is {kind}, not a dataset; {expected} ({ORDER})"),
        kind => format!("is {kind}; {expected}"),
    }
}

/// Contents of a folder that is not a dataset.
enum Found {
    Scene,
    /// Datasets in it.
    Deeper(Vec<PathBuf>),
    /// The dataset that it is a part of.
    Above(PathBuf),
    /// Photos, and their number.
    Photos(usize),
    Nothing,
}

impl Found {
    fn of(path: &Path) -> Found {
        if is_scene_folder(path) {
            return Found::Scene;
        }
        let mut folders: Vec<PathBuf> =
            entries(path).into_iter().filter(|entry| entry.is_dir() && is_dataset(entry)).collect();
        folders.sort();
        if !folders.is_empty() {
            return Found::Deeper(folders);
        }
        let above = path.canonicalize().ok().and_then(|path| Some(path.parent()?.to_owned()));
        if let Some(above) = above.filter(|above| is_dataset(above)) {
            return Found::Above(above);
        }
        match names::count_photos(path) {
            0 => Found::Nothing,
            count => Found::Photos(count),
        }
    }
}

/// Number of photos in a folder for which there are no camera poses, neither in it nor next to it.
pub fn photos_without_poses(path: &Path) -> usize {
    match Found::of(path) {
        Found::Photos(count) if !is_dataset(path) => count,
        _ => 0,
    }
}

/// The message for a folder without a dataset.
pub(super) fn of_folder(path: &Path) -> String {
    match Found::of(path) {
        Found::Scene => return format!("holds an SOG scene, not a dataset ({ORDER})"),
        Found::Deeper(folders) => {
            let named: Vec<String> = folders.iter().take(NAMED).map(|folder| folder.display().to_string()).collect();
            let more = folders.len().checked_sub(NAMED).filter(|&n| n > 0).map(|n| format!(" and {n} more"));
            let (named, more) = (named.join(", "), more.unwrap_or_default());
            return format!("no dataset here, but one folder deeper: give {named}{more}");
        }
        Found::Above(above) => return format!("no dataset here, but in the folder above: give {}", above.display()),
        Found::Photos(count) => {
            let found = counted(count, "photo");
            return format!("found {found} but no camera poses; run COLMAP to find them, {PAGE}");
        }
        Found::Nothing => {}
    }
    if path.join("database.db").is_file() {
        return format!("found a COLMAP database but no model with camera poses; run COLMAP's mapper, {PAGE}");
    }
    let video = entries(path).into_iter().find(|entry| Kind::of_file(entry).is_ok_and(|kind| kind == Kind::Video));
    if let Some(video) = video {
        return format!("no dataset here, but {}, which {}", video.display(), of_file(Kind::Video));
    }
    format!(
        "no dataset here; expected a folder with a COLMAP model (sparse/0/cameras.bin or .txt, and images/), with \
         transforms_train.json or transforms.json, or a path to such a JSON file ({PAGE})"
    )
}

fn is_dataset(folder: &Path) -> bool {
    transforms::find(folder).is_some() || folders::is_dataset(folder)
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_next_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str| {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, if name.ends_with("mp4") { &b"\0\0\0\x18ftypmp42"[..] } else { b"x" }).unwrap();
        };
        let of = |name: &str| of_folder(&folder.path().join(name));
        put("empty/notes.txt");
        assert!(of("empty").contains("expected a folder with a COLMAP model"), "{}", of("empty"));
        put("clip/a.mp4");
        assert!(of("clip").contains("a.mp4, which is a video; extract photos"), "{}", of("clip"));
        put("photos/a.jpg");
        assert_eq!(photos_without_poses(&folder.path().join("photos")), 1);
        put("photos/images/b.PNG");
        put("photos/images/more/c.tif");
        assert!(of("photos").starts_with("found 3 photos but no camera poses; run COLMAP"), "{}", of("photos"));
        put("deep/garden/sparse/0/cameras.bin");
        put("deep/garden/images/a.jpg");
        let garden = folder.path().join("deep/garden");
        // A dataset, the folder above it, and its photos.
        let images = garden.join("images");
        assert_eq!([&garden, &folder.path().join("deep"), &images].map(|path| photos_without_poses(path)), [0; 3]);
        for name in ["b", "c", "d"] {
            put(&format!("deep/{name}/transforms.json"));
        }
        let many = of("deep");
        assert!(many.contains("deep/b, ") && many.ends_with("deep/d and 1 more"), "{many}");
        assert_eq!(of("deep/garden/sparse"), of("deep/garden/images"), "a model alone is none");
        put("scene/meta.json");
        assert!(of("scene").contains("SOG scene, not a dataset") && of("scene").contains("before the dataset"));
        assert!(of_file(Kind::Ply).contains("before the dataset") && of_file(Kind::Ply).contains("transforms.json"));
        assert!(!of_file(Kind::Image).contains("scene") && of_file(Kind::Video).contains("docs/datasets.md"));
    }
}
