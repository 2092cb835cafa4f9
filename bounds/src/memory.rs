//! Memory: the size of each part of a detector and of the whole, and the formula that gives it.

use std::{fmt, ops::RangeInclusive};

use anyhow::{Result, bail};
use fencepost_core::detector::{Capacities, Detector, MemoryPart};

/// Parts that a detector is made of.
const PARTS: usize = 18;

/// The size of a detector and of its parts, as the compiler has laid them out for this processor.
pub(crate) struct Layout {
    pub(crate) capacities: Capacities,
    pub(crate) parts: [MemoryPart; PARTS],
    pub(crate) whole: usize,
    pub(crate) align: usize,
}

macro_rules! layout {
    ($capacities:expr) => {{
        const C: Capacities = $capacities;
        type Whole = Detector<
            { C.pixels },
            { C.width },
            { C.disparities },
            { C.grid },
            { C.surfaces },
            { C.obstacles },
            { C.cells },
        >;
        let (whole, align) = (size_of::<Whole>(), align_of::<Whole>());
        Layout { capacities: C, parts: Whole::memory_parts(), whole, align }
    }};
}

/// The sizes of pictures that are looked at by name.
pub(crate) fn named() -> [(&'static str, Layout); 5] {
    [
        ("128x96x16", layout!(Capacities::for_pictures(128, 96, 16))),
        ("320x240x48", layout!(Capacities::for_pictures(320, 240, 48))),
        ("512x384x64", layout!(Capacities::for_pictures(512, 384, 64))),
        ("640x480x64", layout!(Capacities::for_pictures(640, 480, 64))),
        ("1242x375x128", layout!(Capacities::for_pictures(1242, 375, 128))),
    ]
}

/// Small detectors, each with one capacity larger than the first: what they differ by is what that capacity costs.
struct Probes {
    base: Layout,
    /// In the order of [`TERMS`], and how much larger it is.
    larger: [(Layout, usize); TERMS.len()],
}

impl Probes {
    fn new() -> Self {
        const BASE: Capacities =
            Capacities { pixels: 1024, width: 64, disparities: 16, grid: 64, surfaces: 64, obstacles: 64, cells: 64 };
        let larger = [
            (layout!(Capacities { pixels: 1024 + 64, ..BASE }), 64),
            (layout!(Capacities { width: 128, ..BASE }), 64),
            (layout!(Capacities { disparities: 80, ..BASE }), 64),
            // The product is what is left of it, see below.
            (layout!(Capacities { width: 128, disparities: 80, ..BASE }), 64 * 64),
            (layout!(Capacities { grid: 128, ..BASE }), 64),
            (layout!(Capacities { surfaces: 128, ..BASE }), 64),
            (layout!(Capacities { obstacles: 128, ..BASE }), 64),
            (layout!(Capacities { cells: 128, ..BASE }), 64),
        ];
        Self { base: layout!(BASE), larger }
    }
}

/// What a term of a formula is multiplied with.
const TERMS: [&str; 8] = ["W*H", "W", "D", "W*D", "nodes", "surfaces", "obstacles", "cells"];
const WIDTH_TERM: usize = 1;
const DISPARITY_TERM: usize = 2;
const PRODUCT_TERM: usize = 3;

/// The bytes of a part: a sum of terms, and what the compiler adds so that tables begin where they may: less than twice what the
/// part is aligned to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Formula {
    pub(crate) name: &'static str,
    align: i64,
    constant: i64,
    /// Bytes for each of [`TERMS`].
    terms: [i64; TERMS.len()],
}

/// The formulas of all parts. The compiler gives the terms; that they hold is checked for every named size.
///
/// # Errors
/// A part whose size is no such sum.
pub(crate) fn formulas() -> Result<Vec<Formula>> {
    let probes = Probes::new();
    (0..PARTS).map(|part| Formula::of(&probes, part)).collect()
}

impl Formula {
    fn of(probes: &Probes, part: usize) -> Result<Self> {
        let MemoryPart { name, align, .. } = probes.base.parts[part];
        let bytes = |layout: &Layout| layout.parts[part].bytes as i64;
        let base = bytes(&probes.base);
        let mut terms = [0; TERMS.len()];
        for (term, (larger, by)) in terms.iter_mut().zip(&probes.larger) {
            *term = (bytes(larger) - base) / *by as i64;
        }
        // Width and disparities each stand alone and in the product, and the probe of the product has all three.
        let [width, disparities] = [WIDTH_TERM, DISPARITY_TERM].map(|term| bytes(&probes.larger[term].0) - base);
        let product = (bytes(&probes.larger[PRODUCT_TERM].0) - base - width - disparities) / (64 * 64);
        terms[PRODUCT_TERM] = product;
        terms[WIDTH_TERM] = width / 64 - product * probes.base.capacities.disparities as i64;
        terms[DISPARITY_TERM] = disparities / 64 - product * probes.base.capacities.width as i64;
        let mut formula = Self { name, align: align as i64, constant: 0, terms };
        // What is left at the sizes that need no padding.
        let all = || named().into_iter().map(|(_, layout)| layout);
        let left = all().map(|layout| bytes(&layout) - formula.sum(&layout.capacities));
        formula.constant = left.fold(base - formula.sum(&probes.base.capacities), i64::min);
        if all().all(|layout| formula.holds(&layout.capacities, bytes(&layout))) {
            return Ok(formula);
        }
        bail!(
            "the size of `{name}` is no sum of terms in {}: give it a formula of its own, or parts that have one, in \
             `Detector::memory_parts`",
            TERMS.join(", ")
        );
    }

    /// The bytes of the part in a detector of these capacities, without padding.
    pub(crate) fn bytes(&self, capacities: &Capacities) -> i64 {
        self.constant + self.sum(capacities)
    }

    /// Whether a part of `bytes` is what the formula gives, and padding.
    pub(crate) fn holds(&self, capacities: &Capacities, bytes: i64) -> bool {
        (0..2 * self.align).contains(&(bytes - self.bytes(capacities)))
    }

    fn sum(&self, c: &Capacities) -> i64 {
        let product = c.width * c.disparities;
        let factors = [c.pixels, c.width, c.disparities, product, c.grid, c.surfaces, c.obstacles, c.cells];
        self.terms.iter().zip(factors).map(|(term, factor)| term * factor as i64).sum()
    }
}

impl fmt::Display for Formula {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = self.terms.iter().zip(TERMS).filter(|(bytes, _)| **bytes != 0);
        let terms = named.map(|(bytes, name)| if *bytes == 1 { name.to_owned() } else { format!("{bytes} {name}") });
        let constant = (self.constant != 0).then(|| self.constant.to_string());
        let sum = terms.chain(constant).collect::<Vec<_>>().join(" + ").replace("+ -", "- ");
        f.write_str(&sum)
    }
}

/// The bytes that a whole detector can have: those of its parts, up to a multiple of what the whole is aligned to. The parts behind
/// the matching are one value, which may end with some bytes of padding of its own.
pub(crate) fn whole_bytes(layout: &Layout) -> RangeInclusive<usize> {
    const PADDING: usize = 7;
    let sum = layout.parts.iter().map(|part| part.bytes).sum::<usize>();
    sum.next_multiple_of(layout.align)..=(sum + PADDING).next_multiple_of(layout.align)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_give_what_the_compiler_lays_out() {
        let formulas = formulas().unwrap();
        for (name, layout) in named() {
            for (formula, part) in formulas.iter().zip(layout.parts) {
                assert!(formula.holds(&layout.capacities, part.bytes as i64), "{name}: {}", part.name);
            }
            assert!(whole_bytes(&layout).contains(&layout.whole), "{name}: {}", layout.whole);
        }
    }

    #[test]
    fn a_formula_reads_as_it_is_computed() {
        let formula = Formula { name: "a", align: 8, constant: -4, terms: [1, 0, 0, 2, 0, 0, 0, 12] };
        assert_eq!(formula.to_string(), "W*H + 2 W*D + 12 cells - 4");
        let capacities = Capacities { cells: 1, ..Capacities::for_pictures(10, 5, 3) };
        assert_eq!(formula.bytes(&capacities), 118);
        assert_eq!([117, 118, 133, 134].map(|bytes| formula.holds(&capacities, bytes)), [false, true, true, false]);
        let constant = Formula { terms: [0; TERMS.len()], constant: 16, ..formula };
        assert_eq!(constant.to_string(), "16");
    }
}
