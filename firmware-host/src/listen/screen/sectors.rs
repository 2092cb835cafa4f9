//! The nearest obstacle in each direction, from left to right: a bar as long as the way is free, and the distance.

use fencepost_core::map::{SECTOR_CLEAR_DM, SECTOR_UNKNOWN, SectorDistances};
use ratatui::{
    buffer::Buffer,
    layout::Rect,
    text::{Line, Span},
};

use super::palette::Palette;

const EIGHTHS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Draws the sectors; a full bar is `range_m`. In grey if they are not `trusted`.
pub(super) fn draw(
    sectors: &SectorDistances,
    range_m: f64,
    trusted: bool,
    palette: Palette,
    area: Rect,
    buffer: &mut Buffer,
) {
    let count = sectors.distance_dm.len() as u16;
    let width = area.width / count;
    if width < 3 || area.height < 3 {
        return;
    }
    let left = area.x + (area.width - width * count) / 2;
    let (left_deg, right_deg) = (sectors.left_deg, sectors.left_deg - sectors.width_deg * f32::from(count));
    let heading = format!("SECTORS {left_deg:.0}° left to {:.0}° right", -right_deg);
    let legend = "  metres to an obstacle, clr: clear, ?: not seen";
    let line = Line::from(vec![Span::styled(heading, palette.heading()), Span::styled(legend, palette.faint())]);
    buffer.set_line(area.x, area.y, &line, area.width);

    let bars = Rect { y: area.y + 1, height: area.height - 2, ..area };
    for (place, distance_dm) in sectors.distance_dm.iter().enumerate() {
        let x = left + place as u16 * width;
        let bottom = bars.y + bars.height - 1;
        let rows = f64::from(bars.height);
        let (text, style, length) = match *distance_dm {
            SECTOR_UNKNOWN => ("?".to_owned(), palette.faint(), 0.0),
            SECTOR_CLEAR_DM => ("clr".to_owned(), palette.free(), rows),
            dm => (metres(dm), palette.obstacle(), f64::from(dm) / 10.0 / range_m * rows),
        };
        let style = if trusted { style } else { palette.faint() };
        // Something near still has a bar.
        let eighths = if length > 0.0 { ((length * 8.0).round() as u16).clamp(1, 8 * bars.height) } else { 0 };
        for row in 0..bars.height {
            let filled = usize::from(eighths.saturating_sub(8 * row).min(8));
            let sign = EIGHTHS.get(filled).copied().unwrap_or(' ');
            for column in 0..width - 1 {
                buffer[(x + column, bottom - row)].set_char(sign).set_style(style);
            }
        }
        let text: String = text.chars().take(usize::from(width - 1)).collect();
        let pad = (usize::from(width - 1) - text.chars().count()) / 2;
        buffer.set_string(x + pad as u16, area.y + area.height - 1, text, style);
    }
}

/// Decimetres in metres, three characters.
fn metres(dm: u8) -> String {
    if dm < 100 { format!("{}.{}", dm / 10, dm % 10) } else { format!("{}", (f64::from(dm) / 10.0).round()) }
}
