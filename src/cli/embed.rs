//! Runs commands for a program that links glint. Progress, notes and reports go to that program instead of
//! stdout and stderr. A flag stops a command instead of a signal, and a panic becomes an error.

use std::{any::Any, ffi::OsString, path::PathBuf};

use clap::{Arg, ArgAction, CommandFactory, Parser};

pub use super::caller::{Event, Listener, Phase, Step};
use super::{
    Cli, DeviceArgs, Outcome, SceneArgs,
    caller::{self, Stopped},
    check,
    convert::SaveArgs,
    dataset::PhotoArgs,
    interrupt,
    output::Inputs,
    run, told,
};
use crate::{
    data::{Dataset, SceneFile},
    gpu::Context,
};

/// Error of a command.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failed {
    /// Message of one line, as the command line prints it.
    pub text: String,
    /// Exit code of the command line: 2 for bad input, 1 for the machine, [`STOPPED`] after a requested
    /// stop.
    pub code: u8,
}

/// [`Failed::code`] of a command that was stopped on request.
pub const STOPPED: u8 = interrupt::EXIT_CODE;

/// Runs a command, given as on the command line without the program's name. Returns the printed text, even
/// on an error, and the result.
pub fn command(arguments: &[OsString], listener: Listener) -> (String, Result<(), Failed>) {
    let (printed, result) = with(listener, || {
        let name = OsString::from("glint");
        Ok(Cli::try_parse_from(std::iter::once(&name).chain(arguments))).map(|cli| cli.map(|cli| run(&cli.command)))
    });
    (printed, result.and_then(|parsed| parsed.map_err(unparsed)?.map_err(failed)))
}

/// Reads a scene. `arguments` are its path and the options for reading.
///
/// # Errors
/// Those of the command line.
pub fn load(arguments: &[OsString], listener: Listener) -> Result<SceneFile, Failed> {
    parsed(arguments, listener, |LoadArgs { scene, lenient }| Ok(lenient.open_file(&scene)?))
}

/// Writes a scene. `arguments` are its path and the options for writing.
///
/// # Errors
/// Those of the command line.
pub fn save(arguments: &[OsString], file: SceneFile, listener: Listener) -> Result<(), Failed> {
    parsed(arguments, listener, |WriteArgs { output, save }| {
        save.prepare(&output, file, &Inputs::default())?.write(&output)?;
        Ok(())
    })
}

/// Reads a dataset without its pixels. `arguments` are its path and the options for reading photos.
///
/// # Errors
/// Those of the command line.
pub fn dataset(arguments: &[OsString], listener: Listener) -> Result<Dataset, Failed> {
    parsed(arguments, listener, |DatasetArgs { dataset, photos }| Ok(photos.open(&dataset)?))
}

/// Opens and checks a device, like the commands do. `arguments` are device options.
///
/// # Errors
/// Those of the command line.
pub fn device(arguments: &[OsString], listener: Listener) -> Result<Context, Failed> {
    parsed(arguments, listener, |OpenArgs { device }| {
        let options = device.options();
        let context = Context::new(&options).map_err(|error| device.explain(&options, error))?;
        check::check(&context, &options, device.unchecked)?;
        Ok(context)
    })
}

#[derive(Parser)]
#[command(no_binary_name = true)]
struct LoadArgs {
    /// Input scene; its contents decide the format
    scene: PathBuf,
    #[command(flatten)]
    lenient: SceneArgs,
}

#[derive(Parser)]
#[command(no_binary_name = true)]
struct WriteArgs {
    /// Output file; its ending decides the format
    output: PathBuf,
    #[command(flatten)]
    save: SaveArgs,
}

#[derive(Parser)]
#[command(no_binary_name = true)]
struct DatasetArgs {
    /// Folder or JSON file of the dataset
    dataset: PathBuf,
    #[command(flatten)]
    photos: PhotoArgs,
}

#[derive(Parser)]
#[command(no_binary_name = true)]
struct OpenArgs {
    #[command(flatten)]
    device: DeviceArgs,
}

/// Option of a command.
#[derive(Debug, Clone)]
pub struct Opt {
    /// Name without dashes.
    pub name: String,
    /// Help text.
    pub help: String,
    /// Whether it takes a value.
    pub takes_value: bool,
    /// Whether it may be given several times.
    pub repeats: bool,
    /// Default value.
    pub default: Option<String>,
    /// Names of its values, if it has such.
    pub names: Vec<String>,
}

/// Options of a command, or of [`load`], [`save`], [`dataset`] or [`device`]; empty for any other name.
pub fn options(command: &str) -> Vec<Opt> {
    let command = match command {
        "load" => LoadArgs::command(),
        "save" => WriteArgs::command(),
        "dataset" => DatasetArgs::command(),
        "device" => OpenArgs::command(),
        name => Cli::command().find_subcommand(name).cloned().unwrap_or_default(),
    };
    command.get_arguments().filter(|argument| !argument.is_hide_set()).filter_map(option).collect()
}

fn option(argument: &Arg) -> Option<Opt> {
    let text = |text: &std::ffi::OsStr| text.to_string_lossy().into_owned();
    Some(Opt {
        name: argument.get_long()?.to_owned(),
        help: argument.get_help().map(ToString::to_string).unwrap_or_default(),
        takes_value: argument.get_action().takes_values(),
        repeats: matches!(argument.get_action(), ArgAction::Append),
        default: argument
            .get_default_values()
            .first()
            .filter(|_| !argument.is_hide_default_value_set())
            .map(|v| text(v)),
        names: argument.get_possible_values().iter().map(|value| value.get_name().to_owned()).collect(),
    })
}

/// Parses `arguments` and does `work` with them.
fn parsed<A: Parser, T>(
    arguments: &[OsString],
    listener: Listener,
    work: impl FnOnce(A) -> Outcome<T>,
) -> Result<T, Failed> {
    let arguments = A::try_parse_from(arguments).map_err(unparsed)?;
    with(listener, || Ok(work(arguments))).1?.map_err(failed)
}

/// Does `work` with a listener on this thread. Returns the printed text and the result.
fn with<T>(listener: Listener, work: impl FnOnce() -> Result<T, Failed>) -> (String, Result<T, Failed>) {
    let (printed, result) = caller::hear(listener, work);
    (printed, result.unwrap_or_else(|panic| Err(unwound(&*panic))))
}

fn failed(failure: super::Failure) -> Failed {
    let (text, code) = told(failure);
    Failed { text, code }
}

/// Message without clap's advice for a shell.
fn unparsed(error: clap::Error) -> Failed {
    let text = error.render().to_string();
    let end = ["\n\nUsage", "\n\nFor more"].into_iter().filter_map(|start| text.find(start)).min();
    let text = text[..end.unwrap_or(text.len())].trim_start_matches("error: ").trim();
    Failed { text: text.to_owned(), code: 2 }
}

fn unwound(panic: &(dyn Any + Send)) -> Failed {
    if panic.is::<Stopped>() {
        return Failed { text: "stopped before anything was done".into(), code: STOPPED };
    }
    let said = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    Failed { text: format!("a fault in glint: {}", said.unwrap_or("unknown")), code: 1 }
}

#[cfg(test)]
mod tests {
    use std::{cell::RefCell, rc::Rc, sync::Arc};

    use super::{super::caller::*, *};

    fn listener(stop: bool) -> Listener {
        Listener { tell: Box::new(|_| {}), stop: Arc::new(stop.into()) }
    }

    const PHASE: Phase = Phase { name: "reading", unit: "photos", done: 1, total: 2 };

    #[test]
    fn errors_are_the_command_line_s_without_its_advice_for_a_shell() {
        let run = |arguments: &[&str]| {
            let arguments: Vec<OsString> = arguments.iter().map(Into::into).collect();
            command(&arguments, listener(false))
        };
        let (printed, result) = run(&["train", "photos"]);
        let text = "the following required arguments were not provided:\n  --output <PLY>".to_owned();
        assert_eq!((printed.as_str(), result), ("", Err(Failed { text, code: 2 })));
        let failed = run(&["convert", "nothing.ply", "out.spz"]).1.unwrap_err();
        assert!(failed.code == 2 && failed.text.starts_with("nothing.ply: "), "{failed:?}");
    }

    #[test]
    fn events_go_to_the_listener_while_its_work_runs() {
        let found = Rc::new(RefCell::new(Vec::new()));
        let into = Rc::clone(&found);
        let tell = Box::new(move |event| into.borrow_mut().push(event));
        let (printed, result) = with(Listener { tell, stop: Arc::default() }, || {
            note("a note".into());
            phase(PHASE);
            print("{}");
            Ok(is_embedded())
        });
        assert_eq!((printed.as_str(), result), ("{}", Ok(true)));
        assert_eq!(found.take(), [Event::Note("a note".into()), Event::Phase(PHASE)]);
        assert!(!is_embedded());
    }

    #[test]
    fn an_end_that_is_asked_for_waits_for_a_loop_that_listens() {
        let ended = with(listener(true), || {
            phase(PHASE);
            Ok(())
        });
        assert_eq!(ended.1.unwrap_err().code, STOPPED);
        let (_, seen) = with(listener(true), || {
            assert!(listen(true));
            phase(PHASE);
            Ok(asked())
        });
        assert_eq!(seen, Ok(true));
        assert!(!asked() && !listen(true));
    }

    #[test]
    fn a_panic_is_an_error() {
        let (_, result) = with(listener(false), || -> Result<(), Failed> { panic!("of {}", 7) });
        assert_eq!(result, Err(Failed { text: "a fault in glint: of 7".into(), code: 1 }));
    }

    #[test]
    fn options_are_those_of_the_command_line() {
        let find = |command, name: &str| options(command).into_iter().find(|option| option.name == name);
        let device = find("device", "device").unwrap();
        assert!(device.takes_value && !device.repeats && !device.help.is_empty());
        let strategy = find("train", "strategy").unwrap();
        assert_eq!(strategy.default.as_deref(), Some("budget"));
        assert_eq!(strategy.names, ["fixed", "mcmc", "adc", "budget"]);
        assert!(find("train", "twin").unwrap().repeats);
        assert!(!find("load", "lenient").unwrap().takes_value);
        assert!(options("nothing").is_empty());
    }
}
