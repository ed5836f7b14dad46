//! Packing ends: what it costs, and what it gives when there is no more to spend.

use super::quantized::Number;
use super::tests::{camera, parts, rig, settings};
use super::trials::{Plan, Trials};
use super::work::MOST_FIT_STEPS;
use super::*;
use calib_rays::field::spline::{Spline, SplineGrid};
use calib_rays::field::{BaseLens, CalibratedCamera, Projection, RayField};
use calib_rays::geometry::{RigidTransform, SensorSize};
use calib_rays::progress::{Progress, Silent};
use nalgebra::{Matrix3, Vector2, Vector3};
use ray_runtime::RayBlob;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A fisheye of 150 degrees along its longer side, calibrated everywhere, with rings of some ten pixels;
/// it has more pixels than are proven without a coarse proof.
fn wide_camera() -> CalibratedCamera {
    let sensor = SensorSize::new(2408, 1808);
    let base = BaseLens::ideal(Projection::Equidistant, 920.0);
    let mut field = RayField::ideal(sensor, base, 5);
    let mut spline = Spline::zero(SplineGrid {
        sensor,
        cells_u: 48,
        cells_v: 36,
    });
    for (k, c) in spline.coefficients.iter_mut().enumerate() {
        let (x, y) = ((k % 51) as f64 / 25.0 - 1.0, (k / 51) as f64 / 25.0 - 0.76);
        let swirl = 0.01 * (7.0 * (x * x + y * y)).sin();
        *c = Vector2::new(swirl * (1.0 + 2.0 * x), swirl * (y - x * x));
    }
    field.direction.spline = Some(spline);
    let pose = RigidTransform::new(Matrix3::identity(), Vector3::new(0.0, 0.0, -600.0));
    camera("wide", field, pose)
}

const EVERY_PX: u64 = 2408 * 1808;

/// Counts the steps.
#[derive(Default)]
struct Steps(AtomicUsize);

impl Progress for Steps {
    fn begin(&self, _stage: &str, _total: usize) {}
    fn advance(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
    fn end(&self) {}
}

/// The sample lets a table pass here that does not hold: one proof fails.
#[test]
fn no_table_is_made_or_proven_twice() {
    let rig = rig(vec![wide_camera()]);
    let (bound_px, steps) = (0.01, Steps::default());
    let mut packer = Packer::new(&rig, &settings(bound_px), &steps).unwrap();
    let packed = packer.within(bound_px).unwrap();
    let work = packed.work;
    assert!(packed.worst_error_px <= bound_px);
    assert_eq!(packed.tables[0].tried.len() as u64, work.tables);
    assert!(
        work.tables < 40 && work.fit_steps < MOST_FIT_STEPS / 10,
        "{work:?}"
    );
    assert_eq!((work.proofs, work.is_spent), (2, false));
    // Two of every pixel, and two coarse ones of every third along both axes.
    assert!(
        (2 * EVERY_PX..=EVERY_PX * 5 / 2).contains(&work.proven_px),
        "{work:?}"
    );
    assert!(steps.0.load(Ordering::Relaxed) as u64 > work.tables + 4);
    // The same again costs nothing, and neither does the bound that was just reached.
    assert_eq!(packer.within(bound_px).unwrap(), packed);
    let tighter = packer.within(packed.worst_error_px * 1.000_001).unwrap();
    assert_eq!(tighter.work.proofs, 2);
    assert_eq!(tighter.worst_error_px, packed.worst_error_px);
}

#[test]
fn most_tables_that_do_not_hold_are_refused_by_some_of_the_pixels() {
    let camera = wide_camera();
    let prove = |max_error_px: f64| {
        let mut trials = Trials::new(&camera, &settings(0.01), &Silent).unwrap();
        trials.set_bound(0.01);
        let plan = Plan::Quantized {
            degree: 3,
            number: Number::Two,
        };
        let key = trials.key(plan, [30, 23]);
        trials.error_px(key, 0.01).unwrap().unwrap();
        let table = trials.table(key).unwrap();
        let bytes = parts().encode_cameras(&[(&camera, &table)]).unwrap();
        let bytes = AlignedBytes::from(bytes.as_slice());
        let blob = RayBlob::open(&bytes).unwrap();
        let proof = trials.prove(key, (&blob, 0), max_error_px).unwrap();
        (proof.worst_error_px, trials.work)
    };
    let (worst_px, work) = prove(f64::INFINITY);
    assert_eq!(work.proofs, 1);
    let (found_px, work) = prove(0.9 * worst_px);
    assert!(
        (0.9 * worst_px..=worst_px).contains(&found_px),
        "{found_px} {worst_px}"
    );
    assert_eq!(work.proofs, 0);
    assert!(work.proven_px < EVERY_PX / 8, "{work:?}");
}

/// Below the round-off of f32, and hardly any fits: the best of the few tables is packed, and it is said that there
/// was no more to spend.
#[test]
fn without_more_fits_the_best_table_is_packed() {
    let rig = rig(vec![wide_camera()]);
    let fit_steps = 3_000_000_000;
    let mut packer = Packer::new(&rig, &settings(1e-5), &Silent).unwrap();
    packer.leave(fit_steps, 3 * EVERY_PX);
    let packed = packer.nearest().unwrap();
    assert!(packed.work.is_spent);
    assert!(packed.work.fit_steps <= MOST_FIT_STEPS);
    let tried = &packed.tables[0].tried;
    let best_px = tried
        .iter()
        .map(|t| t.error_px)
        .fold(f64::INFINITY, f64::min);
    assert!(best_px > 1e-5);
    // The sample misses some of the worst pixels, and a smaller table may be off by a fifth more.
    let worst_px = packed.worst_error_px;
    assert!(
        (best_px..1.5 * best_px).contains(&worst_px),
        "{worst_px} {best_px}"
    );
    let bytes = AlignedBytes::from(packed.bytes.as_slice());
    let stated_px = f64::from(RayBlob::open(&bytes).unwrap().max_error_px());
    assert!((stated_px - worst_px).abs() < 1e-6 * worst_px);
    let strict = packer.within(1e-5).unwrap_err();
    assert!(
        matches!(strict, PackError::BoundNotReached { .. }),
        "{strict}"
    );
}

/// The first proof fails and there is none left for another table: the one that is proven is packed.
#[test]
fn without_more_proofs_the_proven_table_is_packed() {
    let rig = rig(vec![wide_camera()]);
    let mut packer = Packer::new(&rig, &settings(0.01), &Silent).unwrap();
    packer.leave(MOST_FIT_STEPS, 0);
    let packed = packer.nearest().unwrap();
    assert_eq!((packed.work.proofs, packed.work.is_spent), (1, true));
    assert!(
        (0.01..0.012).contains(&packed.worst_error_px),
        "{}",
        packed.worst_error_px
    );
    assert_eq!(packed.tables[0].proof.pixel_count as u64 / EVERY_PX, 1);
}
