//! `report.html`: one file that shows how large the errors of depth are and where, before and after correction, on held-out
//! frames; how certain these numbers are; and whether the calibration may be trusted.
//!
//! - [`SavedResults`] writes the files of a task's results with their report, [`report_of`] makes the report alone.
//! - [`render`] makes the report of a calibration, an evaluation or a diagnosis ([`ReportInput`]), of any
//!   number of cameras.
//! - [`FleetResults`] has the files and the report of a fleet, [`fleet_text`] words it for a terminal.
//! - [`fit_sentences`] says what a reader of a fit has to know before its numbers; [`prior_sentences`], of these, what the prior
//!   of a fleet did to a fit.
//! - [`diagnosis_text`] and [`verdict_sentence`] word a diagnosis for a terminal.
//! - [`mod@format`] writes numbers as people read them; the command line prints through it as well.
//! - `rerun` (feature `rerun`) writes recordings for the rerun viewer.
//!
//! The page loads nothing from the network: its figures are drawn by plotly.js, which ships inside the `plotly` crate and
//! is written into the page, and a content security policy forbids the page to load anything. Every number and sentence is
//! in the HTML itself and readable without scripts. The same input gives the same bytes: nothing depends on the time of
//! day, resampling has a fixed seed, and times of stages are those that the caller gives.
//!
//! Intervals come from resampling whole frames: pixels of a frame share the error of its pose and are correlated with
//! their neighbours, so a frame counts as one observation.
//!
//! # Where things are
//!
//! `render` puts a page together: `rig` for what several cameras have in common, `sections` for every camera; `comparison` and
//! `fleet` make the pages of their own. Tables and figures (one file per kind in `figures/`) are built by these;
//! `diagnosis/` words a diagnosis; `leftover` tests what is left after correction; `statistics` has quantiles, tails and
//! resampling.

mod binned;
mod board_view;
mod chart;
mod checks;
mod comparison;
mod component_plot;
mod content;
mod covariates;
mod diagnosis;
mod difference;
mod effect_files;
mod figures;
mod finding;
mod fit_sentences;
mod fleet;
pub mod format;
mod formula_plot;
mod grey_png;
mod headline;
mod html;
mod input;
mod left_out;
mod leftover;
mod made;
mod next_captures;
mod page;
mod parameters;
mod pictures;
mod pool;
mod prior;
mod render;
#[cfg(feature = "rerun")]
pub mod rerun;
mod results;
mod rig;
mod scope;
mod sections;
mod statistics;
mod tables;
mod uncertainty;

pub use board_view::board_views;
pub use diagnosis::{Detail, diagnosis_text, verdict_sentence};
pub use difference::{difference_sentences, difference_text};
pub use effect_files::effect_files;
pub use fit_sentences::fit_sentences;
pub use fleet::{FleetResults, fleet_text};
pub use formula_plot::formula_plot;
pub use input::{Made, ReportCamera, ReportDataset, ReportDiagnosis, ReportError, ReportInput, ReportRig, Role};
pub use next_captures::{goal_words, next_sentence, next_value};
pub use page::prepare_pages;
pub use prior::prior_sentences;
pub use render::render;
pub use results::{SaveError, SavedResults, report_of};

#[cfg(test)]
mod tests;
