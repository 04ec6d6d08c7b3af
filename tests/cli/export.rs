//! Tests `glint export`. `tests/cli/page.rs` tests the page's rendering.

use std::fs;

use glint::{data::write_scene, reference::sample::random_scene};

use super::{NAMES, Work};

#[test]
fn a_page_has_the_scene_and_the_cameras_that_are_asked_for() {
    let work = Work::new();
    write_scene(work.path("augmented.ply"), &random_scene(4, 60, 15, 2)).unwrap();
    let report = work.json("export --html all.html augmented.ply data --json");
    for (field, expected) in [
        ("gaussians", 60),
        ("supplementary", 15),
        ("sh_degree", 2),
        ("cameras", NAMES.len() as u64),
        ("bytes_per_gaussian", 64),
        ("bytes_per_gaussian_with_lobe", 80),
        ("page_bytes", fs::metadata(work.path("all.html")).unwrap().len()),
    ] {
        assert_eq!(report[field], expected, "{field}");
    }
    let page = fs::read_to_string(work.path("all.html")).unwrap();
    assert!(NAMES.iter().all(|name| page.contains(&format!("\"name\":\"{name}\""))));
    work.ok("export --html test.html augmented.ply data --split test --background white");
    let page = fs::read_to_string(work.path("test.html")).unwrap();
    assert!(page.contains("\"name\":\"a.png\"") && !page.contains("\"name\":\"d.png\""));
    assert!(page.contains("\"background\":[1.0,1.0,1.0]"));
    let text = work.ok("export --html alone.html augmented.ply");
    let said = "alone.html: 60 Gaussians of 64 bytes, 15 with lobes of 80 bytes, SH degree 2, 0 cameras, ";
    assert!(text.starts_with(said) && text.ends_with(" MB\n"), "{text}");
}

#[test]
fn pages_are_not_written_over_and_bad_input_is_named() {
    let work = Work::new();
    write_scene(work.path("base.ply"), &random_scene(4, 20, 0, 0)).unwrap();
    work.ok("export --html a.html base.ply");
    work.refused("export --html a.html base.ply", &["a.html", "--force"]);
    work.ok("export --html a.html base.ply --force");
    work.refused("export --html a.txt base.ply", &["a.txt", "a page", "a.html"]);
    work.refused("export --html b.html nowhere.ply", &["nowhere.ply"]);
    work.refused("export --html b.html base.ply nowhere", &["nowhere"]);
    work.refused("export --html b.html data base.ply", &["data", "the scene comes before the dataset"]);
}
