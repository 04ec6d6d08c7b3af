//! Tests the GPU benchmark scripts on a machine without a GPU.

use std::os::unix::fs::{PermissionsExt, symlink};

use glint::data::{Dataset, DatasetOptions, Split};

use super::*;

/// `bench/gpu` with only the program packed, and without verification: tests/verify.rs covers that.
#[test]
fn the_run_on_a_gpu_works_on_any_device_and_tells_what_failed() {
    let work = Work::new();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("bench/gpu");
    fs::create_dir(work.path("packed")).unwrap();
    symlink(&script, work.path("packed/gpu")).unwrap();
    let program = env!("CARGO_BIN_EXE_glint");
    let text = format!("#!/bin/sh\n[ \"$1\" != verify ] || set -- devices --json\nexec '{program}' \"$@\"\n");
    fs::write(work.path("packed/glint"), text).unwrap();
    fs::set_permissions(work.path("packed/glint"), fs::Permissions::from_mode(0o755)).unwrap();
    fs::create_dir(work.path("all")).unwrap();
    symlink(work.path("data"), work.path("all/garden")).unwrap();
    // A fake Python that has gsplat's requirements while the file `there` exists; gsplat itself then fails.
    symlink(script.with_file_name("gsplat_mcmc.py"), work.path("packed/gsplat_mcmc.py")).unwrap();
    fs::create_dir(work.path("python")).unwrap();
    let there = work.path("there");
    let text = format!(
        "#!/bin/sh\n[ -e '{}' ] || {{ echo '\"torch\" \\ none' >&2; exit 1; }}\n[ \"$1\" = -c ] || exit 3\n",
        there.display()
    );
    fs::write(work.path("python/python3"), text).unwrap();
    fs::set_permissions(work.path("python/python3"), fs::Permissions::from_mode(0o755)).unwrap();
    fs::write(&there, "").unwrap();
    let path = format!("{}:{}", work.path("python").display(), std::env::var("PATH").unwrap());

    let run = |options: &str| {
        let mut command = Command::new(work.path("packed/gpu"));
        let output = command
            .args(["run", "--tiny", "-o", "found.json"])
            .args(options.split(' '))
            .env("PATH", &path)
            .current_dir(work.path("."))
            .output()
            .unwrap();
        let found: Value = serde_json::from_slice(&fs::read(work.path("found.json")).unwrap()).unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap(), found)
    };
    let (code, said, found) = run("all");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("frame is not packed") && said.contains("no dataset bonsai"), "{said}");
    assert!(found["verify"][0]["name"].is_string());
    assert_eq!(
        (&found["tests"], &found["frames"], &found["steps"]),
        (&Value::Array(vec![]), &Value::Array(vec![]), &Value::Array(vec![]))
    );
    let [scene] = &found["scenes"].as_array().unwrap()[..] else { panic!("{found}") };
    assert!(scene["train"]["gaussians"].as_u64().unwrap() > 0 && scene["enhance"].is_object());
    let psnr = |part: &str| scene[part]["augmented"]["psnr"].as_f64().unwrap();
    assert!(psnr("base") > 5.0 && psnr("augmented") > 5.0);
    // Failures of programs other than glint only appear in the results.
    let [beside] = &found["gsplat"].as_array().unwrap()[..] else { panic!("{found}") };
    assert_eq!(
        (&beside["scene"], &beside["gsplat"]["failed"], &beside["train"]["iterations"]),
        (&"garden".into(), &3.into(), &20.into())
    );
    assert!(beside["base"]["base"]["psnr"].as_f64().unwrap() > 5.0, "{beside}");

    fs::remove_file(there).unwrap();
    fs::remove_dir_all(work.path("data/images")).unwrap();
    let (code, said, found) = run("all");
    assert_eq!((code, &found["scenes"][0]["train"]["failed"]), (Some(1), &Value::from(2)), "{said}");
    assert!(said.contains("failed with 2") && said.contains("images"), "{said}");
    assert_eq!(found["gsplat"]["absent"], "\"torch\" \\ none");

    // A piece without time left is reported as such.
    let (code, _, found) = run("all --within 0");
    assert_eq!(
        (code, &found["devices"]["failed"], &found["scenes"][0]["train"]["failed"]),
        (Some(1), &124.into(), &124.into())
    );
    assert_eq!(found["gsplat"]["absent"], "python3 gave no answer");
}

/// Only if Python is installed; reading a model needs no torch.
#[test]
fn what_gsplat_is_given_are_the_cameras_that_glint_has() {
    let Some(garden) = shared::shared("small/garden") else { return };
    let text = "import json, sys, pathlib, gsplat_mcmc as g
photos, points = g.read_model(pathlib.Path(sys.argv[1]) / 'sparse/0')
print(json.dumps([len(points), [[p.name, p.camera.size, p.camera.K, g.rotation(*p.quat), p.translation] for p in photos]]))
assert (g.fit(4946, 3286, 1600), g.fit(30, 45, 20), g.fit(8, 6, 8)) == ((1600, 1063), (13, 20), (8, 6))
assert g.schedule(7000, 9) == {'cap_max': 9, 'refine_start_iter': 116, 'refine_stop_iter': 5833, 'refine_every': 23}";
    let mut python = Command::new("python3");
    python.args(["-c", text]).arg(&garden).current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("bench"));
    let Ok(output) = python.env("PYTHONDONTWRITEBYTECODE", "1").output() else {
        eprintln!("skipped: there is no python3");
        return;
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    type Given = (String, [u32; 2], [f64; 4], [[f64; 3]; 3], [f64; 3]);
    let (points, photos): (usize, Vec<Given>) = serde_json::from_slice(&output.stdout).unwrap();
    let data = Dataset::open(&garden, &DatasetOptions::default()).unwrap();
    assert_eq!((points, photos.len()), (data.points.as_ref().unwrap().positions.len(), data.photos.len()));
    for (i, ((name, size, k, rotation, translation), photo)) in photos.iter().zip(&data.photos).enumerate() {
        let camera = &photo.camera;
        assert_eq!((name, *size), (&photo.name, [camera.width, camera.height]));
        let ours =
            [[camera.fx, camera.fy, camera.cx].as_slice(), &[camera.cy], &camera.translation.to_array()].concat();
        // JSON parsing is exact to a unit in the last place.
        assert!(k.iter().chain(translation).zip(ours).all(|(a, b)| (a - b).abs() < 1e-12 * b.abs()), "{name}");
        assert_eq!(i % 8 == 0, photo.split == Split::Test);
        let theirs = DMat3::from_cols_array_2d(rotation).transpose();
        assert!((theirs - camera.rotation).to_cols_array().iter().all(|v| v.abs() < 1e-12), "{name}");
    }
}
