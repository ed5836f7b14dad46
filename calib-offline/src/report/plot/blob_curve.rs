//! Bytes of a blob's tables against the error of its rays.

use super::{Figure, WIDTH};
use crate::present::axes::{Axes, Tick, decades};
use crate::present::numbers::short;
use crate::present::svg::Svg;
use crate::report::BlobFacts;

/// One drawing, both axes logarithmic; the bound asked for is a line across.
pub fn draw(blob: &BlobFacts) -> Option<Figure> {
    let usable = |error: f64| error > 0.0 && error.is_finite();
    let points: Vec<[f64; 2]> = blob
        .curve
        .iter()
        .filter(|point| usable(point.error_px) && point.bytes > 0)
        .map(|point| [(point.bytes as f64).log10(), point.error_px.log10()])
        .collect();
    let ([first, .., last], [smallest, .., largest]) = (&points[..], &blob.curve[..]) else {
        return None;
    };
    let wanted = blob.wanted_error_px.log10();
    let (top, bottom) = (first[1].max(wanted).ceil(), last[1].min(wanted).floor());
    let axes = Axes {
        across: [48.0, WIDTH - 18.0],
        down: [10.0, 190.0],
        x: [first[0] - 0.05, last[0] + 0.05],
        y: [bottom, top],
    };
    let mut svg = Svg::new(WIDTH, 226.0);
    axes.draw_y(&mut svg, &decades(bottom as i32, top as i32));
    let drawn: Vec<[f64; 2]> = points.iter().map(|[x, y]| axes.at(*x, *y)).collect();
    svg.line(
        "limit",
        axes.at(axes.x[0], wanted),
        axes.at(axes.x[1], wanted),
    );
    svg.polyline("curve", &drawn);
    for point in &drawn {
        svg.circle("bar c0", *point, 2.5);
    }
    axes.draw_x_at(&mut svg, "bytes of all tables", &byte_ticks(axes.x));
    let in_words = |point: &calib_blob::pack::CurvePoint| {
        format!(
            "{} bytes: {} px, {} mm at the working distance",
            point.bytes,
            short(point.error_px),
            short(point.error_mm)
        )
    };
    Some(Figure {
        title: "Bytes and error".to_owned(),
        svg: svg.finish("Largest error of a ray, px, against the bytes of the tables"),
        caption: format!(
            "Largest error of a ray, px, on a sample of the pixels; the line across is the bound asked for. {}; {}.",
            in_words(smallest),
            in_words(largest)
        ),
    })
}

/// 1, 2 and 5 times the powers of ten between two logarithms.
fn byte_ticks([from, to]: [f64; 2]) -> Vec<Tick> {
    (from.floor() as i32..=to.ceil() as i32)
        .flat_map(|power| [1.0, 2.0, 5.0].map(|step| step * 10f64.powi(power)))
        .filter(|bytes| (from..=to).contains(&bytes.log10()))
        .map(|bytes| Tick {
            value: bytes.log10(),
            text: format!("{bytes:.0}"),
        })
        .collect()
}
