//! Runs that are killed, interrupted or fail resume from their checkpoint to the same bits.

use std::{
    fs,
    path::Path,
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use glint::data::{
    checkpoint::checksum,
    tensors::{Tensor, Values},
};
use serde_json::Value;

use super::{Work, brief, ends, files, run, signal};

const CHECKPOINT: &str = "out.checkpoint.safetensors";
const TRAIN: &str = "train data --iterations 400 --sh-degree 1 --deterministic";
const BASE: &str = "train data --iterations 60 --sh-degree 1";
// Without test photos nothing is measured at the end.
const ENHANCE: &str =
    "enhance data --base base.ply --holdout none --method augs --preset quick --ratio 0.2 --deterministic";

impl Work {
    /// Starts a command that writes checkpoints, and kills it when `file` appears or changes.
    #[track_caller]
    pub(super) fn killed(&self, arguments: &str, file: &str) {
        let file = self.path(file);
        let written = || fs::metadata(&file).and_then(|found| found.modified()).ok();
        let before = written();
        let mut child = self.started(arguments);
        until(&mut child, || written() != before);
        child.kill().unwrap();
        assert!(!run::finish(child).status.success());
        sweep(file.parent().unwrap());
    }

    /// Starts a command that writes checkpoints as often as possible.
    fn started(&self, arguments: &str) -> Child {
        let mut command = self.command(&format!("{arguments} --checkpoint-every 0"));
        command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Starts a command that writes checkpoints, and kills it after `time`, if it still runs.
    fn killed_after(&self, arguments: &str, time: Duration) {
        let mut child = self.started(arguments);
        thread::sleep(time);
        child.kill().unwrap();
        run::finish(child);
        sweep(self.0.path());
    }

    /// Runs a command whose files are limited to `blocks` blocks of 512 bytes.
    #[cfg(unix)]
    fn run_with_files_below(&self, blocks: u32, arguments: &str) -> Output {
        let mut command = Command::new("sh");
        // An ignored signal stays ignored in the program that follows.
        let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec {} {arguments}", env!("CARGO_BIN_EXE_glint"));
        command.current_dir(self.0.path()).args(["-c", &script]);
        run::run(brief(&mut command))
    }
}

/// Waits until a command has done its part, which it must do before it ends.
#[track_caller]
fn until(child: &mut Child, done: impl Fn() -> bool) {
    let started = Instant::now();
    while !done() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before");
        assert!(started.elapsed() < Duration::from_secs(200), "it takes too long");
        thread::sleep(Duration::from_millis(2));
    }
}

/// Temporary files are not checkpoints; the next run sweeps them when they are a minute old.
fn sweep(folder: &Path) {
    for name in files(folder).iter().filter(|name| name.starts_with(".glint-")) {
        fs::remove_file(folder.join(name)).unwrap();
    }
}

/// The description in a checkpoint.
fn about(path: &Path) -> Value {
    let bytes = fs::read(path).unwrap();
    let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&bytes[8..8 + length]).unwrap();
    serde_json::from_str(header["__metadata__"]["glint"].as_str().unwrap()).unwrap()
}

#[test]
fn training_that_was_killed_goes_on_to_the_same_bits() {
    let work = Work::new();
    let started = Instant::now();
    let plain = work.json(&format!("{TRAIN} -o whole.ply --json"));
    let taken = started.elapsed();
    let whole = fs::read(work.path("whole.ply")).unwrap();
    assert_eq!(files(work.0.path()), ["data", "whole.ply"]);
    // Four kills: at the first checkpoint, at one of a resumed run, and after various times.
    work.killed(&format!("{TRAIN} -o out.ply"), CHECKPOINT);
    work.killed(&format!("{TRAIN} -o out.ply"), CHECKPOINT);
    for share in [0.1, 0.2] {
        work.killed_after(&format!("{TRAIN} -o out.ply"), taken.mul_f64(share));
    }
    assert_eq!(files(work.0.path()), ["data", CHECKPOINT, "whole.ply"]);
    let report = work.json(&format!("{TRAIN} -o out.ply --json"));
    assert_eq!(report["iterations"], 400);
    let resumed = report["iterations_resumed"].as_u64().unwrap();
    assert!((1..400).contains(&resumed), "{report}");
    assert!(fs::read(work.path("out.ply")).unwrap() == whole);
    assert_eq!(files(work.0.path()), ["data", "out.ply", "whole.ply"]);

    // Losses from before the kill are kept.
    assert_eq!(plain["iterations_resumed"], 0);
    assert_eq!(plain["final_loss"], report["final_loss"]);

    // A damaged checkpoint is reported and not used.
    work.killed(&format!("{TRAIN} -o out.ply --force"), CHECKPOINT);
    let kept = fs::read(work.path(CHECKPOINT)).unwrap();
    let mut flipped = kept.clone();
    *flipped.last_mut().unwrap() ^= 1;
    for damaged in [&flipped[..], &kept[..kept.len() / 2]] {
        fs::write(work.path(CHECKPOINT), damaged).unwrap();
        let said = work.said(&format!("{TRAIN} -o out.ply --force"));
        assert!(said.contains(CHECKPOINT) && said.contains("the run starts over"), "{said}");
        assert!(fs::read(work.path("out.ply")).unwrap() == whole);
        assert!(!work.path(CHECKPOINT).exists());
    }
    // A file that never was a checkpoint belongs to somebody else.
    fs::write(work.path(CHECKPOINT), "notes").unwrap();
    fs::remove_file(work.path("out.ply")).unwrap();
    work.refused(&format!("{TRAIN} -o out.ply"), &[CHECKPOINT, "nothing that glint knows", "over with --restart"]);
    assert_eq!(fs::read(work.path(CHECKPOINT)).unwrap(), b"notes");
}

/// A checkpoint can be inspected and used as an initial scene, independent of the run's command.
#[cfg(unix)]
#[test]
fn a_checkpoint_is_a_scene() {
    let work = Work::new();
    let mut child = work.started(&format!("{TRAIN} -o out.ply"));
    until(&mut child, || work.path(CHECKPOINT).exists());
    signal(&child, "-TERM");
    ends(run::finish(child), 130);
    // The scene and the checkpoint of an interrupted run are from the same step.
    work.ok(&format!("convert {CHECKPOINT} copy.ply"));
    assert!(fs::read(work.path("copy.ply")).unwrap() == fs::read(work.path("out.ply")).unwrap());
    assert_eq!(work.json(&format!("info {CHECKPOINT} --json")), work.json("info out.ply --json"));
    let said = work.said(&format!("train data --init {CHECKPOINT} -o on.ply --iterations 2"));
    assert!(!said.contains("note: "), "{said}");
    // A checkpoint of an augmentation has the base and the placed Gaussians.
    let enhance = "enhance data --base copy.ply -o more.ply --ratio 0.2";
    work.killed(enhance, "more.checkpoint.safetensors");
    let info = work.json("info more.checkpoint.safetensors --json");
    assert!(info["base"]["count"].as_u64().unwrap() >= 300 && info["supplement"].is_object(), "{info}");

    let mut bytes = fs::read(work.path(CHECKPOINT)).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(work.path("broken.safetensors"), bytes).unwrap();
    for command in ["convert broken.safetensors x.ply", "train data --init broken.safetensors -o x.ply"] {
        work.refused(command, &["broken.safetensors", "damaged checkpoint"]);
    }
    glint::data::write_tensors(work.path("other.safetensors"), &[("a", &[1], &[1.0f32][..])]).unwrap();
    work.refused("info other.safetensors", &["other.safetensors", "expected a checkpoint of train or enhance"]);
}

/// Two runs would overwrite each other's checkpoints.
#[test]
fn a_second_run_to_one_place_is_refused() {
    let work = Work::new();
    work.trained(BASE, "base.ply");
    for arguments in [format!("{TRAIN} -o out.ply"), format!("{ENHANCE} -o out.ply")] {
        let mut child = work.started(&arguments);
        until(&mut child, || work.path(CHECKPOINT).exists());
        for option in ["--force", "--restart"] {
            let said = String::from_utf8(work.run(&format!("{arguments} {option}")).stderr).unwrap();
            assert!(
                said.contains("error: ") && said.contains("out.ply") && said.contains("another glint process"),
                "{said}"
            );
        }
        child.kill().unwrap();
        run::finish(child);
        // A killed run does not block others.
        work.ok(&arguments);
        fs::remove_file(work.path("out.ply")).unwrap();
    }
}

/// A resumed run ends as if it had been suspended; a run with another time limit is a different run.
#[test]
fn a_run_by_time_that_was_killed_has_the_time_that_is_left() {
    let work = Work::new();
    let train = "train data --time 9s --points 200 --gaussians 300 -o out.ply";
    work.killed_after(train, Duration::from_secs(5));
    let kept = about(&work.path(CHECKPOINT));
    let [taken, milliseconds] = ["taken", "milliseconds"].map(|key| kept["clock"][key].as_u64().unwrap());
    assert!((2000..6000).contains(&milliseconds) && taken > 64, "{kept}");
    work.refused(
        "train data --time 10s -o out.ply --points 200 --gaussians 300",
        &["`options.time` was 9.0 and is 10.0"],
    );
    let started = Instant::now();
    let report = work.json(&format!("{train} --json"));
    let seconds = started.elapsed().as_secs_f64();
    let left = 9.0 - milliseconds as f64 / 1e3;
    assert!((left - 1.5..left + 2.0).contains(&seconds), "{seconds} s of {left}: {report}");
    assert_eq!((&report["iterations_resumed"], &report["gaussians"]), (&taken.into(), &300.into()));
    assert!(report["iterations"].as_u64().unwrap() > taken, "{report}");
    assert_eq!(files(work.0.path()), ["data", "out.ply"]);
}

/// If a run was killed at an evaluation step, the resumed run catches up on the evaluation.
#[test]
fn an_evaluation_that_a_kill_took_is_made_up_for() {
    let work = Work::new();
    const SHORT: &str = "train data --iterations 60 --sh-degree 1 --deterministic -o out.ply";
    work.killed(SHORT, CHECKPOINT);
    // The kill was exactly at an evaluation step.
    let every = about(&work.path(CHECKPOINT))["step"].as_u64().unwrap();
    let report = work.json(&format!("{SHORT} --eval-every {every} --json"));
    let resumed = report["iterations_resumed"].as_u64().unwrap();
    let text = fs::read_to_string(work.path("out.history.jsonl")).unwrap();
    let lines = text.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let steps: Vec<u64> = lines.map(|line| line["step"].as_u64().unwrap()).collect();
    let mut all: Vec<u64> = (resumed..60).step_by(every as usize).collect();
    all.push(60);
    assert_eq!((resumed, steps), (every, all));
}

#[test]
fn exposures_and_betas_that_were_killed_go_on_to_the_same_bits() {
    let work = Work::new();
    let train = "train data --color sb --strategy mcmc --exposure --halvings 2 --iterations 400 --deterministic";
    let whole = work.json(&format!("{train} -o whole.ply --json"));
    work.killed(&format!("{train} -o out.ply"), CHECKPOINT);
    let report = work.json(&format!("{train} -o out.ply --json"));
    assert!((1..400).contains(&report["iterations_resumed"].as_u64().unwrap()), "{report}");
    // Smaller versions of the photos do not count.
    assert_eq!(report["photos"], 7);
    assert!(fs::read(work.path("out.ply")).unwrap() == fs::read(work.path("whole.ply")).unwrap());
    let told = |report: &Value| [report["final_loss"].clone(), report["largest_exposure"].clone()];
    assert_eq!(told(&report), told(&whole));
}

/// Kills before the number of Gaussians is known, after, and once some have lost their bands.
#[test]
fn training_within_bytes_that_was_killed_goes_on_to_the_same_bits() {
    let work = Work::new();
    let train = "train data --bytes 100kB --exposure --halvings 1 --iterations 160 --deterministic";
    let whole = work.json(&format!("{train} -o whole.ply --json"));
    let has = |name: &[u8; 7]| fs::read(work.path(CHECKPOINT)).unwrap().windows(7).any(|found| found == name);
    work.killed(&format!("{train} -o out.ply"), CHECKPOINT);
    assert!(!has(b"classes"));
    for name in [b"classes", b"banded."] {
        while !has(name) {
            work.killed(&format!("{train} -o out.ply"), CHECKPOINT);
        }
    }
    let report = work.json(&format!("{train} -o out.ply --json"));
    assert!((1..160).contains(&report["iterations_resumed"].as_u64().unwrap()), "{report}");
    let scene = fs::read(work.path("out.ply")).unwrap();
    assert!(scene == fs::read(work.path("whole.ply")).unwrap());
    for key in ["gaussians", "banded", "sh_degree", "final_loss", "largest_exposure"] {
        assert_eq!(report[key], whole[key], "{key}");
    }
    // The header has less than 2 KB.
    assert!((1..=100_000 + 2_000).contains(&scene.len()), "{}", scene.len());
    let banded = report["banded"].as_u64().unwrap();
    assert!(banded > 0 && banded < report["gaussians"].as_u64().unwrap(), "{report}");
}

#[test]
fn a_checkpoint_of_another_run_is_refused_by_key() {
    let work = Work::new();
    work.killed(&format!("{TRAIN} -o out.ply"), CHECKPOINT);
    let train = |iterations: u32, options: &str| {
        format!("train data -o out.ply --iterations {iterations} --sh-degree 1 --deterministic {options}")
    };
    for (command, key) in [
        (train(401, ""), "`options.iterations` was 400 and is 401"),
        (train(400, "--seed 1"), "`options.seed` was 0 and is 1"),
        (train(400, "--points 40"), "`options.points` was null and is 40"),
        (train(400, "--exposure"), "`options.exposure` was false and is true"),
        (train(400, "--halvings 1"), "`resolved`"),
        (train(400, "--background white"), "`resolved`"),
        (train(400, "--compensate"), "`resolved`"),
        (train(400, "--max-size 16"), "camera_crc32"),
        (train(400, "--holdout none"), "`photos."),
    ] {
        work.refused(&format!("{command} --force"), &[CHECKPOINT, "another run", key, "start over with --restart"]);
    }
    let points = work.path("data/sparse/0/points3D.txt");
    let text = fs::read_to_string(&points).unwrap();
    fs::write(&points, text.replacen("120 130 140", "121 130 140", 1)).unwrap();
    work.refused(&train(400, ""), &[CHECKPOINT, "`points.crc32`"]);
    fs::write(&points, text).unwrap();
    let mut photo = image::open(work.path("data/images/d.png")).unwrap().into_rgb8();
    photo.get_pixel_mut(3, 3).0[1] ^= 1;
    photo.save(work.path("data/images/d.png")).unwrap();
    work.refused(&train(400, ""), &[CHECKPOINT, "`photos.d.png.pixels_crc32`"]);
    // A file that glint did not write.
    glint::data::write_tensors(work.path(CHECKPOINT), &[("a", &[1], &[1.0f32][..])]).unwrap();
    work.refused(&train(400, ""), &[CHECKPOINT, "--restart"]);

    // --restart keeps an existing checkpoint under another name, whichever run wrote it.
    let somebodys = fs::read(work.path(CHECKPOINT)).unwrap();
    let old = format!("{CHECKPOINT}.old");
    let said = work.said(&train(32, "--restart"));
    assert!(said.contains("the checkpoint of the earlier run is now") && said.contains(&old), "{said}");
    assert!(fs::read(work.path(&old)).unwrap() == somebodys && !work.path(CHECKPOINT).exists());
}

#[test]
fn the_same_command_resumes_and_begins_anew_where_it_is_told_to() {
    let work = Work::new();
    work.trained(TRAIN, "whole.ply");
    // An output next to its checkpoint, as after Ctrl-C.
    let ended = || {
        work.killed(&format!("{TRAIN} -o out.ply --force"), CHECKPOINT);
        fs::write(work.path("out.ply"), "what was learned until then").unwrap();
    };
    let whole = || fs::read(work.path("out.ply")).unwrap() == fs::read(work.path("whole.ply")).unwrap();
    ended();
    let said = work.said(&format!("{TRAIN} -o out.ply"));
    assert!(said.contains("resuming after step") && said.contains("--restart"), "{said}");
    assert!(whole() && !work.path(CHECKPOINT).exists());
    // A finished output is different: there is nothing to restart.
    for options in ["", "--restart"] {
        work.refused(&format!("{TRAIN} -o out.ply {options}"), &["out.ply", "already exists; --force overwrites it"]);
    }
    ended();
    let report = work.json(&format!("{TRAIN} -o out.ply --restart --json"));
    assert!(report["iterations_resumed"] == 0 && whole(), "{report}");
    assert_eq!(files(work.0.path()), ["data", "out.checkpoint.safetensors.old", "out.ply", "whole.ply"]);
}

#[test]
fn an_augmentation_that_was_killed_goes_on_to_the_same_bits() {
    let work = Work::small();
    work.trained(BASE, "base.ply");
    work.ok(&format!("{ENHANCE} -o whole.ply"));
    let whole = || fs::read(work.path("out.ply")).unwrap() == fs::read(work.path("whole.ply")).unwrap();
    assert_eq!(files(work.0.path()), ["base.ply", "data", "whole.ply"]);

    // First after lifting the photos' Gaussians, then in the joint phase.
    work.killed(&format!("{ENHANCE} -o out.ply"), CHECKPOINT);
    let lifted = fs::read(work.path(CHECKPOINT)).unwrap();
    let mut child = work.started(&format!("{ENHANCE} -o out.ply"));
    until(&mut child, || about(&work.path(CHECKPOINT))["step"] != 0);
    child.kill().unwrap();
    run::finish(child);
    sweep(work.0.path());
    let kept = fs::read(work.path(CHECKPOINT)).unwrap();
    for bytes in [&lifted, &kept] {
        fs::write(work.path(CHECKPOINT), bytes).unwrap();
        let report = work.json(&format!("{ENHANCE} -o out.ply --json --force"));
        assert!(report["photos_resumed"] == 5 && whole(), "{report}");
        assert_eq!(files(work.0.path()), ["base.ply", "data", "out.ply", "whole.ply"]);
    }
    // The joint phase resumes from its learned parameters.
    fs::write(work.path(CHECKPOINT), &kept).unwrap();
    let (mut tensors, text) = glint::data::read_tensors_about(work.path(CHECKPOINT)).unwrap();
    let mut about: Value = serde_json::from_str(&text.unwrap()).unwrap();
    assert!(about["step"].as_u64() > Some(0), "{about}");
    let Some(Tensor { values: Values::F32(lobes), .. }) = tensors.get_mut("supplement.lobes") else { panic!() };
    lobes.iter_mut().for_each(|v| *v *= 0.9);
    about["crc32"] = checksum(&about, &tensors).into();
    let list: Vec<_> = tensors.iter().map(|(name, t)| (&name[..], &t.shape[..], t)).collect();
    glint::data::write_tensors_about(work.path(CHECKPOINT), &list, Some(&about.to_string())).unwrap();
    work.ok(&format!("{ENHANCE} -o out.ply"));
    assert!(!whole());
    fs::write(work.path(CHECKPOINT), &kept[..kept.len() - 1]).unwrap();
    let said = work.said(&format!("{ENHANCE} -o out.ply --force"));
    assert!(said.contains("the run starts over") && whole(), "{said}");
    // A run with a time limit reads no checkpoint of another kind, so one next to it is not its own.
    fs::write(work.path(CHECKPOINT), &kept).unwrap();
    let by_time = "enhance data --base base.ply -o out.ply --time 9s";
    work.refused(by_time, &["out.ply", "already exists"]);

    // Every option is in the settings, by its name, unless it is exempt.
    fs::write(work.path(CHECKPOINT), &kept).unwrap();
    for (option, key) in [
        ("--seed 5", "`options.seed` was 0 and is 5"),
        ("--depth-threshold 0.7", "`options.depth-threshold`"),
        ("--cluster-failure smallest", "`options.cluster-failure`"),
        ("--pca-weights plain", "`options.pca-weights`"),
        ("--bias-correction", "`options.bias-correction` was false and is true"),
        ("--background white", "`resolved`"),
        ("--max-size 16", "`photos.a.png.camera_crc32`"),
    ] {
        work.refused(&format!("{ENHANCE} -o out.ply {option}"), &[CHECKPOINT, "another run", key]);
    }
    let other = ENHANCE.replace("--holdout none", "--holdout 3");
    work.refused(&format!("{other} -o out.ply"), &[CHECKPOINT, "another run", "`photos."]);
    work.ok("train data -o base.ply --iterations 61 --sh-degree 1 --force");
    work.refused(&format!("{ENHANCE} -o out.ply"), &[CHECKPOINT, "`base."]);
}

/// A regression test: nothing was left.
#[cfg(unix)]
#[test]
fn a_joint_stage_that_is_interrupted_is_kept() {
    let work = Work::small();
    work.trained(BASE, "base.ply");
    work.ok(&format!("{ENHANCE} -o whole.ply"));
    let mut child = work.started(&format!("{ENHANCE} -o out.ply"));
    until(&mut child, || work.path(CHECKPOINT).exists() && about(&work.path(CHECKPOINT))["step"] != 0);
    signal(&child, "-TERM");
    let said = ends(run::finish(child), 130);
    assert!(
        said.contains("joint steps; out.ply has their result") && said.contains("run the same command to resume"),
        "{said}"
    );
    let ended = glint::data::read_scene(work.path("out.ply")).unwrap();
    let whole = glint::data::read_scene(work.path("whole.ply")).unwrap();
    assert_eq!(ended.supplement.unwrap().gaussians.len(), whole.supplement.unwrap().gaussians.len());
    let said = work.said(&format!("{ENHANCE} -o out.ply"));
    assert!(said.contains("resuming after step"), "{said}");
    assert!(fs::read(work.path("out.ply")).unwrap() == fs::read(work.path("whole.ply")).unwrap());
    assert!(!work.path(CHECKPOINT).exists());
}

/// Closing the terminal interrupts the run. Under nohup it is ignored, and only a second signal, of another
/// kind, ends the run.
#[cfg(target_os = "linux")]
#[test]
fn training_whose_terminal_is_closed_is_kept_unless_that_is_ignored() {
    let work = Work::new();
    work.trained(TRAIN, "whole.ply");
    for (disposition, signals) in [("--default-signal=HUP", &["-HUP"][..]), ("--ignore-signal=HUP", &["-HUP", "-TERM"])]
    {
        let glint = work.command(&format!("{TRAIN} -o out.ply --checkpoint-every 0"));
        let mut child = Command::new("env");
        child.arg(disposition).arg(glint.get_program()).args(glint.get_args()).current_dir(work.0.path());
        let mut child = brief(&mut child).stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
        let step = || work.path(CHECKPOINT).exists().then(|| about(&work.path(CHECKPOINT))["step"].as_u64().unwrap());
        let mut least = 0;
        for name in signals {
            until(&mut child, || step().is_some_and(|step| step > least));
            signal(&child, name);
            // For the second time: some steps after the first.
            least = step().unwrap() + 20;
        }
        let said = ends(run::finish(child), 130);
        assert!(said.contains("out.ply has their result") && said.contains("run the same command to resume"), "{said}");
        work.ok(&format!("{TRAIN} -o out.ply"));
        assert!(fs::read(work.path("out.ply")).unwrap() == fs::read(work.path("whole.ply")).unwrap());
        fs::remove_file(work.path("out.ply")).unwrap();
    }
}

#[test]
fn a_device_that_is_lost_leaves_the_last_checkpoint_whole() {
    let work = Work::new();
    work.trained(TRAIN, "whole.ply");
    let mut command = work.command(&format!("{TRAIN} -o out.ply --checkpoint-every 0"));
    // Photos and the scene need fewer submissions than this, the whole run more.
    command.env("GLINT_LOST_AFTER", "80");
    let said = ends(run::run(&mut command), 1);
    assert!(said.contains("error: vkWaitForFences") && said.contains("lost"), "{said}");
    assert!(said.contains("the last checkpoint is in out.checkpoint.safetensors"), "{said}");
    assert_eq!(files(work.0.path()), ["data", CHECKPOINT, "whole.ply"]);
    let report = work.json(&format!("{TRAIN} -o out.ply --json"));
    assert!(report["iterations_resumed"].as_u64().unwrap() > 0, "{report}");
    assert!(fs::read(work.path("out.ply")).unwrap() == fs::read(work.path("whole.ply")).unwrap());

    // Every other command ends too, and leaves nothing.
    for arguments in [
        "enhance data --base whole.ply --method augs --preset quick -o x.ply",
        "render whole.ply data -o views",
        "eval whole.ply data",
    ] {
        let mut command = work.command(arguments);
        command.env("GLINT_LOST_AFTER", "5");
        let said = ends(run::run(&mut command), 1);
        assert!(said.contains("vkWaitForFences") && !said.contains("panicked"), "glint {arguments}: {said}");
        assert!(!work.path("x.ply").exists());
    }
}

/// Whichever buffer does not fit, a command ends with an error about memory, or succeeds with less memory;
/// its outputs are whole.
#[test]
fn memory_that_runs_out_anywhere_is_an_error() {
    let work = Work::small();
    work.trained("train data --iterations 20 --sh-degree 1", "base.ply");
    let before = work.listing();
    let clean = || {
        for (path, _) in work.listing().into_iter().filter(|(path, _)| !before.contains_key(path)) {
            // Its contents are deleted with the folder.
            let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
        }
    };
    for arguments in [
        "train data --iterations 20 --sh-degree 1 --deterministic -o made.ply",
        "enhance data --base base.ply -o made.ply",
        "enhance data --base base.ply --method augs --preset quick -o made.ply",
        "report data base=base.ply -o made",
    ] {
        work.ok(arguments);
        let whole = work.listing();
        let fits = |budget: u64| {
            clean();
            let mut command = work.bare(arguments);
            let output = run::run(brief(&mut command).env("GLINT_MEMORY_BUDGET", budget.to_string()));
            let (left, told) = (work.listing(), format!("glint {arguments} in {budget} bytes"));
            if output.status.success() {
                // With room for fewer candidates at a time, an augmentation may choose differently.
                assert!(arguments.starts_with("enhance") || left == whole, "{told}");
                return true;
            }
            let said = ends(output, 1);
            let errors: Vec<&str> = said.lines().filter(|line| line.starts_with("error: ")).collect();
            assert!(matches!(errors[..], [line] if line.contains("memory")), "{told}: {said}");
            assert!(left.iter().all(|(path, bytes)| whole.get(path) == Some(bytes)), "{told} leaves another thing");
            assert!(!work.path("made.ply").exists(), "{told}");
            false
        };
        // Bisects for the smallest sufficient budget, so that later and later allocations fail.
        const MOST: u64 = 1 << 24;
        let (mut few, mut enough) = (0, MOST);
        while few == 0 || enough - few > enough / 3 {
            let budget = if few == 0 { enough / 2 } else { u64::midpoint(few, enough) };
            *if fits(budget) { &mut enough } else { &mut few } = budget;
        }
        assert!(enough < MOST, "glint {arguments} needs more");
        clean();
    }
}

/// The checkpoint of a run with photos and Gaussians in one place serves a run with them in another.
#[test]
fn the_scene_does_not_depend_on_where_photos_and_gaussians_lie() {
    let work = Work::new();
    // Packed moments have the fewest planes.
    let train = format!("{TRAIN} --precision half");
    work.trained(&train, "whole.ply");
    let whole = fs::read(work.path("whole.ply")).unwrap();
    for [before, after] in [["disk", "host --gaussians-on host"], ["host --gaussians-on host", "disk"]] {
        work.killed(&format!("{train} -o out.ply --photos-on {before}"), CHECKPOINT);
        assert_eq!(files(work.0.path()), ["data", CHECKPOINT, "whole.ply"]);
        let report = work.json(&format!("{train} -o out.ply --photos-on {after} --json"));
        assert!(report["iterations_resumed"].as_u64() > Some(0), "{report}");
        assert!(fs::read(work.path("out.ply")).unwrap() == whole, "{before}, then {after}");
        fs::remove_file(work.path("out.ply")).unwrap();
    }
    let said = work.said(&format!("{train} -o out.ply --photos-on disk --gaussians-on host"));
    assert!(said.contains("MB of photos lie in a temporary file next to the output; each step copies one"), "{said}");
    assert!(said.contains("MB of the Gaussians' colors and moments lie in the host's memory; each step"), "{said}");
    assert!(fs::read(work.path("out.ply")).unwrap() == whole);
}

/// A limit on file sizes simulates a full disk: either way, writing fails in the middle.
#[cfg(unix)]
#[test]
fn a_disk_that_fills_up_leaves_the_last_checkpoint_whole() {
    let work = Work::new();
    work.trained(TRAIN, "whole.ply");
    // A run that had room for a checkpoint.
    work.killed(&format!("{TRAIN} -o out.ply"), CHECKPOINT);
    let kept = fs::read(work.path(CHECKPOINT)).unwrap();
    let full = |arguments: &str| work.run_with_files_below(16, arguments);
    if full("eval whole.ply data").status.code().is_none() {
        // lavapipe of Mesa 25 keeps device memory in an unnamed file, to which the limit applies too.
        return eprintln!("skipped: this driver dies where files may not grow");
    }
    let said = ends(full(&format!("{TRAIN} -o out.ply --checkpoint-every 0")), 1);
    assert_eq!(said.matches("cannot be saved").count(), 1, "{said}");
    assert!(said.contains("error: out.ply: ") && said.contains("the last checkpoint is in out.checkpoint"), "{said}");
    assert!(fs::read(work.path(CHECKPOINT)).unwrap() == kept);
    assert_eq!(files(work.0.path()), ["data", CHECKPOINT, "whole.ply"]);
    work.ok(&format!("{TRAIN} -o out.ply"));
    assert!(fs::read(work.path("out.ply")).unwrap() == fs::read(work.path("whole.ply")).unwrap());

    // The outputs of other commands.
    work.trained(BASE, "base.ply");
    let said = ends(full("enhance data --base base.ply --method augs --preset quick -o x.ply"), 1);
    assert!(said.contains("error: ") && !said.contains("panicked") && !work.path("x.ply").exists(), "{said}");

    // A scene of 20 Gaussians is smaller than a picture; a picture that does not fit must not end the run.
    let train = "train data -o small.ply --points 20 --sh-degree 0 --strategy fixed --iterations 40 --eval-every 10";
    let said = ends(work.run_with_files_below(6, train), 0);
    assert!(said.matches("cannot be saved").count() == 1 && said.contains("step-000010.png"), "{said}");
    // The history lines fitted.
    assert_eq!(fs::read_to_string(work.path("small.history.jsonl")).unwrap().lines().count(), 4);
    assert!(work.path("small.ply").exists() && files(&work.path("small.history")).is_empty());
}

#[test]
fn pursuit_that_was_killed_goes_on_to_the_same_bits_and_places_what_is_lacking() {
    const PURSUE: &str = "enhance data --base base.ply --holdout none --ratio 0.3 --deterministic";
    let work = Work::new();
    work.trained(BASE, "base.ply");
    let report = work.json(&format!("{PURSUE} -o whole.ply --json"));
    let added = report["supplementary_gaussians"].as_u64().unwrap() + report["plain_gaussians"].as_u64().unwrap();
    assert!(added > 0 && added <= report["budget"].as_u64().unwrap(), "{report}");
    assert_eq!(files(work.0.path()), ["base.ply", "data", "whole.ply"]);
    // Before the second placement and, most likely, after it.
    work.killed(&format!("{PURSUE} -o out.ply"), CHECKPOINT);
    work.killed(&format!("{PURSUE} -o out.ply"), CHECKPOINT);
    work.refused(&format!("{PURSUE} -o out.ply --method augs"), &[CHECKPOINT, "`options.method`"]);
    let said = work.said(&format!("{PURSUE} -o out.ply"));
    assert!(said.contains("resuming"), "{said}");
    assert_eq!(fs::read(work.path("out.ply")).unwrap(), fs::read(work.path("whole.ply")).unwrap());
    work.refused("enhance data --base base.ply -o x.ply --preset quick", &["--preset", "--method augs"]);
}
