//! Reads and writes safetensors files of f32 and u32 tensors: checkpoints and test data.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::io::{self, Write};
use std::path::Path;

use safetensors::{Dtype, SafeTensors, View};

use super::atomic::write_whole;
use crate::{Error, Result};

/// Metadata key of the text about the tensors.
const ABOUT: &str = "glint";

/// A tensor's values, row-major.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Type `F32` in the file.
    F32(Vec<f32>),
    /// Type `U32` in the file.
    U32(Vec<u32>),
}

/// A tensor that was read. The product of `shape` is the number of values.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    /// Lengths of its dimensions; the last varies fastest.
    pub shape: Vec<usize>,
    /// Row-major values, one per element of the shape.
    pub values: Values,
}

/// Borrowed values of a tensor to write, row-major.
#[derive(Debug, Clone, Copy)]
pub enum ValuesRef<'a> {
    /// Type `F32` in the file.
    F32(&'a [f32]),
    /// Type `U32` in the file.
    U32(&'a [u32]),
}

impl<'a> From<&'a [f32]> for ValuesRef<'a> {
    fn from(values: &'a [f32]) -> Self {
        ValuesRef::F32(values)
    }
}

impl<'a> From<&'a Tensor> for ValuesRef<'a> {
    fn from(tensor: &'a Tensor) -> Self {
        match &tensor.values {
            Values::F32(values) => ValuesRef::F32(values),
            Values::U32(values) => ValuesRef::U32(values),
        }
    }
}

impl ValuesRef<'_> {
    fn len(&self) -> usize {
        match self {
            ValuesRef::F32(values) => values.len(),
            ValuesRef::U32(values) => values.len(),
        }
    }
}

struct Entry<'a> {
    shape: &'a [usize],
    values: ValuesRef<'a>,
}

impl View for Entry<'_> {
    fn dtype(&self) -> Dtype {
        match self.values {
            ValuesRef::F32(_) => Dtype::F32,
            ValuesRef::U32(_) => Dtype::U32,
        }
    }

    fn shape(&self) -> &[usize] {
        self.shape
    }

    fn data(&self) -> Cow<'_, [u8]> {
        // The format is little-endian.
        match self.values {
            ValuesRef::F32(v) if cfg!(target_endian = "big") => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
            ValuesRef::U32(v) if cfg!(target_endian = "big") => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
            ValuesRef::F32(v) => Cow::Borrowed(bytemuck::cast_slice(v)),
            ValuesRef::U32(v) => Cow::Borrowed(bytemuck::cast_slice(v)),
        }
    }

    fn data_len(&self) -> usize {
        4 * self.values.len()
    }
}

/// Writes tensors, each as `(name, shape, values)`. The file appears whole or not at all.
pub fn write_tensors<'a, V>(path: impl AsRef<Path>, tensors: &[(&str, &[usize], V)]) -> Result<()>
where
    V: Into<ValuesRef<'a>> + Copy,
{
    write_tensors_about(path, tensors, None)
}

/// [`write_tensors`] with a text about them in the file's metadata.
pub fn write_tensors_about<'a, V>(
    path: impl AsRef<Path>,
    tensors: &[(&str, &[usize], V)],
    about: Option<&str>,
) -> Result<()>
where
    V: Into<ValuesRef<'a>> + Copy,
{
    let path = path.as_ref();
    let refuse = |what: String| Err(Error::Usage(format!("{}: {what}", path.display())));
    let mut entries: BTreeMap<&str, Entry> = BTreeMap::new();
    for &(name, shape, values) in tensors {
        let entry = Entry { shape, values: values.into() };
        if shape.iter().try_fold(1usize, |n, &side| n.checked_mul(side)) != Some(entry.values.len()) {
            return refuse(format!("tensor `{name}` has shape {shape:?} but {} values", entry.values.len()));
        }
        if entries.insert(name, entry).is_some() {
            return refuse(format!("tensor `{name}` is given twice"));
        }
    }
    let about = about.map(|text| HashMap::from([(ABOUT.to_owned(), text.to_owned())]));
    let bytes = safetensors::serialize(entries, about).map_err(|error| Error::io(path, io::Error::other(error)))?;
    write_whole(path, |file| file.write_all(&bytes))
}

/// Reads all tensors by name. Types other than f32 and u32 are errors.
pub fn read_tensors(path: impl AsRef<Path>) -> Result<BTreeMap<String, Tensor>> {
    Ok(read_tensors_about(path)?.0)
}

/// [`read_tensors`] with the text about them, if [`write_tensors_about`] wrote one.
pub fn read_tensors_about(path: impl AsRef<Path>) -> Result<(BTreeMap<String, Tensor>, Option<String>)> {
    let path = path.as_ref();
    let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
    parse_tensors_about(&bytes, path)
}

/// [`read_tensors_about`] from a file's bytes. `path` is only used in errors.
pub(super) fn parse_tensors_about(bytes: &[u8], path: &Path) -> Result<(BTreeMap<String, Tensor>, Option<String>)> {
    let tensors = parse_tensors(bytes, path)?;
    let (_, header) = SafeTensors::read_metadata(bytes)
        .map_err(|error| Error::input(path, format!("is not a valid safetensors file: {error}")))?;
    Ok((tensors, header.metadata().as_ref().and_then(|found| found.get(ABOUT).cloned())))
}

/// [`read_tensors`] from a file's bytes. `path` is only used in errors.
pub(super) fn parse_tensors(bytes: &[u8], path: &Path) -> Result<BTreeMap<String, Tensor>> {
    let file = SafeTensors::deserialize(bytes)
        .map_err(|error| Error::input(path, format!("is not a valid safetensors file: {error}")))?;
    let mut out = BTreeMap::new();
    for (name, view) in file.iter() {
        let words = view.data().chunks_exact(4).map(|word| [word[0], word[1], word[2], word[3]]);
        let values = match view.dtype() {
            Dtype::F32 => Values::F32(words.map(f32::from_le_bytes).collect()),
            Dtype::U32 => Values::U32(words.map(u32::from_le_bytes).collect()),
            other => return Err(Error::input(path, format!("tensor `{name}` is {other:?}, expected F32 or U32"))),
        };
        out.insert(name.to_owned(), Tensor { shape: view.shape().to_vec(), values });
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(path: &Path) {
        let (floats, words) = ([1.5f32, f32::NAN, -0.0, 1e-40, f32::MAX, 7.0], [1u32, u32::MAX]);
        let tensors: [(&str, &[usize], ValuesRef); 3] = [
            ("means", &[2, 3], floats[..].into()),
            ("steps", &[2], ValuesRef::U32(&words)),
            ("none", &[0, 3], floats[..0].into()),
        ];
        write_tensors(path, &tensors).unwrap();
    }

    #[test]
    fn tensors_come_back_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.safetensors");
        sample(&path);
        let read = read_tensors(&path).unwrap();
        assert_eq!(read.keys().collect::<Vec<_>>(), ["means", "none", "steps"]);
        let Values::F32(floats) = &read["means"].values else { panic!("means is not f32") };
        let bits: Vec<u32> = floats.iter().map(|v| v.to_bits()).collect();
        assert_eq!(bits, [1.5f32, f32::NAN, -0.0, 1e-40, f32::MAX, 7.0].map(f32::to_bits));
        assert_eq!(read["steps"], Tensor { shape: vec![2], values: Values::U32(vec![1, u32::MAX]) });
        assert_eq!(read["none"].shape, [0, 3]);
        write_tensors(&path, &[("plain", &[2], &[1.0f32, 2.0][..])]).unwrap();
        assert_eq!(read_tensors(&path).unwrap()["plain"].values, Values::F32(vec![1.0, 2.0]));
        assert_eq!(read_tensors_about(&path).unwrap().1, None);
        write_tensors_about(&path, &[("plain", &[1], &[1.0f32][..])], Some("{\"a\": 1}")).unwrap();
        assert_eq!(read_tensors_about(&path).unwrap().1.as_deref(), Some("{\"a\": 1}"));
    }

    #[test]
    fn wrong_shapes_and_double_names_are_refused() {
        let values = &[1.0f32, 2.0][..];
        let refused = |tensors: &[(&str, &[usize], &[f32])]| write_tensors("a", tensors).unwrap_err().to_string();
        assert!(refused(&[("a", &[3], values)]).contains("`a` has shape [3] but 2 values"));
        assert!(refused(&[("a", &[usize::MAX, 2], values)]).contains("shape"));
        assert!(refused(&[("a", &[2], values), ("a", &[2], values)]).contains("twice"));
    }
}
