//! Detects kinds of files by their first bytes, and lists the scene formats: the reader and writer of each,
//! and the data it keeps.
//!
//! All formats are read into the units of [`Gaussians`](crate::scene::Gaussians), in the frame of 3DGS PLY
//! files (x right, y down, z to the front). Numbers are not checked; the caller does that. Readers get a
//! whole file, and trust sizes and counts in a header only as far as the file's own size allows.

#[cfg(feature = "formats")]
mod axes;
#[cfg(feature = "formats")]
mod common;
#[cfg(feature = "formats")]
mod floaters;
#[cfg(feature = "formats")]
mod gltf;
#[cfg(feature = "formats")]
mod inflate;
#[cfg(feature = "formats")]
mod order;
#[cfg(feature = "formats")]
pub(super) mod packed_ply;
#[cfg(feature = "formats")]
mod quantise;
#[cfg(feature = "formats")]
mod rad;
#[cfg(feature = "formats")]
mod rotate;
#[cfg(feature = "formats")]
mod sog;
#[cfg(feature = "formats")]
mod splat;
#[cfg(feature = "formats")]
mod spz;
#[cfg(feature = "formats")]
mod usd;
#[cfg(feature = "formats")]
mod usdz;

use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::ply;
use super::ply_format::is_ply;
use super::scene_file::{SOG_META, SceneFile};
use crate::{Error, Result};

/// Kinds of files that users may pass as scenes or datasets. `Display` gives the name with an article.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A scene or a point cloud.
    Ply,
    /// JSON: perhaps a transforms.json.
    Json,
    /// An SPZ scene.
    Spz,
    /// A `.splat` scene; recognised by its name, since its rows have no mark.
    Splat,
    /// A scene of mkkellogg's viewer; recognised by its name.
    Ksplat,
    /// A tree of Gaussians for Spark.
    Rad,
    /// The `meta.json` of an SOG scene in a folder, or its `lod-meta.json` if it has levels of detail; recognised by these names.
    Sog,
    /// A ZIP archive: perhaps an SOG scene.
    Zip,
    /// A gzip stream: perhaps an SPZ scene under another name.
    Gzip,
    /// glTF: binary, or JSON if the name says so.
    Gltf,
    /// OpenUSD as text.
    Usda,
    /// OpenUSD in binary form, which glint does not read.
    Usdc,
    /// A ZIP archive whose first file is OpenUSD.
    Usdz,
    /// Tensors; a run's checkpoint is also a scene.
    Safetensors,
    /// An image of floats.
    Exr,
    /// A photo.
    Image,
    /// MP4, QuickTime, Matroska, WebM, AVI or MPEG.
    Video,
    /// No bytes.
    Empty,
    /// None of these.
    Unknown,
}

/// Bytes of a file that its kind needs: for an archive, the name of its first file.
const START: u64 = 1 << 10;

/// Whether the first file of a ZIP archive is OpenUSD, by its name.
fn begins_with_a_layer(archive: &[u8]) -> bool {
    let length = archive.get(26..28).map_or(0, |bytes| usize::from(bytes[0]) | usize::from(bytes[1]) << 8);
    let name = archive.get(30..30 + length).unwrap_or_default();
    [&b".usda"[..], b".usdc", b".usd"].iter().any(|ending| name.ends_with(ending))
}

impl Kind {
    /// Detects the kind from the start of a file. Uses `path` only for kinds without a mark of their own.
    pub fn of(start: &[u8], path: &Path) -> Kind {
        let ending = |ending: &str| path.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending));
        let text = start.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(start).trim_ascii_start();
        match start {
            [] => Kind::Empty,
            _ if is_ply(start) => Kind::Ply,
            [b'N', b'G', b'S', b'P', ..] => Kind::Spz,
            [b'P', b'K', 3, 4, ..] if begins_with_a_layer(start) => Kind::Usdz,
            [b'P', b'K', 3, 4, ..] => Kind::Zip,
            [b'R', b'A', b'D', b'0', ..] => Kind::Rad,
            [b'g', b'l', b'T', b'F', ..] => Kind::Gltf,
            _ if start.starts_with(b"#usda ") => Kind::Usda,
            _ if start.starts_with(b"PXR-USDC") => Kind::Usdc,
            [0x76, 0x2f, 0x31, 0x01, ..] => Kind::Exr,
            [0x89, b'P', b'N', b'G', ..] | [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => {
                Kind::Image
            }
            [0x1a, 0x45, 0xdf, 0xa3, ..] | [b'R', b'I', b'F', b'F', _, _, _, _, b'A', b'V', b'I', b' ', ..] => {
                Kind::Video
            }
            // Photos from phones use such containers too.
            [_, _, _, _, b'f', b't', b'y', b'p', brand @ ..]
                if ![&b"heic"[..], b"heix", b"mif1", b"avif"].iter().any(|photo| brand.starts_with(photo)) =>
            {
                Kind::Video
            }
            // A `.splat` starts with arbitrary numbers, so a mark of less than four bytes may be there by
            // chance.
            _ if ending("splat") => Kind::Splat,
            // Versions before 4 are whole gzip streams.
            [0x1f, 0x8b, ..] => {
                if ending("spz") {
                    Kind::Spz
                } else {
                    Kind::Gzip
                }
            }
            [0xff, 0xd8, 0xff, ..] | [b'I', b'I', 42, 0, ..] | [b'M', b'M', 0, 42, ..] | [b'B', b'M', ..] => {
                Kind::Image
            }
            [_, _, _, _, _, _, 0, 0, b'{', ..] => Kind::Safetensors,
            _ if text.starts_with(b"{") && ending("gltf") => Kind::Gltf,
            _ if text.starts_with(b"{")
                && path.file_name().is_some_and(|name| SOG_META.iter().any(|of| name == *of)) =>
            {
                Kind::Sog
            }
            _ if text.starts_with(b"{") => Kind::Json,
            _ if ending("ksplat") => Kind::Ksplat,
            _ if ["mpg", "mpeg", "mts", "m2ts", "wmv", "flv"].into_iter().any(ending) => Kind::Video,
            _ => Kind::Unknown,
        }
    }

    /// Opens a file, and detects its kind.
    pub fn of_file(path: &Path) -> Result<Kind> {
        let fail = |source| Error::io(path, source);
        let mut start = Vec::new();
        File::open(path).map_err(fail)?.take(START).read_to_end(&mut start).map_err(fail)?;
        Ok(Kind::of(&start, path))
    }
}

impl Kind {
    /// The format of such files, and its name for messages.
    fn format(self) -> Option<(&'static SceneFormat, &'static str)> {
        let of = |format: &'static SceneFormat| format.kinds.iter().map(move |&(kind, name)| (kind, (format, name)));
        SceneFormat::ALL.iter().flat_map(of).find(|(kind, _)| *kind == self).map(|(_, found)| found)
    }

    /// The reader of such files, if they may hold a scene and this build has the reader.
    pub(super) fn reader(self) -> Option<Reader> {
        #[cfg(feature = "train")]
        if self == Kind::Safetensors {
            return Some(super::checkpoint::parse);
        }
        self.format()?.0.read
    }

    /// Whether such files may hold a scene that this build can read.
    pub fn may_be_scene(self) -> bool {
        self.reader().is_some()
    }

    /// Advice to append to the message that such a file is not read, if any.
    pub(super) fn advice(self) -> &'static str {
        match self {
            Kind::Ksplat => "; export it as PLY",
            Kind::Usdc => "; convert it to .usda, for example with usdcat",
            Kind::Json => " (where both are arguments, the scene comes before the dataset)",
            _ if self.format().is_some() && !self.may_be_scene() => "; this build of glint reads PLY scenes only",
            _ => "",
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Kind::Json => "a JSON file",
            Kind::Ksplat => "a .ksplat scene",
            Kind::Safetensors => "a safetensors file",
            Kind::Usdc => "an OpenUSD scene in binary form",
            Kind::Exr => "an EXR image",
            Kind::Image => "an image",
            Kind::Video => "a video",
            Kind::Empty => "empty",
            _ => self.format().map_or("nothing that glint knows", |(_, name)| name),
        })
    }
}

/// Reads a scene from a file's bytes. Files that they name are read from the folder, if there is one; the
/// path is only used in errors.
pub(super) type Reader = fn(&[u8], Option<&Path>, &Path) -> Result<SceneFile>;
/// Writes a scene to a file, in the given version or with so many levels of detail, if the format has several. Returns a note for each
/// unexpected change.
#[cfg(feature = "train")]
pub(super) type Writer = fn(&SceneFile, &Path, Option<u8>) -> Result<Vec<String>>;

/// A format of scene files. A build without its reader and writer still names it in messages.
#[derive(Debug, Clone, Copy)]
pub struct SceneFormat {
    /// Ending of the names of written files.
    pub ending: &'static str,
    /// One line for the help: the data that the format keeps.
    pub about: &'static str,
    /// Default version for writing, if the format has several.
    pub(super) version: Option<u8>,
    /// Default number of levels of detail, if the format has any. Its scenes are folders, and `ending` is the name of their description.
    pub levels: Option<u8>,
    /// Whether it keeps a supplement.
    pub keeps_lobes: bool,
    /// Whether it keeps the world position of its coordinates' origin
    /// ([`Scene::origin`](crate::scene::Scene::origin)) and all training settings.
    pub keeps_origin: bool,
    /// Whether it keeps the antialiasing setting.
    pub keeps_antialiased: bool,
    /// Maximum degree of harmonics that the file keeps.
    pub greatest_sh_degree: u32,
    /// Whether the file keeps [color models](crate::scene::color::MODELS) other than harmonics.
    pub keeps_colors: bool,
    /// Kinds of files read as this format, with their names for messages.
    kinds: &'static [(Kind, &'static str)],
    pub(super) read: Option<Reader>,
    #[cfg(feature = "train")]
    pub(super) write: Option<Writer>,
}

/// Common values of most formats.
const USUAL: SceneFormat = SceneFormat {
    ending: "",
    about: "",
    version: None,
    levels: None,
    keeps_lobes: false,
    keeps_origin: true,
    keeps_antialiased: true,
    greatest_sh_degree: 3,
    keeps_colors: false,
    kinds: &[],
    read: None,
    #[cfg(feature = "train")]
    write: None,
};

impl SceneFormat {
    /// All formats. If a name has two of the endings, the later format wins.
    pub const ALL: &[SceneFormat] = &[
        SceneFormat {
            ending: "ply",
            about: "everything, bit for bit",
            keeps_lobes: true,
            keeps_colors: true,
            kinds: &[(Kind::Ply, "a PLY file")],
            read: Some(ply::parse),
            #[cfg(feature = "train")]
            write: Some(super::ply_write::write_file),
            ..USUAL
        },
        SceneFormat {
            ending: "glb",
            about: "glTF with KHR_gaussian_splatting: everything, as 32-bit floats; lobes in an extension of glint's",
            keeps_lobes: true,
            kinds: &[(Kind::Gltf, "a glTF model")],
            #[cfg(feature = "formats")]
            read: Some(gltf::parse),
            #[cfg(feature = "formats")]
            write: Some(gltf::write),
            ..USUAL
        },
        // PLY's reader detects this one by its header.
        SceneFormat {
            ending: "compressed.ply",
            about: "PlayCanvas: positions of 11, 10 and 11 bits within chunks of 256 Gaussians",
            #[cfg(feature = "formats")]
            write: Some(packed_ply::write),
            ..USUAL
        },
        SceneFormat {
            ending: "sog",
            about: "PlayCanvas: positions of 16 bits, colors and sizes by codebooks, in lossless images",
            kinds: &[(Kind::Sog, "the description of an SOG scene"), (Kind::Zip, "a ZIP archive")],
            #[cfg(feature = "formats")]
            read: Some(sog::parse),
            #[cfg(feature = "formats")]
            write: Some(sog::write),
            ..USUAL
        },
        SceneFormat {
            ending: "lod-meta.json",
            about: "PlayCanvas: streamed SOG, a folder with levels of detail; give it as FOLDER/lod-meta.json",
            levels: Some(5),
            #[cfg(feature = "formats")]
            write: Some(sog::write_streamed),
            ..USUAL
        },
        SceneFormat {
            ending: "rad",
            about: "Spark: a tree with levels of detail; colors and sizes of 16 bits, rotations and harmonics as bytes",
            keeps_origin: false,
            keeps_antialiased: false,
            kinds: &[(Kind::Rad, "a RAD scene")],
            #[cfg(feature = "formats")]
            read: Some(rad::parse),
            #[cfg(feature = "formats")]
            write: Some(rad::write),
            ..USUAL
        },
        SceneFormat {
            ending: "spz",
            about: "Niantic, version 4 by default: positions of 24 bits, all else bytes or less; lobes in an extension of glint's",
            version: Some(4),
            keeps_lobes: true,
            // Version 3 and before are gzip data.
            kinds: &[(Kind::Spz, "an SPZ scene"), (Kind::Gzip, "gzip data")],
            #[cfg(feature = "formats")]
            read: Some(spz::parse),
            #[cfg(feature = "formats")]
            write: Some(spz::write),
            ..USUAL
        },
        SceneFormat {
            ending: "usda",
            about: "OpenUSD 26.03 as text: everything but lobes, as 32-bit floats",
            kinds: &[(Kind::Usda, "an OpenUSD scene")],
            #[cfg(feature = "formats")]
            read: Some(usd::parse),
            #[cfg(feature = "formats")]
            write: Some(usd::write),
            ..USUAL
        },
        SceneFormat {
            ending: "usdz",
            about: "a .usda in an archive",
            kinds: &[(Kind::Usdz, "an OpenUSD archive")],
            #[cfg(feature = "formats")]
            read: Some(usdz::parse),
            #[cfg(feature = "formats")]
            write: Some(usdz::write),
            ..USUAL
        },
        SceneFormat {
            ending: "splat",
            about: "positions and sizes, colors and rotations as bytes; no color that depends on the view",
            keeps_origin: false,
            keeps_antialiased: false,
            greatest_sh_degree: 0,
            kinds: &[(Kind::Splat, "a .splat scene")],
            #[cfg(feature = "formats")]
            read: Some(splat::parse),
            #[cfg(feature = "formats")]
            write: Some(splat::write),
            ..USUAL
        },
    ];

    /// The format in one of its versions; `None` if it has none. Only the newest keeps lobes, origin and settings.
    pub fn in_version(self, version: u8) -> Option<SceneFormat> {
        let newest = self.version? == version;
        let (keeps_lobes, keeps_origin) = (self.keeps_lobes && newest, self.keeps_origin && newest);
        Some(SceneFormat { version: Some(version), keeps_lobes, keeps_origin, ..self })
    }

    /// Ending of a name for messages: ".ply"; "lod-meta.json", which is a whole name.
    pub fn shown(&self) -> String {
        if self.levels.is_some() { self.ending.into() } else { format!(".{}", self.ending) }
    }

    /// The format with so many levels of detail; `None` if it has none.
    pub fn with_levels(self, levels: u8) -> Option<SceneFormat> {
        self.levels.map(|_| SceneFormat { levels: Some(levels), ..self })
    }

    /// Finds the format whose ending the name of `path` has.
    pub fn of(path: &Path) -> Option<SceneFormat> {
        let name = path.file_name()?.to_str()?.to_ascii_lowercase();
        let named = |format: &&SceneFormat| match name.strip_suffix(format.ending) {
            // The description of a folder has no stem.
            Some(stem) => {
                if format.levels.is_some() {
                    stem.is_empty()
                } else {
                    stem.ends_with('.')
                }
            }
            None => false,
        };
        Self::ALL.iter().rev().find(named).copied()
    }

    /// Lists the endings of some formats: ".ply, .glb and .sog".
    pub fn endings(which: impl Fn(&SceneFormat) -> bool) -> String {
        let names: Vec<String> = Self::ALL.iter().filter(|f| which(f)).map(SceneFormat::shown).collect();
        match &names[..] {
            [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
            names => names.concat(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_known_by_their_first_bytes() {
        let is = |bytes: &[u8], name: &str, kind| assert_eq!(Kind::of(bytes, Path::new(name)), kind, "{bytes:?}");
        is(b"ply\nformat", "a", Kind::Ply);
        is(b"ply\r\nformat", "a.splat", Kind::Ply);
        is(b"plywood", "a", Kind::Unknown);
        is(b" \n{\"frames\"", "a", Kind::Json);
        is(b"\xEF\xBB\xBF{", "a.txt", Kind::Json);
        is(b"NGSP\x04\0\0\0", "a", Kind::Spz);
        is(b"\x1f\x8b\x08", "a.SPZ", Kind::Spz);
        is(b"\x1f\x8b\x08", "a.tgz", Kind::Gzip);
        is(b"PK\x03\x04", "a.sog", Kind::Zip);
        // The length of the name, that of more fields, and the name.
        let zip = |name: &str| [&b"PK\x03\x04"[..], &[0; 22], &[name.len() as u8, 0, 9, 0], name.as_bytes()].concat();
        for (name, kind) in
            [("a.usda", Kind::Usdz), ("b/c.usdc", Kind::Usdz), (".usd", Kind::Usdz), ("a.png", Kind::Zip)]
        {
            is(&zip(name), "a.sog", kind);
        }
        is(&zip("a.usda")[..35], "a", Kind::Zip);
        is(b"glTF", "a.glb", Kind::Gltf);
        is(b" {\"asset\"", "a.gltf", Kind::Gltf);
        is(b"{\"version\"", "folder/meta.json", Kind::Sog);
        is(b"\x76\x2f\x31\x01", "a", Kind::Exr);
        for image in [&b"\x89PNG"[..], b"\xff\xd8\xff\xe0", b"RIFF\0\0\0\0WEBP", b"II*\0", b"MM\0*", b"BM6"] {
            is(image, "a", Kind::Image);
        }
        for video in [&b"\0\0\0\x18ftypmp42"[..], b"\0\0\0\x14ftypqt  ", b"\x1a\x45\xdf\xa3", b"RIFF\0\0\0\0AVI LIST"] {
            is(video, "a", Kind::Video);
        }
        is(b"\0\0\x01\xba", "a.MPG", Kind::Video);
        is(b"\0\0\0\x18ftypheic", "a.mp4", Kind::Unknown);
        is(b"\x40\x01\0\0\0\0\0\0{\"a\"", "a", Kind::Safetensors);
        is(b"", "a.ply", Kind::Empty);
        is(&[7; 64], "a.splat", Kind::Splat);
        for start in [&b"{\xfd\x72\xc0"[..], b" {", b"\x1f\x8b\x08", b"BM6", b"\xff\xd8\xff", b"\x40\x01\0\0\0\0\0\0{"]
        {
            is(start, "a.splat", Kind::Splat);
        }
        is(b"PK\x03\x04", "a.splat", Kind::Zip);
        is(&[7; 64], "a.ksplat", Kind::Ksplat);
        is(&[7; 64], "a.ply", Kind::Unknown);
        assert_eq!([Kind::Ksplat, Kind::Image].map(Kind::advice), ["; export it as PLY", ""]);
        assert!(Kind::of_file(Path::new("nowhere")).unwrap_err().to_string().contains("nowhere"));
    }
}
