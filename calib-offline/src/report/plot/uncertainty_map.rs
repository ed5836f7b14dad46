//! How uncertain a point is, over the first camera's image, for points at the working distance:
//! what the calibration leaves open, and that with the noise of one pair of pixels.

use super::coverage::SensorView;
use super::{Figure, WIDTH};
use crate::present::numbers::short;
use crate::present::svg::{Anchor, Svg, point};
use crate::report::Calibration;
use crate::report::facts::Facts;
use calib_rays::field::{CalibratedCamera, PairUncertainty, PointCovariance};
use calib_rays::geometry::PixelPoint;
use nalgebra::Matrix3;
use std::fmt::Write as _;

/// Classes of the style sheet, from certain to uncertain.
const CLASSES: usize = 8;
/// The last class begins below this share of the cells and has no upper end: a few cells at the
/// border would else take all classes for themselves.
const SCALE_SHARE: f64 = 0.95;
/// Room for the legend below a map, units.
const FOOT: f64 = 42.0;
/// Height of the legend's boxes, units.
const BOX_HEIGHT: f64 = 12.0;

/// Two drawings for each pair whose uncertainty is known.
pub fn draw(calibration: &Calibration) -> Vec<Figure> {
    let Some(distance) = Facts::of(calibration).working_distance_mm else {
        return Vec::new();
    };
    let pairs = calibration.rig.uncertainty.iter();
    pairs
        .flat_map(|pair| draw_pair(calibration, pair, distance.median))
        .collect()
}

/// A cell of the calibrated area whose point both cameras see.
struct Cell {
    /// Column and row in the mask.
    place: [usize; 2],
    covariance: PointCovariance,
}

fn draw_pair(calibration: &Calibration, pair: &PairUncertainty, distance_mm: f64) -> Vec<Figure> {
    let cameras = &calibration.rig.cameras;
    let (Some(first), Some(second)) = (cameras.get(pair.first), cameras.get(pair.second)) else {
        return Vec::new();
    };
    let cells = cells(calibration, pair, [first, second], distance_mm);
    let names = format!("{} and {}", first.name, second.name);
    [
        (
            "calibration alone",
            "what averaging many measurements does not take away",
            (|c: &PointCovariance| c.calibration_mm2) as fn(&PointCovariance) -> Matrix3<f64>,
        ),
        (
            "calibration and pixel noise",
            "what one measurement has",
            PointCovariance::total_mm2,
        ),
    ]
    .into_iter()
    .filter_map(|(title, meaning, part)| {
        let sigma_mm: Vec<f64> = cells
            .iter()
            .map(|cell| part(&cell.covariance).trace().max(0.0).sqrt())
            .collect();
        let figures = Figures::of(&sigma_mm)?;
        let title = format!("{names}: {title}");
        let svg = draw_map(first, &cells, &sigma_mm, &figures);
        Some(Figure {
            svg: svg.finish(&format!("Predicted standard deviation of points, {title}")),
            title,
            caption: format!(
                "Standard deviation of a point {distance_mm:.0} mm away, root of the sum over its \
                 three axes: {meaning}. Median {} mm, 95 % below {} mm, worst {} mm, over {} places \
                 on the image of {}.",
                short(figures.median),
                short(figures.most_below),
                short(figures.worst),
                sigma_mm.len(),
                first.name
            ),
        })
    })
    .collect()
}

fn cells(
    calibration: &Calibration,
    pair: &PairUncertainty,
    [first, second]: [&CalibratedCamera; 2],
    distance_mm: f64,
) -> Vec<Cell> {
    let mask = &first.coverage;
    let (width_px, height_px) = mask.cell_size_px();
    (0..mask.covered.len())
        .filter_map(|k| {
            let place = [k % mask.cells_u, k / mask.cells_u];
            let pixel = PixelPoint::new(
                (place[0] as f64 + 0.5) * width_px - 0.5,
                (place[1] as f64 + 0.5) * height_px - 0.5,
            );
            let (_, other) = first.seen_by(second, pixel, distance_mm)?;
            let sightings = [(pair.first, pixel), (pair.second, other)];
            let covariance = calibration.rig.pair_covariance(sightings)?;
            Some(Cell { place, covariance })
        })
        .collect()
}

/// The figures of a map, mm.
struct Figures {
    least: f64,
    median: f64,
    most_below: f64,
    worst: f64,
}

impl Figures {
    /// `None` without cells, or where one has no number.
    fn of(sigma_mm: &[f64]) -> Option<Self> {
        let mut sorted = sigma_mm.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let last = sorted.len().checked_sub(1)?;
            sorted.get((share * last as f64).round() as usize).copied()
        };
        let figures = Self {
            least: at(0.0)?,
            median: at(0.5)?,
            most_below: at(SCALE_SHARE)?,
            worst: at(1.0)?,
        };
        figures.worst.is_finite().then_some(figures)
    }

    /// Where a class begins, mm.
    fn start(&self, class: usize) -> f64 {
        self.least + (self.most_below - self.least) * class as f64 / CLASSES as f64
    }

    /// The class of a number; one for all where all are equal.
    fn class(&self, sigma_mm: f64) -> usize {
        let share = (sigma_mm - self.least) / (self.most_below - self.least);
        // Casts saturate, and what is no number becomes 0.
        ((share * CLASSES as f64) as usize).min(CLASSES - 1)
    }
}

fn draw_map(camera: &CalibratedCamera, cells: &[Cell], sigma_mm: &[f64], figures: &Figures) -> Svg {
    let view = SensorView::new(camera.field.sensor);
    let mut svg = Svg::new(WIDTH, view.height + FOOT);
    svg.rect("sensor", [0.0, 0.0], [WIDTH, view.height]);
    let (width_px, height_px) = camera.coverage.cell_size_px();
    let (width, height) = (width_px * view.units_per_px, height_px * view.units_per_px);
    let classes = sigma_mm.iter().map(|sigma_mm| figures.class(*sigma_mm));
    let placed: Vec<([usize; 2], usize)> =
        cells.iter().map(|cell| cell.place).zip(classes).collect();
    // One path a class, one rectangle per run of neighbors in a row.
    let mut paths = vec![String::new(); CLASSES];
    for run in placed.chunk_by(|(a, p), (b, q)| p == q && a[1] == b[1] && a[0] + 1 == b[0]) {
        let ([i, j], class) = run[0];
        let length = run.len() as f64 * width;
        // Writing to a String cannot fail.
        let _ = write!(
            paths[class],
            "M{}h{length:.1}v{height:.1}h-{length:.1}z",
            point([i as f64 * width, j as f64 * height])
        );
    }
    for (class, path) in paths
        .iter()
        .enumerate()
        .filter(|(_, path)| !path.is_empty())
    {
        svg.path(&format!("heat h{class}"), path);
    }
    draw_legend(&mut svg, view.height + 8.0, figures);
    svg
}

/// A box a class with where it begins; the last one ends at the worst.
fn draw_legend(svg: &mut Svg, top: f64, figures: &Figures) {
    let width = WIDTH / CLASSES as f64;
    let foot = top + BOX_HEIGHT + 13.0;
    for class in 0..CLASSES {
        let left = width * class as f64;
        svg.path(
            &format!("heat h{class}"),
            &format!(
                "M{}h{width:.1}v{BOX_HEIGHT:.1}h-{width:.1}z",
                point([left, top])
            ),
        );
        // The last but one would touch the worst.
        if class.is_multiple_of(2) && class + 2 < CLASSES {
            svg.text(
                "tick",
                [left, foot],
                Anchor::Start,
                &short(figures.start(class)),
            );
        }
    }
    let worst = format!("{} mm", short(figures.worst));
    svg.text("tick", [WIDTH, foot], Anchor::End, &worst);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::example;

    #[test]
    fn figures_are_quantiles_and_classes_span_them() {
        let sigma_mm: Vec<f64> = (0..=100).map(|k| 1.0 + f64::from(k) / 100.0).collect();
        let figures = Figures::of(&sigma_mm).unwrap();
        assert_eq!((figures.least, figures.median), (1.0, 1.5));
        assert_eq!((figures.most_below, figures.worst), (1.95, 2.0));
        assert_eq!(figures.class(1.0), 0);
        assert_eq!(figures.class(1.49), 4);
        assert_eq!((figures.class(1.94), figures.class(2.0)), (7, 7));
        assert!((figures.start(4) - 1.475).abs() < 1e-12);
        let equal = Figures::of(&[3.0; 5]).unwrap();
        assert_eq!(equal.class(3.0), 0);
        assert!(Figures::of(&[]).is_none());
        assert!(Figures::of(&[f64::NAN]).is_none());
    }

    #[test]
    fn the_example_has_two_maps_and_the_noise_makes_the_second_one_larger() {
        let calibration = example::calibration();
        let figures = draw(&calibration);
        assert_eq!(figures.len(), 2);
        let median = |figure: &Figure| -> f64 {
            let (_, rest) = figure.caption.split_once("Median ").unwrap();
            rest.split_once(" mm").unwrap().0.parse().unwrap()
        };
        assert!(median(&figures[1]) > median(&figures[0]) && median(&figures[0]) > 0.0);
        for figure in &figures {
            // As many boxes in the legend as classes, and the unit beside them.
            assert!(figure.svg.matches("class=\"heat").count() >= CLASSES + 2);
            assert!(figure.svg.contains(" mm</text>"));
        }
    }

    #[test]
    fn what_is_not_known_is_not_drawn() {
        let mut calibration = example::calibration();
        calibration.rig.uncertainty.clear();
        assert_eq!(draw(&calibration), []);
        let mut calibration = example::calibration();
        calibration.rig.cameras.truncate(1);
        assert_eq!(draw(&calibration), []);
    }
}
