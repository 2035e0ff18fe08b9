//! Frames that differ as much from each other as possible.

/// Indices of at most `wanted` of the descriptors, each the farthest from those before (Gonzalez 1985), until the farthest is
/// nearer than `least`. Descriptors of unequal length are infinitely far apart. The distance is the mean absolute difference of
/// entries. It begins with `first`.
pub(crate) fn spread(descriptors: &[Vec<f32>], first: usize, wanted: usize, least: f32) -> Vec<usize> {
    if descriptors.is_empty() || wanted == 0 {
        return Vec::new();
    }
    let mut chosen = vec![first];
    let mut nearest: Vec<f32> = descriptors.iter().map(|d| distance(d, &descriptors[first])).collect();
    while chosen.len() < wanted {
        let Some((farthest, gap)) =
            nearest.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
        else {
            break;
        };
        if gap < least || chosen.contains(&farthest) {
            break;
        }
        chosen.push(farthest);
        for (near, descriptor) in nearest.iter_mut().zip(descriptors) {
            *near = near.min(distance(descriptor, &descriptors[farthest]));
        }
    }
    chosen.sort_unstable();
    chosen
}

fn distance(a: &[f32], b: &[f32]) -> f32 {
    if a.len() != b.len() || a.is_empty() {
        return f32::INFINITY;
    }
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.len() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_first_then_the_middle_and_no_twins() {
        let line: Vec<Vec<f32>> = [0.0, 0.001, 0.1, 0.5, 0.52, 1.0].iter().map(|v| vec![*v]).collect();
        assert_eq!(spread(&line, 0, 2, 0.01), [0, 5]);
        assert_eq!(spread(&line, 0, 3, 0.01), [0, 3, 5]);
        assert_eq!(spread(&line, 0, 10, 0.01), [0, 2, 3, 4, 5]);
        assert_eq!(spread(&[], 0, 3, 0.1), [0_usize; 0]);
    }
}
