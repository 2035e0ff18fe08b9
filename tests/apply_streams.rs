//! Streams of `apply -` that are long, slow, cut, or no longer read.

#![cfg(target_os = "linux")]

use std::io::{Read, Write};
use std::process::{Child, ChildStdin, ChildStdout, Stdio};
use std::time::{Duration, Instant};

use crate::support::{CALIBRATION, Folder, command, stderr};

/// Size of the frames, px.
const SMALL: [usize; 2] = [16, 12];

/// The calibration of a small camera, so that a million frames are some hundred megabytes.
fn calibration([width, height]: [usize; 2]) -> String {
    CALIBRATION
        .replace("\"width\": 64, \"height\": 48", &format!("\"width\": {width}, \"height\": {height}"))
        .replace("60.0", "15.0")
        .replace("62.0", "15.5")
        .replace("31.0", "7.5")
        .replace("24.5", "6.0")
}

struct Stream {
    _folder: Folder,
    child: Child,
    input: Option<ChildStdin>,
    output: Option<ChildStdout>,
    frame: Vec<u8>,
}

impl Stream {
    fn start(size: [usize; 2]) -> Self {
        let folder = Folder::new();
        folder.write("calibration.json", calibration(size));
        let file = folder.arg("calibration.json");
        let mut child = command(["apply", &file, "-", "--unit-mm", "1", "--stream-output", "u16", "--threads", "1"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let frame = (0..size[0] * size[1]).flat_map(|i| (500 + (i % 1500) as u16).to_le_bytes()).collect();
        let (input, output) = (child.stdin.take(), child.stdout.take());
        Self { _folder: folder, child, input, output, frame }
    }

    /// Sends a frame and waits for it; returns how long that took.
    fn round_trip(&mut self, received: &mut [u8]) -> Duration {
        let began = Instant::now();
        self.input.as_mut().unwrap().write_all(&self.frame).unwrap();
        self.output.as_mut().unwrap().read_exact(received).unwrap();
        began.elapsed()
    }

    /// The most memory that the program has had, KiB.
    fn peak_kib(&self) -> usize {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
        line.trim().trim_end_matches(" kB").parse().unwrap()
    }

    fn end(mut self) -> std::process::Output {
        drop((self.input.take(), self.output.take()));
        self.child.wait_with_output().unwrap()
    }
}

fn median_us(times: &[Duration]) -> f64 {
    let mut sorted = times.to_vec();
    sorted.sort();
    sorted[sorted.len() / 2].as_secs_f64() * 1e6
}

/// Memory after the first and the last frames, and the median time of a frame among the first and the last ones.
struct Run {
    peak_kib: [usize; 2],
    median_us: [f64; 2],
}

fn run(frames: usize, window: usize) -> Run {
    let mut stream = Stream::start(SMALL);
    let mut received = vec![0; stream.frame.len()];
    let mut times: [Vec<Duration>; 2] = [Vec::new(), Vec::new()];
    let mut first_kib = 0;
    let mut expected = Vec::new();
    for i in 0..frames {
        let time = stream.round_trip(&mut received);
        if i == 0 {
            expected = received.clone();
        }
        assert!(received == expected, "frame {i} differs from the first");
        if i < window {
            times[0].push(time);
        }
        if i + 1 == window {
            first_kib = stream.peak_kib();
        }
        if i >= frames - window {
            times[1].push(time);
        }
    }
    let last_kib = stream.peak_kib();
    let output = stream.end();
    assert!(output.status.success() && stderr(&output).contains(&format!("{frames} frames")), "{}", stderr(&output));
    Run { peak_kib: [first_kib, last_kib], median_us: times.map(|times| median_us(&times)) }
}

fn check(run: &Run) {
    let Run { peak_kib: [first, last], median_us: [early, late] } = run;
    assert!(*last <= first + 512, "memory grew from {first} to {last} KiB");
    // Machines that do other things at the same time are slower by turns.
    assert!(*late < 5.0 * early + 200.0, "a frame takes {late:.0} µs in the end, {early:.0} µs in the beginning");
}

#[test]
fn memory_and_latency_do_not_grow() {
    check(&run(20_000, 2_000));
}

/// The table of docs/trust.md. `DEPTHCAL_FRAMES` sets the number of frames.
#[test]
#[ignore = "takes minutes"]
fn a_million_frames() {
    let frames = std::env::var("DEPTHCAL_FRAMES").map_or(1_000_000, |text| text.parse().expect("a number"));
    let result = run(frames, 10_000);
    let Run { peak_kib: [first, last], median_us: [early, late] } = &result;
    println!(
        "| frames | peak memory, first 10⁴ | peak memory, all | median of a frame, first 10⁴ | last 10⁴ |\n|---|---|---|---|---|"
    );
    println!("| {frames} | {first} KiB | {last} KiB | {early:.1} µs | {late:.1} µs |");
    check(&result);
}

/// Who does not read is waited for, with a few frames in memory.
#[test]
fn a_slow_reader_holds_the_stream() {
    let size = [640, 480];
    let mut stream = Stream::start(size);
    let (mut input, frame) = (stream.input.take().unwrap(), stream.frame.clone());
    let (count, sent) = std::sync::mpsc::channel();
    let writer = std::thread::spawn(move || {
        for i in 1..=60 {
            input.write_all(&frame).unwrap();
            count.send(i).unwrap();
        }
        // Open until its memory has been read: a program that has ended has none.
        input
    });
    // Until nothing goes on: the buffers between input and output are full.
    let mut accepted = 0;
    while let Ok(i) = sent.recv_timeout(Duration::from_secs(2)) {
        accepted = i;
    }
    assert!((1..=12).contains(&accepted), "{accepted} frames were taken although none was read");
    let waiting = stream.peak_kib();
    let mut received = vec![0; stream.frame.len()];
    for _ in 0..60 {
        stream.output.as_mut().unwrap().read_exact(&mut received).unwrap();
        std::thread::sleep(Duration::from_millis(2));
    }
    stream.input = Some(writer.join().unwrap());
    let most = stream.peak_kib();
    assert!(most <= waiting + 2048, "{most} KiB after {waiting} KiB");
    assert!(stream.end().status.success());
}

/// `| head` is no error, and no reason for words.
#[test]
fn a_reader_that_leaves_ends_the_stream_quietly() {
    let mut stream = Stream::start(SMALL);
    let mut received = vec![0; stream.frame.len()];
    stream.round_trip(&mut received);
    drop(stream.output.take());
    let frame = stream.frame.clone();
    let mut input = stream.input.take().unwrap();
    let began = Instant::now();
    while input.write_all(&frame).is_ok() {
        assert!(began.elapsed() < Duration::from_secs(60), "it still reads");
    }
    let output = stream.end();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(stderr(&output), "");
}

#[test]
fn a_frame_that_is_cut_is_named() {
    let mut stream = Stream::start(SMALL);
    let mut received = vec![0; stream.frame.len()];
    for _ in 0..3 {
        stream.round_trip(&mut received);
    }
    let cut = stream.frame[..100].to_vec();
    stream.input.as_mut().unwrap().write_all(&cut).unwrap();
    let output = stream.end();
    assert_eq!(output.status.code(), Some(1));
    let message = stderr(&output);
    assert!(message.contains("frame 4 ends after 100 of its 384 bytes"), "{message}");
    assert!(message.contains("--stream-input"), "{message}");
}
