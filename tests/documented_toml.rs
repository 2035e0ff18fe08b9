//! Every dataset.toml and every effect in the documents is one that the program reads.

use std::path::Path;

use depthcal::formula::FormulaFile;
use depthcal::io::DatasetFile;

/// The indented blocks of a page, without their indentation.
fn blocks(page: &str) -> Vec<String> {
    let mut blocks = Vec::new();
    let mut block: Vec<&str> = Vec::new();
    for line in page.lines().chain(["end"]) {
        match line.trim_start().is_empty() || line.starts_with("    ") {
            true => block.push(line),
            false if block.iter().any(|line| !line.is_empty()) => {
                let lines = block.iter().filter(|line| !line.trim().is_empty());
                let indent = lines.map(|line| line.len() - line.trim_start().len()).min().unwrap_or(0);
                blocks
                    .push(block.drain(..).map(|line| line.get(indent..).unwrap_or("")).collect::<Vec<_>>().join("\n"));
            }
            false => block.clear(),
        }
    }
    blocks
}

/// The TOML in blocks of README.md and of the pages of `docs/`, with the names of their pages: from the first table on.
fn tables() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let pages = std::fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let pages = pages.filter(|path| path.extension().is_some_and(|e| e == "md")).chain([root.join("README.md")]);
    let mut tables = Vec::new();
    for path in pages {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        for block in blocks(&std::fs::read_to_string(&path).unwrap()) {
            let lines = block.lines().skip_while(|line| !KINDS.iter().any(|kind| line.starts_with(kind)));
            let toml: Vec<&str> = lines.collect();
            if !toml.is_empty() {
                tables.push((name.clone(), toml.join("\n")));
            }
        }
    }
    tables
}

/// Beginnings of the first table of a dataset or an effect.
const KINDS: [&str; 5] = ["[board", "[frames", "[depth]", "[camera", "[[effect]]"];

/// The parts of a dataset that a page leaves to the reader.
fn completed(text: &str) -> String {
    let mut text = text.to_owned();
    if !text.contains("[board]") && !text.contains("[boards.") {
        text.push_str("\n[board]\nkind = \"chessboard\"\ncolumns = 9\nrows = 6\nspacing_mm = 25.0\n");
    }
    if !text.contains("[frames]") && !text.contains("[cameras.") {
        text.push_str("\n[frames]\nimage = \"image/*.png\"\n");
    }
    text
}

#[test]
fn datasets_and_effects_of_the_documents_are_read() {
    let (mut datasets, mut effects) = (0, 0);
    for (page, text) in tables() {
        if text.starts_with("[[effect]]") {
            FormulaFile::parse(&text).unwrap_or_else(|error| panic!("{page}: {error}\n{text}"));
            effects += 1;
            continue;
        }
        let text = completed(&text);
        let path = Path::new("dataset.toml");
        DatasetFile::parse(path, &text).unwrap_or_else(|error| panic!("{page}: {error}\n{text}"));
        datasets += 1;
    }
    assert!(datasets >= 4 && effects >= 1, "{datasets} datasets and {effects} effects were found");
}
