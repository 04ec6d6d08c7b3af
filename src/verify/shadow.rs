//! Compares every dispatch of a pipeline with its twin: the buffers that the kernel writes with those that the twin writes from the same inputs.

// Written so that NaN fails: `!(x <= limit)` is intended.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

use std::{
    borrow::Cow,
    collections::{BTreeMap, HashSet},
    ffi::CStr,
    sync::{Arc, Mutex, MutexGuard},
};

use glam::{DMat3, DQuat, DVec3};
use half::f16;

use super::{
    bounds::{self, Bound},
    judge::Row,
    median,
};
use crate::{
    gpu::{Binding, Constant, ConstantKind, Context, GpuError, Judge, Shadowed},
    reference::{self, adam::unpack_moments, lift_join::find, pursuit::WHOLE},
    scene::color::BETAS,
    stages::{
        constants::{
            density::{BUDGET, MCMC},
            resolve::{RGBA16F, RGBA32F},
        },
        kernels, types,
    },
};

/// How a word of a buffer is compared.
#[derive(Clone, Copy)]
enum Word {
    /// Must be equal.
    Integer,
    /// Is a float, which rounding may change.
    Float,
    /// Holds numbers that rounding may change, one for each function.
    Numbers(&'static [fn(u32) -> f32]),
    /// Holds codes of this many bits. Float32 and float64 may round to adjacent codes, which counts as a flip.
    Codes(u32),
}

/// Collects a row for each stage and variant that runs in its context.
pub(super) struct Shadow {
    perturb: f64,
    /// With the twins as they are, and perturbed.
    found: Arc<Mutex<[Vec<Found>; 2]>>,
}

/// The result of all dispatches of a variant.
struct Found {
    row: Row,
    /// Number of elements that were compared under a bound that allows flips.
    decided: usize,
    /// Number of these that flipped.
    flipped: usize,
    /// Seconds of each dispatch.
    times: Vec<f64>,
}

impl Shadow {
    pub fn new(perturb: f64) -> Self {
        Shadow { perturb, found: Arc::default() }
    }

    /// Opens another context on the device, in which every dispatch is compared.
    ///
    /// # Errors
    /// Those of [`Context::judged`].
    pub fn context(&self, context: &Context) -> Result<Context, GpuError> {
        let (found, perturb) = (self.found.clone(), self.perturb);
        let judge = Arc::new(move |shadowed: &Shadowed<'_>| {
            let [found, perturbed] = &mut *lock(&found);
            judge(found, 0.0, shadowed);
            if perturb > 0.0 {
                judge(perturbed, perturb, shadowed);
            }
        });
        context.judged(Judge { twins: reference::twins(), judge })
    }

    /// Takes the rows collected so far, judged, in the order in which their stages first ran.
    pub fn rows(&self) -> Vec<Row> {
        let [found, perturbed] = std::mem::take(&mut *lock(&self.found));
        let mut rows: Vec<Row> = found.into_iter().map(Found::judged).collect();
        // Both lists have the same stages and variants.
        for (row, perturbed) in rows.iter_mut().zip(perturbed) {
            row.blind = perturbed.judged().breaches.is_empty();
        }
        rows
    }
}

impl Found {
    fn judged(self) -> Row {
        let Found { mut row, decided, flipped, times } = self;
        if decided > 0 {
            row.flips(flipped, decided);
        }
        row.time = (!times.is_empty()).then(|| median(times));
        row.judge();
        row
    }
}

fn lock(found: &Mutex<[Vec<Found>; 2]>) -> MutexGuard<'_, [Vec<Found>; 2]> {
    found.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

fn judge(all: &mut Vec<Found>, perturb: f64, shadowed: &Shadowed<'_>) {
    let variant = variant(shadowed.constants, &shadowed.twin.spec);
    let known = all.iter().position(|found| found.row.stage == shadowed.stage && found.row.variant == variant);
    let at = known.unwrap_or_else(|| {
        let row = Row::new(shadowed.stage, variant, perturb);
        all.push(Found { row, decided: 0, flipped: 0, times: Vec::new() });
        all.len() - 1
    });
    let found = &mut all[at];
    found.times.extend(shadowed.time.map(|time| time.as_secs_f64()));
    if let Some(why) = &shadowed.failed {
        // A twin rejects only inputs that no stage should write.
        tracing::warn!("the twin of {}: {why}", shadowed.stage);
        found.row.unequal(1);
        return;
    }
    let mut bound = bounds::of(shadowed.stage).unwrap_or(Bound::exact(shadowed.stage, ""));
    // Only packed moments are rounded to codes, and only betas have factors near 0, at the end of a lobe. Of others, a step flips where a
    // Gaussian's records cancel.
    let may_flip = holds_packed(shadowed) || shadowed.constant(c"sh_degree") == BETAS;
    let may_cancel = shadowed.stage == "project_backward" && !may_flip;
    match shadowed.stage {
        _ if may_cancel => bound.flips = CANCELLED,
        "adam" if !may_flip => bound.flips = 0.0,
        _ => {}
    }
    let is_left = |binding: &Binding| (shadowed.stage, binding.name) == ("lift_groups", c"group_sizes");
    let written =
        shadowed.bindings.iter().enumerate().filter(|(_, binding)| binding.access.writes() && !is_left(binding));
    let written = written.map(|(i, binding)| {
        let [kernel, twin, before] = [&shadowed.kernel[i], &shadowed.twin.bindings[i], &shadowed.before[i]]
            .map(|b| comparable(shadowed, binding, b.words()));
        let words = words_of(shadowed, binding);
        let is_unordered = is_unordered(shadowed.stage, binding.name);
        Written { binding, words, kernel, twin, before, plane: plane(shadowed, binding), is_unordered, may_cancel }
    });
    let written: Vec<Written<'_>> = written.collect();
    // The numbers of an element whose integers flipped differ too.
    let mut skipped = HashSet::new();
    written.iter().for_each(|buffer| buffer.compare_words(found, &bound, &mut skipped, perturb));
    written.iter().for_each(|buffer| buffer.compare_floats(found, &bound, &skipped, perturb));
}

/// Names a pipeline among those of its kernel by its constants that are neither 0 nor a size.
fn variant(constants: &[Constant], spec: &[(u32, u32)]) -> String {
    let named = constants.iter().filter_map(|constant| {
        let name = constant.name.to_string_lossy();
        let value = spec.iter().find(|(id, _)| *id == constant.id)?.1;
        let size = ["workgroup_size", "tile_width", "tile_height"].contains(&&*name);
        match (constant.kind, value) {
            (_, 0) => None,
            _ if size => None,
            (ConstantKind::Bool, _) => Some(name.replace('_', " ")),
            (ConstantKind::F32, _) => Some(format!("{} {}", name.replace('_', " "), f32::from_bits(value))),
            _ => Some(format!("{} {value}", name.replace('_', " "))),
        }
    });
    named.collect::<Vec<_>>().join(", ")
}

/// Elements in each plane of a page of parameters, which are compared plane by plane; `usize::MAX` for other buffers.
fn plane(shadowed: &Shadowed<'_>, binding: &Binding) -> usize {
    use kernels::{adam, density_apply, density_noise, project_backward};
    let push = &shadowed.twin.push;
    let stride = match shadowed.stage {
        "project_backward" => bytemuck::pod_read_unaligned::<project_backward::Push>(push).stride,
        "adam" => bytemuck::pod_read_unaligned::<adam::Push>(push).stride,
        "density_apply" => bytemuck::pod_read_unaligned::<density_apply::Push>(push).stride,
        "density_noise" => bytemuck::pod_read_unaligned::<density_noise::Push>(push).stride,
        _ => return usize::MAX,
    };
    let name = binding.name.to_string_lossy();
    let in_planes = ["geometry", "sh", "lobes"].iter().any(|array| name.starts_with(array));
    if in_planes { stride.max(1) as usize } else { usize::MAX }
}

/// Brings buffers whose contents have several equivalent forms into one form.
fn comparable<'a>(shadowed: &Shadowed<'_>, binding: &Binding, words: &'a [u32]) -> Cow<'a, [u32]> {
    match (shadowed.stage, binding.name.to_bytes()) {
        // The shape of the forest depends on the order of the unions, its roots do not.
        ("lift_join", b"labels") => {
            let [sets, firsts] = [c"point_sets", c"point_firsts"].map(|name| shadowed.before(name));
            let mut labels = words.to_vec();
            for (at, &set) in sets.iter().enumerate().take(words.len()) {
                let Some(&first) = firsts.get(set as usize) else { continue };
                let first = first as usize;
                labels[at] = find(&mut labels[first..], (at - first) as u32);
            }
            labels.into()
        }
        // Axes may point either way, and axes of equal length may be swapped: covariances are compared. Means are relative to a camera,
        // because a scene may lie far from the origin.
        ("lift_pca", b"lifts") => {
            let views: &[types::View] = bytemuck::cast_slice(shadowed.before(c"views"));
            let eye = views.first().map_or([0.0; 3], |view| view.eye);
            let mut lifts: Vec<types::Lift> = bytemuck::cast_slice(words).to_vec();
            for lift in &mut lifts {
                (0..3).for_each(|c| lift.mean[c] -= eye[c]);
                let [w, x, y, z] = lift.quat.map(f64::from);
                let r = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
                let scaled = r * DMat3::from_diagonal(DVec3::from(lift.log_scale.map(|l| (2.0 * f64::from(l)).exp())));
                let m = (scaled * r.transpose()).to_cols_array();
                // Entries are relative to the largest: a small axis is known less precisely, relative to itself.
                let largest = m.iter().fold(f64::MIN_POSITIVE, |most, v| most.max(v.abs()));
                lift.log_scale = [0, 4, 8].map(|k| (m[k] / largest) as f32);
                lift.quat = [(m[1] / largest) as f32, (m[2] / largest) as f32, (m[5] / largest) as f32, 0.0];
            }
            bytemuck::cast_slice(&lifts).to_vec().into()
        }
        _ => words.into(),
    }
}

fn low_half(word: u32) -> f32 {
    f16::from_bits(word as u16).to_f32()
}

fn high_half(word: u32) -> f32 {
    f16::from_bits((word >> 16) as u16).to_f32()
}

fn first_moment(word: u32) -> f32 {
    unpack_moments(word)[0] as f32
}

fn second_moment(word: u32) -> f32 {
    unpack_moments(word)[1] as f32
}

/// Whether a learning kernel's moments are packed into words; sums of gradients are not.
fn holds_packed(shadowed: &Shadowed<'_>) -> bool {
    shadowed.constant(c"packed") != 0 && shadowed.constant(c"accumulate") == 0
}

/// Says how the words of each element of a buffer are compared.
fn words_of(shadowed: &Shadowed<'_>, binding: &Binding) -> Vec<Word> {
    (0..binding.element_bytes as usize / 4).map(|word| word_of(shadowed, binding, word)).collect()
}

/// Says how a word of each element of a buffer is compared.
fn word_of(shadowed: &Shadowed<'_>, binding: &Binding, word: usize) -> Word {
    let halves = Word::Numbers(&[low_half, high_half]);
    // Kernels declare sort keys and packed values as integers.
    match (shadowed.stage, binding.name.to_bytes()) {
        ("project", b"depth_keys") => Word::Float,
        ("project", b"packed_splats") => match word {
            0..=4 => Word::Float,
            5 => Word::Numbers(&[|word| (word & 0xffff) as f32, high_half]),
            _ => halves,
        },
        ("density_weigh", b"keys") => match shadowed.constant(c"strategy") {
            BUDGET => Word::Float,
            MCMC => Word::Numbers(&[|word| word as f32]),
            _ => Word::Integer,
        },
        // Scores are not packed, though their buffer is that of packed records.
        ("blend_backward", b"record_words") if shadowed.constant(c"scores") != 0 && word < 2 => Word::Float,
        ("pursuit_residual" | "pursuit_blur", b"texels") => halves,
        ("project_backward" | "adam", name) if name.ends_with(b"_moments") && holds_packed(shadowed) => {
            // Newton's steps pack three first moments of harmonics into a word; another word has their unit.
            let is_of_three = name == b"sh_moments" && shadowed.constant(c"newton") != 0;
            if is_of_three { Word::Integer } else { Word::Numbers(&[first_moment, second_moment]) }
        }
        ("pursuit_quanta", b"quanta") => Word::Numbers(&[|word| word as f32]),
        // Compared by its use: the remaining fraction.
        ("pursuit_attenuate", b"explained") => Word::Numbers(&[|word| (1.0 - f64::from(word) / WHOLE) as f32]),
        ("resolve", b"target") => {
            match bytemuck::pod_read_unaligned::<kernels::resolve::Push>(&shadowed.twin.push).format {
                RGBA32F => Word::Float,
                RGBA16F => Word::Codes(16),
                _ => Word::Codes(8),
            }
        }
        _ if binding.floats >> word & 1 != 0 => Word::Float,
        _ => Word::Integer,
    }
}

/// Whether atomics give the elements of a buffer their order.
fn is_unordered(stage: &str, buffer: &CStr) -> bool {
    matches!(
        (stage, buffer.to_bytes()),
        ("tile_ranges", b"tile_list") | ("screen_tiles", b"forward_tiles" | b"backward_tiles")
    )
}

/// A buffer that a kernel writes, as words.
struct Written<'a> {
    binding: &'a Binding,
    /// Words of each element.
    words: Vec<Word>,
    kernel: Cow<'a, [u32]>,
    twin: Cow<'a, [u32]>,
    before: Cow<'a, [u32]>,
    /// See [`plane`].
    plane: usize,
    is_unordered: bool,
    /// Whether a flip is a step of a gradient that cancels, and so no larger than others' steps.
    may_cancel: bool,
}

impl Written<'_> {
    /// Returns the elements that the kernel or its twin changed; all elements if neither changed any.
    fn changed(&self) -> impl Iterator<Item = (usize, &[u32], &[u32])> {
        let n = self.words.len();
        let all = self.kernel.chunks_exact(n).zip(self.twin.chunks_exact(n)).zip(self.before.chunks_exact(n));
        let none = self.kernel == self.before && self.twin == self.before;
        let changed =
            all.enumerate().filter(move |(_, ((kernel, twin), before))| none || kernel != before || twin != before);
        changed.map(|(i, ((kernel, twin), _))| (i, kernel, twin))
    }

    /// Compares integers and codes. If the bound allows flips, differing elements count as such and are added to `skipped`. With `perturb`,
    /// one bit of each of the twin's words is inverted.
    fn compare_words(&self, found: &mut Found, bound: &Bound, skipped: &mut HashSet<usize>, perturb: f64) {
        if self.words.iter().all(|word| matches!(word, Word::Float | Word::Numbers(_))) {
            return;
        }
        let mut elements: Vec<_> = self.changed().collect();
        if self.is_unordered {
            let [mut kernel, mut twin]: [Vec<_>; 2] = [1, 2].map(|_| vec![]);
            elements.iter().for_each(|&(_, of_kernel, of_twin)| {
                kernel.push(of_kernel);
                twin.push(of_twin);
            });
            kernel.sort_unstable();
            twin.sort_unstable();
            elements = kernel.into_iter().zip(twin).enumerate().map(|(i, (kernel, twin))| (i, kernel, twin)).collect();
        }
        let fault = if perturb > 0.0 { 2 } else { 0 };
        let (mut differ, mut wrong) = (0, 0);
        for &(i, kernel, twin) in &elements {
            let apart = |(word, (&kernel, &twin)): (&Word, (&u32, &u32))| match *word {
                Word::Integer => u32::from(kernel != twin ^ fault),
                Word::Float | Word::Numbers(_) => 0,
                Word::Codes(bits) => {
                    let codes =
                        (0..32 / bits).map(|code| [kernel, twin].map(|w| w >> (bits * code) & ((1 << bits) - 1)));
                    codes.map(|[kernel, twin]| kernel.abs_diff(twin)).max().unwrap_or(0)
                }
            };
            let apart = self.words.iter().zip(kernel.iter().zip(twin)).map(apart);
            let before = differ;
            apart.for_each(|apart| (differ, wrong) = (differ + usize::from(apart > 0), wrong + usize::from(apart > 1)));
            if differ > before {
                skipped.insert(i);
            }
        }
        if bound.flips > 0.0 {
            let integers = self.words.iter().filter(|word| matches!(word, Word::Integer | Word::Codes(_))).count();
            found.decided += elements.len() * integers;
            found.flipped += differ;
            if differ > 0 {
                let (stage, buffer) = (found.row.stage, self.binding.name.to_string_lossy());
                tracing::debug!("{stage}: {buffer}: {differ} of {} decided otherwise", elements.len());
            }
        } else {
            wrong = differ;
        }
        found.row.unequal(wrong as u64);
    }

    /// Compares numbers, together with the same numbers of the other elements of the plane.
    fn compare_floats(&self, found: &mut Found, bound: &Bound, skipped: &HashSet<usize>, perturb: f64) {
        let stage = found.row.stage;
        let numbers = self.words.iter().enumerate().filter_map(|(at, word)| match word {
            Word::Float => Some((at, &[f32::from_bits as fn(u32) -> f32][..])),
            Word::Numbers(values) => Some((at, *values)),
            _ => None,
        });
        let numbers: Vec<_> = numbers.collect();
        // Pairs, and the largest step of the twin.
        type Group = (Vec<(f32, f64)>, f64);
        let mut groups: BTreeMap<(usize, usize, usize), Group> = BTreeMap::new();
        let mut largest = 0.0f64;
        for (i, kernel, twin) in self.changed().filter(|(i, ..)| !skipped.contains(i)) {
            for (word, number, value) in numbers
                .iter()
                .flat_map(|(word, values)| values.iter().enumerate().map(move |(k, value)| (*word, k, value)))
            {
                let (Some(&kernel), Some(&twin)) = (kernel.get(word), twin.get(word)) else { continue };
                let [got, want] = [kernel, twin].map(value);
                // The difference of equal infinities is NaN, and a NaN may have any bits.
                let same = got == want || got.is_nan() && want.is_nan();
                let pair = if same && !got.is_finite() { (0.0, 0.0) } else { (got, f64::from(want)) };
                largest = largest.max(pair.1.abs());
                let (pairs, step) = groups.entry((i / self.plane, word, number)).or_default();
                pairs.push(pair);
                *step = step.max(f64::from(want - value(self.before[i * self.words.len() + word])).abs());
            }
        }
        for ((plane, word, _), (mut pairs, step)) in groups {
            // Sums that cancel are 0 in float32 and a rounding error in float64.
            let rounding = (1e-15 * largest).max(1e-30);
            pairs.iter_mut().filter(|pair| off(pair) <= rounding).for_each(|pair| pair.1 = pair.0.into());
            if bound.flips > 0.0 {
                let all = pairs.len();
                let effect = if self.may_cancel { 2.0 * step } else { FLIP * largest_of(&pairs) };
                let (left_out, far) = leave_out(&mut pairs, bound, effect);
                found.row.unequal(far as u64);
                (found.decided, found.flipped) = (found.decided + all, found.flipped + left_out);
                if left_out > 0 {
                    let buffer = self.binding.name.to_string_lossy();
                    tracing::debug!("{stage}: {buffer}, plane {plane}, word {word}: {left_out} of {all} left out");
                }
            }
            let mut alone = Row::new(stage, "", perturb);
            match bound.bias > 0.0 {
                true => alone.gradients(pairs),
                false => alone.numbers(pairs),
            }
            found.row.worsen(&alone.errors);
            alone.judge();
            if let Some(breach) = alone.breaches.first().filter(|_| perturb == 0.0) {
                let buffer = self.binding.name.to_string_lossy();
                tracing::info!(
                    "{stage}: {buffer}, plane {plane}, word {word}: {} {:.1e}",
                    breach.measure,
                    breach.value
                );
            }
        }
    }
}

/// Maximum share of gradients that are sums of records which cancel to a few roundings (6e-8 of the largest). Adam and Newton divide by the
/// size of these, too, so the step is another one. Of 20,000 Gaussians in the image one has a channel of color that cancels to 1e-6.
const CANCELLED: f64 = 1e-4;

fn largest_of(pairs: &[(f32, f64)]) -> f64 {
    pairs.iter().fold(0.0, |largest, pair| largest.max(pair.1.abs()))
}

fn off(&(got, want): &(f32, f64)) -> f64 {
    (f64::from(got) - want).abs()
}

/// Maximum effect of a flip, relative to the largest number: 1/255 for α; at the border of pursuit's window,
/// 0.044 of the remaining fraction.
const FLIP: f64 = 0.05;

/// Removes the worst pairs until the others are within the bounds, because a flip at a threshold changes dependent numbers by more than
/// rounding does. Returns how many it removed, and how many of these differ by more than `effect`, which a flip explains.
fn leave_out(pairs: &mut Vec<(f32, f64)>, bound: &Bound, effect: f64) -> (usize, usize) {
    pairs.sort_by(|a, b| off(a).total_cmp(&off(b)));
    // The longest prefix within the bounds, and the sums over the pairs seen so far.
    let (mut held, mut error, mut signed) = (0, 0.0, 0.0);
    let [mut largest, mut squares, mut size] = [0.0f64; 3];
    for (i, pair) in pairs.iter().enumerate() {
        let want = pair.1.abs();
        (largest, squares, size) = (largest.max(want), squares + want * want, size + want);
        error += off(pair) * off(pair);
        signed += f64::from(pair.0) - pair.1;
        let unbiased = bound.bias == 0.0 || signed.abs() <= bound.bias * size;
        if off(pair) <= bound.max * largest && error <= bound.relative_l2.powi(2) * squares && unbiased {
            held = i + 1;
        }
    }
    let out = pairs.split_off(held);
    (out.len(), out.iter().filter(|pair| !(off(pair) <= effect)).count())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::Access;

    fn bound(flips: f64) -> Bound {
        Bound { max: 1e-4, relative_l2: 1e-5, flips, ..Bound::exact("blend", "") }
    }

    #[test]
    fn flips_are_left_out_if_the_others_are_within_bounds() {
        let mut pairs: Vec<(f32, f64)> = (0..1000).map(|i| (i as f32, f64::from(i))).collect();
        (pairs[7].0, pairs[9].0, pairs[11].1) = (500.0, f32::NAN, f64::NAN);
        assert_eq!((leave_out(&mut pairs, &bound(0.1), FLIP * 999.0), pairs.len()), ((3, 3), 997));
        // An error in all elements is not a flip.
        let mut pairs: Vec<(f32, f64)> = (1..1000).map(|i| (1.001 * i as f32, f64::from(i))).collect();
        let (left_out, far) = leave_out(&mut pairs, &bound(0.1), FLIP * 999.0);
        assert!(left_out > 500 && far == 0);
    }

    /// Covers elements that only the twin changes, the order of a list, and codes.
    #[test]
    fn words_are_compared_where_either_changed_them() {
        let binding = Binding { name: c"words", access: Access::ReadWrite, element_bytes: 4, floats: 0 };
        let judged = |kernel: &[u32], twin: &[u32], word: Word, is_unordered: bool| {
            let words = vec![word];
            let before = [0; 4];
            let buffer = Written {
                binding: &binding,
                words,
                kernel: kernel.into(),
                twin: twin.into(),
                before: before[..].into(),
                plane: usize::MAX,
                is_unordered,
                may_cancel: false,
            };
            let row = Row::new("blend", "", 0.0);
            let mut found = Found { row, decided: 0, flipped: 0, times: vec![] };
            buffer.compare_words(&mut found, &bound(0.5), &mut HashSet::new(), 0.0);
            (found.decided, found.flipped, found.row.errors.unequal)
        };
        assert_eq!(judged(&[1, 2, 0, 0], &[1, 0, 3, 0], Word::Integer, false), (3, 2, Some(0)));
        assert_eq!(judged(&[1, 2, 3, 0], &[3, 1, 2, 0], Word::Integer, true), (3, 0, Some(0)));
        // A code adjacent to the twin's, and one farther away.
        assert_eq!(judged(&[0x0105, 0, 0, 0], &[0x0104, 0, 0, 0], Word::Codes(8), false), (1, 1, Some(0)));
        assert_eq!(judged(&[0x0305, 0, 0, 0], &[0x0105, 0, 0, 0], Word::Codes(8), false), (1, 1, Some(1)));
    }
}
