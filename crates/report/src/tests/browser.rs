//! The report in a real browser.

#[path = "../../../../tests/support/measured.rs"]
mod data;

use std::path::{Path, PathBuf};
use std::process::Command;

use depthcal_simulate::Effect;

use super::fixture::Fixture;

/// The browser, where there is one.
fn chromium() -> Option<PathBuf> {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let browser = ["chromium", "chromium-browser", "google-chrome"]
        .iter()
        .flat_map(|name| std::env::split_paths(&path).map(move |folder| folder.join(name)))
        .find(|candidate| candidate.is_file());
    named.or(browser)
}

/// Runs the browser on a page; gives what it wrote to standard output and to its log.
fn browse(chromium: &Path, page: &Path, extra: &[&str]) -> (String, String) {
    let profile = tempfile::tempdir().unwrap();
    let output = Command::new(chromium)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
        .args(["--enable-unsafe-swiftshader", "--enable-logging=stderr", "--virtual-time-budget=30000"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .args(extra)
        .arg(format!("file://{}", page.display()))
        .output()
        .unwrap();
    (String::from_utf8_lossy(&output.stdout).into_owned(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Complaints of the page itself: not the browser's remarks about its machine.
fn complaints(log: &str) -> Vec<&str> {
    let is_page = |l: &&str| l.contains("CONSOLE") || l.contains("Content Security Policy") || l.contains("Uncaught");
    // Hints on speed are not errors: drawing in three dimensions without a graphics card is slow and says so.
    let is_hint = |l: &&str| ["GPU stall", "software WebGL", "willReadFrequently"].iter().any(|h| l.contains(h));
    log.lines().filter(is_page).filter(|l| !is_hint(l)).collect()
}

/// The browser draws every figure of a page without complaint, and `named` ones are not empty.
fn draws(chromium: &Path, page: &Path, html: &str, named: &[&str]) {
    let (dom, log) = browse(chromium, page, &["--dump-dom", "--window-size=1280,900"]);
    assert!(complaints(&log).is_empty(), "{:#?}", complaints(&log));
    assert!(dom.contains("data-ready=\"true\""), "the script did not finish:\n{log}");
    let classes = ["class=\"plot js-plotly-plot\"", "class=\"plot map js-plotly-plot\""];
    let drawn: usize = classes.iter().map(|c| dom.matches(c).count()).sum();
    assert_eq!(drawn, super::figure_ids(html).len(), "figures drawn, figures there");
    for id in named {
        let start = dom.find(&format!("id=\"{id}\"")).unwrap();
        let figure = &dom[start..dom[start..].find("<figcaption>").unwrap() + start];
        assert!(figure.contains("main-svg"), "{id} is empty");
    }
}

#[test]
fn a_browser_draws_diagnoses_and_comparisons_without_complaint() {
    let Some(chromium) = chromium() else {
        data::skipped("no chromium on the PATH, so diagnosis and comparison were not looked at in a browser");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let d = super::diagnosis::diagnosed();
    let pages = [
        (
            "diagnosis",
            d.render(&d.account),
            &["stages", "step-gains", "map-declared", "against-depth", "candidates-gain", "separability"][..],
        ),
        ("comparison", super::comparison::page(), &["ranking", "learning-curve", "correction-map"][..]),
    ];
    for (name, html, figures) in pages {
        let page = folder.path().join(format!("{name}.html"));
        std::fs::write(&page, &html).unwrap();
        draws(&chromium, &page, &html, figures);
    }
}

#[test]
fn a_browser_draws_every_figure_without_complaint() {
    let Some(chromium) = chromium() else {
        data::skipped("no chromium on the PATH, so the report was not looked at in a browser");
        return;
    };
    let fixture = Fixture::simulated(&[Effect::new("cyclic_depth", 6.0).unwrap()]);
    let html =
        fixture.render(&["Simulated: a camera whose depth waves over distance, which the model lacks.".to_owned()]);
    assert!(html.contains("Something is left that this model does not describe"));
    let asked = std::env::var_os("DEPTHCAL_REPORT_DIR").map(PathBuf::from);
    let temporary = tempfile::tempdir().unwrap();
    let folder = asked.unwrap_or_else(|| temporary.path().to_path_buf());
    std::fs::create_dir_all(&folder).unwrap();
    let page = folder.join("report.html");
    std::fs::write(&page, &html).unwrap();

    draws(&chromium, &page, &html, &["errors", "map-left", "difference-after", "against-depth", "uncertainty-map"]);

    for (name, size, dark) in
        [("wide-light", "1280,900", false), ("wide-dark", "1280,900", true), ("phone", "500,900", false)]
    {
        let picture = folder.join(format!("{name}.png"));
        let screenshot = format!("--screenshot={}", picture.display());
        let window = format!("--window-size={size}");
        let mut flags = vec![screenshot.as_str(), window.as_str()];
        if dark {
            flags.push("--blink-settings=preferredColorScheme=0");
        }
        let (_, log) = browse(&chromium, &page, &flags);
        assert!(complaints(&log).is_empty(), "{:#?}", complaints(&log));
        let bytes = std::fs::read(&picture).unwrap();
        // An empty page of this size compresses to some five thousand bytes.
        assert!(bytes.len() > 30_000, "{name}: {} bytes", bytes.len());
    }
}
