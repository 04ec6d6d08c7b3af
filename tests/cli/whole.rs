//! `glint run`: all commands from photos to a page.

use super::*;
use glint::data::read_scene;

#[test]
fn photos_become_a_scene_a_report_and_a_page() {
    let work = Work::new();
    fs::write(work.path("data/transforms.json"), "{}").unwrap();
    let run = "run data -o out --preset draft --sh-degree 0 --background 0.2,0.2,0.2";
    let found = work.json(&format!("{run} --json"));
    assert_eq!(keys(&found), set("output seconds commands train enhance scenes"));
    // 7 photos have 5,376 pixels, hence at most 336 Gaussians of 56 bytes; 65 % are for the base.
    assert_eq!(found["train"]["gaussians"], 218);
    assert!(found["enhance"]["bytes_added"].as_u64().unwrap() <= (336 - 218) * 56, "{found}");
    let names: Vec<&str> = found["scenes"].as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["base", "scene"]);
    let written =
        "base.history base.history.jsonl base.ply enhance.json report run.json scene.html scene.ply train.json";
    assert_eq!(files(&work.path("out")).join(" "), written);
    assert_eq!(files(&work.path("out/report")), ["index.html", "report.json"]);
    // The base's five evaluations are curves of PSNR and SSIM over seconds, bytes and Gaussians.
    assert_eq!(fs::read_to_string(work.path("out/base.history.jsonl")).unwrap().lines().count(), 5);
    assert_eq!(fs::read_to_string(work.path("out/report/index.html")).unwrap().matches("<svg").count(), 6);
    let info = work.ok("info out/scene.ply");
    assert!(info.contains("0.2"), "the scene has its settings: {info}");

    assert_eq!(
        found["commands"][0],
        "glint train data --sh-degree 0 --gaussians 218 --points 109 --iterations 2000 -o out/base.ply --eval-every 400 \
         --max-size 640 --background 0.2,0.2,0.2"
    );

    // A second run has nothing to do, and one after an interruption does what is left.
    let before = work.listing();
    let again = work.run(run);
    let said = String::from_utf8_lossy(&again.stderr).into_owned();
    assert!(again.status.success() && said.matches(" done before: glint ").count() == 4, "{said}");
    assert!(String::from_utf8_lossy(&again.stdout).contains("out/report/index.html"));
    assert_eq!(work.listing(), before);
    // Commands after an unfinished one run again.
    fs::remove_file(work.path("out/report/index.html")).unwrap();
    let said = work.said(run);
    assert!(said.contains("2/4 done before") && said.contains("3/4: glint report"), "{said}");
    assert!(said.contains("4/4: glint export"), "{said}");
    // Three commands read the dataset.
    assert_eq!(said.matches("note: the COLMAP model is read; transforms.json beside it is not").count(), 1, "{said}");
    assert_eq!(work.listing().keys().collect::<Vec<_>>(), before.keys().collect::<Vec<_>>());
    assert_eq!(work.listing()[&work.path("out/scene.ply")], before[&work.path("out/scene.ply")]);

    // Another run has its own folder, or starts over.
    let other = "run data -o out --time 50s --bytes 30kB --sh-degree 0 --holdout none --device nonesuch";
    work.refused(other, &["out", "has another run", "glint train data", "--restart"]);
    let output = work.run(&format!("{other} --restart"));
    assert_eq!(output.status.code(), Some(2));
    let commands: Value = serde_json::from_slice(&fs::read(work.path("out/run.json")).unwrap()).unwrap();
    let line = |i: usize| commands["commands"][i].as_str().unwrap();
    assert!(
        line(0).contains("--gaussians 348 --points 174 --time 27.5s -o out/base.ply --device nonesuch --holdout none"),
        "{commands}"
    );
    assert!(line(2).ends_with("--split train --device nonesuch --holdout none"), "{commands}");
    assert!(!work.path("out/train.json").exists(), "the old run is gone");
}

/// Without a degree, some Gaussians keep their bands in training, and lobes come after it, within the bytes.
#[test]
fn a_scene_without_a_degree_has_bands_where_they_pay() {
    let work = Work::new();
    let found = work.json("run data -o out --preset draft --bytes 22kB --json");
    let lines: Vec<&str> = found["commands"].as_array().unwrap().iter().map(|line| line.as_str().unwrap()).collect();
    assert_eq!(lines.len(), 4);
    assert!(lines[0].starts_with("glint train data --bytes 22000 --iterations 2000 -o out/base.ply"), "{lines:?}");
    assert!(lines[1].contains(" --total-bytes 22000"), "{lines:?}");
    let banded = found["train"]["banded"].as_u64().unwrap() as usize;
    let scene = read_scene(work.path("out/scene.ply")).unwrap();
    // Some may fade, or give up their bands for lobes.
    assert!(scene.mixed && (1..=banded).contains(&(scene.base.len() - scene.base.constants())), "{found}");
    // The header has 3 KB: it names 45 bands twice.
    assert!(found["scenes"][1]["bytes"].as_u64().unwrap() <= 22_000 + 3_000, "{found}");
}

#[test]
fn foreign_files_are_not_replaced() {
    let work = Work::small();
    fs::create_dir(work.path("out")).unwrap();
    fs::write(work.path("out/base.ply"), "mine").unwrap();
    work.refused("run data -o out", &["out", "base.ply, which is not of a run", "--restart"]);
    work.refused("run data -o out --bytes 60", &["a scene of 60 bytes", "a Gaussian takes 236"]);
    work.refused("run data -o data/images", &["data/images", "expected another output folder"]);
}

#[cfg(unix)]
#[test]
fn colmap_finds_poses_of_photos_without() {
    use std::os::unix::fs::PermissionsExt;
    let work = Work::small();
    fs::rename(work.path("data/images"), work.path("photos")).unwrap();
    fs::create_dir(work.path("bin")).unwrap();
    let with = |arguments: &str| {
        let mut command = work.command(arguments);
        command.env("PATH", work.path("bin"));
        command
    };
    let line = "run photos -o out --bytes 30kB --sh-degree 0 --device nonesuch";
    let said = ends(run::run(&mut with(line)), 2);
    assert!(said.contains("COLMAP, which finds them, cannot be run"), "{said}");

    // A stand-in that cannot use a GPU and has the poses ready.
    let colmap = work.path("bin/colmap");
    let script = "#!/bin/sh\n[ \"$1 $2 $3 $4 $5\" = 'automatic_reconstructor --dense 0 --use_gpu 0' ] || exit 1\n\
                  [ \"$6 $8\" = '--workspace_path --image_path' ] && /bin/mkdir -p \"$7/sparse\" && /bin/cp -r \"$9/../data/sparse/0\" \"$7/sparse/0\"\n";
    fs::write(&colmap, script).unwrap();
    fs::set_permissions(&colmap, fs::Permissions::from_mode(0o755)).unwrap();
    let said = ends(run::run(&mut with(line)), 2);
    assert!(said.contains("5 photos without poses") && said.contains("run again without"), "{said}");
    let photos = work.path("photos").canonicalize().unwrap();
    let first = format!(
        "1/4: glint train out/colmap --sh-degree 0 --gaussians 348 --points 174 --iterations 7000 -o out/base.ply --eval-every 1400 --device nonesuch --images {}",
        photos.display()
    );
    assert!(said.contains(&first) && said.contains("error: --device"), "{said}");
}
