//! Axes with round numbers.

use super::svg::{Anchor, Svg};

/// A rectangle of the drawing and the numbers along its sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axes {
    /// Left and right of the rectangle, units.
    pub across: [f64; 2],
    /// Top and bottom of the rectangle, units.
    pub down: [f64; 2],
    /// Numbers at left and right.
    pub x: [f64; 2],
    /// Numbers at bottom and top.
    pub y: [f64; 2],
}

impl Axes {
    /// Where a pair of numbers is drawn.
    pub fn at(&self, x: f64, y: f64) -> [f64; 2] {
        let share = |value: f64, [from, to]: [f64; 2]| (value - from) / (to - from);
        let [left, right] = self.across;
        let [top, bottom] = self.down;
        [
            left + (right - left) * share(x, self.x),
            bottom + (top - bottom) * share(y, self.y),
        ]
    }

    /// Frame, ticks along x and their numbers.
    pub fn draw_x(&self, svg: &mut Svg, label: &str) {
        self.draw_x_at(svg, label, &ticks(self.x, 6));
    }

    /// The same with ticks of one's own.
    pub fn draw_x_at(&self, svg: &mut Svg, label: &str, ticks: &[Tick]) {
        let [left, right] = self.across;
        let [_, bottom] = self.down;
        svg.line("axis", [left, bottom], [right, bottom]);
        for tick in ticks {
            let [x, _] = self.at(tick.value, self.y[0]);
            svg.line("axis", [x, bottom], [x, bottom + 4.0]);
            svg.text("tick", [x, bottom + 15.0], Anchor::Middle, &tick.text);
        }
        svg.text(
            "label",
            [f64::midpoint(left, right), bottom + 30.0],
            Anchor::Middle,
            label,
        );
    }

    /// Lines across at round numbers of y, with the numbers.
    pub fn draw_y(&self, svg: &mut Svg, ticks: &[Tick]) {
        let [left, right] = self.across;
        for tick in ticks {
            let [_, y] = self.at(self.x[0], tick.value);
            svg.line("grid", [left, y], [right, y]);
            svg.text("tick", [left - 5.0, y + 4.0], Anchor::End, &tick.text);
        }
    }
}

/// A round number on an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// Where.
    pub value: f64,
    /// What stands there.
    pub text: String,
}

/// About `count` round numbers in a range, all with the same number of decimals.
pub fn ticks([from, to]: [f64; 2], count: usize) -> Vec<Tick> {
    let raw = (to - from) / count.max(1) as f64;
    if !(raw.is_finite() && raw > 0.0) {
        return Vec::new();
    }
    let power = raw.log10().floor();
    let unit = 10f64.powf(power);
    let (factor, extra_decimals) = match raw / unit {
        r if r <= 1.0 => (1.0, 0),
        r if r <= 2.0 => (2.0, 0),
        r if r <= 5.0 => (5.0, 0),
        _ => (10.0, -1),
    };
    let step = factor * unit;
    let decimals = (-(power as i32) + extra_decimals).max(0) as usize;
    let first = (from / step - 1e-9).ceil() as i64;
    let last = (to / step + 1e-9).floor() as i64;
    (first..=last)
        .map(|k| Tick {
            value: k as f64 * step,
            text: format!("{:.decimals$}", k as f64 * step),
        })
        .collect()
}

/// The smallest of 1, 2, 5 times a power of ten that is not below `value`.
pub fn round_up(value: f64) -> f64 {
    if !(value.is_finite() && value > 0.0) {
        return 1.0;
    }
    let unit = 10f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|factor| factor * unit)
        .find(|rounded| *rounded >= value * (1.0 - 1e-9))
        .unwrap_or(value)
}

/// Powers of ten, few enough to stand apart.
pub fn decades(from: i32, to: i32) -> Vec<Tick> {
    let every = ((to - from) / 6 + 1) as usize;
    (from..=to)
        .step_by(every)
        .map(|power| Tick {
            value: f64::from(power),
            text: format!("1e{power}"),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(range: [f64; 2], count: usize) -> Vec<String> {
        ticks(range, count).into_iter().map(|t| t.text).collect()
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(
            texts([0.0, 0.5], 5),
            ["0.0", "0.1", "0.2", "0.3", "0.4", "0.5"]
        );
        assert_eq!(texts([-3.0, 3.0], 3), ["-2", "0", "2"]);
        assert_eq!(texts([0.0, 1900.0], 4), ["0", "500", "1000", "1500"]);
        assert_eq!(
            texts([0.0, 0.07], 7),
            [
                "0.00", "0.01", "0.02", "0.03", "0.04", "0.05", "0.06", "0.07"
            ]
        );
        assert!(ticks([1.0, 1.0], 5).is_empty());
        assert!(ticks([0.0, f64::NAN], 5).is_empty());
    }

    #[test]
    fn limits_are_rounded_up() {
        assert_eq!(round_up(0.3), 0.5);
        assert_eq!(round_up(1.0), 1.0);
        assert_eq!(round_up(51.0), 100.0);
        assert_eq!(round_up(0.0), 1.0);
    }
}
