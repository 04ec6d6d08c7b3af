//! Separates foreground from background: rounds of [`LiftJoin`] and [`LiftGroups`] at growing τ, as many as are needed, decided
//! on the device.

use super::{
    lift_groups::{self, LiftGroups},
    lift_join::{self, LiftJoin},
};
use crate::gpu::{Buffer, Context, GpuError, Recorder};

/// τ grows by 1.5 at most so many times: 5 pixels' widths to 1.5³² · 5 = 2 million. Points are farther apart than that only
/// where depths differ a thousandfold at a focal length of 2000 pixels; such a set has no lift.
pub const MAX_GROWTHS: u32 = 32;

/// Words of `rounds`: the workgroups of two stages for every round.
pub const ROUNDS_LEN: usize = 6 * (MAX_GROWTHS as usize + 1);

/// Sets of points, the state of their clustering and its outcome. Sets lie one after the other without overlap.
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// Per point: x, y, z, weight.
    pub points: &'a Buffer<[f32; 4]>,
    /// Per point: its set.
    pub point_sets: &'a Buffer<u32>,
    /// Per point: before, its own index within the set; after, that of the first point of its component.
    pub labels: &'a Buffer<u32>,
    /// Per point: scratch.
    pub group_sizes: &'a Buffer<u32>,
    /// Per set: its number of points, its first point, and its point of greatest weight.
    pub point_counts: &'a Buffer<u32>,
    pub point_firsts: &'a Buffer<u32>,
    pub heaviest: &'a Buffer<u32>,
    /// Per set: before, τ0; after, the τ at which clustering succeeded, or the last one tried.
    pub taus: &'a Buffer<f32>,
    /// Per set: label of the prime group; left as it was where there is none.
    pub prime_labels: &'a Buffer<u32>,
    /// Per set: points of the prime group; 0: no lift (fewer than 3 points, τ0 not in (0, 1e18], or failure to the last).
    pub cluster_sizes: &'a Buffer<u32>,
    /// [`ROUNDS_LEN`] words.
    pub rounds: &'a Buffer<u32>,
}

/// Both pipelines of clustering.
pub struct LiftCluster {
    join: LiftJoin,
    groups: LiftGroups,
}

impl LiftCluster {
    /// `fail_on_smallest` ⚖: failure is the smallest group having fewer than 3 points, not the largest.
    pub fn new(context: &Context, workgroup_size: u32, fail_on_smallest: bool) -> Result<Self, GpuError> {
        let fail_on_smallest = u32::from(fail_on_smallest);
        Ok(LiftCluster {
            join: LiftJoin::new(context, &lift_join::Spec { workgroup_size })?,
            groups: LiftGroups::new(context, &lift_groups::Spec { workgroup_size, fail_on_smallest })?,
        })
    }

    /// `count` sets of `point_count` points altogether. Clears `cluster_sizes` and `rounds` first.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, count: u32, point_count: u32) {
        let b = buffers;
        recorder.fill(b.cluster_sizes, 0);
        recorder.fill(b.rounds, 0);
        let join = lift_join::Buffers {
            points: b.points,
            point_sets: b.point_sets,
            point_counts: b.point_counts,
            point_firsts: b.point_firsts,
            taus: b.taus,
            cluster_sizes: b.cluster_sizes,
            labels: b.labels,
        };
        let groups = lift_groups::Buffers {
            point_counts: b.point_counts,
            point_firsts: b.point_firsts,
            heaviest: b.heaviest,
            labels: b.labels,
            group_sizes: b.group_sizes,
            taus: b.taus,
            prime_labels: b.prime_labels,
            cluster_sizes: b.cluster_sizes,
            rounds: b.rounds,
        };
        if point_count == 0 {
            return;
        }
        let join_push = lift_join::Push { point_count };
        for round in 0..=MAX_GROWTHS {
            if round == 0 {
                self.join.record(recorder, &join, &join_push);
            } else {
                self.join.record_indirect(recorder, &join, &join_push, b.rounds, 2 * round);
            }
            let push = lift_groups::Push { count, point_count, round, last_round: MAX_GROWTHS };
            self.groups.record(recorder, &groups, &push);
        }
    }
}
