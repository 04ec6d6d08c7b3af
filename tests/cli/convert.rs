//! Tests `glint convert`, and scenes of other formats in every command that takes a scene.

use std::fs;

use glint::{
    data::{SceneFile, read_scene, read_scene_file, write_scene, write_scene_file},
    reference::sample::random_scene,
};

use super::{Work, visible};

const ENDINGS: [&str; 9] = ["ply", "glb", "usda", "usdz", "compressed.ply", "rad", "sog", "spz", "splat"];

/// Every command that reads a PLY reports the extra properties of another program.
#[test]
fn properties_that_change_the_picture_are_told() {
    let work = Work::new();
    let scene = random_scene(3, 5, 0, 0).base;
    let mut text = String::from("ply\nformat ascii 1.0\nelement vertex 5\n");
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3 filter_3D motion_0";
    names.split(' ').for_each(|name| text += &format!("property float {name}\n"));
    text += "end_header\n";
    for i in 0..5 {
        let row = [
            &scene.means[i][..],
            &scene.sh[i],
            &[scene.opacities[i]],
            &scene.log_scales[i],
            &scene.quats[i],
            &[0.1, 3.0],
        ];
        text += &(row.concat().iter().map(f32::to_string).collect::<Vec<_>>().join(" ") + "\n");
    }
    fs::write(work.path("mip.ply"), text).unwrap();
    for command in ["convert mip.ply a.ply", "info mip.ply", "convert mip.ply b.ply --lenient"] {
        let said = work.said(command);
        assert!(
            said.contains("note: mip.ply: `filter_3D` (Mip-Splatting) is taken into the sizes"),
            "{command}: {said}"
        );
        assert!(said.contains("note: mip.ply: `motion_0` is not read") && said.contains("moves"), "{command}: {said}");
    }
    let found = read_scene(work.path("a.ply")).unwrap().base;
    let want = (scene.log_scales[0].map(|v| (2.0 * v).exp() + 0.01)[1]).ln() / 2.0;
    assert!((found.log_scales[0][1] - want).abs() < 1e-5);
}

#[test]
fn a_scene_of_any_kind_is_taken_wherever_one_is_asked_for() {
    let work = Work::new();
    write_scene(work.path("base.ply"), &visible(4, 200, 0, 1)).unwrap();
    for ending in ENDINGS {
        let out = format!("a.{ending}");
        let report = work.json(&format!("convert base.ply {out} --compare data --json"));
        assert_eq!((&report["gaussians"], &report["supplementary"]), (&200.into(), &0.into()), "{ending}");
        assert_eq!(report["sh_degree"], if ending == "splat" { 0 } else { 1 }, "{ending}");
        assert_eq!(report["input_bytes"], fs::metadata(work.path("base.ply")).unwrap().len());
        assert_eq!(report["output_bytes"], fs::metadata(work.path(&out)).unwrap().len());
        // PLY keeps everything, so the difference is 0 and JSON has no PSNR.
        let psnr = report["psnr"].as_f64();
        assert!(if ending == "ply" { psnr.is_none() } else { psnr.unwrap() > 20.0 }, "{ending}: {report}");
        assert_eq!(work.json(&format!("info {out} --json"))["base"]["count"], 200);
        work.ok(&format!("render {out} data -o views.{ending}"));
        work.ok(&format!("convert {out} b.{ending}"));
    }
    let text = work.ok("convert base.ply text.splat --compare data");
    assert!(text.starts_with("text.splat: 200 Gaussians, SH degree 0, 0.006 MB of 0.021, renders "), "{text}");
    assert!(text.ends_with(" dB against the input's\n"), "{text}");
    let said = work.said("convert base.ply note.splat");
    assert!(said.contains("note: note.splat: view-dependent color is not stored"), "{said}");
    // A folder with the files of an SOG scene.
    let mut archive = zip::ZipArchive::new(fs::File::open(work.path("a.sog")).unwrap()).unwrap();
    archive.extract(work.path("folder")).unwrap();
    for input in ["folder", "folder/meta.json"] {
        assert_eq!(work.json(&format!("info {input} --json"))["base"]["count"], 200);
        work.ok(&format!("convert {input} from_folder.ply --force"));
        assert_eq!(read_scene(work.path("from_folder.ply")).unwrap(), read_scene(work.path("a.sog")).unwrap());
    }
    work.ok("eval a.spz data");
    for version in 1..=3 {
        // tests/formats checks the kept data; here it suffices that it is the same scene.
        let convert = format!("convert base.ply v{version}.spz --spz-version {version} --compare data --json");
        assert!(work.json(&convert)["psnr"].as_f64().unwrap() > 20.0);
    }
    assert!(work.ok("convert base.ply same.ply --compare data").contains("renders are identical to the input's"));
    // With levels of detail the scene is a folder.
    let report = work.json("convert base.ply web/lod-meta.json --lod 2 --compare data --json");
    assert!(report["psnr"].as_f64().unwrap() > 20.0 && report["output_bytes"].as_u64().unwrap() > 2000, "{report}");
    assert!(!work.path("web/2_0").exists() && work.path("web/1_0/meta.json").is_file());
    assert_eq!(work.json("info web --json")["base"]["count"], 200);
    work.refused("convert base.ply web/lod-meta.json", &["web/lod-meta.json", "--force"]);
    for input in ["web", "web/lod-meta.json", "web/1_0"] {
        work.refused(&format!("convert {input} web/lod-meta.json --force"), &["web", "this command reads"]);
    }
    work.ok("convert web b/lod-meta.json");
    work.refused("convert base.ply lod-meta.json", &["is a folder", "web/lod-meta.json"]);
    work.refused("convert base.ply v.sog --lod 3", &["v.sog", "--lod"]);
    // If the comparison is impossible, nothing is written.
    work.refused("convert base.ply x.spz --compare data --holdout none --split test", &["test split"]);
    assert!(!work.path("x.spz").exists());
    assert_eq!(read_scene(work.path("v3.spz")).unwrap(), read_scene(work.path("a.spz")).unwrap());
    work.refused("convert base.ply v.sog --spz-version 3", &["v.sog", "--spz-version"]);
    let report = work.json("enhance data --base a.sog -o x.ply --method augs --preset quick --ratio 0.05 --json");
    assert_eq!(report["base_gaussians"], 200);
}

#[test]
fn lobes_are_kept_refused_or_left_out_when_asked() {
    let work = Work::new();
    let scene = visible(4, 200, 30, 1);
    let mut shown = scene.base.clone();
    shown.opacities.iter_mut().for_each(|v| *v -= 1.0);
    let file = SceneFile { shown: Some(shown.clone()), ..scene.clone().into() };
    write_scene_file(work.path("augmented.ply"), &file).unwrap();
    for ending in ENDINGS {
        let out = format!("a.{ending}");
        if ["ply", "glb", "spz"].contains(&ending) {
            let text = work.ok(&format!("convert augmented.ply {out}"));
            assert!(text.contains("200 Gaussians, 30 with lobes"), "{text}");
            let (found, wanted) = (read_scene(work.path(&out)).unwrap().supplement.unwrap(), &scene.supplement);
            let wanted = wanted.as_ref().unwrap();
            match ending {
                // It rounds.
                "spz" => assert_eq!(found.lobes.widths.len(), wanted.lobes.widths.len()),
                _ => assert_eq!(found.lobes, wanted.lobes),
            }
        } else {
            work.refused(&format!("convert augmented.ply {out}"), &[&out, "30 Gaussians with lobes", "--base-only"]);
        }
        let out = format!("b.{ending}");
        work.ok(&format!("convert augmented.ply {out} --base-only"));
        let file = read_scene_file(work.path(&out)).unwrap();
        assert!(file.scene.supplement.is_none() && file.shown.is_none());
    }
    // The base for other viewers, not the trained one.
    assert_eq!(read_scene(work.path("b.ply")).unwrap().base, shown);
    let copy = work.ok("convert augmented.ply copy.ply");
    assert!(copy.contains("30 with lobes"));
    assert_eq!(fs::read(work.path("copy.ply")).unwrap(), fs::read(work.path("augmented.ply")).unwrap());
}

#[test]
fn nothing_is_written_over_or_left_half_done() {
    let work = Work::new();
    write_scene(work.path("base.ply"), &visible(4, 200, 0, 1)).unwrap();
    work.ok("convert base.ply a.spz");
    work.refused("convert base.ply a.spz", &["a.spz", "--force"]);
    work.ok("convert base.ply a.spz --force");
    work.refused("convert base.ply base.ply --force", &["base.ply", "this command reads"]);
    work.refused("convert base.ply a.obj", &["a.obj", ".ply", ".compressed.ply", ".splat"]);
    work.refused("convert base.ply nowhere/a.spz", &["nowhere"]);
    work.refused("convert nowhere.spz a.ply", &["nowhere.spz"]);
    work.refused("convert data a.ply", &["data", "is a folder"]);
    let bytes = fs::read(work.path("a.spz")).unwrap();
    fs::write(work.path("cut.spz"), &bytes[..bytes.len() - 9]).unwrap();
    work.refused("convert cut.spz b.ply", &["cut.spz"]);
    // An invalid row is named by its number, and dropped on request.
    work.ok("convert base.ply a.splat");
    let mut bytes = fs::read(work.path("a.splat")).unwrap();
    bytes[32 * 7..32 * 7 + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    fs::write(work.path("bad.splat"), bytes).unwrap();
    work.refused("convert bad.splat b.ply", &["bad.splat", "row 7: `x` is not a finite number", "--lenient"]);
    let text = work.ok("convert bad.splat b.ply --lenient");
    assert!(text.contains("199 Gaussians"), "{text}");
}
