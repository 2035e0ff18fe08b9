//! A term with its score, and what chance leaves of it.

use super::library::MOST_COLUMNS;
use super::observations::Observations;
use super::score::Score;
use super::term::Term;

/// Groups of frames whose scores are kept apart.
pub(super) const MOST_GROUPS: usize = 48;

/// The group of a frame, of so many groups of neighbouring frames.
pub(super) fn group_of(frame: usize, frames: usize, groups: usize) -> usize {
    frame * groups / frames
}

/// A term with its score when camera and poses are estimated together with it.
#[derive(Debug, Clone)]
pub(super) struct Screened {
    pub term: Term,
    /// Score of every column, by frame, or by group of neighbouring frames where there are very many.
    pub parts: Vec<[f64; MOST_COLUMNS]>,
    /// Score of each part that the term, estimated from the other parts, leaves.
    unexplained: Vec<[f64; MOST_COLUMNS]>,
    /// The inverse of the information of its columns: [11, 12, 22].
    inverse: [f64; 3],
}

impl Screened {
    /// A term of one product with its score in so many groups of frames; `None` where the shared columns take it up.
    pub fn of(observations: &Observations, term: &Term, groups: usize) -> Option<Self> {
        let score = Score::of(&observations.normals(term), observations.shared)?;
        let (columns, frames) = (term.columns(), score.parts.len());
        if columns > MOST_COLUMNS {
            return None;
        }
        let mut parts = vec![[0.0; MOST_COLUMNS]; groups];
        for (frame, part) in score.parts.iter().enumerate() {
            let sum = &mut parts[group_of(frame, frames, groups)];
            sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        }
        let entry = |i: usize, j: usize| if i.max(j) < columns { score.information[(i, j)] } else { 0.0 };
        let information = [entry(0, 0), entry(0, 1), entry(1, 1)];
        (information[0] > 0.0).then(|| Self {
            term: term.clone(),
            parts,
            unexplained: Vec::new(),
            inverse: inverted(information, columns),
        })
    }

    /// A term with its score in groups of frames; `None` where the shared columns leave too little of a column, of whose square
    /// they take up so much, or where its two columns are one.
    pub fn of_parts(term: Term, parts: &[Part], taken: impl Fn(usize) -> f64) -> Option<Self> {
        let (inverse, unexplained) = explained(parts, |c| LEAST_LEFT * taken(c))?;
        let parts = parts.iter().map(|part| part.gradient).collect();
        Some(Self { term, parts, unexplained, inverse })
    }

    /// Score statistic Uᵀ V⁻¹ U of the weighted sum of the frames' scores.
    #[inline]
    pub fn statistic(&self, weight: impl Fn(usize) -> f64) -> f64 {
        let [mut a, mut b] = [0.0; 2];
        for (i, part) in self.parts.iter().enumerate() {
            let w = weight(i);
            a += w * part[0];
            b += w * part[1];
        }
        self.statistic_of_sum([a, b])
    }

    #[inline]
    fn statistic_of_sum(&self, [a, b]: [f64; MOST_COLUMNS]) -> f64 {
        let [aa, ab, bb] = self.inverse;
        aa * a * a + 2.0 * ab * a * b + bb * b * b
    }

    /// Contribution of every frame, or group of frames, to the statistic of their weighted sum.
    pub fn contributions(&self, weights: &[f64]) -> Vec<f64> {
        let [mut a, mut b] = [0.0; 2];
        for (part, w) in self.parts.iter().zip(weights) {
            a += w * part[0];
            b += w * part[1];
        }
        let [aa, ab, bb] = self.inverse;
        let (by_a, by_b) = (aa * a + ab * b, ab * a + bb * b);
        self.parts.iter().zip(weights).map(|(part, w)| w * (part[0] * by_a + part[1] * by_b)).collect()
    }

    /// The statistic less what its second column is expected to explain of noise, so that terms compare.
    pub fn merit(&self, weight: impl Fn(usize) -> f64) -> f64 {
        self.statistic(weight) - self.penalty()
    }

    /// Score of each frame or group that the term, estimated from the other frames, leaves: without what frames have in common.
    pub fn unexplained(&self) -> &[[f64; MOST_COLUMNS]] {
        &self.unexplained
    }

    /// The merit of a sum of scores.
    pub fn merit_of_sum(&self, sum: [f64; MOST_COLUMNS]) -> f64 {
        self.statistic_of_sum(sum) - self.penalty()
    }

    fn penalty(&self) -> f64 {
        PENALTY * (self.term.columns() as f64 - 1.0)
    }
}

/// Statistic that a further column has to explain. Its expectation under noise is 1, and that of the best of many phases about 2.
pub(super) const PENALTY: f64 = 2.0;

/// Squared mean of the groups' scores over its variance from group to group from which a term counts as shared in part.
pub(super) const LEAST_AGREEMENT: f64 = 3.0;

/// Score and information of a term in a group of frames.
pub(super) struct Part {
    pub gradient: [f64; MOST_COLUMNS],
    /// [11, 12, 22].
    pub information: [f64; 3],
    /// Columns of the term.
    pub columns: usize,
}

/// Inverse of the information of a term, and what it leaves of every part when it is estimated from the other groups, as far as
/// these agree (James, Stein 1961). `None` where the shared columns leave less of a column than `least`, or where its two columns
/// are one.
fn explained(parts: &[Part], least: impl Fn(usize) -> f64) -> Option<([f64; 3], Vec<[f64; MOST_COLUMNS]>)> {
    let mut information = [0.0; 3];
    let mut score = [0.0; MOST_COLUMNS];
    for part in parts {
        (0..3).for_each(|i| information[i] += part.information[i]);
        (0..MOST_COLUMNS).for_each(|i| score[i] += part.gradient[i]);
    }
    let columns = parts.first()?.columns;
    let is_determined = |[a, ab, b]: [f64; 3]| {
        a > LEAST_LEFT * information[0]
            && (columns == 1 || (b > LEAST_LEFT * information[2] && a * b - ab * ab > LEAST_LEFT * a * b))
    };
    let is_left = |c: usize, of: f64| of > least(c);
    if !(is_left(0, information[0]) && (columns == 1 || is_left(1, information[2])) && is_determined(information)) {
        return None;
    }
    let inverse = inverted(information, columns);
    let statistic = |v: [f64; MOST_COLUMNS]| dot(v, product(inverse, v));
    let total: f64 = parts.iter().map(|part| statistic(part.gradient)).sum();
    let unexplained = parts.iter().map(|part| {
        let part_score = part.gradient;
        let of_others = [score[0] - part_score[0], score[1] - part_score[1]];
        // As far as the other groups agree with each other: not at all where they show no more than the best of many terms by
        // chance.
        let agreement = statistic(of_others) / (total - statistic(part_score)).max(f64::MIN_POSITIVE);
        let shrunk = (1.0 - LEAST_AGREEMENT / agreement).max(0.0);
        let information = [0, 1, 2].map(|i| information[i] - part.information[i]);
        if shrunk == 0.0 || !is_determined(information) {
            return part_score;
        }
        let predicted = product(part.information, product(inverted(information, columns), of_others));
        [part_score[0] - shrunk * predicted[0], part_score[1] - shrunk * predicted[1]]
    });
    Some((inverse, unexplained.collect()))
}

/// The inverse of a symmetric matrix [11, 12, 22], or of its first element.
fn inverted([a, ab, b]: [f64; 3], columns: usize) -> [f64; 3] {
    if columns == 1 {
        return [a.recip(), 0.0, 0.0];
    }
    let determinant = a * b - ab * ab;
    [b / determinant, -ab / determinant, a / determinant]
}

fn dot(a: [f64; MOST_COLUMNS], b: [f64; MOST_COLUMNS]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// A symmetric matrix [11, 12, 22] times a vector.
fn product([a, ab, b]: [f64; 3], v: [f64; MOST_COLUMNS]) -> [f64; MOST_COLUMNS] {
    [a * v[0] + ab * v[1], ab * v[0] + b * v[1]]
}

/// Share of a column's information that the other columns must leave.
const LEAST_LEFT: f64 = 1e-4;
