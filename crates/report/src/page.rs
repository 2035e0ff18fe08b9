//! The page: template, style sheet, scripts and content put together.

use std::io::Write;
use std::sync::OnceLock;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde_json::Value;

use super::content::Content;
use super::html::{escape, script_json};
use super::input::ReportError;

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// The script of plotly.js that the plotting library carries; its formula renderer, two megabytes more, is not needed.
fn library() -> Option<String> {
    let sources = plotly::Plot::offline_js_sources();
    let (first, _) = sources.split_once("</script>")?;
    let (_, script) = first.split_once('>')?;
    (!script.trim().is_empty()).then(|| script.to_owned())
}

/// Level of the compression: the page is 3 % longer than at the usual one, which takes twice as long.
const LEVEL: Compression = Compression::new(4);

/// Packs what every page carries, in a thread of its own: it takes as long as a small fit. The first page packs it where there
/// can be no thread.
pub fn prepare_pages() {
    let _thread = std::thread::Builder::new().spawn(packed_library);
}

/// The library as the page carries it, which is less than half as long: compressed (zlib), in base 64. Packed once per process.
fn packed_library() -> Option<&'static str> {
    static PACKED: OnceLock<Option<String>> = OnceLock::new();
    let pack = || {
        let mut encoder = ZlibEncoder::new(Vec::new(), LEVEL);
        encoder.write_all(library()?.as_bytes()).ok()?;
        Some(base64(&encoder.finish().ok()?))
    };
    PACKED.get_or_init(pack).as_deref()
}

/// Bytes in base 64 (RFC 4648).
pub(super) fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    let quad = |bytes: [u8; 3]| {
        let bits = u32::from(bytes[0]) << 16 | u32::from(bytes[1]) << 8 | u32::from(bytes[2]);
        [18, 12, 6, 0].map(|shift| char::from(DIGITS[(bits >> shift & 63) as usize]))
    };
    let (whole, remainder) = bytes.as_chunks::<3>();
    text.extend(whole.iter().flat_map(|chunk| quad(*chunk)));
    if !remainder.is_empty() {
        let last = quad([remainder[0], remainder.get(1).copied().unwrap_or(0), 0]);
        text.extend(&last[..=remainder.len()]);
        text.extend(std::iter::repeat_n('=', 3 - remainder.len()));
    }
    text
}

/// The whole file: the template filled with a title, how the page was made (HTML), and content.
pub(super) fn render(title: &str, made: &str, content: &Content) -> Result<String, ReportError> {
    let library = packed_library().ok_or(ReportError::NoScript)?;
    let title = if title.trim().is_empty() { "Calibration report" } else { title.trim() };
    let figures = script_json(&Value::Array(content.figures.clone()));
    let escaped = escape(title);
    // One pass over the template, so that nothing inside the content can be taken for a placeholder.
    let fill = |name: &str| -> &str {
        match name {
            "title" => &escaped,
            "style" => STYLE,
            "made" => made,
            "navigation" => &content.navigation,
            "body" => &content.body,
            "library" => library,
            "figures" => &figures,
            "script" => SCRIPT,
            "version" => env!("CARGO_PKG_VERSION"),
            _ => "",
        }
    };
    let mut out = String::with_capacity(library.len() + figures.len() + content.body.len() + 64_000);
    let mut unfilled = TEMPLATE;
    while let Some((before, after)) = unfilled.split_once("{{") {
        out.push_str(before);
        let (name, after) = after.split_once("}}").unwrap_or((after, ""));
        out.push_str(fill(name.trim()));
        unfilled = after;
    }
    out.push_str(unfilled);
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of RFC 4648.
    #[test]
    fn base_64_is_that_of_the_standard() {
        let examples =
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("fooba", "Zm9vYmE=")];
        for (bytes, text) in examples {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
        assert_eq!(base64(&[0xfb, 0xff]), "+/8=");
    }
}
