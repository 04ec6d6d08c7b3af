//! Twin of `pursuit_residual.comp`: compares a view's render with its photograph.

use glam::DVec3;

use super::{FLOAT_MAX, NEAR, pursuit::Texel};
use crate::stages::constants::pursuit::ERROR_BLOCK;

/// Residual by pixel, and the sum of the errors of each block of [`ERROR_BLOCK`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Residual {
    /// Texels of the finest level.
    pub texels: Vec<Texel>,
    /// Camera z; 0: none.
    pub depths: Vec<f64>,
    /// Squares of the mean difference; 0 if there is no depth.
    pub errors: Vec<f64>,
    /// Sum of errors of each block.
    pub sums: Vec<f64>,
    /// Squared differences over channels of each block, including pixels without a depth.
    pub squares: Vec<f64>,
}

/// Compares them. `targets` are 8-bit RGBA, alpha 0 if a pixel does not count; `depths` camera z, 0 for none.
pub fn pursuit_residual(image: &[[f64; 4]], targets: &[u32], depths: &[f64]) -> Residual {
    let (mut out, mut squares) = (Residual::default(), Vec::with_capacity(image.len()));
    for ((pixel, &target), &depth) in image.iter().zip(targets).zip(depths) {
        let render = DVec3::new(pixel[0], pixel[1], pixel[2]);
        let finite = render.to_array().iter().all(|v| v.abs() <= FLOAT_MAX);
        let render = if finite { render.clamp(DVec3::ZERO, DVec3::ONE) } else { DVec3::ZERO };
        let [r, g, b, alpha] = target.to_le_bytes().map(|byte| f64::from(byte) / 255.0);
        let difference = if alpha > 0.0 && finite { DVec3::new(r, g, b) - render } else { DVec3::ZERO };
        let seen = depth > NEAR && depth <= FLOAT_MAX;
        let mean = difference.abs().element_sum() / 3.0;
        squares.push(difference.length_squared());
        out.texels.push(Texel { difference, render, ..Default::default() });
        out.depths.push(if seen { depth } else { 0.0 });
        out.errors.push(if seen { mean * mean } else { 0.0 });
    }
    let blocks = |values: &[f64]| values.chunks(ERROR_BLOCK as usize).map(|block| block.iter().sum()).collect();
    (out.sums, out.squares) = (blocks(&out.errors), blocks(&squares));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_count_has_no_residual() {
        let grey = [0.25, 0.5, 2.0, 0.0];
        let image = [grey, grey, [f64::NAN, 0.0, 0.0, 0.0], grey];
        let white = u32::MAX;
        let found = pursuit_residual(&image, &[white, 0xFF_FFFF, white, white], &[1.0, 1.0, 1.0, 0.1]);
        assert_eq!(
            found.texels[0],
            Texel { difference: DVec3::new(0.75, 0.5, 0.0), render: DVec3::new(0.25, 0.5, 1.0), ..Default::default() }
        );
        let error = (1.25f64 / 3.0).powi(2);
        assert_eq!((found.errors, found.sums), (vec![error, 0.0, 0.0, 0.0], vec![error]));
        // The last pixel has no depth, but its squared error counts.
        assert_eq!(found.squares, [2.0 * (0.75f64.powi(2) + 0.25)]);
        assert_eq!(found.depths, [1.0, 1.0, 1.0, 0.0]);
        assert_eq!((found.texels[1].difference, found.texels[2].render), (DVec3::ZERO, DVec3::ZERO));
    }
}
