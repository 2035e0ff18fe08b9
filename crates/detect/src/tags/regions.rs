//! Connected regions of dark pixels.

/// A run of dark pixels in a row, from `start` to before `end`.
#[derive(Debug, Clone, Copy)]
struct Run {
    row: usize,
    start: usize,
    end: usize,
}

/// The outlines of the 4-connected regions of a mask, as points that enclose the region's pixels (px, pixel centres at integers):
/// both ends of each row, and the corners of the first and the last. Regions that are lower or narrower than `least` px, or that
/// touch the image's border, are left out.
pub(super) fn outlines(mask: &[bool], width: usize, least: usize) -> Vec<Vec<[f64; 2]>> {
    let height = mask.len() / width.max(1);
    let mut runs: Vec<Run> = Vec::new();
    let mut root: Vec<u32> = Vec::new();
    // Runs of the row before.
    let mut above = 0..0;
    for (row, line) in mask.chunks_exact(width).enumerate() {
        let first = runs.len();
        let mut x = 0;
        let mut candidate = above.start;
        while x < width {
            if !line[x] {
                x += 1;
                continue;
            }
            let start = x;
            while x < width && line[x] {
                x += 1;
            }
            let run = Run { row, start, end: x };
            let label = runs.len() as u32;
            runs.push(run);
            root.push(label);
            while candidate < above.end && runs[candidate].end <= start {
                candidate += 1;
            }
            let mut over = candidate;
            while over < above.end && runs[over].start < x {
                join(&mut root, over as u32, label);
                over += 1;
            }
        }
        above = first..runs.len();
    }
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); runs.len()];
    for i in 0..runs.len() as u32 {
        members[find(&mut root, i) as usize].push(i);
    }
    members.iter().filter(|m| m.len() >= least).filter_map(|m| outline(m, &runs, [width, height], least)).collect()
}

fn outline(members: &[u32], runs: &[Run], [width, height]: [usize; 2], least: usize) -> Option<Vec<[f64; 2]>> {
    let mut rows: Vec<Run> = Vec::new();
    for &i in members {
        let run = runs[i as usize];
        match rows.last_mut() {
            Some(last) if last.row == run.row => {
                last.start = last.start.min(run.start);
                last.end = last.end.max(run.end);
            }
            _ => rows.push(run),
        }
    }
    let (left, right) = rows.iter().fold((usize::MAX, 0), |(l, r), run| (l.min(run.start), r.max(run.end)));
    let (top, bottom) = (rows.first()?.row, rows.last()?.row);
    if rows.len() < least || right - left < least || left == 0 || top == 0 || right == width || bottom + 1 == height {
        return None;
    }
    let corner = |x: usize, y: f64| [x as f64 - 0.5, y];
    let mut points = Vec::with_capacity(2 * rows.len() + 4);
    for run in &rows {
        points.extend([corner(run.start, run.row as f64), corner(run.end, run.row as f64)]);
    }
    for (run, y) in [(rows.first()?, top as f64 - 0.5), (rows.last()?, bottom as f64 + 0.5)] {
        points.extend([corner(run.start, y), corner(run.end, y)]);
    }
    Some(points)
}

fn find(root: &mut [u32], mut i: u32) -> u32 {
    while root[i as usize] != i {
        let up = root[root[i as usize] as usize];
        root[i as usize] = up;
        i = up;
    }
    i
}

/// The smaller root stays, so that the result does not depend on the order.
fn join(root: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(root, a), find(root, b));
    root[a.max(b) as usize] = a.min(b);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_is_one_region_and_what_touches_the_border_is_none() {
        let rows = [
            "..............", //
            ".####....#....",
            ".#..#...###...",
            ".#..#....#....",
            ".####.......##",
            "..............",
        ];
        let mask: Vec<bool> = rows.iter().flat_map(|r| r.chars().map(|c| c == '#')).collect();
        let all = outlines(&mask, 14, 3);
        assert_eq!(all.len(), 2);
        let bounds = |points: &[[f64; 2]]| {
            points.iter().fold([99.0f64, 99.0, -99.0, -99.0], |b, p| {
                [b[0].min(p[0]), b[1].min(p[1]), b[2].max(p[0]), b[3].max(p[1])]
            })
        };
        assert_eq!(bounds(&all[0]), [0.5, 0.5, 4.5, 4.5]);
        assert_eq!(bounds(&all[1]), [7.5, 0.5, 10.5, 3.5]);
    }
}
