//! Uses glint from outside: a crate and a C program that depend on it like any other, built with Rust and a C
//! compiler alone.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::Command,
    time::Duration,
};

use glam::{DMat4, DVec3, DVec4};
use glint::{
    data::write_scene,
    gpu::{Buffer, BufferRange, Pixels},
    pipelines::{
        frames::{
            Blend, DepthForm, Frame, FrameView, Frames, Instance, Light, Limits, SYNC_READ, SYNC_WRITTEN, Target,
            Texel, Transform,
        },
        model::Model,
        render::{Needs, RenderOptions, Renderer},
        views::Views,
    },
    reference::{
        Background, Intersections, Options, Params, View, blend::blend_before, project::project, random_camera,
        random_scene, tiles::Tiling,
    },
    scene::{Camera, Scene},
};

use super::{common::Gpu, run};

const SIZE: [u32; 2] = [96, 72];
const PIXELS: usize = (SIZE[0] * SIZE[1]) as usize;

/// Time limit of the longest command, a first unoptimised build of glint and its dependencies on two busy
/// cores; it only ends hangs.
const LIMIT: Duration = Duration::from_secs(1800);

/// The first build of an external crate is promised to take three minutes on two cores. Tests share the cores
/// with others, so the limit is the CPU time of two cores in that time, seconds; the README has the
/// wall-clock time.
const BUILD: f64 = 2.0 * 180.0;

/// Builds are kept for the next run, in a private folder.
fn target() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("target/outside")
}

fn within(folder: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)
}

/// Runs a command that must succeed, without cargo's variables of this test: a dependent crate has none of
/// these.
fn done(command: &mut Command) -> String {
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("CARGO") && name != "CARGO_HOME") {
        command.env_remove(name);
    }
    let output = run::run_within(LIMIT, command.env("CARGO_TARGET_DIR", target()));
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{command:?}: {}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

/// A scene, and a camera as a renderer's matrices.
struct Case {
    folder: tempfile::TempDir,
    scene: Scene,
    camera: Camera,
    view: DMat4,
    projection: DMat4,
}

impl Case {
    fn new() -> Self {
        let (scene, camera) = (random_scene(33, 700, 200, 3), random_camera(SIZE[0], SIZE[1]));
        let folder = tempfile::tempdir().unwrap();
        write_scene(folder.path().join("scene.ply"), &scene).unwrap();
        let (r, t) = (camera.rotation, camera.translation);
        let view = DMat4::from_cols(r.x_axis.extend(0.0), r.y_axis.extend(0.0), r.z_axis.extend(0.0), t.extend(1.0));
        let [w, h] = SIZE.map(f64::from);
        let projection = DMat4::from_cols(
            DVec4::new(2.0 * camera.fx / w, 0.0, 0.0, 0.0),
            DVec4::new(0.0, 2.0 * camera.fy / h, 0.0, 0.0),
            DVec4::new(2.0 * camera.cx / w - 1.0, 2.0 * camera.cy / h - 1.0, 0.0, 1.0),
            DVec4::new(0.0, 0.0, 0.2, 0.0),
        );
        Case { folder, scene, camera, view, projection }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs a program on the case; returns its output as words, the frame's pixels first.
    fn words(&self, program: &Path, more: &[f64]) -> Vec<u32> {
        let matrices = [self.view, self.projection].map(|m| m.to_cols_array());
        let numbers: Vec<String> =
            SIZE.map(f64::from).iter().chain(matrices.iter().flatten()).chain(more).map(|v| format!("{v:?}")).collect();
        fs::write(self.path("numbers"), numbers.join(" ")).unwrap();
        let files = ["numbers", "scene.ply", "out"].map(|name| self.path(name));
        println!("{}", done(Command::new(program).args(files)));
        let bytes = fs::read(self.path("out")).unwrap();
        bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect()
    }
}

#[test]
fn a_crate_outside_draws_a_mesh_and_a_scene_that_hide_each_other() {
    let case = Case::new();
    // In a folder outside of glint's, whose cargo settings would otherwise apply.
    let outside = case.path("mesh");
    let manifest = copy_crate(&within("tests/outside/mesh"), &outside);
    // Removes copies of earlier runs.
    done(Command::new("cargo").args(["clean", "--quiet", "--package", "mesh"]).current_dir(&outside));
    let times = done(Command::new("bash").args(["-c", "cargo build --quiet --locked && times"]).current_dir(&outside));
    let seconds = cpu_seconds(&times);
    println!("a build takes {seconds:.1} s of CPU time, of what was not built yet");
    assert!(seconds > 0.0 && seconds < BUILD, "{seconds} s of CPU time");
    assert!(manifest.contains("default-features = false"));
    // All packages built for it, on any system.
    let lock = fs::read_to_string(outside.join("Cargo.lock")).unwrap();
    let packages: Vec<&str> = lock.lines().filter_map(|line| line.strip_prefix("name = ")).collect();
    assert!(packages.contains(&"\"ash\"") && packages.len() <= 30 + 2, "{} beside mesh and glint", packages.len() - 2);
    // A tilted quad: its left edge is 1 unit from the camera, its right one 6.
    let corner = |x: f64, y: f64, z: f64| case.camera.unproject(x, y, z);
    let corners = [corner(10.3, 8.4, 1.0), corner(80.2, 5.1, 6.0), corner(10.3, 66.7, 1.0), corner(80.2, 69.9, 6.0)];
    let numbers: Vec<f64> = corners.iter().flat_map(|c| c.to_array()).collect();
    let got = case.words(&target().join("debug/mesh"), &numbers);
    assert_eq!(got.len(), 4 * PIXELS);
    let got: Vec<_> = got.chunks_exact(4).map(|p| [0, 1, 2, 3].map(|c| f32::from_bits(p[c]))).collect();

    // The quad in float64: camera z of the intersection of a pixel's ray with one of its triangles, and the
    // distance from the edge.
    let eye = case.camera.eye();
    let hit = |pixel: usize| {
        let (x, y) = ((pixel as u32 % SIZE[0]) as f64 + 0.5, (pixel as u32 / SIZE[0]) as f64 + 0.5);
        let ray = case.camera.unproject(x, y, 1.0) - eye;
        [[0, 1, 2], [2, 1, 3]].into_iter().filter_map(|t| triangle(eye, ray, t.map(|i| corners[i]))).next()
    };
    let edge = |pixel: usize| {
        let near = |dx: i64, dy: i64| {
            let at = pixel as i64 + dx + dy * i64::from(SIZE[0]);
            hit(at.clamp(0, i64::from(SIZE[0] * SIZE[1]) - 1) as usize).is_some()
        };
        let here = hit(pixel).is_some();
        [(1, 0), (-1, 0), (0, 1), (0, -1)].iter().any(|&(dx, dy)| near(dx, dy) != here)
    };
    let form = DepthForm::reversed_infinite(0.2);
    assert_eq!(FrameView::from_matrices(case.view, case.projection, SIZE[0], SIZE[1]).unwrap().depth_form, form);
    let params = Params::from_scene(&case.scene).unwrap();
    let view = View::from_camera(&case.camera).rounded();
    let options = Options::default();
    let projected = project(&params, &view, &options);
    let isects = Intersections::new(&projected, Tiling::new(SIZE[0], SIZE[1], &options));
    let want = blend_before(&projected.splats, &isects, Background::Color([0.0; 3]), 0.5, |pixel| {
        hit(pixel).unwrap_or(f64::INFINITY)
    });
    let (quad, sky) = ([0.8, 0.3, 0.1], [0.2, 0.4, 0.6]);
    let (mut seen, mut before, mut behind) = (0, 0, 0);
    for (pixel, got) in got.iter().enumerate() {
        // The rasteriser decides pixels at edges; its interpolated depths have five digits.
        if edge(pixel) || want.margins[pixel].image() < 1e-3 {
            continue;
        }
        seen += 1;
        let under = if hit(pixel).is_some() { quad } else { sky };
        let [r, g, b, t] = want.image[pixel];
        for (c, scene) in [r, g, b].into_iter().enumerate() {
            let want = scene + t * under[c];
            assert!((f64::from(got[c]) - want).abs() < 1e-4, "pixel {pixel}: {got:?}, {c} is {want}");
        }
        if hit(pixel).is_some() {
            before += usize::from(t < 0.5);
            behind += usize::from(t > 0.95);
        }
    }
    // Gaussians in front of the quad, and pixels in which it hides all of them.
    assert!(seen > 4000 && before > 300 && behind > 100, "{seen} {before} {behind}");
}

/// Parses the output of bash's `times`: minutes and seconds of its commands in user and system mode, from the
/// second line.
fn cpu_seconds(times: &str) -> f64 {
    let of = |time: &str| {
        let (minutes, seconds) = time.strip_suffix('s')?.split_once('m')?;
        Some(60.0 * minutes.parse::<f64>().ok()? + seconds.parse::<f64>().ok()?)
    };
    times.lines().nth(1).unwrap_or_default().split_whitespace().filter_map(of).sum()
}

/// Copies the crate `from`, and adapts its path to glint. Returns its manifest.
fn copy_crate(from: &Path, to: &Path) -> String {
    fs::create_dir_all(to.join("src")).unwrap();
    let files =
        fs::read_dir(from).unwrap().chain(fs::read_dir(from.join("src")).unwrap()).map(|entry| entry.unwrap().path());
    for file in files.filter(|path| path.is_file()) {
        fs::copy(&file, to.join(file.strip_prefix(from).unwrap())).unwrap();
    }
    let manifest = fs::read_to_string(to.join("Cargo.toml")).unwrap();
    assert!(manifest.contains("../../.."));
    let manifest = manifest.replace("../../..", within("").to_str().unwrap().trim_end_matches('/'));
    fs::write(to.join("Cargo.toml"), &manifest).unwrap();
    manifest
}

/// Camera z (the ray's parameter, as its z is 1) of a ray's intersection with a triangle (Möller and Trumbore
/// 1997).
fn triangle(eye: DVec3, ray: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let p = ray.cross(ac);
    let scale = 1.0 / ab.dot(p);
    let from = eye - a;
    let u = from.dot(p) * scale;
    let q = from.cross(ab);
    let (v, t) = (ray.dot(q) * scale, ac.dot(q) * scale);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

/// The shared library exports exactly the functions of the header, and the header's barriers equal the Rust
/// side's.
fn check_header(installed: &Path) {
    let header = fs::read_to_string(within("src/c/glint.h")).unwrap();
    let listed = done(Command::new("nm").args(["-D", "--defined-only"]).arg(installed.join("lib/libglint.so")));
    let exported: BTreeSet<&str> = listed
        .lines()
        .filter_map(|line| line.split_whitespace().last())
        .filter(|name| name.starts_with("glint_"))
        .collect();
    let declared: BTreeSet<&str> = header
        .lines()
        .filter(|line| {
            line.contains("(") && !line.starts_with(' ') && !line.starts_with("/*") && !line.starts_with('#')
        })
        .filter_map(|line| line.split('(').next()?.rsplit([' ', '*']).next())
        .filter(|name| name.starts_with("glint_"))
        .collect();
    assert_eq!(exported, declared);
    for (name, (stage, access)) in [("READ", SYNC_READ), ("WRITTEN", SYNC_WRITTEN)] {
        for line in [
            format!("#define GLINT_SYNC_{name}_STAGE VK_PIPELINE_STAGE_{stage:?}_BIT"),
            format!("#define GLINT_SYNC_{name}_ACCESS VK_ACCESS_{access:?}_BIT"),
        ] {
            assert!(header.lines().any(|l| l == line), "{line}");
        }
    }
}

#[test]
fn a_program_in_c_draws_what_rust_draws_to_the_last_bit() {
    let case = Case::new();
    let installed = case.path("installed");
    // Packaged for distribution: a folder with header, libraries and a pkg-config file.
    let mut library = Command::new(within("tools/c-library"));
    library.arg(&installed).arg("--quiet");
    // Compiling takes most of the time here.
    for setting in ["debug=0", "opt-level=0", "package.\"*\".opt-level=0"] {
        library.args(["--config", &format!("profile.dev.{setting}")]);
    }
    done(&mut library);
    let pc = fs::read_to_string(installed.join("lib/pkgconfig/glint.pc")).unwrap();
    assert!(pc.contains(&format!("prefix={}", installed.display())) && pc.contains("Version: 0"));
    let program = case.path("frame");
    let mut compile = Command::new("cc");
    const STRICT: [&str; 5] = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wno-missing-field-initializers"];
    compile.args(STRICT).arg("-o").arg(&program);
    compile.arg(within("tests/outside/frame.c")).arg("-I").arg(installed.join("include"));
    compile.arg(installed.join("lib/libglint.a")).args(["-lvulkan", "-lpthread", "-ldl", "-lm"]);
    done(&mut compile);
    let got = case.words(&program, &[]);
    assert_eq!(got.len(), (4 + 4 + 1 + 1) * PIXELS);
    // With the shared library and the flags from pkg-config.
    let mut ask = Command::new("pkg-config");
    ask.args(["--cflags", "--libs", "glint"]).env("PKG_CONFIG_PATH", installed.join("lib/pkgconfig"));
    let flags = done(&mut ask);
    let program = case.path("frame-shared");
    let mut compile = Command::new("cc");
    compile.args(STRICT).arg(within("tests/outside/frame.c")).args(flags.split_whitespace()).arg("-lvulkan");
    done(compile.arg(format!("-Wl,-rpath,{}", installed.join("lib").display())).arg("-o").arg(&program));
    assert!(done(Command::new("ldd").arg(&program)).contains("libglint.so => "));
    assert!(case.words(&program, &[]) == got, "the shared library draws another frame");
    check_header(&installed);

    let gpu = Gpu::new();
    let views = Views::upload(&gpu, &[case.camera], &[]).unwrap();
    let model = Model::upload(&gpu, &case.scene, 0).unwrap();
    let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, RenderOptions::default()).unwrap();
    let want = renderer.render(&model, &views, 0, [0.5, 0.25, 0.75]).unwrap().color;
    let (plain, both) = got.split_at(4 * PIXELS);
    let got: Vec<f32> = plain.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]].map(f32::from_bits)).collect();
    // The camera is recovered from matrices in float64, and rounded to its original float32.
    let off = got.iter().zip(&want).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(off == 0.0, "{off:e}");

    // Two instances behind a wall; C draws these into images, this into buffers.
    let buffer = |words: usize| Buffer::<u32>::zeroed(&gpu, "target", words * PIXELS).unwrap();
    let [color, depths, ids] = [4, 1, 1].map(buffer);
    let wall = Buffer::from_slice(&gpu, "wall", &[(0.2f32 / 3.0).to_bits(); PIXELS]).unwrap();
    let pixels = |buffer: &Buffer<u32>| Pixels::Buffer(BufferRange { buffer: buffer.raw().handle(), offset: 0 });
    let target =
        Target { light: Light::Linear, blend: Blend::Premultiplied, ..Target::new(pixels(&color), Texel::Rgba32F) };
    let view = FrameView {
        near: 0.2,
        color: Some(target),
        depth_in: Some(pixels(&wall)),
        depth_out: Some(pixels(&depths)),
        ids: Some(pixels(&ids)),
        ..FrameView::from_matrices(case.view, case.projection, SIZE[0], SIZE[1]).unwrap()
    };
    let limits = Limits {
        gaussians: 2 * model.capacity(),
        instances: 2,
        depth_in: true,
        depth_out: true,
        texel: Texel::Rgba32F,
        ..Limits::of(&model, SIZE[0], SIZE[1])
    };
    let frames = Frames::new(&gpu, limits).unwrap();
    let transform = Transform { translation: DVec3::X, scale: 0.5, ..Transform::IDENTITY };
    let instances = [Instance::of(&model), Instance { transform, ..Instance::of(&model) }];
    let mut recorder = gpu.recorder("both").unwrap();
    let frame = Frame { slot: 0, instances: &instances, views: &[view] };
    unsafe { frames.record_into(&mut recorder, &frame) }.unwrap();
    recorder.submit().unwrap().wait().unwrap();
    let want: Vec<u32> = [color, depths, ids].iter().flat_map(|buffer| buffer.download().unwrap()).collect();
    assert!(both == want, "{} words differ", both.iter().zip(&want).filter(|(a, b)| a != b).count());
    // Both are visible.
    let ids = &want[5 * PIXELS..];
    let of = |k: u32| ids.iter().filter(|&&id| id != u32::MAX && id / model.capacity() == k).count();
    assert!(of(0) > 50 && of(1) > 50, "{} {}", of(0), of(1));
}
