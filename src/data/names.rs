//! Finds files by names that other systems wrote: with backslashes, in another case or Unicode form, with
//! another ending or none, in folders of another machine.

use std::cell::OnceCell;
use std::collections::HashMap;
use std::fs;
use std::path::{Component, Path, PathBuf};

use unicode_normalization::UnicodeNormalization;

/// Endings of supported image files.
pub(super) const ENDINGS: [&str; 7] = ["png", "jpg", "jpeg", "webp", "tif", "tiff", "bmp"];
/// Maximum number of files to list: a folder with more is not a folder of photos.
const MAX_FILES: usize = 1_000_000;

/// Looks files up below a folder.
pub(super) struct Finder {
    folder: PathBuf,
    /// Listing of the folder, made when a name is not found as written.
    listing: OnceCell<Listing>,
}

/// Image and PLY files, found by the [`key`] of the relative name, of the relative name without ending (images), and of the bare name.
#[derive(Default)]
struct Listing {
    names: HashMap<String, Vec<PathBuf>>,
    stems: HashMap<String, Vec<PathBuf>>,
    bare: HashMap<String, Vec<(String, PathBuf)>>,
}

impl Listing {
    /// The files whose relative names end with `tail`, in any folder except those of masks.
    fn below(&self, tail: &str) -> impl Iterator<Item = &PathBuf> {
        let tail = key(tail);
        let same = self.bare.get(bare(&tail)).into_iter().flatten();
        let ends = move |name: &str| name.strip_suffix(&tail).is_some_and(|before| before.ends_with('/'));
        same.filter(move |(name, _)| ends(name) && !name.starts_with("mask")).map(|(_, path)| path)
    }
}

impl Finder {
    pub(super) fn new(folder: impl Into<PathBuf>) -> Finder {
        Finder { folder: folder.into(), listing: OnceCell::new() }
    }

    /// Path of a file with exactly this name.
    pub(super) fn expected(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// The image file for `name`, and whether it is spelled differently. `None` if there is none, or more
    /// than one.
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
        // NeRF Synthetic omits the ending.
        if without_ending(&plain) == plain {
            let with = ENDINGS.iter().map(|ending| self.folder.join(format!("{plain}.{ending}")));
            if let Some(found) = with.into_iter().find(|path| path.is_file()) {
                return Some((found, false));
            }
        }
        let (listing, name) = (self.listing(), key(&plain));
        let only = |found: Option<&Vec<PathBuf>>| match found.map(Vec::as_slice) {
            Some([one]) => Some((one.clone(), true)),
            _ => None,
        };
        only(listing.names.get(&name))
            .or_else(|| only(listing.stems.get(&name)))
            .or_else(|| only(listing.stems.get(without_ending(&name))))
            .or_else(|| {
                let meant = unescape(plain.trim()).filter(|meant| *meant != plain)?;
                self.find(&meant).map(|(path, _)| (path, true))
            })
    }

    /// [`Finder::find`], then the tails of `name`, which may start with folders of another machine.
    pub(super) fn find_moved(&self, name: &str) -> Option<(PathBuf, bool)> {
        let plain = slashes(name);
        self.find(name).or_else(|| tails(&plain).skip(1).find_map(|tail| self.find(tail)).map(|(path, _)| (path, true)))
    }

    /// Looks for the longest tail of `name` that has a folder, in any folder except those of masks.
    ///
    /// # Errors
    /// If two files match. The message names both.
    pub(super) fn find_below(&self, name: &str) -> Result<Option<PathBuf>, String> {
        let plain = slashes(name);
        for tail in tails(&plain).filter(|tail| tail.contains('/')) {
            let mut below = self.listing().below(tail);
            match (below.next(), below.next()) {
                (Some(a), Some(b)) => {
                    let [a, b] = [a, b].map(|path| path.display());
                    return Err(format!("`{name}` may be {a} or {b}; --images names the folder of the photos"));
                }
                (Some(path), None) => return Ok(Some(path.clone())),
                _ => {}
            }
        }
        Ok(None)
    }

    /// The mask of the photo `name`: COLMAP's `a.jpg.png`, else `a.jpg`, else `a` with any ending.
    pub(super) fn find_mask(&self, name: &str) -> Option<PathBuf> {
        let colmaps = format!("{}.png", slashes(name));
        self.find(&colmaps).or_else(|| self.find(name)).map(|found| found.0)
    }

    /// [`Finder::find_mask`] by the longest tail of the photo's name.
    pub(super) fn find_mask_of_tail(&self, name: &str) -> Option<PathBuf> {
        tails(&slashes(name)).find_map(|tail| self.find_mask(tail))
    }

    fn listing(&self) -> &Listing {
        self.listing.get_or_init(|| list(&self.folder))
    }
}

/// Normalised form of names for comparison: lower case, and composed, since macOS stores a letter and its
/// accent separately.
fn key(name: &str) -> String {
    composed(&name.to_lowercase())
}

/// The Unicode form NFC.
pub(super) fn composed(name: &str) -> String {
    name.nfc().collect()
}

/// Normalised form of names in two lists: with `/`, composed, without the ending.
pub(super) fn compared(name: &str) -> String {
    composed(without_ending(&slashes(name)))
}

/// The part after the last `/`.
fn bare(name: &str) -> &str {
    name.rsplit_once('/').map_or(name, |(_, bare)| bare)
}

/// `name`, then `name` without its first folder, and so on.
pub(super) fn tails(name: &str) -> impl Iterator<Item = &str> {
    std::iter::successors(Some(name), |name| name.split_once('/').map(|(_, tail)| tail))
}

/// Whether a name starts at the root of some system: `/home/x`, `C:\x`, `\\server\x`.
pub(super) fn is_absolute(name: &str) -> bool {
    let drive =
        name.as_bytes().first_chunk().is_some_and(|[letter, colon]| letter.is_ascii_alphabetic() && *colon == b':');
    drive || name.starts_with(['/', '\\'])
}

/// `name` with `/` between folders and without `.` parts, for comparison and display.
pub(super) fn slashes(name: &str) -> String {
    let parts = name.split(['/', '\\']).filter(|part| !part.is_empty() && *part != ".");
    let joined = parts.collect::<Vec<_>>().join("/");
    // An absolute name stays absolute.
    if name.starts_with('/') { format!("/{joined}") } else { joined }
}

/// `name` without the ending of an image file, if it has one.
pub(super) fn without_ending(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((stem, end)) if !stem.is_empty() && ENDINGS.iter().any(|known| end.eq_ignore_ascii_case(known)) => stem,
        _ => name,
    }
}

/// Decodes the percent escapes (`%20`) of a URI; `None` if they are invalid.
pub(super) fn unescape(uri: &str) -> Option<String> {
    let mut out = Vec::new();
    let mut bytes = uri.bytes();
    while let Some(byte) = bytes.next() {
        out.push(match byte {
            b'%' => {
                let digit = |byte: u8| char::from(byte).to_digit(16);
                let (high, low) = (digit(bytes.next()?)?, digit(bytes.next()?)?);
                u8::try_from(16 * high + low).ok()?
            }
            byte => byte,
        });
    }
    String::from_utf8(out).ok()
}

/// `name` without parts that could lead out of a folder, so that outputs can be named after photos.
pub(super) fn clean(name: &str) -> String {
    let parts = Path::new(name).components().filter_map(|part| match part {
        // guard: names within a folder (2 lines)
        Component::Normal(part) => Some(part.to_string_lossy()),
        _ => None,
    });
    parts.collect::<Vec<_>>().join("/")
}

/// Counts the image files in a folder and below it.
pub(super) fn count_photos(folder: &Path) -> usize {
    list(folder).stems.values().map(Vec::len).sum()
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
            // Links to folders could form cycles.
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                folders.push((path, format!("{name}/")));
                continue;
            }
            let (key, is_image) = (key(&name), without_ending(&name) != name);
            if is_image {
                listing.stems.entry(without_ending(&key).to_owned()).or_default().push(path.clone());
            }
            if is_image || key.ends_with(".ply") {
                listing.bare.entry(bare(&key).to_owned()).or_default().push((key.clone(), path.clone()));
                listing.names.entry(key).or_default().push(path);
            }
        }
    }
    listing
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A folder of empty files.
    pub fn folder(names: &[&str]) -> tempfile::TempDir {
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
            "my photo.png",
            "50%20.png",
        ]);
        let finder = Finder::new(folder.path());
        let find = |name: &str| {
            let (path, respelled) = finder.find(name)?;
            Some((path.strip_prefix(folder.path()).unwrap().to_str().unwrap().to_owned(), respelled))
        };
        let is = |name: &str, file: &str, respelled| assert_eq!(find(name), Some((file.into(), respelled)), "{name}");
        is("a.png", "a.png", false);
        is("./a", "a.png", false);
        is("sub\\B.JPG", "sub/B.JPG", true);
        is("SUB/b.png", "sub/B.JPG", true);
        is("c", "c.webp", false);
        is("r_0.5", "r_0.5.png", false);
        is("R_0.5.tif", "r_0.5.png", true);
        is("Case.png", "Case.png", false);
        is("my%20photo.png", "my photo.png", true);
        is("My photo.png ", "my photo.png", true);
        is("50%20.png", "50%20.png", false);
        // Ambiguous names, and names without a file.
        for name in ["two.tif", "CASE.png", "sub/a.png", "b.jpg", "x", "x.txt/a", "", "sub"] {
            assert_eq!(find(name), None, "{name}");
        }
        assert_eq!(find("x.txt"), Some(("x.txt".into(), false)));
    }

    #[test]
    fn names_of_another_machine_are_found_by_their_longest_tail() {
        let there = ["images/p.png", "p.png", "a/sub/q.png", "b/sub/q.png", "b/one/r.JPG", "masks/one/r.jpg"];
        let folder = folder(&there);
        let finder = Finder::new(folder.path());
        let relative = |path: PathBuf| path.strip_prefix(folder.path()).unwrap().to_str().unwrap().to_owned();
        for (name, file) in [
            ("../images/p.png", "images/p.png"),
            ("/home/x/photos/p.png", "p.png"),
            ("/home/x/d/b/sub/q.png", "b/sub/q.png"),
        ] {
            let (path, respelled) = finder.find_moved(name).unwrap();
            assert_eq!((relative(path), respelled), (file.into(), true), "{name}");
        }
        assert_eq!(
            finder.find_moved("images/p.png").map(|(path, other)| (relative(path), other)),
            Some(("images/p.png".into(), false))
        );
        let absolute = folder.path().join("images/p.png");
        assert_eq!(finder.find_moved(absolute.to_str().unwrap()), Some((absolute, false)));
        // A file in a folder of another name may be another picture.
        assert_eq!(finder.find_moved("/home/x/images/q.png"), None);
        assert_eq!(finder.find_below("/home/x/images/q.png"), Ok(None));
        assert_eq!(finder.find_below("D:/y/one/R.jpg").unwrap().map(relative), Some("b/one/r.JPG".into()));
        let both = finder.find_below("/home/x/sub/q.png").unwrap_err();
        assert!(["a/sub/q.png", "b/sub/q.png", "--images"].iter().all(|part| both.contains(part)), "{both}");
        assert_eq!(
            ["/a", "C:\\a", "c:/a", "\\\\s\\a", "a/b", "a", "", "ab:"].map(is_absolute),
            [1, 1, 1, 1, 0, 0, 0, 0].map(|n| n == 1)
        );
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
