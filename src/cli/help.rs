//! Layout of the help: `-h` has the options of a first run, a line or two each; `--help` has all, under headings.

use clap::{Arg, Command, CommandFactory};

use super::Cli;

/// Headings with their options: those of `-h`, and those that only `--help` shows.
const SECTIONS: [(&str, &[&str], &[&str]); 4] = [
    (
        "Input",
        &[
            "base",
            "path",
            "frames",
            "max-size",
            "background",
            "holdout",
            "split",
            "history",
            "run",
            "photos",
            "views",
            "size",
            "quick",
        ],
        &["images", "model", "tune", "alpha", "part", "reduce", "init", "lenient"],
    ),
    (
        "Output",
        &[
            "output",
            "html",
            "what",
            "format",
            "force",
            "restart",
            "json",
            "compare",
            "lod",
            "base-only",
            "plan",
            "view",
            "eval-every",
        ],
        &["checkpoint-every", "spz-version", "lpips", "decomposition", "half", "resolution", "up"],
    ),
    (
        "Training",
        &["preset", "iterations", "time", "gaussians", "bytes", "ratio", "method", "sh-degree", "exposure"],
        &["total-bytes", "points", "strategy", "color", "halvings", "seed"],
    ),
    (
        "Device",
        &["device"],
        &["deterministic", "precision", "photos-on", "gaussians-on", "twin", "unchecked", "validate"],
    ),
];
/// Heading of all other options; only `--help` shows them.
const ADVANCED: &str = "Advanced";
/// Number of examples of `-h`.
const EXAMPLES: usize = 4;

/// The command line with its help laid out.
pub(super) fn command() -> Command {
    Cli::command().mut_subcommands(laid_out)
}

/// A command with its options in the order of the headings, as clap orders headings by their first option.
fn laid_out(command: Command) -> Command {
    let mut args: Vec<Arg> = command.get_arguments().cloned().map(placed).collect();
    args.sort_by_key(|arg| arg.get_help_heading().map(order));
    let mut new = Command::new(command.get_name().to_owned())
        .aliases(command.get_all_aliases().map(str::to_owned).collect::<Vec<_>>())
        .args(args)
        .groups(command.get_groups().cloned());
    if let Some(about) = command.get_about() {
        new = new.about(about.clone());
    }
    let Some(long) = command.get_after_help().map(ToString::to_string) else { return new };
    let examples =
        long.find("Examples:\n").map(|at| long[at..].lines().take(1 + EXAMPLES).take_while(|line| !line.is_empty()));
    let short: Vec<&str> = examples.into_iter().flatten().collect();
    new.after_help(short.join("\n")).after_long_help(long)
}

/// Place of a heading in the help.
fn order(heading: &str) -> usize {
    SECTIONS.iter().position(|(name, ..)| *name == heading).unwrap_or(SECTIONS.len())
}

/// An option under its heading, with the first sentence of its description for `-h`.
fn placed(arg: Arg) -> Arg {
    let Some(name) = arg.get_long().map(str::to_owned) else { return arg };
    let has = |names: &[&str]| names.contains(&name.as_str());
    let section = SECTIONS.iter().find(|(_, first, others)| has(first) || has(others));
    let heading = section.map_or(ADVANCED, |(heading, ..)| heading);
    let in_short = section.is_some_and(|(_, first, _)| has(first));
    let long = arg.get_help().map(ToString::to_string).unwrap_or_default();
    let end = [". ", "; ", " [default"].iter().filter_map(|mark| long.find(mark)).min().unwrap_or(long.len());
    let arg = arg.help(long[..end].to_owned()).help_heading(heading).hide_short_help(!in_short);
    arg.long_help(long)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_short_help_of_every_command_fits_a_screen() {
        let mut all = command().term_width(100);
        all.build();
        for command in all.get_subcommands_mut() {
            let short = command.render_help().to_string();
            assert!(short.lines().count() <= 45, "{short}");
            let long = command.render_long_help().to_string();
            for arg in command.get_arguments().filter(|arg| !arg.is_hide_set()) {
                let name = arg.get_long().unwrap_or_default();
                assert!(long.contains(name), "--{name} is not in: {long}");
            }
        }
        // No name of a heading is out of date.
        let has = |name: &str| all.get_subcommands().any(|c| c.get_arguments().any(|arg| arg.get_long() == Some(name)));
        for name in SECTIONS.iter().flat_map(|(_, first, others)| first.iter().chain(*others)) {
            assert!(has(name), "no command has --{name}");
        }
        let train = all.find_subcommand_mut("train").unwrap().render_long_help().to_string();
        let headings: Vec<&str> = train.lines().filter(|line| line.ends_with(':') && !line.starts_with(' ')).collect();
        let expected =
            ["Arguments:", "Options:", "Input:", "Output:", "Training:", "Device:", "Advanced:", "Examples:"];
        assert_eq!(headings, expected);
    }
}
