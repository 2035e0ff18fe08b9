//! A linear problem in the place of fits to frames, whose effects are known: rows y = constant + Σ size · regressor + noise. For
//! tests.

use std::cell::RefCell;
use std::collections::BTreeMap;

use depthcal_formula::FormulaFile;
use depthcal_io::DiagnosisPlace;
use depthcal_model::{Block, Camera, ModelSpec, Of, On, Pattern, PieceSpec, Register, Target};
use depthcal_solver::score::{Score, ScoreError};
use depthcal_statistics::chi_squared_tail;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::augmented_model::AugmentedModel;
use super::bench::{Bench, Fitted};
use super::frames::Frames;
use super::state::State;
use super::trial::fitted_with;
use crate::adjust::smoothness_prior::Smoothness;
use crate::calibrate::{CalibrateError, CalibratedCamera, CameraOptions, Estimator};
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::discovery::{Chance, Component, Discovery, OfCovariates, Refused, Search};
use crate::diagnose::evidence::Evidence;
use crate::diagnose::examination::{EffectTest, Examination};
use crate::diagnose::held_out::HeldOut;
use crate::diagnose::linear_examination::{Planted, examined};
use crate::diagnose::options::CameraDiagnoseOptions;
use crate::judge::camera::{EvaluatedCamera, EvaluatedFrame};
use crate::judge::cross_validation::errors;
use crate::observe::CameraFrames;
use crate::observe::noise::{DepthNoise, NoiseModel, PlaneScatter};

const FRAMES: usize = 30;
const ROWS: usize = 20;
const FOLDS: usize = 5;

/// Name of the formula that a search finds.
pub(super) const FORMULA: &str = "row_gain";
/// Names of functions that the residuals depend on.
pub(super) const FUNCTIONS: [&str; 2] = ["found_r", "found_z"];

/// Independent values of a regressor, one for each row.
pub(super) fn regressor(seed: u64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..FRAMES * ROWS).map(|_| StandardNormal.sample(&mut rng)).collect()
}

/// Sum of regressors with factors.
pub(super) fn sum(parts: &[(f64, &[f64])]) -> Vec<f64> {
    (0..FRAMES * ROWS).map(|row| parts.iter().map(|(factor, values)| factor * values[row]).sum()).collect()
}

/// Fits constant and effects to rows by least squares. Effects have names of the register, but any regressors.
pub(super) struct LinearBench {
    pub options: CameraDiagnoseOptions,
    /// Regressors by the effects' names.
    regressors: BTreeMap<&'static str, Vec<f64>>,
    y: Vec<f64>,
    /// Effects with which no model can be fitted.
    pub unfittable: Vec<&'static str>,
    /// Whether a search finds the formula.
    pub finds_formula: bool,
    /// The functions that the residuals depend on.
    pub functions: Vec<&'static str>,
    /// The effect of depth that an examination proposes to models without it.
    pub proposes: Option<&'static str>,
    /// Effects of the models that were fitted, in order.
    pub fits: RefCell<Vec<Vec<String>>>,
}

impl LinearBench {
    /// A problem with effects of given sizes and regressors, and noise of standard deviation 1.
    pub fn new(effects: &[(&'static str, f64, Vec<f64>)]) -> Self {
        let noise = regressor(1000);
        let mut parts: Vec<(f64, &[f64])> = effects.iter().map(|(_, size, values)| (*size, &values[..])).collect();
        parts.push((1.0, &noise));
        Self {
            options: CameraDiagnoseOptions::default(),
            y: sum(&parts),
            regressors: effects.iter().map(|(name, _, values)| (*name, values.clone())).collect(),
            unfittable: Vec::new(),
            finds_formula: false,
            functions: Vec::new(),
            proposes: None,
            fits: RefCell::default(),
        }
    }

    /// The state with some effects in the model.
    pub fn state(&self, effects: &[&str]) -> State {
        let first = self.fitted(self.declared()).unwrap();
        let frames = Frames { used: no_frames(), bad: Vec::new() };
        let mut state = State::new(frames, first, Vec::new());
        for name in effects {
            let effect = self.effect(name, &state.present);
            (state.model, state.present) = fitted_with(self, &state.model, effect).unwrap();
        }
        self.fits.borrow_mut().clear();
        state
    }

    /// An effect as an examination of a fit finds it.
    pub fn effect(&self, name: &str, present: &Fitted) -> AddedEffect {
        let spec = PieceSpec::new(name);
        let register = &self.declared().register;
        let EffectTest { score, gains, .. } = self.test(&present.fit, register, &spec).unwrap();
        let evidence = Evidence {
            name: name.to_owned(),
            block: register.make(&spec, None).unwrap(),
            value: None,
            reduced: None,
            along: None,
            p_value: score.p_value,
            score,
            gains,
            expected_size_mm: 1.0,
            minimal_detectable_mm: 1.0,
            index: 0,
            spec,
        };
        AddedEffect::alone(evidence, 0.0, present.held_out.clone())
    }

    /// Estimates for a target of the constant and of effects, from some of the frames, with the inverse of their normal matrix.
    fn least_squares(
        &self,
        target: &[f64],
        effects: &[String],
        frames: impl Fn(usize) -> bool,
    ) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let rows: Vec<usize> = (0..target.len()).filter(|row| frames(row / ROWS)).collect();
        let x = DMatrix::from_fn(rows.len(), 1 + effects.len(), |row, column| self.value(rows[row], column, effects));
        let y = DVector::from_iterator(rows.len(), rows.iter().map(|row| target[*row]));
        let inverse = (x.transpose() * &x).cholesky()?.inverse();
        Some((&inverse * x.transpose() * y, inverse))
    }

    fn value(&self, row: usize, column: usize, effects: &[String]) -> f64 {
        if column == 0 { 1.0 } else { self.regressors[effects[column - 1].as_str()][row] }
    }

    fn residuals(&self, target: &[f64], effects: &[String], theta: &DVector<f64>) -> Vec<f64> {
        let fitted =
            |row: usize| (0..theta.len()).map(|column| theta[column] * self.value(row, column, effects)).sum::<f64>();
        (0..target.len()).map(|row| target[row] - fitted(row)).collect()
    }

    fn effects_of(&self, fit: &CalibratedCamera) -> Vec<String> {
        let names = fit.camera.blocks().iter().map(|block| block.name().to_owned());
        names.filter(|name| self.regressors.contains_key(name.as_str())).collect()
    }
}

impl Bench for LinearBench {
    fn options(&self) -> &CameraDiagnoseOptions {
        &self.options
    }

    fn report(&self, _: &str, _: &CameraOptions) {}

    fn fit(&self, model: &CameraOptions) -> Result<CalibratedCamera, CalibrateError> {
        let effects: Vec<String> = model.effects.iter().map(|spec| spec.name.clone()).collect();
        self.fits.borrow_mut().push(effects.clone());
        let unfitted = || CalibrateError::NotConverged { reason: "the problem is singular".to_owned() };
        if effects.iter().any(|name| self.unfittable.contains(&name.as_str())) {
            return Err(unfitted());
        }
        let (theta, inverse) = self.least_squares(&self.y, &effects, |_| true).ok_or_else(unfitted)?;
        let block = |(i, spec): (usize, &PieceSpec)| {
            let mut block = model.register.make(spec, None).unwrap();
            block.free.iter_mut().enumerate().for_each(|(k, free)| *free = k == 0);
            block.theta[0] += theta[i + 1];
            block
        };
        let blocks: Vec<Block> = model.effects.iter().enumerate().map(block).collect();
        let camera = Camera::new(640, 480, [500.0, 500.0, 320.0, 240.0, 0.0], blocks);
        let mut covariance = DMatrix::zeros(camera.theta().len(), camera.theta().len());
        for (block, range) in camera.blocks_with_ranges() {
            if let Some(i) = effects.iter().position(|name| name == block.name()) {
                covariance[(range.start, range.start)] = inverse[(i + 1, i + 1)];
            }
        }
        let residuals = self.residuals(&self.y, &effects, &theta);
        Ok(CalibratedCamera {
            camera,
            capture: no_frames(),
            foreign_depth: Vec::new(),
            covariance: Some(covariance),
            // At 1 m a standard deviation is 1 mm.
            noise: NoiseModel {
                pixel_sigma: 1.0,
                depth: DepthNoise { a_per_mm: 1e-6, b_mm: 0.0 },
                planes: PlaneScatter::NONE,
            },
            with_depth: true,
            correlation_length_px: None,
            outliers: 0,
            lens_choice: None,
            lens_comparison: None,
            smoothness: Smoothness::default(),
            prior: None,
            reprojection_rms_px: 0.0,
            depth_rms_mm: None,
            cost: 0.5 * residuals.iter().map(|r| r * r).sum::<f64>(),
            iterations: 1,
            termination: String::new(),
            estimator: Estimator::Joint,
            model: ModelSpec::of(PieceSpec::new("projective")),
        })
    }

    fn held_out(&self, _: &CalibratedCamera, model: &CameraOptions) -> Result<HeldOut, CalibrateError> {
        let effects: Vec<String> = model.effects.iter().map(|spec| spec.name.clone()).collect();
        let folds: Vec<Vec<f64>> = (0..FOLDS)
            .map(|fold| {
                let (theta, _) = self.least_squares(&self.y, &effects, |frame| frame % FOLDS != fold).unwrap();
                self.residuals(&self.y, &effects, &theta)
            })
            .collect();
        let residuals = |frame: usize| &folds[frame % FOLDS][frame * ROWS..][..ROWS];
        let frames = (0..FRAMES).map(|frame| EvaluatedFrame::of_depth_errors(frame.to_string(), residuals(frame)));
        let evaluated = EvaluatedCamera { name: String::new(), frames: frames.collect(), dropped: Vec::new() };
        Ok(HeldOut { errors: errors(&evaluated), evaluated: evaluated.into(), blocks: None })
    }

    fn refined(&self, model: AugmentedModel) -> Result<(AugmentedModel, Fitted), CalibrateError> {
        let fitted = self.fitted(&model.options(self.declared()))?;
        Ok((model, fitted))
    }

    /// Of another problem, in which nothing is missing but the proposed effect.
    fn examine(&self, fit: &CalibratedCamera) -> Result<Examination, ScoreError> {
        let present = self.effects_of(fit);
        let Some(name) = self.proposes.filter(|name| !present.iter().any(|effect| effect == name)) else {
            return Ok(examined(Planted::default(), 1));
        };
        let mut examination = examined(Planted { a: 0.3, ..Planted::default() }, 5);
        for evidence in examination.evidence.iter_mut().filter(|evidence| evidence.name == "a") {
            (evidence.name, evidence.spec) = (name.to_owned(), PieceSpec::new(name));
        }
        Ok(examination)
    }

    fn test(&self, fit: &CalibratedCamera, _: &Register, effect: &PieceSpec) -> Option<EffectTest> {
        let present = self.effects_of(fit);
        let left = |target: &[f64]| {
            let (theta, _) = self.least_squares(target, &present, |_| true)?;
            Some(self.residuals(target, &present, &theta))
        };
        let (r, x) = (left(&self.y)?, left(self.regressors.get(effect.name.as_str())?)?);
        let products = |a: &[f64], b: &[f64]| -> Vec<f64> {
            let product = |frame: usize| (0..ROWS).map(|k| a[frame * ROWS + k] * b[frame * ROWS + k]).sum();
            (0..FRAMES).map(product).collect()
        };
        let (xr, xx) = (products(&x, &r), products(&x, &x));
        let (score, information): (f64, f64) = (xr.iter().sum(), xx.iter().sum());
        let gain = |frame: usize| {
            let size = (score - xr[frame]) / (information - xx[frame]);
            size * xr[frame] - 0.5 * size * size * xx[frame]
        };
        let statistic = score * score / information;
        let covariance = DMatrix::from_element(1, 1, 1.0 / information);
        let score = Score {
            statistic,
            rank: 1,
            p_value: chi_squared_tail(statistic, 1),
            clustered_p_value: chi_squared_tail(statistic, 1),
            change: DVector::from_element(1, score / information),
            clustered_covariance: covariance.clone(),
            covariance,
        };
        Some(EffectTest { score, gains: (0..FRAMES).map(gain).collect(), cost: fit.cost })
    }

    fn components(&self, _: &CalibratedCamera, taken: &[String]) -> Vec<Component> {
        let free = self.functions.iter().filter(|name| !taken.contains(&(**name).to_owned()));
        free.map(|name| Component { share: 0.5, description: formula(name) }).collect()
    }

    fn discover(&self, _: &CalibratedCamera, _: Chance<'_>, _: &Examination, _: &[String]) -> Search {
        match self.finds_formula {
            true => Search::Found(Box::new(formula(FORMULA))),
            false => Search::Nothing(Refused { reason: "no term".to_owned(), together: None }),
        }
    }

    fn formula_of(&self, _: &[String], _: &CalibratedCamera, _: &Examination, _: &[String]) -> Option<OfCovariates> {
        self.finds_formula.then(|| formula(FORMULA).into())
    }
}

fn no_frames<F>() -> CameraFrames<F> {
    let pattern = Pattern::AsymmetricCircles { circle_diameter_mm: 11.5 };
    CameraFrames {
        name: "rows".to_owned(),
        target: Target { pattern, columns: 4, rows: 11, spacing_mm: 17.0 },
        width: 640,
        height: 480,
        depth_unit_mm: None,
        disparity: None,
        technology: None,
        frames: Vec::new(),
        dropped: Vec::new(),
    }
}

/// A formula.
pub(super) fn formula(name: &str) -> Discovery {
    let text = format!(
        "[[effect]]\nname = \"{name}\"\nhook = \"depth\"\nadds_to = \"inverse_depth\"\nformula = \"a * y * rho\"\n\
         parameters = {{ a = \"1\" }}\n"
    );
    Discovery {
        effect: FormulaFile::parse(&text).unwrap().effects()[0].clone(),
        covariates: vec!["y".to_owned()],
        covariates_not_told_apart: Vec::new(),
        place: DiagnosisPlace { of: Of::default(), on: On::InverseDepth },
        places_not_told_apart: Vec::new(),
        p_value: 1e-3,
        stability: 1.0,
        confirmed: true,
        replication: None,
        share_of_free_function: 1.0,
        resembles: Vec::new(),
        runners_up: Vec::new(),
        terms: 1,
        replaced: Vec::new(),
        components: Vec::new(),
    }
}
