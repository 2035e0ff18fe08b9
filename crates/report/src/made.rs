//! How a report was made: the command, and the time of every stage.

use std::fmt::Write;

use super::format::fixed;
use super::html::escape;
use super::input::Made;
use depthcal_calibration::stage_clock::{StageTime, in_words};

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
    let mut kinds = by_kind(&times.stages);
    kinds.push(("everything else".to_owned(), times.rest_s()));
    for (stage, seconds) in kinds {
        let share = fixed(100.0 * seconds / times.elapsed_s.max(f64::MIN_POSITIVE), 1);
        let (stage, time) = (escape(&stage), in_words(seconds));
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

/// Stages with their times, those that differ by the round and the model only as one: a diagnosis fits dozens of models.
fn by_kind(stages: &[StageTime]) -> Vec<(String, f64)> {
    let mut kinds: Vec<(String, usize, f64)> = Vec::new();
    for StageTime { stage, seconds } in stages {
        let (what, model) = stage.split_once(" (").unwrap_or((stage, ""));
        let round = what.split_once(", round ").and_then(|(doing, after)| Some((doing, after.split_once(':')?.1)));
        let kind = match round {
            Some((doing, what)) => format!("{doing}:{what}"),
            None if model.is_empty() => stage.clone(),
            None => what.to_owned(),
        };
        match kinds.iter_mut().find(|(known, ..)| *known == kind) {
            Some((_, times, sum)) => (*times, *sum) = (*times + 1, *sum + seconds),
            None => kinds.push((kind, 1, *seconds)),
        }
    }
    let named = |(kind, times, sum): (String, usize, f64)| {
        (if times > 1 { format!("{kind}, {times} times") } else { kind }, sum)
    };
    kinds.into_iter().map(named).collect()
}

#[cfg(test)]
mod tests {
    use depthcal_calibration::stage_clock::StageTimes;

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
        let of_loop = ["diagnosing: fitting (the declared model)", "diagnosing, round 2: fitting (board_bow)"];
        assert_eq!(by_kind(&of_loop.map(|name| stage(name, 1.5))), [("diagnosing: fitting, 2 times".to_owned(), 3.0)]);
        assert_eq!(made(&Made::default()), "");
        assert!(!made(&Made { command_line, ..Made::default() }).contains("<table"));
    }
}
