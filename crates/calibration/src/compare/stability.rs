//! Test whether D is the same in all datasets of one camera. In the thesis its parameters differed from dataset to dataset
//! (section 7.1.2), and whether by more than their uncertainty remained open.
//!
//! K and lens are held at the values of the training dataset; poses and D are fitted to each dataset anew, by the thesis'
//! three estimators and by the joint adjustment, whose covariance is the expected scatter of D. If D is the same everywhere,
//! the weighted squared scatter about the common mean has a χ² distribution.

use depthcal_io::{StabilityEstimate, StabilityRecord};
use depthcal_model::{ModelSpec, PieceSpec};
use depthcal_statistics::chi_squared_tail;
use nalgebra::{DMatrix, DVector, Matrix4, Vector4};
use rayon::prelude::*;

use super::image_calibrations::ImageCalibrations;
use super::variants::Variant;
use crate::calibrate::{CalibratedCamera, CameraOptions, Estimator};
use crate::observe::CameraFrames;

/// Depth error at 0.8 m, at the image's quarter points, that one unit of (dx, dy, dz, dw) causes, mm. Makes the four
/// parameters comparable.
const EFFECT_MM: [f64; 4] = [0.35 * 0.64e6, 0.25 * 0.64e6, 0.64e6, 800.0];
/// Standard deviation at 0.8 m beyond which a combination of parameters counts as undetermined, mm.
const UNDETERMINED_MM: f64 = 2.0;

struct Estimate {
    dataset: String,
    d: Vector4<f64>,
    covariance: Matrix4<f64>,
}

/// Refits D to every dataset and tests whether the estimates agree; `None` where fewer than two datasets determine it.
pub(super) fn stability(
    train: &CameraFrames,
    verify: &[CameraFrames],
    whole: &ImageCalibrations,
    base: &CameraOptions,
) -> Option<StabilityRecord> {
    let calibrated = whole.by_lens.get(&base.lens)?.as_ref().ok()?;
    let held = calibrated.camera.map_blocks(|block| block.hold());
    let options = CameraOptions { camera: Some(held), ..base.clone() };
    let captures: Vec<&CameraFrames> = std::iter::once(train).chain(verify).collect();
    let refit = |capture: &&CameraFrames| -> (Vec<StabilityEstimate>, Option<Estimate>, Option<String>) {
        let from_image = ImageCalibrations::new((*capture).clone(), &[base.lens.as_str()], &options);
        let (mut estimates, mut joint, mut failure) = (Vec::new(), None, None);
        let d = PieceSpec::new("projective");
        for (is_whole, spec) in [(true, d.clone()), (false, d.only("xw"))] {
            let model = ModelSpec::of(spec);
            for estimator in [Estimator::Linear, Estimator::Irls, Estimator::Nonlinear, Estimator::Joint] {
                match from_image.fit(&Variant::new(&model, &base.lens, estimator), &options) {
                    Ok(fitted) => {
                        let Some((d, covariance)) = d_of(&fitted) else { continue };
                        estimates.push(StabilityEstimate {
                            dataset: capture.name.clone(),
                            model: model.to_string(),
                            estimator: estimator.name().to_owned(),
                            d: d.into(),
                            half_width: covariance.map(|c| std::array::from_fn(|i| 1.96 * c[(i, i)].sqrt())),
                        });
                        if let (Estimator::Joint, true, Some(covariance)) = (estimator, is_whole, covariance) {
                            joint = Some(Estimate { dataset: capture.name.clone(), d, covariance });
                        }
                    }
                    Err(reason) if estimator == Estimator::Joint && is_whole => {
                        failure = Some(format!("'{}' does not determine D: {reason}.", capture.name));
                    }
                    Err(_) => {}
                }
            }
        }
        (estimates, joint, failure)
    };
    let all: Vec<_> = captures.par_iter().map(refit).collect();
    let joint: Vec<&Estimate> = all.iter().filter_map(|(_, joint, _)| joint.as_ref()).collect();
    let mut record = StabilityRecord {
        estimates: all.iter().flat_map(|(e, ..)| e.iter().cloned()).collect(),
        verdict: all.iter().filter_map(|(.., failure)| failure.clone()).collect(),
        ..StabilityRecord::default()
    };
    record.verdict.extend(joint.iter().filter_map(|e| undetermined(e)));
    let (chi_squared, degrees) = scatter(&joint)?;
    record.chi_squared = chi_squared;
    record.degrees_of_freedom = degrees;
    record.p_value = chi_squared_tail(chi_squared, degrees);
    let ratio = (chi_squared / degrees as f64).sqrt();
    let words = if record.p_value < 0.01 {
        "more than they allow: something changes from capture to capture that the model does not have"
    } else {
        "no more than they allow: one D explains all datasets"
    };
    record.verdict.push(format!(
        "D scatters between {} datasets by {ratio:.2} times the reported uncertainties (χ² = {chi_squared:.1} with {degrees} \
         degrees of freedom, p = {:.2e}), {words}.",
        joint.len(),
        record.p_value
    ));
    Some(record)
}

/// D (dx, dy, dz, dw), and its covariance where the estimator gives one.
fn d_of(fitted: &CalibratedCamera) -> Option<(Vector4<f64>, Option<Matrix4<f64>>)> {
    let (block, range) = fitted.camera.blocks_with_ranges().find(|(b, _)| b.name() == "projective")?;
    let d = Vector4::from_column_slice(block.theta.get(..4)?);
    let covariance = (fitted.estimator == Estimator::Joint).then_some(fitted.covariance.as_ref()).flatten();
    Some((d, covariance.map(|c| c.fixed_view::<4, 4>(range.start, range.start).into_owned())))
}

/// Σ (d − d̄)ᵀ Σ⁻¹ (d − d̄) about the weighted mean d̄, and its degrees of freedom.
fn scatter(estimates: &[&Estimate]) -> Option<(f64, usize)> {
    if estimates.len() < 2 {
        return None;
    }
    // In millimetres of depth error, so that the matrices are well scaled.
    let unit = Vector4::from(EFFECT_MM);
    let scaled = |e: &Estimate| {
        let covariance = Matrix4::from_fn(|i, j| e.covariance[(i, j)] * unit[i] * unit[j]);
        Some((e.d.component_mul(&unit), covariance.try_inverse()?))
    };
    let all: Vec<(Vector4<f64>, Matrix4<f64>)> = estimates.iter().filter_map(|e| scaled(e)).collect();
    let (mut weights, mut sum) = (Matrix4::zeros(), Vector4::zeros());
    for (d, weight) in &all {
        weights += weight;
        sum += weight * d;
    }
    let mean = weights.try_inverse()? * sum;
    let total = all.iter().map(|(d, weight)| (d - mean).dot(&(weight * (d - mean)))).sum();
    Some((total, 4 * all.len().checked_sub(1).filter(|n| *n > 0)?))
}

/// The combination of D's parameters with the largest uncertainty, in a sentence; `None` where even that is determined.
fn undetermined(e: &Estimate) -> Option<String> {
    let covariance = DMatrix::from_fn(4, 4, |i, j| e.covariance[(i, j)] * EFFECT_MM[i] * EFFECT_MM[j]);
    let eigen = covariance.symmetric_eigen();
    let worst = eigen.eigenvalues.imax();
    let std = eigen.eigenvalues[worst].max(0.0).sqrt();
    if std < UNDETERMINED_MM {
        return None;
    }
    let direction: DVector<f64> = eigen.eigenvectors.column(worst).into_owned();
    let largest = direction.amax();
    let parts: Vec<&str> =
        (0..4).filter(|i| direction[*i].abs() > 0.3 * largest).map(|i| ["dx", "dy", "dz", "dw"][i]).collect();
    Some(format!(
        "'{}' leaves a combination of {} open by {std:.1} mm at 0.8 m: its boards do not vary enough in distance and tilt.",
        e.dataset,
        parts.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scatter_is_measured_in_standard_deviations() {
        let covariance = Matrix4::from_diagonal(&Vector4::new(1e-12, 1e-12, 1e-12, 1e-6));
        let estimate = |shift: f64| Estimate {
            dataset: "a".to_owned(),
            d: Vector4::new(1e-4, 0.0, 0.0, 1.0) + Vector4::new(shift * 1e-6, 0.0, 0.0, 0.0),
            covariance,
        };
        let (a, b) = (estimate(0.0), estimate(2.0));
        let (chi_squared, degrees) = scatter(&[&a, &b]).unwrap();
        // Two standard deviations apart: each one from their mean.
        assert!((chi_squared - 2.0).abs() < 1e-9 && degrees == 4);
        assert!(undetermined(&a).is_none());
        let open = Estimate { covariance: covariance * 100.0, ..a };
        assert!(undetermined(&open).unwrap().contains("dw"));
    }
}
