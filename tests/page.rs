//! The page of `glint export` in a browser without a window, its pixels beside the float64 twin's. Skips where there is no Chromium,
//! unless `GLINT_REQUIRE_CHROMIUM` is set.

#[path = "common/run.rs"]
mod run;

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use base64::{Engine, engine::general_purpose::STANDARD};
use glint::{
    reference::{self, Background, Options, Params, View, random_camera, random_scene},
    report::viewer::Viewer,
    scene::{Camera, Scene},
};
use tempfile::TempDir;

const BACKGROUND: [f32; 3] = [0.1, 0.2, 0.3];

/// Its name is other on other systems.
fn chromium() -> Option<PathBuf> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&folders).flat_map(|folder| names.map(|name| folder.join(name)));
    let path = found.into_iter().find(|path| path.is_file());
    assert!(path.is_some() || std::env::var_os("GLINT_REQUIRE_CHROMIUM").is_none(), "there is no Chromium");
    if path.is_none() {
        eprintln!("skipped: there is no Chromium");
    }
    path
}

/// The page at `path` as it is when it has loaded.
fn loaded(browser: &Path, path: &Path, hash: &str, more: &[&str]) -> String {
    let profile = tempfile::tempdir().unwrap();
    let mut command = Command::new(browser);
    command.args(["--headless", "--no-sandbox", "--disable-gpu-sandbox", "--disable-dev-shm-usage", "--no-first-run"]);
    command.args(["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-extensions", "--dump-dom"]);
    command.args(more).arg(format!("--user-data-dir={}", profile.path().display()));
    let output = run::run(command.arg(format!("file://{}#{hash}", path.display())));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The text of the element of that id.
fn text_of<'a>(page: &'a str, id: &str) -> Option<&'a str> {
    let (_, behind) = page.split_once(&format!("id=\"{id}\""))?;
    Some(behind.split_once('>')?.1.split_once('<')?.0)
}

fn pixels(page: &str) -> Vec<u8> {
    let text = text_of(page, "pixels").unwrap_or_else(|| panic!("{:?}", text_of(page, "message")));
    STANDARD.decode(text).unwrap()
}

#[test]
fn the_page_draws_what_the_twin_draws() {
    let Some(browser) = chromium() else { return };
    let folder = TempDir::new().unwrap();
    let (scene, camera) = (random_scene(41, 1500, 500, 3), random_camera(160, 120));
    for compensate in [false, true] {
        let page = Viewer {
            title: "random",
            scene: &scene,
            cameras: vec![("a & b.png", camera)],
            focus: None,
            background: BACKGROUND,
            compensate,
        };
        let path = folder.path().join("page.html");
        fs::write(&path, page.page().unwrap()).unwrap();
        for show in ["both", "base", "supplement"] {
            for precision in ["half", "float"] {
                let hash = format!("camera=a%20%26%20b.png&size=160x120&show={show}&precision={precision}&pixels");
                let begin = std::time::Instant::now();
                let rgb = pixels(&loaded(&browser, &path, &hash, &[]));
                eprintln!("{show} {precision} {compensate}: {:?}", begin.elapsed());
                compare(&rgb, &scene, show, &camera, compensate);
            }
        }
    }
}

fn compare(rgb: &[u8], scene: &Scene, show: &str, camera: &Camera, compensate: bool) {
    let scene = match show {
        "base" => Scene { supplement: None, ..scene.clone() },
        "supplement" => {
            let mut alone = scene.clone();
            alone.base.opacities.iter_mut().for_each(|v| *v = -20.0);
            alone
        }
        _ => scene.clone(),
    };
    let params = Params::from_scene(&scene).unwrap();
    let options = Options { compensate, ..Options::default() };
    let background = Background::Color(BACKGROUND.map(f64::from));
    let twin = reference::render(&params, &View::from_camera(camera), &options, background);
    assert_eq!(rgb.len(), 3 * twin.blended.image.len());
    let (mut offs, mut stopped) = (Vec::new(), 0);
    for (pixel, expected) in rgb.chunks(3).zip(&twin.blended.image) {
        let off = (0..3).map(|c| (f64::from(pixel[c]) - 255.0 * expected[c].clamp(0.0, 1.0)).abs()).fold(0.0, f64::max);
        if expected[3] < 0.01 { stopped += 1 }
        offs.push(off);
    }
    let mean = offs.iter().sum::<f64>() / offs.len() as f64;
    offs.sort_by(f64::total_cmp);
    let at = |s: f64| offs[(s * (offs.len() - 1) as f64) as usize];
    eprintln!("mean {mean:.3}, 50 {:.2} 90 {:.2} 99 {:.2} 99.9 {:.2} max {:.2}; stopped {stopped}", at(0.5), at(0.9), at(0.99), at(0.999), at(1.0));
}
