//! The report of simulated captures: what it must contain, and what must not break it.

mod browser;
mod comparison;
mod diagnosis;
mod fixture;

use super::headline;
use super::{ReportCamera, ReportDataset, ReportError, ReportInput, Role, covariates, leftover, render};
use depthcal_calibration::judge::depth_errors::DepthErrors;
use depthcal_calibration::stage_clock::{StageTime, StageTimes};
use fixture::{Fixture, evaluated, image_only};

fn report(fixture: &Fixture) -> String {
    fixture.render(&["A true camera was simulated.".to_owned()])
}

/// The page without the embedded library, in which anything may occur.
fn own_part(html: &str) -> String {
    let (before, scripts) = html.split_once("<script type=\"application/json\"").unwrap();
    let (figures, scripts) = scripts.split_once("</script>").unwrap();
    let (_, after) = scripts.split_once("</script>").unwrap();
    format!("{before}{figures}{after}")
}

fn figure_ids(html: &str) -> Vec<&str> {
    html.split("class=\"plot\" id=\"").skip(1).filter_map(|s| s.split('"').next()).collect()
}

#[test]
fn a_full_report_has_every_figure_and_a_verdict() {
    let fixture = Fixture::simulated(&[]);
    let html = report(&fixture);
    let ids = figure_ids(&html);
    for id in [
        "errors",
        "map-before",
        "map-after",
        "map-left",
        "map-board",
        "reprojection-field",
        "difference-before",
        "difference-after",
        "against-depth",
        "against-incidence",
        "against-radius",
        "against-amplitude",
        "against-time",
        "reprojection-radius",
        "frames-0",
        "frames-1",
        "poses",
        "coverage",
        "distance-tilt",
        "uncertainty-curves",
        "uncertainty-map",
        "residual-histogram",
        "projection-std",
        "noise",
        "correlation",
    ] {
        assert!(ids.contains(&id), "{id} is missing among {ids:?}");
    }
    assert!(html.contains("Held-out depth error fell from"), "{}", headline::sentence(&fixture.input(&[]).cameras[0]));
    let sentence = headline::sentence(&fixture.input(&[]).cameras[0]);
    // Errors grow with distance, so that the interval from nine frames spans more than a factor of five.
    assert!(
        sentence.ends_with("(not determined by these frames: the errors of 9 frames differ too much)."),
        "{sentence}"
    );
    assert!(html.contains("the board was not found"), "dropped frames have reasons");
    assert!(html.contains("A true camera was simulated."));
    assert!(html.contains("A board cannot tell apart what D takes up"));
    assert!(html.len() < 3_000_000, "{} bytes", html.len());
    assert_eq!(html, report(&fixture), "same input, same bytes");
}

/// 51 frames of up to 3000 pixels: the size of a large capture. Printed with `--nocapture`.
#[test]
fn a_large_capture_gives_a_small_file_in_a_short_time() {
    let fixture = Fixture::large();
    let pixels: usize = [&fixture.fitted, &fixture.held].iter().flat_map(|d| &d.frames).map(|f| f.pixels.len()).sum();
    assert!(pixels > 120_000, "{pixels}");
    let start = std::time::Instant::now();
    let html = fixture.render(&[]);
    eprintln!("51 frames, {pixels} pixels: {} bytes in {:?}", html.len(), start.elapsed());
    assert!(html.len() < 3_000_000, "{} bytes", html.len());
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

/// The input of a page of one camera.
fn page_of(camera: ReportCamera<'_>) -> ReportInput<'_> {
    ReportInput { cameras: vec![camera], ..ReportInput::default() }
}

/// A page of several cameras has the sections and figures of each, below a verdict on each.
#[test]
fn every_camera_has_the_sections_of_a_page_of_one() {
    let fixture = Fixture::simulated(&[]);
    let single = fixture.input(&[]);
    let named = |name: &str| ReportCamera { name: name.to_owned(), ..single.cameras[0].clone() };
    let html = render(&ReportInput { cameras: ["left", "r<ght"].map(named).to_vec(), ..single.clone() }).unwrap();
    let of_one = fixture.render(&[]);
    let mut expected: Vec<String> = Vec::new();
    for number in 1..=2 {
        expected.extend(figure_ids(&of_one).iter().map(|id| format!("camera-{number}-{id}")));
        for id in ["verdict", "trust", "where", "parameters", "uncertainty", "dropped"] {
            assert!(html.contains(&format!("<section id=\"camera-{number}-{id}\"")), "{id} of camera {number}");
        }
    }
    assert_eq!(figure_ids(&html), expected);
    assert!(html.contains("2 cameras: left and r&lt;ght"));
    assert_eq!(html.matches("How the numbers are defined").count(), 1);
    let ids: Vec<&str> = own_part_of(&html, " id=\"");
    let mut unique = ids.clone();
    unique.sort_unstable();
    unique.dedup();
    assert_eq!(unique.len(), ids.len(), "every element has an id of its own");
    for link in own_part_of(&html, "href=\"#") {
        assert!(ids.contains(&link), "#{link} leads nowhere");
    }
}

/// Values of an attribute in the page, from its beginning to the scripts.
fn own_part_of<'a>(html: &'a str, attribute: &str) -> Vec<&'a str> {
    let (body, _) = html.split_once("<script").unwrap();
    body.split(attribute).skip(1).filter_map(|text| text.split('"').next()).collect()
}

#[test]
fn nothing_is_loaded_from_anywhere() {
    let page = own_part(&report(&Fixture::simulated(&[])));
    for forbidden in ["src=", "http://", "https://", "url(", "@import", "<link", "<iframe"] {
        assert!(!page.contains(forbidden), "{forbidden} in the page");
    }
    assert!(page.contains("default-src 'none'"), "the page forbids itself to load anything");
}

#[test]
fn every_figure_has_data_a_caption_and_a_text_for_those_who_cannot_see_it() {
    let html = report(&Fixture::simulated(&[]));
    let (_, data) = html.split_once("id=\"figure-data\">").unwrap();
    let (json, _) = data.split_once("</script>").unwrap();
    let figures: Vec<serde_json::Value> = serde_json::from_str(json).unwrap();
    let drawn: Vec<&str> = figures.iter().map(|f| f["id"].as_str().unwrap()).collect();
    assert_eq!(drawn, figure_ids(&html));
    assert!(!html.contains("aria-label=\"\"") && !html.contains("<figcaption></figcaption>"));
    for figure in &figures {
        assert!(!figure["data"].as_array().unwrap().is_empty(), "{}", figure["id"]);
    }
}

#[test]
fn what_users_write_cannot_become_markup() {
    let mut fixture = Fixture::simulated(&[]);
    let evil = "</script><script>alert('x')</script>{{body}}";
    fixture.title = evil.to_owned();
    fixture.held.name = evil.to_owned();
    fixture.held.frames[0].name = evil.to_owned();
    fixture.held.dropped[0].reason = evil.to_owned();
    let html = fixture.render(&[evil.to_owned()]);
    assert!(!html.contains("<script>alert"));
    assert_eq!(html.matches("id=\"verdict-sentence\"").count(), 1, "placeholders in content are text");
}

/// A pattern of 6 mm that the model does not have is found and located; without it nothing is found.
#[test]
fn what_is_left_is_found_and_what_is_not_there_is_not() {
    let mut fixture = Fixture::simulated(&[]);
    let image = covariates::Image::of(&fixture.input(&[]).cameras[0]);
    let clean = leftover::Leftover::of(&fixture.input(&[]).cameras[0], &image).unwrap();
    assert_eq!(clean.found().count(), 0, "{}", clean.sentence());
    assert!(clean.sentence().starts_with("Nothing is left"));

    for frame in fixture.fitted.frames.iter_mut().chain(&mut fixture.held.frames) {
        for p in &mut frame.pixels {
            let t = (p.context.pixel[0] / 640.0).clamp(0.0, 1.0);
            p.after_mm += 12.0 * t.powi(3) - 3.0;
        }
        frame.depth = DepthErrors::of(&frame.pixels);
    }
    let dirty = leftover::Leftover::of(&fixture.input(&[]).cameras[0], &image).unwrap();
    assert!(dirty.found().any(|f| f.over.to_string() == "the position in the image"), "{}", dirty.sentence());
    assert!(dirty.sentence().starts_with("Something is left that this model does not describe"));
    // The error is added towards the right edge, 9 mm at most: it has to be found in the right column of cells, too far.
    let over_image = dirty.findings.iter().find(|f| f.over.to_string() == "the position in the image").unwrap();
    assert!(over_image.worst.contains("right part of the image"), "{}", over_image.worst);
    assert!(over_image.worst.ends_with("too far"), "{}", over_image.worst);
    let html = fixture.render(&[]);
    assert!(html.contains(&over_image.worst), "the report says where");
}

/// Twenty captures in which nothing is wrong: with a false alarm in twenty, more than four come in one of 400 such
/// tests. Twenty whose depth waves by 6 mm, ten times what noise gives a frame: nearly all are found.
#[test]
fn false_alarms_are_rare_and_real_effects_are_seen() {
    let alarms = |effects: &[depthcal_simulate::Effect]| {
        let alarm = |seed: &u64| {
            let fixture = Fixture::seeded(effects, *seed);
            let input = fixture.input(&[]);
            let camera = &input.cameras[0];
            let left = leftover::Leftover::of(camera, &covariates::Image::of(camera)).unwrap();
            eprintln!("seed {seed}: {}", left.sentence());
            left.found().next().is_some()
        };
        (100..120).filter(alarm).count()
    };
    let false_alarms = alarms(&[]);
    let waves = alarms(&[depthcal_simulate::Effect::new("cyclic_depth", 6.0).unwrap()]);
    assert!(false_alarms <= 4, "{false_alarms} of 20");
    assert!(waves >= 18, "{waves} of 20");
}

#[test]
fn a_correction_that_does_harm_is_called_so() {
    let mut fixture = Fixture::simulated(&[]);
    for frame in &mut fixture.held.frames {
        frame.pixels.iter_mut().for_each(|p| std::mem::swap(&mut p.before_mm, &mut p.after_mm));
        frame.depth = DepthErrors::of(&frame.pixels);
    }
    let html = fixture.render(&[]);
    assert!(html.contains("rose from") && html.contains("Do not use it as it is"));
}

#[test]
fn numbers_that_are_not_spoil_nothing() {
    let mut fixture = Fixture::simulated(&[]);
    for (i, frame) in fixture.held.frames.iter_mut().enumerate() {
        frame.pixels[i].before_mm = f64::NAN;
        frame.pixels[i].height_after_mm = f64::INFINITY;
        frame.pixels[i].board_depth_mm = f64::NAN;
        frame.reprojection[0] = [f64::NAN; 4];
        frame.dots.push([f64::NAN; 2]);
        frame.depth = DepthErrors::of(&frame.pixels);
    }
    fixture.held.frames[0].pixels.clear();
    fixture.held.frames[0].depth = DepthErrors::default();
    fixture.held.frames[1].reprojection.clear();
    fixture.held.frames[2].dots.clear();
    let html = fixture.render(&[]);
    assert!(html.contains("Held-out depth error fell from"));
    let page = own_part(&html);
    for word in ["NaN", ">inf", "Infinity"] {
        assert!(!page.replace("Number.isNaN", "").contains(word), "{word} is shown");
    }
}

#[test]
fn without_calibration_the_errors_are_still_told() {
    let fixture = Fixture::simulated(&[]);
    let evaluations = [ReportDataset { evaluated: &fixture.held, role: Role::Other }];
    let camera = ReportCamera { evaluations: evaluations.to_vec(), ..ReportCamera::default() };
    let input = ReportInput { title: "other".to_owned(), ..page_of(camera) };
    let html = render(&input).unwrap();
    let ids = figure_ids(&html);
    assert!(ids.contains(&"map-before") && ids.contains(&"difference-after") && ids.contains(&"poses"));
    assert!(!ids.contains(&"uncertainty-map") && !html.contains("id=\"parameters\""));
    assert!(html.contains("On captures that are not part of the fit"));
}

#[test]
fn an_image_only_calibration_speaks_of_pixels() {
    let (calibrated, evaluated) = image_only();
    let evaluations = [ReportDataset { evaluated: &evaluated, role: Role::Fitted }];
    let camera = ReportCamera { calibrated: Some(&calibrated), ..ReportCamera::default() };
    let html = render(&page_of(ReportCamera { evaluations: evaluations.to_vec(), ..camera.clone() })).unwrap();
    let ids = figure_ids(&html);
    assert!(html.contains("reprojection error is") && html.contains("Calibration report"));
    assert!(ids.contains(&"reprojection-field") && ids.contains(&"coverage") && !ids.contains(&"map-before"));
    assert!(html.contains("brown") || html.contains("Brown"));

    assert!(render(&page_of(camera)).unwrap().contains("not evaluated on any frame"));
}

#[test]
fn frames_that_were_all_dropped_are_listed_and_nothing_at_all_is_an_error() {
    let mut empty = evaluated("empty", &[]);
    let nothing = [ReportDataset { evaluated: &empty, role: Role::Other }];
    let camera = ReportCamera { evaluations: nothing.to_vec(), ..ReportCamera::default() };
    assert_eq!(render(&page_of(camera)), Err(ReportError::Nothing));
    empty.dropped.push(depthcal_calibration::observe::DroppedFrame { name: "f1".into(), reason: "blurred".into() });
    let dropped = [ReportDataset { evaluated: &empty, role: Role::Other }];
    let camera = ReportCamera { evaluations: dropped.to_vec(), ..ReportCamera::default() };
    let html = render(&page_of(camera)).unwrap();
    assert!(html.contains("No frame could be evaluated.") && html.contains("blurred"));
}

/// Frames of a cross-validation are fitted and held out, and are one frame each in every count.
#[test]
fn a_frame_that_is_fitted_and_held_out_counts_once() {
    let fixture = Fixture::simulated(&[]);
    let roles = [Role::Fitted, Role::HeldOut].map(|role| ReportDataset { evaluated: &fixture.fitted, role });
    let input = fixture.input(&roles);
    let frames = fixture.fitted.frames.len();
    assert_eq!(super::pool::Pool::of(&input.cameras[0], |_| true).frame_count(), frames);
    let html = render(&input).unwrap();
    assert!(html.contains(&format!("1 of {} frames; the reasons are listed below.", frames + 1)));
    assert!(html.contains("(fitted): all frames") && html.contains("(held out): all frames"));
    assert!(html.contains("relative to the board's pose"));
}

#[test]
fn one_frame_and_two_frames_make_no_claims() {
    let mut fixture = Fixture::simulated(&[]);
    fixture.held.frames.truncate(2);
    assert!(fixture.render(&[]).contains("too few frames for an interval"));
    fixture.held.frames.truncate(1);
    assert!(fixture.render(&[]).contains("too few frames for an interval"));
}

/// The share that was left out stands beside the errors that it is not in, and a frame of which much was left out is named.
#[test]
fn the_share_that_was_left_out_is_told() {
    let mut fixture = Fixture::simulated(&[]);
    let clean = fixture.render(&[]);
    assert!(clean.contains("None of the board&#39;s pixels were left out.") && !clean.contains("Look there for"));

    let frame = &mut fixture.held.frames[2];
    frame.outliers = frame.depth.pixels / 9;
    let (name, share) = (frame.name.clone(), super::left_out::share(Some(frame.outlier_share())));
    assert!(frame.outlier_share() > 0.09 && frame.outlier_share() <= 0.1, "{share}");
    let held = super::left_out::share(fixture.held.outliers().map(|o| o.share));
    let html = fixture.render(&[]);
    let tied = held.replace(' ', "\u{a0}");
    assert!(html.contains(&format!("{tied} of the board&#39;s pixels were left out: more than 50.0\u{a0}mm off")));
    assert!(html.contains(&format!("<td rowspan=\"2\">{held}</td>")), "the table of datasets");
    assert!(html.contains(&format!("<th scope=\"row\">{name}</th>")) && html.contains(&format!("<td>{share}</td>")));
    let (_, check) = html.split_once("Is all that was measured on the board the board?").unwrap();
    let check = check.split("</li>").next().unwrap();
    assert!(
        check.starts_with(&format!(
            "</b> No: a large share of the board&#39;s pixels was left out in {name} ({share})."
        ))
    );
    assert!(check.contains("in front of the board") && check.contains("reflections"), "{check}");
}

/// Times belong to what made the report; they are shown as they are given, and nothing else depends on them.
#[test]
fn times_of_stages_are_shown_where_they_are_given() {
    let fixture = Fixture::simulated(&[]);
    let stages = vec![StageTime { stage: "joint adjustment".to_owned(), seconds: 1.5 }];
    let stages = StageTimes { stages, elapsed_s: 2.0 };
    let mut input = fixture.input(&[]);
    input.made.stages = stages;
    let html = render(&input).unwrap();
    let (_, table) = html.split_once("<details class=\"stages\">").unwrap();
    let (table, _) = table.split_once("</details>\n").unwrap();
    assert!(table.contains("joint adjustment</th><td>1.50 s</td><td>75.0 %"), "{table}");
    let without = html.replace(&format!("<details class=\"stages\">{table}</details>\n"), "");
    assert_eq!(without, fixture.render(&[]));
}
