//! Handles properties of other tools' PLY files that change a 3DGS scene: filters, positions as doubles,
//! unsupported layouts.

use glam::DVec3;

use super::ply_columns::BASE;
use super::ply_format::{Element, Number, Ply};
use crate::Result;

/// Coordinate origin for means around `middle`: `middle` if float32 keeps less than 16 bits of the 0.9
/// quantile of `distances` at the world's origin; otherwise the world's origin.
pub(super) fn far_origin(middle: DVec3, mut distances: Vec<f64>) -> DVec3 {
    let Some(last) = distances.len().checked_sub(1) else { return DVec3::ZERO };
    let (_, &mut radius, _) = distances.select_nth_unstable_by(last * 9 / 10, f64::total_cmp);
    if middle.is_finite() && middle.length() > 256.0 * radius { middle } else { DVec3::ZERO }
}

/// Coordinate origin for the means of a file with positions of type `double`.
pub(super) fn origin_of_doubles(ply: &Ply, element: &Element) -> Result<DVec3> {
    let xyz = ["x", "y", "z"].map(|name| element.scalar(name).filter(|&p| element.properties[p].number == Number::F64));
    let [Some(x), Some(y), Some(z)] = xyz else { return Ok(DVec3::ZERO) };
    let mut places: Vec<DVec3> = Vec::new();
    ply.for_each_row(|element, _, values| {
        if element.name == BASE {
            places.push(DVec3::new(values[x], values[y], values[z]));
        }
        Ok(())
    })?;
    let Some(last) = places.len().checked_sub(1) else { return Ok(DVec3::ZERO) };
    let middle = [0, 1, 2].map(|axis| {
        let mut values: Vec<f64> = places.iter().map(|place| place[axis]).collect();
        *values.select_nth_unstable_by(last / 2, f64::total_cmp).1
    });
    let middle = DVec3::from_array(middle);
    Ok(far_origin(middle, places.into_iter().map(|place| place.distance(middle)).collect()))
}

/// Mip-Splatting's filter, the size to add to each Gaussian.
pub(super) const FILTER: &str = "filter_3D";

/// Properties of unsupported layouts that change the picture: prefixes of their names, and the meaning.
const NOT_READ: [(&[&str], &str); 3] = [
    (&["sg_"], "colors that spherical Gaussians make depend on the view: what is read is the color without them"),
    (
        &["motion_", "trbf_", "omega_"],
        "a scene that moves: what is read stands still; export one moment of it as a 3DGS PLY",
    ),
    (
        &["scaling_t", "scale_t", "rot_r_", "rotation_r_"],
        "a scene in space and time: what is read is no moment of it; export one as a 3DGS PLY",
    ),
];

/// Notes on an element's properties that change the picture, or should change it but do not.
pub(super) fn remarks(element: &Element) -> Vec<String> {
    let names = || element.properties.iter().map(|property| &property.name[..]);
    let mut notes: Vec<String> = NOT_READ
        .iter()
        .filter_map(|(prefixes, meaning)| {
            let mut found = names().filter(|name| prefixes.iter().any(|prefix| name.starts_with(prefix)));
            let first = found.next()?;
            let are = match found.count() {
                0 => "is".into(),
                1 => "and 1 more property are".into(),
                more => format!("and {more} more properties are"),
            };
            Some(format!("`{first}` {are} not read: {meaning}"))
        })
        .collect();
    if element.scalar(FILTER).is_some() {
        notes.push(format!("`{FILTER}` (Mip-Splatting) is taken into the sizes and opacities of the Gaussians"));
    }
    notes
}

/// Log scales and logit after a filter: variances grow by the filter's, and volume times opacity is preserved
/// (Mip-Splatting, Yu 2024).
pub(super) fn filtered(log_scales: [f32; 3], logit: f32, filter: f64) -> ([f32; 3], f32) {
    let own = log_scales.map(|v| (2.0 * f64::from(v)).exp());
    let grown = own.map(|variance| variance + filter * filter);
    let ratio: f64 = (0..3).map(|axis| if grown[axis] > 0.0 { own[axis] / grown[axis] } else { 1.0 }).product();
    let opacity = ratio.sqrt() / (1.0 + (-f64::from(logit)).exp());
    // Without a filter no bit changes.
    if filter == 0.0 {
        (log_scales, logit)
    } else {
        (grown.map(|v| (0.5 * v.ln()) as f32), (opacity / (1.0 - opacity)).ln() as f32)
    }
}

#[cfg(all(test, feature = "train"))]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::data::ply::parse;
    use crate::data::ply_columns::columns;
    use crate::data::{SceneFile, validate};
    use crate::scene::Scene;

    /// Rows of a 3DGS PLY in ASCII, with further properties of these types and names after the usual ones.
    fn with_more(xyz: &str, more: &[&str], rows: &[&str], comment: &str) -> SceneFile {
        let mut text = format!("ply\nformat ascii 1.0\n{comment}element vertex {}\n", rows.len());
        for (i, (name, _)) in columns(0, false).iter().enumerate() {
            text += &format!("property {} {name}\n", if i < 3 { xyz } else { "float" });
        }
        more.iter().for_each(|name| text += &format!("property float {name}\n"));
        text += "end_header\n";
        rows.iter().for_each(|row| text += &format!("{row}\n"));
        let mut file = parse(text.as_bytes(), None, Path::new("a.ply")).unwrap();
        validate::make_finite(&mut file.scene);
        file
    }

    #[test]
    fn a_filter_is_taken_into_sizes_and_opacities() {
        // Standard deviations 0.3, 0.4 and 0; logits 0 and infinity.
        let rows = ["0 0 0 0 0 0 0 -1.2039728 -0.9162907 -1 1 0 0 0 0.4", "0 0 0 0 0 0 inf 0 -1 -2 1 0 0 0 0"];
        let file = with_more("float", &["filter_3D"], &rows, "");
        let [x, y, z] = file.scene.base.log_scales[0].map(|v| f64::from(v).exp());
        let deep = (-2f64).exp() + 0.16;
        assert!((x - 0.5).abs() < 1e-6 && (y - 0.32f64.sqrt()).abs() < 1e-6 && (z - deep.sqrt()).abs() < 1e-6);
        // Half, times 0.3/0.5 · 0.4/0.5657 · e⁻¹/z.
        let opacity = 0.5 * 0.6 * 0.5f64.sqrt() * (-1f64).exp() / deep.sqrt();
        let found = 1.0 / (1.0 + (-f64::from(file.scene.base.opacities[0])).exp());
        assert!((found - opacity).abs() < 1e-6, "{found}, expected {opacity}");
        // A filter of 0 changes nothing.
        assert_eq!(file.scene.base.log_scales[1], [0.0, -1.0, -2.0]);
        assert!((file.scene.base.opacities[1] - 17.328_68).abs() < 1e-5);
        assert!(
            file.notes.len() == 1 && file.notes[0].contains("`filter_3D` (Mip-Splatting) is taken"),
            "{:?}",
            file.notes
        );
    }

    #[test]
    fn properties_that_change_the_picture_and_are_not_read_are_named() {
        let row = "0 0 0 0 0 0 0 0 0 0 1 0 0 0 1 1 1";
        let said = |more: &[&str]| with_more("float", more, &[row], "").notes.join("; ");
        let sg = said(&["sg_axis_0", "sg_sharpness_0", "sg_color_0"]);
        assert!(
            sg.contains("`sg_axis_0` and 2 more properties are not read") && sg.contains("depend on the view"),
            "{sg}"
        );
        let moving = said(&["trbf_center", "motion_0", "omega_3"]);
        assert!(moving.contains("`trbf_center` and 2 more") && moving.contains("moves"), "{moving}");
        assert!(said(&["scaling_t", "rot_r_0", "label"]).contains("`scaling_t` and 1 more"));
        assert_eq!(said(&["label", "nx", "semantic_2"]), "");
    }

    #[test]
    fn positions_of_doubles_count_from_their_middle() {
        let at = |x: f64, y: f64| format!("{x} {y} 120.5 0 0 0 0 0 0 0 1 0 0 0");
        let rows = [at(5e5, 4.5e6), at(5e5 + 0.001, 4.5e6 - 0.002), at(5e5 + 1.0, 4.5e6)];
        let rows: Vec<&str> = rows.iter().map(|row| &row[..]).collect();
        let SceneFile { scene: Scene { base, origin, .. }, notes, .. } = with_more("double", &[], &rows, "");
        assert!(notes.len() == 1 && notes[0].contains("far from the world's origin"), "{notes:?}");
        let world = |i: usize| origin + DVec3::from_array(base.means[i].map(f64::from));
        assert!(
            world(1).distance(DVec3::new(500000.001, 4499999.998, 120.5)) < 1e-8 && origin.length() > 4e6,
            "{origin}"
        );
        // Near the world's origin nothing moves, and the file's own origin is added.
        let near =
            with_more("double", &[], &["1 2 3.1 0 0 0 0 0 0 0 1 0 0 0", "9 -2 3 0 0 0 0 0 0 0 1 0 0 0"], "").scene;
        assert_eq!((near.base.means[0], near.origin), ([1.0, 2.0, 3.1], DVec3::ZERO));
        let both = with_more("double", &[], &rows, "comment origin 7 -0.25 1e3\n").scene;
        assert_eq!(
            both,
            Scene { origin: origin + DVec3::new(7.0, -0.25, 1000.0), ..Scene { base, ..Default::default() } }
        );
        // A malformed origin is an ordinary comment.
        for comment in ["comment origin of the scene\n", "comment origin 1 2 nan\n", "comment origin 1 2\n"] {
            assert_eq!(with_more("float", &[], &rows, comment).scene.origin, DVec3::ZERO);
        }
    }
}
