//! The window of a run: the scene as it learns, drawn between the run's own submissions.
//!
//! The device is the window's, lent to glint, and all that is made on it stays when the window goes. Frames only read the model, so what
//! the run learns has the same bits with a window and without.

use std::{
    fmt::Arguments,
    rc::Rc,
    time::{Duration, Instant},
};

use glam::DVec3;
use winit::{
    application::ApplicationHandler,
    event::WindowEvent,
    event_loop::{ActiveEventLoop, EventLoop},
    platform::pump_events::EventLoopExtPumpEvents,
    window::WindowId,
};

use super::{
    super::{Failure, Look, Outcome, progress::note, tell_end},
    scenery::Scenery,
    screen::Lender,
    window::{Desk, Open, closes, no_window, open_window},
};
use crate::{Error, gpu::Context, pipelines::model::Model};

/// From one frame to the next it takes so many times as long as the host and the device worked for the window: a run becomes slower by
/// less than a tenth.
const SHARE: u32 = 12;

/// Opens a window and does `work` on its device. The window may be closed before the work is done.
pub(super) fn run<T>(desk: &Desk<'_>, work: impl FnOnce(&Context, &mut Look<'_>) -> Outcome<T>) -> Outcome<T> {
    if !desk.device.twins.is_empty() {
        return Err(Error::Usage("--twin: twins stand in for no stage on a window's device (--view)".into()).into());
    }
    let mut events = EventLoop::new().map_err(|error| no_window(&error))?;
    let mut opening = Opening { desk, opened: None };
    events.pump_app_events(Some(Duration::ZERO), &mut opening);
    let Some(opened) = opening.opened else { return Err(no_window(&"there is no event loop")) };
    let (open, lender) = opened?;
    let (begun, spent) = (Instant::now(), Duration::ZERO);
    let shown = Shown { open, events, begun, spent, drawing: false, first: true };
    let mut watch = Watch { desk, shown: Some(shown) };
    let result = work(lender.context(), &mut |model, progress| watch.look(model, progress));
    // With it goes what is drawn.
    drop(watch);
    let messages = lender.messages();
    drop(lender);
    let faults = messages.lock().map_or(0, |list| list.len());
    tell_end(result, faults)
}

/// The first events of a loop, which let a window be opened.
struct Opening<'a> {
    desk: &'a Desk<'a>,
    opened: Option<Outcome<(Open, Rc<Lender>)>>,
}

impl ApplicationHandler for Opening<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.opened.is_some() {
            return;
        }
        self.opened = Some(open_window(events, self.desk).map(|(window, screen)| {
            let lender = screen.lender();
            // The photographs say where the scene is.
            let around = (DVec3::ZERO, 1.0);
            (Open::new(window, screen, Scenery::learning(self.desk.policy), self.desk, around), lender)
        }));
    }

    fn window_event(&mut self, _: &ActiveEventLoop, _: WindowId, _: WindowEvent) {}
}

/// A window that is open.
struct Shown {
    // Before the loop, whose display it is on.
    open: Open,
    events: EventLoop<()>,
    /// When the last frame was begun.
    begun: Instant,
    /// What the host has done for the window since.
    spent: Duration,
    /// The frame is not known to be done.
    drawing: bool,
    /// No frame was drawn yet.
    first: bool,
}

struct Watch<'a> {
    desk: &'a Desk<'a>,
    /// `None` once it was closed.
    shown: Option<Shown>,
}

impl Watch<'_> {
    /// What has happened in the window, and a frame where one is due. Whatever is wrong with the window, the run goes on.
    fn look(&mut self, model: &Model, progress: Arguments<'_>) {
        let Some(shown) = &mut self.shown else { return };
        match shown.look(self.desk, model, progress) {
            Ok(true) => {}
            Ok(false) => {
                note("the window was closed, the run goes on");
                self.shown = None;
            }
            Err(failure) => {
                let why = match failure {
                    Failure::Error(error) => error.to_string(),
                    other => format!("{other:?}"),
                };
                note(format!("the window was closed, the run goes on: {why}"));
                self.shown = None;
            }
        }
    }
}

impl Shown {
    /// False once somebody wants it closed.
    fn look(&mut self, desk: &Desk<'_>, model: &Model, progress: Arguments<'_>) -> Outcome<bool> {
        let began = Instant::now();
        let (waited, _) = self.open.costs();
        let mut pumped = Pumped { open: &mut self.open, desk, model, closed: false, outcome: Ok(()) };
        self.events.pump_app_events(Some(Duration::ZERO), &mut pumped);
        let Pumped { closed, outcome, .. } = pumped;
        outcome?;
        if closed {
            return Ok(false);
        }
        self.open.keys();
        if self.drawing && !self.open.is_drawing() {
            self.drawing = false;
            // It is done, so nothing is waited for.
            self.open.rest(desk)?;
            // Without a clock the host's share stands for both.
            self.spent += self.open.costs().1.unwrap_or(self.spent);
        }
        if !self.drawing && self.begun.elapsed() >= SHARE * self.spent {
            self.open.tell(progress.to_string());
            self.open.touch();
            let now = Instant::now();
            self.open.draw(desk, model)?;
            (self.begun, self.spent, self.drawing) = (now, Duration::ZERO, true);
        }
        // While the host waits the run's own work goes on, and pipelines are made once.
        if !(self.drawing && std::mem::take(&mut self.first)) {
            self.spent += began.elapsed().saturating_sub(self.open.costs().0 - waited);
        }
        Ok(true)
    }
}

/// The loop's events while a run stands between two steps.
struct Pumped<'a> {
    open: &'a mut Open,
    desk: &'a Desk<'a>,
    model: &'a Model,
    closed: bool,
    outcome: Outcome,
}

impl ApplicationHandler for Pumped<'_> {
    fn resumed(&mut self, _: &ActiveEventLoop) {}

    fn window_event(&mut self, _: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if closes(&event) {
            self.closed = true;
        } else if self.outcome.is_ok() {
            self.outcome = self.open.event(&event, self.desk, self.model);
        }
    }
}
