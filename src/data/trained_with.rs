//! Training settings that a scene file keeps, since they affect drawing and evaluation.
//!
//! In PLY files they are comments: `SplatRenderMode: mip` or `default`, as in Brush's files (Postshot's
//! `antialiased 1` is read too), and glint's own `glint background R G B`, `glint max_size PIXELS`, `glint
//! exposure 1`, `glint matte 1` and `glint part 3 of 8 plan 1a2b3c4d complete`. SOG has an object `glint` next to its
//! `antialias`; glTF has one in the extras of a node. SPZ version 4 has one in an extension of glint's, next to
//! its flag for `antialiased`.

#[cfg(feature = "train")]
use serde::{Deserialize, Serialize};

/// Training settings of a scene; `None` for those that the file does not have.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "train", derive(Serialize, Deserialize), serde(default))]
pub struct TrainedWith {
    /// Background color of the scene: sRGB values from 0 to 1.
    #[cfg_attr(feature = "train", serde(skip_serializing_if = "Option::is_none"))]
    pub background: Option<[f32; 3]>,
    /// Whether Gaussians smaller than a pixel fade (`Policy::compensate`).
    #[cfg_attr(feature = "train", serde(skip_serializing_if = "Option::is_none"))]
    pub antialiased: Option<bool>,
    /// Maximum longer side of photos, pixels, if there was a limit.
    #[cfg_attr(feature = "train", serde(skip_serializing_if = "Option::is_none"))]
    pub max_size: Option<u32>,
    /// Whether each photo had its own color map, which the scene does not include.
    #[cfg_attr(feature = "train", serde(skip_serializing_if = "Option::is_none"))]
    pub exposure: Option<bool>,
    /// Whether training found that colors gain nothing by depending on the view.
    #[cfg_attr(feature = "train", serde(skip_serializing_if = "Option::is_none"))]
    pub matte: Option<bool>,
    /// The part of a plan that the scene is.
    #[cfg_attr(feature = "train", serde(skip_serializing_if = "Option::is_none"))]
    pub part: Option<PartOf>,
}

/// A part of a plan (`glint partition`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "train", derive(Serialize, Deserialize))]
pub struct PartOf {
    /// Checksum of the plan.
    pub plan: u32,
    /// Number of the part, from 0.
    pub part: u32,
    /// Number of parts.
    pub of: u32,
    /// Whether its training has ended.
    pub complete: bool,
}

impl TrainedWith {
    /// Reads a PLY header's comment, given without the word `comment`. Other comments are ignored.
    pub(super) fn read_comment(&mut self, words: &[&str]) {
        let flag = |text: &str| matches!(text, "0" | "1").then_some(text == "1");
        match *words {
            ["SplatRenderMode:", mode @ ("mip" | "default")] => self.antialiased = Some(mode == "mip"),
            ["antialiased", yes] => self.antialiased = flag(yes).or(self.antialiased),
            ["glint", "background", r, g, b] => {
                let [r, g, b] = [r, g, b].map(|text| text.parse().unwrap_or(f32::NAN));
                self.background = Some([r, g, b]);
            }
            ["glint", "max_size", pixels] => self.max_size = pixels.parse().ok(),
            ["glint", "exposure", yes] => self.exposure = flag(yes),
            ["glint", "matte", yes] => self.matte = flag(yes),
            ["glint", "part", part, "of", of, "plan", plan, end] => {
                self.part = PartOf::parse([part, of, plan], end == "complete");
            }
            _ => {}
        }
        *self = self.sound();
    }

    /// Drops invalid numbers.
    fn sound(self) -> Self {
        let color = |rgb: &[f32; 3]| rgb.iter().all(|v| (0.0..=1.0).contains(v));
        TrainedWith {
            background: self.background.filter(color),
            max_size: self.max_size.filter(|&pixels| pixels > 0),
            ..self
        }
    }
}

impl PartOf {
    fn parse([part, of, plan]: [&str; 3], complete: bool) -> Option<PartOf> {
        let plan = u32::from_str_radix(plan, 16).ok()?;
        Some(PartOf { plan, part: part.parse().ok()?, of: of.parse().ok()?, complete })
    }
}

impl std::fmt::Display for PartOf {
    /// Writes `3 of 8 plan 1a2b3c4d complete`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let end = if self.complete { "complete" } else { "unfinished" };
        write!(f, "{} of {} plan {:08x} {end}", self.part, self.of, self.plan)
    }
}

#[cfg(feature = "train")]
impl TrainedWith {
    /// Writes the comments that [`Self::read_comment`] reads.
    pub(super) fn write_comments(&self, out: &mut impl std::io::Write) -> std::io::Result<()> {
        let TrainedWith { background, antialiased, max_size, exposure, matte, part } = *self;
        if let Some(antialiased) = antialiased {
            writeln!(out, "comment SplatRenderMode: {}", if antialiased { "mip" } else { "default" })?;
        }
        if let Some([r, g, b]) = background {
            writeln!(out, "comment glint background {r} {g} {b}")?;
        }
        if let Some(pixels) = max_size {
            writeln!(out, "comment glint max_size {pixels}")?;
        }
        if let Some(exposure) = exposure {
            writeln!(out, "comment glint exposure {}", u8::from(exposure))?;
        }
        if let Some(matte) = matte {
            writeln!(out, "comment glint matte {}", u8::from(matte))?;
        }
        part.map_or(Ok(()), |part| writeln!(out, "comment glint part {part}"))
    }

    /// [`Self::from_json`] in the form that serde requires.
    ///
    /// # Errors
    /// If it is not JSON at all.
    #[cfg(feature = "formats")]
    pub(super) fn deserialize_leniently<'a, D: serde::Deserializer<'a>>(from: D) -> Result<Self, D::Error> {
        let value = serde_json::Value::deserialize(from)?;
        Ok(Self::from_json(&value))
    }

    /// Reads an object that another program may have written; ignores invalid members.
    pub(crate) fn from_json(value: &serde_json::Value) -> Self {
        Self::deserialize(value).unwrap_or_default().sound()
    }

    /// These settings for a scene whose training has ended, or not.
    pub fn ended(mut self, complete: bool) -> Self {
        self.part = self.part.map(|part| PartOf { complete, ..part });
        self
    }

    /// Whether no setting is known.
    pub fn is_unknown(&self) -> bool {
        *self == Self::default()
    }

    /// Options of `glint` for the settings that a format does not keep; `flag`: the format has a flag for
    /// antialiasing.
    pub(super) fn options_beyond(&self, flag: bool) -> Vec<String> {
        let TrainedWith { background, antialiased, max_size, .. } = *self;
        let background = background.filter(|rgb| *rgb != [0.0; 3]).map(|[r, g, b]| format!("--background {r},{g},{b}"));
        let compensate = antialiased.filter(|&yes| yes && !flag).map(|_| "--compensate".to_owned());
        let max_size = max_size.map(|pixels| format!("--max-size {pixels}"));
        [background, compensate, max_size].into_iter().flatten().collect()
    }
}

#[cfg(all(test, feature = "train"))]
mod tests {
    use super::*;

    fn read(comments: &str) -> TrainedWith {
        let mut found = TrainedWith::default();
        comments.lines().for_each(|line| found.read_comment(&line.split_whitespace().skip(1).collect::<Vec<_>>()));
        found
    }

    #[test]
    fn comments_come_back() {
        let all = TrainedWith {
            background: Some([1.0, 0.1, 0.0]),
            antialiased: Some(true),
            max_size: Some(400),
            exposure: Some(true),
            matte: Some(true),
            part: Some(PartOf { plan: 0xfe, part: 3, of: 8, complete: true }),
        };
        for trained in [all, TrainedWith { antialiased: Some(false), ..all }, TrainedWith::default()] {
            let mut written = Vec::new();
            trained.write_comments(&mut written).unwrap();
            assert_eq!(read(&String::from_utf8(written).unwrap()), trained);
            assert_eq!(TrainedWith::from_json(&serde_json::to_value(trained).unwrap()), trained);
        }
    }

    #[test]
    fn what_others_write_is_read_and_what_is_wrong_is_passed_over() {
        assert_eq!(read("comment antialiased 1").antialiased, Some(true));
        assert_eq!(read("comment antialiased 0\ncomment SplatRenderMode: 2dgs").antialiased, Some(false));
        let wrong = "comment glint background 1 nan 1\ncomment glint max_size 0\ncomment glint exposure maybe\ncomment glint matte 2\ncomment antialiased yes\ncomment glint part 3 of x plan 1 complete";
        assert_eq!(read(wrong), TrainedWith::default());
        for json in ["5", "{\"background\": [2, 0, 0]}", "{\"background\": \"white\"}", "{\"max_size\": -1}", "null"] {
            assert!(TrainedWith::from_json(&serde_json::from_str(json).unwrap()).is_unknown(), "{json}");
        }
    }

    #[test]
    fn what_a_format_does_not_keep_is_named_as_options() {
        let trained = TrainedWith { background: Some([1.0; 3]), antialiased: Some(true), ..Default::default() };
        assert_eq!(trained.options_beyond(true), ["--background 1,1,1"]);
        assert_eq!(trained.options_beyond(false), ["--background 1,1,1", "--compensate"]);
        let plain = TrainedWith {
            background: Some([0.0; 3]),
            antialiased: Some(false),
            exposure: Some(true),
            ..Default::default()
        };
        assert!(plain.options_beyond(false).is_empty());
    }
}
