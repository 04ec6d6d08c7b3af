//! `glint report`: writes a page that compares scenes with the photos of a dataset and with one another.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use image::RgbImage;
use serde::{Deserialize, Serialize};

use super::{
    DeviceArgs, DrawArgs, Outcome, PhotoArgs, SceneArgs, SplitArg,
    dataset::note_uncounted,
    output::{Inputs, OutputArgs},
    print,
    progress::Progress,
    to_json,
};
use crate::{
    Error, Result,
    data::{
        DIFFUSE, Photo, SPECULAR, counted,
        plan::{Plan, is_plan},
        to_byte, write_text,
    },
    gpu::Context,
    pipelines::{layers::Layers, render::RenderOptions, spend::Spending, start::photos_of},
    report::{
        decompose::{PartsQuality, judge, linear_from_srgb, srgb_from_linear},
        evaluate::{evaluate, render_parts},
        history::{Record, read_history},
        page::{Entry, EntryView, SPECULAR_GAIN, Truth, page},
        parts,
        pictures::{data_of, pictures},
        runs::{PHASES, Run, StageMean},
        table::{Cell, Column, Table},
    },
    scene::Scene,
};

pub(super) const PAGE: &str = "index.html";
pub(super) const NUMBERS: &str = "report.json";

const EXAMPLES: &str = "\
Writes a single page, DIR/index.html, without other files: for each photo the renders of all scenes with a slider, their \
errors, and the diffuse and specular light of augmented scenes; tables; and with --history work-precision curves. Gains are \
over the first scene. For datasets of glint synth, the page shows the true diffuse and specular light next to those of every \
scene, with their PSNR. DIR/report.json has the numbers.

A history file has a JSON object on each line: \
{\"name\",\"seconds\",\"bytes\",\"gaussians\",\"psnr\",\"ssim\",\"seed\",\"holdout\"}, and \"base_psnr\" if the PSNR of its \
base is known. Lines with the same name and seed are one run; runs that differ in the seed are shown with their mean and \
spread. --run adds the output of `glint train --json` or `glint enhance --json`: times of stages, memory, and the plan of an \
augmentation, under the name of the scene that it made.

With a plan of glint partition and no scenes, the page shows its parts from above, and their sizes.

Examples:
  glint report garden augmented=augmented.ply -o compared    # then open compared/index.html
  glint report garden base=base.ply augmented=augmented.ply -o compared
  glint report garden base=base.ply plain=plain.ply augmented=augmented.ply -o compared --history runs.jsonl
  glint report city.plan.json -o parts";

/// Scene and its name on the page.
#[derive(Debug, Clone)]
struct Named {
    name: String,
    path: PathBuf,
}

fn parse_named(text: &str) -> Result<Named, String> {
    match text.split_once('=') {
        Some((name, path)) if !name.is_empty() && !path.is_empty() => {
            Ok(Named { name: name.into(), path: path.into() })
        }
        _ => Err("expected a name and a scene, such as base=base.ply".into()),
    }
}

/// Compare scenes with a dataset's photos on one page
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES, mut_args(|arg| match arg.get_id().as_str() {
    "dataset" | "scenes" | "output" | "force" => arg,
    // The page of a plan has no use for them.
    _ => arg.requires("scenes"),
}))]
pub(super) struct Args {
    /// Folder or JSON file of the dataset, or a plan of glint partition
    dataset: PathBuf,
    /// Scenes, each with a name; none for a plan
    #[arg(value_name = "NAME=SCENE", value_parser = parse_named)]
    scenes: Vec<Named>,
    /// Output folder for the page; created if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Measurements of runs as JSON lines, for curves. May be given several times
    #[arg(long, value_name = "FILE")]
    history: Vec<PathBuf>,
    /// Output of `glint train --json` or `glint enhance --json`, for times, memory and plan. May be given
    /// several times
    #[arg(long, value_name = "FILE", alias = "plan")]
    run: Vec<PathBuf>,
    /// Photos to compare with
    #[arg(long, value_enum, default_value_t = SplitArg::Test)]
    split: SplitArg,
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

#[derive(Serialize)]
struct Numbers<'a> {
    scenes: &'a [Entry],
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        if self.scenes.is_empty() {
            return Ok(self.show_plan()?);
        }
        if let Some(twice) =
            self.scenes.iter().enumerate().find(|(i, a)| self.scenes[..*i].iter().any(|b| a.name == b.name))
        {
            return Err(
                Error::Usage(format!("two scenes are named `{}`, expected different names", twice.1.name)).into()
            );
        }
        let files = self.scenes.iter().map(|named| self.lenient.open_file(&named.path)).collect::<Result<Vec<_>>>()?;
        // Settings of the first scene count; a note reports contradictions in the others.
        let (mut photos, mut draw) = (self.photos.clone(), self.draw);
        for (file, Named { path, .. }) in files.iter().zip(&self.scenes) {
            (photos, draw) = (photos.like(file.trained_with, path), draw.like(file.trained_with, path));
        }
        let told = self.run.iter().map(|path| read_run(path, &self.scenes)).collect::<Result<Vec<_>>>()?;
        let history = self.history.iter().map(read_history).collect::<Result<Vec<_>>>()?.concat();
        let dataset = photos.open(&self.dataset)?;
        let photos = photos_of(&dataset, self.split.split())?;
        let read = self.scenes.iter().map(|named| &named.path).chain(&self.history).chain(&self.run);
        let inputs = read.fold(Inputs::default().dataset(&dataset), |inputs, path| inputs.scene(path));
        self.replace.check_files(&self.output, [PAGE, NUMBERS], &inputs)?;
        self.replace.make_folder(&self.output, &inputs)?;
        let sizes = self.scenes.iter().map(|Named { path, .. }| fs::metadata(path).map_err(|e| Error::io(path, e)));
        let sizes = sizes.map(|found| found.map(|found| found.len())).collect::<Result<Vec<_>>>()?;
        let scenes = self.scenes.iter().zip(&files).zip(sizes);
        let scenes: Vec<Shown> =
            scenes.map(|((named, file), bytes)| Shown { name: &named.name, scene: &file.scene, bytes }).collect();
        let options = RenderOptions { policy: draw.policy(), ..Default::default() };
        let compared =
            self.device.with(|context| Ok(compare(context, &scenes, &photos, options, dataset.background)?))?;
        compared.write(&self.output, &self.dataset.display().to_string(), &history, &told)?;
        Ok(print(compared.table())?)
    }

    /// Writes the page of a plan.
    fn show_plan(&self) -> Result<()> {
        let path = &self.dataset;
        if !path.is_file() || !is_plan(path)? {
            let what = "is not a plan of glint partition; expected one, or scenes to compare (NAME=SCENE)";
            return Err(Error::input(path, what));
        }
        let plan = Plan::read(path)?;
        let dataset = plan.open_all(path)?;
        let inputs = Inputs::default().dataset(&dataset).scene(path);
        self.replace.check_files(&self.output, [PAGE], &inputs)?;
        self.replace.make_folder(&self.output, &inputs)?;
        let title = format!("{} of {}", counted(plan.parts.len(), "part"), plan.dataset.display());
        write_text(self.output.join(PAGE), &parts::page(&title, &plan, &dataset)?)
    }
}

/// Reads the output of `train --json` or `enhance --json`, and names it after the one of `scenes` that it
/// made.
fn read_run(path: &Path, scenes: &[Named]) -> Result<Run> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Seconds {
        All(f64),
        Phases(BTreeMap<String, f64>),
    }
    #[derive(Deserialize)]
    struct Printed {
        output: String,
        seconds: Seconds,
        plan: Option<Spending>,
        #[serde(default)]
        stages: Vec<StageMean>,
        device_megabytes: Option<f64>,
    }
    let text = fs::read(path).map_err(|e| Error::io(path, e))?;
    let Printed { output, seconds, plan, stages, device_megabytes } = serde_json::from_slice(&text).map_err(|e| {
        Error::input(path, format!("is not the output of `glint train --json` or `glint enhance --json`: {e}"))
    })?;
    let phases = match seconds {
        Seconds::All(seconds) => vec![("training".into(), seconds)],
        Seconds::Phases(all) => {
            let phases = PHASES.iter().map(|&(key, name)| (name.to_owned(), all.get(key).copied().unwrap_or(0.0)));
            phases.filter(|(_, seconds)| *seconds > 0.0).collect()
        }
    };
    Ok(Run { name: name_of(&output, scenes), plan, phases, stages, device_megabytes })
}

/// Name of the scene that a run wrote to `output`, found by its path. If that file is gone, the scene is
/// found by its file name if only one has it. Otherwise, returns `output` itself.
fn name_of(output: &str, scenes: &[Named]) -> String {
    let whole = |path: &Path| fs::canonicalize(path).ok();
    let written = whole(Path::new(output));
    let same = |named: &&Named| written.is_some() && whole(&named.path) == written;
    let mut alike = scenes.iter().filter(|named| named.path.file_name() == Path::new(output).file_name());
    let only = alike.next().filter(|_| written.is_none() && alike.next().is_none());
    scenes.iter().find(same).or(only).map_or_else(|| output.to_owned(), |named| named.name.clone())
}

/// Scene to show on a page.
pub(super) struct Shown<'a> {
    pub(super) name: &'a str,
    pub(super) scene: &'a Scene,
    /// Size of its file, bytes.
    pub(super) bytes: u64,
}

/// Result of comparing scenes with photos.
pub(super) struct Compared {
    truths: Vec<Truth>,
    pub(super) entries: Vec<Entry>,
}

pub(super) fn compare(
    context: &Context,
    scenes: &[Shown],
    photos: &[&Photo],
    options: RenderOptions,
    background: [f32; 3],
) -> Result<Compared> {
    let progress = Progress::new("comparing", "views", (photos.len() * scenes.len()) as u64);
    let mut found = Compared { truths: Vec::new(), entries: Vec::new() };
    for shown in scenes {
        // The photos are the same for every scene.
        found.truths.clear();
        found.entries.push(entry(context, shown, photos, options, background, &progress, &mut found.truths)?);
    }
    note_uncounted(photos.len() - found.truths.len());
    Ok(found)
}

impl Compared {
    /// Writes the page and its numbers into the folder `output`.
    pub(super) fn write(&self, output: &Path, dataset: &str, history: &[Record], told: &[Run]) -> Result<()> {
        let names: Vec<&str> = self.entries.iter().map(|entry| &entry.name[..]).collect();
        let title = format!("{} on {dataset}", names.join(", "));
        write_text(output.join(NUMBERS), &to_json(&Numbers { scenes: &self.entries })?)?;
        write_text(output.join(PAGE), &page(&title, &self.truths, &self.entries, history, told)?)
    }

    fn table(&self) -> Table {
        let mut table = Table::new([
            Column::new("scene", "", 0),
            Column::new("Gaussians", "", 0),
            Column::new("with lobes", "", 0),
            Column::new("bytes", "", 0),
            Column::new("PSNR", "dB", 2),
            Column::new("SSIM", "", 4),
        ]);
        for Entry { name, gaussians, supplementary, bytes, mean, .. } in &self.entries {
            let counts = [*gaussians as u64, *supplementary as u64, *bytes].map(Cell::Count);
            table.row(std::iter::once(Cell::from(&name[..])).chain(counts).chain([mean.psnr.into(), mean.ssim.into()]));
        }
        table
    }
}

/// Compares `shown` with all `photos`. Adds photos and known true parts to `truths`.
fn entry(
    context: &Context,
    shown: &Shown,
    photos: &[&Photo],
    options: RenderOptions,
    background: [f32; 3],
    progress: &Progress,
    truths: &mut Vec<Truth>,
) -> Result<Entry> {
    let &Shown { name, scene, bytes } = shown;
    let supplementary = scene.supplement.as_ref().map_or(0, |s| s.gaussians.len());
    let cameras = || photos.iter().map(|photo| &photo.camera);
    let known = photos.iter().map(|photo| true_parts(photo)).collect::<Result<Vec<_>>>()?;
    // A plain scene is split into its parts only if there are true parts to compare with.
    let apart = supplementary > 0 || known.iter().any(Option::is_some);
    let mut layers = apart.then(|| Layers::new(context, scene, cameras(), options)).transpose()?;
    let mut views = Vec::with_capacity(photos.len());
    let found = evaluate(context, scene, photos, options, background, |view| {
        progress.advance();
        let [photo, render, error] = pictures(view);
        let mut truth = Truth { photo: data_of(&photo)?, parts: None };
        let mut own = vec![("render", data_of(&render)?), ("error", data_of(&error)?)];
        let mut scores = None;
        if let Some(layers) = &mut layers {
            let size = (view.truth.width, view.truth.height);
            let parts = render_parts(layers, view.photo, background)?;
            own.push(("diffuse", light(&parts.diffuse, 1.0, size)?));
            own.push(("specular", light(&parts.specular, SPECULAR_GAIN, size)?));
            if let Some([diffuse, specular]) = true_parts(view.photo)? {
                let (diffuse, specular) = (diffuse.load(background)?, specular.load(background)?);
                let judged = judge(&parts, &diffuse.rgb, &specular.rgb, diffuse.mask.as_deref());
                let named = |error| Error::Usage(format!("photo `{}`: {error}", view.photo.name));
                scores = Some(judged.map_err(named)?);
                let linear =
                    |rgb: &[u8]| rgb.iter().map(|&v| linear_from_srgb(f32::from(v) / 255.0)).collect::<Vec<_>>();
                truth.parts = Some([
                    light(&linear(&diffuse.rgb), 1.0, size)?,
                    light(&linear(&specular.rgb), SPECULAR_GAIN, size)?,
                ]);
            }
        }
        truths.push(truth);
        let name = view.photo.name.clone();
        views.push(EntryView { name, quality: view.quality.augmented, parts: scores, pictures: own });
        Ok(())
    })?;
    // A mean over a part of the views would not be comparable.
    let judged = views.iter().map(|view| view.parts).collect::<Option<Vec<_>>>();
    let parts = judged.and_then(|judged| PartsQuality::mean(&judged));
    let gaussians = scene.base.len() + supplementary;
    Ok(Entry { name: name.into(), gaussians, supplementary, bytes, mean: found.augmented, parts, views })
}

/// True diffuse and specular parts of a photo, if both exist.
fn true_parts(photo: &Photo) -> Result<Option<[Photo; 2]>> {
    Ok(photo.part(DIFFUSE)?.zip(photo.part(SPECULAR)?).map(<[Photo; 2]>::from))
}

/// Encodes a picture of linear light, `gain` times as bright, in pixels.
fn light(linear: &[f32], gain: f32, (width, height): (u32, u32)) -> Result<String> {
    let bytes = linear.iter().map(|&v| to_byte(srgb_from_linear(gain * v))).collect();
    data_of(&RgbImage::from_vec(width, height, bytes).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_has_a_name_and_a_path() {
        let named = parse_named("more steps=a=b.ply").unwrap();
        assert_eq!((&named.name[..], named.path), ("more steps", PathBuf::from("a=b.ply")));
        assert!(["base.ply", "=base.ply", "base="].iter().all(|text| parse_named(text).is_err()));
    }

    #[test]
    fn a_run_has_the_name_of_the_scene_that_it_made() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        for place in ["a", "b"] {
            fs::create_dir(path(place)).unwrap();
            fs::write(path(&format!("{place}/out.ply")), "").unwrap();
        }
        let named = |name: &str, file: &str| Named { name: name.into(), path: path(file).into() };
        let scenes = [named("pursuit", "a/out.ply"), named("plain", "b/out.ply"), named("base", "b/base.ply")];
        fs::write(path("base.ply"), "").unwrap();
        // Found by its path, in any spelling, or by a unique file name if the path is gone. A name that
        // several scenes or an existing file have does not count.
        let of = |output: &str| name_of(output, &scenes);
        assert_eq!([of(&path("a/../b/out.ply")), of("/gone/base.ply")], ["plain", "base"]);
        assert_eq!([of("/gone/out.ply"), of("/gone/other.ply")], ["/gone/out.ply", "/gone/other.ply"]);
        assert_eq!(of(&path("base.ply")), path("base.ply"));
    }
}
