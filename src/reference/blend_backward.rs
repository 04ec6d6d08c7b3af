//! Twin of `blend_backward.comp`: the blend's gradient, front to back again with the forward pass's decisions
//! (3DGS, section 6; `docs/design-notes.md`).
//!
//! The color behind a Gaussian is the final color minus, one by one, the terms in front of it and its own.
//! So the forward pass stores only its image.
//! With C = Σ c_k α_k T_k + b T_end and T_{k+1} = T_k (1 − α_k):
//! ∂(G·C)/∂α_k = T_k (G·c_k) − R_k / (1 − α_k), R_k = G · (all terms behind k, the background included).

use rayon::prelude::*;

use super::blend::sample;
use super::{ALPHA_MIN, Intersections, Splat, TRANSMITTANCE_MIN};

/// The gradient record of an intersection, in the order of `glsl/shared/records.glsl`: Σ g w, ∂loss/∂opacity, Σ g wwᵀ (three
/// entries), ∂loss/∂RGB.
pub type Record = [f64; 9];

/// Gradient records by slot, each the sum over its tile's pixels, row by row. `image` is the forward pass's
/// result, `image_grad` ∂loss/∂RGB by pixel.
pub fn blend_backward(
    splats: &[Splat],
    isects: &Intersections,
    image: &[[f64; 4]],
    image_grad: &[[f64; 3]],
) -> Vec<Record> {
    let tiling = isects.tiling;
    let of_tiles: Vec<Vec<Record>> = (0..tiling.count() as u32)
        .into_par_iter()
        .map(|tile| {
            let [begin, end] = isects.tile_ranges[tile as usize];
            let mut records = vec![[0.0; 9]; (end - begin) as usize];
            let (left, top) = (tile % tiling.tiles_x * tiling.tile_width, tile / tiling.tiles_x * tiling.tile_height);
            for row in top..(top + tiling.tile_height).min(tiling.height) {
                for column in left..(left + tiling.tile_width).min(tiling.width) {
                    let pixel = row as usize * tiling.width as usize + column as usize;
                    let of_pixel = Pixel { column, row, image: image[pixel], grad: image_grad[pixel] };
                    pixel_backward(splats, isects, &of_pixel, &mut records);
                }
            }
            records
        })
        .collect();

    let mut isect_grads = vec![[0.0; 9]; isects.isect_slots.len()];
    for (range, records) in isects.tile_ranges.iter().zip(of_tiles) {
        for (isect, record) in (range[0]..range[1]).zip(records) {
            isect_grads[isects.isect_slots[isect as usize] as usize] = record;
        }
    }
    isect_grads
}

struct Pixel {
    column: u32,
    row: u32,
    image: [f64; 4],
    grad: [f64; 3],
}

fn pixel_backward(splats: &[Splat], isects: &Intersections, pixel: &Pixel, records: &mut [Record]) {
    let Pixel { column, row, image, grad } = *pixel;
    let dot = |c: [f64; 3]| grad[0] * c[0] + grad[1] * c[1] + grad[2] * c[2];
    let mut behind = dot([image[0], image[1], image[2]]);
    let mut transmittance = 1.0;
    for ((_, global), record) in isects.of_pixel(column, row).zip(records) {
        let splat = &splats[global as usize];
        let s = sample(splat, column, row);
        if !(s.alpha >= ALPHA_MIN) {
            continue;
        }
        let next = transmittance * (1.0 - s.alpha);
        if next < TRANSMITTANCE_MIN {
            break;
        }
        let shade = dot(splat.color());
        behind -= shade * s.alpha * transmittance;
        let mut terms = [0.0; 9];
        if !s.clamped {
            let (alpha_grad, wu, wv) = (transmittance * shade - behind / (1.0 - s.alpha), s.wu, s.wv);
            let g = alpha_grad * s.alpha;
            terms[..6].copy_from_slice(&[
                g * wu,
                g * wv,
                alpha_grad * s.falloff,
                g * wu * wu,
                g * wu * wv,
                g * wv * wv,
            ]);
        }
        for c in 0..3 {
            terms[6 + c] = grad[c] * s.alpha * transmittance;
        }
        record.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        transmittance = next;
    }
}
