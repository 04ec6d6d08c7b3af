//! Sparse points, read from PLY files.

use std::fs;
use std::io::Read;
use std::path::Path;

use glam::DVec3;

use super::formats::Kind;
use super::left_out::LeftOut;
use super::ply_columns::BASE;
use super::ply_format::Ply;
use crate::{Error, Result};

/// Maximum length of a header.
const HEADER_BYTES: u64 = 1 << 16;

/// A sparse point cloud, scene units and 8-bit sRGB.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointCloud {
    /// Positions in scene units, in the world.
    pub positions: Vec<[f64; 3]>,
    /// 8-bit sRGB, one per position; grey if the file has none.
    pub colors: Vec<[u8; 3]>,
}

impl PointCloud {
    /// The positions relative to `origin` (world).
    pub fn around(&self, origin: DVec3) -> Vec<[f32; 3]> {
        self.positions.iter().map(|&at| (DVec3::from_array(at) - origin).as_vec3().to_array()).collect()
    }
}

/// Reads a plain point cloud: element `vertex` with x y z, and optional red green blue of 0 to 255, or floats
/// of 0 to 1 if none is larger. Points without color are mid grey. Points with a non-finite position are
/// left out, and a sentence in `notes` counts them.
pub fn read_points(path: impl AsRef<Path>, notes: &mut Vec<String>) -> Result<PointCloud> {
    let path = path.as_ref();
    let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
    parse_points(&bytes, path, notes)
}

/// Whether a file's header is a PLY of points, not of Gaussians.
///
/// # Errors
/// If it cannot be read.
pub fn is_point_cloud(path: impl AsRef<Path>) -> Result<bool> {
    let path = path.as_ref();
    let mut start = Vec::new();
    let read = fs::File::open(path).and_then(|file| file.take(HEADER_BYTES).read_to_end(&mut start));
    read.map_err(|source| Error::io(path, source))?;
    let text = String::from_utf8_lossy(&start);
    let header = text.split("end_header").next().unwrap_or_default();
    // For Gaussians that lack a property, their own reader reports the error.
    let gaussians = ["f_dc_0", "scale_0", "rot_0", "packed_position"];
    Ok(header.starts_with("ply") && !gaussians.iter().any(|name| header.contains(name)))
}

pub(super) fn parse_points(bytes: &[u8], path: &Path, notes: &mut Vec<String>) -> Result<PointCloud> {
    let fail = |what: String| Error::input(path, what);
    let kind = Kind::of(bytes, path);
    if kind != Kind::Ply {
        return Err(fail(format!("is {kind}, not a PLY")));
    }
    let ply = Ply::parse(bytes, path)?;
    let element = ply.element(BASE).ok_or_else(|| fail(format!("has no element `{BASE}`")))?;
    let place = |name| element.scalar(name).ok_or_else(|| fail(format!("element `{BASE}` lacks property `{name}`")));
    let xyz = [place("x")?, place("y")?, place("z")?];
    let named = |prefix: &str| ["red", "green", "blue"].map(|name| element.scalar(&format!("{prefix}{name}")));
    // Older programs prefix the kind of light.
    let rgb = match Some(named("")).filter(|plain| *plain != [None; 3]).unwrap_or_else(|| named("diffuse_")) {
        [Some(r), Some(g), Some(b)] => Some([r, g, b]),
        [None, None, None] => None,
        _ => return Err(fail(format!("element `{BASE}` has only some of `red`, `green`, `blue`"))),
    };
    let floats = rgb.iter().flatten().any(|&p| !element.properties[p].number.is_integer());
    let (mut cloud, mut left_out) = (PointCloud::default(), LeftOut::default());
    let (mut colors, mut largest) = (Vec::new(), 0.0f64);
    ply.for_each_row(|element, row, values| {
        if element.name != BASE {
            return Ok(());
        }
        let position = xyz.map(|p| values[p]);
        // guard: PLY: points
        if let Some(axis) = position.iter().position(|v| !(*v as f32).is_finite()) {
            let name = ["x", "y", "z"][axis];
            left_out.add(|| format!("row {row}"), || format!("row {row}: `{name}` is not a finite number"));
            return Ok(());
        }
        let color = rgb.map_or([128.0; 3], |rgb| rgb.map(|p| values[p]));
        if let Some(bad) = color.iter().find(|v| !(0.0..=255.0).contains(*v)) {
            return Err(fail(format!("row {row} of element `{BASE}`: color value {bad} is not in 0 to 255")));
        }
        cloud.positions.push(position);
        // Bytes up to 255 survive the conversion to float32.
        colors.push(color.map(|v| v as f32));
        largest = color.iter().copied().fold(largest, f64::max);
        Ok(())
    })?;
    let all = cloud.positions.len() + left_out.count;
    notes.extend(left_out.note(all, "point").map(|text| format!("{}: {text}", path.display())));
    let unit = if floats && largest <= 1.0 { 255.0 } else { 1.0 };
    cloud.colors = colors.into_iter().map(|color| color.map(|v| (v * unit).round() as u8)).collect();
    Ok(cloud)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn point_clouds_are_read_with_and_without_color() {
        let head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty float y\nproperty float z\n";
        let plain = format!("{head}end_header\n1 2 3\n4 5 6\n");
        let cloud = parse_points(plain.as_bytes(), Path::new("p.ply"), &mut Vec::new()).unwrap();
        assert_eq!(cloud, PointCloud { positions: vec![[1., 2., 3.], [4., 5., 6.]], colors: vec![[128; 3]; 2] });
        let rgb = "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
        let cloud = parse_points(
            format!("{head}{rgb}1 2 3 0 9 255\n4 5 6 7 8 9\n").as_bytes(),
            Path::new("p.ply"),
            &mut Vec::new(),
        )
        .unwrap();
        assert_eq!(cloud.colors, [[0, 9, 255], [7, 8, 9]]);
        let diffuse = rgb.replace("uchar ", "uchar diffuse_");
        let diffuse = format!("{head}{diffuse}1 2 3 0 9 255\n-nan(ind) 5 6 7 8 9\n");
        let other = parse_points(diffuse.as_bytes(), Path::new("p.ply"), &mut Vec::new()).unwrap();
        assert_eq!(other.colors, [[0, 9, 255]]);
        let read = |text: String, notes: &mut Vec<String>| parse_points(text.as_bytes(), Path::new("p.ply"), notes);
        let error = |text: String| read(text, &mut Vec::new()).unwrap_err().to_string();
        for (text, name) in [("", "empty"), ("solid cube", "nothing that glint knows"), ("NGSP\x04", "an SPZ scene")] {
            let error = error(text.into());
            assert!(error.contains(&format!("is {name}, not a PLY")), "{error}");
        }
        assert!(error(format!("{head}{rgb}1 2 3 0 9 256\n4 5 6 7 8 9\n")).contains("256"));
        let floats = rgb.replace("uchar", "float");
        let colors = |rows: &str| read(format!("{head}{floats}{rows}"), &mut Vec::new()).unwrap().colors;
        assert_eq!(colors("1 2 3 0 0.2 1\n4 5 6 0.5 0.001 1.0\n"), [[0, 51, 255], [128, 0, 255]]);
        assert_eq!(colors("1 2 3 0 9 1\n4 5 6 7.4 8.6 255\n"), [[0, 9, 1], [7, 9, 255]]);
        assert!(error(format!("{head}{floats}1 2 3 0 nan 1\n4 5 6 7 8 9\n")).contains("row 0"));
        assert!(error(format!("{head}property uchar red\nend_header\n1 2 3 4\n4 5 6 7\n")).contains("only some"));
        // Non-finite points are left out and counted, together with their color.
        let mut notes = Vec::new();
        let cloud = read(format!("{head}{floats}1 inf 3 nan 900 0\n4 5 6 0.2 0.4 1\n"), &mut notes).unwrap();
        assert_eq!((cloud.positions, cloud.colors), (vec![[4.0, 5.0, 6.0]], vec![[51, 102, 255]]));
        assert_eq!(notes, ["p.ply: 1 point of 2 left out: row 0: `y` is not a finite number"]);
    }
}
