//! Tests datasets far from the world's origin, like those of drones.

use std::fmt::Write;

use glint::data::{Dataset, DatasetOptions, write_png_bytes};

use super::*;

/// Writes nine photos of a dataset at 64 pixels and 800 of its points as a COLMAP text model to `folder`,
/// translated by `by`.
fn moved(dataset: &Dataset, by: DVec3, folder: &Path) {
    let model = folder.join("sparse/0");
    fs::create_dir_all(&model).unwrap();
    fs::create_dir_all(folder.join("images")).unwrap();
    let (mut cameras, mut images, mut points) = (String::new(), String::new(), String::new());
    for (i, photo) in dataset.photos.iter().step_by(dataset.photos.len() / 9).take(9).enumerate() {
        let image = photo.load([0.0; 3]).unwrap();
        write_png_bytes(folder.join(format!("images/{i}.png")), image.width, image.height, &image.rgb).unwrap();
        // The camera, translated along with the eye.
        let camera = photo.camera.around(-by);
        let Camera { width, height, fx, fy, cx, cy, .. } = camera;
        writeln!(cameras, "{} PINHOLE {width} {height} {fx} {fy} {cx} {cy}", i + 1).unwrap();
        let (q, t) = (DQuat::from_mat3(&camera.rotation), camera.translation);
        writeln!(images, "{0} {1} {2} {3} {4} {5} {6} {7} {0} {8}.png\n", i + 1, q.w, q.x, q.y, q.z, t.x, t.y, t.z, i)
            .unwrap();
    }
    let cloud = dataset.points.as_ref().unwrap();
    for (i, (&at, [r, g, b])) in
        cloud.positions.iter().zip(&cloud.colors).step_by(cloud.positions.len() / 800).enumerate()
    {
        let [x, y, z] = (DVec3::from_array(at) + by).to_array();
        writeln!(points, "{i} {x} {y} {z} {r} {g} {b} 0.5").unwrap();
    }
    for (name, text) in [("cameras", cameras), ("images", images), ("points3D", points)] {
        fs::write(model.join(format!("{name}.txt")), text).unwrap();
    }
}

/// A regression test: it was 19.53 dB instead of 26.76, since a PLY's float32 has steps of half a unit there.
#[test]
fn a_georeferenced_scene_is_as_good_as_at_home() {
    let Some(garden) = shared::shared("small/garden") else { return };
    let dataset = Dataset::open(&garden, &DatasetOptions { max_size: Some(64), ..Default::default() }).unwrap();
    let work = Work::new();
    let utm = DVec3::new(5e5, 4.5e6, 120.0);
    let mut found = Vec::new();
    for (name, by) in [("home", DVec3::ZERO), ("there", utm)] {
        moved(&dataset, by, &work.path(name));
        let said = work.said(&format!("train {name} -o {name}.ply --iterations 200 --gaussians 800 --deterministic"));
        // Reported before the first step.
        assert_eq!(said.contains("note: the cameras are far from the world's origin"), name == "there", "{said}");
        let report = work.json(&format!("eval {name}.ply {name} --split all --json"));
        found.push(report["augmented"]["psnr"].as_f64().unwrap());
    }
    println!("{found:?}");
    assert!((found[0] - found[1]).abs() < 0.1 && found[0] > 18.0, "{found:?}");
    let header = String::from_utf8_lossy(&fs::read(work.path("there.ply")).unwrap()).into_owned();
    let origin = read_scene(work.path("there.ply")).unwrap().origin;
    assert!(origin.distance(utm) < 10.0 && header.contains(&format!("comment origin {} {}", origin.x, origin.y)));
    // Another format holds the same scene; one that cannot store the origin gives a note, and shows nothing
    // there. tests/formats/far.rs has the origins of all formats.
    for file in ["there.sog", "there.splat"] {
        let said = work.said(&format!("convert there.ply {file}"));
        if file == "there.splat" {
            assert!(said.contains("there.splat: positions count from (") && said.contains("does not keep"), "{said}");
            let lost =
                work.json(&format!("eval {file} there --split all --json"))["augmented"]["psnr"].as_f64().unwrap();
            assert!(lost < found[1] - 5.0, "{lost}");
            continue;
        }
        assert!(said.is_empty(), "{said}");
        let psnr = work.json(&format!("eval {file} there --split all --json"))["augmented"]["psnr"].as_f64().unwrap();
        assert!((psnr - found[1]).abs() < 0.5, "{file}: {psnr} of {found:?}");
    }
    // Training and augmentation of the file keep its origin.
    work.ok("train there --init there.ply -o more.ply --iterations 20 --gaussians 800");
    work.ok("enhance there --base there.ply -o augmented.ply --ratio 0.1");
    for file in ["more.ply", "augmented.ply"] {
        let psnr = work.json(&format!("eval {file} there --split all --json"))["augmented"]["psnr"].as_f64().unwrap();
        assert!(psnr > found[1] - 0.3, "{file}: {psnr} of {found:?}");
    }
    assert_eq!(read_scene(work.path("augmented.ply")).unwrap().origin, origin);
}
