//! The ring target in rendered images with known centers: how near, and whether every marker gets
//! its own label or none.

use crate::ring_shots::{Errors, Shot, located, target};
use calib_rays::geometry::{PixelPoint, SensorSize};
use calib_recording::dataset::TargetSpec;
use calib_recording::dataset::image::GrayImage;
use calib_recording::detect::illegible::Illegible;
use calib_recording::detect::ring_target::{Located, TargetRefusal, TargetSettings, locate};
use calib_simulate::{OpticsKind, RenderSettings, Scene, SceneSettings};
use std::collections::BTreeMap;
use std::sync::LazyLock;

type Truth = BTreeMap<(usize, usize), PixelPoint>;

/// Noise of one level moves a center by some 0.001 px; ten times that is no noise.
const NO_NOISE_PX: f64 = 0.01;

fn errors(shot: &Shot) -> Errors {
    let located = located(&shot.image()).expect("a target in full view");
    let truth = shot.truth();
    assert!(
        located.markers.len() >= truth.len(),
        "{}",
        located.markers.len()
    );
    Errors::of(&located, &truth)
}

/// Every marker found has the label that belongs there.
#[track_caller]
fn assert_labels(located: &Located, truth: &Truth) {
    for marker in &located.markers {
        let distance = truth[&(marker.row, marker.col)].distance_px(marker.ring.pixel);
        assert!(
            distance < 0.05,
            "({}, {}): {distance} px",
            marker.row,
            marker.col
        );
    }
}

fn changed(image: &GrayImage, value: impl Fn(f64, f64, f32) -> f32) -> GrayImage {
    let width = image.sensor.width as usize;
    let values = image.values().enumerate();
    let values = values
        .map(|(i, old)| value((i % width) as f64, (i / width) as f64, old))
        .collect();
    GrayImage::from_values(image.sensor, values, image.white_level).unwrap()
}

/// The image turned clockwise by quarter turns, and where its points went.
fn turned(image: &GrayImage, truth: &Truth, quarters: usize) -> (GrayImage, Truth) {
    (0..quarters).fold((image.clone(), truth.clone()), |(image, truth), _| {
        let (width, height) = (image.sensor.width, image.sensor.height);
        let sensor = SensorSize::new(height, width);
        let values = (0..width * height)
            .map(|i| {
                let (u, v) = (i % height, i / height);
                let (old_u, old_v) = (v, height - 1 - u);
                image.value((old_v * width + old_u) as usize)
            })
            .collect();
        let last = f64::from(height - 1);
        let moved = truth
            .iter()
            .map(|(label, p)| (*label, PixelPoint::new(last - p.v, p.u)));
        let image = GrayImage::from_values(sensor, values, 255.0).unwrap();
        (image, moved.collect())
    })
}

fn upright() -> Shot {
    Shot::turned(OpticsKind::Brown, [12.0, -18.0, 5.0])
}

/// The image of [`upright`] and its truth, rendered once.
fn upright_image() -> (&'static GrayImage, &'static Truth) {
    static SHOT: LazyLock<(GrayImage, Truth)> = LazyLock::new(|| {
        let shot = upright();
        (shot.image(), shot.truth())
    });
    (&SHOT.0, &SHOT.1)
}

#[test]
fn centers_are_within_a_hundredth_of_a_pixel_on_many_optics() {
    for (optics, bound_px) in [
        (OpticsKind::Brown, 0.003),
        (OpticsKind::Paper, 0.006),
        (OpticsKind::Port, 0.003),
        (OpticsKind::Wide, 0.006),
        (OpticsKind::Fisheye, 0.006),
        // Local distortion of several pixels bends the map between markers.
        (OpticsKind::Bumps, 0.02),
    ] {
        let shots = Shot::standard(optics);
        let errors = [&shots[1], &shots[5]].map(errors);
        let errors = errors[0].and(errors[1]);
        assert!(errors.count > 100);
        assert!(errors.rms_px() < bound_px, "{optics:?}: {errors:?}");
    }
}

#[test]
fn the_correction_removes_what_the_perspective_adds() {
    for (optics, tilt_deg) in [
        (OpticsKind::Brown, 20.0),
        (OpticsKind::Brown, 40.0),
        (OpticsKind::Brown, 55.0),
        (OpticsKind::Port, 40.0),
        (OpticsKind::Wide, 30.0),
    ] {
        let errors = errors(&Shot::turned(
            optics,
            [0.6 * tilt_deg, -0.8 * tilt_deg, 30.0],
        ));
        // The bias is tens of times the noise here.
        assert!(errors.uncorrected_rms_px() > 0.02, "{optics:?} {tilt_deg}");
        assert!(
            errors.rms_px() < 0.2 * errors.uncorrected_rms_px(),
            "{optics:?} at {tilt_deg} degrees: {} of {}",
            errors.rms_px(),
            errors.uncorrected_rms_px()
        );
    }
}

#[test]
fn the_scatter_is_as_predicted_with_any_blur_and_noise() {
    for (blur_px, noise_levels) in [(0.7, 1.0), (0.7, 5.0), (2.0, 1.0), (2.0, 5.0)] {
        let shot = upright().with(|render| {
            render.blur_px = blur_px;
            render.noise_levels = noise_levels;
        });
        let errors = errors(&shot);
        assert_eq!(errors.count, 63);
        assert!(
            errors.rms_px() < 0.02,
            "{blur_px} {noise_levels}: {errors:?}"
        );
        // 126 numbers: their RMS is known to 6 %.
        let ratio = errors.rms_px() / errors.predicted_px();
        assert!(
            (0.7..1.4).contains(&ratio),
            "{blur_px} {noise_levels}: {ratio}"
        );
    }
}

#[test]
fn without_noise_the_floor_of_rendering_and_quantizing_is_left() {
    let errors = errors(&upright().with(|render| render.noise_levels = 0.0));
    assert!(errors.rms_px() < 0.001, "{errors:?}");
}

#[test]
fn a_turned_image_has_the_same_labels_and_a_mirrored_one_is_refused() {
    let (image, truth) = upright_image();
    for quarters in 0..4 {
        let (image, truth) = turned(image, truth, quarters);
        let located = located(&image).unwrap();
        assert_eq!(located.markers.len(), 63);
        assert_eq!(usize::from(located.quarter_turns), quarters);
        assert_labels(&located, &truth);
        let width = image.sensor.width as usize;
        let values = (0..image.values().len())
            .map(|i| image.value(i - i % width + width - 1 - i % width))
            .collect();
        let mirrored = GrayImage::from_values(image.sensor, values, 255.0).unwrap();
        let refusal = crate::ring_shots::located(&mirrored).unwrap_err();
        assert_eq!(refusal, TargetRefusal::Mirrored);
        assert!(refusal.to_string().contains("mirror"));
    }
}

#[test]
fn any_turn_about_the_viewing_axis_is_followed() {
    for turn_deg in [20.0, 44.0, 46.0, 135.0, 200.0, 300.0] {
        let shot = Shot::turned(OpticsKind::Wide, [15.0, 10.0, turn_deg]);
        let located = located(&shot.image()).unwrap();
        assert_eq!(located.markers.len(), 63, "{turn_deg}");
        assert_labels(&located, &shot.truth());
    }
}

#[test]
fn bright_rings_on_dark_are_measured_as_well() {
    let (shot, truth) = upright_image();
    let inverted = changed(shot, |_, _, value| 255.0 - value);
    let located = located(&inverted).unwrap();
    let errors = Errors::of(&located, truth);
    assert_eq!(errors.count, 63);
    assert!(errors.rms_px() < 0.003, "{errors:?}");
}

#[test]
fn markers_painted_over_are_missing_and_the_others_keep_their_labels() {
    let (shot, truth) = upright_image();
    let hidden = [
        (0, 0),
        (2, 3),
        (3, 3),
        (3, 4),
        (6, 8),
        (5, 1),
        (5, 2),
        (1, 7),
    ];
    let image = changed(shot, |u, v, value| {
        let covered = hidden
            .iter()
            .any(|label| truth[label].distance_px(PixelPoint::new(u, v)) < 24.0);
        if covered { 195.0 } else { value }
    });
    let located = located(&image).unwrap();
    assert_eq!(located.markers.len(), 63 - hidden.len());
    assert_labels(&located, truth);
}

#[test]
fn a_row_and_a_column_missing_do_not_shift_what_lies_beyond() {
    let (shot, truth) = upright_image();
    let image = changed(shot, |u, v, value| {
        let here = PixelPoint::new(u, v);
        let covered = |(label, p): (&(usize, usize), &PixelPoint)| {
            (label.0 == 5 || label.1 == 2) && p.distance_px(here) < 24.0
        };
        if truth.iter().any(covered) {
            195.0
        } else {
            value
        }
    });
    let located = located(&image).unwrap();
    assert_labels(&located, truth);
    // Row 6 and the first two columns are no neighbors of the rest, and found all the same.
    assert_eq!(located.markers.len(), 6 * 8);
}

#[test]
fn a_cover_across_the_target_leaves_the_rest_or_a_refusal() {
    let (image, truth) = upright_image();
    let covered_to = |from: PixelPoint, cover: f32| {
        let edge = from.u + 4.0;
        changed(
            image,
            move |u, _, value| if u < edge { cover } else { value },
        )
    };
    for cover in [20.0, 110.0, 230.0] {
        // The cover cuts through rings; such are left out, and not measured wrong.
        let located = located(&covered_to(truth[&(3, 1)], cover)).unwrap();
        assert!(
            (44..=63).contains(&located.markers.len()),
            "{}",
            located.markers.len()
        );
        assert_labels(&located, truth);
        // All of the large markers behind it: nothing tells where on the target the rest lies.
        let refusal = crate::ring_shots::located(&covered_to(truth[&(3, 6)], cover)).unwrap_err();
        let ambiguous = matches!(refusal, TargetRefusal::AmbiguousDirection { placement_count, .. } if placement_count > 1);
        assert!(ambiguous, "{refusal}");
    }
}

#[test]
fn a_target_cut_off_by_the_edge_of_the_image_is_numbered_by_its_large_markers() {
    let (image, truth) = upright_image();
    let width = (truth[&(3, 7)].u + 3.0) as u32;
    let height = (truth[&(5, 4)].v + 5.0) as u32;
    let values = (0..width * height)
        .map(|i| image.value(((i / width) * image.sensor.width + i % width) as usize))
        .collect();
    let cut = GrayImage::from_values(SensorSize::new(width, height), values, 255.0).unwrap();
    let located = located(&cut).unwrap();
    assert!(
        (30..=6 * 8).contains(&located.markers.len()),
        "{}",
        located.markers.len()
    );
    assert_labels(&located, truth);
}

#[test]
fn images_without_the_target_say_why() {
    let sensor = SensorSize::new(640, 480);
    let flat = GrayImage::from_values(sensor, vec![80.0; 640 * 480], 255.0).unwrap();
    assert!(matches!(
        located(&flat),
        Err(TargetRefusal::Illegible(Illegible::LowContrast { .. }))
    ));
    // Noise alone, from a generator that anybody can write down.
    let mut state = 1_u32;
    let noise = changed(&flat, |_, _, value| value);
    let values = noise.values().map(|_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as f32
    });
    let noise = GrayImage::from_values(sensor, values.collect(), 255.0).unwrap();
    let refusal = located(&noise).unwrap_err();
    assert!(
        matches!(
            refusal,
            TargetRefusal::NoMarkers | TargetRefusal::TooFewMarkers { .. }
        ),
        "{refusal}"
    );
    let scene = Scene::new(SceneSettings::standard(OpticsKind::Brown, 1)).unwrap();
    let board = scene.render_board(0, 8, &RenderSettings::default());
    let values = board.to_u8().into_iter().map(f32::from).collect();
    let board = GrayImage::from_values(board.sensor, values, 255.0).unwrap();
    let refusal = located(&board).unwrap_err();
    assert_eq!(refusal, TargetRefusal::NoMarkers);
    let blurred = upright().with(|render| render.blur_px = 9.0);
    let refusal = located(&blurred.image()).unwrap_err();
    assert!(
        matches!(refusal, TargetRefusal::Illegible(Illegible::Blurred { .. })),
        "{refusal}"
    );
}

#[test]
fn another_target_than_described_is_named() {
    let (image, _) = upright_image();
    let refusal = |change: &dyn Fn(&mut TargetSpec)| {
        let mut described = target();
        change(&mut described);
        locate(image, &described, &TargetSettings::default()).unwrap_err()
    };
    let wrong_size = refusal(&|t| {
        t.outer_radius_mm = 2.8;
        t.direction_outer_radius_mm = 3.4;
    });
    assert!(
        matches!(wrong_size, TargetRefusal::WrongSize { found, .. } if (found - 4.0 / 12.0).abs() < 0.01),
        "{wrong_size}"
    );
    // So small that only diagonal neighbors are as far away as they should be.
    refusal(&|t| {
        t.outer_radius_mm = 2.0;
        t.direction_outer_radius_mm = 2.5;
    });
    let elsewhere = refusal(&|t| t.direction = vec![(0, 0), (0, 1), (6, 2), (5, 5), (2, 8)]);
    assert!(
        matches!(elsewhere, TargetRefusal::WrongTarget { .. }),
        "{elsewhere}"
    );
    let smaller = refusal(&|t| t.rows = 5);
    assert!(
        matches!(smaller, TargetRefusal::WrongTarget { .. }),
        "{smaller}"
    );
    let opposite = refusal(&|t| {
        for place in &mut t.direction {
            place.1 = 8 - place.1;
        }
    });
    assert_eq!(opposite, TargetRefusal::Mirrored);
}

#[test]
fn the_second_round_of_the_correction_is_enough_and_none_leaves_the_middles() {
    let shot = Shot::turned(OpticsKind::Brown, [30.0, -25.0, 0.0]);
    let (image, truth) = (shot.image(), shot.truth());
    let with = |correction_rounds| {
        let settings = TargetSettings {
            correction_rounds,
            ..TargetSettings::default()
        };
        Errors::of(&locate(&image, &target(), &settings).unwrap(), &truth)
    };
    let [none, one, two, three] = [0, 1, 2, 3].map(with);
    assert_eq!(none.rms_px(), none.uncorrected_rms_px());
    assert!(none.rms_px() > 5.0 * NO_NOISE_PX && one.rms_px() < NO_NOISE_PX);
    assert!(two.rms_px() <= one.rms_px() && two.rms_px() < 0.003);
    // A fifth of what the noise does.
    assert!(
        (two.rms_px() - three.rms_px()).abs() < 0.0002,
        "{two:?} {three:?}"
    );
}
