//! Window of a run: shows the scene while it trains, drawn between the run's own submissions.
//!
//! The device belongs to the window and is lent to glint; objects on it remain if the window closes. Frames
//! only read the model, so the result has the same bits with and without a window.

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

/// Minimum interval between frames, relative to the work of host and device for the window. A run is slowed
/// by less than a tenth.
const SHARE: u32 = 12;

/// Opens a window and does `work` on its device. The window may be closed before the work is done.
pub(super) fn run<T>(desk: &Desk<'_>, work: impl FnOnce(&Context, &mut Look<'_>) -> Outcome<T>) -> Outcome<T> {
    if !desk.device.twins.is_empty() {
        return Err(Error::Usage("--twin does not work in a window: leave out --view".into()).into());
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
    // Drops the window and its frames.
    drop(watch);
    let messages = lender.messages();
    drop(lender);
    let faults = messages.lock().map_or(0, |list| list.len());
    tell_end(result, faults)
}

/// First events of a loop, which allow a window to be opened.
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
            // The photos define the position of the scene.
            let around = (DVec3::ZERO, 1.0);
            (Open::new(window, screen, Scenery::learning(self.desk.policy), self.desk, around), lender)
        }));
    }

    fn window_event(&mut self, _: &ActiveEventLoop, _: WindowId, _: WindowEvent) {}
}

/// Open window.
struct Shown {
    // Dropped before the loop, which owns its display.
    open: Open,
    events: EventLoop<()>,
    /// Start of the last frame.
    begun: Instant,
    /// Time that the host has spent on the window since.
    spent: Duration,
    /// Whether the last frame may still be running.
    drawing: bool,
    /// Whether no frame was drawn yet.
    first: bool,
}

struct Watch<'a> {
    desk: &'a Desk<'a>,
    /// `None` after it was closed.
    shown: Option<Shown>,
}

impl Watch<'_> {
    /// Handles the window's events and draws a due frame. The run continues even if the window fails.
    fn look(&mut self, model: &Model, progress: Arguments<'_>) {
        let Some(shown) = &mut self.shown else { return };
        match shown.look(self.desk, model, progress) {
            Ok(true) => {}
            Ok(false) => {
                note("the window was closed; the run continues");
                self.shown = None;
            }
            Err(failure) => {
                let why = match failure {
                    Failure::Error(error) => error.to_string(),
                    other => format!("{other:?}"),
                };
                note(format!("the window was closed; the run continues: {why}"));
                self.shown = None;
            }
        }
    }
}

impl Shown {
    /// Returns false when the user closes the window.
    fn look(&mut self, desk: &Desk<'_>, model: &Model, progress: Arguments<'_>) -> Outcome<bool> {
        let began = Instant::now();
        let waited = self.open.costs().waited;
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
            // The frame is done, so this does not wait.
            self.open.rest(desk)?;
            // Without timestamps, the host's time is counted twice.
            self.spent += self.open.costs().time.unwrap_or(self.spent);
        }
        if !self.drawing && self.begun.elapsed() >= SHARE * self.spent {
            self.open.tell(progress.to_string());
            self.open.touch();
            let now = Instant::now();
            self.open.draw(desk, model)?;
            (self.begun, self.spent, self.drawing) = (now, Duration::ZERO, true);
        }
        // Waiting does not count, since the run's own work continues. The first frame does not either,
        // since it creates pipelines once.
        if !(self.drawing && std::mem::take(&mut self.first)) {
            self.spent += began.elapsed().saturating_sub(self.open.costs().waited - waited);
        }
        Ok(true)
    }
}

/// Events of the loop between two steps of the run.
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
