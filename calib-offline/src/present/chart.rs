//! Several series over common axes with a legend, panels beside each other: a figure that stands in
//! a file of its own.

use super::axes::{Axes, Tick, ticks};
use super::svg::{Anchor, Svg};

/// Colors of the figures' style sheet.
pub const COLORS: usize = 5;
/// Width and height of a panel's plot, units.
pub const PLOT: [f64; 2] = [348.0, 220.0];
/// Room left and right of a plot, units.
const SIDES: [f64; 2] = [56.0, 16.0];
/// Room for a panel's title, for a line of its legend, and below its plot, units.
const TITLE: f64 = 20.0;
const LEGEND_LINE: f64 = 15.0;
const BELOW: f64 = 42.0;
/// Panels beside each other.
const COLUMNS: usize = 2;
/// About how wide a letter is, units.
const LETTER: f64 = 5.7;
/// Length of a series' sample in the legend, units.
const SAMPLE: f64 = 18.0;

/// How the points of a series are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A line through them.
    Line,
    /// A dashed line through them.
    Dashed,
    /// A dot each.
    Dots,
    /// Dots with a line through them.
    LineDots,
    /// A ring each.
    Rings,
}

/// Points that belong together.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// What the legend says; a series without a name is not in it.
    pub name: String,
    /// Which of [`COLORS`].
    pub color: usize,
    /// How it is shown.
    pub mark: Mark,
    /// x and y of each point.
    pub points: Vec<[f64; 2]>,
}

/// How numbers become lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Equal differences are equally long.
    Linear,
    /// Equal ratios are equally long.
    Logarithmic,
}

/// An axis of a panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// What it shows, with its unit.
    pub label: String,
    /// How.
    pub scale: Scale,
    /// From where to where; `None` takes what the points need.
    pub range: Option<[f64; 2]>,
}

/// One plot of a figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Above it.
    pub title: String,
    /// Across.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// What is shown.
    pub series: Vec<Series>,
    /// Upright lines at some x, with a word each.
    pub marks: Vec<(f64, String)>,
}

impl Axis {
    /// A linear axis as long as the points need.
    pub fn linear(label: &str) -> Self {
        Self {
            label: label.to_owned(),
            scale: Scale::Linear,
            range: None,
        }
    }

    /// A logarithmic one.
    pub fn logarithmic(label: &str) -> Self {
        Self {
            scale: Scale::Logarithmic,
            ..Self::linear(label)
        }
    }

    fn place(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => value,
            Scale::Logarithmic => value.log10(),
        }
    }

    /// The places at both ends. A linear axis of errors begins at zero.
    fn ends(&self, values: impl Iterator<Item = f64>, upwards: bool) -> [f64; 2] {
        if let Some([from, to]) = self.range {
            return [self.place(from), self.place(to)];
        }
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for place in values.map(|v| self.place(v)).filter(|p| p.is_finite()) {
            least = least.min(place);
            most = most.max(place);
        }
        if least > most {
            return [0.0, 1.0];
        }
        let room = 0.06 * (most - least).max(1e-9 * most.abs()).max(1e-12);
        if upwards && self.scale == Scale::Linear && least >= 0.0 {
            [0.0, (most + room).max(1e-12)]
        } else {
            [least - room, most + room]
        }
    }

    fn ticks(&self, ends: [f64; 2]) -> Vec<Tick> {
        if self.scale == Scale::Linear {
            return ticks(ends, 5);
        }
        let steps: &[f64] = match ends[1] - ends[0] {
            span if span > 3.5 => &[1.0],
            span if span > 1.7 => &[1.0, 3.0],
            _ => &[1.0, 2.0, 5.0],
        };
        let powers = ends[0].floor() as i32..=ends[1].ceil() as i32;
        powers
            .flat_map(|power| steps.iter().map(move |step| (power, *step)))
            .filter_map(|(power, step)| {
                let value = step * 10f64.powi(power);
                let place = value.log10();
                let decimals = (-power).max(0) as usize;
                (place >= ends[0] - 1e-9 && place <= ends[1] + 1e-9).then(|| Tick {
                    value: place,
                    text: format!("{value:.decimals$}"),
                })
            })
            .collect()
    }
}

/// The figure as the text of a file; `label` is read out in its place.
pub fn draw(panels: &[Panel], label: &str) -> String {
    let legend_lines = panels.iter().map(|p| legend(p).1).max().unwrap_or(0);
    let above = TITLE + LEGEND_LINE * (legend_lines + 1) as f64;
    let size = [SIDES[0] + PLOT[0] + SIDES[1], above + PLOT[1] + BELOW];
    let columns = panels.len().clamp(1, COLUMNS);
    let rows = panels.len().div_ceil(COLUMNS).max(1);
    let [width, height] = [size[0] * columns as f64, size[1] * rows as f64];
    let mut svg = Svg::new(width, height);
    svg.rect("ground", [0.0, 0.0], [width, height]);
    for (k, panel) in panels.iter().enumerate() {
        let corner = [
            size[0] * (k % COLUMNS) as f64,
            size[1] * (k / COLUMNS) as f64,
        ];
        draw_panel(&mut svg, panel, corner, above);
    }
    svg.finish_alone(label)
}

/// Per named series: its place in the legend; and how many lines that takes.
fn legend(panel: &Panel) -> (Vec<(&Series, f64, usize)>, usize) {
    let (mut x, mut line) = (0.0, 0);
    let mut places = Vec::new();
    for series in panel.series.iter().filter(|s| !s.name.is_empty()) {
        let width = SAMPLE + 6.0 + LETTER * series.name.chars().count() as f64 + 12.0;
        if x > 0.0 && x + width > PLOT[0] + SIDES[1] {
            (x, line) = (0.0, line + 1);
        }
        places.push((series, x, line));
        x += width;
    }
    let lines = if places.is_empty() { 0 } else { line + 1 };
    (places, lines)
}

fn draw_panel(svg: &mut Svg, panel: &Panel, [left, top]: [f64; 2], above: f64) {
    let points = || panel.series.iter().flat_map(|s| &s.points);
    let x = panel.x.ends(points().map(|p| p[0]), false);
    let y = panel.y.ends(points().map(|p| p[1]), true);
    let axes = Axes {
        across: [left + SIDES[0], left + SIDES[0] + PLOT[0]],
        down: [top + above, top + above + PLOT[1]],
        x,
        y,
    };
    let start = axes.across[0];
    svg.text("title", [start, top + 14.0], Anchor::Start, &panel.title);
    for (series, x, line) in legend(panel).0 {
        let y = top + TITLE + LEGEND_LINE * line as f64 + 8.0;
        let from = start + x;
        let sample = [[from, y - 4.0], [from + SAMPLE, y - 4.0]];
        match series.mark {
            Mark::Line | Mark::Dashed => draw_points(svg, series, &sample),
            Mark::LineDots => {
                draw_points(svg, &lined(series), &sample);
                draw_points(svg, series, &[middle(sample)]);
            }
            Mark::Dots | Mark::Rings => draw_points(svg, series, &[middle(sample)]),
        }
        svg.text(
            "label",
            [from + SAMPLE + 5.0, y],
            Anchor::Start,
            &series.name,
        );
    }
    svg.text(
        "label",
        [left + 6.0, axes.down[0] - 7.0],
        Anchor::Start,
        &panel.y.label,
    );
    axes.draw_y(svg, &panel.y.ticks(y));
    for (k, (value, word)) in panel.marks.iter().enumerate() {
        let [x, _] = axes.at(panel.x.place(*value), y[0]);
        svg.line("mark", [x, axes.down[0]], [x, axes.down[1]]);
        // Words beside their line, one below the other, on the side with more room.
        let is_right = x > axes.across[0] + 0.65 * PLOT[0];
        let (anchor, dx) = if is_right {
            (Anchor::End, -4.0)
        } else {
            (Anchor::Start, 4.0)
        };
        let y = axes.down[0] + 12.0 + 13.0 * k as f64;
        svg.text("label", [x + dx, y], anchor, word);
    }
    for series in &panel.series {
        let drawn: Vec<[f64; 2]> = series
            .points
            .iter()
            .map(|p| [panel.x.place(p[0]), panel.y.place(p[1])])
            .filter(|p| p.iter().all(|v| v.is_finite()))
            .map(|p| axes.at(p[0], p[1]))
            .collect();
        draw_points(svg, series, &drawn);
    }
    axes.draw_x_at(svg, &panel.x.label, &panel.x.ticks(x));
}

fn lined(series: &Series) -> Series {
    Series {
        mark: Mark::Line,
        ..series.clone()
    }
}

fn middle([a, b]: [[f64; 2]; 2]) -> [f64; 2] {
    [f64::midpoint(a[0], b[0]), f64::midpoint(a[1], b[1])]
}

fn draw_points(svg: &mut Svg, series: &Series, drawn: &[[f64; 2]]) {
    let color = series.color % COLORS;
    if matches!(series.mark, Mark::Line | Mark::LineDots) && drawn.len() > 1 {
        svg.polyline(&format!("s k{color}"), drawn);
    }
    match series.mark {
        Mark::Line => {}
        Mark::Dashed => svg.polyline(&format!("s dashed k{color}"), drawn),
        Mark::Dots | Mark::LineDots => {
            for point in drawn {
                svg.circle(&format!("f k{color}"), *point, 2.2);
            }
        }
        Mark::Rings => {
            for point in drawn {
                svg.circle(&format!("r k{color}"), *point, 3.4);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_series_is_drawn_and_named() {
        let series = |name: &str, mark, color| Series {
            name: name.to_owned(),
            color,
            mark,
            points: vec![[1.0, 0.02], [10.0, 0.5], [100.0, f64::NAN]],
        };
        let panel = Panel {
            title: "t".to_owned(),
            x: Axis::logarithmic("spread, px"),
            y: Axis::linear("error, mm"),
            series: vec![
                series("one", Mark::Line, 0),
                series("two", Mark::Dots, 1),
                series("", Mark::Rings, 2),
            ],
            marks: vec![(10.0, "here".to_owned())],
        };
        let text = draw(&[panel.clone(), panel], "two panels");
        assert!(text.starts_with("<svg xmlns="));
        for part in [
            ">one<",
            ">two<",
            ">spread, px<",
            ">error, mm<",
            ">here<",
            ">10<",
        ] {
            assert_eq!(text.matches(part).count(), 2, "{part}");
        }
        // A line has one path in its plot and one in the legend, per panel.
        assert_eq!(text.matches("class=\"s k0\"").count(), 4);
        // Two points that are numbers, and the legend's.
        assert_eq!(text.matches("class=\"f k1\"").count(), 6);
        assert!(!text.contains("NaN"));
    }

    #[test]
    fn logarithmic_ticks_are_round() {
        let axis = Axis::logarithmic("x");
        let texts = |ends: [f64; 2]| -> Vec<String> {
            axis.ticks(ends).into_iter().map(|t| t.text).collect()
        };
        assert_eq!(texts([2.0, 3.0]), ["100", "200", "500", "1000"]);
        assert_eq!(texts([-2.0, 0.0]), ["0.01", "0.03", "0.1", "0.3", "1"]);
    }
}
