//! Where the noise law of depth is evaluated.

/// At which inverse depth the noise law of depth gives the standard deviation of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DepthSigma {
    /// At the measured one.
    AtMeasured,
    /// At the one that the start values predict: at the measured one, samples with an error towards far would weigh more than
    /// those towards near.
    AtPredicted,
}
