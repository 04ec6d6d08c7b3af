//! Writes scenes to PLY files, as `ply` reads them.

use std::io::Write;
use std::path::Path;

use super::atomic::write_whole;
use super::ply::{ANNOUNCED, BASE, DC, FIXED, LEARNED, LOBE, SHAPE, SUPPLEMENT, beyond};
use super::ply_format::write_comments;
use super::scene_file::SceneFile;
use super::sound;
use super::trained_with::TrainedWith;
use crate::scene::{Gaussians, Lobes, Scene, layout};
use crate::{Error, Result};

/// Writes `scene` as binary little-endian PLY in the reference trainer's order, the supplement (if any) behind it.
/// Every float comes back bit for bit. The file appears whole or not at all.
pub fn write_scene(path: impl AsRef<Path>, scene: &Scene) -> Result<()> {
    write(path.as_ref(), &scene.base, scene, &TrainedWith::default())
}

/// The same of a scene whose base begins with what became of what others show: they find that, [`super::read_scene`] gives the scene. Both
/// count from the scene's origin.
///
/// # Errors
/// [`Error::Usage`] where the base has fewer Gaussians than what is shown, or another SH degree, or a number that is not finite.
pub(super) fn write_file(path: &Path, file: &SceneFile) -> Result<()> {
    write(path, file.shown.as_ref().unwrap_or(&file.scene.base), &file.scene, &file.trained_with)
}

fn write(path: &Path, original: &Gaussians, scene: &Scene, trained_with: &TrainedWith) -> Result<()> {
    let refuse = |what| Error::Usage(format!("{}: this scene cannot be written: {what}", path.display()));
    sound::check(scene).map_err(refuse)?;
    if original.len() > scene.base.len() || original.sh_degree != scene.base.sh_degree {
        return Err(refuse("it does not begin with the Gaussians of the original".into()));
    }
    let vertex = Rows::whole(original, None);
    let learned = Rows::changed(original, &scene.base);
    let supplement = scene.supplement.as_ref().map(|s| Rows::whole(&s.gaussians, Some(&s.lobes)));
    let elements = [(BASE, Some(vertex)), (SUPPLEMENT, supplement), (LEARNED, learned)];
    write_whole(path, |file| {
        writeln!(file, "ply\nformat binary_little_endian 1.0")?;
        write_comments(file, scene.origin, trained_with)?;
        for (name, rows) in &elements {
            let prefix = if *name == BASE { "" } else { ANNOUNCED };
            rows.iter().try_for_each(|rows| rows.write_header(file, prefix, name))?;
        }
        writeln!(file, "end_header")?;
        elements.iter().filter_map(|(_, rows)| rows.as_ref()).try_for_each(|rows| rows.write(file))
    })
}

/// Bytes that a Gaussian of the base or, `lobed`, of the supplement has in the file that [`write_scene`] makes; its header has 2 KB.
pub fn gaussian_bytes(sh_degree: u32, lobed: bool) -> u64 {
    // The constant band is among the fixed; a base has normals too.
    let beside = if lobed { LOBE.len() as u64 } else { 3 };
    4 * (FIXED.len() as u64 + beside + layout::sh_planes(sh_degree) as u64 - 3)
}

/// Bytes of the file that [`write_scene`] makes of a scene, but for its header.
pub fn scene_bytes(scene: &Scene) -> u64 {
    let of = |part: &Gaussians, lobed| part.len() as u64 * gaussian_bytes(part.sh_degree, lobed);
    of(&scene.base, false) + scene.supplement.as_ref().map_or(0, |supplement| of(&supplement.gaussians, true))
}

/// An element that is to be written.
pub(super) struct Rows<'a> {
    gaussians: &'a Gaussians,
    lobes: Option<&'a Lobes>,
    /// Which of [`FIXED`].
    fixed: Vec<usize>,
    /// As [`beyond`] has it.
    rest: bool,
    /// nx ny nz, all 0, as the reference trainer writes them and some readers want them.
    normals: bool,
}

impl<'a> Rows<'a> {
    pub(super) fn whole(gaussians: &'a Gaussians, lobes: Option<&'a Lobes>) -> Self {
        Rows { gaussians, lobes, fixed: (0..FIXED.len()).collect(), rest: true, normals: lobes.is_none() }
    }

    /// What `now` has that `before` has not; `None` where they are the same.
    fn changed(before: &Gaussians, now: &'a Gaussians) -> Option<Self> {
        let (kept, more) = (before.len(), now.len() > before.len());
        let differs = |p: usize| (0..kept).any(|i| fixed(before, i)[p].to_bits() != fixed(now, i)[p].to_bits());
        let bits = |g: &Gaussians, i: usize| bands(g, i).iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
        let rest = (0..kept).any(|i| bits(before, i) != bits(now, i))
            || (kept..now.len()).any(|i| bits(now, i).iter().any(|&bits| bits != 0));
        let fixed: Vec<usize> = (0..FIXED.len()).filter(|&p| more || differs(p)).collect();
        (rest || !fixed.is_empty()).then_some(Rows { gaussians: now, lobes: None, fixed, rest, normals: false })
    }

    fn write_header(&self, file: &mut impl Write, prefix: &str, name: &str) -> std::io::Result<()> {
        writeln!(file, "{prefix}element {name} {}", self.gaussians.len())?;
        let mut property = |name: &str| writeln!(file, "{prefix}property float {name}");
        let (head, tail): (Vec<usize>, Vec<usize>) = self.fixed.iter().partition(|&&p| p < DC);
        head.into_iter().try_for_each(|p| property(FIXED[p]))?;
        if self.normals {
            ["nx", "ny", "nz"].into_iter().try_for_each(&mut property)?;
        }
        tail.iter().filter(|&&p| p < SHAPE).try_for_each(|&p| property(FIXED[p]))?;
        if self.rest {
            let (prefix, order) = beyond(self.gaussians.sh_degree);
            (0..order.len()).try_for_each(|i| property(&format!("{prefix}{i}")))?;
        }
        tail.iter().filter(|&&p| p >= SHAPE).try_for_each(|&p| property(FIXED[p]))?;
        self.lobes.map_or(Ok(()), |_| LOBE.into_iter().try_for_each(&mut property))
    }

    pub(super) fn write(&self, file: &mut impl Write) -> std::io::Result<()> {
        let (_, order) = beyond(self.gaussians.sh_degree);
        let mut row: Vec<f32> = Vec::new();
        let mut bytes: Vec<u8> = Vec::new();
        for i in 0..self.gaussians.len() {
            let values = fixed(self.gaussians, i);
            row.clear();
            row.extend(self.fixed.iter().filter(|&&p| p < DC).map(|&p| values[p]));
            if self.normals {
                row.extend([0.0; 3]);
            }
            row.extend(self.fixed.iter().filter(|&&p| (DC..SHAPE).contains(&p)).map(|&p| values[p]));
            if self.rest {
                let rgb = bands(self.gaussians, i);
                row.extend(order.iter().map(|&[k, channel]| rgb[k - 1][channel]));
            }
            row.extend(self.fixed.iter().filter(|&&p| p >= SHAPE).map(|&p| values[p]));
            if let Some(lobes) = self.lobes {
                row.extend(lobes.directions[i]);
                row.extend([lobes.widths[i], lobes.sharpness[i]]);
            }
            bytes.clear();
            bytes.extend(row.iter().flat_map(|value| value.to_le_bytes()));
            file.write_all(&bytes)?;
        }
        Ok(())
    }
}

/// The values of [`FIXED`].
fn fixed(gaussians: &Gaussians, i: usize) -> [f32; FIXED.len()] {
    let ([x, y, z], [r, g, b]) = (gaussians.means[i], gaussians.sh[i * gaussians.sh_coefficients()]);
    let ([sx, sy, sz], [qw, qx, qy, qz]) = (gaussians.log_scales[i], gaussians.quats[i]);
    [x, y, z, r, g, b, gaussians.opacities[i], sx, sy, sz, qw, qx, qy, qz]
}

/// The coefficients above the constant one.
fn bands(gaussians: &Gaussians, i: usize) -> &[[f32; 3]] {
    let k = gaussians.sh_coefficients();
    &gaussians.sh[i * k + 1..(i + 1) * k]
}
