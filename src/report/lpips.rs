//! LPIPS (Zhang et al. 2018, version 0.1): distance of two images in the features of a neural network.
//! glint contains no weights; they are read from a file.
//!
//! Tensors have the names and shapes of the `state_dict` of the published package `lpips`:
//! `net.slice1.0.weight` `[out, in, height, width]`, its `bias` `[out]` and so on, and
//! `lin0.model.1.weight` `[1, out, 1, 1]`. In Python:
//!
//! ```text
//! state = lpips.LPIPS(net="vgg").state_dict()
//! safetensors.torch.save_file({k: v for k, v in state.items() if not k.startswith("lins.")}, "vgg.safetensors")
//! ```

use std::{collections::BTreeMap, path::Path};

use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;

use super::{
    evaluate::{Compared, Evaluation, ViewQuality},
    metrics::Pair,
};
use crate::{
    Error, Result,
    data::tensors::{Tensor, Values, read_tensors},
    pipelines::render::Rendered,
};

/// Step of a network.
#[derive(Debug, Clone, Copy)]
enum Step {
    /// Convolution with a bias, followed by ReLU.
    Convolve { name: &'static str, side: usize, stride: usize, padding: usize },
    /// Maximum over each square.
    Pool { side: usize, stride: usize },
    /// Comparison of features.
    Compare,
}

const fn convolve(name: &'static str, side: usize, stride: usize, padding: usize) -> Step {
    Step::Convolve { name, side, stride, padding }
}

/// AlexNet with one column (Krizhevsky 2014).
const ALEX: &[Step] = &[
    convolve("slice1.0", 11, 4, 2),
    Step::Compare,
    Step::Pool { side: 3, stride: 2 },
    convolve("slice2.3", 5, 1, 2),
    Step::Compare,
    Step::Pool { side: 3, stride: 2 },
    convolve("slice3.6", 3, 1, 1),
    Step::Compare,
    convolve("slice4.8", 3, 1, 1),
    Step::Compare,
    convolve("slice5.10", 3, 1, 1),
    Step::Compare,
];

/// VGG with 16 layers (Simonyan and Zisserman 2014).
const VGG: &[Step] = &[
    convolve("slice1.0", 3, 1, 1),
    convolve("slice1.2", 3, 1, 1),
    Step::Compare,
    Step::Pool { side: 2, stride: 2 },
    convolve("slice2.5", 3, 1, 1),
    convolve("slice2.7", 3, 1, 1),
    Step::Compare,
    Step::Pool { side: 2, stride: 2 },
    convolve("slice3.10", 3, 1, 1),
    convolve("slice3.12", 3, 1, 1),
    convolve("slice3.14", 3, 1, 1),
    Step::Compare,
    Step::Pool { side: 2, stride: 2 },
    convolve("slice4.17", 3, 1, 1),
    convolve("slice4.19", 3, 1, 1),
    convolve("slice4.21", 3, 1, 1),
    Step::Compare,
    Step::Pool { side: 2, stride: 2 },
    convolve("slice5.24", 3, 1, 1),
    convolve("slice5.26", 3, 1, 1),
    convolve("slice5.28", 3, 1, 1),
    Step::Compare,
];

/// Networks, each with the name of a tensor that only it has.
const FORMS: [(&str, &[Step]); 2] = [("net.slice2.3.weight", ALEX), ("net.slice2.5.weight", VGG)];

/// Mean and standard deviation of photos with values from -1 to 1, by channel.
const SHIFT: [f32; 3] = [-0.030, -0.088, -0.188];
const SCALE: [f32; 3] = [0.458, 0.448, 0.450];
/// Avoids a division by 0 if all features are 0.
const EPSILON: f32 = 1e-10;
/// Pixels whose neighborhoods are gathered at once: 9 MB for 512 channels of 3 × 3.
const BAND: usize = 512;

impl Evaluation<f64> {
    /// Distances of these views; the means are NaN if there are none.
    pub fn of(views: Vec<ViewQuality<f64>>) -> Self {
        let mean = |of: fn(&ViewQuality<f64>) -> f64| views.iter().map(of).sum::<f64>() / views.len() as f64;
        Evaluation { base: mean(|view| view.base), augmented: mean(|view| view.augmented), views }
    }
}

/// Network with its weights.
pub struct Lpips {
    layers: Vec<Layer>,
}

enum Layer {
    Convolve {
        weights: Array2<f32>,
        bias: Vec<f32>,
        side: usize,
        stride: usize,
        padding: usize,
    },
    Pool {
        side: usize,
        stride: usize,
    },
    /// Weight of each channel.
    Compare(Vec<f32>),
}

/// Features of an image, `[channels, height · width]`.
struct Features {
    values: Array2<f32>,
    width: usize,
    height: usize,
}

impl Lpips {
    /// Reads the weights of AlexNet or VGG; the names of the tensors decide between them.
    ///
    /// # Errors
    /// Names the file, and the tensor that is missing or has another shape.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let mut tensors = read_tensors(path)?;
        let bad = |what: String| Error::input(path, what);
        let form = FORMS.iter().find(|(name, _)| tensors.contains_key(*name)).ok_or_else(|| {
            bad("has neither `net.slice2.3.weight` (AlexNet) nor `net.slice2.5.weight` (VGG), which the state_dict of lpips.LPIPS has".into())
        })?;
        let (mut layers, mut channels, mut compared) = (Vec::new(), 3, 0);
        for &step in form.1 {
            layers.push(match step {
                Step::Convolve { name, side, stride, padding } => {
                    let (shape, values) = take(&mut tensors, &format!("net.{name}.weight")).map_err(bad)?;
                    let [out, input, height, width] = shape[..] else {
                        return Err(bad(format!("`net.{name}.weight` has shape {shape:?}, expected four dimensions")));
                    };
                    if out == 0 || [input, height, width] != [channels, side, side] {
                        let wanted = format!("[out, {channels}, {side}, {side}]");
                        return Err(bad(format!("`net.{name}.weight` has shape {shape:?}, expected {wanted}")));
                    }
                    channels = out;
                    let weights = Array2::from_shape_vec((out, input * side * side), values);
                    let weights = weights.map_err(|error| bad(format!("`net.{name}.weight`: {error}")))?;
                    let bias = take_channels(&mut tensors, &format!("net.{name}.bias"), &[channels]).map_err(bad)?;
                    Layer::Convolve { weights, bias, side, stride, padding }
                }
                Step::Pool { side, stride } => Layer::Pool { side, stride },
                Step::Compare => {
                    let name = format!("lin{compared}.model.1.weight");
                    compared += 1;
                    Layer::Compare(take_channels(&mut tensors, &name, &[1, channels, 1, 1]).map_err(bad)?)
                }
            });
        }
        Ok(Lpips { layers })
    }

    /// Distances of both renders of a view.
    ///
    /// # Errors
    /// Those of [`Lpips::distance`], with the name of the photo.
    pub fn of_view(&self, view: &Compared<'_>) -> Result<ViewQuality<f64>> {
        let name = &view.photo.name;
        let distance = |rendered: &Rendered| {
            let (width, height, mask) = (view.truth.width, view.truth.height, view.truth.mask.as_deref());
            let pair = Pair { image: &rendered.color, reference: &view.truth.rgb, width, height, mask };
            self.distance(&pair).map_err(|error| Error::Usage(format!("photo `{name}`: {error}")))
        };
        let base = distance(view.base)?;
        let augmented = if std::ptr::eq(view.base, view.whole) { base } else { distance(view.whole)? };
        Ok(ViewQuality { name: name.clone(), base, augmented })
    }

    /// Distance of a render from its photo: 0 for equal images, and with the published weights seldom more
    /// than 1. Renders are clamped to between 0 and 1; masked pixels of the render are taken from the
    /// photo.
    ///
    /// # Errors
    /// [`Error::Usage`] if images are smaller than the network's windows, or if the [`Pair`] is invalid.
    pub fn distance(&self, pair: &Pair) -> Result<f64> {
        pair.check()?;
        let mut both = [false, true].map(|truth| Features::of(pair, truth));
        let mut sum = 0.0;
        for layer in &self.layers {
            let next = |features: &Features| match layer {
                Layer::Convolve { weights, bias, side, stride, padding } => {
                    features.convolved(weights.view(), bias, *side, *stride, *padding)
                }
                Layer::Pool { side, stride } => features.pooled(*side, *stride),
                Layer::Compare(_) => None,
            };
            if let Layer::Compare(weights) = layer {
                sum += distance(&both[0], &both[1], weights);
                continue;
            }
            let [Some(image), Some(truth)] = [next(&both[0]), next(&both[1])] else {
                return Err(Error::Usage(format!(
                    "images of {} × {} pixels are too small for LPIPS: the windows of its network do not fit",
                    pair.width, pair.height
                )));
            };
            both = [image, truth];
        }
        Ok(sum)
    }
}

/// Removes a tensor of floats and returns its shape and values.
fn take(tensors: &mut BTreeMap<String, Tensor>, name: &str) -> Result<(Vec<usize>, Vec<f32>), String> {
    let tensor = tensors.remove(name).ok_or_else(|| format!("has no tensor `{name}`"))?;
    let Values::F32(values) = tensor.values else { return Err(format!("`{name}` is not of 32-bit floats")) };
    match values.iter().position(|value| !value.is_finite()) {
        Some(at) => Err(format!("`{name}` has the value {} at {at}", values[at])),
        None => Ok((tensor.shape, values)),
    }
}

fn take_channels(tensors: &mut BTreeMap<String, Tensor>, name: &str, wanted: &[usize]) -> Result<Vec<f32>, String> {
    match take(tensors, name)? {
        (shape, values) if shape == wanted => Ok(values),
        (shape, _) => Err(format!("`{name}` has shape {shape:?}, expected {wanted:?}")),
    }
}

/// Squared differences of features normalized at each pixel, weighted by channel; mean over pixels.
fn distance(a: &Features, b: &Features, weights: &[f32]) -> f64 {
    let pixels = a.values.ncols();
    let length = |features: &Features| -> Vec<f32> {
        let mut squares = vec![0.0f32; pixels];
        for row in features.values.rows() {
            squares.iter_mut().zip(row).for_each(|(sum, value)| *sum += value * value);
        }
        squares.into_iter().map(|sum| sum.sqrt() + EPSILON).collect()
    };
    let lengths = [length(a), length(b)];
    let mut sum = 0.0;
    for ((a, b), &weight) in a.values.rows().into_iter().zip(b.values.rows()).zip(weights) {
        let difference = |i: usize| f64::from(a[i] / lengths[0][i] - b[i] / lengths[1][i]).powi(2);
        sum += f64::from(weight) * (0..pixels).map(difference).sum::<f64>();
    }
    sum / pixels as f64
}

/// Number of windows of `side` that fit into `length` with `padding` zeros at both ends.
fn windows(length: usize, side: usize, stride: usize, padding: usize) -> Option<usize> {
    Some((length + 2 * padding).checked_sub(side)? / stride + 1)
}

impl Features {
    fn of(pair: &Pair, truth: bool) -> Self {
        let (width, height) = (pair.width as usize, pair.height as usize);
        let value = |channel: usize, pixel: usize| {
            let of_truth = || f32::from(pair.reference[3 * pixel + channel]) / 255.0;
            let value =
                if truth || !pair.counts(pixel) { of_truth() } else { pair.image[3 * pixel + channel].clamp(0.0, 1.0) };
            (2.0 * value - 1.0 - SHIFT[channel]) / SCALE[channel]
        };
        Features { values: Array2::from_shape_fn((3, width * height), |(c, i)| value(c, i)), width, height }
    }

    /// Convolves with `weights` `[out, in · side · side]`. `None` if no window fits.
    fn convolved(
        &self,
        weights: ArrayView2<f32>,
        bias: &[f32],
        side: usize,
        stride: usize,
        padding: usize,
    ) -> Option<Self> {
        let width = windows(self.width, side, stride, padding)?;
        let height = windows(self.height, side, stride, padding)?;
        let pixels = width * height;
        let source = self.values.as_slice()?;
        let bands: Vec<Array2<f32>> = (0..pixels)
            .into_par_iter()
            .step_by(BAND)
            .map(|first| {
                let count = BAND.min(pixels - first);
                let mut columns = Array2::zeros((weights.ncols(), count));
                for (row, mut column) in columns.rows_mut().into_iter().enumerate() {
                    let (channel, dy, dx) = (row / (side * side), row / side % side, row % side);
                    let plane = &source[channel * self.width * self.height..][..self.width * self.height];
                    for (i, to) in column.iter_mut().enumerate() {
                        let (x, y) = ((first + i) % width * stride + dx, (first + i) / width * stride + dy);
                        // Coordinates in the padding are negative and wrap to large values.
                        let (x, y) = (x.wrapping_sub(padding), y.wrapping_sub(padding));
                        if x < self.width && y < self.height {
                            *to = plane[y * self.width + x];
                        }
                    }
                }
                let mut out = weights.dot(&columns);
                for (mut row, bias) in out.rows_mut().into_iter().zip(bias) {
                    row.mapv_inplace(|value| (value + bias).max(0.0));
                }
                out
            })
            .collect();
        let mut values = Array2::zeros((weights.nrows(), pixels));
        for (band, first) in bands.iter().zip((0..pixels).step_by(BAND)) {
            values.slice_mut(ndarray::s![.., first..first + band.ncols()]).assign(band);
        }
        Some(Features { values, width, height })
    }

    /// Takes the maximum of each window. `None` if no window fits.
    fn pooled(&self, side: usize, stride: usize) -> Option<Self> {
        let width = windows(self.width, side, stride, 0)?;
        let height = windows(self.height, side, stride, 0)?;
        let largest = |(channel, i): (usize, usize)| {
            let (x, y) = (i % width * stride, i / width * stride);
            let at = |k: usize| self.values[(channel, (y + k / side) * self.width + x + k % side)];
            (0..side * side).map(at).fold(f32::NEG_INFINITY, f32::max)
        };
        Some(Features { values: Array2::from_shape_fn((self.values.nrows(), width * height), largest), width, height })
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use tempfile::TempDir;

    use super::*;
    use crate::data::tensors::{ValuesRef, write_tensors};

    type Named = Vec<(String, Vec<usize>, Vec<f32>)>;

    /// Random weights for a network of few channels, scaled so that features keep their mean size.
    fn weights(form: &[Step], seed: u64) -> Named {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut values =
            |n: usize, low: f32, high: f32| -> Vec<f32> { (0..n).map(|_| random.random_range(low..high)).collect() };
        let (mut tensors, mut channels, mut compared) = (Named::new(), 3, 0);
        for step in form {
            match *step {
                Step::Convolve { name, side, .. } => {
                    let out = channels + 2;
                    let count = channels * side * side;
                    let size = (3.0 / count as f32).sqrt();
                    let shape = vec![out, channels, side, side];
                    tensors.push((format!("net.{name}.weight"), shape, values(out * count, -size, 1.5 * size)));
                    tensors.push((format!("net.{name}.bias"), vec![out], values(out, -0.2, 0.2)));
                    channels = out;
                }
                Step::Pool { .. } => {}
                Step::Compare => {
                    let name = format!("lin{compared}.model.1.weight");
                    tensors.push((name, vec![1, channels, 1, 1], values(channels, 0.0, 1.0)));
                    compared += 1;
                }
            }
        }
        tensors
    }

    fn written(folder: &TempDir, tensors: &Named) -> std::path::PathBuf {
        let path = folder.path().join("weights.safetensors");
        let list: Vec<_> =
            tensors.iter().map(|(name, shape, values)| (name.as_str(), &shape[..], ValuesRef::F32(values))).collect();
        write_tensors(&path, &list).unwrap();
        path
    }

    /// Feature of one channel, `[height][width]`, in f64.
    type Plane = Vec<Vec<f64>>;

    /// The definition, window by window.
    fn by_definition(form: &[Step], tensors: &Named, pair: &Pair) -> f64 {
        let tensor = |name: String| &tensors.iter().find(|(found, ..)| *found == name).unwrap().2;
        let (width, height) = (pair.width as usize, pair.height as usize);
        let image = |of: &dyn Fn(usize) -> f64| -> Vec<Plane> {
            let value = |c: usize, i: usize| (2.0 * of(3 * i + c) - 1.0 - f64::from(SHIFT[c])) / f64::from(SCALE[c]);
            (0..3)
                .map(|c| (0..height).map(|y| (0..width).map(|x| value(c, y * width + x)).collect()).collect())
                .collect()
        };
        let truth = |i: usize| f64::from(pair.reference[i]) / 255.0;
        let counts = |i: usize| pair.mask.is_none_or(|mask| mask[i / 3]);
        let shown = |i: usize| if counts(i) { f64::from(pair.image[i]).clamp(0.0, 1.0) } else { truth(i) };
        let mut both = [image(&shown), image(&truth)];
        let (mut sum, mut compared) = (0.0, 0);
        for step in form {
            match *step {
                Step::Convolve { name, side, stride, padding } => {
                    let (weights, bias) = (tensor(format!("net.{name}.weight")), tensor(format!("net.{name}.bias")));
                    both = both.map(|planes| {
                        let (height, width) = (planes[0].len() as i64, planes[0][0].len() as i64);
                        let places = |length: i64| (length as usize + 2 * padding - side) / stride + 1;
                        let at = |out: usize, y: usize, x: usize| -> f64 {
                            let mut sum = f64::from(bias[out]);
                            for (c, plane) in planes.iter().enumerate() {
                                for dy in 0..side {
                                    for dx in 0..side {
                                        let y = (y * stride + dy) as i64 - padding as i64;
                                        let x = (x * stride + dx) as i64 - padding as i64;
                                        if (0..height).contains(&y) && (0..width).contains(&x) {
                                            let weight = weights[((out * planes.len() + c) * side + dy) * side + dx];
                                            sum += f64::from(weight) * plane[y as usize][x as usize];
                                        }
                                    }
                                }
                            }
                            sum.max(0.0)
                        };
                        let row = |out, y| (0..places(width)).map(|x| at(out, y, x)).collect();
                        (0..bias.len()).map(|out| (0..places(height)).map(|y| row(out, y)).collect()).collect()
                    });
                }
                Step::Pool { side, stride } => {
                    let pool = |plane: &Plane| -> Plane {
                        let places = |length: usize| (length - side) / stride + 1;
                        let largest = |y: usize, x: usize| {
                            let window = (0..side).flat_map(|dy| (0..side).map(move |dx| (dy, dx)));
                            window.map(|(dy, dx)| plane[y * stride + dy][x * stride + dx]).fold(f64::MIN, f64::max)
                        };
                        let row = |y: usize| (0..places(plane[0].len())).map(|x| largest(y, x)).collect();
                        (0..places(plane.len())).map(row).collect()
                    };
                    both = both.map(|planes| planes.iter().map(pool).collect());
                }
                Step::Compare => {
                    let weights = tensor(format!("lin{compared}.model.1.weight"));
                    compared += 1;
                    let (height, width) = (both[0][0].len(), both[0][0][0].len());
                    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
                        let unit = both.each_ref().map(|planes| {
                            let length =
                                planes.iter().map(|plane| plane[y][x].powi(2)).sum::<f64>().sqrt() + f64::from(EPSILON);
                            planes.iter().map(|plane| plane[y][x] / length).collect::<Vec<_>>()
                        });
                        let square = |c: usize| f64::from(weights[c]) * (unit[0][c] - unit[1][c]).powi(2);
                        sum += (0..weights.len()).map(square).sum::<f64>() / (height * width) as f64;
                    }
                }
            }
        }
        sum
    }

    #[test]
    fn a_distance_is_its_definition() {
        let folder = TempDir::new().unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let (width, height) = (83, 70);
        let image: Vec<f32> = (0..3 * width * height).map(|_| random.random_range(-0.1..1.1)).collect();
        let reference: Vec<u8> = (0..3 * width * height).map(|_| random.random()).collect();
        let mask: Vec<bool> = (0..width * height).map(|i| i % 7 != 0).collect();
        for (i, (_, form)) in FORMS.into_iter().enumerate() {
            let tensors = weights(form, i as u64);
            let lpips = Lpips::read(written(&folder, &tensors)).unwrap();
            for mask in [None, Some(&mask[..])] {
                let pair = Pair { image: &image, reference: &reference, width, height, mask };
                let (got, want) = (lpips.distance(&pair).unwrap(), by_definition(form, &tensors, &pair));
                // Thirteen layers of sums of hundreds of f32 terms: about the root of the number of terms
                // times 6e-8 each.
                assert!(want > 1e-3 && (got - want).abs() < 1e-5 * want, "{got} for {want}");
            }
            let same: Vec<f32> = reference.iter().map(|&byte| f32::from(byte) / 255.0).collect();
            let pair = Pair { image: &same, reference: &reference, width, height, mask: None };
            assert_eq!(lpips.distance(&pair).unwrap(), 0.0);
        }
    }

    #[test]
    fn what_is_no_network_and_what_is_too_small_is_refused_by_name() {
        let folder = TempDir::new().unwrap();
        let refused = |tensors: &Named, words: &str| {
            let error = Lpips::read(written(&folder, tensors)).err().unwrap().to_string();
            assert!(error.contains("weights.safetensors") && error.contains(words), "{error}");
        };
        let sound = weights(ALEX, 1);
        refused(&vec![], "neither `net.slice2.3.weight` (AlexNet) nor");
        let mut lacking = sound.clone();
        lacking.retain(|(name, ..)| name != "lin3.model.1.weight");
        refused(&lacking, "no tensor `lin3.model.1.weight`");
        let mut narrow = sound.clone();
        narrow[0].1 = vec![5, 3, 121, 1];
        refused(&narrow, "`net.slice1.0.weight` has shape [5, 3, 121, 1], expected [out, 3, 11, 11]");
        let mut unsound = sound.clone();
        unsound[1].2[4] = f32::NAN;
        refused(&unsound, "`net.slice1.0.bias` has the value NaN at 4");
        let lpips = Lpips::read(written(&folder, &sound)).unwrap();
        let (image, reference) = (vec![0.5; 3 * 300], vec![9; 3 * 300]);
        let small = Pair { image: &image, reference: &reference, width: 30, height: 10, mask: None };
        assert!(lpips.distance(&small).unwrap_err().to_string().contains("30 × 10 pixels are too small"));
    }
}
