//! Twin of `median_depth.comp`: the depth of each pixel's median Gaussian (method, section 4).

use glam::{DVec3, DVec4};

use super::project::rotation;
use super::{FLOAT_MAX, NONE, Params, View};

/// Point of the median Gaussian at which the depth is taken (method, section 4, ⚖).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DepthAt {
    /// z of the point of maximum response along the pixel's ray, or of the centre if that point is not in
    /// front of the near plane.
    MaximumResponse,
    /// z of the Gaussian's centre.
    Centre,
}

/// Camera z by pixel, scene units; 0 if there is no median Gaussian. If the point of maximum response is not
/// in front of the near plane, or does not exist, the centre's z is used. `scale` is that of the model in the
/// world, which the view's rows contain too; 1 for a view of the world itself.
pub fn median_depth(params: &Params, view: &View, median: &[u32], at: DepthAt, scale: f64) -> Vec<f64> {
    let mut depths = vec![0.0; median.len()];
    for (pixel, &global) in median.iter().enumerate() {
        if global == NONE {
            continue;
        }
        let i = global as usize;
        let (column, row) = (pixel % view.width as usize, pixel / view.width as usize);
        depths[pixel] = view.to_camera(params.mean(i)).z;
        if at == DepthAt::MaximumResponse {
            let best = scale * scale * maximum_response(params, view, i, column as f64 + 0.5, row as f64 + 0.5);
            if best > view.near && best <= FLOAT_MAX {
                depths[pixel] = best;
            }
        }
    }
    depths
}

/// The ray is eye + z · direction, its direction having camera z = 1. In the Gaussian's own whitened axes it
/// is o + z d with o = S⁻¹Rᵀ(eye − mean), d = S⁻¹Rᵀ direction, and nearest the origin at z = −o·d / |d|².
/// Numerator and denominator contain S⁻¹ twice, so it is multiplied by the smallest scale: entries are in (0,
/// 1], and nothing overflows.
fn maximum_response(params: &Params, view: &View, i: usize, u: f64, v: f64) -> f64 {
    let Some(rotation) = rotation(params.quat(i)) else { return 0.0 };
    let log_scale = params.log_scale(i);
    let smallest = log_scale.min_element();
    let inverse_scale = DVec3::from_array(log_scale.to_array().map(|s| (smallest - s).exp()));
    let row = |r: DVec4| r.truncate();
    let direction =
        (u - view.cx) / view.fx * row(view.row_x) + (v - view.cy) / view.fy * row(view.row_y) + row(view.row_z);
    let o = inverse_scale * (rotation.transpose() * (view.eye - params.mean(i)));
    let d = inverse_scale * (rotation.transpose() * direction);
    -o.dot(d) / d.dot(d)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{Background, NEAR, Options, random_camera, random_scene, render};

    /// Samples the 3D Gaussian along the ray and finds its maximum by ternary search: log density is a
    /// parabola.
    #[test]
    fn the_depth_is_where_the_gaussian_is_densest_on_the_ray() {
        let params = Params::from_scene(&random_scene(3, 300, 100, 0)).unwrap();
        let camera = random_camera(40, 30);
        let view = View::from_camera(&camera);
        let rendered = render(&params, &view, &Options::default(), Background::Color([0.0; 3]));
        let median = &rendered.blended.median;
        let depths = median_depth(&params, &view, median, DepthAt::MaximumResponse, 1.0);
        let centres = median_depth(&params, &view, median, DepthAt::Centre, 1.0);
        let mut checked = 0;
        for (pixel, &global) in median.iter().enumerate() {
            if global == NONE {
                assert_eq!((depths[pixel], centres[pixel]), (0.0, 0.0));
                continue;
            }
            let i = global as usize;
            assert_eq!(centres[pixel], rendered.projected.splats[i].z);
            let rotation = rotation(params.quat(i)).unwrap();
            let distance = |z: f64| {
                let world = camera.unproject((pixel % 40) as f64 + 0.5, (pixel / 40) as f64 + 0.5, z);
                let local = rotation.transpose() * (world - params.mean(i));
                (local / DVec3::from_array(params.log_scale(i).to_array().map(f64::exp))).length_squared()
            };
            let (mut low, mut high) = (-100.0, 200.0);
            for _ in 0..200 {
                let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                if distance(a) < distance(b) { high = b } else { low = a }
            }
            if low > NEAR * 1.001 {
                // A parabola's minimum is found to the root of the arithmetic's precision, √(1e-16 · condition).
                assert!((depths[pixel] - low).abs() < 1e-4 * low, "{} {low}", depths[pixel]);
                checked += 1;
            } else if low < NEAR * 0.999 {
                assert_eq!(depths[pixel], centres[pixel]);
            }
        }
        assert!(checked > 200, "{checked}");
    }
}
