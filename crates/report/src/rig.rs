//! The sections of a rig: the verdict on every camera; extrinsics, shared frames and transfer errors.

use std::fmt::Write;

use depthcal_calibration::judge::transfer::Transfer;
use depthcal_io::{FrameRecord, TransferError};
use depthcal_model::hook::HookKind;
use nalgebra::Isometry3;

use super::content::Content;
use super::figures::{rig_in_space, transfer_by_distance, transfer_over_image};
use super::format::{Measured, count, join, measured, number, quantity};
use super::html::{escape, tie};
use super::input::{ReportCamera, ReportRig};
use super::scope::Scope;
use super::sections::Summary;

/// The first screen of several cameras: the verdict on each, with a link to its sections.
pub(super) fn verdicts(
    page: &mut Content,
    cameras: &[&ReportCamera<'_>],
    summaries: &[Summary],
    rig: Option<&ReportRig<'_>>,
    story: &[String],
) {
    let names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
    let transfer = rig.and_then(worst_transfer).map_or_else(String::new, |t| {
        format!(
            ". Markers carried from {} through its depth into {} are {} off, rms, on {}",
            t.from,
            t.to,
            quantity(t.rms_px, "px"),
            t.dataset
        )
    });
    page.open_verdict(&tie(&escape(&format!("{}: {}{transfer}.", count(names.len(), "camera"), join(&names)))));
    let story: String = story.iter().map(|s| format!("<p>{}</p>\n", escape(s))).collect();
    if !story.is_empty() {
        page.body += &format!("<div class=\"story\">{story}</div>\n");
    }
    let rows = cameras.iter().zip(summaries).enumerate().map(|(i, (camera, summary))| {
        format!(
            "<li class=\"{level}\"><span class=\"mark\" aria-hidden=\"true\"></span><span class=\"visually-hidden\">{level}: \
             </span><b><a href=\"#{link}\">{name}</a></b> {in_rig}{sentence} {outcome}.</li>\n",
            level = summary.level.name(),
            link = Scope::camera(i + 1).id("all"),
            name = escape(&camera.name),
            in_rig = escape(&added_in_rig(camera)),
            sentence = tie(&escape(&summary.sentence)),
            outcome = escape(&summary.outcome),
        )
    });
    page.body += &format!("<ul class=\"checks\">{}</ul>\n", rows.collect::<String>());
    page.close();
}

/// The effects that the rig showed, in a sentence; empty where there are none.
fn added_in_rig(camera: &ReportCamera<'_>) -> String {
    match &camera.added_in_rig[..] {
        [] => String::new(),
        names => format!("The rig shows that {} is missing, and has it. ", join(names)),
    }
}

/// The largest transfer error on the last dataset, which was not fitted where there is one that was not.
fn worst_transfer(rig: &ReportRig<'_>) -> Option<TransferError> {
    let last = rig.evaluated.iter().rev().find(|e| !e.transfers.is_empty())?;
    let records = last.transfers.iter().map(|t| t.record(&last.name));
    records.filter(|t| t.rms_px.is_finite()).max_by(|a, b| a.rms_px.total_cmp(&b.rms_px))
}

/// The section of a rig.
pub(super) fn section(page: &mut Content, rig: &ReportRig<'_>, cameras: &[&ReportCamera<'_>]) {
    let reference = rig.cameras.first().map_or("", |c| c.name.as_str());
    let intro = format!(
        "Extrinsics map the frame of the rig, which is that of the reference camera, {}, to each camera's own.",
        escape(reference)
    );
    page.open("rig", ["Rig", "The rig: intrinsics, extrinsics, overlaps and transfer errors"], &intro);
    page.body += &intrinsics(rig);
    page.body += &extrinsics(rig);
    let frames: Vec<Isometry3<f64>> = rig.record.frames.iter().map(FrameRecord::rig_from_board).collect();
    page.grid(&[rig_in_space(&rig.cameras, &frames, &rig.record.target.points())], "one");
    page.body += &overlaps(cameras);
    let transfers: Vec<(String, &Transfer)> =
        rig.evaluated.iter().flat_map(|e| e.transfers.iter().map(|t| (e.name.clone(), t))).collect();
    if transfers.is_empty() {
        page.body +=
            "<p>No camera with depth shares markers with another camera's image: there are no transfer errors.</p>\n";
    } else {
        let records: Vec<TransferError> = transfers.iter().map(|(name, t)| t.record(name)).collect();
        page.body += &transfer_table(&records);
        page.grid(&[transfer_by_distance(&records)], "one");
        let figures: Vec<_> = transfers.iter().enumerate().map(|(i, (_, t))| transfer_over_image(i, t)).collect();
        page.grid(&figures, "two");
    }
    page.close();
}

fn table(caption: &str, head: &[&str], rows: &str) -> String {
    let head: String = head.iter().map(|h| format!("<th scope=\"col\">{h}</th>")).collect();
    format!(
        "<div class=\"scroll\" tabindex=\"0\"><table><caption>{caption}</caption><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>\n"
    )
}

/// Pinhole, lens and errors of every camera.
fn intrinsics(rig: &ReportRig<'_>) -> String {
    let mut rows = String::new();
    for camera in rig.record.cameras() {
        let _ = write!(rows, "<tr><th scope=\"row\">{}</th>", escape(&camera.name));
        let pinhole = camera.piece("pinhole");
        for name in ["fx", "fy", "cx", "cy"] {
            let value = pinhole.and_then(|piece| piece.parameter(name)).map(|p| measured(p.value, p.std_dev));
            let value = value.map_or_else(|| "–".to_owned(), |v| v.to_string());
            let _ = write!(rows, "<td>{value}</td>");
        }
        let lens: Vec<&str> =
            camera.pieces.iter().filter(|p| p.hook == HookKind::Lens).map(|p| p.name.as_str()).collect();
        let lens = if lens.is_empty() { "none".to_owned() } else { lens.join(", ") };
        let error = |rms: Option<f64>| rms.map_or_else(|| "–".to_owned(), number);
        let _ = writeln!(
            rows,
            "<td>{}×{}</td><td class=\"text\">{}</td><td>{}</td><td>{}</td></tr>",
            camera.width,
            camera.height,
            escape(&lens),
            error(camera.reprojection_rms_px),
            error(camera.depth_rms_mm)
        );
    }
    let head = [
        "camera",
        "fx / px",
        "fy / px",
        "cx / px",
        "cy / px",
        "image / px",
        "lens",
        "reprojection, rms / px",
        "depth, rms / mm",
    ];
    table("Intrinsics of the cameras, with standard deviations, and errors on the fitted frames", &head, &rows)
}

fn extrinsics(rig: &ReportRig<'_>) -> String {
    let mut rows = String::new();
    for (camera, record) in rig.cameras.iter().zip(rig.record.cameras()) {
        let (turn, shift) = (camera.camera_from_rig.rotation.scaled_axis(), camera.camera_from_rig.translation.vector);
        let with = |value: f64, std: Option<f64>| {
            let Measured { value, std } = measured(value, std);
            let std = std.map_or(String::new(), |std| format!(" <span class=\"interval\">± {std}</span>"));
            format!("<td>{value}{std}</td>")
        };
        let std = record.camera_from_rig.std_dev;
        let _ = write!(rows, "<tr><th scope=\"row\">{}</th>", escape(&camera.name));
        for i in 0..3 {
            rows += &with(turn[i].to_degrees(), std.map(|s| s.rotation_rad[i].to_degrees()));
        }
        for i in 0..3 {
            rows += &with(shift[i], std.map(|s| s.translation_mm[i]));
        }
        let open: Vec<&str> = record.left_open.iter().map(|o| o.parameter.as_str()).collect();
        let open = if open.is_empty() { "–".to_owned() } else { escape(&open.join(", ")) };
        let _ = writeln!(rows, "<td>{}</td><td>{open}</td></tr>", record.frames_used);
    }
    let head =
        ["camera", "rx / °", "ry / °", "rz / °", "tx / mm", "ty / mm", "tz / mm", "frames", "left open by the boards"];
    table("Extrinsics of the cameras, with standard deviations; rotations are rotation vectors", &head, &rows)
}

/// Numbers of frames in which pairs of cameras saw the board, on the first dataset.
fn overlaps(cameras: &[&ReportCamera<'_>]) -> String {
    let evaluated = cameras.iter().filter_map(|c| Some((escape(&c.name), c.evaluations.first()?.evaluated)));
    let evaluated: Vec<_> = evaluated.collect();
    let mut rows = String::new();
    for (i, (first, a)) in evaluated.iter().enumerate() {
        for (second, b) in &evaluated[i + 1..] {
            let both = a.frames.iter().filter(|f| b.frames.iter().any(|g| g.name == f.name)).count();
            let [in_first, in_second] = [a, b].map(|camera| camera.frames.len());
            let _ = writeln!(
                rows,
                "<tr><th scope=\"row\">{first} and {second}</th><td>{in_first}</td><td>{in_second}</td><td>{both}</td></tr>"
            );
        }
    }
    if rows.is_empty() {
        rows
    } else {
        table("Frames in which cameras saw the board", &["pair", "the first", "the second", "both"], &rows)
    }
}

fn transfer_table(records: &[TransferError]) -> String {
    let mut rows = String::new();
    for t in records {
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\">{} to {}</th><td>{}</td><td>{}</td><td>{}</td><td><b>{}</b></td><td><b>{}</b></td></tr>",
            escape(&t.from),
            escape(&t.to),
            escape(&t.dataset),
            count(t.markers, "marker"),
            number(t.before_rms_px),
            number(t.rms_px),
            number(t.rms_mm)
        );
    }
    let head =
        ["through the depth of", "dataset", "markers", "as measured, px rms", "corrected, px rms", "corrected, mm rms"];
    table("Transfer errors: markers of one camera, through its depth into another camera's image", &head, &rows)
}
