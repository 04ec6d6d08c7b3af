//! A scene on the device: the parameter planes that every stage reads.

use glam::DVec3;

use super::views::Views;
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Context, GpuError},
    scene::{Gaussians, Lobes, Scene, Supplement},
    stages::types::Lift,
};

/// Planes of `geometry`: mean, log scale, quaternion, opacity.
pub const GEOMETRY_PLANES: usize = 11;
/// Planes of `lobes`: direction, width, sharpness.
pub const LOBE_PLANES: usize = 5;

/// Base Gaussians first, supplementary ones after them; see the buffer table of ARCHITECTURE.md.
#[derive(Clone)]
pub struct Model {
    pub geometry: Buffer<f32>,
    pub sh: Buffer<f32>,
    pub lobes: Buffer<f32>,
    /// Gaussians that a plane has room for.
    pub stride: u32,
    /// Supplementary Gaussians that a plane of `lobes` has room for.
    pub lobe_stride: u32,
    pub base_count: u32,
    pub supplement_count: u32,
    pub sh_degree: u32,
    /// Where the device's coordinates begin, in the world: means are relative to it.
    pub origin: DVec3,
}

impl Model {
    /// Copies `scene` to the device, with room for `spare` more supplementary Gaussians.
    ///
    /// # Errors
    /// [`GpuError::BufferTooLarge`] where the planes do not fit into one buffer of the device.
    pub fn upload(context: &Context, scene: &Scene, spare: usize) -> Result<Self, GpuError> {
        Self::upload_around(context, DVec3::ZERO, scene, spare)
    }

    /// In coordinates that count from `origin`, the views' own.
    pub fn upload_around(context: &Context, origin: DVec3, scene: &Scene, spare: usize) -> Result<Self, GpuError> {
        let empty = Supplement::default();
        let supplement = scene.supplement.as_ref().unwrap_or(&empty);
        let (n, m) = (scene.base.len(), supplement.gaussians.len());
        let (stride, lobe_stride) = (n + m + spare, m + spare);
        let coefficients = scene.base.sh_coefficients();
        let mut geometry = vec![0f32; GEOMETRY_PLANES * stride];
        let mut sh = vec![0f32; 3 * coefficients * stride];
        let mut lobes = vec![0f32; LOBE_PLANES * lobe_stride];
        for (from, first) in [(&scene.base, 0), (&supplement.gaussians, n)] {
            for i in 0..from.len() {
                let at = first + i;
                for c in 0..3 {
                    geometry[c * stride + at] = (f64::from(from.means[i][c]) - origin[c]) as f32;
                    geometry[(3 + c) * stride + at] = from.log_scales[i][c];
                }
                for c in 0..4 {
                    geometry[(6 + c) * stride + at] = from.quats[i][c];
                }
                geometry[10 * stride + at] = from.opacities[i];
                for k in 0..coefficients.min(from.sh_coefficients()) {
                    for c in 0..3 {
                        sh[(3 * k + c) * stride + at] = from.sh[i * from.sh_coefficients() + k][c];
                    }
                }
            }
        }
        for j in 0..m {
            for c in 0..3 {
                lobes[c * lobe_stride + j] = supplement.lobes.directions[j][c];
            }
            lobes[3 * lobe_stride + j] = supplement.lobes.widths[j];
            lobes[4 * lobe_stride + j] = supplement.lobes.sharpness[j];
        }
        Ok(Model {
            geometry: Buffer::from_slice(context, "geometry", &geometry)?,
            sh: Buffer::from_slice(context, "sh", &sh)?,
            lobes: Buffer::from_slice(context, "lobes", &lobes)?,
            stride: stride as u32,
            lobe_stride: lobe_stride as u32,
            base_count: n as u32,
            supplement_count: m as u32,
            sh_degree: scene.base.sh_degree,
            origin,
        })
    }

    /// Fails where `views` count from another origin.
    pub fn check_origin(&self, views: &Views) -> Result<()> {
        match self.origin == views.origin {
            true => Ok(()),
            false => {
                Err(Error::Usage(format!("the model counts from {}, the views from {}", self.origin, views.origin)))
            }
        }
    }

    /// Gaussians in all.
    pub fn count(&self) -> u32 {
        self.base_count + self.supplement_count
    }

    /// SH coefficients that are stored for each Gaussian.
    pub fn coefficients(&self) -> u32 {
        (self.sh_degree + 1).pow(2)
    }

    /// Appends what was lifted, plane by plane, and waits; how many there was room for is the answer. Entries that are no lift
    /// (`cluster_size` 0) are passed over. What `lift_append` does on the device, for lifts that come from a file.
    pub fn append(&mut self, lifts: &[Lift]) -> Result<u32, GpuError> {
        let room = (self.lobe_stride - self.supplement_count) as usize;
        let lifts: Vec<&Lift> = lifts.iter().filter(|l| l.cluster_size > 0).take(room).collect();
        let (first, lobe_first) = (self.count() as usize, self.supplement_count as usize);
        let (stride, lobe_stride) = (self.stride as usize, self.lobe_stride as usize);
        let values = |of: &dyn Fn(&Lift) -> f32| lifts.iter().map(|&l| of(l)).collect::<Vec<f32>>();
        let zeros = vec![0.0; lifts.len()];
        for c in 0..3 {
            self.geometry.upload(c * stride + first, &values(&|l| l.mean[c]))?;
            self.geometry.upload((3 + c) * stride + first, &values(&|l| l.log_scale[c]))?;
            self.sh.upload(c * stride + first, &values(&|l| l.dc[c]))?;
            self.lobes.upload(c * lobe_stride + lobe_first, &values(&|l| l.lobe_dir[c]))?;
        }
        for c in 0..4 {
            self.geometry.upload((6 + c) * stride + first, &values(&|l| l.quat[c]))?;
        }
        self.geometry.upload(10 * stride + first, &values(&|l| l.opacity))?;
        for plane in 3..3 * self.coefficients() as usize {
            self.sh.upload(plane * stride + first, &zeros)?;
        }
        self.lobes.upload(3 * lobe_stride + lobe_first, &values(&|l| l.lobe_width))?;
        self.lobes.upload(4 * lobe_stride + lobe_first, &zeros)?;
        self.supplement_count += lifts.len() as u32;
        Ok(lifts.len() as u32)
    }

    /// Copies the scene back to the host, and waits.
    pub fn download(&self) -> Result<Scene> {
        let (geometry, sh, lobes) = (self.geometry.download()?, self.sh.download()?, self.lobes.download()?);
        let (stride, coefficients) = (self.stride as usize, self.coefficients() as usize);
        let gaussians = |first: usize, count: usize| {
            let plane = |p: usize, i: usize| geometry[p * stride + i];
            let range = first..first + count;
            Gaussians {
                sh_degree: self.sh_degree,
                means: range
                    .clone()
                    .map(|i| [0, 1, 2].map(|p| (f64::from(plane(p, i)) + self.origin[p]) as f32))
                    .collect(),
                log_scales: range.clone().map(|i| [3, 4, 5].map(|p| plane(p, i))).collect(),
                quats: range.clone().map(|i| [6, 7, 8, 9].map(|p| plane(p, i))).collect(),
                opacities: range.clone().map(|i| plane(10, i)).collect(),
                sh: range
                    .flat_map(|i| (0..coefficients).map(move |k| (i, k)))
                    .map(|(i, k)| [0, 1, 2].map(|c| sh[(3 * k + c) * stride + i]))
                    .collect(),
            }
        };
        let (n, m, lobe_stride) = (self.base_count as usize, self.supplement_count as usize, self.lobe_stride as usize);
        let lobe = |p: usize, j: usize| lobes[p * lobe_stride + j];
        let supplement = (m > 0).then(|| Supplement {
            gaussians: gaussians(n, m),
            lobes: Lobes {
                directions: (0..m).map(|j| [0, 1, 2].map(|p| lobe(p, j))).collect(),
                widths: (0..m).map(|j| lobe(3, j)).collect(),
                sharpness: (0..m).map(|j| lobe(4, j)).collect(),
            },
        });
        Ok(Scene { base: gaussians(0, n), supplement })
    }
}
