//! HTML page of a plan: its parts from above, and their sizes.

use std::collections::HashMap;
use std::fmt::Write;

use glam::{DVec2, DVec3};
use plotters::prelude::*;
use rayon::prelude::*;

use super::history::COLORS;
use super::html::{escape, scrolling};
use super::page::STYLE;
use crate::data::Dataset;
use crate::data::plan::{Owners, Part, Plan};
use crate::scene::eigen;
use crate::{Error, Result};

/// Width and maximum height of the picture, and its margin, pixels.
const WIDTH: f64 = 1000.0;
const MARGIN: f64 = 16.0;
/// Maximum numbers of points and cameras in the picture.
const POINTS: usize = 12_000;
const CAMERAS: usize = 4000;
/// Length of a camera's wedge, pixels.
const WEDGE: f64 = 11.0;
/// Share of the points that may lie beyond each edge of the picture.
const BEYOND: f64 = 0.02;
/// Test photos.
const GRAY: RGBColor = RGBColor(128, 128, 128);

/// Writes the page of `plan`, which was made of `dataset`.
///
/// # Errors
/// If the picture cannot be drawn.
pub fn page(title: &str, plan: &Plan, dataset: &Dataset) -> Result<String> {
    let owners = Owners::of(&plan.parts);
    let positions = dataset.points.iter().flat_map(|points| &points.positions).copied().collect::<Vec<_>>();
    let labels: Vec<usize> = positions.par_iter().map(|&at| owners.part(at) as usize).collect();
    let picture = picture(plan, dataset, &positions, &labels)
        .map_err(|error| Error::Usage(format!("the plan could not be drawn: {error}")))?;
    let mut points = vec![0u64; plan.parts.len()];
    labels.iter().for_each(|&part| points[part] += 1);
    let mut table = "<thead><tr><th>part</th><th>photos</th><th>ring</th><th>test</th><th>points</th><th>Gaussians, at most</th></tr></thead>\
                     <tbody>"
        .to_owned();
    for (i, (Part { photos, ring, test, gaussians, .. }, points)) in plan.parts.iter().zip(points).enumerate() {
        let RGBColor(r, g, b) = color(i);
        let _ = writeln!(
            table,
            "<tr><td><span class=\"key\" style=\"background:rgb({r},{g},{b})\"></span>{i}</td><td>{}</td><td>{}</td><td>{}</td>\
             <td>{points}</td><td>{gaussians}</td></tr>",
            photos.len(),
            ring.len(),
            test.len()
        );
    }
    let (title, table) = (escape(title), scrolling("parts", &(table + "</tbody>")));
    Ok(format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>{title}</title>\n<style>{STYLE}svg{{max-width:100%;height:auto}}</style>\n</head><body><h1>{title}</h1>\n<p>{EXPLAINED}</p>\n{picture}\n{table}\
         </body></html>\n"
    ))
}

const EXPLAINED: &str = "Sparse points and cameras (wedges) from above, in the color of their part. Test cameras are gray. The \
    ring of a part is photos of other parts that it trains with as well.";

/// Distinct colors for the first parts; later ones differ from their neighbors in number.
fn color(part: usize) -> RGBColor {
    COLORS.get(part).copied().unwrap_or_else(|| {
        // Hues by the golden ratio, in three degrees of lightness.
        let (r, g, b) = HSLColor((part as f64 * 0.618).fract(), 0.65, [0.45, 0.6, 0.52][part % 3]).rgb();
        RGBColor(r, g, b)
    })
}

/// Places from above, in pixels.
struct Above {
    right: DVec3,
    down: DVec3,
    low: DVec2,
    scale: f64,
    height: f64,
}

impl Above {
    /// Looks along the axis in which the cameras' centers spread least, from the side that is up in most photos.
    fn of(dataset: &Dataset, positions: &[[f64; 3]]) -> Above {
        let eyes: Vec<DVec3> = dataset.photos.iter().map(|photo| photo.camera.eye()).collect();
        let mean = eyes.iter().sum::<DVec3>() / eyes.len().max(1) as f64;
        let sum = |a: usize, b: usize| eyes.iter().map(|eye| (*eye - mean)[a] * (*eye - mean)[b]).sum::<f64>();
        let (_, [right, _, up]) = eigen([sum(0, 0), sum(1, 1), sum(2, 2), sum(0, 1), sum(0, 2), sum(1, 2)]);
        let photos_up = -dataset.photos.iter().map(|photo| photo.camera.rotation.row(1)).sum::<DVec3>();
        let up = if photos_up.dot(up) < 0.0 { -up } else { up };
        let mut above = Above { right, down: right.cross(up), low: DVec2::ZERO, scale: 1.0, height: 0.0 };
        // All cameras, and most points.
        let limits = |axis: fn(DVec2) -> f64| {
            let places = |all: &[DVec3]| {
                let mut places: Vec<f64> = all.iter().map(|&at| axis(above.place(at))).collect();
                places.sort_by(f64::total_cmp);
                places
            };
            let (eyes, points) = (places(&eyes), places(&positions.iter().map(|&at| at.into()).collect::<Vec<_>>()));
            let beyond = (points.len() as f64 * BEYOND) as usize;
            let inner = &points[beyond..points.len() - beyond];
            let all = || eyes.iter().chain(inner).copied();
            (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max))
        };
        let ((left, right), (top, bottom)) = (limits(|at| at.x), limits(|at| at.y));
        let longer = (right - left).max(bottom - top).max(f64::MIN_POSITIVE);
        above.scale = (WIDTH - 2.0 * MARGIN) / longer;
        above.low = DVec2::new(left, top) - (DVec2::new(longer - (right - left), 0.0) * 0.5 + MARGIN / above.scale);
        above.height = (bottom - top) * above.scale + 2.0 * MARGIN;
        above
    }

    fn place(&self, at: DVec3) -> DVec2 {
        (DVec2::new(at.dot(self.right), at.dot(self.down)) - self.low) * self.scale
    }

    /// The pixel of a place, if it is in the picture.
    fn pixel(&self, at: DVec2) -> Option<(i32, i32)> {
        let inside = at.cmpge(DVec2::ZERO).all() && at.cmple(DVec2::new(WIDTH, self.height)).all();
        inside.then_some((at.x.round() as i32, at.y.round() as i32))
    }
}

fn picture(
    plan: &Plan,
    dataset: &Dataset,
    positions: &[[f64; 3]],
    labels: &[usize],
) -> std::result::Result<String, Box<dyn std::error::Error>> {
    let above = Above::of(dataset, positions);
    let names = plan.parts.iter().enumerate().flat_map(|(i, part)| part.photos.iter().map(move |name| (&name[..], i)));
    let own: HashMap<&str, usize> = names.collect();
    let every = |count: usize, most: usize| count.div_ceil(most).max(1);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (WIDTH as u32, above.height.ceil() as u32)).into_drawing_area();
        for (&at, &part) in positions.iter().zip(labels).step_by(every(positions.len(), POINTS)) {
            if let Some(pixel) = above.pixel(above.place(at.into())) {
                area.draw(&Circle::new(pixel, 1, color(part).mix(0.8).filled()))?;
            }
        }
        for photo in dataset.photos.iter().step_by(every(dataset.photos.len(), CAMERAS)) {
            let camera = &photo.camera;
            let (eye, place) = (camera.eye(), above.place(camera.eye()));
            let corner = |right: f64| {
                let to = camera.rotation.transpose() * DVec3::new(right, 0.0, 1.0);
                place + (above.place(eye + to) - place) * (WEDGE / above.scale)
            };
            let wedge: Vec<_> =
                [place, corner(-0.5), corner(0.5), place].iter().filter_map(|&at| above.pixel(at)).collect();
            let part = own.get(&photo.name[..]).map_or(GRAY, |&part| color(part));
            area.draw(&Polygon::new(wedge.clone(), part.mix(0.5)))?;
            area.draw(&PathElement::new(wedge, part))?;
        }
        area.present()?;
    }
    // Within an HTML page it needs no name space.
    Ok(svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1))
}
