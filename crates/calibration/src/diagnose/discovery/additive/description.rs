//! Formulas that describe functions without a name: splines of their covariates, as fine and as smooth as predicts left-out
//! frames best.

use depthcal_io::DiagnosisPlace;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use tracing::debug;

use super::super::discovered::Discovery;
use super::super::observations::{Normal, Observations};
use super::super::score::{left_out_gains, sum};
use super::dictionary::{Dictionary, Group};
use super::penalty::{Information, STRENGTH, block_diagonal};
use super::search::Found;
use super::spline_formula::{Part, formula};

/// Multiples of the usual number of basis functions, and strengths of the penalty of smoothness, that are compared.
const FINER: [usize; 2] = [1, 2];
const STRENGTHS: [f64; 7] = [1e-6, 1e-5, 1e-4, 1e-3, STRENGTH, 1e-1, 1.0];
/// Fall of the cost ½ Σ r² of left-out frames per sample that a finer spline has to bring: a hundredth of what noise leaves.
const LEAST_GAIN_PER_SAMPLE: f64 = 0.005;
/// Parts of the frames, of which one is left out at a time: each has frames from everywhere. A function has to fill the gaps
/// between frames, not to go beyond them.
const PARTS: usize = 12;
/// Passes of the choice of strengths, one component after the other.
const PASSES: usize = 2;

/// Functions of a model as splines of some fineness, each with a strength of its smoothness.
pub(super) struct Descriptions<'a> {
    observations: &'a Observations,
    dictionary: Dictionary,
    found: &'a [Found],
    /// Of every group of every function.
    information: Vec<Vec<Information>>,
    normals: Vec<Normal>,
    strengths: Vec<f64>,
    gain: f64,
}

impl<'a> Descriptions<'a> {
    /// The fineness and the strengths that predict left-out frames best.
    pub fn best(observations: &'a Observations, found: &'a [Found]) -> Option<Self> {
        let all: Vec<Self> = FINER.into_par_iter().filter_map(|finer| Self::new(observations, found, finer)).collect();
        let worth = LEAST_GAIN_PER_SAMPLE * observations.samples().count() as f64;
        all.into_iter().reduce(|coarse, fine| if fine.gain > coarse.gain + worth { fine } else { coarse })
    }

    fn new(observations: &'a Observations, found: &'a [Found], finer: usize) -> Option<Self> {
        let dictionary = Dictionary::of(observations, finer);
        let groups: Vec<usize> = found.iter().flat_map(|function| function.groups.clone()).collect();
        let normals = observations.normals_of(|frame| dictionary.columns(frame, &groups));
        let total = sum(&normals)?;
        let mut start = observations.shared;
        let mut information_of = |number: &usize| {
            let range = start..start + dictionary.groups[*number].columns.len();
            start = range.end;
            let diagonal: Vec<f64> = range.map(|i| total.hessian[(i, i)]).collect();
            Information { total: diagonal.iter().sum(), sums: DVector::from_vec(diagonal) }
        };
        let information =
            found.iter().map(|function| function.groups.iter().map(&mut information_of).collect()).collect();
        let strengths = vec![STRENGTH; found.len()];
        let mut descriptions =
            Self { observations, dictionary, found, information, normals, strengths, gain: f64::NEG_INFINITY };
        for place in (0..found.len()).cycle().take(PASSES * found.len()) {
            for strength in STRENGTHS {
                let mut strengths = descriptions.strengths.clone();
                strengths[place] = strength;
                let gain = descriptions.gain_with(&strengths);
                if gain > descriptions.gain {
                    (descriptions.strengths, descriptions.gain) = (strengths, gain);
                }
            }
        }
        debug!(
            "additive: {finer} times as fine: strengths {:?}, gain {:.1}",
            descriptions.strengths, descriptions.gain
        );
        Some(descriptions)
    }

    /// Fall of the cost of left-out frames with these strengths.
    fn gain_with(&self, strengths: &[f64]) -> f64 {
        let mut penalties: Vec<DMatrix<f64>> = Vec::new();
        for ((function, information), strength) in self.found.iter().zip(&self.information).zip(strengths) {
            let of_groups = function.groups.iter().zip(information);
            penalties.extend(of_groups.map(|(number, own)| own.penalty(&self.dictionary, *number, *strength)));
        }
        let penalty = block_diagonal(&penalties);
        let count = self.normals.len();
        let parts: Vec<usize> = (0..count).map(|frame| frame % PARTS.min(count)).collect();
        left_out_gains(&self.normals, self.observations.shared, &penalty, &parts, PARTS.min(count)).iter().sum()
    }

    /// The formula that describes function number `place`. `taken` are names of pieces.
    pub fn formula(&self, place: usize, taken: &[String]) -> Result<Discovery, String> {
        let (function, dictionary) = (&self.found[place], &self.dictionary);
        let part = |(number, information): (&usize, &Information)| {
            let group = &dictionary.groups[*number];
            Part {
                group,
                smooth: group.smooth.map(|i| dictionary.smooth[i]),
                pair: group.pair.map(|pair| pair.map(|i| dictionary.coarse[i])),
                factor: group.factor.map(|f| dictionary.factors[f]),
                precision: information.precision(dictionary, *number, self.strengths[place]),
                rms: self.rms(group),
            }
        };
        let parts: Vec<Part<'_>> = function.groups.iter().zip(&self.information[place]).map(part).collect();
        let group = parts[0].group;
        Ok(Discovery {
            covariates: function.covariates.iter().map(|c| c.name().to_owned()).collect(),
            covariates_not_told_apart: Vec::new(),
            place: DiagnosisPlace { of: group.of, on: group.on },
            places_not_told_apart: Vec::new(),
            p_value: 0.0,
            stability: 1.0,
            confirmed: false,
            replication: None,
            share_of_free_function: 1.0,
            resembles: Vec::new(),
            runners_up: Vec::new(),
            terms: dictionary.groups.len(),
            replaced: Vec::new(),
            components: Vec::new(),
            effect: formula(&function.covariates, &parts, taken)?,
        })
    }

    /// Root mean square over the samples of the change of inverse depth where the function of a group is 1.
    fn rms(&self, group: &Group) -> f64 {
        let weight = |sample| self.dictionary.weight_in_inverse_depth(group, sample).powi(2);
        let samples = self.observations.samples();
        (samples.clone().map(weight).sum::<f64>() / samples.count().max(1) as f64).sqrt()
    }
}
