//! `cells.csv`, `obstacles.csv` and `ground.csv`.

use fencepost_core::{
    ground::GroundPlane,
    map::{Cell, CellState, MapGeometry},
    methods::DetectorKind,
    obstacles::Obstacle,
};

use super::{OutputFolder, WriteFile};
use crate::{error::Failure, view::FrameView, words};

/// One cell that is not unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellRow {
    /// Cell along x and along y.
    pub cell: (i16, i16),
    /// What is known of it.
    pub content: Cell,
}

/// The three tables. Rows of a frame are on the disk when [`Tables::frame`] returns.
#[derive(Debug)]
pub struct Tables {
    cells: csv::Writer<WriteFile>,
    obstacles: csv::Writer<WriteFile>,
    ground: csv::Writer<WriteFile>,
}

const CELLS: [&str; 10] =
    ["frame", "timestamp_ns", "x_m", "y_m", "state", "pixels", "height_m", "confidence_percent", "doubt", "cost"];
const OBSTACLES: [&str; 16] = [
    "frame",
    "timestamp_ns",
    "obstacle",
    "distance_m",
    "x_m",
    "y_m",
    "height_m",
    "x_min_m",
    "x_max_m",
    "y_min_m",
    "y_max_m",
    "bottom_m",
    "orientation_deg",
    "length_m",
    "pixels",
    "surfaces",
];
const GROUND: [&str; 15] = [
    "frame",
    "timestamp_ns",
    "found",
    "camera_height_m",
    "pitch_down_deg",
    "roll_deg",
    "normal_x",
    "normal_y",
    "normal_z",
    "offset_m",
    "support_pixels",
    "rms_m",
    "age_frames",
    "health",
    "health_reasons",
];

impl Tables {
    /// Starts the tables in `folder`.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn create(folder: &OutputFolder) -> Result<Self, Failure> {
        Ok(Self {
            cells: start(folder, "cells.csv", &CELLS)?,
            obstacles: start(folder, "obstacles.csv", &OBSTACLES)?,
            ground: start(folder, "ground.csv", &GROUND)?,
        })
    }

    /// Writes the rows of a frame. `cells` are those that go on the bus, in their order.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn frame(&mut self, view: &FrameView<'_>, cells: &[CellRow]) -> Result<(), Failure> {
        let geometry = view.detection.map.geometry;
        for row in cells {
            if let Some(fields) = cell_fields(view, &geometry, row) {
                write(&mut self.cells, fields)?;
            }
        }
        for (index, obstacle) in view.detection.obstacles.iter().enumerate() {
            write(&mut self.obstacles, obstacle_fields(view, index, obstacle))?;
        }
        write(&mut self.ground, ground_fields(view))?;
        [&mut self.cells, &mut self.obstacles, &mut self.ground].into_iter().try_for_each(flush)
    }
}

fn cell_fields(view: &FrameView<'_>, geometry: &MapGeometry, row: &CellRow) -> Option<[String; 10]> {
    let state = match row.content.state {
        CellState::Obstacle => "obstacle",
        CellState::Free => "free",
        CellState::Unknown(_) => return None,
    };
    let has_cost = view.detection.detectors.main() == DetectorKind::CostMap;
    // From whole millimetres, so that the centre is written exactly: (i + 1/2) * size.
    let centre = |cell: i16| f64::from((2 * i32::from(cell) + 1) * i32::from(geometry.cell_size_mm)) / 2000.0;
    Some([
        view.number.to_string(),
        view.timestamp_ns.to_string(),
        centre(row.cell.0).to_string(),
        centre(row.cell.1).to_string(),
        state.to_string(),
        row.content.pixels.to_string(),
        format!("{}.{}", row.content.height_dm / 10, row.content.height_dm % 10),
        row.content.confidence_percent.to_string(),
        words::doubt_name(row.content.doubt).to_string(),
        if has_cost { row.content.cost.to_string() } else { String::new() },
    ])
}

fn obstacle_fields(view: &FrameView<'_>, index: usize, obstacle: &Obstacle) -> [String; 16] {
    [
        view.number.to_string(),
        view.timestamp_ns.to_string(),
        index.to_string(),
        millimetres(obstacle.distance_m()),
        millimetres(obstacle.mean_m[0]),
        millimetres(obstacle.mean_m[1]),
        millimetres(obstacle.max_m[2]),
        millimetres(obstacle.min_m[0]),
        millimetres(obstacle.max_m[0]),
        millimetres(obstacle.min_m[1]),
        millimetres(obstacle.max_m[1]),
        millimetres(obstacle.min_m[2]),
        format!("{:.2}", obstacle.orientation_rad.to_degrees()),
        millimetres(obstacle.length_m),
        obstacle.pixels.to_string(),
        obstacle.surfaces.to_string(),
    ]
}

fn ground_fields(view: &FrameView<'_>) -> [String; 15] {
    let health = view.health;
    let ground = view.detection.ground.as_ref();
    let field = |text: &dyn Fn(&GroundPlane) -> String| ground.map(text).unwrap_or_default();
    [
        view.number.to_string(),
        view.timestamp_ns.to_string(),
        match ground {
            Some(plane) if plane.age_frames == 0 => "seen",
            Some(_) => "held",
            None => "none",
        }
        .to_string(),
        field(&|g| format!("{:.4}", g.camera_height_m)),
        field(&|g| format!("{:.4}", g.pitch_down_rad.to_degrees())),
        field(&|g| format!("{:.4}", g.roll_rad.to_degrees())),
        field(&|g| format!("{:.6}", g.normal[0])),
        field(&|g| format!("{:.6}", g.normal[1])),
        field(&|g| format!("{:.6}", g.normal[2])),
        field(&|g| format!("{:.4}", g.offset_m)),
        field(&|g| g.support.to_string()),
        field(&|g| format!("{:.4}", g.rms_m)),
        field(&|g| g.age_frames.to_string()),
        words::level_name(health.level).to_string(),
        words::reason_names(health, " "),
    ]
}

fn millimetres(metres: f32) -> String {
    format!("{metres:.3}")
}

fn start(folder: &OutputFolder, name: &str, header: &[&str]) -> Result<csv::Writer<WriteFile>, Failure> {
    let mut writer = csv::Writer::from_writer(folder.create(name)?);
    write(&mut writer, header)?;
    flush(&mut writer)?;
    Ok(writer)
}

fn write<T: AsRef<[u8]>>(
    writer: &mut csv::Writer<WriteFile>,
    fields: impl IntoIterator<Item = T>,
) -> Result<(), Failure> {
    writer.write_record(fields).map_err(|error| {
        let path = writer.get_ref().path().to_path_buf();
        Failure::cannot_write(&path, &std::io::Error::from(error))
    })
}

fn flush(writer: &mut csv::Writer<WriteFile>) -> Result<(), Failure> {
    let path = writer.get_ref().path().to_path_buf();
    writer.flush().map_err(|error| Failure::cannot_write(&path, &error))
}

#[cfg(test)]
mod tests {
    use fencepost_core::{map::Doubt, methods::Detectors};

    use super::*;
    use crate::view::testing::MadeUp;

    fn read(folder: &OutputFolder, name: &str) -> Vec<csv::StringRecord> {
        let mut reader = csv::Reader::from_path(folder.path().join(name)).unwrap();
        reader.records().map(Result::unwrap).collect()
    }

    #[test]
    fn rows_come_back() {
        let scratch = tempfile::tempdir().unwrap();
        let folder = OutputFolder::open(scratch.path()).unwrap();
        let mut tables = Tables::create(&folder).unwrap();
        let made_up = MadeUp::new();
        let known = Cell { confidence_percent: 100, ..Cell::default() };
        let doubt = Doubt::Disputed;
        let obstacle =
            Cell { state: CellState::Obstacle, pixels: 321, height_dm: 17, confidence_percent: 50, doubt, ..known };
        let free = Cell { state: CellState::Free, pixels: 12, ..known };
        let rows = [CellRow { cell: (9, -1), content: obstacle }, CellRow { cell: (3, 4), content: free }];
        made_up.view(|view| tables.frame(view, &rows)).unwrap();

        // Read while the tables are still open: what was written stays readable whatever comes.
        let cells = read(&folder, "cells.csv");
        let row = |index: usize| cells[index].iter().collect::<Vec<_>>().join(",");
        assert_eq!(row(0), "7,1500000000,4.75,-0.25,obstacle,321,1.7,50,disputed,");
        assert_eq!(row(1), "7,1500000000,1.75,2.25,free,12,0.0,100,,");
        assert_eq!(read(&folder, "obstacles.csv").len(), made_up.detection.obstacles.len());
        let ground = read(&folder, "ground.csv");
        assert_eq!(
            ground[0].iter().take(6).collect::<Vec<_>>(),
            ["7", "1500000000", "seen", "1.0200", "15.0000", "0.5000"]
        );
        assert_eq!(ground[0].iter().skip(13).collect::<Vec<_>>(), ["degraded", "low_coverage exposure_mismatch"]);
    }

    #[test]
    fn only_a_cost_map_has_costs() {
        for (kind, expected) in [(DetectorKind::CostMap, "17"), (DetectorKind::PixelNormals, "")] {
            let scratch = tempfile::tempdir().unwrap();
            let folder = OutputFolder::open(scratch.path()).unwrap();
            let mut tables = Tables::create(&folder).unwrap();
            let mut made_up = MadeUp::new();
            made_up.detection.detectors = Detectors::new(kind, None);
            let content = Cell { state: CellState::Obstacle, cost: 17, ..Cell::default() };
            made_up.view(|view| tables.frame(view, &[CellRow { cell: (1, 1), content }])).unwrap();
            assert_eq!(read(&folder, "cells.csv")[0].iter().next_back(), Some(expected), "{}", kind.name());
        }
    }
}
