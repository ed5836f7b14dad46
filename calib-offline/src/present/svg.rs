//! A drawing as text: just the elements that the figures need.

use std::fmt::Write as _;

/// Of drawings that stand alone: plain colors, since not every viewer knows variables.
const STYLE: &str = include_str!("figure.css");

/// Where a text stands relative to its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// It begins there.
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

/// A drawing in the making; y points down, units as in the view box.
#[derive(Debug, Clone)]
pub struct Svg {
    width: f64,
    height: f64,
    body: String,
}

impl Svg {
    /// An empty drawing.
    pub fn new(width: f64, height: f64) -> Self {
        Self {
            width,
            height,
            body: String::new(),
        }
    }

    /// A straight line.
    pub fn line(&mut self, class: &str, from: [f64; 2], to: [f64; 2]) {
        self.path(class, &format!("M{}L{}", point(from), point(to)));
    }

    /// Lines from point to point.
    pub fn polyline(&mut self, class: &str, points: &[[f64; 2]]) {
        self.path(class, &lines(points));
    }

    /// A closed area.
    pub fn polygon(&mut self, class: &str, points: &[[f64; 2]]) {
        self.path(class, &format!("{}Z", lines(points)));
    }

    /// Anything that a path can say.
    pub fn path(&mut self, class: &str, data: &str) {
        // Writing to a String cannot fail.
        let _ = writeln!(self.body, "<path class=\"{class}\" d=\"{data}\"/>");
    }

    /// A rectangle by its top left corner.
    pub fn rect(&mut self, class: &str, [x, y]: [f64; 2], [width, height]: [f64; 2]) {
        let _ = writeln!(
            self.body,
            "<rect class=\"{class}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>",
            number(x),
            number(y),
            number(width),
            number(height)
        );
    }

    /// A circle.
    pub fn circle(&mut self, class: &str, [x, y]: [f64; 2], radius: f64) {
        let _ = writeln!(
            self.body,
            "<circle class=\"{class}\" cx=\"{}\" cy=\"{}\" r=\"{}\"/>",
            number(x),
            number(y),
            number(radius)
        );
    }

    /// A text on one line.
    pub fn text(&mut self, class: &str, [x, y]: [f64; 2], anchor: Anchor, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let _ = writeln!(
            self.body,
            "<text class=\"{class}\" x=\"{}\" y=\"{}\" text-anchor=\"{anchor}\">{}</text>",
            number(x),
            number(y),
            escaped(text)
        );
    }

    /// The drawing; `label` is what is read out in its place.
    pub fn finish(self, label: &str) -> String {
        format!(
            "<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">\n{}</svg>",
            number(self.width),
            number(self.height),
            escaped(label),
            self.body
        )
    }

    /// The drawing as a file of its own, with its style.
    pub fn finish_alone(self, label: &str) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" role=\"img\" aria-label=\"{}\">\n<style>\n{STYLE}</style>\n{}</svg>\n",
            escaped(label),
            self.body,
            w = number(self.width),
            h = number(self.height),
        )
    }
}

/// Path data through the points.
pub fn lines(points: &[[f64; 2]]) -> String {
    points
        .iter()
        .enumerate()
        .fold(String::new(), |data, (k, p)| {
            data + if k == 0 { "M" } else { "L" } + &point(*p)
        })
}

/// A point as path data.
pub fn point([x, y]: [f64; 2]) -> String {
    format!("{} {}", number(x), number(y))
}

/// A tenth of a unit is finer than any screen; what is not finite would break the drawing.
fn number(value: f64) -> String {
    if !value.is_finite() {
        return "0".to_owned();
    }
    let rounded = (value * 10.0).round() / 10.0;
    // Without the sign of a zero.
    format!("{}", rounded + 0.0)
}

fn escaped(text: &str) -> String {
    text.chars().fold(String::new(), |mut out, c| {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
        out
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_escaped_and_numbers_are_short() {
        let mut svg = Svg::new(10.0, 5.25);
        svg.text("t", [1.0 / 3.0, -0.01], Anchor::End, "a<b & \"c\"");
        svg.line("l", [f64::NAN, 1.0], [2.0, f64::INFINITY]);
        let drawing = svg.finish("x>y");
        assert!(drawing.contains("viewBox=\"0 0 10 5.3\""));
        assert!(drawing.contains("x=\"0.3\" y=\"0\""), "{drawing}");
        assert!(drawing.contains("a&lt;b &amp; &quot;c&quot;"));
        assert!(drawing.contains("d=\"M0 1L2 0\""));
    }
}
