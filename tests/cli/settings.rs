//! Training settings need to be given only once, to `train`.

use super::*;

const SAID: &str = "--background 0.2,0.9,0.6 --compensate --max-size 24";

/// The PSNR of a scene, and the notes.
fn score(work: &Work, arguments: &str) -> (f64, String) {
    let output = work.run(&format!("eval {arguments} --json"));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    (found["augmented"]["psnr"].as_f64().unwrap(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn settings_are_said_once_and_travel_through_every_command_and_format() {
    let work = Work::new();
    work.ok(&format!("train data -o base.ply --iterations 60 --points 100 --sh-degree 1 {SAID}"));
    work.ok("enhance data --base base.ply -o more.ply --ratio 0.2");
    let info = work.json("info more.ply --json")["trained_with"].clone();
    let known = serde_json::json!({"background": [0.2, 0.9, 0.6], "antialiased": true, "max_size": 24});
    assert_eq!(info, known);
    assert!(work.ok("info more.ply").contains("background 0.2,0.9,0.6, photos of at most 24 pixels, antialiasing"));
    let found = score(&work, "more.ply data");
    assert_eq!(found, score(&work, &format!("more.ply data {SAID}")));
    // Each setting has an effect, and a differing one is reported.
    for (option, was) in [
        ("--background black", "--background 0.2,0.9,0.6, but 0,0,0 is given here"),
        ("--compensate=false", "--compensate true, but false is given here"),
        ("--max-size 32", "--max-size 24, but 32 is given here"),
    ] {
        let (other, text) = score(&work, &format!("more.ply data {option}"));
        assert!(text.contains(&format!("more.ply was trained with {was}")), "{option}: {text}");
        assert_ne!(found.0, other, "{option}");
    }
    // Renders, reports and training from the scene use them too.
    work.ok("render more.ply data -o told");
    work.ok(&format!("render more.ply data -o given {SAID}"));
    for view in ["a.png", "i.png"] {
        assert_eq!(fs::read(work.path("told").join(view)).unwrap(), fs::read(work.path("given").join(view)).unwrap());
    }
    work.ok("report data base=base.ply more=more.ply -o page");
    let numbers: Value = serde_json::from_slice(&fs::read(work.path("page/report.json")).unwrap()).unwrap();
    assert_eq!(numbers["scenes"][1]["psnr"].as_f64(), Some(found.0), "{numbers}");
    for options in ["", SAID] {
        work.ok(&format!("export --html page{}.html more.ply data {options}", options.len()));
        work.ok(&format!("train data --init base.ply -o on{}.ply --iterations 5 {options}", options.len()));
    }
    let same = |a: &str, b: &str| fs::read(work.path(a)).unwrap() == fs::read(work.path(b)).unwrap();
    let n = SAID.len();
    assert!(same("page0.html", &format!("page{n}.html")) && same("on0.ply", &format!("on{n}.ply")));

    // Formats keep the settings, or a note names the options to give again.
    for ending in ["ply", "glb"] {
        work.ok(&format!("convert more.ply copy.{ending} --force"));
        // glTF stores opacities and scales, not their logits and logarithms: 3e-10 dB here.
        let off = (score(&work, &format!("copy.{ending} data")).0 - found.0).abs();
        assert!(off <= if ending == "glb" { 1e-5 } else { 0.0 }, "{ending}: {off}");
    }
    let base = score(&work, "base.ply data").0;
    for (ending, again) in [
        ("compressed.ply", ""),
        ("sog", ""),
        ("spz", ""),
        ("splat", "--background 0.2,0.9,0.6 --compensate --max-size 24"),
    ] {
        let text = work.said(&format!("convert base.ply copy.{ending}"));
        assert!(again.is_empty() != text.contains(&format!("give {again} to glint")), "{ending}: {text}");
        let found = score(&work, &format!("copy.{ending} data {again}")).0;
        assert_eq!(found, score(&work, &format!("copy.{ending} data {SAID}")).0, "{ending}");
        assert_ne!(found, score(&work, &format!("copy.{ending} data --background black")).0, "{ending}");
        // The loss from quantisation is 0.02 dB; .splat only has constant colors.
        assert!((found - base).abs() < if ending == "splat" { 1.0 } else { 0.1 }, "{ending}: {found} and {base}");
    }
}

#[test]
fn a_run_says_what_it_is_on_and_what_it_was_worth() {
    let work = Work::new();
    let text = work.said("train data -o base.ply --iterations 20 --points 50 --gaussians 60 --sh-degree 3");
    let line = |begin: &str| text.lines().find(|line| line.starts_with(begin)).unwrap_or_default().to_owned();
    assert!(line("training on ").contains("): 7 photos of 32 × 24, 50 to 60 Gaussians, 20 steps"), "{text}");
    let output = work.run("enhance data --base base.ply -o more.ply --ratio 0.2");
    let [result, text] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    let line = text.lines().find(|line| line.starts_with("enhancing on ")).unwrap();
    assert!(line.contains("): 7 photos of 32 × 24, 60 Gaussians, "), "{text}");
    assert!(work.said("train data -o x.ply --iterations 2 -q").is_empty());
    assert!(result.contains("longer training instead, ") && result.contains("dB (measured)"), "{result}");
    // A run with a time limit has no time left for that measurement.
    let report = work.json("enhance data --base base.ply -o x.ply --ratio 0.2 --time 5s --json --force");
    assert_eq!(report["gain"]["longer_training"]["measured"], false, "{report}");
}

/// Training that finds nothing to depend on the view leaves a comment.
#[test]
fn a_matte_base_gets_plain_gaussians_only() {
    let work = Work::new();
    // So short a trial finds nothing in these photos.
    work.ok("train data -o matte.ply --iterations 40 --bytes 10kB");
    // The same scene without the finding.
    let mut bytes = fs::read(work.path("matte.ply")).unwrap();
    let comment = b"comment glint matte 1";
    let at = bytes.windows(comment.len()).position(|w| w == comment).unwrap();
    bytes[at + comment.len() - 1] = b'0';
    fs::write(work.path("base.ply"), bytes).unwrap();
    let enhance = |base: &str| {
        let output = work.run(&format!("enhance data --base {base} -o x.ply --bytes 12kB --json --force"));
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        let number = |key: &str| found[key].as_u64().unwrap();
        let seen = number("supplementary_gaussians") + number("banded_gaussians");
        (seen, number("plain_gaussians"), String::from_utf8(output.stderr).unwrap())
    };
    let ((seen, _, said), (none, plain, told)) = (enhance("base.ply"), enhance("matte.ply"));
    let note = "no color of the base depends on the view: only plain Gaussians are added";
    assert!(seen > 0 && !said.contains(note), "{seen}: {said}");
    assert!(none == 0 && plain > 0 && told.contains(note), "{none}, {plain}: {told}");
    assert_eq!(work.json("info x.ply --json")["trained_with"]["matte"], true);
    assert!(work.ok("info x.ply").contains("no color depends on the view"));
    work.ok("enhance data --base matte.ply -o augs.ply --method augs --preset quick --ratio 0.2");
    assert!(read_scene(work.path("augs.ply")).unwrap().supplement.is_some(), "who asks for lobes gets them");
}

/// 12 dB is an error of a quarter of the range.
#[test]
fn a_scene_of_another_dataset_is_told() {
    let work = Work::small();
    let mut white = visible(3, 300, 0, 0);
    white.base.sh.fill([9.0; 3]);
    write_scene(work.path("white.ply"), &white).unwrap();
    let (found, notes) = score(&work, "white.ply data");
    assert!(found < 12.0, "{found}");
    let tells = |text: &str| text.contains("on these photos, like a scene of another dataset");
    let told = |arguments: &str| tells(&work.said(arguments));
    assert!(tells(&notes) && told("enhance data --base white.ply -o x.ply --ratio 0.1"));
    work.ok("train data -o own.ply --iterations 100");
    assert!(!told("eval own.ply data") && !told("enhance data --base own.ply -o y.ply --ratio 0.1"));
}
