//! Examinations of linear problems whose missing effects are known: rows y = frame's offset + shared · s + what is planted +
//! noise. For tests.

use depthcal_model::{Block, PieceSpec, Register};
use depthcal_solver::score::{Candidate, Linearization};
use depthcal_solver::{Batch, Factor, Graph, Options, Over, Scalar, Values, VariableId, minimize};
use nalgebra::{SVector, Vector1, Vector2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::along::Along;
use super::evidence::Evidence;
use super::examination::Examination;
use super::frame_planes::FramePlane;
use super::observed_states::ObservedStates;

/// Frames of a problem.
pub(super) const FRAMES: usize = 40;
const ROWS: usize = 25;
/// Names of the candidates, in the order of the linearisation.
const NAMES: [&str; 4] = ["a", "b", "twin", "free"];

/// Regressors of a row: s of the model, a and b of two effects, one that resembles a, and c and c² − 1 of a free function.
struct Row {
    s: f64,
    a: f64,
    b: f64,
    twin: f64,
    c: f64,
    y: f64,
}

type One = Vector1<f64>;

impl Factor<1> for Row {
    type Variables = (One, One, One, One, One, Vector2<f64>);
    fn residual<T: Scalar>(&self, (offset, shared, a, b, twin, free): Over<Self::Variables, T>) -> SVector<T, 1> {
        let effects = a[0] * self.a + b[0] * self.b + twin[0] * self.twin;
        let free = free[0] * self.c + free[1] * (self.c * self.c - 1.0);
        SVector::<T, 1>::new(offset[0] + shared[0] * self.s + effects + free - self.y)
    }
}

/// Sizes of effects in the rows.
#[derive(Clone, Copy, Default)]
pub(super) struct Planted {
    pub a: f64,
    pub b: f64,
    pub c: f64,
    /// Correlation of a with c.
    pub a_with_c: f64,
    /// Standard deviation of a's size from frame to frame.
    pub shake: f64,
    /// Whether the effect that resembles a is among the candidates.
    pub with_twin: bool,
}

/// The examination of a fit of offsets and s alone.
pub(super) fn examined(planted: Planted, seed: u64) -> Examination {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = move || -> f64 { StandardNormal.sample(&mut rng) };
    let mut values = Values::new();
    let [shared, a, b, twin] = std::array::from_fn(|_| values.insert(One::zeros()));
    let free = values.insert(Vector2::zeros());
    let mut batch = Batch::new("rows");
    let mut frames: Vec<VariableId> = Vec::new();
    for _ in 0..FRAMES {
        let of_frame = values.insert(One::zeros());
        frames.push(of_frame.id());
        let (offset, size) = (normal(), planted.a + planted.shake * normal());
        for _ in 0..ROWS {
            let [s, n, b_row, c, m] = std::array::from_fn(|_| normal());
            let a_row = planted.a_with_c * c + (1.0 - planted.a_with_c * planted.a_with_c).sqrt() * n;
            let twin_row = a_row + 0.02 * m;
            let y = offset + 0.5 * s + size * a_row + planted.b * b_row + planted.c * c + normal();
            batch.push(Row { s, a: a_row, b: b_row, twin: twin_row, c, y }, (of_frame, shared, a, b, twin, free));
        }
    }
    let mut graph = Graph::new();
    graph.add_batch(batch);
    [a, b, twin].into_iter().for_each(|key| graph.fix(key));
    graph.fix(free);
    values = minimize(&graph, values, &Options::default()).unwrap().values;
    let ids: [VariableId; 4] = [a.id(), b.id(), twin.id(), free.id()];
    let candidates: Vec<Candidate> = NAMES.iter().zip(ids).map(|(name, id)| Candidate::new(*name, id)).collect();
    let linearization = Linearization::new(&graph, &values, &frames, &candidates).unwrap();
    let mut evidence: Vec<Evidence> = (0..4)
        .filter(|index| planted.with_twin || NAMES[*index] != "twin")
        .map(|index| {
            let score = linearization.score(index);
            Evidence {
                name: NAMES[index].to_owned(),
                spec: PieceSpec::new(NAMES[index]),
                value: None,
                reduced: None,
                along: (NAMES[index] == "free").then_some(Along::Depth),
                p_value: score.p_value,
                score,
                gains: linearization.held_out_gain(&[index]),
                expected_size_mm: 1.0,
                minimal_detectable_mm: 1.0,
                block: Block::new(Register::builtin().find("range_offset").unwrap()),
                index,
            }
        })
        .collect();
    evidence.sort_by(|a, b| b.gain().total_cmp(&a.gain()));
    // As many as a catalogue has.
    Examination { evidence, linearization, tests: 20, states: ObservedStates::default() }
}

/// Planes that deviate no more than noise does: statistics of the mean of χ² with three degrees of freedom.
pub(super) fn quiet_planes() -> Vec<FramePlane> {
    planes(3.0)
}

/// Planes of a statistic.
pub(super) fn planes(statistic: f64) -> Vec<FramePlane> {
    let plane = |i: usize| FramePlane {
        name: i.to_string(),
        offset_mm: 0.0,
        rms_mm: 1.0,
        of_noise: 1.0,
        statistic,
        p_value: 0.4,
    };
    (0..FRAMES).map(plane).collect()
}

/// Place of a candidate in the evidence.
pub(super) fn place(e: &Examination, name: &str) -> usize {
    e.evidence.iter().position(|evidence| evidence.name == name).unwrap()
}
