//! Invariants of residual pursuit, to the bit: pages, budgets, views that see nothing. `tests/learning/pursuit.rs`
//! tests the placement itself.

use std::slice::from_ref;

use glam::{DMat3, DVec3};
use glint::{
    gpu::Context,
    pipelines::{
        model::{Model, Room, Segment},
        pursuit::{Kinds, Placed, Pursuit, PursuitOptions},
        render::{Needs, RenderOptions, Renderer},
        session::Session,
        views::Views,
    },
    scene::{Camera, Gaussians, Scene},
    stages::types::Lift,
};

use super::{
    common::{Gpu, session},
    plates,
};

const WIDTH: u32 = 60;
const HEIGHT: u32 = 50;
const WHITE: u32 = 0xFFFF_FFFF;
const BLACK: u32 = 0xFF00_0000;

/// A camera at `x` that looks along z.
pub fn camera(x: f64) -> Camera {
    Camera { translation: DVec3::new(-x, 0.0, 0.0), ..Camera::new(WIDTH, HEIGHT, 65.0) }
}

/// An exactly black wall at z = 4: the photographs equal the residual.
fn wall() -> Gaussians {
    plates([9, 9], 1.0, [-0.4, -0.4, -6.0], 4.0, [-5.0; 3])
}

/// Options that accept evidence from one view alone.
fn bold() -> PursuitOptions {
    PursuitOptions { caution: 0.0, doubt: 0.0, ..Default::default() }
}

/// Adds a black plate that faces z.
fn push(base: &mut Gaussians, mean: [f32; 3], log_scale: f32) {
    base.means.push(mean);
    base.log_scales.push([log_scale, log_scale, -6.0]);
    base.quats.push([1.0, 0.0, 0.0, 0.0]);
    base.opacities.push(4.0);
    base.sh.push([-5.0; 3]);
}

/// Packed pixels; `color` takes column and row.
fn photo(camera: &Camera, color: impl Fn(u32, u32) -> u32) -> Vec<u32> {
    (0..camera.pixels()).map(|p| color(p % camera.width, p / camera.width)).collect()
}

/// White in a square of 8 px about a pixel, else black.
fn spot(camera: &Camera, x: u32, y: u32) -> Vec<u32> {
    photo(camera, |u, v| if u.abs_diff(x) < 4 && v.abs_diff(y) < 4 { WHITE } else { BLACK })
}

pub struct Found {
    pub placed: Placed,
    /// Added Gaussians by segment.
    added: [u32; 2],
    /// Squared error of all views, before and after.
    errors: [f64; 2],
}

/// Makes room for `made_for` Gaussians and places at most `most`.
pub fn pursue_in(
    session: &Session,
    base: &Gaussians,
    seen: &[(Camera, Vec<u32>)],
    [made_for, most]: [u32; 2],
    options: PursuitOptions,
) -> Found {
    pursue_with(session, base, seen, [made_for, most], options, |pursuit| pursuit.start(most))
}

/// [`pursue_in`] with a custom `start`.
fn pursue_with(
    session: &Session,
    base: &Gaussians,
    seen: &[(Camera, Vec<u32>)],
    [made_for, most]: [u32; 2],
    options: PursuitOptions,
    start: impl FnOnce(&mut Pursuit) -> glint::Result<()>,
) -> Found {
    let gpu = &session.context;
    let cameras: Vec<Camera> = seen.iter().map(|(camera, _)| *camera).collect();
    let views = Views::without_photographs(gpu, DVec3::ZERO, &cameras, true).unwrap();
    seen.iter().enumerate().for_each(|(v, (_, photo))| views.upload_photograph(v, photo).unwrap());
    let scene = Scene { base: base.clone(), ..Default::default() };
    let room = Room { supplement: made_for, base: made_for, ..Room::default() };
    let mut model = Model::upload_around(gpu, DVec3::ZERO, &scene, room).unwrap();
    let shown = RenderOptions { depth: true, ..Default::default() };
    let mut renderer = Renderer::new(gpu, Needs::of(&model), &views, shown).unwrap();
    let squared = |renderer: &mut Renderer, model: &Model| -> f64 {
        let of = |v: usize| -> f64 {
            let shown = renderer.render(model, &views, v as u32, session.background).unwrap();
            let pixels = seen[v].1.iter().zip(shown.color.chunks(3)).filter(|(target, _)| **target >> 24 > 0);
            let one = |target: &u32, c: &[f32]| -> f64 {
                let square = |k: usize| (f64::from(target.to_le_bytes()[k]) / 255.0 - f64::from(c[k])).powi(2);
                (0..3).map(square).sum()
            };
            pixels.map(|(target, c)| one(target, c)).sum()
        };
        (0..seen.len()).map(of).sum()
    };
    let before = squared(&mut renderer, &model);
    let mut pursuit = Pursuit::new(session, &views, made_for, options).unwrap();
    start(&mut pursuit).unwrap();
    while pursuit.advance(&mut renderer, &model, &views).unwrap().is_some() {}
    let placed = pursuit.placed().unwrap();
    model.learn_counts().unwrap();
    let added = [model.count_of(Segment::Base) - base.len() as u32, model.count_of(Segment::Supplement)];
    assert_eq!(added, [placed.plain, placed.lobes]);
    assert!(placed.count() <= most.min(made_for) && placed.gains.is_sorted_by(|a, b| a >= b), "{:?}", placed.gains);
    assert!(placed.gains.iter().all(|&gain| gain > 0.0), "{:?}", placed.gains);
    for lift in &placed.lifts {
        let numbers = [
            &lift.mean[..],
            &lift.log_scale,
            &lift.dc,
            &lift.lobe_dir,
            &[lift.opacity, lift.lobe_width, lift.theta_bar],
        ];
        assert!(numbers.concat().iter().all(|n| n.is_finite()), "{lift:?}");
    }
    let errors = [before, squared(&mut renderer, &model)];
    Found { placed, added, errors }
}

fn pursue(gpu: &Context, base: &Gaussians, seen: &[(Camera, Vec<u32>)], options: PursuitOptions) -> Found {
    pursue_in(&session(gpu), base, seen, [20, 20], options)
}

/// Three views of a stripe on the wall, and a spot that only one of them sees.
fn three() -> Vec<(Camera, Vec<u32>)> {
    let one = |v: u32| {
        let camera = camera(0.4 * f64::from(v));
        let inside = |u: u32, w: u32| v == 1 && u.abs_diff(45) < 4 && w.abs_diff(12) < 4;
        // An object at x is 6.5 px further left in each next camera.
        let stripe = |u: u32| u32::from((20.0..26.0).contains(&(f64::from(u) + 6.5 * f64::from(v))));
        let color = |u, w| if inside(u, w) { WHITE } else { BLACK | (stripe(u) * 0x0060_A0C0) };
        (camera, photo(&camera, color))
    };
    (0..3).map(one).collect()
}

/// Sums over views continue from page to page, so no bit differs.
#[test]
fn pages_change_nothing() {
    let gpu = Gpu::new();
    let seen = three();
    let of = |page| pursue(&gpu, &wall(), &seen, PursuitOptions { rounds: 8, page, ..Default::default() }).placed;
    let whole = of(None);
    assert!(whole.count() > 8, "{whole:?}");
    // A view has 60 x 50 + 30 x 25 + 15 x 13 texels: one page per view, then one page for two views and one
    // for the third.
    for page in [1, 2 * 3945] {
        assert_eq!(of(Some(page)), whole, "{page}");
    }
}

/// Three of five views stand for all: the others change nothing, and gains are those in three times 5/3.
#[test]
fn evenly_spread_views_stand_for_all() {
    let gpu = Gpu::new();
    let of = |seen: &[(Camera, Vec<u32>)]| {
        pursue(&gpu, &wall(), seen, PursuitOptions { rounds: 8, views: Some(3), ..Default::default() }).placed
    };
    let whole = of(&three());
    assert!(whole.count() > 8, "{whole:?}");
    let mut seen = three();
    // Views 0, 1 and 3 are looked at.
    for at in [2, 4] {
        seen.insert(at, (camera(0.2), photo(&camera(0.2), |_, _| WHITE)));
    }
    let some = of(&seen);
    let gains: Vec<f32> = whole.gains.iter().map(|gain| gain / 0.6).collect();
    assert_eq!((&some.lifts, &some.gains), (&whole.lifts, &gains));
}

/// With the same draws and rounds the first Gaussians are the same, whether or not more may follow.
#[test]
fn budgets_are_kept() {
    let gpu = Gpu::new();
    let (base, seen) = (wall(), three());
    let run = |made_for, most, draws| {
        let options = PursuitOptions { draws, rounds: 8, ..Default::default() };
        pursue_in(&session(&gpu), &base, &seen, [made_for, most], options).placed
    };
    let all = run(20, 20, 12);
    assert!(all.count() > 8, "{all:?}");
    // The limit at construction is never exceeded.
    for (made_for, most, draws) in [(1, 1, 240), (20, 1, 12), (20, 7, 12), (20, 0, 12), (6, 40, 40)] {
        let (some, fit) = (run(made_for, most, draws), most.min(made_for) as usize);
        assert_eq!((&some.lifts[..], &some.gains[..]), (&all.lifts[..fit], &all.gains[..fit]));
    }
}

/// A limit on bytes ends a placement at the first Gaussian that does not fit, whatever its kind.
#[test]
fn bytes_are_spent_in_the_order_of_gain() {
    let gpu = Gpu::new();
    let run = |prices: [u64; 2], bytes| {
        let options = PursuitOptions { rounds: 8, lobe_worth: 0.5, ..Default::default() };
        let start = |pursuit: &mut Pursuit| {
            pursuit.charge(prices);
            pursuit.start_within(20, bytes)
        };
        pursue_with(&session(&gpu), &wall(), &three(), [20, 20], options, start).placed
    };
    // At half the price and half the worth, ties give both kinds.
    let prices = [124, 248];
    let all = run(prices, None);
    assert!(all.lobes > 0 && all.plain > 0 && all.count() > 8, "{all:?}");
    let price = |lift: &Lift| if lift.lobe_width > 0.0 { prices[0] } else { prices[1] };
    for bytes in [0, 123, 124, 247, 248, 1000, 1003, 2004, 20 * 124, 20 * 248, u64::MAX] {
        let mut taken = 0;
        let fit = all.lifts.iter().take_while(|lift| {
            taken += price(lift);
            taken <= bytes
        });
        let (fit, some) = (fit.count(), run(prices, Some(bytes)));
        assert_eq!((&some.lifts[..], &some.gains[..]), (&all.lifts[..fit], &all.gains[..fit]), "{bytes}");
    }
    // A lower price makes a kind more frequent.
    let cheap = run([76, 248], Some(20 * 76));
    assert!(cheap.lobes > all.lobes && cheap.plain < all.plain, "{cheap:?}");
}

/// A placement that is hurried at its beginning or in its first round has one round, and places what that chose.
#[test]
fn a_hurried_placement_has_one_round() {
    let gpu = Gpu::new();
    let run = |rounds, hurried| {
        let options = PursuitOptions { rounds, ..Default::default() };
        let start = |pursuit: &mut Pursuit| {
            pursuit.start(20)?;
            if hurried {
                pursuit.hurry();
            }
            Ok(())
        };
        pursue_with(&session(&gpu), &wall(), &three(), [20, 20], options, start).placed
    };
    let [one, hurried, whole] = [run(1, false), run(8, true), run(8, false)];
    assert_eq!(hurried, one);
    assert!((1..whole.count()).contains(&one.count()), "{} of {}", one.count(), whole.count());
}

/// Only the allowed kinds, with at least the minimum gain.
#[test]
fn kinds_and_the_least_gain_are_kept() {
    let gpu = Gpu::new();
    let run = |kinds, least_gain| {
        let options = PursuitOptions { kinds, least_gain, rounds: 8, ..Default::default() };
        pursue(&gpu, &wall(), &three(), options).placed
    };
    let (lobes, plain) = (run(Kinds::Lobes, 0.0), run(Kinds::Plain, 0.0));
    assert!(lobes.lobes > 5 && lobes.plain == 0 && plain.plain > 5 && plain.lobes == 0);
    let least = plain.gains[4];
    let fewer = run(Kinds::Plain, least);
    let enough = plain.gains.iter().filter(|&&gain| gain >= least).count();
    assert!(enough < plain.gains.len());
    assert_eq!(fewer.gains, plain.gains[..enough]);
}

/// A wall of small plates of all colors; the photographs differ by evenly spaced spots and by noise.
/// Gaussians that would hide the plates are not worth it.
#[test]
fn gains_are_what_the_error_falls_by_on_a_texture() {
    let gpu = Gpu::new();
    let mut base = Gaussians { sh_degree: 0, ..Default::default() };
    let hash = |i: u32| i.wrapping_mul(0x9E37_79B9).rotate_left(13).wrapping_mul(0x85EB_CA6B) >> 8;
    let unit = |i: u32| f64::from(hash(i)) / f64::from(1u32 << 24);
    for (i, j) in (0..20u32).flat_map(|i| (0..20u32).map(move |j| (i, j))) {
        push(&mut base, [0.25 * i as f32 - 2.0, 0.25 * j as f32 - 2.5, 4.0], -2.1);
        let last = base.sh.len() - 1;
        base.sh[last] = [0, 1, 2].map(|k| (2.4 * unit(3 * (20 * i + j) + k) - 1.2) as f32);
    }
    let cameras: Vec<Camera> = (0..5).map(|v| camera(0.2 * f64::from(v))).collect();
    let session = session(&gpu);
    let views = Views::without_photographs(&gpu, DVec3::ZERO, &cameras, true).unwrap();
    let scene = Scene { base: base.clone(), ..Default::default() };
    let model = Model::upload_around(&gpu, DVec3::ZERO, &scene, Room::default()).unwrap();
    let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, RenderOptions::default()).unwrap();
    let mut seen = Vec::new();
    for (v, camera) in cameras.iter().enumerate() {
        let shown = renderer.render(&model, &views, v as u32, session.background).unwrap();
        let one = |u: u32, w: u32| {
            let p = camera.unproject(f64::from(u) + 0.5, f64::from(w) + 0.5, 4.0);
            let spot = |s: f64| (-0.5 * (s - (s / 0.8).round() * 0.8).powi(2) / 0.12f64.powi(2)).exp();
            let pixel = w * camera.width + u;
            let byte = |k: u32| {
                let noise = 0.06 * (unit(3 * (pixel + 3000 * v as u32) + k + 7777) - 0.5);
                let render = f64::from(shown.color[(3 * pixel + k) as usize]);
                (255.0 * (render + 0.05 * spot(p.x) * spot(p.y) + noise)).round().clamp(0.0, 255.0) as u32
            };
            BLACK | byte(0) | byte(1) << 8 | byte(2) << 16
        };
        seen.push((*camera, photo(camera, one)));
    }
    // Without doubt, which would reduce the predicted gains.
    let found = pursue(&gpu, &base, &seen, PursuitOptions { doubt: 0.0, ..Default::default() });
    let predicted: f64 = found.placed.gains.iter().map(|&gain| f64::from(gain)).sum();
    let fell = found.errors[0] - found.errors[1];
    // A fifth, since levels are at every other size and candidates between pixels. Without the occlusion by a
    // footprint, the error would rise.
    let count = found.placed.count();
    assert!(count > 10 && (fell / predicted - 1.0).abs() < 0.2, "{count}: fell by {fell}, predicted {predicted}");
}

/// Nine views of a black wall, some of which show a spot: with doubt, one view in nine counts as noise, all
/// nine do not.
#[test]
fn what_few_views_tell_counts_less() {
    let gpu = Gpu::new();
    let seen = |tell: usize| -> Vec<(Camera, Vec<u32>)> {
        let one = |v: usize| {
            let camera = camera(0.05 * v as f64);
            // The same place on the wall in every view.
            let at = 30 - (65.0 * 0.05 * v as f64 / 4.0).round() as u32;
            (camera, if v < tell { spot(&camera, at, 25) } else { photo(&camera, |_, _| BLACK) })
        };
        (0..9).map(one).collect()
    };
    let of = |tell, doubt| {
        let options = PursuitOptions { caution: 0.0, doubt, kinds: Kinds::Lobes, ..Default::default() };
        pursue(&gpu, &wall(), &seen(tell), options).placed
    };
    assert!(of(1, 0.0).count() > 0);
    assert_eq!(of(1, 1.0).count(), 0);
    let [sure, unsure] = [0.0, 1.0].map(|doubt| of(9, doubt).gains[0]);
    // Lobes of the maximum width reach all nine, the outer ones weakly: between 1 - 1/3 for nine equal views,
    // and the value for four.
    assert!((0.5..0.7).contains(&(unsure / sure)), "{unsure} of {sure}");
}

#[test]
fn without_an_error_nothing_is_placed() {
    let gpu = Gpu::new();
    let black = [0.0, 0.4].map(|x| (camera(x), photo(&camera(x), |_, _| BLACK)));
    let white = [0.0, 0.4].map(|x| (camera(x), photo(&camera(x), |_, _| WHITE)));
    // A wall that equals its photographs, and a scene without any surface.
    for (base, seen) in [(wall(), &black), (Gaussians::default(), &white)] {
        let found = pursue(&gpu, &base, seen, PursuitOptions::default());
        assert_eq!((found.added, found.placed), ([0, 0], Placed::default()));
    }
}

/// The square is masked in a photograph, or a whole render is NaN or infinite.
#[test]
fn pixels_that_do_not_count_draw_nothing() {
    let gpu = Gpu::new();
    let masked = (
        camera(0.0),
        spot(&camera(0.0), 30, 25).iter().map(|p| if *p == WHITE { p & 0xFF_FFFF } else { *p }).collect(),
    );
    let found = pursue(&gpu, &wall(), &[masked], bold());
    assert_eq!(found.added, [0, 0]);
    for bad in [f32::NAN, f32::INFINITY] {
        let session = Session { background: [bad, 0.0, 0.0], ..session(&gpu) };
        let seen = [(camera(0.0), spot(&camera(0.0), 30, 25))];
        let found = pursue_in(&session, &wall(), &seen, [20, 20], bold());
        assert_eq!(found.added, [0, 0], "{bad}");
    }
    // Where a color of the base is infinite; the rest works as usual.
    let mut base = wall();
    base.sh[29] = [f32::MAX; 3];
    let seen = [(camera(0.0), spot(&camera(0.0), 45, 40))];
    assert!(pursue(&gpu, &base, &seen, bold()).placed.count() > 0);
}

/// Without another view the angle to the nearest is a quarter turn; placed Gaussians lie on the wall. Each is
/// fitted to the same original render, so overlapping ones gain less than their sum: the square keeps 0.63 of
/// its error. A camera that looks away and one that looks elsewhere do not see the wall's middle: angle and gain must not change.
#[test]
fn one_view_is_enough() {
    let gpu = Gpu::new();
    let front = (camera(0.0), spot(&camera(0.0), 30, 25));
    let found = pursue(&gpu, &wall(), from_ref(&front), bold());
    assert!(
        found.placed.count() > 0 && found.errors[1] < 0.8 * found.errors[0],
        "{:?} {:?}",
        found.added,
        found.errors
    );
    for lift in &found.placed.lifts {
        assert_eq!(lift.theta_bar, std::f32::consts::FRAC_PI_2);
        // 4 px at depth 4, with 65 px per unit.
        let [x, y, z] = lift.mean;
        assert!(x.abs() < 0.25 && y.abs() < 0.25 && (z - 4.0).abs() < 0.1, "{lift:?}");
    }
    let away = Camera { rotation: DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0)), ..camera(0.0) };
    for other in [away, camera(2.5)] {
        let seen = [front.clone(), (other, photo(&other, |_, _| BLACK))];
        assert_eq!(pursue(&gpu, &wall(), &seen, bold()).placed, found.placed, "{other:?}");
    }
}

/// If a plate hides a candidate in a view from the side, that view does not affect its gain; without the
/// plate it does.
#[test]
fn a_view_from_which_a_candidate_is_hidden_does_not_judge_it() {
    let gpu = Gpu::new();
    let (front, side) = ((camera(0.0), spot(&camera(0.0), 30, 25)), (camera(1.5), photo(&camera(1.5), |_, _| BLACK)));
    let options = PursuitOptions { kinds: Kinds::Plain, ..bold() };
    // Half way from the side's camera to the middle of the spot; 24 px next to it for the camera in front.
    let mut hidden = wall();
    push(&mut hidden, [0.75, 0.0, 2.0], 0.3f32.ln());
    let run = |base: &Gaussians, seen: &[(Camera, Vec<u32>)]| pursue(&gpu, base, seen, options).placed;
    let alone = run(&hidden, from_ref(&front));
    assert!(alone.count() > 0);
    let judged = run(&hidden, &[front.clone(), side.clone()]);
    assert_eq!(judged.gains, alone.gains);
    let parts =
        |placed: &Placed| placed.lifts.iter().map(|l| (l.mean, l.log_scale, l.opacity, l.dc)).collect::<Vec<_>>();
    assert_eq!(parts(&judged), parts(&alone));
    // Without the plate, the side loses the front's gain.
    let open = [run(&wall(), from_ref(&front)), run(&wall(), &[front, side])];
    assert!(open[1].gains.iter().sum::<f32>() < 0.8 * open[0].gains.iter().sum::<f32>(), "{open:?}");
}

/// A pixel gives one candidate, however often it is drawn.
#[test]
fn more_draws_than_pixels() {
    let gpu = Gpu::new();
    for (width, height) in [(1, 1), (2, 1), (1, 3)] {
        let (cx, cy) = (0.5 * f64::from(width), 0.5 * f64::from(height));
        let small = |x: f64| Camera { width, height, cx, cy, ..camera(x) };
        let seen = [0.0, 3.0].map(|x| (small(x), photo(&small(x), |_, _| WHITE)));
        let found = pursue(&gpu, &wall(), &seen, bold());
        let pixels = 2 * width * height;
        assert!((1..=pixels).contains(&found.placed.count()), "{:?} of {pixels} pixels", found.added);
        assert!(found.errors[1] < found.errors[0], "{:?}", found.errors);
    }
}
