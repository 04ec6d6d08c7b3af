//! Connects a command to the program that embeds it: the program gets events and can request a stop by a
//! flag.

use std::{
    cell::{Cell, RefCell},
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    rc::Rc,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
};

/// Event that a command sends while it runs.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A sentence that the command line prints to stderr.
    Note(String),
    /// Progress of a phase.
    Phase(Phase),
    /// Progress of training or of a joint phase.
    Step(Step),
}

/// Progress of a phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phase {
    /// Name of the phase, for example "reading".
    pub name: &'static str,
    /// Unit that is counted, for example "photos".
    pub unit: &'static str,
    /// Units done.
    pub done: u64,
    /// Units in all.
    pub total: u64,
}

/// Progress of training or of a joint phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Steps done, including those of earlier runs.
    pub step: u32,
    /// Steps in all, as far as is known.
    pub steps: u32,
    /// Mean loss and PSNR \[dB\] of the last pass through the photos; `None` before the first step of a run.
    pub lately: Option<[f64; 2]>,
    /// Number of Gaussians.
    pub gaussians: u32,
    /// Time since the first step of this run, seconds.
    pub seconds: f64,
}

/// Receiver of events, with the flag that stops the command.
pub struct Listener {
    /// Receives events, on the thread that runs the command.
    pub tell: Box<dyn FnMut(Event)>,
    /// Set it to stop the command. A training run then writes its scene and checkpoint, as after Ctrl-C;
    /// any other command ends without output.
    pub stop: Arc<AtomicBool>,
}

/// Listener of the command that runs on this thread.
struct Caller {
    tell: RefCell<Box<dyn FnMut(Event)>>,
    stop: Arc<AtomicBool>,
    /// Whether a loop polls `stop` and ends by itself.
    listening: Cell<bool>,
    printed: RefCell<String>,
}

thread_local! {
    static CALLER: RefCell<Option<Rc<Caller>>> = const { RefCell::new(None) };
}

fn caller() -> Option<Rc<Caller>> {
    CALLER.with_borrow(Clone::clone)
}

/// Panic payload that unwinds a stopped command.
pub(super) struct Stopped;

/// Does `work` with a listener on this thread. Returns the printed text, and the panic if one ended `work`.
pub(super) fn hear<T>(listener: Listener, work: impl FnOnce() -> T) -> (String, thread::Result<T>) {
    let Listener { tell, stop } = listener;
    let caller = Rc::new(Caller { tell: tell.into(), stop, listening: Cell::default(), printed: RefCell::default() });
    let before = CALLER.replace(Some(Rc::clone(&caller)));
    let result = catch_unwind(AssertUnwindSafe(work));
    CALLER.set(before);
    (caller.printed.take(), result)
}

/// Whether a program receives the events of this thread.
pub(super) fn is_embedded() -> bool {
    caller().is_some()
}

/// Collects text that goes to stdout on the command line.
pub(super) fn print(text: &str) {
    if let Some(caller) = caller() {
        caller.printed.borrow_mut().push_str(text);
    }
}

/// Sends a note to the caller.
pub(super) fn note(text: String) {
    if let Some(caller) = caller() {
        (caller.tell.borrow_mut())(Event::Note(text));
    }
}

/// Reports the progress of a phase to the caller. If a stop was requested and no loop polls for it, this
/// unwinds the command.
pub(super) fn phase(phase: Phase) {
    if let Some(caller) = caller() {
        (caller.tell.borrow_mut())(Event::Phase(phase));
        if caller.stop.load(Ordering::Relaxed) && !caller.listening.get() {
            resume_unwind(Box::new(Stopped));
        }
    }
}

/// Reports the progress of a run to the caller.
pub(super) fn step(step: Step) {
    if let Some(caller) = caller() {
        (caller.tell.borrow_mut())(Event::Step(step));
    }
}

/// Sets whether a loop polls for the stop flag from now on. Returns whether there is a caller.
pub(super) fn listen(listening: bool) -> bool {
    caller().map(|caller| caller.listening.set(listening)).is_some()
}

/// Whether the caller requested a stop.
pub(super) fn asked() -> bool {
    caller().is_some_and(|caller| caller.stop.load(Ordering::Relaxed))
}
