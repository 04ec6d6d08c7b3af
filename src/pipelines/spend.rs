//! What an augmentation may spend, what each thing that it can be spent on gains, and the plan that follows (method, section 7).
//!
//! One currency: the fall of the squared error, summed over pixels and channels of all training views.

use serde::{Deserialize, Serialize};

use crate::{data::scene_bytes, scene::Gaussians};

/// Gaussians for each of the base at most where their gain says how many are added.
pub const MOST_BY_GAIN: f64 = 0.25;
/// The same where bytes say it.
pub const MOST_BY_BYTES: f64 = 1.0;

/// Whether Gaussians are weighed against training on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Weigh {
    /// What training on gains is not asked.
    #[default]
    Not,
    /// It is told; the budget is spent all the same.
    Tell,
    /// Gaussians that gain less than training on are not placed.
    Limit,
}

/// Gaussians and bytes that an augmentation may add.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Allowance {
    /// Of either kind.
    pub gaussians: u32,
    /// In a file; `None`: as many as they take.
    pub bytes: Option<u64>,
    plain_bytes: u64,
    lobe_bytes: u64,
}

impl Allowance {
    /// At most `ratio` Gaussians for each of `base`, and `bytes`.
    pub fn new(base: &Gaussians, ratio: f64, bytes: Option<u64>) -> Self {
        Allowance {
            gaussians: (ratio * base.len() as f64).ceil() as u32,
            bytes,
            plain_bytes: scene_bytes(1, 0, base.sh_degree),
            lobe_bytes: scene_bytes(0, 1, base.sh_degree),
        }
    }

    /// Gaussians that may still be added beside so many, whatever their kind.
    pub fn left(&self, plain: u32, lobes: u32) -> u32 {
        let count = self.gaussians.saturating_sub(plain.saturating_add(lobes));
        let Some(bytes) = self.bytes else { return count };
        let left = bytes.saturating_sub(self.taken(plain, lobes)) / self.lobe_bytes;
        u32::try_from(left).unwrap_or(u32::MAX).min(count)
    }

    /// Bytes of so many Gaussians in a file.
    pub fn taken(&self, plain: u32, lobes: u32) -> u64 {
        u64::from(plain) * self.plain_bytes + u64::from(lobes) * self.lobe_bytes
    }
}

/// What training the base on gains, from a short run of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrainingOn {
    /// Squared error of the base as it was.
    pub before: f64,
    /// After the short run.
    pub after: f64,
    /// Steps of it.
    pub steps: u32,
}

impl TrainingOn {
    /// Of `steps` steps: gains go with the square root of the steps.
    pub fn gain(&self, steps: u32) -> f64 {
        // NaN gains nothing.
        (self.before - self.after).max(0.0) * (f64::from(steps) / f64::from(self.steps.max(1))).sqrt()
    }

    /// What a Gaussian must gain to be worth its time: with one of `gaussians` more each of `steps` steps takes so much longer that
    /// steps / gaussians more of them would take as long, and the last steps gain half of what they gain on the mean.
    pub fn least_gain(&self, steps: u32, gaussians: u32) -> f64 {
        0.5 * self.gain(steps) / f64::from(gaussians.max(1))
    }
}

/// What was chosen of a kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Spent {
    /// Candidates that gain most of all that they overlap.
    pub chosen: u32,
    /// Those of them that are placed at first.
    pub placed: u32,
    /// What these gain in the training views, dB, before anything learns.
    pub gain_db: f64,
    /// The same for a thousand of them.
    pub db_per_thousand: f64,
    /// The same for a million bytes.
    pub db_per_megabyte: f64,
}

/// What is spent on which, known before the joint phase.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Spending {
    /// Gaussians that may be added, and those that are at first.
    pub gaussians_allowed: u32,
    /// See `gaussians_allowed`.
    pub gaussians_at_first: u32,
    /// Bytes that added Gaussians may take; null: as many as they do.
    pub bytes_allowed: Option<u64>,
    /// Placements in all.
    pub placements: u32,
    /// Of the joint phase.
    pub steps: u32,
    /// What training the base on for as many steps gains in the training views; null where that was not asked.
    pub training_on_db: Option<f64>,
    /// What a thousand Gaussians must gain at least, dB; 0: anything.
    pub least_db_per_thousand: f64,
    /// Gaussians with lobes.
    pub lobes: Spent,
    /// Gaussians without, for the base.
    pub plain: Spent,
    /// Candidates that were drawn.
    pub drawn: u32,
    /// Of these: gain nothing in all views together, or overlap one that gains more.
    pub no_gain: u32,
    /// Chosen, but gain less than training on.
    pub below_training_on: u32,
    /// Chosen, but more than may be placed at first.
    pub beyond: u32,
}

/// What a placement found.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Choice {
    /// What each chosen candidate gains, and whether it has a lobe; in the order of falling gain.
    pub gains: Vec<(f32, bool)>,
    /// Candidates that were drawn.
    pub drawn: u32,
    /// Squared error of all views.
    pub squared_error: f64,
}

/// PSNR that a gain brings, in dB, to first order: so that the gains of several add up.
fn decibels(gain: f64, squared_error: f64) -> f64 {
    if squared_error > 0.0 { 10.0 / std::f64::consts::LN_10 * gain / squared_error } else { 0.0 }
}

impl Spending {
    /// Of the first placement, which may place `first` Gaussians that gain `least` each.
    pub fn new(
        allowance: &Allowance,
        [first, placements, steps]: [u32; 3],
        choice: &Choice,
        least: f32,
        training_on: Option<&TrainingOn>,
    ) -> Self {
        let enough = choice.gains.iter().take_while(|(gain, _)| *gain >= least).count();
        let placed = enough.min(first as usize);
        let all = choice.squared_error;
        let of = |lobe: bool| {
            let chosen = choice.gains.iter().filter(|(_, has)| *has == lobe).count() as u32;
            let gains =
                || choice.gains[..placed].iter().filter(|(_, has)| *has == lobe).map(|(gain, _)| f64::from(*gain));
            let (count, gain_db) = (gains().count() as u32, decibels(0.0 + gains().sum::<f64>(), all));
            let bytes = if lobe { allowance.lobe_bytes } else { allowance.plain_bytes } as f64 * f64::from(count);
            let per = |much: f64| if count > 0 { gain_db / much } else { 0.0 };
            let (db_per_thousand, db_per_megabyte) = (per(f64::from(count) / 1e3), per(bytes / 1e6));
            Spent { chosen, placed: count, gain_db, db_per_thousand, db_per_megabyte }
        };
        let chosen = choice.gains.len() as u32;
        Spending {
            gaussians_allowed: allowance.left(0, 0),
            gaussians_at_first: first,
            bytes_allowed: allowance.bytes,
            placements,
            steps,
            training_on_db: training_on.map(|on| decibels(on.gain(steps), all)),
            least_db_per_thousand: 1e3 * decibels(least.into(), all),
            lobes: of(true),
            plain: of(false),
            drawn: choice.drawn,
            no_gain: choice.drawn.saturating_sub(chosen),
            below_training_on: chosen - enough as u32,
            beyond: (enough - placed) as u32,
        }
    }

    /// Gaussians that are placed at first.
    pub fn placed(&self) -> u32 {
        self.lobes.placed + self.plain.placed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn base(count: usize, sh_degree: u32) -> Gaussians {
        Gaussians { sh_degree, means: vec![[0.0; 3]; count], ..Default::default() }
    }

    #[test]
    fn the_tighter_budget_wins_and_is_never_overrun() {
        for sh_degree in 0..=3 {
            for (ratio, bytes) in
                [(0.1, None), (0.1, Some(0)), (0.1, Some(9_999)), (10.0, Some(123_456)), (0.0, Some(99))]
            {
                let allowance = Allowance::new(&base(1000, sh_degree), ratio, bytes);
                for plain in [0, 1, 7, 90] {
                    let more = allowance.left(plain, 3);
                    assert!(more == 0 || plain + 3 + more <= (1000.0 * ratio) as u32);
                    // Whatever the kind of what comes.
                    for lobes in [0, more / 2, more] {
                        let taken = allowance.taken(plain + more - lobes, 3 + lobes);
                        assert!(
                            more == 0 || bytes.is_none_or(|bytes| taken <= bytes),
                            "{ratio} {bytes:?} {plain} {lobes}"
                        );
                    }
                }
            }
        }
        assert_eq!(Allowance::new(&base(1000, 3), 0.1, None).left(0, 0), 100);
        assert_eq!(Allowance::new(&base(1000, 3), 0.1, Some(u64::MAX)).left(40, 30), 30);
    }

    #[test]
    fn training_on_gains_with_the_root_of_its_steps() {
        let on = TrainingOn { before: 100.0, after: 99.0, steps: 50 };
        assert_eq!([on.gain(50), on.gain(450), on.gain(0)], [1.0, 3.0, 0.0]);
        assert_eq!(on.least_gain(450, 1000), 0.0015);
        for after in [101.0, f64::NAN] {
            assert_eq!(TrainingOn { after, ..on }.least_gain(450, 1000), 0.0);
        }
    }

    #[test]
    fn a_plan_says_what_is_placed_and_why_the_rest_is_not() {
        let allowance = Allowance::new(&base(40, 3), 0.2, None);
        let gains = vec![(10.0, true), (5.0, false), (4.0, true), (2.0, true), (1.0, false), (0.5, true)];
        let choice = Choice { gains, drawn: 90, squared_error: 1000.0 };
        let on = TrainingOn { before: 1000.0, after: 990.0, steps: 10 };
        let plan = Spending::new(&allowance, [3, 3, 90], &choice, 1.0, Some(&on));
        assert_eq!((plan.gaussians_allowed, plan.placed(), plan.lobes.placed, plan.plain.placed), (8, 3, 2, 1));
        assert_eq!((plan.lobes.chosen, plan.plain.chosen), (4, 2));
        assert_eq!((plan.no_gain, plan.below_training_on, plan.beyond), (84, 1, 2));
        // A thousandth less squared error is 0.0043429 dB.
        let near = |got: f64, thousandths: f64| (got / (0.0043429448 * thousandths) - 1.0).abs() < 1e-6;
        assert!(near(plan.lobes.gain_db, 14.0) && near(plan.training_on_db.unwrap(), 30.0));
        assert!(near(plan.plain.db_per_thousand, 5e3) && near(plan.plain.db_per_megabyte, 5e6 / 248.0));
        let none =
            Spending::new(&allowance, [3, 3, 90], &Choice { squared_error: 0.0, ..Choice::default() }, 0.0, None);
        assert_eq!((none.placed(), none.lobes, none.training_on_db), (0, Spent::default(), None));
    }
}
