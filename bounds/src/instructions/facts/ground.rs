//! How often the loops of finding the ground and the obstacles go round.

use super::{At, Fact, Stage, angles, each, function, library, ran, total, unwritten};
use crate::work::Shape;

/// Tries to grow a plane: from that of the frame before, from the mount and from three regions; and if none of them is at the height of
/// the mount, once more without the mount.
const GROWN: u64 = (1 + 1 + 3) + (1 + 3);
const GROWN_ELSEWHERE: u64 = 1 + 3;

pub(super) fn stage(shape: &Shape, of: &dyn Fn(&str, &str) -> u64) -> Stage {
    let of = |name| of("ground", name);
    let (width, surfaces) = (shape.width, shape.surfaces);
    let rows = shape.height.div_ceil(2);
    // Both rows and columns of patches, of the weights and of the sums, three times.
    let lines = 3 * 2 * (40 + 40);
    Stage {
        name: "ground",
        entries: vec![("entry_ground_run", 1)],
        facts: [
            regions(shape, 2, of("pairs")),
            angles(),
            vec![
                // With the height of the mount and without it.
                unwritten("fencepost_core::ground::GroundFinder::run", 2),
                total("ground/mod.rs", "for height in self.heights()", 2),
                total("ground/mod.rs", "for _ in 0..REGIONS", 2 * 3),
                total(
                    "ground/mod.rs",
                    "for root in regions.roots() || region.weight < below || if !table.get(root) || z <= allowance",
                    7 * surfaces,
                ),
                total("ground/mod.rs", "let region = members.fold", 6 * surfaces),
                total("ground/mod.rs", "for place in regions.members(root)", surfaces),
                total(
                    "ground/mod.rs",
                    "for surface in regions.members(root) || if surface.class == SurfaceClass::Horizontal { || on_plane =",
                    surfaces,
                ),
                each("ground/mod.rs", "for round in 0..REFINEMENTS", 4),
                total("ground/mod.rs", "for surface in table.iter().filter(tells)", GROWN * 4 * surfaces),
                total("ground/mod.rs", "let pixels = table.iter().filter(below)", GROWN_ELSEWHERE * surfaces),
                total("ground/mod.rs", "for surface in table.iter().filter(|surface|", 4 * surfaces),
                each("ground/terrain.rs", "for round in [Round::Follow", 3),
                total("ground/terrain.rs", "for y in (0..self.picture.height())", 3 * rows),
                // Each row of tiles has 16 rows that are looked at.
                total("ground/terrain.rs", "for (says, surface) in || *says = Says::of(", 3 * 16 * surfaces).by(4),
                // With those tiles that have nothing to say, in place of their pixels.
                total("ground/terrain.rs", "for x in (x0..end)", of("pixels")),
                total(
                    "ground/terrain.rs",
                    "let table = self.surfaces.of_tile || if table.is_empty()",
                    3 * rows * width.div_ceil(32),
                ),
                // One round of three follows the ground.
                ran("ground/terrain.rs", "Round::Follow => self.terrain.follow(&points, self.bend)", of("pixels") / 3),
                total("ground/terrain.rs", "backs.find_map", of("patches_looked_back")),
                total("ground/terrain.rs", "for (lift_m, (sum_m, weight)) in || *lift_m = if", 3 * 1600).by(10),
                // Rows and columns of patches, one at a time.
                each("ground/terrain.rs", "for rows in patches || for first in (0..ACROSS)", 40),
                each("ground/terrain.rs", "for (patches, before) in || let own = *patches || *patches =", 40).by(10),
            ],
            // Lines of patches are all that is copied: whole words, rows in and out.
            vec![
                words("compiler_builtins::mem::memcpy", 0, 0),
                words("compiler_builtins::mem::memcpy", 1, 40 * lines).of("copied"),
                words("compiler_builtins::mem::memcpy", 2, 0),
                words("compiler_builtins::mem::memcpy", 3, 0),
                words("__aeabi_memcpy4", 0, 40 * lines).of("copied"),
            ],
            // What hangs together, two bytes for each surface, twice.
            vec![words("__aeabi_memset4", 0, surfaces)],
            // What the surfaces of a tile say, a byte for each of 65, and the patches.
            library([16; 2], [3 * 2 * 1600 + 1600, 0]),
        ]
        .concat(),
        calls: vec![
            ("fencepost_core::ground::GroundFinder::grow", GROWN),
            ("fencepost_core::ground::terrain::spread", 6),
            ("libm::math::rem_pio2f::rem_pio2f", 0),
        ],
        groups: vec![("copied", 40 * lines)],
    }
}

pub(super) fn obstacles(shape: &Shape, of: &dyn Fn(&str, &str) -> u64) -> Stage {
    let of = |name| of("obstacles", name);
    let surfaces = shape.surfaces;
    Stage {
        name: "obstacles",
        entries: vec![("entry_obstacles_run", 1)],
        facts: [
            regions(shape, 1, of("pairs")),
            vec![
                total("obstacles/mod.rs", "for root in regions.roots()", surfaces),
                total("obstacles/mod.rs", "for member in regions.members(root)", surfaces),
                total("obstacles/mod.rs", "for surface in members", surfaces),
                total(
                    "obstacles/mod.rs",
                    ".position( || for listed in || core::mem::swap(listed",
                    of("obstacles_passed"),
                ),
                // An angle of less than two turns is cut: what is divided has no more than 32 bits, which takes one instruction.
                function("compiler_builtins::math::full_availability::fmodf", 0, 0),
                function("compiler_builtins::int::specialized_div_rem::u64_div_rem", 0, 0),
            ],
            // An obstacle, of 13 words, and the sums that it is made from.
            library([13; 2], [surfaces, 0]),
        ]
        .concat(),
        // Both surfaces of each pair that touches, and those that stand for the regions.
        calls: vec![("fencepost_core::obstacles::ObstacleFinder::stands_up", 2 * touching(shape) + surfaces)],
        groups: vec![],
    }
}

/// The joining of surfaces over the borders of tiles, `times` times, past so many pairs of pixels.
fn regions(shape: &Shape, times: u64, pairs: u64) -> Vec<Fact> {
    let (down, across) = tiles(shape);
    vec![
        total(
            "surfaces/join.rs",
            "for (place, (parent, next)) in || (*parent, *next) = (place",
            times * shape.surfaces,
        )
        .by(40),
        each("surfaces/join.rs", "for y0 in (0..height)", down),
        total("surfaces/join.rs", "for x0 in (0..width)", times * down * across),
        total("surfaces/join.rs", "for i in 0..border.length", pairs),
        ran(
            "surfaces/join.rs",
            "if [a, b].into_iter().all( || .map(|(first, label)| first.wrapping_add",
            times * touching(shape),
        ),
        // Each time there is a region less.
        ran("surfaces/join.rs", "let (keep, give) = if", times * (shape.surfaces - 1)),
        total("surfaces/join.rs", "while of_a != a", times * told(shape)),
        total(
            "surfaces/join.rs",
            "if place == give || self.parent.get_mut(place) || *parent = keep",
            times * told(shape),
        )
        .early(4),
        each(
            "surfaces/join.rs",
            "for place in 0..self.len || *first = if || *parent = *first",
            shape.surfaces.next_multiple_of(4),
        )
        .by(4),
        each("surfaces/join.rs", "for (place, next) in (0..self.len)", shape.surfaces),
        each("surfaces/join.rs", "for place in (0..self.len).rev()", shape.surfaces),
    ]
}

/// A loop of a memory function that goes round so often in all.
const fn words(name: &'static str, nth: usize, more: u64) -> Fact {
    Fact { is_shared: true, ..Fact::new(At::LoopOf(name, nth), 0, more) }
}

fn tiles(shape: &Shape) -> (u64, u64) {
    (shape.height.div_ceil(32), shape.width.div_ceil(32))
}

/// Pairs of surfaces that touch across the border of a tile and are not those that touched before: the first of each border, and one
/// whenever the surface on one side is another. All around a tile its surfaces never lie crosswise (a b a b), as each hangs together
/// within it: another one comes at most twice for each of them but the first (Davenport and Schinzel, 1965). The two that are left for
/// each tile are those that its right and its lower border begin with.
const fn touching(shape: &Shape) -> u64 {
    2 * shape.surfaces
}

/// Surfaces that are told of another region at most: the smaller ones of two each time. Two of the same size cost the most: with `n`
/// in the end, half of them, then half of each half: `n / 2 log2 n`.
fn told(shape: &Shape) -> u64 {
    shape.surfaces / 2 * u64::from(shape.surfaces.ilog2() + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_pile_of_regions_has_more_told_than_is_bounded() {
        // The most for each number of surfaces, over all ways to join two regions to one of that size.
        let mut most = vec![0u64; 401];
        for n in 2..=400 {
            most[n] = (1..=n / 2).map(|small| most[small] + most[n - small] + small as u64).max().unwrap();
            let shape = Shape { surfaces: n as u64, ..Shape::of(320, 240, 48) };
            assert!(most[n] <= told(&shape), "{n} surfaces: {} of {}", most[n], told(&shape));
        }
    }

    #[test]
    fn surfaces_around_tiles_touch_no_more_than_is_bounded() {
        // Surfaces around a tile that do not lie crosswise: the most changes of `n` of them are those of one between all others.
        fn changes(around: &mut Vec<usize>, n: usize) -> usize {
            let crosswise = |around: &[usize]| {
                let [.., d] = *around else { return false };
                let before = |end: usize, of: &dyn Fn(usize) -> bool| (0..end).rev().find(|&i| of(around[i]));
                let last = around.len() - 1;
                (0..last).any(|b| {
                    around[b] != d
                        && before(b, &|label| label == d)
                            .is_some_and(|c| before(c, &|label| label == around[b]).is_some())
                })
            };
            let mut most = around.len().saturating_sub(1);
            for label in 0..n {
                if around.last() == Some(&label) {
                    continue;
                }
                around.push(label);
                if !crosswise(around) {
                    most = most.max(changes(around, n));
                }
                around.pop();
            }
            most
        }
        for n in 1..=4 {
            assert_eq!(changes(&mut Vec::new(), n), 2 * n - 2, "{n} surfaces");
        }
        // A border for the right and the lower side of each tile at most.
        let shape = Shape::of(320, 240, 48);
        let (down, across) = tiles(&shape);
        let borders = down * (across - 1) + (down - 1) * across;
        assert!(borders + 2 * shape.surfaces - 2 * down * across <= touching(&shape));
    }
}
