//! Defects in rendered captures.

use depthcal_simulate::{CameraTruth, Defects, Kind, Noise, Rendering, Simulation};

fn simulation() -> Simulation {
    let whole = CameraTruth::published(1).unwrap();
    let camera = CameraTruth {
        width: 320,
        height: 240,
        focal_px: whole.focal_px.map(|f| f / 2.0),
        centre_px: whole.centre_px.map(|c| c / 2.0),
        ..whole
    };
    Simulation::new(camera, Kind::General(3), &[], 5).frames(6)
}

#[test]
fn rendered_frames_are_duplicated_swapped_and_bad_as_the_truth_says() {
    let defects = Defects { bad_frames: 1, duplicated_frames: 1, swapped_depth_pairs: 1, ..Defects::default() };
    let (good, spoilt) = (simulation(), simulation().defects(defects));
    let (good, spoilt) = (good.renderer().unwrap(), spoilt.renderer().unwrap());
    let hit = spoilt.truth().defective.clone();
    let (before, after) = (|i: usize| good.frame(i).unwrap(), |i: usize| spoilt.frame(i).unwrap());

    let [original, copy] = hit.duplicated[0];
    assert_eq!((after(original).image, after(original).depth), (after(copy).image, after(copy).depth));
    assert_eq!(after(original).image, before(original).image);
    let [a, b] = hit.swapped[0];
    assert_eq!((after(a).image, after(a).depth), (before(a).image, before(b).depth));
    assert_eq!(after(b).depth, before(a).depth);
    let bad = hit.bad[0];
    assert_eq!(after(bad).image, before(bad).image);
    assert_ne!(after(bad).depth, before(bad).depth);
    assert!(spoilt.frame(6).is_none());
}

#[test]
fn gross_outliers_are_as_frequent_as_asked_for() {
    let rendering = Rendering { holes: 0.0, edge_noise: 1.0, ..Rendering::default() };
    let clean = simulation().noise(Noise::none()).rendering(rendering);
    let spoilt = clean.clone().defects(Defects { depth_outliers: 0.05, ..Defects::default() });
    let depth = |simulation: &Simulation| simulation.renderer().unwrap().frame(0).unwrap().depth;
    let (before, after) = (depth(&clean), depth(&spoilt));
    let valid = before.iter().filter(|raw| **raw != 0).count() as f64;
    let wrong =
        before.iter().zip(&after).filter(|(a, b)| **a != 0 && **b != 0 && a.abs_diff(**b) >= 20 * 8 - 1).count();
    assert!((wrong as f64 / valid - 0.05).abs() < 0.005, "{}", wrong as f64 / valid);
}

#[test]
fn wrong_declarations_are_in_the_dataset_and_nowhere_else() {
    let dir = tempfile::tempdir().unwrap();
    let defects = Defects { spacing_factor: 1.5, depth_unit_factor: 8.0, ..Defects::default() };
    let truth = simulation().frames(1).defects(defects).write_dataset(dir.path()).unwrap();
    let toml = std::fs::read_to_string(dir.path().join("dataset.toml")).unwrap();
    assert!(toml.contains("spacing_mm = 25.5") && toml.contains("circle_diameter_mm = 17.25"), "{toml}");
    assert!(toml.contains("unit_mm = 1.0"), "{toml}");
    assert_eq!((truth.board.spacing_mm, truth.declared_spacing_mm), (17.0, 25.5));
}

#[test]
fn nonsense_is_refused() {
    let refused = |simulation: Simulation, field: &str| {
        let error = simulation.truth().unwrap_err().to_string();
        assert!(error.contains(field), "{error}");
    };
    refused(simulation().frames(0), "frames");
    refused(simulation().defects(Defects { bad_frames: 7, ..Defects::default() }), "defects");
    refused(simulation().defects(Defects { spacing_factor: 0.0, ..Defects::default() }), "spacing_factor");
    refused(simulation().noise(Noise { blur_px: -1.0, ..Noise::default() }), "blur_px");
    refused(simulation().noise(Noise { tail_dof: Some(2.0), ..Noise::default() }), "tail_dof");
    let camera = CameraTruth { focal_px: [f64::NAN, 1.0], ..CameraTruth::published(1).unwrap() };
    refused(Simulation::new(camera, Kind::Plywood1, &[], 0), "focal");
    let seven = simulation().rendering(Rendering { image_bits: 7, ..Rendering::default() });
    assert!(seven.renderer().is_err());
    assert!(CameraTruth::published(5).is_err());
}
