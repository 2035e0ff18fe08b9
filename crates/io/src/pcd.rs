//! Point clouds in PCD, the format of the Point Cloud Library.

use std::path::Path;

use crate::file::{FileError, write_atomically};
use crate::ply::Cloud;

/// Writes a cloud as binary PCD (version 0.7), atomically: fields x, y, z and, where given, intensity, as 32-bit floats, and rgb,
/// which holds 0x00RRGGBB in the bits of a float, as PCL's own files do. The cloud is unorganised.
///
/// # Errors
/// As [`write_ply`](crate::ply::write_ply).
pub fn write_pcd(path: impl AsRef<Path>, cloud: &Cloud) -> Result<(), FileError> {
    write_pcd_file(path.as_ref(), cloud)
}

fn write_pcd_file(path: &Path, cloud: &Cloud) -> Result<(), FileError> {
    cloud.check(path)?;
    let (points, intensity, color) = (&cloud.points, cloud.intensity.as_deref(), cloud.color.as_deref());
    let fields: Vec<&str> =
        ["x", "y", "z"].into_iter().chain(intensity.map(|_| "intensity")).chain(color.map(|_| "rgb")).collect();
    let each = |word: &str| vec![word; fields.len()].join(" ");
    write_atomically(path, |writer| {
        write!(
            writer,
            "# .PCD v0.7 - depthcal: millimetres, x right, y down, z forward\nVERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT {}\n\
             WIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA binary\n",
            fields.join(" "),
            each("4"),
            each("F"),
            each("1"),
            n = points.len()
        )?;
        for (i, point) in points.iter().enumerate() {
            for number in point.iter().chain(intensity.map(|values| &values[i])) {
                writer.write_all(&number.to_le_bytes())?;
            }
            if let Some([r, g, b]) = color.map(|values| values[i]) {
                writer.write_all(&[b, g, r, 0])?;
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn header_and_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cloud.pcd");
        let cloud = Cloud {
            points: vec![[1.0, -2.0, 1000.5], [0.25, 0.0, 3.0]],
            intensity: Some(vec![7.0, 8.0]),
            color: Some(vec![[1, 2, 3], [255, 0, 9]]),
        };
        write_pcd(&path, &cloud).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let head = bytes.windows(12).position(|w| w == b"DATA binary\n").unwrap() + 12;
        let text = std::str::from_utf8(&bytes[..head]).unwrap();
        for line in ["FIELDS x y z intensity rgb", "SIZE 4 4 4 4 4", "TYPE F F F F F", "WIDTH 2", "POINTS 2"] {
            assert!(text.lines().any(|l| l == line), "{text}");
        }
        let expected: Vec<u8> =
            [1.0_f32, -2.0, 1000.5, 7.0].iter().flat_map(|v| v.to_le_bytes()).chain([3, 2, 1, 0]).collect();
        assert_eq!((bytes.len() - head, &bytes[head..head + 20]), (40, &expected[..]));
        let broken = Cloud { points: vec![[f32::NAN; 3]], ..Cloud::default() };
        assert!(write_pcd(&path, &broken).unwrap_err().to_string().contains("points[0]"));
    }
}
