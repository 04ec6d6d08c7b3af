//! Window of `glint view`: handles keys, mouse and dropped files, and decides when to draw a frame.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
    sync::Arc,
    time::Instant,
};

use glam::{DMat3, DVec3};
use winit::{
    application::ApplicationHandler,
    dpi::{PhysicalPosition, PhysicalSize},
    event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent},
    event_loop::{ActiveEventLoop, ControlFlow, EventLoop},
    keyboard::{Key, KeyCode, ModifiersState, NamedKey, PhysicalKey},
    window::{Window, WindowId},
};

use super::{
    super::{DeviceArgs, Failure, Outcome, SceneArgs, check::check, print, progress::note},
    flight::{Flight, Motion},
    scenery::{Fitted, Look, Mode, Scenery},
    screen::{Costs, Screen},
};
use crate::{
    Error, Result,
    data::{CameraPath, Dataset, Photo, Split, write_png_bytes},
    pipelines::{
        model::Model,
        session::Policy,
        views::{origin_around, origin_for},
    },
    scene::{Camera, Scene},
};

/// Default size, pixels.
const SIZE: [u32; 2] = [1280, 720];
/// Vertical angle of view without photos, radians.
const FIELD: f64 = 0.9;
/// Initial distance from a scene's middle, in radii of the ball with nine tenths of its Gaussians.
const AWAY: f64 = 3.0;
/// Maximum time step of the camera, seconds, so that it does not leap after a slow frame.
const LEAP: f64 = 0.5;
/// Factor of the speed with Shift.
const HURRY: f64 = 4.0;
/// Pixels of a touchpad for a notch of the wheel.
const PIXELS_PER_NOTCH: f64 = 40.0;
/// Number of stages in the title.
const STAGES: usize = 5;

/// Settings with which a window is opened.
pub(super) struct Desk<'a> {
    pub(super) device: &'a DeviceArgs,
    pub(super) dataset: Option<&'a Dataset>,
    /// Options for reading dropped files.
    pub(super) lenient: &'a SceneArgs,
    pub(super) policy: Policy,
    /// Background, sRGB.
    pub(super) background: [f32; 3],
    /// Size of the window, pixels; `None` for that of a photo.
    pub(super) size: Option<[u32; 2]>,
    /// Upward direction; `None` to derive it from the photos.
    pub(super) up: Option<DVec3>,
    /// Folder for screenshots and camera paths.
    pub(super) folder: &'a Path,
    /// File of the scene.
    pub(super) file: &'a Path,
}

impl Desk<'_> {
    fn window_size(&self) -> [u32; 2] {
        let of = |i: usize| [self.photos()[i].camera.width, self.photos()[i].camera.height];
        self.size.or(self.first().map(of)).unwrap_or(SIZE)
    }

    fn photos(&self) -> &[Photo] {
        self.dataset.map_or(&[][..], |dataset| &dataset.photos)
    }

    /// Photo to show first.
    fn first(&self) -> Option<usize> {
        let photos = self.photos();
        photos.iter().position(|photo| photo.split == Split::Test).or((!photos.is_empty()).then_some(0))
    }
}

/// Failure to open a window.
pub(super) fn no_window(error: &impl ToString) -> Failure {
    Failure::NoWindow(reason(&error.to_string()))
}

/// Connects to the display and disconnects.
pub(super) fn try_display() -> Outcome {
    EventLoop::new().map(drop).map_err(|error| no_window(&error))
}

/// Shows `scene` until the window is closed. Returns the number of faults found by the validation layers.
pub(super) fn run(desk: &Desk<'_>, scene: Scene) -> Outcome<usize> {
    let events = EventLoop::new().map_err(|error| no_window(&error))?;
    let mut viewer = Viewer { desk, start: Some(scene), open: None, outcome: Ok(()), faults: 0 };
    let ended = events.run_app(&mut viewer);
    viewer.close();
    viewer.outcome?;
    ended.map_err(|error| no_window(&error))?;
    Ok(viewer.faults)
}

/// Message of an error of winit, without the source location at its beginning.
fn reason(text: &str) -> String {
    let behind = text.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": "));
    behind.map_or(text, |(_, reason)| reason).trim_end_matches('.').to_owned()
}

struct Viewer<'a> {
    desk: &'a Desk<'a>,
    /// Scene to show, until there is a window.
    start: Option<Scene>,
    // The model is dropped first: it is on the window's device.
    open: Option<(Model, Open)>,
    outcome: Outcome,
    faults: usize,
}

/// State of an open window.
pub(super) struct Open {
    // Dropped before the screen, which owns its device.
    scenery: Scenery,
    screen: Screen,
    window: Arc<Window>,
    flight: Flight,
    home: Camera,
    /// Point near which cameras look.
    pivot: DVec3,
    mode: Mode,
    /// Photo whose camera is in use, if any.
    photo: Option<usize>,
    /// Last photo shown, and the size of the window then.
    fitted: Option<(usize, [u32; 2], Fitted)>,
    path: CameraPath,
    /// Whether to save a screenshot of the next frame.
    save: bool,
    status: Status,
    input: Input,
    /// Whether anything has changed since the last frame.
    pub(super) stale: bool,
    /// Whether the last frame was not yet waited for.
    running: bool,
}

/// Texts in the window's title.
#[derive(Default)]
struct Status {
    /// Name of the scene's file, without its ending.
    name: String,
    /// Stages of the last timed frame.
    stages: String,
    /// Progress of a run.
    progress: String,
    /// Note on the last action.
    note: String,
}

/// State of keyboard and mouse.
struct Input {
    held: HashSet<KeyCode>,
    modifiers: ModifiersState,
    button: Option<MouseButton>,
    cursor: PhysicalPosition<f64>,
    /// Time of the last camera move by keys.
    moved: Instant,
}

impl Drop for Open {
    fn drop(&mut self) {
        // Models and frames must not be dropped while the device draws them.
        if let Err(error) = self.screen.finish() {
            note(format!("the last frame was not finished: {error}"));
        }
    }
}

impl ApplicationHandler for Viewer<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        let Some(scene) = self.start.take() else { return };
        match self.make(events, scene) {
            Ok(open) => self.open = Some(open),
            Err(failure) => self.fail(events, failure),
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if closes(&event) {
            return events.exit();
        }
        let Some((model, open)) = &mut self.open else { return };
        let outcome = match event {
            WindowEvent::RedrawRequested => open.draw(self.desk, model).map_err(Failure::from),
            WindowEvent::DroppedFile(path) => {
                if let Some(other) = open.drop_in(&path, self.desk) {
                    *model = other;
                    open.settle_mode(model);
                }
                Ok(())
            }
            event => open.event(&event, self.desk, model),
        };
        if let Err(failure) = outcome {
            self.fail(events, failure);
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let Some((_, open)) = &mut self.open else { return };
        open.keys();
        let outcome = if open.stale { Ok(()) } else { open.rest(self.desk) };
        if open.stale {
            open.window.request_redraw();
        }
        // A redraw wakes the loop; otherwise nothing moves until an event.
        events.set_control_flow(if open.input.held.is_empty() { ControlFlow::Wait } else { ControlFlow::Poll });
        if let Err(error) = outcome {
            self.fail(events, error.into());
        }
    }
}

impl Viewer<'_> {
    fn fail(&mut self, events: &ActiveEventLoop, failure: Failure) {
        // Later failures follow from the first.
        if self.outcome.is_ok() {
            self.outcome = Err(failure);
        }
        events.exit();
    }

    /// Drops everything before the display closes.
    fn close(&mut self) {
        let Some((model, open)) = self.open.take() else { return };
        let messages = open.screen.lender().messages();
        drop(model);
        drop(open);
        self.faults = messages.lock().map_or(0, |list| list.len());
    }

    fn make(&self, events: &ActiveEventLoop, scene: Scene) -> Outcome<(Model, Open)> {
        let (window, screen) = open_window(events, self.desk)?;
        let (middle, radius) = ball(&scene);
        let cameras: Vec<Camera> = self.desk.photos().iter().map(|photo| photo.camera).collect();
        let origin = if cameras.is_empty() { origin_around(middle, radius) } else { origin_for(&cameras) };
        let (scenery, model) = Scenery::new(screen.context(), scene, origin, self.desk.policy)?;
        Ok((model, Open::new(window, screen, scenery, self.desk, (middle, radius))))
    }
}

/// Whether an event closes the window.
pub(super) fn closes(event: &WindowEvent) -> bool {
    match event {
        WindowEvent::CloseRequested => true,
        WindowEvent::KeyboardInput { event: KeyEvent { logical_key, state, .. }, .. } => {
            *logical_key == Key::Named(NamedKey::Escape) && *state == ElementState::Pressed
        }
        _ => false,
    }
}

/// Opens a window and a device that can draw in it.
pub(super) fn open_window(events: &ActiveEventLoop, desk: &Desk<'_>) -> Outcome<(Arc<Window>, Screen)> {
    let size = desk.window_size();
    let attributes =
        Window::default_attributes().with_title("glint").with_inner_size(PhysicalSize::new(size[0], size[1]));
    let window = Arc::new(events.create_window(attributes).map_err(|error| no_window(&error))?);
    let options = desk.device.options();
    let screen = Screen::new(window.clone(), &options).map_err(|error| desk.device.explain(&options, error))?;
    tracing::info!("device: {}", screen.context().info().name);
    check(screen.context(), &options, desk.device.unchecked)?;
    Ok((window, screen))
}

impl Open {
    /// Opens on a scene with its middle and radius.
    pub(super) fn new(
        window: Arc<Window>,
        screen: Screen,
        scenery: Scenery,
        desk: &Desk<'_>,
        (middle, radius): (DVec3, f64),
    ) -> Self {
        let (photos, first) = (desk.photos(), desk.first());
        let pivot = desk.dataset.and_then(Dataset::focus).map_or(middle, |focus| focus.center);
        let above = -photos.iter().map(|photo| photo.camera.rotation.row(1)).sum::<DVec3>();
        let up = desk.up.or(above.try_normalize()).unwrap_or(DVec3::NEG_Y);
        let home = first.map_or_else(|| overview(middle, radius, up, desk.window_size()), |i| photos[i].camera);
        Open {
            scenery,
            screen,
            window,
            flight: Flight::new(home, pivot, up),
            home,
            pivot,
            mode: Mode::Augmented,
            photo: first,
            fitted: None,
            path: CameraPath::default(),
            save: false,
            status: Status { name: stem(desk.file), ..Status::default() },
            input: Input {
                held: HashSet::new(),
                modifiers: ModifiersState::default(),
                button: None,
                cursor: PhysicalPosition::default(),
                moved: Instant::now(),
            },
            stale: true,
            running: false,
        }
    }

    /// Handles an event that the loop does not handle itself.
    pub(super) fn event(&mut self, event: &WindowEvent, desk: &Desk<'_>, model: &Model) -> Outcome {
        match event {
            WindowEvent::Resized(_) | WindowEvent::ScaleFactorChanged { .. } => {
                self.screen.resized();
                self.touch();
            }
            WindowEvent::RedrawRequested | WindowEvent::Occluded(false) => self.touch(),
            WindowEvent::Focused(false) => {
                self.input.held.clear();
                self.input.button = None;
            }
            WindowEvent::ModifiersChanged(modifiers) => self.input.modifiers = modifiers.state(),
            WindowEvent::KeyboardInput { event, .. } => self.key(event, desk, model)?,
            WindowEvent::MouseInput { state, button, .. } => {
                self.input.button = (*state == ElementState::Pressed).then_some(*button);
            }
            WindowEvent::CursorMoved { position, .. } => self.mouse(*position),
            WindowEvent::MouseWheel { delta, .. } => {
                let moved = self.flight.wheel(match delta {
                    MouseScrollDelta::LineDelta(_, lines) => (*lines).into(),
                    MouseScrollDelta::PixelDelta(moved) => moved.y / PIXELS_PER_NOTCH,
                });
                if moved {
                    self.left();
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Whether a frame is in flight.
    pub(super) fn is_drawing(&self) -> bool {
        self.running && !self.screen.is_done()
    }

    pub(super) fn costs(&self) -> Costs {
        self.screen.costs()
    }

    /// Sets the progress in the title.
    pub(super) fn tell(&mut self, progress: String) {
        self.status.progress = progress;
    }

    /// Requests a new frame.
    pub(super) fn touch(&mut self) {
        self.stale = true;
    }

    /// Notes that the camera has left a photo's pose.
    fn left(&mut self) {
        self.photo = None;
        if self.mode.of_photograph() {
            self.mode = Mode::Augmented;
        }
        self.touch();
    }

    fn say(&mut self, text: impl Into<String>) {
        self.status.note = text.into();
        self.touch();
    }

    /// Reports a failed action; the window stays open.
    fn complain(&mut self, error: &Error) {
        note(error.to_string());
        self.say(error.to_string());
    }

    fn key(&mut self, event: &KeyEvent, desk: &Desk<'_>, model: &Model) -> Outcome {
        let PhysicalKey::Code(code) = event.physical_key else { return Ok(()) };
        let pressed = event.state == ElementState::Pressed;
        if step(code).is_some() {
            if pressed && self.input.held.is_empty() {
                self.input.moved = Instant::now();
            }
            if pressed {
                self.input.held.insert(code)
            } else {
                self.input.held.remove(&code)
            };
            return Ok(());
        }
        if !pressed || event.repeat {
            return Ok(());
        }
        if let Some(mode) = digit(code).and_then(|i| Mode::ALL.get(i)) {
            match self.scenery.lacks(model, *mode, self.photo.is_some()) {
                Some(why) => self.say(why),
                None => {
                    self.mode = *mode;
                    self.say("");
                }
            }
            return Ok(());
        }
        let Key::Character(character) = &event.logical_key else { return Ok(()) };
        let photos = desk.photos();
        match character.to_lowercase().as_str() {
            "n" => self.turn_to(photos, 1),
            "p" => self.turn_to(photos, photos.len().saturating_sub(1)),
            "o" => self.move_by(Motion::Orbit),
            "f" => self.move_by(Motion::Fly),
            "g" => self.move_by(Motion::Walk),
            "r" => {
                self.left();
                self.flight.jump(self.home, self.pivot);
                self.say("");
            }
            "c" => {
                self.save = true;
                self.touch();
            }
            "t" => {
                self.scenery.timed = !self.scenery.timed;
                self.status.stages.clear();
                self.touch();
            }
            "k" if self.input.modifiers.shift_key() => self.save_path(desk)?,
            "k" => {
                let camera = self.camera()?;
                self.path.push(camera);
                self.say(format!("pose {} of the path", self.path.len()));
            }
            _ => {}
        }
        Ok(())
    }

    fn move_by(&mut self, motion: Motion) {
        self.flight.motion = motion;
        self.touch();
    }

    /// Jumps to the camera of the photo `by` positions further.
    fn turn_to(&mut self, photos: &[Photo], by: usize) {
        if photos.is_empty() {
            return self.say("there are no photographs: use glint view SCENE DATASET");
        }
        let next = match self.photo {
            Some(i) => (i + by) % photos.len(),
            None => 0,
        };
        self.photo = Some(next);
        self.flight.jump(photos[next].camera, self.pivot);
        self.say("");
    }

    fn mouse(&mut self, position: PhysicalPosition<f64>) {
        let (right, down) = (position.x - self.input.cursor.x, position.y - self.input.cursor.y);
        self.input.cursor = position;
        let height = f64::from(self.window.inner_size().height.max(1));
        match self.input.button {
            Some(MouseButton::Left) => self.flight.drag(right / height, down / height),
            Some(MouseButton::Right | MouseButton::Middle) => {
                // From the window's pixels to those of the camera's picture.
                let Ok(shown) = self.camera() else { return };
                let scale = self.flight.camera().fx / shown.fx;
                self.flight.pan(scale * right, scale * down);
            }
            _ => return,
        }
        self.left();
    }

    /// Moves while keys are held.
    pub(super) fn keys(&mut self) {
        if self.input.held.is_empty() {
            return;
        }
        let seconds = self.input.moved.elapsed().as_secs_f64().min(LEAP);
        self.input.moved = Instant::now();
        let hurry = if self.input.modifiers.shift_key() { HURRY } else { 1.0 };
        let mut sum = DVec3::ZERO;
        self.input.held.iter().filter_map(|&code| step(code)).for_each(|step| sum += hurry * DVec3::from(step));
        self.flight.go(sum.to_array(), seconds);
        self.left();
    }

    /// Camera of the window's pixels.
    fn camera(&mut self) -> Result<Camera> {
        let [width, height] = self.screen.size()?;
        Ok(self.flight.camera().fitted(width.max(1), height.max(1)))
    }

    /// Draws a frame, and saves a screenshot if requested.
    pub(super) fn draw(&mut self, desk: &Desk<'_>, model: &Model) -> Result<()> {
        let size = self.screen.size()?;
        if size == [0, 0] {
            self.stale = false;
            return Ok(());
        }
        if let Err(error) = self.fit_photo(desk, size) {
            self.mode = Mode::Augmented;
            self.complain(&error);
        }
        let look = Look {
            camera: self.flight.camera().fitted(size[0], size[1]),
            background: desk.background,
            photo: self.fitted.as_ref().filter(|_| self.photo.is_some()).map(|(_, _, fitted)| fitted),
        };
        let asked = self.save;
        let mut drawn = self.scenery.show(&mut self.screen, model, self.mode, &look, asked)?;
        if asked && drawn.shown {
            // The first frame may have overflowed.
            if self.scenery.make_room(&mut self.screen)? {
                drawn = self.scenery.show(&mut self.screen, model, self.mode, &look, true)?;
            }
            self.save = !drawn.shown;
        }
        // If the window had no image, the frame is drawn again.
        self.stale = !drawn.shown;
        self.running = drawn.shown;
        if let Some(pixels) = drawn.pixels {
            let file = free(desk.folder, |i| format!("{}-{i:04}.png", self.status.name));
            match write_png_bytes(&file, size[0], size[1], &pixels) {
                Ok(()) => {
                    print(format_args!("{}\n", file.display()))?;
                    self.status.note = file.display().to_string();
                }
                Err(error) => self.complain(&error),
            }
        } else if drawn.shown && asked {
            self.status.note = "this window's pixels cannot be read".into();
        }
        self.title(desk);
        Ok(())
    }

    /// Waits for the last frame while nothing moves, and grows buffers that overflowed.
    pub(super) fn rest(&mut self, desk: &Desk<'_>) -> Result<()> {
        if !std::mem::take(&mut self.running) {
            return Ok(());
        }
        self.stale = self.scenery.make_room(&mut self.screen)?;
        if self.scenery.timed && !self.stale {
            let stages = self.scenery.stages(&self.screen)?;
            let named = stages.iter().take(STAGES);
            let named: Vec<_> = named.map(|(name, time)| format!("{name} {:.1}", 1e3 * time.as_secs_f64())).collect();
            self.status.stages = if named.is_empty() { "no clock".into() } else { named.join(", ") };
        }
        self.title(desk);
        Ok(())
    }

    /// Fits the photo of this camera to the window, if it is shown.
    fn fit_photo(&mut self, desk: &Desk<'_>, size: [u32; 2]) -> Result<()> {
        let (Some(dataset), Some(i), true) = (desk.dataset, self.photo, self.mode.of_photograph()) else {
            return Ok(());
        };
        if self.fitted.as_ref().is_none_or(|(photo, of, _)| (*photo, *of) != (i, size)) {
            let image = dataset.photos[i].load(desk.background)?;
            self.fitted = Some((i, size, Fitted::new(&image, size)));
        }
        Ok(())
    }

    fn title(&self, desk: &Desk<'_>) {
        let photo = self.photo.zip(desk.dataset).map(|(i, dataset)| &dataset.photos[i].name[..]);
        // A photo takes no device time.
        let time = self.screen.costs().time.filter(|_| self.mode != Mode::Photograph).map(|time| {
            let stages =
                if self.status.stages.is_empty() { String::new() } else { format!(" ({})", self.status.stages) };
            format!("{:.1} ms{stages}", 1e3 * time.as_secs_f64())
        });
        let counts = self.scenery.counts.map(|[base, supplement]| format!("{base} + {supplement} Gaussians"));
        let memory = self.screen.context().memory().used as f64 / 1e6;
        let parts = [
            Some(self.status.name.clone()),
            Some(self.mode.name().to_owned()),
            Some(self.flight.motion.name().to_owned()),
            photo.map(str::to_owned),
            time,
            counts,
            Some(self.status.progress.clone()).filter(|progress| !progress.is_empty()),
            Some(format!("{memory:.1} MB")),
            Some(self.status.note.clone()).filter(|note| !note.is_empty()),
        ];
        // A file name may contain line breaks.
        let title = parts.into_iter().flatten().collect::<Vec<_>>().join(" | ").replace(char::is_control, " ");
        self.window.set_title(&title);
    }

    fn save_path(&mut self, desk: &Desk<'_>) -> Outcome {
        if self.path.is_empty() {
            self.say("the path has no poses yet: k adds one");
            return Ok(());
        }
        let file = free(desk.folder, |i| format!("{}-path-{i}.json", self.status.name));
        if let Err(error) = self.path.write(&file) {
            self.complain(&error);
            return Ok(());
        }
        print(format_args!("{}\n", file.display()))?;
        let n = self.path.len();
        self.say(format!("{}: {n} pose{}", file.display(), if n == 1 { "" } else { "s" }));
        Ok(())
    }

    /// Replaces the scene by a dropped file and returns its model. If reading fails, the old scene stays.
    fn drop_in(&mut self, path: &Path, desk: &Desk<'_>) -> Option<Model> {
        let made = desk.lenient.open(path).and_then(|scene| {
            let (middle, radius) = ball(&scene);
            let camera = self.flight.camera();
            // Coordinates are precise around the camera, wherever the scene is.
            let origin = origin_around(camera.eye(), camera.eye().distance(middle).max(radius));
            Scenery::new(self.screen.context(), scene, origin, desk.policy)
        });
        match made.and_then(|made| self.screen.finish().map(|()| made).map_err(Error::from)) {
            Ok((scenery, model)) => {
                let timed = self.scenery.timed;
                self.scenery = scenery;
                self.scenery.timed = timed;
                self.screen.forget();
                self.status.name = stem(path);
                self.say("");
                Some(model)
            }
            // The window is unchanged.
            Err(error) => {
                self.complain(&error);
                None
            }
        }
    }

    /// Falls back to the default mode if the current one does not exist in another scene.
    fn settle_mode(&mut self, model: &Model) {
        if self.scenery.lacks(model, self.mode, self.photo.is_some()).is_some() {
            self.mode = Mode::Augmented;
        }
    }
}

/// Direction of a key: right, up, ahead.
fn step(code: KeyCode) -> Option<[f64; 3]> {
    Some(match code {
        KeyCode::KeyW => [0.0, 0.0, 1.0],
        KeyCode::KeyS => [0.0, 0.0, -1.0],
        KeyCode::KeyD => [1.0, 0.0, 0.0],
        KeyCode::KeyA => [-1.0, 0.0, 0.0],
        KeyCode::KeyE => [0.0, 1.0, 0.0],
        KeyCode::KeyQ => [0.0, -1.0, 0.0],
        _ => return None,
    })
}

/// Index of a digit key, from 0 on.
fn digit(code: KeyCode) -> Option<usize> {
    const DIGITS: [[KeyCode; 2]; 8] = [
        [KeyCode::Digit1, KeyCode::Numpad1],
        [KeyCode::Digit2, KeyCode::Numpad2],
        [KeyCode::Digit3, KeyCode::Numpad3],
        [KeyCode::Digit4, KeyCode::Numpad4],
        [KeyCode::Digit5, KeyCode::Numpad5],
        [KeyCode::Digit6, KeyCode::Numpad6],
        [KeyCode::Digit7, KeyCode::Numpad7],
        [KeyCode::Digit8, KeyCode::Numpad8],
    ];
    DIGITS.iter().position(|codes| codes.contains(&code))
}

/// Stem of a scene's output files.
fn stem(path: &Path) -> String {
    path.file_stem().map_or("scene".into(), |stem| stem.to_string_lossy().into_owned())
}

/// First of numbered files that does not exist.
fn free(folder: &Path, name: impl Fn(u32) -> String) -> PathBuf {
    let files = (1..).map(|i| folder.join(name(i)));
    files.into_iter().find(|file| file.symlink_metadata().is_err()).unwrap_or_else(|| folder.join(name(0)))
}

/// Median of the base's Gaussians on each axis, and the radius around it that contains nine tenths.
fn ball(scene: &Scene) -> (DVec3, f64) {
    let at = |mut values: Vec<f64>, share: f64| {
        let n = (share * values.len().saturating_sub(1) as f64) as usize;
        if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(n, f64::total_cmp).1 }
    };
    let means = || scene.world_means().take(scene.base.len());
    let middle = DVec3::from([0, 1, 2].map(|axis| at(means().map(|mean| mean[axis]).collect(), 0.5)));
    let radius = at(means().map(|mean| mean.distance(middle)).collect(), 0.9);
    (middle, if radius > 0.0 { radius } else { 1.0 })
}

/// Camera that sees a ball from slightly above.
fn overview(middle: DVec3, radius: f64, up: DVec3, [width, height]: [u32; 2]) -> Camera {
    let focal = f64::from(height) / (2.0 * (FIELD / 2.0).tan());
    let ahead = if up.z.abs() < 0.5 { DVec3::Z } else { DVec3::Y };
    let level = DMat3::from_cols(ahead.cross(up), -up, ahead).transpose();
    let rotation = DMat3::from_rotation_x(0.3) * level;
    let eye = middle - AWAY * radius * rotation.row(2);
    Camera { rotation, translation: -(rotation * eye), ..Camera::new(width, height, focal) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Gaussians;

    #[test]
    fn a_scene_is_looked_at_from_above_and_outside() {
        let means = (0..100).map(|i| [i as f32, 10.0, 0.1 * i as f32]).collect();
        let scene = Scene { base: Gaussians { means, ..Default::default() }, ..Default::default() };
        let (middle, radius) = ball(&scene);
        assert!((middle - DVec3::new(49.0, 10.0, 4.9)).length() < 0.1 && (40.0..50.0).contains(&radius));
        for up in [DVec3::NEG_Y, DVec3::Z, DVec3::X] {
            let camera = overview(middle, radius, up, [64, 48]);
            let (x, y, z) = camera.project(middle);
            assert!((x - 32.0).abs() < 1e-9 && (y - 24.0).abs() < 1e-9 && (z - AWAY * radius).abs() < 1e-9);
            assert!((camera.eye() - middle).dot(up) > 0.1 * radius && camera.project(middle + up).1 < 24.0);
            assert!((camera.rotation.determinant() - 1.0).abs() < 1e-12);
        }
        assert_eq!(ball(&Scene::default()), (DVec3::ZERO, 1.0));
    }

    #[test]
    fn digits_are_those_of_both_rows() {
        let keys = [KeyCode::Digit1, KeyCode::Digit3, KeyCode::Numpad8, KeyCode::Digit9, KeyCode::KeyA];
        assert_eq!(keys.map(digit), [Some(0), Some(2), Some(7), None, None]);
    }

    #[test]
    fn a_reason_is_said_without_the_place_in_somebodys_source() {
        let text = "os error at /home/a/winit-0.30.13/src/platform_impl/linux/mod.rs:765: DISPLAY: it is not set.";
        assert_eq!(reason(text), "DISPLAY: it is not set");
        assert_eq!(reason("Exit Failure: 1"), "Exit Failure: 1");
    }

    #[test]
    fn files_get_numbers_that_are_free() {
        let folder = tempfile::tempdir().unwrap();
        let name = |i| format!("a-{i}");
        assert_eq!(free(folder.path(), name), folder.path().join("a-1"));
        std::fs::write(folder.path().join("a-1"), "").unwrap();
        assert_eq!(free(folder.path(), name), folder.path().join("a-2"));
    }
}
