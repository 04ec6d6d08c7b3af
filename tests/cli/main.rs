//! Tests the command line on a tiny dataset. If `GLINT_VALIDATION` is set, the first command with the same
//! options has validation layers, and fails on any message.

mod convert;
mod datasets;
#[cfg(unix)]
mod doctor;
mod examples;
mod export;
mod far;
mod flags;
mod gpu;
mod kept;
mod output;
mod page;
mod parts;
#[path = "../common/photos.rs"]
mod photos;
#[path = "../common/run.rs"]
mod run;
mod scenes;
mod settings;
#[path = "../common/shared.rs"]
mod shared;
mod talk;
mod train;
mod truth;
mod whole;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    sync::{Arc, Mutex, OnceLock},
};

use glam::{DMat3, DQuat, DVec3};
use glint::{
    data::{read_scene, write_scene, write_tensors},
    reference::sample::random_scene,
    report::decompose::{linear_from_srgb, srgb_from_linear},
    scene::{Camera, Scene},
    stages::NAMES as NAMES_OF_STAGES,
};
use photos::{camera_of, visible, write_photos};
use serde_json::Value;
use tempfile::TempDir;

/// Nine photos, the first and the last for testing: one is in a folder, two differ only in their extension.
const NAMES: [&str; 9] = ["a.png", "b/c.png", "d.png", "e.png", "f.png", "g.PNG", "g.png", "h.png", "i.png"];

/// Scenes by the number of photos and the command that trained them: equal datasets give equal scenes, so tests share them.
static TRAINED: Mutex<BTreeMap<(usize, String), Trained>> = Mutex::new(BTreeMap::new());
type Trained = Arc<OnceLock<Vec<u8>>>;

/// The commands that ran with validation layers, each with the names of its options.
static VALIDATED: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// Takes the validation layers from a command, half of its time if it is short, and llvmpipe's threads, a quarter. For commands of
/// which others with the same options have them.
fn brief(command: &mut Command) -> &mut Command {
    command.env_remove("GLINT_VALIDATION").env("LP_NUM_THREADS", "0")
}

/// A folder with a dataset `data` and the test's files.
struct Work(TempDir);

impl Work {
    /// The built-in scene seen by nine cameras in a row, in COLMAP's text format with 300 random points.
    fn new() -> Work {
        let folder = tempfile::tempdir().unwrap();
        let points = random_scene(3, 300, 0, 0).base.means;
        let line = |(i, p): (usize, &[f32; 3])| {
            // Any points spread over the cameras' view.
            let [x, y, z] = p.map(|v| f64::from(v).sin());
            format!("{} {x} {y} {z} 120 130 140 0.5\n", i + 1)
        };
        let points: String = points.iter().enumerate().map(line).collect();
        let photos: Vec<_> = NAMES.iter().zip(0..).map(|(name, i)| (*name, camera(f64::from(i) * 0.1 - 0.4))).collect();
        write_photos(&folder.path().join("data"), &photos, &points);
        Work(folder)
    }

    /// The dataset with four training photos and one test photo, for tests of many runs.
    fn small() -> Work {
        let work = Work::new();
        let list = work.path("data/sparse/0/images.txt");
        let text = fs::read_to_string(&list).unwrap();
        let few: Vec<&str> = text.lines().take(2 * 5).collect();
        fs::write(list, few.join("\n") + "\n").unwrap();
        NAMES[5..].iter().for_each(|name| fs::remove_file(work.path("data/images").join(name)).unwrap());
        work
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// A command in this folder.
    fn bare(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_glint"));
        command.current_dir(self.0.path()).args(arguments.split_whitespace()).env_remove("RUST_LOG");
        command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
        command
    }

    /// [`Work::bare`] for commands that reach the device. Only the first with the same options is not [`brief`].
    fn command(&self, arguments: &str) -> Command {
        let mut command = self.bare(arguments);
        let name = arguments.split_whitespace().next();
        let kind = name.into_iter().chain(arguments.split_whitespace().filter(|word| word.starts_with('-')));
        if !VALIDATED.lock().unwrap().insert(kind.collect::<Vec<_>>().join(" ")) {
            brief(&mut command);
        }
        command
    }

    /// Runs glint in this folder.
    fn run(&self, arguments: &str) -> Output {
        run::run(&mut self.command(arguments))
    }

    /// Runs glint, which must succeed; returns its standard output.
    #[track_caller]
    fn ok(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        assert!(output.status.success(), "glint {arguments}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// Runs glint, which must succeed; returns its messages.
    #[track_caller]
    fn said(&self, arguments: &str) -> String {
        ends(self.run(arguments), 0)
    }

    /// Runs glint with wrong arguments; its message must contain `words`.
    #[track_caller]
    fn misused(&self, arguments: &str, words: &str) {
        let said = ends(self.run(arguments), 2);
        assert!(said.contains(words), "glint {arguments}: {said}");
    }

    /// Writes the scene of a command that begins with `train data` to `file`. Only the first test trains it.
    fn trained(&self, arguments: &str, file: &str) {
        let key = (files(&self.path("data/images")).len(), arguments.to_owned());
        let trained = TRAINED.lock().unwrap().entry(key).or_default().clone();
        let scene = trained.get_or_init(|| {
            self.ok(&format!("{arguments} -o {file}"));
            fs::read(self.path(file)).unwrap()
        });
        fs::write(self.path(file), scene).unwrap();
    }

    fn json(&self, arguments: &str) -> Value {
        serde_json::from_str(&self.ok(arguments)).unwrap()
    }

    /// Runs glint, which must refuse its input with one line that contains all of `words`, and change no
    /// files.
    #[track_caller]
    fn refused(&self, arguments: &str, words: &[&str]) {
        self.fails(self.bare(arguments), 2, words);
    }

    /// [`Work::refused`] for a prepared command, and for any exit code.
    #[track_caller]
    fn fails(&self, mut command: Command, code: i32, words: &[&str]) {
        let before = self.listing();
        let output = run::run(&mut command);
        let text = String::from_utf8(output.stderr).unwrap();
        let arguments = format!("{:?}", command.get_args().collect::<Vec<_>>());
        assert_eq!(output.status.code(), Some(code), "glint {arguments}: {text}");
        let errors: Vec<&str> = text.lines().filter(|line| !line.starts_with("note: ")).collect();
        assert!(matches!(errors[..], [line] if line.starts_with("error: ")), "glint {arguments}: {text}");
        assert!(words.iter().all(|word| errors[0].contains(word)), "glint {arguments}: {text}");
        assert!(output.stdout.is_empty());
        assert_eq!(self.listing(), before, "glint {arguments} left or changed something");
    }

    /// Every file and folder, with the contents of the files.
    fn listing(&self) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
        let mut found = BTreeMap::new();
        let mut folders = vec![self.0.path().to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                let bytes = if path.is_dir() { None } else { Some(fs::read(&path).unwrap()) };
                if bytes.is_none() {
                    folders.push(path.clone());
                }
                found.insert(path, bytes);
            }
        }
        found
    }
}

fn camera(turn: f64) -> Camera {
    camera_of([32, 24], 40.0, turn)
}

/// The messages of a command, which must have ended with this code.
#[track_caller]
fn ends(output: Output, code: i32) -> String {
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{said}");
    said
}

#[cfg(unix)]
fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
}

fn keys(value: &Value) -> BTreeSet<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

fn set(names: &str) -> BTreeSet<&str> {
    names.split(' ').collect()
}

/// Width, height and the planes of an EXR by channel name.
fn exr(path: &Path) -> (usize, usize, Vec<(String, Vec<f32>)>) {
    let image = exr::prelude::read_first_flat_layer_from_file(path).unwrap();
    let size = image.layer_data.size;
    let planes = image.layer_data.channel_data.list.iter();
    let planes = planes.map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect();
    (size.0, size.1, planes)
}

/// A network with VGG's structure and two channels everywhere.
fn write_vgg(path: &Path) {
    let layers = "1.0 1.2 2.5 2.7 3.10 3.12 3.14 4.17 4.19 4.21 5.24 5.26 5.28".split(' ');
    let mut tensors = Vec::new();
    let ripple = |count: usize| (0..count).map(|i| 0.2 * (1.0 + (7.0 * i as f32).sin())).collect::<Vec<f32>>();
    for (i, layer) in layers.enumerate() {
        let channels = if i == 0 { 3 } else { 2 };
        tensors.push((format!("net.slice{layer}.weight"), vec![2, channels, 3, 3], ripple(18 * channels)));
        tensors.push((format!("net.slice{layer}.bias"), vec![2], ripple(2)));
    }
    tensors.extend((0..5).map(|i| (format!("lin{i}.model.1.weight"), vec![1, 2, 1, 1], vec![0.5; 2])));
    let list: Vec<_> = tensors.iter().map(|(name, shape, values)| (name.as_str(), &shape[..], &values[..])).collect();
    write_tensors(path, &list).unwrap();
}

fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_scene_is_trained_measured_rendered_and_described() {
    let work = Work::new();
    let report = work.json("train data -o base.ply --iterations 30 --gaussians 300 --sh-degree 1 --seed 5 --json");
    let expected = "output device photos gaussians sh_degree iterations iterations_resumed seed halvings tile seconds \
                    steps_per_second final_loss device_megabytes host_megabytes buffers_grown stages";
    assert_eq!(keys(&report), set(expected));
    assert_eq!((&report["photos"], &report["gaussians"], &report["sh_degree"]), (&7.into(), &300.into(), &1.into()));
    assert!(report["final_loss"].as_f64().unwrap() > 0.0 && report["seconds"].as_f64().unwrap() > 0.0);
    let base = read_scene(work.path("base.ply")).unwrap();
    assert_eq!((base.base.len(), base.base.sh_degree, base.supplement.is_some()), (300, 1, false));

    // The same seed gives the same scene, with or without --deterministic; fewer points give a smaller one.
    work.ok("train data -o again.ply --iterations 30 --gaussians 300 --sh-degree 1 --seed 5 --deterministic");
    assert!(fs::read(work.path("base.ply")).unwrap() == fs::read(work.path("again.ply")).unwrap());
    let few = work.json("train data -o few.ply --iterations 2 --points 40 --gaussians 40 --json");
    assert_eq!(few["gaussians"], 40);

    let before = work.json("eval few.ply data --json");
    let after = work.json("eval base.ply data --json");
    assert_eq!(keys(&after), set("base augmented views"));
    let psnr = |v: &Value| v["augmented"]["psnr"].as_f64().unwrap();
    assert!(psnr(&after) > psnr(&before), "{before} {after}");
    assert_eq!(after["base"], after["augmented"]);
    let names: Vec<&str> = after["views"].as_array().unwrap().iter().map(|v| v["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["a.png", "i.png"]);

    let info = work.json("info base.ply --json");
    assert_eq!(
        (&info["kind"], &info["base"]["count"], &info["supplement"]),
        (&"scene".into(), &300.into(), &Value::Null)
    );
    let info = work.json("info data --json");
    assert_eq!(
        (&info["kind"], &info["train"], &info["test"], &info["points"]),
        (&"dataset".into(), &7.into(), &2.into(), &300.into())
    );
    assert!(work.ok("info data").contains("9 (7 train, 2 test)"));
    assert!(work.ok("info base.ply").contains("300 Gaussians, SH degree 1"));
    assert!(work.json("devices --json")[0]["subgroup_size"].as_u64().unwrap() > 0);
}

#[test]
fn an_augmented_scene_is_measured_and_rendered_in_all_its_parts() {
    let work = Work::new();
    let scene = visible(8, 400, 200, 2);
    write_scene(work.path("scene.ply"), &scene).unwrap();
    write_scene(work.path("base.ply"), &Scene { base: scene.base.clone(), ..Default::default() }).unwrap();

    let found = work.json("eval scene.ply data --split all --json");
    assert_eq!(keys(&found), set("base augmented views"));
    for part in [&found["base"], &found["augmented"], &found["views"][0]["base"], &found["views"][8]["augmented"]] {
        assert_eq!(keys(part), set("psnr ssim"));
        assert!(part["psnr"].is_f64() && part["ssim"].is_f64());
    }
    assert_eq!(keys(&found["views"][3]), set("name base augmented"));
    assert_ne!(found["base"], found["augmented"]);
    // The base alone equals its own file.
    assert_eq!(work.json("eval base.ply data --split all --json")["augmented"], found["base"]);
    let table = work.ok("eval scene.ply data");
    assert!(table.contains("base PSNR [dB]") && table.lines().last().unwrap().starts_with("mean"), "{table}");

    write_vgg(&work.path("vgg.safetensors"));
    let seen = work.json("eval scene.ply data --lpips vgg.safetensors --json");
    assert_eq!(keys(&seen["lpips"]), set("base augmented views"));
    assert_eq!(keys(&seen["lpips"]["views"][1]), set("name base augmented"));
    let [base, augmented] = ["base", "augmented"].map(|part| seen["lpips"][part].as_f64().unwrap());
    assert!(base > 0.0 && augmented > 0.0 && base != augmented);
    let [first, second] = [0, 1].map(|i| seen["lpips"]["views"][i]["augmented"].as_f64().unwrap());
    // JSON parsing is exact to a unit in the last place.
    assert!((augmented - (first + second) / 2.0).abs() < 1e-12);
    assert_eq!(work.json("eval base.ply data --lpips vgg.safetensors --json")["lpips"]["augmented"], base);
    let table = work.ok("eval base.ply data --lpips vgg.safetensors");
    assert!(table.contains("LPIPS") && table.lines().last().unwrap().ends_with(&format!("{base:.4}")), "{table}");
    work.refused("eval base.ply data --lpips base.ply", &["base.ply", "safetensors"]);

    let mut images = std::collections::HashMap::new();
    for what in ["color", "base", "depth", "transmittance", "diffuse", "specular"] {
        let listed = work.json(&format!("render scene.ply data -o out/{what} --what {what} --split all --json"));
        assert_eq!(listed.as_array().unwrap().len(), 9);
        let names = ["a", "b_c", "d", "e", "f", "g.PNG", "g.png-2", "h", "i"].map(|stem| format!("{stem}.png"));
        assert_eq!(files(&work.path(&format!("out/{what}"))), names);
        work.ok(&format!("render scene.ply data -o exr --what {what} --format exr --force"));
        assert_eq!(files(&work.path("exr")), ["a.exr", "i.exr"]);
        let (width, height, planes) = exr(&work.path("exr/i.exr"));
        assert_eq!((width, height), (32, 24));
        let png = image::open(work.path(&format!("out/{what}/i.png"))).unwrap();
        assert_eq!((png.width(), png.height()), (32, 24));
        images.insert(what, (planes, png));
    }
    let channels = |what: &str| images[what].0.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>();
    assert_eq!(channels("depth"), ["Z"]);
    assert_eq!(channels("transmittance"), ["Y"]);
    assert_eq!(channels("specular"), ["B", "G", "R"]);

    let red = |what: &str| &images[what].0.last().unwrap().1;
    for (i, &whole) in red("color").iter().enumerate() {
        // The parts add up in linear light, and a PNG holds the sRGB values of either; 0.5/255 is its
        // rounding.
        let sum = red("diffuse")[i] + red("specular")[i];
        assert!((sum - linear_from_srgb(whole)).abs() <= 1e-6 * whole.max(1.0));
        for (what, value) in [("color", whole), ("diffuse", srgb_from_linear(red("diffuse")[i]))] {
            let byte = images[what].1.as_rgb8().unwrap().as_raw()[3 * i];
            assert!((f32::from(byte) / 255.0 - value.clamp(0.0, 1.0)).abs() < 0.51 / 255.0, "{what} {i}");
        }
        let (depth, light) = (images["depth"].0[0].1[i], images["transmittance"].0[0].1[i]);
        assert!((0.0..=1.0).contains(&light) && (depth == 0.0 || depth > 0.2));
        // A depth exists exactly if half of the light is stopped; at the threshold itself float32 may decide
        // either way.
        assert!((light - 0.5).abs() < 1e-5 || (depth > 0.0) == (light < 0.5), "{depth} {light}");
    }
    assert_ne!(red("color"), red("base"));

    // Without a supplement the base is the whole scene; the background shows through.
    assert!(work.said("render base.ply data -o plain --what base").contains("no supplement"));
    assert_eq!(fs::read(work.path("plain/i.png")).unwrap(), fs::read(work.path("out/base/i.png")).unwrap());
    work.ok("render base.ply data -o white --background white --format exr");
    work.ok("render base.ply data -o black --format exr");
    let (white, black) = (exr(&work.path("white/i.exr")).2, exr(&work.path("black/i.exr")).2);
    work.ok("render base.ply data -o light --what transmittance --format exr");
    let light = &exr(&work.path("light/i.exr")).2[0].1;
    for ((white, black), light) in white[0].1.iter().zip(&black[0].1).zip(light) {
        assert!((white - black - light).abs() < 1e-5);
    }
    work.ok("render base.ply data -o small --max-size 16");
    assert_eq!(image::open(work.path("small/a.png")).unwrap().width(), 16);
}

#[test]
fn bad_input_is_refused_in_one_line_and_leaves_nothing() {
    let work = Work::new();
    let scene = random_scene(1, 50, 0, 0);
    write_scene(work.path("base.ply"), &scene).unwrap();
    fs::write(work.path("text.ply"), "this is no scene").unwrap();
    let bytes = fs::read(work.path("base.ply")).unwrap();
    fs::write(work.path("short.ply"), &bytes[..bytes.len() - 7]).unwrap();
    fs::write(work.path("points.ply"), "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n").unwrap();
    fs::write(work.path("photo.bin"), [7; 90]).unwrap();
    fs::create_dir(work.path("empty")).unwrap();

    work.refused("eval nowhere.ply data", &["nowhere.ply"]);
    work.refused("eval base.ply nowhere", &["nowhere"]);
    work.refused("eval text.ply data", &["text.ply", "ply"]);
    work.refused("eval short.ply data", &["short.ply"]);
    work.refused("info points.ply", &["points.ply", "point cloud"]);
    work.refused("info photo.bin", &["photo.bin", "expected a scene"]);
    work.refused("info nowhere", &["nowhere"]);
    work.refused("eval data base.ply", &["data", "the scene comes before the dataset"]);
    work.refused("train empty -o out.ply", &["empty", "expected a folder with a COLMAP model"]);
    work.refused("train base.ply -o out.ply", &["base.ply"]);
    work.refused("train data -o nowhere/out.ply", &["nowhere/out.ply", "cannot be written"]);
    work.refused("train data -o empty", &["empty", "expected the name of a file"]);
    work.refused("train data -o base.ply/out.ply", &["base.ply/out.ply", "cannot be written"]);
    work.refused("render base.ply data -o text.ply", &["text.ply", "expected a folder"]);
    work.refused("render base.ply data -o text.ply/in", &["text.ply/in", "cannot be created"]);
    work.refused("render base.ply data -o out --what specular", &["base.ply", "no specular part"]);
    work.refused("train data -o out.ply --device nonesuch", &["--device", "nonesuch"]);
    work.refused("train data -o out.ply --device 99", &["--device", "99"]);

    // A dataset of a single photo, which is for testing: every 8th is, from the first.
    let only_test = work.path("only_test");
    fs::create_dir(&only_test).unwrap();
    fs::copy(work.path("data/images/a.png"), only_test.join("r_0.png")).unwrap();
    let frame = r#"{"file_path": "r_0", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}"#;
    let text = format!(r#"{{"camera_angle_x": 0.7, "frames": [{frame}]}}"#);
    fs::write(only_test.join("transforms_train.json"), &text).unwrap();
    work.refused("train only_test -o out.ply", &["the training split has no photos"]);
}

#[test]
fn bad_usage_exits_with_2_and_help_with_0() {
    let work = Work::new();
    for arguments in [
        "",
        "dance",
        "train data",
        "train data -o x.ply --sh-degree 4",
        "train data -o x.ply --iterations 0",
        "train data -o x.ply --points 0",
        "train data -o x.ply --max-size 0",
        "train data -o x.ply --background grey",
        "train data -o x.ply --no-such-flag",
        "render base.ply data -o out --what color",
        "eval base.ply",
        "verify --twin blending",
    ] {
        let output = work.run(arguments);
        assert_eq!(output.status.code(), Some(2), "glint {arguments}");
        assert!(output.stdout.is_empty() && !output.stderr.is_empty());
    }
    assert_eq!(files(work.0.path()), ["data"]);
    for command in ["train", "render", "eval"] {
        let help = work.ok(&format!("{command} --help"));
        assert!(help.contains("Examples:") && help.contains(&format!("glint {command}")), "{help}");
    }
    assert!(work.ok("--help").contains("Exit codes"));
    assert!(work.ok("--version").starts_with("glint "));
}

#[test]
fn a_twin_stands_in_for_a_stage_on_the_command_line() {
    let work = Work::new();
    write_scene(work.path("scene.ply"), &visible(9, 300, 100, 1)).unwrap();
    for (folder, options) in [("device", ""), ("twins", "--twin blend --twin project -vv")] {
        work.ok(&format!("render scene.ply data -o {folder} --format exr {options}"));
    }
    let [device, twins] = ["device", "twins"].map(|folder| exr(&work.path(&format!("{folder}/i.exr"))).2);
    let pairs = || device.iter().zip(&twins).flat_map(|(a, b)| a.1.iter().zip(&b.1));
    // Different bits prove that a twin ran; but the picture is the same, except for pixels at a threshold.
    assert!(pairs().any(|(a, b)| a != b));
    assert!(pairs().filter(|(a, b)| (*a - *b).abs() > 1e-4).count() <= 3);

    let said = ends(work.run("render scene.ply data -o x --twin fma_rate"), 2);
    assert!(NAMES_OF_STAGES.iter().all(|stage| *stage == "fma_rate" || said.contains(stage)), "{said}");
}

#[test]
fn a_scene_without_gaussians_is_rendered_as_background() {
    let work = Work::new();
    write_scene(work.path("none.ply"), &Scene::default()).unwrap();
    work.ok("render none.ply data -o out --background 0,0.5,1 --format exr");
    let planes = exr(&work.path("out/a.exr")).2;
    assert!(planes.iter().zip([1.0, 0.5, 0.0]).all(|((_, plane), want)| plane.iter().all(|&v| v == want)));
    work.ok("render none.ply data -o depth --what depth");
    assert!(work.ok("info none.ply").contains("0 Gaussians"));
    assert_eq!(work.json("eval none.ply data --json")["views"].as_array().unwrap().len(), 2);
}

#[test]
fn a_closed_pipe_is_no_error() {
    let work = Work::new();
    let mut command = work.command("info data --json");
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = run::finish(child);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn an_augmentation_by_augs_adds_lobes_and_learns_opacities() {
    let work = Work::new();
    work.trained("train data --iterations 150 --gaussians 300 --sh-degree 1", "base.ply");
    let enhance = "enhance data --base base.ply --method augs --preset quick --ratio 0.2 --json";
    let report = work.json(&format!("{enhance} -o first.ply"));
    let added = report["supplementary_gaussians"].as_u64().unwrap();
    assert!(added > 0, "{report}");
    let scene = read_scene(work.path("first.ply")).unwrap();
    assert_eq!(scene.supplement.as_ref().unwrap().gaussians.len() as u64, added);
    assert_eq!(scene.base.len(), 300);
    // The file's first element is the base for any viewer, with opacities from the joint phase.
    let base = read_scene(work.path("base.ply")).unwrap().base;
    assert_eq!((&base.means, &base.sh), (&scene.base.means, &scene.base.sh));
    assert_ne!(base.opacities, scene.base.opacities);

    // A view with a NaN loss gets nothing, and a note reports it.
    let mut bright = read_scene(work.path("base.ply")).unwrap();
    bright.base.sh.iter_mut().for_each(|rgb| rgb[0] = 1e30);
    write_scene(work.path("bright.ply"), &bright).unwrap();
    let said = work.said("enhance data --base bright.ply --method augs --preset quick -o bright_more.ply");
    assert!(said.contains("of 7 photos is so far out of range"), "{said}");

    work.refused("enhance data --base first.ply -o x.ply", &["first.ply", "augmented already"]);
}

#[test]
fn a_scene_of_another_tool_is_a_base_for_any_dataset() {
    let Some(splats) = shared::shared("splats") else { return };
    let work = Work::small();
    let base = splats.join("inria_sh3_9k.ply");
    let report = work.json(&format!(
        "enhance data --base {} -o a.ply --method augs --preset quick --ratio 0.01 --json",
        base.display()
    ));
    assert_eq!(report["base_gaussians"], 9080);
    assert_eq!(read_scene(work.path("a.ply")).unwrap().base.sh_degree, 3);
    let broken = splats.join("inria_header_says_100.ply");
    work.refused(&format!("enhance data --base {} -o x.ply", broken.display()), &["header_says_100", "100"]);
}
