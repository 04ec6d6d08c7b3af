//! One row of the table: a comparison, its errors, and whether they are within the bounds.

// Conditions are written so that NaN fails: `!(x <= limit)` is intended.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

use serde::Serialize;

use super::bounds::{self, Bound};

/// Errors of one stage in one variant. With several groups of numbers (parameter classes, fields), each is
/// the worst group's.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Errors {
    /// Largest difference, relative to the group's largest value.
    pub max: Option<f64>,
    /// ‖got − want‖₂ / ‖want‖₂.
    pub relative_l2: Option<f64>,
    /// 1 − cosine of the angle between gradients.
    pub cosine_loss: Option<f64>,
    /// Σ(got − want) / Σ|want| of gradients, with its sign.
    pub bias: Option<f64>,
    /// Fraction of decisions (pixels, Gaussians, tiles) that differ from float64, all at a threshold.
    pub flips: Option<f64>,
    /// Number of decisions that differ without a threshold near, and of words that must not differ.
    pub unequal: Option<u64>,
}

/// A violated bound.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Breach {
    /// Name of the measure in [`Errors`].
    pub measure: &'static str,
    /// Measured value.
    pub value: f64,
    /// Limit from [`Bound`].
    pub limit: f64,
}

/// Result of one stage in one variant.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Row {
    /// See [`Bound::stage`].
    pub stage: &'static str,
    /// The variant's constants and input.
    pub variant: String,
    /// Errors against the twin.
    pub errors: Errors,
    /// Violated bounds; empty if the row passes.
    pub breaches: Vec<Breach>,
    /// Whether no bound notices a twin that is off by [`Options::perturb`](super::Options::perturb); false if that is 0.
    pub blind: bool,
    /// Seconds per call on the device; `None` without timestamps.
    pub time: Option<f64>,
    #[serde(skip)]
    perturb: f64,
}

impl Row {
    pub(super) fn new(stage: &'static str, variant: impl Into<String>, perturb: f64) -> Self {
        Row { stage, variant: variant.into(), perturb, ..Row::default() }
    }

    /// Compares numbers of one group with the twin's.
    pub(super) fn numbers(&mut self, pairs: impl IntoIterator<Item = (f32, f64)>) {
        self.group(pairs, false);
    }

    /// Compares a gradient, including its direction and bias.
    pub(super) fn gradients(&mut self, pairs: impl IntoIterator<Item = (f32, f64)>) {
        self.group(pairs, true);
    }

    fn group(&mut self, pairs: impl IntoIterator<Item = (f32, f64)>, gradient: bool) {
        let (mut difference, mut want2, mut got2, mut dot) = (0.0, 0.0, 0.0, 0.0);
        let (mut most, mut largest, mut signed, mut size) = (0.0f64, 0.0f64, 0.0, 0.0);
        let mut not_a_number = false;
        for (got, want) in pairs {
            let (got, want) = (f64::from(got), want * (1.0 + self.perturb));
            let off = got - want;
            // max() ignores NaN, sums propagate it.
            not_a_number |= off.is_nan();
            difference += off * off;
            want2 += want * want;
            got2 += got * got;
            dot += got * want;
            most = most.max(off.abs());
            largest = largest.max(want.abs());
            signed += off;
            size += want.abs();
        }
        // 0 against an expected 0 is correct; any other value against 0 is infinitely wrong.
        let ratio = |a: f64, b: f64| if a == 0.0 && b == 0.0 { 0.0 } else { a / b };
        let most = if not_a_number { f64::NAN } else { ratio(most, largest) };
        let e = &mut self.errors;
        raise(&mut e.max, most);
        raise(&mut e.relative_l2, ratio(difference.sqrt(), want2.sqrt()));
        if gradient {
            raise(&mut e.cosine_loss, ratio((want2 * got2).sqrt() - dot, (want2 * got2).sqrt()).max(0.0));
            let bias = ratio(signed, size);
            if e.bias.is_none_or(|b| !(bias.abs() <= b.abs())) {
                e.bias = Some(bias);
            }
        }
    }

    /// Adds errors that no bound allows.
    pub(super) fn unequal(&mut self, count: u64) {
        *self.errors.unequal.get_or_insert(0) += count;
    }

    /// Adds `count` of `of` decisions that differ, each within its margin.
    pub(super) fn flips(&mut self, count: usize, of: usize) {
        raise(&mut self.errors.flips, count as f64 / of.max(1) as f64);
    }

    /// Raises the errors to the worse of both.
    pub(super) fn worsen(&mut self, by: &Errors) {
        let e = &mut self.errors;
        let pairs = [(&mut e.max, by.max), (&mut e.relative_l2, by.relative_l2), (&mut e.cosine_loss, by.cosine_loss)];
        pairs.into_iter().for_each(|(old, new)| new.into_iter().for_each(|new| raise(old, new)));
        if let Some(bias) = by.bias
            && e.bias.is_none_or(|old| !(bias.abs() <= old.abs()))
        {
            e.bias = Some(bias);
        }
    }

    /// Whether the row passes.
    pub fn is_ok(&self) -> bool {
        self.breaches.is_empty() && !self.blind
    }

    /// Compares the errors with the bounds, and fills [`Row::breaches`].
    pub(super) fn judge(&mut self) {
        let Errors { max, relative_l2, cosine_loss, bias, flips, unequal } = self.errors;
        let mut check = |measure, value: Option<f64>, limit: f64| {
            if let Some(value) = value
                && !(value.abs() <= limit)
            {
                self.breaches.push(Breach { measure, value, limit });
            }
        };
        check("unequal", unequal.map(|n| n as f64), 0.0);
        let bound = bounds::of(self.stage).unwrap_or(Bound::exact(self.stage, ""));
        check("max", max, bound.max);
        check("relative L2", relative_l2, bound.relative_l2);
        // The angle φ between got and want has sin φ ≤ the relative L2 error, so 1 − cos φ is at most its
        // square.
        check("1 - cosine", cosine_loss, bound.relative_l2 * bound.relative_l2);
        check("bias", bias, bound.bias);
        check("flips", flips, bound.flips);
    }
}

/// Keeps the larger value; NaN counts as the largest.
fn raise(old: &mut Option<f64>, new: f64) {
    if old.is_none_or(|old| !(new <= old) && !old.is_nan()) {
        *old = Some(new);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(perturb: f64) -> Row {
        Row::new("blend", "", perturb)
    }

    #[test]
    fn the_worst_group_counts() {
        let mut row = row(0.0);
        row.gradients([(3.0, 3.0), (4.0, 4.0)]);
        row.gradients([(0.0, 0.0)]);
        assert_eq!(row.errors.relative_l2, Some(0.0));
        row.gradients([(3.0, 3.0), (5.0, 4.0)]);
        row.gradients([(1.0, 1.0)]);
        assert_eq!((row.errors.max, row.errors.relative_l2), (Some(0.25), Some(0.2)));
        assert_eq!(row.errors.bias, Some(1.0 / 7.0));
    }

    #[test]
    fn nan_breaks_the_bound() {
        for pair in [(f32::NAN, 1.0), (f32::INFINITY, 1.0), (1.0, 0.0)] {
            let mut row = row(0.0);
            row.numbers([(1.0, 1.0), pair]);
            row.numbers([(1.0, 1.0)]);
            row.judge();
            assert!(pair == (1.0, 0.0) || row.breaches.len() == 2, "{row:?}");
            let mut row = Row::new("blend", "", 0.0);
            row.gradients([pair]);
            row.judge();
            assert!(!row.breaches.is_empty(), "{row:?}");
        }
    }

    #[test]
    fn a_perturbed_twin_is_noticed() {
        let mut row = row(1e-3);
        row.numbers([(1.0, 1.0)]);
        row.judge();
        assert_eq!(row.breaches.len(), 2);
    }
}
