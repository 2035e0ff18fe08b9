//! Images and depth against the programs that own their formats: frames bit-equal. Skipped where Python or a package is absent.

use std::path::Path;

use crate::python;
use depthcal_io::{DepthFrame, DepthValues, read_depth_frame, read_gray, read_rgb, write_depth_frame};

const WIDTH: usize = 37;
const HEIGHT: usize = 23;

/// Value of pixel `i` in the scripts' files too: 16-bit steps over the whole range.
fn step(i: usize) -> u16 {
    (i * 2654435761 % 65536) as u16
}

/// Metres with all bits of a float in use, and values that are no measurement.
fn metres(i: usize) -> f32 {
    match i {
        0 => f32::NAN,
        1 => f32::INFINITY,
        2 => 0.0,
        3 => -1.5,
        _ => ((i * 2654435761 % 16777216) as f64 / 8388608.0 + 0.25) as f32,
    }
}

const ARRAYS: &str = "
import sys, numpy as np
folder = sys.argv[1]
W, H = 37, 23
i = np.arange(W * H, dtype=np.uint64)
steps = (i * 2654435761 % 65536).astype(np.uint16).reshape(H, W)
metres = ((i * 2654435761 % 16777216).astype(np.float64) / 8388608.0 + 0.25).astype(np.float32)
metres[:4] = [np.nan, np.inf, 0.0, -1.5]
metres = metres.reshape(H, W)
";

fn bits(path: &Path) -> (usize, usize, Vec<u32>) {
    let frame = read_depth_frame(path).unwrap_or_else(|error| panic!("{error}"));
    let values = match &frame.values {
        DepthValues::Steps(values) => values.iter().map(|v| u32::from(*v)).collect(),
        DepthValues::Float(values) => values.iter().map(|v| v.to_bits()).collect(),
    };
    (frame.width, frame.height, values)
}

fn check(folder: &Path, steps: &[&str], floats: &[&str]) {
    let n = WIDTH * HEIGHT;
    for name in steps {
        assert_eq!(bits(&folder.join(name)), (WIDTH, HEIGHT, (0..n).map(|i| u32::from(step(i))).collect()), "{name}");
    }
    for name in floats {
        assert_eq!(bits(&folder.join(name)), (WIDTH, HEIGHT, (0..n).map(|i| metres(i).to_bits()).collect()), "{name}");
    }
}

/// Depth as we write it, in a folder.
fn ours(folder: &Path, extensions: &[&str]) {
    let n = WIDTH * HEIGHT;
    for extension in extensions {
        if *extension != "exr" {
            let values = DepthValues::Steps((0..n).map(step).collect());
            write_depth_frame(
                folder.join(format!("ours_u16.{extension}")),
                &DepthFrame { width: WIDTH, height: HEIGHT, values },
            )
            .unwrap();
        }
        if !["png", "pgm"].contains(extension) {
            let values = DepthValues::Float((0..n).map(metres).collect());
            write_depth_frame(
                folder.join(format!("ours_f32.{extension}")),
                &DepthFrame { width: WIDTH, height: HEIGHT, values },
            )
            .unwrap();
        }
    }
}

#[test]
fn numpy_arrays() {
    let Some(python) = python::with_modules(&["numpy"]) else { return };
    let folder = python::folder("numpy");
    ours(&folder, &["npy"]);
    let code = format!(
        "{ARRAYS}
np.save(f'{{folder}}/u16.npy', steps); np.save(f'{{folder}}/f32.npy', metres)
np.save(f'{{folder}}/fortran.npy', np.asfortranarray(steps)); np.save(f'{{folder}}/big.npy', steps.astype('>u2'))
np.save(f'{{folder}}/f64.npy', metres.astype(np.float64)); np.save(f'{{folder}}/one.npy', metres[..., None])
np.savez(f'{{folder}}/plain.npz', depth=steps, other=metres); np.savez_compressed(f'{{folder}}/small.npz', metres)
np.save(f'{{folder}}/i32.npy', np.where(steps == 65535, 0, steps).astype(np.int32))
np.save(f'{{folder}}/rgb.npy', np.dstack([steps % 256] * 3).astype(np.uint8))
assert np.array_equal(np.load(f'{{folder}}/ours_u16.npy'), steps)
assert np.array_equal(np.load(f'{{folder}}/ours_f32.npy').view(np.uint32), metres.view(np.uint32))
"
    );
    python.run(&code, &[&folder]);
    check(
        &folder,
        &["u16.npy", "fortran.npy", "big.npy", "plain.npz", "ours_u16.npy"],
        &["f32.npy", "f64.npy", "one.npy", "small.npz"],
    );
    let whole = (0..WIDTH * HEIGHT).map(|i| if step(i) == 65535 { 0 } else { u32::from(step(i)) }).collect();
    assert_eq!(bits(&folder.join("i32.npy")), (WIDTH, HEIGHT, whole));
    let colour = read_rgb(folder.join("rgb.npy")).unwrap();
    assert!((0..WIDTH * HEIGHT).all(|i| colour.data[i] == [(step(i) % 256) as u8; 3]));
}

#[test]
fn tiff_of_tifffile() {
    let Some(python) = python::with_modules(&["tifffile", "numpy", "imagecodecs"]) else { return };
    let folder = python::folder("tiff");
    ours(&folder, &["tif"]);
    let code = format!(
        "{ARRAYS}
import tifffile as t
w = lambda name, a, **k: t.imwrite(f'{{folder}}/{{name}}', a, **k)
w('u16.tif', steps); w('f32.tif', metres); w('big.tif', steps, byteorder='>'); w('bigtiff.tif', metres, bigtiff=True)
w('deflate.tif', steps, compression='zlib', predictor=True); w('lzw.tif', steps, compression='lzw')
w('float.tif', metres, compression='zlib', predictor=True); w('strips.tif', metres, rowsperstrip=5)
w('tiles.tif', metres, tile=(16, 16), compression='zlib'); w('imagej.tif', steps, imagej=True)
w('grey.tif', (steps % 256).astype(np.uint8)); w('rgb.tif', np.dstack([steps % 256] * 3).astype(np.uint8), photometric='rgb')
assert np.array_equal(t.imread(f'{{folder}}/ours_u16.tif'), steps)
assert np.array_equal(t.imread(f'{{folder}}/ours_f32.tif').view(np.uint32), metres.view(np.uint32))
"
    );
    python.run(&code, &[&folder]);
    check(
        &folder,
        &["u16.tif", "big.tif", "deflate.tif", "lzw.tif", "imagej.tif"],
        &["f32.tif", "bigtiff.tif", "float.tif", "strips.tif", "tiles.tif"],
    );
    for name in ["grey.tif", "rgb.tif"] {
        let grey = read_gray(folder.join(name)).unwrap();
        assert!((0..WIDTH * HEIGHT).all(|i| grey.data[i] == step(i) % 256), "{name}");
    }
}

#[test]
fn exr_of_openexr() {
    let Some(python) = python::with_modules(&["OpenEXR", "numpy"]) else { return };
    let folder = python::folder("exr");
    ours(&folder, &["exr"]);
    let code = format!(
        "{ARRAYS}
import OpenEXR as E
def w(name, channels, compression):
    header = {{'compression': compression, 'type': E.scanlineimage}}
    E.File(header, channels).write(f'{{folder}}/{{name}}')
w('none.exr', {{'Z': metres}}, E.NO_COMPRESSION); w('zip.exr', {{'Y': metres}}, E.ZIP_COMPRESSION)
w('zips.exr', {{'depth': metres}}, E.ZIPS_COMPRESSION); w('rle.exr', {{'Z': metres}}, E.RLE_COMPRESSION)
w('piz.exr', {{'Z': metres, 'A': metres * 0 + 1}}, E.PIZ_COMPRESSION)
w('u32.exr', {{'Z': np.where(steps == 65535, 0, steps).astype(np.uint32)}}, E.ZIP_COMPRESSION)
w('half.exr', {{'Y': (steps % 1024).astype(np.float16)}}, E.ZIP_COMPRESSION)
with E.File(f'{{folder}}/ours_f32.exr') as f:
    assert np.array_equal(f.channels()['Z'].pixels.view(np.uint32), metres.view(np.uint32))
"
    );
    python.run(&code, &[&folder]);
    check(&folder, &[], &["none.exr", "zip.exr", "zips.exr", "rle.exr", "piz.exr"]);
    let whole = (0..WIDTH * HEIGHT).map(|i| if step(i) == 65535 { 0 } else { u32::from(step(i)) }).collect();
    assert_eq!(bits(&folder.join("u32.exr")), (WIDTH, HEIGHT, whole));
    let half = bits(&folder.join("half.exr")).2;
    assert!(half.iter().enumerate().all(|(i, v)| f32::from_bits(*v) == f32::from(step(i) % 1024)));
}

#[test]
fn png_pgm_and_ppm_of_opencv() {
    let Some(python) = python::with_modules(&["cv2", "numpy"]) else { return };
    let folder = python::folder("opencv");
    ours(&folder, &["png", "pgm", "tif"]);
    let code = format!(
        "{ARRAYS}
import cv2
for e in ['png', 'pgm', 'tif']:
    cv2.imwrite(f'{{folder}}/u16.{{e}}', steps)
    assert np.array_equal(cv2.imread(f'{{folder}}/ours_u16.{{e}}', cv2.IMREAD_UNCHANGED), steps), e
cv2.imwrite(f'{{folder}}/f32.tif', metres)
cv2.imwrite(f'{{folder}}/rgb.ppm', np.dstack([steps % 256, steps // 256, steps % 7]).astype(np.uint8)[..., ::-1])
"
    );
    python.run(&code, &[&folder]);
    check(&folder, &["u16.png", "u16.pgm", "u16.tif"], &["f32.tif"]);
    let colour = read_rgb(folder.join("rgb.ppm")).unwrap();
    let expected = |i: usize| [step(i) % 256, step(i) / 256, step(i) % 7].map(|v| v as u8);
    assert!((0..WIDTH * HEIGHT).all(|i| colour.data[i] == expected(i)));
}

#[test]
fn clouds_of_open3d() {
    let Some(python) = python::with_modules(&["open3d", "numpy"]) else { return };
    let folder = python::folder("clouds");
    let points: Vec<[f32; 3]> = (0..1000).map(|i| [metres(i + 4), -metres(i + 5), 1000.0 * metres(i + 6)]).collect();
    let color = (0..1000).map(|i| [i as u8, (i / 4) as u8, 7]).collect();
    let cloud = depthcal_io::Cloud { points: points.clone(), intensity: None, color: Some(color) };
    depthcal_io::write_pcd(folder.join("a.pcd"), &cloud).unwrap();
    depthcal_io::write_ply(folder.join("a.ply"), &cloud).unwrap();
    let code = "
import sys, numpy as np, open3d as o
for name in ['a.pcd', 'a.ply']:
    cloud = o.io.read_point_cloud(f'{sys.argv[1]}/{name}')
    points, colours = np.asarray(cloud.points).astype(np.float32), np.asarray(cloud.colors) * 255
    i = np.arange(1000)
    assert np.allclose(colours, np.dstack([i % 256, i // 4, i * 0 + 7])[0]), name
    points.tofile(f'{sys.argv[1]}/{name}.raw')
";
    python.run(code, &[&folder]);
    let expected: Vec<u8> = points.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    for name in ["a.pcd.raw", "a.ply.raw"] {
        assert!(std::fs::read(folder.join(name)).unwrap() == expected, "{name}");
    }
}
