//! How a report was made: the command, and the time of every stage.

use std::fmt::Write;

use super::format::fixed;
use super::html::escape;
use super::input::Made;
use depthcal_calibration::stage_clock::in_words;

/// The command line and a table of the stages' times as HTML, below the heading; nothing where neither is known.
pub(super) fn made(made: &Made) -> String {
    let Made { command_line, stages: times } = made;
    let mut html = String::new();
    if !command_line.is_empty() {
        html += &format!("<p class=\"command\"><code>{}</code></p>\n", escape(command_line));
    }
    if times.stages.is_empty() {
        return html;
    }
    let mut rows = String::new();
    let remaining = [("everything else", times.rest_s())];
    for (stage, seconds) in times.stages.iter().map(|s| (s.stage.as_str(), s.seconds)).chain(remaining) {
        let share = fixed(100.0 * seconds / times.elapsed_s.max(f64::MIN_POSITIVE), 1);
        let (stage, time) = (escape(stage), in_words(seconds));
        let _ = writeln!(rows, "<tr><th scope=\"row\">{stage}</th><td>{time}</td><td>{share} %</td></tr>");
    }
    let all = in_words(times.elapsed_s);
    let _ = writeln!(
        html,
        "<details class=\"stages\"><summary>{all} until this report</summary><div class=\"scroll\" tabindex=\"0\"><table>\
         <caption>Wall time of every stage before this report</caption><thead><tr><th scope=\"col\">stage</th><th \
         scope=\"col\">time</th><th scope=\"col\">share</th></tr></thead><tbody>{rows}</tbody></table></div></details>"
    );
    html
}

#[cfg(test)]
mod tests {
    use depthcal_calibration::stage_clock::{StageTime, StageTimes};

    use super::*;

    #[test]
    fn the_table_has_every_stage_its_share_and_the_rest() {
        let stage = |stage: &str, seconds| StageTime { stage: stage.to_owned(), seconds };
        let stages = vec![stage("reading images", 1.0), stage("fitting <D>", 2.5)];
        let command_line = "depthcal calibrate a".to_owned();
        let times = StageTimes { stages, elapsed_s: 4.0 };
        let html = made(&Made { command_line: command_line.clone(), stages: times });
        assert!(
            html.contains("<code>depthcal calibrate a</code>") && html.contains("4.00 s until this report"),
            "{html}"
        );
        for row in ["reading images</th><td>1.00 s</td><td>25.0 %", "fitting &lt;D&gt;</th><td>2.50 s</td><td>62.5 %"] {
            assert!(html.contains(row), "{html}");
        }
        assert!(html.contains("everything else</th><td>500 ms</td><td>12.5 %"), "{html}");
        assert_eq!(made(&Made::default()), "");
        assert!(!made(&Made { command_line, ..Made::default() }).contains("<table"));
    }
}
