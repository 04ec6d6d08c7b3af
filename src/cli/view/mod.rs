//! `glint view`: shows a scene in a window.

mod flight;
mod scenery;
mod screen;
mod watch;
mod window;

use std::path::{Path, PathBuf};

use glam::DVec3;

use window::Desk;

use super::{DeviceArgs, DrawArgs, Failure, Look, Outcome, PhotoArgs, SceneArgs, Watched, output::writable};
use crate::{Error, Result, data::SceneFile, gpu::Context};

const EXAMPLES: &str = "\
Keys:
  1 photograph   2 augmented   3 base       4 supplement
  5 diffuse      6 specular    7 depth      8 error
  n, p           camera of the next, the previous photograph (with a DATASET)
  o, f, g        orbit a point, fly, walk on the ground
  w a s d, q e   ahead, left, back, right, down, up; with Shift four times as fast
  r              back to the first camera
  c              take a screenshot: SCENE-0001.png in the folder --output
  k, Shift-K     add this pose to the camera path, save the path: SCENE-path-1.json
  t              time the stages of a frame; shown when the camera rests
  Escape         quit

Mouse: the left button turns, the right or middle button moves, the wheel moves nearer (orbit) or sets the speed (fly, walk). \
A file dropped on the window replaces the scene.

The title shows the mode, the device time of the last frame, the Gaussians (base + supplement), the device memory in use, and \
the last action. Names of screenshots and paths are printed to stdout; existing files are not replaced.

Photograph and error (bright: a mean error of 0.25 or more) are shown only from a photo's camera. Diffuse, specular, depth and \
error are computed on the CPU, as in `glint render` and `glint report`. If the window has another shape than the photo, it \
shows more around it, black or gray in photograph and error.

Examples:
  glint view base.ply
  glint view augmented.ply garden --size 1280x720
  glint view scene.spz --up z --output pictures
  glint render augmented.ply --path augmented-path-1.json -o frames";

/// Look at a scene in a window
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene, in any format that glint reads
    scene: PathBuf,
    /// Folder or JSON file of the dataset with cameras and photos
    dataset: Option<PathBuf>,
    /// Size of the window, pixels [default: that of the first photo, else 1280x720]
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// Axis that points up: x, -x, y, -y, z or -z [default: from the photos, else -y as in COLMAP's scenes]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true, value_parser = parse_axis)]
    up: Option<DVec3>,
    /// Folder for screenshots and camera paths; must exist
    #[arg(short, long, value_name = "DIR", default_value = ".")]
    output: PathBuf,
    #[command(flatten)]
    lenient: SceneArgs,
    #[command(flatten)]
    photos: PhotoArgs,
    #[command(flatten)]
    draw: DrawArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

/// Shows the scene of a run while it trains.
pub(super) fn watch<T>(run: &Watched<'_>, work: impl FnOnce(&Context, &mut Look<'_>) -> Outcome<T>) -> Outcome<T> {
    let folder = run.output.parent().filter(|folder| !folder.as_os_str().is_empty());
    let desk = Desk {
        device: run.device,
        dataset: Some(run.dataset),
        lenient: &SceneArgs { lenient: false },
        policy: run.policy,
        background: run.background,
        size: None,
        up: None,
        folder: folder.unwrap_or(Path::new(".")),
        file: run.output,
    };
    watch::run(&desk, work)
}

/// Fails if no window can be opened on this machine.
pub(super) fn try_display() -> Outcome {
    window::try_display()
}

/// Maximum side of a window, as windowing systems and drivers accept it.
const MAX_SIDE: u32 = 16_384;

fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once(['x', '×']).map(|(w, h)| [w.parse().ok(), h.parse().ok()]);
    match sides {
        Some([Some(w), Some(h)]) if (1..=MAX_SIDE).contains(&w) && (1..=MAX_SIDE).contains(&h) => Ok([w, h]),
        _ => Err(format!("expected two numbers from 1 to {MAX_SIDE} such as 1280x720")),
    }
}

fn parse_axis(text: &str) -> Result<DVec3, String> {
    let (sign, axis) = text.strip_prefix('-').map_or((1.0, text), |axis| (-1.0, axis));
    match axis {
        "x" => Ok(sign * DVec3::X),
        "y" => Ok(sign * DVec3::Y),
        "z" => Ok(sign * DVec3::Z),
        _ => Err("expected x, -x, y, -y, z or -z".into()),
    }
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        if !self.device.twins.is_empty() {
            return Err(Error::Usage("--twin does not work in a window; use glint render".into()).into());
        }
        if !self.output.is_dir() {
            return Err(Error::input(&self.output, "is not a folder, expected a folder for screenshots").into());
        }
        writable(&self.output).map_err(|error| Error::input(&self.output, format!("cannot be written to: {error}")))?;
        let SceneFile { scene, trained_with, .. } = self.lenient.open_file(&self.scene)?;
        let (photos, draw) = (self.photos.like(trained_with, &self.scene), self.draw.like(trained_with, &self.scene));
        let dataset = self.dataset.as_deref().map(|path| photos.open(path)).transpose()?;
        let desk = Desk {
            device: &self.device,
            dataset: dataset.as_ref(),
            lenient: &self.lenient,
            policy: draw.policy(),
            background: photos.background(),
            size: self.size,
            up: self.up,
            folder: &self.output,
            file: &self.scene,
        };
        match window::run(&desk, scene)? {
            0 => Ok(()),
            count => Err(Failure::Validation(count)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_two_numbers() {
        assert_eq!(parse_size("64x48"), Ok([64, 48]));
        for bad in ["", "64", "0x4", "4x", "64x48x2", "-1x2", "99999x2"] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn an_axis_has_a_sign() {
        assert_eq!((parse_axis("z"), parse_axis("-y")), (Ok(DVec3::Z), Ok(DVec3::NEG_Y)));
        for bad in ["", "w", "--z", "zz", "+z"] {
            assert!(parse_axis(bad).is_err(), "{bad}");
        }
    }
}
