//! Sector hold-out: tests on a contiguous eighth of the cameras, to measure extrapolation to places without
//! cameras instead of interpolation between neighbours.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};

use crate::scene::eigen;

/// The sector is one in this number of photos, rounded up.
const PART: usize = 8;
/// Cameras count as surrounding something if their axes are at least this far from the rotation axis (the
/// sine: 30°) ...
const LEAST_TURN: f64 = 0.5;
/// ... and cancel: the length of their mean, relative to their root mean square, is sin(A/2)/(A/2) on an arc
/// of A, half at 217°.
const LARGEST_MEAN: f64 = 0.5;
/// Differences of angles and positions below this fraction of the spread are rounding: names then decide the
/// order.
const SAME: f64 = 1e-6;

/// Position of a camera, and its optical axis, a unit vector; world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stand {
    pub(super) eye: DVec3,
    pub(super) axis: DVec3,
}

/// For each of `stands`, in the order of their names, whether it is in the sector.
///
/// - If the cameras surround something, they are ordered by their angle around the point nearest to all axes,
///   in the plane of the two largest spreads of the eyes. The sector is a run of an eighth that contains the
///   first photo, the one that spans the least angle.
/// - Otherwise they are ordered along the largest spread of the eyes, from the end nearer to the first photo.
///   The sector is the first eighth.
pub(super) fn sector(stands: &[Stand]) -> Vec<bool> {
    let n = stands.len();
    let mut taken = vec![false; n];
    if n == 0 {
        return taken;
    }
    let count = n.div_ceil(PART);
    let mean = stands.iter().map(|s| s.eye).sum::<DVec3>() / n as f64;
    let [across, along] = principal(stands.iter().map(|s| s.eye - mean));
    let chosen = round(stands, across, count).unwrap_or_else(|| {
        let places: Vec<f64> = stands.iter().map(|s| (s.eye - mean).dot(along)).collect();
        let spread = places.iter().fold(0.0, |largest: f64, place| largest.max(place.abs()));
        // Puts the first photo into the lower half, or the middle.
        let sign = if places[0] > SAME * spread { -1.0 } else { 1.0 };
        let key = |i: usize| (sign * places[i] / (SAME * spread)).round();
        let mut order: Vec<usize> = (0..n).collect();
        // Stable, so that names decide between equal positions; if all eyes are at one place the keys are
        // NaN, which compares as equal.
        order.sort_by(|&a, &b| key(a).total_cmp(&key(b)));
        order.truncate(count);
        order
    });
    chosen.into_iter().for_each(|i| taken[i] = true);
    taken
}

/// The sector of cameras that surround `axle`; `None` if they do not.
fn round(stands: &[Stand], axle: DVec3, count: usize) -> Option<Vec<usize>> {
    let n = stands.len();
    let flat = |v: DVec3| v - v.dot(axle) * axle;
    let turns: Vec<DVec3> = stands.iter().map(|s| flat(s.axis)).collect();
    let size = (turns.iter().map(|t| t.length_squared()).sum::<f64>() / n as f64).sqrt();
    let mean = turns.iter().sum::<DVec3>() / n as f64;
    // An eighth of so few is one photo, for any order.
    if !(n > PART && size >= LEAST_TURN && mean.length() <= LARGEST_MEAN * size) {
        return None;
    }
    let meeting = meeting(stands);
    let (right, up) = axle.any_orthonormal_pair();
    let angle = |s: &Stand| {
        let from = s.eye - meeting;
        from.dot(up).atan2(from.dot(right)).rem_euclid(TAU)
    };
    let angles: Vec<f64> = stands.iter().map(angle).collect();
    let key = |i: usize| (angles[i] / SAME).round();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| key(a).total_cmp(&key(b)));
    let first = order.iter().position(|&i| i == 0)?;
    let run = |before: usize| (0..count).map(move |k| (first + n - before + k) % n);
    let span = |before: usize| {
        let (a, b) = (order[(first + n - before) % n], order[(first + n - before + count - 1) % n]);
        (angles[b] - angles[a]).rem_euclid(TAU)
    };
    let least = (0..count).fold(0, |best, before| if span(before) < span(best) - SAME { before } else { best });
    Some(run(least).map(|at| order[at]).collect())
}

/// The point with the smallest sum of squared distances to all optical axes; a small weight pulls it towards
/// the eyes if the axes leave it undetermined.
fn meeting(stands: &[Stand]) -> DVec3 {
    let (mut a, mut b) = (DMat3::ZERO, DVec3::ZERO);
    for Stand { eye, axis } in stands {
        let across = DMat3::IDENTITY - DMat3::from_cols(*axis * axis.x, *axis * axis.y, *axis * axis.z);
        let weighed = across + DMat3::from_diagonal(DVec3::splat(1e-6));
        a += weighed;
        b += weighed * *eye;
    }
    a.inverse() * b
}

/// Unit vectors along the smallest and the largest spread of `offsets` from their mean, each with a positive
/// largest component.
fn principal(offsets: impl Iterator<Item = DVec3>) -> [DVec3; 2] {
    let mut sums = [0.0f64; 6];
    for DVec3 { x, y, z } in offsets {
        [x * x, y * y, z * z, x * y, x * z, y * z].iter().zip(&mut sums).for_each(|(product, sum)| *sum += product);
    }
    let (_, [largest, _, least]) = eigen(sums);
    [least, largest].map(|axis| {
        let longest = axis.to_array().into_iter().max_by(|x, y| x.abs().total_cmp(&y.abs())).unwrap_or(1.0);
        if longest < 0.0 { -axis } else { axis }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(stands: &[Stand]) -> Vec<usize> {
        sector(stands).iter().enumerate().filter_map(|(i, taken)| taken.then_some(i)).collect()
    }

    /// Cameras on circles around `middle` at these angles, looking at `middle` from above or below.
    fn around(middle: DVec3, turns: impl IntoIterator<Item = f64>, height: f64) -> Vec<Stand> {
        let stand = |turn: f64| {
            let from = DVec3::new(3.0 * turn.cos(), 3.0 * turn.sin(), height);
            Stand { eye: middle + from, axis: -from.normalize() }
        };
        turns.into_iter().map(stand).collect()
    }

    /// Reorders `of` by names unrelated to positions: each seventh, modulo their number.
    fn shuffled(of: &[Stand]) -> Vec<(usize, Stand)> {
        (0..of.len()).map(|i| (7 * i + 3) % of.len()).map(|place| (place, of[place])).collect()
    }

    fn places(of: &[Stand]) -> Vec<usize> {
        let named = shuffled(of);
        let stands: Vec<Stand> = named.iter().map(|n| n.1).collect();
        let mut places: Vec<usize> = taken(&stands).into_iter().map(|i| named[i].0).collect();
        places.sort();
        places
    }

    #[test]
    fn the_end_of_a_line_that_the_first_is_nearer_to() {
        let line = |n: usize, tilt: DVec3| -> Vec<Stand> {
            (0..n).map(|i| Stand { eye: tilt * i as f64, axis: DVec3::Z }).collect()
        };
        for tilt in [DVec3::X, DVec3::NEG_X, DVec3::new(1e-3, -2e-3, 5e-4), DVec3::splat(1e5)] {
            assert_eq!(taken(&line(24, tilt)), [0, 1, 2]);
            // The first by name is the fourth of the line.
            assert_eq!(places(&line(25, tilt)), [0, 1, 2, 3]);
            let mut back = line(24, tilt);
            back.reverse();
            assert_eq!(taken(&back), [0, 1, 2]);
        }
        // A grid with a column spacing of 2 and a row spacing of 1: whole columns, from one side.
        let grid: Vec<Stand> = (0..48)
            .map(|i| Stand {
                eye: DVec3::new(2.0 * (i / 6) as f64, (i % 6) as f64, 0.01 * (i % 5) as f64),
                axis: DVec3::Z,
            })
            .collect();
        assert_eq!(taken(&grid), [0, 1, 2, 3, 4, 5]);
        assert_eq!(places(&grid[..41]), (0..6).collect::<Vec<_>>());
    }

    #[test]
    fn an_arc_loses_one_end() {
        let arc = |from: f64, to: f64| {
            around(DVec3::new(4.0, -2.0, 9.0), (0..32).map(|i| from + (to - from) * f64::from(i) / 31.0), 1.0)
        };
        for (from, to) in [(0.0, 1.0), (2.0, 4.9)] {
            assert_eq!(taken(&arc(from, to)), [0, 1, 2, 3]);
        }
        // Three quarters of a circle, with ends unrelated to names: no run with the first photo crosses the
        // gap.
        let wide = arc(0.4, 5.1);
        let found = places(&wide);
        assert!(found.len() == 4 && found.windows(2).all(|w| w[1] == w[0] + 1), "{found:?}");
        let mut named = wide.clone();
        named.rotate_right(1);
        // The last position is first by name: the run ends there.
        assert_eq!(taken(&named), [0, 29, 30, 31]);
    }

    #[test]
    fn an_orbit_loses_an_eighth_of_its_round() {
        let even = |n: u32| (0..n).map(move |i| TAU * f64::from(i) / f64::from(n));
        for height in [-1.0, 0.0, 2.5] {
            let ring = around(DVec3::new(10.0, 20.0, 30.0), even(40), height);
            let found = taken(&ring);
            assert!(found == [0, 1, 2, 3, 4] || found == [0, 36, 37, 38, 39], "{height}: {found:?}");
        }
        // Two rings of different heights and widths, one after the other by name: the same sector of both.
        let mut rings = around(DVec3::ZERO, even(32), 0.3);
        rings.extend(around(DVec3::ZERO, even(32), 2.0));
        let found = taken(&rings);
        let turns: Vec<usize> = found.iter().map(|i| i % 32).collect();
        assert_eq!(found.len(), 8);
        assert_eq!(found.iter().filter(|i| **i < 32).count(), 4, "{found:?}");
        assert!(turns[..4] == turns[4..], "{found:?}");
        // Cameras that look outward also count as surrounding.
        let outward: Vec<Stand> =
            around(DVec3::ZERO, even(40), 0.0).iter().map(|s| Stand { axis: -s.axis, ..*s }).collect();
        assert_eq!(taken(&outward).len(), 5);
        let found = taken(&outward);
        assert!(found == [0, 1, 2, 3, 4] || found == [0, 36, 37, 38, 39], "{found:?}");
    }

    #[test]
    fn few_photos_equal_eyes_and_numbers_beyond_all() {
        let stand = |x: f64| Stand { eye: DVec3::new(x, 0.0, 0.0), axis: DVec3::Y };
        assert_eq!(sector(&[]), Vec::<bool>::new());
        assert_eq!(sector(&[stand(1.0)]), [true]);
        assert_eq!(sector(&[stand(1.0), stand(3.0)]), [true, false]);
        assert_eq!(sector(&[stand(3.0), stand(1.0)]), [true, false]);
        assert_eq!(taken(&[stand(2.0); 20]), [0, 1, 2]);
        // Equal eyes that look all around: any order, but not more than an eighth.
        let turning: Vec<Stand> = around(DVec3::ZERO, (0..24).map(f64::from), 0.0)
            .iter()
            .map(|s| Stand { eye: DVec3::ONE, axis: s.axis })
            .collect();
        assert_eq!(taken(&turning).len(), 3);
        for far in [1e200, f64::INFINITY, f64::NAN] {
            let stands: Vec<Stand> = (0..20).map(|i| stand(f64::from(i) * far)).collect();
            assert_eq!(taken(&stands).len(), 3);
        }
    }
}
