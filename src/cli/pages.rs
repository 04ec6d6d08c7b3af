//! `glint completions` and `glint man`: files for a package of glint.

use std::{io, path::PathBuf};

use clap_complete::Shell;

use super::{
    Outcome, help,
    output::{Inputs, OutputArgs},
    print,
};
use crate::{Error, data::write_text};

/// Print a shell's completions for glint
#[derive(Debug, clap::Args)]
pub(super) struct CompletionsArgs {
    /// Shell; for bash: glint completions bash > ~/.local/share/bash-completion/completions/glint
    #[arg(value_enum)]
    shell: Shell,
}

/// Write glint's manual pages into a folder
#[derive(Debug, clap::Args)]
pub(super) struct ManArgs {
    /// Output folder for glint.1 and a page for each command; created if missing
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    #[command(flatten)]
    replace: OutputArgs,
}

impl CompletionsArgs {
    pub(super) fn run(&self) -> Outcome {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut help::command(), "glint", &mut script);
        Ok(print(String::from_utf8_lossy(&script))?)
    }
}

impl ManArgs {
    pub(super) fn run(&self) -> Outcome {
        let mut all = help::command();
        all.build();
        let pages: Vec<clap::Command> = std::iter::once(all.clone())
            .chain(all.get_subcommands().filter(|c| c.get_name() != "help").cloned())
            .collect();
        let name = |page: &clap::Command| match page.get_name() {
            "glint" => "glint.1".to_owned(),
            command => format!("glint-{command}.1"),
        };
        let names: Vec<String> = pages.iter().map(name).collect();
        self.replace.check_files(&self.folder, names.iter().map(String::as_str), &Inputs::default())?;
        self.replace.make_folder(&self.folder, &Inputs::default())?;
        for (page, name) in pages.into_iter().zip(&names) {
            let mut text = Vec::new();
            let path = self.folder.join(name);
            let title = name.trim_end_matches(".1").to_owned();
            clap_mangen::Man::new(page).title(title).render(&mut text).map_err(|e: io::Error| Error::io(&path, e))?;
            write_text(&path, &String::from_utf8_lossy(&text))?;
        }
        Ok(print(format_args!("{}: {} pages\n", self.folder.display(), names.len()))?)
    }
}
