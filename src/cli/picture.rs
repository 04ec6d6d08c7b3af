//! Rendered picture, before it is written to a file or shown in a window.

use std::path::Path;

use rayon::prelude::*;

use crate::{
    Result,
    data::{write_exr_channel, write_exr_rgb, write_png_gray, write_png_rgb},
    report::decompose::srgb_from_linear,
};

/// Picture of one kind of content.
pub(super) struct Picture {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) content: Content,
}

/// File formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Format {
    Png,
    Exr,
}

pub(super) enum Content {
    /// sRGB values, interleaved.
    Srgb(Vec<f32>),
    /// Linear light, interleaved.
    Linear(Vec<f32>),
    Grey(Vec<f32>),
    /// Camera z, 0 if there is none.
    Depth(Vec<f32>),
}

impl Picture {
    /// Pixels as in the PNG, 3 bytes each.
    #[cfg(feature = "view")]
    pub(super) fn rgb(&self) -> Vec<u8> {
        use crate::data::to_byte;
        match &self.content {
            Content::Srgb(rgb) => rgb.iter().map(|&v| to_byte(v)).collect(),
            Content::Linear(rgb) => encoded(rgb).iter().map(|&v| to_byte(v)).collect(),
            Content::Grey(values) => values.iter().flat_map(|&v| [to_byte(v); 3]).collect(),
            Content::Depth(values) => depth_grey(values).iter().flat_map(|&v| [to_byte(v); 3]).collect(),
        }
    }

    pub(super) fn write(&self, path: &Path, format: Format) -> Result<()> {
        let (width, height) = (self.width, self.height);
        match (&self.content, format) {
            (Content::Srgb(rgb) | Content::Linear(rgb), Format::Exr) => write_exr_rgb(path, width, height, rgb),
            (Content::Srgb(rgb), Format::Png) => write_png_rgb(path, width, height, rgb),
            (Content::Linear(rgb), Format::Png) => write_png_rgb(path, width, height, &encoded(rgb)),
            (Content::Grey(values), Format::Exr) => write_exr_channel(path, width, height, "Y", values),
            (Content::Grey(values), Format::Png) => write_png_gray(path, width, height, values),
            (Content::Depth(values), Format::Exr) => write_exr_channel(path, width, height, "Z", values),
            (Content::Depth(values), Format::Png) => write_png_gray(path, width, height, &depth_grey(values)),
        }
    }
}

fn encoded(linear: &[f32]) -> Vec<f32> {
    linear.par_iter().map(|&v| srgb_from_linear(v)).collect()
}

/// Gray of the largest depth: dark, but different from the black of pixels without depth.
const FARTHEST_GREY: f32 = 0.1;

/// Depths as gray, linear in 1/depth between the 1st and the 99th percentile of the view.
fn depth_grey(depths: &[f32]) -> Vec<f32> {
    let mut near: Vec<f32> = depths.iter().filter(|&&z| z > 0.0).map(|z| 1.0 / z).collect();
    near.sort_unstable_by(f32::total_cmp);
    let at = |p: f64| near[(p * (near.len() - 1) as f64).round() as usize];
    let (low, high) = if near.is_empty() { (0.0, 1.0) } else { (at(0.01), at(0.99)) };
    let grey = |z: f32| {
        // A view with a single depth is white.
        let t = if high > low { ((1.0 / z - low) / (high - low)).clamp(0.0, 1.0) } else { 1.0 };
        FARTHEST_GREY + (1.0 - FARTHEST_GREY) * t
    };
    depths.iter().map(|&z| if z > 0.0 { grey(z) } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_becomes_srgb_value_by_value() {
        let found = encoded(&[0.0, 1.0, 0.5]);
        // IEC 61966-2-1: 1.055 · 0.5^(1/2.4) − 0.055.
        assert!(found[0] == 0.0 && (found[1] - 1.0).abs() < 1e-6 && (found[2] - 0.735_357).abs() < 1e-5, "{found:?}");
    }

    #[test]
    fn depth_is_white_near_dark_far_and_black_where_there_is_none() {
        let mut depths: Vec<f32> = (0..1000).map(|i| 1.0 + i as f32 * 0.01).collect();
        depths.push(0.0);
        let grey = depth_grey(&depths);
        assert_eq!((grey[0], grey[999], grey[1000]), (1.0, FARTHEST_GREY, 0.0));
        assert!(grey[..1000].is_sorted_by(|a, b| a >= b));
        assert_eq!(depth_grey(&[2.0, 0.0]), [1.0, 0.0]);
        assert_eq!(depth_grey(&[0.0]), [0.0]);
        assert!(depth_grey(&[]).is_empty());
    }
}
