//! Raw grey values for fits, which are linear in the light, unlike stretched ones.

use depthcal_io::GrayImage;

/// An image and the grey value at which it is saturated.
pub(crate) struct Pixels<'a> {
    image: &'a GrayImage,
    saturation: f64,
}

impl<'a> Pixels<'a> {
    pub(crate) fn new(image: &'a GrayImage) -> Pixels<'a> {
        // A sensor may saturate below the range of its file; then many pixels have the largest value.
        let top = image.data.iter().copied().max().unwrap_or(0);
        let at_top = image.data.iter().filter(|&&v| v == top).count();
        let full = if image.bits <= 8 { 255 } else { u16::MAX };
        let saturated = top >= full || at_top > image.data.len() / 2000;
        Pixels { image, saturation: if saturated { f64::from(top) } else { f64::INFINITY } }
    }

    pub(crate) fn value(&self, x: usize, y: usize) -> f64 {
        f64::from(self.image.data[y * self.image.width + x])
    }

    /// Measured minus modelled value, and whether the pixel constrains the model. A saturated pixel does not when the
    /// model is as bright as it or brighter: the residual is then 0, and its derivatives are to be taken as 0.
    pub(crate) fn residual(&self, measured: f64, modelled: f64) -> (f64, bool) {
        if measured >= self.saturation && modelled >= measured { (0.0, false) } else { (measured - modelled, true) }
    }

    /// Pixels inside the image whose centres lie in a box.
    pub(crate) fn inside(&self, low: [f64; 2], high: [f64; 2]) -> impl Iterator<Item = [usize; 2]> + use<> {
        let range = |low: f64, high: f64, size: usize| {
            let first = low.ceil().max(0.0);
            let last = high.floor().min(size as f64 - 1.0);
            if first <= last { first as usize..last as usize + 1 } else { 0..0 }
        };
        let columns = range(low[0], high[0], self.image.width);
        range(low[1], high[1], self.image.height).flat_map(move |y| columns.clone().map(move |x| [x, y]))
    }
}
