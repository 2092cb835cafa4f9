//! The bird's-eye map: cells around the robot, which stands at (0, 0) and looks up.

use embedded_graphics::{
    mono_font::{MonoTextStyle, ascii::FONT_8X13, ascii::FONT_8X13_BOLD},
    pixelcolor::Rgb888,
    prelude::{Drawable, Point, Primitive, Size},
    primitives::{Circle, Line, PointsIter, PrimitiveStyle, Rectangle, Triangle},
    text::{Alignment, Baseline, Text, TextStyle, TextStyleBuilder},
};
use fencepost_core::{
    map::{Cell, CellState, Doubt, MapGeometry, UnknownReason},
    methods::{DetectorKind, Detectors},
};
use fencepost_hal::scene::TruthCell;

use super::{
    Canvas,
    colours::{Colour, mix},
};
use crate::{view::FrameView, words};

const PAPER: Colour = [255, 255, 255];
const FREE: Colour = [238, 244, 232];
const UNKNOWN: Colour = [206, 208, 212];
const HATCH: Colour = [168, 171, 178];
const OBSTACLE: Colour = [240, 176, 166];
const DOT: Colour = [186, 24, 22];
const INK: Colour = [40, 42, 48];
const GRID: Colour = [178, 182, 190];
const VIEW: Colour = [36, 84, 170];
const DISPUTED: Colour = [226, 124, 0];
const UNCONFIRMED: Colour = [238, 196, 120];
/// Cells by their cost, from none to the most: the paper, Figure 7, where lighter is costlier.
const NO_COST: Colour = [44, 48, 58];
const MOST_COST: Colour = [252, 250, 240];
/// Cost that is as light as can be. Costs differ by orders of magnitude, as numbers of pixels do: light goes by their logarithm.
const LIGHTEST: f32 = 2000.0;

/// Longest edge of the map itself, px.
const LONGEST_PX: f32 = 500.0;
const LEFT_PX: i32 = 58;
const TOP_PX: i32 = 34;
const RIGHT_PX: i32 = 22;
const BOTTOM_PX: i32 = 76;
/// A second row of the legend.
const LEGEND_ROW_PX: i32 = 18;
/// Metres from one line of the grid to the next.
const GRID_M: i32 = 5;

/// Paints the map of a frame.
pub fn birdseye(view: &FrameView<'_>) -> Canvas {
    let reasons = words::reason_names(view.health, ", ");
    let level = words::level_name(view.health.level);
    let title = match reasons.is_empty() {
        true => format!("frame {}   health {level}", view.number),
        false => format!("frame {}   health {level}: {reasons}", view.number),
    };
    paint(view, &title, &legend(view.detection.detectors))
}

/// Paints what is really in the cells of a frame, in the same manner. `truth(i, j)` is told of cell `(i, j)`.
pub fn true_map(view: &FrameView<'_>, truth: impl Fn(i16, i16) -> TruthCell) -> Canvas {
    let mut detection = Box::new(view.detection.clone());
    detection.obstacles.clear();
    // Neither costs nor doubts are painted.
    detection.detectors = Detectors::default();
    let geometry = detection.map.geometry;
    for (index, cell) in detection.map.cells.iter_mut().enumerate() {
        let (i, j) = geometry.cell_at(index);
        let state = match truth(i, j) {
            TruthCell::Obstacle => CellState::Obstacle,
            TruthCell::Free => CellState::Free,
            TruthCell::NotJudged => CellState::Unknown(UnknownReason::OutsideView),
        };
        *cell = Cell { state, ..Cell::default() };
    }
    let legend = [
        Entry { dot: true, ..Entry::plain(OBSTACLE, "obstacle") },
        Entry::plain(FREE, "free"),
        Entry::plain(UNKNOWN, "not judged"),
    ];
    paint(&FrameView { detection: &detection, ..*view }, &format!("frame {}   truth", view.number), &legend)
}

/// Marks cells of a map that [`birdseye`] painted with a frame of a colour.
pub fn mark_cells(canvas: &mut Canvas, geometry: MapGeometry, cells: impl IntoIterator<Item = ((i16, i16), Colour)>) {
    let scale = Scale::new(geometry);
    for ((i, j), colour) in cells {
        let Some(index) = geometry.index(i, j) else { continue };
        let size = Size::new(scale.px_per_cell.unsigned_abs() + 1, scale.px_per_cell.unsigned_abs() + 1);
        let style = PrimitiveStyle::with_stroke(rgb(colour), if scale.px_per_cell >= 8 { 2 } else { 1 });
        draw(&Rectangle::new(scale.cell(index), size).into_styled(style), canvas);
    }
}

fn paint(view: &FrameView<'_>, title: &str, legend: &[Entry]) -> Canvas {
    let scale = Scale::new(view.detection.map.geometry);
    let (width, height) = scale.canvas_px();
    let more = if legend.len() > LEGEND_ROW { LEGEND_ROW_PX as usize } else { 0 };
    let mut canvas = Canvas::new(width, height + more, PAPER);
    paint_cells(&mut canvas, &scale, view);
    paint_grid(&mut canvas, &scale);
    paint_field_of_view(&mut canvas, &scale, view);
    paint_obstacles(&mut canvas, &scale, view);
    paint_robot(&mut canvas, &scale);
    paint_words(&mut canvas, &scale, title, legend);
    canvas
}

/// From metres of the vehicle frame to pixels of the picture.
struct Scale {
    geometry: MapGeometry,
    px_per_cell: i32,
    px_per_m: f32,
}

impl Scale {
    fn new(geometry: MapGeometry) -> Self {
        let longest = geometry.x_count.max(geometry.y_count).max(1);
        let px_per_cell = ((LONGEST_PX / f32::from(longest)) as i32).clamp(1, 60);
        let px_per_m = px_per_cell as f32 / geometry.cell_size_m().max(1.0e-3);
        Self { geometry, px_per_cell, px_per_m }
    }

    fn canvas_px(&self) -> (usize, usize) {
        let (width, height) = self.map_px();
        ((LEFT_PX + width + RIGHT_PX).max(420) as usize, (TOP_PX + height + BOTTOM_PX) as usize)
    }

    fn map_px(&self) -> (i32, i32) {
        (i32::from(self.geometry.y_count) * self.px_per_cell, i32::from(self.geometry.x_count) * self.px_per_cell)
    }

    /// Pixel of the point `x_m` ahead and `y_m` to the left.
    fn point(&self, x_m: f32, y_m: f32) -> Point {
        let size_m = self.geometry.cell_size_m();
        let far_m = f32::from(self.geometry.x_first) * size_m + f32::from(self.geometry.x_count) * size_m;
        let left_m = f32::from(self.geometry.y_first) * size_m + f32::from(self.geometry.y_count) * size_m;
        let across = ((left_m - y_m) * self.px_per_m).clamp(-4000.0, 4000.0);
        let down = ((far_m - x_m) * self.px_per_m).clamp(-4000.0, 4000.0);
        Point::new(LEFT_PX + across.round() as i32, TOP_PX + down.round() as i32)
    }

    /// Top left pixel of the cell at place `index` of the map.
    fn cell(&self, index: usize) -> Point {
        let (i, j) = self.geometry.cell_at(index);
        let down = i32::from(self.geometry.x_count) - 1 - (i32::from(i) - i32::from(self.geometry.x_first));
        let across = i32::from(self.geometry.y_count) - 1 - (i32::from(j) - i32::from(self.geometry.y_first));
        Point::new(LEFT_PX + across * self.px_per_cell, TOP_PX + down * self.px_per_cell)
    }

    fn frame(&self) -> Rectangle {
        let (width, height) = self.map_px();
        Rectangle::new(Point::new(LEFT_PX, TOP_PX), Size::new(width as u32, height as u32))
    }

    /// Multiples of the grid's step within the map, metres: along x and along y.
    fn grid_m(&self) -> (Vec<i32>, Vec<i32>) {
        let size_m = self.geometry.cell_size_m();
        let lines = |first: i16, count: u16| {
            let (start, end) = (f32::from(first) * size_m, (f32::from(first) + f32::from(count)) * size_m);
            let step = GRID_M * (((end - start) / 60.0) as i32 + 1);
            let nearest = (start / step as f32).ceil() as i32;
            (nearest..).map(|k| k * step).take_while(|m| *m as f32 <= end + 1.0e-3).take(200).collect::<Vec<_>>()
        };
        (lines(self.geometry.x_first, self.geometry.x_count), lines(self.geometry.y_first, self.geometry.y_count))
    }
}

fn paint_cells(canvas: &mut Canvas, scale: &Scale, view: &FrameView<'_>) {
    let has_cost = view.detection.detectors.main() == DetectorKind::CostMap;
    for (index, cell) in view.detection.map.cells.iter().enumerate() {
        let at = scale.cell(index);
        let frame = match cell.doubt {
            Doubt::None => None,
            Doubt::Unconfirmed => Some(UNCONFIRMED),
            Doubt::Disputed => Some(DISPUTED),
        };
        for dy in 0..scale.px_per_cell {
            for dx in 0..scale.px_per_cell {
                let (x, y) = (at.x + dx, at.y + dy);
                let [nearest, farthest] = [dx.min(dy), dx.max(dy)];
                let at_edge = nearest == 0 || farthest == scale.px_per_cell - 1;
                let colour = if has_cost { cost_colour(cell) } else { None };
                let colour = colour.unwrap_or_else(|| state_colour(cell.state, x, y));
                canvas.set(x, y, frame.filter(|_| at_edge).unwrap_or(colour));
            }
        }
        if cell.state == CellState::Obstacle {
            let diameter = (scale.px_per_cell * 3 / 5).max(2) as u32;
            let centre = Point::new(at.x + scale.px_per_cell / 2, at.y + scale.px_per_cell / 2);
            draw(&Circle::with_center(centre, diameter).into_styled(PrimitiveStyle::with_fill(rgb(DOT))), canvas);
        }
    }
}

fn state_colour(state: CellState, x: i32, y: i32) -> Colour {
    match state {
        CellState::Free => FREE,
        CellState::Obstacle => OBSTACLE,
        CellState::Unknown(UnknownReason::OutsideView) => UNKNOWN,
        CellState::Unknown(_) => [UNKNOWN, HATCH][usize::from((x + y).rem_euclid(6) == 0)],
    }
}

/// Colour of a cell by its cost; `None` where nothing is known of it.
fn cost_colour(cell: &Cell) -> Option<Colour> {
    let known = cell.cost > 0 || !matches!(cell.state, CellState::Unknown(_));
    known.then(|| mix(NO_COST, MOST_COST, ((1.0 + f32::from(cell.cost)).ln() / LIGHTEST.ln()).min(1.0)))
}

fn paint_grid(canvas: &mut Canvas, scale: &Scale) {
    let style = MonoTextStyle::new(&FONT_8X13, rgb(INK));
    let (width, height) = scale.map_px();
    let (along_x, along_y) = scale.grid_m();
    for metres in along_x {
        let y = scale.point(metres as f32, 0.0).y;
        for x in LEFT_PX..LEFT_PX + width {
            canvas.blend(x, y, GRID, 0.6);
        }
        let (label, at) = (metres.to_string(), Point::new(LEFT_PX - 8, y));
        draw(&Text::with_text_style(&label, at, style, text_style(Alignment::Right, Baseline::Middle)), canvas);
    }
    for metres in along_y {
        let x = scale.point(0.0, metres as f32).x;
        for y in TOP_PX..TOP_PX + height {
            canvas.blend(x, y, GRID, 0.6);
        }
        let (label, at) = (metres.to_string(), Point::new(x, TOP_PX + height + 6));
        draw(&Text::with_text_style(&label, at, style, text_style(Alignment::Center, Baseline::Top)), canvas);
    }
    draw(&scale.frame().into_styled(PrimitiveStyle::with_stroke(rgb(INK), 1)), canvas);
}

/// Dashed lines along the left and right edge of what the left camera sees at the height of its optical axis.
fn paint_field_of_view(canvas: &mut Canvas, scale: &Scale, view: &FrameView<'_>) {
    let pair = view.pair;
    let frame = scale.frame();
    let [x, y, _] = view.vehicle.origin_m();
    for column in [0.0, pair.width as f32] {
        let ray = view.vehicle.direction([(column - pair.cx) / pair.focal_px, 0.0, 1.0]);
        let length = (ray[0] * ray[0] + ray[1] * ray[1]).sqrt();
        if length < 1.0e-3 {
            continue;
        }
        let (dx, dy) = (ray[0] / length, ray[1] / length);
        let step_m = 0.5 / scale.px_per_m;
        for k in 0..8000 {
            let distance_m = k as f32 * step_m;
            let at = scale.point(x + dx * distance_m, y + dy * distance_m);
            if k % 24 < 14 && frame.contains(at) {
                canvas.blend(at.x, at.y, VIEW, 0.9);
            }
        }
    }
}

/// A stroke through the middle of each obstacle along its largest extent, as far as its cells reach.
fn paint_obstacles(canvas: &mut Canvas, scale: &Scale, view: &FrameView<'_>) {
    for obstacle in &view.detection.obstacles {
        let (sin, cos) = obstacle.orientation_rad.sin_cos();
        let half_m = obstacle.length_m.clamp(0.1, 50.0) / 2.0;
        let [x, y, _] = obstacle.mean_m;
        let ends = [-half_m, half_m].map(|along| scale.point(x + cos * along, y + sin * along));
        for point in Line::new(ends[0], ends[1]).points() {
            let (Ok(column), Ok(row)) = (usize::try_from(point.x), usize::try_from(point.y)) else { continue };
            if [OBSTACLE, DOT].contains(&canvas.get(column, row)) {
                canvas.set(point.x, point.y, INK);
            }
        }
    }
}

fn paint_robot(canvas: &mut Canvas, scale: &Scale) {
    let at = scale.point(0.0, 0.0);
    let robot =
        Triangle::new(Point::new(at.x, at.y - 12), Point::new(at.x - 8, at.y + 5), Point::new(at.x + 8, at.y + 5));
    draw(&robot.into_styled(PrimitiveStyle::with_fill(rgb(INK))), canvas);
}

fn paint_words(canvas: &mut Canvas, scale: &Scale, title: &str, legend: &[Entry]) {
    let plain = MonoTextStyle::new(&FONT_8X13, rgb(INK));
    let bold = MonoTextStyle::new(&FONT_8X13_BOLD, rgb(INK));
    let left_top = text_style(Alignment::Left, Baseline::Top);
    let (width, height) = scale.map_px();

    let room = (canvas.width() as i32 - 16) / 8;
    let title: String = title.chars().take(room.max(0) as usize).collect();
    draw(&Text::with_text_style(&title, Point::new(8, 10), bold, left_top), canvas);

    let middle = text_style(Alignment::Center, Baseline::Top);
    let axis = "y, metres to the left";
    draw(&Text::with_text_style(axis, Point::new(LEFT_PX + width / 2, TOP_PX + height + 24), plain, middle), canvas);
    draw_upward(canvas, "x, metres ahead", Point::new(6, TOP_PX + height / 2));
    for (entries, row) in legend.chunks(LEGEND_ROW).zip(0..) {
        paint_legend(canvas, TOP_PX + height + 50 + row * LEGEND_ROW_PX, entries);
    }
}

/// Entries in a row of the legend.
const LEGEND_ROW: usize = 4;

/// A word of the legend, and what its patch looks like.
struct Entry {
    colour: Colour,
    word: &'static str,
    hatched: bool,
    dot: bool,
    frame: Colour,
}

impl Entry {
    const fn plain(colour: Colour, word: &'static str) -> Self {
        Self { colour, word, hatched: false, dot: false, frame: INK }
    }
}

/// What the map shows, in rows of [`LEGEND_ROW`].
fn legend(detectors: Detectors) -> Vec<Entry> {
    let has_cost = detectors.main() == DetectorKind::CostMap;
    let (obstacle, free) = if has_cost { (MOST_COST, NO_COST) } else { (OBSTACLE, FREE) };
    let mut entries = vec![
        Entry { dot: true, ..Entry::plain(obstacle, "obstacle") },
        Entry::plain(free, "free"),
        Entry { hatched: true, ..Entry::plain(UNKNOWN, "not known") },
        Entry::plain(UNKNOWN, "out of view"),
    ];
    if has_cost {
        entries.push(Entry::plain(mix(NO_COST, MOST_COST, 0.6), "lighter: costlier"));
    }
    if detectors.cross_check().is_some() {
        entries.push(Entry { frame: DISPUTED, ..Entry::plain(PAPER, "disputed") });
        entries.push(Entry { frame: UNCONFIRMED, ..Entry::plain(PAPER, "unconfirmed") });
    }
    entries
}

fn paint_legend(canvas: &mut Canvas, y: i32, entries: &[Entry]) {
    let plain = MonoTextStyle::new(&FONT_8X13, rgb(INK));
    let mut x = 12;
    for Entry { colour, word, hatched, dot, frame } in entries {
        for dy in 0..13 {
            for dx in 0..13 {
                let thick = if *frame == INK { 0 } else { 1 };
                let edge = dx.min(dy) <= thick || dx.max(dy) >= 12 - thick;
                let line = *hatched && (x + dx + y + dy).rem_euclid(6) == 0;
                let inner = if line { HATCH } else { *colour };
                canvas.set(x + dx, y + dy, if edge { *frame } else { inner });
            }
        }
        if *dot {
            let dot = Circle::new(Point::new(x + 3, y + 3), 7);
            draw(&dot.into_styled(PrimitiveStyle::with_fill(rgb(DOT))), canvas);
        }
        draw(&Text::with_baseline(word, Point::new(x + 18, y), plain, Baseline::Top), canvas);
        x += 18 + 8 * word.len() as i32 + 18;
    }
}

/// Text that runs upward, its middle at the height of `at`: the font cannot be turned, the picture of it can.
fn draw_upward(canvas: &mut Canvas, text: &str, at: Point) {
    let style = MonoTextStyle::new(&FONT_8X13, rgb(INK));
    let mut lying = Canvas::new(8 * text.len(), 13, PAPER);
    draw(&Text::with_baseline(text, Point::zero(), style, Baseline::Top), &mut lying);
    let length = lying.width() as i32;
    for y in 0..lying.height() as i32 {
        for x in 0..length {
            canvas.set(at.x + y, at.y + length / 2 - x, lying.get(x as usize, y as usize));
        }
    }
}

fn text_style(alignment: Alignment, baseline: Baseline) -> TextStyle {
    TextStyleBuilder::new().alignment(alignment).baseline(baseline).build()
}

fn rgb(colour: Colour) -> Rgb888 {
    Rgb888::new(colour[0], colour[1], colour[2])
}

fn draw(what: &impl Drawable<Color = Rgb888>, canvas: &mut Canvas) {
    let Ok(_) = what.draw(canvas);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::testing::MadeUp;

    #[test]
    fn cells_lie_where_the_axes_say() {
        let made_up = MadeUp::new();
        let canvas = made_up.view(birdseye);
        let scale = Scale::new(made_up.detection.map.geometry);
        for (index, cell) in made_up.detection.map.cells.iter().enumerate() {
            let (i, j) = made_up.detection.map.geometry.cell_at(index);
            let (x_m, y_m) = made_up.detection.map.geometry.centre_m(i, j);
            let at = scale.point(x_m, y_m);
            let colour = canvas.get(at.x as usize, at.y as usize);
            if cell.state == CellState::Obstacle {
                assert!(colour == DOT || colour[0] < 120, "cell ({i}, {j}) is {colour:?}");
            } else {
                assert_ne!(colour, DOT, "cell ({i}, {j})");
            }
        }
    }

    #[test]
    fn the_truth_is_painted_in_place_of_what_was_found() {
        let made_up = MadeUp::new();
        let truth = |i: i16, j: i16| if (i, j) == (20, 3) { TruthCell::Obstacle } else { TruthCell::Free };
        let canvas = made_up.view(|view| true_map(view, truth));
        let scale = Scale::new(made_up.detection.map.geometry);
        let dot_at = |i: i16, j: i16| {
            let (x_m, y_m) = made_up.detection.map.geometry.centre_m(i, j);
            let at = scale.point(x_m, y_m);
            canvas.get(at.x as usize, at.y as usize) == DOT
        };
        assert!(dot_at(20, 3), "the obstacle of the truth");
        assert!(!dot_at(9, 1), "what the detector found");
    }

    #[test]
    fn doubt_has_a_frame_and_costs_are_lighter_the_higher_they_are() {
        let mut made_up = MadeUp::new();
        let geometry = made_up.detection.map.geometry;
        let doubts = [(5, Doubt::Disputed, DISPUTED), (6, Doubt::Unconfirmed, UNCONFIRMED)];
        for (i, doubt, _) in doubts {
            made_up.detection.map.cells[geometry.index(i, 0).unwrap()].doubt = doubt;
        }
        let scale = Scale::new(geometry);
        let canvas = made_up.view(birdseye);
        for (i, _, colour) in doubts {
            let at = scale.cell(geometry.index(i, 0).unwrap());
            // The lines of the grid lie over the cells' edges; this pixel is beside one.
            assert_eq!(canvas.get(at.x as usize + 1, at.y as usize), colour, "cell ({i}, 0)");
        }

        made_up.detection.detectors = Detectors::new(DetectorKind::CostMap, None);
        for (i, cost) in [(5, 0), (6, 1), (7, 30), (8, 3000)] {
            let cell = &mut made_up.detection.map.cells[geometry.index(i, 3).unwrap()];
            *cell = Cell { state: CellState::Free, cost, ..Cell::default() };
        }
        let canvas = made_up.view(birdseye);
        let light = [5, 6, 7, 8].map(|i| {
            let at = scale.cell(geometry.index(i, 3).unwrap());
            canvas.get(at.x as usize + 3, at.y as usize + 3)
        });
        assert_eq!((light[0], light[3]), (NO_COST, MOST_COST));
        assert!(light.is_sorted_by(|a, b| (0..3).all(|i| a[i] < b[i])), "{light:?}");
    }

    #[test]
    fn every_map_geometry_has_a_picture() {
        let mut made_up = MadeUp::new();
        for (size, x_first, x_count, y_first, y_count) in
            [(500, 0, 1, 0, 1), (100, -64, 128, -64, 128), (5000, -20, 40, 3, 2), (1, 0, 10, 0, 10), (500, 0, 0, 0, 0)]
        {
            made_up.set_geometry(MapGeometry { cell_size_mm: size, x_first, x_count, y_first, y_count });
            assert!(made_up.view(birdseye).width() > 100);
        }
    }
}
