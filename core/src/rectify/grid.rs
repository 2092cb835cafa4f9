//! The map of one camera, sampled on a coarse grid in fixed point.
//!
//! A plane, exact in integers, takes up scale, turn and shift; a node holds what remains, the lens mostly, in 16 bits.
//! Between the nodes the map is bilinear, also exact in integers, and linear along a row from node to node: a start and
//! a slope tell eight pixels.

use core::{iter::Zip, slice::Iter};

use super::cameras::CameraMap;

/// Pixels from node to node, a power of two.
pub(super) const STEP: usize = 1 << STEP_SHIFT;
const STEP_SHIFT: u32 = 3;

/// Fraction bits of a node, px.
const NODE_SHIFT: u32 = 6;

/// Fraction bits of a place, px: those of a node and of both interpolations, so that nothing is ever rounded between.
pub(super) const PLACE_SHIFT: u32 = NODE_SHIFT + 2 * STEP_SHIFT;
const PLACE_ONE: f32 = (1_u32 << PLACE_SHIFT) as f32;

/// A node where the map has no value, or one too far off the plane.
const NOWHERE: [i16; 2] = [i16::MIN; 2];

/// The steepest plane, px per px: with it, places of pictures of 8192 px stay within 31 bits.
const MAX_SLOPE: f32 = 8.0;

/// The farthest place, px.
const MAX_PLACE_PX: f32 = 32768.0;

/// Nodes along a side of `length` px.
pub(super) const fn side_nodes(length: usize) -> usize {
    length.div_ceil(STEP) + 1
}

/// The coarse map of one camera; `[x, y]` throughout.
#[derive(Clone, Debug)]
pub(super) struct Grid<const NODES: usize> {
    /// Row by row, in `1 / 2^NODE_SHIFT` px from the plane.
    nodes: [[i16; 2]; NODES],
    columns: usize,
    plane: Plane,
}

/// The linear part of a map, in `1 / 2^PLACE_SHIFT` px.
#[derive(Clone, Copy, Debug)]
struct Plane {
    origin: [i32; 2],
    along_row: [i32; 2],
    along_column: [i32; 2],
}

/// The places of up to [`STEP`] pixels of a row, in `1 / 2^PLACE_SHIFT` px: `start + k * slope`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    pub(super) start: [i32; 2],
    pub(super) slope: [i32; 2],
}

impl<const NODES: usize> Grid<NODES> {
    pub(super) const fn new() -> Self {
        let plane = Plane { origin: [0; 2], along_row: [0; 2], along_column: [0; 2] };
        // Zeros, so that a detector in a `static` takes no room in the image of the program; no node is read before `fill`.
        Self { nodes: [[0; 2]; NODES], columns: 0, plane }
    }

    /// Samples the map for a rectified picture of `width x height`; the caller has seen that the nodes suffice.
    ///
    /// # Bound
    /// Five evaluations of the lens per node.
    pub(super) fn fill(&mut self, map: &CameraMap, width: usize, height: usize) {
        self.plane = Plane::tangent(map, width, height);
        self.columns = side_nodes(width);
        // A picture has at least one column of nodes.
        for (row, nodes) in self.nodes.chunks_mut(self.columns.max(1)).enumerate().take(side_nodes(height)) {
            for (column, node) in nodes.iter_mut().enumerate() {
                let [u, v] = [column, row].map(|nodes| nodes.saturating_mul(STEP));
                *node = node_value(map, &self.plane, u, v);
            }
        }
    }

    /// The segments of row `v` from the left, `None` where the map has no value; none at all below the picture.
    #[inline(always)]
    pub(super) fn segments(&self, v: usize) -> Segments<'_> {
        let first = (v >> STEP_SHIFT).saturating_mul(self.columns);
        let upper = self.nodes.get(first..).unwrap_or(&[]);
        let lower = upper.get(self.columns..).unwrap_or(&[]);
        let lower = lower.get(..self.columns).unwrap_or(lower);
        let nodes = upper.iter().zip(lower);
        let plane = self.plane;
        let base = core::array::from_fn(|i| plane.origin[i].wrapping_add(plane.along_column[i].wrapping_mul(v as i32)));
        let mut segments = Segments { nodes, along_row: plane.along_row, base, left: None, below: (v % STEP) as i32 };
        segments.left = segments.node().flatten();
        segments
    }
}

/// The segments of a row.
pub(super) struct Segments<'a> {
    nodes: Zip<Iter<'a, [i16; 2]>, Iter<'a, [i16; 2]>>,
    along_row: [i32; 2],
    /// Where the plane has the node to the left.
    base: [i32; 2],
    left: Option<[i32; 2]>,
    /// Rows below the upper nodes.
    below: i32,
}

impl Segments<'_> {
    /// The value of the map between the next two nodes, in `1 / 2^(NODE_SHIFT + STEP_SHIFT)` px.
    #[inline(always)]
    fn node(&mut self) -> Option<Option<[i32; 2]>> {
        let (upper, lower) = self.nodes.next()?;
        let below = self.below;
        let between = |i: usize| i32::from(upper[i]) * (STEP as i32 - below) + i32::from(lower[i]) * below;
        // Nodes hold either both of their numbers or none.
        let known = upper[0] != NOWHERE[0] && lower[0] != NOWHERE[0];
        Some(known.then(|| [between(0), between(1)]))
    }
}

impl Iterator for Segments<'_> {
    type Item = Option<Segment>;

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        let right = self.node()?;
        let segment = match (self.left, right) {
            (Some(left), Some(right)) => {
                let start = |i: usize| self.base[i].wrapping_add(left[i] << STEP_SHIFT);
                let slope = |i: usize| self.along_row[i].wrapping_add(right[i].wrapping_sub(left[i]));
                Some(Segment { start: [start(0), start(1)], slope: [slope(0), slope(1)] })
            }
            _ => None,
        };
        for (base, along) in self.base.iter_mut().zip(self.along_row) {
            *base = base.wrapping_add(along << STEP_SHIFT);
        }
        self.left = right;
        Some(segment)
    }
}

impl Plane {
    /// The map's tangent in the middle of the picture; plainly the pixel itself where there is no map.
    fn tangent(map: &CameraMap, width: usize, height: usize) -> Self {
        let (u, v) = (0.5 * width as f32, 0.5 * height as f32);
        let reach = STEP as f32;
        let places = [
            map.source(u, v),
            map.source(u - reach, v),
            map.source(u + reach, v),
            map.source(u, v - reach),
            map.source(u, v + reach),
        ];
        let [Some(middle), Some(left), Some(right), Some(above), Some(below)] = places else {
            let one = 1 << PLACE_SHIFT;
            return Self { origin: [0; 2], along_row: [one, 0], along_column: [0, one] };
        };
        let slope = |low: f32, high: f32| ((high - low) / (2.0 * reach)).clamp(-MAX_SLOPE, MAX_SLOPE);
        let along_row = [0, 1].map(|i| slope(left[i], right[i]));
        let along_column = [0, 1].map(|i| slope(above[i], below[i]));
        let origin =
            [0, 1].map(|i| middle[i].clamp(-MAX_PLACE_PX, MAX_PLACE_PX) - along_row[i] * u - along_column[i] * v);
        let fixed = |px: [f32; 2]| px.map(|p| (p * PLACE_ONE) as i32);
        Self { origin: fixed(origin), along_row: fixed(along_row), along_column: fixed(along_column) }
    }

    fn place_px(&self, u: usize, v: usize) -> [f32; 2] {
        core::array::from_fn(|i| {
            // 32 bits times the number of a pixel, of which no picture has 2^31 in a row or column.
            let across = i64::from(self.along_row[i]).wrapping_mul(u as i64);
            let down = i64::from(self.along_column[i]).wrapping_mul(v as i64);
            i64::from(self.origin[i]).wrapping_add(across).wrapping_add(down) as f32 / PLACE_ONE
        })
    }
}

fn node_value(map: &CameraMap, plane: &Plane, u: usize, v: usize) -> [i16; 2] {
    let at = |du: f32, dv: f32| map.source(u as f32 + du, v as f32 + dv);
    let Some(middle) = at(0.0, 0.0) else { return NOWHERE };
    let reach = STEP as f32;
    let beside = [at(-reach, 0.0), at(reach, 0.0), at(0.0, -reach), at(0.0, reach)];
    // A chord lies to one side of its curve, by h^2 f'' / 8 in the middle. Half of that, in each direction, moves the nodes
    // so that the error is shared between both sides.
    let bend = if let [Some(left), Some(right), Some(above), Some(below)] = beside {
        [0, 1].map(|i| left[i] + right[i] + above[i] + below[i] - 4.0 * middle[i])
    } else {
        [0.0; 2]
    };
    let plane_px = plane.place_px(u, v);
    let node = [0, 1].map(|i| libm::roundf((middle[i] - bend[i] / 16.0 - plane_px[i]) * (1_u32 << NODE_SHIFT) as f32));
    if node.iter().all(|n| n.abs() < f32::from(i16::MAX)) { node.map(|n| n as i16) } else { NOWHERE }
}
