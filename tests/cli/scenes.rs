//! Scenes as other tools leave them.

use std::fs;

use glint::{data::write_scene, reference::sample::random_scene, scene::Scene};

use super::Work;

/// A scene of which the Gaussians in `rows` have an infinite opacity.
fn broken(work: &Work, name: &str, scene: &Scene, rows: &[usize]) {
    write_scene(work.path(name), scene).unwrap();
    let mut bytes = fs::read(work.path(name)).unwrap();
    let body = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    for row in rows {
        // Of SH degree 0: position, normal and colour come first.
        let at = body + 4 * (17 * row + 9);
        bytes[at..at + 4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    }
    fs::write(work.path(name), bytes).unwrap();
}

#[test]
fn unsound_gaussians_are_refused_by_name_or_dropped_when_asked() {
    let work = Work::new();
    let mut scene = random_scene(4, 60, 0, 0);
    scene.base.means.iter_mut().for_each(|mean| *mean = mean.map(f32::sin));
    broken(&work, "broken.ply", &scene, &[7, 31]);
    for command in ["info broken.ply", "eval broken.ply data", "render broken.ply data -o out"] {
        work.refused(command, &["broken.ply", "row 7 of element `vertex`", "`opacity`", "--lenient"]);
    }
    work.refused("enhance data --base broken.ply -o x.ply", &["broken.ply", "row 7", "--lenient"]);
    assert_eq!(work.json("info broken.ply --lenient --json")["base"]["count"], 58);
    let said = String::from_utf8(work.run("eval broken.ply data --lenient").stderr).unwrap();
    assert!(
        said.contains("2 of 60 Gaussians dropped") && said.contains("row 7 of element `vertex`: `opacity`"),
        "{said}"
    );
    let report =
        work.json("enhance data --base broken.ply -o x.ply --lenient --method augs --preset quick --ratio 0.05 --json");
    assert_eq!(report["base_gaussians"], 58);
    // What is dropped is all that differs.
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
    // Leniency is for numbers, not for other files.
    fs::write(work.path("text.ply"), "solid cube").unwrap();
    work.refused("info text.ply --lenient", &["text.ply"]);
}
