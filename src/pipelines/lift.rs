//! Inverse splatting (method, section 4): from 2D Gaussians and depth maps to supplementary Gaussians, all on the device.
//!
//! count → scan → points → cluster → pca → scan → append. The host reads two numbers of a batch: its points, which size the
//! buffers, and its lifts.

use std::ops::Range;

use super::{
    model::Model,
    plane::PlaneStage,
    raster::WORKGROUP,
    sort::{Extent, Scan, ScanBuffers},
    views::{Views, view},
};
use crate::{
    error::Result,
    gpu::{Buffer, Context, GpuError, Location},
    scene::Camera,
    stages::{
        dispatch_args::{self, DispatchArgs},
        lift_append::{self, LiftAppend},
        lift_cluster::{self, LiftCluster},
        lift_count::{self, LiftCount},
        lift_pca::{self, LiftPca},
        lift_points::{self, LiftPoints},
        scan_reduce::{block_sums_len, items_per_group},
        types::Lift,
    },
};

/// ⚖ settings of the method, the defaults first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LiftOptions {
    /// Clustering has failed while the smallest group has fewer than 3 points (the appendix), not the largest.
    pub fail_on_smallest: bool,
    /// The covariance weighs points with w, not with w².
    pub plain_weights: bool,
}

/// What became of the 2D Gaussians of a batch, by slot.
#[derive(Debug, Clone, PartialEq)]
pub struct Lifted {
    /// `cluster_size` 0: no lift.
    pub lifts: Vec<Lift>,
    /// The τ at which clustering succeeded, scene units.
    pub taus: Vec<f32>,
    /// Gaussians that were appended to the model.
    pub appended: u32,
}

/// The pipelines of inverse splatting.
pub struct LiftStage {
    context: Context,
    count: LiftCount,
    scan: Scan,
    args: DispatchArgs,
    points: LiftPoints,
    cluster: LiftCluster,
    pca: LiftPca,
    append: LiftAppend,
}

/// Words of `counts`: 2D Gaussians, their points, their lifts.
const SLOTS: u32 = 0;
const POINTS: u32 = 1;
const LIFTS: u32 = 2;

impl LiftStage {
    pub fn new(context: &Context, options: LiftOptions) -> Result<Self, GpuError> {
        let workgroup_size = WORKGROUP;
        let plain_weights = u32::from(options.plain_weights);
        Ok(LiftStage {
            count: LiftCount::new(context, &lift_count::Spec { workgroup_size })?,
            scan: Scan::new(context, false)?,
            args: DispatchArgs::new(context)?,
            points: LiftPoints::new(context, &lift_points::Spec { workgroup_size })?,
            cluster: LiftCluster::new(context, workgroup_size, options.fail_on_smallest)?,
            pca: LiftPca::new(context, &lift_pca::Spec { workgroup_size, plain_weights })?,
            append: LiftAppend::new(context, &lift_append::Spec { workgroup_size })?,
            context: context.clone(),
        })
    }

    /// Lifts the 2D Gaussians of `batch`, which `plane` refined last, and appends them to `model`, which must have been
    /// uploaded with room to spare. All of `views` count as training views. `unit` is the scene's own length: eigenvalues are
    /// at least 1e-7 of its square.
    pub fn lift(
        &self,
        plane: &PlaneStage,
        batch: &Range<usize>,
        views: &Views,
        unit: f32,
        model: &mut Model,
    ) -> Result<Lifted> {
        let slots = plane.stride;
        let n = slots as usize;
        let context = &self.context;
        let words = |name: &str, len: usize| Buffer::<u32>::new(context, name, len, Location::Device);
        let (view_list, train_list) = lift_views(&views.cameras, batch);
        let lift_views = Buffer::from_slice(context, "lift views", &view_list)?;
        let train_views = Buffer::from_slice(context, "train views", &train_list)?;
        let counts = Buffer::from_slice(context, "lift counts", &[slots, 0, 0])?;
        let (point_counts, point_firsts) = (words("point counts", n)?, words("point firsts", n)?);
        let block_sums = words("lift block sums", block_sums_len(slots))?;
        let status = Buffer::zeroed(context, "lift status", 1)?;
        let args = words("lift args", 3)?;
        let view_count = batch.len() as u32;

        let mut recorder = context.recorder("lift points")?;
        self.count.record(
            &mut recorder,
            &lift_count::Buffers {
                plane: &plane.plane,
                plane_views: &plane.plane_frames,
                views: &lift_views,
                depths: &plane.depths,
                point_counts: &point_counts,
            },
            &lift_count::Push { count: slots, stride: plane.stride, view_count },
        );
        self.args.record(
            &mut recorder,
            &dispatch_args::Buffers { count: &counts, dispatch_args: &args, status: &status },
            &dispatch_args::Push {
                count_index: SLOTS,
                capacity: slots,
                items_per_group: items_per_group(context.info()),
                args_index: 0,
                status_index: 0,
            },
        );
        let extent = Extent { count: &counts, index: SLOTS, args: &args, slot: 0 };
        let scan = |values, offsets| ScanBuffers { values, index: None, block_sums: &block_sums, offsets };
        self.scan.record(&mut recorder, &scan(&point_counts, &point_firsts), extent, POINTS);
        recorder.submit()?.wait()?;
        let point_count = counts.download_range(POINTS as usize, 1)?[0];

        let per_point = |name: &str| words(name, point_count as usize);
        let points = Buffer::new(context, "points", point_count as usize, Location::Device)?;
        let (point_sets, labels, group_sizes) =
            (per_point("point sets")?, per_point("labels")?, per_point("group sizes")?);
        let (heaviest, prime_labels, cluster_sizes) =
            (words("heaviest", n)?, words("prime labels", n)?, words("cluster sizes", n)?);
        let taus = Buffer::new(context, "taus", n, Location::Device)?;
        let rounds = words("rounds", lift_cluster::ROUNDS_LEN)?;
        let lifts = Buffer::new(context, "lifts", n, Location::Device)?;
        let (lift_flags, lift_ranks) = (words("lift flags", n)?, words("lift ranks", n)?);
        let mut recorder = context.recorder("lift")?;
        self.points.record(
            &mut recorder,
            &lift_points::Buffers {
                plane: &plane.plane,
                plane_views: &plane.plane_frames,
                views: &lift_views,
                depths: &plane.depths,
                point_counts: &point_counts,
                point_firsts: &point_firsts,
                points: &points,
                heaviest: &heaviest,
                taus: &taus,
                point_sets: &point_sets,
                labels: &labels,
            },
            &lift_points::Push { count: slots, stride: plane.stride, view_count },
        );
        self.cluster.record(
            &mut recorder,
            &lift_cluster::Buffers {
                points: &points,
                point_sets: &point_sets,
                labels: &labels,
                group_sizes: &group_sizes,
                point_counts: &point_counts,
                point_firsts: &point_firsts,
                heaviest: &heaviest,
                taus: &taus,
                prime_labels: &prime_labels,
                cluster_sizes: &cluster_sizes,
                rounds: &rounds,
            },
            slots,
            point_count,
        );
        self.pca.record(
            &mut recorder,
            &lift_pca::Buffers {
                plane: &plane.plane,
                plane_views: &plane.plane_frames,
                views: &lift_views,
                train_views: &train_views,
                points: &points,
                point_counts: &point_counts,
                point_firsts: &point_firsts,
                heaviest: &heaviest,
                labels: &labels,
                prime_labels: &prime_labels,
                cluster_sizes: &cluster_sizes,
                lifts: &lifts,
                lift_flags: &lift_flags,
            },
            &lift_pca::Push {
                count: slots,
                stride: plane.stride,
                view_count: view_list.len() as u32,
                train_count: train_list.len() as u32,
                unit,
            },
        );
        self.scan.record(&mut recorder, &scan(&lift_flags, &lift_ranks), extent, LIFTS);
        self.append.record(
            &mut recorder,
            &lift_append::Buffers {
                lifts: &lifts,
                lift_ranks: &lift_ranks,
                geometry: &model.geometry,
                sh: &model.sh,
                lobes: &model.lobes,
            },
            &lift_append::Push {
                count: slots,
                gaussian_first: model.count(),
                lobe_first: model.supplement_count,
                stride: model.stride,
                lobe_stride: model.lobe_stride,
                sh_coefficients: model.coefficients(),
            },
        );
        recorder.submit()?.wait()?;
        // What lay beyond the model's room was not written.
        let room = model.lobe_stride - model.supplement_count;
        let appended = counts.download_range(LIFTS as usize, 1)?[0].min(room);
        model.supplement_count += appended;
        Ok(Lifted { lifts: lifts.download()?, taus: taus.download()?, appended })
    }
}

/// The batch's views as the plane stage numbers them, then the others; and each training view's index among these.
fn lift_views(cameras: &[Camera], batch: &Range<usize>) -> (Vec<crate::stages::types::View>, Vec<u32>) {
    let mut list = Vec::with_capacity(cameras.len());
    let mut pixel_first = 0;
    for camera in &cameras[batch.clone()] {
        list.push(view(camera, pixel_first));
        pixel_first += camera.pixels();
    }
    let mut train = vec![0; cameras.len()];
    for (v, camera) in cameras.iter().enumerate() {
        if batch.contains(&v) {
            train[v] = (v - batch.start) as u32;
        } else {
            train[v] = list.len() as u32;
            // Its pixels are not in this batch's depth map; only its frustum is asked for.
            list.push(view(camera, 0));
        }
    }
    (list, train)
}
