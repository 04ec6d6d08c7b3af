//! Work-precision curves: quality over seconds, bytes and Gaussians, read from JSON lines and drawn as SVG.

use std::fs;
use std::path::Path;

use plotters::coord::ranged1d::{AsRangedCoord, DefaultFormatting, KeyPointHint, Ranged, ValueFormatter};
use plotters::prelude::*;
use serde::Deserialize;

use crate::{Error, Result};

/// Size of a plot, pixels. Three fit side by side in a window of 1280.
const SIZE: (u32, u32) = (400, 300);
/// Minimum ratio of the largest to the smallest value for a logarithmic axis.
const WIDE: f64 = 10.0;
/// Okabe and Ito's colors without yellow and black; also distinct with color blindness.
pub(super) const COLORS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

/// Measurement of a run.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Record {
    /// Name of the run, shared by all its measurements and seeds.
    pub name: String,
    /// Time since the run's start, seconds, at least 0.
    pub seconds: f64,
    /// Size of the scene's file, bytes.
    pub bytes: u64,
    /// Number of Gaussians, with and without lobes.
    pub gaussians: u64,
    /// Mean PSNR over the test photos, dB.
    pub psnr: f64,
    /// Mean SSIM over the test photos, −1 to 1.
    pub ssim: f64,
    /// Seed of the run; curves show the spread over seeds.
    pub seed: u64,
    /// Selection of the test photos: `every`, `sector` or the user's own name.
    pub holdout: String,
    /// PSNR of the base that the run started from, if known, dB.
    pub base_psnr: Option<f64>,
}

/// Reads JSON lines, one [`Record`] each. Other fields and empty lines are skipped.
///
/// # Errors
/// Errors of reading the file; [`Error::Input`] with line and field if a field is missing or invalid.
pub fn read_history(path: impl AsRef<Path>) -> Result<Vec<Record>> {
    let path = path.as_ref();
    let text = fs::read(path).map_err(|source| Error::io(path, source))?;
    let text = String::from_utf8(text).map_err(|_| Error::input(path, "is not UTF-8 text, expected JSON lines"))?;
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    lines
        .map(|(i, line)| {
            let fail = |what: String| Error::input(path, format!("line {}: {what}", i + 1));
            let record: Record =
                serde_json::from_str(line).map_err(|error| fail(format!("is not a record, expected JSON: {error}")))?;
            if record.seconds < 0.0 {
                return Err(fail(format!("`seconds` is {}, expected 0 or more", record.seconds)));
            }
            if record.ssim.abs() > 1.0 {
                return Err(fail(format!("`ssim` is {}, expected -1 to 1", record.ssim)));
            }
            Ok(record)
        })
        .collect()
}

/// Horizontal axis of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cost {
    /// Wall time since the start of the run.
    Seconds,
    /// Size of the scene's file.
    Bytes,
    /// Number of Gaussians, with and without lobes.
    Gaussians,
}

/// Vertical axis of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gain {
    /// PSNR, dB.
    Psnr,
    /// SSIM, −1 to 1.
    Ssim,
}

impl Cost {
    /// All costs, in the page's order.
    pub const ALL: [Cost; 3] = [Cost::Seconds, Cost::Bytes, Cost::Gaussians];

    fn of(self, record: &Record) -> f64 {
        match self {
            Cost::Seconds => record.seconds,
            Cost::Bytes => record.bytes as f64,
            Cost::Gaussians => record.gaussians as f64,
        }
    }

    /// Title of the axis, with its unit.
    pub fn title(self) -> &'static str {
        match self {
            Cost::Seconds => "seconds",
            Cost::Bytes => "bytes",
            Cost::Gaussians => "Gaussians",
        }
    }
}

impl Gain {
    /// All gains, in the page's order.
    pub const ALL: [Gain; 2] = [Gain::Psnr, Gain::Ssim];

    fn of(self, record: &Record) -> f64 {
        match self {
            Gain::Psnr => record.psnr,
            Gain::Ssim => record.ssim,
        }
    }

    /// Title of the axis, with its unit.
    pub fn title(self) -> &'static str {
        match self {
            Gain::Psnr => "test PSNR [dB]",
            Gain::Ssim => "test SSIM",
        }
    }
}

/// Runs of one name.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Measurements by seed, ascending; those of a seed are in the order of their seconds.
    pub seeds: Vec<Vec<&'a Record>>,
}

/// Mean, minimum and maximum over seeds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Mean over the seeds.
    pub mean: f64,
    /// Minimum over the seeds.
    pub least: f64,
    /// Maximum over the seeds.
    pub largest: f64,
}

impl Range {
    /// Range of `values`; `None` if there are none.
    fn of(values: impl Iterator<Item = f64> + Clone) -> Option<Range> {
        let n = values.clone().count();
        (n > 0).then(|| Range {
            mean: values.clone().sum::<f64>() / n as f64,
            least: values.clone().fold(f64::INFINITY, f64::min),
            largest: values.fold(f64::NEG_INFINITY, f64::max),
        })
    }
}

/// Hold-outs of `records`, in the order of their first records.
pub fn holdouts(records: &[Record]) -> Vec<&str> {
    let mut found: Vec<&str> = Vec::new();
    for record in records {
        if !found.contains(&&record.holdout[..]) {
            found.push(&record.holdout);
        }
    }
    found
}

/// Curves of one hold-out, in the order of their first records.
pub fn curves<'a>(records: &'a [Record], holdout: &str) -> Vec<Curve<'a>> {
    let mut names: Vec<&str> = Vec::new();
    let chosen: Vec<&Record> = records.iter().filter(|record| record.holdout == holdout).collect();
    for record in &chosen {
        if !names.contains(&&record.name[..]) {
            names.push(&record.name);
        }
    }
    let curve = |name: &'a str| {
        let mut own: Vec<&Record> = chosen.iter().copied().filter(|record| record.name == name).collect();
        own.sort_by(|a, b| a.seed.cmp(&b.seed).then(a.seconds.total_cmp(&b.seconds)));
        Curve { name, seeds: own.chunk_by(|a, b| a.seed == b.seed).map(<[&Record]>::to_vec).collect() }
    };
    names.into_iter().map(curve).collect()
}

impl Curve<'_> {
    /// Cost and gain of the k-th measurements of all seeds, for each k that every seed has.
    pub fn means(&self, cost: Cost, gain: Gain) -> Vec<(Range, Range)> {
        let shared = self.seeds.iter().map(Vec::len).min().unwrap_or(0);
        let at = |k: usize, of: &dyn Fn(&Record) -> f64| Range::of(self.seeds.iter().map(|seed| of(seed[k])));
        (0..shared).filter_map(|k| at(k, &|r| cost.of(r)).zip(at(k, &|r| gain.of(r)))).collect()
    }

    /// Range of `of` at the end of each seed's run, without seeds for which it is unknown.
    pub fn last(&self, of: impl Fn(&Record) -> Option<f64>) -> Option<Range> {
        let all: Vec<f64> = self.seeds.iter().filter_map(|seed| seed.last()).filter_map(|record| of(record)).collect();
        Range::of(all.iter().copied())
    }

    /// Whether the curve covers more than one cost, so that there is a line to draw.
    pub fn goes_over(&self, cost: Cost) -> bool {
        let means = self.means(cost, Gain::Psnr);
        means.iter().any(|(x, _)| x.mean != means[0].0.mean)
    }
}

/// CSS color of the k-th curve.
pub fn css_color(k: usize) -> String {
    let RGBColor(r, g, b) = COLORS[k % COLORS.len()];
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Draws an SVG without any text from the user: for each curve its seeds (pale), their mean, and bars from
/// the minimum to the maximum gain.
///
/// # Errors
/// [`Error::Usage`] if there is nothing to draw.
pub fn plot(curves: &[Curve<'_>], cost: Cost, gain: Gain) -> Result<String> {
    let all = || curves.iter().flat_map(|curve| curve.seeds.iter().flatten());
    let xs = Range::of(all().map(|record| cost.of(record)));
    let ys = Range::of(all().map(|record| gain.of(record)));
    let (Some(xs), Some(ys)) = (xs, ys) else { return Err(Error::Usage("there is nothing to plot".into())) };
    // Neither axis may be empty, and no point may lie on its end.
    let margin = |range: Range, least: f64| (0.05 * (range.largest - range.least)).max(least);
    let dy = margin(ys, if gain == Gain::Psnr { 0.05 } else { 5e-4 });
    let y = ys.least - dy..ys.largest + dy;
    let drawn = if xs.least > 0.0 && xs.largest > WIDE * xs.least {
        draw(curves, cost, gain, Decades(xs.least / 1.2..xs.largest * 1.2), y)
    } else {
        let dx = margin(xs, 0.01 * xs.largest.max(1.0));
        draw(curves, cost, gain, xs.least - dx..xs.largest + dx, y)
    };
    let svg = drawn.map_err(|error| Error::Usage(format!("the curves could not be drawn: {error}")))?;
    // Within an HTML page it needs no name space, and the page should contain no address.
    Ok(svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1))
}

/// Logarithmic axis with ticks at 1, 2 and 5 times powers of ten, or at fewer multiples if those are too
/// many. The axis of plotters has ticks at powers of ten only, and a range may contain just one.
struct Decades(std::ops::Range<f64>);

impl Decades {
    fn ticks(&self, most: usize) -> Vec<f64> {
        let of = |steps: &[f64]| -> Vec<f64> {
            let powers = self.0.start.log10().floor() as i32..=self.0.end.log10().ceil() as i32;
            let all = powers.flat_map(|power| steps.iter().map(move |step| step * 10f64.powi(power)));
            all.filter(|tick| (self.0.start..=self.0.end).contains(tick)).collect()
        };
        [&[1.0, 2.0, 5.0][..], &[1.0, 3.0]]
            .into_iter()
            .map(of)
            .find(|ticks| ticks.len() <= most)
            .unwrap_or_else(|| of(&[1.0]))
    }
}

impl Ranged for Decades {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (left, right): (i32, i32)) -> i32 {
        let part = (value / self.0.start).ln() / (self.0.end / self.0.start).ln();
        left + (f64::from(right - left) * part).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        self.ticks(hint.max_num_points().max(2))
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.0.clone()
    }
}

fn draw<X>(
    curves: &[Curve<'_>],
    cost: Cost,
    gain: Gain,
    x: X,
    y: std::ops::Range<f64>,
) -> std::result::Result<String, Box<dyn std::error::Error>>
where
    X: AsRangedCoord<Value = f64>,
    X::CoordDescType: ValueFormatter<f64> + Ranged<ValueType = f64>,
{
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart =
            ChartBuilder::on(&area).margin(12).x_label_area_size(42).y_label_area_size(62).build_cartesian_2d(x, y)?;
        let short = |v: &f64| match v.abs() {
            v if v >= 1e6 => format!("{}M", round(v / 1e6)),
            v if v >= 1e4 => format!("{}k", round(v / 1e3)),
            _ => round(*v),
        };
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .x_labels(5)
            .y_labels(7)
            .x_desc(cost.title())
            .y_desc(gain.title())
            .x_label_formatter(&short)
            .y_label_formatter(&|v| if gain == Gain::Psnr { format!("{v:.2}") } else { format!("{v:.4}") })
            .axis_desc_style(("sans-serif", 15))
            .label_style(("sans-serif", 12))
            .draw()?;
        for (k, curve) in curves.iter().enumerate() {
            let color = COLORS[k % COLORS.len()];
            if curve.seeds.len() > 1 {
                let line = |seed: &Vec<&Record>| {
                    let points: Vec<(f64, f64)> =
                        seed.iter().map(|record| (cost.of(record), gain.of(record))).collect();
                    PathElement::new(points, color.mix(0.3))
                };
                chart.draw_series(curve.seeds.iter().map(line))?;
            }
            let means = curve.means(cost, gain);
            let line: Vec<(f64, f64)> = means.iter().map(|(x, y)| (x.mean, y.mean)).collect();
            chart.draw_series([PathElement::new(line, color.stroke_width(2))])?;
            chart.draw_series(means.iter().map(|(x, y)| Circle::new((x.mean, y.mean), 3, color.filled())))?;
            if curve.seeds.len() > 1 {
                let bar =
                    |(x, y): &(Range, Range)| PathElement::new(vec![(x.mean, y.least), (x.mean, y.largest)], color);
                chart.draw_series(means.iter().map(bar))?;
            }
        }
        area.present()?;
    }
    Ok(svg)
}

/// Formats with at least three digits, without trailing zeros.
fn round(v: f64) -> String {
    let text = format!("{:.*}", if v < 10.0 { 2 } else { 1 }, v);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(name: &str, seed: u64, seconds: f64, psnr: f64) -> Record {
        let (name, holdout) = (name.to_owned(), "every".to_owned());
        Record { name, seconds, bytes: 1000, gaussians: 10, psnr, ssim: 0.9, seed, holdout, base_psnr: None }
    }

    fn read(text: &str) -> Result<Vec<Record>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.jsonl");
        fs::write(&path, text).unwrap();
        read_history(path)
    }

    const LINE: &str = r#"{"name":"a","seconds":1.5,"bytes":10,"gaussians":2,"psnr":25.5,"ssim":0.8,"seed":3,"holdout":"sector","views":{"a.png":26.5}}"#;

    #[test]
    fn lines_are_read_and_bad_ones_named() {
        let expected = Record {
            name: "a".into(),
            seconds: 1.5,
            bytes: 10,
            gaussians: 2,
            psnr: 25.5,
            ssim: 0.8,
            seed: 3,
            holdout: "sector".into(),
            base_psnr: None,
        };
        let with_base = LINE.replace("\"views\"", "\"base_psnr\":24.5,\"views\"");
        let of_base = Record { base_psnr: Some(24.5), ..expected.clone() };
        assert_eq!(read(&format!("{LINE}\n\n{with_base}\r\n")).unwrap(), [expected, of_base]);
        assert_eq!(read("").unwrap(), []);
        for (from, to, word) in [
            ("\"psnr\":25.5,", "", "psnr"),
            ("1.5", "-1.5", "seconds"),
            ("0.8", "1.8", "ssim"),
            ("25.5", "null", "line 2"),
            ("25.5", "1e999", "line 2"),
            ("10", "-10", "line 2"),
            ("}", "", "line 2"),
        ] {
            let message = read(&format!("{LINE}\n{}\n", LINE.replace(from, to))).unwrap_err().to_string();
            assert!(
                message.contains("line 2") && message.contains(word) && message.contains("history.jsonl"),
                "{message}"
            );
        }
    }

    #[test]
    fn seeds_are_averaged_by_rank() {
        let records = [
            record("b", 1, 20.0, 31.0),
            record("b", 1, 10.0, 28.0),
            record("a", 0, 5.0, 20.0),
            record("b", 0, 12.0, 30.0),
            record("b", 0, 26.0, 33.0),
            record("b", 0, 99.0, 40.0),
        ];
        let curves = curves(&records, "every");
        assert_eq!(curves.iter().map(|c| c.name).collect::<Vec<_>>(), ["b", "a"]);
        let range = |mean, least, largest| Range { mean, least, largest };
        let means = curves[0].means(Cost::Seconds, Gain::Psnr);
        assert_eq!(
            means,
            [(range(11.0, 10.0, 12.0), range(29.0, 28.0, 30.0)), (range(23.0, 20.0, 26.0), range(32.0, 31.0, 33.0))]
        );
        assert_eq!(curves[0].last(|r| Some(r.psnr)), Some(range(35.5, 31.0, 40.0)));
        assert_eq!(curves[0].last(|r| r.base_psnr), None);
        // A single measurement makes no line, nor do several at one cost.
        let lines = |k: usize| Cost::ALL.map(|cost| curves[k].goes_over(cost));
        assert_eq!([lines(0), lines(1)], [[true, false, false], [false; 3]]);
        assert!(super::curves(&records, "sector").is_empty());
        assert_eq!(holdouts(&records), ["every"]);
    }

    #[test]
    fn curves_are_drawn_over_every_cost_and_say_nothing_of_strangers() {
        // A single point, equal points and a wide range can be drawn.
        for records in [
            vec![record("<b>", 0, 0.0, 20.0)],
            vec![record("<b>", 0, 1.0, 20.0), record("<b>", 1, 1.0, 20.0)],
            (0..9)
                .map(|i| record(if i % 2 == 0 { "<b>" } else { "x" }, i / 3, 10f64.powi(i as i32), 20.0 + i as f64))
                .collect(),
        ] {
            let curves = curves(&records, "every");
            for (cost, gain) in Cost::ALL.into_iter().flat_map(|cost| Gain::ALL.map(|gain| (cost, gain))) {
                let svg = plot(&curves, cost, gain).unwrap();
                assert!(svg.contains("<svg") && svg.contains("<circle") && svg.contains(cost.title()), "{svg}");
                assert!(!svg.contains("<b>") && !svg.contains("http") && !svg.contains("NaN"), "{svg}");
            }
        }
        assert!(plot(&[], Cost::Bytes, Gain::Ssim).is_err());
        let ticks = |least: f64, largest: f64| Decades(least..largest).ticks(7);
        assert_eq!(ticks(0.6, 6.0), [1.0, 2.0, 5.0]);
        assert_eq!(ticks(0.8, 120.0), [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]);
        assert_eq!(ticks(0.9, 1e6).len(), 7);
        assert_eq!([0.25, 3.0, 31.62, 100.0].map(round), ["0.25", "3", "31.6", "100"]);
    }
}
