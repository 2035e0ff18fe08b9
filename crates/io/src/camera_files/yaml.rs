//! YAML of any dialect: OpenCV's directive, anchors and aliases, streams of several documents.

use std::collections::HashMap;

use yaml_rust2::parser::{Event, Parser};
use yaml_rust2::{Yaml, YamlLoader};

/// Largest depth of lists and mappings in each other. Camera files have six; the parser's stack would not stand thousands.
pub(super) const DEEPEST: usize = 32;
/// Largest number of values after aliases are written out. Camera files have some hundred.
const MOST_VALUES: usize = 1_000_000;

/// Size of a part of a document, its aliases written out.
#[derive(Clone, Copy, Default)]
struct Extent {
    values: usize,
    depth: usize,
}

impl Extent {
    fn add(&mut self, part: Self) {
        self.values = self.values.saturating_add(part.values);
        self.depth = self.depth.max(part.depth + 1);
    }
}

/// Refuses what the loader takes on trust: depth, which it walks by recursion, and aliases, a few of which in each other are more
/// than any memory holds.
fn check_structure(body: &str) -> Result<(), String> {
    let mut parser = Parser::new_from_str(body);
    let mut anchors: HashMap<usize, Extent> = HashMap::new();
    // Lists and mappings that are open, with their anchors; the first is the document.
    let mut open = vec![(0, Extent::default())];
    loop {
        let (event, mark) = parser.next_token().map_err(|e| format!("is no valid YAML: {e}"))?;
        let closed = match event {
            Event::SequenceStart(anchor, _) | Event::MappingStart(anchor, _) => {
                open.push((anchor, Extent::default()));
                None
            }
            Event::SequenceEnd | Event::MappingEnd => open.pop(),
            Event::Scalar(_, _, anchor, _) => Some((anchor, Extent { values: 1, depth: 0 })),
            Event::Alias(anchor) => Some((0, anchors.get(&anchor).copied().unwrap_or_default())),
            Event::StreamEnd => return Ok(()),
            _ => None,
        };
        if let Some((anchor, extent)) = closed {
            if anchor > 0 {
                anchors.insert(anchor, extent);
            }
            if let Some((_, outer)) = open.last_mut() {
                outer.add(extent);
            }
        }
        let line = mark.line();
        let depth = open.len() + open.last().map_or(0, |(_, extent)| extent.depth);
        if depth > DEEPEST + 2 {
            return Err(format!("line {line}: has more than {DEEPEST} lists or mappings in each other"));
        }
        if open.iter().any(|(_, extent)| extent.values > MOST_VALUES) {
            return Err(format!(
                "line {line}: has more than {MOST_VALUES} values, its aliases (*NAME) written out, which is no camera"
            ));
        }
    }
}

/// The first document of a text. OpenCV's directive `%YAML:1.0`, which is no valid one, is left out, as are the documents that
/// follow: `rostopic echo` writes one for every message, and may be interrupted in any of them.
pub(super) fn parse(text: &str) -> Result<Yaml, String> {
    let mut body = String::with_capacity(text.len());
    let mut is_empty = true;
    for line in text.lines() {
        let is_directive = line.starts_with('%') && is_empty;
        if line.trim_end() == "---" && !is_empty {
            break;
        }
        if !is_directive && line.trim_end() != "---" {
            is_empty &= line.trim_start().is_empty() || line.trim_start().starts_with('#');
            body.push_str(line);
        }
        body.push('\n');
    }
    check_structure(&body)?;
    let documents = YamlLoader::load_from_str(&body).map_err(|e| format!("is no valid YAML: {e}"))?;
    documents.into_iter().next().ok_or_else(|| "is empty".to_owned())
}
