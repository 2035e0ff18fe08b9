//! An effect of depth in the model of a unit, and the parameters of the depth model that can take its part.

use depthcal_formula::FormulaEffect;
use depthcal_io::{Calibration, CameraRecord, PieceRecord};
use depthcal_model::hook::HookKind;
use depthcal_model::uncertainty::UncertainCamera;
use depthcal_model::{Block, Camera, Context, Covariate, Placement, Register, Role, ScanKind};
use nalgebra::DMatrix;

/// A place on a ray under some conditions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cell {
    /// Pixel and quantities of the frame.
    pub context: Context,
    /// Cosine of the angle of incidence.
    pub cos_incidence: f64,
    /// True depth, mm.
    pub depth_mm: f64,
}

/// An effect of depth in the model of a unit.
#[derive(Debug, Clone)]
pub struct DepthEffect {
    /// The unit's camera, without its lens, with the depth model and this effect, whose parameters alone are uncertain.
    pub with: UncertainCamera,
    /// That camera with the effect at its nominal parameters.
    pub without: Camera,
    /// It with every free parameter of the depth model changed by a standard deviation to either side.
    pub compensating: Vec<[Camera; 2]>,
    /// The amplitude to which the effect refers.
    pub reference_amplitude: Option<f64>,
}

impl DepthEffect {
    /// `None` of other pieces than effects of depth, and of those that neither the register nor a formula explains.
    pub(crate) fn of(calibration: &Calibration, effect: &PieceRecord, register: &Register) -> Option<Self> {
        let covariance = calibration.covariance.as_ref()?;
        let pinhole = calibration.camera.pieces.iter().find(|piece| piece.name == "pinhole")?;
        let pinhole: Vec<f64> = pinhole.parameters.iter().map(|parameter| parameter.value).collect();
        let known = |piece: &PieceRecord| block_of(piece, register).filter(|block| block.hook() == HookKind::Depth);
        let is_model = |block: &Block| block.piece().is_some_and(|piece| piece.role() != Role::Effect);
        let of_effect = known(effect)?;
        let takes_part = |block: &Block| block.name() == effect.name || is_model(block);
        let blocks = calibration.camera.pieces.iter().filter_map(known).filter(takes_part).collect();
        let CameraRecord { width, height, .. } = calibration.camera;
        let camera = Camera::new(width, height, pinhole.try_into().ok()?, blocks);
        let at_rest = |mut block: Block| {
            if block.name() == effect.name {
                block.theta = block.parameters().iter().map(|parameter| parameter.nominal).collect();
            }
            block
        };
        let without = camera.map_blocks(at_rest);
        // Rows of the covariance by places among the camera's parameters.
        let rows = |is_wanted: &dyn Fn(&str) -> bool| -> Vec<(usize, usize)> {
            let mut rows = Vec::new();
            for (block, range) in camera.blocks_with_ranges().filter(|(block, _)| is_wanted(block.name())) {
                for (place, parameter) in range.zip(block.parameters()) {
                    let name = format!("{}.{}", block.name(), parameter.name);
                    rows.extend(covariance.parameters.iter().position(|n| *n == name).map(|row| (place, row)));
                }
            }
            rows
        };
        let (places, uncertain): (Vec<usize>, Vec<usize>) = rows(&|name| name == effect.name).into_iter().unzip();
        let n = uncertain.len();
        let of_effect_alone = DMatrix::from_fn(n, n, |i, k| covariance.matrix[uncertain[i]][uncertain[k]]);
        let others = rows(&|name| name != effect.name && name != "pinhole");
        let changed = |(place, row): (usize, usize)| {
            let std_dev = covariance.matrix[row][row].sqrt();
            [std_dev, -std_dev].map(|step| {
                let mut theta = without.theta();
                theta[place] += step;
                without.with_theta(&theta)
            })
        };
        Some(Self {
            compensating: others.into_iter().map(changed).collect(),
            with: UncertainCamera::new(camera, &places, &of_effect_alone),
            without,
            reference_amplitude: reference_amplitude(&of_effect),
        })
    }
}

/// The block of a piece in a file.
fn block_of(piece: &PieceRecord, register: &Register) -> Option<Block> {
    let placement = Placement { of: piece.of, on: piece.on };
    let made = match &piece.formula {
        Some(definition) => FormulaEffect::new(definition.clone()).ok()?.placed_piece(&piece.options, placement),
        None => register.placed_piece(&piece.name, &piece.options, placement),
    };
    let mut block = Block::new(made.ok()?);
    block.theta = piece.parameters.iter().map(|parameter| parameter.value).collect();
    (block.theta.len() == block.parameters().len()).then_some(block)
}

/// The amplitude to which an effect of the amplitude refers.
fn reference_amplitude(block: &Block) -> Option<f64> {
    let piece = block.piece()?;
    let of_amplitude = Some((Covariate::Amplitude, ScanKind::Reference));
    let constant = piece.constants().into_iter().find(|constant| constant.search == of_amplitude)?;
    piece.options().get(constant.name).copied().filter(|reference| *reference > 0.0)
}

/// Measured depth of a camera without a lens at cells, mm.
pub(crate) fn measured_mm(camera: &Camera, cells: &[Cell]) -> Vec<f64> {
    let [fx, fy, cx, cy, skew] = camera.pinhole();
    let measured = |cell: &Cell| {
        let [u, v] = cell.context.pixel;
        let y = (v - cy) / fy;
        let ray = [(u - cx - skew * y) / fx, y];
        1.0 / camera.measured_inverse_depth(&cell.context, ray, cell.cos_incidence, 1.0 / cell.depth_mm)
    };
    cells.iter().map(measured).collect()
}
