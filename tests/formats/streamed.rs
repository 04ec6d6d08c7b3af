//! Tests streamed SOG.

use serde_json::{Value, json};

use super::*;

/// A scene of so many Gaussians in a cube of 10 units, half of them in its upper eighth.
fn cube(count: usize) -> Scene {
    let mut scene = sample(7, count, 0);
    for (i, mean) in scene.base.means.iter_mut().enumerate() {
        let hash = |k: u64| (i as u64 * 3 + k).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
        *mean = [0, 1, 2].map(|axis| hash(axis) as f32 / (1 << 24) as f32 * if i % 2 == 0 { 10.0 } else { 1.25 });
    }
    scene
}

fn write(folder: &Path, scene: &Scene, levels: u8) -> (PathBuf, Value) {
    let path = folder.join("web").join("lod-meta.json");
    write_scene_as(&path, format("lod-meta.json").with_levels(levels).unwrap(), &scene.clone().into()).unwrap();
    let index = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    (path, index)
}

fn leaves<'a>(node: &'a Value, out: &mut Vec<&'a Value>) {
    match node["children"].as_array() {
        Some(children) => children.iter().for_each(|child| leaves(child, out)),
        None => out.push(node),
    }
}

#[test]
fn leaves_name_their_gaussians_at_each_level() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cube(70_000);
    let (path, index) = write(folder.path(), &scene, 3);
    assert_eq!((&index["counts"], &index["lodLevels"]), (&json!([70_000, 35_000, 17_500]), &json!(3)));
    let mut found = Vec::new();
    leaves(&index["tree"], &mut found);
    // Cut in half once, so that no leaf has more than 65,536.
    assert_eq!(found.len(), 2);
    for level in 0..3 {
        let unit = read_scene(path.with_file_name(format!("{level}_0"))).unwrap().base;
        assert_eq!(index["counts"][level], unit.len());
        let mut next = 0;
        for leaf in &found {
            let range = &leaf["lods"][level.to_string()];
            let [file, offset, count] = ["file", "offset", "count"].map(|of| range[of].as_u64().unwrap() as usize);
            assert_eq!((&index["filenames"][file], offset), (&json!(format!("{level}_0/meta.json")), next));
            next += count;
            // Boxes hold the means, to SOG's 16 bits: 10 units in 65,535 steps of a logarithm.
            let bound = |end: &str, axis: usize| leaf["bound"][end][axis].as_f64().unwrap();
            let inside = |mean: &[f32; 3]| {
                (0..3).all(|axis| {
                    let v = f64::from(mean[axis]);
                    bound("min", axis) <= v + 1e-3 && v <= bound("max", axis) + 1e-3
                })
            };
            assert!(unit.means[offset..next].iter().all(inside), "level {level}");
        }
        assert_eq!(next, unit.len());
    }
    let back = read_scene(&path).unwrap().base;
    assert_eq!(back, read_scene(path.parent().unwrap()).unwrap().base);
    let sorted = |means: &[[f32; 3]]| {
        let mut all: Vec<f32> = means.iter().map(|mean| mean[0]).collect();
        all.sort_by(f32::total_cmp);
        all
    };
    let off = sorted(&back.means).iter().zip(sorted(&scene.base.means)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(off < 1e-3, "{off}");
}

#[test]
fn a_folder_is_replaced_as_a_whole_and_always_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let all = |folder: &Path| {
        let mut files: Vec<(PathBuf, Vec<u8>)> = fs::read_dir(folder)
            .unwrap()
            .flat_map(|entry| match entry.unwrap().path() {
                path if path.is_dir() => fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()).collect(),
                path => vec![path],
            })
            .map(|path| (path.clone(), fs::read(path).unwrap()))
            .collect();
        files.sort();
        files
    };
    let (path, _) = write(folder.path(), &sample(8, 300, 1), 2);
    let web = path.parent().unwrap();
    let first = all(web);
    write(folder.path(), &sample(9, 200, 0), 4);
    assert_ne!(all(web), first);
    write(folder.path(), &sample(8, 300, 1), 2);
    assert_eq!(all(web), first);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(web, folder.path().join("link")).unwrap();
        write_scene_file(folder.path().join("link/lod-meta.json"), &sample(8, 10, 0).into()).unwrap();
        assert!(fs::read_link(folder.path().join("link")).is_ok() && all(web) != first);
        fs::remove_file(folder.path().join("link")).unwrap();
        write(folder.path(), &sample(8, 300, 1), 2);
    }
    fs::write(web.join("notes.txt"), "mine").unwrap();
    let refused = write_scene_file(&path, &sample(8, 10, 0).into()).unwrap_err().to_string();
    assert!(refused.contains("notes.txt"), "{refused}");
    assert!(all(web).len() == first.len() + 1 && fs::read_dir(folder.path()).unwrap().count() == 1);
}

#[test]
fn an_index_that_is_wrong_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (path, index) = write(folder.path(), &sample(6, 50, 0), 2);
    let refused = |change: &dyn Fn(&mut Value), words: &[&str]| {
        let mut index = index.clone();
        change(&mut index);
        fs::write(&path, index.to_string()).unwrap();
        let message = read_scene(&path).unwrap_err().to_string();
        assert!(words.iter().chain(&["lod-meta.json"]).all(|word| message.contains(word)), "{message}");
    };
    refused(&|index| index["version"] = 2.into(), &["version 2"]);
    refused(&|index| index["tree"]["lods"]["0"]["file"] = 9.into(), &["file 9"]);
    refused(&|index| index["tree"]["lods"]["0"]["count"] = 51.into(), &["51 Gaussians", "which has 50"]);
    refused(&|index| index["tree"]["lods"]["0"]["offset"] = 1.into(), &["from 1 on", "which has 50"]);
    refused(&|index| index["filenames"][0] = "../a/meta.json".into(), &["../a/meta.json", "beside"]);
    refused(&|index| index["filenames"][0] = "5_0/meta.json".into(), &["5_0/meta.json", "cannot be read"]);
    refused(&|index| index["environment"] = "0_0/meta.json".into(), &["0_0/meta.json", "twice"]);
    refused(&|index| index["tree"] = 1.into(), &["not understood"]);
    // An environment is part of the scene, and leaves without the finest level show what they have.
    let mut index = index.clone();
    index["environment"] = "0_0/meta.json".into();
    index["tree"]["lods"].as_object_mut().unwrap().remove("0");
    fs::write(&path, index.to_string()).unwrap();
    assert_eq!(read_scene(&path).unwrap().base.len(), 25 + 50);
}
