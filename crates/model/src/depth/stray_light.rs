use crate::frame_covariates::Modulation;
use crate::hook::{Depth, DepthState};
use crate::piece::{Constant, Context, Covariate, Options, Parameter, Piece, Scalar};
use crate::technology::Technology;

const F1: Constant = Constant::new("f1_mhz", "first modulation frequency", "MHz", 16.0);
const F2: Constant = Constant::new("f2_mhz", "second modulation frequency", "MHz", 80.0);
const F3: Constant = Constant::new("f3_mhz", "third modulation frequency", "MHz", 120.0);

/// Depth, mm, by which a delay of one radian at 80 MHz lengthens the range: c / (4π · 80 MHz).
const DELAY_MM: f64 = crate::frame_covariates::LIGHT_MM_PER_S / (4.0 * std::f64::consts::PI * 80e6);

/// Light that the lens spreads: a share of the light of the whole scene falls on every pixel and turns its phase, the more the
/// darker the pixel is; light of the nearest pixels delays it. Needs [`Context::stray`] of the same frequencies; no effect where
/// it is unknown.
///
/// With the phasor P_f = A exp(i 4π f r/c) of every pixel (amplitude A, range r), G∗P_f its mean over the frame, weighted by a
/// Gaussian of 200 px, and B∗A the mean amplitude over 3×3 pixels, R_f = G∗P_f / (B∗A exp(iφ_f)) with the own phase φ_f of the
/// state's range and the delay. The neighbours' share N = B∗(G'∗A) / B∗A (Gaussian G' of 0.8 px) is without phases, which hardly
/// differ between neighbours: phases measured at this scale would take noise off instead of explaining it.
#[derive(Debug, Clone, Copy)]
pub struct StrayLight {
    /// The camera's modulation frequencies.
    pub modulation: Modulation,
}

impl StrayLight {
    /// With the frequencies that are given by name, see [`Modulation::of`].
    pub fn with_options(given: &Options) -> Self {
        Self { modulation: Modulation::of(given) }
    }
}

impl Piece<Depth, 2> for StrayLight {
    const NAME: &'static str = "stray_light";
    const SUMMARY: &'static str = "light that the lens spreads over the image pulls at the depth of dark pixels";
    const EQUATION: &'static str = "z + (b N c / (4π · 80 MHz) − c / (4π Σf) · Σ_f arg(1 − κ R_f)) / √(1 + x² + y²), light R_f of the scene and N of the \
         nearest pixels over the pixel's own";
    const SOURCE: &'static str = "Mure-Dubois, Hügli 2007, Real-time scattering compensation for time-of-flight camera; Kavli et al. 2008, \
         Modelling and compensating measurement errors caused by scattering in time-of-flight cameras";
    const TECHNOLOGIES: &'static [Technology] = &[Technology::TimeOfFlight];
    const PARAMETERS: [Parameter; 2] = [
        Parameter::new("kappa", "1", 0.0, 0.005)
            .meaning("Share of the light of the whole scene that the lens spreads evenly over the image."),
        Parameter::new("b", "1", 0.0, 0.03)
            .meaning("Delay by the light of the nearest pixels, in radians of the phase at 80 MHz."),
    ];
    const CONSTANTS: &'static [Constant] = &[F1, F2, F3];
    const NEEDS: &'static [Covariate] = &[Covariate::StrayLight];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [kappa, b]: [T; 2], c: &Context) -> T {
        let sum_hz = self.modulation.sum_hz();
        if !(c.stray.is_known() && sum_hz > 0.0) {
            return s.rho;
        }
        let slant = (s.x * s.x + s.y * s.y + 1.0).sqrt();
        let delay = b * (DELAY_MM * f64::from(c.stray.near));
        // The phases of the scene are measured ones, which the near light has delayed: so is the pixel's own.
        let range = slant / s.rho + delay;
        let mut turned = T::from(0.0);
        for (scene, k) in c.stray.scene.iter().zip(self.modulation.rad_per_mm()).filter(|(_, k)| *k > 0.0) {
            let [re, im] = scene.map(f64::from);
            let (sin, cos) = (range * k).sin_cos();
            let (along, across) = (cos * re + sin * im, cos * im - sin * re);
            turned += (-kappa * across).atan2(-kappa * along + 1.0);
        }
        let mm_per_rad = crate::frame_covariates::LIGHT_MM_PER_S / (4.0 * std::f64::consts::PI * sum_hz);
        let bias = (delay - turned * mm_per_rad) / slant;
        s.rho / (bias * s.rho + 1.0)
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(F1.name, self.modulation.mhz[0]), (F2.name, self.modulation.mhz[1]), (F3.name, self.modulation.mhz[2])]
    }
}
