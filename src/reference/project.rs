//! Twin of `project.comp`: projects every Gaussian into a view (3DGS; EWA splatting, Zwicker 2002).
//!
//! params, view → splats, depths, tile counts. One iteration is one thread of the kernel.

use glam::{DMat3, DVec3};

use super::tiles::{Tiling, for_each_tile};
use super::{ALPHA_MIN, DILATION, FLOAT_MAX, FLOAT_MIN, Options, Params, Splat, View, harmonics, lobe, sigmoid};

/// A view's Gaussians, all vectors by Gaussian index.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Projected {
    /// Zero if the Gaussian is not visible.
    pub splats: Vec<Splat>,
    /// Camera z, ∞ if the Gaussian is not visible; the kernel encodes it in `depth_keys`.
    pub depths: Vec<f64>,
    /// 0 if the Gaussian is not visible.
    pub tile_counts: Vec<u32>,
    /// The side of its kinks that each visible Gaussian is on: bit 0, 1: the Jacobian's x/z, y/z is clamped;
    /// bit 2, 3, 4: red, green, blue is clamped to 0. Not on the GPU; if a bit changes, gradients are
    /// one-sided.
    pub kinks: Vec<u8>,
}

/// Splats, depth keys and tile counts of all Gaussians in one view.
pub fn project(params: &Params, view: &View, options: &Options) -> Projected {
    let tiling = Tiling::new(view.width, view.height, options);
    let mut out = Projected {
        splats: vec![Splat::default(); params.count],
        depths: vec![f64::INFINITY; params.count],
        tile_counts: vec![0; params.count],
        kinks: vec![0; params.count],
    };
    for i in 0..params.count {
        let Some((splat, kinks)) = project_one(params, view, options, i) else { continue };
        let mut tile_count = 0;
        for_each_tile(&splat, &tiling, |_| tile_count += 1);
        if tile_count == 0 {
            continue;
        }
        out.splats[i] = splat;
        out.depths[i] = splat.z;
        out.tile_counts[i] = tile_count;
        out.kinks[i] = kinks;
    }
    out
}

fn project_one(params: &Params, view: &View, options: &Options, i: usize) -> Option<(Splat, u8)> {
    let f = footprint(params, view, i)?;
    let opacity = sigmoid(params.logit(i)) * lobe_factor(params, view, i) * compensation(&f, options);
    if !(opacity >= ALPHA_MIN) {
        return None;
    }
    let direction = (params.mean(i) - view.eye).normalize();
    let shade = harmonics::color_of(params, i, options.active_degree, direction);
    if !shade.iter().all(|c| c.abs() <= FLOAT_MAX) {
        return None;
    }
    let [r, g, b] = shade.map(|c| if c > 0.0 { c } else { 0.0 });
    let kinks =
        f.clamped.0 as u8 | (f.clamped.1 as u8) << 1 | (0..3).map(|c| ((shade[c] <= 0.0) as u8) << (2 + c)).sum::<u8>();
    let splat = Splat {
        x: view.fx * f.p.x / f.p.z + view.cx,
        y: view.fy * f.p.y / f.p.z + view.cy,
        l11: (f.c / f.d).sqrt(),
        l12: -f.b / (f.c * f.d).sqrt(),
        l22: 1.0 / f.c.sqrt(),
        opacity,
        r,
        g,
        b,
        z: f.p.z,
    };
    Some((splat, kinks))
}

/// The geometry of a projected Gaussian, recomputed by the backward pass.
pub(super) struct Footprint {
    /// Mean in camera space.
    pub p: DVec3,
    /// x/z and y/z as the Jacobian takes them, and whether they were clamped.
    pub tx: f64,
    pub ty: f64,
    pub clamped: (bool, bool),
    /// Rows of JW, px per scene unit.
    pub jw1: DVec3,
    pub jw2: DVec3,
    /// R of the quaternion, and the scales.
    pub rotation: DMat3,
    pub scale: DVec3,
    /// Rows of M = JWRS, px.
    pub m1: DVec3,
    pub m2: DVec3,
    /// m1 × m2 = cof(S) Rᵀ(jw1 × jw2): in the Gaussian's own axes no component cancels, not even of a needle.
    pub n: DVec3,
    /// Σ2D = [[a, b], [b, c]] (a is only needed through d), its determinant, and the undilated one.
    pub b: f64,
    pub c: f64,
    pub d: f64,
    pub d0: f64,
}

/// None if the Gaussian is not in front of the near plane, has no rotation or no finite footprint.
pub(super) fn footprint(params: &Params, view: &View, i: usize) -> Option<Footprint> {
    let p = view.to_camera(params.mean(i));
    if !(p.z > view.near && p.z <= FLOAT_MAX) {
        return None;
    }
    let rotation = rotation(params.quat(i))?;
    let log_scale = params.log_scale(i);
    let scale = DVec3::new(log_scale.x.exp(), log_scale.y.exp(), log_scale.z.exp());

    let tx = (p.x / p.z).max(view.slope_x[0]).min(view.slope_x[1]);
    let ty = (p.y / p.z).max(view.slope_y[0]).min(view.slope_y[1]);
    let jw1 = view.fx / p.z * (view.row_x - tx * view.row_z).truncate();
    let jw2 = view.fy / p.z * (view.row_y - ty * view.row_z).truncate();
    let m1 = scale * (rotation.transpose() * jw1);
    let m2 = scale * (rotation.transpose() * jw2);

    let n = m1.cross(m2);
    let b = m1.dot(m2);
    let c = m2.dot(m2) + DILATION;
    let d0 = n.length_squared();
    let d = d0 + DILATION * (m1.dot(m1) + m2.dot(m2)) + DILATION * DILATION;
    if !(d <= FLOAT_MAX) {
        return None;
    }
    let clamped = (p.x / p.z != tx, p.y / p.z != ty);
    Some(Footprint { p, tx, ty, clamped, jw1, jw2, rotation, scale, m1, m2, n, b, c, d, d0 })
}

/// The rotation of a quaternion (w, x, y, z) of any length; none if it is 0, denormal, infinite or NaN in
/// float32.
pub(super) fn rotation(quat: [f64; 4]) -> Option<DMat3> {
    let largest = quat.iter().fold(0.0, |a: f64, q| a.max(q.abs()));
    let length = quat.iter().map(|q| q * q).sum::<f64>().sqrt();
    if !(length > 0.0 && (FLOAT_MIN..=FLOAT_MAX).contains(&largest)) {
        return None;
    }
    let [w, x, y, z] = quat.map(|q| q / length);
    Some(DMat3::from_cols(
        DVec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        DVec3::new(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        DVec3::new(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    ))
}

/// √(det Σ / det(Σ + 0.3 I)) if compensation is on (Mip-Splatting, Yu 2024), else 1.
pub(super) fn compensation(f: &Footprint, options: &Options) -> f64 {
    if options.compensate { (f.d0 / f.d).sqrt() } else { 1.0 }
}

pub(super) fn lobe_factor(params: &Params, view: &View, i: usize) -> f64 {
    match params.lobe(i) {
        Some((direction, width, sharpness)) => lobe::factor(direction, width, sharpness, view.eye - params.mean(i)),
        None => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat2;

    use super::*;
    use crate::reference::{random_camera, random_scene};

    /// LᵀL against the inverse of Σ2D built the textbook way, J W R S S Rᵀ Wᵀ Jᵀ + 0.3 I. The product L Σ2D Lᵀ
    /// must be I; for the worst needle (axes 1 : 1000) Σ2D is known to 1e-16 · 1e6, hence 1e-8.
    #[test]
    fn the_factor_is_that_of_the_inverse_covariance() {
        let params = Params::from_scene(&random_scene(11, 1500, 500, 3)).unwrap();
        let view = View::from_camera(&random_camera(96, 80));
        let projected = project(&params, &view, &Options::default());
        let mut seen = 0;
        for i in 0..params.count {
            if projected.tile_counts[i] == 0 {
                continue;
            }
            seen += 1;
            let p = view.to_camera(params.mean(i));
            let (tx, ty) = (
                (p.x / p.z).clamp(view.slope_x[0], view.slope_x[1]) * p.z,
                (p.y / p.z).clamp(view.slope_y[0], view.slope_y[1]) * p.z,
            );
            let j1 = DVec3::new(view.fx / p.z, 0.0, -view.fx * tx / (p.z * p.z));
            let j2 = DVec3::new(0.0, view.fy / p.z, -view.fy * ty / (p.z * p.z));
            let r = rotation(params.quat(i)).unwrap();
            let s = params.log_scale(i);
            let s2 = DMat3::from_diagonal(DVec3::new((2.0 * s.x).exp(), (2.0 * s.y).exp(), (2.0 * s.z).exp()));
            let sigma = view.rotation() * r * s2 * r.transpose() * view.rotation().transpose();
            let cov = DMat2::from_cols_array(&[
                j1.dot(sigma * j1) + 0.3,
                j1.dot(sigma * j2),
                j1.dot(sigma * j2),
                j2.dot(sigma * j2) + 0.3,
            ]);
            let splat = &projected.splats[i];
            let l = DMat2::from_cols_array(&[splat.l11, 0.0, splat.l12, splat.l22]);
            let identity = l * cov * l.transpose();
            assert!(identity.abs_diff_eq(DMat2::IDENTITY, 1e-8), "Gaussian {i}: {identity}");
        }
        assert!(seen > 500, "{seen}");
    }
}
