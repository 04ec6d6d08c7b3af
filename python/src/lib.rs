//! The native half of the Python module `glint_splat`. `glint_splat/__init__.py` has the functions that users call.

mod dataset;
mod device;
mod job;
mod rasterize;
mod render;
mod scene;

use std::ffi::OsString;

use glint::{
    Error,
    cli::embed::{self, Event, Failed, Listener, Opt},
};
use pyo3::prelude::*;

/// A failure in Rust, which becomes one of the module's exceptions.
pub struct Failure(Failed);

impl From<Failed> for Failure {
    fn from(failed: Failed) -> Self {
        Failure(failed)
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Failure(Failed { text: error.to_string(), code: error.exit_code() })
    }
}

impl From<glint::gpu::GpuError> for Failure {
    fn from(error: glint::gpu::GpuError) -> Self {
        Error::from(error).into()
    }
}

impl From<Failure> for PyErr {
    fn from(Failure(Failed { text, code }): Failure) -> Self {
        Python::attach(|py| {
            let name = if code == 2 { "InputError" } else { "DeviceError" };
            let class = py.import("glint_splat").and_then(|module| module.getattr(name));
            let made = class.and_then(|class| class.call1((text,)));
            made.map_or_else(|error| error, PyErr::from_value)
        })
    }
}

/// A failure for an invalid argument.
pub fn bad(what: impl Into<String>) -> Failure {
    Error::Usage(what.into()).into()
}

/// Fails on the first number of an array that does not fit. `n` is the number of Gaussians.
pub fn check_each(name: &str, values: &[f32], n: usize, fits: fn(f32) -> bool, wanted: &str) -> Result<(), Failure> {
    let Some(at) = values.iter().position(|&value| !fits(value)) else { return Ok(()) };
    let row = at / (values.len() / n);
    Err(bad(format!("{name} of Gaussian {row}: found {}, expected {wanted}", values[at])))
}

/// Does `work` with a listener that collects notes. Returns the result and the notes.
pub fn noted<T>(work: impl FnOnce(Listener) -> Result<T, Failed>) -> Result<(T, Vec<String>), Failure> {
    let notes = std::rc::Rc::new(std::cell::RefCell::new(Vec::new()));
    let into = std::rc::Rc::clone(&notes);
    let tell = move |event| {
        if let Event::Note(text) = event {
            into.borrow_mut().push(text);
        }
    };
    let found = work(Listener { tell: Box::new(tell), stop: Default::default() })?;
    Ok((found, notes.take()))
}

/// Name, help, whether it takes a value, whether it repeats, default and named values of a command's options.
#[pyfunction]
#[allow(clippy::type_complexity, reason = "a tuple is what Python unpacks")]
fn options(command: &str) -> Vec<(String, String, bool, bool, Option<String>, Vec<String>)> {
    let tuple =
        |Opt { name, help, takes_value, repeats, default, names }| (name, help, takes_value, repeats, default, names);
    embed::options(command).into_iter().map(tuple).collect()
}

#[pyfunction]
fn load(py: Python<'_>, arguments: Vec<OsString>) -> Result<(scene::Scene, Vec<String>), Failure> {
    let (file, notes) = py.detach(|| noted(|listener| embed::load(&arguments, listener)))?;
    Ok((scene::Scene::of(file), notes))
}

#[pyfunction]
fn save(py: Python<'_>, arguments: Vec<OsString>, scene: &scene::Scene) -> Result<Vec<String>, Failure> {
    Ok(py.detach(|| noted(|listener| embed::save(&arguments, scene.file().clone(), listener)))?.1)
}

#[pymodule(gil_used = false)]
fn _glint(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<dataset::Dataset>()?;
    module.add_class::<job::Job>()?;
    module.add_class::<rasterize::Meta>()?;
    module.add_class::<scene::Gaussians>()?;
    module.add_class::<scene::Scene>()?;
    module.add_function(wrap_pyfunction!(options, module)?)?;
    module.add_function(wrap_pyfunction!(load, module)?)?;
    module.add_function(wrap_pyfunction!(save, module)?)?;
    module.add_function(wrap_pyfunction!(rasterize::rasterize, module)?)?;
    module.add_function(wrap_pyfunction!(render::render, module)?)
}
