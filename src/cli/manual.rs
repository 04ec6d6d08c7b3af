//! Makes docs/cli.md of the commands and their options.

use std::{
    env,
    fmt::Write,
    fs,
    path::{Path, PathBuf},
};

use clap::{Arg, Command, CommandFactory, Parser, error::ErrorKind};

use super::Cli;

const HEAD: &str = "\
# Command line

<!-- Generated; after a change of an option: GLINT_WRITE_CLI=1 cargo test --lib manual -->

`glint COMMAND -h` prints a summary, `glint COMMAND --help` all options with examples. Results go to stdout, progress and notes to stderr. \
Options stand before or after arguments, as `--option VALUE` or `--option=VALUE`.

| exit code | meaning |
|---|---|
| 0 | success |
| 1 | machine: device, driver, memory, disk; a broken bound of `verify`; `doctor` on a machine that cannot train |
| 2 | bad input or usage |
| 130 | interrupted; partial results are saved |

| variable | effect |
|---|---|
| `GLINT_DEVICE` | default of `--device` |
| `GLINT_MEMORY_BUDGET` | device memory in bytes that glint may use, if less than the device has |
| `GLINT_VALIDATION` | turns on Vulkan's validation layers, like `--validate` |
| `RUST_LOG` | overrides `-v` |
| `XDG_CACHE_HOME` | folder with the list of checked devices, `glint/checked` |
| `GLINT_SUBGROUP_SIZE`, `GLINT_SOFTWARE_SUBGROUPS`, `GLINT_LOST_AFTER` | for tests: lanes of a subgroup; subgroups through shared \
memory; submissions after which the device is lost |
";

/// Options of more than one command with equal descriptions, each with its commands.
struct Shared<'a>(Vec<(&'a Arg, Vec<&'a str>)>);

impl<'a> Shared<'a> {
    fn of(commands: &[&'a Command]) -> Self {
        let mut found: Vec<(&Arg, Vec<&str>)> = Vec::new();
        for &command in commands {
            for arg in listed(command).filter(|arg| !arg.is_positional()) {
                match found.iter_mut().find(|(other, _)| row(other) == row(arg)) {
                    Some((_, names)) => names.push(command.get_name()),
                    None => found.push((arg, vec![command.get_name()])),
                }
            }
        }
        found.retain(|(_, names)| names.len() > 1);
        Shared(found)
    }

    fn has(&self, arg: &Arg) -> bool {
        self.0.iter().any(|(other, _)| row(other) == row(arg))
    }
}

/// Arguments and options of a command, but for `--help`.
fn listed(command: &Command) -> impl Iterator<Item = &Arg> {
    command.get_arguments().filter(|arg| arg.get_id() != "help")
}

/// `-o`, `--output PLY`
fn label(arg: &Arg) -> String {
    let names =
        arg.get_value_names().unwrap_or_default().iter().map(|name| name.as_str()).collect::<Vec<_>>().join(" ");
    let Some(long) = arg.get_long() else { return format!("`{names}`") };
    let short = arg.get_short().map(|short| format!("`-{short}`, ")).unwrap_or_default();
    match arg.get_action().takes_values() {
        true if arg.is_require_equals_set() => format!("{short}`--{long}[={names}]`"),
        true => format!("{short}`--{long} {names}`"),
        false => format!("{short}`--{long}`"),
    }
}

/// Description and default.
fn row(arg: &Arg) -> [String; 3] {
    let help = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
    let mut text = help.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|");
    let mut default = String::new();
    if arg.get_action().takes_values() {
        let values: Vec<String> = arg
            .get_possible_values()
            .iter()
            .filter(|v| !v.is_hide_set())
            .map(|v| format!("`{}`", v.get_name()))
            .collect();
        if !values.is_empty() && !arg.is_require_equals_set() {
            text += &format!(": {}", values.join(", "));
        }
        default = arg.get_default_values().iter().map(|value| value.to_string_lossy()).collect::<Vec<_>>().join(" ");
    }
    if let Some(aliases) = arg.get_all_aliases().filter(|aliases| !aliases.is_empty()) {
        text += &format!(" (also `--{}`)", aliases.join("`, `--"));
    }
    [label(arg).replace('|', "\\|"), default, text]
}

fn page() -> String {
    let mut glint = Cli::command();
    glint.build();
    let commands: Vec<&Command> = glint.get_subcommands().filter(|command| command.get_name() != "help").collect();
    let shared = Shared::of(&commands);
    let mut text = HEAD.to_owned();
    text += "\n## Options of several commands\n\n| option | default | description | commands |\n|---|---|---|---|\n";
    for (arg, names) in &shared.0 {
        let [label, default, help] = row(arg);
        let names = if names.len() == commands.len() { "all".to_owned() } else { names.join(", ") };
        let _ = writeln!(text, "| {label} | {default} | {help} | {names} |");
    }
    for command in commands {
        let usage = command.clone().render_usage().to_string();
        let usage = usage.trim_start_matches("Usage: ").replace("\n       ", "\n    ");
        let about = command.get_about().map(ToString::to_string).unwrap_or_default();
        let _ = write!(text, "\n## glint {}\n\n{about}.\n\n    {usage}\n", command.get_name());
        let mut head = "\n| option | default | description |\n|---|---|---|\n";
        for arg in listed(command).filter(|arg| !shared.has(arg)) {
            let [label, default, help] = row(arg);
            let _ = writeln!(text, "{head}| {label} | {default} | {help} |");
            head = "";
        }
        let others: Vec<String> = shared
            .0
            .iter()
            .filter(|(_, names)| names.contains(&command.get_name()))
            .filter_map(|(arg, _)| Some(format!("`--{}`", arg.get_long()?)))
            .collect();
        let _ = writeln!(text, "\nAlso: {}", others.join(", "));
    }
    text
}

#[test]
fn the_page_of_the_command_line_is_what_the_program_says() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/cli.md");
    let page = page();
    if env::var_os("GLINT_WRITE_CLI").is_some() {
        fs::write(&path, &page).unwrap();
    }
    assert!(page == fs::read_to_string(&path).unwrap_or_default(), "run GLINT_WRITE_CLI=1 cargo test --lib manual");
    assert!(page.lines().count() <= 400);
    // Every variable that the library reads.
    let source = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/gpu/context.rs")).unwrap();
    let names = source.split("\"GLINT_").skip(1).filter_map(|rest| rest.split('"').next());
    let missing: Vec<&str> = names.filter(|name| !page.contains(&format!("`GLINT_{name}`"))).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// Checks the commands of a line of code in `page`. Those that are not `whole` may lack arguments and values.
fn check_commands(page: &str, code: &str, whole: bool) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let code = code.split(" # ").next().unwrap_or_default();
    let words: Vec<&str> = code.split_whitespace().collect();
    for word in words.iter().filter(|word| ["tools/", "bench/", ".ci/"].iter().any(|folder| word.starts_with(folder))) {
        // Benchmarks are named without their ending; capitals stand for something else.
        let is_there = root.join(word).exists() || root.join(word).with_extension("rs").exists();
        assert!(
            is_there || word.contains(['*', '…']) || word.contains(char::is_uppercase),
            "{page}: {word} is missing"
        );
    }
    for pair in words.windows(2).filter(|pair| ["--bench", "--test"].contains(&pair[0])) {
        let folder = root.join(if pair[0] == "--bench" { "bench" } else { "tests" });
        let found = folder.join(pair[1]).exists() || folder.join(pair[1]).with_extension("rs").exists();
        assert!(found, "{page}: there is no {} {}", pair[0], pair[1]);
    }
    for command in code.split([';', '|', '>', '&']) {
        let command = command.trim().trim_start_matches("do ").trim_start_matches("target/release/");
        let is_sketch = ["…", "...", "[", "COMMAND"].iter().any(|mark| command.contains(mark));
        if !command.starts_with("glint ") || is_sketch {
            continue;
        }
        // A shell's variable stands for a number.
        let number = |word: &str| {
            word.split_once('$').map_or(word.to_owned(), |(before, after)| {
                before.to_owned() + "8" + after.trim_start_matches(|c: char| c.is_alphanumeric())
            })
        };
        let Err(error) = Cli::try_parse_from(command.split_whitespace().map(number)) else { continue };
        let wrong = match error.kind() {
            ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => false,
            ErrorKind::UnknownArgument | ErrorKind::InvalidSubcommand | ErrorKind::ArgumentConflict => true,
            _ => whole,
        };
        assert!(!wrong, "{page}: {command}: {error}");
    }
}

/// Command lines of the documents and of the help are valid; JSON in the documents is.
#[test]
fn command_lines_of_documents_are_valid() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut pages: Vec<PathBuf> = ["README.md", "CONTRIBUTING.md", "SECURITY.md"].map(|name| root.join(name)).into();
    pages.extend(fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path()));
    pages.retain(|path| path.extension().is_some_and(|extension| extension == "md"));
    assert!(pages.len() > 15);
    for page in pages {
        let name = page.display().to_string();
        let text = fs::read_to_string(&page).unwrap().replace("\\\n", " ");
        for line in text.lines() {
            if let Some(code) = line.strip_prefix("    ") {
                check_commands(&name, code, true);
            } else if line.matches('`').count() % 2 == 0 {
                line.split('`').skip(1).step_by(2).for_each(|code| check_commands(&name, code, false));
            }
        }
        for json in text.split("```json").skip(1).filter_map(|rest| rest.split("```").next()) {
            serde_json::from_str::<serde_json::Value>(&format!("{{{json}}}"))
                .unwrap_or_else(|error| panic!("{name}: {error}: {json}"));
        }
    }
    let mut glint = Cli::command();
    glint.build();
    for command in glint.get_subcommands().chain([&glint]) {
        let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
        for line in help.lines().filter_map(|line| line.strip_prefix("  ")) {
            // A description follows after two spaces.
            check_commands(command.get_name(), line.split("  ").next().unwrap_or_default(), true);
        }
    }
}
