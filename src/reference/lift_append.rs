//! Lifts behind the Gaussians that there are, closed up in the order of their 2D Gaussians.

use super::lift_pca::Lift;

/// Where the parameters of Gaussians lie: planes as on the GPU.
#[derive(Debug)]
pub struct ParameterPlanes<'a> {
    /// 11 planes × `stride`.
    pub geometry: &'a mut [f64],
    /// 3·`sh_coefficients` planes × `stride`.
    pub sh: &'a mut [f64],
    /// 5 planes × `lobe_stride`.
    pub lobes: &'a mut [f64],
    pub stride: usize,
    pub lobe_stride: usize,
    /// (L + 1)².
    pub sh_coefficients: usize,
}

/// Writes Gaussian `gaussian_first` + rank and lobe `lobe_first` + rank for every lift and returns their number. What would not
/// fit into the strides is not written.
pub fn lift_append(lifts: &[Lift], gaussian_first: usize, lobe_first: usize, planes: &mut ParameterPlanes) -> usize {
    let mut rank = 0;
    for lift in lifts.iter().filter(|lift| lift.cluster_size > 0) {
        let (i, j) = (gaussian_first + rank, lobe_first + rank);
        rank += 1;
        let (stride, lobe_stride) = (planes.stride, planes.lobe_stride);
        if i >= stride || j >= lobe_stride {
            continue;
        }
        for k in 0..3 {
            planes.geometry[k * stride + i] = lift.mean[k];
            planes.geometry[(3 + k) * stride + i] = lift.log_scale[k];
            planes.sh[k * stride + i] = lift.dc[k];
            planes.lobes[k * lobe_stride + j] = lift.lobe_dir[k];
        }
        for k in 0..4 {
            planes.geometry[(6 + k) * stride + i] = lift.quat[k];
        }
        planes.geometry[10 * stride + i] = lift.opacity;
        for plane in 3..3 * planes.sh_coefficients {
            planes.sh[plane * stride + i] = 0.0;
        }
        planes.lobes[3 * lobe_stride + j] = lift.lobe_width;
        planes.lobes[4 * lobe_stride + j] = 0.0;
    }
    rank
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lifts_close_up_in_order_and_touch_nothing_else() {
        let lift = |v: f64| Lift { mean: [v; 3], lobe_width: v, opacity: v, cluster_size: 3, ..Default::default() };
        let lifts = [lift(1.0), Lift::default(), lift(2.0), Lift::default(), lift(3.0)];
        let (mut geometry, mut sh, mut lobes) = (vec![9.0; 11 * 4], vec![9.0; 12 * 4], vec![9.0; 5 * 4]);
        let mut planes = ParameterPlanes {
            geometry: &mut geometry,
            sh: &mut sh,
            lobes: &mut lobes,
            stride: 4,
            lobe_stride: 4,
            sh_coefficients: 4,
        };
        assert_eq!(lift_append(&lifts, 2, 1, &mut planes), 3);
        // The third does not fit into 4 Gaussians.
        assert_eq!(geometry[..4], [9.0, 9.0, 1.0, 2.0]);
        assert_eq!(geometry[40..], [9.0, 9.0, 1.0, 2.0]);
        for plane in sh.chunks(4) {
            assert_eq!(plane, [9.0, 9.0, 0.0, 0.0]);
        }
        assert_eq!(lobes[12..], [9.0, 1.0, 2.0, 9.0, 9.0, 0.0, 0.0, 9.0]);
    }
}
