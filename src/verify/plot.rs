//! Error against time, one point for each row.

use std::path::Path;

use plotters::prelude::*;

use super::{Report, Row};
use crate::{Error, Result, data::write_text};

/// Pixels.
const SIZE: (u32, u32) = (1600, 1200);
/// Where results that are exact are drawn: below what float32 can err by.
const EXACT: f64 = 1e-9;
/// Height of a label, pixels.
const TEXT: i32 = 11;
/// Lines that a label may lie off its point where its stage has one already.
const NEARBY: i32 = 3;

/// Writes an SVG with time on one axis and relative L2 error on the other, both logarithmic: a point for each row
/// that has a time. Integers and what is equal lie on the line of exact results.
pub fn plot(report: &Report, path: &Path) -> Result<()> {
    write_text(path, &draw(report).map_err(|e| Error::Usage(format!("the plot could not be drawn: {e}")))?)
}

fn error(row: &Row) -> f64 {
    row.error().filter(|e| e.is_finite()).unwrap_or(0.0).max(EXACT)
}

fn draw(report: &Report) -> std::result::Result<String, Box<dyn std::error::Error>> {
    let rows: Vec<(&Row, f64)> = report.rows.iter().filter_map(|r| Some((r, r.time?.max(1e-7)))).collect();
    let bounds = |values: &mut dyn Iterator<Item = f64>, low: f64, high: f64| {
        values.fold((low, high), |(a, b), v| (a.min(v / 2.0), b.max(v * 2.0)))
    };
    if rows.is_empty() {
        return Err("the device has no timestamps".into());
    }
    let (left, right) = bounds(&mut rows.iter().map(|r| r.1 * 1e6), f64::INFINITY, 0.0);
    let (bottom, top) = bounds(&mut rows.iter().map(|r| error(r.0)), EXACT / 3.0, 1e-4);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let d = &report.device;
        let mut chart = ChartBuilder::on(&area)
            .margin(20)
            .caption(
                format!("{}, subgroups of {} (blue: what the engine takes, red: broken)", d.name, d.subgroup_size),
                ("sans-serif", 20),
            )
            .x_label_area_size(45)
            .y_label_area_size(80)
            .build_cartesian_2d((left..right).log_scale(), (bottom..top).log_scale())?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .x_desc("time of a call, µs")
            .y_desc(format!("relative L2 error against float64 ({EXACT:.0e}: exact)"))
            .x_label_formatter(&|v| format!("{v}"))
            .y_label_formatter(&|v| format!("{v:.0e}"))
            .axis_desc_style(("sans-serif", 16))
            .label_style(("sans-serif", 13))
            .draw()?;
        let colour = |row: &Row| match (row.breaches.is_empty(), row.chosen) {
            (false, _) => RGBColor(200, 0, 0),
            (true, true) => RGBColor(0, 80, 160),
            (true, false) => RGBColor(130, 130, 130),
        };
        chart.draw_series(
            rows.iter().map(|(row, time)| Circle::new((time * 1e6, error(row)), 3, colour(row).filled())),
        )?;

        // Labels go to the nearest free line below or above their points, and a line leads there: one for each stage, and others where there
        // is room nearby.
        let plotted = area.strip_coord_spec();
        let mut taken: Vec<(i32, i32, i32)> = Vec::new();
        let mut points: Vec<_> =
            rows.iter().map(|(row, time)| (*row, chart.backend_coord(&(time * 1e6, error(row))))).collect();
        points.sort_by_key(|(_, (x, y))| (*y, *x));
        // A point takes the lines that its circle touches.
        for (_, (x, y)) in &points {
            taken.extend([y - 3, y + 3].map(|y| (x - 4, x + 4, y.div_euclid(TEXT))));
        }
        let (mut of_stages, mut others): (Vec<_>, Vec<_>) = (Vec::new(), Vec::new());
        for point in points {
            let known = of_stages.iter().any(|(row, _): &(&Row, _)| row.stage == point.0.stage);
            if known { others.push(point) } else { of_stages.push(point) }
        }
        let anywhere = of_stages.into_iter().map(|point| (point, i32::MAX));
        for ((row, (x, y)), reach) in anywhere.chain(others.into_iter().map(|point| (point, NEARBY))) {
            let text = format!("{} {}", row.stage, row.variant);
            let width = 6 * text.chars().count() as i32;
            let from = if x + 8 + width > SIZE.0 as i32 - 20 { x - 8 - width } else { x + 8 };
            let free = |line: i32| taken.iter().all(|&(a, b, l)| l != line || from + width < a || b < from);
            // The line whose middle is nearest.
            let own = y / TEXT;
            let first = 50 / TEXT;
            let last = (SIZE.1 as i32 - 80) / TEXT;
            let line =
                (0..=last.min(reach)).flat_map(|k| [own + k, own - k]).find(|&l| l >= first && l <= last && free(l));
            let Some(line) = line else { continue };
            taken.push((from, from + width, line));
            let at = line * TEXT;
            let style = ("sans-serif", TEXT).into_font().color(&colour(row));
            plotted.draw(&PathElement::new(
                vec![(x, y), (if from > x { from - 2 } else { from + width + 2 }, at + TEXT / 2)],
                colour(row).mix(0.3),
            ))?;
            plotted.draw(&Text::new(text, (from, at), style))?;
        }
        area.present()?;
    }
    Ok(svg)
}
