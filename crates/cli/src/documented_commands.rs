//! Every command line of the documents is one that the program takes.

use std::path::{Path, PathBuf};

use clap::error::ErrorKind;

use super::arguments::Arguments;

/// README.md and the pages of `docs/`.
fn documents() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let pages = std::fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let mut pages: Vec<PathBuf> = pages.filter(|path| path.extension().is_some_and(|e| e == "md")).collect();
    pages.push(root.join("README.md"));
    pages.sort();
    pages
}

/// A command line of a page, without the program's name.
struct Documented {
    command: String,
    /// Whether it is a line of a block. `code` within a sentence may leave out arguments that do not matter there.
    is_whole: bool,
}

/// Joins lines that end in a backslash to the next ones, as a shell does: the indentation of the block is not part of the text,
/// and further indentation separates words.
fn joined(page: &str) -> String {
    let mut lines = page.split("\\\n    ");
    let first = lines.next().unwrap_or_default().to_owned();
    lines.fold(first, |text, line| if text.ends_with(' ') { text + line.trim_start() } else { text + line })
}

/// Command lines in a page: of blocks, and of `code` that has options.
fn commands(page: &str) -> Vec<Documented> {
    let of_line = |line: &str| -> Vec<Documented> {
        let begins = ["depthcal ", "--example own_depth_model -- "].iter().find_map(|program| {
            let (before, command) = line.split_once(program)?;
            (before.trim().is_empty() || before.ends_with("| ") || before.contains("cargo run")).then_some(command)
        });
        if let Some(command) = begins.filter(|_| line.starts_with("    ") || line.starts_with("$ ")) {
            // In a Cargo.toml the name is followed by an equals sign.
            let command = (!command.starts_with('=')).then(|| command.to_owned());
            return command.into_iter().map(|command| Documented { command, is_whole: true }).collect();
        }
        let code = line.split('`').skip(1).step_by(2).filter_map(|code| code.strip_prefix("depthcal "));
        let code = code.filter(|code| code.contains(" --") && !code.contains("COMMAND"));
        code.map(|code| Documented { command: code.to_owned(), is_whole: false }).collect()
    };
    joined(page).lines().flat_map(of_line).collect()
}

/// The words of a command line up to a comment, a pipe or a file that the output goes to.
fn words(command: &str) -> Vec<String> {
    let command = ["   ", " #", " |", " >"].iter().fold(command, |text, end| text.split(end).next().unwrap_or(text));
    // Placeholders for numbers, kinds and names.
    command.split_whitespace().map(|word| if word == "N" { "1" } else { word }.replace("$k", "general1")).collect()
}

#[test]
fn every_command_line_of_the_documents_is_understood() {
    let mut count = 0;
    let mut refused = Vec::new();
    for path in documents() {
        let page = std::fs::read_to_string(&path).unwrap();
        for Documented { command, is_whole } in commands(&page) {
            let words = words(&command);
            let known = match words[0].as_str() {
                "import" => cfg!(feature = "import"),
                "live" => cfg!(feature = "live"),
                _ => cfg!(feature = "rerun") || !words.iter().any(|word| word == "--rrd"),
            };
            if !known {
                continue;
            }
            count += 1;
            match Arguments::parser().try_get_matches_from(std::iter::once("depthcal".to_owned()).chain(words)) {
                Err(error) if !is_whole && error.kind() == ErrorKind::MissingRequiredArgument => {}
                Err(error) if !matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
                    refused.push(format!("{}: depthcal {command}\n{error}", path.display()));
                }
                _ => {}
            }
        }
    }
    assert!(refused.is_empty(), "{}", refused.join("\n"));
    assert!(count > 40, "only {count} command lines were found");
}

#[test]
fn command_lines_are_found_in_every_form() {
    let page = "text `depthcal board --kind charuco --out b.pdf` and `depthcal apply`\n\n    depthcal compare a --models x,\\\n    y,z \\\n      --out b\n\
                \n    camera | depthcal apply c.json - --stream-output u16 | viewer\n    depthcal detect a/   # why\n\
                $ cargo run --release --example own_depth_model -- diagnose a/ --out b/\n";
    let lines: Vec<Vec<String>> = commands(page).iter().map(|documented| words(&documented.command)).collect();
    let expected = [
        "board --kind charuco --out b.pdf",
        "compare a --models x,y,z --out b",
        "apply c.json - --stream-output u16",
        "detect a/",
        "diagnose a/ --out b/",
    ];
    assert_eq!(lines.iter().map(|words| words.join(" ")).collect::<Vec<_>>(), expected);
}
