use std::{collections::HashMap, path::PathBuf};

use clap::ValueEnum;
use serde::Serialize;

use super::{
    DeviceArgs, DrawArgs, Outcome, PhotoArgs, SceneArgs, SplitArg,
    names::stems,
    output::{Inputs, OutputArgs},
    print, print_json,
    progress::{Progress, note},
};
use crate::{
    Error, Result,
    data::{write_exr_channel, write_exr_rgb, write_png_gray, write_png_rgb},
    pipelines::{
        layers::{Layer, Layers},
        render::{RenderOptions, Rendered},
        start::photos_of,
    },
    report::decompose::{decompose, srgb_from_linear},
    scene::Camera,
};

const EXAMPLES: &str = "\
PNG, 8 bits:
  color, base        sRGB values, clamped
  diffuse, specular  sRGB values, clamped
  depth              grey by 1/depth, 1 % cut off at either end of the view:
                     nearest white, farthest dark, none black
  transmittance      grey
EXR, 32-bit float:
  color, base        R G B, sRGB values, not clamped
  diffuse, specular  R G B, linear light, not clamped; they add up to the color
  depth              Z, camera z in scene units, 0 where there is none
  transmittance      Y

Depth is where half of the light is absorbed. Diffuse is what the base Gaussians show with their constant SH band \
only, but nowhere more than the color; specular is the rest.

Files are named after the photos, folders in their names joined with `_`. Every file appears whole or not at all, and \
none that is there is replaced without --force.

Examples:
  glint render augmented.ply garden -o views
  glint render augmented.ply garden -o depth --what depth --format exr";

/// Render the views of a dataset
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene
    scene: PathBuf,
    /// Folder or JSON file of the dataset whose cameras are used
    dataset: PathBuf,
    /// Folder for the images; created if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Photos whose cameras are used
    #[arg(long, value_enum, default_value_t = SplitArg::Test)]
    split: SplitArg,
    /// What to show
    #[arg(long, value_enum, default_value_t = What::Color)]
    what: What,
    /// Kind of file
    #[arg(long, value_enum, default_value_t = Format::Png)]
    format: Format,
    /// Depth is that of the median Gaussian's centre, instead of the Gaussian's maximum along the ray
    #[arg(long)]
    centre_depth: bool,
    /// Print JSON: [{"name","file"}]
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    replace: OutputArgs,
    #[command(flatten)]
    lenient: SceneArgs,
    #[command(flatten)]
    photos: PhotoArgs,
    #[command(flatten)]
    draw: DrawArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum What {
    /// The whole scene
    Color,
    /// The base Gaussians alone, as they are stored in this file
    Base,
    /// Distance at which half of the light is absorbed
    Depth,
    /// The share of light from behind the scene
    Transmittance,
    /// What looks the same from every direction
    Diffuse,
    /// The rest: color minus diffuse
    Specular,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Png,
    Exr,
}

/// A view and its file.
#[derive(Serialize)]
struct Written<'a> {
    name: &'a str,
    file: String,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let scene = self.lenient.open(&self.scene)?;
        let path = self.scene.display();
        match (&scene.supplement, self.what) {
            (None, What::Specular) if scene.base.sh_degree == 0 => {
                let what = "looks the same from everywhere (SH degree 0, no supplement), so it has no specular part";
                return Err(Error::Usage(format!("{path}: {what}; render its color")).into());
            }
            (None, What::Base) => note(format!("{path} has no supplement: its base is all there is")),
            _ => {}
        }
        let dataset = self.photos.open(&self.dataset)?;
        let photos = photos_of(&dataset, self.split.split())?;
        // Over all photos, so that a photo's file has the same name whatever the split.
        let extension = if self.format == Format::Png { "png" } else { "exr" };
        let names = stems(&dataset.photos).into_iter().map(|stem| format!("{stem}.{extension}"));
        let files: HashMap<&str, String> = dataset.photos.iter().map(|p| &p.name[..]).zip(names).collect();
        let inputs = Inputs::default().scene(&self.scene).dataset(&dataset);
        let names = photos.iter().map(|photo| &files[&photo.name[..]][..]);
        self.replace.check_files(&self.output, names, &inputs)?;
        self.replace.make_folder(&self.output, &inputs)?;

        let written = self.device.with(|context| {
            let options = RenderOptions {
                depth: self.what == What::Depth,
                centre_depth: self.centre_depth,
                policy: self.draw.policy(),
                ..Default::default()
            };
            let mut layers = Layers::new(context, &scene, photos.iter().map(|p| &p.camera), options)?;
            let progress = Progress::new("rendering", "views", photos.len() as u64);
            let mut written = Vec::with_capacity(photos.len());
            for photo in &photos {
                let path = self.output.join(&files[&photo.name[..]]);
                self.view(&mut layers, &photo.camera)?.write(&path, self.format)?;
                written.push(Written { name: &photo.name, file: path.to_string_lossy().into_owned() });
                progress.set(written.len() as u64);
            }
            Ok(written)
        })?;
        if self.json {
            print_json(&written)?;
        } else {
            let what = self.what.to_possible_value().map_or(String::new(), |v| v.get_name().to_owned());
            print(format_args!("{}: {} views ({what})\n", self.output.display(), written.len()))?;
        }
        Ok(())
    }

    fn view(&self, layers: &mut Layers, camera: &Camera) -> Result<Picture> {
        let mut render = |layer| layers.render(layer, camera, self.photos.background);
        let Rendered { width, height, color, transmittance, depth } =
            render(if self.what == What::Base { Layer::Base } else { Layer::Whole })?;
        let content = match self.what {
            What::Color | What::Base => Content::Srgb(color),
            What::Depth => Content::Depth(depth),
            What::Transmittance => Content::Grey(transmittance),
            What::Diffuse => Content::Linear(decompose(&color, &render(Layer::Constant)?.color).diffuse),
            What::Specular => Content::Linear(decompose(&color, &render(Layer::Constant)?.color).specular),
        };
        Ok(Picture { width, height, content })
    }
}

/// A picture before it becomes a file.
struct Picture {
    width: u32,
    height: u32,
    content: Content,
}

enum Content {
    /// sRGB values, interleaved.
    Srgb(Vec<f32>),
    /// Linear light, interleaved.
    Linear(Vec<f32>),
    Grey(Vec<f32>),
    /// Camera z, 0 where there is none.
    Depth(Vec<f32>),
}

impl Picture {
    fn write(&self, path: &std::path::Path, format: Format) -> Result<()> {
        let (width, height) = (self.width, self.height);
        match (&self.content, format) {
            (Content::Srgb(rgb) | Content::Linear(rgb), Format::Exr) => write_exr_rgb(path, width, height, rgb),
            (Content::Srgb(rgb), Format::Png) => write_png_rgb(path, width, height, rgb),
            (Content::Linear(rgb), Format::Png) => {
                let encoded: Vec<f32> = rgb.iter().map(|&v| srgb_from_linear(v)).collect();
                write_png_rgb(path, width, height, &encoded)
            }
            (Content::Grey(values), Format::Exr) => write_exr_channel(path, width, height, "Y", values),
            (Content::Grey(values), Format::Png) => write_png_gray(path, width, height, values),
            (Content::Depth(values), Format::Exr) => write_exr_channel(path, width, height, "Z", values),
            (Content::Depth(values), Format::Png) => write_png_gray(path, width, height, &depth_grey(values)),
        }
    }
}

/// Grey of the farthest depth: dark, but not the black of no depth.
const FARTHEST_GREY: f32 = 0.1;

/// Depths as grey, linear in 1/depth between the 1st and the 99th percentile of the view.
fn depth_grey(depths: &[f32]) -> Vec<f32> {
    let mut near: Vec<f32> = depths.iter().filter(|&&z| z > 0.0).map(|z| 1.0 / z).collect();
    near.sort_unstable_by(f32::total_cmp);
    let at = |p: f64| near[(p * (near.len() - 1) as f64).round() as usize];
    let (low, high) = if near.is_empty() { (0.0, 1.0) } else { (at(0.01), at(0.99)) };
    let grey = |z: f32| {
        // A view of one depth only is white.
        let t = if high > low { ((1.0 / z - low) / (high - low)).clamp(0.0, 1.0) } else { 1.0 };
        FARTHEST_GREY + (1.0 - FARTHEST_GREY) * t
    };
    depths.iter().map(|&z| if z > 0.0 { grey(z) } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_white_near_dark_far_and_black_where_there_is_none() {
        let mut depths: Vec<f32> = (0..1000).map(|i| 1.0 + i as f32 * 0.01).collect();
        depths.push(0.0);
        let grey = depth_grey(&depths);
        assert_eq!((grey[0], grey[999], grey[1000]), (1.0, FARTHEST_GREY, 0.0));
        assert!(grey[..1000].is_sorted_by(|a, b| a >= b));
        assert_eq!(depth_grey(&[2.0, 0.0]), [1.0, 0.0]);
        assert_eq!(depth_grey(&[0.0]), [0.0]);
        assert!(depth_grey(&[]).is_empty());
    }
}
