//! A board that was found in part, extended marker by marker.
//!
//! Tags that were read give the first corners. From there every further corner is predicted from the corners around it
//! and fitted to the grey values, so that corners beside tags that cannot be read (blur, small tags, a tag cut off by the
//! image border) are found as well. Predictions are local: perspective and lens hardly matter, and nothing is
//! extrapolated by more than one step.

use std::collections::BTreeMap;

use depthcal_io::GrayImage;
use depthcal_model::target::{Pattern, Target};

use super::neighbours::{local_map, near};
use super::strays::without_strays;
use crate::detection::Marker;
use crate::geometry::Homography;
use crate::refine::pixels::Pixels;
use crate::refine::{RefineOptions, fit_corner, standard_deviation};

/// Least contrast of a corner, relative to the median of the corners around it.
const LEAST_CONTRAST: f64 = 0.35;
/// Largest standard deviation of a coordinate of a fitted corner, px.
const MAX_STD_PX: f64 = 0.35;
/// Largest standard deviation of the blur, relative to the distance within which nothing else is printed: beyond, the tag
/// beside a crossing displaces it.
const MAX_BLUR: f64 = 0.3;
/// Distance from the image border, px, within which a corner's surroundings are not seen on all sides.
const BORDER_PX: f64 = 2.0;

/// A corner that was fitted.
#[derive(Debug, Clone, Copy)]
struct Corner {
    pixel: [f64; 2],
    /// Grey values, with the sign that tells dark squares from bright ones.
    contrast: f64,
}

/// Fits the corners `seeds` (px, where they are about), then all that follow from them; in ascending order of the index.
/// Corners that cannot be fitted, that end away from their predicted position, whose dark and bright squares are
/// exchanged or that disagree with the corners around them are left out.
pub(super) fn extend(image: &GrayImage, target: &Target, seeds: &[Marker]) -> Vec<Marker> {
    let search = Search { image, pixels: Pixels::new(image), target };
    let mut corners: BTreeMap<usize, Corner> = BTreeMap::new();
    let places: BTreeMap<usize, [f64; 2]> = seeds.iter().map(|m| (m.index, m.pixel)).collect();
    for seed in seeds {
        let Some(map) = local_map(target, seed.index, true, &places) else { continue };
        if let Some(corner) = search.fit(seed.index, seed.pixel, &map) {
            corners.insert(seed.index, corner);
        }
    }
    search.keep_polarity(&mut corners);
    // How many corners were around a corner when it was last tried.
    let mut tried: BTreeMap<usize, usize> = BTreeMap::new();
    loop {
        let mut frontier: Vec<(usize, usize)> = (0..target.len())
            .filter(|index| !corners.contains_key(index))
            .map(|index| (near(target, index, false, corners.keys().copied()).len(), index))
            .filter(|(support, index)| *support >= 4 && tried.get(index).is_none_or(|before| before < support))
            .collect();
        // Those with most support first: they are predicted best, and once found they support the others.
        frontier.sort_by_key(|(support, index)| (std::cmp::Reverse(*support), *index));
        let before = corners.len();
        for (support, index) in frontier {
            tried.insert(index, support);
            let places = corners.iter().map(|(&i, c)| (i, c.pixel)).collect();
            let Some(map) = local_map(target, index, false, &places) else { continue };
            let Some(place) = map.apply(target.point(index)) else { continue };
            if let Some(corner) = search.fit(index, place, &map).filter(|c| search.belongs(index, c, &corners)) {
                corners.insert(index, corner);
            }
        }
        if corners.len() == before {
            break;
        }
    }
    let markers = corners.iter().map(|(&index, corner)| Marker { index, pixel: corner.pixel }).collect();
    without_strays(markers, target)
}

struct Search<'a> {
    image: &'a GrayImage,
    pixels: Pixels<'a>,
    target: &'a Target,
}

impl Search<'_> {
    /// The corner `index` near `place` (px), when there is one and it lies where it is expected.
    fn fit(&self, index: usize, place: [f64; 2], map: &Homography) -> Option<Corner> {
        let (width, height) = (self.image.width as f64, self.image.height as f64);
        let inside = |p: [f64; 2], border: f64| {
            (border..width - 1.0 - border).contains(&p[0]) && (border..height - 1.0 - border).contains(&p[1])
        };
        if !inside(place, BORDER_PX) {
            return None;
        }
        let [x, y] = self.target.point(index);
        // Tags have corners inside, which must not be taken for the outer ones; crossings have tags around them.
        let (length, share) = match self.target.pattern {
            Pattern::Aprilgrid { marker_mm } => (marker_mm, 0.06),
            _ => (self.target.spacing_mm, 0.15),
        };
        let origin = map.apply([x, y])?;
        let (right, down) = (map.apply([x + length, y])?, map.apply([x, y + length])?);
        let step =
            (right[0] - origin[0]).hypot(right[1] - origin[1]).min((down[0] - origin[0]).hypot(down[1] - origin[1]));
        let options = RefineOptions::default();
        let marker = Marker { index, pixel: place };
        let (fitted, clear_px) = fit_corner(&self.pixels, self.target, &marker, &|p| map.apply(p), &options)?;
        let moved = (fitted.pixel[0] - place[0]).hypot(fitted.pixel[1] - place[1]);
        let sharp = fitted.width_px < MAX_BLUR * clear_px;
        let good = sharp
            && moved < share * step + 0.5
            && standard_deviation(&fitted.covariance) < MAX_STD_PX
            && inside(fitted.pixel, BORDER_PX.max(2.0 * fitted.width_px));
        good.then_some(Corner { pixel: fitted.pixel, contrast: fitted.contrast })
    }

    /// 1 or −1: corners with the same value have the same sign of the contrast.
    fn parity(&self, index: usize) -> f64 {
        match self.target.pattern {
            Pattern::Charuco { .. } => {
                let columns = self.target.columns - 1;
                if (index % columns + index / columns).is_multiple_of(2) { 1.0 } else { -1.0 }
            }
            _ => 1.0,
        }
    }

    /// Drops corners whose dark and bright sides are not those of most others.
    fn keep_polarity(&self, corners: &mut BTreeMap<usize, Corner>) {
        let positive = corners.iter().filter(|(i, c)| c.contrast * self.parity(**i) > 0.0).count();
        let sign = if 2 * positive >= corners.len() { 1.0 } else { -1.0 };
        corners.retain(|&index, corner| corner.contrast * self.parity(index) * sign > 0.0);
    }

    /// Whether a corner has the polarity and about the contrast of the corners around it.
    fn belongs(&self, index: usize, corner: &Corner, corners: &BTreeMap<usize, Corner>) -> bool {
        let mut contrasts: Vec<f64> = near(self.target, index, false, corners.keys().copied())
            .into_iter()
            .map(|i| corners[&i].contrast * self.parity(i))
            .collect();
        contrasts.sort_by(f64::total_cmp);
        let Some(&median) = contrasts.get(contrasts.len() / 2) else { return false };
        let contrast = corner.contrast * self.parity(index);
        contrast * median > 0.0 && contrast.abs() > LEAST_CONTRAST * median.abs()
    }
}
