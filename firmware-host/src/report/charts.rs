//! Charts as SVG. Colours are names of the page's style sheet, so that they follow its light and dark looks.

use std::ops::Range;

use plotters::prelude::*;

/// A chart of values over time.
#[derive(Clone, Debug)]
pub(super) struct Chart {
    /// What lies along x, with its unit.
    pub(super) x_label: &'static str,
    /// What lies along y, with its unit.
    pub(super) y_label: &'static str,
    /// The values.
    pub(super) series: Vec<Series>,
    /// A value that is known from elsewhere, drawn as a dashed line.
    pub(super) expected: Option<f64>,
    /// The least range of y, so that noise does not look like a mountain range.
    pub(super) least_span: f64,
    /// Whether y begins at 0.
    pub(super) from_zero: bool,
}

/// One series of a chart.
#[derive(Clone, Debug)]
pub(super) struct Series {
    /// Which of the colours: 0 and 1 for values, 2 for values that need care.
    pub(super) colour: usize,
    /// Only dots, no line.
    pub(super) dots: bool,
    /// `(x, y)` in rising x. A gap in the line is a NaN.
    pub(super) points: Vec<(f64, f64)>,
}

/// Colours that the style sheet replaces by its own.
const COLOURS: [RGBColor; 3] = [RGBColor(1, 0, 0), RGBColor(2, 0, 0), RGBColor(3, 0, 0)];
const INK: RGBColor = RGBColor(4, 0, 0);
const GRID: RGBColor = RGBColor(5, 0, 0);
const EXPECTED: RGBColor = RGBColor(6, 0, 0);

impl Chart {
    /// The chart as an `svg` element; empty if there are no values.
    pub(super) fn svg(&self, (width, height): (u32, u32)) -> String {
        let finite = || self.series.iter().flat_map(|s| s.points.iter()).filter(|p| p.0.is_finite() && p.1.is_finite());
        if finite().next().is_none() {
            return String::new();
        }
        let x = padded(finite().map(|p| p.0), 1.0e-6, false);
        let y = padded(finite().map(|p| p.1).chain(self.expected), self.least_span, self.from_zero);
        let mut svg = String::new();
        match self.draw(&mut svg, (width, height), x, y) {
            Ok(()) => with_classes(&svg),
            // Drawing into a string does not fail; a report without one chart is better than none.
            Err(_) => String::new(),
        }
    }

    fn draw(
        &self,
        svg: &mut String,
        size: (u32, u32),
        x: Range<f64>,
        y: Range<f64>,
    ) -> Result<(), Box<dyn std::error::Error>> {
        let root = SVGBackend::with_string(svg, size).into_drawing_area();
        let mut chart = ChartBuilder::on(&root)
            .margin_top(10)
            .margin_right(14)
            .x_label_area_size(44)
            .y_label_area_size(62)
            .build_cartesian_2d(x.clone(), y)?;
        let text = ("sans-serif", 16).into_font().color(&INK);
        chart
            .configure_mesh()
            .disable_x_mesh()
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .axis_style(INK)
            .x_desc(self.x_label)
            .y_desc(self.y_label)
            .x_labels(if size.0 < 450 { 6 } else { 10 })
            .y_labels(6)
            .label_style(text.clone())
            .axis_desc_style(text)
            .x_label_formatter(&short)
            .y_label_formatter(&short)
            .draw()?;
        if let Some(expected) = self.expected {
            let ends = [(x.start, expected), (x.end, expected)];
            chart.draw_series(DashedLineSeries::new(ends, 6, 5, EXPECTED.stroke_width(2)))?;
        }
        for series in &self.series {
            let colour = COLOURS[series.colour.min(COLOURS.len() - 1)];
            if !series.dots {
                for run in series.points.split(|p| !p.1.is_finite()) {
                    chart.draw_series(LineSeries::new(run.iter().copied(), colour.stroke_width(2)))?;
                }
            }
            let dots = series.dots || series.points.len() <= 60;
            if dots {
                let radius = if series.points.len() <= 60 { 3 } else { 2 };
                let points = series.points.iter().filter(|p| p.1.is_finite());
                chart.draw_series(points.map(|p| Circle::new(*p, radius, colour.filled())))?;
            }
        }
        root.present()?;
        drop(chart);
        Ok(())
    }
}

fn padded(values: impl Iterator<Item = f64>, least_span: f64, from_zero: bool) -> Range<f64> {
    let (min, max) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    let (min, max) = if from_zero { (0.0, max.max(0.0)) } else { (min, max) };
    let span = (max - min).max(least_span);
    let middle = 0.5 * (min + max);
    if from_zero { 0.0..(1.08 * span) } else { (middle - 0.54 * span)..(middle + 0.54 * span) }
}

fn short(value: &f64) -> String {
    let text = format!("{value:.3}");
    match text.trim_end_matches('0').trim_end_matches('.') {
        "-0" => "0".to_string(),
        text => text.to_string(),
    }
}

/// Replaces the stand-in colours by classes of the style sheet.
fn with_classes(svg: &str) -> String {
    let names = [("1", "c0"), ("2", "c1"), ("3", "c2"), ("4", "ink"), ("5", "grid"), ("6", "expected")];
    names
        .into_iter()
        .fold(svg.to_string(), |svg, (number, name)| svg.replace(&format!("#0{number}0000"), &format!("var(--{name})")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> Chart {
        Chart {
            x_label: "time, s",
            y_label: "camera height, m",
            series: vec![Series { colour: 0, dots: false, points }],
            expected: Some(1.3),
            least_span: 0.2,
            from_zero: false,
        }
    }

    #[test]
    fn labels_have_no_digits_to_spare() {
        for (value, text) in
            [(0.0, "0"), (-1.0e-9, "0"), (1.5, "1.5"), (200.0, "200"), (-0.25, "-0.25"), (0.1 + 0.2, "0.3")]
        {
            assert_eq!(short(&value), text);
        }
    }

    #[test]
    fn charts_of_any_values_are_drawn() {
        let svg = chart((0..50).map(|i| (f64::from(i), 1.2 + 0.01 * f64::from(i % 7))).collect()).svg((560, 240));
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        assert!(svg.contains("camera height, m") && svg.contains("var(--c0)") && svg.contains("var(--expected)"));
        assert!(!svg.contains("#010000"), "a stand-in colour is left");
        assert_eq!(chart(vec![]).svg((560, 240)), "");
        for points in [vec![(0.0, 1.0)], vec![(0.0, f64::NAN), (1.0, 1.0)], vec![(5.0, 1.0e9), (5.0, -1.0e9)]] {
            assert!(chart(points.clone()).svg((560, 240)).contains("<svg"), "{points:?}");
        }
    }
}
