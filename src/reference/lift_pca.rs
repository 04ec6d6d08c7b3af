//! Twin of `lift_pca.comp`: the 3D Gaussian of each prime group: position, weighted PCA, calibration, color
//! and lobe (method, section 4.3 to 4.6). The kernel's head comment lists the cases in which the algebra is
//! not unique.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

use super::harmonics::C0;
use super::lift_count::ScreenGaussians;
use super::lift_groups::LiftClusters;
use super::lift_points::LiftPoints;
use super::{NEAR, View};
use crate::{
    scene::{Camera, eigen},
    stages::types,
};

/// Smallest eigenvalue, in squares of the scene's own length.
pub const EIGENVALUE_MIN: f64 = 1e-7;

/// A supplementary Gaussian in world space; all 0 if there is no lift.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Lift {
    /// Scene units.
    pub mean: [f64; 3],
    /// Natural logarithms of the standard deviations, descending.
    pub log_scale: [f64; 3],
    /// (w, x, y, z), unit.
    pub quat: [f64; 4],
    /// Constant SH coefficient of each channel.
    pub dc: [f64; 3],
    /// Logit.
    pub opacity: f64,
    /// Unit, from the Gaussian to the source camera.
    pub lobe_dir: [f64; 3],
    /// T, 0.01 to 1.
    pub lobe_width: f64,
    /// θ̄, radians.
    pub theta_bar: f64,
    /// Points of the prime group; 0: no lift.
    pub cluster_size: u32,
}

impl From<&types::Lift> for Lift {
    fn from(l: &types::Lift) -> Self {
        Lift {
            mean: l.mean.map(f64::from),
            log_scale: l.log_scale.map(f64::from),
            quat: l.quat.map(f64::from),
            dc: l.dc.map(f64::from),
            opacity: f64::from(l.opacity),
            lobe_dir: l.lobe_dir.map(f64::from),
            lobe_width: f64::from(l.lobe_width),
            theta_bar: f64::from(l.theta_bar),
            cluster_size: l.cluster_size,
        }
    }
}

/// The covariance of the weighted points (xyz, weight) as (xx, yy, zz, xy, xz, yz), and their weighted mean:
/// weights w for the mean, w² (⚖ `plain_weights`: w) for the covariance. Sums are centred on the first point.
pub fn weighted_covariance(points: &[[f64; 4]], plain_weights: bool) -> ([f64; 6], DVec3) {
    let Some(&first) = points.first() else { return ([0.0; 6], DVec3::ZERO) };
    let origin = DVec3::new(first[0], first[1], first[2]);
    let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
    for p in points {
        sum += p[3] * (DVec3::new(p[0], p[1], p[2]) - origin);
        weights += p[3];
    }
    let centred_mean = sum / weights;
    let (mut c, mut total) = ([0.0; 6], 0.0);
    for p in points {
        let d = (DVec3::new(p[0], p[1], p[2]) - origin) - centred_mean;
        let weight = if plain_weights { p[3] } else { p[3] * p[3] };
        for (c, product) in c.iter_mut().zip([d.x * d.x, d.y * d.y, d.z * d.z, d.x * d.y, d.x * d.z, d.y * d.z]) {
            *c += weight * product;
        }
        total += weight;
    }
    (c.map(|v| v / total), origin + centred_mean)
}

/// Unit quaternion (w, x, y, z) of the rotation with these columns (Shepperd's method).
pub fn quaternion(columns: [DVec3; 3]) -> [f64; 4] {
    let [a, b, c] = columns;
    let w = 1.0 + a.x + b.y + c.z;
    let x = 1.0 + a.x - b.y - c.z;
    let y = 1.0 - a.x + b.y - c.z;
    let z = 1.0 - a.x - b.y + c.z;
    let q = if w >= x && w >= y && w >= z {
        [w, b.z - c.y, c.x - a.z, a.y - b.x]
    } else if x >= y && x >= z {
        [b.z - c.y, x, a.y + b.x, c.x + a.z]
    } else if y >= z {
        [c.x - a.z, a.y + b.x, y, b.z + c.y]
    } else {
        [a.y - b.x, c.x + a.z, b.z + c.y, z]
    };
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    q.map(|v| v / length)
}

/// Q = J R diag(λ) Rᵀ Jᵀ as (Q11, Q12, Q22), px², without dilation. All in the camera's frame; `slope` is x/z
/// and y/z, clamped as in rendering.
pub fn projected_covariance(
    camera: &Camera,
    slope: [f64; 2],
    depth: f64,
    value: [f64; 3],
    axes: [DVec3; 3],
) -> [f64; 3] {
    let View { slope_x, slope_y, .. } = View::from_camera(camera);
    let slope = [slope[0].max(slope_x[0]).min(slope_x[1]), slope[1].max(slope_y[0]).min(slope_y[1])];
    let mut q = [0.0; 3];
    for (value, axis) in value.iter().zip(axes) {
        let m1 = camera.fx / depth * value.sqrt() * (axis.x - slope[0] * axis.z);
        let m2 = camera.fy / depth * value.sqrt() * (axis.y - slope[1] * axis.z);
        q[0] += m1 * m1;
        q[1] += m1 * m2;
        q[2] += m2 * m2;
    }
    q
}

/// The k² for which k²·Q is closest to S in the Frobenius norm: ⟨Q,S⟩/‖Q‖². NaN if Q is 0.
pub fn calibration(q: [f64; 3], s: [f64; 3]) -> f64 {
    let size = q[0] + q[2];
    let u = q.map(|v| v / size);
    (u[0] * s[0] + 2.0 * u[1] * s[1] + u[2] * s[2]) / ((u[0] * u[0] + 2.0 * u[1] * u[1] + u[2] * u[2]) * size)
}

/// Angle at `position` between the source camera (in direction `toward`) and the training camera closest in
/// angle whose frustum contains the position; π/2 if there is none.
fn nearest_view_angle(position: DVec3, toward: DVec3, source: u32, views: &[Camera], train_views: &[u32]) -> f64 {
    let mut nearest = 4.0;
    for &v in train_views {
        let Some(camera) = views.get(v as usize).filter(|_| v != source) else { continue };
        let (x, y, z) = camera.project(position);
        let seen = z > NEAR && x >= 0.0 && y >= 0.0 && x < camera.width as f64 && y < camera.height as f64;
        if seen {
            let other = camera.eye() - position;
            nearest = f64::min(nearest, toward.cross(other).length().atan2(toward.dot(other)));
        }
    }
    if nearest < 4.0 { nearest } else { FRAC_PI_2 }
}

/// Computes all lifts. `unit`: the scene's own length. `plain_weights` ⚖: covariance weighted by w, not w².
pub fn lift_pca(
    gaussians: &ScreenGaussians,
    points: &LiftPoints,
    clusters: &LiftClusters,
    train_views: &[u32],
    unit: f64,
    plain_weights: bool,
) -> Vec<Lift> {
    (0..gaussians.len())
        .map(|item| make_lift(gaussians, points, clusters, train_views, unit, plain_weights, item).unwrap_or_default())
        .collect()
}

fn make_lift(
    gaussians: &ScreenGaussians,
    points: &LiftPoints,
    clusters: &LiftClusters,
    train_views: &[u32],
    unit: f64,
    plain_weights: bool,
    item: usize,
) -> Option<Lift> {
    let camera = gaussians.view(item).filter(|_| clusters.cluster_sizes[item] > 0)?;
    let set = points.set(item);
    let labels = &clusters.labels[points.firsts[item] as usize..];
    let prime = clusters.prime_labels[item];
    let group: Vec<[f64; 4]> = set.iter().zip(labels).filter(|&(_, &l)| l == prime).map(|(&p, _)| p).collect();
    let (covariance, mean) = weighted_covariance(&group, plain_weights);

    // Depth and position, in the camera's frame.
    let heavy = (points.heaviest[item] as usize).min(set.len() - 1);
    let depth = if labels[heavy] == prime { set[heavy][2] } else { mean.z };
    let ray = [(gaussians.get(0, item) - camera.cx) / camera.fx, (gaussians.get(1, item) - camera.cy) / camera.fy];
    let position = DVec3::new(ray[0] * depth, ray[1] * depth, depth);

    let (value, mut axes) = eigen(covariance);
    let value = value.map(|v| v.max(EIGENVALUE_MIN * unit * unit));
    if axes[2].dot(position) > 0.0 {
        axes[2] = -axes[2];
    }
    if axes[0].cross(axes[1]).dot(axes[2]) < 0.0 {
        axes[1] = -axes[1];
    }
    let q = projected_covariance(camera, ray, depth, value, axes);
    let k2 = calibration(q, gaussians.covariance(item));

    let to_world = |v: DVec3| camera.rotation.transpose() * v;
    let mean = camera.eye() + to_world(position);
    let toward = to_world(-position);
    let theta_bar = nearest_view_angle(mean, toward, gaussians.screen_frames[item], gaussians.views, train_views);
    let lift = Lift {
        mean: mean.to_array(),
        log_scale: value.map(|v| 0.5 * (k2 * v).ln()),
        quat: quaternion(axes.map(to_world)),
        dc: [2, 3, 4].map(|plane| (gaussians.get(plane, item) - 0.5) / C0),
        opacity: gaussians.get(5, item),
        lobe_dir: toward.normalize().to_array(),
        lobe_width: (7.0 * theta_bar / PI).clamp(0.01, 1.0),
        theta_bar,
        cluster_size: clusters.cluster_sizes[item],
    };
    let numbers =
        [&lift.mean[..], &lift.log_scale, &lift.quat, &lift.dc, &lift.lobe_dir, &[lift.opacity, theta_bar]].concat();
    (k2 > 0.0 && numbers.iter().all(|v| v.is_finite())).then_some(lift)
}

#[cfg(test)]
mod tests {
    use super::super::{lift_cluster::lift_cluster, lift_points::lift_points};
    use super::*;
    use glam::{DMat3, DQuat};
    use proptest::prelude::*;

    fn rotation() -> impl Strategy<Value = DMat3> {
        (-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64, 0.1..1.0f64)
            .prop_map(|(x, y, z, w)| DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize()))
    }

    fn packed(m: DMat3) -> [f64; 6] {
        [m.col(0).x, m.col(1).y, m.col(2).z, m.col(1).x, m.col(2).x, m.col(2).y]
    }

    fn rebuilt(value: [f64; 3], axes: [DVec3; 3]) -> [f64; 6] {
        let r = DMat3::from_cols(axes[0], axes[1], axes[2]);
        packed(r * DMat3::from_diagonal(DVec3::from(value)) * r.transpose())
    }

    fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    proptest! {
        #[test]
        fn jacobi_recovers_r_diag_rt(r in rotation(), exponents in prop::array::uniform3(-8..9i32), equal in 0..4u32) {
            let mut want = exponents.map(|e| 10f64.powi(e));
            if equal & 1 != 0 { want[1] = want[0]; }
            if equal & 2 != 0 { want[2] = want[1]; }
            let m = packed(r * DMat3::from_diagonal(DVec3::from(want)) * r.transpose());
            let (value, axes) = eigen(m);
            want.sort_by(|a, b| b.total_cmp(a));
            let scale = want[0];
            // A few roundings (2e-16) of the largest eigenvalue.
            prop_assert!(largest_difference(&value, &want) < 1e-14 * scale);
            prop_assert!(largest_difference(&rebuilt(value, axes), &m) < 1e-14 * scale);
            for k in 0..3 {
                prop_assert!((axes[k].length() - 1.0).abs() < 1e-14 && axes[k].dot(axes[(k + 1) % 3]).abs() < 1e-14);
            }
        }

        #[test]
        fn quaternions_give_their_rotation_back(r in rotation(), flips in 0..4u32) {
            // Half turns reach all four branches.
            let turn = [DMat3::IDENTITY, DMat3::from_rotation_x(PI), DMat3::from_rotation_y(PI), DMat3::from_rotation_z(PI)];
            let r = turn[flips as usize] * r;
            let [w, x, y, z] = quaternion([r.x_axis, r.y_axis, r.z_axis]);
            let back = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w));
            prop_assert!(back.abs_diff_eq(r, 1e-14));
        }

        #[test]
        fn calibration_is_the_best_scaling(
            a in 0.1..9.0f64, c in 0.1..9.0f64, t in -0.99..0.99f64, p in 0.1..9.0f64, r in 0.1..9.0f64, u in -0.99..0.99f64,
        ) {
            let (q, s) = ([a, t * (a * c).sqrt(), c], [p, u * (p * r).sqrt(), r]);
            let k2 = calibration(q, s);
            let distance = |k2: f64| {
                let d = [0, 1, 2].map(|i| k2 * q[i] - s[i]);
                d[0] * d[0] + 2.0 * d[1] * d[1] + d[2] * d[2]
            };
            prop_assert!(k2 > 0.0);
            for other in [0.5, 0.99, 0.9999, 1.0001, 1.01, 2.0] {
                prop_assert!(distance(k2) <= distance(other * k2));
            }
            prop_assert!((calibration(q, q.map(|v| 7.0 * v)) - 7.0).abs() < 1e-12);
        }
    }

    #[test]
    fn covariance_is_that_of_known_bodies() {
        // Corners and face centres of boxes: 8 corners (±a, ±b, ±c) have covariance diag(a², b², c²), however far away.
        let far = DVec3::new(1e5, -2e5, 3e5);
        let half = DVec3::new(3.0, 2.0, 0.5);
        let r = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
        let corner = |k: u32| DVec3::from([0, 1, 2].map(|i| if k >> i & 1 == 0 { -1.0 } else { 1.0 })) * half;
        let points: Vec<_> = (0..8).map(corner).map(|v| far + r * v).map(|v| [v.x, v.y, v.z, 0.3]).collect();
        let want = packed(r * DMat3::from_diagonal(half * half) * r.transpose());
        for plain in [false, true] {
            let (got, mean) = weighted_covariance(&points, plain);
            // Points are rounded at 1e5 · 1e-16 = 1e-11.
            assert!(largest_difference(&got, &want) < 1e-9 && mean.abs_diff_eq(far, 1e-9));
        }
        // Weights 1 and 2 at 0 and 3: mean 2; w²: (1·4 + 4·1)/5; w: (1·4 + 2·1)/3.
        let two = [[0.0, 0.0, 0.0, 1.0], [3.0, 0.0, 0.0, 2.0]];
        assert!((weighted_covariance(&two, false).0[0] - 8.0 / 5.0).abs() < 1e-14);
        assert!((weighted_covariance(&two, true).0[0] - 2.0).abs() < 1e-14);
        assert_eq!(weighted_covariance(&two, true).1, DVec3::new(2.0, 0.0, 0.0));
    }

    fn camera(eye: DVec3, target: DVec3) -> Camera {
        let z = (target - eye).normalize();
        let x = DVec3::Y.cross(z).normalize();
        let rotation = DMat3::from_cols(x, z.cross(x), z).transpose();
        let (width, height, fx, fy) = (160, 120, 150.0, 155.0);
        Camera { width, height, fx, fy, cx: 81.0, cy: 59.0, rotation, translation: -(rotation * eye) }
    }

    /// Depth map of the plane through `point` with this normal.
    fn screen_depths(camera: &Camera, point: DVec3, normal: DVec3) -> Vec<f64> {
        let pixels = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y)));
        let depth = |(x, y)| {
            // z of the hit grows linearly along the ray of depth 1.
            let eye = camera.eye();
            let ray = camera.unproject(x as f64 + 0.5, y as f64 + 0.5, 1.0) - eye;
            (point - eye).dot(normal) / ray.dot(normal)
        };
        pixels.map(depth).map(|z| if z > 0.0 { z } else { 0.0 }).collect()
    }

    fn lift_one(plane: &[f64], views: &[Camera], depths: &[f64], train: &[u32]) -> Lift {
        let firsts: Vec<usize> =
            views.iter().scan(0, |at, v| Some(std::mem::replace(at, *at + v.pixels() as usize))).collect();
        let g = ScreenGaussians {
            screen_planes: plane,
            stride: 1,
            screen_frames: &[0],
            views,
            pixel_firsts: &firsts,
            depths,
        };
        let p = lift_points(&g);
        let c = lift_cluster(&p.points, &p.counts, &p.firsts, &p.heaviest, &p.start_taus, false);
        lift_pca(&g, &p, &c, train, 1.0, false)[0]
    }

    /// The lift's mean in pixels and its undilated 2D covariance, from its quaternion and scales alone.
    fn projected(camera: &Camera, lift: &Lift) -> ([f64; 2], [f64; 3]) {
        let mean = DVec3::from(lift.mean);
        let (x, y, _) = camera.project(mean);
        let p = camera.rotation * mean + camera.translation;
        let [w, i, j, k] = lift.quat;
        let r = camera.rotation * DMat3::from_quat(DQuat::from_xyzw(i, j, k, w));
        let value = lift.log_scale.map(|l| (2.0 * l).exp());
        ([x, y], projected_covariance(camera, [p.x / p.z, p.y / p.z], p.z, value, [r.x_axis, r.y_axis, r.z_axis]))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn a_gaussian_on_a_plane_comes_back_where_it_was(
            x in 50.0..110.0f64, y in 45.0..75.0f64, a in 1.2..2.1f64, b in 1.2..2.1f64, angle in -3.0..3.0f64,
            tilt in (-0.6..0.6f64, -0.6..0.6f64), logit in -2.0..2.0f64,
        ) {
            let cam = camera(DVec3::new(3.0, 1.0, -4.0), DVec3::new(0.2, 0.1, 0.3));
            let normal = cam.rotation.transpose() * DVec3::new(tilt.0, tilt.1, -1.0).normalize();
            let depths = screen_depths(&cam, DVec3::ZERO, normal);
            let plane = [x, y, 0.2, 0.5, 0.9, logit, a, b, angle, 0.0];
            let lift = lift_one(&plane, &[cam], &depths, &[0]);
            prop_assert!(lift.cluster_size > 20);
            let (centre, q) = projected(&cam, &lift);
            prop_assert!((centre[0] - x).abs() < 1e-6 && (centre[1] - y).abs() < 1e-6);
            // Sources of the difference between Q and S, together below 10 %: the weights are those of S +
            // 0.3 I, so its shape is too, 0.3/s² ≤ 0.3/e^2.4 = 2.7 %. Over a radius of 3.3·s ≤ 27 px of f =
            // 150 px a slope of 0.85 bends depth by ±15 %; its even part, squared, is 2.4 %, about doubled by
            // the fourth moments. The truncated sum over pixels is under 1 %.
            let s = super::super::lift_count::screen_covariance([a, b], angle);
            let norm = |m: [f64; 3]| (m[0] * m[0] + 2.0 * m[1] * m[1] + m[2] * m[2]).sqrt();
            let error = norm([0, 1, 2].map(|i| q[i] - s[i])) / norm(s);
            prop_assert!(error < 0.1, "{error}");
            // Points on a plane: the third axis is its normal, and points at the camera.
            let [w, i, j, k] = lift.quat;
            let third = DQuat::from_xyzw(i, j, k, w) * DVec3::Z;
            let facing = normal * (cam.eye() - DVec3::from(lift.mean)).dot(normal).signum();
            prop_assert!(third.dot(facing) > 1.0 - 1e-6, "{third} {facing}");
        }
    }

    #[test]
    fn a_straight_plane_gives_the_dilated_shape_closely() {
        // No tilt, no bend: the only errors are 0.3 I, here 0.3/64 at most, and the sum over pixels.
        let cam = camera(DVec3::new(0.0, 0.0, -5.0), DVec3::ZERO);
        let depths = screen_depths(&cam, DVec3::ZERO, DVec3::Z);
        let plane = [80.3, 60.1, 0.5, 0.5, 0.5, 1.0, 8f64.ln(), 11f64.ln(), 0.4, 5.0];
        let lift = lift_one(&plane, &[cam], &depths, &[0]);
        let (_, q) = projected(&cam, &lift);
        let s = super::super::lift_count::screen_covariance([8f64.ln(), 11f64.ln()], 0.4);
        assert!(largest_difference(&q, &s) < 0.005 * s[2]);
        assert_eq!(lift.dc, [0.0; 3]);
        // No other camera sees it.
        assert_eq!((lift.theta_bar, lift.lobe_width), (FRAC_PI_2, 1.0));
        // λ3 = 1e-7·unit²; w² weights halve C, so k² is a little over 2: √(2.5e-7) < 1e-3.
        assert!(lift.log_scale[2].exp() < 1e-3);
    }

    #[test]
    fn the_lobe_is_as_wide_as_the_nearest_camera_that_sees_it() {
        let source = camera(DVec3::new(0.0, 0.0, -5.0), DVec3::ZERO);
        let near = camera(DVec3::new(5.0 * 0.1f64.sin(), 0.0, -5.0 * 0.1f64.cos()), DVec3::ZERO);
        let nearer_but_turned_away = camera(DVec3::new(0.1, 0.0, -5.0), DVec3::new(0.1, 0.0, -10.0));
        let far = camera(DVec3::new(5.0, 0.0, 0.0), DVec3::ZERO);
        let depths = screen_depths(&source, DVec3::ZERO, DVec3::Z);
        let views = [source, far, nearer_but_turned_away, near];
        // The source's principal point, so that the position is the origin.
        let plane = [81.0, 59.0, 0.5, 0.5, 0.5, 1.0, 1.5, 1.2, 0.0, 5.0];
        let lift = lift_one(&plane, &views, &depths, &[0, 1, 2, 3, 99]);
        assert!(largest_difference(&lift.mean, &[0.0; 3]) < 1e-12);
        assert!((lift.theta_bar - 0.1).abs() < 1e-9);
        assert!((lift.lobe_width - 0.7 / PI).abs() < 1e-9);
        assert!(largest_difference(&lift.lobe_dir, &[0.0, 0.0, -1.0]) < 1e-12);
        assert_eq!(lift_one(&plane, &views, &depths, &[0, 1]).lobe_width, 1.0);
        // A camera in the same place.
        assert_eq!(lift_one(&plane, &[source, source], &depths, &[1]).lobe_width, 0.01);
    }
}
