//! Reads SOG version 1, with ranges instead of codebooks.

use serde::{Deserialize, de::Error};

use super::{Coded, Images, Means, Meta, Palette, Tables};
use crate::data::TrainedWith;

#[derive(Deserialize)]
struct First {
    means: Ranges,
    scales: Ranges,
    quats: Images,
    sh0: Ranges,
    #[serde(rename = "shN")]
    sh_n: Option<OneRange>,
}

/// Ranges by channel.
#[derive(Deserialize)]
struct Ranges {
    #[serde(default)]
    shape: Vec<usize>,
    mins: Vec<f64>,
    maxs: Vec<f64>,
    files: Vec<String>,
}

/// One range for all channels.
#[derive(Deserialize)]
struct OneRange {
    mins: f64,
    maxs: f64,
    files: Vec<String>,
}

/// Converts a description of version 1 to version 2, with tables instead of codebooks.
pub(super) fn understand(text: &[u8]) -> Result<(Meta, Tables), serde_json::Error> {
    let First { means, scales, quats, sh0, sh_n } = serde_json::from_slice(text)?;
    let Some(&count) = means.shape.first() else {
        return Err(Error::custom("means have no `shape`, expected a count"));
    };
    let of = |what: &str, ranges: &Ranges, channel: usize| match (ranges.mins.get(channel), ranges.maxs.get(channel)) {
        (Some(&low), Some(&high)) => Ok([low, high]),
        _ => Err(serde_json::Error::custom(format!(
            "{what} have `mins` and `maxs` of {channel} channels, expected more"
        ))),
    };
    let three = |what, ranges: &Ranges| Ok([of(what, ranges, 0)?, of(what, ranges, 1)?, of(what, ranges, 2)?]);
    let positions: [[f64; 2]; 3] = three("means", &means)?;
    let tables = Tables {
        scales: three("scales", &scales)?.map(|range| evenly(range).to_vec()),
        colors: three("sh0", &sh0)?.map(|range| evenly(range).to_vec()),
        opacities: evenly(of("sh0", &sh0, 3)?),
    };
    let plain = |files| Coded { codebook: Vec::new(), files };
    let palette = |OneRange { mins, maxs, files }| {
        let codebook = evenly([mins, maxs]).to_vec();
        Palette { count: None, bands: None, codebook, files }
    };
    let [mins, maxs] = [0, 1].map(|end| positions.map(|range| range[end]));
    let meta = Meta {
        version: 1,
        count,
        antialias: false,
        origin: None,
        glint: TrainedWith::default(),
        means: Means { mins, maxs, files: means.files },
        scales: plain(scales.files),
        quats,
        sh0: plain(sh0.files),
        sh_n: sh_n.map(palette),
    };
    Ok((meta, tables))
}

/// Evenly spaced values of the bytes between two numbers.
fn evenly([low, high]: [f64; 2]) -> [f32; 256] {
    std::array::from_fn(|byte| (low + (high - low) * byte as f64 / 255.0) as f32)
}
