//! Formats besides PNG and JPEG: what is written reads back, what is damaged is an error, what a header claims is bounded.

use std::io::Write as _;

use proptest::prelude::*;

use super::*;

fn steps() -> DepthFrame {
    DepthFrame { width: 4, height: 3, values: DepthValues::Steps((0..12).map(|i| i * 5957).collect()) }
}

fn float() -> DepthFrame {
    let mut values: Vec<f32> = (0..12).map(|i| 0.3 + i as f32 / 7.0).collect();
    (values[0], values[1], values[2]) = (f32::NAN, f32::INFINITY, 0.0);
    DepthFrame { width: 4, height: 3, values: DepthValues::Float(values) }
}

/// The values' bits, so that NaN equals itself.
fn bits(frame: &DepthFrame) -> (usize, usize, Vec<u32>) {
    let values = match &frame.values {
        DepthValues::Steps(values) => values.iter().map(|v| u32::from(*v)).collect(),
        DepthValues::Float(values) => values.iter().map(|v| v.to_bits()).collect(),
    };
    (frame.width, frame.height, values)
}

fn written(frame: &DepthFrame, name: &str) -> Result<Vec<u8>, FileError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    write_depth_frame(&path, frame)?;
    Ok(fs::read(path).unwrap())
}

#[test]
fn depth_reads_back_bit_by_bit() {
    for (name, frame) in [
        ("a.png", steps()),
        ("a.pgm", steps()),
        ("a.tiff", steps()),
        ("a.npy", steps()),
        ("a.tif", float()),
        ("a.npy", float()),
        ("a.exr", float()),
    ] {
        let read = decode_depth_frame(Path::new(name), &written(&frame, name).unwrap()).unwrap();
        assert_eq!(bits(&read), bits(&frame), "{name}");
    }
    // An EXR holds floating-point numbers only; 16-bit steps survive in them.
    let read = decode_depth_frame(Path::new("a.exr"), &written(&steps(), "a.exr").unwrap()).unwrap();
    let DepthValues::Float(values) = &read.values else { panic!("{read:?}") };
    assert_eq!(values[3], 3.0 * 5957.0);
}

#[test]
fn what_a_format_cannot_hold_is_refused() {
    for (name, part) in
        [("a.png", "TIFF, NPY or EXR"), ("a.pgm", "TIFF, NPY or EXR"), ("a.jpg", "`.jpg`"), ("a", "`.`")]
    {
        let message = written(&float(), name).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
    let torn = DepthFrame { width: 5, ..steps() };
    assert!(written(&torn, "a.npy").unwrap_err().to_string().contains("12 values for 5×3"));
}

/// An NPY as NumPy writes it.
fn npy(description: &str, order: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if order { "True" } else { "False" };
    let mut head = format!("{{'descr': '{description}', 'fortran_order': {order}, 'shape': ({shape}), }}");
    while (head.len() + 11) % 64 != 0 {
        head.push(' ');
    }
    head.push('\n');
    let mut bytes = b"\x93NUMPY\x01\0".to_vec();
    bytes.extend((head.len() as u16).to_le_bytes());
    bytes.extend(head.as_bytes());
    bytes.extend(data);
    bytes
}

fn depth_of(bytes: &[u8]) -> Result<DepthValues, String> {
    decode_depth_frame(Path::new("a.npy"), bytes).map(|frame| frame.values).map_err(|error| error.to_string())
}

#[test]
fn types_of_numpy() {
    let le = |values: &[i64], size: usize| -> Vec<u8> {
        values.iter().flat_map(|v| v.to_le_bytes()[..size].to_vec()).collect()
    };
    let read = |kind: &str, size: usize, values: &[i64]| depth_of(&npy(kind, false, "1, 3", &le(values, size)));
    assert_eq!(read("<u2", 2, &[0, 7, 65535]), Ok(DepthValues::Steps(vec![0, 7, 65535])));
    // Negative and largest values are no measurement.
    assert_eq!(read("<i2", 2, &[-5, 7, 32767]), Ok(DepthValues::Steps(vec![0, 7, 0])));
    assert_eq!(read("<i4", 4, &[-5, 7, i64::from(i32::MAX)]), Ok(DepthValues::Steps(vec![0, 7, 0])));
    assert_eq!(read("<u4", 4, &[0, 65535, 100_000]), Ok(DepthValues::Float(vec![0.0, 65535.0, 100_000.0])));
    assert_eq!(read("<i8", 8, &[-1, 7, i64::MAX]), Ok(DepthValues::Steps(vec![0, 7, 0])));
    assert!(read("|u1", 1, &[1, 2, 3]).unwrap_err().contains("8-bit grey NPY"));
    assert!(read("|b1", 1, &[1, 1, 0]).unwrap_err().contains("type |b1"));
    let floats: Vec<u8> = [0.5_f64, 2.0, f64::NAN].iter().flat_map(|v| v.to_le_bytes()).collect();
    let DepthValues::Float(values) = depth_of(&npy("<f8", false, "1, 3", &floats)).unwrap() else { panic!() };
    assert!(values[0] == 0.5 && values[2].is_nan());
    assert_eq!(depth_of(&npy(">u2", false, "1, 2", &[0, 7, 1, 0])), Ok(DepthValues::Steps(vec![7, 256])));
    // Column by column: [[1, 3, 5], [2, 4, 6]].
    let columns = npy("<u2", true, "2, 3", &le(&[1, 2, 3, 4, 5, 6], 2));
    assert_eq!(depth_of(&columns), Ok(DepthValues::Steps(vec![1, 3, 5, 2, 4, 6])));
    assert!(depth_of(&npy("<u2", false, "2, 3, 2", &[0; 24])).unwrap_err().contains("2 channels"));
    assert!(depth_of(&npy("<u2", false, "6,", &[0; 12])).unwrap_err().contains("shape [6]"));
    assert!(depth_of(&npy("<u2", false, "2, 3", &[0; 11])).unwrap_err().contains("damaged"));
    assert!(depth_of(&npy("|O", false, "2, 3", &[0; 48])).unwrap_err().contains("Python objects"));
}

#[test]
fn colours_and_floats_become_grey() {
    let colour = npy("|u1", false, "1, 2, 3", &[255, 0, 0, 10, 10, 10]);
    assert_eq!(decode_gray(name(), &colour).unwrap().data, [76, 10]);
    let unit: Vec<u8> = [0.0_f32, 0.5, 1.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_eq!(decode_gray(name(), &npy("<f4", false, "1, 3", &unit)).unwrap().data, [0, 32768, 65535]);
    let raw: Vec<u8> = [f32::NAN, 300.4, 1e9].iter().flat_map(|v| v.to_le_bytes()).collect();
    let grey = decode_gray(name(), &npy("<f4", false, "1, 3", &raw)).unwrap();
    assert_eq!((grey.data, grey.bits), (vec![0, 300, 65535], 16));
    assert_eq!(decode_gray(name(), b"P6 1 1 255 \xff\0\0").unwrap().data, [76]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ppm");
    fs::write(&path, b"P6 1 1 255 \x01\x02\x03").unwrap();
    assert_eq!(read_rgb(&path).unwrap().data, [[1, 2, 3]]);
}

fn archive(members: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, bytes) in members {
        let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
        zip.start_file(*name, options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

#[test]
fn archives_of_numpy() {
    let (one, two) = (npy("<u2", false, "1, 1", &[1, 0]), npy("<u2", false, "1, 1", &[2, 0]));
    let depth = |members: &[(&str, &[u8])]| depth_of(&archive(members));
    assert_eq!(depth(&[("anything.npy", &one)]), Ok(DepthValues::Steps(vec![1])));
    assert_eq!(depth(&[("a.npy", &one), ("depth.npy", &two)]), Ok(DepthValues::Steps(vec![2])));
    assert!(
        depth(&[("a.npy", &one), ("b.npy", &two)]).unwrap_err().contains("the arrays a, b, and which one is meant")
    );
    // Names as NumPy gives them say nothing, and of two names that could be meant none is taken.
    assert!(depth(&[("arr_0.npy", &one), ("arr_1.npy", &two)]).unwrap_err().contains("arr_0, arr_1"));
    assert!(depth(&[("z.npy", &one), ("depth.npy", &two)]).unwrap_err().contains("z, depth"));
    let both = archive(&[("depth.npy", &one), ("image.npy", &two)]);
    assert_eq!(decode_gray(name(), &both).unwrap().data, [2]);
    assert_eq!(depth_of(&both), Ok(DepthValues::Steps(vec![1])));
    assert!(depth(&[("readme.txt", b"x")]).is_err());
}

/// Memory must not follow a header: files of some hundred bytes that claim gigabytes are refused.
#[test]
fn headers_that_claim_too_much() {
    let huge = npy("<f8", false, "16000, 16000", &[0; 64]);
    assert!(depth_of(&huge).unwrap_err().contains("damaged"));
    assert!(depth_of(&npy("<f8", false, "99999999, 99999999", &[])).unwrap_err().contains("no image"));
    let mut long = b"\x93NUMPY\x02\0\xff\xff\xff\xff".to_vec();
    long.extend([b' '; 100]);
    assert!(depth_of(&long).unwrap_err().contains("header"));
    let nested = npy(&"[".repeat(3000), false, "1, 1", &[]);
    assert!(depth_of(&nested).is_err());

    let mut tiff = written(&steps(), "a.tif").unwrap();
    // ImageWidth and ImageLength, tags 256 and 257, as LONG: the first entries of the directory.
    for tag in [256_u16, 257] {
        let entry = (0..tiff.len() - 12)
            .find(|i| tiff[*i..i + 2] == tag.to_le_bytes() && tiff[i + 3] == 0 && tiff[i + 4] == 1)
            .unwrap();
        tiff[entry + 2..entry + 4].copy_from_slice(&4_u16.to_le_bytes());
        tiff[entry + 8..entry + 12].copy_from_slice(&16_000_u32.to_le_bytes());
    }
    assert!(decode_depth_frame(name(), &tiff).unwrap_err().to_string().contains("too short"));

    let mut exr = written(&float(), "a.exr").unwrap();
    for window in ["dataWindow", "displayWindow"] {
        let box_start =
            exr.windows(window.len()).position(|w| w == window.as_bytes()).unwrap() + window.len() + 1 + 6 + 4;
        exr[box_start + 8..box_start + 12].copy_from_slice(&15_999_i32.to_le_bytes());
        exr[box_start + 12..box_start + 16].copy_from_slice(&15_999_i32.to_le_bytes());
    }
    let message = decode_depth_frame(name(), &exr).unwrap_err().to_string();
    assert!(message.contains("too short") || message.contains("damaged"), "{message}");
}

proptest! {
    #[test]
    fn damaged_files_are_no_panic(
        which in 0..4_usize,
        position in any::<prop::sample::Index>(),
        value in any::<u8>(),
        cut in any::<bool>(),
    ) {
        let mut bytes = match which {
            0 => written(&float(), "a.tif").unwrap(),
            1 => written(&float(), "a.exr").unwrap(),
            2 => written(&steps(), "a.npy").unwrap(),
            _ => archive(&[("a.npy", &npy("<u2", false, "1, 1", &[1, 0]))]),
        };
        let position = position.index(bytes.len());
        if cut {
            bytes.truncate(position);
        } else {
            bytes[position] = value;
        }
        let _ = decode_gray(name(), &bytes);
        let _ = decode_depth_frame(name(), &bytes);
    }
}
