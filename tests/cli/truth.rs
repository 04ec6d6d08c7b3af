//! Tests datasets with known truth, the score of a decomposition, and reports of several scenes.

use std::fs;

use glint::{
    data::{write_png_rgb, write_scene},
    report::pictures::data_of,
};
use serde_json::Value;

use super::{Work, files, visible};

const SYNTH: &str = "synth mixed -o shiny --views 9 --size 24 --points 80";

#[test]
fn a_synthetic_dataset_is_made_trained_and_its_parts_are_judged() {
    let work = Work::new();
    assert!(work.ok(SYNTH).contains("9 photos"));
    for folder in ["images", "diffuse", "specular"] {
        assert_eq!(files(&work.path(&format!("shiny/{folder}"))).len(), 9);
    }
    let info = work.json("info shiny --json");
    assert_eq!((&info["train"], &info["test"], &info["points"]), (&7.into(), &2.into(), &80.into()));
    work.refused(SYNTH, &["already exists", "--force"]);
    let before = fs::read(work.path("shiny/images/view_03.png")).unwrap();
    work.ok(&format!("{SYNTH} --force"));
    assert_eq!(fs::read(work.path("shiny/images/view_03.png")).unwrap(), before);
    work.ok(&format!("{SYNTH} --force --seed 1"));
    assert_ne!(fs::read(work.path("shiny/images/view_03.png")).unwrap(), before);
    for bad in ["synth chrome -o x", "synth mirror -o x --views 7", "synth mirror -o x --size 15"] {
        assert_eq!(work.run(bad).status.code(), Some(2), "{bad}");
    }

    work.ok("train shiny -o few.ply --iterations 2 --sh-degree 1");
    work.ok("train shiny -o more.ply --iterations 200 --sh-degree 1");
    let parts = |scene: &str| {
        let found = work.json(&format!("eval {scene} shiny --decomposition --json"));
        let parts = found["decomposition"].clone();
        assert_eq!(parts["views"].as_array().unwrap().len(), 2);
        let of = |value: &Value| [&value["diffuse"], &value["specular"]].map(|v| v.as_f64().unwrap());
        // Means of the two views.
        let (mean, [a, b]) = (of(&parts), [0, 1].map(|i| of(&parts["views"][i])));
        assert!((0..2).all(|i| (mean[i] - 0.5 * (a[i] + b[i])).abs() < 1e-9));
        mean
    };
    let (few, more) = (parts("few.ply"), parts("more.ply"));
    assert!(more[0] > few[0] + 1.0, "{few:?} {more:?}");
    let table = work.ok("eval more.ply shiny --decomposition");
    assert!(table.contains("diffuse PSNR [dB]") && table.contains("specular PSNR [dB]"), "{table}");
    assert!(work.json("eval more.ply shiny --json").get("decomposition").is_none());

    // A report shows the true parts of both views next to those of both scenes, with the numbers of eval.
    work.ok("report shiny few=few.ply more=more.ply -o page");
    let html = fs::read_to_string(work.path("page/index.html")).unwrap();
    let count = |part: &str| html.matches(part).count();
    let numbers: Value = serde_json::from_slice(&fs::read(work.path("page/report.json")).unwrap()).unwrap();
    for (scene, expected) in numbers["scenes"].as_array().unwrap().iter().zip([few, more]) {
        let found = [scene, &scene["views"][0]].map(|of| of["decomposition"]["specular"].as_f64().unwrap());
        assert!((found[0] - expected[1]).abs() < 1e-9 && found[1].is_finite(), "{found:?} {expected:?}");
        assert!(count(&format!("<td>{:.2}</td><td>{:.2}</td></tr>", expected[0], expected[1])) == 1, "{html}");
    }
    assert_eq!([count("true diffuse of"), count("true specular of"), count("few: diffuse of")], [2; 3], "{html}");
    assert_eq!((count("over few [dB]"), count("× 4</th>")), (1, 2), "{html}");

    // A missing part, or one of another size, is named.
    write_png_rgb(work.path("shiny/specular/view_08.png"), 5, 5, &[0.0; 75]).unwrap();
    for command in ["eval more.ply shiny --decomposition", "report shiny few=few.ply -o page --force"] {
        work.refused(command, &["specular/view_08.png", "5 × 5", "24 × 24"]);
    }
    fs::remove_file(work.path("shiny/specular/view_08.png")).unwrap();
    work.refused("eval more.ply shiny --decomposition", &["view_08", "no true specular part"]);
    work.refused("eval more.ply data --decomposition", &["a.png", "no true diffuse part"]);
}

#[test]
fn scenes_are_shown_beside_each_other() {
    let work = Work::new();
    let mut scene = visible(8, 200, 60, 1);
    write_scene(work.path("augmented.ply"), &scene).unwrap();
    scene.supplement = None;
    write_scene(work.path("base.ply"), &scene).unwrap();
    let line = |name: &str, seed: u32, seconds: f64, psnr: f64, holdout: &str| {
        format!(
            r#"{{"name":"{name}","seconds":{seconds},"bytes":900,"gaussians":200,"psnr":{psnr},"ssim":0.7,"seed":{seed},"holdout":"{holdout}"}}"#
        ) + "\n"
    };
    let history = line("base", 0, 1.0, 20.0, "every")
        + &line("base", 1, 3.0, 22.0, "every")
        + &line("base", 0, 2.0, 21.0, "every")
        + &line("base", 1, 6.0, 23.0, "every")
        + &line("base", 0, 1.0, 19.0, "sector");
    fs::write(work.path("runs.jsonl"), history).unwrap();
    let report = "report data base=base.ply more=augmented.ply -o shown --split all";
    let table = work.ok(&format!("{report} --history runs.jsonl"));
    assert!(table.contains("base") && table.contains("with lobes"), "{table}");
    assert_eq!(files(&work.path("shown")), ["index.html", "report.json"]);
    let html = fs::read_to_string(work.path("shown/index.html")).unwrap();
    let count = |part: &str| html.matches(part).count();
    // Nine views: a photograph and two renders each, an error for either scene, the parts of the augmented
    // one.
    assert_eq!(
        [count("<section"), count("class=\"shot"), count("class=\"error"), count("class=\"part")],
        [9, 27, 18, 18]
    );
    // Curves over seconds, for the hold-out that has several evaluations.
    assert_eq!((count("<svg"), count("hold-out every"), count("hold-out sector")), (2, 1, 1));
    assert!(!html.contains("://") && html.contains("<td>22.00 (21.00 to 23.00)</td>"));
    // A photo's picture equals the photo, a render's picture equals `render`'s output.
    work.ok("render augmented.ply data -o renders");
    for file in ["data/images/a.png", "renders/a.png"] {
        let pixels = image::open(work.path(file)).unwrap().into_rgb8();
        assert!(html.contains(&data_of(&pixels).unwrap()), "{file}");
    }
    // The numbers equal those of eval.
    let numbers: Value = serde_json::from_slice(&fs::read(work.path("shown/report.json")).unwrap()).unwrap();
    let found = work.json("eval augmented.ply data --split all --json");
    for (i, part) in ["base", "augmented"].into_iter().enumerate() {
        let scene = &numbers["scenes"][i];
        assert_eq!((&scene["psnr"], &scene["ssim"]), (&found[part]["psnr"], &found[part]["ssim"]));
        assert_eq!(scene["views"][4]["psnr"], found["views"][4][part]["psnr"]);
        assert!(html.contains(&format!(
            "<td>{:.2}</td><td>{:.4}</td>",
            scene["psnr"].as_f64().unwrap(),
            scene["ssim"].as_f64().unwrap()
        )));
    }
    assert_eq!((&numbers["scenes"][1]["gaussians"], &numbers["scenes"][1]["supplementary"]), (&260.into(), &60.into()));
    assert_eq!(numbers["scenes"][1]["bytes"], fs::metadata(work.path("augmented.ply")).unwrap().len());

    work.refused(report, &["index.html", "--force"]);
    work.ok(&format!("{report} --force"));
    work.refused("report data a=base.ply a=augmented.ply -o x", &["two scenes", "`a`"]);
    work.refused("report data a=nowhere.ply -o x/y", &["nowhere.ply"]);
    fs::write(work.path("bad.jsonl"), "{\"name\":\"a\"}\n").unwrap();
    work.refused("report data a=base.ply -o x --history bad.jsonl", &["bad.jsonl", "line 1", "seconds"]);
    work.refused("report data a=base.ply -o data/images", &["a folder of the dataset's photos"]);
    assert_eq!(work.run("report data base.ply -o x").status.code(), Some(2));
}
