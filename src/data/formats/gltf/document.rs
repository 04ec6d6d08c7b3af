//! Parses the glTF container: GLB or JSON, buffers, and accessors as numbers.
//!
//! Source: the glTF 2.0 specification of Khronos, sections 3.6 (binary data) and 4 (GLB).

use std::borrow::Cow;
use std::cell::OnceCell;
use std::path::{Component, Path};

use base64::Engine;
use serde::Deserialize;
use serde_json::value::RawValue;

use crate::data::names;

const MAGIC: &[u8] = b"glTF";
const JSON: &[u8; 4] = b"JSON";
const BINARY: &[u8; 4] = b"BIN\0";

/// Objects stay unparsed text until used: most files have more than are needed.
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Root<'a> {
    pub(super) extensions_required: Vec<String>,
    pub(super) scene: Option<usize>,
    #[serde(borrow)]
    pub(super) scenes: Vec<&'a RawValue>,
    #[serde(borrow)]
    pub(super) nodes: Vec<&'a RawValue>,
    #[serde(borrow)]
    pub(super) meshes: Vec<&'a RawValue>,
    #[serde(borrow)]
    accessors: Vec<&'a RawValue>,
    #[serde(borrow)]
    buffer_views: Vec<&'a RawValue>,
    #[serde(borrow)]
    buffers: Vec<&'a RawValue>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor<'a> {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: u64,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: u64,
    #[serde(rename = "type", borrow)]
    shape: Cow<'a, str>,
    #[serde(borrow)]
    sparse: Option<&'a RawValue>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct BufferView<'a> {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: Option<u64>,
    #[serde(borrow)]
    extensions: Option<&'a RawValue>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Buffer<'a> {
    #[serde(borrow)]
    uri: Option<Cow<'a, str>>,
    byte_length: u64,
}

/// A document with its buffers, each loaded on first use.
pub(super) struct Document<'a> {
    pub(super) root: Root<'a>,
    /// Size of the document itself, bytes.
    bytes: usize,
    binary: Option<&'a [u8]>,
    buffers: Vec<OnceCell<Cow<'a, [u8]>>>,
    /// Folder of the files that the document names; `None` to read none.
    folder: Option<&'a Path>,
}

impl<'a> Document<'a> {
    pub(super) fn parse(bytes: &'a [u8], folder: Option<&'a Path>) -> Result<Self, String> {
        let (json, binary) = if bytes.starts_with(MAGIC) { chunks(bytes)? } else { (bytes, None) };
        let root: Root = serde_json::from_slice(json).map_err(|error| format!("is not a valid glTF: {error}"))?;
        let buffers = root.buffers.iter().map(|_| OnceCell::new()).collect();
        Ok(Document { root, bytes: bytes.len(), binary, buffers, folder })
    }

    /// Parses an object of one of the document's lists.
    pub(super) fn object<T: Deserialize<'a>>(list: &[&'a RawValue], index: usize, what: &str) -> Result<T, String> {
        let text = list.get(index).ok_or_else(|| format!("names {what} {index}, but has {}", list.len()))?;
        serde_json::from_str(text.get()).map_err(|error| format!("{what} {index} is not understood: {error}"))
    }

    /// Bytes of the document and of the other files read so far.
    pub(super) fn bytes(&self) -> usize {
        let files = self.buffers.iter().filter_map(OnceCell::get).map(|bytes| match bytes {
            Cow::Owned(bytes) => bytes.len(),
            Cow::Borrowed(_) => 0,
        });
        self.bytes + files.sum::<usize>()
    }

    /// Numbers of an accessor whose elements have `N` components. `what` names it in errors.
    pub(super) fn numbers<const N: usize>(&self, index: usize, what: &str) -> Result<Vec<[f32; N]>, String> {
        let accessor: Accessor = Self::object(&self.root.accessors, index, "accessor")?;
        let fail = |why: String| Err(format!("accessor {index} ({what}) {why}"));
        let shape = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        if accessor.shape != shape {
            return fail(format!("is {}, expected {shape}", accessor.shape));
        }
        let Some(view) = accessor.buffer_view else { return fail("has no bufferView, expected one".into()) };
        if accessor.sparse.is_some() {
            return fail("is sparse, which is not read".into());
        }
        let Some((width, decode)) = component(accessor.component_type, accessor.normalized) else {
            return fail(format!("has components of type {}, expected 5120 to 5126", accessor.component_type));
        };
        let (bytes, stride) = self.view(view)?;
        let element = (N * width) as u64;
        let stride = stride.unwrap_or(element);
        // This also keeps the element within the stride, so that the view has bytes for every element.
        if stride < element {
            return fail(format!("has a byteStride of {stride}, expected {element} or more"));
        }
        let last = accessor.count.checked_sub(1).map(|n| n.checked_mul(stride));
        let end = match last {
            None => Some(accessor.byte_offset),
            Some(last) => last.and_then(|last| last.checked_add(accessor.byte_offset)?.checked_add(element)),
        };
        let have = bytes.len() as u64;
        if end.is_none_or(|end| end > have) {
            let count = accessor.count;
            return fail(format!(
                "promises {count} elements of {stride} bytes, but bufferView {view} has {have} bytes"
            ));
        }
        let start = accessor.byte_offset as usize;
        let elements = bytes[start..].chunks(stride as usize).take(accessor.count as usize);
        Ok(elements.map(|bytes| std::array::from_fn(|i| decode(&bytes[i * width..(i + 1) * width]))).collect())
    }

    /// Bytes of a view, and its stride if given.
    pub(super) fn view(&self, index: usize) -> Result<(&[u8], Option<u64>), String> {
        let view: BufferView = Self::object(&self.root.buffer_views, index, "bufferView")?;
        if let Some(extensions) = view.extensions {
            let text: String = extensions.get().chars().take(80).collect();
            return Err(format!("bufferView {index} has extensions, which are not read: {text}"));
        }
        let buffer = self.buffer(view.buffer)?;
        let end = view.byte_offset.checked_add(view.byte_length).filter(|&end| end <= buffer.len() as u64);
        let Some(end) = end else {
            let (from, length, have) = (view.byte_offset, view.byte_length, buffer.len());
            return Err(format!(
                "bufferView {index} has {length} bytes from byte {from}, but buffer {} has {have}",
                view.buffer
            ));
        };
        Ok((&buffer[view.byte_offset as usize..end as usize], view.byte_stride))
    }

    fn buffer(&self, index: usize) -> Result<&[u8], String> {
        let buffer: Buffer = Self::object(&self.root.buffers, index, "buffer")?;
        // The index was found in the root's list, which has the same length.
        let cell = &self.buffers[index];
        if cell.get().is_none() {
            let bytes = match (&buffer.uri, self.binary) {
                (None, Some(binary)) if index == 0 => Cow::Borrowed(binary),
                (None, _) => return Err(format!("buffer {index} has no uri, and there is no binary chunk for it")),
                (Some(uri), _) => Cow::Owned(self.load(uri).map_err(|why| format!("buffer {index} {why}"))?),
            };
            if (bytes.len() as u64) < buffer.byte_length {
                let (have, wanted) = (bytes.len(), buffer.byte_length);
                return Err(format!("buffer {index} has {have} bytes, expected {wanted}"));
            }
            let _ = cell.set(bytes);
        }
        cell.get().map(|bytes| &bytes[..]).ok_or_else(|| format!("buffer {index} is not there"))
    }

    /// Loads a URI: base64 data, or a file next to the document.
    fn load(&self, uri: &str) -> Result<Vec<u8>, String> {
        if let Some(data) = uri.strip_prefix("data:") {
            let (_, text) = data.split_once(";base64,").ok_or("has a data URI that is not in base64")?;
            let decoded = base64::engine::general_purpose::STANDARD.decode(text);
            return decoded.map_err(|error| format!("has a data URI that is not valid: {error}"));
        }
        let shown: String = uri.chars().take(200).collect();
        let name = names::unescape(uri).ok_or_else(|| format!("is in `{shown}`, which is not text"))?;
        let inside = Path::new(&name).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        let Some(folder) = self.folder.filter(|_| inside && !name.contains("://")) else {
            return Err(format!("is in `{shown}`, expected a file beside this one"));
        };
        let path = folder.join(&name);
        std::fs::read(&path).map_err(|error| format!("is in `{shown}`, which cannot be read: {error}"))
    }
}

/// The two chunks of a GLB.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    let word = |at: usize| bytes.get(at..)?.first_chunk().map(|&word| u32::from_le_bytes(word));
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(format!("is a GLB of {} bytes, expected a header of 12", bytes.len()));
    };
    if version != 2 {
        return Err(format!("is GLB version {version}, expected 2"));
    }
    if length as usize != bytes.len() {
        return Err(format!("is a GLB of {} bytes, expected {length} by its header", bytes.len()));
    }
    let (mut found, mut rest): (Vec<(&[u8], &[u8])>, _) = (Vec::new(), &bytes[12..]);
    while !rest.is_empty() && found.len() < 2 {
        let head = rest.split_first_chunk::<8>();
        let chunk = head.and_then(|(&[a, b, c, d, ref kind @ ..], rest)| {
            let (data, rest) = rest.split_at_checked(u32::from_le_bytes([a, b, c, d]) as usize)?;
            Some((kind.to_vec(), data, rest))
        });
        let Some((kind, data, left)) = chunk else {
            return Err(format!("ends within chunk {} of its GLB", found.len()));
        };
        let expected: &[u8; 4] = if found.is_empty() { JSON } else { BINARY };
        if kind == *expected {
            found.push((expected, data));
        } else if found.is_empty() {
            return Err("is a GLB whose first chunk is not JSON".into());
        }
        rest = left;
    }
    let json = found.first().ok_or("is a GLB without chunks")?.1;
    Ok((json, found.get(1).map(|chunk| chunk.1)))
}

/// Bytes of a component, and its conversion to a number.
type Number = (usize, fn(&[u8]) -> f32);

/// Integers keep their value, or if normalised map to −1 to 1 or 0 to 1 (section 3.11).
fn component(kind: u32, normalized: bool) -> Option<Number> {
    fn two(b: &[u8]) -> [u8; 2] {
        [b[0], b[1]]
    }
    fn four(b: &[u8]) -> [u8; 4] {
        [b[0], b[1], b[2], b[3]]
    }
    Some(match (kind, normalized) {
        (5120, false) => (1, |b| f32::from(b[0] as i8)),
        (5120, true) => (1, |b| (f32::from(b[0] as i8) / 127.0).max(-1.0)),
        (5121, false) => (1, |b| f32::from(b[0])),
        (5121, true) => (1, |b| f32::from(b[0]) / 255.0),
        (5122, false) => (2, |b| f32::from(i16::from_le_bytes(two(b)))),
        (5122, true) => (2, |b| (f32::from(i16::from_le_bytes(two(b))) / 32767.0).max(-1.0)),
        (5123, false) => (2, |b| f32::from(u16::from_le_bytes(two(b)))),
        (5123, true) => (2, |b| f32::from(u16::from_le_bytes(two(b))) / 65535.0),
        (5125, false) => (4, |b| u32::from_le_bytes(four(b)) as f32),
        (5126, _) => (4, |b| f32::from_le_bytes(four(b))),
        _ => return None,
    })
}
