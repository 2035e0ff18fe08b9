//! Rendered frames against geometry, against point observations, and against the declared noise.

use depthcal_simulate::{
    Board, CameraTruth, DepthNoise, Effect, Kind, Noise, Pattern, PointOptions, Pose, Rendering, Simulation, catalogue,
    of_whole_frames, uncatalogued,
};

fn complete() -> Rendering {
    Rendering { holes: 0.0, edge_noise: 1.0, ..Rendering::default() }
}

#[test]
fn dots_have_their_centre_of_mass_where_they_are_projected() {
    let camera = CameraTruth { centre_px: [321.3, 238.6], ..CameraTruth::ideal(640, 480, 480.0) };
    let (cx, cy) = (59.5, 85.0);
    let poses: Vec<Pose> = [(400.0, 13.0), (700.0, -80.0), (1200.0, 201.3)]
        .map(|(z, x)| Pose::from_rotation_vector([0.0; 3], [x - cx, 7.7 - cy, z]))
        .to_vec();
    let rendering = Rendering { image_bits: 16, ..Rendering::default() };
    let simulation = Simulation::new(camera, Kind::General(1), &[], 0)
        .poses(poses.clone())
        .noise(Noise::none())
        .rendering(rendering);
    let blurred = simulation.clone().noise(Noise { blur_px: 0.7, ..Noise::none() });
    // Any renderer aliases a sharp disc; with the blur of a real lens only the renderer's own error remains.
    for (simulation, limit) in [(simulation, 0.01), (blurred, 0.005)] {
        let renderer = simulation.renderer().unwrap();
        let mut errors = Vec::new();
        for (index, pose) in poses.iter().enumerate() {
            let frame = renderer.frame(index).unwrap();
            for marker in 0..44 {
                let [x, y] = Board::default().marker(marker);
                let [px, py, z] = pose.apply([x, y, 0.0]);
                let expected = [480.0 * px / z + 321.3, 480.0 * py / z + 238.6];
                let radius = 5.75 * 480.0 / z;
                let centre = centre_of_mass(&frame.image, 640, expected, radius + 2.8);
                errors.push((centre[0] - expected[0]).hypot(centre[1] - expected[1]));
            }
        }
        let rms = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
        let worst = errors.iter().copied().fold(0.0, f64::max);
        assert!(rms < limit && worst < 3.0 * limit, "rms {rms}, worst {worst}");
    }
}

/// Centre of mass of the darkness around `centre`. Paper is as bright as the window's rim, interpolated linearly.
fn centre_of_mass(image: &[u16], width: usize, centre: [f64; 2], reach: f64) -> [f64; 2] {
    let [u0, v0] = centre.map(|c| (c - reach).round() as usize);
    let [u1, v1] = centre.map(|c| (c + reach).round() as usize);
    let grey = |u: usize, v: usize| f64::from(image[v * width + u]);
    let (mut weight, mut moment) = (0.0, [0.0, 0.0]);
    for v in v0..=v1 {
        for u in u0..=u1 {
            if (u as f64 - centre[0]).hypot(v as f64 - centre[1]) > reach {
                continue;
            }
            let (a, b) = ((u - u0) as f64 / (u1 - u0) as f64, (v - v0) as f64 / (v1 - v0) as f64);
            let middle_u = u0.midpoint(u1);
            let middle_v = v0.midpoint(v1);
            let across = grey(u0, middle_v) * (1.0 - a) + grey(u1, middle_v) * a;
            let down = grey(middle_u, v0) * (1.0 - b) + grey(middle_u, v1) * b;
            let centre_level =
                (grey(u0, middle_v) + grey(u1, middle_v) + grey(middle_u, v0) + grey(middle_u, v1)) / 4.0;
            // Relative to the paper: shading across the dot would shift the centre.
            let dark = 1.0 - grey(u, v) / (across + down - centre_level);
            weight += dark;
            moment = [moment[0] + dark * u as f64, moment[1] + dark * v as f64];
        }
    }
    [moment[0] / weight, moment[1] / weight]
}

#[test]
fn points_and_rendered_depth_agree_for_every_effect() {
    let whole = CameraTruth::published(2).unwrap();
    let camera = CameraTruth {
        width: 320,
        height: 240,
        focal_px: whole.focal_px.map(|f| f / 2.0),
        centre_px: whole.centre_px.map(|c| c / 2.0),
        ..whole
    };
    let rendering = Rendering { depth_unit_mm: 0.03, ..complete() };
    let options = PointOptions { edge_margin_mm: 2.5, on_dots: true, ..PointOptions::default() };
    let all = catalogue().iter().chain(uncatalogued()).map(|info| vec![Effect::with_default_size(info.name).unwrap()]);
    for effects in all.chain([vec![]]) {
        let name = effects.first().map_or("none", |effect| &effect.name).to_owned();
        let simulation =
            Simulation::new(camera, Kind::Plywood1, &effects, 2).noise(Noise::none()).rendering(rendering).frames(1);
        let points = simulation.observe_points(&options).unwrap();
        let frame = simulation.renderer().unwrap().frame(0).unwrap();
        assert!(points.frames[0].depths.len() > 200, "{name}");
        for sample in &points.frames[0].depths {
            let index = sample.pixel[1] as usize * camera.width + sample.pixel[0] as usize;
            let z = f64::from(frame.depth[index]) * 0.03;
            assert!((z - sample.z_mm).abs() < 0.02, "{name} at {:?}: {z} {}", sample.pixel, sample.z_mm);
            if name != "depth_registration" {
                assert!((f64::from(frame.amplitude[index]) - sample.amplitude).abs() < 1e-3, "{name}");
            }
        }
    }
}

#[test]
fn depth_noise_has_its_standard_deviation_and_correlation_everywhere() {
    let camera = CameraTruth::published(1).unwrap();
    let quiet = Simulation::new(camera, Kind::Sameheight2, &[], 4).noise(Noise::none()).frames(1);
    let fine = Rendering { depth_unit_mm: 0.04, ..complete() };
    let depth = |simulation: Simulation| simulation.rendering(fine).renderer().unwrap().frame(0).unwrap().depth;
    let before = depth(quiet.clone());
    for noise in [
        Noise { depth_step_rho: 0.0, ..Noise::default() },
        Noise { depth: DepthNoise::TimeOfFlight { sigma_mm: 1.5 }, depth_step_rho: 0.0, ..Noise::default() },
    ] {
        let after = depth(quiet.clone().noise(noise));
        let standard = |i: usize| {
            (before[i] != 0 && after[i] != 0).then(|| {
                let [a, b] = [before[i], after[i]].map(|raw| 1.0 / (f64::from(raw) * 0.04));
                (b - a) / noise.depth.sigma_rho(a)
            })
        };
        let product = |shift: usize| {
            let pairs = (0..before.len() - shift).filter_map(|i| Some(standard(i)? * standard(i + shift)?));
            let (sum, count) = pairs.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
            sum / count
        };
        assert!((product(0) - 1.0).abs() < 0.05, "{}", product(0));
        assert!((product(1) - (-1.0f64 / 6.76).exp()).abs() < 0.05, "{}", product(1));
        assert!((product(640 * 2) - (-4.0f64 / 6.76).exp()).abs() < 0.05, "{}", product(1280));
        assert!(product(12).abs() < 0.05, "{}", product(12));
    }
}

#[test]
fn depth_is_missing_at_dots_and_outlines_and_hardly_elsewhere() {
    let camera = CameraTruth::published(1).unwrap();
    let simulation = Simulation::new(camera, Kind::Sameheight2, &[], 4).frames(1);
    let points = simulation.observe_points(&PointOptions { edge_margin_mm: 4.0, ..Default::default() }).unwrap();
    let frame = simulation.renderer().unwrap().frame(0).unwrap();
    let valid = |[u, v]: [f64; 2]| frame.depth[v.round() as usize * 640 + u.round() as usize] != 0;
    let samples = &points.frames[0].depths;
    let paper = samples.iter().filter(|sample| valid(sample.pixel)).count() as f64 / samples.len() as f64;
    let markers = &points.frames[0].markers;
    let dots = markers.iter().filter(|marker| valid(marker.pixel)).count() as f64 / markers.len() as f64;
    assert!(paper > 0.97, "{paper}");
    assert!((0.05..0.6).contains(&dots), "{dots}");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let effects =
        [Effect::with_default_size("reflectivity_bias").unwrap(), Effect::new("focus_breathing", 1.0).unwrap()];
    let noise = Noise { tail_dof: Some(4.0), ..Noise::default() };
    let simulation =
        Simulation::new(CameraTruth::published(3).unwrap(), Kind::Vertical1, &effects, 8).frames(2).noise(noise);
    let with_threads = |count: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
        pool.install(|| simulation.renderer().unwrap().frame(1).unwrap())
    };
    assert_eq!(with_threads(1), with_threads(3));
}

#[test]
fn a_dataset_tells_nothing_of_its_effects() {
    let dir = tempfile::tempdir().unwrap();
    let effects: Vec<Effect> =
        ["board_bow", "temporal_drift"].iter().map(|name| Effect::with_default_size(name).unwrap()).collect();
    let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::Longplywood2, &effects, 1).frames(2);
    let truth = simulation.write_dataset(dir.path()).unwrap();
    assert_eq!(truth.effects.len(), 2);
    let mut files = Vec::new();
    let mut folders = vec![dir.path().to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { folders.push(path) } else { files.push(path) }
        }
    }
    assert_eq!(files.len(), 6);
    for file in files {
        let bytes = std::fs::read(&file).unwrap();
        let text = String::from_utf8_lossy(&bytes);
        for info in catalogue().iter().chain(uncatalogued()).chain(of_whole_frames()) {
            assert!(!text.contains(info.name), "{}: {}", file.display(), info.name);
        }
        assert!(!text.contains("longplywood"));
    }
    let toml = std::fs::read_to_string(dir.path().join("dataset.toml")).unwrap();
    assert!(toml.contains("kind = \"asymmetric-circles\"") && toml.contains("spacing_mm = 17.0"), "{toml}");
    assert!(toml.contains("unit_mm = 0.125") && toml.contains("metadata = \"frames.csv\""), "{toml}");
    let csv = std::fs::read_to_string(dir.path().join("frames.csv")).unwrap();
    assert!(csv.starts_with("frame,timestamp_s,temperature_c\n0000,0.000,"), "{csv}");
    let error = simulation.write_dataset(dir.path()).unwrap_err().to_string();
    assert!(error.contains("empty"), "{error}");
    let restored: depthcal_simulate::Truth = serde_json::from_str(&serde_json::to_string(&truth).unwrap()).unwrap();
    assert_eq!(restored.effects, truth.effects);
}

#[test]
fn other_boards_are_rendered() {
    let camera = CameraTruth::published(4).unwrap();
    let boards = [
        Board::new(Pattern::Chessboard, 8, 5, 25.0),
        Board::new(Pattern::SymmetricCircles { circle_diameter_mm: 12.0 }, 7, 6, 24.0).white_on_black(),
    ];
    for board in boards {
        let simulation = Simulation::new(camera, Kind::Centered1, &[], 0).board(board).frames(1);
        let frame = simulation.renderer().unwrap().frame(0).unwrap();
        let points = simulation.observe_points(&PointOptions::default()).unwrap();
        assert_eq!(points.frames[0].markers.len(), board.len());
        let level = |[u, v]: [f64; 2]| frame.image[v.round() as usize * 640 + u.round() as usize];
        let markers: Vec<u16> = points.frames[0].markers.iter().map(|marker| level(marker.pixel)).collect();
        let paper: Vec<u16> = points.frames[0].depths.iter().map(|sample| level(sample.pixel)).collect();
        assert!(paper.len() > 100, "{} samples on paper", paper.len());
        if board.white_on_black {
            assert!(markers.iter().min() > paper.iter().max());
        } else {
            // A corner lies between the levels of both squares.
            let mean = markers.iter().map(|&m| f64::from(m)).sum::<f64>() / markers.len() as f64;
            assert!(
                mean > 1.2 * f64::from(*paper.iter().min().unwrap()) && mean < f64::from(*paper.iter().max().unwrap())
            );
        }
    }
}
