//! Reads and writes Niantic's SPZ: attributes one after the other, as bytes, compressed.
//!
//! Source: nianticlabs/spz, README.md, extensions/README.md and load-spz.cc. Versions 1 to 3 are one gzip
//! stream: a header of 16 bytes, the attributes, records of extensions. Version 4 has a header of 32 bytes,
//! records of extensions, a table of the streams' sizes, and a zstd stream for each attribute. Per Gaussian,
//! little-endian:
//!
//! - position, 9 bytes: three signed 24-bit numbers over 2^(bits of the header); in version 1 three float16
//! - opacity, 1 byte: 255 σ(logit)
//! - color, 3 bytes: 255 (0.15 coefficient + 0.5), so wider than 0 to 1
//! - scale, 3 bytes: 16 (logarithm + 10)
//! - rotation, up to version 2, 3 bytes: x, y, z as 127.5 (q + 1), with w ≥ 0 implied; since version 3, 4
//!   bytes: the index of the largest of x, y, z, w (2 bits), and for each other a sign and 511 √2 |q|, the
//!   last in the low bits
//! - harmonics above the constant one, 3 bytes a coefficient (RGB): 128 coefficient + 128
//!
//! The frame is x right, y up, z back, unless an extension says otherwise.
//!
//! Gaussians with lobes, the origin and training settings are in extensions of version 4 that other readers skip; docs/formats.md
//! describes them.

use std::path::Path;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::axes::{self, Signs, Y_UP_Z_BACK};
use super::common::{name, put, room};
use super::{floaters, inflate, quantise};
use crate::data::{SceneFile, TrainedWith, validate::LOBE_WIDTHS};
use crate::scene::{Gaussians, Lobes, Scene, Supplement};
use crate::{Error, Result};

const MAGIC: [u8; 4] = *b"NGSP";
/// The newest version.
const VERSION: u8 = 4;
/// Header sizes of versions up to 3, and of 4.
const LEGACY_HEADER: usize = 16;
const HEADER: usize = 32;
/// Bytes per row of the table of streams: two 64-bit numbers.
const TABLE_ROW: usize = 16;
const ANTIALIASED: u8 = 1;
const HAS_EXTENSIONS: u8 = 2;
/// Adobe's extension for the frame, 1 to 8; minus 1, its bits are x right, y up, z front.
const FRAME_EXTENSION: u32 = 0xADBE_0003;
/// glint's extensions, of vendor `GL`: the supplement, and [`Settings`] as JSON.
const LOBES_EXTENSION: u32 = 0x474C_0001;
const SETTINGS_EXTENSION: u32 = 0x474C_0002;
/// Bytes of a lobe: direction (three signed 16-bit parts of 32,767), width (16 bits of 1), sharpness (float16).
const LOBE_BYTES: usize = 10;
/// Factor of the color's coefficient, which leaves room for colors beyond 0 to 1.
const COLOR: f64 = 0.15;
/// Range of a fixed-point position.
const FIXED: std::ops::RangeInclusive<f64> = -8_388_608.0..=8_388_607.0;
/// Maximum number of fraction bits, even for tiny scenes: an application shifts a 32-bit 1 by it.
const MOST_FRACTION_BITS: u8 = 24;
/// Fraction bits of the format's own writer; floaters must not reduce them.
const OWN_FRACTION_BITS: u8 = 12;
/// A note reports a grid step above this fraction of a Gaussian's median size.
const COARSE: f64 = 0.1;
/// Level of zstd, usual for archives that are written once and read often.
const LEVEL: i32 = 12;

/// Attributes in the order of the file.
const NAMES: [&str; 6] = ["positions", "opacities", "colors", "scales", "rotations", "harmonics"];

#[derive(Debug, Clone, Copy)]
struct Header {
    version: u32,
    count: u32,
    sh_degree: u8,
    fraction_bits: u8,
    flags: u8,
}

impl Header {
    /// Parses the common start of both headers; `bytes` has 16.
    fn parse(bytes: &[u8]) -> Result<Header, String> {
        if bytes[..4] != MAGIC {
            return Err("is not an SPZ scene: it does not begin with `NGSP`".into());
        }
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let header = Header {
            version: word(4),
            count: word(8),
            sh_degree: bytes[12],
            fraction_bits: bytes[13],
            flags: bytes[14],
        };
        if header.sh_degree > 3 {
            return Err(format!("has SH degree {}; 0 to 3 are known", header.sh_degree));
        }
        if header.fraction_bits > 31 {
            return Err(format!("has positions of {} fractional bits, expected 0 to 31", header.fraction_bits));
        }
        Ok(header)
    }

    fn has(&self, flag: u8) -> bool {
        self.flags & flag != 0
    }

    /// Bytes per Gaussian of each attribute.
    fn widths(&self) -> [u64; 6] {
        let harmonics = 3 * ((u64::from(self.sh_degree) + 1).pow(2) - 1);
        [if self.version == 1 { 6 } else { 9 }, 1, 3, 3, if self.version < 3 { 3 } else { 4 }, harmonics]
    }

    /// Total bytes of each attribute, if a file of `have` bytes can hold these.
    fn sizes(&self, have: usize) -> Result<[usize; 6], String> {
        let sizes = self.widths().map(|width| width * u64::from(self.count));
        inflate::check_promise(have, sizes.iter().sum(), &format!("{} Gaussians", self.count))?;
        Ok(sizes.map(|size| size as usize))
    }
}

/// Settings that the header has no flag for.
#[derive(Default, PartialEq, Serialize, Deserialize)]
struct Settings {
    /// World position of the coordinate origin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    origin: Option<[f64; 3]>,
    #[serde(default, deserialize_with = "TrainedWith::deserialize_leniently")]
    glint: TrainedWith,
}

/// Contents of a file.
#[derive(Default)]
struct Parsed {
    base: Gaussians,
    antialiased: bool,
    settings: Settings,
    supplement: Option<Supplement>,
    /// The base that was trained with the supplement, if it differs.
    learned: Option<Gaussians>,
}

/// Reads a scene. `path` is only used in errors.
pub(in crate::data) fn parse(bytes: &[u8], _: Option<&Path>, path: &Path) -> Result<SceneFile> {
    let parsed = if bytes.starts_with(&MAGIC) { parse_streams(bytes, true) } else { parse_legacy(bytes) };
    let parsed = parsed.map_err(|what| Error::input(path, what))?;
    let Parsed { base, antialiased, settings: Settings { origin, glint }, supplement, learned } = parsed;
    // Programs that do not know this flag leave it unset.
    let trained_with = TrainedWith { antialiased: glint.antialiased.or(antialiased.then_some(true)), ..glint };
    let origin = origin.map(DVec3::from_array).filter(|origin| origin.is_finite()).unwrap_or_default();
    let (base, shown) = match learned {
        Some(learned) => (learned, Some(base)),
        None => (base, None),
    };
    let scene = Scene { base, supplement, origin, ..Scene::default() };
    Ok(SceneFile { trained_with, shown, ..scene.into() })
}

/// Returns the Gaussians that every reader shows, and whether they were trained with antialiasing.
pub(super) fn read(bytes: &[u8]) -> Result<(Gaussians, bool), String> {
    let parsed = if bytes.starts_with(&MAGIC) { parse_streams(bytes, false)? } else { parse_legacy(bytes)? };
    Ok((parsed.base, parsed.antialiased))
}

/// Versions 1 to 3.
fn parse_legacy(bytes: &[u8]) -> Result<Parsed, String> {
    let (start, _) = inflate::gzip(bytes, LEGACY_HEADER as u64)?;
    if start.len() < LEGACY_HEADER {
        return Err(format!(
            "is gzip data of {} bytes, expected an SPZ scene's header of {LEGACY_HEADER}",
            start.len()
        ));
    }
    let header = Header::parse(&start)?;
    if !(1..=3).contains(&header.version) {
        return Err(format!("is SPZ version {} in a gzip stream, expected 1 to 3", header.version));
    }
    let sizes = header.sizes(bytes.len())?;
    let expected = LEGACY_HEADER + sizes.iter().sum::<usize>();
    let (all, more) = inflate::gzip(bytes, expected as u64)?;
    if all.len() < expected {
        let (have, count) = (all.len(), header.count);
        return Err(format!("has {have} bytes once inflated, expected {expected} of the header's {count} Gaussians"));
    }
    if more && !header.has(HAS_EXTENSIONS) {
        return Err(format!("has more than the {expected} bytes of the header's {} Gaussians", header.count));
    }
    let mut rest = &all[LEGACY_HEADER..];
    let attributes = sizes.map(|size| {
        let (taken, left) = rest.split_at(size);
        rest = left;
        taken
    });
    let base = decode(header, attributes, Y_UP_Z_BACK);
    Ok(Parsed { base, antialiased: header.has(ANTIALIASED), ..Default::default() })
}

/// Version 4. The scenes within glint's extension are read without theirs.
fn parse_streams(bytes: &[u8], with_lobes: bool) -> Result<Parsed, String> {
    if bytes.len() < HEADER {
        return Err(format!("is an SPZ scene of {} bytes, expected a header of {HEADER}", bytes.len()));
    }
    let header = Header::parse(bytes)?;
    if header.version != 4 {
        return Err(format!("is SPZ version {}; 1 to 3 (in gzip streams) and 4 are known", header.version));
    }
    let sizes = header.sizes(bytes.len())?;
    let wanted: Vec<usize> = (0..NAMES.len()).filter(|&i| sizes[i] > 0).collect();
    let streams = usize::from(bytes[15]);
    if streams != wanted.len() {
        let degree = header.sh_degree;
        return Err(format!("has {streams} streams, expected {} of SH degree {degree}", wanted.len()));
    }
    let table = u32::from_le_bytes([bytes[16], bytes[17], bytes[18], bytes[19]]) as usize;
    let end = table.saturating_add(TABLE_ROW * streams);
    if table < HEADER || end > bytes.len() {
        return Err(format!("has its table of streams at byte {table}, expected {HEADER} or more and within the file"));
    }
    let extensions = if header.has(HAS_EXTENSIONS) { &bytes[HEADER..table] } else { &[] };
    let Extensions { frame, lobes, settings } = Extensions::parse(extensions)?;
    let mut attributes: [Vec<u8>; 6] = Default::default();
    let mut rest = &bytes[end..];
    for (&i, row) in wanted.iter().zip(bytes[table..end].chunks_exact(TABLE_ROW)) {
        let number = |at: usize| row[at..at + 8].iter().rev().fold(0u64, |n, &b| n << 8 | u64::from(b));
        let (packed, whole) = (number(0), number(8));
        if whole != sizes[i] as u64 {
            let (name, count) = (NAMES[i], header.count);
            return Err(format!("has {whole} bytes of {name}, expected {} of {count} Gaussians", sizes[i]));
        }
        let split = usize::try_from(packed).ok().and_then(|packed| rest.split_at_checked(packed));
        let Some((taken, left)) = split else {
            return Err(format!("ends in its stream of {}, which has {packed} bytes, not {}", NAMES[i], rest.len()));
        };
        rest = left;
        attributes[i] = inflate::zstd(taken, sizes[i], NAMES[i])?;
    }
    if !rest.is_empty() {
        return Err(format!("has {} bytes behind its last stream", rest.len()));
    }
    let base = decode(header, attributes.each_ref().map(Vec::as_slice), frame);
    let mut parsed = Parsed { base, antialiased: header.has(ANTIALIASED), settings, ..Default::default() };
    if let Some(lobes) = lobes.filter(|_| with_lobes) {
        let in_extension = |what| format!("has an extension {LOBES_EXTENSION:#x} that {what}");
        let (supplement, learned) = parse_lobes(lobes).map_err(in_extension)?;
        (parsed.supplement, parsed.learned) = (Some(supplement), learned);
    }
    Ok(parsed)
}

/// Extensions that glint knows.
struct Extensions<'a> {
    /// Signs of the axes.
    frame: Signs,
    /// Payload of [`LOBES_EXTENSION`].
    lobes: Option<&'a [u8]>,
    settings: Settings,
}

impl<'a> Extensions<'a> {
    fn parse(mut records: &'a [u8]) -> Result<Self, String> {
        let mut found = Extensions { frame: Y_UP_Z_BACK, lobes: None, settings: Settings::default() };
        while let Some((head, rest)) = records.split_first_chunk::<8>() {
            let [a, b, c, d, e, f, g, h] = *head;
            let (kind, length) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
            let Some((payload, rest)) = rest.split_at_checked(length as usize) else {
                return Err(format!(
                    "has an extension {kind:#x} of {length} bytes, but {} are left for it",
                    rest.len()
                ));
            };
            records = rest;
            match kind {
                LOBES_EXTENSION => found.lobes = Some(payload),
                // Settings that another program has damaged are no reason to refuse the scene.
                SETTINGS_EXTENSION => found.settings = serde_json::from_slice(payload).unwrap_or_default(),
                FRAME_EXTENSION => {
                    found.frame = signs_of(payload.first_chunk().map(|&bytes| u32::from_le_bytes(bytes)))?
                }
                _ => {}
            }
        }
        Ok(found)
    }
}

/// Signs of the axes of Adobe's frame.
fn signs_of(system: Option<u32>) -> Result<Signs, String> {
    match system {
        Some(0) => Ok(Y_UP_Z_BACK),
        Some(system @ 1..=8) => {
            let bit = |i: u32| (system - 1) >> i & 1 == 1;
            Ok([(0, true), (1, false), (2, true)].map(|(i, same)| if bit(i) == same { 1.0 } else { -1.0 }))
        }
        system => Err(format!("has a frame {system:?} in extension {FRAME_EXTENSION:#x}, expected 0 to 8")),
    }
}

/// Parses the payload of glint's extension: a supplement, and a base if it differs from the file's.
fn parse_lobes(payload: &[u8]) -> Result<(Supplement, Option<Gaussians>), String> {
    let scene = |payload: &mut &[u8]| -> Result<Option<Gaussians>, String> {
        let Some((length, rest)) = payload.split_first_chunk() else { return Err("ends within a length".into()) };
        let length = u32::from_le_bytes(*length) as usize;
        let split = rest.split_at_checked(length);
        let (scene, rest) =
            split.ok_or_else(|| format!("ends in a scene of {length} bytes, of which {} are left", rest.len()))?;
        *payload = rest;
        match scene {
            [] => Ok(None),
            scene => parse_streams(scene, false).map(|parsed| Some(parsed.base)),
        }
    };
    let mut rest = payload;
    let (gaussians, learned) = (scene(&mut rest)?.unwrap_or_default(), scene(&mut rest)?);
    let size = LOBE_BYTES * gaussians.len();
    inflate::check_promise(payload.len(), size as u64, "lobes")?;
    let mut lobes = Lobes::default();
    for bytes in inflate::zstd(rest, size, "lobes")?.as_chunks::<LOBE_BYTES>().0 {
        let &[a, b, c, d, e, f, g, h, i, j] = bytes;
        let part = |bytes| f32::from(i16::from_le_bytes(bytes)) / f32::from(i16::MAX);
        lobes.directions.push([part([a, b]), part([c, d]), part([e, f])]);
        lobes.widths.push(f32::from(u16::from_le_bytes([g, h])) / f32::from(u16::MAX));
        lobes.sharpness.push(half::f16::from_le_bytes([i, j]).to_f32());
    }
    axes::flip_lobes(&mut lobes, Y_UP_Z_BACK);
    Ok((Supplement { gaussians, lobes }, learned))
}

/// The payload that [`parse_lobes`] parses.
fn pack_lobes(
    supplement: &Supplement,
    learned: Option<&Gaussians>,
    notes: &mut Vec<String>,
) -> Result<Vec<u8>, String> {
    let Supplement { gaussians, lobes } = supplement;
    let mut out = Vec::new();
    for scene in [Some(gaussians), learned] {
        let bytes = scene.map_or(Ok(Vec::new()), |scene| pack(scene, VERSION, 0, &[], notes))?;
        // A longer one makes the whole record too long, which the caller refuses.
        out.extend((bytes.len() as u32).to_le_bytes());
        out.extend(bytes);
    }
    let mut turned = lobes.clone();
    axes::flip_lobes(&mut turned, Y_UP_Z_BACK);
    let mut stream = Vec::with_capacity(LOBE_BYTES * gaussians.len());
    for ((direction, width), sharpness) in turned.directions.iter().zip(&turned.widths).zip(&turned.sharpness) {
        let direction = DVec3::from_array(direction.map(f64::from)).normalize_or_zero();
        let parts = direction.to_array().map(|v| (v * f64::from(i16::MAX)).round() as i16);
        stream.extend(parts.into_iter().flat_map(i16::to_le_bytes));
        // The smallest width lies between two steps, and the lower one is refused.
        let [width, least] = [*width, *LOBE_WIDTHS.start()].map(|v| f64::from(v) * f64::from(u16::MAX));
        stream.extend((width.round().max(least.ceil()) as u16).to_le_bytes());
        // Beyond float16 the factor is 0 or 1 in float32 as well.
        let [least, most] = [half::f16::MIN, half::f16::MAX].map(half::f16::to_f32);
        stream.extend(half::f16::from_f32(sharpness.clamp(least, most)).to_le_bytes());
    }
    out.extend(zstd::bulk::compress(&stream, LEVEL).map_err(|error| error.to_string())?);
    Ok(out)
}

/// Decodes attributes, whose sizes match the header.
fn decode(
    header: Header,
    [positions, opacities, colors, scales, rotations, harmonics]: [&[u8]; 6],
    frame: Signs,
) -> Gaussians {
    let mut out = room(header.count as usize, u32::from(header.sh_degree));
    let step = (-f64::from(header.fraction_bits)).exp2();
    out.means.extend(positions.chunks_exact(header.widths()[0] as usize).map(|bytes| match bytes {
        &[a, b, c, d, e, f] => [[a, b], [c, d], [e, f]].map(|half| half::f16::from_le_bytes(half).to_f32()),
        bytes => [0, 3, 6].map(|at| {
            // The sign is in the highest of three bytes; shifting by a byte makes it that of a 32-bit number.
            let fixed = i32::from_le_bytes([0, bytes[at], bytes[at + 1], bytes[at + 2]]) >> 8;
            (f64::from(fixed) * step) as f32
        }),
    }));
    out.opacities.extend(opacities.iter().map(|&b| quantise::opacity_logit(b)));
    out.log_scales.extend(scales.as_chunks::<3>().0.iter().map(|rgb| rgb.map(|b| f32::from(b) / 16.0 - 10.0)));
    out.quats.extend(rotations.chunks_exact(header.widths()[4] as usize).map(|bytes| match bytes {
        &[x, y, z] => {
            let [x, y, z] = [x, y, z].map(|b| f64::from(b) / 127.5 - 1.0);
            let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
            [w, x, y, z].map(|v| v as f32)
        }
        bytes => rotation(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])),
    }));
    let higher = out.sh_coefficients() - 1;
    for (i, rgb) in colors.as_chunks::<3>().0.iter().enumerate() {
        out.sh.push(rgb.map(|b| ((f64::from(b) / 255.0 - 0.5) / COLOR) as f32));
        let rest = &harmonics.as_chunks::<3>().0[i * higher..(i + 1) * higher];
        out.sh.extend(rest.iter().map(|rgb| rgb.map(|b| (f32::from(b) - 128.0) / 128.0)));
    }
    axes::flip(&mut out, frame);
    out
}

/// Maximum magnitude of a component other than the largest.
const MAGNITUDE: f64 = 511.0 * std::f64::consts::SQRT_2;

fn rotation(packed: u32) -> [f32; 4] {
    // The last component is in the low bits.
    let three = [20, 10, 0].map(|shift| {
        let value = f64::from(packed >> shift & 511) / MAGNITUDE;
        if packed >> shift & 512 == 0 { value } else { -value }
    });
    let [x, y, z, w] = quantise::from_smallest_three((packed >> 30) as usize, three);
    [w, x, y, z]
}

fn pack_rotation([w, x, y, z]: [f32; 4]) -> u32 {
    let (largest, three) = quantise::smallest_three([x, y, z, w]);
    three.into_iter().fold(largest as u32, |packed, v| {
        let magnitude = (MAGNITUDE * v.abs()).round().min(511.0) as u32;
        packed << 10 | u32::from(v < 0.0) << 9 | magnitude
    })
}

/// x, y and z for versions 1 and 2, with the sign that makes w positive.
fn rotation_bytes(quat: [f32; 4]) -> [u8; 3] {
    let [w, x, y, z] = quantise::unit(quat);
    let sign = if w < 0.0 { -1.0 } else { 1.0 };
    [x, y, z].map(|v| quantise::byte(127.5 * (sign * v + 1.0)))
}

/// Writes one of the versions 1 to 4. Version 3 has the same precision as 4, but no lobes; 2 has coarser
/// rotations, and 1 also has positions of 16 bits. Floaters that would leave the others less than 12 fraction
/// bits are moved in. Other viewers show the base for them, if there is one.
///
/// Versions below 4 keep neither lobes nor settings.
///
/// # Errors
/// [`Error::Usage`] if there is no such version, or if a position exceeds its range.
pub(in crate::data) fn write(file: &SceneFile, path: &Path, version: Option<u8>) -> Result<Vec<String>> {
    let (Scene { base, supplement, origin, .. }, version) = (&file.scene, version.unwrap_or(VERSION));
    let refuse = |what: String| Error::Usage(format!("{}: {what}", name(path)));
    if !(1..=VERSION).contains(&version) {
        return Err(refuse(format!("there is no SPZ version {version}, expected 1 to {VERSION}")));
    }
    let (mut notes, mut extensions, mut shown) = (Vec::new(), Vec::new(), base);
    let mut extend = |kind: u32, payload: &[u8]| {
        let length =
            u32::try_from(payload.len()).map_err(|_| refuse("an extension of SPZ holds no more than 4 GB".into()))?;
        extensions.extend([kind, length].into_iter().flat_map(u32::to_le_bytes));
        extensions.extend(payload);
        Ok::<_, Error>(())
    };
    if let Some(supplement) = supplement {
        shown = file.shown.as_ref().unwrap_or(base);
        let learned = file.shown.as_ref().map(|_| base);
        extend(LOBES_EXTENSION, &pack_lobes(supplement, learned, &mut notes).map_err(refuse)?)?;
    }
    let origin = Some(origin.to_array()).filter(|_| *origin != DVec3::ZERO);
    let settings = Settings { origin, glint: file.trained_with };
    if version == VERSION && settings != Settings::default() {
        extend(SETTINGS_EXTENSION, &serde_json::to_vec(&settings).map_err(|error| refuse(error.to_string()))?)?;
    }
    let flags = if file.trained_with.antialiased == Some(true) { ANTIALIASED } else { 0 };
    put(path, &pack(shown, version, flags, &extensions, &mut notes).map_err(refuse)?)?;
    notes.dedup();
    Ok(notes)
}

/// A whole file. `extensions` are for version 4.
fn pack(
    gaussians: &Gaussians,
    version: u8,
    flags: u8,
    extensions: &[u8],
    notes: &mut Vec<String>,
) -> Result<Vec<u8>, String> {
    let Grid { fraction_bits, limit, step } = Grid::of(&gaussians.means, version)?;
    let count = u32::try_from(gaussians.len()).map_err(|_| format!("SPZ holds no more than {} Gaussians", u32::MAX))?;
    let mut turned = gaussians.clone();
    if let Some(limit) = limit {
        let (moved, all) = (floaters::move_in(&mut turned, limit), gaussians.len());
        notes.push(format!(
            "{moved} of {all} Gaussians lie beyond ±{limit:.0} and were moved in to there, smaller by as much: so the positions of the \
             others keep a step of {step}"
        ));
    }
    let size = floaters::median_size(&gaussians.log_scales);
    if step > COARSE * size {
        notes.push(format!("positions lie on a grid of step {step}, and the median size of a Gaussian is {size:.3}"));
    }
    axes::flip(&mut turned, Y_UP_Z_BACK);
    let streams = encode(&turned, fraction_bits, version);
    let streams: Vec<&[u8]> = streams.iter().map(Vec::as_slice).filter(|stream| !stream.is_empty()).collect();
    let mut out = Vec::from(MAGIC);
    out.extend([u32::from(version), count].into_iter().flat_map(u32::to_le_bytes));
    let flags = flags | if extensions.is_empty() { 0 } else { HAS_EXTENSIONS };
    out.extend([gaussians.sh_degree as u8, fraction_bits, flags]);
    let fail = |error: std::io::Error| error.to_string();
    if version < VERSION {
        out.resize(LEGACY_HEADER, 0);
        streams.iter().for_each(|stream| out.extend(*stream));
        return inflate::deflate(&out).map_err(fail);
    }
    let packed: Vec<Vec<u8>> =
        streams.iter().map(|stream| zstd::bulk::compress(stream, LEVEL)).collect::<Result<_, _>>().map_err(fail)?;
    out.push(streams.len() as u8);
    out.extend(((HEADER + extensions.len()) as u32).to_le_bytes());
    out.resize(HEADER, 0);
    out.extend(extensions);
    for (stream, packed) in streams.iter().zip(&packed) {
        out.extend([packed.len() as u64, stream.len() as u64].into_iter().flat_map(u64::to_le_bytes));
    }
    packed.iter().for_each(|packed| out.extend(packed));
    Ok(out)
}

/// Quantisation of positions.
struct Grid {
    /// The most fraction bits that leave room for the farthest position, floaters aside. Unused by version 1,
    /// whose positions are float16.
    fraction_bits: u8,
    /// Limit that floaters are moved to; `None` if all positions fit.
    limit: Option<f64>,
    /// Grid step in scene units; for float16 that of the farthest position.
    step: f64,
}

impl Grid {
    fn of(means: &[[f32; 3]], version: u8) -> Result<Grid, String> {
        let [farthest, most] = floaters::reaches(means);
        let beyond = |end: f64| {
            Err(format!(
                "a position of {farthest:e} is beyond what SPZ version {version} holds, ±{end}; .ply and .glb hold it"
            ))
        };
        if version == 1 {
            let end = f64::from(half::f16::MAX);
            let limit = (farthest > end).then_some(end);
            // 11 bits of the number's own size, down to the smallest float16.
            let step = most.max(half::f16::MIN_POSITIVE.into()).log2().floor().exp2() / 1024.0;
            return if most > end { beyond(end) } else { Ok(Grid { fraction_bits: 0, limit, step }) };
        }
        let bits = |reach: f64| {
            let fits = |bits: &u8| (reach * f64::from(*bits).exp2()).round() <= *FIXED.end();
            (0..=MOST_FRACTION_BITS).rev().find(fits)
        };
        let (fraction_bits, moves) = match (bits(farthest), bits(most)) {
            (Some(all), Some(own)) if all < own.min(OWN_FRACTION_BITS) => (own.min(OWN_FRACTION_BITS), true),
            (None, Some(own)) => (own.min(OWN_FRACTION_BITS), true),
            (Some(all), _) => (all, false),
            (None, None) => return beyond(*FIXED.end()),
        };
        let step = (-f64::from(fraction_bits)).exp2();
        Ok(Grid { fraction_bits, limit: moves.then_some(*FIXED.end() * step), step })
    }
}

fn encode(gaussians: &Gaussians, fraction_bits: u8, version: u8) -> [Vec<u8>; 6] {
    let one = f64::from(fraction_bits).exp2();
    let fixed = |v: f32| {
        let [a, b, c, _] = ((f64::from(v) * one).round().clamp(*FIXED.start(), *FIXED.end()) as i32).to_le_bytes();
        [a, b, c]
    };
    let positions = gaussians.means.iter().flatten();
    let k = gaussians.sh_coefficients();
    let constant = gaussians.sh.iter().step_by(k).flatten();
    let higher = gaussians.sh.iter().enumerate().filter(|(i, _)| i % k > 0);
    [
        match version {
            1 => positions.flat_map(|&v| half::f16::from_f32(v).to_le_bytes()).collect(),
            _ => positions.flat_map(|&v| fixed(v)).collect(),
        },
        gaussians.opacities.iter().map(|&v| quantise::opacity_byte(v)).collect(),
        constant.map(|&v| quantise::byte(255.0 * (COLOR * f64::from(v) + 0.5))).collect(),
        gaussians.log_scales.iter().flatten().map(|&v| quantise::byte(16.0 * (f64::from(v) + 10.0))).collect(),
        match version {
            1 | 2 => gaussians.quats.iter().flat_map(|&q| rotation_bytes(q)).collect(),
            _ => gaussians.quats.iter().flat_map(|&q| pack_rotation(q).to_le_bytes()).collect(),
        },
        higher.flat_map(|(_, &rgb)| rgb.map(|v| quantise::byte(128.0 * f64::from(v) + 128.0))).collect(),
    ]
}
