//! The self-tests of a blob: how many give the bits that the packing host computed, and how far off
//! the others are.

use ray_runtime::format::SelfTest;
use ray_runtime::{PixelPoint, RayBlob};

use crate::protocol::SelfTestReport;

/// Asks all of them.
#[inline(never)]
pub fn report(blob: &RayBlob<'_>) -> SelfTestReport {
    let mut report = SelfTestReport {
        tests: 0,
        equal: 0,
        unanswered: 0,
        worst_mm: 0.0,
        worst_direction: 0.0,
    };
    for test in blob.self_tests() {
        report.tests = report.tests.saturating_add(1);
        if test.passes(blob) {
            report.equal = report.equal.saturating_add(1);
        } else if let Some([mm, direction]) = differences(blob, &test) {
            report.worst_mm = report.worst_mm.max(mm);
            report.worst_direction = report.worst_direction.max(direction);
        } else {
            report.unanswered = report.unanswered.saturating_add(1);
        }
    }
    report
}

/// Largest difference of a coordinate, mm, and of a direction's component; `None` without an answer.
fn differences(blob: &RayBlob<'_>, test: &SelfTest) -> Option<[f32; 2]> {
    let pixel = |[u, v]: [f32; 2]| PixelPoint { u, v };
    match *test {
        SelfTest::Ray {
            camera,
            pixel: at,
            origin_mm,
            direction,
        } => {
            let ray = blob.lookup(camera.into(), pixel(at)).ok()?;
            Some([
                largest(ray.origin_mm, origin_mm),
                largest(ray.direction, direction),
            ])
        }
        SelfTest::Pair {
            cameras: [a, b],
            pixels: [at_a, at_b],
            point_mm,
            ..
        } => {
            let found = blob.triangulate((a.into(), pixel(at_a)), (b.into(), pixel(at_b)));
            Some([largest(found.ok()?.point_mm, point_mm), 0.0])
        }
        SelfTest::Sigma {
            cameras: [a, b],
            pixels: [at_a, at_b],
            sigma_mm,
        } => {
            let sightings = [(a.into(), pixel(at_a)), (b.into(), pixel(at_b))];
            let [first, second] = sightings;
            let measured = blob.triangulate_with_covariance(first, second).ok()?;
            Some([largest(measured.covariance?.sigma_mm(), sigma_mm), 0.0])
        }
    }
}

fn largest([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> f32 {
    (a - x).abs().max((b - y).abs()).max((c - z).abs())
}
