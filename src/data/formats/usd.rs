//! Reads and writes the text form of OpenUSD, `.usda`, with prims `ParticleField3DGaussianSplat`.
//!
//! Source: the schema `usdVol` of OpenUSD 26.11. Positions, sizes, opacities (0 to 1) and rotations (w, x, y, z) are linear;
//! coefficients of harmonics are by Gaussian, the constant first. Each array has a variant of half width, which counts if the other
//! is missing. An array that is too long is cut; one that is too short is ignored, with a note.
//!
//! glint writes a stage with y up and z back. The origin is a translation in float64, and training settings are JSON in the prim's
//! `customData`. Composition (references, payloads, variants) and animation are not read.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use glam::{DMat4, DQuat, DVec3};

use super::axes::{self, Y_UP_Z_BACK};
use super::common::append;
use super::quantise;
use super::rotate::Placing;
use crate::data::atomic::write_whole;
use crate::data::{SceneFile, TrainedWith};
use crate::scene::{Gaussians, Scene};
use crate::{Error, Result};

const PRIM: &str = "ParticleField3DGaussianSplat";
const DEGREE: &str = "radiance:sphericalHarmonicsDegree";
const HARMONICS: &str = "radiance:sphericalHarmonicsCoefficients";
/// Maximum depth of nested prims.
const DEPTH: usize = 64;

/// A prim with its properties as text.
#[derive(Default)]
struct Prim<'a> {
    kind: &'a str,
    name: &'a str,
    metadata: &'a str,
    properties: BTreeMap<&'a str, &'a str>,
    children: Vec<Prim<'a>>,
}

/// A position in a text.
struct Cursor<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Cursor<'a> {
    fn fail<T>(&self, what: &str) -> Result<T, String> {
        let line = self.text[..self.at].lines().count().max(1);
        Err(format!("line {line}: {what}"))
    }

    /// Skips separators and comments, and returns the next byte; 0 at the end.
    fn peek(&mut self) -> u8 {
        let bytes = self.text.as_bytes();
        while let Some(&byte) = bytes.get(self.at) {
            match byte {
                b'#' => self.at += self.text[self.at..].find('\n').unwrap_or(self.text.len() - self.at),
                b' ' | b'\t' | b'\r' | b'\n' | b',' | b';' => self.at += 1,
                byte => return byte,
            }
        }
        0
    }

    /// Takes a word: a keyword, a type or a name.
    fn word(&mut self) -> &'a str {
        self.peek();
        let rest = &self.text[self.at..];
        let end = rest.find(|c: char| c.is_whitespace() || "=(){}\"'<@,;".contains(c)).unwrap_or(rest.len());
        self.at += end;
        &rest[..end]
    }

    /// Takes `byte`.
    fn expect(&mut self, byte: u8) -> Result<(), String> {
        match self.peek() == byte {
            true => self.at += 1,
            false => return self.fail(&format!("expected `{}`", byte as char)),
        }
        Ok(())
    }

    /// Takes a value as text: a list, tuple or dictionary up to its closing bracket, a string with its quotes, or a word.
    fn value(&mut self) -> Result<&'a str, String> {
        self.peek();
        let (bytes, begin) = (self.text.as_bytes(), self.at);
        // The closing brackets that are expected.
        let mut open = Vec::new();
        loop {
            match bytes.get(self.at) {
                Some(&bracket @ (b'[' | b'(' | b'{')) => {
                    open.push(if bracket == b'(' { b')' } else { bracket + 2 });
                    self.at += 1;
                }
                Some(bracket @ (b']' | b')' | b'}')) if !open.is_empty() => {
                    if open.pop().as_ref() != Some(bracket) {
                        return self.fail("a bracket is not closed");
                    }
                    self.at += 1;
                }
                // A path or an asset ends at its own bracket.
                Some(b'"' | b'\'' | b'@' | b'<') => {
                    let rest = &self.text[self.at..];
                    let quotes = ["\"\"\"", "\'\'\'", "\"", "'", "@", "<"];
                    let quote = quotes.into_iter().find(|quote| rest.starts_with(*quote)).unwrap_or("\"");
                    self.quoted(if quote == "<" { ">" } else { quote }, quote.len())?;
                }
                None if !open.is_empty() => return self.fail("a bracket is not closed"),
                _ if open.is_empty() => drop(self.word()),
                Some(b'#') => drop(self.peek()),
                // Bytes of longer characters are skipped one by one, up to a bracket or quote.
                _ => self.at += 1,
            }
            if open.is_empty() {
                return Ok(&self.text[begin..self.at]);
            }
        }
    }

    /// Skips a quoted text; `begin` is the length of the opening quote.
    fn quoted(&mut self, quote: &str, begin: usize) -> Result<(), String> {
        let mut at = self.at + begin;
        while let Some(next) = self.text[at..].find(|c: char| c == '\\' || quote.starts_with(c)) {
            at += next;
            let rest = &self.text[at..];
            if rest.starts_with(quote) {
                self.at = at + quote.len();
                return Ok(());
            }
            // A backslash escapes one character; a single quote within a triple one is text.
            let escaped = usize::from(rest.starts_with('\\'));
            at += rest.chars().take(1 + escaped).map(char::len_utf8).sum::<usize>();
        }
        self.fail("a string is not closed")
    }

    /// Parses prims and properties up to a closing brace, or to the end of the file at depth 0.
    fn prim(&mut self, prim: &mut Prim<'a>, depth: usize) -> Result<(), String> {
        loop {
            match self.peek() {
                0 if depth == 0 => return Ok(()),
                0 => return self.fail("a brace is not closed"),
                b'}' if depth > 0 => {
                    self.at += 1;
                    return Ok(());
                }
                _ => {}
            }
            let mut word = self.word();
            match word {
                "def" | "over" | "class" => {
                    if depth == DEPTH {
                        return self.fail(&format!("prims are nested deeper than {DEPTH}"));
                    }
                    let mut child = Prim { kind: self.word(), ..Prim::default() };
                    child.name = self.value()?;
                    if self.peek() == b'(' {
                        child.metadata = self.value()?;
                    }
                    self.expect(b'{')?;
                    self.prim(&mut child, depth + 1)?;
                    // Abstract prims and overrides are nothing to draw by themselves.
                    if word == "def" {
                        prim.children.push(child);
                    }
                }
                "variantSet" => {
                    self.value()?;
                    self.expect(b'=')?;
                    self.value()?;
                }
                "" => return self.fail("expected a prim or a property"),
                _ => {
                    while ["custom", "uniform", "varying", "config", "prepend", "append", "delete", "add", "reorder"]
                        .contains(&word)
                    {
                        word = self.word();
                    }
                    let name = self.word();
                    if self.peek() == b'=' {
                        self.at += 1;
                        self.peek();
                        prim.properties.insert(name, self.value()?);
                    }
                    if self.peek() == b'(' {
                        self.value()?;
                    }
                }
            }
        }
    }
}

/// The numbers of a value.
fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let words = text.split(|c: char| c.is_whitespace() || "[](),".contains(c)).filter(|word| !word.is_empty());
    words.map(|word| word.parse().map_err(|_| format!("`{}` is not a number", shown(word)))).collect()
}

/// The start of a text of the file, for errors.
pub(super) fn shown(text: &str) -> String {
    text.chars().take(40).flat_map(char::escape_debug).collect()
}

/// The text within quotes, without escapes.
fn unquoted(text: &str) -> String {
    let inner = text.trim_matches(['"', '\'']);
    let mut out = String::with_capacity(inner.len());
    let mut chars = inner.chars();
    while let Some(c) = chars.next() {
        out.extend(if c == '\\' { chars.next() } else { Some(c) });
    }
    out
}

/// The value of a name in metadata, which is a list of assignments in brackets. Of names within dictionaries the first counts.
fn metadata<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    let ends = |at: usize| !text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
    let at = text
        .match_indices(name)
        .map(|(at, _)| at)
        .find(|&at| ends(at) && text[at + name.len()..].trim_start().starts_with('='))?;
    let mut cursor = Cursor { text, at: at + name.len() };
    cursor.peek();
    cursor.at += 1;
    cursor.peek();
    cursor.value().ok()
}

impl Prim<'_> {
    fn numbers(&self, name: &str) -> Result<Option<Vec<f64>>, String> {
        self.properties
            .get(name)
            .map(|text| numbers(text).map_err(|what| format!("`{}`: {what}", shown(name))))
            .transpose()
    }

    /// The prim's own transformation: its operations, the first outermost; and whether it is relative to the stage, not to the parent.
    fn matrix(&self) -> Result<(DMat4, bool), String> {
        let order = self.properties.get("xformOpOrder").copied().unwrap_or_default();
        let (mut all, mut resets) = (DMat4::IDENTITY, false);
        for name in order.split(['[', ']', ',', '"', '\'']).map(str::trim).filter(|name| !name.is_empty()) {
            if name == "!resetXformStack!" {
                resets = true;
                continue;
            }
            let (inverse, name) = name.strip_prefix("!invert!").map_or((false, name), |name| (true, name));
            let values = self
                .numbers(name)?
                .ok_or_else(|| format!("`xformOpOrder` names `{}`, which has no value", shown(name)))?;
            let kind = name.split(':').nth(1).unwrap_or_default();
            let vector = || match values[..] {
                [x, y, z] => Ok(DVec3::new(x, y, z)),
                _ => Err(format!("`{}` has {} numbers, expected 3", shown(name), values.len())),
            };
            let axis = |axis: char| match axis {
                'X' => DQuat::from_rotation_x,
                'Y' => DQuat::from_rotation_y,
                _ => DQuat::from_rotation_z,
            };
            let turned = kind.strip_prefix("rotate").unwrap_or_default();
            let matrix = match (kind, values.as_slice()) {
                ("translate", _) => DMat4::from_translation(vector()?),
                ("scale", _) => DMat4::from_scale(vector()?),
                ("orient", &[w, x, y, z]) => DMat4::from_quat(DQuat::from_xyzw(x, y, z, w).normalize()),
                // Rows of a matrix for row vectors are columns of one for column vectors.
                ("transform", values) if values.len() == 16 => {
                    DMat4::from_cols_array(values.try_into().unwrap_or(&[0.0; 16]))
                }
                (_, &[angle]) if ["X", "Y", "Z"].contains(&turned) => {
                    DMat4::from_quat(axis(turned.chars().next().unwrap_or('X'))(angle.to_radians()))
                }
                // The first axis is applied first.
                (_, &[x, y, z]) if turned.len() == 3 && turned.chars().all(|c| "XYZ".contains(c)) => {
                    let angle = |c| [x, y, z]["XYZ".find(c).unwrap_or(0)].to_radians();
                    let turns = turned.chars().rev().map(|c| axis(c)(angle(c)));
                    DMat4::from_quat(turns.fold(DQuat::IDENTITY, |all, turn| all * turn))
                }
                _ => {
                    return Err(format!(
                        "`{}` is not a transformation that is read, or has {} numbers",
                        shown(name),
                        values.len()
                    ));
                }
            };
            all *= if inverse { matrix.inverse() } else { matrix };
        }
        Ok((all, resets))
    }

    /// The Gaussians of a prim in its own frame. Adds a note for each array that is too short.
    fn gaussians(&self, notes: &mut Vec<String>) -> Result<Gaussians, String> {
        let either = |name: &str| -> Result<Option<Vec<f64>>, String> {
            Ok(self.numbers(name)?.or(self.numbers(&format!("{name}h"))?))
        };
        let Some(positions) = either("positions")? else {
            let animated = self.properties.keys().any(|name| name.ends_with(".timeSamples"));
            return Err(if animated { "is animated, which is not read" } else { "lacks `positions`" }.into());
        };
        let count = positions.len() / 3;
        let mut array = |name: &str, width: usize| -> Result<Option<Vec<f32>>, String> {
            let Some(values) = either(name)? else { return Ok(None) };
            if values.len() < width * count {
                notes.push(format!("`{name}` has {} numbers of {}, so it is ignored", values.len(), width * count));
                return Ok(None);
            }
            Ok(Some(values[..width * count].iter().map(|&v| v as f32).collect()))
        };
        let rows = |values: Option<Vec<f32>>, missing: [f32; 3]| match values {
            Some(values) => values.as_chunks::<3>().0.to_vec(),
            None => vec![missing; count],
        };
        let mut sh_degree = match self.numbers(DEGREE)?.as_deref() {
            None => 3,
            Some(&[degree]) if (0.0..=3.0).contains(&degree) => degree as u32,
            Some(degree) => return Err(format!("`{DEGREE}` is {:?}, expected 0 to 3", degree.first())),
        };
        let bands = ((sh_degree + 1) * (sh_degree + 1)) as usize;
        let sh = array(HARMONICS, 3 * bands)?;
        if sh.is_none() {
            sh_degree = 0;
        }
        Ok(Gaussians {
            sh_degree,
            means: positions.as_chunks::<3>().0.iter().map(|p| p.map(|v| v as f32)).collect(),
            log_scales: rows(array("scales", 3)?, [1.0; 3]).into_iter().map(|s| s.map(quantise::log_scale)).collect(),
            quats: match array("orientations", 4)? {
                Some(values) => values.as_chunks::<4>().0.to_vec(),
                None => vec![[1.0, 0.0, 0.0, 0.0]; count],
            },
            opacities: array("opacities", 1)?.unwrap_or(vec![1.0; count]).into_iter().map(quantise::logit).collect(),
            sh: sh.map_or(vec![[0.0; 3]; count], |values| values.as_chunks::<3>().0.to_vec()),
        })
    }
}

/// Reads a scene. `path` is only used in errors.
pub(in crate::data) fn parse(bytes: &[u8], _: Option<&Path>, path: &Path) -> Result<SceneFile> {
    read(bytes).map_err(|what| Error::input(path, what))
}

pub(super) fn read(bytes: &[u8]) -> Result<SceneFile, String> {
    let text = std::str::from_utf8(bytes).map_err(|error| format!("is not UTF-8 at byte {}", error.valid_up_to()))?;
    let mut cursor = Cursor { text, at: 0 };
    let mut root = Prim::default();
    if cursor.peek() == b'(' {
        root.metadata = cursor.value()?;
    }
    cursor.prim(&mut root, 0)?;
    // A stage is y up unless it says otherwise.
    let up = match metadata(root.metadata, "upAxis").map(unquoted).as_deref() {
        Some("Z") => DMat4::from_cols_array(&[1., 0., 0., 0., 0., 0., -1., 0., 0., 1., 0., 0., 0., 0., 0., 1.]),
        _ => DMat4::IDENTITY,
    };
    let (mut found, mut origin, mut notes) = (None, None, Vec::new());
    let mut trained_with = TrainedWith::default();
    let mut open: Vec<(&Prim, DMat4)> = root.children.iter().rev().map(|prim| (prim, up)).collect();
    while let Some((prim, above)) = open.pop() {
        let in_prim = |what| format!("prim `{}`: {what}", shown(&unquoted(prim.name)));
        let (own, resets) = prim.matrix().map_err(in_prim)?;
        let here = if resets { up } else { above } * own;
        open.extend(prim.children.iter().rev().map(|child| (child, here)));
        if prim.kind != PRIM {
            continue;
        }
        let mut gaussians = prim.gaussians(&mut notes).map_err(in_prim)?;
        let placing = Placing::of(here)
            .ok_or_else(|| in_prim("its transformation is no rotation, uniform scale and translation".into()))?;
        if trained_with.is_unknown() {
            let json = metadata(prim.metadata, "glint").map(unquoted);
            let json = json.and_then(|text| serde_json::from_str(&text).ok());
            trained_with = json.map(|json| TrainedWith::from_json(&json)).unwrap_or_default();
        }
        placing.into_frame(&mut gaussians, &mut origin, Y_UP_Z_BACK);
        append(&mut found, gaussians);
    }
    let Some(base) = found else {
        return Err(format!("has no prim `{PRIM}` (prims in files that it references are not read)"));
    };
    let origin = axes::flip_origin(origin, Y_UP_Z_BACK);
    notes.sort();
    notes.dedup();
    Ok(SceneFile { trained_with, notes, ..Scene { base, origin, ..Default::default() }.into() })
}

/// Writes the base as a stage.
pub(in crate::data) fn write(file: &SceneFile, path: &Path, _: Option<u8>) -> Result<Vec<String>> {
    write_whole(path, |out| put(file, out))?;
    Ok(Vec::new())
}

/// Writes a stage whose prim `/scene` is the base. Numbers are written so that reading gives the same float32.
pub(super) fn put(file: &SceneFile, out: &mut impl Write) -> std::io::Result<()> {
    let Scene { base, origin, .. } = &file.scene;
    let mut turned = base.clone();
    axes::flip(&mut turned, Y_UP_Z_BACK);
    let at = axes::flip_origin(Some(*origin), Y_UP_Z_BACK);
    let scales: Vec<[f32; 3]> = turned.log_scales.iter().map(|scales| scales.map(quantise::scale)).collect();
    let mut extent = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for (mean, scales) in turned.means.iter().zip(&scales) {
        let reach = 3.0 * scales.iter().fold(0.0f32, |most, &v| most.max(v));
        for axis in 0..3 {
            extent[0][axis] = extent[0][axis].min(mean[axis] - reach);
            extent[1][axis] = extent[1][axis].max(mean[axis] + reach);
        }
    }
    writeln!(out, "#usda 1.0\n(\n    defaultPrim = \"scene\"\n    metersPerUnit = 1\n    upAxis = \"Y\"\n)\n")?;
    write!(out, "def {PRIM} \"scene\"")?;
    if !file.trained_with.is_unknown() {
        let json = serde_json::to_string(&file.trained_with)?.replace('\\', "\\\\").replace('"', "\\\"");
        write!(out, " (\n    customData = {{\n        string glint = \"{json}\"\n    }}\n)")?;
    }
    writeln!(out, "\n{{")?;
    if !turned.is_empty() {
        array(out, "float3[] extent", &extent)?;
    }
    array(out, "point3f[] positions", &turned.means)?;
    let quats = turned.quats.iter().map(|&quat| quantise::unit(quat).map(|v| v as f32));
    array(out, "quatf[] orientations", &quats.collect::<Vec<_>>())?;
    array(out, "float3[] scales", &scales)?;
    let opacities = turned.opacities.iter().map(|&v| [quantise::opacity(v) as f32]);
    array(out, "float[] opacities", &opacities.collect::<Vec<_>>())?;
    writeln!(out, "    uniform int {DEGREE} = {}", turned.sh_degree)?;
    array(out, &format!("float3[] {HARMONICS}"), &turned.sh)?;
    if at != DVec3::ZERO {
        writeln!(out, "    double3 xformOp:translate = ({}, {}, {})", at.x, at.y, at.z)?;
        writeln!(out, "    uniform token[] xformOpOrder = [\"xformOp:translate\"]")?;
    }
    writeln!(out, "}}")
}

/// Writes an array with one element a line.
fn array<const N: usize>(out: &mut impl Write, name: &str, rows: &[[f32; N]]) -> std::io::Result<()> {
    writeln!(out, "    {name} = [")?;
    for row in rows {
        match row[..] {
            [value] => writeln!(out, "        {value},")?,
            _ => {
                let row: Vec<String> = row.iter().map(f32::to_string).collect();
                writeln!(out, "        ({}),", row.join(", "))?;
            }
        }
    }
    writeln!(out, "    ]")
}
