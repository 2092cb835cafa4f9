//! Sums over the window around each pixel, exact, at a cost that does not grow with the window.

use super::disparity_plane::PlaneSums;

/// Sums over the pixels of one column within the rows of the window; rows `v` from that of the pixel.
///
/// The largest window has 21 rows: rows fit 16 bits, and no sum of disparities 32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct ColumnSums {
    n: i16,
    v: i16,
    vv: i16,
    d: i32,
    vd: i32,
    dd: i64,
}

impl ColumnSums {
    pub(super) const ZERO: Self = Self { n: 0, v: 0, vv: 0, d: 0, vd: 0, dd: 0 };

    /// Counts rows from the next one on.
    fn move_down(&mut self) {
        self.vv += self.n - 2 * self.v;
        self.v -= self.n;
        self.vd -= self.d;
    }

    /// Adds the pixel in row `v`; there is none if `steps` is 0.
    fn add(&mut self, v: i16, steps: u16) {
        if steps == 0 {
            return;
        }
        let d = i32::from(steps);
        self.n += 1;
        self.v += v;
        self.vv += v * v;
        self.d += d;
        self.vd += i32::from(v) * d;
        self.dd += i64::from(d) * i64::from(d);
    }

    /// Takes the pixel in row `v` away again.
    fn remove(&mut self, v: i16, steps: u16) {
        if steps == 0 {
            return;
        }
        let d = i32::from(steps);
        self.n -= 1;
        self.v -= v;
        self.vv -= v * v;
        self.d -= d;
        self.vd -= i32::from(v) * d;
        self.dd -= i64::from(d) * i64::from(d);
    }
}

impl PlaneSums {
    /// Counts columns from the next one on.
    fn move_right(&mut self) {
        self.uu += self.n - 2 * self.u;
        self.uv -= self.v;
        self.ud -= self.d;
        self.u -= self.n;
    }

    /// Adds (`sign` 1) or takes away (-1) a column.
    fn add_column(&mut self, column: &ColumnSums, u: i64, sign: i64) {
        let n = sign * i64::from(column.n);
        let (v, d) = (sign * i64::from(column.v), sign * i64::from(column.d));
        self.n += n;
        self.u += u * n;
        self.v += v;
        self.d += d;
        self.uu += u * u * n;
        self.uv += u * v;
        self.vv += sign * i64::from(column.vv);
        self.ud += u * d;
        self.vd += sign * i64::from(column.vd);
        self.dd += sign * column.dd;
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
    let r = radius as i16;
    for (x, column) in columns.iter_mut().enumerate() {
        if y == 0 {
            *column = ColumnSums::ZERO;
            for v in 0..reach {
                column.add(v as i16, steps(x, Some(v)));
            }
        } else {
            column.move_down();
            column.remove(-r - 1, steps(x, (y - 1).checked_sub(reach)));
        }
        column.add(r, steps(x, Some(y + reach)));
    }
}

/// The sums of the windows around the pixels of a row, from the left; columns and rows are counted from the pixel.
///
/// # Bound
/// Two steps for each pixel, and `radius` more.
pub(super) fn windows(columns: &[ColumnSums], radius: u16) -> impl Iterator<Item = PlaneSums> {
    let reach = usize::from(radius);
    let r = i64::from(radius);
    let mut sums = PlaneSums::default();
    // As if the pixel before the first had been the last.
    for (column, u) in columns.iter().take(reach).zip(1..) {
        sums.add_column(column, u, 1);
    }
    (0..columns.len()).map(move |x| {
        sums.move_right();
        if let Some(column) = x.checked_sub(reach + 1).and_then(|x| columns.get(x)) {
            sums.add_column(column, -r - 1, -1);
        }
        if let Some(column) = columns.get(x + reach) {
            sums.add_column(column, r, 1);
        }
        sums
    })
}

#[cfg(test)]
#[path = "tests/window.rs"]
mod tests;
