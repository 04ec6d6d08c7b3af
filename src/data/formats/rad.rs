//! Reads and writes RAD, the levels of detail of Spark 2: one tree of all Gaussians, in chunks that a viewer loads as it needs them.
//!
//! Source: sparkjsdev/spark, `rad.rs` of its Rust library, version 1. A file is `RAD0`, the length of a JSON header, the header, and
//! chunks of 65,536 Gaussians; a chunk is `RADC`, the length of its JSON header, the header, the length of its payload (64 bits), and
//! properties, each a raw deflate stream. Everything begins at a multiple of 8 bytes. A property has its first component of all
//! Gaussians, then the second, and so on. The root of the tree is Gaussian 0; the children of one follow one another. The frame is
//! that of PLY.

use std::f64::consts::PI;
use std::io::{Read, Write};
use std::path::Path;

use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use half::f16;
use serde::{Deserialize, Serialize};

use super::common::{append, put, room};
use super::{inflate, order, quantise};
use crate::data::{SceneFile, lod};
use crate::scene::{Gaussians, Scene};
use crate::{Error, Result};

/// Gaussians in a chunk.
const CHUNK: usize = 1 << 16;
/// Harmonics are bytes of up to the greatest coefficient, leaving out one in this number.
const OUTLIERS: usize = 1000;

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Header {
    version: u32,
    #[serde(rename = "type")]
    kind: String,
    count: usize,
    #[serde(default)]
    max_sh: u32,
    #[serde(default)]
    lod_tree: bool,
    chunk_size: usize,
    all_chunk_bytes: usize,
    chunks: Vec<Place>,
}

/// A chunk, from the end of the header on.
#[derive(Debug, Serialize, Deserialize)]
struct Place {
    offset: usize,
    bytes: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    filename: Option<String>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Chunk {
    version: u32,
    base: usize,
    count: usize,
    payload_bytes: usize,
    #[serde(default)]
    max_sh: u32,
    #[serde(default)]
    lod_tree: bool,
    properties: Vec<Property>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Property {
    offset: usize,
    bytes: usize,
    property: String,
    encoding: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    compression: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    min: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    max: Option<f32>,
}

/// Writes the Gaussians and a tree above them, whose levels each have half of the Gaussians of the one below.
pub(in crate::data) fn write(file: &SceneFile, path: &Path, _: Option<u8>) -> Result<Vec<String>> {
    let (gaussians, children) = tree(&file.scene.base);
    let fail = |error| Error::io(path, error);
    let chunks: std::io::Result<Vec<Vec<u8>>> =
        (0..gaussians.len()).step_by(CHUNK).map(|base| chunk(&gaussians, &children, base)).collect();
    let chunks = chunks.map_err(fail)?;
    let mut all_chunk_bytes = 0;
    let place = |chunk: &Vec<u8>| {
        all_chunk_bytes += chunk.len();
        Place { offset: all_chunk_bytes - chunk.len(), bytes: chunk.len(), filename: None }
    };
    let places: Vec<Place> = chunks.iter().map(place).collect();
    let header = Header {
        version: 1,
        kind: "gsplat".into(),
        count: gaussians.len(),
        max_sh: gaussians.sh_degree,
        lod_tree: true,
        chunk_size: CHUNK,
        all_chunk_bytes,
        chunks: places,
    };
    let mut out = headed(b"RAD0", &serde_json::to_vec(&header).map_err(|error| fail(error.into()))?);
    chunks.iter().for_each(|chunk| out.extend(chunk));
    put(path, &out)?;
    Ok(Vec::new())
}

/// All Gaussians from the root on, and for each the number of its children and that of the first.
fn tree(base: &Gaussians) -> (Gaussians, Vec<[u32; 2]>) {
    let along = |gaussians: &Gaussians| gaussians.reordered(&order::along_curve(&gaussians.means));
    let mut levels = vec![(along(base), Vec::new())];
    while levels[levels.len() - 1].0.len() > 1 {
        let below = &levels[levels.len() - 1].0;
        let (level, stands_for) = lod::coarser(below, below.len().div_ceil(2));
        let mut members = vec![Vec::new(); level.len()];
        stands_for.iter().zip(0..).for_each(|(&of, i)| members[of as usize].push(i));
        levels.push((level, members));
    }
    // One that stands for itself alone is the same Gaussian as in the level below.
    let lowest = |mut level: usize, mut i: usize| {
        while let Some([only]) = levels[level].1.get(i).map(Vec::as_slice) {
            (level, i) = (level - 1, *only as usize);
        }
        (level, i)
    };
    let top = levels.len() - 1;
    let mut nodes: Vec<(usize, usize)> = (0..levels[top].0.len()).map(|i| lowest(top, i)).collect();
    let mut children = Vec::new();
    while let Some(&(level, i)) = nodes.get(children.len()) {
        let members = levels[level].1.get(i).map_or(&[][..], Vec::as_slice);
        children.push([members.len() as u32, if members.is_empty() { 0 } else { nodes.len() as u32 }]);
        nodes.extend(members.iter().map(|&member| lowest(level - 1, member as usize)));
    }
    let mut all = None;
    let starts: Vec<usize> = levels
        .into_iter()
        .scan(0, |start, (level, _)| {
            *start += level.len();
            let first = *start - level.len();
            append(&mut all, level);
            Some(first)
        })
        .collect();
    let order: Vec<usize> = nodes.iter().map(|&(level, i)| starts[level] + i).collect();
    (all.unwrap_or_default().reordered(&order), children)
}

/// Magic, length, text, and zeros up to a multiple of 8 bytes.
fn headed(magic: &[u8; 4], text: &[u8]) -> Vec<u8> {
    let mut out = [&magic[..], &(text.len() as u32).to_le_bytes(), text].concat();
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

fn chunk(all: &Gaussians, children: &[[u32; 2]], base: usize) -> std::io::Result<Vec<u8>> {
    let count = (all.len() - base).min(CHUNK);
    let numbers = base..base + count;
    let k = all.sh_coefficients();
    let half = |value: f64| f16::from_f64(value.clamp(f16::MIN.to_f64(), f16::MAX.to_f64())).to_le_bytes();
    let halves = |values: &dyn Fn(usize) -> [f64; 3]| -> Vec<u8> {
        (0..3).flat_map(|axis| numbers.clone().flat_map(move |i| half(values(i)[axis]))).collect()
    };
    let mut means = vec![0; 12 * count];
    for (at, i) in numbers.clone().enumerate() {
        for (axis, value) in all.means[i].iter().enumerate() {
            for (byte, of) in value.to_le_bytes().into_iter().enumerate() {
                means[(3 * byte + axis) * count + at] = of;
            }
        }
    }
    let opacities: Vec<u8> = numbers.clone().flat_map(|i| half(quantise::opacity(all.opacities[i]))).collect();
    let colors = halves(&|i| all.sh[i * k].map(|v| 0.5 + quantise::C0 * f64::from(v)));
    // Their exponentials must be float32 numbers.
    let scales = halves(&|i| all.log_scales[i].map(|v| f64::from(v).clamp(-87.0, 88.0)));
    let rotations: Vec<u8> = numbers.clone().flat_map(|i| octahedral(all.quats[i])).collect();
    let counts: Vec<u8> = numbers.clone().flat_map(|i| (children[i][0] as u16).to_le_bytes()).collect();
    let starts: Vec<u8> = numbers.clone().flat_map(|i| children[i][1].to_le_bytes()).collect();
    let mut properties = vec![
        ("center", "f32_lebytes", means, None),
        ("alpha", "f16", opacities, None),
        ("rgb", "f16", colors, None),
        ("scales", "ln_f16", scales, None),
        ("orientation", "oct88r8", rotations, None),
    ];
    for (degree, name) in (1..=all.sh_degree as usize).zip(["sh1", "sh2", "sh3"]) {
        let band = degree * degree..(degree + 1) * (degree + 1);
        let values = || numbers.clone().flat_map(|i| &all.sh[i * k..][band.clone()]).flatten();
        let mut sizes: Vec<f32> = values().map(|v| v.abs()).collect();
        let at = sizes.len() - 1 - sizes.len() / OUTLIERS;
        let max = sizes.select_nth_unstable_by(at, f32::total_cmp).1.max(f32::MIN_POSITIVE);
        let byte = |v: f32| (v / max * 127.0).round().clamp(-127.0, 127.0) as i8 as u8;
        let of = |c: usize, channel: usize| numbers.clone().map(move |i| byte(all.sh[i * k + c][channel]));
        let bytes = band.clone().flat_map(|c| (0..3).flat_map(move |channel| of(c, channel))).collect();
        properties.push((name, "s8", bytes, Some(max)));
    }
    properties.extend([("child_count", "u16", counts, None), ("child_start", "u32", starts, None)]);
    let (mut payload, mut listed) = (Vec::new(), Vec::new());
    for (property, encoding, bytes, max) in properties {
        let mut deflated = DeflateEncoder::new(Vec::new(), Compression::default());
        deflated.write_all(&bytes)?;
        let deflated = deflated.finish()?;
        listed.push(Property {
            offset: payload.len(),
            bytes: deflated.len(),
            property: property.into(),
            encoding: encoding.into(),
            compression: Some("gz".into()),
            min: max.map(|max: f32| -max),
            max,
        });
        payload.extend(deflated);
        payload.resize(payload.len().next_multiple_of(8), 0);
    }
    let header = Chunk {
        version: 1,
        base,
        count,
        payload_bytes: payload.len(),
        max_sh: all.sh_degree,
        lod_tree: true,
        properties: listed,
    };
    let mut out = headed(b"RADC", &serde_json::to_vec(&header)?);
    out.extend((payload.len() as u64).to_le_bytes());
    out.extend(payload);
    Ok(out)
}

/// Axis (two bytes of an octahedral map) and angle of a rotation.
fn octahedral(quat: [f32; 4]) -> [u8; 3] {
    let unit = quantise::unit(quat);
    let [w, x, y, z] = if unit[0] < 0.0 { unit.map(|v| -v) } else { unit };
    let angle = 2.0 * w.min(1.0).acos();
    let sum = x.abs() + y.abs() + z.abs();
    // No rotation has any axis.
    let [u, v] = if sum > 0.0 { [x / sum, y / sum] } else { [1.0, 0.0] };
    // The lower half is folded outwards.
    let [u, v] = if z < 0.0 { [(1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v)] } else { [u, v] };
    let byte = |share: f64| quantise::byte(255.0 * share);
    [byte(0.5 * u + 0.5), byte(0.5 * v + 0.5), byte(angle / PI)]
}

fn from_octahedral([u, v, angle]: [u8; 3]) -> [f32; 4] {
    let [u, v] = [u, v].map(|byte| f64::from(byte) / 127.5 - 1.0);
    let z = 1.0 - u.abs() - v.abs();
    let [x, y] = if z < 0.0 { [(1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v)] } else { [u, v] };
    let length = (x * x + y * y + z * z).sqrt();
    let (sin, cos) = (0.5 * PI * f64::from(angle) / 255.0).sin_cos();
    [cos, x / length * sin, y / length * sin, z / length * sin].map(|v| v as f32)
}

/// Reads the leaves of the tree. `path` is only used in errors.
pub(in crate::data) fn parse(bytes: &[u8], _: Option<&Path>, path: &Path) -> Result<SceneFile> {
    read(bytes).map_err(|what| Error::input(path, what))
}

fn read(bytes: &[u8]) -> Result<SceneFile, String> {
    let (header, begin) = header::<Header>(bytes, b"RAD0", "the header")?;
    if header.version != 1 || header.kind != "gsplat" {
        return Err(format!("is RAD version {} of {}; version 1 of gsplat is read", header.version, header.kind));
    }
    let (mut all, mut promised) = (None, 0u64);
    for (number, place) in header.chunks.iter().enumerate() {
        if let Some(name) = &place.filename {
            return Err(format!("has its chunks in other files, such as `{name}`; glint reads one file"));
        }
        let what = format!("chunk {number}");
        let end = place.offset.checked_add(place.bytes);
        let at = end.and_then(|end| bytes.get(begin..)?.get(place.offset..end));
        let at = at.ok_or_else(|| format!("{what} ends beyond the file's {} bytes", bytes.len()))?;
        let (chunk, payload) = self::header::<Chunk>(at, b"RADC", &what)?;
        // Several chunks may lie in the same bytes, so the limit holds for their sum.
        promised = promised.saturating_add(chunk.bytes());
        inflate::check_promise(bytes.len(), promised, &format!("Gaussians up to {what}"))?;
        append(&mut all, leaves(&chunk, at.get(payload + 8..).unwrap_or(&[]), &what, header.lod_tree)?);
    }
    Ok(Scene { base: all.unwrap_or_default(), ..Default::default() }.into())
}

/// The header behind four bytes of magic, and the number of bytes up to its end.
fn header<T: for<'a> Deserialize<'a>>(bytes: &[u8], magic: &[u8; 4], what: &str) -> Result<(T, usize), String> {
    let short = || format!("{what} ends beyond the file");
    let (found, rest) = bytes.split_first_chunk().ok_or_else(short)?;
    if found != magic {
        return Err(format!("{what} begins with {found:?}, expected {}", String::from_utf8_lossy(magic)));
    }
    let (length, rest) = rest.split_first_chunk().ok_or_else(short)?;
    let length = u32::from_le_bytes(*length) as usize;
    let text = rest.get(..length).ok_or_else(short)?;
    let header = serde_json::from_slice(text).map_err(|error| format!("{what} is not understood: {error}"))?;
    Ok((header, (8 + length).next_multiple_of(8)))
}

fn leaves(chunk: &Chunk, payload: &[u8], what: &str, tree: bool) -> Result<Gaussians, String> {
    if chunk.max_sh > 3 {
        return Err(format!("{what} has harmonics of degree {}, expected 0 to 3", chunk.max_sh));
    }
    let values = |name: &str, dimensions: usize| -> Result<Vec<f32>, String> {
        let property = chunk.properties.iter().find(|property| property.property == name);
        let property = property.ok_or_else(|| format!("{what} lacks `{name}`"))?;
        property.values(payload, dimensions, chunk.count).map_err(|why| format!("`{name}` of {what} {why}"))
    };
    let children = if tree { values("child_count", 1)? } else { vec![0.0; chunk.count] };
    let (means, opacities) = (values("center", 3)?, values("alpha", 1)?);
    let (colors, scales, rotations) = (values("rgb", 3)?, values("scales", 3)?, values("orientation", 4)?);
    let bands: Vec<Vec<f32>> = (1..=chunk.max_sh as usize)
        .zip(["sh1", "sh2", "sh3"])
        .map(|(degree, name)| values(name, 3 * (2 * degree + 1)))
        .collect::<Result<_, _>>()?;
    let mut out = room(chunk.count, chunk.max_sh);
    for i in (0..chunk.count).filter(|&i| children[i] == 0.0) {
        let three = |from: &[f32]| [from[3 * i], from[3 * i + 1], from[3 * i + 2]];
        out.means.push(three(&means));
        out.log_scales.push(three(&scales).map(quantise::log_scale));
        out.quats.push([rotations[4 * i], rotations[4 * i + 1], rotations[4 * i + 2], rotations[4 * i + 3]]);
        out.opacities.push(quantise::logit(opacities[i].min(1.0)));
        out.sh.push(three(&colors).map(|v| ((f64::from(v) - 0.5) / quantise::C0) as f32));
        for (band, degree) in bands.iter().zip(1..) {
            let each = 3 * (2 * degree + 1);
            out.sh.extend(band[i * each..][..each].as_chunks::<3>().0);
        }
    }
    Ok(out)
}

impl Chunk {
    /// Bytes of its Gaussians.
    fn bytes(&self) -> u64 {
        let coefficients = (u64::from(self.max_sh) + 1).saturating_pow(2);
        let each = size_of::<[f32; 11]>() as u64 + coefficients.saturating_mul(12);
        each.saturating_mul(self.count as u64)
    }
}

impl Property {
    /// Decodes the values of `count` Gaussians, row by row.
    fn values(&self, payload: &[u8], dimensions: usize, count: usize) -> Result<Vec<f32>, String> {
        let end = self.offset.checked_add(self.bytes);
        let bytes = end.and_then(|end| payload.get(self.offset..end)).ok_or("ends beyond its chunk")?;
        let encoding = &self.encoding[..];
        let width = match encoding {
            "f32" | "f32_lebytes" => 4,
            "f16" | "f16_lebytes" | "ln_f16" | "u16" => 2,
            "r8" | "r8_delta" | "s8" | "s8_delta" | "ln_0r8" | "oct88r8" => 1,
            other => return Err(format!("is encoded as `{other}`, which glint does not read")),
        };
        // Three bytes give a rotation; other encodings leave out its w.
        let stored = if dimensions == 4 { 3 } else { dimensions };
        let expected = width * stored * count;
        let mut data = Vec::new();
        match self.compression.as_deref() {
            None => data.extend(bytes),
            Some("gz") => {
                let read = DeflateDecoder::new(bytes).take(expected as u64 + 1).read_to_end(&mut data);
                read.map_err(|error| format!("is not a valid deflate stream: {error}"))?;
            }
            Some(other) => return Err(format!("is compressed as `{other}`, which glint does not read")),
        }
        if data.len() != expected {
            return Err(format!("has {} bytes, expected {expected}", data.len()));
        }
        if encoding.ends_with("delta") {
            for plane in data.chunks_mut(count.max(1)) {
                let mut last = 0u8;
                for byte in plane {
                    last = last.wrapping_add(*byte);
                    *byte = last;
                }
            }
        }
        if encoding == "oct88r8" {
            return Ok(data.as_chunks().0.iter().flat_map(|&bytes| from_octahedral(bytes)).collect());
        }
        let (low, high) = (self.min.unwrap_or(0.0), self.max.unwrap_or(1.0));
        let planes = encoding.ends_with("lebytes");
        let value = |at: usize| {
            let byte = |b: usize| data[if planes { b * stored * count + at } else { width * at + b }];
            let half = || f16::from_le_bytes([byte(0), byte(1)]).to_f32();
            match encoding {
                "f32" | "f32_lebytes" => f32::from_le_bytes(std::array::from_fn(byte)),
                "f16" | "f16_lebytes" => half(),
                "ln_f16" => half().exp(),
                "u16" => f32::from(u16::from_le_bytes([byte(0), byte(1)])),
                "s8" | "s8_delta" => f32::from(byte(0) as i8) / 127.0 * high,
                "ln_0r8" if byte(0) == 0 => 0.0,
                "ln_0r8" => (low + f32::from(byte(0) - 1) / 254.0 * (high - low)).exp(),
                _ => low + f32::from(byte(0)) / 255.0 * (high - low),
            }
        };
        let row = |i: usize| (0..stored).map(move |d| d * count + i);
        if dimensions != 4 {
            return Ok((0..count).flat_map(row).map(value).collect());
        }
        let with_w = |i: usize| {
            let [x, y, z] = [0, 1, 2].map(|d| value(d * count + i));
            [(1.0 - x * x - y * y - z * z).max(0.0).sqrt(), x, y, z]
        };
        Ok((0..count).flat_map(with_w).collect())
    }
}
