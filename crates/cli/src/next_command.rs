//! The command that usually follows another, with the paths of the one that has run.

use std::path::Path;

use depthcal_io::{Comparison, recommended};
use serde_json::Value;

use super::arguments::Command;

/// A path as a shell takes it.
fn shown(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-~+:#".contains(c);
    if text.chars().all(is_plain) { text } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

impl Command {
    /// The command to run next; `value` is the result. `None` where none follows.
    pub(super) fn next(&self, value: &Value) -> Option<String> {
        Some(match self {
            Command::Detect(command) => format!("depthcal calibrate {} --cross-validate 3", shown(&command.dataset)),
            Command::Calibrate(command) => {
                let is_rig = value["frames"].is_array();
                let with_depth = value["calibration"]["fit"]["depth_rms_mm"].is_number();
                let [dataset, out] = [&command.dataset, &command.output.out].map(|path| shown(path));
                match with_depth || is_rig {
                    true => format!("depthcal diagnose {dataset} --out {out}"),
                    false => format!("depthcal export {out} --format opencv"),
                }
            }
            Command::Diagnose(command) => {
                format!("depthcal evaluate {} OTHER-CAPTURES", shown(&command.output.out))
            }
            Command::Evaluate(command) => {
                format!("depthcal apply {} DEPTH --out corrected --cloud", shown(&command.calibration))
            }
            Command::Compare(command) => {
                let comparison: Comparison = serde_json::from_value(value["comparison"].clone()).ok()?;
                let model = &recommended(&comparison.models)?.model;
                format!("depthcal calibrate {} --model {model} --cross-validate 3", shown(&command.train))
            }
            Command::Diff(command) => format!("depthcal evaluate {} OTHER-CAPTURES", shown(&command.second)),
            Command::Fleet(command) => {
                let prior = command.output.out.join("prior.json");
                format!("depthcal calibrate CAPTURES --prior {}", shown(&prior))
            }
            Command::Simulate(command) => {
                format!("depthcal calibrate {} --cross-validate 3", shown(&command.output.out))
            }
            #[cfg(feature = "import")]
            Command::Import(command) => format!("depthcal detect {}", shown(&command.out)),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_quoted_where_a_shell_needs_it() {
        assert_eq!(shown(Path::new("results/a-1/calibration.json")), "results/a-1/calibration.json");
        assert_eq!(shown(Path::new("my captures")), "'my captures'");
        assert_eq!(shown(Path::new("it's")), r"'it'\''s'");
    }
}
