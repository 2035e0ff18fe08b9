//! What a camera's pieces depend on, found by trying them: pieces are open to extension, so no list of names could know.

use depthcal_model::{Camera, Context};

/// An inverse depth in the middle of what depth cameras measure, 1/mm.
pub(super) const TYPICAL_RHO: f64 = 1e-3;

/// Depths at which pieces are tried, mm; no two differ by a multiple of a round period.
const DEPTHS_MM: [f64; 4] = [413.0, 907.0, 1733.0, 3109.0];
/// Pixels tried along each side of the image.
const GRID: usize = 5;

/// What the correction depends on beside depth and pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Needs {
    /// The time of the frame.
    pub time: bool,
    /// The temperature of the frame.
    pub temperature: bool,
    /// The infrared amplitude of the pixel.
    pub amplitude: bool,
    /// The angle of incidence, which is taken from the neighbours' depth.
    pub incidence: bool,
}

const REFERENCE: Context = Context {
    pixel: [0.0; 2],
    amplitude: 1711.0,
    surround: 1500.0,
    slope: [0.01, -0.02],
    time_s: 0.0,
    temperature_c: 21.3,
};

fn pixels(camera: &Camera) -> impl Iterator<Item = [f64; 2]> {
    let at = |i: usize, size: usize| (i * (size - 1)) as f64 / (GRID - 1) as f64;
    let (width, height) = (camera.width, camera.height);
    (0..GRID * GRID).map(move |i| [at(i % GRID, width).round(), at(i / GRID, height).round()])
}

/// Contexts in which one thing is another than in [`REFERENCE`].
fn changed(change: impl Fn(&mut Context, f64)) -> [Context; 2] {
    [0.37, 2.9].map(|factor| {
        let mut context = REFERENCE;
        change(&mut context, factor);
        context
    })
}

fn times() -> [Context; 2] {
    changed(|c, factor| c.time_s = 1000.0 * factor)
}

fn temperatures() -> [Context; 2] {
    changed(|c, factor| c.temperature_c *= factor)
}

fn amplitudes() -> [Context; 2] {
    changed(|c, factor| c.amplitude *= factor)
}

/// Whether the true ray of a pixel is the same at every depth and in every frame.
pub(super) fn rays_are_fixed(camera: &Camera) -> bool {
    pixels(camera).all(|pixel| {
        let ray = |context: &Context, rho: f64| {
            let ray = camera.ray(camera.image_pixel(&Context { pixel, ..*context }), rho);
            // Bits, so that a lens that ignores the depth is told from one that hardly depends on it.
            ray.map(|r| r.map(f64::to_bits)).ok()
        };
        let reference = ray(&REFERENCE, TYPICAL_RHO);
        let other_depths = DEPTHS_MM.iter().all(|z| ray(&REFERENCE, 1.0 / z) == reference);
        let others = [times(), temperatures(), amplitudes(), [Context::default(); 2]];
        other_depths && others.iter().flatten().all(|context| ray(context, TYPICAL_RHO) == reference)
    })
}

/// What the camera's depth pieces depend on.
pub(super) fn needs(camera: &Camera) -> Needs {
    let measured = |context: &Context, cosine: f64| -> Vec<u64> {
        let tried = pixels(camera).flat_map(|pixel| DEPTHS_MM.map(|z| (pixel, 1.0 / z)));
        tried
            .filter_map(|(pixel, rho)| {
                let context = Context { pixel, ..*context };
                let ray = camera.ray(camera.image_pixel(&context), rho).ok()?;
                Some(camera.measured_inverse_depth(&context, ray, cosine, rho).to_bits())
            })
            .collect()
    };
    let reference = measured(&REFERENCE, 1.0);
    let depends = |contexts: [Context; 2]| contexts.iter().any(|context| measured(context, 1.0) != reference);
    Needs {
        time: depends(times()),
        temperature: depends(temperatures()),
        amplitude: depends(amplitudes()),
        incidence: [0.4, 0.8].iter().any(|cosine| measured(&REFERENCE, *cosine) != reference),
    }
}
