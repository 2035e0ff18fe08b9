//! Classification of a camera's pieces: what each depends on, and how it depends on depth.
//!
//! Users add pieces of their own, so no list of names can be complete. A piece is evaluated instead: a quantity that
//! changes no bit of its value at sampled pixels and depths is one that it does not depend on.

use depthcal_model::{
    Camera, Context, Covariate, MOST_QUANTITIES, Modulation, Quantities, Quantity, StrayLight, needed_light,
};

use crate::conventions::{TYPICAL_RHO, pixel};
use crate::needs::Needs;

/// Depths at which pieces are evaluated, mm; no two differ by a multiple of a round period.
const DEPTHS_MM: [f64; 4] = [413.0, 907.0, 1733.0, 3109.0];
/// Sampled pixels along each side of the image.
const GRID: usize = 5;

/// The quantities that users record on which pieces of a camera may depend.
fn quantities(camera: &Camera) -> Vec<Quantity> {
    let needs = camera.blocks().iter().filter_map(|block| block.piece()).flat_map(|piece| piece.needs());
    let mut quantities: Vec<Quantity> = needs
        .filter_map(|covariate| match covariate {
            Covariate::Quantity(quantity) => Some(*quantity),
            _ => None,
        })
        .collect();
    quantities.sort_unstable();
    quantities.dedup();
    quantities
}

/// Usual values of these quantities.
pub(crate) fn some_quantities(camera: &Camera) -> Quantities {
    Quantities::new(quantities(camera).into_iter().map(|quantity| {
        let [low, high] = quantity.typical_range();
        (quantity, low + 0.37 * (high - low))
    }))
}

/// The context that others are compared with.
fn reference(camera: &Camera) -> Context {
    let stray = StrayLight { scene: [[1.1, -0.4], [-0.7, 0.9], [0.3, 1.2]], near: 1.07 };
    let (amplitude, surround, slope) = (1711.0, 1500.0, [0.01, -0.02]);
    let quantities = some_quantities(camera);
    Context { amplitude, surround, slope, stray, temperature_c: 21.3, quantities, ..Context::default() }
}

/// Sampled pixels, on a regular grid over the image.
fn pixels(camera: &Camera) -> impl Iterator<Item = [f64; 2]> {
    let coordinate = |i: usize, size: usize| (i * (size - 1)) as f64 / (GRID - 1) as f64;
    let (width, height) = (camera.width, camera.height);
    (0..GRID * GRID).map(move |i| [coordinate(i % GRID, width).round(), coordinate(i / GRID, height).round()])
}

/// Two contexts that differ from a reference in a single quantity, which `change` multiplies by a factor.
fn changed(reference: &Context, change: impl Fn(&mut Context, f64)) -> [Context; 2] {
    [0.37, 2.9].map(|factor| {
        let mut context = *reference;
        change(&mut context, factor);
        context
    })
}

fn times(reference: &Context) -> [Context; 2] {
    changed(reference, |c, factor| c.time_s = 1000.0 * factor)
}

fn temperatures(reference: &Context) -> [Context; 2] {
    changed(reference, |c, factor| c.temperature_c *= factor)
}

fn recorded(reference: &Context, which: impl Fn(Quantity) -> bool) -> [Context; 2] {
    changed(reference, |c, factor| {
        let all = c
            .quantities
            .iter()
            .map(|(quantity, value)| (quantity, if which(quantity) { value * factor } else { value }));
        c.quantities = Quantities::new(all.collect::<Vec<_>>());
    })
}

fn amplitudes(reference: &Context) -> [Context; 2] {
    changed(reference, |c, factor| c.amplitude *= factor)
}

fn surroundings(reference: &Context) -> [Context; 2] {
    changed(reference, |c, factor| {
        c.surround *= factor;
        c.slope = c.slope.map(|slope| slope * factor);
    })
}

fn lights(reference: &Context) -> [Context; 2] {
    changed(reference, |c, factor| {
        c.stray.scene.as_flattened_mut().iter_mut().for_each(|part| *part *= factor as f32);
        c.stray.near *= factor as f32;
    })
}

/// The modulation frequencies of the first piece that depends on the light of a frame.
pub(crate) fn modulation(camera: &Camera) -> Option<Modulation> {
    needed_light(camera.blocks().iter().filter_map(|block| block.piece()).map(|piece| &**piece))
}

/// Whether the true ray of a pixel is the same at every depth and in every frame.
pub(crate) fn rays_are_fixed(camera: &Camera) -> bool {
    let reference = reference(camera);
    pixels(camera).all(|pixel| {
        let ray = |context: &Context, rho: f64| {
            let ray = camera.ray(camera.image_pixel(&Context { pixel, ..*context }), rho);
            // Equal bits, so that a lens with a small dependence on depth is not taken for one without.
            ray.map(|r| r.map(f64::to_bits)).ok()
        };
        let usual = ray(&reference, TYPICAL_RHO);
        let other_depths = DEPTHS_MM.iter().all(|z| ray(&reference, 1.0 / z) == usual);
        let of_frame = [times(&reference), temperatures(&reference), recorded(&reference, |_| true)].concat();
        let others = [of_frame, amplitudes(&reference).to_vec(), vec![Context::default()]];
        other_depths && others.iter().flatten().all(|context| ray(context, TYPICAL_RHO) == usual)
    })
}

/// Quantities that the camera's depth pieces depend on besides depth and pixel.
pub(crate) fn needs(camera: &Camera) -> Needs {
    let measured = |context: &Context, cosine: f64| -> Vec<u64> {
        let sampled = pixels(camera).flat_map(|pixel| DEPTHS_MM.map(|z| (pixel, 1.0 / z)));
        sampled
            .filter_map(|(pixel, rho)| {
                let context = Context { pixel, ..*context };
                let ray = camera.ray(camera.image_pixel(&context), rho).ok()?;
                Some(camera.measured_inverse_depth(&context, ray, cosine, rho).to_bits())
            })
            .collect()
    };
    let reference = &reference(camera);
    let usual = measured(reference, 1.0);
    let depends = |contexts: [Context; 2]| contexts.iter().any(|context| measured(context, 1.0) != usual);
    let (stray_light, surroundings) = (depends(lights(reference)), depends(surroundings(reference)));
    let mut needed = quantities(camera).into_iter().filter(|quantity| depends(recorded(reference, |q| q == *quantity)));
    let quantities: [Option<Quantity>; MOST_QUANTITIES] = std::array::from_fn(|_| needed.next());
    Needs {
        time: depends(times(reference)),
        temperature: depends(temperatures(reference)),
        quantities,
        amplitude: stray_light || surroundings || depends(amplitudes(reference)),
        surroundings,
        stray_light,
        incidence: [0.4, 0.8].iter().any(|cosine| measured(reference, *cosine) != usual),
    }
}

/// The form of a depth piece as a function of depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    /// ρ_m = a + b ρ.
    AffineInInverse,
    /// z_m = m z + c.
    AffineInDepth,
    /// Any other function.
    Other,
}

/// The quantities that a depth piece depends on besides depth, and its form as a function of depth.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PieceClass {
    /// Whether it depends on the pixel or its ray.
    pub pixel: bool,
    /// Whether it depends on the time, the temperature or another quantity of the frame.
    pub frame: bool,
    /// Whether it depends on the infrared amplitude of the pixel.
    pub amplitude: bool,
    /// Whether it depends on the infrared amplitude around the pixel.
    pub surroundings: bool,
    /// Whether it depends on the light of the whole frame.
    pub light: bool,
    /// Whether it depends on the angle of incidence.
    pub incidence: bool,
    pub shape: Shape,
}

impl PieceClass {
    /// Whether it is the same in every frame, whatever the frame shows.
    pub fn is_static(&self) -> bool {
        !(self.frame || self.amplitude || self.surroundings || self.light || self.incidence)
    }
}

/// A pixel's observation of a depth.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Observation {
    pub context: Context,
    /// (x, y).
    pub ray: [f64; 2],
    /// Cosine of the angle of incidence.
    pub cosine: f64,
    /// True inverse depth, 1/mm.
    pub rho: f64,
}

/// A piece that is affine in depth or in inverse depth is known from its values at two inverse depths, 1/mm.
pub(crate) fn affine_at(shape: Shape) -> [f64; 2] {
    match shape {
        Shape::AffineInInverse => [0.0, TYPICAL_RHO],
        _ => [1.0 / DEPTHS_MM[0], 1.0 / DEPTHS_MM[3]],
    }
}

/// a (1/mm) and b of ρ_m = a + b ρ, or m and c (mm) of z_m = m z + c, from the measured inverse depths at those of [`affine_at`].
pub(crate) fn affine(shape: Shape, measured: [f64; 2]) -> [f64; 2] {
    if shape == Shape::AffineInInverse {
        let a = measured[0];
        return [a, (measured[1] - a) / TYPICAL_RHO];
    }
    let [near, far] = [DEPTHS_MM[0], DEPTHS_MM[3]];
    let [near_m, far_m] = measured.map(|rho| 1.0 / rho);
    let m = (far_m - near_m) / (far - near);
    [m, near_m - m * near]
}

/// Indices of at most 529 pixels that have a ray, on a regular grid over the image.
pub(crate) fn samples(camera: &Camera, rays: &[[f64; 2]]) -> Vec<usize> {
    const ALONG: usize = 23;
    let coordinate = |i: usize, size: usize| i * (size - 1) / (ALONG - 1);
    let all = (0..ALONG * ALONG)
        .map(|i| coordinate(i / ALONG, camera.height) * camera.width + coordinate(i % ALONG, camera.width));
    all.filter(|index| !rays[*index][0].is_nan()).collect()
}

/// Classifies a depth piece. `measured` gives the measured inverse depths (1/mm) of observations, many at a time, because pieces
/// in other languages take long for each call; `rays` has the ray of every pixel.
pub(crate) fn piece(camera: &Camera, rays: &[[f64; 2]], measured: impl Fn(&[Observation]) -> Vec<f64>) -> PieceClass {
    let reference = &reference(camera);
    let places: Vec<([f64; 2], [f64; 2])> =
        samples(camera, rays).into_iter().map(|i| (pixel(i, camera.width), rays[i])).collect();
    // One row of values per place: those at the given inverse depths.
    let values = |places: &[([f64; 2], [f64; 2])], context: &Context, cosine: f64, rhos: &[f64]| {
        let observations: Vec<Observation> = places
            .iter()
            .flat_map(|(pixel, ray)| {
                let context = Context { pixel: *pixel, ..*context };
                rhos.iter().map(move |rho| Observation { context, ray: *ray, cosine, rho: *rho })
            })
            .collect();
        measured(&observations)
    };
    let rhos = DEPTHS_MM.map(|z| 1.0 / z);
    let bits = |places: &[([f64; 2], [f64; 2])], context: &Context, cosine: f64| -> Vec<u64> {
        values(places, context, cosine, &rhos).into_iter().map(f64::to_bits).collect()
    };
    let few: Vec<_> = places.iter().step_by(1 + places.len() / (GRID * GRID)).copied().collect();
    let usual = bits(&few, reference, 1.0);
    let differs = |context: &Context, cosine: f64| bits(&few, context, cosine) != usual;
    let depends = |contexts: [Context; 2]| contexts.iter().any(|context| differs(context, 1.0));
    let pixel = bits(&places, reference, 1.0).chunks(rhos.len()).any(|values| Some(values) != usual.get(..rhos.len()));

    let cases = || {
        let of_frame = [times(reference), temperatures(reference), recorded(reference, |_| true)];
        let of_pixel = [amplitudes(reference), surroundings(reference), lights(reference)];
        let contexts = [&[*reference][..], of_frame.as_flattened(), of_pixel.as_flattened()].concat();
        contexts.into_iter().flat_map(|context| [(context, 1.0), (context, 0.5)])
    };
    let fits = |shape: Shape| {
        let checked = [150.0, 413.0, 907.0, 1733.0, 3109.0, 9000.0];
        let rhos: Vec<f64> = affine_at(shape).into_iter().chain(checked.map(|z| 1.0 / z)).collect();
        cases().all(|(context, cosine)| {
            values(&places, &context, cosine, &rhos).chunks(rhos.len()).all(|values| {
                let [k0, k1] = affine(shape, [values[0], values[1]]);
                checked.iter().zip(&values[2..]).all(|(z, value)| {
                    let expected = if shape == Shape::AffineInInverse { k0 + k1 / z } else { 1.0 / (k0 * z + k1) };
                    (value - expected).abs() <= 1e-10 * expected.abs()
                })
            })
        })
    };
    let shape = [Shape::AffineInInverse, Shape::AffineInDepth].into_iter().find(|shape| fits(*shape));
    PieceClass {
        pixel,
        frame: depends(times(reference)) || depends(temperatures(reference)) || depends(recorded(reference, |_| true)),
        amplitude: depends(amplitudes(reference)),
        surroundings: depends(surroundings(reference)),
        light: depends(lights(reference)),
        incidence: [0.4, 0.8].iter().any(|cosine| differs(reference, *cosine)),
        shape: shape.unwrap_or(Shape::Other),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use depthcal_model::hook::{Depth, DepthState};
    use depthcal_model::{Block, Parameter, Piece, Register, Scalar};

    use super::*;
    use crate::tests::block;

    #[test]
    fn samples_are_spread_over_the_whole_image() {
        let camera = Camera::new(160, 120, [140.0, 139.0, 77.9, 60.2, 0.0], Vec::new());
        let mut rays = vec![[0.0; 2]; 160 * 120];
        let all = samples(&camera, &rays);
        let columns: HashSet<usize> = all.iter().map(|index| index % 160).collect();
        let rows: HashSet<usize> = all.iter().map(|index| index / 160).collect();
        assert_eq!((columns.len(), rows.len(), all.iter().collect::<HashSet<_>>().len()), (23, 23, 23 * 23));
        assert_eq!((all.iter().min(), all.iter().max()), (Some(&0), Some(&(160 * 120 - 1))));
        rays[0] = [f64::NAN; 2];
        assert_eq!(samples(&camera, &rays).len(), 23 * 23 - 1);

        let few: Vec<[f64; 2]> = pixels(&camera).collect();
        assert_eq!((few.len(), few[0], few[12], few[24]), (25, [0.0, 0.0], [80.0, 60.0], [159.0, 119.0]));
    }

    fn small_camera(pieces: Vec<Block>) -> Camera {
        Camera::new(160, 120, [140.0, 139.0, 77.9, 60.2, 0.0], pieces)
    }

    /// The class of z_m = z + e with e(context, ray, cosine), mm.
    fn class(e: impl Fn(&Context, [f64; 2], f64) -> f64) -> PieceClass {
        let rays: Vec<[f64; 2]> = (0..160 * 120).map(|i| [i % 160, i / 160].map(|c| 0.01 * c as f64)).collect();
        piece(&small_camera(Vec::new()), &rays, |observations| {
            observations.iter().map(|o| o.rho / (1.0 + e(&o.context, o.ray, o.cosine) * o.rho)).collect()
        })
    }

    #[test]
    fn a_piece_depends_on_what_changes_it_and_on_nothing_else() {
        let dependencies = |class: PieceClass| {
            let all = [
                (class.pixel, "pixel"),
                (class.frame, "frame"),
                (class.amplitude, "amplitude"),
                (class.surroundings, "surroundings"),
                (class.light, "light"),
                (class.incidence, "incidence"),
            ];
            assert_eq!((class.shape, class.is_static()), (Shape::AffineInDepth, !all[1..].iter().any(|(is, _)| *is)));
            all.into_iter().filter(|(is, _)| *is).map(|(_, name)| name).collect::<Vec<_>>()
        };
        assert!(dependencies(class(|_, _, _| 3.0)).is_empty());
        assert_eq!(dependencies(class(|c, _, _| 0.1 * c.pixel[1])), ["pixel"]);
        assert_eq!(dependencies(class(|_, ray, _| 2.0 * ray[0])), ["pixel"]);
        assert_eq!(dependencies(class(|c, _, _| 1e-3 * c.time_s)), ["frame"]);
        assert_eq!(dependencies(class(|c, _, _| 0.1 * c.temperature_c)), ["frame"]);
        assert_eq!(dependencies(class(|c, _, _| c.amplitude.ln())), ["amplitude"]);
        assert_eq!(dependencies(class(|c, _, _| c.surround.ln())), ["surroundings"]);
        assert_eq!(dependencies(class(|c, _, _| 10.0 * c.slope[1])), ["surroundings"]);
        assert_eq!(dependencies(class(|c, _, _| f64::from(c.stray.scene[2][1]))), ["light"]);
        assert_eq!(dependencies(class(|c, _, _| f64::from(c.stray.near))), ["light"]);
        assert_eq!(dependencies(class(|_, _, cosine| 1.0 / cosine)), ["incidence"]);
        assert_eq!(dependencies(class(|c, ray, _| c.amplitude.ln() * ray[1])), ["pixel", "amplitude"]);
    }

    /// At the first pixel it is affine.
    #[test]
    fn a_piece_has_the_form_that_it_has_at_all_pixels() {
        let rays = vec![[0.0; 2]; 160 * 120];
        let shape = |measured: fn(&Context, f64) -> f64| {
            let all = |o: &[Observation]| o.iter().map(|o| measured(&o.context, o.rho)).collect();
            piece(&small_camera(Vec::new()), &rays, all).shape
        };
        assert_eq!(shape(|c, rho| rho + 1e-7 * c.pixel[0]), Shape::AffineInInverse);
        assert_eq!(shape(|c, rho| rho + 1e-3 * c.pixel[0] * rho * rho), Shape::Other);
    }

    /// Drifts in proportion to the column, so that the first pixel does not.
    #[derive(Debug)]
    struct DriftOfColumns;

    impl Piece<Depth, 1> for DriftOfColumns {
        const NAME: &'static str = "drift_of_columns";
        const SUMMARY: &'static str = "columns drift";
        const EQUATION: &'static str = "z + d u t";
        const SOURCE: &'static str = "a test";
        const PARAMETERS: [Parameter; 1] = [Parameter::new("d", "mm/(px s)", 0.0, 1e-6)];

        fn map<T: Scalar>(&self, s: DepthState<T>, [d]: [T; 1], c: &Context) -> T {
            s.rho / (d * (c.pixel[0] * c.time_s) * s.rho + 1.0)
        }
    }

    #[test]
    fn needs_are_those_of_all_pixels() {
        let mut register = Register::builtin();
        register.add(|_| DriftOfColumns);
        let mut drift = register.block("drift_of_columns", None).unwrap();
        assert_eq!(needs(&small_camera(vec![drift.clone()])), Needs::default());
        drift.theta = vec![1e-5];
        assert_eq!(needs(&small_camera(vec![drift])), Needs { time: true, ..Needs::default() });
    }

    /// Breathing moves every pixel but that on the optical axis, which is the first one here.
    #[test]
    fn rays_are_fixed_only_if_those_of_all_pixels_are() {
        let camera = |pieces| Camera::new(160, 120, [140.0, 139.0, 0.0, 0.0, 0.0], pieces);
        assert!(rays_are_fixed(&camera(vec![block("depth_registration", &[1.7, -0.6])])));
        assert!(!rays_are_fixed(&camera(vec![block("focus_breathing", &[3.0])])));
    }
}
