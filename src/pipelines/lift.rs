//! Inverse splatting (method, section 4): turns 2D Gaussians and depth maps into supplementary 3D Gaussians
//! on the device.
//!
//! count → scan → points → (join → groups) … → pca → scan → append. The host reads one number per batch, the
//! points, to size buffers.

use std::ops::Range;

use super::{
    model::{Model, Segment},
    plan::{bind, buffers},
    screen::Refiner,
    sort::{Extent, Scan, ScanBuffers},
    views::{Views, view},
};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Context, GpuError, Recorder},
    scene::{Camera, layout::coefficients},
    stages::{
        WORKGROUP,
        blocks::{block_sums_len, items_per_group},
        constants::cluster::MAX_GROWTHS,
        dispatch_args, lift_append, lift_count, lift_groups, lift_join, lift_pca, lift_points,
        status::{self, Resource, Status},
        types::{Lift, View},
    },
};

/// ⚖ Options of the method, the defaults first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LiftOptions {
    /// Clustering fails while the smallest group, not the largest, has fewer than 3 points (as in the
    /// appendix).
    pub fail_on_smallest: bool,
    /// The covariance weighs points by w, not by w².
    pub plain_weights: bool,
}

/// Results of lifting a batch, by place.
#[derive(Debug, Clone, PartialEq)]
pub struct Lifted {
    /// `cluster_size` 0: no lift.
    pub lifts: Vec<Lift>,
    /// The τ at which clustering succeeded, scene units.
    pub taus: Vec<f32>,
}

/// Sizes of [`LiftBuffers`].
#[derive(Debug, Clone, Copy)]
pub struct LiftSizes {
    /// 2D Gaussians of a batch, empty places among them.
    pub places: u32,
    /// All views; those of the batch come first.
    pub views: u32,
    /// Training views, candidates for the nearest one.
    pub train_views: u32,
}

buffers! {
    /// Buffers by point set, one set per place of a 2D Gaussian.
    pub struct LiftBuffers(o: LiftSizes) {
        /// Cameras of the batch, then those of training; `pixel_first` is relative to [`Flat::depths`].
        pub views: View = o.views,
        /// Indices of the training views.
        pub train_views: u32 = o.train_views,
        /// Numbers of 2D Gaussians, of their points, and of their lifts.
        pub counts: u32 = 3,
        args: u32 = 3,
        block_sums: u32 = block_sums_len(o.places),
        /// Pixels that are covered and have a depth.
        pub point_counts: u32 = o.places,
        /// Start of a set's points in [`PointBuffers`].
        pub point_firsts: u32 = o.places,
        /// Index within the set of the point of greatest weight.
        pub heaviest: u32 = o.places,
        /// τ0 before clustering. Afterwards the τ at which clustering succeeded, or the last one tried.
        pub taus: f32 = o.places,
        /// Label of the prime group; undefined if there is none.
        pub prime_labels: u32 = o.places,
        /// Points of the prime group; 0: no lift (fewer than 3 points, τ0 not in (0, 1e18], or failure to the last).
        pub cluster_sizes: u32 = o.places,
        /// The lift; `cluster_size` 0 if there is none.
        pub lifts: Lift = o.places,
        /// 1 if there is a lift, else 0.
        pub lift_flags: u32 = o.places,
        lift_ranks: u32 = o.places,
        /// Dispatches of two stages for every round of clustering.
        pub rounds: u32 = 6 * (MAX_GROWTHS + 1),
    }
}

buffers! {
    /// Buffers by point; sets lie one after the other without overlap.
    pub struct PointBuffers(points: u32) {
        /// x, y, z in the camera's frame, and the weight.
        pub points: [f32; 4] = *points,
        /// Place of a point's 2D Gaussian.
        pub point_sets: u32 = *points,
        /// Before clustering a point's own index within its set, afterwards that of the first point of its
        /// component.
        pub labels: u32 = *points,
        group_sizes: u32 = *points,
    }
}

/// Words of `counts`.
const PLACES: u32 = 0;
const POINTS: u32 = 1;
const LIFTS: u32 = 2;

/// 2D Gaussians of views, by place.
#[derive(Clone, Copy)]
pub struct Flat<'a> {
    /// Planes of `glsl/shared/screen.glsl` × `stride`.
    pub screen_planes: &'a Buffer<f32>,
    /// Places per plane.
    pub stride: u32,
    /// View of each place, an index in [`LiftBuffers::views`].
    pub screen_frames: &'a Buffer<u32>,
    /// Median depth of each pixel of the batch, camera z; 0: none.
    pub depths: &'a Buffer<f32>,
    /// Number of places, empty ones included.
    pub count: u32,
}

/// Appends lifts to a segment.
pub struct Append {
    scan: Scan,
    /// Without lobes and with.
    stages: [lift_append::Stage; 2],
}

/// Lifts, with flags for those to append.
#[derive(Clone, Copy)]
pub struct Lifts<'a> {
    /// In the order of places; `cluster_size` 0: nothing to append.
    pub lifts: &'a Buffer<Lift>,
    /// 1: to be appended, else 0.
    pub flags: &'a Buffer<u32>,
    /// Scratch: a word for each lift.
    pub ranks: &'a Buffer<u32>,
    /// Scratch of a scan over the lifts.
    pub block_sums: &'a Buffer<u32>,
    /// Extent of the lifts; `count` has the same number on the host.
    pub extent: Extent<'a>,
    /// Index in `extent.count` that receives the number of appended lifts.
    pub total_index: u32,
    /// Number of lifts.
    pub count: u32,
}

impl Append {
    /// Makes the pipelines.
    pub fn new(context: &Context) -> Result<Self, GpuError> {
        let stage =
            |has_lobes| lift_append::Stage::new(context, &lift_append::Spec { workgroup_size: WORKGROUP, has_lobes });
        Ok(Append { scan: Scan::new(context, false)?, stages: [stage(false)?, stage(true)?] })
    }

    /// Appends the flagged lifts. If `segment` has no room for some, they are left out and reported in
    /// `status`.
    pub fn record(
        &self,
        recorder: &mut Recorder,
        segment: Segment,
        from: &Lifts<'_>,
        model: &Model,
        status: &Buffer<u32>,
    ) {
        let Lifts { lifts, flags, ranks, block_sums, extent, total_index, count } = *from;
        let buffers = ScanBuffers { values: flags, index: None, block_sums, offsets: ranks };
        self.scan.record(recorder, &buffers, extent, total_index);
        let part = model.part(segment);
        for (k, _, page) in model.pages(segment) {
            self.stages[usize::from(segment.has_lobes())].record(
                recorder,
                &lift_append::Buffers {
                    lifts,
                    lift_ranks: ranks,
                    lift_flags: flags,
                    population: &model.population,
                    geometry: part.geometry.page(k),
                    sh: part.sh.page(k),
                    lobes: part.lobes.page(k),
                },
                &lift_append::Push {
                    count,
                    segment: segment.index(),
                    page_first: page.first,
                    stride: page.capacity,
                    sh_coefficients: coefficients(part.sh_degree) as u32,
                },
                count,
            );
        }
        model.record_recount(recorder, Some((segment, extent.count, total_index)), status);
    }
}

/// The pipelines of inverse splatting.
pub struct LiftPhase {
    context: Context,
    count: lift_count::Stage,
    scan: Scan,
    args: dispatch_args::Stage,
    points: lift_points::Stage,
    join: lift_join::Stage,
    groups: lift_groups::Stage,
    pca: lift_pca::Stage,
    append: Append,
    status: Buffer<u32>,
}

impl LiftPhase {
    /// Makes the pipelines; buffers are made per batch.
    pub fn new(context: &Context, options: LiftOptions) -> Result<Self, GpuError> {
        let workgroup_size = WORKGROUP;
        let fail_on_smallest = u32::from(options.fail_on_smallest);
        let lockstep = context.info().lockstep;
        let plain_weights = u32::from(options.plain_weights);
        Ok(LiftPhase {
            count: lift_count::Stage::new(context, &lift_count::Spec { workgroup_size })?,
            scan: Scan::new(context, false)?,
            args: dispatch_args::Stage::new(context, &dispatch_args::Spec { workgroup_size: 1 })?,
            points: lift_points::Stage::new(context, &lift_points::Spec { workgroup_size })?,
            join: lift_join::Stage::new(context, &lift_join::Spec { workgroup_size })?,
            groups: lift_groups::Stage::new(
                context,
                &lift_groups::Spec { workgroup_size, fail_on_smallest, lockstep },
            )?,
            pca: lift_pca::Stage::new(context, &lift_pca::Spec { workgroup_size, plain_weights })?,
            append: Append::new(context)?,
            status: Buffer::zeroed(context, "lift status", status::WORDS)?,
            context: context.clone(),
        })
    }

    /// Counts the pixels with a depth that each 2D Gaussian covers, and the start of their points.
    pub fn record_count(&self, recorder: &mut Recorder, flat: &Flat<'_>, b: &LiftBuffers) {
        let Flat { screen_planes, stride, screen_frames, depths, count } = *flat;
        self.count.record(
            recorder,
            &bind!(lift_count { screen_planes, screen_frames, depths; b => views, point_counts; }),
            &lift_count::Push { count, stride, view_count: b.views.len() as u32 },
            count,
        );
        self.args.record(
            recorder,
            &dispatch_args::Buffers { count: &b.counts, dispatch_args: &b.args, status: &self.status },
            &dispatch_args::Push {
                count_index: PLACES,
                capacity: count,
                items_per_group: items_per_group(self.context.info()),
                args_index: 0,
                resource_index: Resource::Intersections.index(),
            },
            1,
        );
        self.record_scan(recorder, b, &b.point_counts, &b.point_firsts, POINTS);
    }

    fn record_scan(
        &self,
        recorder: &mut Recorder,
        b: &LiftBuffers,
        values: &Buffer<u32>,
        to: &Buffer<u32>,
        total: u32,
    ) {
        let extent = Extent { count: &b.counts, index: PLACES, args: &b.args, dispatch: 0 };
        let buffers = ScanBuffers { values, index: None, block_sums: &b.block_sums, offsets: to };
        self.scan.record(recorder, &buffers, extent, total);
    }

    /// Unprojects the covered pixels to 3D points.
    pub fn record_points(&self, recorder: &mut Recorder, flat: &Flat<'_>, b: &LiftBuffers, p: &PointBuffers) {
        let Flat { screen_planes, stride, screen_frames, depths, count } = *flat;
        self.points.record(
            recorder,
            &bind!(lift_points {
                screen_planes, screen_frames, depths;
                b => views, point_counts, point_firsts, heaviest, taus;
                p => points, point_sets, labels;
            }),
            &lift_points::Push { count, stride, view_count: b.views.len() as u32 },
            count,
        );
    }

    /// Separates foreground from background in `count` sets with a total of `point_count` points. Rounds with
    /// a growing τ repeat until clustering succeeds; the device decides.
    pub fn record_clusters(
        &self,
        recorder: &mut Recorder,
        count: u32,
        point_count: u32,
        b: &LiftBuffers,
        p: &PointBuffers,
    ) {
        recorder.fill(&b.cluster_sizes, 0);
        recorder.fill(&b.rounds, 0);
        if point_count == 0 {
            return;
        }
        let join = bind!(lift_join {
            p => points, point_sets, labels;
            b => point_counts, point_firsts, taus, cluster_sizes;
        });
        let groups = bind!(lift_groups {
            b => point_counts, point_firsts, heaviest, taus, prime_labels, cluster_sizes, rounds;
            p => labels, group_sizes;
        });
        let join_push = lift_join::Push { point_count };
        for round in 0..=MAX_GROWTHS {
            let push = lift_groups::Push { count, point_count, round, last_round: MAX_GROWTHS };
            if round == 0 {
                let subgroups = point_count.div_ceil(recorder.context().info().subgroup_size);
                self.join.record(recorder, &join, &join_push, subgroups);
                self.groups.record(recorder, &groups, &push, count);
            } else {
                self.join.record_indirect(recorder, &join, &join_push, &b.rounds, 2 * round);
                self.groups.record_indirect(recorder, &groups, &push, &b.rounds, 2 * round + 1);
            }
        }
    }

    /// Fits a 3D Gaussian to each prime group. `unit` is the scene's length unit: eigenvalues are at least
    /// 1e-7 of its square.
    pub fn record_pca(&self, recorder: &mut Recorder, flat: &Flat<'_>, unit: f32, b: &LiftBuffers, p: &PointBuffers) {
        let Flat { screen_planes, stride, screen_frames, count, .. } = *flat;
        self.pca.record(
            recorder,
            &bind!(lift_pca {
                screen_planes, screen_frames;
                b => views, train_views, point_counts, point_firsts, heaviest, prime_labels, cluster_sizes, lifts,
                    lift_flags;
                p => points, labels;
            }),
            &lift_pca::Push {
                count,
                stride,
                view_count: b.views.len() as u32,
                train_count: b.train_views.len() as u32,
                unit,
            },
            count,
        );
    }

    /// Appends lifts to the supplement of `model`. If there is no room for some, they are left out and
    /// reported in `status`.
    pub fn record_append(
        &self,
        recorder: &mut Recorder,
        count: u32,
        b: &LiftBuffers,
        model: &Model,
        status: &Buffer<u32>,
    ) {
        let lifts = Lifts {
            lifts: &b.lifts,
            flags: &b.lift_flags,
            ranks: &b.lift_ranks,
            block_sums: &b.block_sums,
            extent: Extent { count: &b.counts, index: PLACES, args: &b.args, dispatch: 0 },
            total_index: LIFTS,
            count,
        };
        self.append.record(recorder, Segment::Supplement, &lifts, model, status);
    }

    /// Lifts the batch that `refiner` has refined last, and appends the result to `model`. All of `views`
    /// count as training views. Waits.
    ///
    /// # Errors
    /// [`Error::Usage`] if the model has no room; otherwise an error of the device.
    pub fn lift(&self, refiner: &Refiner, views: &Views, unit: f32, model: &mut Model) -> Result<Lifted> {
        let (screen, batch) = (&refiner.screen, refiner.views());
        let places = screen.sizes.places;
        let (view_list, train_list) = lift_views(&views.cameras, &batch);
        let sizes = LiftSizes { places, views: view_list.len() as u32, train_views: train_list.len() as u32 };
        let b = LiftBuffers::new(&self.context, &sizes)?;
        b.views.upload(0, &view_list)?;
        b.train_views.upload(0, &train_list)?;
        b.counts.upload(0, &[places, 0, 0])?;
        let flat = Flat {
            screen_planes: &screen.buffers.screen_planes,
            stride: places,
            screen_frames: &screen.buffers.screen_frames,
            depths: &screen.buffers.depths,
            count: places,
        };
        let mut recorder = self.context.recorder("lift points")?;
        self.record_count(&mut recorder, &flat, &b);
        recorder.submit()?.wait()?;
        let point_count = b.counts.download_range(POINTS as usize, 1)?[0];

        let p = PointBuffers::new(&self.context, &point_count)?;
        let mut recorder = self.context.recorder("lift")?;
        self.record_points(&mut recorder, &flat, &b, &p);
        self.record_clusters(&mut recorder, places, point_count, &b, &p);
        self.record_pca(&mut recorder, &flat, unit, &b, &p);
        recorder.submit()?.wait()?;
        self.append(places, &b, model)?;
        Ok(Lifted { lifts: b.lifts.download()?, taus: b.taus.download()? })
    }

    /// Appends lifts of an earlier run; skips empty entries. Waits.
    pub fn append_lifts(&self, lifts: &[Lift], model: &mut Model) -> Result<()> {
        let count = lifts.len() as u32;
        let b = LiftBuffers::new(&self.context, &LiftSizes { places: count, views: 1, train_views: 1 })?;
        b.lifts.upload(0, lifts)?;
        b.lift_flags.upload(0, &lifts.iter().map(|l| u32::from(l.cluster_size > 0)).collect::<Vec<_>>())?;
        b.counts.upload(0, &[count, 0, 0])?;
        // Dispatch over the blocks; so few need no folding.
        let groups = count.div_ceil(items_per_group(self.context.info())).max(1);
        b.args.upload(0, &[groups, 1, 1])?;
        self.append(count, &b, model)
    }

    fn append(&self, count: u32, b: &LiftBuffers, model: &mut Model) -> Result<()> {
        let status = Buffer::<u32>::zeroed(&self.context, "append status", status::WORDS)?;
        let mut recorder = self.context.recorder("append")?;
        self.record_append(&mut recorder, count, b, model, &status);
        recorder.submit()?.wait()?;
        model.learn_counts()?;
        let found = Status::read(&status.download()?);
        match found.needs().next() {
            None => Ok(()),
            Some((what, needed)) => Err(Error::Usage(format!("there is no room for {needed} {what}"))),
        }
    }
}

/// The batch's views in the screen phase's order, then the others; and the index of each training view in
/// this list.
fn lift_views(cameras: &[Camera], batch: &Range<usize>) -> (Vec<View>, Vec<u32>) {
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
            // A view outside the batch has no pixels in its depth map; only its frustum is used.
            list.push(view(camera, 0));
        }
    }
    (list, train)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_batchs_views_come_first_with_their_pixels_and_others_behind() {
        let camera = |width, fx| Camera { fx, ..Camera::new(width, 2, 9.0) };
        let cameras: Vec<Camera> = (0..5).map(|v| camera(10 + v, f64::from(v))).collect();
        let (list, train) = lift_views(&cameras, &(1..4));
        assert_eq!(train, [3, 0, 1, 2, 4]);
        assert_eq!(list.iter().map(|view| view.fx as u32).collect::<Vec<_>>(), [1, 2, 3, 0, 4]);
        assert_eq!(list.iter().map(|view| view.pixel_first).collect::<Vec<_>>(), [0, 22, 46, 0, 0]);
    }
}
