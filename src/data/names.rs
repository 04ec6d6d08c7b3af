//! Files by names that other systems wrote: with backslashes, in another case, with another ending or none.

use std::cell::OnceCell;
use std::collections::HashMap;
use std::fs;
use std::path::{Component, Path, PathBuf};

/// Endings of image files that are read.
pub(super) const ENDINGS: [&str; 7] = ["png", "jpg", "jpeg", "webp", "tif", "tiff", "bmp"];
/// A folder with more files than this is no folder of photos; what lies beyond is not looked at.
const MAX_FILES: usize = 1_000_000;

/// Looks files up below a folder.
pub(super) struct Finder {
    folder: PathBuf,
    /// Made when a name is not there as it is written.
    listing: OnceCell<Listing>,
}

/// Image files by lower-case relative name, and by that without its ending.
#[derive(Default)]
struct Listing {
    names: HashMap<String, Vec<PathBuf>>,
    stems: HashMap<String, Vec<PathBuf>>,
}

impl Finder {
    pub(super) fn new(folder: impl Into<PathBuf>) -> Finder {
        Finder { folder: folder.into(), listing: OnceCell::new() }
    }

    /// Where a file of this name would be.
    pub(super) fn expected(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// The image file that `name` means, and whether it is written otherwise. `None` where there is none, or more than one.
    pub(super) fn find(&self, name: &str) -> Option<(PathBuf, bool)> {
        let literal = self.expected(name);
        if literal.is_file() {
            return Some((literal, false));
        }
        let plain = slashes(name);
        let here = self.folder.join(&plain);
        if here.is_file() {
            return Some((here, true));
        }
        // NeRF Synthetic leaves the ending out.
        if without_ending(&plain) == plain {
            let with = ENDINGS.iter().map(|ending| self.folder.join(format!("{plain}.{ending}")));
            if let Some(found) = with.into_iter().find(|path| path.is_file()) {
                return Some((found, false));
            }
        }
        let listing = self.listing.get_or_init(|| list(&self.folder));
        let name = plain.to_lowercase();
        let only = |found: Option<&Vec<PathBuf>>| match found.map(Vec::as_slice) {
            Some([one]) => Some((one.clone(), true)),
            _ => None,
        };
        only(listing.names.get(&name))
            .or_else(|| only(listing.stems.get(&name)))
            .or_else(|| only(listing.stems.get(without_ending(&name))))
    }

    /// The mask of the photo `name`: COLMAP's `a.jpg.png`, else `a.jpg`, else `a` with any ending.
    pub(super) fn find_mask(&self, name: &str) -> Option<PathBuf> {
        let colmaps = self.folder.join(format!("{}.png", slashes(name)));
        if colmaps.is_file() { Some(colmaps) } else { self.find(name).map(|found| found.0) }
    }
}

/// `name` with `/` between folders and without `.` parts, as it is compared and shown.
pub(super) fn slashes(name: &str) -> String {
    let parts = name.split(['/', '\\']).filter(|part| !part.is_empty() && *part != ".");
    let joined = parts.collect::<Vec<_>>().join("/");
    // An absolute name stays one.
    if name.starts_with('/') { format!("/{joined}") } else { joined }
}

/// `name` without the ending of an image file, if it has one.
pub(super) fn without_ending(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((stem, end)) if !stem.is_empty() && ENDINGS.iter().any(|known| end.eq_ignore_ascii_case(known)) => stem,
        _ => name,
    }
}

/// `name` without what could lead out of a folder, so that outputs may be named after photos.
pub(super) fn clean(name: &str) -> String {
    let parts = Path::new(name).components().filter_map(|part| match part {
        // guard: names within a folder (2 lines)
        Component::Normal(part) => Some(part.to_string_lossy()),
        _ => None,
    });
    parts.collect::<Vec<_>>().join("/")
}

fn list(root: &Path) -> Listing {
    let mut listing = Listing::default();
    let (mut folders, mut count) = (vec![(root.to_owned(), String::new())], 0);
    while let Some((folder, prefix)) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let (path, Ok(name)) = (entry.path(), entry.file_name().into_string()) else { continue };
            let name = format!("{prefix}{name}");
            count += 1;
            if count > MAX_FILES {
                return listing;
            }
            // Links to folders could lead round in circles.
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                folders.push((path, format!("{name}/")));
            } else if without_ending(&name) != name {
                let lower = name.to_lowercase();
                listing.stems.entry(without_ending(&lower).to_owned()).or_default().push(path.clone());
                listing.names.entry(lower).or_default().push(path);
            }
        }
    }
    listing
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        folder
    }

    #[test]
    fn a_name_finds_its_file_however_it_is_written() {
        let folder = folder(&[
            "a.png",
            "sub/B.JPG",
            "c.webp",
            "r_0.5.png",
            "two.png",
            "two.jpg",
            "Case.png",
            "case.PNG",
            "x.txt",
        ]);
        let finder = Finder::new(folder.path());
        let find = |name: &str| {
            let (path, respelled) = finder.find(name)?;
            Some((path.strip_prefix(folder.path()).unwrap().to_str().unwrap().to_owned(), respelled))
        };
        let is = |name: &str, file: &str, respelled| assert_eq!(find(name), Some((file.into(), respelled)), "{name}");
        is("a.png", "a.png", false);
        is("./a", "a.png", false);
        is("A.PNG", "a.png", true);
        is("a.jpeg", "a.png", true);
        is("sub\\b.jpg", "sub/B.JPG", true);
        is("sub\\B.JPG", "sub/B.JPG", true);
        is("SUB/b.png", "sub/B.JPG", true);
        is("c", "c.webp", false);
        is("r_0.5", "r_0.5.png", false);
        is("R_0.5.tif", "r_0.5.png", true);
        is("Case.png", "Case.png", false);
        // Which one is meant cannot be told, or nothing is.
        for name in ["two.tif", "CASE.png", "sub/a.png", "b.jpg", "x", "x.txt/a", "", "sub"] {
            assert_eq!(find(name), None, "{name}");
        }
        assert_eq!(find("x.txt"), Some(("x.txt".into(), false)));
    }

    /// COLMAP calls the mask of `a.jpg` `a.jpg.png`, others `a.png`.
    #[test]
    fn masks_are_found_by_either_custom() {
        let both = folder(&["a.jpg.png", "a.JPG.png", "a.png", "sub/b.png", "c.PNG.png"]);
        let finder = Finder::new(both.path());
        let is = |name: &str, file: &str| assert_eq!(finder.find_mask(name), Some(both.path().join(file)), "{name}");
        is("a.jpg", "a.jpg.png");
        is("a.JPG", "a.JPG.png");
        is("sub\\b.jpg", "sub/b.png");
        is("a.png", "a.png");
        is("c.png", "c.PNG.png");
        assert_eq!(finder.find_mask("d.jpg"), None);
    }

    #[test]
    fn names_cannot_lead_out_of_a_folder() {
        assert_eq!(clean("./train/r_0"), "train/r_0");
        assert_eq!(clean("../../etc/passwd"), "etc/passwd");
        assert_eq!(clean("/abs/x.png"), "abs/x.png");
        assert_eq!(clean(".."), "");
    }

    #[test]
    fn only_endings_of_images_are_endings() {
        assert_eq!(["a.png", "a.TIFF", "r_0.5", ".jpg", "a"].map(without_ending), ["a", "a", "r_0.5", ".jpg", "a"]);
        assert_eq!(["a\\b//./c.png", "./a", "/abs/x.png"].map(slashes), ["a/b/c.png", "a", "/abs/x.png"]);
    }
}
