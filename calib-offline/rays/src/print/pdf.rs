//! A drawing as PDF at true size: one page, filled paths.

use crate::print::artwork::{Artwork, Shape};
use crate::print::svg::number;
use std::fmt::Write as _;

/// Points of PDF (a 72nd of an inch) per millimeter.
const PT_PER_MM: f64 = 72.0 / 25.4;
/// Handle of the Bezier curve of a quarter circle of radius 1: the curve is off by 2.7e-4 of the radius
/// at most.
const HANDLE: f64 = 0.552_284_749_831;

/// The document.
pub fn document(art: &Artwork) -> Vec<u8> {
    let [left, right, upper, lower] = art.plate_mm;
    let (width, height) = (right - left, lower - upper);
    // Millimeters from the upper left, y down.
    let mut paint = format!(
        "{0} 0 0 -{0} 0 {1} cm\n",
        number(PT_PER_MM),
        number(height * PT_PER_MM)
    );
    for shape in &art.shapes {
        draw(&mut paint, shape, [left, upper]);
    }
    let media = format!(
        "[0 0 {} {}]",
        number(width * PT_PER_MM),
        number(height * PT_PER_MM)
    );
    let objects = [
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
        format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox {media} /Contents 4 0 R /Resources << >> >>"
        ),
        format!("<< /Length {} >>\nstream\n{paint}endstream", paint.len()),
    ];
    let mut text = String::from("%PDF-1.4\n");
    let mut places = Vec::new();
    for (k, object) in objects.iter().enumerate() {
        places.push(text.len());
        let _ = write!(text, "{} 0 obj\n{object}\nendobj\n", k + 1);
    }
    let table = text.len();
    let count = objects.len() + 1;
    let _ = write!(text, "xref\n0 {count}\n0000000000 65535 f \n");
    for place in places {
        // Twenty bytes: a space stands before the line's end.
        let _ = writeln!(text, "{place:010} 00000 n ");
    }
    let _ = write!(
        text,
        "trailer\n<< /Size {count} /Root 1 0 R >>\nstartxref\n{table}\n%%EOF\n"
    );
    text.into_bytes()
}

fn draw(paint: &mut String, shape: &Shape, [left, upper]: [f64; 2]) {
    let gray = |black: bool| if black { "0 g" } else { "1 g" };
    // Writing to a string does not fail.
    let _ = match *shape {
        Shape::Rect { from, to, black } => writeln!(
            paint,
            "{} {} {} {} {} re f",
            gray(black),
            number(from[0] - left),
            number(from[1] - upper),
            number(to[0] - from[0]),
            number(to[1] - from[1])
        ),
        Shape::Disk { at, radius, black } => {
            let point = |x: f64, y: f64| {
                format!(
                    "{} {}",
                    number(at[0] - left + x * radius),
                    number(at[1] - upper + y * radius)
                )
            };
            let mut path = format!("{} {} m", gray(black), point(1.0, 0.0));
            let (mut x, mut y) = (1.0, 0.0);
            for _ in 0..4 {
                // A quarter turn: from (x, y) to (-y, x).
                let (next_x, next_y) = (-y, x);
                let _ = write!(
                    path,
                    " {} {} {} c",
                    point(x + HANDLE * next_x, y + HANDLE * next_y),
                    point(next_x + HANDLE * x, next_y + HANDLE * y),
                    point(next_x, next_y)
                );
                (x, y) = (next_x, next_y);
            }
            writeln!(paint, "{path} f")
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_points_to_the_objects() {
        let art = Artwork::new(
            [0.0, 254.0, 0.0, 127.0],
            vec![Shape::Disk {
                at: [50.0, 50.0],
                radius: 10.0,
                black: true,
            }],
        );
        let bytes = document(&art);
        let text = String::from_utf8(bytes).unwrap();
        assert!(text.contains("/MediaBox [0 0 720 360]"));
        let table: usize = text
            .lines()
            .skip_while(|line| *line != "startxref")
            .nth(1)
            .unwrap()
            .parse()
            .unwrap();
        assert!(text[table..].starts_with("xref"));
        for (k, line) in text[table..].lines().skip(3).take(4).enumerate() {
            let place: usize = line[..10].parse().unwrap();
            assert!(text[place..].starts_with(&format!("{} 0 obj", k + 1)));
        }
    }
}
