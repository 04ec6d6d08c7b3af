//! Twin of `ssim_forward.comp`: SSIM and L1 of a frame, and the derivatives of SSIM.

/// Weight of 1 − SSIM in the loss; |x − y| has the rest.
pub const SSIM_WEIGHT: f64 = 0.2;
/// Half the window's width in pixels; σ is 1.5 pixels.
const RADIUS: usize = 5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;
/// Moments are those of x − MIDDLE and y − MIDDLE, −MIDDLE outside the image; see `ssim.glsl`.
pub(super) const MIDDLE: f64 = 0.5;

/// Results of the forward pass for one frame; pixels row by row.
pub struct SsimForward {
    /// Per pixel and channel: ∂S/∂mx with the second moments fixed, ∂S/∂E\[x²\], ∂S/∂E\[xy\].
    pub partials: Vec<[[f64; 3]; 3]>,
    /// Sums over pixels and channels of |x − y|, of (x − y)² and of SSIM.
    pub sums: [f64; 3],
    /// Those sums for each pixel, over its channels.
    pub pixel_sums: Vec<[f64; 3]>,
    /// The loss of each pixel, the mean over its channels.
    pub loss_map: Vec<f64>,
}

/// Channel `channel` of a packed RGBA8 pixel, in [0, 1].
pub fn target_channel(packed: u32, channel: usize) -> f64 {
    f64::from(packed >> (8 * channel) & 0xFF) / 255.0
}

/// True if a packed pixel counts: a mask that leaves it out sets its alpha to 0.
pub fn counts(packed: u32) -> bool {
    packed >> 24 != 0
}

/// Compares them. `image` is RGB and transmittance, `targets` RGBA8 with R in the low byte, both `width` ×
/// `height` pixels. If a target does not count, the image is taken to equal it, and the map is 0.
pub fn ssim_forward(width: usize, height: usize, image: &[[f64; 4]], targets: &[u32]) -> SsimForward {
    let pixels = width * height;
    let pair = |i: usize, c: usize| {
        let y = target_channel(targets[i], c);
        (if counts(targets[i]) { image[i][c] } else { y }, y)
    };
    let moments: Vec<[[f64; 4]; 3]> = (0..pixels)
        .map(|i| {
            std::array::from_fn(|c| {
                let (x, y) = pair(i, c);
                let (x, y) = (x - MIDDLE, y - MIDDLE);
                [x, y, x * x + y * y, x * y]
            })
        })
        .collect();
    let outside = [-MIDDLE, -MIDDLE, 2.0 * MIDDLE * MIDDLE, MIDDLE * MIDDLE];
    let moments = filter(width, height, &moments, outside);
    let mut forward = SsimForward {
        partials: vec![[[0.0; 3]; 3]; pixels],
        sums: [0.0; 3],
        pixel_sums: vec![[0.0; 3]; pixels],
        loss_map: vec![0.0; pixels],
    };
    for i in 0..pixels {
        for (c, &[x, y, squares, product]) in moments[i].iter().enumerate() {
            let (mx, my) = (x + MIDDLE, y + MIDDLE);
            let a1 = 2.0 * mx * my + C1;
            let a2 = 2.0 * (product - x * y) + C2;
            let b1 = mx * mx + my * my + C1;
            let b2 = squares - x * x - y * y + C2;
            let s = a1 * a2 / (b1 * b2);
            let p1 = -s / b2;
            let p2 = 2.0 * a1 / (b1 * b2);
            let p0 = 2.0 * (my * a2 / b2 - mx * s) / b1 - 2.0 * x * p1 - y * p2;
            let (x, y) = pair(i, c);
            let l1 = (x - y).abs();
            forward.partials[i][c] = [p0, p1, p2];
            for (k, part) in [l1, l1 * l1, s].into_iter().enumerate() {
                forward.sums[k] += part;
                forward.pixel_sums[i][k] += part;
            }
            if counts(targets[i]) {
                forward.loss_map[i] += ((1.0 - SSIM_WEIGHT) * l1 + SSIM_WEIGHT * (1.0 - s)) / 3.0;
            }
        }
    }
    forward
}

/// Filters each plane down the columns, then along the rows; beyond the image it is `outside`.
pub(super) fn filter<const N: usize>(
    width: usize,
    height: usize,
    planes: &[[[f64; N]; 3]],
    outside: [f64; N],
) -> Vec<[[f64; N]; 3]> {
    let window = window();
    let outside = [outside; 3];
    let down = tap(&window, planes, &outside, |i, t| {
        let y = (i / width + t).checked_sub(RADIUS).filter(|&y| y < height)?;
        Some(y * width + i % width)
    });
    tap(&window, &down, &outside, |i, t| {
        let x = (i % width + t).checked_sub(RADIUS).filter(|&x| x < width)?;
        Some(i / width * width + x)
    })
}

/// Σ over the taps t of weight × sample; `at` gives the sample's index by pixel and tap if it is within the
/// image.
fn tap<const N: usize>(
    window: &[f64],
    planes: &[[[f64; N]; 3]],
    outside: &[[f64; N]; 3],
    at: impl Fn(usize, usize) -> Option<usize>,
) -> Vec<[[f64; N]; 3]> {
    let mut sums = vec![[[0.0; N]; 3]; planes.len()];
    for (i, sums) in sums.iter_mut().enumerate() {
        for (t, weight) in window.iter().enumerate() {
            let sample = at(i, t).map_or(outside, |j| &planes[j]);
            for (sum, value) in sums.as_flattened_mut().iter_mut().zip(sample.as_flattened()) {
                *sum += weight * value;
            }
        }
    }
    sums
}

/// exp(−d²/2σ²) for d = −5..5, divided by their sum.
fn window() -> [f64; 2 * RADIUS + 1] {
    let bell: [f64; 2 * RADIUS + 1] = std::array::from_fn(|t| (-(t as f64 - RADIUS as f64).powi(2) / 4.5).exp());
    let sum: f64 = bell.iter().sum();
    bell.map(|b| b / sum)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Sizes with less than a window, with less than a tile, and with more than one.
    pub const SIZES: [(usize, usize); 3] = [(1, 1), (17, 3), (40, 36)];

    /// A picture with gradients, edges and noise, and a target near it.
    pub fn pictures(width: usize, height: usize) -> (Vec<[f64; 4]>, Vec<u32>) {
        let noise = |i: usize| (i as u32).wrapping_mul(2_654_435_761) as f64 / 4_294_967_296.0;
        let image = (0..width * height)
            .map(|i| {
                let (x, y) = ((i % width) as f64, (i / width) as f64);
                let edge = if x > 20.0 { 0.5 } else { 0.1 };
                [edge + 0.1 * noise(3 * i), 0.013 + 0.02 * y, 0.5 + 0.4 * (0.3 * x).sin() * (0.2 * y).cos(), 0.3]
            })
            .collect::<Vec<_>>();
        let targets = image
            .iter()
            .enumerate()
            .map(|(i, rgb)| {
                let byte = |c: usize| ((rgb[c] + 0.2 * noise(5 * i + c) - 0.1).clamp(0.0, 1.0) * 255.0) as u32;
                byte(0) | byte(1) << 8 | byte(2) << 16 | 0xFF00_0000
            })
            .collect();
        (image, targets)
    }

    /// SSIM of the definition, with the window of 11 × 11 taps at each pixel.
    #[test]
    fn separable_filters_give_what_the_square_window_gives() {
        let bell = |d: i64| (-(d * d) as f64 / 4.5).exp();
        let norm: f64 = (-5..=5).map(bell).sum();
        for (width, height) in SIZES {
            let (image, targets) = pictures(width, height);
            let (mut l1, mut squared, mut ssim) = (0.0, 0.0, 0.0);
            for (i, c) in (0..width * height).flat_map(|i| (0..3).map(move |c| (i, c))) {
                let (mut mx, mut my, mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
                for (dy, dx) in (-5..=5).flat_map(|dy| (-5..=5).map(move |dx| (dy, dx))) {
                    let (px, py) = ((i % width) as i64 + dx, (i / width) as i64 + dy);
                    if px < 0 || py < 0 || px >= width as i64 || py >= height as i64 {
                        continue;
                    }
                    let j = py as usize * width + px as usize;
                    let (x, y, w) = (image[j][c], target_channel(targets[j], c), bell(dx) * bell(dy) / (norm * norm));
                    mx += w * x;
                    my += w * y;
                    xx += w * x * x;
                    yy += w * y * y;
                    xy += w * x * y;
                }
                let difference = image[i][c] - target_channel(targets[i], c);
                l1 += difference.abs();
                squared += difference * difference;
                ssim += (2.0 * mx * my + 1e-4) * (2.0 * (xy - mx * my) + 9e-4)
                    / ((mx * mx + my * my + 1e-4) * (xx - mx * mx + yy - my * my + 9e-4));
            }
            let forward = ssim_forward(width, height, &image, &targets);
            assert!((forward.sums[0] - l1).abs() < 1e-9 && (forward.sums[2] - ssim).abs() < 1e-9);
            assert!((forward.sums[1] - squared).abs() < 1e-9);
            let of_map: f64 = forward.loss_map.iter().sum();
            let total = 0.8 * l1 / 3.0 + 0.2 * ((width * height) as f64 - ssim / 3.0);
            assert!((of_map - total).abs() < 1e-9);
        }
    }
}
