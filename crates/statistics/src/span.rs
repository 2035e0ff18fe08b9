//! The changes that some parameters can make, and what they leave of others.

/// Share of a column that the ones before it must not reach, for it to be one more.
const LEAST_LEFT: f64 = 1e-6;

/// Changes that a linear model can make of some values, as orthonormal columns.
#[derive(Debug, Clone, Default)]
pub struct Span(Vec<Vec<f64>>);

impl Span {
    /// The span of some columns of one length (modified Gram–Schmidt). Columns that those before reach add nothing.
    pub fn of(columns: impl IntoIterator<Item = Vec<f64>>) -> Self {
        let mut span = Self::default();
        for mut column in columns {
            let size = norm(&column);
            span.take_off(&mut column);
            let left = norm(&column);
            if left > LEAST_LEFT * size {
                column.iter_mut().for_each(|v| *v /= left);
                span.0.push(column);
            }
        }
        span
    }

    /// Takes the part of values off that the columns can make: what is left is at right angles to all of them.
    pub fn take_off(&self, values: &mut [f64]) {
        for column in &self.0 {
            let along: f64 = column.iter().zip(&*values).map(|(c, v)| c * v).sum();
            values.iter_mut().zip(column).for_each(|(v, c)| *v -= along * c);
        }
    }
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// The rest has no part along any column, and the part that was taken off is a sum of columns.
    #[test]
    fn what_is_left_is_at_right_angles_to_every_column() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut column = || -> Vec<f64> { (0..40).map(|_| rng.random_range(-1.0..1.0)).collect() };
        let mut columns: Vec<Vec<f64>> = (0..5).map(|_| column()).collect();
        columns.push(columns[0].iter().zip(&columns[3]).map(|(a, b)| 2.0 * a - b).collect());
        columns.push(vec![0.0; 40]);
        let given = column();
        let span = Span::of(columns.clone());
        assert_eq!(span.0.len(), 5, "sums of columns and nothing add nothing");
        let mut left = given.clone();
        span.take_off(&mut left);
        for column in &columns {
            let along: f64 = column.iter().zip(&left).map(|(c, v)| c * v).sum();
            assert!(along.abs() < 1e-12, "{along}");
        }
        let mut taken: Vec<f64> = given.iter().zip(&left).map(|(g, l)| g - l).collect();
        span.take_off(&mut taken);
        assert!(norm(&left) > 0.1 && norm(&taken) < 1e-12 * norm(&given));
    }
}
