//! `glint demo`: trains and augments a built-in scene and compares the result with its controls.

use std::{path::PathBuf, time::Instant};

use serde::Serialize;

use super::{
    DeviceArgs, LearnArgs, Outcome,
    enhance::{
        ChoiceArgs, Preset,
        drive::{Beside, run_with_progress},
        report::{joint_stages, train_longer},
    },
    output::{Inputs, OutputArgs},
    print, print_json,
    progress::{Progress, note},
    report::{NUMBERS, PAGE, Shown, compare},
};
use crate::{
    Result,
    data::{Dataset, Holdout, Photo, Split, TrainedWith, builtin::builtin_scene, scene_bytes, write_ply},
    gpu::Context,
    pipelines::{
        enhance::{EnhanceOptions, Enhanced, Method, Times},
        join::JoinOptions,
        model::{Model, Room},
        render::RenderOptions,
        session::{Policy, Session},
        start::{photos_of, upload_photos},
        steps::StepReport,
        train::{BaseOptions, train_base},
        views::Views,
    },
    report::{
        history::Record,
        metrics::Quality,
        page::Entry,
        runs::{PHASES, Run, StageMean},
        table::{Cell, Column, Table},
    },
    scene::{Scene, from_points},
};

const EXAMPLES: &str = "\
Renders 48 photos of glossy objects under small bright lights with an analytic renderer, trains a base scene on them and \
augments it. A page compares both with 8 held-out photos. It also has three controls: the base trained longer by the same \
number of steps, plain Gaussians trained from the start with the same bytes and steps, and the base augmented \
by the other method.

Examples:
  glint demo
  glint demo -o demo --force --json";

/// Amount of work.
struct Length {
    /// Surface points at the start of the base, one Gaussian each.
    points: usize,
    /// Steps of the base.
    iterations: u32,
    /// Steps of the joint phase for each view; `None` for the preset's.
    joint: Option<u32>,
}

/// Lengths for which the whole demo takes at most four minutes on two CPU cores.
const WHOLE: Length = Length { points: 4000, iterations: 2000, joint: None };
const SH_DEGREE: u32 = 3;
const BASE: &str = "base.ply";
const AUGMENTED: &str = "augmented.ply";

/// Train and augment a built-in scene, and show the gain
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Output folder for the scenes and the page
    #[arg(short, long, value_name = "DIR", default_value = "glint-demo")]
    output: PathBuf,
    /// Method that places Gaussians
    #[arg(long, value_enum, default_value_t)]
    method: Method,
    /// Seed of random numbers and of the order of photos
    #[arg(long, default_value_t = 0)]
    seed: u32,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    replace: OutputArgs,
    #[command(flatten)]
    learn: LearnArgs,
    #[command(flatten)]
    device: DeviceArgs,
    #[command(flatten)]
    choices: ChoiceArgs,
}

/// Scene to compare, with its cost.
struct Made {
    what: &'static str,
    scene: Scene,
    steps: u32,
    /// Time since the first step of its base, seconds.
    seconds: f64,
    /// Whether it started from the base.
    from_base: bool,
    told: Run,
}

/// Row of the report on a scene.
#[derive(Serialize)]
struct Row {
    what: &'static str,
    gaussians: usize,
    supplementary: usize,
    steps: u32,
    seconds: f64,
    psnr: f64,
    ssim: f64,
}

#[derive(Serialize)]
struct Report {
    device: String,
    /// Base; base trained longer by the steps of the joint phase; plain Gaussians from the start, with
    /// equal bytes and steps; augmented by the other method; augmented.
    rows: [Row; 5],
    /// Test PSNR over the base, and over plain Gaussians of equal bytes and steps, dB.
    gain_over_base: f64,
    gain_over_plain: f64,
    seconds_base_renders: f64,
    seconds_place: f64,
    seconds_screen: f64,
    seconds_lift: f64,
    seconds_join: f64,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        // Every prefix of the points is spread evenly. The plain control takes a longer prefix.
        let (report, times) = self.run_for(&builtin_scene(2 * WHOLE.points).dataset(), &WHOLE)?;
        if self.json { Ok(print_json(&report)?) } else { Ok(print(self.summary(&report, &times))?) }
    }

    fn run_for(&self, dataset: &Dataset, length: &Length) -> Outcome<(Report, Times)> {
        self.replace.check_files(&self.output, [BASE, AUGMENTED, PAGE, NUMBERS], &Inputs::default())?;
        self.replace.make_folder(&self.output, &Inputs::default())?;
        self.device.with(|context| Ok(self.run_on(context, dataset, length)?))
    }

    fn run_on(&self, context: &Context, dataset: &Dataset, length: &Length) -> Result<(Report, Times)> {
        let Length { points, iterations, joint } = *length;
        note(format!("device: {}", context.info().name));
        let train = photos_of(dataset, Some(Split::Train))?;
        let test = photos_of(dataset, Some(Split::Test))?;
        let background = dataset.background;
        let extent = dataset.extent() as f32;
        let session = self.learn.session(context, Policy::default(), background, extent, self.seed.into());
        let views = upload_photos(context, &train, background, 0, |_, _| ())?;

        let base = self.train("base", &session, dataset, &views, points, iterations)?;
        let trained_with = TrainedWith { background: Some(background), antialiased: Some(false), ..Default::default() };
        write_ply(self.output.join(BASE), &base.scene, None, trained_with)?;

        let with_joint = |options: EnhanceOptions| {
            let steps_per_view = joint.unwrap_or(options.join.steps_per_view);
            EnhanceOptions { join: JoinOptions { steps_per_view, ..options.join }, ..options }
        };
        let options = with_joint(self.choices.options(self.method, Preset::Quick)?);
        let (augmented, enhanced) = self.augment(self.method, &session, &base, &views, &options)?;
        write_ply(self.output.join(AUGMENTED), &augmented.scene, enhanced.original.as_ref(), trained_with)?;

        let (other, choices) = match self.method {
            Method::Pursuit => (Method::Augs, EnhanceOptions::quick()),
            Method::Augs => (Method::Pursuit, EnhanceOptions::pursuit()),
        };
        let choices = EnhanceOptions {
            median_threshold: options.median_threshold,
            centre_depth: options.centre_depth,
            ..choices
        };
        let (other, _) = self.augment(other, &session, &base, &views, &with_joint(choices))?;
        let trained_on = self.train_on(&session, &base, &views, &with_joint(EnhanceOptions::pursuit()).join)?;
        // Lobes have one color and plain Gaussians SH 3: as many bytes are fewer plain ones.
        let each = scene_bytes(&base.scene) / base.scene.base.len() as u64;
        let as_many = scene_bytes(&augmented.scene).div_ceil(each) as usize;
        let plain = self.train("more plain Gaussians", &session, dataset, &views, as_many, augmented.steps)?;

        let made = [base, trained_on, plain, other, augmented];
        let rows = self.page(context, &test, background, &made)?;
        let times = enhanced.times;
        let report = Report {
            device: context.info().name.clone(),
            gain_over_base: rows[4].psnr - rows[0].psnr,
            gain_over_plain: rows[4].psnr - rows[2].psnr,
            seconds_base_renders: times.base.as_secs_f64(),
            seconds_place: times.place.as_secs_f64(),
            seconds_screen: times.screen.as_secs_f64(),
            seconds_lift: times.lift.as_secs_f64(),
            seconds_join: times.join.as_secs_f64(),
            rows,
        };
        Ok((report, times))
    }

    /// Trains plain Gaussians on the first `points` surface points.
    fn train(
        &self,
        what: &'static str,
        session: &Session,
        dataset: &Dataset,
        views: &Views,
        points: usize,
        iterations: u32,
    ) -> Result<Made> {
        session.context.count_most_anew();
        let started = Instant::now();
        let cloud = dataset.points.clone().unwrap_or_default();
        let (positions, points) = (cloud.around(views.origin), points.min(cloud.positions.len()));
        let base = from_points(&positions[..points], &cloud.colors[..points], SH_DEGREE);
        let scene = Scene { base, origin: views.origin, ..Scene::default() };
        let model = Model::upload_around(&session.context, views.origin, &scene, Room::default())?;
        let options = BaseOptions { iterations, sh_degree: SH_DEGREE, ..Default::default() };
        let bar = Progress::new("training", "steps", iterations.into());
        let trained = train_base(session, &model, views, &options, true, |done| bar.set(done.into()))?;
        let seconds = started.elapsed().as_secs_f64();
        let told = trained_run(session, what, seconds, &trained.steps);
        Ok(Made { what, scene: model.download()?, steps: iterations, seconds, from_base: false, told })
    }

    /// Trains the base longer, as in a joint phase with nothing added.
    fn train_on(&self, session: &Session, base: &Made, views: &Views, options: &JoinOptions) -> Result<Made> {
        session.context.count_most_anew();
        let (what, started) = ("base trained longer", Instant::now());
        let steps = options.steps_per_view * views.cameras.len() as u32;
        let (scene, trained) = train_longer(session, &base.scene, views, options, steps)?;
        let seconds = started.elapsed().as_secs_f64();
        let told = trained_run(session, what, seconds, &trained.steps);
        let (steps, seconds) = (base.steps + steps, base.seconds + seconds);
        Ok(Made { what, scene, steps, seconds, from_base: true, told })
    }

    fn augment(
        &self,
        method: Method,
        session: &Session,
        base: &Made,
        views: &Views,
        options: &EnhanceOptions,
    ) -> Result<(Made, Enhanced)> {
        let what = match method {
            Method::Pursuit => "augmented by pursuit",
            Method::Augs => "augmented by augs",
        };
        session.context.count_most_anew();
        let started = Instant::now();
        let beside = Beside { silent: self.json, ..Default::default() };
        let enhanced = run_with_progress(session, &base.scene, views, options, beside, &mut |_, _| ())?;
        let seconds = base.seconds + started.elapsed().as_secs_f64();
        let times = enhanced.times;
        let phases = [times.base, times.weigh, times.place, times.screen, times.lift, times.join];
        let phases = PHASES.iter().zip(phases).filter(|(_, time)| !time.is_zero());
        let told = Run {
            name: what.into(),
            plan: enhanced.spending.clone(),
            phases: phases.map(|((_, name), time)| ((*name).to_owned(), time.as_secs_f64())).collect(),
            stages: joint_stages(&enhanced),
            device_megabytes: Some(most_megabytes(session)),
        };
        let steps = base.steps + options.join.steps_per_view * views.cameras.len() as u32;
        Ok((Made { what, scene: enhanced.scene.clone(), steps, seconds, from_base: true, told }, enhanced))
    }

    /// Writes the page that compares all scenes, and returns their rows.
    fn page(&self, context: &Context, test: &[&Photo], background: [f32; 3], made: &[Made; 5]) -> Result<[Row; 5]> {
        let shown =
            made.each_ref().map(|Made { what, scene, .. }| Shown { name: what, scene, bytes: scene_bytes(scene) });
        let compared = compare(context, &shown, test, RenderOptions::default(), background)?;
        let rows = std::array::from_fn(|i| {
            let (&Made { what, steps, seconds, .. }, entry) = (&made[i], &compared.entries[i]);
            let &Entry { gaussians, supplementary, mean: Quality { psnr, ssim }, .. } = entry;
            Row { what, gaussians: gaussians - supplementary, supplementary, steps, seconds, psnr, ssim }
        });
        let record = |what: &str, row: &Row, bytes| Record {
            name: what.into(),
            seconds: row.seconds,
            bytes,
            gaussians: (row.gaussians + row.supplementary) as u64,
            psnr: row.psnr,
            ssim: row.ssim,
            seed: self.seed.into(),
            holdout: Holdout::default().to_string(),
            base_psnr: Some(rows[0].psnr),
        };
        let records = rows.iter().zip(&made[..]).zip(&shown).flat_map(|((row, made), of)| {
            // A curve that starts from the base has the base as its first point.
            let first = made.from_base.then(|| record(row.what, &rows[0], shown[0].bytes));
            first.into_iter().chain([record(row.what, row, of.bytes)])
        });
        let told = made.each_ref().map(|made| made.told.clone());
        compared.write(&self.output, "the built-in scene", &records.collect::<Vec<_>>(), &told)?;
        Ok(rows)
    }

    fn summary(&self, report: &Report, times: &Times) -> String {
        let mut table = Table::new(vec![
            Column::new("held-out views", "", 0),
            Column::new("Gaussians", "", 0),
            Column::new("with lobes", "", 0),
            Column::new("steps", "", 0),
            Column::new("time", "s", 1),
            Column::new("PSNR", "dB", 2),
            Column::new("SSIM", "", 4),
        ]);
        for row in &report.rows {
            table.row(vec![
                row.what.into(),
                Cell::Count(row.gaussians as u64),
                Cell::Count(row.supplementary as u64),
                Cell::Count(row.steps.into()),
                row.seconds.into(),
                row.psnr.into(),
                row.ssim.into(),
            ]);
        }
        format!(
            "{table}\n{}: {:+.2} dB over its base, {:+.2} dB over plain Gaussians of the same bytes and steps\n\
             placing {:.1} s, joint phase {:.1} s\n{}: {BASE}, {AUGMENTED}, {PAGE}\n",
            report.rows[4].what,
            report.gain_over_base,
            report.gain_over_plain,
            (times.base + times.place + times.screen + times.lift).as_secs_f64(),
            times.join.as_secs_f64(),
            self.output.display()
        )
    }
}

/// Peak device memory of the run that has just ended, MB.
fn most_megabytes(session: &Session) -> f64 {
    session.context.memory().most_used as f64 / 1e6
}

fn trained_run(session: &Session, what: &str, seconds: f64, steps: &StepReport) -> Run {
    Run {
        name: what.into(),
        phases: vec![("training".into(), seconds)],
        stages: StageMean::all(&steps.milliseconds()),
        device_megabytes: Some(most_megabytes(session)),
        plan: None,
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn a_short_demo_writes_all_that_the_long_one_does() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("demo");
        let line = Line::try_parse_from(["demo", "--json", "-o", output.to_str().unwrap()]).unwrap();
        let length = Length { points: 300, iterations: 20, joint: Some(1) };
        let mut dataset = builtin_scene(2 * length.points).dataset();
        let photos = std::mem::take(&mut dataset.photos).into_iter().enumerate();
        dataset.photos = photos.filter(|(i, _)| i % 14 == 0).map(|(_, photo)| photo).collect();
        let views = dataset.split(Split::Train).count() as u32;
        let Ok((report, _)) = line.args.run_for(&dataset, &length) else { panic!("the demo fails") };
        let [base, on, plain, other, augmented] = &report.rows;
        assert!(augmented.supplementary > 0 && augmented.gaussians >= 300);
        assert_eq!((base.gaussians, base.supplementary, base.steps), (300, 0, 20));
        // One joint step for each view.
        let steps = 20 + views;
        // 248 bytes of SH 3 each; a lobe has 76 bytes.
        let as_many = augmented.gaussians + (76 * augmented.supplementary).div_ceil(248);
        assert_eq!((plain.gaussians, plain.supplementary, plain.steps), (as_many, 0, steps));
        assert_eq!((augmented.steps, other.steps), (steps, steps));
        assert_eq!((on.gaussians, on.supplementary, on.steps), (300, 0, steps));
        assert_eq!((other.what, augmented.what), ("augmented by augs", "augmented by pursuit"));
        assert!(other.supplementary > 0 && other.gaussians == 300, "{}", other.supplementary);
        let times = [report.seconds_base_renders, report.seconds_place, report.seconds_join].into_iter().sum::<f64>();
        assert!(base.seconds > 0.0 && augmented.seconds >= base.seconds + times);
        assert_eq!(report.gain_over_plain, augmented.psnr - plain.psnr);
        let mut found: Vec<_> = std::fs::read_dir(&output).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        found.sort();
        assert_eq!(found, [AUGMENTED, BASE, PAGE, NUMBERS]);
        // Curves from the base over seconds, bytes and Gaussians: three plots of PSNR and three of SSIM.
        let page = std::fs::read_to_string(output.join(PAGE)).unwrap();
        assert_eq!(page.matches("<svg").count(), 6);
        // Existing files are not overwritten without `--force`.
        assert!(line.args.run_for(&dataset, &length).is_err());
    }
}
