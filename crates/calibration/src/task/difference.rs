//! Two calibrations compared with each other: yesterday's and today's, the maker's and one's own, two models.

use std::path::{Path, PathBuf};

use depthcal_io::{
    Calibration, CameraDifference, CameraRecord, ClearestDifference, DepthDifference, Difference, DifferenceSide,
    DifferenceSize, FileError, ParameterDifference, PieceRecord, ProjectionDifference, grid_pixel,
};
use depthcal_model::hook::HookKind;
use depthcal_model::uncertainty::UncertainCamera;
use depthcal_model::{Camera, Context, Register};
use depthcal_statistics::median;
use nalgebra::{Isometry3, Point3, UnitQuaternion};

use super::error::TaskError;
use super::extrinsics_difference::extrinsics_difference;
use super::given_camera::GivenCamera;
use super::made::Made;
use super::results::{Results, Shown};
use crate::camera_record::covariance_of;
use crate::camera_record::piece_records;
use crate::depth_uncertainty::usual_quantities;
use crate::judge::difference::{Propagated, depends_on_distance, depth_differences, projection_difference};
use crate::observe::PlacedCamera;

/// Level of every test. A comparison has many, which depend on each other: chance makes one in a hundred of them differ anywhere.
const LEVEL: f64 = 1e-3;
/// Columns of the grid over the image, and number of distances.
const FINE: [usize; 2] = [17, 13];
/// Both for cameras of more parameters than `MANY`.
const COARSE: [usize; 2] = [9, 9];
const MANY: usize = 60;
/// Distances go from this share of the nearest board to this multiple of the farthest.
const BEYOND: [f64; 2] = [0.7, 1.4];
/// Distances where no board is known, mm.
const WITHOUT_BOARDS_MM: [f64; 2] = [400.0, 4000.0];

/// One of two calibrations that are compared.
#[derive(Debug, Clone)]
pub struct DiffSide {
    /// Its name: the path, as it was given.
    pub name: String,
    /// The calibration, or the camera file of another program.
    pub given: GivenCamera,
    /// The pieces that it may have.
    pub register: Register,
}

/// Two calibrations, compared.
#[derive(Debug, Clone)]
pub struct Differed {
    /// `diff.json`.
    pub record: Difference,
}

/// A camera of a side, with its record where that is a calibration.
struct SideCamera<'a> {
    placed: &'a PlacedCamera,
    uncertain: UncertainCamera,
    calibration: Option<(&'a Calibration, &'a CameraRecord)>,
}

impl Differed {
    /// Compares two calibrations: second minus first. `size` is that of images (px) where neither file has one; `option` is what
    /// its user calls it.
    ///
    /// # Errors
    ///
    /// [`TaskError`]: a piece is not known, images differ in size or have none, no camera is in both.
    pub fn new(sides: &[DiffSide; 2], size: Option<[usize; 2]>, option: &str) -> Result<Self, TaskError> {
        let [first, second] = sides;
        let no_size =
            || TaskError::NoSize { first: first.name.clone(), second: second.name.clone(), option: option.to_owned() };
        let fallback = first.given.size().or(second.given.size()).or(size).ok_or_else(no_size)?;
        let placed = [
            first.given.cameras(first.given.size().unwrap_or(fallback), &first.register)?,
            second.given.cameras(second.given.size().unwrap_or(fallback), &second.register)?,
        ];
        let pairs = pairs([&placed[0], &placed[1]]);
        if pairs.is_empty() {
            let names = placed.each_ref().map(|cameras| names(cameras).join(", "));
            return Err(TaskError::NoCommonCamera { first: first.name.clone(), second: second.name.clone(), names });
        }
        let mut cameras = Vec::new();
        for pair in &pairs {
            let sizes = pair.map(|camera| [camera.camera.width, camera.camera.height]);
            if sizes[0] != sizes[1] {
                let camera = if pairs.len() > 1 { format!("camera {}", pair[0].name) } else { "the camera".to_owned() };
                let (first, second) = (first.name.clone(), second.name.clone());
                return Err(TaskError::DifferentSizes { camera, first, second, sizes });
            }
            cameras.push(camera_difference([side_camera(pair[0], &first.given), side_camera(pair[1], &second.given)]));
        }
        let common: Vec<&str> = pairs.iter().flatten().map(|camera| camera.name.as_str()).collect();
        let not_compared = placed.iter().flat_map(|cameras| names(cameras)).filter(|name| !common.contains(name));
        let record = Difference {
            first: first.name.clone(),
            second: second.name.clone(),
            common_frames: common_frames(first.given.record(), second.given.record()),
            level: LEVEL,
            not_compared: not_compared.map(str::to_owned).collect(),
            cameras,
        };
        Ok(Self { record })
    }
}

/// Number of frames of one dataset to which both calibrations were fitted.
fn common_frames(first: Option<&Calibration>, second: Option<&Calibration>) -> usize {
    let (Some(first), Some(second)) = (first, second) else { return 0 };
    if first.dataset.digest.is_empty() || first.dataset.digest != second.dataset.digest {
        return 0;
    }
    first.frames.iter().filter(|frame| second.frame(&frame.name).is_some()).count()
}

fn names(cameras: &[PlacedCamera]) -> Vec<&str> {
    cameras.iter().map(|camera| camera.name.as_str()).collect()
}

/// Cameras of the same name; where both sides have a single one, these, whatever their names.
fn pairs<'a>([first, second]: [&'a [PlacedCamera]; 2]) -> Vec<[&'a PlacedCamera; 2]> {
    if let ([a], [b]) = (first, second) {
        return vec![[a, b]];
    }
    let partner = |a: &'a PlacedCamera| Some([a, second.iter().find(|b| b.name == a.name)?]);
    first.iter().filter_map(partner).collect()
}

fn side_camera<'a>(placed: &'a PlacedCamera, given: &'a GivenCamera) -> SideCamera<'a> {
    let calibration = given.record();
    let record = calibration.and_then(|c| Some((c, c.cameras().find(|record| record.name == placed.name)?)));
    let camera = placed.camera.clone();
    let uncertain = match record.and_then(|(c, _)| covariance_of(c, placed)) {
        Some((places, covariance)) => UncertainCamera::new(camera, &places, &covariance),
        None => UncertainCamera::exact(camera),
    };
    SideCamera { placed, uncertain, calibration: record }
}

impl SideCamera<'_> {
    fn camera(&self) -> &Camera {
        &self.uncertain.camera
    }

    fn corrects_depth(&self) -> bool {
        // The pinhole is a block at the same hook as pieces that displace the depth image.
        let pieces = self.camera().blocks().iter().filter(|block| block.piece().is_some());
        pieces.map(|block| block.hook()).any(|hook| matches!(hook, HookKind::Depth | HookKind::Pixel))
    }

    /// Distances of the centre of the board in every frame, mm.
    fn board_distances(&self) -> Vec<f64> {
        let Some((calibration, _)) = self.calibration else { return Vec::new() };
        let [low, high] = calibration.target.marker_rectangle();
        let middle = Point3::new(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.0);
        let distance =
            |frame: &depthcal_io::FrameRecord| (self.placed.camera_from_rig * frame.rig_from_board() * middle).z;
        calibration.frames.iter().map(distance).filter(|z| *z > 0.0).collect()
    }

    fn record(&self) -> DifferenceSide {
        let distances = self.board_distances();
        let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
        let farthest = distances.iter().copied().fold(0.0, f64::max);
        let is_shown = |name: &str| name != "pinhole";
        let blocks = self.camera().blocks().iter().filter(|block| block.hook() != HookKind::Board);
        DifferenceSide {
            pieces: blocks.map(|block| block.name().to_owned()).filter(|name| is_shown(name)).collect(),
            frames: self.calibration.map_or(0, |(_, record)| record.frames_used),
            has_covariance: !self.uncertain.is_exact(),
            corrects_depth: self.corrects_depth(),
            covered_mm: (nearest < farthest).then_some([nearest, farthest]),
        }
    }
}

/// Distances in equal ratios, mm, a little beyond those of the boards.
fn distances(sides: &[SideCamera<'_>; 2], n: usize) -> Vec<f64> {
    let boards: Vec<f64> = sides.iter().flat_map(SideCamera::board_distances).collect();
    let nearest = boards.iter().copied().fold(f64::INFINITY, f64::min);
    let farthest = boards.iter().copied().fold(0.0, f64::max);
    let [near, far] = if nearest < farthest { [BEYOND[0] * nearest, BEYOND[1] * farthest] } else { WITHOUT_BOARDS_MM };
    (0..n).map(|i| near * (far / near).powf(i as f64 / (n as f64 - 1.0))).collect()
}

/// Median temperature of the frames of the first side that has any, °C; NaN without.
fn temperature(sides: &[SideCamera<'_>; 2]) -> f64 {
    let of_side = |side: &SideCamera<'_>| {
        let frames = side.calibration.map(|(calibration, _)| calibration.frames.as_slice()).unwrap_or_default();
        frames.iter().filter_map(|frame| frame.metadata.temperature_c).collect::<Vec<_>>()
    };
    let measured = sides.iter().map(of_side).find(|temperatures| !temperatures.is_empty());
    measured.map_or(f64::NAN, |mut temperatures| median(&mut temperatures))
}

fn camera_difference(sides: [SideCamera<'_>; 2]) -> CameraDifference {
    let size = sides[0].camera();
    let size = [size.width, size.height];
    let many = sides.iter().any(|side| side.camera().theta().len() > MANY);
    let [columns, steps] = if many { COARSE } else { FINE };
    let rows = ((columns as f64 * size[1] as f64 / size[0] as f64).round() as usize).max(2);
    let grid = [columns, rows];
    let pixels: Vec<[f64; 2]> = (0..columns * rows).map(|cell| grid_pixel(size, grid, cell)).collect();
    let distances = distances(&sides, steps);
    let pair = sides.each_ref().map(|side| &side.uncertain);
    let ends = [distances[0], distances[steps - 1]];
    let projection = if sides.iter().any(|side| depends_on_distance(side.camera(), &pixels, ends)) {
        distances.iter().map(|d| projection(pair, &pixels, *d, true)).collect()
    } else {
        vec![projection(pair, &pixels, distances[steps / 2], false)]
    };
    let depth = if sides.iter().any(SideCamera::corrects_depth) {
        let records = sides.iter().filter_map(|side| side.calibration.map(|(calibration, _)| calibration));
        let mut quantities = records.map(usual_quantities).filter(|quantities| quantities.iter().next().is_some());
        let quantities = quantities.next().unwrap_or_default();
        let base = Context { temperature_c: temperature(&sides), quantities, ..Context::default() };
        let contexts: Vec<Context> = pixels.iter().map(|pixel| Context { pixel: *pixel, ..base }).collect();
        let all = depth_differences(pair, &contexts, &distances);
        all.iter().zip(&distances).map(|(difference, distance)| depth(difference, &pixels, *distance)).collect()
    } else {
        Vec::new()
    };
    let [first, second] = sides.each_ref().map(SideCamera::record);
    let is_reference = sides.iter().any(|side| side.placed.camera_from_rig == Isometry3::identity());
    CameraDifference {
        name: sides[0].placed.name.clone(),
        width: size[0],
        height: size[1],
        first,
        second,
        columns,
        rows,
        projection,
        depth,
        extrinsics: (!is_reference).then(|| {
            let calibrations = sides.each_ref().map(|side| side.calibration.map(|(calibration, _)| calibration));
            extrinsics_difference(sides.each_ref().map(|side| side.placed), calibrations)
        }),
        parameters: parameters(&sides),
    }
}

fn projection(pair: [&UncertainCamera; 2], pixels: &[[f64; 2]], distance: f64, varies: bool) -> ProjectionDifference {
    let of_projection = projection_difference(pair, pixels, distance);
    let values = of_projection.difference.values();
    let std_dev_px = of_projection.difference.std_devs::<2>();
    let length = |c: &[Option<f64>]| Some(c[0]?.hypot(c[1]?));
    let lengths: Vec<Option<f64>> = values.chunks(2).map(length).collect();
    ProjectionDifference {
        distance_mm: varies.then_some(distance),
        // By quaternion: the angle of a matrix of nearly no rotation is not a number where its trace is rounded up.
        rotation_rad: UnitQuaternion::from_rotation_matrix(&of_projection.rotation).scaled_axis().into(),
        size: size::<2>(&of_projection.difference, &lengths, &std_dev_px, pixels),
        du_px: values.chunks(2).map(|cell| cell[0]).collect(),
        dv_px: values.chunks(2).map(|cell| cell[1]).collect(),
        std_dev_px,
    }
}

fn depth(difference: &Propagated, pixels: &[[f64; 2]], distance_mm: f64) -> DepthDifference {
    let (difference_mm, std_dev_mm) = (difference.values(), difference.std_devs::<1>());
    let size = size::<1>(difference, &difference_mm, &std_dev_mm, pixels);
    DepthDifference { distance_mm, size, difference_mm, std_dev_mm }
}

/// Size of a difference, and the cell in which it is clearest.
fn size<const N: usize>(
    all: &Propagated,
    cells: &[Option<f64>],
    std_devs: &[Option<f64>],
    pixels: &[[f64; 2]],
) -> DifferenceSize {
    let size = all.size::<N>();
    let clearness = |difference: f64, std_dev: f64| {
        if std_dev > 0.0 { difference.abs() / std_dev } else { difference.abs() }
    };
    let certain = all.is_certain::<N>();
    let cells = cells.iter().zip(std_devs).zip(pixels).zip(certain).filter(|(_, certain)| *certain);
    let valid = cells.filter_map(|(((difference, std_dev), [u, v]), _)| {
        Some(ClearestDifference { u: *u, v: *v, difference: (*difference)?, std_dev: (*std_dev)? })
    });
    let order = |c: &ClearestDifference| clearness(c.difference, c.std_dev);
    DifferenceSize {
        rms: size.rms,
        expected_rms: size.expected_rms,
        p_value: size.p_value,
        differs: size.p_value.is_some_and(|p| p < LEVEL),
        clearest: valid.max_by(|a, b| order(a).total_cmp(&order(b))),
    }
}

/// The parameters that both cameras have.
fn parameters(sides: &[SideCamera<'_>; 2]) -> Vec<ParameterDifference> {
    let pieces = sides.each_ref().map(|side| {
        let estimated = side.calibration.map(|(_, record)| record.pieces.clone());
        let exact = || piece_records(side.camera(), &vec![None; side.camera().theta().len()]);
        estimated.unwrap_or_else(exact)
    });
    let in_second = |piece: &PieceRecord| pieces[1].iter().find(|other| other.name == piece.name);
    let both = pieces[0].iter().filter_map(|piece| Some((piece, in_second(piece)?)));
    let rows = both.flat_map(|(piece, other)| {
        piece.parameters.iter().filter_map(|first| {
            let second = other.parameter(&first.name)?;
            let std_dev = match (first.std_dev, second.std_dev) {
                (None, None) => None,
                (a, b) => Some(a.unwrap_or(0.0).hypot(b.unwrap_or(0.0))),
            };
            Some(ParameterDifference {
                name: format!("{}.{}", piece.name, first.name),
                unit: first.unit.clone(),
                first: first.value,
                second: second.value,
                std_dev,
            })
        })
    });
    rows.collect()
}

impl Results for Differed {
    fn main_file(&self) -> &'static str {
        "diff.json"
    }

    fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        self.record.write(folder.join("diff.json"))?;
        Ok(vec![PathBuf::from("diff.json")])
    }

    fn shown(&self, made: &Made) -> Shown<'_> {
        Shown::Difference { difference: &self.record, made: made.clone() }
    }
}
