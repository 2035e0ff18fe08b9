//! `man`: manual pages.

use std::path::PathBuf;

use clap::Args;
use clap_mangen::Man;
use depthcal_io::write_atomically;
use serde_json::{Value, json};

use super::failure::{Failure, input};
use super::voice::{document, say};
use depthcal_report::format::count;

/// Prints the manual page, or writes one for every command into a folder.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal man | man -l -
  depthcal man --out ~/.local/share/man/man1")]
pub(super) struct ManPage {
    /// Folder for the pages of all commands [default: the main page, to standard output].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl ManPage {
    /// `command` is the whole command line.
    pub(super) fn run(&self, mut command: clap::Command) -> Result<Value, Failure> {
        command.build();
        let page = |command: clap::Command| -> Result<Vec<u8>, Failure> {
            let mut text = Vec::new();
            Man::new(command).render(&mut text).map_err(input)?;
            Ok(text)
        };
        let Some(out) = &self.out else {
            document(&page(command)?);
            return Ok(Value::Null);
        };
        let mut written = Vec::new();
        let all = command.get_subcommands().filter(|c| c.get_name() != "help").cloned().collect::<Vec<_>>();
        for command in std::iter::once(command).chain(all) {
            let name = command.get_display_name().unwrap_or("depthcal").to_owned();
            let path = out.join(format!("{name}.1"));
            let text = page(command)?;
            write_atomically(&path, |file| file.write_all(&text)).map_err(input)?;
            written.push(path);
        }
        say!("{} written: {}", count(written.len(), "page"), out.display());
        Ok(json!({ "written": written }))
    }
}
