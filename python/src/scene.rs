//! Scenes as Python sees them: read-only arrays over Rust's memory.

use std::sync::{Arc, Mutex};

use glam::DVec3;
use glint::{
    data::{SceneFile, TrainedWith, check_scene},
    scene::{
        self, Lobes, Supplement,
        color::{self, MODELS},
        layout::coefficients,
    },
};
use numpy::{
    PyArray, PyArrayDyn, PyReadonlyArrayDyn, PyUntypedArrayMethods,
    ndarray::{ArrayViewD, IxDyn},
};
use pyo3::prelude::*;

use crate::{Failure, bad, check_each, render::OnDevice};

/// N Gaussians: the base of a scene, or with lobes its supplement. Arrays of numpy or any framework with
/// DLPack are copied, as float32.
///
/// means: (N, 3), centers, scene units.
/// log_scales: (N, 3), natural logarithms of standard deviations in scene units.
/// quats: (N, 4), w first, of any length but 0.
/// opacity_logits: (N,), logits of opacities.
/// sh: (N, K, 3), coefficients of spherical harmonics of degree 0 to 3, so that K is 1, 4, 9 or 16; or K = 5, spherical betas.
/// lobe_directions: (N, 3), from the Gaussian toward its best viewpoint, of any length but 0.
/// lobe_widths: (N,), 0.01 to 1; the lobe ends at this times 180 degrees.
/// lobe_sharpness: (N,), natural logarithms of the lobes' exponents.
///
/// A Gaussian has opacity 1 / (1 + exp(-logit)), and the color 0.5 + the sum of coefficients times harmonics in sRGB.
///
/// Raises InputError with the array's name for a wrong shape or a number that is not finite.
#[pyclass(frozen, module = "glint_splat")]
pub struct Gaussians {
    file: Arc<SceneFile>,
    has_lobes: bool,
}

impl Gaussians {
    fn own(&self) -> &scene::Gaussians {
        match self.supplement() {
            Some(supplement) => &supplement.gaussians,
            None => &self.file.scene.base,
        }
    }

    fn supplement(&self) -> Option<&Supplement> {
        self.file.scene.supplement.as_ref().filter(|_| self.has_lobes)
    }
}

/// A read-only array over the owner's memory.
fn view<'py, T: numpy::Element>(
    owner: &Bound<'py, Gaussians>,
    values: &[T],
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let array = ArrayViewD::from_shape(IxDyn(shape), values)
        .map_err(|error| PyErr::from(bad(format!("a scene's array: {error}"))))?;
    // SAFETY: the memory is the owner's, which never changes it and lives as long as the array.
    let array = unsafe { PyArray::borrow_from_array(&array, owner.clone().into_any()) };
    array.call_method1("setflags", (false,))?;
    Ok(array)
}

/// Contiguous float32 numbers of an array, of numpy or another framework.
fn host<'py>(name: &str, values: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f32>> {
    Ok(values.py().import("glint_splat")?.call_method1("_host", (name, values))?.extract()?)
}

/// Finite numbers of `n` Gaussians, each of which has a row of this shape.
fn rows<T: bytemuck::AnyBitPattern>(name: &str, array: &Bound<'_, PyAny>, n: usize, row: &[usize]) -> PyResult<Vec<T>> {
    let (array, shape) = (host(name, array)?, [&[n], row].concat());
    if array.shape() != shape {
        return Err(bad(format!("{name} has shape {:?}, expected {shape:?}", array.shape())).into());
    }
    let values = array.as_slice()?;
    check_each(name, values, n, f32::is_finite, "a finite number")?;
    Ok(bytemuck::cast_slice(values).to_vec())
}

#[pymethods]
impl Gaussians {
    #[new]
    #[pyo3(signature = (means, log_scales, quats, opacity_logits, sh, lobe_directions=None, lobe_widths=None, lobe_sharpness=None))]
    #[allow(clippy::too_many_arguments, reason = "an array each")]
    fn new(
        means: &Bound<'_, PyAny>,
        log_scales: &Bound<'_, PyAny>,
        quats: &Bound<'_, PyAny>,
        opacity_logits: &Bound<'_, PyAny>,
        sh: &Bound<'_, PyAny>,
        lobe_directions: Option<&Bound<'_, PyAny>>,
        lobe_widths: Option<&Bound<'_, PyAny>>,
        lobe_sharpness: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (means, sh) = (host("means", means)?, host("sh", sh)?);
        let n = means.shape().first().copied().unwrap_or(0);
        let means = rows("means", means.as_any(), n, &[3])?;
        let degree = (0..MODELS.len() as u32).find(|&degree| sh.shape() == [n, coefficients(degree), 3]);
        let Some(sh_degree) = degree else {
            return Err(bad(format!(
                "sh has shape {:?}, expected [{n}, K, 3], where K is 1, 4, 9 or 16, or 5 of spherical betas",
                sh.shape()
            ))
            .into());
        };
        let gaussians = scene::Gaussians {
            sh_degree,
            means,
            log_scales: rows("log_scales", log_scales, n, &[3])?,
            quats: rows("quats", quats, n, &[4])?,
            opacities: rows("opacity_logits", opacity_logits, n, &[])?,
            sh: rows("sh", sh.as_any(), n, &[coefficients(sh_degree), 3])?,
        };
        let scene = match (lobe_directions, lobe_widths, lobe_sharpness) {
            (None, None, None) => scene::Scene { base: gaussians, ..Default::default() },
            (Some(directions), Some(widths), Some(sharpness)) => {
                let lobes = Lobes {
                    directions: rows("lobe_directions", directions, n, &[3])?,
                    widths: rows("lobe_widths", widths, n, &[])?,
                    sharpness: rows("lobe_sharpness", sharpness, n, &[])?,
                };
                let base = scene::Gaussians { sh_degree, ..Default::default() };
                scene::Scene { base, supplement: Some(Supplement { gaussians, lobes }), ..Default::default() }
            }
            _ => return Err(bad("lobes have directions, widths and sharpness: expected all three or none").into()),
        };
        check_scene(&scene).map_err(Failure::from)?;
        let has_lobes = scene.supplement.is_some();
        Ok(Gaussians { file: Arc::new(scene.into()), has_lobes })
    }

    /// (N, 3), float32: centers, scene units. A read-only view, as all arrays of a scene.
    #[getter]
    fn means<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let own = this.get().own();
        view(this, own.means.as_flattened(), &[own.len(), 3])
    }

    /// (N, 3), float32: natural logarithms of standard deviations in scene units.
    #[getter]
    fn log_scales<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let own = this.get().own();
        view(this, own.log_scales.as_flattened(), &[own.len(), 3])
    }

    /// (N, 4), float32: rotations, w first, of any length but 0.
    #[getter]
    fn quats<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let own = this.get().own();
        view(this, own.quats.as_flattened(), &[own.len(), 4])
    }

    /// (N,), float32: logits of opacities.
    #[getter]
    fn opacity_logits<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let own = this.get().own();
        view(this, &own.opacities, &[own.len()])
    }

    /// (N, K, 3), float32: coefficients of spherical harmonics, or of spherical betas if K is 5.
    #[getter]
    fn sh<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let own = this.get().own();
        view(this, own.sh.as_flattened(), &[own.len(), own.sh_coefficients(), 3])
    }

    /// (N, 3), float32: from the Gaussian toward its best viewpoint, of any length but 0. None without lobes.
    #[getter]
    fn lobe_directions<'py>(this: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArrayDyn<f32>>>> {
        let lobes = this.get().supplement().map(|supplement| &supplement.lobes);
        lobes.map(|l| view(this, l.directions.as_flattened(), &[l.directions.len(), 3])).transpose()
    }

    /// (N,), float32: 0.01 to 1; the lobe ends at this times 180 degrees. None without lobes.
    #[getter]
    fn lobe_widths<'py>(this: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArrayDyn<f32>>>> {
        let lobes = this.get().supplement().map(|supplement| &supplement.lobes);
        lobes.map(|l| view(this, &l.widths, &[l.widths.len()])).transpose()
    }

    /// (N,), float32: natural logarithms of the lobes' exponents. None without lobes.
    #[getter]
    fn lobe_sharpness<'py>(this: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArrayDyn<f32>>>> {
        let lobes = this.get().supplement().map(|supplement| &supplement.lobes);
        lobes.map(|l| view(this, &l.sharpness, &[l.sharpness.len()])).transpose()
    }

    /// Degree of the harmonics, 0 to 3; None of spherical betas.
    #[getter]
    fn sh_degree(&self) -> Option<u32> {
        color::of(self.own().sh_degree).harmonics
    }

    fn __len__(&self) -> usize {
        self.own().len()
    }

    fn __repr__(&self) -> String {
        let lobes = if self.has_lobes { ", with lobes" } else { "" };
        format!("<{} Gaussians, {} coefficients each{lobes}>", self.own().len(), self.own().sh_coefficients())
    }
}

/// A base, its supplement if it has one, and the settings that it was trained with. `load` makes scenes of files.
///
/// base: Gaussians without lobes.
/// supplement: Gaussians with lobes, or None.
/// origin: the scene's origin in the world, scene units; three float64 numbers.
/// background: three sRGB values from 0 to 1 behind the photos; None if unknown, as are the next two.
/// antialiased: whether Gaussians smaller than a pixel fade.
/// max_size: longest side of the photos, pixels.
///
/// Raises InputError if the base has lobes or the supplement has none.
#[pyclass(frozen, module = "glint_splat")]
pub struct Scene {
    file: Arc<SceneFile>,
    /// The scene on the device that rendered it last.
    pub device: Mutex<Option<OnDevice>>,
}

impl Scene {
    pub fn of(file: SceneFile) -> Self {
        Scene { file: Arc::new(file), device: Mutex::new(None) }
    }

    pub fn file(&self) -> &SceneFile {
        &self.file
    }
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (base, supplement=None, *, origin=[0.0; 3], background=None, antialiased=None, max_size=None))]
    fn new(
        base: &Gaussians,
        supplement: Option<&Gaussians>,
        origin: [f64; 3],
        background: Option<[f32; 3]>,
        antialiased: Option<bool>,
        max_size: Option<u32>,
    ) -> Result<Self, Failure> {
        if base.has_lobes || supplement.is_some_and(|supplement| !supplement.has_lobes) {
            return Err(bad("a scene: expected a base without lobes and a supplement with them"));
        }
        let scene = scene::Scene {
            base: base.own().clone(),
            supplement: supplement.and_then(Gaussians::supplement).cloned(),
            origin: DVec3::from_array(origin),
            ..scene::Scene::default()
        };
        check_scene(&scene)?;
        let trained_with = TrainedWith { background, antialiased, max_size, ..TrainedWith::default() };
        Ok(Scene::of(SceneFile { trained_with, ..scene.into() }))
    }

    /// Gaussians without lobes.
    #[getter]
    fn base(&self) -> Gaussians {
        Gaussians { file: Arc::clone(&self.file), has_lobes: false }
    }

    /// Gaussians with lobes; None if there are none.
    #[getter]
    fn supplement(&self) -> Option<Gaussians> {
        self.file.scene.supplement.as_ref().map(|_| Gaussians { file: Arc::clone(&self.file), has_lobes: true })
    }

    /// The scene's origin in the world, scene units.
    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.file.scene.origin.to_array()
    }

    /// Three sRGB values from 0 to 1 behind the photos; None if unknown.
    #[getter]
    fn background(&self) -> Option<[f32; 3]> {
        self.file.trained_with.background
    }

    /// Whether Gaussians smaller than a pixel fade; None if unknown.
    #[getter]
    fn antialiased(&self) -> Option<bool> {
        self.file.trained_with.antialiased
    }

    /// Longest side of the photos, pixels; None if unknown.
    #[getter]
    fn max_size(&self) -> Option<u32> {
        self.file.trained_with.max_size
    }

    fn __repr__(&self) -> String {
        let supplement = self.file.scene.supplement.as_ref().map_or(0, |supplement| supplement.gaussians.len());
        format!("<Scene of {} Gaussians and {supplement} with lobes>", self.file.scene.base.len())
    }
}
