//! Errors of every frame of a dataset.

use serde_json::{Value, json};

use super::figure::Figure;
use super::plotly::{AFTER, BEFORE, plain, short};
use crate::format::{count, number};
use crate::input::{ReportDataset, Role};

/// Mean plane error per frame, with the pixels' standard deviation; `None` without depth.
pub(crate) fn per_frame(dataset: &ReportDataset<'_>, index: usize) -> Option<Figure> {
    let records: Vec<_> = dataset.evaluated.frames.iter().map(|f| f.record()).collect();
    let with: Vec<_> = records.iter().filter_map(|r| Some((plain(&r.name), r.plane_error_mm?))).collect();
    if with.is_empty() {
        return None;
    }
    let side = |after: bool| {
        let (name, colour, symbol) =
            if after { ("corrected", AFTER, "circle") } else { ("as measured", BEFORE, "circle-open") };
        let pick = |e: &depthcal_io::BeforeAfter<depthcal_io::MeanStd>| if after { e.after } else { e.before };
        json!({
            "type": "scatter", "mode": "markers", "name": name,
            "x": with.iter().map(|w| w.0.clone()).collect::<Value>(),
            "y": with.iter().map(|w| short(pick(&w.1).mean)).collect::<Value>(),
            "error_y": {"type": "data", "array": with.iter().map(|w| short(pick(&w.1).std)).collect::<Value>(),
                        "thickness": 1.2, "width": 2, "color": colour},
            "marker": {"color": colour, "size": 8, "symbol": symbol, "line": {"width": 2, "color": colour}},
            "hovertemplate": "%{x}: %{y:.3~g} mm<extra>%{fullData.name}</extra>",
        })
    };
    let worse: Vec<&String> = with.iter().filter(|w| w.1.after.mean > w.1.before.mean).map(|w| &w.0).collect();
    let worst = with.iter().max_by(|a, b| a.1.after.mean.total_cmp(&b.1.after.mean));
    let mut caption = "Mean absolute plane error of each frame; whiskers: standard deviation of its pixels.".to_owned();
    if let Some((name, error)) = worst {
        caption += &format!(" Largest after correction: frame {name} with {} mm.", number(error.after.mean));
    }
    caption += &match worse.len() {
        0 => " Correction lowered the error of every frame.".to_owned(),
        n if n <= 5 => {
            format!(" Larger after correction: {}.", worse.iter().map(|w| w.as_str()).collect::<Vec<_>>().join(", "))
        }
        n => format!(" Larger after correction: {}.", count(n, "frame")),
    };
    let role = match dataset.role {
        Role::Fitted => ", fitted",
        Role::HeldOut => ", held out",
        Role::Other => "",
    };
    let layout = json!({
        "xaxis": {"type": "category", "title": {"text": "frame"}, "nticks": 20},
        "yaxis": {"title": {"text": "plane error / mm"}, "rangemode": "tozero"},
    });
    Some(
        Figure::new(
            format!("frames-{index}"),
            format!("{}{role}", dataset.evaluated.name),
            vec![side(false), side(true)],
            layout,
        )
        .caption(caption)
        .alt(format!("Plane error of {} before and after correction.", count(with.len(), "frame")))
        .aspect(2.6),
    )
}
