//! Writes GLB files.

use std::path::Path;

use serde_json::{Map, Value, json};

use super::{
    LOBE_DIRECTION, LOBE_SHARPNESS, LOBE_WIDTH, LOBES, OPACITY, ROTATION, SCALE, SPLATTING, X_LEFT_Y_UP, axes, harmonic,
};
use crate::data::SceneFile;
use crate::data::formats::common::{name, put};
use crate::data::formats::quantise;
use crate::scene::Gaussians;
use crate::{Error, Result};

/// `componentType`.
const FLOAT: u32 = 5126;
const UNSIGNED_BYTE: u32 = 5121;

/// Accessors with their data, all at offsets that are multiples of four.
#[derive(Default)]
struct Binary {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Binary {
    /// Adds an accessor, and returns its index. `more` has further members.
    fn add(
        &mut self,
        bytes: impl IntoIterator<Item = u8>,
        count: usize,
        shape: &str,
        component: u32,
        more: Value,
    ) -> usize {
        let begin = self.bytes.len();
        self.bytes.extend(bytes);
        let length = self.bytes.len() - begin;
        self.views.push(json!({"buffer": 0, "byteOffset": begin, "byteLength": length}));
        let mut accessor =
            json!({"bufferView": self.views.len() - 1, "componentType": component, "count": count, "type": shape});
        if let (Value::Object(all), Value::Object(more)) = (&mut accessor, more) {
            all.extend(more);
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(&mut self, values: impl ExactSizeIterator<Item = [f32; N]>) -> usize {
        let count = values.len();
        let shape = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let bytes = values.flat_map(|value| value.map(f32::to_le_bytes)).flatten();
        self.add(bytes, count, shape, FLOAT, Value::Null)
    }

    /// The attributes of a primitive.
    fn gaussians(&mut self, gaussians: &Gaussians) -> Map<String, Value> {
        let mut turned = gaussians.clone();
        axes::flip(&mut turned, X_LEFT_Y_UP);
        let bound = |pick: fn(f32, f32) -> f32| {
            let all = turned.means.iter().copied();
            all.reduce(|a, b| std::array::from_fn(|axis| pick(a[axis], b[axis]))).unwrap_or_default()
        };
        // The format requires the bounds of positions.
        let bounds = json!({"min": bound(f32::min), "max": bound(f32::max)});
        let positions = turned.means.as_flattened().iter().flat_map(|v| v.to_le_bytes());
        let mut out = Map::new();
        let mut put = |name: &str, accessor: usize| drop(out.insert(name.into(), accessor.into()));
        put("POSITION", self.add(positions, turned.len(), "VEC3", FLOAT, bounds));
        put(
            ROTATION,
            self.floats(turned.quats.iter().map(|&quat| {
                let [w, x, y, z] = quantise::unit(quat).map(|v| v as f32);
                [x, y, z, w]
            })),
        );
        put(SCALE, self.floats(turned.log_scales.iter().map(|scales| scales.map(quantise::scale))));
        put(OPACITY, self.floats(turned.opacities.iter().map(|&v| [quantise::opacity(v) as f32])));
        let k = turned.sh_coefficients();
        for i in 0..k {
            put(&harmonic(i), self.floats(turned.sh.chunks_exact(k).map(|row| row[i])));
        }
        out
    }

    /// Points with colors, for programs that do not know splats.
    fn fallback(&mut self, gaussians: &Gaussians) -> usize {
        let k = gaussians.sh_coefficients();
        let color = |(rgb, &opacity): (&[[f32; 3]], &f32)| {
            let [r, g, b] = rgb[0].map(quantise::color_byte);
            [r, g, b, quantise::opacity_byte(opacity)]
        };
        let bytes = gaussians.sh.chunks_exact(k).zip(&gaussians.opacities).flat_map(color);
        self.add(bytes, gaussians.len(), "VEC4", UNSIGNED_BYTE, json!({"normalized": true}))
    }
}

/// # Errors
/// [`Error::Usage`] if the Gaussians exceed the size field of a GLB.
pub(in crate::data) fn write(file: &SceneFile, path: &Path, _: Option<u8>) -> Result<Vec<String>> {
    let base = &file.scene.base;
    let shown = file.shown.as_ref().unwrap_or(base);
    let mut binary = Binary::default();
    let mut attributes = binary.gaussians(shown);
    attributes.insert("COLOR_0".into(), binary.fallback(shown).into());
    let mut splatting = json!({
        "kernel": "ellipse",
        "colorSpace": "srgb_rec709_display",
        "projection": "perspective",
        "sortingMethod": "cameraDistance",
    });
    let mut used = vec![SPLATTING];
    if let Some(supplement) = &file.scene.supplement {
        used.push(LOBES);
        let mut attributes = binary.gaussians(&supplement.gaussians);
        let mut lobes = supplement.lobes.clone();
        axes::flip_lobes(&mut lobes, X_LEFT_Y_UP);
        let mut put = |name: &str, accessor: usize| drop(attributes.insert(name.into(), accessor.into()));
        put(LOBE_DIRECTION, binary.floats(lobes.directions.iter().copied()));
        put(LOBE_WIDTH, binary.floats(lobes.widths.iter().map(|&v| [v])));
        put(LOBE_SHARPNESS, binary.floats(lobes.sharpness.iter().map(|&v| [v])));
        let mut extension = json!({ "attributes": attributes });
        if file.shown.is_some() {
            extension["learned"] = binary.gaussians(base).into();
        }
        splatting["extensions"] = json!({ LOBES: extension });
    }
    // A node's translation is in decimal numbers, positions are float32.
    let origin: [f64; 3] = std::array::from_fn(|axis| file.scene.origin[axis] * f64::from(X_LEFT_Y_UP[axis]));
    let mut node = json!({"mesh": 0});
    if origin != [0.0; 3] {
        node["translation"] = json!(origin);
    }
    if !file.trained_with.is_unknown() {
        node["extras"] = json!({ "glint": file.trained_with });
    }
    let document = json!({
        "asset": {"version": "2.0", "generator": concat!("glint ", env!("CARGO_PKG_VERSION"))},
        "extensionsUsed": used,
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [node],
        "meshes": [{"primitives": [{"mode": 0, "attributes": attributes, "extensions": {SPLATTING: splatting}}]}],
        "accessors": binary.accessors,
        "bufferViews": binary.views,
        "buffers": [{"byteLength": binary.bytes.len()}],
    });
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let bytes = &binary.bytes;
    let length = 12 + 8 + json.len() + 8 + bytes.len();
    let words = [length, json.len(), bytes.len()].map(u32::try_from);
    let [Ok(length), Ok(json_length), Ok(binary_length)] = words else {
        let what = format!("{}: a GLB holds no more than 4 GiB, and this scene takes {length} bytes", name(path));
        return Err(Error::Usage(what));
    };
    let mut out = Vec::with_capacity(length as usize);
    out.extend(b"glTF");
    out.extend([2, length, json_length].into_iter().flat_map(u32::to_le_bytes));
    out.extend(b"JSON");
    out.extend(json);
    out.extend(binary_length.to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(bytes);
    put(path, &out)?;
    Ok(Vec::new())
}
