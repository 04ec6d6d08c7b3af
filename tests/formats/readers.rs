//! Other programs' readers of glint's files: an augmented PLY must be exactly its base to all of them, and a
//! GLB must conform to its specification.

use std::{collections::BTreeMap, process::Command};

use ::gltf::{Semantic, json::validation::Error};
use ply_rs_bw::{
    parser::Parser,
    ply::{DefaultElement, Property},
};
use serde::Deserialize;
use serde_json::json;

use super::*;

/// An augmented scene with a trained base.
fn augmented() -> (SceneFile, Vec<u8>) {
    let file = faded(random_scene(6, 200, 40, 3));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("augmented.ply");
    write_scene_file(&path, &file).unwrap();
    let bytes = fs::read(&path).unwrap();
    assert!(bytes.windows(15).any(|text| text == b"element learned"), "nothing is behind the base");
    (file, bytes)
}

/// The properties of Gaussian `i`, named as in a PLY of the reference trainer.
fn properties(g: &Gaussians, i: usize) -> BTreeMap<String, f32> {
    let k = g.sh_coefficients();
    let sh = &g.sh[i * k..(i + 1) * k];
    let numbered = |name: &str, values: &[f32]| -> Vec<(String, f32)> {
        values.iter().enumerate().map(|(n, &v)| (format!("{name}_{n}"), v)).collect()
    };
    let rest: Vec<f32> = (0..3).flat_map(|channel| sh[1..].iter().map(move |rgb| rgb[channel])).collect();
    let [x, y, z] = g.means[i];
    let plain = [("x", x), ("y", y), ("z", z), ("nx", 0.0), ("ny", 0.0), ("nz", 0.0), ("opacity", g.opacities[i])];
    let plain = plain.into_iter().map(|(name, v)| (name.to_owned(), v));
    let others = [("f_dc", &sh[0][..]), ("f_rest", &rest), ("scale", &g.log_scales[i]), ("rot", &g.quats[i])];
    plain.chain(others.into_iter().flat_map(|(name, values)| numbered(name, values))).collect()
}

#[track_caller]
fn assert_is_base(rows: &[BTreeMap<String, f32>], file: &SceneFile) {
    let base = file.shown.as_ref().unwrap();
    assert_eq!(rows.len(), base.len());
    for (i, row) in rows.iter().enumerate() {
        assert_eq!(row, &properties(base, i), "row {i}");
    }
}

/// Brush's reader.
#[test]
fn serde_ply_reads_the_base_of_an_augmented_scene() {
    #[derive(Deserialize)]
    struct File {
        vertex: Vec<BTreeMap<String, f32>>,
    }
    let (file, bytes) = augmented();
    let read: File = serde_ply::from_reader(&bytes[..]).unwrap();
    assert_is_base(&read.vertex, &file);
}

#[test]
fn ply_rs_reads_the_base_of_an_augmented_scene() {
    let (file, bytes) = augmented();
    let ply = Parser::<DefaultElement>::new().read_ply(&mut &bytes[..]).unwrap();
    assert_eq!(ply.payload.len(), 1);
    let number = |(name, value): (&String, &Property)| match value {
        Property::Float(v) => (name.clone(), *v),
        other => panic!("{name} is {other:?}"),
    };
    let rows: Vec<BTreeMap<String, f32>> = ply.payload["vertex"]
        .iter()
        .map(|row| row.iter().map(|(name, value)| number((name, value))).collect())
        .collect();
    assert_is_base(&rows, &file);
}

/// Prints the values of element `vertex`, property by property in the order of their names.
const PLYFILE: &str = "
import sys, numpy, plyfile
ply = plyfile.PlyData.read(sys.argv[1])
assert [element.name for element in ply.elements] == ['vertex']
vertex = ply['vertex']
columns = [vertex[name] for name in sorted(p.name for p in vertex.properties)]
sys.stdout.buffer.write(numpy.stack(columns, 1).astype('<f4').tobytes())
";

/// Points and their data in meshio's terms.
const MESHIO: &str = "
import sys, numpy, meshio
mesh = meshio.read(sys.argv[1], file_format='ply')
columns = dict(zip('xyz', mesh.points.T), **mesh.point_data)
sys.stdout.buffer.write(numpy.stack([columns[name] for name in sorted(columns)], 1).astype('<f4').tobytes())
";

/// `tools/setup test` installs them in target/readers; if they are missing, the test skips, except in CI.
#[test]
fn readers_in_python_read_the_base_of_an_augmented_scene() {
    let (file, bytes) = augmented();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("augmented.ply");
    fs::write(&path, bytes).unwrap();
    let installed = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/readers/bin/python3");
    let program = if installed.exists() { installed } else { "python3".into() };
    let required = std::env::var_os("GLINT_REQUIRE_READERS").is_some();
    for (script, needs) in [(PLYFILE, "import plyfile"), (MESHIO, "import meshio")] {
        let python = |script: &str| Command::new(&program).args(["-c", script]).arg(&path).output();
        if !python(needs).is_ok_and(|output| output.status.success()) {
            assert!(!required, "{} does not `{needs}`", program.display());
            eprintln!("skipped: {} does not `{needs}`", program.display());
            continue;
        }
        let output = python(script).unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let wanted = file.shown.as_ref().unwrap();
        let wanted = (0..wanted.len()).flat_map(|i| properties(wanted, i).into_values());
        let wanted: Vec<u8> = wanted.flat_map(f32::to_ne_bytes).collect();
        assert!(output.stdout == wanted, "{needs}: other numbers");
    }
}

/// The crate `gltf` does not know either extension: it validates the rest of the document, and reads the
/// accessors. What it does not check are requirements of glTF's specification without which other readers fail.
#[test]
fn the_crate_gltf_takes_a_glb_and_reads_its_numbers() {
    let (file, _) = augmented();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    write_scene_file(&path, &file).unwrap();
    let bytes = fs::read(&path).unwrap();
    let gltf = ::gltf::Gltf::from_slice_without_validation(&bytes).unwrap();
    let mut faults = Vec::new();
    let root = gltf.document.as_json();
    ::gltf::json::validation::Validate::validate(root, root, ::gltf::json::Path::new, &mut |path, error| {
        faults.push((path().to_string(), error));
    });
    // Extensions may define attribute names that it does not know.
    faults.retain(|(path, error)| !(path.contains("attributes") && matches!(error, Error::Invalid)));
    assert!(faults.is_empty(), "{faults:?}");

    let blob = gltf.blob.as_deref().unwrap();
    let shown = file.shown.as_ref().unwrap();
    let primitive = gltf.meshes().next().unwrap().primitives().next().unwrap();
    assert_eq!(primitive.mode(), ::gltf::mesh::Mode::Points);
    let reader = primitive.reader(|_| Some(blob));
    let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
    assert_eq!(positions, shown.means.iter().map(|&[x, y, z]| [-x, -y, z]).collect::<Vec<_>>());
    assert_eq!(primitive.get(&Semantic::Colors(0)).unwrap().count(), shown.len());
    let document: serde_json::Value =
        serde_json::from_slice(&::gltf::binary::Glb::from_slice(&bytes).unwrap().json).unwrap();
    assert_eq!(document["extensionsUsed"], json!(["KHR_gaussian_splatting", "GLINT_gaussian_lobes"]));
    assert_eq!(document["buffers"], json!([{"byteLength": blob.len()}]));
    for accessor in gltf.accessors() {
        let view = accessor.view().unwrap();
        assert_eq!((view.length(), view.offset() % 4), (accessor.count() * accessor.size(), 0), "{}", accessor.index());
    }
    let attribute = |name: &str| {
        let attributes = &document["meshes"][0]["primitives"][0]["attributes"];
        let index = attributes[format!("KHR_gaussian_splatting:{name}")].as_u64().unwrap() as usize;
        gltf.accessors().nth(index).unwrap()
    };
    let mut rotations = ::gltf::accessor::Iter::<[f32; 4]>::new(attribute("ROTATION"), |_| Some(blob)).unwrap();
    assert!(rotations.all(|q| (q.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-6));
    let scales = ::gltf::accessor::Iter::<[f32; 3]>::new(attribute("SCALE"), |_| Some(blob)).unwrap();
    assert_eq!(scales.collect::<Vec<_>>(), shown.log_scales.iter().map(|s| s.map(f32::exp)).collect::<Vec<_>>());
}
