//! The times of a run's stages, for people and for machines.

use depthcal_calibration::stage_clock::{StageTime, StageTimes, in_words};
use serde_json::{Value, json};

/// A table of every stage with its time and its share of the run, then of what belongs to no stage, and of the whole run.
pub(super) fn stage_table(times: &StageTimes) -> String {
    let remaining = [("everything else", times.rest_s()), ("all", times.elapsed_s)];
    let rows = times.stages.iter().map(|s| (s.stage.as_str(), s.seconds)).chain(remaining);
    let width = rows.clone().map(|(stage, _)| stage.chars().count()).max().unwrap_or(0);
    let mut lines = vec![format!("{:width$}  {:>9}  {:>7}", "stage", "time", "share")];
    for (stage, seconds) in rows {
        let percent = 100.0 * seconds / times.elapsed_s.max(f64::MIN_POSITIVE);
        lines.push(format!("{stage:width$}  {:>9}  {percent:>5.1} %", in_words(seconds)));
    }
    lines.join("\n")
}

/// A stage for `--json`.
pub(super) fn seconds_of(time: &StageTime) -> Value {
    json!({ "stage": time.stage, "seconds": time.seconds })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_equal_columns_and_adds_up() {
        let stage = |stage: &str, seconds| StageTime { stage: stage.to_owned(), seconds };
        let stages = vec![stage("reading images", 0.5), stage("diagnosing: σ", 2.5)];
        let table = stage_table(&StageTimes { stages, elapsed_s: 4.0 });
        let expected = "\
stage                 time    share
reading images      500 ms   12.5 %
diagnosing: σ       2.50 s   62.5 %
everything else     1.00 s   25.0 %
all                 4.00 s  100.0 %";
        assert_eq!(table, expected);
    }
}
