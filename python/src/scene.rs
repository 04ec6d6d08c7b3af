//! Scenes as Python sees them: read-only arrays over Rust's memory.

use std::sync::{Arc, Mutex};

use glam::DVec3;
use glint::{
    data::{SceneFile, TrainedWith, check_scene},
    scene::{
        self, Lobes, Supplement,
        layout::{BETAS, coefficients},
    },
};
use numpy::{
    PyArray, PyArrayDyn, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
    ndarray::{ArrayViewD, IxDyn},
};
use pyo3::prelude::*;

use crate::{Failure, bad, render::OnDevice};

/// Base or supplement of a scene.
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

/// A read-only array over memory that `owner` keeps.
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

#[pymethods]
impl Gaussians {
    #[new]
    #[pyo3(signature = (means, log_scales, quats, opacity_logits, sh, lobe_directions=None, lobe_widths=None, lobe_sharpness=None))]
    #[allow(clippy::too_many_arguments, reason = "an array each")]
    fn new(
        means: PyReadonlyArray2<'_, f32>,
        log_scales: PyReadonlyArray2<'_, f32>,
        quats: PyReadonlyArray2<'_, f32>,
        opacity_logits: PyReadonlyArray1<'_, f32>,
        sh: PyReadonlyArray3<'_, f32>,
        lobe_directions: Option<PyReadonlyArray2<'_, f32>>,
        lobe_widths: Option<PyReadonlyArray1<'_, f32>>,
        lobe_sharpness: Option<PyReadonlyArray1<'_, f32>>,
    ) -> PyResult<Self> {
        let k = sh.shape()[1];
        let degree = (0..=3).chain([BETAS]).find(|&degree| coefficients(degree) == k && sh.shape()[2] == 3);
        let Some(sh_degree) = degree else {
            return Err(bad(format!(
                "sh has shape {:?}, expected (N, 1, 3), (N, 4, 3), (N, 9, 3) or (N, 16, 3)",
                sh.shape()
            ))
            .into());
        };
        let rows = |array: &PyReadonlyArray2<'_, f32>, name| {
            let [_, columns] = array.shape() else { unreachable!("two dimensions") };
            match *columns {
                3 => Ok(bytemuck::cast_slice::<f32, [f32; 3]>(array.as_slice()?).to_vec()),
                _ => Err(PyErr::from(bad(format!("{name} has shape {:?}, expected (N, 3)", array.shape())))),
            }
        };
        if quats.shape()[1] != 4 {
            return Err(bad(format!("quats has shape {:?}, expected (N, 4)", quats.shape())).into());
        }
        let gaussians = scene::Gaussians {
            sh_degree,
            means: rows(&means, "means")?,
            log_scales: rows(&log_scales, "log_scales")?,
            quats: bytemuck::cast_slice(quats.as_slice()?).to_vec(),
            opacities: opacity_logits.as_slice()?.to_vec(),
            sh: bytemuck::cast_slice(sh.as_slice()?).to_vec(),
        };
        let scene = match (lobe_directions, lobe_widths, lobe_sharpness) {
            (None, None, None) => scene::Scene { base: gaussians, ..Default::default() },
            (Some(directions), Some(widths), Some(sharpness)) => {
                let lobes = Lobes {
                    directions: rows(&directions, "lobe_directions")?,
                    widths: widths.as_slice()?.to_vec(),
                    sharpness: sharpness.as_slice()?.to_vec(),
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

    #[getter]
    fn means<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let own = this.get().own();
        view(this, own.means.as_flattened(), &[own.len(), 3])
    }

    #[getter]
    fn log_scales<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let own = this.get().own();
        view(this, own.log_scales.as_flattened(), &[own.len(), 3])
    }

    #[getter]
    fn quats<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let own = this.get().own();
        view(this, own.quats.as_flattened(), &[own.len(), 4])
    }

    #[getter]
    fn opacity_logits<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let own = this.get().own();
        view(this, &own.opacities, &[own.len()])
    }

    #[getter]
    fn sh<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let own = this.get().own();
        view(this, own.sh.as_flattened(), &[own.len(), own.sh_coefficients(), 3])
    }

    #[getter]
    fn lobe_directions<'py>(this: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArrayDyn<f32>>>> {
        let lobes = this.get().supplement().map(|supplement| &supplement.lobes);
        lobes.map(|l| view(this, l.directions.as_flattened(), &[l.directions.len(), 3])).transpose()
    }

    #[getter]
    fn lobe_widths<'py>(this: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArrayDyn<f32>>>> {
        let lobes = this.get().supplement().map(|supplement| &supplement.lobes);
        lobes.map(|l| view(this, &l.widths, &[l.widths.len()])).transpose()
    }

    #[getter]
    fn lobe_sharpness<'py>(this: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArrayDyn<f32>>>> {
        let lobes = this.get().supplement().map(|supplement| &supplement.lobes);
        lobes.map(|l| view(this, &l.sharpness, &[l.sharpness.len()])).transpose()
    }

    /// The degree of the harmonics; None of spherical betas.
    #[getter]
    fn sh_degree(&self) -> Option<u32> {
        Some(self.own().sh_degree).filter(|&degree| degree != BETAS)
    }

    fn __len__(&self) -> usize {
        self.own().len()
    }

    fn __repr__(&self) -> String {
        let lobes = if self.has_lobes { ", with lobes" } else { "" };
        format!("<{} Gaussians, {} coefficients each{lobes}>", self.own().len(), self.own().sh_coefficients())
    }
}

/// A base, its supplement if it has one, and what its file says of its training.
#[pyclass(frozen, module = "glint_splat")]
pub struct Scene {
    file: Arc<SceneFile>,
    /// The scene on the device that has drawn it last.
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
        };
        check_scene(&scene)?;
        let trained_with = TrainedWith { background, antialiased, max_size, exposure: None };
        Ok(Scene::of(SceneFile { trained_with, ..scene.into() }))
    }

    #[getter]
    fn base(&self) -> Gaussians {
        Gaussians { file: Arc::clone(&self.file), has_lobes: false }
    }

    #[getter]
    fn supplement(&self) -> Option<Gaussians> {
        self.file.scene.supplement.as_ref().map(|_| Gaussians { file: Arc::clone(&self.file), has_lobes: true })
    }

    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.file.scene.origin.to_array()
    }

    #[getter]
    fn background(&self) -> Option<[f32; 3]> {
        self.file.trained_with.background
    }

    #[getter]
    fn antialiased(&self) -> Option<bool> {
        self.file.trained_with.antialiased
    }

    #[getter]
    fn max_size(&self) -> Option<u32> {
        self.file.trained_with.max_size
    }

    fn __repr__(&self) -> String {
        let supplement = self.file.scene.supplement.as_ref().map_or(0, |supplement| supplement.gaussians.len());
        format!("<Scene of {} Gaussians and {supplement} with lobes>", self.file.scene.base.len())
    }
}
