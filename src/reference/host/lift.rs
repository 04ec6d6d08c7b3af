//! Host adapters of inverse splatting's twins.

use super::{Outcome, camera, wide, wide_rows};
use crate::{
    reference::{
        self as twin, lift_count::ScreenGaussians, lift_groups::LiftClusters, lift_pca::Lift, lift_points::LiftPoints,
    },
    scene::{Camera, Gaussians, Supplement, layout},
    stages::{
        kernels,
        types::{self, View},
    },
};

twins!(lift_append, lift_count, lift_groups, lift_join, lift_pca, lift_points);

/// 2D Gaussians in float64.
struct Flat {
    planes: Vec<f64>,
    stride: usize,
    frames: Vec<u32>,
    views: Vec<Camera>,
    pixel_firsts: Vec<usize>,
    depths: Vec<f64>,
}

impl Flat {
    /// Converts the first `count` slots, and `view_count` views.
    fn new(
        (planes, stride): (&[f32], u32),
        (frames, count): (&[u32], usize),
        (views, view_count): (&[View], u32),
        depths: &[f32],
    ) -> Self {
        let views = &views[..view_count as usize];
        Flat {
            planes: wide(planes),
            stride: stride as usize,
            frames: frames[..count].to_vec(),
            views: views.iter().map(camera).collect(),
            pixel_firsts: views.iter().map(|v| v.pixel_first as usize).collect(),
            depths: wide(depths),
        }
    }

    fn gaussians(&self) -> ScreenGaussians<'_> {
        ScreenGaussians {
            screen_planes: &self.planes,
            stride: self.stride,
            screen_frames: &self.frames,
            views: &self.views,
            pixel_firsts: &self.pixel_firsts,
            depths: &self.depths,
        }
    }
}

pub(super) fn lift_count(h: kernels::lift_count::Host<'_>) -> Outcome {
    let kernels::lift_count::Push { count, stride, view_count } = h.push;
    let count = h.workgroups.subgroups().min(count as usize);
    let flat = Flat::new((h.screen_planes, stride), (h.screen_frames, count), (h.views, view_count), h.depths);
    h.point_counts[..count].copy_from_slice(&twin::lift_count::lift_count(&flat.gaussians()));
    Ok(())
}

pub(super) fn lift_points(h: kernels::lift_points::Host<'_>) -> Outcome {
    let kernels::lift_points::Push { count, stride, view_count } = h.push;
    let count = h.workgroups.subgroups().min(count as usize);
    let flat = Flat::new((h.screen_planes, stride), (h.screen_frames, count), (h.views, view_count), h.depths);
    let lifted = twin::lift_points::lift_points(&flat.gaussians());
    for item in 0..count {
        let (first, n) = (h.point_firsts[item] as usize, h.point_counts[item] as usize);
        let there = n > 0 && h.screen_frames[item] < view_count;
        h.heaviest[item] = if there { lifted.heaviest[item] } else { 0 };
        h.taus[item] = if there { lifted.start_taus[item] as f32 } else { 0.0 };
        if !there {
            continue;
        }
        let set = lifted.set(item);
        for at in 0..n {
            // If a pixel at the threshold was counted but is not found here, the last point is repeated
            // without weight: clustering needs a point at each index.
            let last = set.last().map_or([0.0; 4], |&[x, y, z, _]| [x, y, z, 0.0]);
            h.points[first + at] = set.get(at).copied().unwrap_or(last).map(|v| v as f32);
            h.point_sets[first + at] = item as u32;
            h.labels[first + at] = at as u32;
        }
    }
    Ok(())
}

pub(super) fn lift_join(h: kernels::lift_join::Host<'_>) -> Outcome {
    let points = h.workgroups.threads().min(h.push.point_count as usize);
    // Sets without points here belong to other dispatches.
    let mut counts = vec![0; h.point_counts.len()];
    h.point_sets[..points].iter().for_each(|&set| counts[set as usize] = h.point_counts[set as usize]);
    let taus = wide(h.taus);
    twin::lift_join::lift_join(&wide_rows(h.points), &counts, h.point_firsts, &taus, h.cluster_sizes, h.labels);
    Ok(())
}

pub(super) fn lift_groups(h: kernels::lift_groups::Host<'_>) -> Outcome {
    let kernels::lift_groups::Push { count, point_count, round, last_round } = h.push;
    let count = h.workgroups.subgroups().min(count as usize);
    let mut clusters = LiftClusters {
        labels: h.labels.to_vec(),
        taus: wide(&h.taus[..count]),
        prime_labels: h.prime_labels[..count].to_vec(),
        cluster_sizes: h.cluster_sizes[..count].to_vec(),
    };
    let failed = twin::lift_groups::lift_groups(
        &h.point_counts[..count],
        h.point_firsts,
        h.heaviest,
        &mut clusters,
        h.spec.fail_on_smallest != 0,
        round >= last_round,
    );
    h.labels.copy_from_slice(&clusters.labels);
    h.taus.iter_mut().zip(clusters.taus).for_each(|(to, tau)| *to = tau as f32);
    h.prime_labels[..count].copy_from_slice(&clusters.prime_labels);
    h.cluster_sizes[..count].copy_from_slice(&clusters.cluster_sizes);
    if failed {
        // The dispatches of another round: lift_join's, and this one again.
        let joins = twin::dispatch_args::dispatch_args(point_count, u32::MAX, h.workgroups.size).2;
        let [x, y, _] = h.workgroups.count;
        let asked = joins.into_iter().chain([x, y, 1]);
        let words = &mut h.rounds[6 * (round as usize + 1)..][..6];
        words.iter_mut().zip(asked).for_each(|(word, n)| *word = n.max(*word));
    }
    Ok(())
}

pub(super) fn lift_pca(h: kernels::lift_pca::Host<'_>) -> Outcome {
    let kernels::lift_pca::Push { count, stride, view_count, train_count, unit } = h.push;
    let count = h.workgroups.subgroups().min(count as usize);
    let flat = Flat::new((h.screen_planes, stride), (h.screen_frames, count), (h.views, view_count), &[]);
    let points = LiftPoints {
        counts: h.point_counts[..count].to_vec(),
        firsts: h.point_firsts[..count].to_vec(),
        points: wide_rows(h.points),
        heaviest: h.heaviest[..count].to_vec(),
        start_taus: vec![],
    };
    let clusters = LiftClusters {
        labels: h.labels.to_vec(),
        taus: vec![],
        prime_labels: h.prime_labels[..count].to_vec(),
        cluster_sizes: h.cluster_sizes[..count].to_vec(),
    };
    let lifts = twin::lift_pca::lift_pca(
        &flat.gaussians(),
        &points,
        &clusters,
        &h.train_views[..train_count as usize],
        f64::from(unit),
        h.spec.plain_weights != 0,
    );
    for (item, lift) in lifts.iter().enumerate() {
        h.lifts[item] = narrow(lift);
        h.lift_flags[item] = u32::from(lift.cluster_size > 0);
    }
    Ok(())
}

pub(super) fn narrow(l: &Lift) -> types::Lift {
    types::Lift {
        mean: l.mean.map(|v| v as f32),
        log_scale: l.log_scale.map(|v| v as f32),
        quat: l.quat.map(|v| v as f32),
        dc: l.dc.map(|v| v as f32),
        opacity: l.opacity as f32,
        lobe_dir: l.lobe_dir.map(|v| v as f32),
        lobe_width: l.lobe_width as f32,
        theta_bar: l.theta_bar as f32,
        cluster_size: l.cluster_size,
    }
}

pub(super) fn lift_append(h: kernels::lift_append::Host<'_>) -> Outcome {
    let kernels::lift_append::Push { count, segment, page_first, stride, sh_coefficients } = h.push;
    let count = h.workgroups.threads().min(count as usize);
    let sh_degree = sh_coefficients.isqrt().saturating_sub(1);
    let there = h.population[segment as usize + 1] - h.population[segment as usize];
    let flagged = h.lift_flags[..count].iter().zip(h.lift_ranks).enumerate().filter(|(_, (flag, _))| **flag != 0);
    for (item, (_, &rank)) in flagged {
        let lift = &h.lifts[item];
        let Some(place) = (there + rank).checked_sub(page_first).filter(|&place| place < stride) else { continue };
        let gaussians = Gaussians { sh_degree, ..Default::default() };
        let mut one = Supplement { gaussians, ..Default::default() };
        twin::lift_append::lift_append(&[Lift::from(lift)], usize::MAX, &mut one);
        let quad = |p: usize| p / 4 * stride as usize + place as usize;
        layout::geometry(&one.gaussians, 0).into_iter().enumerate().for_each(|(p, v)| h.geometry[quad(p)][p % 4] = v);
        (0..layout::sh_planes(sh_degree)).for_each(|p| h.sh[quad(p)][p % 4] = layout::sh(&one.gaussians, 0, p));
        if h.spec.has_lobes {
            layout::lobe(&one.lobes, 0).into_iter().enumerate().for_each(|(p, v)| h.lobes[quad(p)][p % 4] = v);
        }
    }
    Ok(())
}
