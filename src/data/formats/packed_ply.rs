//! Reads and writes PlayCanvas' compressed PLY: chunks of 256 Gaussians, quantised within the chunk's bounds.
//!
//! Source: playcanvas/splat-transform, compressed-chunk.ts and decompress-ply.ts. Element `chunk` has the
//! minimum and maximum of its Gaussians' positions, logarithms of scales and (in newer files) colors as
//! float32. Element `vertex` has four 32-bit words per Gaussian, the first component in the high bits:
//! position and scale of 11, 10 and 11 bits between the chunk's bounds; color and opacity of 8 bits each;
//! the rotation w, x, y, z as the index of its largest component (2 bits) and the others of 10 bits for −√½
//! to √½. Element `sh` has the harmonics above the constant one, channel by channel as in a 3DGS PLY, as
//! bytes for −4 to 4. The frame is that of a 3DGS PLY.

use std::io::Write;
use std::ops::Range;
use std::path::Path;

use super::common::{put, room};
use super::{floaters, order, quantise};
use crate::data::SceneFile;
use crate::data::ply_format::{Element, Ply, write_comments};
use crate::scene::Gaussians;
use crate::{Error, Result};

/// Gaussians per chunk.
const CHUNK: usize = 256;
const PACKED: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];
/// Names of the minima and maxima, in file order.
const BOUNDS: [&str; 18] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
    "min_r",
    "min_g",
    "min_b",
    "max_r",
    "max_g",
    "max_b",
];
/// Start of the colors' bounds; in files without them the bounds are 0 and 1.
const COLORS: usize = 12;
const NO_COLOR_BOUNDS: [f32; 6] = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
/// Bits of the three parts of a position or scale.
const PARTS: [u32; 3] = [11, 10, 11];
/// Clamp for logarithms of scales; otherwise one infinitely thin Gaussian would use up the bits of its whole
/// chunk.
const SCALES: f32 = 20.0;
/// A note reports chunks with a grid step above this fraction of a Gaussian's median size: a mean is then off
/// by up to half a standard deviation.
const COARSE: f64 = 1.0;
/// Range of a coefficient: bytes cover −4 to 4.
const HARMONICS: f64 = 8.0;

/// Whether a PLY has this layout.
pub(in crate::data) fn is_packed(ply: &Ply) -> bool {
    ply.element("vertex").is_some_and(|vertex| vertex.scalar(PACKED[0]).is_some())
}

/// Reads the Gaussians. `path` is only used in errors.
pub(in crate::data) fn unpack(ply: &Ply, path: &Path) -> Result<Gaussians> {
    let fail = |what: String| Error::input(path, what);
    let element = |name: &str| {
        ply.element(name).ok_or_else(|| fail(format!("has no element `{name}`, which a compressed PLY has")))
    };
    let (chunk, vertex) = (element("chunk")?, element("vertex")?);
    let place = |element: &Element, name: &str| {
        let what = || fail(format!("element `{}` lacks property `{name}`, which a compressed PLY has", element.name));
        element.scalar(name).ok_or_else(what)
    };
    let colored = chunk.scalar(BOUNDS[COLORS]).is_some();
    let bounds = BOUNDS[..if colored { BOUNDS.len() } else { COLORS }].iter();
    let bounds = bounds.map(|name| place(chunk, name)).collect::<Result<Vec<usize>>>()?;
    let mut packed = [0; 4];
    for (slot, name) in packed.iter_mut().zip(PACKED) {
        *slot = place(vertex, name)?;
        if vertex.properties[*slot].number.bytes() != 4 || !vertex.properties[*slot].number.is_integer() {
            return Err(fail(format!("property `{name}` of element `vertex` is of another type, expected uint")));
        }
    }
    let (count, chunks) = (vertex.rows, chunk.rows);
    if chunks != count.div_ceil(CHUNK as u64) {
        let expected = count.div_ceil(CHUNK as u64);
        return Err(fail(format!("has {chunks} rows of element `chunk`, expected {expected} of {count} Gaussians")));
    }
    let harmonics = ply.element("sh").map(|sh| harmonics(sh, count)).transpose().map_err(fail)?;
    let harmonics = harmonics.unwrap_or_default();
    ply.check_size()?;

    let (mut limits, mut words): (Vec<[f32; 18]>, Vec<[u32; 4]>) = Default::default();
    let mut bytes: Vec<u8> = Vec::new();
    ply.for_each_row(|element, _, values| {
        match &element.name[..] {
            "chunk" => {
                let mut row = [0.0; 18];
                row[COLORS..].copy_from_slice(&NO_COLOR_BOUNDS);
                row.iter_mut().zip(&bounds).for_each(|(slot, &at)| *slot = values[at] as f32);
                limits.push(row);
            }
            // The sign does not matter: the bits are the same.
            "vertex" => words.push(packed.map(|at| values[at] as i64 as u32)),
            "sh" => bytes.extend(harmonics.iter().map(|&at| values[at] as u8)),
            _ => {}
        }
        Ok(())
    })?;
    let degree = [0, 3, 8, 15].iter().position(|&k| 3 * k == harmonics.len()).unwrap_or(0) as u32;
    let mut out = room(words.len(), degree);
    for (i, &[position, rotation, scale, color]) in words.iter().enumerate() {
        let limits = &limits[i / CHUNK];
        out.means.push(three(position, &limits[..6]));
        out.log_scales.push(three(scale, &limits[6..COLORS]));
        let [r, g, b, opacity] = color.to_be_bytes();
        let rgb = [r, g, b].map(|byte| f64::from(byte) / 255.0);
        let rgb = between(rgb, &limits[COLORS..]);
        out.sh.push(rgb.map(|v| ((v - 0.5) / quantise::C0) as f32));
        out.opacities.push(quantise::opacity_logit(opacity));
        let smaller = [20, 10, 0].map(|shift| rotation_part(rotation >> shift & 1023));
        out.quats.push(quantise::from_smallest_three((rotation >> 30) as usize, smaller));
        let channel = harmonics.len() / 3;
        let row = &bytes[i * harmonics.len()..(i + 1) * harmonics.len()];
        out.sh.extend((0..channel).map(|k| [0, 1, 2].map(|c| harmonic(row[c * channel + k]) as f32)));
    }
    Ok(out)
}

/// Columns of the harmonics in element `sh`, in order.
fn harmonics(sh: &Element, count: u64) -> Result<Vec<usize>, String> {
    let places: Vec<usize> = (0..).map_while(|i| sh.scalar(&format!("f_rest_{i}"))).take(46).collect();
    if ![9, 24, 45].contains(&places.len()) {
        return Err(format!(
            "element `sh` has {} properties `f_rest_*`; expected 9, 24 or 45 (SH degree 1 to 3)",
            places.len()
        ));
    }
    if sh.rows != count {
        return Err(format!("has {} rows of element `sh`, expected one for each of {count} Gaussians", sh.rows));
    }
    let byte = |&at: &usize| sh.properties[at].number.bytes() == 1 && sh.properties[at].number.is_integer();
    if !places.iter().all(byte) {
        return Err("a property `f_rest_*` of element `sh` is of another type, expected uchar".into());
    }
    Ok(places)
}

/// Interpolates between the three minima and the three maxima.
fn between(shares: [f64; 3], limits: &[f32]) -> [f64; 3] {
    std::array::from_fn(|i| f64::from(limits[i]) * (1.0 - shares[i]) + f64::from(limits[i + 3]) * shares[i])
}

/// Unpacks a position or scale.
fn three(word: u32, limits: &[f32]) -> [f32; 3] {
    let [_, second, third] = PARTS;
    let parts = [word >> (second + third), word >> third, word];
    let shares = std::array::from_fn(|i| {
        let most = (1u32 << PARTS[i]) - 1;
        f64::from(parts[i] & most) / f64::from(most)
    });
    between(shares, limits).map(|v| v as f32)
}

fn rotation_part(bits: u32) -> f64 {
    (f64::from(bits) / 1023.0 - 0.5) * std::f64::consts::SQRT_2
}

/// The extreme bytes are −4 and 4; the others stand for the middle of their interval.
fn harmonic(byte: u8) -> f64 {
    let share = match byte {
        0 => 0.0,
        255 => 1.0,
        byte => (f64::from(byte) + 0.5) / 256.0,
    };
    HARMONICS * (share - 0.5)
}

/// The byte with the nearest value.
fn harmonic_byte(value: f32) -> u8 {
    let value = f64::from(value);
    let near = (256.0 * (value / HARMONICS + 0.5)).floor().clamp(0.0, 255.0) as u8;
    let distance = |&byte: &u8| (harmonic(byte) - value).abs();
    let candidates = [near, near.saturating_sub(1), near.saturating_add(1)];
    candidates.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(near)
}

/// Writes the Gaussians reordered, so that those of a chunk are neighbours. Floaters get their own chunks.
pub(in crate::data) fn write(file: &SceneFile, path: &Path, _: Option<u8>) -> Result<Vec<String>> {
    let gaussians = &file.scene.base;
    let (order, fill) = chunks(gaussians);
    let mut sorted = gaussians.reordered(&order);
    let mut notes = Vec::new();
    if !fill.is_empty() {
        sorted.opacities[fill.clone()].fill(f32::MIN);
        notes.push(format!(
            "{} of {} Gaussians lie far from the others and have chunks of their own, or the others' positions would be coarse; {} \
             invisible Gaussians fill the chunk before them",
            sorted.len() - fill.end,
            gaussians.len(),
            fill.len()
        ));
    }
    let mut out = Vec::new();
    // Writing to memory does not fail.
    let _ = write_header(&mut out, sorted.len(), sorted.sh_coefficients() - 1, file);
    let (mut words, mut harmonics): (Vec<u32>, Vec<u8>) = Default::default();
    let k = sorted.sh_coefficients();
    let color = |i: usize| sorted.sh[i * k].map(|v| (quantise::C0 * f64::from(v) + 0.5) as f32);
    let scale = |i: usize| sorted.log_scales[i].map(|v| v.clamp(-SCALES, SCALES));
    let near = if fill.is_empty() { sorted.len() } else { fill.end };
    let (mut coarse, mut widest) = (0, 0.0f64);
    for begin in (0..sorted.len()).step_by(CHUNK) {
        let rows = begin..sorted.len().min(begin + CHUNK);
        let position = limits(rows.clone().map(|i| sorted.means[i]));
        let step =
            |axis: usize| (f64::from(position[axis + 3]) - f64::from(position[axis])) / f64::from(1u32 << PARTS[axis]);
        let step = (0..3).map(step).fold(0.0, f64::max);
        if begin < near && step > COARSE * floaters::median_size(&sorted.log_scales[rows.clone()]) {
            (coarse, widest) = (coarse + rows.len(), widest.max(step));
        }
        let scales = limits(rows.clone().map(scale));
        let colors = limits(rows.clone().map(color));
        out.extend([position, scales, colors].as_flattened().iter().flat_map(|v| v.to_le_bytes()));
        for i in rows {
            let [r, g, b] = std::array::from_fn(|c| bits(color(i)[c], &colors, c, 8));
            let color = r << 24 | g << 16 | b << 8 | u32::from(quantise::opacity_byte(sorted.opacities[i]));
            let packed = |values: [f32; 3], limits: &[f32; 6]| {
                (0..3).fold(0, |word, part| word << PARTS[part] | bits(values[part], limits, part, PARTS[part]))
            };
            words.extend([
                packed(sorted.means[i], &position),
                rotation(sorted.quats[i]),
                packed(scale(i), &scales),
                color,
            ]);
        }
    }
    if coarse > 0 {
        let all = gaussians.len();
        notes.push(format!(
            "{coarse} of {all} positions lie on a grid that is coarse for Gaussians of their size, of step {widest:.3} or less: some of \
             their chunk lie far from the others"
        ));
    }
    out.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    for row in sorted.sh.chunks_exact(k) {
        for channel in 0..3 {
            harmonics.extend(row[1..].iter().map(|rgb| harmonic_byte(rgb[channel])));
        }
    }
    out.extend(harmonics);
    put(path, &out)?;
    Ok(notes)
}

/// Gaussians in file order, floaters last; and the range of rows that only pad the chunk before the floaters.
fn chunks(gaussians: &Gaussians) -> (Vec<usize>, Range<usize>) {
    let (middle, limit) = floaters::core(&gaussians.means);
    let all = order::along_curve(&gaussians.means);
    let (mut order, far): (Vec<usize>, Vec<usize>) =
        all.into_iter().partition(|&i| floaters::distance(&gaussians.means[i], middle) <= limit);
    let near = order.len();
    if let (Some(&last), false) = (order.last(), far.is_empty()) {
        order.resize(near.next_multiple_of(CHUNK), last);
    }
    let fill = near..order.len();
    order.extend(far);
    (order, fill)
}

fn write_header(out: &mut Vec<u8>, count: usize, higher: usize, file: &SceneFile) -> std::io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0")?;
    write_comments(out, file.scene.origin, &file.trained_with)?;
    writeln!(out, "element chunk {}", count.div_ceil(CHUNK))?;
    BOUNDS.iter().try_for_each(|name| writeln!(out, "property float {name}"))?;
    writeln!(out, "element vertex {count}")?;
    PACKED.iter().try_for_each(|name| writeln!(out, "property uint {name}"))?;
    if higher > 0 {
        writeln!(out, "element sh {count}")?;
        (0..3 * higher).try_for_each(|i| writeln!(out, "property uchar f_rest_{i}"))?;
    }
    writeln!(out, "end_header")
}

/// Minimum and maximum of each component.
fn limits(values: impl Iterator<Item = [f32; 3]>) -> [f32; 6] {
    values
        .fold([f32::INFINITY, f32::NEG_INFINITY].map(|v| [v; 3]), |[low, high], value| {
            [std::array::from_fn(|i| low[i].min(value[i])), std::array::from_fn(|i| high[i].max(value[i]))]
        })
        .as_flattened()
        .try_into()
        .unwrap_or_default()
}

/// The nearest of 2^`bits` values between the limits of component `part`.
fn bits(value: f32, limits: &[f32; 6], part: usize, bits: u32) -> u32 {
    let [value, low, high] = [value, limits[part], limits[part + 3]].map(f64::from);
    let share = if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 0.0 };
    (share * f64::from((1u32 << bits) - 1)).round() as u32
}

fn rotation(quat: [f32; 4]) -> u32 {
    let (largest, smaller) = quantise::smallest_three(quat);
    let part = |v: f64| ((v / std::f64::consts::SQRT_2 + 0.5) * 1023.0).round().clamp(0.0, 1023.0) as u32;
    smaller.into_iter().fold(largest as u32, |word, v| word << 10 | part(v))
}
