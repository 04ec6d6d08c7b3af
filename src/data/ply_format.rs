//! Parses the PLY container: header, elements and rows, independent of their meaning.
//!
//! Format: Greg Turk, "The PLY Polygon File Format", 1994, in its three encodings. Numbers are returned as
//! f64, which represents every value of every PLY type exactly.
//!
//! Many readers only accept files with one element. Further elements form a block after the rows of the
//! declared ones, announced in comments: `comment glint element NAME ROWS` and `comment glint property TYPE
//! NAME`, the usual lines after two more words. If a tool keeps the comments but drops the block, the file
//! stays valid.
//!
//! `comment origin X Y Z` is the world position of the coordinate origin, in decimal numbers; for other
//! comments see `trained_with`.

use std::collections::HashSet;
use std::path::Path;

use glam::DVec3;

use super::trained_with::TrainedWith;
use crate::{Error, Result};

/// Maximum length of a header: splats of SH degree 3 need 1.6 KB.
const MAX_HEADER: usize = 1 << 20;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Number {
    fn from_name(name: &str) -> Option<Number> {
        Some(match name {
            "char" | "int8" => Number::I8,
            "uchar" | "uint8" => Number::U8,
            "short" | "int16" => Number::I16,
            "ushort" | "uint16" => Number::U16,
            "int" | "int32" => Number::I32,
            "uint" | "uint32" => Number::U32,
            "float" | "float32" => Number::F32,
            "double" | "float64" => Number::F64,
            _ => return None,
        })
    }

    pub(super) fn bytes(self) -> usize {
        match self {
            Number::I8 | Number::U8 => 1,
            Number::I16 | Number::U16 => 2,
            Number::I32 | Number::U32 | Number::F32 => 4,
            Number::F64 => 8,
        }
    }

    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Number::F32 | Number::F64)
    }

    /// Decodes `bytes`, which must have length `self.bytes()`.
    fn decode(self, bytes: &[u8], big: bool) -> f64 {
        let mut raw = [0u8; 8];
        // Little-endian in the low bytes of `raw`, for either byte order of the file.
        for (i, &byte) in bytes.iter().take(8).enumerate() {
            raw[if big { bytes.len() - 1 - i } else { i }] = byte;
        }
        let [a, b, c, d, ..] = raw;
        match self {
            Number::I8 => a as i8 as f64,
            Number::U8 => a as f64,
            Number::I16 => i16::from_le_bytes([a, b]) as f64,
            Number::U16 => u16::from_le_bytes([a, b]) as f64,
            Number::I32 => i32::from_le_bytes([a, b, c, d]) as f64,
            Number::U32 => u32::from_le_bytes([a, b, c, d]) as f64,
            Number::F32 => f32::from_le_bytes([a, b, c, d]) as f64,
            Number::F64 => f64::from_le_bytes(raw),
        }
    }

    /// Parses float32 as such, so that it is rounded only once.
    fn parse(self, text: &str) -> Option<f64> {
        let number = match self {
            Number::F32 => text.parse::<f32>().ok().map(f64::from),
            _ => text.parse::<f64>().ok(),
        };
        number.or_else(|| is_nan_of_windows(text).then_some(f64::NAN))
    }
}

/// Windows writes NaN as `-nan(ind)` or `1.#QNAN`.
pub(super) fn is_nan_of_windows(word: &str) -> bool {
    let lower = word.to_ascii_lowercase();
    ["nan(", "#ind", "#qnan", "#snan"].iter().any(|mark| lower.contains(mark))
}

#[derive(Debug, Clone)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) number: Number,
    /// For a list, the type of its leading count.
    list: Option<Number>,
}

impl Property {
    pub(super) fn is_list(&self) -> bool {
        self.list.is_some()
    }
}

#[derive(Debug, Clone)]
pub(super) struct Element {
    pub(super) name: String,
    /// Number of rows in the header; trusted only as far as the file's size allows.
    pub(super) rows: u64,
    pub(super) properties: Vec<Property>,
    /// Whether it is announced in comments.
    announced: bool,
}

impl Element {
    /// Index of the scalar property `name`.
    pub(super) fn scalar(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|p| p.name == name && !p.is_list())
    }

    /// Bytes per row in the binary encodings, if equal for all rows.
    fn row_bytes(&self) -> Option<usize> {
        self.properties.iter().map(|p| if p.is_list() { None } else { Some(p.number.bytes()) }).sum()
    }

    /// Minimum bytes of a row.
    fn least_row_bytes(&self, encoding: Encoding) -> usize {
        match encoding {
            // A digit and a separator per property.
            Encoding::Ascii => 2 * self.properties.len(),
            _ => self.properties.iter().map(|p| p.list.unwrap_or(p.number).bytes()).sum(),
        }
    }
}

/// Writes the comments for [`Ply::origin`] and [`Ply::trained_with`]; none for the world's origin.
#[cfg(feature = "train")]
pub(super) fn write_comments(
    out: &mut impl std::io::Write,
    origin: DVec3,
    trained_with: &TrainedWith,
) -> std::io::Result<()> {
    let [x, y, z] = origin.to_array();
    if origin != DVec3::ZERO {
        writeln!(out, "comment origin {x} {y} {z}")?;
    }
    trained_with.write_comments(out)
}

/// Whether a file that starts with these bytes is a PLY.
pub(super) fn is_ply(start: &[u8]) -> bool {
    start.starts_with(b"ply\n") || start.starts_with(b"ply\r\n")
}

/// A parsed header and the bytes after it.
pub(super) struct Ply<'a> {
    path: &'a Path,
    encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Origin of the positions: `comment origin X Y Z`.
    pub(super) origin: DVec3,
    pub(super) trained_with: TrainedWith,
    body: &'a [u8],
}

impl<'a> Ply<'a> {
    /// Parses the header. `path` is only used in errors.
    pub(super) fn parse(bytes: &'a [u8], path: &'a Path) -> Result<Ply<'a>> {
        let fail = |what: String| Error::input(path, what);
        if !is_ply(bytes) {
            return Err(fail("is not a PLY".into()));
        }
        let (mut encoding, mut origin, mut trained_with) = (None, DVec3::ZERO, TrainedWith::default());
        let mut elements: Vec<Element> = Vec::new();
        // Names of the elements, and of the last one's properties: sets, since a megabyte of header has a
        // hundred thousand.
        let (mut names, mut property_names) = (HashSet::new(), HashSet::new());
        let mut at = 0;
        loop {
            let rest = &bytes[at..bytes.len().min(MAX_HEADER)];
            let Some(length) = rest.iter().position(|&b| b == b'\n') else {
                return Err(fail("the PLY header has no `end_header` line".into()));
            };
            let line = String::from_utf8_lossy(&rest[..length]);
            at += length + 1;
            let words: Vec<&str> = line.split_whitespace().collect();
            let (announced, words) = match words[..] {
                ["comment", "glint", what @ ("element" | "property"), ref rest @ ..] => {
                    (true, [&[what], rest].concat())
                }
                _ => (false, words),
            };
            match words[..] {
                ["ply"] | [] => {}
                ["comment", "origin", x, y, z] => {
                    // Malformed comments are ignored.
                    let number = |text: &str| text.parse().ok().filter(|v: &f64| v.is_finite());
                    if let (Some(x), Some(y), Some(z)) = (number(x), number(y), number(z)) {
                        origin = DVec3::new(x, y, z);
                    }
                }
                ["comment", ref words @ ..] => trained_with.read_comment(words),
                ["obj_info", ..] => {}
                ["format", kind, "1.0"] => {
                    encoding = Some(match kind {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::Little,
                        "binary_big_endian" => Encoding::Big,
                        _ => return Err(fail(format!("PLY format `{kind}` is unknown"))),
                    });
                }
                ["element", name, rows] => {
                    let rows =
                        rows.parse().map_err(|_| fail(format!("header line `{line}`: the number of rows is bad")))?;
                    if !names.insert(name.to_owned()) {
                        return Err(fail(format!("element `{name}` appears twice in the header")));
                    }
                    property_names.clear();
                    elements.push(Element { name: name.to_owned(), rows, properties: Vec::new(), announced });
                }
                ["property", ref kind @ .., name] => {
                    let (number, list) = match *kind {
                        [number] => (Number::from_name(number), Ok(None)),
                        ["list", count, item] => {
                            (Number::from_name(item), Number::from_name(count).map(Some).ok_or(()))
                        }
                        _ => (None, Ok(None)),
                    };
                    let (Some(number), Ok(list)) = (number, list) else {
                        return Err(fail(format!("header line `{line}`: the type is unknown")));
                    };
                    if list.is_some_and(|count| !count.is_integer()) {
                        return Err(fail(format!("header line `{line}`: the length of a list must be an integer")));
                    }
                    let Some(element) = elements.last_mut().filter(|element| element.announced == announced) else {
                        return Err(fail(format!("header line `{line}`: no element comes before it")));
                    };
                    if !property_names.insert(name.to_owned()) {
                        let what = format!("element `{}` has property `{name}` twice", element.name);
                        return Err(fail(what));
                    }
                    element.properties.push(Property { name: name.to_owned(), number, list });
                }
                ["end_header"] => break,
                _ => return Err(fail(format!("header line `{}` is not understood", line.trim_end()))),
            }
        }
        let Some(encoding) = encoding else {
            return Err(fail("the PLY header has no `format` line".into()));
        };
        // This also limits every loop over rows: each row takes at least a byte.
        if let Some(empty) = elements.iter().find(|e| e.properties.is_empty() && e.rows > 0) {
            return Err(fail(format!("element `{}` promises {} rows but has no properties", empty.name, empty.rows)));
        }
        // The block comes last, wherever a tool has put the comments.
        elements.sort_by_key(|element| element.announced);
        let mut ply = Ply { path, encoding, elements, origin, trained_with, body: &bytes[at..] };
        // guard: PLY: a block that is gone
        if ply.elements.iter().any(|element| element.announced) && ply.has_no_block() {
            ply.elements.retain(|element| !element.announced || element.rows == 0);
        }
        Ok(ply)
    }

    /// Whether the body ends with the declared elements.
    fn has_no_block(&self) -> bool {
        let declared = self.elements.iter().filter(|element| !element.announced);
        if self.encoding == Encoding::Ascii {
            let lines = self.body.split(|&b| b == b'\n').filter(|line| !line.trim_ascii().is_empty()).count();
            return declared.map(|element| u128::from(element.rows)).sum::<u128>() == lines as u128;
        }
        let bytes: Option<u128> = declared.map(|e| Some(u128::from(e.rows) * e.row_bytes()? as u128)).sum();
        bytes == Some(self.body.len() as u128)
    }

    pub(super) fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.name == name)
    }

    /// Compares the size promised by the header with the actual bytes, as far as possible without reading
    /// rows.
    pub(super) fn check_size(&self) -> Result<()> {
        let have = self.body.len() as u128;
        let needs = |e: &Element, row: usize| e.rows as u128 * row as u128;
        let fixed = self.elements.iter().all(|e| e.row_bytes().is_some());
        if self.encoding == Encoding::Ascii || !fixed {
            let least: u128 = self.elements.iter().map(|e| needs(e, e.least_row_bytes(self.encoding))).sum();
            // The last line break may be missing.
            // guard: PLY: sizes of text
            if least > have + 1 {
                let promised = self.promises();
                let what = format!("the header promises {promised}, at least {least} bytes, but the body has {have}");
                return Err(Error::input(self.path, what));
            }
            return Ok(());
        }
        let need: u128 = self.elements.iter().map(|e| needs(e, e.row_bytes().unwrap_or(0))).sum();
        // guard: PLY: sizes
        if need == have {
            return Ok(());
        }
        let difference = match have.checked_sub(need) {
            Some(more) => format!("{more} bytes too many"),
            None => format!("{} bytes too few", need - have),
        };
        let mut what =
            format!("the header promises {}, {need} bytes, but the body has {have}: {difference}", self.promises());
        // With one element, the error can give the actual number of rows.
        if let [element] = &self.elements[..] {
            let row = element.row_bytes().unwrap_or(0).max(1) as u128;
            what += &match (have / row, have % row) {
                (rows, 0) => format!(" (it holds {rows} rows)"),
                (rows, left) => format!(" (it holds {rows} whole rows and {left} bytes more)"),
            };
        }
        Err(Error::input(self.path, what))
    }

    fn promises(&self) -> String {
        let each = self.elements.iter().map(|e| match e.row_bytes() {
            Some(row) if self.encoding != Encoding::Ascii => {
                format!("{} rows of element `{}` ({row} bytes each)", e.rows, e.name)
            }
            _ => format!("{} rows of element `{}`", e.rows, e.name),
        });
        each.collect::<Vec<_>>().join(" and ")
    }

    /// Reads all rows of all elements in order. `visit` gets the element, the row number and the row's scalar
    /// values by property index (0 for lists). Fails if the body ends too early, or not after the last row.
    pub(super) fn for_each_row(&self, mut visit: impl FnMut(&Element, u64, &[f64]) -> Result<()>) -> Result<()> {
        self.check_size()?;
        match self.encoding {
            Encoding::Ascii => self.ascii_rows(&mut visit),
            Encoding::Little => self.binary_rows(false, &mut visit),
            Encoding::Big => self.binary_rows(true, &mut visit),
        }
    }

    fn binary_rows(&self, big: bool, visit: &mut impl FnMut(&Element, u64, &[f64]) -> Result<()>) -> Result<()> {
        let mut rest = self.body;
        let mut values = Vec::new();
        for element in &self.elements {
            let short = |row: u64| {
                let Element { name, rows, .. } = element;
                let what =
                    format!("the body ends in row {row} of element `{name}`, of which the header promises {rows}");
                Error::input(self.path, what)
            };
            values.resize(element.properties.len(), 0.0);
            for row in 0..element.rows {
                for (value, property) in values.iter_mut().zip(&element.properties) {
                    let mut take = |bytes: usize| {
                        let (taken, left) = rest.split_at_checked(bytes)?;
                        rest = left;
                        Some(taken)
                    };
                    *value = match property.list {
                        None => property.number.decode(take(property.number.bytes()).ok_or_else(|| short(row))?, big),
                        Some(count) => {
                            let length = count.decode(take(count.bytes()).ok_or_else(|| short(row))?, big);
                            if !(0.0..).contains(&length) {
                                return Err(self.bad_list(element, row, property));
                            }
                            // At most 2³² items of 8 bytes.
                            let bytes = length as u64 * property.number.bytes() as u64;
                            usize::try_from(bytes).ok().and_then(take).ok_or_else(|| short(row))?;
                            0.0
                        }
                    };
                }
                visit(element, row, &values)?;
            }
        }
        if !rest.is_empty() {
            let what = format!("{} bytes are left after the {} of the header", rest.len(), self.promises());
            return Err(Error::input(self.path, what));
        }
        Ok(())
    }

    fn ascii_rows(&self, visit: &mut impl FnMut(&Element, u64, &[f64]) -> Result<()>) -> Result<()> {
        let fail = |what: String| Error::input(self.path, what);
        let text = std::str::from_utf8(self.body).map_err(|_| fail("the body of an ascii PLY is not text".into()))?;
        let mut lines = text.lines().filter(|line| !line.trim().is_empty());
        let mut values = Vec::new();
        for element in &self.elements {
            values.resize(element.properties.len(), 0.0);
            let name = &element.name;
            for row in 0..element.rows {
                let Some(line) = lines.next() else {
                    let what =
                        format!("the header promises {} rows of element `{name}`, the body has {row}", element.rows);
                    return Err(fail(what));
                };
                let mut words = line.split_whitespace();
                for (value, property) in values.iter_mut().zip(&element.properties) {
                    let mut next = |number: Number| {
                        let place = || format!("row {row} of element `{name}`, property `{}`", property.name);
                        let word = words.next().ok_or_else(|| fail(format!("{}: the line ends before it", place())))?;
                        number.parse(word).ok_or_else(|| fail(format!("{}: `{word}` is not a number", place())))
                    };
                    *value = match property.list {
                        None => next(property.number)?,
                        Some(count) => {
                            let length = next(count)?;
                            if !(0.0..).contains(&length) {
                                return Err(self.bad_list(element, row, property));
                            }
                            // Stops at the end of the line at the latest.
                            for _ in 0..length as u64 {
                                next(property.number)?;
                            }
                            0.0
                        }
                    };
                }
                let more = words.count();
                if more > 0 {
                    let what = format!("row {row} of element `{name}` has {more} values more than its properties");
                    return Err(fail(what));
                }
                visit(element, row, &values)?;
            }
        }
        match lines.count() {
            0 => Ok(()),
            more => Err(fail(format!("{more} lines are left after the {} of the header", self.promises()))),
        }
    }

    fn bad_list(&self, element: &Element, row: u64, property: &Property) -> Error {
        let what = format!("row {row} of element `{}`: the list `{}` has no valid length", element.name, property.name);
        Error::input(self.path, what)
    }
}
