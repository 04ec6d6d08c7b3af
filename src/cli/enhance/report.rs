//! Report at the end of an augmentation: gain, costs and their JSON.

use std::time::Duration;

use serde::Serialize;

use crate::{
    Error, Result,
    cli::{
        counted,
        dataset::note_uncounted,
        progress::{Progress, note},
    },
    data::{Dataset, Photo, Split},
    pipelines::{
        enhance::{EnhanceOptions, Enhanced, Method, Times},
        join::{JoinOptions, join_for},
        model::{Model, Room},
        render::RenderOptions,
        session::Session,
        spend::Spending,
        train::TrainReport,
        views::Views,
    },
    report::{evaluate::evaluate, metrics::Quality, runs::StageMean},
    scene::Scene,
};

/// Content of `--json`.
#[derive(Serialize)]
pub(super) struct Report<'a> {
    pub(super) output: String,
    pub(super) device: &'a str,
    pub(super) photos: usize,
    /// Photos whose lifts came from a checkpoint.
    pub(super) photos_resumed: usize,
    #[serde(flatten)]
    pub(super) sizes: Sizes,
    /// Plan of pursuit; null for --method augs.
    pub(super) plan: Option<&'a Spending>,
    /// Gaussians removed because the joint phase made them transparent.
    pub(super) faded_gaussians: u32,
    /// Whether `vertex` is the original base, because the changed one is worse without the supplement.
    pub(super) original_kept: bool,
    #[serde(flatten)]
    pub(super) costs: Costs,
    /// Mean loss of the first and of the last pass of the joint phase; null if it did not run.
    pub(super) joint_loss_first: Option<f64>,
    pub(super) joint_loss_last: Option<f64>,
    /// Gaussians of each placement.
    pub(super) placements: Vec<Placement>,
    /// Whether the output is the original base, because the test photos were worse and no budget was given.
    /// Other fields then describe the discarded augmentation.
    pub(super) discarded: bool,
    /// Gain on the test views; null if there are none.
    pub(super) gain: Option<Gain>,
}

/// Numbers of Gaussians, and their bytes.
#[derive(Serialize)]
pub(super) struct Sizes {
    pub(super) base_gaussians: usize,
    /// Maximum number of added Gaussians; with --method augs, 2D Gaussians left after the screen phase.
    pub(super) budget: u32,
    pub(super) refined: u32,
    pub(super) supplementary_gaussians: u32,
    /// Plain Gaussians that pursuit added to the base.
    pub(super) plain_gaussians: u32,
    /// Gaussians of the base that got bands.
    pub(super) banded_gaussians: u32,
    /// Gaussians of the base that lost their bands.
    pub(super) demoted_gaussians: usize,
    /// Size of added Gaussians and bands in the file, bytes; 0 if they were discarded.
    pub(super) bytes_added: u64,
    /// Size of the file, bytes, including a changed base stored next to the original.
    pub(super) file_bytes: u64,
}

/// Times and device memory of the augmentation.
#[derive(Serialize)]
pub(super) struct Costs {
    pub(super) seconds: Seconds,
    /// Peak device memory, MB.
    pub(super) device_megabytes: f64,
    /// Stages of a joint step, in the order of their first run; empty if the device has no timestamps.
    pub(super) stages: Vec<StageMean>,
}

#[derive(Serialize)]
pub(super) struct Placement {
    pub(super) lobes: u32,
    pub(super) plain: u32,
}

/// Gain of an augmentation on the test views, which no training used.
#[derive(Serialize)]
pub(super) struct Gain {
    views: usize,
    /// Quality of the original base.
    pub(super) before: Quality,
    pub(super) after: Quality,
    /// Quality of the `vertex` part, as other viewers show it. This is the original base if the changed one
    /// is worse alone.
    pub(super) base_alone: Quality,
    /// Whether some Gaussians of the base have bands: other viewers show none of them.
    #[serde(skip)]
    mixed: bool,
    /// Gain of as many steps of longer training, dB; null if unknown.
    pub(super) longer_training: Option<Longer>,
}

/// Gain of longer training, dB.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Longer {
    psnr: f64,
    /// Whether it was measured on the test views, by training the base for as many steps. Otherwise it is
    /// an estimate from the first steps, on the training views.
    measured: bool,
}

/// Maximum duration of a joint phase that is repeated without the added Gaussians, to measure longer
/// training. That doubles a short run; for a long one the control costs too much.
const REPEATED: Duration = Duration::from_secs(30);

/// Trains the base longer, as in a joint phase with nothing added.
pub(in crate::cli) fn train_longer(
    session: &Session,
    base: &Scene,
    views: &Views,
    options: &JoinOptions,
    steps: u32,
) -> Result<(Scene, TrainReport)> {
    let model = Model::upload_around(&session.context, views.origin, base, Room::default())?;
    let bar = Progress::new("longer training", "steps", steps.into());
    let mut trainer = join_for(session, &model, views, options, steps)?;
    let trained = trainer.run(&model, views, true, |done| bar.set(done.into()))?;
    Ok((model.download()?, trained))
}

#[derive(Serialize)]
pub(super) struct Seconds {
    base: f64,
    bands: f64,
    weigh: f64,
    place: f64,
    screen: f64,
    lift: f64,
    join: f64,
}

impl Seconds {
    pub(super) fn of(times: &Times) -> Self {
        Seconds {
            base: times.base.as_secs_f64(),
            bands: times.bands.as_secs_f64(),
            weigh: times.weigh.as_secs_f64(),
            place: times.place.as_secs_f64(),
            screen: times.screen.as_secs_f64(),
            lift: times.lift.as_secs_f64(),
            join: times.join.as_secs_f64(),
        }
    }
}

impl Report<'_> {
    /// Formats the report as text.
    pub(super) fn text(&self, method: Method) -> String {
        let Report { output, device, sizes, costs: Costs { seconds, .. }, gain, .. } = self;
        let base_gaussians = sizes.base_gaussians;
        let times = match method {
            Method::Pursuit => {
                let found =
                    if seconds.bands > 0.0 { format!("finding bands {:.1} s, ", seconds.bands) } else { String::new() };
                format!("{found}weighing {:.1} s, placing {:.1} s", seconds.weigh, seconds.place)
            }
            Method::Augs => format!("screen phase {:.1} s, lifting {:.1} s", seconds.screen, seconds.lift),
        };
        let plain = match sizes.plain_gaussians {
            0 => String::new(),
            plain => format!(" and {}", counted(plain as usize, "plain Gaussian")),
        };
        let banded = match sizes.banded_gaussians {
            0 => String::new(),
            banded => format!(", {banded} of which got bands"),
        };
        let demoted = match sizes.demoted_gaussians {
            0 => String::new(),
            demoted => format!(", {demoted} of which lost their bands"),
        };
        let faded = match self.faded_gaussians {
            0 => String::new(),
            faded => format!(", without {faded} that faded"),
        };
        let discarded = if self.discarded { ", discarded: the file has the original base" } else { "" };
        format!(
            "{output}: {}{plain} on a base of {base_gaussians}{banded}{demoted}{faded}{discarded}\n\
             base {:.1} s, {times}, joint phase {:.1} s on {device}\n{}",
            counted(sizes.supplementary_gaussians as usize, "supplementary Gaussian"),
            seconds.base,
            seconds.join,
            gain.as_ref().map_or(String::new(), Gain::text)
        )
    }
}

/// Mean times of the stages in a joint step.
pub(in crate::cli) fn joint_stages(found: &Enhanced) -> Vec<StageMean> {
    found.join.as_ref().map_or_else(Vec::new, |join| StageMean::all(&join.steps.milliseconds()))
}

/// Compares the base and the result with the test views. `repeat` tells whether a short joint phase may be
/// repeated.
pub(super) fn gain(
    session: &Session,
    base: &Scene,
    found: &Enhanced,
    dataset: &Dataset,
    (views, repeat): (&Views, bool),
) -> Result<Option<Gain>> {
    let photos: Vec<&Photo> = dataset.split(Split::Test).map(|(_, photo)| photo).collect();
    if photos.is_empty() {
        return Ok(None);
    }
    let bar = |scenes: u64| Progress::new("comparing", "views", scenes * photos.len() as u64);
    let options = RenderOptions { policy: session.policy, ..Default::default() };
    let compare = |scene: &Scene, bar: &Progress| {
        evaluate(&session.context, scene, &photos, options, dataset.background, |_| {
            bar.advance();
            Ok(())
        })
    };
    let comparing = bar(2);
    let before = match compare(base, &comparing) {
        // The scene is already written, so a failed comparison is not an error.
        Err(Error::Usage(why)) => {
            note(why);
            return Ok(None);
        }
        before => before?,
    };
    let after = compare(&found.scene, &comparing)?;
    drop(comparing);
    let base_alone = match (&found.original, found.scene.mixed) {
        (Some(_), _) => before.augmented,
        (None, false) => after.base,
        // Other viewers show the constant colors.
        (None, true) => {
            let base = found.scene.base.clone().with_degree(0);
            compare(&Scene { base, origin: found.scene.origin, ..Scene::default() }, &bar(1))?.augmented
        }
    };
    let seen = after.views.len();
    note_uncounted(photos.len() - seen);
    let (before, after) = (before.augmented, after.augmented);
    let estimate = found.spending.as_ref().and_then(|plan| plan.training_on_db);
    let mut longer_training = estimate.map(|psnr| Longer { psnr, measured: false });
    if let (Some(join), true) = (&found.join, repeat && found.times.join <= REPEATED) {
        let (options, steps) = (EnhanceOptions::pursuit().join, join.losses.len() as u32);
        let measured = train_longer(session, base, views, &options, steps)
            .and_then(|(longer, _)| Ok(compare(&longer, &bar(1))?.augmented.psnr - before.psnr));
        match measured {
            Ok(psnr) => longer_training = Some(Longer { psnr, measured: true }),
            // The augmentation is complete without this control.
            Err(error) => note(format!("longer training was not measured: {error}")),
        }
    }
    Ok(Some(Gain { views: seen, before, after, base_alone, mixed: found.scene.mixed, longer_training }))
}

impl Gain {
    fn text(&self) -> String {
        let Gain { views, before, after, base_alone, mixed, longer_training } = self;
        let longer = longer_training.map_or(String::new(), |Longer { psnr, measured }| {
            let how = if measured { "measured" } else { "estimated from its first steps, on the training views" };
            format!("longer training instead, same number of steps: {psnr:+.2} dB ({how})\n")
        });
        let missed = if *mixed { ", without the bands, which other formats of glint convert have" } else { "" };
        format!(
            "{}: PSNR {:.2} to {:.2} dB ({:+.2}), SSIM {:.4} to {:.4}\n\
             the base part alone, as other viewers show it: {:.2} dB ({:+.2}){missed}\n{longer}",
            counted(*views, "test view"),
            before.psnr,
            after.psnr,
            after.psnr - before.psnr,
            before.ssim,
            after.ssim,
            base_alone.psnr,
            base_alone.psnr - before.psnr
        )
    }
}

/// Mean loss of the first or the last pass over the photos.
pub(super) fn pass_loss(found: &Enhanced, photos: usize, last: bool) -> Option<f64> {
    let losses = &found.join.as_ref()?.losses;
    let n = photos.min(losses.len());
    let pass = if last { &losses[losses.len() - n..] } else { &losses[..n] };
    Some(pass.iter().map(|&l| f64::from(l)).sum::<f64>() / n.max(1) as f64)
}
