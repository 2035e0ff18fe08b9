mod formats;

use proptest::prelude::*;

use super::*;

fn gray(bits: u8) -> GrayImage {
    let data = (0..12).map(|i| if bits == 8 { i * 20 } else { i * 5000 }).collect();
    GrayImage { width: 4, height: 3, data, bits }
}

fn png_bytes(color: png::ColorType, depth: png::BitDepth, size: [u32; 2], data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if color == png::ColorType::Indexed {
        encoder.set_palette(vec![0, 0, 0, 255, 255, 255, 255, 0, 0]);
    }
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(data).unwrap();
    writer.finish().unwrap();
    bytes
}

fn name() -> &'static Path {
    Path::new("set/0001.png")
}

#[test]
fn grey_and_depth_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a/image.png");
    for bits in [8, 16] {
        write_gray(&path, &gray(bits)).unwrap();
        assert_eq!(read_gray(&path).unwrap(), gray(bits));
    }
    let depth = DepthImage { width: 4, height: 3, data: gray(16).data };
    write_depth(&path, &depth).unwrap();
    assert_eq!(read_depth(&path).unwrap(), depth);
}

#[test]
fn colour_becomes_luma() {
    use png::{BitDepth::*, ColorType::*};
    let decode = |color, depth, size, data: &[u8]| decode_gray(name(), &png_bytes(color, depth, size, data)).unwrap();
    let image = decode(Rgb, Eight, [2, 1], &[255, 0, 0, 10, 10, 10]);
    assert_eq!((image.data, image.bits), (vec![76, 10], 8));
    assert_eq!(decode(Rgba, Eight, [1, 1], &[0, 255, 0, 0]).data, [150]);
    assert_eq!(decode(Rgb, Sixteen, [1, 1], &[255; 6]).data, [65535]);
    assert_eq!(decode(GrayscaleAlpha, Eight, [1, 1], &[7, 128]).data, [7]);
    assert_eq!(decode(Indexed, Eight, [3, 1], &[0, 1, 2]).data, [0, 255, 76]);
    assert_eq!(decode(Grayscale, Two, [4, 1], &[0b00_01_10_11]).data, [0, 85, 170, 255]);
}

#[test]
fn only_16_bit_grey_is_depth() {
    use png::{BitDepth::*, ColorType::*};
    for (color, depth, data, expected) in [
        (Grayscale, Eight, vec![1], "8-bit grey PNG"),
        (Rgb, Eight, vec![1; 3], "8-bit RGB PNG"),
        (Rgb, Sixteen, vec![1; 6], "16-bit RGB PNG"),
        (Indexed, Eight, vec![1], "8-bit palette PNG"),
    ] {
        let message = decode_depth_frame(name(), &png_bytes(color, depth, [1, 1], &data)).unwrap_err().to_string();
        assert!(message.contains("set/0001.png") && message.contains(expected), "{message}");
        assert!(message.contains("16-bit grey PNG"), "{message}");
    }
    assert!(decode_depth_frame(name(), b"\xff\xd8\xff").unwrap_err().to_string().contains("JPEG"));
    assert!(decode_depth_frame(name(), b"").unwrap_err().to_string().contains("empty"));
}

#[test]
fn a_truncated_png_is_named_wherever_it_is_cut() {
    let data: Vec<u8> = (0..64 * 64 * 2u32).map(|i| (i * i % 251) as u8).collect();
    let bytes = png_bytes(png::ColorType::Grayscale, png::BitDepth::Sixteen, [64, 64], &data);
    assert!(decode_depth_frame(name(), &bytes).is_ok());
    for length in (8..bytes.len()).step_by(7).chain([bytes.len() - 1]) {
        for error in [decode_gray(name(), &bytes[..length]).err(), decode_depth_frame(name(), &bytes[..length]).err()] {
            let message = error.unwrap_or_else(|| panic!("accepted {length} of {} bytes", bytes.len())).to_string();
            assert!(message.contains("set/0001.png"), "{message}");
        }
    }
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 1;
    assert!(decode_gray(name(), &flipped).is_err());
}

#[test]
fn sizes_that_differ_name_both_files() {
    let (image, other) = (Path::new("ir/1.png"), Path::new("depth/1.png"));
    let message = check_same_size((image, [4, 3]), (other, [2, 3])).unwrap_err().to_string();
    for part in ["ir/1.png", "4×3", "depth/1.png", "2×3"] {
        assert!(message.contains(part), "{message}");
    }
    assert!(check_same_size((image, [4, 3]), (other, [4, 3])).is_ok());
}

/// A JPEG whose EXIF data say that it is shown turned, in both byte orders.
#[test]
fn an_image_that_viewers_turn_is_told_by_its_orientation() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("1.jpg");
    let tiffs: [&[u8]; 2] = [
        b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0",
        b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0",
    ];
    for tiff in tiffs {
        let length = (2 + 6 + tiff.len()) as u16;
        let head: &[&[u8]] =
            &[b"\xff\xd8\xff\xe0\0\x04ab\xff\xe1", &length.to_be_bytes(), b"Exif\0\0", tiff, b"\xff\xda"];
        std::fs::write(&path, head.concat()).unwrap();
        let depth = Path::new("depth/1.png");
        let message = check_same_size((&path, [4, 3]), (depth, [3, 4])).unwrap_err().to_string();
        assert!(message.contains("orientation 6") && message.contains("clockwise"), "{message}");
        // A half of the size has another cause.
        let message = check_same_size((&path, [4, 2]), (depth, [2, 1])).unwrap_err().to_string();
        assert!(message.contains("register"), "{message}");
        for cut in 0..head.concat().len() {
            std::fs::write(&path, &head.concat()[..cut]).unwrap();
            assert!(check_same_size((&path, [4, 3]), (depth, [3, 4])).is_err());
        }
    }
    let message = check_same_size((Path::new("a.png"), [4, 3]), (Path::new("b.png"), [3, 4])).unwrap_err().to_string();
    assert!(message.contains("turned by 90°"), "{message}");
}

#[test]
fn pgm_of_8_and_16_bits() {
    let image = decode_gray(name(), b"P5\n# made by hand\n2 1\n255\n\x0a\x20").unwrap();
    assert_eq!(image, GrayImage { width: 2, height: 1, data: vec![10, 32], bits: 8 });
    let image = decode_gray(name(), b"P5 1 2 4095 \x01\x02\x0f\xff").unwrap();
    assert_eq!(image, GrayImage { width: 1, height: 2, data: vec![258, 4095], bits: 16 });
    for bytes in [&b"P5 2 2 255\nabc"[..], b"P5 2", b"P5 2 2 70000\nabcd", b"P5 0 2 255\n", b"P5 -1 2 255\n"] {
        assert!(decode_gray(name(), bytes).unwrap_err().to_string().contains("set/0001.png"));
    }
}

#[test]
fn wrong_data_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.png");
    let broken = GrayImage { width: 4, height: 4, ..gray(8) };
    assert!(write_gray(&path, &broken).unwrap_err().to_string().contains("12 values for 4×4"));
    let broken = GrayImage { bits: 8, ..gray(16) };
    assert!(write_gray(&path, &broken).unwrap_err().to_string().contains("255"));
    assert!(!path.exists());
}

#[test]
fn a_transposed_array_and_files_that_were_not_fetched_are_named() {
    let sizes = |image: &str, depth: &str| {
        check_same_size((Path::new(image), [640, 480]), (Path::new(depth), [480, 640])).unwrap_err().to_string()
    };
    assert!(sizes("a.png", "a.npy").contains("save its transpose"));
    assert!(sizes("a.png", "b.png").contains("turned by 90°"));
    let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n";
    assert!(decode_gray(name(), pointer).unwrap_err().to_string().contains("git lfs pull"));
    assert!(decode_depth_frame(name(), b"<!DOCTYPE html><html>").unwrap_err().to_string().contains("web page"));
}

#[test]
fn files_that_are_no_images_are_named() {
    assert!(read_gray("set/none.png").unwrap_err().to_string().contains("set/none.png"));
    assert!(decode_gray(name(), b"GIF89a").unwrap_err().to_string().contains("PNG, JPEG, TIFF"));
    assert!(decode_gray(name(), b"").unwrap_err().to_string().contains("empty"));
}

/// 16×8 grey pixels of value 16 × column.
const GREY_JPEG: &str = "\
    ffd8ffe000104a46494600010100000100010000ffdb0043000302020302020303030304030304050805050404050a070706080c0a0c\
    0c0b0a0b0b0d0e12100d0e110e0b0b1016101113141515150c0f171816141812141514ffc0000b080008001001011100ffc400150001\
    0100000000000000000000000000000809ffc40017100003010000000000000000000000000000084481ffda0008010100003f001fad\
    b2e15556d970ffd9";

/// 8×8 red pixels.
const RED_JPEG: &str = "\
    ffd8ffe000104a46494600010100000100010000ffdb0043000302020302020303030304030304050805050404050a070706080c0a0c\
    0c0b0a0b0b0d0e12100d0e110e0b0b1016101113141515150c0f171816141812141514ffdb00430103040405040509050509140d0b0d\
    1414141414141414141414141414141414141414141414141414141414141414141414141414141414141414141414141414ffc00011\
    080008000803012200021101031101ffc4001500010100000000000000000000000000000008ffc40014100100000000000000000000\
    000000000000ffc4001501010100000000000000000000000000000709ffc40014110100000000000000000000000000000000ffda00\
    0c03010002110311003f009d00062a9bffd9";

fn from_hex(text: &str) -> Vec<u8> {
    (0..text.len()).step_by(2).map(|i| u8::from_str_radix(&text[i..i + 2], 16).unwrap()).collect()
}

#[test]
fn jpeg_grey_and_colour() {
    let image = decode_gray(name(), &from_hex(GREY_JPEG)).unwrap();
    assert_eq!((image.width, image.height, image.bits, image.data.len()), (16, 8, 8, 128));
    for (i, value) in image.data.iter().enumerate() {
        assert!(value.abs_diff(16 * (i as u16 % 16)) <= 4, "{value} at {i}");
    }
    let image = decode_gray(name(), &from_hex(RED_JPEG)).unwrap();
    assert_eq!((image.width, image.height, image.data.len()), (8, 8, 64));
    assert!(image.data.iter().all(|value| value.abs_diff(76) <= 2), "luma of red: {:?}", image.data);
}

#[test]
fn a_truncated_jpeg_is_named_wherever_it_is_cut() {
    let bytes = from_hex(GREY_JPEG);
    for length in 3..bytes.len() {
        let message = decode_gray(name(), &bytes[..length]).unwrap_err().to_string();
        assert!(message.contains("set/0001.png") && message.contains("JPEG"), "{message}");
    }
}

#[test]
fn a_jpeg_that_claims_more_than_it_holds_is_refused_before_memory_is_allocated() {
    let mut bytes = from_hex(GREY_JPEG);
    let header = bytes.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
    for (size, problem) in [([60_000_u16; 2], "60000"), ([16_000; 2], "too short for the 256000000 bytes")] {
        bytes[header + 5..header + 9].copy_from_slice(&[size[0].to_be_bytes(), size[1].to_be_bytes()].concat());
        let message = decode_gray(name(), &bytes).unwrap_err().to_string();
        assert!(message.contains(problem), "{message}");
    }
}

#[test]
fn any_sampling_of_a_jpeg_is_an_image_or_an_error() {
    let header = from_hex(RED_JPEG);
    let frame = header.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
    let scan = header.windows(2).position(|pair| pair == [0xff, 0xda]).unwrap();
    let one: &[u8] = &[0xff, 0xda, 0, 8, 1, 1, 0, 0, 0x3f, 0];
    let three: &[u8] = &header[scan..scan + 14];
    let (mut decoded, mut refused) = (0, 0);
    let factors = [0x11, 0x12, 0x21, 0x22, 0x14, 0x41, 0x42, 0x44];
    for count in 0..factors.len().pow(3) * 2 {
        let [first, second, third] = [1, 8, 64].map(|place| factors[count / 2 / place % 8]);
        let mut bytes = header[..scan].to_vec();
        bytes[frame + 6] = 16;
        bytes[frame + 8] = 40;
        for (component, sampling) in [first, second, third].into_iter().enumerate() {
            bytes[frame + 11 + 3 * component] = sampling;
        }
        // What is no segment is passed over.
        bytes.splice(frame..frame, [0xff, 0x00].repeat(count % 3));
        bytes.extend([if count % 2 == 0 { one } else { three }, &[0; 400], &[0xff, 0xd9]].concat());
        for image in [decode_gray(name(), &bytes).map(|_| ()), decode_rgb(name(), &bytes).map(|_| ())] {
            // What the decoder panics at is known beforehand.
            let message = image.err().map(|error| error.to_string()).unwrap_or_default();
            assert!(!message.contains("do not fit together"), "{first:x} {second:x} {third:x}: {message}");
            decoded += usize::from(message.is_empty());
            refused += usize::from(message.contains("sampled more coarsely"));
        }
    }
    assert!(decoded > 100 && refused > 1000, "{decoded} were decoded, {refused} refused");
}

proptest! {
    #[test]
    fn damaged_jpeg_is_no_panic(position in any::<prop::sample::Index>(), value in any::<u8>(), red in any::<bool>()) {
        let mut bytes = from_hex(if red { RED_JPEG } else { GREY_JPEG });
        let position = position.index(bytes.len());
        bytes[position] = value;
        let _ = decode_gray(name(), &bytes);
    }

    #[test]
    fn any_bytes_are_no_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let png = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR";
        for start in [&b""[..], &png[..8], png, b"\xff\xd8\xff", b"P5 3 3 255 "] {
            let mut file = start.to_vec();
            file.extend(&bytes);
            let _ = decode_gray(name(), &file);
            let _ = decode_depth_frame(name(), &file);
        }
    }

    #[test]
    fn damaged_png_is_no_panic(position in 8usize..200, value in any::<u8>()) {
        let mut bytes = png_bytes(png::ColorType::Grayscale, png::BitDepth::Eight, [16, 16], &[77; 256]);
        let position = position % bytes.len();
        bytes[position] = value;
        let _ = decode_gray(name(), &bytes);
    }
}
