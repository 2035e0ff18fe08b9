use proptest::prelude::*;

use super::*;

fn files(names: &[&str]) -> Vec<Candidate> {
    names.iter().map(|name| Candidate { path: format!("{name}.png").into(), time_s: None }).collect()
}

/// The rule, and the pairs by the names of their files.
fn paired(images: &[&str], depth: &[&str]) -> (Pairing, Vec<(String, String, String)>) {
    let (rule, pairs) = by_name(&files(images), &files(depth));
    let named = pairs.into_iter().map(|(name, i, d)| (name, images[i].to_owned(), depth[d].to_owned()));
    (rule, named.collect())
}

fn check(images: &[&str], depth: &[&str], rule: Pairing, expected: &[(&str, &str, &str)]) {
    let expected: Vec<_> = expected.iter().map(|(n, i, d)| (n.to_string(), i.to_string(), d.to_string())).collect();
    assert_eq!(paired(images, depth), (rule, expected));
}

#[test]
fn equal_stems_come_first() {
    check(&["a_1", "b_2", "x"], &["b_2", "a_1"], Pairing::Stem, &[("a_1", "a_1", "a_1"), ("b_2", "b_2", "b_2")]);
}

#[test]
fn prefixes_and_suffixes_of_a_kind_do_not_count() {
    check(
        &["rgb_1", "rgb_2", "rgb_10"],
        &["depth_1", "depth_2", "depth_10"],
        Pairing::Rest,
        &[("1", "rgb_1", "depth_1"), ("10", "rgb_10", "depth_10"), ("2", "rgb_2", "depth_2")],
    );
    check(
        &["0001_sync_ir", "0003_sync_ir"],
        &["0001_sync_depth", "0003_sync_depth"],
        Pairing::Rest,
        &[("0001", "0001_sync_ir", "0001_sync_depth"), ("0003", "0003_sync_ir", "0003_sync_depth")],
    );
    check(
        &["left_a_ir", "right_a_ir"],
        &["left_a_z", "right_a_z"],
        Pairing::Rest,
        &[("left", "left_a_ir", "left_a_z"), ("right", "right_a_ir", "right_a_z")],
    );
}

#[test]
fn a_stray_does_not_spoil_prefixes() {
    // The stray leaves no common prefix, so the numbers decide.
    check(
        &["rgb_1", "rgb_2", "thumbnail"],
        &["depth_001", "depth_002"],
        Pairing::Number,
        &[("1", "rgb_1", "depth_001"), ("2", "rgb_2", "depth_002")],
    );
    // A number that occurs twice is nobody's.
    check(&["rgb_1", "copy_rgb_1", "rgb_2"], &["depth_1", "depth_2"], Pairing::Number, &[("2", "rgb_2", "depth_2")]);
}

#[test]
fn a_single_frame_and_nothing() {
    check(&["rgb_7"], &["depth_7"], Pairing::Rest, &[("7", "rgb_7", "depth_7")]);
    check(&["a"], &["b"], Pairing::Stem, &[]);
    check(&[], &[], Pairing::Stem, &[]);
}

#[test]
fn nearest_times_once_each() {
    let timed = |times: &[f64]| -> Vec<Candidate> {
        times.iter().map(|t| Candidate { path: format!("{t}.png").into(), time_s: Some(*t) }).collect()
    };
    let (images, depth) = (timed(&[1.0, 1.033, 1.066, 5.0]), timed(&[1.070, 1.034, 1.012, 9.0]));
    let pairs = by_time(&images, &depth, 0.02).unwrap();
    let named: Vec<_> = pairs.iter().map(|(_, i, d)| (*i, *d)).collect();
    assert_eq!(named, [(1, 1), (2, 0), (0, 2)]);
    let names = by_time(&files(&["1305031102.175304"]), &files(&["d_1305031102.18"]), 0.02).unwrap();
    assert_eq!(names, [("1305031102.175304".to_owned(), 0, 0)]);
    assert_eq!(by_time(&files(&["a"]), &depth, 0.02), Err("a.png".into()));
}

proptest! {
    /// A shuffled set of numbered files of both kinds pairs every number, whatever the words around it.
    #[test]
    fn numbered_files_pair(
        numbers in proptest::collection::btree_set(0_u32..5000, 1..30),
        words in ("[a-z]{1,5}_", "[a-z]{0,5}", "[a-z]{1,5}_", "[a-z]{0,5}"),
    ) {
        let name = |front: &str, n: &u32, back: &str| format!("{front}{n:04}{back}");
        let images: Vec<String> = numbers.iter().map(|n| name(&words.0, n, &words.1)).collect();
        let depth: Vec<String> = numbers.iter().rev().map(|n| name(&words.2, n, &words.3)).collect();
        let view = |names: &[String]| files(&names.iter().map(String::as_str).collect::<Vec<_>>());
        let (_, pairs) = by_name(&view(&images), &view(&depth));
        prop_assert_eq!(pairs.len(), numbers.len());
        for (_, i, d) in pairs {
            prop_assert_eq!(last_number(&images[i]), last_number(&depth[d]));
        }
    }

    #[test]
    fn any_names_are_no_panic(images in proptest::collection::vec(".{0,6}", 0..5), depth in proptest::collection::vec(".{0,6}", 0..5)) {
        let view = |names: &[String]| files(&names.iter().map(String::as_str).collect::<Vec<_>>());
        let _ = by_name(&view(&images), &view(&depth));
        let _ = by_time(&view(&images), &view(&depth), 1.0);
    }
}
