//! Raw frames on a stream.

use std::io::{BufReader, Cursor};

use depthcal_io::DepthValues;
use depthcal_live::{Arrival, LiveError, read_frame};

fn frames(bytes: &[u8]) -> Result<Vec<Arrival>, LiveError> {
    let mut reader = BufReader::new(Cursor::new(bytes));
    let mut frames = Vec::new();
    while let Some(arrival) = read_frame(&mut reader, frames.len() as u64 + 1)? {
        frames.push(arrival);
    }
    Ok(frames)
}

fn complaint(bytes: &[u8]) -> String {
    frames(bytes).unwrap_err().to_string()
}

fn framed(header: &str, bytes: &[u8]) -> Vec<u8> {
    [header.as_bytes(), b"\n", bytes].concat()
}

#[test]
fn every_type_of_value_is_read() {
    let grey8 = framed(r#"{"width":2,"height":1,"format":"gray8","timestamp_s":1.5}"#, &[7, 200]);
    let grey16 = framed(
        r#"{"width":2,"height":1,"format":"gray16","depth":"u16","unit_mm":0.25,"temperature_c":31}"#,
        &[1, 2, 255, 255, 16, 39, 0, 0],
    );
    let floats: Vec<u8> = [1.5_f32, f32::NAN].iter().flat_map(|v| v.to_le_bytes()).collect();
    let colour = framed(
        r#"{"width":2,"height":1,"format":"rgb8","depth":"f32","unit_mm":1000}"#,
        &[&[255, 0, 0, 0, 0, 255][..], &floats].concat(),
    );
    let swapped = framed(r#"{"width":2,"height":1,"format":"bgr8"}"#, &[0, 0, 255, 255, 0, 0]);
    let all = frames(&[grey8, grey16, colour, swapped].concat()).unwrap();
    assert_eq!((&all[0].image.data[..], all[0].image.bits, all[0].metadata.timestamp_s), (&[7, 200][..], 8, Some(1.5)));
    assert_eq!((&all[1].image.data[..], all[1].image.bits, all[1].unit_mm), (&[513, 65535][..], 16, Some(0.25)));
    assert_eq!(all[1].depth.as_ref().unwrap().values, DepthValues::Steps(vec![10_000, 0]));
    assert_eq!(all[1].metadata.temperature_c, Some(31.0));
    // Luma of red and blue.
    assert_eq!((&all[2].image.data[..], &all[3].image.data), (&[76, 29][..], &all[2].image.data));
    let depth = all[2].depth.as_ref().unwrap();
    assert_eq!((depth.measurement(0), depth.measurement(1)), (Some(1.5), None));
}

#[test]
fn a_stream_that_ends_within_a_frame_says_where() {
    let whole = framed(r#"{"width":2,"height":2,"format":"gray8","depth":"u16","unit_mm":1}"#, &[1; 12]);
    assert_eq!(frames(&[&whole[..], &whole].concat()).unwrap().len(), 2);
    for cut in 1..whole.len() {
        let message = complaint(&[&whole[..], &whole[..cut]].concat());
        let part = match whole.len() - cut {
            13.. => "header",
            9.. => "image",
            8 => "depth, after 0 of 8 bytes",
            _ => "depth",
        };
        assert!(message.contains("frame 2") && message.contains(part), "{cut}: {message}");
    }
}

#[test]
fn headers_that_mean_nothing_are_named() {
    let cases = [
        ("hello", "docs/live.md"),
        (r#"{"width":2,"height":2,"format":"yuyv"}"#, "yuyv"),
        (r#"{"width":2,"height":2,"format":"gray8","fps":30}"#, "fps"),
        (r#"{"width":0,"height":2,"format":"gray8"}"#, "0 × 2"),
        (r#"{"width":-1,"height":2,"format":"gray8"}"#, "docs/live.md"),
        (r#"{"width":4294967296,"height":4294967296,"format":"gray8"}"#, "no size"),
        (r#"{"width":2,"height":2,"format":"gray8","depth":"u16"}"#, "unit_mm"),
        (r#"{"width":2,"height":2,"format":"gray8","depth":"u16","unit_mm":0}"#, "unit_mm"),
    ];
    for (header, word) in cases {
        let message = complaint(&framed(header, &[0; 64]));
        assert!(message.contains(word), "{header}: {message}");
    }
    let message = complaint(&[b'{'; 10_000]);
    assert!(message.contains("longer than 4096"), "{message}");
}

/// Frames with bytes changed, removed and added at random end in frames or errors, and take no more memory than was sent: a
/// header may claim 64 million pixels.
#[test]
fn any_bytes_are_frames_or_errors() {
    let whole =
        framed(r#"{"width":3,"height":2,"format":"gray8","depth":"f32","unit_mm":1,"timestamp_s":0}"#, &[9; 30]);
    let mut state = 7_u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let (mut read, mut refused) = (0, 0);
    for _ in 0..20_000 {
        let mut bytes = whole.repeat(2);
        for _ in 0..=random(4) {
            let place = random(bytes.len());
            match random(3) {
                0 => bytes[place] = random(256) as u8,
                1 => bytes.insert(place, b'0' + random(10) as u8),
                _ => drop(bytes.remove(place)),
            }
        }
        match frames(&bytes) {
            Ok(frames) => read += frames.len(),
            Err(LiveError::Stream { .. }) => refused += 1,
            Err(other) => panic!("{other}"),
        }
    }
    assert!(read > 1000 && refused > 10_000, "{read} {refused}");
    let message = complaint(&framed(r#"{"width":8192,"height":8192,"format":"rgb8"}"#, &[0; 100]));
    assert!(message.contains("after 100 of 201326592 bytes"), "{message}");
}
