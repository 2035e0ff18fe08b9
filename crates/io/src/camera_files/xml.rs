//! OpenCV's FileStorage as XML.
//!
//! An element with child elements is a mapping, or a list where they are all called `_`; several words in an element are a list;
//! the attribute `type_id` adds nothing that rows, columns and data do not say.

use roxmltree::{Document, Node, ParsingOptions};
use yaml_rust2::Yaml;
use yaml_rust2::yaml::Hash;

use super::yaml::DEEPEST;

/// Largest number of elements. Camera files have some hundred.
const MOST_ELEMENTS: u32 = 100_000;

/// Whether a text is XML.
pub(super) fn is_one(text: &str) -> bool {
    text.trim_start().starts_with('<')
}

/// The mapping of the root element, `opencv_storage`.
pub(super) fn parse(text: &str) -> Result<Yaml, String> {
    let options = ParsingOptions { nodes_limit: MOST_ELEMENTS, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|e| format!("is no valid XML: {e}"))?;
    value(document.root_element(), 0)
}

fn value(element: Node<'_, '_>, depth: usize) -> Result<Yaml, String> {
    if depth > DEEPEST {
        return Err(format!("has more than {DEEPEST} elements in each other"));
    }
    let children: Vec<_> = element.children().filter(Node::is_element).collect();
    if children.is_empty() {
        return Ok(words(element));
    }
    if children.iter().all(|child| child.tag_name().name() == "_") {
        return Ok(Yaml::Array(children.into_iter().map(|child| value(child, depth + 1)).collect::<Result<_, _>>()?));
    }
    let mut mapping = Hash::new();
    for child in children {
        let name = child.tag_name().name();
        if mapping.insert(Yaml::String(name.to_owned()), value(child, depth + 1)?).is_some() {
            return Err(format!("has <{name}> twice: leave one of them out"));
        }
    }
    Ok(Yaml::Hash(mapping))
}

/// The words of an element; of its matrix `data` always a list.
fn words(element: Node<'_, '_>) -> Yaml {
    let text = element.text().unwrap_or_default().trim();
    let is_data = element.tag_name().name() == "data";
    if text.starts_with('"') {
        return Yaml::String(text.trim_matches('"').to_owned());
    }
    let words: Vec<Yaml> = text.split_whitespace().map(|word| Yaml::String(word.to_owned())).collect();
    match &words[..] {
        [] if !is_data => Yaml::Null,
        [word] if !is_data => word.clone(),
        _ => Yaml::Array(words),
    }
}
