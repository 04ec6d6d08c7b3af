//! Twin of `project_backward.comp`: sums a Gaussian's gradient records and differentiates `project` to get
//! gradients of its parameters.

use glam::{DMat3, DVec3, DVec4, Vec3Swizzles};

use super::blend_backward::Record;
use super::project::{Footprint, compensation, footprint};
use super::{DILATION, Intersections, Options, Params, Splat, View, harmonics, lobe, sigmoid};
use crate::scene::layout::{LOG_SCALE, MEAN, OPACITY, QUAT};

/// Gradients of a loss in one view.
#[derive(Debug, Clone, PartialEq)]
pub struct Gradients {
    /// ∂loss/∂parameter, in the parameters' layout.
    pub params: Params,
    /// Records summed over slots, by Gaussian index.
    pub records: Vec<Record>,
    /// True if a Gaussian's record has a part that is not zero: it was blended into this view.
    pub touched: Vec<bool>,
}

/// Gradients from the blend's records. `tile_counts` and `isects` are the forward pass's, `isect_grads` the
/// blend's, by slot.
pub fn project_backward(
    params: &Params,
    view: &View,
    options: &Options,
    splats: &[Splat],
    tile_counts: &[u32],
    isects: &Intersections,
    isect_grads: &[Record],
) -> Gradients {
    let rises = |_, _, gradient| gradient < 0.0;
    passing(params, view, options, splats, sum_records(tile_counts, isects, isect_grads), &rises)
}

/// [`project_backward`] for the summed records of a `loss_probe`. A probe has no sign, so a clamped channel
/// passes it only while `known`, the curvature of the Gaussian's constant color, is 0.
pub fn probe_backward(
    params: &Params,
    view: &View,
    options: &Options,
    splats: &[Splat],
    records: Vec<Record>,
    known: &[[f64; 3]],
) -> Gradients {
    passing(params, view, options, splats, records, &|i, c, _| known[i][c] == 0.0)
}

/// Whether a channel clamped at 0 passes its gradient, by Gaussian, channel and gradient.
type Passes<'a> = &'a dyn Fn(usize, usize, f64) -> bool;

fn passing(
    params: &Params,
    view: &View,
    options: &Options,
    splats: &[Splat],
    records: Vec<Record>,
    passes: Passes<'_>,
) -> Gradients {
    Gradients {
        params: backward(params, view, options, splats, &records, passes),
        touched: records.iter().map(is_touched).collect(),
        records,
    }
}

/// Adds the gradient of `mean_opacity` times the mean of `of_all` Gaussians' opacities and `mean_scale` times
/// that of their scales (Kheradmand 2024), for the first `count`.
pub fn regularise(
    params: &Params,
    count: usize,
    of_all: usize,
    mean_opacity: f64,
    mean_scale: f64,
    grads: &mut Params,
) {
    let of_all = of_all as f64;
    for i in 0..count {
        let logit = params.logit(i);
        grads.geometry[OPACITY * params.stride + i] += mean_opacity / of_all * sigmoid(logit) * sigmoid(-logit);
        for p in LOG_SCALE..LOG_SCALE + 3 {
            let at = p * params.stride + i;
            grads.geometry[at] += mean_scale / (3.0 * of_all) * params.geometry[at].exp();
        }
    }
}

/// Records summed over slots, by Gaussian index.
pub fn sum_records(tile_counts: &[u32], isects: &Intersections, isect_grads: &[Record]) -> Vec<Record> {
    let sum = |(&first, &tiles): (&u32, &u32)| {
        let mut record = [0.0; 9];
        for slot_record in &isect_grads[first as usize..(first + tiles) as usize] {
            record.iter_mut().zip(slot_record).for_each(|(sum, part)| *sum += part);
        }
        record
    };
    isects.first_slot.iter().zip(tile_counts).map(sum).collect()
}

fn is_touched(record: &Record) -> bool {
    record.iter().any(|&part| part != 0.0)
}

fn backward(
    params: &Params,
    view: &View,
    options: &Options,
    splats: &[Splat],
    records: &[Record],
    passes: Passes<'_>,
) -> Params {
    let mut out = params.zeros_like();
    for (i, record) in records.iter().enumerate().filter(|(_, record)| is_touched(record)) {
        let Some(f) = footprint(params, view, i) else { continue };
        let mean = geometry_backward(params, view, options, &splats[i], &f, record, i, &mut out)
            + color_backward(params, view, options, color_gradient(&splats[i], record, i, passes), i, &mut out)
            + opacity_backward(params, view, options, &splats[i], &f, record, i, &mut out);
        for axis in 0..3 {
            out.geometry[(MEAN + axis) * params.stride + i] = mean[axis];
        }
    }
    out
}

/// ∂loss/∂centre = Lᵀ (Σ g w), per px: −½|w|² with w = L(pixel − centre) has the gradient +Lᵀw in the centre.
pub fn centre_gradient(splat: &Splat, record: &Record) -> [f64; 2] {
    [splat.l11 * record[0], splat.l12 * record[0] + splat.l22 * record[1]]
}

/// Adds the gradients of log scales and quaternion; returns the mean's part through centre, Σ2D and
/// compensation.
#[allow(clippy::too_many_arguments)]
fn geometry_backward(
    params: &Params,
    view: &View,
    options: &Options,
    splat: &Splat,
    f: &Footprint,
    record: &Record,
    i: usize,
    out: &mut Params,
) -> DVec3 {
    // ∂(−½ δᵀQδ)/∂Σ2D = ½ Qδ (Qδ)ᵀ since ∂Q = −Q ∂Σ Q, and Qδ = Lᵀw: so ∂loss/∂Σ2D = ½ Lᵀ(Σ g wwᵀ)L =: H.
    // Σ2D = MMᵀ + 0.3 I gives ∂loss/∂M = 2HM = Lᵀ (Σ g wwᵀ) N with N = LM, of order 1. Everything below is
    // written in N and LJW (rows j1, j2), because a needle's rows of M are long and nearly parallel. n1 = l11
    // m1 + l12 m2 = (c m1 − b m2)/√(cD).
    let n1 = (f.m2.cross(f.n) + DILATION * f.m1) / (f.c * f.d).sqrt();
    let n2 = f.m2 / f.c.sqrt();
    let k1 = record[3] * n1 + record[4] * n2;
    let k2 = record[4] * n1 + record[5] * n2;
    let j1 = splat.l11 * f.jw1 + splat.l12 * f.jw2;
    let j2 = splat.l22 * f.jw2;
    // Component k of both rows of M is proportional to the k-th scale.
    let mut log_scale_grad = k1 * n1 + k2 * n2;
    let mut rotation_grad = outer(j1, f.scale * k1) + outer(j2, f.scale * k2);
    // jw1 = fx/z (row_x − tx row_z), jw2 = fy/z (row_y − ty row_z).
    let row_z = view.row_z.truncate();
    let along = f.scale * (f.rotation.transpose() * row_z);
    let (a1, a2) = (along.dot(k1), along.dot(k2));
    let (mut tx_grad, mut ty_grad) = (splat.l11 * a1, splat.l12 * a1 + splat.l22 * a2);

    if options.compensate && f.d0 > 0.0 {
        // ln k = ½ ln(D0/D) with D0 = |n|², n = cof(S) Rᵀ(jw1 × jw2), and D = D0 + 0.3 (m1·m1 + m2·m2) + 0.09;
        // 1/D0 − 1/D = (D − D0)/(D0 D). The opacity is proportional to k.
        let gain = record[2] * splat.opacity / f.d;
        let (sharp, blunt) = (gain * (f.d - f.d0), gain * DILATION);
        let (share, turn) = (f.n * f.n / f.d0, f.scale.yzx() * f.scale.zxy() * f.n / f.d0);
        log_scale_grad += sharp * (DVec3::splat(share.element_sum()) - share) - blunt * (f.m1 * f.m1 + f.m2 * f.m2);
        let (s1, s2) = (blunt * f.scale * f.m1, blunt * f.scale * f.m2);
        rotation_grad += outer(f.jw1.cross(f.jw2), sharp * turn) - outer(f.jw1, s1) - outer(f.jw2, s2);
        let world = sharp * (f.rotation * turn);
        tx_grad += (f.jw2.cross(world) - f.rotation * s1).dot(row_z);
        ty_grad += (world.cross(f.jw1) - f.rotation * s2).dot(row_z);
    }
    for axis in 0..3 {
        out.geometry[(LOG_SCALE + axis) * params.stride + i] = log_scale_grad[axis];
    }
    let quat_grad = quat_backward(params.quat(i), rotation_grad);
    for (k, grad) in quat_grad.into_iter().enumerate() {
        out.geometry[(QUAT + k) * params.stride + i] = grad;
    }

    // JW is proportional to 1/z: a Gaussian nearer by a factor appears larger by it, so the z part is minus
    // the sum over all log scales.
    let z = f.p.z;
    let mut p_grad = DVec3::new(0.0, 0.0, -log_scale_grad.element_sum() / z);
    if !f.clamped.0 {
        p_grad += -view.fx / (z * z) * tx_grad * DVec3::new(1.0, 0.0, -f.tx);
    }
    if !f.clamped.1 {
        p_grad += -view.fy / (z * z) * ty_grad * DVec3::new(0.0, 1.0, -f.ty);
    }

    // The centre is never clamped.
    let [u_grad, v_grad] = centre_gradient(splat, record);
    p_grad += DVec3::new(
        view.fx / z * u_grad,
        view.fy / z * v_grad,
        -(view.fx * f.p.x * u_grad + view.fy * f.p.y * v_grad) / (z * z),
    );
    view.rotation().transpose() * p_grad
}

/// The gradient by the color before it is clamped. A channel that max(0, ·) clamped is exactly 0; it gets a
/// gradient if `passes`, which is not the derivative.
fn color_gradient(splat: &Splat, record: &Record, i: usize, passes: Passes<'_>) -> [f64; 3] {
    let color = splat.color();
    [0, 1, 2].map(|c| if color[c] > 0.0 || passes(i, c, record[6 + c]) { record[6 + c] } else { 0.0 })
}

/// Adds the gradients of SH coefficients; returns the mean's part through the viewing direction.
fn color_backward(
    params: &Params,
    view: &View,
    options: &Options,
    color_grad: [f64; 3],
    i: usize,
    out: &mut Params,
) -> DVec3 {
    let offset = params.mean(i) - view.eye;
    let distance = offset.length();
    let direction = offset / distance;
    let direction_grad = harmonics::color_backward(params, i, options.active_degree, direction, color_grad, out);
    (direction_grad - direction * direction.dot(direction_grad)) / distance
}

/// Adds the gradients of logit and lobe; returns the mean's part through the lobe.
#[allow(clippy::too_many_arguments)]
fn opacity_backward(
    params: &Params,
    view: &View,
    options: &Options,
    splat: &Splat,
    f: &Footprint,
    record: &Record,
    i: usize,
    out: &mut Params,
) -> DVec3 {
    let logit = params.logit(i);
    // σ' = σ(1 − σ), and 1 − σ(x) = σ(−x) without cancellation.
    out.geometry[OPACITY * params.stride + i] = record[2] * splat.opacity * sigmoid(-logit);
    let Some((direction, width, sharpness)) = params.lobe(i) else { return DVec3::ZERO };
    let factor_grad = record[2] * sigmoid(logit) * compensation(f, options);
    let lobe = lobe::factor_gradient(direction, width, sharpness, view.eye - params.mean(i));
    let j = i - params.lobe_first;
    let planes = [lobe.direction.x, lobe.direction.y, lobe.direction.z, lobe.width, lobe.sharpness];
    for (p, grad) in planes.into_iter().enumerate() {
        out.lobes[p * params.lobe_stride + j] = factor_grad * grad;
    }
    factor_grad * lobe.mean
}

/// The outer product a bᵀ.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// ∂/∂(w, x, y, z) of the stored quaternion, from ∂/∂R: through R(q̂), then through q̂ = q/|q|, which removes
/// the part along q̂ and divides by |q|.
fn quat_backward(quat: [f64; 4], grad: DMat3) -> [f64; 4] {
    let q = DVec4::from_array(quat);
    let length = q.length();
    let [w, x, y, z] = (q / length).to_array();
    let g = |row: usize, column: usize| grad.col(column)[row];
    let unit_grad = DVec4::new(
        2.0 * (x * (g(2, 1) - g(1, 2)) + y * (g(0, 2) - g(2, 0)) + z * (g(1, 0) - g(0, 1))),
        2.0 * (y * (g(0, 1) + g(1, 0)) + z * (g(0, 2) + g(2, 0)) + w * (g(2, 1) - g(1, 2)))
            - 4.0 * x * (g(1, 1) + g(2, 2)),
        2.0 * (x * (g(0, 1) + g(1, 0)) + z * (g(1, 2) + g(2, 1)) + w * (g(0, 2) - g(2, 0)))
            - 4.0 * y * (g(0, 0) + g(2, 2)),
        2.0 * (x * (g(0, 2) + g(2, 0)) + y * (g(1, 2) + g(2, 1)) + w * (g(1, 0) - g(0, 1)))
            - 4.0 * z * (g(0, 0) + g(1, 1)),
    );
    let unit = q / length;
    ((unit_grad - unit * unit.dot(unit_grad)) / length).to_array()
}
