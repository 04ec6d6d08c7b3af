//! `glint export`: writes a scene as an HTML page for browsers.

use std::path::PathBuf;

use serde::Serialize;

use super::{
    DrawArgs, Outcome, PhotoArgs, SceneArgs, SplitArg, counted,
    output::{Inputs, OutputArgs, check_room},
    print, print_json,
};
use crate::{
    data::{SceneFile, write_text},
    pipelines::start::photos_of,
    report::viewer::Viewer,
};

const EXAMPLES: &str = "\
The page needs a browser with WebGPU or WebGL2 and nothing else: no network, no other files. It shows the base, the Gaussians \
with lobes or both, from any side, and from the cameras of the dataset if one is given. Positions are 32-bit floats, all else \
has 16, 15 or 8 bits: 80 bytes for a Gaussian of SH degree 3, 96 with a lobe, or 48 with a lobe and a single color. Encoding \
as text adds a third.

Settings after # in the page's address, joined by &, select its initial state: camera=NAME (or 18 numbers with commas between: \
width, height, fx, fy, cx, cy, the rotation from world to camera by rows, the translation), show=both|base|supplement, \
background=R,G,B, renderer=webgpu|webgl2. size=WIDTHxHEIGHT makes the page a still image of this size, the same every time. By \
default WebGPU draws if the browser runs it on a graphics device; a still image is drawn by WebGL2.

Examples:
  glint export --html augmented.html augmented.ply garden
  glint export --html base.html base.ply --background white
  xdg-open augmented.html
  chromium --headless --screenshot --window-size=640,480 'file:///tmp/augmented.html#camera=DSC01.JPG&size=640x480'";

/// Write a scene as an HTML page for browsers
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene to show
    scene: PathBuf,
    /// Folder or JSON file of a dataset; the page lists its cameras
    dataset: Option<PathBuf>,
    /// Output HTML file
    #[arg(long, value_name = "FILE.html")]
    html: PathBuf,
    /// Photos whose cameras the page lists
    #[arg(long, value_enum, default_value_t = SplitArg::All)]
    split: SplitArg,
    /// Print JSON
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
}

#[derive(Serialize)]
struct Report {
    gaussians: usize,
    supplementary: usize,
    sh_degree: u32,
    cameras: usize,
    /// Bytes before encoding as text.
    bytes_per_gaussian: usize,
    bytes_per_gaussian_with_lobe: usize,
    page_bytes: usize,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let SceneFile { scene, trained_with, .. } = self.lenient.open_file(&self.scene)?;
        let (photos, draw) = (self.photos.like(trained_with, &self.scene), self.draw.like(trained_with, &self.scene));
        let (background, policy) = (photos.background(), draw.policy());
        let dataset = self.dataset.as_ref().map(|path| photos.open(path)).transpose()?;
        let mut inputs = Inputs::default().scene(&self.scene);
        if let Some(dataset) = &dataset {
            inputs = inputs.dataset(dataset);
        }
        self.replace.check_file(&self.html, "html", "a page", &inputs)?;
        let photos = dataset.as_ref().map(|dataset| photos_of(dataset, self.split.split())).transpose()?;
        let photos = photos.unwrap_or_default();
        let viewer = Viewer {
            title: &self.scene.file_stem().unwrap_or_default().to_string_lossy(),
            scene: &scene,
            cameras: photos.iter().map(|photo| (&photo.name[..], photo.camera)).collect(),
            focus: dataset.as_ref().and_then(|dataset| dataset.focus()).map(|focus| focus.center),
            background,
            compensate: policy.compensate,
        };
        let page = viewer.page()?;
        check_room(&self.html, page.len() as u64, 0)?;
        write_text(&self.html, &page)?;
        let [plain, with_lobe] = viewer.bytes_per_gaussian();
        let report = Report {
            gaussians: scene.base.len(),
            supplementary: scene.supplement.as_ref().map_or(0, |s| s.gaussians.len()),
            sh_degree: scene.base.sh_degree,
            cameras: photos.len(),
            bytes_per_gaussian: plain,
            bytes_per_gaussian_with_lobe: with_lobe,
            page_bytes: page.len(),
        };
        match self.json {
            true => print_json(&report)?,
            false => print(self.text(&report))?,
        }
        Ok(())
    }

    fn text(&self, report: &Report) -> String {
        let &Report { gaussians, supplementary, sh_degree, cameras, page_bytes, .. } = report;
        let (path, megabytes) = (self.html.display(), page_bytes as f64 / 1e6);
        let mut text = format!("{path}: {} of {} bytes", counted(gaussians, "Gaussian"), report.bytes_per_gaussian);
        if supplementary > 0 {
            text += &format!(", {supplementary} with lobes of {} bytes", report.bytes_per_gaussian_with_lobe);
        }
        text + &format!(", SH degree {sh_degree}, {cameras} cameras, {megabytes:.3} MB\n")
    }
}
