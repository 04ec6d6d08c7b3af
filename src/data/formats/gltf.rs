//! Reads and writes glTF 2.0 with `KHR_gaussian_splatting`; Gaussians with lobes use an extension of glint.
//!
//! Source: Khronos, KHR_gaussian_splatting. Besides POSITION, a primitive of points has one attribute each
//! for rotation (unit quaternion x, y, z, w), scale (standard deviations; drafts before April 2026 had their
//! logarithms), opacity (0 to 1) and every coefficient of the harmonics. The frame is glTF's: x left, y up, z
//! front, under the transformations of the nodes. docs/gltf.md describes `GLINT_gaussian_lobes`.
//!
//! In Khronos' drafts, an SPZ scene in a buffer view has all attributes. Its extension is
//! `KHR_gaussian_splatting_compression_spz_2` (or without its number) in the primitive's
//! `KHR_gaussian_splatting`. Older names are `KHR_spz_gaussian_splats_compression` or `KHR_spz_compression`
//! in the primitive.

mod document;
mod write;

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

use glam::{DMat4, DQuat, DVec3};
use serde::Deserialize;
use serde_json::value::{RawValue, Value};

pub(in crate::data) use write::write;

use super::axes::{self, Signs};
use super::common::append;
use super::rotate::Placing;
use super::{inflate, quantise, spz};
use crate::data::{SceneFile, TrainedWith};
use crate::scene::{Gaussians, Lobes, Scene, Supplement};
use crate::{Error, Result};
use document::Document;

/// Names of the extensions.
const SPLATTING: &str = "KHR_gaussian_splatting";
const LOBES: &str = "GLINT_gaussian_lobes";
/// Extensions that a file may require.
const KNOWN: [&str; 7] = [
    SPLATTING,
    LOBES,
    "KHR_mesh_quantization",
    "KHR_gaussian_splatting_compression_spz_2",
    "KHR_gaussian_splatting_compression_spz",
    "KHR_spz_gaussian_splats_compression",
    "KHR_spz_compression",
];
/// Between PLY (x right, y down, z front) and glTF (x left, y up, z front).
const X_LEFT_Y_UP: Signs = [-1.0, -1.0, 1.0];
/// Attributes besides POSITION.
const ROTATION: &str = "KHR_gaussian_splatting:ROTATION";
const SCALE: &str = "KHR_gaussian_splatting:SCALE";
const OPACITY: &str = "KHR_gaussian_splatting:OPACITY";
const LOBE_DIRECTION: &str = "GLINT_gaussian_lobes:DIRECTION";
const LOBE_WIDTH: &str = "GLINT_gaussian_lobes:WIDTH";
const LOBE_SHARPNESS: &str = "GLINT_gaussian_lobes:SHARPNESS";

/// Attribute name of coefficient `k`: its degree, and its index in that degree.
fn harmonic(k: usize) -> String {
    let degree = k.isqrt();
    format!("KHR_gaussian_splatting:SH_DEGREE_{degree}_COEF_{}", k - degree * degree)
}

type Attributes<'a> = HashMap<Cow<'a, str>, usize>;

#[derive(Debug, Deserialize)]
struct Mesh<'a> {
    #[serde(borrow)]
    primitives: Vec<&'a RawValue>,
}

#[derive(Debug, Deserialize)]
struct Primitive<'a> {
    #[serde(borrow, default)]
    attributes: Attributes<'a>,
    mode: Option<u32>,
    #[serde(borrow, default)]
    extensions: PrimitiveExtensions<'a>,
}

#[derive(Debug, Default, Deserialize)]
struct PrimitiveExtensions<'a> {
    #[serde(rename = "KHR_gaussian_splatting", borrow)]
    splatting: Option<Splatting<'a>>,
    #[serde(rename = "KHR_spz_gaussian_splats_compression", alias = "KHR_spz_compression")]
    spz: Option<Spz>,
}

/// Location of an SPZ scene.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Spz {
    buffer_view: usize,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Splatting<'a> {
    #[serde(borrow)]
    kernel: Option<Cow<'a, str>>,
    #[serde(borrow)]
    color_space: Option<Cow<'a, str>>,
    #[serde(borrow, default)]
    extensions: SplattingExtensions<'a>,
}

#[derive(Debug, Default, Deserialize)]
struct SplattingExtensions<'a> {
    #[serde(rename = "GLINT_gaussian_lobes", borrow)]
    lobes: Option<LobesExtension<'a>>,
    #[serde(rename = "KHR_gaussian_splatting_compression_spz_2", alias = "KHR_gaussian_splatting_compression_spz")]
    spz: Option<Spz>,
}

#[derive(Debug, Deserialize)]
struct LobesExtension<'a> {
    #[serde(borrow)]
    attributes: Attributes<'a>,
    #[serde(borrow)]
    learned: Option<Attributes<'a>>,
}

#[derive(Debug, Deserialize)]
struct Node<'a> {
    mesh: Option<usize>,
    #[serde(default)]
    children: Vec<usize>,
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
    #[serde(borrow)]
    extensions: Option<&'a RawValue>,
    extras: Option<Value>,
}

impl Node<'_> {
    fn matrix(&self) -> DMat4 {
        if let Some(columns) = &self.matrix {
            return DMat4::from_cols_array(columns);
        }
        DMat4::from_scale_rotation_translation(
            DVec3::from_array(self.scale.unwrap_or([1.0; 3])),
            DQuat::from_array(self.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0])).normalize(),
            DVec3::from_array(self.translation.unwrap_or_default()),
        )
    }
}

#[derive(Debug, Deserialize)]
struct Nodes {
    #[serde(default)]
    nodes: Vec<usize>,
}

/// Reads all splats of the file's scene. Files that it names are read from `folder`, if there is one; `path`
/// is only used in errors.
pub(in crate::data) fn parse(bytes: &[u8], folder: Option<&Path>, path: &Path) -> Result<SceneFile> {
    read(bytes, folder).map_err(|what| Error::input(path, what))
}

fn read(bytes: &[u8], folder: Option<&Path>) -> Result<SceneFile, String> {
    let document = Document::parse(bytes, folder)?;
    if let Some(unknown) = document.root.extensions_required.iter().find(|name| !KNOWN.contains(&&name[..])) {
        return Err(format!("requires the extension `{unknown}`, which is not read"));
    }
    let mut found = Found::default();
    for Placed { mesh, matrix, trained_with } in placed_meshes(&document)? {
        // A scene has one setting: the first one found.
        if found.trained_with.is_unknown() {
            found.trained_with = trained_with;
        }
        // A mesh is read once for every node that names it, and text takes longer than numbers: count a byte
        // of it as eight.
        let text = document.root.meshes.get(mesh).map_or(0, |text| text.get().len());
        found.promise(&document, 8 * text as u64, "meshes")?;
        let primitives: Mesh = Document::object(&document.root.meshes, mesh, "mesh")?;
        for (i, text) in primitives.primitives.iter().enumerate() {
            let place = || format!("primitive {i} of mesh {mesh}");
            let primitive: Primitive =
                serde_json::from_str(text.get()).map_err(|error| format!("{} is not understood: {error}", place()))?;
            let PrimitiveExtensions { splatting, spz } = primitive.extensions;
            if let Some(mut splatting) = splatting.or_else(|| spz.map(|_| Splatting::default())) {
                splatting.extensions.spz = splatting.extensions.spz.or(spz);
                let placing = Placing::of(matrix).ok_or_else(|| {
                    format!("places mesh {mesh} by a matrix that is no rotation, uniform scale and translation")
                })?;
                let splats = Splats { attributes: primitive.attributes, mode: primitive.mode, splatting };
                found.add(&document, splats, placing).map_err(|what| format!("{}: {what}", place()))?;
            }
        }
    }
    found.finish().map_err(|what| format!("{what} (it requires {:?})", document.root.extensions_required))
}

/// A mesh of the scene.
struct Placed {
    mesh: usize,
    /// Transformation by its nodes.
    matrix: DMat4,
    trained_with: TrainedWith,
}

/// Every mesh of the scene with its transformation.
fn placed_meshes(document: &Document) -> Result<Vec<Placed>, String> {
    let root = &document.root;
    let roots = match (root.scene, root.scenes.is_empty()) {
        (None, true) => return Err("has no scene".into()),
        (scene, _) => Document::object::<Nodes>(&root.scenes, scene.unwrap_or(0), "scene")?.nodes,
    };
    let mut meshes = Vec::new();
    let mut seen = vec![false; root.nodes.len()];
    let mut open: Vec<(usize, DMat4)> = roots.into_iter().rev().map(|node| (node, DMat4::IDENTITY)).collect();
    while let Some((index, above)) = open.pop() {
        let node: Node = Document::object(&root.nodes, index, "node")?;
        // Nodes form trees, so the list of open nodes is never longer than that of all.
        if std::mem::replace(&mut seen[index], true) {
            return Err(format!("reaches node {index} twice, expected a tree"));
        }
        if node.extensions.is_some_and(|text| text.get().contains("EXT_mesh_gpu_instancing")) {
            return Err(format!("has instances at node {index} (EXT_mesh_gpu_instancing), which are not read"));
        }
        let here = above * node.matrix();
        let trained_with = node.extras.map_or_else(Default::default, |extras| TrainedWith::from_json(&extras["glint"]));
        meshes.extend(node.mesh.map(|mesh| Placed { mesh, matrix: here, trained_with }));
        open.extend(node.children.iter().rev().map(|&child| (child, here)));
    }
    Ok(meshes)
}

/// A primitive of Gaussians.
struct Splats<'a> {
    attributes: Attributes<'a>,
    mode: Option<u32>,
    splatting: Splatting<'a>,
}

/// Data read so far.
#[derive(Default)]
struct Found {
    /// Bytes of the data, read or still to be read.
    promised: u64,
    /// Origin of the means, in glTF's frame; known after the first Gaussians.
    origin: Option<DVec3>,
    trained_with: TrainedWith,
    shown: Option<Gaussians>,
    /// The trained base, if any primitive has one.
    learned: Option<Gaussians>,
    supplement: Option<Supplement>,
}

impl Found {
    fn add(&mut self, document: &Document, splats: Splats, placing: Placing) -> Result<(), String> {
        let Splats { attributes, mode, splatting } = splats;
        let spz = splatting.extensions.spz;
        if spz.is_none() && mode != Some(0) {
            return Err(format!("has mode {}, expected 0 (points) of splats", mode.unwrap_or(4)));
        }
        if let Some(kernel) = splatting.kernel.as_deref().filter(|&kernel| kernel != "ellipse") {
            return Err(format!("has the kernel `{kernel}`, expected `ellipse`"));
        }
        if let Some(space) = splatting.color_space.as_deref().filter(|space| space.to_ascii_lowercase().contains("lin"))
        {
            return Err(format!("has colors in `{space}`, expected `srgb_rec709_display`"));
        }
        let base = match spz {
            Some(Spz { buffer_view }) => self.inflated(document, buffer_view, placing)?,
            None => self.gaussians(document, &attributes, placing)?,
        };
        let lobes = splatting.extensions.lobes;
        let learned = lobes.as_ref().and_then(|lobes| lobes.learned.as_ref());
        let learned = learned.map(|attributes| self.gaussians(document, attributes, placing)).transpose()?;
        if let Some(short) = learned.as_ref().filter(|learned| learned.len() < base.len()) {
            return Err(format!(
                "{LOBES} has {} learned Gaussians of {}, expected as many or more",
                short.len(),
                base.len()
            ));
        }
        if learned.is_some() || self.learned.is_some() {
            // The shown and the trained base differ from the first primitive with a trained one.
            let before = self.shown.clone();
            if self.learned.is_none() {
                self.learned = before;
            }
            append(&mut self.learned, learned.unwrap_or_else(|| base.clone()));
        }
        append(&mut self.shown, base);
        if let Some(LobesExtension { attributes, .. }) = lobes {
            let gaussians = self.gaussians(document, &attributes, placing)?;
            let place = |name: &str| attribute(&attributes, name);
            let flat = |values: Vec<[f32; 1]>| values.into_flattened();
            let mut lobes = Lobes {
                directions: document.numbers(place(LOBE_DIRECTION)?, LOBE_DIRECTION)?,
                widths: flat(document.numbers(place(LOBE_WIDTH)?, LOBE_WIDTH)?),
                sharpness: flat(document.numbers(place(LOBE_SHARPNESS)?, LOBE_SHARPNESS)?),
            };
            for (name, count) in [
                (LOBE_DIRECTION, lobes.directions.len()),
                (LOBE_WIDTH, lobes.widths.len()),
                (LOBE_SHARPNESS, lobes.sharpness.len()),
            ] {
                same(name, count, gaussians.len())?;
            }
            placing.apply_to_lobes(&mut lobes);
            axes::flip_lobes(&mut lobes, X_LEFT_Y_UP);
            match &mut self.supplement {
                None => self.supplement = Some(Supplement { gaussians, lobes }),
                Some(all) => {
                    let mut grown = Some(std::mem::take(&mut all.gaussians));
                    append(&mut grown, gaussians);
                    all.gaussians = grown.unwrap_or_default();
                    all.lobes.directions.extend(lobes.directions);
                    all.lobes.widths.extend(lobes.widths);
                    all.lobes.sharpness.extend(lobes.sharpness);
                }
            }
        }
        Ok(())
    }

    /// Fails if the total of the promised bytes is too large for the file.
    fn promise(&mut self, document: &Document, bytes: u64, what: &str) -> Result<(), String> {
        self.promised = self.promised.saturating_add(bytes);
        inflate::check_promise(document.bytes(), self.promised, what)
    }

    /// Gaussians of an SPZ scene, in PLY's frame. The extension defines SPZ data in glTF's frame, and nodes
    /// transform it there.
    fn inflated(&mut self, document: &Document, view: usize, placing: Placing) -> Result<Gaussians, String> {
        let (bytes, _) = document.view(view)?;
        let (mut out, antialiased) = spz::read(bytes).map_err(|what| format!("bufferView {view} {what}"))?;
        let each = size_of::<[f32; 11]>() + size_of::<[f32; 3]>() * out.sh_coefficients();
        self.promise(document, (each * out.len()) as u64, &format!("{} Gaussians", out.len()))?;
        if antialiased {
            self.trained_with.antialiased = Some(true);
        }
        axes::flip(&mut out, X_LEFT_Y_UP);
        Ok(self.placed(out, placing))
    }

    /// Gaussians from these attributes, in PLY's frame.
    fn gaussians(
        &mut self,
        document: &Document,
        attributes: &Attributes,
        placing: Placing,
    ) -> Result<Gaussians, String> {
        let place = |name: &str| attribute(attributes, name);
        let degree = (1..=4).find(|&l: &usize| !attributes.contains_key(&harmonic(l * l)[..])).unwrap_or(1) - 1;
        if degree == 3 && attributes.contains_key(&harmonic(16)[..]) {
            return Err("has harmonics of degree 4; 0 to 3 are known".into());
        }
        let mut out = Gaussians { sh_degree: degree as u32, ..Default::default() };
        out.means = document.numbers(place("POSITION")?, "POSITION")?;
        let count = out.means.len();
        let bytes = size_of::<[f32; 11]>() + out.sh_coefficients() * size_of::<[f32; 3]>();
        self.promise(document, (bytes * count) as u64, "Gaussians")?;
        let scales = document.numbers::<3>(place(SCALE)?, SCALE)?;
        same(SCALE, scales.len(), count)?;
        // Linear scales are never negative, but nearly all logarithms are if the scene fits a room.
        let negative = scales.as_flattened().iter().filter(|&&v| v < 0.0).count();
        let linear = 2 * negative <= 3 * count;
        out.log_scales = if linear { scales.into_iter().map(|s| s.map(quantise::log_scale)).collect() } else { scales };
        let rotations = document.numbers::<4>(place(ROTATION)?, ROTATION)?;
        same(ROTATION, rotations.len(), count)?;
        out.quats = rotations.into_iter().map(|[x, y, z, w]| [w, x, y, z]).collect();
        let opacities = document.numbers::<1>(place(OPACITY)?, OPACITY)?;
        same(OPACITY, opacities.len(), count)?;
        out.opacities = opacities.into_iter().map(|[v]| quantise::logit(v)).collect();
        let k = out.sh_coefficients();
        out.sh = vec![[0.0; 3]; k * count];
        for i in 0..k {
            let name = harmonic(i);
            let values = document.numbers::<3>(place(&name)?, &name)?;
            same(&name, values.len(), count)?;
            out.sh.iter_mut().skip(i).step_by(k).zip(values).for_each(|(slot, value)| *slot = value);
        }
        Ok(self.placed(out, placing))
    }

    /// Transforms Gaussians from glTF's frame by their node, into PLY's frame. If the node is too far away
    /// for float32, their means are relative to its position.
    fn placed(&mut self, mut gaussians: Gaussians, placing: Placing) -> Gaussians {
        placing.into_frame(&mut gaussians, &mut self.origin, X_LEFT_Y_UP);
        gaussians
    }

    fn finish(self) -> Result<SceneFile, String> {
        let shown = self.shown.ok_or_else(|| format!("has no primitive with `{SPLATTING}`"))?;
        let (base, shown) = match self.learned {
            Some(learned) => (learned, Some(shown)),
            None => (shown, None),
        };
        // If the shown and the trained base differ, raise both to the higher degree.
        let degree = shown.iter().fold(base.sh_degree, |degree, shown| degree.max(shown.sh_degree));
        let (base, shown) = (base.with_degree(degree), shown.map(|shown| shown.with_degree(degree)));
        let origin = axes::flip_origin(self.origin, X_LEFT_Y_UP);
        let scene = Scene { base, supplement: self.supplement, origin, ..Scene::default() };
        Ok(SceneFile { shown, trained_with: self.trained_with, ..scene.into() })
    }
}

fn attribute(attributes: &Attributes, name: &str) -> Result<usize, String> {
    attributes.get(name).copied().ok_or_else(|| format!("lacks the attribute `{name}`"))
}

fn same(name: &str, count: usize, expected: usize) -> Result<(), String> {
    if count == expected { Ok(()) } else { Err(format!("has {count} values of `{name}`, expected {expected}")) }
}
