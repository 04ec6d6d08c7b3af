//! The budget of an augmentation: its limits, the gain of each way to spend it, and the resulting plan
//! (method, section 7).
//!
//! Gains have one unit: the fall of the squared error, summed over pixels and channels of all training views.

use serde::{Deserialize, Serialize};

use super::bands::Promotion;
use crate::{
    data::{band_bytes, gaussian_bytes, scene_bytes},
    scene::Scene,
};

/// Maximum number of added Gaussians relative to the base, if gains decide the number.
pub const MOST_BY_GAIN: f64 = 0.25;
/// Maximum number of added Gaussians relative to the base, if bytes limit it.
pub const MOST_BY_BYTES: f64 = 1.0;

/// Size of a scene before the joint phase, of that after it, if its total size has a limit. In the joint phase 7 to 18 % of the bytes fade;
/// if fewer do, the faintest are left out (docs/experiments/2026-11-30-number.md).
pub const OVERFILL: f64 = 1.1;

/// Selects whether Gaussians compete with longer training of the base.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Weigh {
    /// Do not measure the gain of longer training.
    #[default]
    Not,
    /// Measure and report it; spend the budget regardless.
    Tell,
    /// Only place Gaussians that gain more than longer training.
    Limit,
}

/// Limits of an augmentation, in Gaussians and bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Allowance {
    /// Maximum number of added Gaussians of either kind.
    pub gaussians: u32,
    /// Maximum size in a file; `None`: unlimited.
    pub bytes: Option<u64>,
    plain_bytes: u64,
    lobe_bytes: u64,
    /// Number of Gaussians in the base.
    base: u32,
}

impl Allowance {
    /// Limits to `ratio` times the number of Gaussians in the base of `scene`, and to `bytes`. Gaussians with lobes have
    /// harmonics of `lobe_degree`.
    pub fn new(scene: &Scene, lobe_degree: u32, ratio: f64, bytes: Option<u64>) -> Self {
        Allowance {
            gaussians: (ratio * scene.base.len() as f64).ceil() as u32,
            bytes,
            plain_bytes: gaussian_bytes(scene.plain_degree(), false),
            lobe_bytes: gaussian_bytes(lobe_degree, true),
            base: scene.base.len() as u32,
        }
    }

    /// Maximum numbers of added Gaussians: if all have a lobe, and if none has.
    pub fn most(&self) -> [u32; 2] {
        self.prices().map(|price| self.fitting(self.gaussians, self.bytes, price))
    }

    /// Maximum number of Gaussians with lobes, if `plain` Gaussians without are added too.
    pub fn lobes_beside(&self, plain: u32) -> u32 {
        let left = self.bytes.map(|bytes| bytes.saturating_sub(self.taken(plain, 0)));
        self.fitting(self.gaussians.saturating_sub(plain), left, self.lobe_bytes)
    }

    fn fitting(&self, count: u32, bytes: Option<u64>, price: u64) -> u32 {
        bytes.map_or(count, |bytes| u32::try_from(bytes / price).unwrap_or(u32::MAX).min(count))
    }

    /// Gaussians and bytes left for placement `index` of `placements`, given the numbers placed so far. The
    /// first placement may use half of the total, and always the bytes of one Gaussian if the total allows
    /// it.
    pub fn left(&self, [index, placements]: [u32; 2], plain: u32, lobes: u32) -> (u32, Option<u64>) {
        let gaussians = allowed(self.gaussians.into(), index, placements) as u32;
        let one = |bytes: u64| bytes.min(self.lobe_bytes).min(self.plain_bytes);
        let most = |bytes| allowed(bytes, index, placements).max(one(bytes));
        let bytes = self.bytes.map(|bytes| most(bytes).saturating_sub(self.taken(plain, lobes)));
        (gaussians.saturating_sub(plain.saturating_add(lobes)), bytes)
    }

    /// Price in bytes of a Gaussian with a lobe, and of a plain one.
    pub fn prices(&self) -> [u64; 2] {
        [self.lobe_bytes, self.plain_bytes]
    }

    /// Size in a file of these numbers of Gaussians, bytes.
    pub fn taken(&self, plain: u32, lobes: u32) -> u64 {
        u64::from(plain) * self.plain_bytes + u64::from(lobes) * self.lobe_bytes
    }
}

/// Part of `most` allowed after placement `index` of `placements`: half after the first.
fn allowed(most: u64, index: u32, placements: u32) -> u64 {
    match placements {
        0 | 1 => most,
        _ => most.div_ceil(2) + (u128::from(most / 2) * u128::from(index) / u128::from(placements - 1)) as u64,
    }
}

/// Leaves out the Gaussians with the lowest opacity so that `scene` takes at most `bytes` in a file; those with bands in a mixed scene go last.
/// `greatest` has the opacity of each supplementary Gaussian.
pub fn leave_out_faintest(scene: &mut Scene, greatest: &[f64], bytes: u64) {
    let count = scene.base.len();
    let constants = if scene.mixed { scene.base.constants() } else { count };
    let plain = gaussian_bytes(scene.plain_degree(), false);
    let banded = plain + band_bytes(scene.base.sh_degree);
    let lobed = scene.supplement.as_ref().map_or(0, |supplement| gaussian_bytes(supplement.gaussians.sh_degree, true));
    let of_base = scene.base.opacities.iter().map(|&logit| 1.0 / (1.0 + (-f64::from(logit)).exp()));
    let opacities: Vec<f64> = of_base.chain(greatest.iter().copied()).collect();
    let has_bands = |i| (constants..count).contains(&i);
    let mut order: Vec<usize> = (0..opacities.len()).collect();
    order.sort_by(|&a, &b| has_bands(a).cmp(&has_bands(b)).then(opacities[a].total_cmp(&opacities[b])));
    let mut taken = scene_bytes(scene);
    let mut keep = vec![true; opacities.len()];
    for i in order {
        if taken <= bytes {
            break;
        }
        keep[i] = false;
        taken -= match i {
            _ if i >= count => lobed,
            _ if has_bands(i) => banded,
            _ => plain,
        };
    }
    let shown: Vec<usize> = (0..count).filter(|&i| keep[i]).collect();
    scene.base = scene.base.reordered(&shown);
    scene.supplement.iter_mut().for_each(|supplement| supplement.retain(|i| keep[count + i]));
}

/// Gain of longer training of the base, measured in a short run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrainingOn {
    /// Squared error of the original base.
    pub before: f64,
    /// Squared error after the short run.
    pub after: f64,
    /// Steps of the short run.
    pub steps: u32,
    /// Wall-clock seconds of the short run.
    pub seconds: f64,
}

impl TrainingOn {
    /// Extrapolated gain of `steps` steps: gains grow with the square root of the number of steps.
    pub fn gain(&self, steps: u32) -> f64 {
        // NaN counts as no gain.
        (self.before - self.after).max(0.0) * (f64::from(steps) / f64::from(self.steps.max(1))).sqrt()
    }

    /// Minimum gain that is worth a Gaussian's time. It slows down each of `steps` steps by 1 / `gaussians`,
    /// the time of steps / gaussians more steps; the last steps gain half of the mean.
    pub fn least_gain(&self, steps: u32, gaussians: u32) -> f64 {
        0.5 * self.gain(steps) / f64::from(gaussians.max(1))
    }
}

/// Choice and gain of one kind of Gaussian.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Spent {
    /// Candidates that gain more than all they overlap.
    pub chosen: u32,
    /// Number of these in the first placement.
    pub placed: u32,
    /// Gain of the first placement in the training views, dB, before the joint phase.
    pub gain_db: f64,
    /// `gain_db` per thousand Gaussians.
    pub db_per_thousand: f64,
    /// `gain_db` per million bytes.
    pub db_per_megabyte: f64,
    /// `gain_db` per second that they add to the joint phase; null if no step was timed before.
    #[serde(default)]
    pub db_per_second: Option<f64>,
}

/// The plan of an augmentation, known before the joint phase.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Spending {
    /// Maximum number of added Gaussians, and the maximum of the first placement.
    pub gaussians_allowed: u32,
    /// See `gaussians_allowed`.
    pub gaussians_at_first: u32,
    /// Maximum bytes of added Gaussians; null: unlimited.
    pub bytes_allowed: Option<u64>,
    /// Number of placements.
    pub placements: u32,
    /// Steps of the joint phase.
    pub steps: u32,
    /// Gain of training the base for the same number of steps, in the training views; null if not measured.
    pub training_on_db: Option<f64>,
    /// `training_on_db` per second.
    #[serde(default)]
    pub training_on_db_per_second: Option<f64>,
    /// Minimum gain per thousand Gaussians, dB; 0: none.
    pub least_db_per_thousand: f64,
    /// Gaussians with lobes.
    pub lobes: Spent,
    /// Candidates of `lobes`, with their gains as plain Gaussians.
    #[serde(default)]
    pub without_lobes: Spent,
    /// Plain Gaussians, for the base.
    pub plain: Spent,
    /// Gaussians of the base that get bands.
    #[serde(default)]
    pub bands: Spent,
    /// Candidates, and those left out.
    #[serde(flatten)]
    pub candidates: Candidates,
}

/// Number of candidates of the first placement, and of those left out by reason.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Candidates {
    /// Number of candidates drawn.
    pub drawn: u32,
    /// Candidates without a gain over all views, or overlapping one with a higher gain.
    pub no_gain: u32,
    /// Chosen, but with a lower gain than longer training.
    pub below_training_on: u32,
    /// Chosen, but beyond the maximum of the first placement.
    pub beyond: u32,
}

/// A chosen candidate.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Chosen {
    /// Fall of the squared error.
    pub gain: f32,
    /// Whether it has a lobe.
    pub lobe: bool,
    /// Gain without a lobe, at the size, opacity and color that are then best.
    pub plain: f32,
}

/// Result of choosing candidates.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Choice {
    /// Candidates in order of falling gain.
    pub chosen: Vec<Chosen>,
    /// Number of candidates drawn.
    pub drawn: u32,
    /// Squared error of all views.
    pub squared_error: f64,
}

/// First-order gain in PSNR, dB, so that gains add up.
fn decibels(gain: f64, squared_error: f64) -> f64 {
    if squared_error > 0.0 { 10.0 / std::f64::consts::LN_10 * gain / squared_error } else { 0.0 }
}

impl Spending {
    /// Plan of the first placement; a Gaussian must gain at least `least`.
    pub fn new(
        allowance: &Allowance,
        [placements, steps]: [u32; 2],
        choice: &Choice,
        least: f32,
        training_on: Option<&TrainingOn>,
    ) -> Self {
        let enough = choice.chosen.iter().take_while(|chosen| chosen.gain >= least).count();
        let (first, bytes) = allowance.left([0, placements], 0, 0);
        let mut taken = 0;
        let within = |chosen: &&Chosen| {
            taken += if chosen.lobe { allowance.lobe_bytes } else { allowance.plain_bytes };
            bytes.is_none_or(|bytes| taken <= bytes)
        };
        let placed = choice.chosen.iter().take(enough.min(first as usize)).take_while(within).count();
        let all = choice.squared_error;
        // Estimated seconds of the joint phase.
        let seconds = training_on.map(|on| on.seconds * f64::from(steps) / f64::from(on.steps.max(1)));
        let of = |lobe: bool, gain: fn(&Chosen) -> f32, bytes: u64| {
            let chosen = choice.chosen.iter().filter(|chosen| chosen.lobe == lobe).count() as u32;
            let gains =
                || choice.chosen[..placed].iter().filter(|chosen| chosen.lobe == lobe).map(|c| f64::from(gain(c)));
            let (count, gain_db) = (gains().count() as u32, decibels(0.0 + gains().sum::<f64>(), all));
            let bytes = bytes as f64 * f64::from(count);
            let per = |much: f64| if count > 0 { gain_db / much } else { 0.0 };
            let (db_per_thousand, db_per_megabyte) = (per(f64::from(count) / 1e3), per(bytes / 1e6));
            // Each step takes longer in proportion to the number of Gaussians, at most.
            let takes = seconds.map(|seconds| seconds * f64::from(count) / f64::from(allowance.base.max(1)));
            let db_per_second = takes.map(per).filter(|db| db.is_finite());
            Spent { chosen, placed: count, gain_db, db_per_thousand, db_per_megabyte, db_per_second }
        };
        let training_on_db = training_on.map(|on| decibels(on.gain(steps), all));
        let chosen = choice.chosen.len() as u32;
        let [lobes, plain] = allowance.most();
        let most = lobes.max(plain);
        Spending {
            gaussians_allowed: most,
            gaussians_at_first: allowed(most.into(), 0, placements) as u32,
            bytes_allowed: allowance.bytes,
            placements,
            steps,
            training_on_db,
            training_on_db_per_second: training_on_db
                .zip(seconds)
                .map(|(db, seconds)| db / seconds)
                .filter(|db| db.is_finite()),
            least_db_per_thousand: 1e3 * decibels(least.into(), all),
            lobes: of(true, |c| c.gain, allowance.lobe_bytes),
            without_lobes: of(true, |c| c.plain, allowance.plain_bytes),
            plain: of(false, |c| c.gain, allowance.plain_bytes),
            bands: Spent::default(),
            candidates: Candidates {
                drawn: choice.drawn,
                no_gain: choice.drawn.saturating_sub(chosen),
                below_training_on: chosen - enough as u32,
                beyond: (enough - placed) as u32,
            },
        }
    }

    /// The plan with bands for the Gaussians of a promotion.
    pub fn with_bands(mut self, promotion: &Promotion, choice: &Choice) -> Self {
        let (placed, gain_db) = (promotion.gains.len() as u32, decibels(promotion.gain(), choice.squared_error));
        let per = |much: f64| if placed > 0 { gain_db / much } else { 0.0 };
        self.bands = Spent {
            chosen: placed,
            placed,
            gain_db,
            db_per_thousand: per(f64::from(placed) / 1e3),
            db_per_megabyte: per(promotion.bytes() as f64 / 1e6),
            db_per_second: None,
        };
        self
    }

    /// Number of Gaussians in the first placement.
    pub fn placed(&self) -> u32 {
        self.lobes.placed + self.plain.placed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Gaussians, Lobes, Supplement, layout};

    fn base(count: usize, sh_degree: u32) -> Scene {
        Scene { base: Gaussians { sh_degree, means: vec![[0.0; 3]; count], ..Default::default() }, ..Scene::default() }
    }

    /// Three constants have opacities of 0.1, 0.3 and 0.5, one with bands 0.01, and two with lobes 0.2 and 0.4.
    #[test]
    fn the_faintest_are_left_out_and_those_with_bands_last() {
        let logit = |p: f32| (p / (1.0 - p)).ln();
        let with = |count: usize, sh_degree: u32, opacities: &[f32]| Gaussians {
            sh_degree,
            means: (0..count).map(|i| [i as f32, 0.0, 0.0]).collect(),
            log_scales: vec![[0.0; 3]; count],
            quats: vec![[1.0, 0.0, 0.0, 0.0]; count],
            opacities: opacities.iter().map(|&p| logit(p)).collect(),
            sh: vec![[0.0; 3]; count * layout::coefficients(sh_degree)],
        };
        let mut base = with(4, 1, &[0.1, 0.3, 0.5, 0.01]);
        base.sh[4 * 3 + 1] = [1.0; 3];
        let lobes = Lobes { directions: vec![[0.0, 0.0, 1.0]; 2], widths: vec![1.0; 2], sharpness: vec![1.0; 2] };
        let supplement = Some(Supplement { gaussians: with(2, 0, &[0.9, 0.9]), lobes });
        let whole = Scene { base, supplement, mixed: true, ..Scene::default() };
        let left = |bytes: u64| {
            let mut scene = whole.clone();
            leave_out_faintest(&mut scene, &[0.2, 0.4], bytes);
            assert!(scene_bytes(&scene) <= bytes);
            let of = |gaussians: &Gaussians| gaussians.means.iter().map(|mean| mean[0] as u32).collect::<Vec<_>>();
            (of(&scene.base), of(&scene.supplement.unwrap().gaussians))
        };
        // 56 bytes each, 92 with bands and 76 with a lobe.
        let all = scene_bytes(&whole);
        assert_eq!(all, 3 * 56 + 92 + 2 * 76);
        assert_eq!(left(all), (vec![0, 1, 2, 3], vec![0, 1]));
        assert_eq!(left(all - 1), (vec![1, 2, 3], vec![0, 1]));
        assert_eq!(left(all - 57), (vec![1, 2, 3], vec![1]));
        assert_eq!(left(all - 57 - 76), (vec![2, 3], vec![1]));
        assert_eq!(left(92), (vec![3], vec![]));
        assert_eq!(left(91), (vec![], vec![]));
    }

    #[test]
    fn placements_end_with_all_and_begin_with_half() {
        for most in [0, 1, 2, 7, 400] {
            assert_eq!(allowed(most, 0, 1), most);
            for placements in 2..5 {
                let all: Vec<u64> = (0..placements).map(|k| allowed(most, k, placements)).collect();
                assert!(
                    all.is_sorted() && all[0] == most.div_ceil(2) && all[placements as usize - 1] == most,
                    "{all:?}"
                );
            }
        }
        assert_eq!(allowed(u64::MAX, 2, 3), u64::MAX);
    }

    #[test]
    fn the_tighter_budget_wins_and_is_never_overrun() {
        for sh_degree in 0..=3 {
            for (ratio, bytes) in
                [(0.1, None), (0.1, Some(0)), (0.1, Some(9_999)), (10.0, Some(123_456)), (0.0, Some(99))]
            {
                let (allowance, all) =
                    (Allowance::new(&base(1000, sh_degree), 0, ratio, bytes), (1000.0 * ratio) as u32);
                let within = |plain, lobes| {
                    plain + lobes <= all && bytes.is_none_or(|bytes| allowance.taken(plain, lobes) <= bytes)
                };
                // Exactly this number fits.
                let [lobes, plain] = allowance.most();
                assert!(within(0, lobes) && !within(0, lobes + 1) && within(plain, 0) && !within(plain + 1, 0));
                for plain in [0, 1, 7, 90] {
                    let lobes = allowance.lobes_beside(plain);
                    let full = !within(plain, 0);
                    assert!(if full { lobes == 0 } else { within(plain, lobes) && !within(plain, lobes + 1) });
                    let (count, left) = allowance.left([2, 3], plain, 3);
                    assert!(count == all.saturating_sub(plain + 3) && left.is_some() == bytes.is_some());
                    let left_and_taken = left.map(|left| left + allowance.taken(plain, 3));
                    assert!(left_and_taken.is_none_or(|sum| left == Some(0) || Some(sum) == bytes));
                }
            }
        }
        let allowance = |bytes| Allowance::new(&base(1000, 3), 3, 0.1, bytes);
        assert_eq!((allowance(None).most(), allowance(Some(u64::MAX)).left([2, 3], 40, 30).0), ([100; 2], 30));
        // Three quarters of the total after the second of three placements.
        assert_eq!(allowance(Some(40_000)).left([1, 3], 0, 0), (75, Some(30_000)));
        // 62 and 64 words in a file, and 19 without bands above the constant one.
        assert_eq!(allowance(None).prices(), [256, 248]);
        assert_eq!(Allowance::new(&base(1, 3), 0, 0.1, None).prices(), [76, 248]);
        // Gaussians that are added to a mixed scene have no bands.
        assert_eq!(Allowance::new(&Scene { mixed: true, ..base(1, 3) }, 0, 0.1, None).prices(), [76, 56]);
    }

    #[test]
    fn training_on_gains_with_the_root_of_its_steps() {
        let on = TrainingOn { before: 100.0, after: 99.0, steps: 50, seconds: 1.0 };
        assert_eq!([on.gain(50), on.gain(450), on.gain(0)], [1.0, 3.0, 0.0]);
        assert_eq!(on.least_gain(450, 1000), 0.0015);
        for after in [101.0, f64::NAN] {
            assert_eq!(TrainingOn { after, ..on }.least_gain(450, 1000), 0.0);
        }
    }

    #[test]
    fn a_plan_says_what_is_placed_and_why_the_rest_is_not() {
        let allowance = Allowance::new(&base(40, 3), 3, 0.2, None);
        let chosen = [(10.0, true), (5.0, false), (4.0, true), (2.0, true), (1.0, false), (0.5, true)];
        let chosen =
            chosen.map(|(gain, lobe)| Chosen { gain, lobe, plain: if lobe { gain / 4.0 } else { gain } }).to_vec();
        let choice = Choice { chosen, drawn: 90, squared_error: 1000.0 };
        let on = TrainingOn { before: 1000.0, after: 990.0, steps: 10, seconds: 2.0 };
        let plan = Spending::new(&allowance, [3, 90], &choice, 1.0, Some(&on));
        assert_eq!((plan.gaussians_allowed, plan.gaussians_at_first), (8, 4));
        assert_eq!((plan.placed(), plan.lobes.placed, plan.plain.placed), (4, 3, 1));
        assert_eq!((plan.lobes.chosen, plan.plain.chosen), (4, 2));
        assert_eq!(plan.candidates, Candidates { drawn: 90, no_gain: 84, below_training_on: 1, beyond: 1 });
        // A thousandth less squared error is 0.0043429 dB.
        let near = |got: f64, thousandths: f64| (got / (0.0043429448 * thousandths) - 1.0).abs() < 1e-6;
        assert!(near(plan.lobes.gain_db, 16.0) && near(plan.training_on_db.unwrap(), 30.0));
        // 90 steps take 18 seconds; one more Gaussian adds a fortieth of that.
        assert!(near(plan.training_on_db_per_second.unwrap(), 30.0 / 18.0));
        assert!(near(plan.plain.db_per_second.unwrap(), 5.0 / (18.0 / 40.0)));
        assert!(near(plan.plain.db_per_thousand, 5e3) && near(plan.plain.db_per_megabyte, 5e6 / 248.0));
        // The same candidates without their lobes.
        assert!(near(plan.without_lobes.gain_db, 4.0) && near(plan.without_lobes.db_per_megabyte, 4e6 / (3.0 * 248.0)));
        assert_eq!(plan.without_lobes.placed, 3);
        let none = Spending::new(&allowance, [3, 90], &Choice { squared_error: 0.0, ..Choice::default() }, 0.0, None);
        assert_eq!((none.placed(), none.lobes, none.training_on_db), (0, Spent::default(), None));
        // The first placement has half of the bytes; they run out before the next plain candidate.
        let bytes = Allowance::new(&base(40, 3), 0, 1.0, Some(2 * (76 + 247)));
        let plan = Spending::new(&bytes, [3, 90], &choice, 0.0, None);
        assert_eq!(
            (plan.gaussians_allowed, plan.lobes.placed, plan.plain.placed, plan.candidates.beyond),
            (8, 1, 0, 5)
        );
        assert!(near(plan.lobes.db_per_megabyte, 10e6 / 76.0));
    }
}
