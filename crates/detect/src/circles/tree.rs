//! The component tree of an image: its connected dark regions at every threshold.
//!
//! The connected regions {v ≤ t} grow with the threshold t; they are nested and form a tree. One union-find pass over
//! the pixels in ascending order of grey value builds it (Berger et al. 2007, "Effective component tree computation"),
//! with area and second moments of every region. A dot is a node of this tree under any illumination, so there is no
//! threshold to choose.

/// A connected region {v ≤ level}.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    /// Index of the smallest region that contains this one, larger than the node's own index; the root is its own
    /// parent.
    pub(crate) parent: u32,
    /// Threshold.
    pub(crate) level: u8,
    /// Lowest grey value inside.
    pub(crate) darkest: u8,
    /// Number of pixels.
    pub(crate) area: u32,
    /// Sums of x, y, x², xy, y² over the pixels.
    sums: [u64; 5],
}

impl Node {
    /// Centroid, px.
    pub(crate) fn center(&self) -> [f64; 2] {
        let n = f64::from(self.area);
        [self.sums[0] as f64 / n, self.sums[1] as f64 / n]
    }

    /// Second central moments [xx, xy, yy] of the region over its area, px². Pixels are unit squares, hence the 1/12.
    pub(crate) fn covariance(&self) -> [f64; 3] {
        let n = f64::from(self.area);
        let [x, y] = self.center();
        let [_, _, xx, xy, yy] = self.sums.map(|s| s as f64 / n);
        [xx - x * x + 1.0 / 12.0, xy - x * y, yy - y * y + 1.0 / 12.0]
    }

    fn absorb(&mut self, child: &Node) {
        self.area += child.area;
        self.darkest = self.darkest.min(child.darkest);
        for (sum, more) in self.sums.iter_mut().zip(child.sums) {
            *sum += more;
        }
    }
}

/// Builds the tree of an 8-bit image (row-major) with 4-connected regions. Children come before their parents; the root
/// is last.
pub(crate) fn component_tree(data: &[u8], width: usize, height: usize) -> Vec<Node> {
    let order = sorted_by_value(data);
    let count = data.len();
    // `parent` is the tree, `shortcut` the union-find forest over it with path halving.
    let mut parent: Vec<u32> = (0..count as u32).collect();
    let mut shortcut: Vec<u32> = parent.clone();
    let mut seen = vec![false; count];
    let find = |shortcut: &mut [u32], mut i: u32| {
        while shortcut[i as usize] != i {
            let up = shortcut[shortcut[i as usize] as usize];
            shortcut[i as usize] = up;
            i = up;
        }
        i
    };
    for &p in &order {
        seen[p as usize] = true;
        let (x, y) = (p as usize % width, p as usize / width);
        let neighbours = [
            (x > 0).then(|| p - 1),
            (x + 1 < width).then(|| p + 1),
            (y > 0).then(|| p - width as u32),
            (y + 1 < height).then(|| p + width as u32),
        ];
        for q in neighbours.into_iter().flatten().filter(|&q| seen[q as usize]) {
            let root = find(&mut shortcut, q);
            if root != p {
                shortcut[root as usize] = p;
                parent[root as usize] = p;
            }
        }
    }
    // The last pixel of a region at its level represents the region: make all its pixels point there, root first.
    for &p in order.iter().rev() {
        let up = parent[p as usize];
        let top = parent[up as usize];
        if data[top as usize] == data[up as usize] {
            parent[p as usize] = top;
        }
    }
    nodes(data, width, &order, &parent)
}

/// One node per region, from the tree of pixels.
fn nodes(data: &[u8], width: usize, order: &[u32], parent: &[u32]) -> Vec<Node> {
    let stands_for_region = |p: u32| {
        let up = parent[p as usize];
        up == p || data[up as usize] != data[p as usize]
    };
    let mut node_of = vec![u32::MAX; data.len()];
    let mut nodes = Vec::new();
    for &p in order.iter().filter(|&&p| stands_for_region(p)) {
        node_of[p as usize] = nodes.len() as u32;
        let level = data[p as usize];
        nodes.push(Node { parent: 0, level, darkest: level, area: 0, sums: [0; 5] });
    }
    for &p in order {
        let representative = if node_of[p as usize] == u32::MAX { parent[p as usize] } else { p };
        let (x, y) = (u64::from(p) % width as u64, u64::from(p) / width as u64);
        let pixel = Node { parent: 0, level: 0, darkest: data[p as usize], area: 1, sums: [x, y, x * x, x * y, y * y] };
        nodes[node_of[representative as usize] as usize].absorb(&pixel);
    }
    for &p in order.iter().filter(|&&p| stands_for_region(p)) {
        let (node, up) = (node_of[p as usize] as usize, node_of[parent[p as usize] as usize]);
        nodes[node].parent = up;
        if up as usize != node {
            let child = nodes[node];
            nodes[up as usize].absorb(&child);
        }
    }
    nodes
}

/// Pixel indices in ascending order of grey value, by a stable counting sort.
fn sorted_by_value(data: &[u8]) -> Vec<u32> {
    let mut start = [0usize; 257];
    for &v in data {
        start[usize::from(v) + 1] += 1;
    }
    for level in 0..256 {
        start[level + 1] += start[level];
    }
    let mut order = vec![0u32; data.len()];
    for (p, &v) in data.iter().enumerate() {
        order[start[usize::from(v)]] = p as u32;
        start[usize::from(v)] += 1;
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_pits_in_a_plain_are_two_leaves_under_the_root() {
        let mut data = vec![200u8; 10 * 6];
        for (x, y, v) in [(1, 1, 10), (2, 1, 20), (1, 2, 10), (7, 3, 50)] {
            data[y * 10 + x] = v;
        }
        let tree = component_tree(&data, 10, 6);
        let root = tree.last().expect("a root");
        assert_eq!((root.area, root.level, root.darkest), (60, 200, 10));
        let pit = tree.iter().find(|n| n.level == 20).expect("the pit of three pixels");
        assert_eq!((pit.area, pit.darkest), (3, 10));
        assert_eq!(pit.center(), [4.0 / 3.0, 4.0 / 3.0]);
        assert!(tree.iter().any(|n| n.level == 50 && n.area == 1));
        for (i, node) in tree.iter().enumerate().take(tree.len() - 1) {
            assert!(node.parent as usize > i && tree[node.parent as usize].level > node.level);
        }
    }

    #[test]
    fn covariance_of_a_rectangle() {
        let mut data = vec![9u8; 20 * 20];
        for y in 5..9 {
            for x in 3..15 {
                data[y * 20 + x] = 1;
            }
        }
        let tree = component_tree(&data, 20, 20);
        let [xx, xy, yy] = tree[0].covariance();
        assert!((xx - 144.0 / 12.0).abs() < 1e-9 && xy.abs() < 1e-9 && (yy - 16.0 / 12.0).abs() < 1e-9);
    }
}
