use std::io::{Write, stdout};

use clap::{Args, CommandFactory};
use clap_complete::{Shell, generate};
use serde_json::Value;

use super::common::Failure;

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
    pub(super) fn run(&self) -> Result<Value, Failure> {
        let mut script = Vec::new();
        generate(self.shell, &mut super::Arguments::command(), "depthcal", &mut script);
        let _ = stdout().write_all(&script);
        Ok(Value::Null)
    }
}
