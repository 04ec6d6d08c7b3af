//! What a file is, by its first bytes.

use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::scene_file::SOG_META;
use crate::{Error, Result};

/// Kinds of files that come one's way around scenes and datasets. `Display` says it with an article.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A scene or a point cloud.
    Ply,
    /// Something in braces: a transforms.json, perhaps.
    Json,
    /// An SPZ scene.
    Spz,
    /// The name says so too: the rows have no mark.
    Splat,
    /// A scene of mkkellogg's viewer; the name says so.
    Ksplat,
    /// The `meta.json` of an SOG scene in a folder; the name says so.
    Sog,
    /// An archive: of an SOG scene, perhaps.
    Zip,
    /// A compressed stream: an SPZ scene under another name, perhaps.
    Gzip,
    /// Binary, or in JSON if the name says so.
    Gltf,
    /// Tensors, such as a run keeps: its checkpoint is a scene.
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

impl Kind {
    /// Of a file's beginning. `path` is looked at only for what has no mark of its own.
    pub fn of(start: &[u8], path: &Path) -> Kind {
        let ending = |ending: &str| path.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending));
        let text = start.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(start).trim_ascii_start();
        match start {
            [] => Kind::Empty,
            _ if start.starts_with(b"ply\n") || start.starts_with(b"ply\r\n") => Kind::Ply,
            [b'N', b'G', b'S', b'P', ..] => Kind::Spz,
            [b'P', b'K', 3, 4, ..] => Kind::Zip,
            [b'g', b'l', b'T', b'F', ..] => Kind::Gltf,
            [0x76, 0x2f, 0x31, 0x01, ..] => Kind::Exr,
            [0x89, b'P', b'N', b'G', ..] | [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => {
                Kind::Image
            }
            [0x1a, 0x45, 0xdf, 0xa3, ..] | [b'R', b'I', b'F', b'F', _, _, _, _, b'A', b'V', b'I', b' ', ..] => {
                Kind::Video
            }
            // Photos of phones are such containers, too.
            [_, _, _, _, b'f', b't', b'y', b'p', brand @ ..]
                if ![&b"heic"[..], b"heix", b"mif1", b"avif"].iter().any(|photo| brand.starts_with(photo)) =>
            {
                Kind::Video
            }
            // It begins with any numbers, so less than four bytes can be a mark by chance.
            _ if ending("splat") => Kind::Splat,
            // A version before 4 is a whole gzip stream.
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
            _ if text.starts_with(b"{") && path.file_name().is_some_and(|name| name == SOG_META) => Kind::Sog,
            _ if text.starts_with(b"{") => Kind::Json,
            _ if ending("ksplat") => Kind::Ksplat,
            _ if ["mpg", "mpeg", "mts", "m2ts", "wmv", "flv"].into_iter().any(ending) => Kind::Video,
            _ => Kind::Unknown,
        }
    }

    /// Of a file that can be opened.
    pub fn of_file(path: &Path) -> Result<Kind> {
        let fail = |source| Error::io(path, source);
        let mut start = Vec::new();
        File::open(path).map_err(fail)?.take(64).read_to_end(&mut start).map_err(fail)?;
        Ok(Kind::of(&start, path))
    }
}

impl Kind {
    /// Whether a scene can be in such a file, and this build reads it.
    pub fn may_be_scene(self) -> bool {
        let other = matches!(self, Kind::Spz | Kind::Splat | Kind::Sog | Kind::Zip | Kind::Gzip | Kind::Gltf);
        let kept = self == Kind::Safetensors && cfg!(feature = "train");
        self == Kind::Ply || kept || (other && cfg!(feature = "formats"))
    }

    /// What to say after that it is not read, if anything.
    pub(super) fn advice(self) -> &'static str {
        match self {
            Kind::Ksplat => "; export it as PLY",
            Kind::Json => " (where both are arguments, the scene comes before the dataset)",
            Kind::Spz | Kind::Splat | Kind::Sog | Kind::Zip | Kind::Gzip | Kind::Gltf if !self.may_be_scene() => {
                "; this build of glint reads PLY scenes only"
            }
            _ => "",
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Kind::Ply => "a PLY file",
            Kind::Json => "a JSON file",
            Kind::Spz => "an SPZ scene",
            Kind::Splat => "a .splat scene",
            Kind::Ksplat => "a .ksplat scene",
            Kind::Sog => "the description of an SOG scene",
            Kind::Zip => "a ZIP archive",
            Kind::Gzip => "gzip data",
            Kind::Gltf => "a glTF model",
            Kind::Safetensors => "a safetensors file",
            Kind::Exr => "an EXR image",
            Kind::Image => "an image",
            Kind::Video => "a video",
            Kind::Empty => "empty",
            Kind::Unknown => "nothing that glint knows",
        })
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
