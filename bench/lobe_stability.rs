//! How much radiance depends on the order of Gaussians, where opacity has a lobe and where colour has one (paper, appendix B).
//!
//!     cargo bench --bench lobe_stability -- [--json]
//!
//! Three Gaussians lie over one another on a ray, with lobes turned by an angle from one to the next in a plane. In the intended order
//! both models shine alike at the middle of each lobe: with lobes of opacity each has colour 1 and opacity ½ f, with lobes of colour
//! opacity ½ and colour 1, 2 and 4 times f, since what lies behind is seen through what is before it. f is the same (method, section 1).
//! All six orders are seen from 181 directions; what changes is told of the largest radiance in the intended order.

use std::process::ExitCode;

use clap::Parser;
use glam::DVec3;
use glint::{
    reference::lobe::factor,
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

/// T and β of the lobes: they end at 45°.
const SHAPE: [f64; 2] = [0.25, 0.0];
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// What has the lobe.
#[derive(Clone, Copy, PartialEq)]
enum Model {
    Opacity,
    Colour,
}

/// In a plane, from its middle.
fn direction(degrees: f64) -> DVec3 {
    DVec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos())
}

/// Red, green and blue of the ray towards `view`; the Gaussians are of one colour, or each has a channel of its own.
fn radiance(model: Model, own_channels: bool, apart: f64, order: [usize; 3], view: f64) -> [f64; 3] {
    let (mut sum, mut transmittance) = ([0.0; 3], 1.0);
    for i in order {
        let f = factor(direction(apart * (i as f64 - 1.0)), SHAPE[0], SHAPE[1], direction(view));
        let (opacity, colour) = match model {
            Model::Opacity => (0.5 * f, 1.0),
            Model::Colour => (0.5, f64::from(1 << i) * f),
        };
        for (channel, sum) in sum.iter_mut().enumerate() {
            if !own_channels || channel == i {
                *sum += transmittance * opacity * colour;
            }
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
            for (lobe, model) in [("opacity", Model::Opacity), ("colour", Model::Colour)] {
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
