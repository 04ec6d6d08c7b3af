use std::{
    env, fs,
    io::ErrorKind,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use super::{DeviceArgs, Outcome, print, print_json, progress::Progress};
use crate::{
    Error, Result,
    data::write_text,
    gpu::Context,
    pipelines::{
        calibrate::{LOADS, Load, TileTimes, best_tile, measurements, time_tiles},
        raster::TileShape,
    },
    report::table::{Cell, Column, Table},
};

/// Time training steps by each shape of a tile, and keep what is fastest on this device for later runs
///
/// A subgroup covers a tile of 8×8, 8×16 or 16×16 pixels; which is fastest depends on the device and on the size of the photos. Without
/// this, subgroups of up to 16 lanes cover 8×8 pixels and others 8×16. Another shape is kept where it is faster by 5 % or more in each
/// of three rounds, so that calibrating again finds the same. `train` and `enhance` take the shape of the nearest size from then on.
/// What they learn has other bits by another shape, images have not. Nothing else should run meanwhile; seconds on a GPU, minutes on a CPU.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Kept in glint/calibration.json of $XDG_CONFIG_HOME, of ~/.config without it, or of %APPDATA% on Windows, for this \
    device, driver and version of glint; without that file all is as before.\n\nExamples:\n  glint calibrate\n  glint calibrate --json \
    --device 1"
)]
pub(super) struct Args {
    #[command(flatten)]
    device: DeviceArgs,
    /// Views of 256×256 only: some seconds on a CPU, too
    #[arg(long)]
    quick: bool,
    /// Print JSON: {"output","device","sizes":[{"width","height","gaussians","tile","times":[{"tile","milliseconds"}]}]}
    #[arg(long)]
    json: bool,
}

/// The file.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Calibrations {
    devices: Vec<Calibration>,
}

/// What suits a device.
#[derive(Debug, Serialize, Deserialize)]
struct Calibration {
    device: String,
    driver: String,
    glint: String,
    sizes: Vec<Choice>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Choice {
    width: u32,
    height: u32,
    /// Width and height, pixels.
    tile: [u32; 2],
}

impl Calibration {
    fn is_of(&self, context: &Context) -> bool {
        let info = context.info();
        (&*self.device, &*self.driver, &*self.glint) == (&*info.name, &*info.driver, env!("CARGO_PKG_VERSION"))
    }

    /// That of the size whose pixels are nearest, by their ratio.
    fn nearest(&self, pixels: f64) -> Option<&Choice> {
        let far = |c: &&Choice| (f64::from(c.width) * f64::from(c.height) / pixels.max(1.0)).ln().abs();
        self.sizes.iter().min_by(|a, b| far(a).total_cmp(&far(b)))
    }
}

/// Where calibrations are kept; `None` where the system names no such place.
fn file() -> Option<PathBuf> {
    let named = |name: &str| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let folder = match cfg!(windows) {
        true => named("APPDATA"),
        false => named("XDG_CONFIG_HOME").or_else(|| Some(named("HOME")?.join(".config"))),
    };
    Some(folder?.join("glint").join("calibration.json"))
}

fn read(path: &Path) -> Result<Calibrations> {
    match fs::read(path) {
        Ok(bytes) => serde_json::from_slice(&bytes).map_err(|e| {
            Error::input(
                path,
                format!("{e}; expected what glint calibrate writes (remove the file, or calibrate again)"),
            )
        }),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(Calibrations::default()),
        Err(e) => Err(Error::io(path, e)),
    }
}

/// The shape that was found best on the device for views of so many pixels, if it was calibrated.
///
/// # Errors
/// Where the file of calibrations is not what it should be.
pub(super) fn calibrated_tile(context: &Context, pixels: f64) -> Result<Option<TileShape>> {
    let Some(path) = file() else { return Ok(None) };
    let all = read(&path)?;
    let Some(choice) = all.devices.iter().find(|c| c.is_of(context)).and_then(|c| c.nearest(pixels)) else {
        return Ok(None);
    };
    let ([width, height], lanes) = (choice.tile, context.info().subgroup_size);
    let tile = TileShape::new(width, height, lanes).ok_or_else(|| {
        let what =
            format!("tile {width}×{height}: expected one that subgroups of {lanes} lanes can cover (calibrate again)");
        Error::input(&path, what)
    })?;
    tracing::info!("tiles of {tile} pixels, as calibrated");
    Ok(Some(tile))
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let path = file().ok_or_else(|| Error::Usage("no folder to keep a calibration in: HOME is not set".into()))?;
        // What cannot be read is not written over: it is known before anything is timed.
        let mut all = read(&path)?;
        self.device.with(|context| {
            let loads = if self.quick { &LOADS[..1] } else { &LOADS[..] };
            let bar = Progress::new("calibrating", "measurements", (loads.len() * measurements(context)) as u64);
            let mut done = 0;
            let mut found = Vec::new();
            for load in loads {
                found.push(time_tiles(context, *load, || {
                    done += 1;
                    bar.set(done);
                })?);
            }
            drop(bar);
            let chosen = || loads.iter().zip(&found).filter_map(|(load, times)| Some((load, times, best_tile(times)?)));
            let choice = |(load, _, tile): (&Load, &Vec<TileTimes>, TileShape)| Choice {
                width: load.width,
                height: load.height,
                tile: [tile.width, tile.height],
            };
            let info = context.info();
            let (device, driver) = (info.name.clone(), info.driver.clone());
            all.devices.retain(|other| (&other.device, &other.driver) != (&device, &driver));
            let glint = env!("CARGO_PKG_VERSION").into();
            all.devices.push(Calibration { device, driver, glint, sizes: chosen().map(choice).collect() });
            if let Some(folder) = path.parent() {
                fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
            }
            let text = serde_json::to_string_pretty(&all).map_err(|e| Error::Usage(e.to_string()))?;
            write_text(&path, &(text + "\n"))?;
            if self.json {
                return self.print_json(&path, &info.name, chosen());
            }
            let column = |title, unit, decimals| Column { key: title, title, unit, decimals };
            let mut table = Table::new([
                column("views", "px", 0),
                column("Gaussians", "", 0),
                column("tile", "px", 0),
                column("step", "ms", 2),
                column("taken", "", 0),
            ]);
            for (load, times, best) in chosen() {
                for TileTimes { tile, times } in times {
                    table.row([
                        format!("{}×{}", load.width, load.height).into(),
                        Cell::Count(load.gaussians as u64),
                        tile.to_string().into(),
                        Cell::Number(milliseconds(times).fold(f64::INFINITY, f64::min)),
                        if *tile == best { "yes" } else { "" }.into(),
                    ]);
                }
            }
            Ok(print(format!("{table}\nkept in {}\n", path.display()))?)
        })
    }

    fn print_json<'a>(
        &self,
        path: &Path,
        device: &str,
        chosen: impl Iterator<Item = (&'a Load, &'a Vec<TileTimes>, TileShape)>,
    ) -> Outcome {
        let sizes = chosen.map(|(load, times, best)| {
            let times = times.iter().map(|of| {
                serde_json::json!({"tile": of.tile.to_string(), "milliseconds": milliseconds(&of.times).collect::<Vec<_>>()})
            });
            serde_json::json!({
                "width": load.width, "height": load.height, "gaussians": load.gaussians, "tile": best.to_string(),
                "times": times.collect::<Vec<_>>(),
            })
        });
        let sizes: Vec<_> = sizes.collect();
        Ok(print_json(&serde_json::json!({"output": path, "device": device, "sizes": sizes}))?)
    }
}

fn milliseconds(times: &[std::time::Duration]) -> impl Iterator<Item = f64> + '_ {
    times.iter().map(|time| time.as_secs_f64() * 1e3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_size_is_that_of_the_smallest_ratio() {
        let choice = |width, height| Choice { width, height, tile: [8, 8] };
        let sizes = vec![choice(256, 256), choice(1024, 576), choice(1920, 1080)];
        let found = Calibration { device: String::new(), driver: String::new(), glint: String::new(), sizes };
        let width = |pixels: f64| found.nearest(pixels).map(|c| c.width);
        // The middle of the first two is √(65,536 · 589,824) = 196,608.
        assert_eq!([1.0, 196_000.0, 197_000.0, 1e12, 0.0].map(width), [256, 256, 1024, 1920, 256].map(Some));
        assert!(Calibration { sizes: Vec::new(), ..found }.nearest(1.0).is_none());
    }
}
