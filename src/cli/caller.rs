//! The program that runs a command in place of a terminal: it gets progress, notes and reports, and asks for an end by a flag.

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

/// What a command tells while it runs.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A sentence that the command line prints to stderr.
    Note(String),
    /// How far a phase is.
    Phase(Phase),
    /// How far training or a joint phase is.
    Step(Step),
}

/// How far a phase is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phase {
    /// What is done, for example "reading".
    pub name: &'static str,
    /// What is counted, for example "photos".
    pub unit: &'static str,
    /// How many are done.
    pub done: u64,
    /// Of how many.
    pub total: u64,
}

/// How far training or a joint phase is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Steps that are done, those of earlier runs included.
    pub step: u32,
    /// Of how many, as far as is known.
    pub steps: u32,
    /// Mean loss and PSNR \[dB\] of the last pass through the photos; `None` before the first step of a run.
    pub lately: Option<[f64; 2]>,
    /// Gaussians in all.
    pub gaussians: u32,
    /// Since the first step of this run.
    pub seconds: f64,
}

/// Who gets the events, and how they ask for an end.
pub struct Listener {
    /// Gets events, on the thread that runs the command.
    pub tell: Box<dyn FnMut(Event)>,
    /// Set to ask for an end. A run that learns then writes its scene and checkpoint, as after Ctrl-C; anything else ends with nothing done.
    pub stop: Arc<AtomicBool>,
}

/// The listener of the command that runs on this thread.
struct Caller {
    tell: RefCell<Box<dyn FnMut(Event)>>,
    stop: Arc<AtomicBool>,
    /// A loop looks at `stop` and ends by itself.
    listening: Cell<bool>,
    printed: RefCell<String>,
}

thread_local! {
    static CALLER: RefCell<Option<Rc<Caller>>> = const { RefCell::new(None) };
}

fn caller() -> Option<Rc<Caller>> {
    CALLER.with_borrow(Clone::clone)
}

/// Unwinds a command that is asked to end.
pub(super) struct Stopped;

/// Does `work` with a listener on this thread. Returns what it printed, and the panic if it ended by one.
pub(super) fn hear<T>(listener: Listener, work: impl FnOnce() -> T) -> (String, thread::Result<T>) {
    let Listener { tell, stop } = listener;
    let caller = Rc::new(Caller { tell: tell.into(), stop, listening: Cell::default(), printed: RefCell::default() });
    let before = CALLER.replace(Some(Rc::clone(&caller)));
    let result = catch_unwind(AssertUnwindSafe(work));
    CALLER.set(before);
    (caller.printed.take(), result)
}

/// Whether a program is told in place of a terminal.
pub(super) fn is_embedded() -> bool {
    caller().is_some()
}

/// Hands the caller what goes to stdout elsewhere.
pub(super) fn print(text: &str) {
    if let Some(caller) = caller() {
        caller.printed.borrow_mut().push_str(text);
    }
}

/// Hands the caller a note.
pub(super) fn note(text: String) {
    if let Some(caller) = caller() {
        (caller.tell.borrow_mut())(Event::Note(text));
    }
}

/// Tells the caller how far a phase is. If an end is asked for and no loop listens, the command ends here.
pub(super) fn phase(phase: Phase) {
    if let Some(caller) = caller() {
        (caller.tell.borrow_mut())(Event::Phase(phase));
        if caller.stop.load(Ordering::Relaxed) && !caller.listening.get() {
            resume_unwind(Box::new(Stopped));
        }
    }
}

/// Tells the caller how far a run is.
pub(super) fn step(step: Step) {
    if let Some(caller) = caller() {
        (caller.tell.borrow_mut())(Event::Step(step));
    }
}

/// Tells that from now on a loop ends by itself when an end is asked for, or no longer does; whether there is a caller.
pub(super) fn listen(listening: bool) -> bool {
    caller().map(|caller| caller.listening.set(listening)).is_some()
}

/// Whether the caller asks for an end.
pub(super) fn asked() -> bool {
    caller().is_some_and(|caller| caller.stop.load(Ordering::Relaxed))
}
