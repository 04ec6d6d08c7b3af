//! How much radiance depends on the order of Gaussians, where opacity has a lobe and where colour has one (paper, appendix B).
//!
//!     cargo bench --bench lobe_stability -- [--json]
//!
//! Three Gaussians lie over one another on a ray, with lobes turned by an angle from one to the next in a plane. In the intended order
//! both models shine alike at the middle of each lobe: with lobes of opacity each has colour 1 and opacity ½ f, with lobes of colour
//! opacity ½ and colour 1, 2 and 4 times f, since what lies behind is seen through what is before it. f is the same (method, section 1),
//! or for colour that of a spherical beta (Liu et al. 2025), as it is before it learns and at the width of the others.
//! All six orders are seen from 181 directions; what changes is told of the largest radiance in the intended order.

use std::process::ExitCode;

use clap::Parser;
use glam::DVec3;
use glint::{
    reference::{betas::beta, lobe::factor},
    report::table::{Column, Table},
};

#[derive(Parser)]
#[command(name = "lobe_stability", about = "How much radiance depends on the order of Gaussians")]
struct Args {
    #[arg(long)]
    json: bool,
    /// Given by cargo bench
    #[arg(long, hide = true)]
    bench: bool,
}

/// T and β of the lobes: they end at 45°, and are half at 22.5°.
const SHAPE: [f64; 2] = [0.25, 0.0];
/// b of a spherical beta as it begins: half at 33°.
const FIRST_B: f64 = 0.0;
/// cos(22.5°)^(4 exp(b)) = ½.
const NARROW_B: f64 = 0.783;
/// Of a channel in which a spherical beta does not shine: at 0 a tenth would be left.
const DARK: f64 = -2.0;
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// What has the lobe.
#[derive(Clone, Copy, PartialEq)]
enum Model {
    Opacity,
    Colour,
    /// Colour, by a spherical beta of this b.
    Beta(f64),
}

/// In a plane, from its middle.
fn direction(degrees: f64) -> DVec3 {
    DVec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos())
}

/// Red, green and blue of the ray towards `view`; the Gaussians are of one colour, or each has a channel of its own.
fn radiance(model: Model, own_channels: bool, apart: f64, order: [usize; 3], view: f64) -> [f64; 3] {
    let (mut sum, mut transmittance) = ([0.0; 3], 1.0);
    for i in order {
        let (turn, toward) = (apart * (i as f64 - 1.0), direction(view));
        let f = || factor(direction(turn), SHAPE[0], SHAPE[1], toward);
        let channels = |shine: f64, dark: f64| [0, 1, 2].map(|c| if !own_channels || c == i { shine } else { dark });
        let bright = f64::from(1 << i);
        let (opacity, colour) = match model {
            Model::Opacity => (0.5 * f(), channels(1.0, 0.0)),
            Model::Colour => (0.5, channels(bright * f(), 0.0)),
            Model::Beta(b) => {
                let beta = beta(toward, channels(bright, DARK), [turn.to_radians(), 0.0, b]);
                (0.5, beta.light.map(|light| light * beta.factor))
            }
        };
        for (sum, colour) in sum.iter_mut().zip(colour) {
            *sum += transmittance * opacity * colour;
        }
        transmittance *= 1.0 - opacity;
    }
    sum
}

/// Over all orders, views and channels: the largest and the root mean square change, both of the largest radiance, and the share that
/// changes by more than a hundredth of it.
fn changes(model: Model, own_channels: bool, apart: f64) -> [f64; 3] {
    let views = || (-90..=90).map(f64::from);
    let of = |order, view| radiance(model, own_channels, apart, order, view);
    let most = views().flat_map(|view| of(ORDERS[0], view)).fold(0.0, f64::max);
    let all: Vec<f64> = ORDERS[1..]
        .iter()
        .flat_map(|&order| views().map(move |view| (order, view)))
        .flat_map(|(order, view)| {
            let [a, b] = [of(order, view), of(ORDERS[0], view)];
            [0, 1, 2].map(|c| (a[c] - b[c]).abs() / most)
        })
        .collect();
    let n = all.len() as f64;
    let largest = all.iter().copied().fold(0.0, f64::max);
    let seen = all.iter().filter(|&&change| change > 0.01).count() as f64;
    [largest, (all.iter().map(|change| change * change).sum::<f64>() / n).sqrt(), seen / n]
}

fn main() -> ExitCode {
    let args = Args::parse();
    let column = |key, title, unit, decimals| Column { key, title, unit, decimals };
    let mut table = Table::new(vec![
        column("lobe_of", "lobe of", "", 0),
        column("colours", "colours", "", 0),
        column("apart", "apart", "°", 0),
        column("largest", "largest change", "%", 1),
        column("rms", "RMS", "%", 1),
        column("seen", "above 1 %", "%", 1),
    ]);
    for (colours, own_channels) in [("one", false), ("three", true)] {
        for apart in [15.0, 30.0, 60.0] {
            for (lobe, model) in [
                ("opacity", Model::Opacity),
                ("colour", Model::Colour),
                ("colour, a beta as narrow", Model::Beta(NARROW_B)),
                ("colour, a beta at first", Model::Beta(FIRST_B)),
            ] {
                let [largest, rms, seen] = changes(model, own_channels, apart).map(|part| 100.0 * part);
                table.row(vec![lobe.into(), colours.into(), apart.into(), largest.into(), rms.into(), seen.into()]);
            }
        }
    }
    if args.json {
        match serde_json::to_string_pretty(&table) {
            Ok(text) => println!("{text}"),
            Err(error) => {
                eprintln!("error: {error}");
                return ExitCode::FAILURE;
            }
        }
    } else {
        print!("{table}");
    }
    ExitCode::SUCCESS
}
