//! Cameras and boards in space, seen aslant and from above.

use super::{Figure, WIDTH};
use crate::present::numbers::short;
use crate::present::svg::{Anchor, Svg};
use crate::report::Calibration;
use calib_rays::geometry::{PixelPoint, RigidTransform};
use nalgebra::{Matrix2x3, Vector2, Vector3};

/// Room around the drawing, units.
const MARGIN: f64 = 26.0;
/// Tallest drawing, units.
const MAX_HEIGHT: f64 = 360.0;

/// Two drawings of the same things.
pub fn draw(calibration: &Calibration) -> Vec<Figure> {
    // Rows give drawing x (right) and y (down) from rig x (right), y (down), z (away).
    let (sin, cos) = 0.6f64.sin_cos();
    let (tilt_sin, tilt_cos) = 0.45f64.sin_cos();
    let aslant = Matrix2x3::new(cos, 0.0, sin, sin * tilt_sin, tilt_cos, -cos * tilt_sin);
    let from_above = Matrix2x3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    [("Seen aslant", aslant), ("Seen from above", from_above)]
        .into_iter()
        .map(|(title, projection)| draw_one(calibration, title, &projection))
        .collect()
}

/// Something to draw, rig frame, mm.
struct Shape {
    class: String,
    points: Vec<Vector3<f64>>,
    label: Option<String>,
}

fn draw_one(calibration: &Calibration, title: &str, projection: &Matrix2x3<f64>) -> Figure {
    let shapes = shapes(calibration);
    let flat = |p: &Vector3<f64>| projection * p;
    let (mut least, mut most) = (
        Vector2::repeat(f64::INFINITY),
        Vector2::repeat(f64::NEG_INFINITY),
    );
    for point in shapes.iter().flat_map(|s| &s.points) {
        let p = flat(point);
        if p.iter().all(|v| v.is_finite()) {
            least = least.inf(&p);
            most = most.sup(&p);
        }
    }
    let extent = (most - least).map(|v| if v.is_finite() { v.max(1.0) } else { 1.0 });
    let units_per_mm =
        ((WIDTH - 2.0 * MARGIN) / extent.x).min((MAX_HEIGHT - 2.0 * MARGIN) / extent.y);
    let height = extent.y * units_per_mm + 2.0 * MARGIN + 14.0;
    let left = (WIDTH - extent.x * units_per_mm) / 2.0;
    let at = |p: &Vector3<f64>| {
        let p = (flat(p) - least) * units_per_mm;
        [left + p.x, MARGIN + p.y]
    };
    let mut svg = Svg::new(WIDTH, height);
    for shape in &shapes {
        let points: Vec<[f64; 2]> = shape.points.iter().map(at).collect();
        if points.len() == 2 {
            svg.polyline(&shape.class, &points);
        } else {
            svg.polygon(&shape.class, &points);
        }
    }
    for shape in &shapes {
        if let (Some(label), Some(point)) = (&shape.label, shape.points.first()) {
            let [x, y] = at(point);
            svg.text("tick halo", [x, y + 14.0], Anchor::Middle, label);
        }
    }
    let bar_mm = scale_bar_mm(80.0 / units_per_mm);
    let y = height - 8.0;
    svg.line("arrow", [8.0, y], [8.0 + bar_mm * units_per_mm, y]);
    svg.text(
        "tick",
        [14.0 + bar_mm * units_per_mm, y + 4.0],
        Anchor::Start,
        &format!("{bar_mm} mm"),
    );
    let axes = match calibration.stage_axes.len() {
        0 => String::new(),
        1 => " The dashed line is the stage's axis.".to_owned(),
        count => format!(" The {count} dashed lines are the stage's axes, one per placement."),
    };
    Figure {
        title: title.to_owned(),
        svg: svg.finish(&format!("Cameras and boards: {title}")),
        caption: format!(
            "{} boards (outline of the inner corners; pose {} stands out{}), {} cameras with what they see to a quarter of the way.{axes}",
            calibration.poses.len(),
            calibration.rig.datum_pose,
            if calibration.rig.frame_is_known {
                ""
            } else {
                ": it is the rig frame"
            },
            calibration.rig.cameras.len()
        ),
    }
}

fn shapes(calibration: &Calibration) -> Vec<Shape> {
    let outline = calibration.board.outline_in_board();
    let board = |rig_from_board: &RigidTransform, class: &str| Shape {
        class: class.to_owned(),
        points: outline
            .iter()
            .map(|corner| rig_from_board.point(corner))
            .collect(),
        label: None,
    };
    let mut shapes: Vec<Shape> = calibration
        .poses
        .iter()
        .map(|pose| board(&pose.rig_from_board, "board"))
        .collect();
    let datum = calibration
        .poses
        .iter()
        .find(|pose| pose.pose == calibration.rig.datum_pose);
    shapes.extend(datum.map(|pose| board(&pose.rig_from_board, "board datum")));
    let center = calibration.board.center_in_board();
    let middle = calibration
        .poses
        .iter()
        .map(|pose| pose.rig_from_board.point(&center))
        .sum::<Vector3<f64>>()
        / calibration.poses.len().max(1) as f64;
    // Drawn beside the boards, a little longer than one is tall.
    let (width_mm, height_mm) = calibration.board.extent_mm();
    let half_mm = 0.7 * width_mm.max(height_mm);
    shapes.extend(calibration.stage_axes.iter().map(|axis| {
        let beside = axis.point_mm + axis.direction * (middle - axis.point_mm).dot(&axis.direction);
        Shape {
            class: "stage".to_owned(),
            points: vec![
                beside - axis.direction * half_mm,
                beside + axis.direction * half_mm,
            ],
            label: None,
        }
    }));
    for camera in &calibration.rig.cameras {
        let origin = camera.rig_from_camera.translation_mm;
        let reach_mm = (center - origin).norm() / 4.0;
        let sensor = camera.field.sensor;
        let (u, v) = (f64::from(sensor.width), f64::from(sensor.height));
        let corners = [(0.0, 0.0), (u, 0.0), (u, v), (0.0, v)].map(|(u, v)| {
            let direction = camera
                .field
                .ray(PixelPoint::new(u - 0.5, v - 0.5))
                .transformed(&camera.rig_from_camera)
                .direction;
            origin + direction.normalize() * reach_mm
        });
        for k in 0..4 {
            shapes.push(Shape {
                class: "camera".to_owned(),
                points: vec![origin, corners[k], corners[(k + 1) % 4]],
                label: (k == 0).then(|| camera.name.clone()),
            });
        }
    }
    shapes
}

/// The largest of 1, 2, 5 times a power of ten that is not above `value`.
fn scale_bar_mm(value: f64) -> f64 {
    let unit = 10f64.powf(value.log10().floor());
    let bar = [5.0, 2.0, 1.0]
        .into_iter()
        .map(|factor| factor * unit)
        .find(|bar| *bar <= value * (1.0 + 1e-9))
        .unwrap_or(unit);
    short(bar).parse().unwrap_or(bar)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_bars_are_round() {
        assert_eq!(scale_bar_mm(70.0), 50.0);
        assert_eq!(scale_bar_mm(2000.0), 2000.0);
        assert_eq!(scale_bar_mm(0.13), 0.1);
    }
}
