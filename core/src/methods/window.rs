//! Sums over the window around each pixel, exact, at a cost that does not grow with the window.

use core::num::Wrapping;

use super::disparity_plane::PlaneSums;

/// Sums over the pixels of one column within the rows of the window; rows `v` from that of the pixel.
///
/// The largest window has 21 rows: rows fit 16 bits, and no sum of disparities 32. So nothing wraps that is written so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct ColumnSums {
    n: Wrapping<i16>,
    v: Wrapping<i16>,
    vv: Wrapping<i16>,
    d: Wrapping<i32>,
    vd: Wrapping<i32>,
    dd: Wrapping<i64>,
}

impl ColumnSums {
    pub(super) const ZERO: Self =
        Self { n: Wrapping(0), v: Wrapping(0), vv: Wrapping(0), d: Wrapping(0), vd: Wrapping(0), dd: Wrapping(0) };

    /// Counts rows from the next one on.
    fn move_down(&mut self) {
        self.vv += self.n - self.v - self.v;
        self.v -= self.n;
        self.vd -= self.d;
    }

    /// Adds the pixel in row `v`; there is none if `steps` is 0.
    fn add(&mut self, v: i16, steps: u16) {
        if steps == 0 {
            return;
        }
        let (v, d) = (Wrapping(v), Wrapping(i32::from(steps)));
        self.n += 1;
        self.v += v;
        self.vv += v * v;
        self.d += d;
        self.vd += Wrapping(i32::from(v.0)) * d;
        self.dd += Wrapping(i64::from(d.0)) * Wrapping(i64::from(d.0));
    }

    /// Takes the pixel in row `v` away again.
    fn remove(&mut self, v: i16, steps: u16) {
        if steps == 0 {
            return;
        }
        let (v, d) = (Wrapping(v), Wrapping(i32::from(steps)));
        self.n -= 1;
        self.v -= v;
        self.vv -= v * v;
        self.d -= d;
        self.vd -= Wrapping(i32::from(v.0)) * d;
        self.dd -= Wrapping(i64::from(d.0)) * Wrapping(i64::from(d.0));
    }
}

impl PlaneSums {
    /// Counts columns from the next one on.
    fn move_right(&mut self) {
        self.uu = self.uu.wrapping_add(self.n.wrapping_sub(self.u.wrapping_mul(2)));
        self.uv = self.uv.wrapping_sub(self.v);
        self.ud = self.ud.wrapping_sub(self.d);
        self.u = self.u.wrapping_sub(self.n);
    }

    /// Adds (`sign` 1) or takes away (-1) a column.
    fn add_column(&mut self, column: &ColumnSums, u: i64, sign: i64) {
        // As small as [`PlaneSums::add`] says.
        let add = |sum: &mut i64, more: i64| *sum = sum.wrapping_add(more);
        let product = i64::wrapping_mul;
        let n = product(sign, column.n.0.into());
        let (v, d) = (product(sign, column.v.0.into()), product(sign, column.d.0.into()));
        add(&mut self.n, n);
        add(&mut self.u, product(u, n));
        add(&mut self.v, v);
        add(&mut self.d, d);
        add(&mut self.uu, product(product(u, u), n));
        add(&mut self.uv, product(u, v));
        add(&mut self.vv, product(sign, column.vv.0.into()));
        add(&mut self.ud, product(u, d));
        add(&mut self.vd, product(sign, column.vd.0.into()));
        add(&mut self.dd, product(sign, column.dd.0));
    }
}

/// Moves the columns from the windows of row `y - 1` to those of row `y`, or begins with row 0. `steps(x, y)` is the disparity of a
/// pixel, 1/16 px, 0 where there is none and outside the picture; `radius` is half the window.
///
/// # Bound
/// Two steps for each column; `radius + 1` steps for row 0.
pub(super) fn move_columns(
    columns: &mut [ColumnSums],
    y: usize,
    radius: u16,
    steps: impl Fn(usize, Option<usize>) -> u16,
) {
    let reach = usize::from(radius);
    let below = radius as i16;
    let above = below.wrapping_neg().wrapping_sub(1);
    for (x, column) in columns.iter_mut().enumerate() {
        if y == 0 {
            *column = ColumnSums::ZERO;
            for v in 0..reach {
                column.add(v as i16, steps(x, Some(v)));
            }
        } else {
            column.move_down();
            column.remove(above, steps(x, y.wrapping_sub(1).checked_sub(reach)));
        }
        column.add(below, steps(x, y.checked_add(reach)));
    }
}

/// The sums of the windows around the pixels of a row, from the left; columns and rows are counted from the pixel.
///
/// # Bound
/// Two steps for each pixel, and `radius` more.
pub(super) fn windows(columns: &[ColumnSums], radius: u16) -> impl Iterator<Item = PlaneSums> {
    let reach = usize::from(radius);
    let right = i64::from(radius);
    let left = right.wrapping_neg().wrapping_sub(1);
    let mut sums = PlaneSums::default();
    // As if the pixel before the first had been the last.
    for (column, u) in columns.iter().take(reach).zip(1..=right) {
        sums.add_column(column, u, 1);
    }
    (0..columns.len()).map(move |x| {
        sums.move_right();
        if let Some(column) = x.checked_sub(reach.wrapping_add(1)).and_then(|x| columns.get(x)) {
            sums.add_column(column, left, -1);
        }
        if let Some(column) = x.checked_add(reach).and_then(|x| columns.get(x)) {
            sums.add_column(column, right, 1);
        }
        sums
    })
}

#[cfg(test)]
#[path = "tests/window.rs"]
mod tests;
