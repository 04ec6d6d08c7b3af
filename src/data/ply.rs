//! Scenes and point clouds in PLY files.
//!
//! A scene has the layout that the 3DGS reference trainer writes: element `vertex` with x y z, nx ny nz (ignored), f_dc_0..2,
//! f_rest_0..(3(L+1)²−4) channel-major, opacity (logit), scale_0..2 (natural log), rot_0..3 (w x y z). Supplementary
//! Gaussians are a second element `augmented` with the same properties and lobe_x lobe_y lobe_z lobe_width lobe_sharpness.

use std::collections::HashMap;
use std::fs;
use std::io::Write;
use std::path::Path;

use super::atomic::write_whole;
use super::ply_format::{Element, Ply};
use super::sound::{self, Dropped};
use crate::scene::{Gaussians, Lobes, Scene, Supplement};
use crate::{Error, Result};

/// A sparse point cloud, scene units and 8-bit sRGB.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointCloud {
    pub positions: Vec<[f32; 3]>,
    pub colors: Vec<[u8; 3]>,
}

pub(super) const BASE: &str = "vertex";
pub(super) const SUPPLEMENT: &str = "augmented";
pub(super) const LOBE: [&str; 5] = ["lobe_x", "lobe_y", "lobe_z", "lobe_width", "lobe_sharpness"];

/// Everything but f_rest, in the order of [`Columns::fixed`].
pub(super) const FIXED: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2",
    "rot_3",
];

/// Reads a 3DGS scene, with its supplement if it has one. Properties may have any order and any numeric type; those that are
/// not known, and unknown elements, are skipped. Numbers must be finite in 32 bits and rotations not zero.
pub fn read_scene(path: impl AsRef<Path>) -> Result<Scene> {
    let path = path.as_ref();
    let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
    parse_scene(&bytes, path)
}

/// Reads what is sound of a 3DGS scene. Real exports contain Gaussians with infinite opacities, NaN and the like, which
/// [`read_scene`] refuses; here they are dropped and counted.
pub fn read_scene_leniently(path: impl AsRef<Path>) -> Result<(Scene, Dropped)> {
    let path = path.as_ref();
    let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
    let mut scene = parse_rows(&bytes, path)?;
    let dropped = sound::drop_faults(&mut scene);
    Ok((scene, dropped))
}

/// Writes `scene` as binary little-endian PLY in the reference trainer's order, the supplement (if any) as a second element.
/// Every float comes back bit for bit. The file appears whole or not at all.
pub fn write_scene(path: impl AsRef<Path>, scene: &Scene) -> Result<()> {
    let path = path.as_ref();
    let refuse = |what| Error::Usage(format!("{}: this scene cannot be written: {what}", path.display()));
    sound::check(scene).map_err(refuse)?;
    if scene.supplement.as_ref().is_some_and(|s| s.gaussians.sh_degree != scene.base.sh_degree) {
        return Err(refuse("the supplement has another SH degree than the base".into()));
    }
    write_whole(path, |file| {
        let rest = 3 * (scene.base.sh_coefficients() - 1);
        writeln!(file, "ply\nformat binary_little_endian 1.0")?;
        let supplement = scene.supplement.as_ref();
        for (name, gaussians) in [(BASE, Some(&scene.base)), (SUPPLEMENT, supplement.map(|s| &s.gaussians))] {
            let Some(gaussians) = gaussians else { continue };
            writeln!(file, "element {name} {}", gaussians.len())?;
            let mut property = |name: &str| writeln!(file, "property float {name}");
            ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"].into_iter().try_for_each(&mut property)?;
            (0..rest).try_for_each(|i| property(&format!("f_rest_{i}")))?;
            FIXED[6..].iter().try_for_each(|name| property(name))?;
            if name == SUPPLEMENT {
                LOBE.into_iter().try_for_each(&mut property)?;
            }
        }
        writeln!(file, "end_header")?;
        write_rows(file, &scene.base, None)?;
        supplement.map_or(Ok(()), |s| write_rows(file, &s.gaussians, Some(&s.lobes)))
    })
}

/// Bytes of the file that [`write_scene`] makes of so many base and supplementary Gaussians, but for its header of 2 KB.
pub fn scene_bytes(base: u64, supplementary: u64, sh_degree: u32) -> u64 {
    // Normals are written too; the constant band is among the fixed.
    let row = FIXED.len() as u64 + 3 + 3 * ((u64::from(sh_degree) + 1).pow(2) - 1);
    4 * (base * row + supplementary * (row + LOBE.len() as u64))
}

fn write_rows(file: &mut impl Write, gaussians: &Gaussians, lobes: Option<&Lobes>) -> std::io::Result<()> {
    let k = gaussians.sh_coefficients();
    let mut row: Vec<f32> = Vec::new();
    let mut bytes: Vec<u8> = Vec::new();
    for i in 0..gaussians.len() {
        let sh = &gaussians.sh[i * k..(i + 1) * k];
        row.clear();
        row.extend(gaussians.means[i]);
        row.extend([0.0; 3]);
        row.extend(sh[0]);
        for channel in 0..3 {
            row.extend(sh[1..].iter().map(|rgb| rgb[channel]));
        }
        row.push(gaussians.opacities[i]);
        row.extend(gaussians.log_scales[i]);
        row.extend(gaussians.quats[i]);
        if let Some(lobes) = lobes {
            row.extend(lobes.directions[i]);
            row.extend([lobes.widths[i], lobes.sharpness[i]]);
        }
        bytes.clear();
        bytes.extend(row.iter().flat_map(|value| value.to_le_bytes()));
        file.write_all(&bytes)?;
    }
    Ok(())
}

/// Reads a plain point cloud: element `vertex` with x y z and, if they are there, red green blue: 0 to 255, or as floats 0 to 1
/// if none is larger. Points without colour are mid grey.
pub fn read_points(path: impl AsRef<Path>) -> Result<PointCloud> {
    let path = path.as_ref();
    let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
    parse_points(&bytes, path)
}

pub(super) fn parse_points(bytes: &[u8], path: &Path) -> Result<PointCloud> {
    let fail = |what: String| Error::input(path, what);
    let ply = Ply::parse(bytes, path)?;
    let element = ply.element(BASE).ok_or_else(|| fail(format!("has no element `{BASE}`")))?;
    let place = |name| element.scalar(name).ok_or_else(|| fail(format!("element `{BASE}` lacks property `{name}`")));
    let xyz = [place("x")?, place("y")?, place("z")?];
    let rgb = match ["red", "green", "blue"].map(|name| element.scalar(name)) {
        [Some(r), Some(g), Some(b)] => Some([r, g, b]),
        [None, None, None] => None,
        _ => return Err(fail(format!("element `{BASE}` has only some of `red`, `green`, `blue`"))),
    };
    let floats = rgb.iter().flatten().any(|&p| !element.properties[p].number.is_integer());
    let mut cloud = PointCloud::default();
    let (mut colors, mut largest) = (Vec::new(), 0.0f64);
    ply.for_each_row(|element, row, values| {
        if element.name != BASE {
            return Ok(());
        }
        let position = xyz.map(|p| values[p] as f32);
        // guard: PLY: points
        if let Some(axis) = position.iter().position(|v| !v.is_finite()) {
            let name = ["x", "y", "z"][axis];
            return Err(fail(format!("row {row} of element `{BASE}`: `{name}` is not a finite number")));
        }
        let color = rgb.map_or([128.0; 3], |rgb| rgb.map(|p| values[p]));
        if let Some(bad) = color.iter().find(|v| !(0.0..=255.0).contains(*v)) {
            return Err(fail(format!("row {row} of element `{BASE}`: colour value {bad} is not in 0 to 255")));
        }
        cloud.positions.push(position);
        // Every value up to 255 is held by a float32 closely enough to become its byte.
        colors.push(color.map(|v| v as f32));
        largest = color.iter().copied().fold(largest, f64::max);
        Ok(())
    })?;
    let unit = if floats && largest <= 1.0 { 255.0 } else { 1.0 };
    cloud.colors = colors.into_iter().map(|color| color.map(|v| (v * unit).round() as u8)).collect();
    Ok(cloud)
}

/// Property indices of one element.
struct Columns {
    fixed: [usize; FIXED.len()],
    /// By SH coefficient above the constant one, then channel.
    rest: Vec<[usize; 3]>,
    lobe: Option<[usize; LOBE.len()]>,
}

impl Columns {
    fn find(element: &Element, lobe: bool) -> Result<Columns, String> {
        let named: HashMap<&str, usize> = element
            .properties
            .iter()
            .enumerate()
            .filter(|(_, p)| !p.is_list())
            .map(|(i, p)| (&p.name[..], i))
            .collect();
        let place = |name: &str| {
            let lacks = || format!("element `{}` lacks property `{name}`, which a 3DGS PLY has", element.name);
            named.get(name).copied().ok_or_else(lacks)
        };
        let mut fixed = [0; FIXED.len()];
        for (slot, name) in fixed.iter_mut().zip(FIXED) {
            *slot = place(name)?;
        }
        let count = named.keys().filter(|name| name.starts_with("f_rest_")).count();
        if ![0, 9, 24, 45].contains(&count) {
            let name = &element.name;
            return Err(format!(
                "element `{name}` has {count} properties `f_rest_*`; expected 0, 9, 24 or 45 (SH degree 0 to 3)"
            ));
        }
        let per_channel = count / 3;
        let mut rest = Vec::with_capacity(per_channel);
        for k in 0..per_channel {
            let at = |channel| place(&format!("f_rest_{}", channel * per_channel + k));
            rest.push([at(0)?, at(1)?, at(2)?]);
        }
        let lobe = match lobe {
            false => None,
            true => {
                let mut lobe = [0; LOBE.len()];
                for (slot, name) in lobe.iter_mut().zip(LOBE) {
                    *slot = place(name)?;
                }
                Some(lobe)
            }
        };
        Ok(Columns { fixed, rest, lobe })
    }

    fn sh_degree(&self) -> u32 {
        match self.rest.len() {
            0 => 0,
            3 => 1,
            8 => 2,
            _ => 3,
        }
    }

    fn push(&self, values: &[f64], gaussians: &mut Gaussians, lobes: &mut Lobes) {
        let [x, y, z, r, g, b, opacity, sx, sy, sz, qw, qx, qy, qz] = self.fixed.map(|p| values[p] as f32);
        gaussians.means.push([x, y, z]);
        gaussians.sh.push([r, g, b]);
        gaussians.sh.extend(self.rest.iter().map(|rgb| rgb.map(|p| values[p] as f32)));
        gaussians.opacities.push(opacity);
        gaussians.log_scales.push([sx, sy, sz]);
        gaussians.quats.push([qw, qx, qy, qz]);
        if let Some(lobe) = self.lobe {
            let [x, y, z, width, sharpness] = lobe.map(|p| values[p] as f32);
            lobes.directions.push([x, y, z]);
            lobes.widths.push(width);
            lobes.sharpness.push(sharpness);
        }
    }
}

/// `path` is only named in errors.
pub(super) fn parse_scene(bytes: &[u8], path: &Path) -> Result<Scene> {
    let scene = parse_rows(bytes, path)?;
    sound::check(&scene).map_err(|what| Error::input(path, what))?;
    Ok(scene)
}

/// The scene, whatever its numbers are.
fn parse_rows(bytes: &[u8], path: &Path) -> Result<Scene> {
    let fail = |what: String| Error::input(path, what);
    let ply = Ply::parse(bytes, path)?;
    if let Some(kind) = describe_non_splats(&ply) {
        return Err(fail(format!("is {kind}, not a 3DGS PLY")));
    }
    let no_base = || fail(format!("has no element `{BASE}`, so it is not a 3DGS PLY"));
    let base_columns = Columns::find(ply.element(BASE).ok_or_else(no_base)?, false).map_err(fail)?;
    let extra_columns =
        ply.element(SUPPLEMENT).map(|element| Columns::find(element, true)).transpose().map_err(fail)?;
    let sh_degree = base_columns.sh_degree();
    if let Some(other) = extra_columns.as_ref().map(Columns::sh_degree).filter(|&other| other != sh_degree) {
        return Err(fail(format!("`{SUPPLEMENT}` has SH degree {other}, but `{BASE}` has {sh_degree}")));
    }

    let mut base = Gaussians { sh_degree, ..Default::default() };
    let mut extra = Gaussians { sh_degree, ..Default::default() };
    let mut lobes = Lobes::default();
    ply.for_each_row(|element, _, values| {
        match (&element.name[..], &extra_columns) {
            (BASE, _) => base_columns.push(values, &mut base, &mut Lobes::default()),
            (SUPPLEMENT, Some(columns)) => columns.push(values, &mut extra, &mut lobes),
            _ => {}
        }
        Ok(())
    })?;
    Ok(Scene { base, supplement: extra_columns.map(|_| Supplement { gaussians: extra, lobes }) })
}

/// What a PLY without a single splat property seems to be.
fn describe_non_splats(ply: &Ply) -> Option<&'static str> {
    let vertex = ply.element(BASE)?;
    if vertex.scalar("packed_position").is_some() {
        return Some("a compressed PLY (as SuperSplat writes them; export it uncompressed)");
    }
    let splat = |name: &&str| vertex.scalar(name).is_some();
    if FIXED[3..].iter().any(&splat) || !FIXED[..3].iter().all(splat) {
        return None;
    }
    Some(if ply.element("face").is_some() { "a mesh" } else { "a point cloud" })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Numbers that no order or channel swap can confuse.
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
        Scene { base: gaussians(3, sh_degree, 0.5), supplement }
    }

    fn written(scene: &Scene) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.ply");
        write_scene(&path, scene).unwrap();
        assert_eq!(&read_scene(&path).unwrap(), scene);
        let bytes = fs::read(&path).unwrap();
        let header = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let extra = scene.supplement.as_ref().map_or(0, |s| s.gaussians.len());
        let expected = scene_bytes(scene.base.len() as u64, extra as u64, scene.base.sh_degree);
        assert_eq!((bytes.len() - header) as u64, expected);
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

    /// The same scene as text, with properties shuffled, types mixed, and things in between that nobody knows.
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
        (out, Scene { base, supplement: None })
    }

    #[test]
    fn every_degree_comes_back_bit_for_bit_with_and_without_supplement() {
        for degree in 0..4 {
            for supplement in [false, true] {
                written(&scene(degree, supplement));
            }
        }
        written(&Scene::default());
        written(&Scene {
            base: gaussians(1, 2, 0.0),
            supplement: Some(Supplement { gaussians: gaussians(0, 2, 0.0), lobes: Lobes::default() }),
        });
    }

    #[test]
    fn the_layout_is_the_reference_trainers() {
        let bytes = written(&scene(1, false));
        let text = String::from_utf8_lossy(&bytes);
        let names: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("property float ")).collect();
        let mut expected = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2".split(' ').map(String::from).collect::<Vec<_>>();
        expected.extend((0..9).map(|i| format!("f_rest_{i}")));
        expected.extend("opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split(' ').map(String::from));
        assert_eq!(names, expected);
        // f_rest_3 of the first row is the second channel of the first coefficient above the constant.
        let body = &bytes[bytes.len() - 3 * 26 * 4..];
        let value = f32::from_le_bytes(body[4 * (9 + 3)..][..4].try_into().unwrap());
        assert_eq!(value, scene(1, false).base.sh[1][1]);
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
        expect(b"solid cube", &["nothing that glint knows", "not a PLY"]);
        expect(b"NGSP\x04", &["SPZ"]);
        expect(b"\x1f\x8b\x08", &["gzip", "SPZ"]);
        let head = "ply\nformat ascii 1.0\nelement vertex 0\n";
        let xyz = "property float x\nproperty float y\nproperty float z\n";
        expect(format!("{head}{xyz}end_header\n").as_bytes(), &["point cloud", "3DGS"]);
        let face = "element face 0\nproperty list uchar int vertex_indices\n";
        expect(format!("{head}{xyz}{face}end_header\n").as_bytes(), &["mesh", "3DGS"]);
        expect(format!("{head}property uint packed_position\nend_header\n").as_bytes(), &["compressed PLY"]);
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
        let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
        assert!(header.contains(from));
        [header.replace(from, to).as_bytes(), &bytes[end..]].concat()
    }

    #[test]
    fn missing_properties_and_odd_sh_counts_are_named() {
        expect(&replaced(&scene(0, false), "float opacity", "float opaque"), &["`vertex`", "`opacity`"]);
        expect(
            &replaced(&scene(1, false), "float f_rest_8", "float rest"),
            &["8 properties `f_rest_*`", "0, 9, 24 or 45"],
        );
        expect(&replaced(&scene(1, false), "float f_rest_8", "float f_rest_9"), &["`f_rest_8`"]);
        expect(&replaced(&scene(0, true), "lobe_width", "width"), &["`augmented`", "`lobe_width`"]);
        let degrees = Scene { base: gaussians(1, 1, 0.0), supplement: scene(0, true).supplement };
        assert!(write_scene("never.ply", &degrees).unwrap_err().to_string().contains("SH degree"));
    }

    #[test]
    fn sizes_that_disagree_with_the_header_are_counted() {
        let scene = scene(0, false);
        expect(
            &replaced(&scene, "vertex 3", "vertex 2"),
            &["2 rows", "68 bytes each", "136 bytes", "204", "68 bytes too many", "3 rows"],
        );
        expect(&replaced(&scene, "vertex 3", "vertex 4"), &["4 rows", "272 bytes", "68 bytes too few"]);
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

    /// As kernels draw them all; those of squares beyond float32 were once refused.
    #[test]
    fn rotations_and_lobes_may_have_any_length() {
        let mut odd = scene(1, true);
        odd.base.quats = vec![[0.0, 1e-37, 0.0, 0.0], [3e38; 4], [1e-30, 0.0, 1e-39, 1e20]];
        odd.supplement.as_mut().unwrap().lobes.directions = vec![[1e30, 0.0, -1e30], [1e-30; 3]];
        written(&odd);
    }

    #[test]
    fn numbers_that_are_none_are_refused_by_name() {
        let patch = |edit: &dyn Fn(&mut Scene)| {
            // The writer refuses such a scene, so the rows of a sound one are replaced.
            let sound = scene(2, true);
            let mut edited = sound.clone();
            edit(&mut edited);
            assert!(write_scene("never.ply", &edited).is_err());
            let mut bytes = written(&sound);
            let (n, k) = (3, 9);
            let row = (17 + 3 * (k - 1)) * 4;
            let extra = row + 20;
            let base_at = bytes.len() - 2 * extra - n * row;
            let mut rows = Vec::new();
            write_rows(&mut rows, &edited.base, None).unwrap();
            let supplement = edited.supplement.unwrap();
            write_rows(&mut rows, &supplement.gaussians, Some(&supplement.lobes)).unwrap();
            bytes.truncate(base_at);
            bytes.extend(rows);
            bytes
        };
        expect(&patch(&|s| s.base.sh[2 * 9 + 4][1] = f32::NAN), &["row 2", "`vertex`", "`f_rest_11`"]);
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

    /// Real exports have infinite opacities here and there.
    #[test]
    fn a_lenient_reader_drops_and_counts_what_is_not_sound() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.ply");
        let read = |edit: &dyn Fn(&mut Scene)| {
            let sound = scene(1, true);
            let mut edited = sound.clone();
            edit(&mut edited);
            let mut bytes = written(&sound);
            let rows = scene_bytes(3, 2, 1) as usize;
            bytes.truncate(bytes.len() - rows);
            write_rows(&mut bytes, &edited.base, None).unwrap();
            let supplement = edited.supplement.unwrap();
            write_rows(&mut bytes, &supplement.gaussians, Some(&supplement.lobes)).unwrap();
            fs::write(&path, bytes).unwrap();
            assert_eq!(read_scene(&path).is_ok(), read_scene_leniently(&path).unwrap().1.first.is_none());
            let (found, dropped) = read_scene_leniently(&path).unwrap();
            let left = (found.base.means.clone(), found.supplement.clone().unwrap().lobes.widths);
            sound::check(&found).unwrap();
            (left, dropped)
        };
        let all = scene(1, true);
        let (means, widths) = (all.base.means.clone(), all.supplement.unwrap().lobes.widths);
        let (left, dropped) = read(&|_| ());
        assert_eq!((left, dropped), ((means.clone(), widths.clone()), Dropped::default()));
        let (left, dropped) = read(&|s| s.base.opacities[1] = f32::INFINITY);
        assert_eq!(left, (vec![means[0], means[2]], widths.clone()));
        assert_eq!((dropped.base, dropped.supplementary), (1, 0));
        assert!(dropped.first.unwrap().contains("row 1 of element `vertex`: `opacity`"));
        let (left, dropped) = read(&|s| {
            s.base.log_scales[0][2] = f32::NEG_INFINITY;
            s.base.quats[2] = [0.0; 4];
            s.supplement.as_mut().unwrap().lobes.widths[1] = 2.0;
        });
        assert_eq!((left, dropped.base, dropped.supplementary), ((vec![means[1]], vec![widths[0]]), 2, 1));
        let (left, dropped) = read(&|s| {
            s.base.sh.iter_mut().for_each(|rgb| rgb[1] = f32::NAN);
            s.supplement.as_mut().unwrap().gaussians.means[0][1] = f32::NAN;
        });
        assert_eq!((left, dropped.base, dropped.supplementary), ((Vec::new(), vec![widths[1]]), 3, 1));
        // A file that is no scene is none for this reader either.
        fs::write(&path, "solid cube").unwrap();
        assert!(read_scene_leniently(&path).is_err());
    }

    #[test]
    fn point_clouds_are_read_with_and_without_colour() {
        let head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty float y\nproperty float z\n";
        let plain = format!("{head}end_header\n1 2 3\n4 5 6\n");
        let cloud = parse_points(plain.as_bytes(), Path::new("p.ply")).unwrap();
        assert_eq!(cloud, PointCloud { positions: vec![[1., 2., 3.], [4., 5., 6.]], colors: vec![[128; 3]; 2] });
        let rgb = "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
        let cloud =
            parse_points(format!("{head}{rgb}1 2 3 0 9 255\n4 5 6 7 8 9\n").as_bytes(), Path::new("p.ply")).unwrap();
        assert_eq!(cloud.colors, [[0, 9, 255], [7, 8, 9]]);
        let error = |text: String| parse_points(text.as_bytes(), Path::new("p.ply")).unwrap_err().to_string();
        assert!(error(format!("{head}{rgb}1 2 3 0 9 256\n4 5 6 7 8 9\n")).contains("256"));
        let floats = rgb.replace("uchar", "float");
        let colors =
            |rows: &str| parse_points(format!("{head}{floats}{rows}").as_bytes(), Path::new("p.ply")).unwrap().colors;
        assert_eq!(colors("1 2 3 0 0.2 1\n4 5 6 0.5 0.001 1.0\n"), [[0, 51, 255], [128, 0, 255]]);
        assert_eq!(colors("1 2 3 0 9 1\n4 5 6 7.4 8.6 255\n"), [[0, 9, 1], [7, 9, 255]]);
        assert!(error(format!("{head}{floats}1 2 3 0 nan 1\n4 5 6 7 8 9\n")).contains("row 0"));
        assert!(error(format!("{head}property uchar red\nend_header\n1 2 3 4\n4 5 6 7\n")).contains("only some"));
        assert!(error(format!("{head}end_header\n1 inf 3\n4 5 6\n")).contains("row 0"));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn no_damage_makes_the_reader_panic(which in 0..4usize, cut in 0.0..1.0f64, flips in prop::collection::vec((0.0..1.0f64, any::<u8>()), 0..6)) {
            let mut bytes = match which {
                0 => ascii(false).0,
                1 => ascii(true).0,
                2 => replaced(&scene(0, true), "vertex", "vertex"),
                _ => replaced(&scene(3, false), "vertex", "vertex"),
            };
            for (at, value) in flips {
                let at = (at * bytes.len() as f64) as usize;
                bytes[at] ^= value;
            }
            if cut < 0.5 {
                bytes.truncate((cut * 2.0 * bytes.len() as f64) as usize);
            }
            let _ = parse_scene(&bytes, Path::new("a.ply"));
            let _ = parse_points(&bytes, Path::new("a.ply"));
        }
    }
}
