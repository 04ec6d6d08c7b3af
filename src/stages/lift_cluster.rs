//! Separates foreground from background: single-linkage clustering of each set of points.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::lift_cluster::{Buffers, Kernel, Push, Spec};

/// See `glsl/lift/lift_cluster.comp`.
pub struct LiftCluster(Pipeline<Kernel>);

impl LiftCluster {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(LiftCluster(Pipeline::new(context, spec)?))
    }

    /// `labels` and `group_sizes` have one element for each point, `taus`, `prime_labels` and `cluster_sizes` one for each of the
    /// `count` sets. The sets may not overlap. One subgroup for each set.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        let lanes = recorder.context().info().subgroup_size;
        recorder.dispatch(&self.0, buffers, push, push.count * lanes);
    }
}
