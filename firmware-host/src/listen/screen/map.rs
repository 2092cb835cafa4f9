//! The map, seen from above: the robot at the bottom looks up.

use ratatui::{
    buffer::Buffer,
    layout::Rect,
    style::{Color, Style},
};

use super::palette::Palette;
use crate::{listen::node::Extent, scans::WholeScan};

/// Columns for the distances at the left.
const LABELS: u16 = 6;
/// Rows below the map for the robot and the distances to the sides.
const BOTTOM: u16 = 1;
/// Fewest rows and columns between two distances.
const ROWS_APART: f64 = 3.0;
const COLUMNS_APART: f64 = 6.0;

/// What a square of the map shows. The number is the place in [`Palette::squares`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Square {
    Obstacle = 0,
    Free = 1,
    #[default]
    Unknown = 2,
}

/// The cells of a scan by their indices.
struct Cells {
    squares: Box<[[Square; 128]; 128]>,
}

/// Where the cells lie on the screen: half a row or a column for each square.
#[derive(Clone, Copy, Debug)]
struct Scale {
    extent: Extent,
    /// Cells in a square.
    cells: f64,
    /// Squares across and up.
    columns: u16,
    rows: u16,
}

/// Draws the map of `scan`; in grey if it is not `trusted`.
pub(super) fn draw(scan: &WholeScan, extent: Extent, trusted: bool, palette: Palette, area: Rect, buffer: &mut Buffer) {
    let (width, height) = (area.width.saturating_sub(LABELS), area.height.saturating_sub(BOTTOM));
    if width < 4 || height < 2 {
        return;
    }
    let scale = Scale::fit(extent, width, 2 * height);
    // The map stands on the robot's row and in the middle.
    let left = area.x + LABELS + (width - scale.columns) / 2;
    let rows = scale.rows.div_ceil(2);
    let top = area.y + height - rows;
    let cells = Cells::of(scan);
    for row in 0..rows {
        for column in 0..scale.columns {
            let upper = scale.square(&cells, column, 2 * row);
            let lower = scale.square(&cells, column, 2 * row + 1);
            let (sign, style) = look(upper, lower, trusted, palette);
            buffer[(left + column, top + row)].set_char(sign).set_style(style);
        }
    }
    let cell_m = f64::from(scan.end.cell_size_mm) / 1000.0;
    let labels = Rect { x: left - LABELS, y: top, width: LABELS, height: rows };
    distances_ahead(scale, cell_m, palette, labels, buffer);
    let bottom = Rect { x: left, y: area.y + height, width: scale.columns, height: 1 };
    distances_aside(scale, cell_m, palette, bottom, buffer);
}

impl Cells {
    fn of(scan: &WholeScan) -> Self {
        let mut squares = Box::new([[Square::Unknown; 128]; 128]);
        for (i, j, obstacle) in &scan.cells {
            if let Some(square) =
                squares.get_mut(place(i32::from(*i))).and_then(|row| row.get_mut(place(i32::from(*j))))
            {
                *square = if *obstacle { Square::Obstacle } else { Square::Free };
            }
        }
        Self { squares }
    }

    fn at(&self, i: i32, j: i32) -> Square {
        self.squares.get(place(i)).and_then(|row| row.get(place(j))).copied().unwrap_or_default()
    }
}

impl Scale {
    /// As large as it fits into `width` columns and `rows` half rows, with whole squares where a cell takes more than one.
    fn fit(extent: Extent, width: u16, rows: u16) -> Self {
        let (ahead, across) = (span(extent.i_first, extent.i_last), span(extent.j_first, extent.j_last));
        let cells = (across / f64::from(width)).max(ahead / f64::from(rows));
        let cells = if cells < 1.0 { 1.0 / (1.0 / cells).floor() } else { cells };
        let squares = |count: f64, most: u16| ((count / cells - 1e-6).ceil() as u16).clamp(1, most);
        Self { extent, cells, columns: squares(across, width), rows: squares(ahead, rows) }
    }

    /// What a square shows: an obstacle if any of its cells is one, free if the cell at its centre is free.
    fn square(&self, cells: &Cells, column: u16, row: u16) -> Square {
        let (x, y) = (self.ahead(f64::from(row)), self.aside(f64::from(column)));
        let range = |far: f64| ((far - self.cells + 1e-6).floor() as i32, (far - 1e-6).floor() as i32);
        let ((i_first, i_last), (j_first, j_last)) = (range(x), range(y));
        let any = (i_first..=i_last).any(|i| (j_first..=j_last).any(|j| cells.at(i, j) == Square::Obstacle));
        let centre = |far: f64| (far - self.cells / 2.0).floor() as i32;
        if any { Square::Obstacle } else { cells.at(centre(x), centre(y)) }
    }

    /// Distance ahead of the far edge of a half row, cells.
    fn ahead(&self, row: f64) -> f64 {
        // The lowest row ends at the first cells, whatever is left over at the top.
        f64::from(self.extent.i_first) + (f64::from(self.rows) - row) * self.cells
    }

    /// Distance to the left of the left edge of a column, cells.
    fn aside(&self, column: f64) -> f64 {
        f64::from(self.extent.j_last) + 1.0 - column * self.cells
    }
}

fn distances_ahead(scale: Scale, cell_m: f64, palette: Palette, area: Rect, buffer: &mut Buffer) {
    let step_m = step(scale.cells * cell_m * 2.0 * ROWS_APART);
    let furthest_m = scale.ahead(0.0) * cell_m;
    let mut distance_m = (scale.ahead(f64::from(scale.rows)) * cell_m / step_m).ceil() * step_m;
    while distance_m <= furthest_m {
        let half_rows = (furthest_m - distance_m) / (scale.cells * cell_m);
        let row = (half_rows / 2.0).floor() as u16;
        if row < area.height {
            let text = format!("{distance_m:>3} m┤");
            buffer.set_string(area.x, area.y + row, text, palette.faint());
        }
        distance_m += step_m;
    }
}

fn distances_aside(scale: Scale, cell_m: f64, palette: Palette, area: Rect, buffer: &mut Buffer) {
    let column_of = |left_m: f64| (scale.aside(0.0) - left_m / cell_m) / scale.cells;
    let step_m = step(scale.cells * cell_m * COLUMNS_APART);
    let most = (scale.aside(0.0).abs().max(scale.aside(f64::from(scale.columns)).abs()) * cell_m / step_m) as i32;
    for sign in [1.0, -1.0] {
        for times in 1..=most {
            let distance_m = f64::from(times) * step_m;
            let text = format!("{distance_m}");
            let centre = column_of(sign * distance_m);
            let last = f64::from(area.width) - text.len() as f64;
            if (0.0..=f64::from(area.width)).contains(&centre) {
                let column = (centre - text.len() as f64 / 2.0).clamp(0.0, last.max(0.0));
                buffer.set_string(area.x + column as u16, area.y, text, palette.faint());
            }
        }
    }
    // Between the cells to its left and to its right.
    let column = (column_of(0.0) - 0.5).round();
    if column >= 0.0 && (column as u16) < area.width {
        buffer.set_string(area.x + column as u16, area.y, "▲", palette.robot());
    }
}

/// Sign and style of two squares, one above the other.
fn look(upper: Square, lower: Square, trusted: bool, palette: Palette) -> (char, Style) {
    if !palette.colours {
        let sign = match (upper, lower) {
            (Square::Obstacle, Square::Obstacle) => '█',
            (Square::Obstacle, _) => '▀',
            (_, Square::Obstacle) => '▄',
            (Square::Free, Square::Free) => ':',
            (Square::Free, Square::Unknown) => '\'',
            (Square::Unknown, Square::Free) => '.',
            (Square::Unknown, Square::Unknown) => ' ',
        };
        return (sign, Style::new());
    }
    let colours = palette.squares(trusted);
    let colour = |square: Square| colours.get(square as usize).copied().unwrap_or(Color::Reset);
    let background = Style::new().bg(colour(lower));
    match (upper, lower) {
        (Square::Free, Square::Free) => ('·', background.fg(Color::Indexed(if trusted { 74 } else { 248 }))),
        (same, other) if same == other => {
            (if same == Square::Obstacle { '█' } else { ' ' }, background.fg(colour(same)))
        }
        // What stands is drawn in the foreground, also where signs are all that is seen.
        (Square::Unknown | Square::Free, Square::Obstacle) => ('▄', Style::new().fg(colour(lower)).bg(colour(upper))),
        _ => ('▀', background.fg(colour(upper))),
    }
}

/// The smallest of 1, 2, 5, 10, ... that is not below `least`.
fn step(least: f64) -> f64 {
    let mut step = 1.0;
    for factor in [2.0, 2.5, 2.0].into_iter().cycle().take(12) {
        if step >= least {
            break;
        }
        step *= factor;
    }
    step
}

fn span(first: i8, last: i8) -> f64 {
    f64::from(i32::from(last) - i32::from(first) + 1)
}

/// Indices of cells reach from -64 to 63.
fn place(index: i32) -> usize {
    usize::try_from(index + 64).unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_round_numbers() {
        for (least, expected) in
            [(0.1, 1.0), (1.0, 1.0), (1.1, 2.0), (3.0, 5.0), (6.0, 10.0), (11.0, 20.0), (70.0, 100.0)]
        {
            assert_eq!(step(least), expected);
        }
    }

    #[test]
    fn the_scale_takes_the_room_that_there_is() {
        let extent = Extent { i_first: 0, i_last: 49, j_first: -25, j_last: 24 };
        let small = Scale::fit(extent, 41, 32);
        assert_eq!((small.rows, small.columns), (32, 32));
        assert!((small.ahead(0.0) - 50.0).abs() < 1e-9 && small.ahead(32.0).abs() < 1e-9);
        let large = Scale::fit(extent, 120, 103);
        assert_eq!((large.cells, large.rows, large.columns), (0.5, 100, 100));
        assert_eq!((large.aside(0.0), large.aside(100.0)), (25.0, -25.0));
    }

    #[test]
    fn no_obstacle_is_lost_when_several_cells_share_a_square() {
        let extent = Extent { i_first: 0, i_last: 49, j_first: -25, j_last: 24 };
        for rows in [7, 32, 49, 50, 101] {
            let scale = Scale::fit(extent, 200, rows);
            for i in (0..50).step_by(3) {
                for j in (-25..25).step_by(4) {
                    let mut cells = Cells { squares: Box::new([[Square::Free; 128]; 128]) };
                    cells.squares[place(i)][place(j)] = Square::Obstacle;
                    let shown = (0..scale.rows)
                        .flat_map(|row| (0..scale.columns).map(move |column| (row, column)))
                        .filter(|(row, column)| scale.square(&cells, *column, *row) == Square::Obstacle)
                        .count();
                    assert!(shown >= 1, "cell ({i}, {j}) in {rows} rows");
                }
            }
        }
    }
}
