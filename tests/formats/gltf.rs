//! Tests glTF and GLB.

use glint::scene::Supplement;
use serde_json::{Value, json};

use super::*;

/// Two Gaussians of degree 1 in glTF's frame, as a document and its buffer, built from the extension's
/// description.
fn document() -> (Value, Vec<u8>) {
    let (mut bytes, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    let mut attributes = serde_json::Map::new();
    let mut put = |name: &str, shape: &str, values: &[f32]| {
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": 4 * values.len()}));
        bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        accessors.push(json!({"bufferView": accessors.len(), "componentType": 5126, "count": 2, "type": shape}));
        attributes.insert(name.into(), (accessors.len() - 1).into());
    };
    put("POSITION", "VEC3", &[1.0, 2.0, 3.0, -4.0, 5.0, -6.0]);
    put("KHR_gaussian_splatting:ROTATION", "VEC4", &[0.0, 0.6, 0.8, 0.0, 0.6, 0.0, 0.0, 0.8]);
    put("KHR_gaussian_splatting:SCALE", "VEC3", &[1.0, 0.5, 0.0, 2.0, 2.0, 2.0]);
    put("KHR_gaussian_splatting:OPACITY", "SCALAR", &[0.5, 1.0]);
    put("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", "VEC3", &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
    put("KHR_gaussian_splatting:SH_DEGREE_1_COEF_0", "VEC3", &[1.0, 2.0, 3.0, 0.0, 0.0, 0.0]);
    put("KHR_gaussian_splatting:SH_DEGREE_1_COEF_1", "VEC3", &[4.0, 5.0, 6.0, 0.0, 0.0, 0.0]);
    put("KHR_gaussian_splatting:SH_DEGREE_1_COEF_2", "VEC3", &[7.0, 8.0, 9.0, 0.0, 0.0, 0.0]);
    let splatting = json!({"kernel": "ellipse", "colorSpace": "srgb_rec709_display"});
    let document = json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_gaussian_splatting"],
        "extensionsRequired": ["KHR_gaussian_splatting"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "n"}],
        "meshes": [{"primitives": [
            {"mode": 4, "attributes": {"POSITION": 0}},
            {"mode": 0, "attributes": attributes, "extensions": {"KHR_gaussian_splatting": splatting}},
        ]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": bytes.len()}],
    });
    (document, bytes)
}

fn glb(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut out = b"glTF".to_vec();
    out.extend([2, 28 + json.len() + binary.len(), json.len()].iter().flat_map(|&v| (v as u32).to_le_bytes()));
    out.extend(b"JSON");
    out.extend(&json);
    out.extend((binary.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(binary);
    out
}

/// Reads the document after a change.
fn changed(change: impl FnOnce(&mut Value)) -> Result<SceneFile, String> {
    let (mut document, binary) = document();
    change(&mut document);
    read("a.glb", &glb(&document, &binary))
}

/// Cesium writes drafts with the attributes in an SPZ scene, in another frame than glTF's.
#[test]
fn an_spz_scene_in_a_buffer_view_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let scene = SceneFile {
        trained_with: TrainedWith { antialiased: Some(true), ..Default::default() },
        ..sample(7, 40, 2).into()
    };
    let path = folder.path().join("a.spz");
    for version in [2, 3, 4] {
        write_scene_as(&path, spz(version), &scene).unwrap();
        let plain = read_scene_file(&path).unwrap();
        let mut spz = std::fs::read(&path).unwrap();
        let length = spz.len();
        spz.resize(length.next_multiple_of(4), 0);
        let at = json!({"bufferView": 0});
        let splatting = |name: &str| json!({"KHR_gaussian_splatting": {"extensions": {name: at}}});
        for (name, extensions) in [
            ("KHR_gaussian_splatting_compression_spz_2", splatting("KHR_gaussian_splatting_compression_spz_2")),
            ("KHR_gaussian_splatting_compression_spz", splatting("KHR_gaussian_splatting_compression_spz")),
            ("KHR_spz_gaussian_splats_compression", json!({"KHR_spz_gaussian_splats_compression": at})),
            ("KHR_spz_compression", json!({"KHR_spz_compression": at})),
        ] {
            let document = |node: Value| {
                json!({
                    "asset": {"version": "2.0"},
                    "extensionsRequired": [name],
                    "scenes": [{"nodes": [0]}],
                    "nodes": [node],
                    // Accessors without a buffer view give the attributes' shape.
                    "meshes": [{"primitives": [{"mode": 0, "attributes": {"POSITION": 0}, "extensions": extensions}]}],
                    "accessors": [{"componentType": 5126, "count": 40, "type": "VEC3"}],
                    "bufferViews": [{"buffer": 0, "byteLength": length}],
                    "buffers": [{"byteLength": spz.len()}],
                })
            };
            let found = read("a.glb", &glb(&document(json!({"mesh": 0})), &spz)).unwrap();
            assert_eq!(found, plain, "{name}, version {version}");
            // A node moves along glTF's axes: x left, y up.
            let moved = document(json!({"mesh": 0, "translation": [10, 20, 30]}));
            let moved = read("a.glb", &glb(&moved, &spz)).unwrap().scene.base;
            for (a, b) in moved.means.iter().zip(&plain.scene.base.means) {
                assert!((0..3).all(|k| (a[k] - b[k] - [-10.0, -20.0, 30.0][k]).abs() < 1e-4), "{a:?} {b:?}");
            }
            let mut bad = document(json!({"mesh": 0}));
            bad["bufferViews"][0]["byteLength"] = 20.into();
            refused("a.glb", &glb(&bad, &spz), &["bufferView 0", "primitive 0 of mesh 0"]);
        }
    }
}

#[test]
fn splats_are_read_as_described_and_turned_to_the_frame_of_ply() {
    let (document, binary) = document();
    let base = read("a.glb", &glb(&document, &binary)).unwrap().scene.base;
    assert_eq!(base.means, [[-1.0, -2.0, 3.0], [4.0, -5.0, -6.0]]);
    // x, y, z, w rotated by 180° about z.
    assert_eq!(base.quats, [[0.0, 0.0, -0.6, 0.8], [0.8, -0.6, 0.0, 0.0]]);
    let [one, half, flat] = base.log_scales[0];
    assert!(one == 0.0 && half == 0.5f32.ln() && flat < -87.0 && flat.is_finite());
    assert!(base.opacities[0] == 0.0 && base.opacities[1] > 15.0 && base.opacities[1].is_finite());
    assert_eq!(base.sh[..4], [[0.1, 0.2, 0.3], [-1.0, -2.0, -3.0], [4.0, 5.0, 6.0], [-7.0, -8.0, -9.0]]);

    // The same bytes in base64, and in a file next to the document.
    let mut other = document.clone();
    let text = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, &binary);
    other["buffers"][0]["uri"] = format!("data:application/octet-stream;base64,{text}").into();
    assert_eq!(read("a.gltf", other.to_string().as_bytes()).unwrap().scene.base, base);
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("b c.bin"), &binary).unwrap();
    other["buffers"][0]["uri"] = "b%20c.bin".into();
    fs::write(folder.path().join("a.gltf"), other.to_string()).unwrap();
    assert_eq!(read_scene(folder.path().join("a.gltf")).unwrap().base, base);
    for uri in ["../b c.bin", "/b c.bin", "https://example.org/b.bin", "none.bin", "%zz"] {
        other["buffers"][0]["uri"] = uri.into();
        fs::write(folder.path().join("a.gltf"), other.to_string()).unwrap();
        let error = read_scene(folder.path().join("a.gltf")).unwrap_err().to_string();
        assert!(error.contains("a.gltf") && error.contains(uri), "{error}");
    }
}

#[test]
fn components_may_be_integers_and_elements_may_have_gaps() {
    let (mut document, mut binary) = document();
    // One view with two rows of 12 bytes: rotation as normalised shorts, then opacity as a normalised byte.
    let begin = binary.len();
    for (rotation, opacity) in [([0i16, 0, 0, 32767], 51), ([0, -32767, 0, 0], 255u8)] {
        binary.extend(rotation.iter().flat_map(|v| v.to_le_bytes()));
        binary.extend([opacity, 0, 0, 0]);
    }
    document["buffers"][0]["byteLength"] = binary.len().into();
    let view = json!({"buffer": 0, "byteOffset": begin, "byteLength": 24, "byteStride": 12});
    document["bufferViews"].as_array_mut().unwrap().push(view);
    document["accessors"][1] =
        json!({"bufferView": 8, "componentType": 5122, "normalized": true, "count": 2, "type": "VEC4"});
    document["accessors"][3] = json!({"bufferView": 8, "byteOffset": 8, "componentType": 5121, "normalized": true, "count": 2, "type": "SCALAR"});
    let base = read("a.glb", &glb(&document, &binary)).unwrap().scene.base;
    assert_eq!(base.quats, [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]].map(|q| q.map(|v: f32| v + 0.0)));
    assert!((opacity(&base, 0)[0] - 0.2).abs() < ROUNDING && opacity(&base, 1)[0] > 0.999);
    document["bufferViews"][8]["byteStride"] = 4.into();
    refused("a.glb", &glb(&document, &binary), &["accessor 1", "byteStride of 4, expected 8"]);
}

#[test]
fn nodes_place_what_they_hold() {
    let there = changed(|document| {
        // A quarter turn about y, scaled by two, five to the left of its parent, which is one up.
        let half = 0.5f64.sqrt();
        document["scenes"][0]["nodes"] = json!([1]);
        document["nodes"] = json!([
            {"mesh": 0, "rotation": [0, half, 0, half], "scale": [2, 2, 2], "translation": [5, 0, 0]},
            {"children": [0], "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,1,0,1]},
        ]);
    });
    let base = there.unwrap().scene.base;
    // (1, 2, 3) becomes (2·3 + 5, 2·2 + 1, −2·1).
    assert!(near(&base.means[0], &[-11.0, -5.0, -2.0]), "{:?}", base.means[0]);
    assert!(near(&base.log_scales[1], &[4f32.ln(); 3]));
    // Degree 1 is −y, z and −x; z becomes x, and x becomes −z.
    assert!(
        near(base.sh[1..4].as_flattened(), &[-1.0, -2.0, -3.0, 7.0, 8.0, 9.0, 4.0, 5.0, 6.0]),
        "{:?}",
        &base.sh[1..4]
    );
    let twice = changed(|document| {
        document["scenes"][0]["nodes"] = json!([0, 1]);
        document["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "translation": [1, 0, 0]}]);
    });
    let twice = twice.unwrap().scene.base;
    assert_eq!((twice.len(), twice.means[2]), (4, [-2.0, -2.0, 3.0]));
}

#[test]
fn drafts_with_logarithms_of_scales_are_read() {
    let (document, mut binary) = document();
    let logarithms = [-1.0f32, -2.5, -3.0, -4.0, 0.5, -6.0];
    let at = 24 + 32;
    binary[at..at + 24].copy_from_slice(&logarithms.map(f32::to_le_bytes).concat());
    let base = read("a.glb", &glb(&document, &binary)).unwrap().scene.base;
    assert_eq!(base.log_scales.as_flattened(), logarithms);
    // A single negative number among linear scales is a fault.
    binary[at..at + 24].copy_from_slice(&[1.0f32, 1.0, 1.0, 1.0, -1.0, 1.0].map(f32::to_le_bytes).concat());
    refused("a.glb", &glb(&document, &binary), &["row 1", "`scale_1` is not a finite number"]);
    dropped("a.glb", &glb(&document, &binary), 1, 1);
}

#[test]
fn all_of_an_augmented_scene_comes_back() {
    for degree in [3, 0] {
        let mut scene = random_scene(5, 300, 80, 3);
        scene.supplement = scene.supplement.map(|s| Supplement { gaussians: s.gaussians.with_degree(degree), ..s });
        // Other viewers show the base from before training.
        let shown = random_scene(6, 250, 0, 3).base;
        let file = SceneFile { shown: Some(shown.clone()), ..scene.clone().into() };
        let (back, _) = kept(&file, format("a.glb"));
        let Supplement { gaussians, lobes } = back.scene.supplement.unwrap();
        let wanted = scene.supplement.as_ref().unwrap();
        assert_eq!(lobes, wanted.lobes);
        let pairs = [(&scene.base, &back.scene.base), (&shown, &back.shown.unwrap()), (&wanted.gaussians, &gaussians)];
        for (a, b) in pairs {
            assert_eq!((&a.means, &a.sh, a.sh_degree), (&b.means, &b.sh, b.sh_degree));
            // exp and ln of float32; a rotation of length 1.
            assert!(largest(a, b, log_scales) < 1e-6 && largest(a, b, opacity) < 1e-6 && turned(a, b) < 1e-6);
        }
    }
}

#[test]
fn what_is_not_understood_is_said() {
    let says = |change: &dyn Fn(&mut Value), words: &[&str]| says(changed(change), words);
    let splats = "/meshes/0/primitives/1";
    let set = |at: &str, value: Value| {
        let at = at.to_owned();
        move |document: &mut Value| *document.pointer_mut(&at).unwrap() = value.clone()
    };
    let remove = |at: &str, name: &str| {
        let (at, name) = (at.to_owned(), name.to_owned());
        move |document: &mut Value| drop(document.pointer_mut(&at).unwrap().as_object_mut().unwrap().remove(&name))
    };
    says(
        &set("/extensionsRequired", json!(["KHR_draco_mesh_compression"])),
        &["requires", "KHR_draco_mesh_compression"],
    );
    says(&set(&format!("{splats}/mode"), json!(4)), &["primitive 1 of mesh 0", "mode 4"]);
    says(&remove(splats, "extensions"), &["no primitive with `KHR_gaussian_splatting`"]);
    let kernel = format!("{splats}/extensions/KHR_gaussian_splatting/kernel");
    says(&set(&kernel, json!("disc")), &["kernel `disc`"]);
    let space = format!("{splats}/extensions/KHR_gaussian_splatting/colorSpace");
    says(&set(&space, json!("lin_rec709_display")), &["`lin_rec709_display`", "expected `srgb"]);
    let attributes = format!("{splats}/attributes");
    for name in ["POSITION", "KHR_gaussian_splatting:ROTATION", "KHR_gaussian_splatting:SH_DEGREE_1_COEF_2"] {
        says(&remove(&attributes, name), &["primitive 1", &format!("lacks the attribute `{name}`")]);
    }
    says(&set("/scenes/0/nodes", json!([3])), &["node 3, but has 1"]);
    says(&set("/nodes", json!([{"children": [0]}])), &["node 0 twice"]);
    says(&set("/nodes/0", json!({"mesh": 0, "scale": [1, 2, 1]})), &["matrix"]);
    says(&set("/nodes/0", json!({"mesh": 0, "rotation": [0, 0, 0, 0]})), &["matrix"]);
    says(&set("/nodes/0", json!({"mesh": 7})), &["mesh 7, but has 1"]);
    says(&set("/accessors/0/count", json!(3)), &["accessor 0 (POSITION)", "3 elements", "24 bytes"]);
    says(&set("/accessors/0/count", json!(u64::MAX)), &["accessor 0 (POSITION)", "18446744073709551615 elements"]);
    says(&set("/accessors/1/count", json!(1)), &["1 values of `KHR_gaussian_splatting:ROTATION`, expected 2"]);
    says(&set("/accessors/0/type", json!("VEC4")), &["VEC4, expected VEC3"]);
    says(&set("/accessors/0/componentType", json!(5124)), &["type 5124"]);
    says(&remove("/accessors/0", "bufferView"), &["has no bufferView"]);
    says(
        &set("/accessors/0", json!({"bufferView": 0, "componentType": 5126, "count": 2, "type": "VEC3", "sparse": {}})),
        &["sparse"],
    );
    says(&set("/bufferViews/0/byteLength", json!(1u64 << 40)), &["bufferView 0", "1099511627776 bytes"]);
    says(&set("/bufferViews/0/byteOffset", json!(u64::MAX)), &["bufferView 0"]);
    says(&set("/bufferViews/0/buffer", json!(1)), &["buffer 1, but has 1"]);
    says(
        &set("/bufferViews/0", json!({"buffer": 0, "byteLength": 24, "extensions": {"EXT_meshopt_compression": {}}})),
        &["EXT_meshopt_compression"],
    );
    says(&set("/buffers/0/byteLength", json!(1_000_000)), &["buffer 0 has", "expected 1000000"]);
    says(&set("/accessors", json!("none")), &["is not a valid glTF"]);
    // 1,000 nodes with one mesh of two Gaussians are 2,000 Gaussians of a small file; a million nodes are a
    // bomb.
    let many = |count: usize, name: usize| {
        let text = vec![json!({"mesh": 0}); count];
        changed(|document| {
            document["meshes"][0]["name"] = "m".repeat(name).into();
            document["nodes"] = text.into();
            document["scenes"][0]["nodes"] = (0..count).collect::<Vec<_>>().into();
        })
    };
    assert_eq!(many(1000, 1).unwrap().scene.base.len(), 2000);
    super::says(many(10_000, 100_000), &["bytes of meshes", "expected no more than"]);
}

/// The document is a hundredth of the size of its files.
#[test]
fn buffers_in_files_of_their_own_may_be_large() {
    let folder = tempfile::tempdir().unwrap();
    let scene = sample(3, 30_000, 0);
    write_scene_file(folder.path().join("a.glb"), &scene.into()).unwrap();
    let bytes = fs::read(folder.path().join("a.glb")).unwrap();
    let json = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut document: Value = serde_json::from_slice(&bytes[20..20 + json]).unwrap();
    document["buffers"][0]["uri"] = "a.bin".into();
    fs::write(folder.path().join("a.bin"), &bytes[28 + json..]).unwrap();
    fs::write(folder.path().join("a.gltf"), document.to_string()).unwrap();
    let there = |name: &str| read_scene(folder.path().join(name)).unwrap();
    assert_eq!(there("a.gltf"), there("a.glb"));
}

#[test]
fn damage_is_an_error() {
    let (document, binary) = document();
    let bytes = glb(&document, &binary);
    damage("damaged.glb", &bytes, |_| false);
    refused("a.glb", &[&bytes[..4], &[1, 0, 0, 0], &bytes[8..]].concat(), &["GLB version 1"]);
    refused("a.glb", &[&bytes[..], b"more"].concat(), &["by its header"]);
    refused("a.gltf", b"{\"asset\":", &["not a valid glTF"]);
}
