//! Plan for rendering a scene, computed before anything is allocated: features compiled and left out, with
//! reasons, and memory.

use std::fmt;

use serde::Serialize;

use crate::{
    Error, Result,
    gpu::DeviceInfo,
    pipelines::{
        frames::Limits,
        learn::{moment_planes, sh_moments},
        model::{Model, Room, Segment},
        plan::{Plan, Planned},
        render::Needs,
    },
    scene::{
        Scene, color,
        layout::{self, GEOMETRY_PLANES, LOBE_PLANES},
    },
};

/// Capability or data of rendering.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Feature {
    /// Name of the feature.
    pub name: &'static str,
    /// Whether it is compiled and stored.
    pub included: bool,
    /// Reason why it is included or left out.
    pub why: String,
    /// Device memory that it takes or would add, bytes (negative: would save).
    pub bytes: i64,
}

/// Plan for rendering a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RenderPlan {
    /// Name of the device; it determines the size of tiles.
    pub device: String,
    /// Width of a frame, pixels.
    pub width: u32,
    /// Height of a frame, pixels.
    pub height: u32,
    /// Frames in flight.
    pub in_flight: u32,
    /// Base and supplementary Gaussians.
    pub gaussians: u64,
    /// Bytes of a plain Gaussian in the model.
    pub plain_bytes: u64,
    /// Bytes of a Gaussian with a lobe in the model.
    pub lobed_bytes: u64,
    /// Bytes that frames hold for each Gaussian: its splat, its place in the order, four intersections with
    /// tiles.
    pub work_bytes: f64,
    /// Bytes that frames hold for each pixel.
    pub pixel_bytes: f64,
    /// Bytes in all.
    pub bytes: u64,
    /// Features included and left out.
    pub features: Vec<Feature>,
    /// Buffers of the scene.
    pub model: Vec<Planned>,
    /// Buffers shared by all frames.
    pub frames: Vec<Planned>,
}

impl RenderPlan {
    /// Plan for one view of `width` × `height` pixels, of half width if `half`.
    ///
    /// # Errors
    /// [`Error::Usage`] if such a view is impossible.
    pub fn of(device: &DeviceInfo, scene: &Scene, [width, height]: [u32; 2], half: bool) -> Result<RenderPlan> {
        let model_of = |half| Model::plan(device, scene, Room { half, ..Default::default() });
        let limits = Limits::for_needs(Needs::of_scene(scene, half), width, height);
        let frames_of = |half| Limits { half, ..limits.clone() }.plan(device);
        let (model, frames) = (model_of(half), frames_of(half)?);
        let more = |change: &dyn Fn(&mut Limits)| {
            let mut other = limits.clone();
            change(&mut other);
            Ok::<_, Error>(difference(&other.plan(device)?, &frames))
        };
        let counts = Counts::of(scene);
        let Counts { degree, lobe_degree, supplementary, .. } = counts;
        let gaussians = counts.base + supplementary;
        let room = Room { half, ..Default::default() };
        let harmonics = |degree| room.bytes(Segment::Base, degree)[1];
        let [geometry, _, lobe] = room.bytes(Segment::Supplement, lobe_degree);
        let all = |bytes: u64| (bytes * gaussians) as i64;
        let mut features = vec![feature("geometry", true, format!("{geometry} bytes a Gaussian"), all(geometry))];
        features.extend(counts.color_features(harmonics));
        let halved = difference(&model_of(true).and(frames_of(true)?), &model_of(false).and(frames_of(false)?));
        features.extend([
            match half {
                true => {
                    feature("half width", true, "colors are 16-bit floats, rotations and scales packed".into(), halved)
                }
                false => {
                    feature("half width", false, "all numbers are 32-bit floats; --half changes that".into(), halved)
                }
            },
            match supplementary {
                0 => feature("lobes", false, format!("the scene has no supplement; {lobe} bytes a Gaussian"), 0),
                _ => {
                    let why = format!("{supplementary} Gaussians have one, of {lobe} bytes");
                    feature("lobes", true, why, (supplementary * lobe) as i64)
                }
            },
            feature("depths and ids of pixels", false, "no view asks for them".into(), more(&|l| l.depth_out = true)?),
            feature("depths that hide", false, "no mesh is drawn before".into(), more(&|l| l.depth_in = true)?),
            feature(
                "background image",
                false,
                "one color, or blended over the target".into(),
                16 * i64::from(width) * i64::from(height),
            ),
            feature("moments of what learns", false, "nothing learns while it is rendered".into(), {
                let beside = |planes| layout::bytes(moment_planes(planes, false));
                all(beside(GEOMETRY_PLANES))
                    + counts.bytes(|degree| layout::bytes(sh_moments(degree, false, color::of(degree).newton)))
                    + (supplementary * beside(LOBE_PLANES)) as i64
            }),
        ]);
        let bytes = model.bytes() + frames.bytes();
        let many = 1 << 20;
        let work_bytes = more(&|l| l.gaussians = l.gaussians.saturating_add(many))? as f64 / f64::from(many);
        let pixels = f64::from(width) * f64::from(height);
        Ok(RenderPlan {
            device: device.name.clone(),
            width,
            height,
            in_flight: limits.in_flight,
            gaussians,
            plain_bytes: geometry + harmonics(degree),
            lobed_bytes: geometry + harmonics(lobe_degree) + lobe,
            work_bytes,
            pixel_bytes: (frames.bytes() as f64 - work_bytes * gaussians as f64) / pixels,
            bytes,
            features,
            model: model.0,
            frames: frames.0,
        })
    }
}

fn feature(name: &'static str, included: bool, why: String, bytes: i64) -> Feature {
    Feature { name, included, why, bytes }
}

/// Numbers of Gaussians without and with lobes, and the color models of both.
struct Counts {
    base: u64,
    supplementary: u64,
    degree: u32,
    lobe_degree: u32,
}

impl Counts {
    fn of(scene: &Scene) -> Counts {
        let (base, degree) = (scene.base.len() as u64, scene.base.sh_degree);
        let lobed = scene.supplement.as_ref().map(|supplement| &supplement.gaussians);
        Counts {
            base,
            supplementary: lobed.map_or(0, |gaussians| gaussians.len() as u64),
            degree,
            lobe_degree: lobed.map_or(degree, |gaussians| gaussians.sh_degree),
        }
    }

    /// Bytes of all Gaussians, from those of one by color model.
    fn bytes(&self, of: impl Fn(u32) -> u64) -> i64 {
        (of(self.degree) * self.base + of(self.lobe_degree) * self.supplementary) as i64
    }

    /// The colors that the scene has, and the harmonics that it lacks; `harmonics` gives the bytes of a Gaussian by color model.
    fn color_features(&self, harmonics: impl Fn(u32) -> u64) -> Vec<Feature> {
        let &Counts { degree, lobe_degree, supplementary, .. } = self;
        let colors = color::of(degree);
        let (name, own) = match colors.harmonics {
            None => (colors.group, colors.name.to_owned()),
            Some(_) => ("harmonics", format!("the scene's degree is {degree}")),
        };
        let why = match lobe_degree == degree || supplementary == 0 {
            true => format!("{own}: {} bytes a Gaussian", harmonics(degree)),
            false => format!(
                "the base's degree is {degree}, {} bytes a Gaussian; the supplement's {lobe_degree}, {} bytes",
                harmonics(degree),
                harmonics(lobe_degree)
            ),
        };
        let mut features = vec![feature(name, true, why, self.bytes(&harmonics))];
        let more = |degree| harmonics(3) - harmonics(degree);
        if degree < 3 {
            let why = format!("the scene has none; {} bytes a Gaussian", more(degree));
            features.push(feature("harmonics up to degree 3", false, why, self.bytes(more)));
        } else if lobe_degree < 3 && supplementary > 0 {
            let why = format!("the supplement has none; {} bytes a Gaussian", more(lobe_degree));
            features.push(feature("harmonics of lobes, degree 3", false, why, self.bytes(more)));
        }
        features
    }
}

fn difference(a: &Plan, b: &Plan) -> i64 {
    a.bytes() as i64 - b.bytes() as i64
}

impl fmt::Display for RenderPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mb = |bytes: i64| bytes as f64 / 1e6;
        let RenderPlan { width, height, device, .. } = self;
        writeln!(f, "plan            one view of {width} × {height} pixels, {} frames in flight", self.in_flight)?;
        writeln!(f, "device          {device}")?;
        for (title, included) in [("compiled and stored", true), ("left out", false)] {
            writeln!(f, "{title}")?;
            for Feature { name, why, bytes, .. } in self.features.iter().filter(|x| x.included == included) {
                writeln!(f, "  {name:<29} {:>+10.3} MB  {why}", mb(*bytes))?;
            }
        }
        let (plain, lobed, work) = (self.plain_bytes, self.lobed_bytes, self.work_bytes);
        writeln!(f, "a Gaussian      {plain} bytes, with a lobe {lobed}; in frames {work:.0} more")?;
        writeln!(f, "a pixel         {:.0} bytes", self.pixel_bytes)?;
        for (title, buffers) in [("model", &self.model), ("frames", &self.frames)] {
            writeln!(f, "{title:<16}{:.3} MB", mb(buffers.iter().map(Planned::bytes).sum::<u64>() as i64))?;
            for b in buffers.iter() {
                writeln!(f, "  {:<22} {:>12} × {:>3} = {:>13} bytes", b.name, b.elements, b.element_bytes, b.bytes())?;
            }
        }
        writeln!(f, "in all          {:.3} MB for {} Gaussians", mb(self.bytes as i64), self.gaussians)
    }
}
