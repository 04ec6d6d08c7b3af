//! Options shared by all commands that read a dataset.

use std::{
    ffi::OsString,
    path::{Path, PathBuf},
};

use clap::{Args, ValueEnum};
use glam::DVec3;

use super::progress::{Progress, note};
use crate::{
    Error, Result,
    data::{
        Alpha, Dataset, DatasetOptions, Holdout, NEAR, Photo, PixelSource, Reduce, Split, TrainedWith, counted,
        plan::{Plan, is_plan},
    },
    gpu::Context,
    pipelines::{photographs::Storage, start::store_photos, views::Views},
    report::summary::DatasetSummary,
};

/// Options that select the parts of a dataset.
#[derive(Debug, Clone, Args)]
pub(super) struct DatasetArgs {
    /// Folder of the photos: a path, or a name in the dataset [default: the dataset's own folder, else
    /// images, input, images_2, images_4 or images_8]
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,
    /// Folder of the COLMAP model: a path, or a name in the dataset [default: the first of sparse/0,
    /// sparse, the dataset, sparse/1 and on, colmap/sparse/0 and the like]
    #[arg(long, value_name = "DIR")]
    model: Option<PathBuf>,
    /// Test photos: every N-th by name, from the first on; sector, a contiguous eighth of the cameras (by
    /// angle in an orbit, else one end of their largest spread); or none [default: as the dataset says,
    /// else 8]
    #[arg(long, alias = "test-every", value_name = "N|sector|none")]
    holdout: Option<Holdout>,
    /// Choose settings without the test photos: leave these out and test on every 8th of the others
    #[arg(long)]
    tune: bool,
    /// Meaning of transparent pixels in photos
    #[arg(long, value_enum, default_value_t)]
    alpha: Alpha,
    /// The dataset is a plan of glint partition: read this part of it, from 0. The plan decides all other
    /// options of the dataset
    #[arg(long, value_name = "N", conflicts_with_all = ["images", "model", "holdout", "tune", "alpha"])]
    part: Option<u32>,
}

impl DatasetArgs {
    /// Adds these options.
    fn options(&self, options: DatasetOptions) -> DatasetOptions {
        DatasetOptions {
            images: self.images.clone(),
            model: self.model.clone(),
            holdout: self.holdout.unwrap_or_default(),
            tune: self.tune,
            alpha: self.alpha,
            ..options
        }
    }

    /// Reads the dataset, or the part of a plan, and prints its notes. Returns it with the options that it was read with, which are the
    /// plan's for a part.
    pub(super) fn open(&self, path: &Path, options: DatasetOptions) -> Result<(Dataset, DatasetOptions)> {
        let (dataset, options) = match self.part {
            Some(part) => {
                let plan = Plan::read(path)?;
                (plan.open(path, part)?, plan.options)
            }
            None if path.is_file() && is_plan(path)? => {
                let parts = Plan::read(path)?.parts.len();
                let what = format!("is a plan of {}: --part N names one", counted(parts, "part"));
                return Err(Error::input(path, what));
            }
            None => {
                let options = self.options(options);
                (Dataset::open(path, &options)?, options)
            }
        };
        let found = DatasetSummary::of(&dataset);
        for size in &found.sizes {
            tracing::info!("{} photos of {} × {}", size.photos, size.width, size.height);
        }
        let (points, extent) = (found.points.unwrap_or(0), found.extent);
        tracing::info!("{} dataset: {} train, {} test, {points} points", found.format, found.train, found.test);
        tracing::info!("cameras within {:.4} scene units of their middle", extent / 1.1);
        if let (Some(center), Some(radius)) = (found.focus_center, found.focus_radius) {
            tracing::info!("they look at {center:.3?} from {radius:.3} away");
        }
        dataset.notes.iter().for_each(|text| note(text.as_str()));
        Ok((dataset, options))
    }
}

/// Stores photos for training. Returns their views and the checksum of each as uploaded: after lens, mask
/// and downscaling.
pub(super) fn upload(
    context: &Context,
    photos: &[&Photo],
    background: [f32; 3],
    halvings: u32,
    storage: Storage,
    transparent: bool,
) -> Result<(Views, Vec<u32>)> {
    let reading = Progress::new("reading", "photos", photos.len() as u64);
    let (mut checksums, mut uncounted) = (Vec::with_capacity(photos.len()), 0);
    let views = store_photos(context, photos, background, halvings, storage, transparent, |done, words| {
        checksums.push(crc32fast::hash(bytemuck::cast_slice(words)));
        uncounted += usize::from(words.iter().all(|pixel| pixel >> 24 == 0));
        reading.set(done as u64);
    })?;
    drop(reading);
    note_uncounted(uncounted);
    Ok((views, checksums))
}

/// Prints a note with the number of photos left out.
pub(super) fn note_uncounted(photos: usize) {
    if photos > 0 {
        let s = if photos == 1 { "" } else { "s" };
        note(format!("{photos} photo{s} left out: masks leave out every pixel"));
    }
}

/// Fails if no training photo sees any of these Gaussians, since a run would learn nothing. Prints a note
/// if some photos see none.
pub(super) fn check_sight(dataset: &Dataset, origin: DVec3, gaussians: &[[f32; 3]]) -> Result<()> {
    let (seeing, all) = (dataset.seeing(origin, gaussians), dataset.split(Split::Train).count());
    if seeing == 0 && !gaussians.is_empty() {
        return Err(Error::Usage(format!(
            "no training photo sees a Gaussian: all {} are behind the cameras, outside their images, or nearer than \
             the near plane at {NEAR} scene units (the cameras are within {:.3e} of their middle); check the dataset's \
             scale, and that the scene belongs to it",
            gaussians.len(),
            dataset.extent() / 1.1
        )));
    }
    if seeing < all {
        note(format!("{} of {all} training photos see no Gaussian", all - seeing));
    }
    Ok(())
}

/// Minimum PSNR of a scene on its own photos, dB. Scenes of other datasets and gray pictures have less.
const FOREIGN_DB: f64 = 12.0;
/// That limit as a mean loss, 0.8 L1 + 0.2 (1 − SSIM). At 12 dB the mean L1 is 0.15 to 0.25, with almost no
/// structure.
const FOREIGN_LOSS: f64 = 0.3;

/// Prints a note if a scene seems to belong to other photos.
pub(super) fn note_foreign(scene: &Path, psnr: f64) {
    if psnr < FOREIGN_DB {
        note_if_foreign(scene, format_args!("{psnr:.1} dB"));
    }
}

/// Prints such a note for a base before its augmentation.
pub(super) fn note_foreign_base(scene: &Path, losses: &[f64]) {
    let loss = losses.iter().sum::<f64>() / losses.len().max(1) as f64;
    if loss > FOREIGN_LOSS {
        note_if_foreign(scene, format_args!("a mean loss of {loss:.2}"));
    }
}

fn note_if_foreign(scene: &Path, found: std::fmt::Arguments<'_>) {
    note(format!(
        "{} has {found} on these photos, like a scene of another dataset: check the dataset, its scale and \
         --background; --max-size and --compensate must be as in training",
        scene.display()
    ));
}

/// Options that control how photos are prepared.
#[derive(Debug, Clone, Args)]
pub(super) struct PhotoArgs {
    #[command(flatten)]
    dataset: DatasetArgs,
    /// Downscale photos to at most this many pixels on the longer side. If images_2, images_4 or images_8
    /// holds all photos at exactly that size, it is used, unless --images or --reduce is given [default: as
    /// the scene was trained, else 1600]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..), alias = "max-resolution")]
    max_size: Option<u32>,
    /// Filter for downscaling photos [default: area]
    #[arg(long, value_enum)]
    reduce: Option<Reduce>,
    /// Color behind the scene and behind transparent pixels: black, white, #RRGGBB, #RGB, or R,G,B with sRGB
    /// values from 0 to 1 [default: as the scene was trained, else black]
    #[arg(long, value_name = "COLOR", value_parser = parse_background)]
    background: Option<[f32; 3]>,
}

/// Default maximum size, as in 3DGS, pixels.
const DEFAULT_MAX_SIZE: u32 = 1600;

/// Returns the given value, else the one that `scene` was trained with. A note reports a contradiction.
pub(super) fn settled<T: PartialEq>(
    option: &str,
    [given, trained]: [Option<T>; 2],
    scene: &Path,
    text: impl Fn(&T) -> String,
) -> Option<T> {
    if let (Some(given), Some(trained)) = (&given, &trained)
        && given != trained
    {
        let (scene, given, trained) = (scene.display(), text(given), text(trained));
        note(format!(
            "{scene} was trained with {option} {trained}, but {given} is given here: figures are not comparable"
        ));
    }
    given.or(trained)
}

impl PhotoArgs {
    /// Fills options that were not given with those that the scene at this path was trained with.
    pub(super) fn like(&self, TrainedWith { background, max_size, .. }: TrainedWith, scene: &Path) -> PhotoArgs {
        let color = |[r, g, b]: &[f32; 3]| format!("{r},{g},{b}");
        PhotoArgs {
            background: settled("--background", [self.background, background], scene, color),
            max_size: settled("--max-size", [self.max_size, max_size], scene, u32::to_string),
            ..self.clone()
        }
    }

    /// Sets the folder of the photos, and their maximum size if none was given.
    pub(super) fn prefer(&mut self, images: Option<PathBuf>, max_size: Option<u32>) {
        self.dataset.images = self.dataset.images.take().or(images);
        self.max_size = self.max_size.or(max_size);
    }

    /// Whether the poses come from a folder of their own.
    pub(super) fn has_model(&self) -> bool {
        self.dataset.model.is_some()
    }

    /// These options as on the command line.
    pub(super) fn arguments(&self) -> Vec<OsString> {
        let PhotoArgs {
            dataset: DatasetArgs { images, model, holdout, tune, alpha, part },
            max_size,
            reduce,
            background,
        } = self;
        let value = |value: Option<clap::builder::PossibleValue>| value.map(|value| value.get_name().into());
        let selection = |holdout: Holdout| match holdout {
            Holdout::Every(n) => n.to_string().into(),
            other => other.to_string().into(),
        };
        let given: [(&str, Option<OsString>); 8] = [
            ("--images", images.as_ref().map(|path| path.into())),
            ("--model", model.as_ref().map(|path| path.into())),
            ("--holdout", holdout.map(selection)),
            ("--alpha", value(alpha.to_possible_value()).filter(|_| *alpha != Alpha::default())),
            ("--part", part.map(|part| part.to_string().into())),
            ("--max-size", max_size.map(|size| size.to_string().into())),
            ("--reduce", value(reduce.and_then(|reduce| reduce.to_possible_value()))),
            ("--background", background.map(|[r, g, b]| format!("{r},{g},{b}").into())),
        ];
        let flag = tune.then(|| "--tune".into());
        given.into_iter().filter_map(|(name, value)| Some([name.into(), value?])).flatten().chain(flag).collect()
    }

    /// Color behind the scene.
    pub(super) fn background(&self) -> [f32; 3] {
        self.background.unwrap_or_default()
    }

    /// Settings to store in a scene that is trained on these photos.
    pub(super) fn trained_with(&self, antialiased: bool) -> TrainedWith {
        TrainedWith {
            background: Some(self.background()),
            antialiased: Some(antialiased),
            max_size: self.max_size,
            ..TrainedWith::default()
        }
    }

    /// Name of the selection of test photos.
    pub(super) fn holdout(&self) -> String {
        let name = self.dataset.holdout.unwrap_or_default().to_string();
        if self.dataset.tune { name + ", tune" } else { name }
    }

    /// Reads the dataset, or the part of a plan, and prints its notes.
    ///
    /// # Errors
    /// If the plan has other settings than are given here; those of [`Dataset::open`].
    pub(super) fn open(&self, path: &Path) -> Result<Dataset> {
        Ok(self.clone().open_with_options(path)?.0)
    }

    /// [`PhotoArgs::open`], with the options that the dataset was read with. The settings of a plan become these.
    pub(super) fn open_with_options(&mut self, path: &Path) -> Result<(Dataset, DatasetOptions)> {
        let reduce = self.reduce.unwrap_or_default();
        let (max_size, background) = (self.max_size.unwrap_or(DEFAULT_MAX_SIZE), self.background());
        let reduced_folders = self.max_size.is_some() && self.reduce.is_none();
        let options =
            DatasetOptions { max_size: Some(max_size), reduce, reduced_folders, background, ..Default::default() };
        let (dataset, options) = self.dataset.open(path, options)?;
        if dataset.part.is_some() {
            self.follow(path, &options)?;
        }
        let reduced = dataset.photos.iter().filter(|photo| match &photo.pixels {
            PixelSource::File(file) => file.size.iter().any(|&side| side > max_size),
            PixelSource::Memory(_) => false,
        });
        if self.max_size.is_none() && reduced.clone().next().is_some() {
            note(format!(
                "{} of {} photos are downscaled to {max_size} pixels on the longer side; --max-size sets another limit",
                reduced.count(),
                dataset.photos.len()
            ));
        }
        Ok((dataset, options))
    }

    /// Takes over the settings of a plan.
    fn follow(
        &mut self,
        plan: &Path,
        &DatasetOptions { max_size, background, reduce, .. }: &DatasetOptions,
    ) -> Result<()> {
        let differs = [
            self.max_size.is_some_and(|given| Some(given) != max_size).then_some("--max-size"),
            self.background.is_some_and(|given| given != background).then_some("--background"),
            self.reduce.is_some_and(|given| given != reduce).then_some("--reduce"),
        ];
        if let Some(option) = differs.into_iter().flatten().next() {
            let what = format!("the plan has another {option} than the command line or the scene; expected the plan's");
            return Err(Error::input(plan, what));
        }
        (self.max_size, self.background, self.reduce) = (max_size, Some(background), Some(reduce));
        Ok(())
    }
}

fn parse_background(text: &str) -> Result<[f32; 3], String> {
    match text {
        "black" => return Ok([0.0; 3]),
        "white" => return Ok([1.0; 3]),
        _ => {}
    }
    if let Some(digits) = text.strip_prefix('#') {
        return hex_color(digits).ok_or_else(|| "expected three or six hexadecimal digits, such as #fff".into());
    }
    let values: Option<Vec<f32>> = text.split(',').map(|v| v.trim().parse().ok()).collect();
    let color = values.and_then(|v| <[f32; 3]>::try_from(v).ok());
    color
        .filter(|color| color.iter().all(|v| (0.0..=1.0).contains(v)))
        .ok_or_else(|| "expected black, white, #RRGGBB or three numbers from 0 to 1 such as 0.2,0.2,0.2".into())
}

fn hex_color(digits: &str) -> Option<[f32; 3]> {
    let digits: Option<Vec<u32>> = digits.chars().map(|c| c.to_digit(16)).collect();
    match digits?[..] {
        [r, g, b] => Some([r, g, b].map(|digit| digit as f32 / 15.0)),
        [r, s, g, h, b, c] => Some([[r, s], [g, h], [b, c]].map(|[high, low]| (16 * high + low) as f32 / 255.0)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backgrounds_are_names_hexadecimal_or_three_numbers() {
        assert_eq!(parse_background("white"), Ok([1.0; 3]));
        assert_eq!(parse_background("#fff"), Ok([1.0; 3]));
        assert_eq!(parse_background("#3300Cc"), Ok([0.2, 0.0, 0.8]));
        assert_eq!(parse_background("0, 0.5,1"), Ok([0.0, 0.5, 1.0]));
        for bad in
            ["", "grey", "#", "#ff", "#ggg", "#ffff", "#+1+1+1", "1,1", "0,0,0,0", "0,0,255", "0,0,nan", "-1,0,0"]
        {
            assert!(parse_background(bad).is_err(), "{bad}");
        }
    }
}
