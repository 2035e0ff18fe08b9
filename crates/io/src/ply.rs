//! Point clouds in PLY.

use std::path::Path;

use crate::file::{FileError, write_atomically};

/// A point cloud, with one intensity and one colour per point where they are known.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cloud {
    /// Points [x, y, z] in mm, in the camera frame (x right, y down, z forward).
    pub points: Vec<[f32; 3]>,
    /// One value per point, such as the infrared amplitude.
    pub intensity: Option<Vec<f32>>,
    /// One colour per point: red, green, blue.
    pub color: Option<Vec<[u8; 3]>>,
}

impl Cloud {
    /// Checks that every point is finite and has its intensity and colour; `path` is for the error.
    pub(crate) fn check(&self, path: &Path) -> Result<(), FileError> {
        let points = &self.points;
        let invalid = |field: String, problem: String| FileError::Invalid { path: path.to_owned(), field, problem };
        let intensity = self.intensity.as_deref();
        if let Some(values) = intensity.filter(|values| values.len() != points.len()) {
            let problem = format!("has {} values for {} points", values.len(), points.len());
            return Err(invalid("intensity".into(), problem));
        }
        let color = self.color.as_deref();
        if let Some(values) = color.filter(|values| values.len() != points.len()) {
            return Err(invalid("color".into(), format!("has {} values for {} points", values.len(), points.len())));
        }
        if let Some(i) = points.iter().position(|point| !point.iter().all(|x| x.is_finite())) {
            return Err(invalid(format!("points[{i}]"), "is not finite: leave pixels without depth out".into()));
        }
        Ok(())
    }
}

/// Writes a cloud as binary PLY, little-endian, atomically: one element `vertex` with float properties x, y, z and,
/// where given, intensity, and uchar properties red, green, blue.
///
/// # Errors
/// [`FileError::Invalid`] when there are not as many intensities or colours as points, or when a coordinate is not
/// finite (pixels without depth must be left out of the cloud); [`FileError::Write`].
pub fn write_ply(path: impl AsRef<Path>, cloud: &Cloud) -> Result<(), FileError> {
    write_ply_file(path.as_ref(), cloud)
}

fn write_ply_file(path: &Path, cloud: &Cloud) -> Result<(), FileError> {
    cloud.check(path)?;
    let (points, intensity, color) = (&cloud.points, cloud.intensity.as_deref(), cloud.color.as_deref());

    let property = if intensity.is_some() { "property float intensity\n" } else { "" };
    let channels = if color.is_some() { "property uchar red\nproperty uchar green\nproperty uchar blue\n" } else { "" };
    write_atomically(path, |writer| {
        write!(
            writer,
            "ply\nformat binary_little_endian 1.0\ncomment depthcal: millimetres, x right, y down, z forward\nelement vertex {}\n\
             property float x\nproperty float y\nproperty float z\n{property}{channels}end_header\n",
            points.len()
        )?;
        for (i, point) in points.iter().enumerate() {
            let value = intensity.map(|values| values[i]);
            for number in point.iter().chain(&value) {
                writer.write_all(&number.to_le_bytes())?;
            }
            if let Some(color) = color {
                writer.write_all(&color[i])?;
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(cloud: &Cloud) -> Result<Vec<u8>, FileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cloud.ply");
        write_ply(&path, cloud)?;
        Ok(std::fs::read(&path).unwrap())
    }

    #[test]
    fn binary_with_intensity() {
        let cloud = Cloud { points: vec![[1.0, 2.0, 3.0]; 2], intensity: Some(vec![4.0, 5.0]), color: None };
        let bytes = written(&cloud).unwrap();
        let head = b"end_header\n";
        let start = bytes.windows(head.len()).position(|window| window == head).unwrap() + head.len();
        let numbers: Vec<f32> =
            bytes[start..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(numbers, [1.0, 2.0, 3.0, 4.0, 1.0, 2.0, 3.0, 5.0]);
        let head = String::from_utf8_lossy(&bytes[..start]);
        assert!(head.contains("binary_little_endian 1.0") && head.contains("property float intensity"));
    }

    #[test]
    fn colours_follow_the_numbers() {
        let color = Some(vec![[1, 2, 3], [255, 0, 9]]);
        let cloud = Cloud { points: vec![[1.0, 2.0, 3.0]; 2], intensity: Some(vec![4.0, 5.0]), color };
        let bytes = written(&cloud).unwrap();
        let head = String::from_utf8_lossy(&bytes);
        assert!(
            head.contains("intensity\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n")
        );
        // Four numbers of four bytes and three of one.
        assert_eq!([&bytes[bytes.len() - 22..][..3], &bytes[bytes.len() - 3..]], [[1, 2, 3], [255, 0, 9]]);
        let short = Cloud { color: Some(vec![[0; 3]]), ..cloud };
        assert!(written(&short).unwrap_err().to_string().contains("1 values for 2 points"));
    }

    #[test]
    fn faults_are_named() {
        let cloud = Cloud { points: vec![[1.0, 2.0, f32::NAN]], intensity: None, color: None };
        assert!(written(&cloud).unwrap_err().to_string().contains("points[0]"));
        let cloud = Cloud { points: vec![[1.0; 3]], intensity: Some(vec![]), color: None };
        assert!(written(&cloud).unwrap_err().to_string().contains("0 values for 1 points"));
        assert!(written(&Cloud::default()).is_ok());
    }
}
