//! Photos with their cameras, and sparse points.

use std::ffi::OsString;

use glint::{
    cli::embed,
    data::{self, Split},
    scene::Camera,
};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::{Failure, bad, noted};

/// A dataset, without its photos' pixels.
#[pyclass(frozen)]
pub struct Dataset {
    own: data::Dataset,
    #[pyo3(get)]
    notes: Vec<String>,
}

/// Name, split, width, height, and the numbers of K and viewmat row by row.
type Photo = (String, &'static str, u32, u32, Vec<f64>, Vec<f64>);

#[pymethods]
impl Dataset {
    #[new]
    fn new(py: Python<'_>, arguments: Vec<OsString>) -> Result<Self, Failure> {
        let (own, notes) = py.detach(|| noted(|listener| embed::dataset(&arguments, listener)))?;
        Ok(Dataset { own, notes })
    }

    fn photos(&self) -> Vec<Photo> {
        let photo = |photo: &data::Photo| {
            let Camera { width, height, fx, fy, cx, cy, rotation, translation } = photo.camera;
            let row = |i: usize| [rotation.row(i).x, rotation.row(i).y, rotation.row(i).z, translation[i]];
            let viewmat = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]].concat();
            let split = if photo.split == Split::Train { "train" } else { "test" };
            (photo.name.clone(), split, width, height, vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], viewmat)
        };
        self.own.photos.iter().map(photo).collect()
    }

    /// Reads the pixels of a photo, and which of them count; None if all do.
    #[allow(clippy::type_complexity, reason = "a tuple is what Python unpacks")]
    fn image<'py>(
        &self,
        py: Python<'py>,
        number: usize,
    ) -> PyResult<(Bound<'py, PyArray3<u8>>, Option<Bound<'py, PyArray2<bool>>>)> {
        let photo = self.own.photos.get(number).ok_or_else(|| bad(format!("there is no photo {number}")))?;
        let image = py.detach(|| photo.load(self.own.background)).map_err(Failure::from)?;
        let [rows, columns] = [image.height, image.width].map(|side| side as usize);
        let mask = image.mask.map(|mask| PyArray1::from_vec(py, mask).reshape([rows, columns]));
        Ok((PyArray1::from_vec(py, image.rgb).reshape([rows, columns, 3])?, mask.transpose()?))
    }

    /// Positions and colors of the sparse points; None if there are none.
    #[allow(clippy::type_complexity, reason = "a tuple is what Python unpacks")]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Option<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u8>>)>> {
        let Some(cloud) = &self.own.points else { return Ok(None) };
        let n = cloud.positions.len();
        let (positions, colors) = (cloud.positions.as_flattened().to_vec(), cloud.colors.as_flattened().to_vec());
        Ok(Some((PyArray1::from_vec(py, positions).reshape([n, 3])?, PyArray1::from_vec(py, colors).reshape([n, 3])?)))
    }

    #[getter]
    fn background(&self) -> [f32; 3] {
        self.own.background
    }

    #[getter]
    fn extent(&self) -> f64 {
        self.own.extent()
    }
}
