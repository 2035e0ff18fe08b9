//! The picture on the page.

use depthcal_io::GrayImage;

/// Widest picture, px: wider ones are reduced by a whole factor.
const WIDEST: usize = 960;

/// A grey PNG of 8 bits; brighter than the image where that uses few of its 16 bits. `None` where it cannot be encoded.
pub(crate) fn png_of(image: &GrayImage) -> Option<Vec<u8>> {
    let factor = image.width.div_ceil(WIDEST).max(1);
    let (width, height) = (image.width / factor, image.height / factor);
    let white = if image.bits == 8 { 255.0 } else { brightest(image) };
    let area = (factor * factor) as f32;
    let mut grey = Vec::with_capacity(width * height);
    for row in 0..height {
        for column in 0..width {
            let part = |i: usize| {
                let start = (row * factor + i) * image.width + column * factor;
                image.data[start..start + factor].iter().map(|v| f32::from(*v)).sum::<f32>()
            };
            let mean = (0..factor).map(part).sum::<f32>() / area;
            grey.push((mean * 255.0 / white).min(255.0) as u8);
        }
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, u32::try_from(width).ok()?, u32::try_from(height).ok()?);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().ok()?;
    writer.write_image_data(&grey).ok()?;
    writer.finish().ok()?;
    Some(bytes)
}

/// The value that one of a hundred pixels exceeds, of every seventh.
fn brightest(image: &GrayImage) -> f32 {
    let mut values: Vec<u16> = image.data.iter().copied().step_by(7).collect();
    let place = values.len() * 99 / 100;
    if values.is_empty() {
        return 1.0;
    }
    let (_, value, _) = values.select_nth_unstable(place);
    f32::from((*value).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_and_dark_images_are_shown() {
        let (width, height) = (2000, 90);
        let data = (0..width * height).map(|i| ((i % width) / 2) as u16).collect();
        let bytes = png_of(&GrayImage { width, height, data, bits: 16 }).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut grey = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut grey).unwrap();
        assert_eq!((info.width, info.height), (666, 30));
        assert!(
            grey[0] < 3 && grey[665] > 250 && (i32::from(grey[333]) - 128).abs() < 4,
            "{} {}",
            grey[333],
            grey[665]
        );
    }
}
