//! Compares the twins' gradients with central differences of the whole chain project → … → blend. Runs on the CPU alone.

use glint::{
    reference::{
        Background, Options, Params, Rendered, View,
        blend_backward::blend_backward,
        project_backward::{probe_backward, sum_records},
        random_camera, random_scene, render,
    },
    scene::{
        color::BETAS,
        layout::{Array, LOG_SCALE, OPACITY, groups},
    },
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

const WIDTH: u32 = 24;
const HEIGHT: u32 = 20;
const PIXELS: usize = (WIDTH * HEIGHT) as usize;

/// A true derivative: channels clamped at 0 have none, though descent passes a gradient that would raise
/// them.
fn derivative(problem: &Problem, base: &Rendered) -> Params {
    let Rendered { projected, isects, blended } = base;
    let Problem { params, view, options, weights, .. } = problem;
    let records = blend_backward(&projected.splats, isects, &blended.image, weights);
    let records = sum_records(&projected.tile_counts, isects, &records);
    // A known curvature blocks all clamped channels.
    probe_backward(params, view, options, &projected.splats, records, &vec![[1.0; 3]; params.count]).params
}

/// One parameter: its array and index, its Gaussian and its group.
#[derive(Debug, Clone, Copy)]
struct Parameter {
    array: Array,
    at: usize,
    gaussian: usize,
    group: &'static str,
}

fn value(params: &mut Params, parameter: Parameter) -> &mut f64 {
    match parameter.array {
        Array::Geometry => &mut params.geometry[parameter.at],
        Array::Sh => &mut params.sh[parameter.at],
        Array::Lobes => &mut params.lobes[parameter.at],
    }
}

/// All parameters, but only every seventh of the SH bands above 0, since everything is linear in these.
fn parameters(params: &Params) -> Vec<Parameter> {
    let mut all = Vec::new();
    for group in groups(params.sh_degree) {
        let (first, stride) = match group.array {
            Array::Lobes => (params.lobe_first, params.lobe_stride),
            _ => (0, params.stride),
        };
        for (p, gaussian) in group.planes.flat_map(|p| (first..params.count).map(move |i| (p, i))) {
            if group.name != "SH" || (p + gaussian) % 7 == 0 {
                let at = p * stride + gaussian - first;
                all.push(Parameter { array: group.array, at, gaussian, group: group.name });
            }
        }
    }
    all
}

struct Problem {
    params: Params,
    view: View,
    options: Options,
    background: Vec<[f64; 3]>,
    /// loss = Σ weights · image.
    weights: Vec<[f64; 3]>,
}

impl Problem {
    fn new(seed: u64, count: usize, supplement: usize, options: Options) -> Self {
        Self::of(seed, count, supplement, 3, options)
    }

    fn of(seed: u64, count: usize, supplement: usize, degree: u32, options: Options) -> Self {
        let params = Params::from_scene(&random_scene(seed, count, supplement, degree)).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(seed + 1000);
        let mut image = |low: f64| (0..PIXELS).map(|_| std::array::from_fn(|_| rng.random_range(low..1.0))).collect();
        Problem {
            params,
            view: View::from_camera(&random_camera(WIDTH, HEIGHT)),
            options,
            background: image(0.0),
            weights: image(-1.0),
        }
    }

    /// Adds constants to all log scales and opacity logits.
    fn grown(mut self, log_scale: f64, logit: f64) -> Self {
        let stride = self.params.stride;
        self.params.geometry[LOG_SCALE * stride..(LOG_SCALE + 3) * stride].iter_mut().for_each(|s| *s += log_scale);
        self.params.geometry[OPACITY * stride..(OPACITY + 1) * stride].iter_mut().for_each(|o| *o += logit);
        self
    }

    fn render(&self, params: &Params) -> Rendered {
        render(params, &self.view, &self.options, Background::Image(&self.background))
    }

    fn loss(&self, rendered: &Rendered) -> f64 {
        let pixels = self.weights.iter().zip(&rendered.blended.image);
        pixels.map(|(w, c)| w[0] * c[0] + w[1] * c[1] + w[2] * c[2]).sum()
    }

    /// The fourth-order central difference with the largest step of 1e-5, 1e-6, 1e-7 that changes no decision
    /// of a pixel and no kink of the Gaussian; `None` if every step changes one.
    ///
    /// At 1e-5 a Gaussian moves by at most 1e-3 of its projected width, so the truncation, the fourth power
    /// of that, is below 1e-11. The rounding is 1e-16 · |loss| ~ 1e-15, or 1e-13 with sums of 500 pixels,
    /// divided by the step.
    fn difference(&self, base: &Rendered, parameter: Parameter) -> Option<(f64, f64)> {
        let mut params = self.params.clone();
        let centre = *value(&mut params, parameter);
        [1e-5, 1e-6, 1e-7].into_iter().find_map(|h| {
            let losses = [-2.0, -1.0, 1.0, 2.0].map(|k| {
                *value(&mut params, parameter) = centre + k * h;
                let rendered = self.render(&params);
                let kinks = |r: &Rendered| r.projected.kinks[parameter.gaussian];
                let smooth = rendered.blended.decisions == base.blended.decisions && kinks(&rendered) == kinks(base);
                smooth.then(|| self.loss(&rendered))
            });
            let [Some(a), Some(b), Some(c), Some(d)] = losses else { return None };
            Some(((8.0 * (c - b) - (d - a)) / (12.0 * h), h))
        })
    }
}

/// Coverage of one problem's check, so that no branch passes by being absent.
#[derive(Default, Debug)]
struct Seen {
    tested: usize,
    skipped: usize,
    /// Parameters tested with a smaller step than 1e-5.
    narrowed: usize,
    /// Parameters with a gradient, by group.
    live: [usize; 9],
    /// Those of Gaussians with a clamped Jacobian.
    jacobian_clamped: usize,
    /// Those of Gaussians with a color channel clamped at 0.
    color_clamped: usize,
    /// Pixels and Gaussians with an α clamped at 0.99.
    alpha_clamped: usize,
    /// Pixels with a final transmittance below 1e-3.
    opaque: usize,
}

fn check(problem: &Problem, seen: &mut Seen) {
    let base = problem.render(&problem.params);
    let mut analytic = derivative(problem, &base);
    let all = parameters(&problem.params);
    let differences: Vec<_> = all.par_iter().map(|&parameter| problem.difference(&base, parameter)).collect();
    for (parameter, difference) in all.into_iter().zip(differences) {
        let gradient = *value(&mut analytic, parameter);
        let Some((difference, h)) = difference else {
            seen.skipped += 1;
            continue;
        };
        let tolerance = 1e-7 * gradient.abs() + 1e-13 / h;
        assert!(
            (difference - gradient).abs() <= tolerance,
            "{parameter:?}: {gradient} but differences say {difference} ({:?}, h = {h})",
            problem.options
        );
        seen.tested += 1;
        seen.narrowed += (h < 1e-5) as usize;
        // A gradient large enough not to be rounding.
        if gradient.abs() > 1e-6 {
            let kinks = base.projected.kinks[parameter.gaussian];
            seen.live
                [groups(problem.params.sh_degree).iter().position(|group| group.name == parameter.group).unwrap()] += 1;
            seen.jacobian_clamped += (kinks & 3 != 0) as usize;
            seen.color_clamped += (kinks >> 2 != 0) as usize;
        }
    }
    seen.opaque += base.blended.image.iter().filter(|pixel| pixel[3] < 1e-3).count();
    for splat in base.projected.splats.iter().filter(|splat| splat.opacity > 0.99) {
        for (column, row) in (0..HEIGHT).flat_map(|row| (0..WIDTH).map(move |column| (column, row))) {
            let (wu, wv) = splat.whiten(column, row);
            seen.alpha_clamped += (splat.opacity * (-0.5 * (wu * wu + wv * wv)).exp() > 0.99) as usize;
        }
    }
}

#[test]
fn every_gradient_is_the_central_difference() {
    let tiles = [(16, 16), (8, 8), (7, 3), (16, 4), (5, 7)];
    let mut seen = Seen::default();
    for (n, (tile_width, tile_height)) in tiles.into_iter().enumerate() {
        let options = Options { compensate: n % 2 == 1, tile_width, tile_height, ..Default::default() };
        let problem = Problem::new(40 + n as u64, 24, 16, options);
        check(&problem, &mut seen);
        // Large and opaque: some reach in from far outside the image, α is clamped, pixels stop early.
        check(&problem.grown(2.3, 5.0), &mut seen);
    }
    println!("{seen:?}");
    assert!(seen.skipped * 50 < seen.tested, "too many parameters at a threshold: {seen:?}");
    assert!(seen.live.iter().all(|&live| live >= 30), "{seen:?}");
    assert!(seen.jacobian_clamped >= 30 && seen.color_clamped >= 30, "{seen:?}");
    assert!(seen.alpha_clamped >= 30 && seen.opaque >= 30, "{seen:?}");
}

#[test]
fn gradients_of_betas_are_central_differences() {
    let mut seen = Seen::default();
    for seed in 120..122 {
        let options = Options { active_degree: BETAS, ..Default::default() };
        let problem = Problem::of(seed, 24, 16, BETAS, options);
        check(&problem, &mut seen);
        check(&problem.grown(2.3, 5.0), &mut seen);
    }
    println!("{seen:?}");
    assert!(seen.skipped * 50 < seen.tested, "too many parameters at a threshold: {seen:?}");
    assert!(seen.live.iter().all(|&live| live >= 30) && seen.color_clamped >= 30, "{seen:?}");
    // With degree 0 there is only the constant.
    let problem = Problem::of(124, 60, 20, BETAS, Options { active_degree: 0, ..Default::default() });
    let mut plain = problem.params.clone();
    plain.sh.truncate(3 * plain.stride);
    plain.sh_degree = 0;
    assert_eq!(problem.render(&problem.params).blended, problem.render(&plain).blended);
}

/// Checks the rule itself: an unclamped channel has its derivative. A clamped channel passes the loss's slope
/// in the color only if it is negative, so that a step raises the channel. A probe passes it while no
/// curvature is known.
#[test]
fn a_clamped_color_passes_what_raises_it() {
    let (mut raised, mut held, mut free) = (0, 0, 0);
    for degree in [3, BETAS] {
        let options = Options { active_degree: degree, ..Default::default() };
        let problem = Problem::of(44, 60, 30, degree, options).grown(1.0, 1.0);
        let Problem { params, view, weights, .. } = &problem;
        let base = problem.render(params);
        let found = base.backward(params, view, &options, weights);
        let splats = &base.projected.splats;
        let unknown = vec![[0.0; 3]; params.count];
        let probe = probe_backward(params, view, &options, splats, found.records.clone(), &unknown).params;
        let stopped = derivative(&problem, &base);
        for (i, record) in found.records.iter().enumerate().filter(|(i, _)| found.touched[*i]) {
            for c in 0..3 {
                let at = c * params.stride + i;
                let [got, probed, none] = [&found.params, &probe, &stopped].map(|grads| grads.sh[at]);
                // The constant's slope is the color's times Y_0.
                let slope = record[6 + c] * 0.282_094_791_773_878_14;
                let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * slope.abs();
                assert!(near(probed, slope), "Gaussian {i}");
                if splats[i].color()[c] > 0.0 {
                    free += 1;
                    assert!(near(got, slope) && near(none, slope), "Gaussian {i}");
                } else {
                    let wanted = slope.min(0.0);
                    *(if wanted < 0.0 { &mut raised } else { &mut held }) += 1;
                    assert!(near(got, wanted) && none == 0.0, "Gaussian {i}: {got} for {wanted}");
                }
            }
        }
    }
    assert!(raised >= 10 && held >= 10 && free >= 50, "{raised}, {held}, {free}");
}

#[test]
fn coefficients_beyond_the_active_degree_neither_shine_nor_learn() {
    for active_degree in 0..3 {
        let options = Options { active_degree, ..Default::default() };
        let problem = Problem::new(60, 60, 20, options).grown(0.5, 0.0);
        let base = problem.render(&problem.params);
        let gradients = base.backward(&problem.params, &problem.view, &options, &problem.weights);
        let first = 3 * ((active_degree + 1) * (active_degree + 1)) as usize * problem.params.stride;
        assert!(gradients.params.sh[first..].iter().all(|&g| g == 0.0));
        assert!(gradients.params.sh[..first].iter().any(|&g| g != 0.0));
        let mut dark = problem.params.clone();
        dark.sh[first..].fill(0.0);
        assert_eq!(problem.render(&dark).blended, base.blended);
    }
}

/// The image is a convex combination: transmittance and weights sum to 1, so equal colors everywhere give
/// that color.
#[test]
fn a_scene_of_one_color_has_that_color() {
    let mut problem = Problem::new(110, 400, 150, Options::default()).grown(0.5, 0.0);
    problem.params.sh.fill(0.0);
    problem.background.fill([0.5; 3]);
    for pixel in problem.render(&problem.params).blended.image {
        assert!(pixel[..3].iter().all(|c| (c - 0.5).abs() < 1e-13), "{pixel:?}");
    }
}
