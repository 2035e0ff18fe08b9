//! The section of a rig: extrinsics of its cameras, what they share, and how well one meets the other.

use std::fmt::Write;

use depthcal_calibration::judge::transfer::Transfer;
use depthcal_io::{DiagnosedCamera, Diagnosis, TransferError};
use nalgebra::Isometry3;

use super::content::Content;
use super::diagnosis::verdict_sentence;
use super::figures::{rig_in_space, transfer_by_distance, transfer_over_image};
use super::format::{count, number};
use super::html::escape;
use super::input::ReportRig;

/// The verdicts of a rig's cameras in a sentence each, which introduce the report of its diagnosis.
pub(super) fn rig_sentences(diagnosis: &Diagnosis) -> Vec<String> {
    let sentence = |camera: &DiagnosedCamera| {
        let (name, verdict) = (&camera.camera, verdict_sentence(&camera.diagnosis));
        format!("{name}: {verdict} (its own report is in the folder {name}).")
    };
    diagnosis.cameras.iter().map(sentence).collect()
}

/// The section of a rig.
pub(super) fn content(rig: &ReportRig<'_>) -> Content {
    let mut content = Content::default();
    section(&mut content, rig);
    content
}

fn section(page: &mut Content, rig: &ReportRig<'_>) {
    let reference = rig.cameras.first().map_or("", |c| c.name.as_str());
    let intro = format!(
        "The sections above are those of the reference camera, {}. Extrinsics map the frame of the rig, which is that of the reference, to each \
         camera's own.",
        escape(reference)
    );
    page.open("rig", ["Rig", "The rig: extrinsics, overlaps and transfer errors"], &intro);
    page.body += &extrinsics(rig);
    page.body += &not_used(rig, reference);
    let frames = rig.record.frames.iter().map(|f| {
        let [w, x, y, z] = f.rotation;
        let rotation = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        Isometry3::from_parts(nalgebra::Translation3::from(nalgebra::Vector3::from(f.translation_mm)), rotation)
    });
    let frames: Vec<Isometry3<f64>> = frames.collect();
    page.grid(&[rig_in_space(&rig.cameras, &frames, &rig.record.target.points())], "one");
    page.body += &overlaps(rig);
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

fn extrinsics(rig: &ReportRig<'_>) -> String {
    let mut rows = String::new();
    for (camera, record) in rig.cameras.iter().zip(rig.record.cameras()) {
        let (turn, shift) = (camera.camera_from_rig.rotation.scaled_axis(), camera.camera_from_rig.translation.vector);
        let with = |value: f64, std: Option<f64>, digits: usize| {
            let std = std.map_or(String::new(), |s| format!(" <span class=\"interval\">± {}</span>", number(s)));
            format!("<td>{value:.digits$}{std}</td>")
        };
        let std = record.camera_from_rig.std_dev;
        let _ = write!(rows, "<tr><th scope=\"row\">{}</th>", escape(&camera.name));
        for i in 0..3 {
            rows += &with(turn[i].to_degrees(), std.map(|s| s.rotation_rad[i].to_degrees()), 4);
        }
        for i in 0..3 {
            rows += &with(shift[i], std.map(|s| s.translation_mm[i]), 3);
        }
        let open: Vec<&str> = record.left_open.iter().map(|o| o.parameter.as_str()).collect();
        let open = if open.is_empty() { "–".to_owned() } else { escape(&open.join(", ")) };
        let _ = writeln!(rows, "<td>{}</td><td>{open}</td></tr>", record.frames_used);
    }
    let head =
        ["camera", "rx / °", "ry / °", "rz / °", "tx / mm", "ty / mm", "tz / mm", "frames", "left open by the boards"];
    table("Extrinsics of the cameras, with standard deviations; rotations are rotation vectors", &head, &rows)
}

/// Frames that a camera other than the reference, whose sections list its own, could not use. Their names in the record are
/// CAMERA/FRAME.
fn not_used(rig: &ReportRig<'_>, reference: &str) -> String {
    let named = rig.record.fit.frames_dropped.iter().filter_map(|d| Some((d.name.split_once('/')?, &d.reason)));
    let of_others: Vec<_> = named.filter(|((camera, _), _)| *camera != reference).collect();
    if of_others.is_empty() {
        return String::new();
    }
    let mut rows = String::new();
    for ((camera, frame), reason) in &of_others {
        let [camera, frame, reason] = [*camera, *frame, reason.as_str()].map(escape);
        let _ = writeln!(rows, "<tr><th scope=\"row\">{camera}</th><td>{frame}</td><td>{reason}</td></tr>");
    }
    let caption = format!("{} of other cameras not used", count(of_others.len(), "frame"));
    table(&caption, &["camera", "frame", "reason"], &rows)
}

fn overlaps(rig: &ReportRig<'_>) -> String {
    let Some(fitted) = rig.evaluated.first() else { return String::new() };
    let mut rows = String::new();
    for (i, a) in fitted.cameras.iter().enumerate() {
        for b in &fitted.cameras[i + 1..] {
            let both = a.frames.iter().filter(|f| b.frames.iter().any(|g| g.name == f.name)).count();
            let short = |name: &str| escape(name.rsplit('/').next().unwrap_or(name));
            let _ = writeln!(
                rows,
                "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{both}</td></tr>",
                format_args!("{} and {}", short(&a.name), short(&b.name)),
                a.frames.len(),
                b.frames.len()
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
