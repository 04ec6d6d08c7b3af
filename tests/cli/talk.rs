//! Tests messages during and at the end of a command.

use std::fs;

use serde_json::Value;

use super::{Work, files, keys, set};

/// A regression test: `train -v` printed nothing.
#[test]
fn verbose_tells_of_cameras_memory_losses_and_times() {
    let work = Work::new();
    let said = work.said("train data -o x.ply --iterations 30 -v");
    for part in [
        "9 photos of 32 × 24",
        "COLMAP dataset: 7 train, 2 test, 300 points",
        "scene units of their middle",
        "MB of photos",
        "MB for 336 Gaussians",
        "mean loss of steps 1 to 7: 0.",
        "mean loss of steps 29 to 30: 0.",
        "training: 30 steps in",
        "reading: 7 photos in",
        "a step's project",
    ] {
        assert!(said.contains(part), "`{part}` is not in: {said}");
    }
    if cfg!(target_os = "linux") {
        assert!(said.contains("MB of memory at most"), "{said}");
    }
    let said = work.said("enhance data --base x.ply -o y.ply --method augs --preset quick -v");
    for part in ["refining: ", "joining: 210 steps in", "comparing: 4 views in"] {
        assert!(said.contains(part), "`{part}` is not in: {said}");
    }
    let said = work.said("train data -o z.ply --iterations 3");
    // A slow machine also prints progress.
    assert!(said.contains("training on ") && said.lines().all(|line| line.starts_with("training")), "{said}");
}

/// `script` provides a terminal for a command and prints its output.
#[cfg(target_os = "linux")]
#[test]
fn a_terminal_has_one_bar_for_each_stage() {
    let work = Work::new();
    let bars = |arguments: &str| {
        let mut command = std::process::Command::new("script");
        let line = format!("stty cols 100; {} {arguments}", env!("CARGO_BIN_EXE_glint"));
        let command = command.current_dir(work.path(".")).args(["-qec", &line, "/dev/null"]).env("TERM", "xterm");
        let output = super::run::run(command);
        let seen = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success(), "glint {arguments}: {seen}");
        // Bars are the lines with bar characters; each is redrawn many times.
        let mut names: Vec<String> = Vec::new();
        for line in seen.split(['\r', '\n', '\x1b']).filter(|line| line.contains(['━', '─', '░', '█'])) {
            // After a terminal sequence, which ends with its first letter.
            let text = match line.strip_prefix('[') {
                Some(rest) => rest.split_once(|c: char| c.is_ascii_alphabetic()).map_or("", |(_, text)| text),
                None => line,
            };
            let name = text.split_whitespace().next().unwrap_or_default();
            if names.last().is_none_or(|last| last != name) {
                names.push(name.to_owned());
            }
        }
        names
    };
    // Short stages may not be drawn at all, but the order of stages is fixed.
    let in_turn = |arguments: &str, stages: &[&str]| {
        let (seen, mut left) = (bars(arguments), stages.iter());
        assert!(seen.iter().all(|name| left.any(|stage| stage == name)), "glint {arguments}: {seen:?}");
        assert!(seen.len() > stages.len() / 2, "glint {arguments}: {seen:?}");
    };
    in_turn("train data -o base.ply --iterations 30 --sh-degree 1", &["reading", "training"]);
    let again = ["placing", "joining"].repeat(3);
    let stages = [&["reading", "rendering", "weighing"], &again[..], &["comparing", "longer", "comparing"]].concat();
    in_turn("enhance data --base base.ply -o x.ply", &stages);
}

#[test]
fn quiet_says_nothing_but_errors() {
    let work = Work::new();
    fs::remove_file(work.path("data/images/e.png")).unwrap();
    assert!(work.said("train data -o x.ply --iterations 3 --sh-degree 1").contains("note: "));
    assert_eq!(work.said("train data -o y.ply --iterations 3 --sh-degree 1 -q"), "");
    let mut command = work.command("train nowhere -o z.ply --quiet");
    command.env_remove("RUST_LOG");
    work.fails(command, 2, &["nowhere"]);
    assert_eq!(work.run("train data -o z.ply -q -v").status.code(), Some(2));
    // --quiet does not suppress results.
    assert!(work.ok("info data -q").contains("photos"));
}

/// A regression test, found by damaging files at random: the scene was written, but the command was reported
/// as failed.
#[test]
fn a_damaged_test_photo_costs_the_gain_and_nothing_else() {
    let work = Work::new();
    work.ok("train data -o base.ply --iterations 30 --sh-degree 1");
    // The first of nine is for testing.
    let photo = fs::read(work.path("data/images/a.png")).unwrap();
    fs::write(work.path("data/images/a.png"), &photo[..photo.len() / 2]).unwrap();
    let enhance = "enhance data --base base.ply --ratio 0.1 --force -o a.ply";
    let said = work.said(enhance);
    assert!(said.contains("note: the gain on the test photos is unknown") && said.contains("a.png"), "{said}");
    assert_eq!(work.json(&format!("{enhance} --json"))["gain"], Value::Null);
}

#[test]
fn an_augmentation_ends_with_what_it_gained() {
    let work = Work::small();
    work.trained("train data --iterations 150 --gaussians 300 --sh-degree 1", "base.ply");
    let enhance = "enhance data --base base.ply --method augs --preset quick --ratio 0.2";
    let report = work.json(&format!("{enhance} -o a.ply --json"));
    let [first, last] = ["joint_loss_first", "joint_loss_last"].map(|key| report[key].as_f64().unwrap());
    assert!(0.0 < last && last < first && first < 0.5, "{first} {last}");
    let gain = &report["gain"];
    assert_eq!(keys(gain), set("views before after base_alone longer_training"));
    assert_eq!(gain["views"], 1);
    // Same numbers as `eval`.
    let (before, after) = (work.json("eval base.ply data --json"), work.json("eval a.ply data --json"));
    // If the trained base is worse alone, the original is shown to other viewers.
    let is_kept = String::from_utf8_lossy(&fs::read(work.path("a.ply")).unwrap()).contains("element learned");
    let shown = if is_kept { &before["augmented"] } else { &after["base"] };
    assert_eq!(
        [&gain["before"], &gain["after"], &gain["base_alone"]],
        [&before["augmented"], &after["augmented"], shown]
    );
    let output = work.run(&format!("{enhance} -o b.ply"));
    let [said, notes] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    let number = |v: &Value| format!("{:.2}", v["psnr"].as_f64().unwrap());
    let line = format!("1 test view: PSNR {} to {} dB", number(&gain["before"]), number(&gain["after"]));
    assert!(said.contains(&line) && said.contains("the base part alone"), "{line} is not in: {said}");
    // A regression test: ten times the requested number was added silently.
    let few = work.run(&format!("{enhance}0 -o c.ply --json --holdout none").replace("0.20", "0.001"));
    let rounded = "each view's share is rounded up: --ratio 0.001 of 300 Gaussians is 1, and 5 were allowed";
    assert!(String::from_utf8(few.stderr).unwrap().contains(rounded) && !notes.contains("rounded up"), "{notes}");
    // Without test views there is no evaluation.
    let report: Value = serde_json::from_slice(&few.stdout).unwrap();
    assert!(report["gain"].is_null(), "{report}");
}

/// Some Gaussians of a constant color get bands; the report, the file and its summary agree on their number.
#[test]
fn constant_colors_get_bands_where_they_pay() {
    let work = Work::small();
    work.ok("train data -o base.ply --iterations 150 --gaussians 300 --sh-degree 0");
    let report = work.json("enhance data --base base.ply -o a.ply --bytes 20kB --json");
    let banded = report["banded_gaussians"].as_u64().unwrap();
    assert!(banded > 0 && report["plan"]["bands"]["placed"] == banded, "{report}");
    let info = work.json("info a.ply --json");
    assert!(info["banded"] == banded && info["sh_degree"].as_u64() > Some(0), "{info}");
    let line = format!("{banded} of {} Gaussians of the base; the others have a constant color", info["base"]["count"]);
    assert!(work.ok("info a.ply").contains(&line), "{line}");
    let added = report["bytes_added"].as_u64().unwrap();
    let base = fs::metadata(work.path("base.ply")).unwrap().len();
    // Headers of 2 KB.
    assert!(added <= 20_000 && report["file_bytes"].as_u64().unwrap() <= base + added + 2000, "{report}");
    work.ok("convert a.ply b.ply");
    assert_eq!(work.json("info b.ply --json")["banded"], banded);
    // Other viewers show constant colors of it, and all bands of the base alone.
    work.ok("convert a.ply c.ply --base-only");
    let alone = work.json("info c.ply --json");
    assert_eq!((&alone["sh_degree"], &alone["banded"]), (&info["sh_degree"], &Value::Null));
    let [whole, copy] =
        ["a.ply", "b.ply"].map(|scene| work.json(&format!("eval {scene} data --json"))["augmented"].clone());
    assert_eq!(whole, copy);
    assert_eq!(whole, report["gain"]["after"]);
}

/// A base may be larger than the whole result: it loses bands, and added Gaussians take part of their bytes.
#[test]
fn an_augmented_scene_can_be_smaller_than_its_base() {
    let work = Work::small();
    // 31,200 bytes; 16,800 without bands.
    work.ok("train data -o base.ply --iterations 150 --gaussians 300 --points 300 --sh-degree 1");
    let enhance = "enhance data --base base.ply -o a.ply";
    let report = work.json(&format!("{enhance} --total-bytes 25kB --json"));
    let number = |name: &str| report[name].as_u64().unwrap();
    let (info, lost) = (work.json("info a.ply --json"), number("demoted_gaussians"));
    assert_eq!(info["banded"].as_u64().unwrap_or_default(), 300 - lost, "{report} {info}");
    // The base takes at most 0.93 of them: bands of 36 bytes for 179 Gaussians. Fits to 3 photos miss the fourth.
    assert!(lost >= 121 && number("supplementary_gaussians") > 0, "{report}");
    let base = 16_800 + 36 * (300 - lost);
    // A tenth more may be placed, because some of the base fades.
    assert_eq!(report["plan"]["bytes_allowed"], 27_500 - base);
    // A header of 2 KB.
    assert!((23_000..=27_000).contains(&number("file_bytes")), "{report}");
    // The estimate of longer training is of the base without these bands; the control is of the whole.
    assert!(report["plan"]["training_on_db"].is_null() && report["gain"]["longer_training"]["measured"] == true);
    let refused = work.run(&format!("{enhance} --total-bytes 16kB --force"));
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(said.contains("300 Gaussians take 16800 bytes without bands, expected at most 16000"), "{said}");
}

/// The plan is printed before it is executed, also in JSON and in the report; the result stays within every
/// budget.
#[test]
fn an_augmentation_has_a_plan_and_keeps_to_it() {
    let work = Work::new();
    fs::write(
        work.path("base.json"),
        work.ok("train data -o base.ply --iterations 60 --gaussians 300 --sh-degree 1 --json"),
    )
    .unwrap();
    let report = work.json("enhance data --base base.ply -o a.ply --bytes 2.5kB --ratio 0.3 --json");
    let (plan, number) = (&report["plan"], |name: &str| report[name].as_u64().unwrap());
    let added = number("supplementary_gaussians") + number("plain_gaussians");
    assert!(added > 0 && added <= plan["gaussians_allowed"].as_u64().unwrap(), "{report}");
    assert!(number("bytes_added") <= 2500 && plan["bytes_allowed"] == 2500 && number("budget") < 90, "{report}");
    assert_eq!(number("file_bytes"), fs::metadata(work.path("a.ply")).unwrap().len());
    assert!(plan["training_on_db"].is_number() && plan["least_db_per_thousand"] == 0.0);
    let gain = |kind: &str| plan[kind]["gain_db"].as_f64().unwrap();
    assert!(gain("lobes") > gain("without_lobes") && gain("without_lobes") >= 0.0, "{plan}");
    fs::write(work.path("plan.json"), report.to_string()).unwrap();
    work.ok("report data base=base.ply more=a.ply -o page --run base.json --run plan.json");
    let page = fs::read_to_string(work.path("page/index.html")).unwrap();
    assert!(page.contains("<h2>Plan of more</h2>") && page.contains("Gaussians with lobes"));
    // The time of both; the joint phase is a part of a run's time.
    for part in [
        "<th>base</th><th>more</th>",
        "<td>training [s]",
        "<td>joint phase [s]",
        "peak device memory",
        "blend_backward",
    ] {
        assert!(page.contains(part), "`{part}` is not on the page");
    }
    assert!(report["device_megabytes"].as_f64().unwrap() > 0.0 && !report["stages"].as_array().unwrap().is_empty());
    work.refused("report data a=a.ply -o x --run base.ply", &["base.ply"]);
    // Half of 120 bytes fits no Gaussian, 120 fit one, which may fade; with fewer, a note gives the reason.
    let report = work.json("enhance data --base base.ply -o one.ply --bytes 120 --json");
    let first = &report["placements"][0];
    assert_eq!(first["lobes"].as_u64().unwrap() + first["plain"].as_u64().unwrap(), 1);
    assert!(work.said("enhance data --base base.ply -o none.ply --bytes 10").contains("less than one Gaussian"));
    // Adds Gaussians that gain more than longer training, within the time limit.
    let started = std::time::Instant::now();
    let said = work.ok("enhance data --base base.ply -o b.ply --time 2s");
    assert!(said.contains("plan: at most 75 Gaussians"), "{said}");
    // Most of the time is used; on a busy machine a little more.
    let seconds = started.elapsed().as_secs_f64();
    assert!((1.5..30.0).contains(&seconds), "{seconds} s: {said}");
    for bad in ["--bytes -1", "--bytes 2XB", "--time 0s"] {
        assert_eq!(work.run(&format!("enhance data --base base.ply -o x.ply {bad}")).status.code(), Some(2), "{bad}");
    }
    for option in ["--bytes 1MB", "--time 9s"] {
        let command = format!("enhance data --base base.ply -o x.ply --method augs {option}");
        work.refused(&command, &[&option[..6], "--method pursuit"]);
    }
}

/// The test photos are the base's own renders, so any learning makes them worse. Without a given budget the
/// base stays unchanged.
#[test]
fn what_makes_the_test_photos_worse_is_not_kept_unless_it_was_asked_for() {
    let work = Work::new();
    work.ok("train data -o base.ply --iterations 100 --sh-degree 1");
    work.ok("render base.ply data --split test -o renders");
    for name in ["a.png", "i.png"] {
        fs::copy(work.path(&format!("renders/{name}")), work.path(&format!("data/images/{name}"))).unwrap();
    }
    let enhance = "enhance data --base base.ply";
    let report = work.json(&format!("{enhance} -o a.ply --json"));
    let psnr = |what: &str| report["gain"][what]["psnr"].as_f64().unwrap();
    assert_eq!(
        (&report["bytes_added"], &report["file_bytes"]),
        (&0.into(), &fs::metadata(work.path("base.ply")).unwrap().len().into())
    );
    assert!(report["discarded"] == true && psnr("after") < psnr("before") - 0.02, "{report}");
    // The gain is reported next to the gain of the same number of additional steps.
    assert!(report["gain"]["longer_training"]["measured"] == true && psnr("longer_training").is_finite(), "{report}");
    assert!(report["placements"].as_array().unwrap().len() == 3 && report["supplementary_gaussians"].is_u64());
    assert!(fs::read(work.path("a.ply")).unwrap() == fs::read(work.path("base.ply")).unwrap());
    let output = work.run(&format!("{enhance} -o b.ply"));
    let [said, notes] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(notes.contains("so the base was written"), "{notes}");
    for part in ["plan: at most 84 Gaussians", "longer training, ", "that gain less than longer training"] {
        assert!(said.contains(part), "`{part}` is not in: {said}");
    }
    // A requested budget is spent; other viewers still get the original base.
    let report = work.json(&format!("{enhance} --ratio 0.1 -o c.ply --json"));
    assert!(report["discarded"] == false && report["original_kept"] == true, "{report}");
    assert_eq!(report["gain"]["base_alone"], report["gain"]["before"]);
}

#[test]
fn completions_and_manual_pages_are_made() {
    let work = Work::new();
    for (shell, part) in [("bash", "_glint"), ("zsh", "#compdef glint"), ("fish", "complete -c glint")] {
        let script = work.ok(&format!("completions {shell}"));
        assert!(script.contains(part) && script.contains("holdout"), "{shell}");
    }
    assert_eq!(work.run("completions tcsh").status.code(), Some(2));
    work.ok("man pages");
    let commands = "completions convert demo devices doctor enhance eval export info man merge partition render report \
                    run synth train verify view";
    let mut expected: Vec<String> = commands.split(' ').map(|command| format!("glint-{command}.1")).collect();
    expected.push("glint.1".into());
    assert_eq!(files(&work.path("pages")), expected);
    let page = fs::read_to_string(work.path("pages/glint-enhance.1")).unwrap();
    assert!(page.contains(".TH glint-enhance 1") && page.contains("depth\\-threshold"), "{page}");
    work.refused("man pages", &["--force"]);
}
