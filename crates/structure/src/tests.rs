//! The checks on made-up crates, with and without circles.

use crate::check::{CrateReport, check_crate};
use crate::layers::check_manifest;
use crate::sources::Sources;
use crate::test_programs::check_test_programs;

fn check(files: &[(&str, &str)]) -> CrateReport {
    check_crate(&Sources::from_texts(files.iter().copied())).unwrap()
}

/// The only circle among files, which must have these arrows.
fn one_circle(files: &[(&str, &str)], lines: &[&str]) {
    let circles = check(files).file_circles;
    assert_eq!(circles.len(), 1, "{circles:#?}");
    for line in lines {
        assert!(circles[0].contains(line), "no '{line}' in {}", circles[0]);
    }
}

#[track_caller]
fn no_circle(files: &[(&str, &str)]) {
    let report = check(files);
    assert!(report.file_circles.is_empty() && report.folder_circles.is_empty(), "{report:#?}");
}

#[test]
fn files_that_import_each_other_are_a_circle_with_the_lines_of_both() {
    let files = [
        ("src/lib.rs", "mod a;\nmod b;"),
        ("src/a.rs", "use crate::b::B;\npub struct A(B);"),
        ("src/b.rs", "\npub struct B;\nimpl B { fn back(_: &super::a::A) {} }"),
    ];
    one_circle(
        &files,
        &[
            "circle of 2: src/a.rs -> src/b.rs",
            "src/a.rs:1: `crate::b::B` is defined in src/b.rs (and 1 more)",
            "src/b.rs:3: `super::a::A` is defined in src/a.rs",
        ],
    );
    assert_eq!(check(&files).folder_circles.len(), 1);
}

#[test]
fn one_way_is_no_circle() {
    no_circle(&[
        ("src/lib.rs", "mod a;\nmod b;\npub use a::A;"),
        ("src/a.rs", "use crate::b::B;\npub struct A(B);"),
        ("src/b.rs", "pub struct B;"),
    ]);
}

#[test]
fn longer_circles_are_found_and_each_once() {
    let files = [
        ("src/lib.rs", "mod a;\nmod b;\nmod c;\nmod d;"),
        ("src/a.rs", "pub fn a() { crate::b::b() }"),
        ("src/b.rs", "pub fn b() { crate::c::c() }"),
        ("src/c.rs", "pub fn c() { crate::a::a(); crate::d::d() }"),
        ("src/d.rs", "pub fn d() {}"),
    ];
    one_circle(&files, &["circle of 3: src/a.rs -> src/b.rs -> src/c.rs"]);
}

#[test]
fn re_exports_lead_to_the_file_that_defines() {
    // `one` imports `Two` through the parent, which only re-exports: no circle with the parent.
    let parent = ("src/group/mod.rs", "mod one;\nmod two;\npub use one::One;\npub use two::Two;");
    let lib = ("src/lib.rs", "mod group;\npub use group::{One, Two};");
    let two = ("src/group/two.rs", "pub struct Two;");
    no_circle(&[lib, parent, ("src/group/one.rs", "use super::Two;\npub struct One(Two);"), two]);
    no_circle(&[lib, parent, ("src/group/one.rs", "use crate::Two;\npub struct One(Two);"), two]);
    // But the two children may not import each other that way.
    let one = ("src/group/one.rs", "use crate::group::Two as Other;\npub struct One(Other);");
    let two = ("src/group/two.rs", "pub struct Two;\nfn back() -> crate::One { todo!() }");
    one_circle(
        &[lib, parent, one, two],
        &["`crate::group::Two` is defined in src/group/two.rs", "src/group/two.rs:2: `crate::One`"],
    );
}

#[test]
fn a_parent_that_defines_what_its_children_use_is_in_a_circle_with_them() {
    let child = ("src/group/child.rs", "use super::{Shared, helper};\npub fn run(_: Shared) { helper() }");
    let defining = "mod child;\npub use child::run;\npub struct Shared;\nfn helper() {}";
    one_circle(&[("src/lib.rs", "mod group;"), ("src/group/mod.rs", defining), child], &["circle of 2"]);
    // The same with the shared type in a file of its own.
    let child = ("src/group/child.rs", "use super::shared::Shared;\npub fn run(_: Shared) {}");
    let declaring = ("src/group/mod.rs", "mod child;\nmod shared;\npub use child::run;\npub use shared::Shared;");
    no_circle(&[("src/lib.rs", "mod group;"), declaring, child, ("src/group/shared.rs", "pub struct Shared;")]);
}

#[test]
fn folders_may_be_in_a_circle_where_files_are_not() {
    let files = [
        ("src/lib.rs", "mod left;\nmod right;"),
        ("src/left/mod.rs", "pub mod high;\npub mod low;"),
        ("src/left/high.rs", "use crate::right::Middle;\nstruct High(Middle);"),
        ("src/left/low.rs", "pub struct Low;"),
        ("src/right.rs", "use crate::left::low::Low;\npub struct Middle(Low);"),
    ];
    let report = check(&files);
    assert!(report.file_circles.is_empty());
    assert_eq!(report.folder_circles.len(), 1);
    assert!(report.folder_circles[0].contains("left/ -> right/"), "{}", report.folder_circles[0]);
    assert!(report.folder_circles[0].contains("src/right.rs:1"), "{}", report.folder_circles[0]);
}

/// Every way of naming `a::Thing` (or what belongs to it) in `b`, which `a` depends on.
#[test]
fn references_are_seen_wherever_they_are_written() {
    for reference in [
        "use crate::a::{self, Thing};",
        "use crate::{a::{Thing as Renamed}};",
        "use crate::a; fn f(_: a::Thing) {}",
        "use super::a as other; fn f() { other::make(); }",
        "fn f() -> Option<Vec<crate::a::Thing>> { None }",
        "fn f() { let _ = |x| super::a::make(x); }",
        "fn f() { use crate::a; a::make(); }",
        "fn f() { use crate::a::make as built; built(); }",
        "fn f() { println!(\"{}\", 1 + crate::a::make()); }",
        "fn f() { assert!(matches!(0, crate::a::Thing::Variant)); }",
        "fn f(x: u8) { match x { crate::a::LIMIT => {} _ => {} } }",
        "impl crate::a::Trait for u8 {}",
        "fn f(_: &dyn crate::a::Trait) {}",
        "fn f<T: crate::a::Trait>() {}",
        "fn f<T>() where T: crate::a::Trait {}",
        "struct S { #[serde(default = \"crate::a::make\")] x: u8 }",
        "struct S { #[serde(with = \"super::a\")] x: u8 }",
        "macro_rules! m { () => { $crate::a::make() } }",
        "fn f() { picked!() }",
        "use crate::a::*; fn f(_: Thing) {}",
        "use crate::a::*; fn f() { make(); }",
        "use crate::a::*;",
        "mod inner { use super::super::a::Thing; }",
        "mod inner { fn f() { crate::a::make() } }",
        "use crate::a::made_by_a_macro;",
        "impl crate::b::B { fn g(&self) { self.of_a() } }",
        "impl B { fn g() { Self::of_a() } }",
        "fn f() { B::of_a(); }",
        "impl B { fn g(&self) { println!(\"{}\", self.of_a()) } }",
        "const fn f() -> [u8; crate::a::LIMIT] { todo!() }",
    ] {
        let a = "use crate::b::B;\npub enum Thing { Variant }\npub const LIMIT: usize = 1;\npub trait Trait {}\npub fn make() {}\n\
                 macro_rules! picked { () => {} }\nimpl B { fn of_a(&self) {} }";
        let b = format!("pub struct B;\n{reference}");
        let report = check(&[("src/lib.rs", "mod a;\nmod b;"), ("src/a.rs", a), ("src/b.rs", &b)]);
        assert_eq!(report.file_circles.len(), 1, "{reference}: {report:#?}");
    }
}

#[test]
fn what_is_no_reference_is_not_seen() {
    for no_reference in [
        "#[cfg(test)] use crate::a::Thing;",
        "#[cfg(test)] mod checks { use crate::a::Thing; }",
        "#[cfg(all(test, feature = \"x\"))] mod checks { use crate::a::Thing; }",
        "mod tests;",
        "impl B { #[cfg(test)] fn f() { crate::a::make() } }",
        "/// See [`crate::a::Thing`].\nfn f() {}",
        "fn f() { let text = \"crate::a::Thing\"; }",
        "pub(in crate::a) fn f() {}",
        "use crate::a;",
        "use a_crate::a::Thing;",
        "fn f() { ::a::make() }",
        "fn make(a: u8) -> u8 { a }",
        "use crate::External;",
    ] {
        let lib = "mod a;\nmod b;\npub use serde::External;";
        let a = "use crate::b::B;\npub struct Thing(B);\npub fn make() {}";
        let b = format!("pub struct B;\n{no_reference}");
        let tests = ("src/b/tests.rs", "use crate::a::Thing;");
        no_circle(&[("src/lib.rs", lib), ("src/a.rs", a), ("src/b.rs", &b), tests]);
    }
    // What is left out of a test is not left out.
    let b = "pub struct B;\n#[cfg(not(test))] use crate::a::Thing;";
    let a = "use crate::b::B;\npub struct Thing(B);";
    one_circle(&[("src/lib.rs", "mod a;\nmod b;"), ("src/a.rs", a), ("src/b.rs", b)], &["src/b.rs:2"]);
}

#[test]
fn imports_of_each_other_come_to_an_end() {
    // Not a valid program, but it may not hang.
    check(&[
        ("src/lib.rs", "mod a;\nmod b;"),
        ("src/a.rs", "pub use crate::b::X;"),
        ("src/b.rs", "pub use crate::a::X;"),
    ]);
    no_circle(&[
        ("src/lib.rs", "mod a;\nmod b;"),
        ("src/a.rs", "pub use crate::b::*;\npub fn f(_: Y) {}"),
        ("src/b.rs", "pub use crate::a::*;\npub struct Y;"),
    ]);
}

#[test]
fn modules_are_found_at_paths_and_inside_inline_modules() {
    let lib = "mod outer { pub mod inner; }\n#[path = \"elsewhere.rs\"] mod named;";
    let inner = ("src/outer/inner.rs", "use crate::named::N;\npub struct I(N);");
    one_circle(
        &[("src/lib.rs", lib), inner, ("src/elsewhere.rs", "pub struct N(Box<crate::outer::inner::I>);")],
        &["src/elsewhere.rs:1"],
    );
    let missing = check_crate(&Sources::from_texts([("src/lib.rs", "mod lost;")])).unwrap_err().to_string();
    assert_eq!(missing, "src/lib.rs: no file for `mod lost;`: expected lost.rs or lost/mod.rs");
    let broken = check_crate(&Sources::from_texts([("src/lib.rs", "\nfn {}")])).unwrap_err().to_string();
    assert!(broken.starts_with("src/lib.rs:2: not valid Rust"), "{broken}");
}

#[test]
fn crates_depend_on_lower_ones_only() {
    let violations = |package: &str, text: &str| check_manifest(package, text).unwrap();
    let fine = "[dependencies]\ndepthcal-solver.workspace = true\nfaer = \"1\"\n[dev-dependencies]\ndepthcal-cli = \"1\"\nopencv = \"1\"";
    assert_eq!(violations("depthcal-calibration", fine), [] as [String; 0]);
    for (package, text, message) in [
        ("depthcal-calibration", "[dependencies]\ndepthcal-report.workspace = true", "not below it"),
        ("depthcal-calibration", "[dependencies.cli]\npackage = \"depthcal-cli\"\nversion = \"1\"", "not below it"),
        ("depthcal-io", "[build-dependencies]\ndepthcal-simulate = \"1\"", "not below it"),
        ("depthcal-model", "[target.'cfg(unix)'.dependencies]\ndepthcal = \"1\"", "not below it"),
        ("depthcal-solver", "[dependencies]\ndepthcal-model = \"1\"", "must not know each other"),
        (
            "depthcal",
            "[dependencies]\nopencv = { version = \"1\", optional = true }",
            "for depthcal-detect, depthcal-studies only",
        ),
        ("depthcal-calibration", "[dependencies]\nindicatif = \"1\"", "for depthcal-cli, depthcal-report only"),
        ("depthcal", "[dependencies]\ndepthcal-structure = \"1\"", "for tests"),
    ] {
        let messages = violations(package, text);
        assert!(messages.len() == 1 && messages[0].contains(message), "{text}: {messages:?}");
    }
    assert!(check_manifest("depthcal", "[dependencies").is_err());
}

#[test]
fn a_test_that_no_program_contains_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let write = |path: &str, text: &str| {
        let path = folder.path().join(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    write("tests/suite.rs", "mod a;\nmod b;\nmod inline { mod c {} }");
    for file in ["a.rs", "b/mod.rs", "b/more.rs", "c.rs", "d/mod.rs", "alone.rs", "data/x.json"] {
        write(&format!("tests/{file}"), "");
    }
    let programs = "[[test]]\nname = \"suite\"\n[[test]]\nname = \"other\"\npath = \"tests/alone.rs\"";
    write("Cargo.toml", &format!("[package]\nautotests = false\n{programs}"));
    let names = |violations: Vec<String>| {
        violations.iter().map(|v| v.split(' ').next().unwrap().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(names(check_test_programs(folder.path()).unwrap()), ["tests/c", "tests/d"]);
    // Cargo finds every file itself.
    write("Cargo.toml", &format!("[package]\n{programs}"));
    assert_eq!(check_test_programs(folder.path()).unwrap(), [] as [String; 0]);
}
