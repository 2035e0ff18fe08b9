//! The report of a diagnosis: the questions that it answers, and the figures behind the answers.

use std::sync::OnceLock;

use depthcal_io::{
    CameraDiagnosis as CameraRecord, DeclaredValue, DiagnosisAddOutcome, DiagnosisCapture, DiagnosisCovariate,
    DiagnosisDecision, DiagnosisDeclaration, DiagnosisFrame, DiagnosisFrameCause, DiagnosisImage, DiagnosisLeftOver,
    DiagnosisStep, FileReference, Verdict,
};
use depthcal_model::Register;
use depthcal_simulate::{CameraTruth, Effect, Kind, PointOptions, Simulation};
use serde_json::Value;

use super::super::{Made, ReportCamera, ReportDataset, ReportDiagnosis, ReportInput, Role, render};
use super::{figure_ids, own_part};
use depthcal_calibration::diagnose::record::to_file;
use depthcal_calibration::diagnose::separability::separability;
use depthcal_calibration::diagnose::{CameraDiagnoseOptions, CameraDiagnosis, diagnose_camera};
use depthcal_calibration::judge::camera::{EvaluatedCamera, evaluate_camera};

/// A capture whose depth waves over distance by 3 mm, which the declared model does not say, diagnosed.
pub(super) struct Diagnosed {
    pub diagnosis: CameraDiagnosis,
    pub account: CameraRecord,
    fitted: EvaluatedCamera,
}

pub(super) fn diagnosed() -> &'static Diagnosed {
    static ONCE: OnceLock<Diagnosed> = OnceLock::new();
    ONCE.get_or_init(|| {
        let camera = CameraTruth::published(1).unwrap();
        let effects = [Effect::new("cyclic_depth", 3.0).unwrap()];
        let simulation = Simulation::new(camera, Kind::General(1), &effects, 2);
        let capture =
            depthcal_calibration::simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
        let diagnosis = diagnose_camera(&capture, None, &CameraDiagnoseOptions::default()).unwrap();
        let dataset = FileReference { path: "captures".to_owned(), digest: "00".to_owned() };
        let mut account = to_file(&diagnosis, dataset, "projective".parse().unwrap());
        account.separability = Some(separability(&diagnosis, &Register::builtin()).unwrap());
        let fitted = evaluate_camera(&diagnosis.last.camera, &diagnosis.last.capture);
        Diagnosed { diagnosis, account, fitted }
    })
}

impl Diagnosed {
    pub(super) fn render(&self, account: &CameraRecord) -> String {
        let datasets = [
            ReportDataset { evaluated: &self.fitted, role: Role::Fitted },
            ReportDataset { evaluated: &self.diagnosis.after.evaluated, role: Role::HeldOut },
        ];
        let register = Register::builtin();
        let camera = ReportCamera {
            calibrated: Some(&self.diagnosis.last),
            evaluations: datasets.to_vec(),
            diagnosis: Some(ReportDiagnosis {
                record: account,
                before: &self.diagnosis.before.evaluated,
                register: &register,
            }),
            ..ReportCamera::default()
        };
        let input = ReportInput {
            title: "Camera 1".to_owned(),
            made: Made { command_line: "depthcal diagnose captures --out result".to_owned(), ..Made::default() },
            cameras: vec![camera],
            ..ReportInput::default()
        };
        render(&input).unwrap()
    }
}

fn figures(html: &str) -> Vec<Value> {
    let (_, data) = html.split_once("id=\"figure-data\">").unwrap();
    serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn every_question_is_answered_on_the_first_screen() {
    let d = diagnosed();
    let html = d.render(&d.account);
    let (first, _) = html.split_once("id=\"steps\"").unwrap();
    for question in [
        "How wrong was the depth?",
        "Where?",
        "Why?",
        "What was added?",
        "How wrong is it now?",
        "How certain is that?",
        "What to capture next?",
    ] {
        assert!(first.contains(question), "{question}");
    }
    assert!(first.contains("with cyclic_depth it is"), "the headline names the effect");
    assert!(first.contains("Depth waves over distance"), "in plain words");
    assert!(first.contains("Effect: what was missing was found and added"));
    let ids = figure_ids(&html);
    for id in [
        "stages",
        "step-gains",
        "map-before",
        "map-declared",
        "map-after",
        "map-board-declared",
        "map-board",
        "reprojection-field",
        "against-depth",
        "difference-before",
        "difference-declared",
        "difference-after",
        "frames-by-model",
        "candidates-gain",
        "candidates-size",
        "separability",
        "uncertainty-map",
        "residual-histogram",
        "projection-std",
        "poses",
    ] {
        assert!(ids.contains(&id), "{id} is missing among {ids:?}");
    }
    let mut unique = ids.clone();
    unique.sort_unstable();
    unique.dedup();
    assert_eq!(unique.len(), ids.len(), "every figure has an id of its own");
    assert!(html.len() < 3_000_000, "{} bytes", html.len());
    for link in html.split("href=\"#").skip(1).filter_map(|s| s.split('"').next()) {
        assert!(html.contains(&format!("id=\"{link}\"")), "#{link} leads nowhere");
    }
}

/// The text of HTML.
fn text_of(html: &str) -> String {
    html.split('<').filter_map(|part| part.split_once('>')).map(|(_, text)| format!("{text} ")).collect()
}

/// A verdict is read at a glance: at most 80 words with its outcome, and no sentence of the first screen stands there twice.
#[test]
fn the_verdict_is_short_and_says_everything_once() {
    let d = diagnosed();
    let mut unsure = d.account.clone();
    unsure.steps.push(unsure.steps[0].clone());
    unsure.steps[1].effects = vec!["range_offset".to_owned()];
    unsure.steps[1].gain_percent = Some(depthcal_io::GainInterval { value: 1.0, low: -1.0, high: 3.0 });
    let mut several = d.account.clone();
    for name in ["board_bow", "board_warp", "found_r", "found_z", "found_amplitude", "found_x_time"] {
        let step = DiagnosisStep { effects: vec![name.to_owned()], ..several.steps[0].clone() };
        several.steps.push(step);
    }
    for account in [&d.account, &unsure, &several] {
        let html = d.render(account);
        let (_, verdict) = html.split_once("<p class=\"verdict\"").unwrap();
        let (verdict, after) = verdict.split_once("</a></p>").unwrap();
        let verdict = text_of(&format!("<{verdict}"));
        let words = verdict.split_whitespace().filter(|word| word.chars().any(char::is_alphanumeric)).count();
        assert!((10..=80).contains(&words), "{words} words: {verdict}");
        assert!(
            verdict.contains("cyclic_depth") && !verdict.contains("range_offset"),
            "only what is certain: {verdict}"
        );
        let first = text_of(after.split_once("id=\"steps\"").unwrap().0);
        assert!(!first.contains("would have been missed"), "{first}");
        let mut sentences: Vec<&str> = first.split(". ").map(str::trim).filter(|s| s.len() > 20).collect();
        let all = sentences.len();
        sentences.sort_unstable();
        sentences.dedup();
        assert!(all > 5 && sentences.len() == all, "a sentence stands there twice: {first}");
    }
    // Functions without a known cause have one sentence.
    let html = d.render(&several);
    let why = text_of(html.split_once("Why?").unwrap().1.split_once("What was added?").unwrap().0);
    assert_eq!(why.matches("own (found_r").count(), 1, "{why}");
    assert!(["found_z", "found_amplitude", "found_x_time"].iter().all(|name| why.contains(name)), "{why}");
    // Two causes of the board with one remedy.
    assert_eq!(why.matches("flatten the board").count(), 1, "{why}");
    assert!(why.split_whitespace().count() <= 80, "{why}");
    let html = d.render(&unsure);
    let (_, why) = html.split_once("Why?").unwrap();
    let (why, added) = why.split_once("What was added?").unwrap();
    assert!(why.contains("keep the correction") && !why.contains("range_offset"), "{why}");
    let (_, possible) = added.split_once("Possible, but not certain: range_offset").unwrap();
    assert!(possible.contains("not significant"), "{possible}");
}

/// Every bar has a whisker: those between the first and the last model as well, from the account.
#[test]
fn all_stages_have_intervals() {
    let d = diagnosed();
    let mut account = d.account.clone();
    let first = account.steps[0].clone();
    let after = first.depth_rms_after_mm.unwrap();
    assert!(after.low < after.mean && after.mean < after.high, "{after:?}");
    assert!((after.mean - first.after.depth_rms_mm.unwrap()).abs() < 1e-9);
    account.steps.push(first);
    let stages =
        |account: &CameraRecord| figures(&d.render(account)).into_iter().find(|f| f["id"] == "stages").unwrap();
    let bars = |figure: &Value, trace: usize| figure["data"][trace]["x"].as_array().unwrap().len();
    let all = stages(&account);
    assert_eq!((bars(&all, 0), bars(&all, 1)), (4, 4));
    // An account of an earlier version does not have the one in the middle.
    account.steps[0].depth_rms_after_mm = None;
    let earlier = stages(&account);
    assert_eq!((bars(&earlier, 0), bars(&earlier, 1)), (4, 3));
}

/// The line that is drawn through what the declared model leaves is the fitted effect: it follows the bins, which are
/// measured, within their intervals.
#[test]
fn the_fitted_effect_runs_through_what_the_declared_model_leaves() {
    let d = diagnosed();
    let all = figures(&d.render(&d.account));
    let figure = all.iter().find(|f| f["id"] == "against-depth").unwrap();
    let numbers = |trace: &Value, key: &str| -> Vec<f64> {
        trace[key].as_array().unwrap().iter().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect()
    };
    let (left, line) = (&figure["data"][0], &figure["data"][2]);
    let (depths, values, half) = (numbers(left, "x"), numbers(left, "y"), numbers(&left["error_y"], "array"));
    let (line_at, line) = (numbers(line, "x"), numbers(line, "y"));
    let nearest = |x: f64| {
        let by = |a: &&usize, b: &&usize| (line_at[**a] - x).abs().total_cmp(&(line_at[**b] - x).abs());
        line[*(0..line.len()).collect::<Vec<_>>().iter().min_by(by).unwrap()]
    };
    let used: Vec<usize> = (0..depths.len()).filter(|i| half[*i].is_finite()).collect();
    let off = used.iter().map(|i| (values[*i] - nearest(depths[*i])).powi(2)).sum::<f64>();
    let all: f64 = used.iter().map(|i| values[*i].powi(2)).sum();
    assert!(used.len() > 5 && off < 0.1 * all, "{off} of {all} mm² is not the effect's: {values:?} {line:?}");
}

#[test]
fn the_separability_matrix_has_cosines_and_knows_the_added_effect() {
    let s = diagnosed().account.separability.as_ref().unwrap();
    assert_eq!(s.effects[0], "cyclic_depth");
    assert!(s.effects.len() > 10, "{:?}", s.effects);
    for (i, row) in s.mimicry.iter().enumerate() {
        assert_eq!((row.len(), row[i]), (s.effects.len(), 1.0));
        assert!(row.iter().all(|c| (0.0..=1.0).contains(c)), "{row:?}");
    }
    // A bent board moves board points, which a ripple of the depth cannot.
    let place = |name: &str| s.effects.iter().position(|e| e == name).unwrap();
    assert!(s.mimicry[place("board_bow")][place("cyclic_depth")] < 0.3);
}

#[test]
fn other_verdicts_have_words_of_their_own() {
    let d = diagnosed();
    let mut account = d.account.clone();
    account.verdict = Verdict::Adequate;
    account.steps.clear();
    account.separability = None;
    let html = d.render(&account);
    assert!(html.contains("Adequate: nothing is missing") && html.contains("No effect was added."));
    assert!(html.contains("these captures show nothing that is missing"));
    assert!(!figure_ids(&html).contains(&"separability") && !figure_ids(&html).contains(&"step-gains"));

    account.verdict = Verdict::Unexplained;
    account.left_over = vec![DiagnosisLeftOver::FreeFunction {
        along: DiagnosisCovariate::Depth,
        rms_mm: Some(2.0),
        explained_share: 0.1,
    }];
    account.bad_frames = vec![DiagnosisFrame {
        name: "0007".to_owned(),
        cause: DiagnosisFrameCause::Duplicate { of: "0006".to_owned(), image: DiagnosisImage::Image },
    }];
    let html = d.render(&account);
    assert!(html.contains("something is left that no known effect explains"));
    assert!(html.contains("1 frame excluded") && html.contains("its image is that of 0006"));
    assert!(html.contains("a function of the distance of 2.00 mm rms"));

    let declared = |declared, fitting| DeclaredValue { declared, fitting };
    account.declarations = vec![DiagnosisDeclaration::DepthScale {
        scale: 0.2,
        spacing_mm: declared(17.0, 3.4),
        unit_mm: declared(1.0, 5.0),
    }];
    assert!(d.render(&account).contains("Check the dataset file"));
}

#[test]
fn what_an_account_says_cannot_become_markup() {
    let d = diagnosed();
    let evil = "</script><script>alert('x')</script>".to_owned();
    let mut account = d.account.clone();
    account.model = depthcal_model::ModelSpec::of(depthcal_model::PieceSpec::new(evil.clone()));
    account.capture_next =
        vec![DiagnosisCapture::Record { covariate: DiagnosisCovariate::Time, effects: vec![evil.clone()] }];
    account.rounds[0].decision = DiagnosisDecision::Add {
        effect: evil.clone(),
        spec: depthcal_model::PieceSpec::new(evil.clone()),
        with: vec![evil.clone()],
        explained_share: 1.0,
        of_frame_planes: None,
        despite_unexplained: false,
        outcome: DiagnosisAddOutcome::NotFitted { error: evil.clone() },
    };
    account.rounds[0].effects[0].effect = evil.clone();
    account.steps[0].effects[0] = evil.clone();
    account.steps[0].with = depthcal_model::PieceSpec::new(evil.clone());
    account.bad_frames =
        vec![DiagnosisFrame { name: evil.clone(), cause: DiagnosisFrameCause::ExchangedDepth { with: evil.clone() } }];
    account.separability.as_mut().unwrap().effects[0] = evil;
    let html = d.render(&account);
    assert!(!own_part(&html).contains("<script>alert"));
}
