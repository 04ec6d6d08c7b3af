//! Renders a scene, which stays on the device after its first render.

use glam::DVec3;
use glint::{
    gpu::Context,
    pipelines::{
        model::{Model, Room},
        render::{Needs, RenderOptions, Rendered, Renderer, Show},
        session::Policy,
        views::{Views, origin_around},
    },
    scene::{Camera, Scene},
};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::{Failure, device, scene};

/// A scene on a device, with the renderer of its last view.
pub struct OnDevice {
    device: Option<String>,
    context: Context,
    model: Model,
    renderer: Option<(Made, Renderer)>,
}

/// The settings that a renderer is made for.
#[derive(PartialEq)]
struct Made {
    size: [u32; 2],
    depth: bool,
    compensate: bool,
}

/// Origin of the device's coordinates: other than the file's for a scene that is far from its origin.
fn origin_of(scene: &Scene) -> DVec3 {
    let means = || scene.base.means.iter().map(|mean| DVec3::from_array(mean.map(f64::from)));
    let middle = means().sum::<DVec3>() / means().count().max(1) as f64;
    let spread = means().map(|mean| mean.distance(middle)).fold(0.0, f64::max);
    scene.origin + origin_around(middle, spread)
}

impl OnDevice {
    fn new(scene: &Scene, context: Context, device: Option<&str>) -> Result<Self, Failure> {
        let model = Model::upload_around(&context, origin_of(scene), scene, Room::default())?;
        Ok(OnDevice { device: device.map(str::to_owned), context, model, renderer: None })
    }

    fn render(
        &mut self,
        camera: &Camera,
        background: [f32; 3],
        depth: bool,
        compensate: bool,
    ) -> Result<Rendered, Failure> {
        let OnDevice { context, model, renderer, .. } = self;
        let views = Views::upload_around(context, model.origin, &[*camera], &[])?;
        let made = Made { size: [camera.width, camera.height], depth, compensate };
        if renderer.as_ref().is_none_or(|(found, _)| *found != made) {
            // Frees the old one's memory first.
            *renderer = None;
            let policy = Policy { compensate, ..Policy::default() };
            let options = RenderOptions { depth, policy, ..Default::default() };
            *renderer = Some((made, Renderer::new(context, Needs::of(model), &views, options)?));
        }
        match renderer {
            Some((_, renderer)) => Ok(renderer.render_shown(model, &views, 0, &Show::all(model, background))?),
            None => unreachable!("a renderer was made"),
        }
    }
}

/// Image, alpha and depth of one view.
type Pictures<'py> = (Bound<'py, PyArray3<f32>>, Bound<'py, PyArray2<f32>>, Option<Bound<'py, PyArray2<f32>>>);

#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "the arguments of `render`")]
pub fn render<'py>(
    py: Python<'py>,
    scene: &scene::Scene,
    width: u32,
    height: u32,
    k: PyReadonlyArray2<'py, f64>,
    viewmat: PyReadonlyArray2<'py, f64>,
    background: Option<[f32; 3]>,
    compensate: Option<bool>,
    depth: bool,
    device: Option<String>,
) -> PyResult<Pictures<'py>> {
    let camera = device::camera(width, height, k.as_slice()?, viewmat.as_slice()?)?;
    let trained_with = scene.file().trained_with;
    let background = background.or(trained_with.background).unwrap_or_default();
    let compensate = compensate.or(trained_with.antialiased).unwrap_or_default();
    let rendered = py.detach(|| {
        let context = device::context(device.as_deref())?;
        let mut kept = scene.device.lock().unwrap_or_else(|error| error.into_inner());
        if kept.as_ref().is_none_or(|kept| kept.device != device) {
            *kept = None;
            *kept = Some(OnDevice::new(&scene.file().scene, context, device.as_deref())?);
        }
        match kept.as_mut() {
            Some(kept) => kept.render(&camera, background, depth, compensate),
            None => unreachable!("the scene was uploaded"),
        }
    })?;
    let Rendered { color, mut transmittance, depth: depths, .. } = rendered;
    transmittance.iter_mut().for_each(|seen| *seen = 1.0 - *seen);
    let [rows, columns] = [height, width].map(|side| side as usize);
    let flat = |values: Vec<f32>| PyArray1::from_vec(py, values).reshape([rows, columns]);
    Ok((
        PyArray1::from_vec(py, color).reshape([rows, columns, 3])?,
        flat(transmittance)?,
        if depth { Some(flat(depths)?) } else { None },
    ))
}
