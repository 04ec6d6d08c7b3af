use std::{
    env,
    ffi::OsString,
    fs,
    io::ErrorKind,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{
    DeviceArgs, Outcome, print, print_json,
    progress::{Progress, note},
};
use crate::{
    Error, Result,
    data::write_text,
    gpu::{Context, DeviceInfo},
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
/// Another shape changes the last bits of what is learned, but not of rendered images; a run that goes on keeps its own. Run nothing else
/// meanwhile; it takes seconds on a GPU, minutes on a CPU.
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

impl Calibrations {
    /// Takes in what was found. Other sizes stay as they are, and so do other devices, drivers and versions.
    fn take_in(&mut self, found: Calibration) {
        let Some(known) = self.devices.iter_mut().find(|known| known.is_of(&found)) else {
            return self.devices.push(found);
        };
        known.sizes.retain(|old| found.sizes.iter().all(|new| (old.width, old.height) != (new.width, new.height)));
        known.sizes.extend(found.sizes);
    }
}

impl Calibration {
    /// Of a device, by this version.
    fn new(info: &DeviceInfo, sizes: Vec<Choice>) -> Self {
        let glint = env!("CARGO_PKG_VERSION").into();
        Calibration { device: info.name.clone(), driver: info.driver.clone(), glint, sizes }
    }

    /// Of the same device, driver and version.
    fn is_of(&self, other: &Calibration) -> bool {
        (&self.device, &self.driver, &self.glint) == (&other.device, &other.driver, &other.glint)
    }

    /// That of the size whose pixels are nearest, by their ratio.
    fn nearest(&self, pixels: f64) -> Option<&Choice> {
        let far = |c: &&Choice| (f64::from(c.width) * f64::from(c.height) / pixels.max(1.0)).ln().abs();
        self.sizes.iter().min_by(|a, b| far(a).total_cmp(&far(b)))
    }
}

/// Where calibrations are kept; where the system names no such place, the variables that would. What the user has calibrated is nothing to
/// the library's tests.
fn file() -> Result<PathBuf, &'static str> {
    file_by(cfg!(windows), |name| env::var_os(name).filter(|_| !cfg!(test)))
}

fn file_by(windows: bool, variable: impl Fn(&str) -> Option<OsString>) -> Result<PathBuf, &'static str> {
    let named = |name: &str| variable(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let (folder, names) = match windows {
        true => (named("APPDATA"), "APPDATA"),
        false => {
            let home = || Some(named("HOME")?.join(".config"));
            (named("XDG_CONFIG_HOME").or_else(home), "XDG_CONFIG_HOME or HOME")
        }
    };
    Ok(folder.ok_or(names)?.join("glint").join("calibration.json"))
}

fn read(path: &Path) -> Result<Calibrations> {
    match fs::read(path) {
        Ok(bytes) => serde_json::from_slice(&bytes)
            .map_err(|e| Error::input(path, format!("{e}; expected what glint calibrate writes (remove the file)"))),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(Calibrations::default()),
        Err(e) => Err(Error::io(path, e)),
    }
}

/// The shape of so many pixels, which is named in `path`; `advice` is for where the device cannot have it.
fn shape([width, height]: [u32; 2], context: &Context, path: &Path, advice: &str) -> Result<TileShape> {
    let lanes = context.info().subgroup_size;
    TileShape::new(width, height, lanes).ok_or_else(|| {
        let what = format!("tile {width}×{height}: expected one that subgroups of {lanes} lanes can cover ({advice})");
        Error::input(path, what)
    })
}

/// The shape that the settings of a run have, which are kept in `path`.
pub(super) fn tile_of(settings: &Value, path: &Path, context: &Context) -> Result<Option<TileShape>> {
    let sides = serde_json::from_value::<Option<[u32; 2]>>(settings["tile"].clone())
        .map_err(|e| Error::input(path, format!("tile {}: {e}", settings["tile"])))?;
    sides.map(|sides| shape(sides, context, path, "begin anew elsewhere")).transpose()
}

/// The shape that was found best on the device for views of so many pixels, if it was calibrated. A file that cannot be read is none.
///
/// # Errors
/// Where the file of calibrations is not what it should be.
pub(super) fn calibrated_tile(context: &Context, pixels: f64) -> Result<Option<TileShape>> {
    let Ok(path) = file() else { return Ok(None) };
    let all = match read(&path) {
        Err(error @ Error::Io { .. }) => {
            note(format!("tiles are of the usual shape, calibrated or not: {error}"));
            return Ok(None);
        }
        all => all?,
    };
    let here = Calibration::new(context.info(), Vec::new());
    let Some(choice) = all.devices.iter().find(|c| c.is_of(&here)).and_then(|c| c.nearest(pixels)) else {
        return Ok(None);
    };
    let tile = shape(choice.tile, context, &path, "calibrate again")?;
    tracing::info!("calibrated: tiles of {tile} pixels");
    Ok(Some(tile))
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let path = file().map_err(|names| {
            Error::Usage(format!("no folder to keep a calibration in: expected an absolute path in {names}"))
        })?;
        // What cannot be read is not written over: it is known before anything is timed.
        read(&path)?;
        self.device.with(|context| {
            let loads = if self.quick { &LOADS[..1] } else { &LOADS[..] };
            let bar = Progress::new("calibrating", "measurements", (loads.len() * measurements(context)) as u64);
            let mut done = 0;
            let mut found = Vec::new();
            for load in loads {
                let times = time_tiles(context, *load, || {
                    done += 1;
                    bar.set(done);
                });
                match times {
                    Err(Error::Gpu(error)) if error.is_no_room() && !found.is_empty() => {
                        let Load { width, height, .. } = load;
                        note(format!("views of {width}×{height} and more are left out: {error}"));
                        break;
                    }
                    times => found.push(times?),
                }
            }
            drop(bar);
            let chosen = || loads.iter().zip(&found).filter_map(|(load, times)| Some((load, times, best_tile(times)?)));
            let choice = |(load, _, tile): (&Load, &Vec<TileTimes>, TileShape)| Choice {
                width: load.width,
                height: load.height,
                tile: [tile.width, tile.height],
            };
            let info = context.info();
            // Another run may have written since.
            let mut all = read(&path)?;
            all.take_in(Calibration::new(info, chosen().map(choice).collect()));
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

    #[test]
    fn what_is_found_takes_the_place_of_the_same_sizes_only() {
        let of = |driver: &str, glint: &str, sizes: &[(u32, u32)]| {
            let sizes = sizes.iter().map(|&(width, tile)| Choice { width, height: width, tile: [tile, 8] }).collect();
            Calibration { device: "a".into(), driver: driver.into(), glint: glint.into(), sizes }
        };
        let mut all = Calibrations::default();
        all.take_in(of("1", "0.1", &[(256, 8), (1024, 16)]));
        all.take_in(of("1", "0.2", &[(256, 8)]));
        all.take_in(of("2", "0.1", &[(256, 8)]));
        all.take_in(of("1", "0.1", &[(256, 16)]));
        let told = |of: &Calibration| {
            let mut sizes: Vec<_> = of.sizes.iter().map(|choice| (choice.width, choice.tile[0])).collect();
            sizes.sort_unstable();
            (of.driver.clone(), of.glint.clone(), sizes)
        };
        let told: Vec<_> = all.devices.iter().map(told).collect();
        let expected =
            [("1", "0.1", vec![(256, 16), (1024, 16)]), ("1", "0.2", vec![(256, 8)]), ("2", "0.1", vec![(256, 8)])];
        assert_eq!(told, expected.map(|(driver, glint, sizes)| (driver.into(), glint.into(), sizes)));
    }

    #[test]
    fn the_file_is_where_an_absolute_path_leads() {
        let unix = |xdg: Option<&str>, home: Option<&str>| {
            file_by(false, |name| if name == "HOME" { home } else { xdg }.map(OsString::from))
        };
        let root = env::temp_dir();
        let root = root.to_str();
        for (xdg, home, inside) in
            [(root, None, ""), (root, root, ""), (Some("a"), root, ".config"), (None, root, ".config")]
        {
            assert_eq!(unix(xdg, home), Ok(env::temp_dir().join(inside).join("glint/calibration.json")));
        }
        assert_eq!([unix(None, None), unix(Some("a"), Some("b"))], [(); 2].map(|()| Err("XDG_CONFIG_HOME or HOME")));
        assert_eq!(file_by(true, |name| (name != "APPDATA").then(|| env::temp_dir().into())), Err("APPDATA"));
        // None of the user's, wherever it is.
        assert!(file().is_err());
    }
}
