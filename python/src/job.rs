//! Runs a command in its own thread and hands its events to Python.

use std::{
    ffi::OsString,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, RecvTimeoutError, sync_channel},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use glint::cli::embed::{self, Event, Failed, Listener, Phase, STOPPED, Step};
use pyo3::{IntoPyObjectExt, prelude::*};

use crate::Failure;

/// How often a waiting thread checks for signals, such as Ctrl-C.
const LISTEN_EVERY: Duration = Duration::from_millis(50);

type Ended = (String, Result<(), Failed>);

struct Running {
    events: Receiver<Event>,
    thread: JoinHandle<Ended>,
}

/// A command that runs. It pauses while Python takes no events: the channel holds one.
#[pyclass(frozen)]
pub struct Job {
    stop: Arc<AtomicBool>,
    running: Mutex<Option<Running>>,
    ended: Mutex<Option<Ended>>,
}

impl Job {
    /// Waits for the next event, up to [`LISTEN_EVERY`]. `Ok(None)` after the last.
    fn next(&self) -> Result<Option<Event>, RecvTimeoutError> {
        let mut running = self.running.lock().unwrap_or_else(|error| error.into_inner());
        let Some(Running { events, .. }) = &*running else { return Ok(None) };
        match events.recv_timeout(LISTEN_EVERY) {
            Ok(event) => return Ok(Some(event)),
            Err(RecvTimeoutError::Timeout) => return Err(RecvTimeoutError::Timeout),
            Err(RecvTimeoutError::Disconnected) => {}
        }
        if let Some(Running { thread, .. }) = running.take() {
            let fault = || Failed { text: "a fault in glint".into(), code: 1 };
            let ended = thread.join().unwrap_or_else(|_| (String::new(), Err(fault())));
            *self.ended.lock().unwrap_or_else(|error| error.into_inner()) = Some(ended);
        }
        Ok(None)
    }
}

#[pymethods]
impl Job {
    #[new]
    fn new(arguments: Vec<OsString>) -> PyResult<Self> {
        let (sender, events) = sync_channel(1);
        let stop = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&stop);
        let work = move || {
            let stop = Arc::clone(&asked);
            // The job was dropped: nobody wants its result.
            let tell = move |event| {
                if sender.send(event).is_err() {
                    asked.store(true, Ordering::Relaxed);
                }
            };
            embed::command(&arguments, Listener { tell: Box::new(tell), stop })
        };
        let thread = thread::Builder::new().name("glint".into()).spawn(work)?;
        Ok(Job { stop, running: Mutex::new(Some(Running { events, thread })), ended: Mutex::new(None) })
    }

    /// Waits for the next event, a tuple that begins with its kind; None once the command has ended.
    fn wait(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        loop {
            match py.detach(|| self.next()) {
                Ok(None) => return Ok(None),
                Ok(Some(Event::Note(text))) => return ("note", text).into_py_any(py).map(Some),
                Ok(Some(Event::Phase(Phase { name, unit, done, total }))) => {
                    return ("phase", name, unit, done, total).into_py_any(py).map(Some);
                }
                Ok(Some(Event::Step(Step { step, steps, lately, gaussians, seconds }))) => {
                    let [loss, psnr] = lately.map_or([None; 2], |both| both.map(Some));
                    return ("step", step, steps, loss, psnr, gaussians, seconds).into_py_any(py).map(Some);
                }
                Err(_) => py.check_signals()?,
            }
        }
    }

    /// Asks the command to end.
    fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Output of the ended command, and whether it was stopped.
    ///
    /// # Errors
    /// The command's failure.
    fn result(&self) -> Result<(String, bool), Failure> {
        match self.ended.lock().unwrap_or_else(|error| error.into_inner()).clone() {
            Some((printed, Ok(()))) => Ok((printed, false)),
            Some((printed, Err(Failed { code: STOPPED, .. }))) => Ok((printed, true)),
            Some((_, Err(failed))) => Err(failed.into()),
            None => Ok((String::new(), true)),
        }
    }
}

impl Drop for Job {
    fn drop(&mut self) {
        self.stop();
        let running = self.running.get_mut().unwrap_or_else(|error| error.into_inner()).take();
        if let Some(Running { events, thread }) = running {
            drop(events);
            // The command writes its scene and checkpoint first.
            Python::attach(|py| py.detach(|| drop(thread.join())));
        }
    }
}
