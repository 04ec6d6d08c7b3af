//! Training loop: steps, checkpoints, evaluations, and the end by steps, by time or by Ctrl-C.

use std::time::{Duration, Instant};

use super::{Args, Costs, Length, Report, SUBMISSIONS};
use crate::{
    Error, Result,
    cli::{
        Failure, Look, Outcome, caller, counted,
        deadline::{Deadline, Plan},
        history::{History, Moment},
        interrupt::Interrupt,
        kept::Kept,
        print, print_json,
        progress::{Progress, learned, note},
    },
    data::{TrainedWith, scene_bytes, write_ply},
    gpu::Memory,
    pipelines::{
        checkpoint::{Checkpoint, Clock},
        classes::{Classes, DEMOTED_AT, MEASURED_AT, Trial, divide, measure},
        density::{DensityOptions, Strategy},
        exposure::IDENTITY,
        model::{Model, Room},
        render::RenderOptions,
        session::Session,
        train::{BaseOptions, Trainer, dense_trainer, halvings_at},
        views::Views,
    },
    report::runs::StageMean,
    scene::{Scene, color},
};

/// Course of a run for any number of steps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Course {
    pub(super) sh_degree: u32,
    /// See [`BaseOptions::begins`].
    pub(super) begins: f64,
    pub(super) strategy: Strategy,
    /// Gaussians at the start.
    pub(super) first: u32,
    /// Maximum number of Gaussians.
    pub(super) most: u32,
    /// Number of times that the sides of photos are halved at first.
    pub(super) halvings: u32,
    /// With --bytes.
    pub(super) bytes: Option<u64>,
    /// Colors and moments lie in the host's memory.
    pub(super) host: bool,
    /// With --bytes, once the number of Gaussians is known.
    pub(super) classes: Option<Classes>,
}

impl Course {
    pub(super) fn options(&self, iterations: u32) -> BaseOptions {
        let sh_degree = self.classes.map_or(self.sh_degree, |classes| classes.degree());
        BaseOptions { iterations, sh_degree, begins: self.begins }
    }

    /// Density control.
    pub(super) fn density(&self, iterations: u32) -> DensityOptions {
        let limit = self.bytes.map_or(self.most, |bytes| self.most.min(Classes::at_first(bytes)).max(self.first));
        let before = DensityOptions { strategy: self.strategy, limit, first: self.first, iterations };
        self.classes.map_or(before, |classes| classes.control(&before))
    }

    /// Steps of a run of `iterations` until the next [`Training::divide`]; `None` after the last.
    fn divides_at(&self, iterations: u32) -> Option<u32> {
        let after = match self.classes {
            None => MEASURED_AT,
            Some(Classes { banded: None, .. }) => DEMOTED_AT,
            Some(_) => return None,
        };
        self.bytes.map(|_| (after * f64::from(iterations)).ceil() as u32)
    }

    /// The loop of a run, on the model of `scene`, or on one for its classes once they are known.
    pub(super) fn engine(
        &self,
        args: &Args,
        session: &Session,
        views: &Views,
        scene: &Scene,
        iterations: u32,
    ) -> Result<(Model, Trainer)> {
        let (control, host) = (self.density(iterations), self.host);
        let model = match self.classes {
            None => {
                let room = Room { base: control.limit.saturating_sub(self.first), host, ..Default::default() };
                Model::upload_around(&session.context, views.origin, scene, room)?
            }
            Some(classes) => {
                let (scene, room) = classes.room(scene.origin, host);
                Model::upload_around(&session.context, views.origin, &scene, room)?
            }
        };
        let mut trainer = dense_trainer(session, &model, views, &self.options(iterations), &control)?;
        if args.exposure {
            trainer.correct_exposure(session, views)?;
        }
        if let Some(time) = args.time {
            trainer.submit_at_most(time / SUBMISSIONS);
        }
        Ok((model, trainer))
    }

    /// Relative duration of a step, by the fraction of `iterations` steps that is done.
    pub(super) fn cost(self, iterations: u32) -> impl Fn(f64) -> f64 + Copy {
        let (whole, control) = (self.options(1), self.density(iterations));
        move |part| step_cost(halvings_at(whole.part_of(part), self.halvings), control.share(part))
    }
}

/// Relative duration of a step on photos halved `halvings` times, with this share of the final Gaussians. A
/// quarter of a full step is spent on Gaussians: 0.17 to 0.3 at 224 to 800 pixels and the numbers of
/// Gaussians in docs/experiments/2026-11-26-photographs.md. The whole grows with about the root of the number of
/// Gaussians (there: exponent 0.47).
fn step_cost(halvings: u32, gaussians: f64) -> f64 {
    0.25 * gaussians + 0.75 * 0.25f64.powi(halvings as i32) * gaussians.powf(0.3)
}

/// Position in a run.
#[derive(Clone, Copy)]
pub(super) struct At {
    /// Steps done.
    pub(super) done: u32,
    pub(super) total: u32,
    /// Steps executed. With --time, `done` changes when the run is replanned.
    pub(super) taken: u32,
}

impl At {
    /// Position after `done` steps.
    fn after(self, done: u32) -> At {
        At { done, taken: self.taken + (done - self.done), ..self }
    }

    fn is_going_on(self) -> bool {
        self.done < self.total
    }

    /// Prints notes on a run with --time that fell short of its schedule.
    fn tell_of_time(self, photos: usize) {
        let At { done, total, taken } = self;
        if self.is_going_on() {
            let part = 100.0 * f64::from(done) / f64::from(total);
            note(format!(
                "the time ended after {part:.0} % of the schedule: the last steps were slower than estimated"
            ));
        }
        if (taken as usize) < photos {
            let (steps, photos) = (counted(taken as usize, "step"), counted(photos, "photo"));
            note(format!("there was time for only {steps}, but there are {photos}: the scene is hardly trained"));
        }
    }
}

/// Run in progress.
pub(super) struct Training<'a> {
    pub(super) args: &'a Args,
    pub(super) session: &'a Session,
    pub(super) model: Model,
    pub(super) views: &'a Views,
    pub(super) course: Course,
    pub(super) trainer: Trainer,
    pub(super) kept: Kept,
    pub(super) trained_with: TrainedWith,
    pub(super) history: Option<History<'a>>,
    pub(super) deadline: Option<Deadline>,
    pub(super) bar: Progress,
    pub(super) at: At,
    pub(super) clocks: Clocks,
    /// Stages are timed.
    pub(super) timed: bool,
}

/// Times of a run.
pub(super) struct Clocks {
    /// Start of reading photos.
    pub(super) began: Instant,
    /// Start of the loop.
    pub(super) started: Instant,
    /// Time of earlier runs.
    pub(super) spent: Duration,
    /// Time of evaluations, which do not count.
    pub(super) evaluating: Duration,
}

impl Clocks {
    /// Time of the loop alone, seconds.
    fn seconds(&self) -> f64 {
        (self.started.elapsed() - self.evaluating).as_secs_f64()
    }
}

impl Training<'_> {
    /// Trains until the end or an interrupt, and writes the scene. Returns its number of Gaussians and, if it is mixed, of those with bands.
    pub(super) fn drive(&mut self, interrupt: &Interrupt, look_at: &mut Look<'_>) -> Result<[usize; 2]> {
        let mut looks_at = self.next_evaluation();
        // A run that was interrupted just before an evaluation does it now.
        let due = |every| self.at.taken > 0 && self.at.is_going_on() && self.at.taken.is_multiple_of(every);
        if self.args.eval_every.is_some_and(due) {
            self.evaluate(&self.model.download()?)?;
        }
        while !interrupt.asked() {
            let At { done, total, taken } = self.at;
            let divides_at = self.course.divides_at(total);
            if let Some(bytes) = self.course.bytes.filter(|_| divides_at.is_some_and(|step| done >= step)) {
                self.divide(bytes, interrupt)?;
                continue;
            }
            let stop = looks_at.map_or(total, |next| total.min(done + (next - taken)));
            let stop = divides_at.map_or(stop, |step| stop.min(step));
            let in_time = self.deadline.as_ref().map_or(stop, |deadline| deadline.last(done, Instant::now()));
            self.trainer.go_on_to(stop.min(in_time));
            if let Some(done) = self.trainer.advance(&self.model, self.views)? {
                self.advanced(done, look_at)?;
            } else if looks_at == Some(taken) && self.at.is_going_on() {
                let took = self.evaluate(&self.model.download()?)?;
                if let Some(deadline) = &mut self.deadline {
                    deadline.pause(took);
                }
                looks_at = self.next_evaluation();
            } else if !self.at.is_going_on() || done >= in_time {
                break;
            }
        }
        if interrupt.asked() {
            let found = self.checkpoint();
            self.kept.keep(found)?;
        }
        // The time may have ended before.
        while let (Some(bytes), Some(_), false) =
            (self.course.bytes, self.course.divides_at(self.at.total), interrupt.asked())
        {
            self.divide(bytes, interrupt)?;
        }
        let scene = self.model.download()?;
        let ended = !(interrupt.asked() && self.at.is_going_on());
        let matte = self.course.classes.is_some_and(|classes| classes.are_matte()).then_some(true);
        write_ply(&self.args.output, &scene, None, TrainedWith { matte, ..self.trained_with.ended(ended) })?;
        if !interrupt.asked() {
            self.evaluate(&scene)?;
        }
        let banded = if scene.mixed { scene.base.len() - scene.base.constants() } else { 0 };
        Ok([scene.base.len(), banded])
    }

    /// Reports progress after `done` steps, writes due checkpoints, and replans a run by time.
    fn advanced(&mut self, done: u32, look_at: &mut Look<'_>) -> Result<()> {
        self.at = self.at.after(done);
        let At { taken, total, .. } = self.at;
        let all = taken + total.saturating_sub(done);
        look_at(&self.model, format_args!("step {taken} of {all}"));
        self.bar.set_of(taken.into(), all.into());
        let small = match halvings_at(self.course.options(total).part(done), self.course.halvings) {
            0 => String::new(),
            halvings => format!(", photos at 1/{}", 1 << halvings),
        };
        let lately = self.trainer.lately(done, self.views.photos as usize);
        let gaussians = self.trainer.gaussians().or(self.course.classes.map(|classes| classes.count));
        self.bar.say(learned(lately, gaussians, &self.session.context) + &small);
        let (gaussians, seconds) = (gaussians.unwrap_or(self.course.first), self.clocks.seconds());
        caller::step(caller::Step { step: taken, steps: all, lately, gaussians, seconds });
        if self.kept.is_due() {
            let found = self.checkpoint();
            self.kept.keep(found)?;
        }
        if let Some(deadline) = &mut self.deadline
            && deadline.is_due(done, Instant::now())
        {
            self.at = self.at.after(self.trainer.settle(&self.model, self.views)?);
            let Plan { total, done } = deadline.plan(self.at.done, Instant::now(), Duration::ZERO);
            tracing::info!("after {} steps: a run of {total}, of which {done} count as done", self.at.taken);
            let (options, density) = (self.course.options(total), self.course.density(total));
            self.trainer.replan(self.session, self.views, &options, &density, done)?;
            self.at = At { done, total, ..self.at };
        }
        Ok(())
    }

    /// Finds the number of Gaussians, or takes bands that show little. After an interrupt nothing changes.
    fn divide(&mut self, bytes: u64, interrupt: &Interrupt) -> Result<()> {
        let At { done, total, .. } = self.at;
        let halvings = halvings_at(self.course.options(total).part(done), self.course.halvings);
        let (session, model, trainer, views) = (self.session, &self.model, &mut self.trainer, self.views);
        let (classes, found) = match self.course.classes {
            None => {
                let (options, density) = (self.course.options(total), self.course.density(total));
                self.bar.say("learning with and without bands, to compare");
                let goes_on = || !interrupt.asked();
                let trial = Trial { options: &options, density: &density, host: self.course.host, goes_on: &goes_on };
                let found = measure(session, model, trainer, (views, halvings), bytes, self.course.most, &trial)?;
                let Some(found) = found else { return Ok(()) };
                found
            }
            Some(_) => divide(session, model, trainer, views, bytes)?,
        };
        let course = Course { classes: Some(classes), ..self.course };
        let scene = Scene { origin: self.model.scene_origin, ..Scene::default() };
        let (model, mut trainer) = course.engine(self.args, self.session, self.views, &scene, total)?;
        trainer.resume(&model, &found, self.timed)?;
        // Only now: after an error the checkpoint is that of the scene before.
        (self.course, self.model, self.trainer) = (course, model, trainer);
        tracing::info!(
            "{}",
            match classes.banded {
                None => format!("after {done} steps: up to {} Gaussians", classes.limit),
                Some(0) => format!("after {done} steps: up to {} Gaussians, all without bands", classes.limit),
                Some(banded) => {
                    let others = classes.limit - banded;
                    format!("after {done} steps: {banded} Gaussians keep their bands, {others} lose them")
                }
            }
        );
        Ok(())
    }

    /// Step of the next evaluation.
    fn next_evaluation(&self) -> Option<u32> {
        self.args.eval_every.map(|every| (self.at.taken / every + 1).saturating_mul(every))
    }

    /// Evaluates `scene` on the test photos, at most once for each step. Returns the time this took.
    fn evaluate(&mut self, scene: &Scene) -> Result<Duration> {
        let Some(history) = self.history.as_mut().filter(|history| !history.has(self.at.taken)) else {
            return Ok(Duration::ZERO);
        };
        let (seconds, began) = (self.clocks.seconds(), Instant::now());
        let losses = self.trainer.losses(self.at.done);
        let loss = mean_loss(&losses[losses.len().saturating_sub(self.views.photos as usize)..]);
        let bytes = scene_bytes(scene);
        let options = RenderOptions { policy: self.session.policy, ..Default::default() };
        history.add(scene, Moment { step: self.at.taken, seconds, bytes, loss }, options)?;
        let took = began.elapsed();
        self.clocks.evaluating += took;
        Ok(took)
    }

    fn checkpoint(&mut self) -> Result<Checkpoint> {
        let mut found = self.trainer.checkpoint(&self.model, self.views)?;
        // Steps that were in flight are done, too.
        self.at = self.at.after(found.step);
        let Clocks { began, spent, evaluating, .. } = self.clocks;
        let milliseconds = (spent + began.elapsed().saturating_sub(evaluating)).as_millis() as u64;
        let At { total, taken, .. } = self.at;
        found.clock = self.args.time.map(|_| Clock { total, taken, milliseconds });
        self.course.classes.into_iter().for_each(|classes| classes.keep(&mut found));
        Ok(found)
    }

    /// Saves a checkpoint if it can after `error`, and returns the error.
    pub(super) fn fail(mut self, error: Error) -> Error {
        let found = self.checkpoint();
        drop(self.bar);
        self.kept.keep_after(error, found)
    }

    /// Prints the report of a run that resumed after `had` steps and wrote this number of Gaussians.
    pub(super) fn finish(self, had: u32, [gaussians, banded]: [usize; 2], interrupt: Interrupt) -> Outcome {
        let Training { args, session, course, mut trainer, kept, bar, at, clocks, .. } = self;
        let (context, photos) = (&session.context, self.views.photos as usize);
        let sh_degree = course.options(at.total).sh_degree;
        let trained = trainer.stop()?;
        let largest_exposure = trainer.exposures()?.map(|maps| farthest(&maps));
        let Memory { most_used, host, .. } = context.memory();
        // Steps that were in flight at the interrupt are done, too.
        let at = at.after(trained.losses.len() as u32);
        let ended = interrupt.asked() && at.is_going_on();
        let seconds = clocks.seconds();
        drop(bar);
        if !ended {
            kept.remove()?;
        }
        drop(interrupt);
        if args.time.is_some() && !ended {
            at.tell_of_time(photos);
        }
        for (pass, losses) in passes(&trained.losses, photos) {
            tracing::info!("mean loss of steps {pass}: {:.4}", mean_loss(losses));
        }
        let stages = trained.steps.milliseconds();
        for (name, milliseconds) in &stages {
            tracing::info!("a step's {name}: {milliseconds:.3} ms");
        }
        let report = Report {
            output: &args.output.to_string_lossy(),
            device: &context.info().name,
            photos,
            gaussians,
            sh_degree: color::of(sh_degree).harmonics,
            banded: course.bytes.map(|_| banded),
            length: Length { iterations: at.taken, iterations_resumed: had },
            seed: args.seed,
            halvings: course.halvings,
            tile: session.policy.tile(context.info()).to_string(),
            seconds,
            steps_per_second: f64::from(at.taken - had) / seconds,
            final_loss: mean_loss(&trained.losses[trained.losses.len().saturating_sub(photos)..]),
            largest_exposure,
            costs: Costs {
                device_megabytes: most_used as f64 / 1e6,
                host_megabytes: host as f64 / 1e6,
                buffers_grown: trained.steps.grown,
                stages: StageMean::all(&stages),
            },
        };
        if let Some(largest) = largest_exposure {
            note(format!("exposure: the photos' color maps differ from the identity by at most {largest:.3}"));
        }
        match args.json {
            true => print_json(&report)?,
            false => print(report.text(sh_degree))?,
        }
        if ended {
            // With --time, the final number of steps is unknown.
            let of = args.time.map_or(format!(" of {}", at.total), |_| String::new());
            let (taken, output) = (at.taken, report.output);
            let what = format!(
                "interrupted after {taken}{of} steps; {output} has their result; run the same command to resume"
            );
            return Err(Failure::Interrupted(what));
        }
        Ok(())
    }
}

impl Report<'_> {
    /// Formats the report as text.
    fn text(&self, sh_degree: u32) -> String {
        let Report { output, device, seconds, steps_per_second, final_loss, .. } = self;
        let (colors, shown) = match self.banded {
            Some(banded @ 1..) => (
                format!("{}, {banded} of them with bands of degree {sh_degree}", color::of(0).name),
                "other viewers show constant colors of this file, and the bands in other formats of glint convert\n",
            ),
            _ => (color::of(sh_degree).name.into(), ""),
        };
        format!(
            "{output}: {} of {colors} from {}\n{} in {seconds:.1} s ({steps_per_second:.1}/s) on {device}, loss {final_loss:.4}\n{shown}",
            counted(self.gaussians, "Gaussian"),
            counted(self.photos, "photo"),
            counted(self.length.iterations as usize, "step"),
        )
    }
}

fn mean_loss(pass: &[f32]) -> f64 {
    pass.iter().map(|&l| f64::from(l)).sum::<f64>() / pass.len().max(1) as f64
}

/// Largest difference between an entry of these maps and the identity.
fn farthest(maps: &[[f32; 12]]) -> f32 {
    let off = |map: &[f32; 12]| map.iter().zip(IDENTITY).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    maps.iter().map(off).fold(0.0, f32::max)
}

/// The first pass through the photos, the last one and eight between them, with their step numbers.
fn passes(losses: &[f32], photos: usize) -> Vec<(String, &[f32])> {
    let all: Vec<&[f32]> = losses.chunks(photos.max(1)).collect();
    let shown = all.len().min(10);
    let at = |i: usize| i * (all.len() - 1) / (shown - 1).max(1);
    let named = |i: usize| {
        let first = i * photos.max(1);
        (format!("{} to {}", first + 1, first + all[i].len()), all[i])
    };
    (0..shown).map(|i| named(at(i))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_are_the_first_the_last_and_some_between() {
        let losses: Vec<f32> = (0..1005).map(|i| i as f32).collect();
        let named = |n: usize, photos: usize| {
            passes(&losses[..n], photos).into_iter().map(|(name, pass)| (name, pass[0])).collect::<Vec<_>>()
        };
        assert_eq!(named(3, 7), [("1 to 3".into(), 0.0)]);
        assert_eq!(named(10, 7), [("1 to 7".into(), 0.0), ("8 to 10".into(), 7.0)]);
        let many = named(1005, 10);
        assert_eq!((many.len(), &many[0].0[..], &many[9].0[..]), (10, "1 to 10", "1001 to 1005"));
        assert!(many.is_sorted_by(|a, b| a.1 < b.1) && named(0, 7).is_empty());
    }
}
