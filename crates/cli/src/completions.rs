//! `completions`: scripts for shells.

use clap::Args;
use clap_complete::{Shell, generate};
use serde_json::Value;

use super::failure::Failure;
use super::voice::document;

/// Prints a script that completes commands and options in a shell.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal completions bash > ~/.local/share/bash-completion/completions/depthcal
  depthcal completions zsh > ~/.zfunc/_depthcal
  depthcal completions fish > ~/.config/fish/completions/depthcal.fish")]
pub(super) struct Completions {
    /// The shell.
    shell: Shell,
}

impl Completions {
    /// `command` is the whole command line.
    pub(super) fn run(&self, mut command: clap::Command) -> Result<Value, Failure> {
        let mut script = Vec::new();
        generate(self.shell, &mut command, "depthcal", &mut script);
        document(&script);
        Ok(Value::Null)
    }
}
