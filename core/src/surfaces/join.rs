//! Joining surfaces over the whole picture.

use super::{Surface, Surfaces, TILE};
use crate::disparity::DisparityPicture;

/// Union-find over surfaces: which of them hang together.
///
/// Inside a tile a surface is connected already, and what is joined is chosen by surface, so only neighbours across the
/// borders of the tiles need to be looked at. The result is that of union-find over all pixels. Source: the paper,
/// section 4.4.
pub struct Regions<const SURFACES: usize> {
    parent: [u16; SURFACES],
    /// The next surface of the same region, the surface itself at the end.
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
    /// `width x height / 16` pairs of pixels.
    pub fn join<const PIXELS: usize>(
        &mut self,
        surfaces: &Surfaces<PIXELS, SURFACES>,
        picture: DisparityPicture<'_>,
        takes_part: impl Fn(&Surface) -> bool,
    ) {
        for (place, parent) in self.parent.iter_mut().enumerate() {
            *parent = place as u16;
        }
        let (width, height) = (picture.width(), picture.height());
        let step = surfaces.settings().step_sixteenths;
        let table = surfaces.table();
        let mut touch = |(ax, ay): (usize, usize), (bx, by): (usize, usize)| {
            let (Some(a), Some(b)) = (surfaces.place_at(ax, ay), surfaces.place_at(bx, by)) else { return };
            let steps = |x: usize, y: usize| picture.row(y).get(x).map_or(0, |pixel| pixel.steps());
            let contiguous = steps(ax, ay).abs_diff(steps(bx, by)) <= step;
            let both = |a: usize, b: usize| Some(takes_part(table.get(a)?) && takes_part(table.get(b)?));
            if contiguous && both(a, b).unwrap_or(false) {
                self.unite(a, b);
            }
        };
        for y in (TILE..height).step_by(TILE) {
            for x in 0..width {
                touch((x, y.saturating_sub(1)), (x, y));
            }
        }
        for x in (TILE..width).step_by(TILE) {
            for y in 0..height {
                touch((x.saturating_sub(1), y), (x, y));
            }
        }
        self.chain(table.len());
    }

    /// The regions, each by the surface that stands for it. Surfaces that took no part are regions of their own.
    pub fn roots(&self) -> impl Iterator<Item = usize> {
        self.parent
            .iter()
            .take(self.len)
            .enumerate()
            .filter(|&(place, &parent)| usize::from(parent) == place)
            .map(|(place, _)| place)
    }

    /// The surfaces of the region for which surface `root` stands, in the order of the table.
    pub fn members(&self, root: usize) -> impl Iterator<Item = usize> {
        core::iter::successors(self.next.get(root).map(|_| root), |&place| {
            self.next.get(place).map(|&next| usize::from(next)).filter(|&next| next != place)
        })
    }

    /// Chains the surfaces of each region, last to first.
    fn chain(&mut self, len: usize) {
        self.len = len.min(SURFACES);
        for place in (0..self.len).rev() {
            let root = self.root(place);
            if let (Some(parent), Some(next)) = (self.parent.get_mut(place), self.next.get_mut(place)) {
                (*parent, *next) = (root as u16, place as u16);
            }
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

    /// The surface that stands for the region of surface `place`.
    pub fn root(&mut self, mut place: usize) -> usize {
        while let Some(&parent) = self.parent.get(place) {
            let parent = usize::from(parent);
            if parent == place {
                break;
            }
            // Every other one is hung one higher on the way, so that the next way is half as long.
            let Some(&above) = self.parent.get(parent) else { break };
            if let Some(halved) = self.parent.get_mut(place) {
                *halved = above;
            }
            place = usize::from(above);
        }
        place
    }

    fn unite(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        if let Some(parent) = self.parent.get_mut(a.max(b)) {
            *parent = a.min(b) as u16;
        }
    }
}

impl<const SURFACES: usize> Default for Regions<SURFACES> {
    fn default() -> Self {
        Self::new()
    }
}
