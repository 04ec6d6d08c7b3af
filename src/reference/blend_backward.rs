//! The blend's gradient: front to back again with the forward's decisions (3DGS, section 6; `ARCHITECTURE.md`).
//!
//! What lies behind a Gaussian is what is left of the final colour after taking away, one by one, what lies
//! before it and itself. So the forward pass need store nothing but its image.
//! With C = Σ c_k α_k T_k + b T_end and T_{k+1} = T_k (1 − α_k):
//! ∂(G·C)/∂α_k = T_k (G·c_k) − R_k / (1 − α_k), R_k = G · (all terms behind k, the background included).

use rayon::prelude::*;

use super::blend::sample;
use super::{ALPHA_MIN, Intersections, Splat, TRANSMITTANCE_MIN};

/// The gradient record of an intersection; `ARCHITECTURE.md` names its nine parts.
pub type Record = [f64; 9];

/// `image` is the forward pass's result, `image_grad` ∂loss/∂RGB by pixel. Records by slot, each the sum over
/// its tile's pixels, row by row.
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
                    pixel_backward(splats, isects, column, row, &image[pixel], image_grad[pixel], &mut records);
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

fn pixel_backward(
    splats: &[Splat],
    isects: &Intersections,
    column: u32,
    row: u32,
    image: &[f64; 4],
    grad: [f64; 3],
    records: &mut [Record],
) {
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
        if !s.clamped {
            let alpha_grad = transmittance * shade - behind / (1.0 - s.alpha);
            let g = alpha_grad * s.alpha;
            record[0] += g * s.wu;
            record[1] += g * s.wv;
            record[2] += g * s.wu * s.wu;
            record[3] += g * s.wu * s.wv;
            record[4] += g * s.wv * s.wv;
            record[5] += alpha_grad * s.falloff;
        }
        for c in 0..3 {
            record[6 + c] += grad[c] * s.alpha * transmittance;
        }
        transmittance = next;
    }
}
