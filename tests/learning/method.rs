//! The numbers in docs/numbers.md equal those in the code, and the joint phase moves exactly the parameters
//! that the method lists.

use std::collections::BTreeMap;

use glam::DVec3;
use glint::{
    pipelines::{
        classes, density,
        enhance::EnhanceOptions,
        exposure,
        join::{JoinOptions, join},
        learn::{NEWTON_PART, PROBED_NTH},
        model::{Model, Segment},
        pursuit::FEW_CANDIDATES,
        session::{Policy, Session},
        spend::{MOST_BY_BYTES, MOST_BY_GAIN, OVERFILL},
        train::{BaseOptions, HALVED_UNTIL, VARIED_NTH},
        views::Views,
    },
    reference::{
        ALPHA_MAX, ALPHA_MIN, DILATION, NEAR, TRANSMITTANCE_MIN,
        adam::{BETA1, BETA2, CURVATURE_DECAY, NEWTON_REACH, PACE, SHARPNESS_RANGE, WIDTH_RANGE},
        betas::B_RANGE,
        density_apply::{COPIES, SPLIT_SCALE},
        density_noise::GATE,
        lift_groups::{GROUP_MIN, TAU_GROWTH},
        lift_pca::EIGENVALUE_MIN,
        lift_points::TAU_PIXELS,
        loss_probe::LEAST_DIFFERENCE,
        random_scene,
        screen_backward::{RATE_ANGLE, RATE_CENTRE, RATE_COLOR, RATE_LOG_SCALE, RATE_LOGIT, scale_max},
        screen_draw::{FIRST_OPACITY, FIRST_SCALE, draw_size},
        screen_prune::{OPACITY_MIN, covered_min},
        ssim_forward::SSIM_WEIGHT,
    },
    scene::{
        Gaussians, Scene, Supplement,
        color::{BETA_LOBES, BETAS},
    },
};

use super::{
    built,
    common::{Gpu, session},
    put_before,
};

/// Values of rendering and of the base's training, by the table's names.
fn numbers_of_training() -> BTreeMap<&'static str, f64> {
    let base = BaseOptions::default();
    let betas = BaseOptions { sh_degree: BETAS, ..base };
    let (first, last) = (base.plan(1.0, 0).rates, base.plan(1.0, 30_000).rates);
    let band = (1..30_000).find(|&step| base.plan(1.0, step).active_degree == 1).unwrap();
    BTreeMap::from([
        ("near plane", NEAR),
        ("dilation, px²", DILATION),
        ("least α", ALPHA_MIN),
        ("largest α", ALPHA_MAX),
        ("least transmittance", TRANSMITTANCE_MIN),
        ("least T", WIDTH_RANGE.0),
        ("largest T", WIDTH_RANGE.1),
        ("least β", SHARPNESS_RANGE.0),
        ("largest β", SHARPNESS_RANGE.1),
        ("betas of a Gaussian", BETA_LOBES as f64),
        ("least b", B_RANGE.0),
        ("largest b", B_RANGE.1),
        ("weight of 1 − SSIM", SSIM_WEIGHT),
        ("Adam's first decay", BETA1),
        ("Adam's second decay", BETA2),
        ("base: half the sides until, of the run", HALVED_UNTIL[0]),
        ("base: a quarter of the sides until, of the run", HALVED_UNTIL[1]),
        ("base: of so many steps one has a random background", VARIED_NTH.into()),
        ("base: rate of positions at first, of the extent", first.mean.into()),
        ("base: rate of positions at last, of the extent", last.mean.into()),
        ("base: rate of scales", first.log_scale.into()),
        ("base: rate of rotations", first.quat.into()),
        ("base: rate of opacities", first.opacity.into()),
        ("base: rate of DC", first.dc.into()),
        ("base: rate of other SH", first.sh.into()),
        ("base: rate of betas", betas.plan(1.0, 0).rates.sh.into()),
        ("base: steps", base.iterations.into()),
        ("base: steps until the next band", band.into()),
        ("density: least opacity", density::LEAST_OPACITY.into()),
        ("density: least pull", density::LEAST_PULL.into()),
        ("density: largest clone, of the extent", density::CLONE_SCALE.into()),
        ("density: scales over, in a split", SPLIT_SCALE),
        ("density: opacity of a reset", density::RESET_OPACITY.into()),
        ("density: growth", 1.0 / f64::from(density::GROWTH_NTH)),
        ("density: noise, of the rate of positions", density::NOISE.into()),
        ("density: weight of mean opacity and scale", density::MEAN_WEIGHT.into()),
        ("density: first opacity", density::FIRST_OPACITY.into()),
        ("density: first scale, of the usual", density::FIRST_SCALE.into()),
        ("density: rate of opacities", density::OPACITY_RATE.into()),
        ("density: copies of one", COPIES.into()),
        ("density: gate's steepness", GATE.0),
        ("density: gate's middle", GATE.1),
        ("density: budget from, of the run", density::BUDGET_SPAN[0]),
        ("density: budget spent, of the run", density::BUDGET_SPAN[1]),
        ("density: budget until, of the run", density::BUDGET_SPAN[2]),
        ("density: refinements of a budget", density::BUDGET_EVENTS.into()),
        ("density: steps to a scored one", density::SCORED_NTH.into()),
        ("density: last rates, of the first", density::LAST_RATE),
        ("density: last rates of rotations and opacities, of these", density::SETTLED_RATE),
        ("density: rate of positions, of the usual", density::MEAN_RATE),
        ("density: power of a shorter run", density::RATE_POWER),
        ("classes: measured after, of the run", classes::MEASURED_AT),
        ("classes: length of the trial, of the run", classes::TRIED),
        ("classes: worth of bands when measured", classes::WORTH),
        ("classes: assumed with bands before", classes::ASSUMED),
        ("classes: worth of bands that are kept", classes::WORTH_KEEPING),
        ("classes: least true worth that the trial tells, of the squared error", classes::TOLD),
        ("classes: predicted over true worth from which on all bands go", classes::EMPTY),
        ("classes: most true worth with which all bands go, of the squared error", classes::SHOWN),
        ("classes: part of the bytes for a base that loses bands", classes::BASE_PART),
        ("total size: before the joint phase, of that after it", OVERFILL),
        ("exposure: first rate", exposure::RATES[0]),
        ("exposure: last rate", exposure::RATES[1]),
        ("Newton: decay of a curvature", CURVATURE_DECAY),
        ("Newton: a step at most, rates", NEWTON_REACH),
        ("Newton: least difference of a probe", LEAST_DIFFERENCE),
        ("Newton: of so many steps one is probed", PROBED_NTH.into()),
        ("Newton: part of the way, at first", NEWTON_PART.into()),
        ("Newton: factor on a step after a pause", PACE),
    ])
}

/// Values of the augmentation, by the table's names.
fn numbers_of_augmentation() -> BTreeMap<&'static str, f64> {
    let (paper, ours) = (EnhanceOptions::paper(), EnhanceOptions::pursuit());
    let pursuit = ours.pursuit;
    let joint = paper.join.rates(1.0, 0.0);
    BTreeMap::from([
        ("ratio", paper.ratio),
        ("screen: share of a draw", f64::from(draw_size(1000)) / 1000.0),
        ("screen: steps of a round", paper.schedule.round_steps.into()),
        ("screen: final steps", paper.schedule.final_steps.into()),
        ("screen: first scale, of the shorter side", FIRST_SCALE),
        ("screen: first opacity", FIRST_OPACITY),
        ("screen: least opacity", OPACITY_MIN),
        ("screen: least pixels", covered_min(800, 546) as f64),
        ("screen: largest scale, px", scale_max(9000.0, 9000.0)),
        ("screen: largest scale, of width + height", scale_max(800.0, 1200.0) / 2000.0),
        ("screen: rate of centers, of the mean side", RATE_CENTRE),
        ("screen: rate of colors", RATE_COLOR),
        ("screen: rate of opacities", RATE_LOGIT),
        ("screen: rate of scales", RATE_LOG_SCALE),
        ("screen: rate of angles", RATE_ANGLE),
        ("depth threshold", paper.median_threshold.into()),
        ("lift: first τ, in pixels", TAU_PIXELS),
        ("lift: growth of τ", TAU_GROWTH),
        ("lift: least points", GROUP_MIN.into()),
        ("lift: least variance, of the square of the scene's length", EIGENVALUE_MIN),
        ("join: steps for each view", paper.join.steps_per_view.into()),
        ("join: rate of positions, of the extent", joint.mean.into()),
        ("join: rate of scales", joint.log_scale.into()),
        ("join: rate of rotations", joint.quat.into()),
        ("join: rate of opacities", joint.opacity.into()),
        ("join: rate of DC", joint.dc.into()),
        ("join: rate of other SH", joint.sh.into()),
        ("join: rate of d", joint.direction.into()),
        ("join: rate of T", joint.width.into()),
        ("join: rate of β", joint.sharpness.into()),
        ("pursuit: candidates for each Gaussian", pursuit.draws.into()),
        ("pursuit: few candidates", FEW_CANDIDATES.into()),
        ("pursuit: sizes", pursuit.sizes.into()),
        ("pursuit: first size, px", pursuit.first_size.into()),
        ("pursuit: ratio of sizes", pursuit.size_ratio.into()),
        ("pursuit: rounds", pursuit.rounds.into()),
        ("pursuit: worth of a lobe's gain", pursuit.lobe_worth.into()),
        ("pursuit: placements", pursuit.placements.into()),
        ("pursuit: caution", pursuit.caution.into()),
        ("pursuit: doubt", pursuit.doubt.into()),
        ("pursuit: least opacity of a supplement", pursuit.least_opacity.into()),
        ("pursuit: joint rates, of those of `join`", ours.join.pace.into()),
        ("pursuit: joint rates at last, of those at first", ours.join.decay.into()),
        ("pursuit: Gaussians at most, by their gain, of the base's", MOST_BY_GAIN),
        ("pursuit: Gaussians at most, by bytes, of the base's", MOST_BY_BYTES),
    ])
}

/// `glint verify` checks that kernels and twins use the same numbers.
#[test]
fn the_numbers_are_those_of_the_page() {
    let page = include_str!("../../docs/numbers.md");
    let cells = |line: &'static str| {
        let (name, value) = line.strip_prefix("| ")?.strip_suffix(" |")?.split_once(" | ")?;
        let parts: Vec<f64> = value.split('/').map(|part| part.parse().ok()).collect::<Option<_>>()?;
        Some((name, parts.into_iter().reduce(|a, b| a / b)?))
    };
    let said: BTreeMap<&str, f64> = page.lines().filter_map(cells).collect();
    let mut found = numbers_of_training();
    found.extend(numbers_of_augmentation());
    assert_eq!(said.keys().collect::<Vec<_>>(), found.keys().collect::<Vec<_>>());
    for (name, value) in said {
        // Rates are float32.
        assert!((found[name] / value - 1.0).abs() < 1e-6, "{name}: {} in the code, {value} on the page", found[name]);
    }
}

#[test]
fn rates_of_positions_follow_the_extent_and_bands_the_run() {
    let (one, three) = (EnhanceOptions::paper().join.rates(1.0, 0.0), EnhanceOptions::paper().join.rates(3.0, 0.0));
    assert_eq!((three.mean, three.opacity), (3.0 * one.mean, one.opacity));
    let plan =
        |iterations: u32, step: u32| BaseOptions { iterations, sh_degree: 3, ..Default::default() }.plan(2.0, step);
    // In the middle the rate is the geometric mean.
    assert!((f64::from(plan(600, 300).rates.mean) / (2.0 * 1.6e-5) - 1.0).abs() < 1e-6);
    // Betas have no bands.
    assert_eq!(BaseOptions { sh_degree: BETAS, ..Default::default() }.plan(2.0, 0).active_degree, BETAS);
    let degrees = |iterations: u32, steps: [u32; 5]| steps.map(|step| plan(iterations, step).active_degree);
    assert_eq!(degrees(30_000, [999, 1000, 2000, 3000, 29_999]), [0, 1, 2, 3, 3]);
    assert_eq!(degrees(600, [19, 20, 40, 60, 599]), [0, 1, 2, 3, 3]);
    assert_eq!(degrees(300_000, [999, 1000, 2000, 3000, 299_999]), [0, 1, 2, 3, 3]);
}

/// In a first step missing bands act as 0, to the bit: they add 0 to colors and gradients.
#[test]
fn a_supplement_without_bands_learns_as_one_whose_bands_are_0() {
    let gpu = Gpu::new();
    let built = built(300);
    let photo = &built.photos[0];
    let views = Views::upload(&gpu, &[photo.camera], &[&photo.rgb]).unwrap();
    let mut scene = random_scene(3, 200, 300, 2);
    let constant = scene.supplement.take().unwrap();
    let mut constant = Supplement { gaussians: constant.gaussians.with_degree(0), ..constant };
    for part in [&mut scene.base, &mut constant.gaussians] {
        put_before(&photo.camera, &mut part.means);
    }
    let session = Session { background: built.background, extent: 2.0, ..session(&gpu) };
    let learned = |degree, packed| {
        let gaussians = constant.gaussians.clone().with_degree(degree);
        let before = Scene { supplement: Some(Supplement { gaussians, ..constant.clone() }), ..scene.clone() };
        let model = Model::upload(&gpu, &before, 0).unwrap();
        let options = JoinOptions { steps_per_view: 1, ..EnhanceOptions::pursuit().join };
        let policy = Policy { packed, ..session.policy };
        let session = Session { policy, ..session.clone() };
        join(&session, &model, &views, &options).unwrap().run(&model, &views, false, |_| ()).unwrap();
        let after = model.download().unwrap();
        let supplement = after.supplement.unwrap();
        assert_eq!((after.base.sh_degree, supplement.gaussians.sh_degree), (2, degree));
        assert_ne!(supplement.gaussians.opacities, constant.gaussians.opacities);
        (after.base, Supplement { gaussians: supplement.gaussians.with_degree(0), ..supplement })
    };
    for packed in [false, true] {
        assert_eq!(learned(0, packed), learned(2, packed));
    }
}

/// Visible opacities of the base move; its geometry and colors stay bit for bit; all of the supplement moves. Lobes always have Adam's
/// bias correction, so their first step is as long as their rates.
#[test]
fn joining_leaves_the_bases_geometry_and_colors_bit_for_bit() {
    let gpu = Gpu::new();
    let built = built(300);
    let photo = &built.photos[0];
    let views = Views::upload(&gpu, &[photo.camera], &[&photo.rgb]).unwrap();
    let mut before = random_scene(3, 500, 300, 2);
    let supplement = before.supplement.as_mut().unwrap();
    for part in [&mut before.base, &mut supplement.gaussians] {
        put_before(&photo.camera, &mut part.means);
    }
    // Within their ranges, rotated slightly away from the view.
    let eye = photo.camera.eye();
    let (lobes, means) = (&mut supplement.lobes, &supplement.gaussians.means);
    lobes.widths.fill(0.5);
    lobes.sharpness.fill(2.0);
    for (direction, mean) in lobes.directions.iter_mut().zip(means) {
        let mean = DVec3::from_array(mean.map(f64::from));
        *direction = ((eye - mean).normalize() + DVec3::new(0.3, 0.2, -0.1)).normalize().as_vec3().to_array();
    }
    let model = Model::upload(&gpu, &before, 0).unwrap();
    let mut options = EnhanceOptions::paper().join;
    options.steps_per_view = 1;
    let session = Session { background: built.background, extent: 2.0, ..session(&gpu) };
    join(&session, &model, &views, &options).unwrap().run(&model, &views, false, |_| ()).unwrap();
    let after = model.download().unwrap();
    assert_eq!(model.count_of(Segment::Supplement), 300);

    let Scene { base, supplement, .. } = &after;
    let frozen = |base: &Gaussians| {
        let numbers = [&base.means, &base.log_scales, &base.sh].map(|values| values.as_flattened());
        numbers.into_iter().flatten().chain(base.quats.as_flattened()).map(|v| v.to_bits()).collect::<Vec<_>>()
    };
    assert!(frozen(base) == frozen(&before.base));
    let moved = base.opacities.iter().zip(&before.base.opacities).filter(|(a, b)| a != b).count();
    assert!((50..500).contains(&moved), "{moved} opacities moved");
    let (new, old) = (supplement.as_ref().unwrap(), before.supplement.as_ref().unwrap());
    assert!(new.gaussians.means != old.gaussians.means && new.gaussians.sh != old.gaussians.sh);
    assert!(new.lobes.directions != old.lobes.directions);
    let longest = |new: &[f32], old: &[f32]| new.iter().zip(old).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    for (what, moved, rate) in [
        ("widths", longest(&new.lobes.widths, &old.lobes.widths), 2e-4),
        ("sharpnesses", longest(&new.lobes.sharpness, &old.lobes.sharpness), 2e-3),
    ] {
        assert!((moved / rate - 1.0).abs() < 0.01, "{what} moved by {moved}, their rate is {rate}");
    }
}
