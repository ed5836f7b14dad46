//! Corners of boards rendered without sampling, from no lens blur on, along the pixel grid and across.

use super::exact::Exact;
use super::*;
use nalgebra::Matrix3;

/// Half a percent of the range.
const NOISE: f64 = 1.275;
const BLURS_PX: [f64; 6] = [0.0, 0.15, 0.25, 0.35, 0.5, 0.7];

/// A board square to the sensor: pitch of the squares, and the first corner's place.
fn frontal(square_px: f64, first: [f64; 2], blur_px: f64) -> Exact {
    Exact {
        board: board(6, 9),
        sensor: SensorSize::new(480, 360),
        px_from_board: Matrix3::new(
            square_px, 0.0, first[0], 0.0, square_px, first[1], 0.0, 0.0, 1.0,
        ),
        blur_px,
    }
}

fn frontals(blur_px: f64) -> Vec<Exact> {
    vec![
        // Edges on pixel centers, on pixel borders, between, and wandering through all phases.
        frontal(40.0, [80.0, 80.0], blur_px),
        frontal(40.0, [80.5, 80.5], blur_px),
        frontal(40.0, [80.27, 79.81], blur_px),
        frontal(40.37, [77.3, 78.8], blur_px),
        frontal(34.61, [97.1, 92.33], blur_px),
        frontal(26.083, [130.9, 110.41], blur_px),
    ]
}

pub fn across(blur_px: f64) -> Vec<Exact> {
    [
        (2.0, [0.0, 0.0]),
        (8.0, [20.0, -10.0]),
        (-17.0, [-25.0, 25.0]),
        (33.0, [0.0, 35.0]),
        (45.0, [10.0, 5.0]),
    ]
    .map(|(roll_deg, tilt_deg)| {
        let photo = tilted(board(6, 9), roll_deg, tilt_deg, 1.3, -0.7);
        Exact {
            board: photo.board,
            sensor: photo.sensor,
            px_from_board: photo.px_from_board,
            blur_px,
        }
    })
    .to_vec()
}

/// What the fit makes of boards that are rendered once each.
struct Outcome {
    /// RMS per axis, px.
    rms_px: f64,
    /// RMS of errors over what was predicted of them.
    normalized: f64,
    /// Corners found of all.
    found: (usize, usize),
}

fn outcome(boards: &[Exact]) -> Outcome {
    let each: Vec<Vec<(f64, f64)>> = boards
        .par_iter()
        .enumerate()
        .map(|(k, exact)| {
            let image = exact.take(NOISE, 100 + k as u64);
            let raw = ChessTopologicalDetector.detect(&image, &exact.board);
            let Some(grid) = FittedGrid::from_raw(
                &image,
                raw.first().map_or(&[][..], Vec::as_slice),
                &exact.board,
                20.0,
            ) else {
                return Vec::new();
            };
            let errors = grid.corners.values().flat_map(|corner| {
                let error = exact.error_px(corner.pixel);
                error.map(|e| (e, grid.sigma_px(corner, 0.0)))
            });
            errors.collect()
        })
        .collect();
    let all = each.concat();
    let mean = |of: fn(&(f64, f64)) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
    Outcome {
        rms_px: mean(|(e, _)| e * e).sqrt(),
        normalized: mean(|(e, sigma)| (e / sigma).powi(2)).sqrt(),
        found: (all.len() / 2, 54 * boards.len()),
    }
}

#[test]
fn sharp_corners_are_found_along_the_grid_and_across() {
    for (name, boards, limit_px) in [
        ("along", frontals as fn(f64) -> Vec<Exact>, 0.003),
        ("across", across, 0.006),
    ] {
        for blur_px in BLURS_PX {
            let Outcome {
                rms_px,
                normalized,
                found,
            } = outcome(&boards(blur_px));
            println!(
                "{name} the grid, blur {blur_px} px: {} of {} corners, {rms_px:.4} px RMS per axis, {normalized:.2} of sigma",
                found.0, found.1
            );
            assert_eq!(found.0, found.1);
            assert!(rms_px <= limit_px, "{name} {blur_px}: {rms_px}");
            assert!(
                (0.8..1.2).contains(&normalized),
                "{name} {blur_px}: {normalized}"
            );
        }
    }
}

#[test]
fn the_renderer_is_the_integral_of_square_waves() {
    let exact = frontal(26.083, [130.9, 110.41], 0.4);
    let image = exact.brightness();
    // Lines at which a square wave changes, one more on either side than there are corners.
    let wave = |at: f64, first: f64, count: usize| {
        let sigma = 0.4;
        let integral = |x: f64| {
            x * libm::erf(x / (sigma * std::f64::consts::SQRT_2))
                + sigma * (2.0 / std::f64::consts::PI).sqrt() * (-0.5 * (x / sigma).powi(2)).exp()
        };
        let steps = (0..count).map(|k| {
            let d = at - first - 26.083 * k as f64;
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            sign * (integral(d + 0.5) - integral(d - 0.5))
        });
        steps.sum::<f64>() - if count % 2 == 1 { 0.0 } else { 1.0 }
    };
    let [dark, bright] = super::exact::LEVELS;
    for v in 100..250 {
        for u in 120..350 {
            let product = wave(f64::from(u), 130.9, 9) * wave(f64::from(v), 110.41, 6);
            let value = image[v as usize * 480 + u as usize];
            let expected = (dark + bright) / 2.0 - product * (bright - dark) / 2.0;
            let inverted = dark + bright - expected;
            let error = (value - expected).abs().min((value - inverted).abs());
            // A thousandth of a pixel's place is 0.2 code values.
            assert!(error < 0.02, "{u} {v}: {value} {expected}");
        }
    }
}
