//! Reads scenes from PLY files.
//!
//! The layout is that of the 3DGS reference trainer: element `vertex` with x y z, nx ny nz (ignored, and not written with constant colors),
//! f_dc_0..2, f_rest_0..(3(L+1)²−4) channel-major, opacity (logit), scale_0..2 (natural log), rot_0..3 (w x y
//! z). Spherical betas have sb_params_0..11 instead of f_rest, like DBS: r, g, b, θ, φ and b of both lobes,
//! number by number. Supplementary Gaussians are a second element `augmented` with the same properties and
//! lobe_x lobe_y lobe_z lobe_width lobe_sharpness.
//!
//! If a base was trained together with its supplement, `vertex` is the original base, for other viewers. An
//! element `learned` then has the changed properties, row by row, and after them the added plain Gaussians.
//!
//! If only some Gaussians have bands, `vertex` has constant colors, and an element `bands` the f_rest of its last Gaussians.
//!
//! Comments announce these elements (see `ply_format`), so that readers of a single element can open the file.
//! Older files of glint declare them as ordinary elements; these are read too.

use std::path::Path;

use glam::DVec3;

#[cfg(feature = "formats")]
use super::formats::packed_ply;
use super::ply_columns::{BANDS, BASE, LEARNED, Place, SUPPLEMENT, columns, number_mut};
use super::ply_format::{Element, Ply};
use super::ply_variants::{FILTER, filtered, origin_of_doubles, remarks};
use super::scene_file::SceneFile;
use crate::scene::{
    Gaussians, Lobes, Scene, Supplement,
    color::{self, ColorModel, MODELS},
};
use crate::stages::constants::constants::SH_C0;
use crate::{Error, Result};

/// Colors that some writers store instead of f_dc_*: 0 to 255, or floats of 0 to 1 if none is larger.
const PLAIN: [&str; 3] = ["red", "green", "blue"];

/// Columns of an element, with the index of each property.
struct Columns {
    /// All columns; for `learned` only the changed ones, with all coefficients beyond the constant one or
    /// none.
    places: Vec<(usize, Place)>,
    /// Index of [`FILTER`].
    filter: Option<usize>,
    /// Set if the element has colors instead of coefficients: whether they are integers.
    plain: Option<bool>,
    sh_degree: u32,
    lobed: bool,
}

impl Columns {
    fn find(element: &Element, lobed: bool) -> Result<Columns, String> {
        let scalars = || element.properties.iter().filter(|p| !p.is_list());
        let sh_degree = degree_of(&element.name, |prefix| scalars().filter(|p| p.name.starts_with(prefix)).count())?;
        let has = |name: &str| element.scalar(name).is_some();
        let plain = PLAIN.iter().enumerate().all(|(channel, name)| has(name) && !has(&format!("f_dc_{channel}")));
        let find = |(name, place): (String, Place)| {
            let name = match place {
                Place::Sh(0, channel) if plain => PLAIN[channel],
                _ => &name,
            };
            let lacks = || format!("element `{}` lacks property `{name}`, which a 3DGS PLY has", element.name);
            Ok((element.scalar(name).ok_or_else(lacks)?, place))
        };
        let places = columns(sh_degree, lobed).into_iter().map(find).collect::<Result<Vec<_>, String>>()?;
        let integers = || PLAIN.iter().all(|name| scalars().any(|p| p.name == *name && p.number.is_integer()));
        Ok(Columns { places, filter: element.scalar(FILTER), plain: plain.then(integers), sh_degree, lobed })
    }

    /// Finds the columns of an element that changes a base of this degree.
    fn changed(element: &Element, sh_degree: u32) -> Result<Columns, String> {
        let all = columns(sh_degree, false);
        let rest = all.iter().filter(|(_, place)| place.is_rest()).count();
        let places: Vec<_> =
            all.into_iter().filter_map(|(name, place)| Some((element.scalar(&name)?, place))).collect();
        let there = places.iter().filter(|(_, place)| place.is_rest()).count();
        if there != 0 && there != rest {
            let prefix = color::of(sh_degree).ply_prefix;
            let element = &element.name;
            return Err(format!("element `{element}` has {there} of {rest} properties `{prefix}*`"));
        }
        Ok(Columns { places, filter: None, plain: None, sh_degree, lobed: false })
    }

    /// Finds the columns of `bands`.
    fn bands(element: &Element) -> Result<Columns, String> {
        let scalars = || element.properties.iter().filter(|p| !p.is_list());
        let sh_degree = degree_of(BANDS, |prefix| scalars().filter(|p| p.name.starts_with(prefix)).count())?;
        let mut columns = Columns::changed(element, sh_degree)?;
        columns.places.retain(|(_, place)| place.is_rest());
        match color::of(sh_degree).harmonics {
            Some(1..) => Ok(columns),
            _ => Err(format!("element `{BANDS}` has {}; expected degree 1 to 3", color::of(sh_degree).name)),
        }
    }

    /// Gives the last Gaussians of `base` their bands.
    fn add(&self, rows: &[Vec<f64>], base: &mut Gaussians) -> Result<(), String> {
        let (count, own) = (base.len(), color::of(base.sh_degree).name);
        let Some(first) = count.checked_sub(rows.len()).filter(|_| base.sh_degree == 0) else {
            return Err(format!(
                "element `{BANDS}` has {} rows for {count} of `{BASE}` with {own}; expected no more, and constant colors",
                rows.len()
            ));
        };
        *base = std::mem::take(base).with_degree(self.sh_degree);
        let mut no_lobes = Lobes::default();
        rows.iter().enumerate().for_each(|(i, row)| self.set(row, DVec3::ZERO, base, &mut no_lobes, first + i));
        Ok(())
    }

    /// Sets these columns of row `i`. Means are relative to `origin`.
    fn set(&self, values: &[f64], origin: DVec3, gaussians: &mut Gaussians, lobes: &mut Lobes, i: usize) {
        for &(at, place) in &self.places {
            let begin = if let Place::Mean(axis) = place { origin[axis] } else { 0.0 };
            *number_mut(gaussians, lobes, i, place) = (values[at] - begin) as f32;
        }
        if let Some(filter) = self.filter {
            let (scales, opacity) = (&mut gaussians.log_scales[i], &mut gaussians.opacities[i]);
            (*scales, *opacity) = filtered(*scales, *opacity, values[filter]);
        }
    }

    fn push(&self, values: &[f64], origin: DVec3, gaussians: &mut Gaussians, lobes: &mut Lobes) {
        let i = gaussians.len();
        resize(gaussians, i + 1);
        if self.lobed {
            lobes.directions.push([0.0; 3]);
            lobes.widths.push(0.0);
            lobes.sharpness.push(0.0);
        }
        self.set(values, origin, gaussians, lobes, i);
    }

    /// Replaces these columns of `base`. Extra rows are new Gaussians.
    fn apply(&self, rows: &[Vec<f64>], origin: DVec3, base: &mut Gaussians) -> Result<(), String> {
        let count = base.len();
        let fixed = self.places.iter().filter(|(_, place)| !place.is_rest()).count();
        if rows.len() < count || (rows.len() > count && fixed < columns(0, false).len()) {
            return Err(format!(
                "element `{LEARNED}` has {} rows for {count} of `{BASE}`; expected as many, or more with all properties",
                rows.len()
            ));
        }
        resize(base, rows.len());
        let mut no_lobes = Lobes::default();
        rows.iter().enumerate().for_each(|(i, row)| self.set(row, origin, base, &mut no_lobes, i));
        Ok(())
    }
}

/// Sets the number of Gaussians; new ones are zeros.
fn resize(gaussians: &mut Gaussians, rows: usize) {
    gaussians.means.resize(rows, [0.0; 3]);
    gaussians.log_scales.resize(rows, [0.0; 3]);
    gaussians.quats.resize(rows, [0.0; 4]);
    gaussians.opacities.resize(rows, 0.0);
    gaussians.sh.resize(rows * gaussians.sh_coefficients(), [0.0; 3]);
}

/// Degree of an element's colors, from the number of properties with each name.
fn degree_of(element: &str, count: impl Fn(&str) -> usize) -> Result<u32, String> {
    let mut prefixes: Vec<&str> = MODELS.iter().map(|model| model.ply_prefix).collect();
    prefixes.dedup();
    prefixes.retain(|prefix| count(prefix) > 0);
    let prefix = match prefixes[..] {
        [] => return Ok(0),
        [prefix] => prefix,
        _ => {
            return Err(format!(
                "element `{element}` has properties `{}*`; expected one of them",
                prefixes.join("*` and `")
            ));
        }
    };
    let properties = |model: &ColorModel| 3 * (model.coefficients - 1);
    let found = |model: &ColorModel| model.ply_prefix == prefix && properties(model) == count(prefix);
    MODELS.iter().position(found).map(|index| index as u32).ok_or_else(|| {
        let models = MODELS.iter().filter(|model| model.ply_prefix == prefix);
        let expected: Vec<String> = models.map(|model| format!("{} ({})", properties(model), model.name)).collect();
        format!("element `{element}` has {} properties `{prefix}*`; expected {}", count(prefix), expected.join(", "))
    })
}

/// Reads a 3DGS scene, with its supplement if it has one, without checking the numbers. Properties may have
/// any order and any numeric type; unknown properties and elements are skipped. `path` is only used in
/// errors.
pub(super) fn parse(bytes: &[u8], _: Option<&Path>, path: &Path) -> Result<SceneFile> {
    let fail = |what: String| Error::input(path, what);
    let ply = Ply::parse(bytes, path)?;
    #[cfg(feature = "formats")]
    if packed_ply::is_packed(&ply) {
        let scene = Scene { base: packed_ply::unpack(&ply, path)?, origin: ply.origin, ..Scene::default() };
        return Ok(SceneFile { trained_with: ply.trained_with, ..scene.into() });
    }
    if let Some(kind) = describe_non_splats(&ply) {
        return Err(fail(format!("is {kind}, not a 3DGS PLY")));
    }
    let no_base = || fail(format!("has no element `{BASE}`, so it is not a 3DGS PLY"));
    let vertex = ply.element(BASE).ok_or_else(no_base)?;
    let base_columns = Columns::find(vertex, false).map_err(fail)?;
    let origin = origin_of_doubles(&ply, vertex)?;
    let extra_columns =
        ply.element(SUPPLEMENT).map(|element| Columns::find(element, true)).transpose().map_err(fail)?;
    let sh_degree = base_columns.sh_degree;
    let learned_columns = ply.element(LEARNED).map(|element| Columns::changed(element, sh_degree));
    let learned_columns = learned_columns.transpose().map_err(fail)?;

    if ply.element(LEARNED).is_some() && ply.element(BANDS).is_some() {
        return Err(fail(format!("has the elements `{LEARNED}` and `{BANDS}`; expected one of them")));
    }
    let bands_columns = ply.element(BANDS).map(Columns::bands).transpose().map_err(fail)?;

    let mut base = Gaussians { sh_degree, ..Default::default() };
    let extra_degree = extra_columns.as_ref().map_or(sh_degree, |columns| columns.sh_degree);
    let mut extra = Gaussians { sh_degree: extra_degree, ..Default::default() };
    let mut lobes = Lobes::default();
    let (mut learned, mut bands) = (Vec::new(), Vec::new());
    ply.for_each_row(|element, _, values| {
        match (&element.name[..], &extra_columns) {
            (BASE, _) => base_columns.push(values, origin, &mut base, &mut Lobes::default()),
            (SUPPLEMENT, Some(columns)) => columns.push(values, origin, &mut extra, &mut lobes),
            // `learned` may come before `vertex`.
            (LEARNED, _) => learned.push(values.to_vec()),
            (BANDS, _) => bands.push(values.to_vec()),
            _ => {}
        }
        Ok(())
    })?;
    for (columns, gaussians) in [(Some(&base_columns), &mut base), (extra_columns.as_ref(), &mut extra)] {
        if let Some(integers) = columns.and_then(|columns| columns.plain) {
            let k = gaussians.sh_coefficients();
            let largest = gaussians.sh.iter().step_by(k).flatten().fold(0.0, |a: f32, &b| a.max(b));
            let white = if integers || largest > 1.0 { 255.0 } else { 1.0 };
            let colors = gaussians.sh.iter_mut().step_by(k).flatten();
            colors.for_each(|v| *v = (*v / white - 0.5) / SH_C0);
        }
    }
    let mut shown = None;
    if let Some(columns) = learned_columns {
        shown = Some(base.clone());
        columns.apply(&learned, origin, &mut base).map_err(fail)?;
    }
    let supplement = extra_columns.map(|_| Supplement { gaussians: extra, lobes });
    let mixed = bands_columns.is_some();
    if let Some(columns) = bands_columns {
        columns.add(&bands, &mut base).map_err(fail)?;
    }
    let scene = Scene { base, supplement, mixed, origin: ply.origin + origin };
    let mut notes = remarks(vertex);
    if origin != DVec3::ZERO {
        let [x, y, z] = scene.origin.to_array();
        notes.push(format!(
            "positions are `double` and lie far from the world's origin: they are read to count from ({x}, {y}, {z})"
        ));
    }
    Ok(SceneFile { shown, trained_with: ply.trained_with, notes, ..scene.into() })
}

/// Describes a PLY without any splat property, if its content is recognised.
fn describe_non_splats(ply: &Ply) -> Option<&'static str> {
    let vertex = ply.element(BASE)?;
    if vertex.scalar("packed_position").is_some() {
        return Some("a compressed PLY, which this build of glint does not read");
    }
    let splat = |name: &&str| vertex.scalar(name).is_some();
    if ["sh0_0", "beta"].iter().all(splat) {
        return Some("a scene of beta kernels, as DBS writes them");
    }
    if splat(&"f_anchor_feat_0") {
        return Some("a scene of anchors and networks, as Scaffold-GS writes it");
    }
    if splat(&"scale_1") && !splat(&"scale_2") {
        return Some("a scene of flat Gaussians without `scale_2`, as 2DGS writes it");
    }
    let (means, others): (Vec<_>, Vec<_>) =
        columns(0, false).into_iter().partition(|(_, place)| matches!(place, Place::Mean(_)));
    let there = |(name, _): &(String, Place)| vertex.scalar(name).is_some();
    if others.iter().any(there) || !means.iter().all(there) {
        return None;
    }
    Some(if ply.element("face").is_some() { "a mesh" } else { "a point cloud" })
}

#[cfg(all(test, feature = "train"))]
mod tests {
    use std::fs;

    use super::*;
    use crate::data::ply_write::*;
    use crate::data::validate;
    use crate::data::{Dropped, parse_scene, read_scene, read_scene_leniently, write_scene, write_scene_file};
    use crate::scene::color::BETAS;

    /// Distinct numbers, so that a swap of order or channels shows.
    fn gaussians(n: usize, sh_degree: u32, seed: f32) -> Gaussians {
        let mut next = seed;
        let mut number = || {
            next += 1.0 / 3.0;
            next
        };
        let mut out = Gaussians { sh_degree, ..Default::default() };
        for _ in 0..n {
            out.means.push(std::array::from_fn(|_| number()));
            out.log_scales.push(std::array::from_fn(|_| -number()));
            out.quats.push(std::array::from_fn(|_| number()));
            out.opacities.push(number());
            for _ in 0..out.sh_coefficients() {
                out.sh.push(std::array::from_fn(|_| number()));
            }
        }
        out
    }

    fn scene(sh_degree: u32, supplement: bool) -> Scene {
        let lobes = Lobes {
            directions: vec![[0.0, -1.5, 2.0], [1e-3, 0.0, 0.1]],
            widths: vec![0.01, 1.0],
            sharpness: vec![-0.0, 3.0],
        };
        let supplement = supplement.then(|| Supplement { gaussians: gaussians(2, sh_degree, 100.0), lobes });
        Scene { base: gaussians(3, sh_degree, 0.5), supplement, ..Default::default() }
    }

    fn written(scene: &Scene) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.ply");
        write_scene(&path, scene).unwrap();
        assert_eq!(&read_scene(&path).unwrap(), scene);
        let bytes = fs::read(&path).unwrap();
        let header = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        assert_eq!((bytes.len() - header) as u64, scene_bytes(scene));
        bytes
    }

    fn error(bytes: &[u8]) -> String {
        parse_scene(bytes, Path::new("scene.ply")).unwrap_err().to_string()
    }

    #[track_caller]
    fn expect(bytes: &[u8], parts: &[&str]) {
        let message = error(bytes);
        for part in parts.iter().chain(&["scene.ply"]) {
            assert!(message.contains(part), "`{part}` is not in: {message}");
        }
    }

    /// The scene as text, with shuffled properties, mixed types and unknown content in between.
    fn ascii(big_endian: bool) -> (Vec<u8>, Scene) {
        let names = ["rot_3", "rot_2", "rot_1", "rot_0", "z", "y", "x", "opacity", "scale_2", "scale_1", "scale_0"];
        let mut header = String::from(if big_endian {
            "ply\r\nformat binary_big_endian 1.0\r\n"
        } else {
            "ply\nformat ascii 1.0\n"
        });
        header += "comment made by a test\nelement camera 1\nproperty list uchar int path\nproperty double focal\n";
        header += "element vertex 2\nproperty list uint8 short links\n";
        for name in names {
            header += &format!("property {} {name}\n", if name == "x" { "double" } else { "float" });
        }
        header += "property uchar f_dc_2\nproperty short f_dc_1\nproperty int f_dc_0\nproperty char label\n";
        for i in (0..9).rev() {
            header += &format!("property float f_rest_{i}\n");
        }
        header += "end_header\n";
        let mut out = header.into_bytes();
        if big_endian {
            out.extend([2, 0, 0, 0, 1, 0, 0, 0, 2]);
            out.extend(1.5f64.to_be_bytes());
        } else {
            out.extend(b"2 1 2 1.5\n");
        }
        for row in 0..2 {
            let f = |i: usize| 0.25 * (row * 50 + i) as f32 + 0.1;
            if big_endian {
                out.extend([1, 0, 7]);
                for (i, name) in names.into_iter().enumerate() {
                    match name {
                        "x" => out.extend((f(i) as f64).to_be_bytes()),
                        _ => out.extend(f(i).to_be_bytes()),
                    }
                }
                out.extend([200, 255, 254]);
                out.extend((-70000i32).to_be_bytes());
                out.push(0xff);
                (0..9).rev().for_each(|i| out.extend(f(20 + i).to_be_bytes()));
            } else {
                out.extend(b"1 7 ");
                (0..names.len()).for_each(|i| out.extend(format!("{} ", f(i)).bytes()));
                out.extend(b"200 -2 -70000 -1");
                (0..9).rev().for_each(|i| out.extend(format!(" {}", f(20 + i)).bytes()));
                out.extend(b"\n");
            }
        }
        let mut base = Gaussians { sh_degree: 1, ..Default::default() };
        for row in 0..2 {
            let f = |i: usize| 0.25 * (row * 50 + i) as f32 + 0.1;
            base.means.push([f(6), f(5), f(4)]);
            base.quats.push([f(3), f(2), f(1), f(0)]);
            base.opacities.push(f(7));
            base.log_scales.push([f(10), f(9), f(8)]);
            base.sh.push([-70000.0, -2.0, 200.0]);
            base.sh.extend((0..3).map(|k| [f(20 + k), f(23 + k), f(26 + k)]));
        }
        (out, Scene { base, ..Default::default() })
    }

    #[test]
    fn every_degree_comes_back_bit_for_bit_with_and_without_supplement() {
        for degree in 0..=BETAS {
            for supplement in [false, true] {
                written(&scene(degree, supplement));
            }
        }
        written(&Scene::default());
        written(&Scene {
            base: gaussians(1, 2, 0.0),
            supplement: Some(Supplement { gaussians: gaussians(0, 2, 0.0), lobes: Lobes::default() }),
            ..Default::default()
        });
    }

    #[test]
    fn colors_may_stand_in_the_place_of_their_coefficients() {
        let with = |kind: &str, colors: [&str; 2]| {
            let mut text = String::from("ply\nformat ascii 1.0\nelement vertex 2\n");
            for (name, place) in columns(0, false) {
                text += &match place {
                    Place::Sh(0, channel) => format!("property {kind} {}\n", PLAIN[channel]),
                    _ => format!("property float {name}\n"),
                };
            }
            text += "end_header\n";
            colors.iter().for_each(|rgb| text += &format!("1 2 3 {rgb} 0.5 -1 -1 -1 1 0 0 0\n"));
            parse_scene(text.as_bytes(), Path::new("a.ply")).map(|scene| scene.base.sh)
        };
        // Y₀⁰ = √(1/4π) = 0.2820948: black is −½ of it, white ½.
        let (half, fifth) = (0.5 / 0.282_094_8, 0.2 / 0.282_094_8);
        let near = |found: Vec<[f32; 3]>, expected: [[f32; 3]; 2]| {
            let pairs = found.as_flattened().iter().zip(expected.as_flattened());
            assert!(found.len() == 2 && pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-5), "{found:?}");
        };
        let expected = [[-half, half, fifth - half], [half, -half, half - fifth]];
        near(with("uchar", ["0 255 51", "255 0 204"]).unwrap(), expected);
        near(with("float", ["0 255 51", "255 0 204"]).unwrap(), expected);
        near(with("float", ["0 1 0.2", "1 0 0.8"]).unwrap(), expected);
        // Colors of a single value are bytes too.
        near(
            with("uchar", ["0 1 1", "1 1 0"]).unwrap()[..1].repeat(2),
            [[-half, 1.0 / 255.0 / 0.282_094_8 - half, 1.0 / 255.0 / 0.282_094_8 - half]; 2],
        );
        assert!(with("float", ["nan 0 0", "0 0 0"]).unwrap_err().to_string().contains("f_dc_0"));
    }

    #[test]
    fn a_base_that_learned_keeps_what_it_was_for_other_viewers() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.ply");
        let original = scene(2, true);
        let bytes = |scene: &Scene| {
            write_augmented(&path, &original.base, scene).unwrap();
            assert_eq!(&read_scene(&path).unwrap(), scene);
            let bytes = fs::read(&path).unwrap();
            // Stands for a reader that does not know the comment.
            let strange = header_with(&bytes, "comment glint element learned", "comment glint element unknown");
            assert_eq!(parse_scene(&strange, &path).unwrap().base, original.base);
            bytes.len()
        };
        let same = bytes(&original);
        let mut faded = original.clone();
        faded.base.opacities[1] = -7.5;
        assert!((4 * 3..100).contains(&(bytes(&faded) - same)), "three opacities");
        let mut moved = faded.clone();
        moved.base.means[0][2] = 9.0;
        moved.base.sh[3 * 9 - 1][1] = -3.0;
        bytes(&moved);
        let mut more = faded.clone();
        more.base.append(gaussians(1, 2, 7.0));
        let whole = bytes(&more);
        // Harmonics of 0 are not written.
        let mut lean = more.clone();
        lean.base.sh[3 * 9 + 1..].fill([0.0; 3]);
        assert_eq!(
            whole - bytes(&lean),
            4 * 4 * 3 * 8 + "comment glint property float f_rest_0\n".len() * 10 + 14 * 39
        );
        let fewer = Scene { base: gaussians(2, 2, 0.5), ..Default::default() };
        assert!(write_augmented(&path, &original.base, &fewer).unwrap_err().to_string().contains("begin with"));
    }

    fn write_augmented(path: &Path, shown: &Gaussians, scene: &Scene) -> Result<()> {
        write_scene_file(path, &SceneFile { shown: Some(shown.clone()), ..scene.clone().into() }).map(drop)
    }

    /// The lines before `end_header`, and the bytes from it on.
    fn split(bytes: &[u8]) -> (&str, &[u8]) {
        let (header, body) = bytes.split_at(bytes.windows(11).position(|w| w == b"end_header\n").unwrap());
        (std::str::from_utf8(header).unwrap(), body)
    }

    /// Parses the file like a reader of a single element that ignores comments.
    fn strict(bytes: &[u8]) -> (Vec<String>, Vec<f32>) {
        let (header, body) = split(bytes);
        let mut lines = header.lines().filter(|line| !line.starts_with("comment"));
        assert_eq!(lines.next(), Some("ply"));
        assert_eq!(lines.next(), Some("format binary_little_endian 1.0"));
        let rows: usize = lines.next().unwrap().strip_prefix("element vertex ").unwrap().parse().unwrap();
        let names: Vec<String> = lines.map(|line| line.strip_prefix("property float ").unwrap().into()).collect();
        let values = body[11..][..4 * rows * names.len()].chunks(4);
        (names, values.map(|v| f32::from_le_bytes(v.try_into().unwrap())).collect())
    }

    #[test]
    fn a_reader_of_one_element_and_no_comments_opens_an_augmented_scene() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.ply");
        for degree in 0..=BETAS {
            let augmented = scene(degree, true);
            let plain = Scene { base: augmented.base.clone(), ..Default::default() };
            let mut learned = augmented.clone();
            learned.base.opacities[0] += 1.0;
            for scene in [&augmented, &learned] {
                write_augmented(&path, &augmented.base, scene).unwrap();
                assert_eq!(strict(&fs::read(&path).unwrap()), strict(&written(&plain)));
            }
        }
    }

    #[test]
    fn the_block_is_read_declared_as_elements_too_and_may_be_gone() {
        let (whole, path) = (scene(1, true), Path::new("a.ply"));
        let bytes = written(&whole);
        let declared = header_with(&bytes, "comment glint ", "");
        assert_eq!(parse_scene(&declared, path).unwrap(), whole);
        let gone = &bytes[..bytes.len() - 2 * gaussian_bytes(1, true) as usize];
        assert_eq!(parse_scene(gone, path).unwrap(), Scene { base: whole.base.clone(), ..Default::default() });
        // A tool may move the comments to the front.
        let (header, body) = split(&bytes);
        let (comments, others): (Vec<&str>, Vec<&str>) = header.lines().partition(|line| line.starts_with("comment"));
        let lines = [&others[..2], &comments, &others[2..]].concat().join("\n") + "\n";
        assert_eq!(parse_scene(&[lines.as_bytes(), body].concat(), path).unwrap(), whole);
        // A partial block is an error; other comments are ignored.
        expect(&bytes[..bytes.len() - 1], &["`augmented`", "1 bytes too few"]);
        let head = "ply\nformat ascii 1.0\ncomment glint\ncomment glint was here\n";
        expect(format!("{head}comment glint property float x\nend_header\n").as_bytes(), &["no element comes before"]);
        let text = "element vertex 0\nproperty float x\ncomment glint element augmented 1\nproperty float y\n";
        expect(format!("{head}{text}end_header\n").as_bytes(), &["no element comes before"]);
        let (text, expected) = ascii(false);
        let text = String::from_utf8(text).unwrap();
        let more = "comment glint element augmented 3\ncomment glint property float x\nend_header\n";
        let gone = text.replace("end_header\n", more);
        assert_eq!(parse_scene(gone.as_bytes(), path).unwrap(), expected);
    }

    /// A file of one Gaussian, with another element.
    fn with_element(element: &str, rows: &str) -> String {
        let names: String = columns(0, false).iter().map(|(name, _)| format!("property float {name}\n")).collect();
        let head = "ply\nformat ascii 1.0\nelement vertex 1\n";
        format!("{head}{names}{element}end_header\n0 0 0 0 0 0 0 0 0 0 1 0 0 0\n{rows}")
    }

    #[test]
    fn a_damaged_bands_element_is_explained() {
        let file = |bands: &str, rows: &str| with_element(&format!("comment glint element {bands}"), rows);
        let properties = |count: usize| -> String {
            (0..count).map(|i| format!("comment glint property float f_rest_{i}\n")).collect()
        };
        let good = file(&format!("bands 1\n{}", properties(9)), "1 2 3 4 5 6 7 8 9\n");
        let scene = parse_scene(good.as_bytes(), Path::new("a.ply")).unwrap();
        assert!(scene.mixed && scene.base.sh_degree == 1 && scene.base.sh[1] == [1.0, 4.0, 7.0]);
        let two = file(&format!("bands 2\n{}", properties(9)), &"1 2 3 4 5 6 7 8 9\n".repeat(2));
        expect(two.as_bytes(), &["`bands` has 2 rows for 1 of `vertex`", "constant colors"]);
        expect(file(&format!("bands 0\n{}", properties(8)), "").as_bytes(), &["`bands` has 8 properties"]);
        let none = file("bands 0\ncomment glint property float label\n", "");
        expect(none.as_bytes(), &["`bands` has SH degree 0; expected degree 1 to 3"]);
        let nan = file(&format!("bands 1\n{}", properties(9)), "1 2 nan 4 5 6 7 8 9\n");
        expect(nan.as_bytes(), &["f_rest_2"]);
        let both = good
            .replace("end_header", "comment glint element learned 0\ncomment glint property float opacity\nend_header");
        expect(both.as_bytes(), &["`learned` and `bands`"]);
    }

    #[test]
    fn a_damaged_learned_element_is_explained() {
        let with = with_element;
        expect(with("element learned 0\nproperty float opacity\n", "").as_bytes(), &["`learned` has 0 rows", "1 of"]);
        expect(with("element learned 2\nproperty float opacity\n", "1\n2\n").as_bytes(), &["2 rows", "all properties"]);
        expect(with("element learned 1\nproperty float opacity\n", "nan\n").as_bytes(), &["opacity"]);
    }

    #[test]
    fn the_layout_is_the_reference_trainers() {
        let (names, values) = strict(&written(&scene(1, false)));
        let mut expected = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2".split(' ').map(String::from).collect::<Vec<_>>();
        expected.extend((0..9).map(|i| format!("f_rest_{i}")));
        expected.extend("opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split(' ').map(String::from));
        assert_eq!(names, expected);
        // f_rest_3 of the first row is the second channel of the first coefficient above the constant one.
        assert_eq!(values[9 + 3], scene(1, false).base.sh[1][1]);
    }

    #[test]
    fn betas_have_the_names_and_the_order_of_dbs() {
        let scene = scene(BETAS, false);
        let (names, values) = strict(&written(&scene));
        let expected: Vec<String> = (0..12).map(|i| format!("sb_params_{i}")).collect();
        assert_eq!((names.len(), &names[8][..]), (29, "f_dc_2"));
        assert_eq!(names[9..21], expected);
        // r of both lobes, g, b, θ, φ, b.
        let value = |i: usize| values[9 + i];
        let [_, one, one_shape, two, two_shape] = scene.base.sh[..5].try_into().unwrap();
        for number in 0..3 {
            assert_eq!([value(2 * number), value(2 * number + 1)], [one[number], two[number]]);
            assert_eq!([value(6 + 2 * number), value(7 + 2 * number)], [one_shape[number], two_shape[number]]);
        }
        let path = Path::new("never.ply");
        let mixed = Scene { supplement: self::scene(0, true).supplement, ..scene };
        assert!(write_scene(path, &mixed).unwrap_err().to_string().contains("expected harmonics or betas in both"));
    }

    #[test]
    fn any_order_type_and_encoding_is_read_and_strangers_are_skipped() {
        for big_endian in [false, true] {
            let (bytes, expected) = ascii(big_endian);
            assert_eq!(parse_scene(&bytes, Path::new("a.ply")).unwrap(), expected);
        }
    }

    #[test]
    fn what_is_no_3dgs_ply_is_called_what_it_is() {
        expect(b"", &["empty"]);
        expect(b"solid cube", &["nothing that glint knows", "not a scene"]);
        let head = "ply\nformat ascii 1.0\nelement vertex 0\n";
        let xyz = "property float x\nproperty float y\nproperty float z\n";
        expect(format!("{head}{xyz}end_header\n").as_bytes(), &["point cloud", "3DGS"]);
        let face = "element face 0\nproperty list uchar int vertex_indices\n";
        expect(format!("{head}{xyz}{face}end_header\n").as_bytes(), &["mesh", "3DGS"]);
        expect(format!("{head}property uint packed_position\nend_header\n").as_bytes(), &["compressed PLY"]);
        for (names, kind) in [
            (["sh0_0", "beta"], "beta kernels"),
            (["f_anchor_feat_0", "opacity"], "as Scaffold-GS writes it"),
            (["scale_0", "scale_1"], "flat Gaussians without `scale_2`"),
        ] {
            let more = names.map(|name| format!("property float {name}\n")).concat();
            expect(format!("{head}{xyz}{more}end_header\n").as_bytes(), &[kind, "not a 3DGS PLY"]);
        }
        expect(b"ply\nformat ascii 1.0\nelement point 0\nend_header\n", &["no element `vertex`"]);
    }

    #[test]
    fn broken_headers_are_explained() {
        let head = "ply\nformat ascii 1.0\n";
        for (body, part) in [
            ("element vertex 0\n", "end_header"),
            ("element vertex -1\nend_header\n", "number of rows"),
            ("element vertex 99999999999999999999999\nend_header\n", "number of rows"),
            ("property float x\nend_header\n", "no element comes before"),
            ("element vertex 0\nproperty half x\nend_header\n", "type is unknown"),
            ("element vertex 0\nproperty list float int x\nend_header\n", "must be an integer"),
            ("element vertex 0\nproperty float x\nproperty float x\nend_header\n", "twice"),
            ("element vertex 0\nelement vertex 0\nend_header\n", "twice"),
            ("element vertex 5\nend_header\n", "no properties"),
            ("elephant\nend_header\n", "not understood"),
        ] {
            expect(format!("{head}{body}").as_bytes(), &[part]);
        }
        expect(b"ply\nformat ebcdic 1.0\nend_header\n", &["`ebcdic` is unknown"]);
        expect(b"ply\nelement vertex 0\nend_header\n", &["no `format`"]);
    }

    fn replaced(scene: &Scene, from: &str, to: &str) -> Vec<u8> {
        let bytes = written(scene);
        assert!(split(&bytes).0.contains(from));
        header_with(&bytes, from, to)
    }

    fn header_with(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
        let (header, body) = split(bytes);
        [header.replace(from, to).as_bytes(), body].concat()
    }

    #[test]
    fn missing_properties_and_odd_sh_counts_are_named() {
        expect(&replaced(&scene(0, false), "float opacity", "float opaque"), &["`vertex`", "`opacity`"]);
        expect(
            &replaced(&scene(1, false), "float f_rest_8", "float rest"),
            &["8 properties `f_rest_*`", "24 (SH degree 2)"],
        );
        expect(&replaced(&scene(1, false), "float f_rest_8", "float f_rest_9"), &["`f_rest_8`"]);
        let betas = scene(BETAS, false);
        expect(
            &replaced(&betas, "float sb_params_11", "float params"),
            &["11 properties `sb_params_*`", "expected 12"],
        );
        expect(&replaced(&betas, "float sb_params_11", "float sb_params_12"), &["`sb_params_11`"]);
        expect(
            &replaced(&betas, "float sb_params_11", "float f_rest_0"),
            &["`f_rest_*` and `sb_params_*`", "expected one"],
        );
        expect(&replaced(&scene(0, true), "lobe_width", "width"), &["`augmented`", "`lobe_width`"]);
    }

    #[test]
    fn sizes_that_disagree_with_the_header_are_counted() {
        let scene = scene(0, false);
        expect(
            &replaced(&scene, "vertex 3", "vertex 2"),
            &["2 rows", "56 bytes each", "112 bytes", "168", "56 bytes too many", "3 rows"],
        );
        expect(&replaced(&scene, "vertex 3", "vertex 4"), &["4 rows", "224 bytes", "56 bytes too few"]);
        expect(&replaced(&scene, "vertex 3", "vertex 18446744073709551615"), &["too few"]);
        let mut bytes = written(&scene);
        bytes.push(0);
        expect(&bytes, &["1 bytes too many", "3 whole rows and 1 bytes more"]);
        let (text, _) = ascii(false);
        expect(&text[..text.len() - 90], &["row 1"]);
        expect(&[&text[..], b"1 2 3\n"].concat(), &["1 lines are left"]);
        expect(&[&text[..text.len() - 1], b" 7\n"].concat(), &["row 1", "1 values more"]);
        let (binary, _) = ascii(true);
        expect(&binary[..binary.len() - 1], &["ends in row 1"]);
        expect(&[&binary[..], b"x"].concat(), &["1 bytes are left"]);
        let many = String::from_utf8_lossy(&text).replace("vertex 2", "vertex 4000000000");
        expect(many.as_bytes(), &["4000000000 rows", "at least"]);
    }

    /// Kernels draw all of these; those with squares beyond float32 were once refused.
    #[test]
    fn rotations_and_lobes_may_have_any_length() {
        let mut odd = scene(1, true);
        odd.base.quats = vec![[0.0, 1e-37, 0.0, 0.0], [3e38; 4], [1e-30, 0.0, 1e-39, 1e20]];
        odd.supplement.as_mut().unwrap().lobes.directions = vec![[1e30, 0.0, -1e30], [1e-30; 3]];
        written(&odd);
    }

    /// A file of a changed scene. The writer refuses some, so the rows of a valid one are replaced.
    fn patched(degree: u32, edit: impl Fn(&mut Scene)) -> Vec<u8> {
        let mut edited = scene(degree, true);
        let mut bytes = written(&edited);
        edit(&mut edited);
        let rows = 3 * gaussian_bytes(degree, false) + 2 * gaussian_bytes(degree, true);
        bytes.truncate(bytes.len() - rows as usize);
        Rows::whole(&edited.base, None).write(&mut bytes).unwrap();
        let supplement = edited.supplement.unwrap();
        Rows::whole(&supplement.gaussians, Some(&supplement.lobes)).write(&mut bytes).unwrap();
        bytes
    }

    #[test]
    fn numbers_that_are_none_are_refused_by_name() {
        let patch = |edit: &dyn Fn(&mut Scene)| {
            let mut edited = scene(2, true);
            edit(&mut edited);
            assert!(write_scene("never.ply", &edited).is_err());
            patched(2, edit)
        };
        expect(&patch(&|s| s.base.sh[2 * 9 + 4][1] = f32::NAN), &["row 2", "`vertex`", "`f_rest_11`"]);
        expect(&patched(BETAS, |s| s.base.sh[5 + 4][1] = f32::NAN), &["row 1", "`vertex`", "`sb_params_9`"]);
        expect(&patch(&|s| s.base.means[1][2] = f32::INFINITY), &["row 1", "`vertex`", "`z`"]);
        expect(&patch(&|s| s.base.quats[0] = [0.0; 4]), &["row 0", "rot_0..3"]);
        expect(&patch(&|s| s.base.quats[0] = [1e-39; 4]), &["row 0", "rot_0..3"]);
        expect(
            &patch(&|s| s.supplement.as_mut().unwrap().lobes.sharpness[1] = f32::NAN),
            &["`augmented`", "`lobe_sharpness`"],
        );
        expect(
            &patch(&|s| s.supplement.as_mut().unwrap().lobes.directions[1] = [0.0; 3]),
            &["row 1", "lobe direction"],
        );
        expect(&patch(&|s| s.supplement.as_mut().unwrap().lobes.widths[0] = 1.5), &["`lobe_width` is 1.5"]);
        let (text, _) = ascii(false);
        let text = String::from_utf8(text).unwrap();
        expect(text.replacen("-70000", "nan", 1).as_bytes(), &["row 0", "`f_dc_0`"]);
        expect(text.replacen("-70000", "1e60", 1).as_bytes(), &["row 0", "`f_dc_0`"]);
        expect(text.replacen("-70000", "ten", 1).as_bytes(), &["row 0", "`ten` is not a number"]);
    }

    /// Real exports contain a few opacities that are NaN.
    #[test]
    fn a_lenient_reader_drops_and_counts_what_is_not_sound() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.ply");
        let read = |edit: &dyn Fn(&mut Scene)| {
            fs::write(&path, patched(1, edit)).unwrap();
            assert_eq!(read_scene(&path).is_ok(), read_scene_leniently(&path).unwrap().1.first.is_none());
            let (found, dropped) = read_scene_leniently(&path).unwrap();
            let left = (found.base.means.clone(), found.supplement.clone().unwrap().lobes.widths);
            validate::check(&found).unwrap();
            (left, dropped)
        };
        let all = scene(1, true);
        let (means, widths) = (all.base.means.clone(), all.supplement.unwrap().lobes.widths);
        let (left, dropped) = read(&|_| ());
        assert_eq!((left, dropped), ((means.clone(), widths.clone()), Dropped::default()));
        // Meaningful infinities are kept, also by the strict reader.
        let (left, dropped) = read(&|s| {
            s.base.opacities[0] = f32::INFINITY;
            s.base.opacities[2] = f32::NEG_INFINITY;
            s.base.log_scales[1][0] = f32::NEG_INFINITY;
            s.supplement.as_mut().unwrap().gaussians.opacities[1] = f32::INFINITY;
        });
        assert_eq!((left, dropped), ((means.clone(), widths.clone()), Dropped::default()));
        let (left, dropped) = read(&|s| s.base.opacities[1] = f32::NAN);
        assert_eq!(left, (vec![means[0], means[2]], widths.clone()));
        assert_eq!((dropped.base, dropped.supplementary), (1, 0));
        assert!(dropped.first.unwrap().contains("row 1 of element `vertex`: `opacity`"));
        let (left, dropped) = read(&|s| {
            s.base.log_scales[0][2] = f32::INFINITY;
            s.base.quats[2] = [0.0; 4];
            s.supplement.as_mut().unwrap().lobes.widths[1] = 2.0;
        });
        assert_eq!((left, dropped.base, dropped.supplementary), ((vec![means[1]], vec![widths[0]]), 2, 1));
        let (left, dropped) = read(&|s| {
            s.base.sh.iter_mut().for_each(|rgb| rgb[1] = f32::NAN);
            s.supplement.as_mut().unwrap().gaussians.means[0][1] = f32::NAN;
        });
        assert_eq!((left, dropped.base, dropped.supplementary), ((Vec::new(), vec![widths[1]]), 3, 1));
        // A file without a scene is an error for this reader too.
        fs::write(&path, "solid cube").unwrap();
        assert!(read_scene_leniently(&path).is_err());
    }

    #[test]
    fn an_origin_comes_back_bit_for_bit() {
        let origin = DVec3::new(500_000.1, -4.5e6 - 1.0 / 3.0, 1e-3);
        let scene = Scene { origin, ..scene(1, true) };
        assert_eq!(parse_scene(&written(&scene), Path::new("a.ply")).unwrap(), scene);
    }
}
