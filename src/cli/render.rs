//! `glint render`: renders images of a scene from a dataset's cameras or along a camera path.

use std::{collections::HashMap, path::PathBuf};

use clap::ValueEnum;
use serde::Serialize;

use super::{
    DeviceArgs, DrawArgs, Outcome, PhotoArgs, SceneArgs, SplitArg, counted,
    names::stems,
    output::{Inputs, OutputArgs},
    picture::{Content, Format, Picture},
    print, print_json,
    progress::{Progress, note},
};
use crate::{
    Error, Result,
    data::{CameraPath, SceneFile},
    pipelines::{
        layers::{Layer, Layers},
        render::{RenderOptions, Rendered},
        start::photos_of,
    },
    report::decompose::decompose,
    scene::Camera,
};

const EXAMPLES: &str = "\
PNG, 8 bits:
  color, base        sRGB values, clamped
  diffuse, specular  sRGB values, clamped
  depth              gray by 1/depth, 1 % cut off at both ends of the view:
                     nearest white, farthest dark, no depth black
  transmittance      gray
EXR, 32-bit float:
  color, base        R G B, sRGB values, not clamped
  diffuse, specular  R G B, linear light, not clamped; they add up to the color
  depth              Z, camera z in scene units, 0 if there is none
  transmittance      Y

Depth is the distance at which half of the light is absorbed. Diffuse shows the base Gaussians with their constant SH band \
only, but at most the color; specular is the rest.

Files are named after the photos; folders in names are joined with `_`. Every file appears whole or not at all. Existing files \
are replaced only with --force.

K and Shift-K in `glint view` save a camera path. The camera moves smoothly through its poses (Catmull-Rom splines, rotations \
along great circles). Frames are evenly spaced; frame-00001 is the first pose.

Examples:
  glint render augmented.ply garden -o views
  glint render augmented.ply garden -o depth --what depth --format exr
  glint render augmented.ply --path augmented-path-1.json -o frames --frames 240";

/// Maximum number of frames; their names have five digits.
const MAX_FRAMES: i64 = 99_999;

/// Render the views of a dataset, or frames along a camera path
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene to render
    scene: PathBuf,
    /// Folder or JSON file of the dataset with the cameras
    #[arg(required_unless_present = "path", conflicts_with = "path")]
    dataset: Option<PathBuf>,
    /// JSON file of a camera path, instead of a dataset's cameras
    #[arg(long, value_name = "FILE")]
    path: Option<PathBuf>,
    /// Number of frames along the path
    #[arg(long, value_name = "N", requires = "path", default_value_t = 120, value_parser = clap::value_parser!(u32).range(1..=MAX_FRAMES))]
    frames: u32,
    /// Output folder for the images; created if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Photos whose cameras are rendered
    #[arg(long, value_enum, default_value_t = SplitArg::Test)]
    split: SplitArg,
    /// Image content
    #[arg(long, value_enum, default_value_t = What::Color)]
    what: What,
    /// File format
    #[arg(long, value_enum, default_value_t = Format::Png)]
    format: Format,
    /// Take depth at the center of the median Gaussian, instead of at the Gaussian's maximum along the ray
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
    /// Only the base Gaussians, as stored in this file
    Base,
    /// Distance at which half of the light is absorbed
    Depth,
    /// Share of light from behind the scene
    Transmittance,
    /// Part that looks the same from every direction
    Diffuse,
    /// The rest: color minus diffuse
    Specular,
}

/// View to render.
struct Shot {
    name: String,
    camera: Camera,
    /// Name in the output folder.
    file: String,
}

/// View and its file, for `--json`.
#[derive(Serialize)]
struct Written<'a> {
    name: &'a str,
    file: String,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let SceneFile { scene, trained_with, .. } = self.lenient.open_file(&self.scene)?;
        let (photos, draw) = (self.photos.like(trained_with, &self.scene), self.draw.like(trained_with, &self.scene));
        let path = self.scene.display();
        match (&scene.supplement, self.what) {
            (None, What::Specular) if scene.base.sh_degree == 0 => {
                let what = "looks the same from everywhere (SH degree 0, no supplement), so it has no specular part";
                return Err(Error::Usage(format!("{path}: {what}; render its color")).into());
            }
            (None, What::Base) => note(format!("{path} has no supplement: its base is the whole scene")),
            _ => {}
        }
        let (shots, inputs) = self.shots(&photos)?;
        let names = shots.iter().map(|shot| &shot.file[..]);
        self.replace.check_files(&self.output, names, &inputs)?;
        self.replace.make_folder(&self.output, &inputs)?;

        let written = self.device.with(|context| {
            let options = RenderOptions {
                depth: self.what == What::Depth,
                centre_depth: self.centre_depth,
                policy: draw.policy(),
                ..Default::default()
            };
            let mut layers = Layers::new(context, &scene, shots.iter().map(|shot| &shot.camera), options)?;
            let progress = Progress::new("rendering", "views", shots.len() as u64);
            let mut written = Vec::with_capacity(shots.len());
            for Shot { name, camera, file } in &shots {
                let path = self.output.join(file);
                self.view(&mut layers, camera, photos.background())?.write(&path, self.format)?;
                written.push(Written { name, file: path.to_string_lossy().into_owned() });
                progress.set(written.len() as u64);
            }
            Ok(written)
        })?;
        if self.json {
            print_json(&written)?;
        } else {
            let what = self.what.to_possible_value().map_or(String::new(), |v| v.get_name().to_owned());
            print(format_args!("{}: {} ({what})\n", self.output.display(), counted(written.len(), "view")))?;
        }
        Ok(())
    }

    /// Views to render, and the files that were read for them.
    fn shots(&self, photos: &PhotoArgs) -> Result<(Vec<Shot>, Inputs)> {
        let extension = if self.format == Format::Png { "png" } else { "exr" };
        let inputs = Inputs::default().scene(&self.scene);
        if let Some(path) = &self.path {
            let cameras = CameraPath::read(path)?.frames(self.frames as usize);
            let shot = |(i, camera)| {
                let name = format!("frame-{i:05}");
                Shot { file: format!("{name}.{extension}"), name, camera }
            };
            return Ok(((1..).zip(cameras).map(shot).collect(), inputs.scene(path)));
        }
        let Some(dataset) = &self.dataset else {
            return Err(Error::Usage("expected a dataset or --path, for the cameras".into()));
        };
        let dataset = photos.open(dataset)?;
        // Named over all photos, so that a photo's file has the same name for every split.
        let names = stems(&dataset.photos).into_iter().map(|stem| format!("{stem}.{extension}"));
        let files: HashMap<&str, String> = dataset.photos.iter().map(|p| &p.name[..]).zip(names).collect();
        let shots = photos_of(&dataset, self.split.split())?.into_iter().map(|photo| Shot {
            name: photo.name.clone(),
            camera: photo.camera,
            file: files[&photo.name[..]].clone(),
        });
        Ok((shots.collect(), inputs.dataset(&dataset)))
    }

    fn view(&self, layers: &mut Layers, camera: &Camera, background: [f32; 3]) -> Result<Picture> {
        let mut render = |layer| layers.render(layer, camera, background);
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
