//! Tests outputs, and files that must never be overwritten.

use std::{
    fs,
    io::{BufRead, BufReader},
    process::Stdio,
    time::{Duration, SystemTime},
};

use glint::{
    data::{read_scene, write_scene},
    reference::sample::random_scene,
};

use super::{Work, files, run, signal};

/// A regression test: renders over a dataset's photographs made `eval` report 58.96 dB.
#[test]
fn what_a_command_reads_is_never_written_over() {
    let work = Work::new();
    write_scene(work.path("base.ply"), &random_scene(1, 50, 0, 0)).unwrap();
    fs::copy(work.path("base.ply"), work.path("data/images/scene.ply")).unwrap();
    for force in ["", " --force"] {
        let reads = "a folder of the dataset's photos";
        work.refused(
            &format!("render base.ply data -o data/images{force}"),
            &["a.png", if force.is_empty() { "command reads" } else { "" }],
        );
        work.refused(&format!("render base.ply data -o data/images --format exr{force}"), &["data/images", reads]);
        work.refused(&format!("render base.ply data -o data/images/../images{force}"), &["images"]);
        work.refused(&format!("enhance data --base base.ply -o base.ply{force}"), &["base.ply", "command reads"]);
        work.refused(&format!("train data -o data/images/a.png{force}"), &["a.png", "a PLY scene", "a.ply"]);
    }
    work.refused("render base.ply data -o data/images --force", &["a.png", "command reads"]);
    // A point cloud named by a dataset is an input too.
    let frame = r#"{"file_path": "a.png", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}"#;
    let json = format!(
        r#"{{"fl_x": 40, "ply_file_path": "points.ply", "frames": [{frame}, {}]}}"#,
        frame.replace("a.png", "d.png")
    );
    let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n";
    fs::write(work.path("data/images/transforms.json"), json).unwrap();
    fs::write(work.path("data/images/points.ply"), cloud).unwrap();
    work.refused("train data/images -o data/images/points.ply --force", &["points.ply", "command reads"]);
}

#[test]
fn files_that_are_there_are_replaced_only_with_force() {
    let work = Work::new();
    write_scene(work.path("base.ply"), &random_scene(1, 50, 0, 0)).unwrap();
    fs::write(work.path("out.ply"), "mine").unwrap();
    fs::create_dir(work.path("views")).unwrap();
    fs::write(work.path("views/i.png"), "mine").unwrap();
    fs::create_dir(work.path("here")).unwrap();
    fs::write(work.path("here/augmented.ply"), "mine").unwrap();
    work.refused("train data -o out.ply", &["out.ply", "--force"]);
    work.refused("enhance data --base base.ply -o out.ply", &["out.ply", "--force"]);
    work.refused("render base.ply data -o views", &["views/i.png", "--force"]);
    work.refused("demo -o here", &["here/augmented.ply", "--force"]);
    work.ok("train data -o out.ply --iterations 2 --force");
    work.ok("render base.ply data -o views --force");
    assert!(fs::read(work.path("out.ply")).unwrap().starts_with(b"ply"));
    assert!(fs::read(work.path("views/i.png")).unwrap().starts_with(b"\x89PNG"));
    // Other files in the folder are not touched.
    fs::write(work.path("views/notes.txt"), "mine").unwrap();
    work.ok("render base.ply data -o views --force");
    assert_eq!(fs::read(work.path("views/notes.txt")).unwrap(), b"mine");
}

#[test]
fn names_say_what_files_are() {
    let work = Work::new();
    write_scene(work.path("base.ply"), &random_scene(1, 50, 0, 0)).unwrap();
    work.refused("train data -o x.png", &["x.png", "a PLY scene", "x.ply"]);
    work.refused("train data -o x", &["a PLY scene", "x.ply"]);
    work.refused("enhance data --base base.ply -o x.splat", &["x.splat", "a PLY scene", "x.ply"]);
    work.ok("train data -o x.PLY --iterations 1");
}

#[test]
fn what_cannot_be_written_is_bad_input_wherever_it_is_named() {
    let work = Work::new();
    write_scene(work.path("base.ply"), &random_scene(1, 50, 0, 0)).unwrap();
    fs::write(work.path("file"), "").unwrap();
    work.refused("train data -o file/x.ply", &["file/x.ply", "cannot be written"]);
    work.refused("render base.ply data -o file/x", &["file/x", "cannot be created"]);
    work.refused("render base.ply data -o file", &["file", "expected a folder"]);
}

/// Photos that consist of headers only, with enough pixels that a Gaussian for each 256 would fill the disk,
/// and far more than fit in memory. The error must be about memory, not about disk space for Gaussians that
/// never exist.
#[test]
fn a_disk_is_asked_for_no_more_gaussians_than_memory_has_room_for() {
    let work = Work::new();
    const SIDE: u32 = (1 << 14) - 1;
    let free = fs4::available_space(work.path(".")).unwrap() as f64;
    // The number of Gaussians is limited to 32 bits, and a file of that size would fit.
    if 1.5 * free > 248.0 * f64::from(u32::MAX) {
        eprintln!("skipped: {free} bytes are free, more than any run could fill");
        return;
    }
    let photos = (1.5 * free / 248.0 * 256.0 / f64::from(SIDE).powi(2)) as usize + 8;
    image::RgbImage::new(2, 2).save(work.path("huge.webp")).unwrap();
    let mut huge = fs::read(work.path("huge.webp")).unwrap();
    // After the signature: 14 bits of width minus one, 14 of height, alpha and version.
    assert_eq!((&huge[12..16], huge[20]), (&b"VP8L"[..], 0x2f));
    huge[21..25].copy_from_slice(&((SIDE - 1) | ((SIDE - 1) << 14)).to_le_bytes());
    let mut poses = String::new();
    for i in 0..photos {
        fs::write(work.path(&format!("data/images/{i}.webp")), &huge).unwrap();
        poses += &format!("{} 1 0 0 0 0 0 5 1 {i}.webp\n\n", i + 1);
    }
    fs::write(work.path("data/sparse/0/images.txt"), poses).unwrap();
    fs::write(work.path("data/sparse/0/cameras.txt"), format!("1 PINHOLE {SIDE} {SIDE} 20000 20000 8000 8000\n"))
        .unwrap();
    let train = format!("train data -o out.ply --max-size {SIDE} --photos-on device");
    work.refused(&train, &["the photo", "--max-size", "fits"]);
}

#[test]
fn a_device_that_is_not_there_is_named_by_who_asked_for_it() {
    let work = Work::new();
    write_scene(work.path("base.ply"), &random_scene(1, 50, 0, 0)).unwrap();
    let mut command = work.command("eval base.ply data");
    command.env("GLINT_DEVICE", "nonesuch");
    work.fails(command, 2, &["GLINT_DEVICE", "nonesuch"]);
    let mut command = work.command("eval base.ply data --device nowhere");
    command.env("GLINT_DEVICE", "nonesuch");
    work.fails(command, 2, &["--device", "nowhere"]);
    // Without any driver.
    let mut command = work.command("eval base.ply data");
    command.env_remove("GLINT_DEVICE").env("VK_DRIVER_FILES", "/nowhere").env("VK_ICD_FILENAMES", "/nowhere");
    work.fails(command, 1, &["mesa-vulkan-drivers"]);
    let mut command = work.command("devices");
    command.env("VK_DRIVER_FILES", "/nowhere").env("VK_ICD_FILENAMES", "/nowhere");
    work.fails(command, 1, &["mesa-vulkan-drivers"]);
}

/// A regression test: everything was lost, and a test required that.
#[cfg(unix)]
#[test]
fn what_was_learned_until_ctrl_c_is_kept() {
    let work = Work::new();
    for name in ["-INT", "-TERM"] {
        let train = "train data -o out.ply --iterations 1000000 --json --force -vv";
        let mut child = work.command(train).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
        assert!(lines.any(|line| line.unwrap().contains("listening for signals")));
        signal(&child, name);
        let output = run::finish(child);
        assert_eq!(output.status.code(), Some(130));
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!((0..1_000_000).contains(&report["iterations"].as_u64().unwrap()));
        assert_eq!(files(work.0.path()), ["data", "out.checkpoint.safetensors", "out.ply"]);
        assert_eq!(read_scene(work.path("out.ply")).unwrap().base.len(), 300);
    }
}

/// Killed, not interrupted: a signal ignored by the test's parent would be ignored here too.
#[test]
fn a_killed_run_leaves_nothing_that_could_be_taken_for_whole() {
    let work = Work::new();
    let before = files(work.0.path());
    let mut child =
        work.command("train data -o out.ply --iterations 100000 -vv").stderr(Stdio::piped()).spawn().unwrap();
    let opened = BufReader::new(child.stderr.take().unwrap()).lines().any(|l| l.unwrap().contains("device opened"));
    child.kill().unwrap();
    assert!(!run::finish(child).status.success() && opened);
    // Its lock is released: it blocks no other run, and the next one removes it.
    let lock = files(work.0.path()).into_iter().filter(|name| !before.contains(name));
    assert_eq!(lock.collect::<Vec<_>>(), [".glint-out.ply.lock"]);

    // A file that was being written at the kill is swept by the next run.
    let left = fs::File::create(work.path(".glint-left")).unwrap();
    left.set_modified(SystemTime::now() - Duration::from_secs(3600)).unwrap();
    drop(left);
    let output = work.run("train data -o out.ply --iterations 1");
    assert!(String::from_utf8_lossy(&output.stderr).contains("unfinished files of killed runs removed: 1"));
    assert_eq!(files(work.0.path()), ["data", "out.ply"]);
}
