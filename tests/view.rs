//! Tests `glint view` with a headless X server: keys and mouse by its XTEST extension, and pictures compared
//! with those of `glint render`. Validation layers are on if `GLINT_VALIDATION` is set; the viewer then fails
//! on any message.
#![cfg(target_os = "linux")]

#[path = "common/photos.rs"]
mod photos;
#[path = "common/run.rs"]
mod run;

use std::{
    fs,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

use glam::DVec3;
use glint::{
    data::{CameraPath, write_scene},
    gpu::{Context, ContextOptions},
    pipelines::{
        frames::{Limits, Texel},
        layers::{Layer, Layers},
        model::{Model, Room},
        render::{Needs, RenderOptions},
    },
    report::pictures::error_map,
    scene::{Camera, Gaussians, Scene},
};
use tempfile::TempDir;
use x11rb::{
    connection::Connection,
    protocol::{
        Event,
        xproto::{
            ClientMessageEvent, ConfigureWindowAux, ConnectionExt as _, CreateWindowAux, EventMask, ImageFormat,
            InputFocus, PropMode, SELECTION_NOTIFY_EVENT, SelectionNotifyEvent, Window, WindowClass,
        },
        xtest::ConnectionExt as _,
    },
    rust_connection::RustConnection,
    wrapper::ConnectionExt as _,
};

const WIDTH: u32 = 96;
const HEIGHT: u32 = 72;
/// Longer than any step on two busy cores with the validation layers.
const PATIENCE: Duration = Duration::from_secs(30);

/// Core events of X11 for XTEST.
const KEY: [u8; 2] = [2, 3];
const BUTTON: [u8; 2] = [4, 5];
const MOTION: u8 = 6;

/// Keysyms.
const SHIFT: u32 = 0xffe1;
const ESCAPE: u32 = 0xff1b;

/// A process that must not outlive its test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// An X server, and a client of it.
struct Display {
    name: String,
    client: RustConnection,
    root: Window,
    _server: Running,
}

#[track_caller]
fn until<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(start.elapsed() < PATIENCE, "no {what} in {PATIENCE:?}");
        sleep(Duration::from_millis(5));
    }
}

impl Display {
    fn new() -> Self {
        // The server selects a free number and prints it when ready.
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "400x300x24", "-nolisten", "tcp", "-noreset"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb, see tools/setup test");
        let mut server = Running(server);
        let mut number = String::new();
        BufReader::new(server.0.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let name = format!(":{}", number.trim());
        let client = until("X server", || RustConnection::connect(Some(&name)).ok()).0;
        let root = client.setup().roots[0].root;
        Display { name, client, root, _server: server }
    }

    fn atom(&self, name: &str) -> u32 {
        self.client.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom
    }

    fn title(&self, window: Window) -> String {
        let (name, utf8) = (self.atom("_NET_WM_NAME"), self.atom("UTF8_STRING"));
        let property = self.client.get_property(false, window, name, utf8, 0, 1024).unwrap().reply();
        property.map_or(String::new(), |p| String::from_utf8_lossy(&p.value).into_owned())
    }

    fn input(&self, kind: u8, detail: u8, x: i16, y: i16) {
        self.client.xtest_fake_input(kind, detail, 0, self.root, x, y, 0).unwrap().check().unwrap();
    }

    fn keycode(&self, keysym: u32) -> u8 {
        let setup = self.client.setup();
        let (first, last) = (setup.min_keycode, setup.max_keycode);
        let map = self.client.get_keyboard_mapping(first, last - first + 1).unwrap().reply().unwrap();
        let columns = map.keysyms_per_keycode as usize;
        let at = map.keysyms.chunks(columns).position(|key| key[0] == keysym).expect("a key of the keyboard");
        first + at as u8
    }

    fn key(&self, keysym: u32, held: Duration) {
        let code = self.keycode(keysym);
        self.input(KEY[0], code, 0, 0);
        sleep(held);
        self.input(KEY[1], code, 0, 0);
    }

    fn press(&self, character: char) {
        self.key(character.into(), Duration::ZERO);
    }

    fn drag(&self, button: u8, from: [i16; 2], to: [i16; 2]) {
        self.input(MOTION, 0, from[0], from[1]);
        self.input(BUTTON[0], button, 0, 0);
        for i in 1..=4 {
            let at = |k: usize| from[k] + (to[k] - from[k]) * i / 4;
            self.input(MOTION, 0, at(0), at(1));
        }
        self.input(BUTTON[1], button, 0, 0);
    }

    fn click(&self, button: u8) {
        BUTTON.iter().for_each(|&kind| self.input(kind, button, 0, 0));
    }

    fn message(&self, to: Window, kind: &str, data: [u32; 5]) {
        let event = ClientMessageEvent::new(32, to, self.atom(kind), data);
        self.client.send_event(false, to, EventMask::NO_EVENT, event).unwrap().check().unwrap();
    }

    /// Drops a file on a window, as a file manager does.
    fn drop_file(&self, window: Window, path: &Path) {
        let source = self.client.generate_id().unwrap();
        let look = CreateWindowAux::new();
        let (class, visual) = (WindowClass::INPUT_ONLY, x11rb::COPY_FROM_PARENT);
        self.client.create_window(0, source, self.root, 0, 0, 1, 1, 0, class, visual, &look).unwrap().check().unwrap();
        let (selection, uris) = (self.atom("XdndSelection"), self.atom("text/uri-list"));
        self.client.set_selection_owner(source, selection, x11rb::CURRENT_TIME).unwrap().check().unwrap();
        self.message(window, "XdndEnter", [source, 5 << 24, uris, 0, 0]);
        self.message(window, "XdndPosition", [source, 0, 10 << 16 | 10, 0, self.atom("XdndActionCopy")]);
        let request = until("request of what is dragged", || match self.client.poll_for_event().unwrap() {
            Some(Event::SelectionRequest(request)) => Some(request),
            _ => None,
        });
        let text = format!("file://{}\r\n", path.display());
        let bytes = text.as_bytes();
        let client = &self.client;
        client
            .change_property8(PropMode::REPLACE, request.requestor, request.property, uris, bytes)
            .unwrap()
            .check()
            .unwrap();
        let answer = SelectionNotifyEvent {
            response_type: SELECTION_NOTIFY_EVENT,
            sequence: 0,
            time: request.time,
            requestor: request.requestor,
            selection,
            target: uris,
            property: request.property,
        };
        client.send_event(false, request.requestor, EventMask::NO_EVENT, answer).unwrap().check().unwrap();
        self.message(window, "XdndDrop", [source, 0, 0, 0, 0]);
    }
}

/// A picture with 3 bytes per pixel.
#[derive(PartialEq)]
struct Shot {
    size: [u32; 2],
    rgb: Vec<u8>,
}

impl Shot {
    fn read(path: &Path) -> Self {
        let image = image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).into_rgb8();
        Shot { size: [image.width(), image.height()], rgb: image.into_raw() }
    }

    /// The largest difference of a byte, and the number of bytes that differ.
    #[track_caller]
    fn from(&self, other: &Shot) -> (u8, usize) {
        assert_eq!(self.size, other.size);
        let differences = self.rgb.iter().zip(&other.rgb).map(|(a, b)| a.abs_diff(*b));
        (differences.clone().max().unwrap(), differences.filter(|d| *d > 0).count())
    }
}

/// A viewer on a display, in its own folder.
struct Viewer<'a> {
    display: &'a Display,
    folder: &'a Path,
    child: Running,
    window: Window,
    shots: usize,
}

impl<'a> Viewer<'a> {
    fn new(display: &'a Display, folder: &'a Path, arguments: &str) -> Self {
        let child = glint(folder, arguments).env("DISPLAY", &display.name).stdout(Stdio::piped()).spawn().unwrap();
        let mut child = Running(child);
        let window = until("window", || {
            assert!(child.0.try_wait().unwrap().is_none(), "the viewer has ended");
            let windows = display.client.query_tree(display.root).unwrap().reply().unwrap().children;
            windows.into_iter().find(|&window| display.title(window).contains(" | "))
        });
        // No window manager would give it the keyboard focus.
        let client = &display.client;
        client.set_input_focus(InputFocus::PARENT, window, x11rb::CURRENT_TIME).unwrap().check().unwrap();
        Viewer { display, folder, child, window, shots: 0 }
    }

    #[track_caller]
    fn says(&self, words: &str) {
        let what = format!("{words:?} in the title");
        until(&what, || self.display.title(self.window).contains(words).then_some(()));
    }

    /// Presses the key for a picture; the file must show the window's contents.
    #[track_caller]
    fn shot(&mut self, name: &str) -> Shot {
        self.shots += 1;
        let path = self.folder.join(format!("{name}-{:04}.png", self.shots));
        self.display.press('c');
        until("screenshot", || path.exists().then_some(()));
        let shot = Shot::read(&path);
        let [width, height] = shot.size.map(|side| side as u16);
        let on_screen = || {
            let client = &self.display.client;
            let image = client.get_image(ImageFormat::Z_PIXMAP, self.window, 0, 0, width, height, !0).unwrap();
            let data = image.reply().ok()?.data;
            // B, G, R and an unused byte.
            (data.chunks_exact(4).flat_map(|p| [p[2], p[1], p[0]]).eq(shot.rgb.iter().copied())).then_some(())
        };
        until("picture in the window that is the screenshot", on_screen);
        shot
    }

    /// Ends the viewer by its key; returns its output lines.
    fn quit(mut self) -> Vec<String> {
        self.display.key(ESCAPE, Duration::ZERO);
        let status = until("end", || self.child.0.try_wait().unwrap());
        assert!(status.success(), "{status}");
        BufReader::new(self.child.0.stdout.take().unwrap()).lines().map(Result::unwrap).collect()
    }
}

fn glint(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_glint"));
    command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
    command.current_dir(folder).args(arguments.split_whitespace());
    command.env_remove("RUST_LOG").env_remove("DISPLAY");
    command
}

fn camera(turn: f64) -> Camera {
    photos::camera_of([WIDTH, HEIGHT], 110.0, turn)
}

/// An augmented scene `scene.ply`, its supplement alone, another scene, and three photographs.
fn work() -> (TempDir, Scene) {
    let folder = tempfile::tempdir().unwrap();
    let photos = [("a.png", camera(0.0)), ("b.png", camera(0.2)), ("c.png", camera(0.4))];
    photos::write_photos(&folder.path().join("data"), &photos, "");
    let sample = |seed| photos::visible(seed, 400, 200, 2);
    let scene = sample(8);
    let write = |name: &str, scene: &Scene| write_scene(folder.path().join(name), scene).unwrap();
    write("scene.ply", &scene);
    let none = Gaussians { sh_degree: 2, ..Default::default() };
    write("lobes.ply", &Scene { base: none, ..scene.clone() });
    write("other.ply", &Scene { base: sample(9).base, ..Default::default() });
    fs::write(folder.path().join("bad.ply"), "ply\nformat ascii 1.0\nelement vertex 1\nend_header\n").unwrap();
    (folder, scene)
}

fn rendered(folder: &Path, arguments: &str) -> PathBuf {
    let out = folder.join("rendered");
    let output = run::run(&mut glint(folder, &format!("render {arguments} -o rendered --force -q")));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    out
}

/// The memory in the title is the planned size of the scene and of its renderer for a window of this size.
fn check_memory(viewer: &Viewer<'_>, context: &Context, scene: &Scene) {
    let mut needs = Needs::of_scene(scene, false);
    // The diffuse mode is the base without bands.
    needs.degrees.push(0);
    let frames =
        Limits { texel: Texel::Rgba8, ..Limits::for_needs(needs, WIDTH, HEIGHT) }.plan(context.info()).unwrap();
    let planned = (Model::plan(context.info(), scene, Room::default()).bytes() + frames.bytes()) as f64 / 1e6;
    let title = viewer.display.title(viewer.window);
    let said = title.split(" | ").find_map(|part| part.strip_suffix(" MB")?.parse::<f64>().ok());
    // Printed with one decimal; reports and placeholders of unused bindings are a few KB.
    assert!(planned > 0.5 && said.is_some_and(|mb| (mb - planned).abs() < 0.06), "{planned} MB planned: {title}");
}

/// Shows the scene in all its modes, from the photograph `b.png`. Each equals what `glint render` writes.
fn every_mode(viewer: &mut Viewer<'_>) -> Vec<Shot> {
    let parts = [
        ('2', "augmented", "scene.ply data --what color"),
        ('3', "base", "scene.ply data --what base"),
        ('4', "supplement", "lobes.ply data --what color"),
        ('5', "diffuse", "scene.ply data --what diffuse"),
        ('6', "specular", "scene.ply data --what specular"),
        ('7', "depth", "scene.ply data --what depth"),
    ];
    let mut shots = Vec::new();
    for (key, name, arguments) in parts {
        viewer.display.press(key);
        viewer.says(&format!("| {name} |"));
        let shot = viewer.shot("scene");
        let expected = Shot::read(&rendered(viewer.folder, &format!("{arguments} --split all")).join("b.png"));
        // The same kernels on the same device give the same bits. Only a depth is rounded once more, by its
        // reciprocal: its grey may be the next byte if it is between two.
        let (most, count) = shot.from(&expected);
        let (steps, bytes) = if name == "depth" { (1, shot.rgb.len() / 500) } else { (0, 0) };
        assert!(most <= steps && count <= bytes, "{name}: {most}, {count} of {}", shot.rgb.len());
        assert!(!shots.contains(&shot), "{name} is like another");
        shots.push(shot);
    }
    shots
}

/// `glint render` draws the three poses of the recorded path as the viewer showed them: closer to a photograph's
/// target, after a flight, and after a walk.
fn check_path(folder: &Path, on_the_way: &[Shot]) {
    let frames = rendered(folder, "scene.ply --path scene-path-1.json --frames 3");
    for (i, shot) in on_the_way.iter().enumerate() {
        let (most, count) = shot.from(&Shot::read(&frames.join(format!("frame-{:05}.png", i + 1))));
        // The pose is written as a quaternion, whose rotation differs in float64's last bits, and coordinates
        // may have another origin: float32 rounds differently, and a byte may be the next.
        assert!(most <= 1 && count <= shot.rgb.len() / 500, "pose {i}: {most}, {count}");
        assert!(!on_the_way[..i].contains(shot));
    }
    let path = CameraPath::read(folder.join("scene-path-1.json")).unwrap().frames(3);
    let eyes = [path[0].eye(), path[1].eye(), path[2].eye()];
    // The wheel went closer to the cameras' target, near the origin, and walking kept the height. winit 0.30
    // counts a wheel made only of buttons, like XTEST's, as two notches: one on press, one on release.
    let nearer = camera(0.2).eye().length() / eyes[0].length();
    assert!((nearer / 1.15 - 1.0).abs() < 0.05 || (nearer / 1.15 / 1.15 - 1.0).abs() < 0.05, "{eyes:?}");
    assert!(eyes[1].distance(eyes[0]) > 0.01 && eyes[2].distance(eyes[1]) > 0.01);
    let up = -(0..3).map(|i| camera(0.2 * f64::from(i)).rotation.row(1)).sum::<DVec3>().normalize();
    assert!((eyes[2] - eyes[1]).dot(up).abs() < 1e-6, "{eyes:?}");
}

#[test]
fn a_scene_is_looked_at_in_all_its_parts_from_wherever_mouse_and_keys_lead() {
    let (work, scene) = work();
    let folder = work.path();
    let display = Display::new();
    let mut viewer = Viewer::new(&display, folder, "view scene.ply data");
    // The first photograph is for testing, and its size is the window's.
    viewer.says("scene | augmented | orbit | a.png");
    viewer.says("400 + 200 Gaussians");
    let context = Context::new(&ContextOptions::from_env()).unwrap();
    check_memory(&viewer, &context, &scene);

    // Cycles through the photographs' cameras, in all modes.
    display.press('p');
    viewer.says("| c.png");
    display.press('p');
    viewer.says("| b.png");
    let shots = every_mode(&mut viewer);
    display.press('1');
    viewer.says("| photograph |");
    let photo = Shot::read(&folder.join("data/images/b.png"));
    assert!(viewer.shot("scene") == photo);
    display.press('8');
    viewer.says("| error |");
    let cameras = [camera(0.0), camera(0.2), camera(0.4), camera(0.0).fitted(210, 160)];
    let mut layers = Layers::new(&context, &scene, &cameras, RenderOptions::default()).unwrap();
    let mut render = |camera: &Camera| layers.render(Layer::Whole, camera, [0.0; 3]).unwrap().color;
    let map = Shot { size: photo.size, rgb: error_map(&render(&camera(0.2)), &photo.rgb) };
    assert_eq!(viewer.shot("scene").from(&map), (0, 0));
    // In flight the wheel only changes the speed: the camera stays at the photograph's.
    for (key, name) in [('f', "fly"), ('g', "walk")] {
        display.press(key);
        viewer.says(&format!("| error | {name} | b.png"));
        display.click(4);
        display.press('o');
        viewer.says("| error | orbit | b.png");
    }

    // Away from the photograph there is no error to show. Poses are recorded on the way.
    let mut on_the_way = Vec::new();
    let pose = |viewer: &mut Viewer<'_>, n: usize| {
        display.press('k');
        viewer.says(&format!("pose {n} of the path"));
        viewer.shot("scene")
    };
    display.drag(1, [40, 30], [52, 38]);
    display.click(4);
    until("other place than a photograph's", || {
        let title = display.title(viewer.window);
        (title.contains("| augmented | orbit |") && !title.contains("b.png")).then_some(())
    });
    display.press('8');
    viewer.says("no photograph was taken from here");
    on_the_way.push(pose(&mut viewer, 1));
    display.press('f');
    viewer.says("| fly |");
    display.drag(1, [40, 30], [44, 32]);
    display.key('w'.into(), Duration::from_millis(150));
    on_the_way.push(pose(&mut viewer, 2));
    display.press('g');
    viewer.says("| walk |");
    display.key('d'.into(), Duration::from_millis(150));
    on_the_way.push(pose(&mut viewer, 3));
    let shift = display.keycode(SHIFT);
    display.input(KEY[0], shift, 0, 0);
    display.press('k');
    display.input(KEY[1], shift, 0, 0);
    viewer.says("scene-path-1.json: 3 poses");
    check_path(folder, &on_the_way);
    assert!(on_the_way.iter().all(|shot| !shots.contains(shot)));

    // Another size: the same camera, with more around it.
    display.press('r');
    display.press('n');
    viewer.says("| a.png");
    let larger = ConfigureWindowAux::new().width(210).height(160);
    display.client.configure_window(viewer.window, &larger).unwrap().check().unwrap();
    let at = camera(0.0).fitted(210, 160);
    let expected = Shot { size: [210, 160], rgb: render(&at).iter().map(|&v| glint::data::to_byte(v)).collect() };
    assert_eq!(viewer.shot("scene").from(&expected), (0, 0));

    // A dropped file replaces the scene, unless it is not a scene.
    display.press('t');
    viewer.says(" ms (");
    display.drop_file(viewer.window, &folder.join("bad.ply"));
    viewer.says("bad.ply: ");
    viewer.says("scene | augmented");
    display.drop_file(viewer.window, &folder.join("other.ply"));
    viewer.says("other | augmented | walk | a.png");
    viewer.says("400 + 0 Gaussians");
    display.press('4');
    viewer.says("the scene has no supplement");

    let taken = viewer.shots;
    let lines = viewer.quit();
    assert_eq!(lines.len(), taken + 1, "{lines:?}");
    assert!(lines.iter().all(|line| folder.join(line).is_file()), "{lines:?}");
}

#[test]
fn a_scene_without_a_dataset_is_seen_whole() {
    let (work, _) = work();
    let display = Display::new();
    let mut viewer = Viewer::new(&display, work.path(), "view scene.ply --size 120x90 --background white");
    display.press('n');
    viewer.says("there are no photographs");
    let shot = viewer.shot("scene");
    assert_eq!(shot.size, [120, 90]);
    let pixel = |x: usize, y: usize| &shot.rgb[3 * (120 * y + x)..][..3];
    // Gaussians in the middle, and mostly background in a corner.
    assert!(pixel(60, 45).iter().any(|v| *v < 200) && pixel(0, 0).iter().all(|v| *v > 200));
    assert_eq!(viewer.quit(), ["./scene-0001.png"]);
    let doctor = run::run(glint(work.path(), "doctor").env("DISPLAY", &display.name));
    assert!(String::from_utf8(doctor.stdout).unwrap().contains("ok       display  glint view can open a window"));
}

#[test]
fn a_scene_that_learns_is_seen_and_learns_the_same() {
    let (work, _) = work();
    let folder = work.path();
    let display = Display::new();
    // Runs with and without a window give the same bits, even if the window is closed on the way.
    for (name, closed, command) in
        [("base", true, "train data --iterations 200 --points 200"), ("more", false, "enhance data --base base.ply")]
    {
        let plain = run::run(&mut glint(folder, &format!("{command} -o {name}.ply")));
        assert!(plain.status.success(), "{}", String::from_utf8_lossy(&plain.stderr));
        let mut viewed = glint(folder, &format!("{command} -o seen.ply --view --force"));
        let child = viewed.env("DISPLAY", &display.name).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let windows = || display.client.query_tree(display.root).unwrap().reply().unwrap().children;
        let find = || windows().into_iter().find(|&window| display.title(window).contains("step "));
        let window = until("window", find);
        assert!(display.title(window).starts_with("seen | augmented | orbit | a.png"), "{}", display.title(window));
        until("picture", || {
            let (width, height) = (WIDTH as u16, HEIGHT as u16);
            let image = display.client.get_image(ImageFormat::Z_PIXMAP, window, 0, 0, width, height, !0);
            let data = image.unwrap().reply().ok()?.data;
            // The scene's middle has many colors; the background has one.
            let mut colors: Vec<[u8; 3]> = data.chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect();
            colors.sort_unstable();
            colors.dedup();
            (colors.len() > 100).then_some(())
        });
        if closed {
            let client = &display.client;
            client.set_input_focus(InputFocus::PARENT, window, x11rb::CURRENT_TIME).unwrap().check().unwrap();
            display.key(ESCAPE, Duration::ZERO);
            until("end of the window", || find().is_none().then_some(()));
        }
        let output = run::finish(child);
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{text}");
        assert_eq!(text.contains("the window was closed; the run continues"), closed, "{text}");
        let bytes = |name: &str| fs::read(folder.join(name)).unwrap();
        assert!(bytes("seen.ply") == bytes(&format!("{name}.ply")), "{name}");
    }
}

#[test]
fn where_nothing_can_be_shown_the_reason_is_said() {
    let (work, _) = work();
    let says = |command: &mut Command, code: i32, words: &[&str]| {
        let output = run::run(command);
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{text}");
        assert!(words.iter().all(|word| text.contains(word)) && !text.contains("panicked"), "{text}");
    };
    let view = |arguments: &str| glint(work.path(), &format!("view {arguments}"));
    says(&mut view("scene.ply"), 1, &["error: no window can be opened", "DISPLAY"]);
    says(view("scene.ply").env("DISPLAY", ":4711"), 1, &["error: no window can be opened"]);
    says(&mut view("none.ply"), 2, &["none.ply"]);
    says(&mut view("bad.ply"), 2, &["bad.ply"]);
    says(&mut view("scene.ply nowhere"), 2, &["nowhere"]);
    says(&mut view("scene.ply --size 12"), 2, &["--size", "such as 1280x720"]);
    says(&mut view("scene.ply -o nowhere"), 2, &["nowhere", "expected a folder"]);
    says(&mut view("scene.ply --twin blend"), 2, &["--twin"]);
    let none = "train data -o none.ply --view";
    says(&mut glint(work.path(), none), 1, &["error: no window can be opened", "DISPLAY"]);
    says(&mut glint(work.path(), &format!("{none} --twin blend")), 2, &["--twin", "--view"]);
    assert!(!work.path().join("none.ply").exists());
    fs::write(work.path().join("path.json"), r#"{"width": 8, "height": 8, "keys": [{"eye": [0, 0, 0]}]}"#).unwrap();
    let render = |arguments: &str| glint(work.path(), &format!("render scene.ply {arguments} -o frames"));
    says(&mut render("--path path.json"), 2, &["path.json", "missing field `rotation`", "expected a camera path"]);
    says(&mut render("data --path path.json"), 2, &["cannot be used with"]);
    says(&mut render("--path path.json --frames 0"), 2, &["--frames"]);
    says(&mut render(""), 2, &["DATASET"]);
    assert!(!work.path().join("frames").exists());
}
