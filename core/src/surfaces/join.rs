//! Joining surfaces over the whole picture.

use super::{Surface, Surfaces, TILE};
use crate::{
    disparity::DisparityPicture,
    work::{self, Loop},
};

/// Which surfaces hang together.
///
/// Every surface knows which one stands for its region, so that asking is one step. Where two regions become one, the smaller is told
/// anew: a surface is told at most as often as regions can double.
///
/// Inside a tile a surface is connected already, and what is joined is chosen by surface, so only neighbours across the
/// borders of the tiles need to be looked at. The result is that of union-find over all pixels. Source: the paper,
/// section 4.4.
pub struct Regions<const SURFACES: usize> {
    parent: [u16; SURFACES],
    /// The next surface of the same region, the surface itself at the end; while regions are joined, the first after the last.
    next: [u16; SURFACES],
    len: usize,
}

impl<const SURFACES: usize> Regions<SURFACES> {
    /// Every surface on its own.
    pub const fn new() -> Self {
        Self { parent: [0; SURFACES], next: [0; SURFACES], len: 0 }
    }

    /// Joins the surfaces that `takes_part` and touch: neighbouring pixels of contiguous disparity.
    ///
    /// # Bound
    /// `width x height / 16` pairs of pixels; each surface is told of another region at most `log2 SURFACES` times.
    pub fn join<const PIXELS: usize>(
        &mut self,
        surfaces: &Surfaces<PIXELS, SURFACES>,
        picture: DisparityPicture<'_>,
        takes_part: impl Fn(&Surface) -> bool,
    ) {
        work::count(Loop::RegionPlaces, SURFACES);
        for (place, (parent, next)) in (0..SURFACES).zip(self.parent.iter_mut().zip(&mut self.next)) {
            (*parent, *next) = (place as u16, place as u16);
        }
        let (width, height) = (picture.width(), picture.height());
        let table = surfaces.table();
        // The surfaces of another picture have nothing to do with this one.
        if (width, height) == surfaces.size() {
            for y0 in (0..height).step_by(TILE) {
                for x0 in (0..width).step_by(TILE) {
                    let here = surfaces.first_of_tile(x0, y0);
                    let first = y0.wrapping_mul(width).wrapping_add(x0);
                    if let Some(above) = y0.checked_sub(1) {
                        let length = TILE.min(width.saturating_sub(x0));
                        let border = Border { first, step: 1, length, across: width };
                        self.cross(surfaces, picture, &border, (surfaces.first_of_tile(x0, above), here), &takes_part);
                    }
                    if let Some(left) = x0.checked_sub(1) {
                        let length = TILE.min(height.saturating_sub(y0));
                        let border = Border { first, step: width, length, across: 1 };
                        self.cross(surfaces, picture, &border, (surfaces.first_of_tile(left, y0), here), &takes_part);
                    }
                }
            }
        }
        self.chain(table.len());
    }

    /// Joins surfaces across a border of a tile: those before it, whose first in the table is `firsts.0`, with those behind.
    fn cross<const PIXELS: usize>(
        &mut self,
        surfaces: &Surfaces<PIXELS, SURFACES>,
        picture: DisparityPicture<'_>,
        border: &Border,
        firsts: (usize, usize),
        takes_part: &impl Fn(&Surface) -> bool,
    ) {
        let (labels, pixels, table) = (surfaces.labels(), picture.pixels(), surfaces.table());
        let reach = surfaces.settings().step_sixteenths;
        // Neighbours along the border mostly belong to the same two surfaces, which are joined but once.
        let mut last = (0, 0);
        work::count(Loop::RegionPairs, border.length);
        for i in 0..border.length {
            // Within the picture, as its own length says.
            let behind = border.first.wrapping_add(i.wrapping_mul(border.step));
            let before = behind.saturating_sub(border.across);
            let (Some(&a), Some(&b)) = (labels.get(before), labels.get(behind)) else { return };
            if a == 0 || b == 0 || (a, b) == last {
                continue;
            }
            let (Some(from), Some(to)) = (pixels.get(before), pixels.get(behind)) else { return };
            if from.steps().abs_diff(to.steps()) > reach {
                continue;
            }
            last = (a, b);
            // Labels count from 1; what lies beyond the table is not looked at.
            let [a, b] = [(firsts.0, a), (firsts.1, b)]
                .map(|(first, label)| first.wrapping_add(usize::from(label)).wrapping_sub(1));
            if [a, b].into_iter().all(|place| table.get(place).is_some_and(takes_part)) {
                self.unite(a, b);
            }
        }
    }

    /// The regions, each by the surface that stands for it. Surfaces that took no part are regions of their own.
    pub fn roots(&self) -> impl Iterator<Item = usize> {
        (0..SURFACES)
            .zip(self.parent.iter().take(self.len))
            .filter(|&(place, &parent)| usize::from(parent) == place)
            .map(|(place, _)| place)
    }

    /// The surfaces of the region for which surface `root` stands, in the order of the table.
    pub fn members(&self, root: usize) -> impl Iterator<Item = usize> {
        core::iter::successors(self.next.get(root).map(|_| root), |&place| {
            self.next.get(place).map(|&next| usize::from(next)).filter(|&next| next != place)
        })
    }

    /// Lets the first surface of each region stand for it, and chains the surfaces of each region.
    fn chain(&mut self, len: usize) {
        self.len = len.min(SURFACES);
        work::count(Loop::RegionPlaces, self.len.saturating_mul(3));
        self.next.fill(NONE);
        for place in 0..self.len {
            let Some(parent) = self.parent.get_mut(place) else { break };
            // The first that is asked is the first of its region. What stood for the region so far remembers it.
            if let Some(first) = self.next.get_mut(usize::from(*parent)) {
                *first = if *first == NONE { place as u16 } else { *first };
                *parent = *first;
            }
        }
        for (place, next) in (0..self.len).zip(&mut self.next) {
            *next = place as u16;
        }
        // A root is the first of its region, so everything can be hung in right behind it, from the end on.
        for place in (0..self.len).rev() {
            let Some(root) = self.parent.get(place).map(|&root| usize::from(root)).filter(|&root| root != place) else {
                continue;
            };
            let Some(behind) = self.next.get_mut(root).map(|next| core::mem::replace(next, place as u16)) else {
                continue;
            };
            if let Some(next) = self.next.get_mut(place) {
                *next = if usize::from(behind) == root { place as u16 } else { behind };
            }
        }
    }

    /// The surface that stands for the region of surface `place`; itself where there is no such surface.
    pub fn root(&self, place: usize) -> usize {
        self.parent.get(place).map_or(place, |&parent| usize::from(parent))
    }

    /// Makes one region of those of two surfaces.
    fn unite(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return;
        }
        // Both are gone round at the same time: that which ends first is the smaller one.
        let after = |next: &[u16; SURFACES], place: usize| next.get(place).map_or(place, |&next| usize::from(next));
        let (mut of_a, mut of_b) = (after(&self.next, a), after(&self.next, b));
        while of_a != a && of_b != b {
            work::count(Loop::RegionMoved, 1);
            (of_a, of_b) = (after(&self.next, of_a), after(&self.next, of_b));
        }
        let (keep, give) = if of_b == b { (a, b) } else { (b, a) };
        let mut place = give;
        loop {
            work::count(Loop::RegionMoved, 1);
            if let Some(parent) = self.parent.get_mut(place) {
                *parent = keep as u16;
            }
            place = after(&self.next, place);
            if place == give {
                break;
            }
        }
        if let (Some(&keeps), Some(&gives)) = (self.next.get(keep), self.next.get(give)) {
            if let Some(next) = self.next.get_mut(keep) {
                *next = gives;
            }
            if let Some(next) = self.next.get_mut(give) {
                *next = keeps;
            }
        }
    }
}

/// No surface.
const NONE: u16 = u16::MAX;

/// Pixels along the border of a tile, as places in the picture.
struct Border {
    /// The first behind the border, and from each to the next.
    first: usize,
    step: usize,
    length: usize,
    /// From each to that before the border.
    across: usize,
}

impl<const SURFACES: usize> Default for Regions<SURFACES> {
    fn default() -> Self {
        Self::new()
    }
}
