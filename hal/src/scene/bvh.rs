//! Triangles and leaves in a tree of boxes, so that a ray meets few of them.

use super::vector::{V3, least, most, v3};

/// A triangle, or a parallelogram: the points `corner + u side_a + v side_b` with `u, v >= 0` and `u + v <= 1`, or both `<= 1`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    pub(crate) corner: V3,
    pub(crate) side_a: V3,
    pub(crate) side_b: V3,
    pub(crate) parallelogram: bool,
    /// Number of the shape in the order in which it was made.
    pub(crate) id: u32,
}

impl Shape {
    fn bounds(&self) -> (V3, V3) {
        let (a, b) = (self.corner + self.side_a, self.corner + self.side_b);
        let (mut low, mut high) = (self.corner.min(a).min(b), self.corner.max(a).max(b));
        if self.parallelogram {
            let c = a + self.side_b;
            (low, high) = (low.min(c), high.max(c));
        }
        (low, high)
    }

    /// Visits points of the shape that lie at most about `step_m` apart.
    pub(crate) fn sprinkle(&self, step_m: f32, mut visit: impl FnMut(V3)) {
        let na = (self.side_a.length() / step_m) as u32 + 1;
        let nb = (self.side_b.length() / step_m) as u32 + 1;
        for i in 0..=na {
            for j in 0..=nb {
                let (u, v) = (i as f32 / na as f32, j as f32 / nb as f32);
                if self.parallelogram || u + v <= 1.0 {
                    visit(self.corner + self.side_a * u + self.side_b * v);
                }
            }
        }
    }

    /// Source: Möller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997.
    fn hit(&self, origin: V3, direction: V3) -> Option<(f32, f32, f32)> {
        let p = direction.cross(self.side_b);
        let determinant = self.side_a.dot(p);
        if determinant.abs() < 1.0e-14 {
            return None;
        }
        let inverse = 1.0 / determinant;
        let s = origin - self.corner;
        let u = s.dot(p) * inverse;
        // A little over the edge, so that no light falls through the seam between two triangles.
        const OVER: f32 = 1.0e-5;
        if !(-OVER..=1.0 + OVER).contains(&u) {
            return None;
        }
        let q = s.cross(self.side_a);
        let v = direction.dot(q) * inverse;
        let limit = if self.parallelogram { v } else { u + v };
        if v < -OVER || limit > 1.0 + OVER {
            return None;
        }
        Some((self.side_b.dot(q) * inverse, u, v))
    }
}

/// Where a ray meets a shape.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShapeHit {
    pub(crate) t: f32,
    pub(crate) u: f32,
    pub(crate) v: f32,
    pub(crate) id: u32,
}

/// A node of the tree as it is built, with two children.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: V3,
    /// First shape of a leaf, or the second child; the first child follows its parent.
    first: u32,
    high: V3,
    /// Number of shapes in a leaf; 0 for an inner node.
    count: u32,
}

/// A node of the tree as it is walked, with four children, coordinate by coordinate: the compiler makes vectors of them.
#[derive(Clone, Copy, Debug)]
struct Wide {
    low: [[f32; 4]; 3],
    high: [[f32; 4]; 3],
    /// First shape of a leaf, or the child.
    first: [u32; 4],
    /// Number of shapes in a leaf; 0 for an inner node.
    count: [u32; 4],
}

/// Coordinate of the box of a child that is not there: out of reach of every ray.
const NOWHERE: f32 = 3.0e30;

/// The tree.
#[derive(Debug, Default)]
pub(crate) struct Bvh {
    nodes: Vec<Wide>,
    shapes: Vec<Shape>,
}

const LEAF: usize = 4;
const BINS: usize = 12;
/// Nodes below this depth are leaves, however many shapes they hold; bounds the stack of a walk.
const MAX_DEPTH: usize = 32;

impl Bvh {
    pub(crate) fn new(shapes: Vec<Shape>) -> Self {
        let mut items: Vec<Item> = shapes
            .iter()
            .enumerate()
            .map(|(index, shape)| {
                let (low, high) = shape.bounds();
                Item { low, high, centre: (low + high) * 0.5, index: index as u32 }
            })
            .collect();
        let mut bvh = Self::default();
        if !items.is_empty() {
            let mut pairs = Vec::with_capacity(shapes.len());
            build(&mut pairs, &mut items, 0, 0);
            bvh.shapes = items.iter().map(|item| shapes[item.index as usize]).collect();
            bvh.widen(&pairs, 0);
        }
        bvh
    }

    /// Joins each node with the larger of its children, until it has four; says the number of the new node.
    fn widen(&mut self, pairs: &[Node], index: usize) -> u32 {
        let mut children = vec![index];
        while children.len() < 4 {
            let area = |i: usize| half_area(pairs[i].low, pairs[i].high);
            let inner = children.iter().enumerate().filter(|(_, child)| pairs[**child].count == 0);
            let Some((place, child)) = inner.max_by(|a, b| area(*a.1).total_cmp(&area(*b.1))) else { break };
            let second = pairs[*child].first as usize;
            let first = child + 1;
            children[place] = first;
            children.push(second);
        }
        let number = self.nodes.len();
        let nowhere = [[NOWHERE; 4]; 3];
        self.nodes.push(Wide { low: nowhere, high: nowhere, first: [0; 4], count: [0; 4] });
        for (k, child) in children.into_iter().enumerate() {
            let node = &pairs[child];
            let first = if node.count == 0 { self.widen(pairs, child) } else { node.first };
            let wide = &mut self.nodes[number];
            for axis in 0..3 {
                (wide.low[axis][k], wide.high[axis][k]) = (node.low.axis(axis), node.high.axis(axis));
            }
            (wide.first[k], wide.count[k]) = (first, node.count);
        }
        number as u32
    }

    /// The nearest shape with `near < t < far`.
    pub(crate) fn nearest(&self, origin: V3, direction: V3, near: f32, far: f32) -> Option<ShapeHit> {
        self.walk::<false>(origin, direction, near, far)
    }

    /// Whether any shape lies at `near < t < far`.
    pub(crate) fn blocks(&self, origin: V3, direction: V3, near: f32, far: f32) -> bool {
        self.walk::<true>(origin, direction, near, far).is_some()
    }

    fn walk<const ANY: bool>(&self, origin: V3, direction: V3, near: f32, mut far: f32) -> Option<ShapeHit> {
        if self.nodes.is_empty() {
            return None;
        }
        let inverse = v3(reciprocal(direction.x), reciprocal(direction.y), reciprocal(direction.z));
        let mut best = None;
        // Three more wait for each level that is gone down.
        let mut stack = [(0u32, 0u32, 0.0f32); 3 * MAX_DEPTH + 4];
        let mut top = 1;
        stack[0] = (0, 0, near);
        while top > 0 {
            top -= 1;
            let (first, count, enter) = stack[top];
            if enter >= far {
                continue;
            }
            if count == 0 {
                let wide = &self.nodes[first as usize];
                let (enter, leave) = wide.cross(origin, inverse, near, far);
                let bottom = top;
                for k in 0..4 {
                    if enter[k] <= leave[k] * 1.000_001 {
                        // Kept in order, the nearest on top.
                        let mut place = top;
                        while place > bottom && stack[place - 1].2 < enter[k] {
                            stack[place] = stack[place - 1];
                            place -= 1;
                        }
                        stack[place] = (wide.first[k], wide.count[k], enter[k]);
                        top += 1;
                    }
                }
                continue;
            }
            for shape in &self.shapes[first as usize..(first + count) as usize] {
                if let Some((t, u, v)) = shape.hit(origin, direction)
                    && t > near
                    && t < far
                {
                    far = t;
                    best = Some(ShapeHit { t, u, v, id: shape.id });
                    if ANY {
                        return best;
                    }
                }
            }
        }
        best
    }
}

impl Wide {
    /// Where a ray enters and leaves each child.
    #[inline]
    fn cross(&self, origin: V3, inverse: V3, near: f32, far: f32) -> ([f32; 4], [f32; 4]) {
        let (mut enter, mut leave) = ([near; 4], [far; 4]);
        for axis in 0..3 {
            let (o, i) = (origin.axis(axis), inverse.axis(axis));
            for k in 0..4 {
                let a = (self.low[axis][k] - o) * i;
                let b = (self.high[axis][k] - o) * i;
                enter[k] = most(enter[k], least(a, b));
                leave[k] = least(leave[k], most(a, b));
            }
        }
        (enter, leave)
    }
}

fn build(nodes: &mut Vec<Node>, items: &mut [Item], first: u32, depth: usize) {
    let (mut low, mut high) = (items[0].low, items[0].high);
    let (mut centre_low, mut centre_high) = (items[0].centre, items[0].centre);
    for item in items.iter() {
        (low, high) = (low.min(item.low), high.max(item.high));
        (centre_low, centre_high) = (centre_low.min(item.centre), centre_high.max(item.centre));
    }
    let node = nodes.len();
    nodes.push(Node { low, first, high, count: items.len() as u32 });
    if items.len() <= LEAF || depth >= MAX_DEPTH {
        return;
    }
    let Some(middle) = split(items, centre_low, centre_high) else { return };
    let (left, right) = items.split_at_mut(middle);
    build(nodes, left, first, depth + 1);
    nodes[node].first = nodes.len() as u32;
    build(nodes, right, first + middle as u32, depth + 1);
    nodes[node].count = 0;
}

#[derive(Clone, Copy)]
struct Item {
    low: V3,
    high: V3,
    centre: V3,
    index: u32,
}

/// Keeps 0 times infinity, which is not a number, out of the box test.
fn reciprocal(x: f32) -> f32 {
    if x.abs() < 1.0e-12 { 1.0e12 } else { 1.0 / x }
}

fn half_area(low: V3, high: V3) -> f32 {
    let d = high - low;
    d.x * d.y + d.y * d.z + d.z * d.x
}

/// Orders the items so that those of the first child come first, and says how many they are: by surface area, in bins.
fn split(items: &mut [Item], low: V3, high: V3) -> Option<usize> {
    let extent = high - low;
    let axis = if extent.x >= extent.y && extent.x >= extent.z {
        0
    } else if extent.y >= extent.z {
        1
    } else {
        2
    };
    let (start, length) = (low.axis(axis), extent.axis(axis));
    if length <= 1.0e-9 {
        return None;
    }
    let scale = BINS as f32 * 0.9999 / length;
    let bin_of = |item: &Item| (((item.centre.axis(axis) - start) * scale) as usize).min(BINS - 1);
    let empty = (0usize, v3(1.0e30, 1.0e30, 1.0e30), v3(-1.0e30, -1.0e30, -1.0e30));
    let mut bins = [empty; BINS];
    for item in items.iter() {
        let bin = &mut bins[bin_of(item)];
        *bin = (bin.0 + 1, bin.1.min(item.low), bin.2.max(item.high));
    }
    let join = |a: (usize, V3, V3), b: (usize, V3, V3)| (a.0 + b.0, a.1.min(b.1), a.2.max(b.2));
    let mut after = [empty; BINS + 1];
    for i in (0..BINS).rev() {
        after[i] = join(after[i + 1], bins[i]);
    }
    let mut before = empty;
    let mut best = (f32::INFINITY, 0);
    for i in 1..BINS {
        before = join(before, bins[i - 1]);
        if before.0 == 0 || after[i].0 == 0 {
            continue;
        }
        let cost =
            before.0 as f32 * half_area(before.1, before.2) + after[i].0 as f32 * half_area(after[i].1, after[i].2);
        if cost < best.0 {
            best = (cost, i);
        }
    }
    let cut = best.1;
    let mut middle = 0;
    for i in 0..items.len() {
        if bin_of(&items[i]) < cut {
            items.swap(i, middle);
            middle += 1;
        }
    }
    (middle > 0 && middle < items.len()).then_some(middle)
}
