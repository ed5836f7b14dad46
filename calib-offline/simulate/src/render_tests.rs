//! Rendered images against the true projections.

use super::pattern::{Pattern, RING_PITCH_MM};
use super::render::{PlateView, Rendered};
use super::*;
use calib_rays::geometry::{PixelPoint, SensorSize};
use nalgebra::{Matrix3, Vector3};

const PERFECT: RenderSettings = RenderSettings {
    blur_px: 1.0,
    black: 0.1,
    white: 0.9,
    background: 0.3,
    gradient: [0.0, 0.0],
    noise_levels: 0.0,
    is_displaced: false,
};

fn scene(optics: OpticsKind) -> Scene {
    Scene::new(SceneSettings {
        sensor: SensorSize::new(800, 640),
        angles_deg: vec![-20.0, 15.0],
        ..SceneSettings::standard(optics, 2)
    })
    .unwrap()
}

fn board_view(scene: &Scene, camera_idx: usize, pose: usize) -> PlateView<'_> {
    PlateView {
        camera: &scene.cameras[camera_idx],
        camera_from_plate: scene.left_from_camera[camera_idx].inverse() * scene.true_poses[pose],
        pattern: Pattern::Chessboard(scene.settings.board.clone()),
        bow_mm: scene.settings.bow_mm,
        displaced: None,
    }
}

/// Brightness between pixels, by cubic convolution over 6 x 6 pixels: for places that are whole pixels
/// apart, whose weights are the same.
struct Sampler<'a> {
    image: &'a Rendered,
    /// Pixel before the place.
    first: [i32; 2],
    weights: [[f64; 6]; 2],
}

impl<'a> Sampler<'a> {
    fn new(image: &'a Rendered, u: f64, v: f64) -> Self {
        let weight = |x: f64| {
            // Keys' kernel of fourth order.
            let x = x.abs();
            if x < 1.0 {
                4.0 / 3.0 * x.powi(3) - 7.0 / 3.0 * x * x + 1.0
            } else if x < 2.0 {
                -7.0 / 12.0 * x.powi(3) + 3.0 * x * x - 59.0 / 12.0 * x + 2.5
            } else if x < 3.0 {
                x.powi(3) / 12.0 - 2.0 / 3.0 * x * x + 1.75 * x - 1.5
            } else {
                0.0
            }
        };
        let along = |at: f64| [-2.0, -1.0, 0.0, 1.0, 2.0, 3.0].map(|i| weight(at - at.floor() - i));
        Self {
            image,
            first: [u, v].map(|at| at.floor() as i32),
            weights: [along(u), along(v)],
        }
    }

    /// So many pixels to the right of the place, and so many below.
    fn at(&self, right: i32, down: i32) -> f64 {
        let [u, v] = self.first;
        let (u, v) = ((u + right - 2) as usize, (v + down - 2) as usize);
        let width = self.image.sensor.width as usize;
        let [along_u, along_v] = &self.weights;
        let lines = along_v.iter().zip(v..).map(|(weight, v)| {
            let line = &self.image.brightness[v * width + u..][..6];
            let values = line.iter().zip(along_u);
            weight
                * values
                    .map(|(value, weight)| f64::from(*value) * weight)
                    .sum::<f64>()
        });
        lines.sum()
    }
}

/// The point about which the image is most nearly unchanged by a half turn: a chessboard corner,
/// or the middle of a ring, under any affine view.
fn symmetry_center(image: &Rendered, start: PixelPoint, radius: i32) -> PixelPoint {
    let cost = |u: f64, v: f64| {
        let sampler = Sampler::new(image, u, v);
        let mut sum = 0.0;
        for j in -radius..=radius {
            for i in -radius..=radius {
                let difference = sampler.at(i, j) - sampler.at(-i, -j);
                sum += difference * difference;
            }
        }
        sum
    };
    let mut at = start;
    // Newton on a quadratic whose curvature is taken from half a pixel around.
    for _ in 0..6 {
        let h = 0.25;
        let c = |i: f64, j: f64| cost(at.u + i * h, at.v + j * h);
        let middle = c(0.0, 0.0);
        let gradient = [
            (c(1.0, 0.0) - c(-1.0, 0.0)) / 2.0,
            (c(0.0, 1.0) - c(0.0, -1.0)) / 2.0,
        ];
        let uu = c(1.0, 0.0) + c(-1.0, 0.0) - 2.0 * middle;
        let vv = c(0.0, 1.0) + c(0.0, -1.0) - 2.0 * middle;
        let uv = (c(1.0, 1.0) + c(-1.0, -1.0) - c(1.0, -1.0) - c(-1.0, 1.0)) / 4.0;
        let det = uu * vv - uv * uv;
        at.u -= h * (vv * gradient[0] - uv * gradient[1]) / det;
        at.v -= h * (uu * gradient[1] - uv * gradient[0]) / det;
    }
    at
}

#[test]
fn corners_in_the_image_are_where_the_true_projection_puts_them() {
    for kind in [OpticsKind::Brown, OpticsKind::Bumps, OpticsKind::Port] {
        let scene = scene(kind);
        for camera_idx in 0..2 {
            let image = scene.render_board(camera_idx, 1, &PERFECT);
            let (mut squares, mut count) = (0.0, 0);
            for row in 0..15 {
                for col in 0..13 {
                    let Some(truth) = scene.true_corner(camera_idx, 1, row, col) else {
                        continue;
                    };
                    if truth.u < 15.0 || truth.u > 785.0 || truth.v < 15.0 || truth.v > 625.0 {
                        continue;
                    }
                    let found = symmetry_center(&image, truth, 5);
                    let error = found.distance_px(truth);
                    // Bends inside the window break its symmetry: a bump of 3 px over 50 px moves
                    // the middle of 5 px by 3 / 50^2 * 5^2 / 2 = 0.015 px, on two axes.
                    let most = if kind == OpticsKind::Bumps {
                        0.03
                    } else {
                        0.01
                    };
                    assert!(
                        error < most,
                        "{kind:?} {camera_idx} {row} {col}: {error} px"
                    );
                    squares += error * error;
                    count += 1;
                }
            }
            let rms_px = (squares / f64::from(count)).sqrt();
            assert!(count > 100 && rms_px < 0.003, "{kind:?}: {rms_px} px");
        }
    }
}

#[test]
fn ring_centers_lie_where_a_small_ring_says() {
    // Straight before a camera without perspective across the ring, its center is its middle.
    let scene = scene(OpticsKind::Telecentric);
    let view = PlateView {
        camera: &scene.cameras[0],
        camera_from_plate: calib_rays::geometry::RigidTransform::new(
            Matrix3::identity(),
            Vector3::new(-47.3, -35.9, 300.0),
        ),
        pattern: Pattern::RingTarget,
        bow_mm: 0.0,
        displaced: None,
    };
    let image = view.render(&PERFECT);
    for (row, col) in [(0, 0), (3, 4), (1, 2), (6, 8)] {
        let center = view.camera_from_plate.point(&Vector3::new(
            f64::from(col) * RING_PITCH_MM,
            f64::from(row) * RING_PITCH_MM,
            0.0,
        ));
        let truth = scene.cameras[0].project(&center).unwrap();
        let error = symmetry_center(&image, truth, 18).distance_px(truth);
        assert!(error < 0.002, "{row} {col}: {error} px");
    }
}

#[test]
fn the_lattice_between_exact_rays_is_good_to_a_thousandth_of_a_pixel() {
    for kind in OpticsKind::ALL {
        let scene = scene(kind);
        for camera_idx in 0..2 {
            let view = board_view(&scene, camera_idx, 1);
            let worst = view.lattice_error_px();
            assert!(worst < 1e-3, "{kind:?} camera {camera_idx}: {worst} px");
        }
    }
}

#[test]
fn plain_areas_have_the_brightness_of_their_print() {
    let scene = scene(OpticsKind::Brown);
    let image = scene.render_board(0, 1, &PERFECT);
    let middle_of = |row: f64, col: f64| {
        let point =
            scene.true_poses[1].point(&Vector3::new((col + 0.5) * 10.0, (row + 0.5) * 10.0, 0.0));
        let pixel = scene.true_project(0, &point).unwrap();
        image.brightness[pixel.v.round() as usize * 800 + pixel.u.round() as usize]
    };
    // The square right below corner (0, 0) has the color of even sums: black.
    assert!((middle_of(8.0, 6.0) - 0.1).abs() < 1e-3);
    assert!((middle_of(8.0, 7.0) - 0.9).abs() < 1e-3);
    assert!((middle_of(7.0, 6.0) - 0.9).abs() < 1e-3);
}

#[test]
fn a_bowed_board_is_rendered_bowed() {
    let mut bowed = scene(OpticsKind::Brown);
    bowed.settings.bow_mm = 2.0;
    let image = bowed.render_board(1, 1, &PERFECT);
    let flat = scene(OpticsKind::Brown);
    let mut largest_shift = 0.0_f64;
    for (row, col) in [(2, 2), (7, 6), (12, 10)] {
        let (Some(truth), Some(plain)) = (
            bowed.true_corner(1, 1, row, col),
            flat.true_corner(1, 1, row, col),
        ) else {
            continue;
        };
        let error = symmetry_center(&image, truth, 5).distance_px(truth);
        assert!(error < 0.03, "{row} {col}: {error} px");
        largest_shift = largest_shift.max(truth.distance_px(plain));
    }
    assert!(largest_shift > 0.5, "{largest_shift} px");
}

#[test]
fn sensor_noise_has_its_size_and_its_own_stream() {
    let scene = scene(OpticsKind::Brown);
    let noisy = RenderSettings {
        noise_levels: 2.0,
        ..PERFECT
    };
    let clean = scene.render_board(0, 0, &PERFECT);
    let image = scene.render_board(0, 0, &noisy);
    let squares: f64 = clean
        .brightness
        .iter()
        .zip(&image.brightness)
        .map(|(a, b)| (f64::from(b - a) * 255.0).powi(2))
        .sum();
    let n = clean.brightness.len() as f64;
    let sd = (squares / n).sqrt();
    assert!(
        (sd / 2.0 - 1.0).abs() < 4.0 / (2.0 * n).sqrt() + 1e-4,
        "{sd}"
    );
    assert_eq!(scene.render_board(0, 0, &noisy), image);
    // Rounding to 16 bits is finer than to 8.
    assert_eq!(clean.to_u8().len(), clean.to_u16().len());
    let (byte, word) = (clean.to_u8()[0], clean.to_u16()[0]);
    assert!((f64::from(byte) * 257.0 - f64::from(word)).abs() <= 129.0);
}

#[test]
fn outside_the_image_circle_there_is_background() {
    let scene = scene(OpticsKind::Fisheye);
    let image = scene.render_board(0, 0, &PERFECT);
    assert!((image.brightness[0] - 0.3).abs() < 1e-6);
    let brightest = image.brightness.iter().copied().fold(0.0, f32::max);
    assert!(brightest > 0.85, "the board is in view: {brightest}");
}

/// Displaced by 0.05 px, a corner is seen where its noise puts it: the print around it goes with it.
#[test]
fn displaced_corners_are_off_by_their_noise() {
    let mut scene = scene(OpticsKind::Brown);
    scene.settings.noise_px = 0.05;
    let displaced = RenderSettings {
        is_displaced: true,
        ..PERFECT
    };
    let [clean, image] = [&PERFECT, &displaced].map(|settings| scene.render_board(0, 0, settings));
    let views = scene.observe_corners();
    let view = views
        .iter()
        .find(|view| (view.camera_idx, view.pose) == (0, 0))
        .unwrap();
    let (mut along, mut squares, mut rest, mut count) = (0.0, 0.0, 0.0, 0);
    for corner in &view.corners {
        let truth = scene.true_corner(0, 0, corner.row, corner.col).unwrap();
        if truth.u < 15.0 || truth.u > 785.0 || truth.v < 15.0 || truth.v > 625.0 {
            continue;
        }
        let [before, after] = [&clean, &image].map(|image| symmetry_center(image, truth, 3));
        for (noise, found) in [
            (corner.pixel.u - truth.u, after.u - before.u),
            (corner.pixel.v - truth.v, after.v - before.v),
        ] {
            along += noise * found;
            squares += noise * noise;
            rest += (noise - found).powi(2);
            count += 1;
        }
    }
    assert!(count > 200);
    // What is left of it: the place around a corner that is level is some tenths of a square, and the window that
    // finds it is 7 px wide and as much again by the blur.
    assert!((along / squares - 1.0).abs() < 0.1, "{}", along / squares);
    assert!(
        (rest / squares).sqrt() < 0.15,
        "{}",
        (rest / squares).sqrt()
    );
    // The noise is that of `corners.csv`, from the same stream.
    let sd_px = (squares / f64::from(count)).sqrt();
    assert!(
        (sd_px / 0.05 - 1.0).abs() < 4.0 / f64::from(2 * count).sqrt(),
        "{sd_px}"
    );
}
