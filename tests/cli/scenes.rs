//! Tests scenes from other tools.

use std::fs;

use glint::{data::write_scene, reference::sample::random_scene, scene::Scene};

use super::{Work, visible};

/// A scene in which the Gaussians in `rows` have a NaN opacity.
fn broken(work: &Work, name: &str, scene: &Scene, rows: &[usize]) {
    write_scene(work.path(name), scene).unwrap();
    let mut bytes = fs::read(work.path(name)).unwrap();
    let body = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    for row in rows {
        // SH degree 0: position and color come first.
        let at = body + 4 * (14 * row + 6);
        bytes[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    }
    fs::write(work.path(name), bytes).unwrap();
}

#[test]
fn unsound_gaussians_are_refused_by_name_or_dropped_when_asked() {
    let work = Work::new();
    let scene = visible(4, 60, 0, 0);
    broken(&work, "broken.ply", &scene, &[7, 31]);
    for command in ["info broken.ply", "eval broken.ply data", "render broken.ply data -o out"] {
        work.refused(command, &["broken.ply", "row 7 of element `vertex`", "`opacity`", "--lenient"]);
    }
    work.refused("enhance data --base broken.ply -o x.ply", &["broken.ply", "row 7", "--lenient"]);
    assert_eq!(work.json("info broken.ply --lenient --json")["base"]["count"], 58);
    let said = work.said("eval broken.ply data --lenient");
    assert!(
        said.contains("2 of 60 Gaussians dropped") && said.contains("row 7 of element `vertex`: `opacity`"),
        "{said}"
    );
    let report =
        work.json("enhance data --base broken.ply -o x.ply --lenient --method augs --preset quick --ratio 0.05 --json");
    assert_eq!(report["base_gaussians"], 58);
    // The dropped rows are the only difference.
    let mut sound = scene.clone();
    for row in [31, 7] {
        sound.base.means.remove(row);
        sound.base.log_scales.remove(row);
        sound.base.quats.remove(row);
        sound.base.opacities.remove(row);
        sound.base.sh.remove(row);
    }
    write_scene(work.path("sound.ply"), &sound).unwrap();
    work.ok("render broken.ply data -o broken --lenient");
    work.ok("render sound.ply data -o sound");
    assert_eq!(fs::read(work.path("broken/a.png")).unwrap(), fs::read(work.path("sound/a.png")).unwrap());
    // --lenient is for invalid numbers, not for other files.
    fs::write(work.path("text.ply"), "solid cube").unwrap();
    work.refused("info text.ply --lenient", &["text.ply"]);
}

#[test]
fn a_plan_says_what_is_stored_and_what_is_left_out() {
    let work = Work::new();
    write_scene(work.path("plain.ply"), &random_scene(4, 500, 0, 1)).unwrap();
    write_scene(work.path("lobes.ply"), &random_scene(4, 500, 60, 3)).unwrap();
    let text = work.ok("info plain.ply --plan --resolution 640x360");
    for words in [
        "640 × 360 pixels",
        "the scene's degree is 1: 48 bytes a Gaussian",
        "the scene has none; 144 bytes a Gaussian",
        "the scene has no supplement",
        "a Gaussian      96 bytes",
        "nothing learns",
        "splat_colors",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let plan = |options: &str| work.json(&format!("info {options} --plan --json"))["plan"].clone();
    let (whole, half) = (plan("lobes.ply"), plan("lobes.ply --half"));
    assert_eq!((&whole["plain_bytes"], &whole["lobed_bytes"]), (&240.into(), &272.into()));
    assert_eq!((&half["plain_bytes"], &half["lobed_bytes"]), (&128.into(), &160.into()));
    let saved = whole["bytes"].as_i64().unwrap() - half["bytes"].as_i64().unwrap();
    // 112 per Gaussian of the model, 8 per splat; an empty splat buffer still has one element, of 36 bytes or
    // 28.
    assert_eq!(saved, 120 * 560 - 8);
    let feature = |plan: &serde_json::Value, name: &str| {
        plan["features"].as_array().unwrap().iter().find(|f| f["name"] == name).unwrap().clone()
    };
    assert_eq!(feature(&whole, "half width")["bytes"], -saved);
    let included = |plan, name: &str| feature(plan, name)["included"].as_bool().unwrap();
    assert!(included(&whole, "lobes") && !included(&whole, "half width") && included(&half, "half width"));
    assert!(plan("plain.ply --resolution 64x64")["bytes"].as_i64() < plan("plain.ply")["bytes"].as_i64());
    assert!(work.json("info plain.ply --json").get("plan").is_none());
    work.refused("info data --plan", &["data", "expected a scene"]);
    for (command, word) in
        [("info plain.ply --plan --resolution 0x9", "1920x1080"), ("info plain.ply --half", "--plan")]
    {
        work.misused(command, word);
    }
}
