//! Rasterizes arrays and computes their gradients. The next call of the same shapes uses a call's buffers again.

use std::sync::Mutex;

use glam::DVec3;
use glint::{
    gpu::{Buffer, Context},
    pipelines::{
        learn::{Learner, Lesson, Seen},
        model::{Model, Planes, Room, Segment},
        render::{Needs, RenderOptions, Renderer, Show},
        session::Policy,
        views::Views,
    },
    scene::{
        Camera, Gaussians, SH_DC, Scene,
        layout::{GEOMETRY_PLANES, LOG_SCALE, MEAN, OPACITY, QUAT, coefficients, quads},
    },
    stages::{
        status::{self, Resource, Status},
        types::Page,
    },
};
use numpy::{
    PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArray4,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::{Failure, bad, check_each, device};

/// Rasterizers for the next calls.
static IDLE: Mutex<Vec<Rasterizer>> = Mutex::new(Vec::new());
/// The most that are kept: an autograd graph frees one while the next call uses another.
const MOST_IDLE: usize = 2;

/// Properties that a rasterizer is made for.
#[derive(Debug, Clone, PartialEq)]
struct Key {
    device: Option<String>,
    degree: u32,
    size: [u32; 2],
    compensate: bool,
}

/// Gaussians on a device, with the stages that render them and compute gradients.
struct Rasterizer {
    key: Key,
    context: Context,
    model: Model,
    renderer: Renderer,
    /// Present if the renderer has the buffers of gradients.
    learner: Option<Learner>,
    /// The view whose sorted splats the raster holds.
    blended: Option<usize>,
    status: Buffer<u32>,
}

/// The arrays of a call, row by row.
#[derive(Clone, Copy)]
struct Arrays<'a> {
    means: &'a [f32],
    quats: &'a [f32],
    scales: &'a [f32],
    opacities: &'a [f32],
    /// Coefficients of harmonics, or colors.
    colors: &'a [f32],
    are_harmonics: bool,
}

/// Opacities are clamped to this distance from 0 and 1, where logits are infinite.
const LEAST_OPACITY: f32 = 1.0 / (1 << 24) as f32;

fn inside(opacity: f32) -> f32 {
    opacity.clamp(LEAST_OPACITY, 1.0 - LEAST_OPACITY)
}

impl Arrays<'_> {
    fn count(&self) -> usize {
        self.opacities.len()
    }

    /// Plane `p` of Gaussian `i` on the device.
    fn geometry(&self, i: usize, p: usize) -> f32 {
        let of = |first: usize, planes: usize| (first..first + planes).contains(&p).then(|| planes * i + p - first);
        if let Some(at) = of(MEAN, 3) {
            self.means[at]
        } else if let Some(at) = of(LOG_SCALE, 3) {
            self.scales[at].ln()
        } else if let Some(at) = of(QUAT, 4) {
            self.quats[at]
        } else {
            let opacity = inside(self.opacities[i]);
            (opacity / (1.0 - opacity)).ln()
        }
    }

    fn harmonic(&self, i: usize, p: usize) -> f32 {
        let value = self.colors[self.colors.len() / self.count() * i + p];
        if self.are_harmonics { value } else { (value - 0.5) / SH_DC }
    }
}

/// Uploads `planes` values of each Gaussian.
fn upload(
    to: &Planes,
    pages: &[Page],
    planes: usize,
    count: usize,
    value: impl Fn(usize, usize) -> f32 + Sync,
) -> Result<(), Failure> {
    for (k, page) in pages.iter().enumerate() {
        let (first, capacity) = (page.first as usize, page.capacity as usize);
        let mut values = vec![[0.0; 4]; quads(planes) * capacity];
        let here = capacity.min(count.saturating_sub(first));
        values.par_chunks_mut(capacity).enumerate().for_each(|(q, values)| {
            for (place, quad) in values[..here].iter_mut().enumerate() {
                for (p, to) in (4 * q..planes).zip(quad) {
                    *to = value(first + place, p);
                }
            }
        });
        to.page(k).upload(0, &values)?;
    }
    Ok(())
}

/// The first `planes` values of each Gaussian, row by row.
fn download(from: &Planes, pages: &[Page], planes: usize, count: usize) -> Result<Vec<f32>, Failure> {
    let mut rows = vec![0.0; planes * count];
    for (k, page) in pages.iter().enumerate().filter(|(_, page)| (page.first as usize) < count) {
        let (values, capacity) = (from.page(k).download()?, page.capacity as usize);
        let here = rows[planes * page.first as usize..].par_chunks_mut(planes).take(capacity);
        here.enumerate().for_each(|(place, row)| {
            row.iter_mut().enumerate().for_each(|(p, to)| *to = values[p / 4 * capacity + place][p % 4]);
        });
    }
    Ok(rows)
}

impl Rasterizer {
    /// An idle one that fits, or a new one.
    fn take(key: Key, count: usize) -> Result<Self, Failure> {
        let context = device::context(key.device.as_deref())?;
        let fits = |found: &Rasterizer| {
            let room = found.model.capacity() as usize;
            found.key == key && (count..=2 * count.max(1)).contains(&room)
        };
        let mut idle = IDLE.lock().unwrap_or_else(|error| error.into_inner());
        if let Some(at) = idle.iter().position(fits) {
            return Ok(idle.swap_remove(at));
        }
        drop(idle);
        let scene = Scene { base: Gaussians { sh_degree: key.degree, ..Default::default() }, ..Default::default() };
        let room = Room { base: count.max(1) as u32, ..Default::default() };
        let model = Model::upload_around(&context, DVec3::ZERO, &scene, room)?;
        let renderer = renderer(&context, &model, &key, false)?;
        let status = Buffer::zeroed(&context, "status", status::WORDS)?;
        Ok(Rasterizer { key, context, model, renderer, learner: None, blended: None, status })
    }

    fn fill(&mut self, arrays: &Arrays<'_>) -> Result<(), Failure> {
        self.blended = None;
        let (part, count) = (self.model.part(Segment::Base), arrays.count());
        upload(&part.geometry, &part.pages, GEOMETRY_PLANES, count, |i, p| arrays.geometry(i, p))?;
        let planes = 3 * coefficients(self.key.degree);
        upload(&part.sh, &part.pages, planes, count, |i, p| arrays.harmonic(i, p))?;
        Ok(self.model.set_count(Segment::Base, count as u32)?)
    }

    /// Prepares gradients.
    fn learns(&mut self) -> Result<(), Failure> {
        if self.learner.is_none() {
            self.renderer = renderer(&self.context, &self.model, &self.key, true)?;
            self.blended = None;
            let lesson = Lesson { compensate: self.key.compensate, ..Lesson::new(Segment::Base) };
            self.learner = Some(Learner::new(&self.model, lesson, true)?);
        }
        Ok(())
    }
}

fn renderer(context: &Context, model: &Model, key: &Key, backward: bool) -> Result<Renderer, Failure> {
    let [width, height] = key.size;
    let size = Camera {
        width,
        height,
        fx: 1.0,
        fy: 1.0,
        cx: 0.0,
        cy: 0.0,
        rotation: Default::default(),
        translation: DVec3::ZERO,
    };
    let policy = Policy { compensate: key.compensate, ..Policy::default() };
    let options = RenderOptions { backward, policy, ..Default::default() };
    Ok(Renderer::new(context, Needs::of(model), &Views::upload(context, &[size], &[])?, options)?)
}

/// Inputs of the gradients of a call. It owns the call's rasterizer until it is dropped.
#[pyclass(frozen, module = "glint_splat")]
pub struct Meta {
    rasterizer: Mutex<Option<Rasterizer>>,
    views: Views,
    backgrounds: Vec<[f32; 3]>,
    scales: Vec<f32>,
    opacities: Vec<f32>,
    /// None of colors.
    sh_degree: Option<u32>,
}

impl Meta {
    fn render(&self) -> Result<(Vec<f32>, Vec<f32>), Failure> {
        let mut kept = self.rasterizer.lock().unwrap_or_else(|error| error.into_inner());
        let (mut images, mut alphas) = (Vec::new(), Vec::new());
        if let Some(Rasterizer { model, renderer, blended, .. }) = &mut *kept {
            for (view, background) in self.backgrounds.iter().enumerate() {
                let rendered = renderer.render(model, &self.views, view as u32, *background)?;
                *blended = Some(view);
                let single = self.backgrounds.len() == 1;
                // The image of a single view is not copied.
                if single {
                    images = rendered.color;
                } else {
                    images.extend(rendered.color);
                }
                alphas.extend(rendered.transmittance.iter().map(|seen| 1.0 - seen));
            }
        }
        Ok((images, alphas))
    }

    /// Gradients of the planes on the device, geometry and harmonics, row by row.
    fn learn(&self, image_grad: &[f32]) -> Result<[Vec<f32>; 2], Failure> {
        let mut kept = self.rasterizer.lock().unwrap_or_else(|error| error.into_inner());
        let Some(own) = &mut *kept else { return Ok(Default::default()) };
        device::context(own.key.device.as_deref())?;
        own.learns()?;
        let Rasterizer { context, model, renderer, learner: Some(learner), blended, status, key } = own else {
            return Ok(Default::default());
        };
        let mut recorder = context.recorder("gradients")?;
        learner.record_begin(&mut recorder);
        recorder.submit()?.wait()?;
        let grads: Vec<&[f32]> = image_grad.chunks(image_grad.len() / self.backgrounds.len()).collect();
        for (view, background) in self.backgrounds.iter().enumerate().rev() {
            let show = Show::all(model, *background);
            let mut needed = None;
            loop {
                if let Some(needed) = needed {
                    *blended = None;
                    renderer.raster.grow(needed)?;
                }
                renderer.raster.buffers.image_grad.upload(0, grads[view])?;
                let mut recorder = context.recorder("backward")?;
                recorder.fill(status, 0);
                let seen = view as u32;
                let grid = match blended.take() == Some(view) {
                    true => renderer.raster.grid(seen, 1, key.size[0], key.size[1]),
                    false => renderer.record(&mut recorder, model, &self.views, seen, &show, status)?,
                };
                let raster = &renderer.raster;
                raster.record_blend_backward(&mut recorder, &grid, &self.views.frames, &model.population, 0);
                let seen = Seen { model, views: &self.views, view: seen, raster, degree: key.degree, status };
                learner.record_add(&mut recorder, &seen);
                recorder.submit()?.wait()?;
                needed = Status::read(&status.download()?).needed(Resource::Intersections);
                if needed.is_none() {
                    *blended = Some(view);
                    break;
                }
            }
        }
        let Some(found) = learner.gradients() else { return Ok(Default::default()) };
        let (pages, count) = (&model.part(Segment::Base).pages, self.opacities.len());
        Ok([
            download(&found.geometry, pages, GEOMETRY_PLANES, count)?,
            download(&found.sh, pages, 3 * coefficients(key.degree), count)?,
        ])
    }
}

impl Drop for Meta {
    fn drop(&mut self) {
        let own = self.rasterizer.get_mut().unwrap_or_else(|error| error.into_inner()).take();
        let mut idle = IDLE.lock().unwrap_or_else(|error| error.into_inner());
        idle.extend(own);
        if idle.len() > MOST_IDLE {
            idle.remove(0);
        }
    }
}

type Array<'py> = Bound<'py, PyArrayDyn<f32>>;

fn array<'py>(py: Python<'py>, values: Vec<f32>, shape: &[usize]) -> PyResult<Array<'py>> {
    PyArray1::from_vec(py, values).reshape(shape)
}

#[pymethods]
impl Meta {
    /// Gradients of means, quats, scales, opacities and colors.
    fn backward<'py>(&self, py: Python<'py>, image_grad: PyReadonlyArray4<'py, f32>) -> PyResult<[Array<'py>; 5]> {
        let camera = &self.views.cameras[0];
        let shape = [self.backgrounds.len(), camera.height as usize, camera.width as usize, 3];
        if image_grad.shape() != shape {
            return Err(bad(format!("image_grad has shape {:?}, expected {shape:?}", image_grad.shape())).into());
        }
        let pixels = image_grad.as_slice()?;
        let [geometry, mut sh] = py.detach(|| self.learn(pixels))?;
        let n = self.opacities.len();
        let of = |first: usize, planes: usize| -> Vec<f32> {
            geometry.chunks(GEOMETRY_PLANES).flat_map(|row| row[first..first + planes].iter().copied()).collect()
        };
        let (mut scales, mut opacities) = (of(LOG_SCALE, 3), of(OPACITY, 1));
        // The device has logarithms of scales and logits of opacities.
        scales.iter_mut().zip(&self.scales).for_each(|(grad, scale)| *grad /= scale);
        for (grad, &opacity) in opacities.iter_mut().zip(&self.opacities) {
            *grad /= inside(opacity) * (1.0 - inside(opacity));
        }
        let colors = match self.sh_degree {
            Some(degree) => array(py, sh, &[n, coefficients(degree), 3])?,
            None => {
                sh.iter_mut().for_each(|grad| *grad /= SH_DC);
                array(py, sh, &[n, 3])?
            }
        };
        Ok([
            array(py, of(MEAN, 3), &[n, 3])?,
            array(py, of(QUAT, 4), &[n, 4])?,
            array(py, scales, &[n, 3])?,
            array(py, opacities, &[n])?,
            colors,
        ])
    }
}

#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "the arguments of `rasterization`")]
pub fn rasterize<'py>(
    py: Python<'py>,
    means: PyReadonlyArray2<'py, f32>,
    quats: PyReadonlyArray2<'py, f32>,
    scales: PyReadonlyArray2<'py, f32>,
    opacities: PyReadonlyArray1<'py, f32>,
    colors: PyReadonlyArray3<'py, f32>,
    viewmats: PyReadonlyArray3<'py, f64>,
    ks: PyReadonlyArray3<'py, f64>,
    width: u32,
    height: u32,
    sh_degree: Option<u32>,
    backgrounds: PyReadonlyArray2<'py, f32>,
    compensate: bool,
    device: Option<String>,
) -> PyResult<(Array<'py>, Array<'py>, Meta)> {
    let n = means.shape()[0];
    let degree = sh_degree.unwrap_or(0);
    if degree > 3 {
        return Err(bad(format!("sh_degree is {degree}, expected 0 to 3")).into());
    }
    let views = viewmats.shape()[0];
    let expected: [(&str, &[usize], &[usize]); 8] = [
        ("means", means.shape(), &[n, 3]),
        ("quats", quats.shape(), &[n, 4]),
        ("scales", scales.shape(), &[n, 3]),
        ("opacities", opacities.shape(), &[n]),
        ("colors", colors.shape(), &[n, coefficients(degree), 3]),
        ("viewmats", viewmats.shape(), &[views.max(1), 4, 4]),
        ("Ks", ks.shape(), &[views, 3, 3]),
        ("backgrounds", backgrounds.shape(), &[views, 3]),
    ];
    if let Some((name, found, wanted)) = expected.into_iter().find(|(_, found, wanted)| found != wanted) {
        return Err(bad(format!("{name} has shape {found:?}, expected {wanted:?}")).into());
    }
    let arrays = Arrays {
        means: means.as_slice()?,
        quats: quats.as_slice()?,
        scales: scales.as_slice()?,
        opacities: opacities.as_slice()?,
        colors: colors.as_slice()?,
        are_harmonics: sh_degree.is_some(),
    };
    check(&arrays)?;
    let (viewmats, ks) = (viewmats.as_slice()?.chunks(16), ks.as_slice()?.chunks(9));
    let cameras: Result<Vec<Camera>, Failure> =
        ks.zip(viewmats).map(|(k, viewmat)| device::camera(width, height, k, viewmat)).collect();
    let (cameras, backgrounds) = (cameras?, bytemuck::cast_slice(backgrounds.as_slice()?).to_vec());
    let key = Key { device, degree, size: [width, height], compensate };
    let (meta, (images, alphas)) = py.detach(|| -> Result<_, Failure> {
        let mut rasterizer = Rasterizer::take(key, n)?;
        rasterizer.fill(&arrays)?;
        let meta = Meta {
            views: Views::upload(&rasterizer.context, &cameras, &[])?,
            rasterizer: Mutex::new(Some(rasterizer)),
            backgrounds,
            scales: arrays.scales.to_vec(),
            opacities: arrays.opacities.to_vec(),
            sh_degree,
        };
        let pictures = meta.render()?;
        Ok((meta, pictures))
    })?;
    let [rows, columns] = [height, width].map(|side| side as usize);
    Ok((array(py, images, &[views, rows, columns, 3])?, array(py, alphas, &[views, rows, columns, 1])?, meta))
}

/// Fails on numbers that no Gaussian can have.
fn check(arrays: &Arrays<'_>) -> Result<(), Failure> {
    let Arrays { means, quats, scales, opacities, colors, .. } = *arrays;
    let n = arrays.count();
    check_each("means", means, n, f32::is_finite, "a finite number")?;
    check_each("quats", quats, n, f32::is_finite, "a finite number")?;
    check_each("scales", scales, n, |scale| scale > 0.0 && scale.is_finite(), "a positive number")?;
    check_each("opacities", opacities, n, |opacity| (0.0..=1.0).contains(&opacity), "0 to 1")?;
    check_each("colors", colors, n, f32::is_finite, "a finite number")
}
