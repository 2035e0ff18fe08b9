//! Variants: the combinations of depth model, lens model and estimator that are compared.

use depthcal_model::{ModelSpec, PieceSpec};

use crate::calibrate::{CameraOptions, Estimator};

/// A depth model with the lens model and the estimator that it is fitted with.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// The depth model.
    pub model: ModelSpec,
    /// `brown-conrady` or `none`.
    pub lens: String,
    /// [`Estimator::name`].
    pub estimator: &'static str,
}

impl Variant {
    pub(super) fn new(model: &ModelSpec, lens: &str, estimator: Estimator) -> Self {
        Self { model: model.clone(), lens: lens.to_owned(), estimator: estimator.name() }
    }

    /// `base` with the variant's model, lens and estimator.
    pub(super) fn options(&self, base: &CameraOptions) -> CameraOptions {
        let (model, lens) = (self.model.clone(), self.lens.clone());
        CameraOptions { model, lens, estimator: self.used_estimator(), ..base.clone() }
    }

    fn used_estimator(&self) -> Estimator {
        let all = [Estimator::Joint, Estimator::Linear, Estimator::Irls, Estimator::Nonlinear];
        let estimator = all.into_iter().find(|e| e.name() == self.estimator).unwrap_or_default();
        // Without a depth model, depth has no information about the camera: its errors would only bias the image calibration.
        if self.model.is_none() { Estimator::Linear } else { estimator }
    }

    /// Whether camera, lens and poses are those that the images alone give.
    pub(super) fn is_of_markers(&self) -> bool {
        self.used_estimator() != Estimator::Joint
    }
}

/// The 16 subsets of D's parameters as models: `projective`, then fewer and fewer parameters in the thesis' order, then `none`.
pub fn subsets() -> Vec<ModelSpec> {
    let letters = ["xyzw", "xyz", "xyw", "xzw", "yzw", "xy", "xz", "xw", "yz", "yw", "zw", "x", "y", "z", "w"];
    let d = || PieceSpec::new("projective");
    let model = |l: &&str| ModelSpec::of(if *l == "xyzw" { d() } else { d().only(*l) });
    letters.iter().map(model).chain([ModelSpec::none()]).collect()
}

/// The variants that the thesis' tables contain.
pub(super) fn thesis_variants() -> Vec<Variant> {
    let mut variants = Vec::new();
    let d = || PieceSpec::new("projective");
    for estimator in [Estimator::Nonlinear, Estimator::Joint] {
        variants.extend(subsets().iter().map(|m| Variant::new(m, "brown-conrady", estimator)));
        variants.push(Variant::new(&ModelSpec::of(d()), "none", estimator));
    }
    for estimator in [Estimator::Linear, Estimator::Irls] {
        for model in [d(), d().only("xw")] {
            variants.push(Variant::new(&ModelSpec::of(model), "brown-conrady", estimator));
        }
    }
    variants
}
