//! Whole sessions, from a source to a dataset.

use std::fs;
use std::io::{Cursor, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::sync::mpsc;
use std::thread;

use depthcal_detect::DetectOptions;
use depthcal_io::{Dataset, DepthValues};
use depthcal_live::{Arrival, Ended, LiveError, LiveOptions, Source, run};

use crate::captures::{arrivals, board, folder, live_fit};

fn options(out: &Path) -> LiveOptions {
    LiveOptions {
        target: board(),
        out: out.to_owned(),
        port: 0,
        share: false,
        detect: DetectOptions::default(),
        fit: live_fit(),
    }
}

/// The bytes of a frame as a program writes them to standard input.
fn raw(arrival: &Arrival) -> Vec<u8> {
    let (width, height) = (arrival.image.width, arrival.image.height);
    let mut bytes = format!(
        "{{\"width\":{width},\"height\":{height},\"format\":\"gray16\",\"depth\":\"u16\",\"unit_mm\":{}}}\n",
        arrival.unit_mm.unwrap()
    )
    .into_bytes();
    bytes.extend(arrival.image.data.iter().flat_map(|v| v.to_le_bytes()));
    let DepthValues::Steps(values) = &arrival.depth.as_ref().unwrap().values else { panic!("depth of the simulator") };
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    bytes
}

fn ask(address: &str, line: &str) -> String {
    let host = address.trim_start_matches("http://").trim_end_matches('/');
    let mut stream = TcpStream::connect(host).unwrap();
    write!(stream, "{line} HTTP/1.1\r\nHost: {host}\r\nX-Depthcal: live\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

/// Runs a session in a thread; returns the address of its page.
fn started(options: LiveOptions, source: Source) -> (String, thread::JoinHandle<Result<Ended, LiveError>>) {
    let (send, receive) = mpsc::channel();
    let session = thread::spawn(move || run(options, source, |address| send.send(address.to_owned()).unwrap()));
    (receive.recv().unwrap(), session)
}

/// Asks for states until one is as wanted.
fn wait_for(address: &str, is_wanted: impl Fn(&serde_json::Value) -> bool) -> serde_json::Value {
    let mut version = 0;
    loop {
        let answer = ask(address, &format!("GET /state?after={version}"));
        let state: serde_json::Value = serde_json::from_str(answer.split_once("\r\n\r\n").unwrap().1).unwrap();
        if is_wanted(&state) {
            return state;
        }
        version = state["version"].as_u64().unwrap();
    }
}

fn count(state: &serde_json::Value) -> usize {
    state["kept"].as_array().unwrap().len()
}

/// Files come one by one, the depth after its image; the page has the frames, their fit and the pose that is wanted next.
#[test]
fn a_folder_that_fills_becomes_a_dataset_and_a_fit() {
    let place = tempfile::tempdir().unwrap();
    let (source, out) = (place.path().join("source"), place.path().join("out"));
    fs::create_dir_all(source.join("image")).unwrap();
    fs::create_dir_all(source.join("depth")).unwrap();
    let unit_mm = Dataset::open(folder()).unwrap().cameras[0].depth_unit_mm;
    let from = Source::Folder { path: source.clone(), unit_mm, is_video: false };
    let (address, session) = started(options(&out), from);
    let names: Vec<String> = arrivals(false).into_iter().map(|arrival| arrival.name).collect();
    for name in &names {
        for kind in ["image", "depth"] {
            fs::copy(folder().join(format!("{kind}/{name}.png")), source.join(format!("{kind}/{name}.png"))).unwrap();
        }
    }
    // A file that is no image, and one that is still written, disturb nothing.
    fs::write(source.join("image/broken.png"), "no image").unwrap();
    fs::write(source.join("depth/broken.png"), "no depth").unwrap();
    let state = wait_for(&address, |state| count(state) >= 8 && state["fit"]["frames"].as_u64() >= Some(8));
    assert!(state["wanted"]["outline"].as_array().unwrap().len() >= 30, "{state}");
    let before = count(&wait_for(&address, |state| state["is_fitting"] == false));
    ask(&address, "POST /take-back");
    wait_for(&address, |state| count(state) == before - 1);
    ask(&address, "POST /finish");
    let ended = session.join().unwrap().unwrap();
    assert_eq!((ended.kept.len(), &ended.problem), (before - 1, &None));
    let camera = Dataset::open(&out).unwrap().into_only_camera().unwrap();
    let frames: Vec<String> = camera.frames.iter().map(|frame| frame.name.clone()).collect();
    assert_eq!(frames, ended.kept);
    assert_eq!(camera.depth_unit_mm, unit_mm);
}

/// A stream that ends ends the session. Frames may replace each other while one is searched, so some are not seen.
#[test]
fn a_stream_that_ends_ends_the_session() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("out");
    let view = &arrivals(true)[0];
    let bytes = raw(view).repeat(40);
    let cut = [&bytes[..], &bytes[..1000]].concat();
    let ended = run(options(&out), Source::Stream(Box::new(Cursor::new(cut))), |_| ()).unwrap();
    let problem = ended.problem.unwrap();
    assert!(problem.contains("frame 41") && problem.contains("ends within its image"), "{problem}");
    assert!(ended.kept.len() <= 1);
    let ended = run(options(&out), Source::Stream(Box::new(Cursor::new(Vec::new()))), |_| ()).unwrap();
    assert_eq!(ended.problem, None);
}

#[test]
fn sources_that_cannot_be_read_are_named() {
    let place = tempfile::tempdir().unwrap();
    let from = |path: &Path| Source::Folder { path: path.to_owned(), unit_mm: None, is_video: false };
    let complaint = |out: &Path, path: &Path| run(options(out), from(path), |_| ()).unwrap_err().to_string();
    let out = place.path().join("out");
    assert!(complaint(&out, &place.path().join("nowhere")).contains("no folder"));
    let source = place.path().join("source");
    fs::create_dir_all(source.join("depth")).unwrap();
    assert!(complaint(&out, &source).contains("--unit-mm"));
    assert!(complaint(&source, &source).contains("--out"));
}
