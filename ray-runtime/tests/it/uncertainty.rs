//! The covariance of a point against differences of the point itself, by pixels.

use crate::test_blob::{TestBlob, TestCamera, TestPair, encoding};
use nalgebra::{Matrix3, Matrix4, Vector3};
use ray_runtime::format::Form;
use ray_runtime::{MeasureError, PixelPoint, RayBlob};

/// Turned by 0.2 rad about y and -0.3 rad about z.
fn turned() -> [f32; 9] {
    let (about_y, about_z) = (0.2f64, -0.3f64);
    let y = Matrix3::new(
        about_y.cos(),
        0.0,
        about_y.sin(),
        0.0,
        1.0,
        0.0,
        -about_y.sin(),
        0.0,
        about_y.cos(),
    );
    let z = Matrix3::new(
        about_z.cos(),
        -about_z.sin(),
        0.0,
        about_z.sin(),
        about_z.cos(),
        0.0,
        0.0,
        0.0,
        1.0,
    );
    let r = (z * y).cast::<f32>();
    core::array::from_fn(|k| r[(k / 3, k % 3)])
}

/// A central camera and one that is not, their pair, and a camera of which nothing is known.
fn content() -> TestBlob {
    content_of(Form::Spline)
}

fn content_of(form: Form) -> TestBlob {
    let mut first = TestCamera::new("first", -80.0);
    first.encoding = encoding(form, true);
    let mut second = TestCamera::new("second", 90.0);
    second.encoding = encoding(form, false);
    second.offset_mm = [4.0, -2.5];
    second.rotation = turned();
    let mut blob = TestBlob::new(vec![first, second, TestCamera::new("third", 10.0)]);
    blob.pairs = vec![TestPair::new([0, 1])];
    blob
}

/// (u, v) in the first camera and u in the second one.
const PLACES: [([f32; 2], f32); 3] = [
    ([40.0, 20.0], 2.25),
    ([50.5, 30.25], 15.5),
    ([45.0, 25.5], 9.0),
];

/// Matches whose rays meet: v in the second camera is where they pass nearest to each other. (The
/// derivative leaves out what the rays' turning does to a gap, which is noise itself.)
fn matches(blob: &RayBlob<'_>) -> [[[f32; 2]; 2]; 3] {
    PLACES.map(|(first, u)| {
        let gap = |v: f32| {
            let found = blob.triangulate((0, at(first)), (1, at([u, v])));
            found.map_or(f32::INFINITY, |found| found.gap_squared_mm2)
        };
        let (mut low, mut high) = (0.0, 47.0);
        for _ in 0..60 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if gap(a) < gap(b) {
                high = b;
            } else {
                low = a;
            }
        }
        assert!(gap(low) < 1e-4, "the rays meet at {u}, {low}: {}", gap(low));
        [first, [u, low]]
    })
}

fn at([u, v]: [f32; 2]) -> PixelPoint {
    PixelPoint::new(u, v)
}

/// How the point, and the gap with its sign, move with the four coordinates, mm/px, by differences in f64
/// of f32 points.
fn by_differences(blob: &RayBlob<'_>, pixels: [[f32; 2]; 2]) -> Matrix4<f64> {
    // 1/8 px: a point's f32 step of 3e-5 mm makes 1.2e-4 mm/px.
    const H: f32 = 0.125;
    let point = |pixels: [[f32; 2]; 2]| {
        let found = blob.triangulate_with_covariance((0, at(pixels[0])), (1, at(pixels[1])));
        let found = found.unwrap();
        let gap_mm = f64::from(found.signed_gap_mm());
        Vector3::from(found.found.point_mm)
            .cast::<f64>()
            .push(gap_mm)
    };
    Matrix4::from_columns(&[0, 1, 2, 3].map(|k| {
        let mut moved = [pixels, pixels];
        moved[0][k / 2][k % 2] -= H;
        moved[1][k / 2][k % 2] += H;
        (point(moved[1]) - point(moved[0])) / (2.0 * f64::from(H))
    }))
}

/// What the nodes of [`TestPair::new`] say, px.
fn factor() -> Matrix4<f64> {
    Matrix4::new(
        50.0, 0.0, 0.0, 0.0, //
        0.0, 50.0, 0.0, 0.0, //
        20.0, 0.0, 30.0, 0.0, //
        0.0, -10.0, 5.0, 40.0,
    ) * 0.002
}

/// Symmetric: rows or columns first is the same.
fn matrix(rows: [[f32; 3]; 3]) -> Matrix3<f32> {
    rows.into()
}

fn assert_near(found: &[[f32; 3]; 3], expected: &Matrix3<f64>, what: &str) {
    let found = matrix(*found);
    // The derivative by differences is off by 1e-3 of itself (third derivatives, round-off).
    let error = (found.cast::<f64>() - expected).norm() / expected.norm();
    assert!(error < 5e-3, "{what}: {error}\n{found}\n{expected}");
}

#[test]
fn covariance_is_carried_by_the_derivative_of_the_point() {
    for form in [Form::Spline, Form::Patches, Form::Quantized] {
        covariance_is_carried(form);
    }
}

fn covariance_is_carried(form: Form) {
    let bytes = content_of(form).bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    for pixels in matches(&blob) {
        let (a, b) = ((0, at(pixels[0])), (1, at(pixels[1])));
        let measured = blob.triangulate_with_covariance(a, b).unwrap();
        // The bits of the point are those of the plain question.
        assert_eq!(Ok(measured.found), blob.triangulate(a, b));
        let covariance = measured.covariance.unwrap();
        let of_all = by_differences(&blob, pixels);
        let gap_by_pixels = of_all.row(3);
        let gap_mm2 =
            (gap_by_pixels * factor()).norm_squared() + gap_by_pixels.norm_squared() * 0.01;
        let error = f64::from(covariance.gap_mm2) / gap_mm2 - 1.0;
        assert!(error.abs() < 5e-3, "gap: {error}");
        let by_pixels = of_all.fixed_rows::<3>(0);
        let carried = by_pixels * factor();
        assert_near(
            &covariance.calibration_mm2,
            &(carried * carried.transpose()),
            "calibration",
        );
        let noise = by_pixels * by_pixels.transpose() * 0.01;
        assert_near(&covariance.noise_mm2, &noise, "noise");
        let total = covariance.total_mm2();
        for (k, sigma) in covariance.sigma_mm().into_iter().enumerate() {
            assert!((sigma * sigma - total[k][k]).abs() <= 1e-6 * total[k][k]);
        }
    }
}

#[test]
fn the_order_of_the_cameras_does_not_matter() {
    let bytes = content().bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    for [first, second] in matches(&blob) {
        let (a, b) = ((0, at(first)), (1, at(second)));
        let one = blob.triangulate_with_covariance(a, b).unwrap();
        let other = blob.triangulate_with_covariance(b, a).unwrap();
        let [total, other_total] =
            [one, other].map(|measured| matrix(measured.covariance.unwrap().total_mm2()));
        assert!((total - other_total).norm() < 1e-5 * total.norm());
        let [gap, other_gap] = [one, other].map(|m| m.covariance.unwrap().gap_mm2);
        assert!((gap - other_gap).abs() < 1e-5 * gap);
        // A tenth of a pixel lower, the second ray passes below the first, whichever is asked first.
        let lower = (1, at([second[0], second[1] + 0.1]));
        for (a, b) in [(a, lower), (lower, a)] {
            let below = blob.triangulate_with_covariance(a, b).unwrap();
            assert!(below.signed_gap_mm() < -0.01, "{below:?}");
        }
    }
}

#[test]
fn without_a_pair_there_is_a_point_but_no_covariance() {
    let bytes = content().bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    let (a, c) = (
        (0, PixelPoint::new(40.0, 20.0)),
        (2, PixelPoint::new(25.0, 20.0)),
    );
    let measured = blob.triangulate_with_covariance(a, c).unwrap();
    assert_eq!(measured.covariance, None);
    assert_eq!(Ok(measured.found), blob.triangulate(a, c));
    let pairs: Vec<_> = blob.uncertain_pairs().collect();
    assert_eq!(pairs, [TestPair::new([0, 1]).header]);
}

#[test]
fn what_has_no_point_has_no_covariance_either() {
    let bytes = content().bytes();
    let blob = RayBlob::open(bytes.bytes()).unwrap();
    let inside = PixelPoint::new(40.0, 20.0);
    let outside = PixelPoint::new(-3.0, 20.0);
    let ask = |a, b| blob.triangulate_with_covariance(a, b).unwrap_err();
    assert_eq!(
        ask((0, inside), (1, outside)),
        MeasureError::Outside { camera: 1 }
    );
    assert_eq!(
        ask((7, inside), (1, inside)),
        MeasureError::NoSuchCamera {
            camera: 7,
            count: 3
        }
    );
    assert_eq!(ask((0, inside), (0, inside)), MeasureError::Parallel);
}

#[test]
fn nodes_are_blended_over_the_first_cameras_image() {
    // Without noise, sigma follows the nodes' scale: equal at every node, then halved at all.
    let sigma = |scale: u8| {
        let mut content = content();
        content.pairs[0].header.noise_px2 = 0.0;
        content.pairs[0].node[0] = scale;
        let bytes = content.bytes();
        let blob = RayBlob::open(bytes.bytes()).unwrap();
        let [_, [first, second], _] = matches(&blob);
        let measured = blob.triangulate_with_covariance((0, at(first)), (1, at(second)));
        Vector3::from(measured.unwrap().covariance.unwrap().sigma_mm())
    };
    assert!((sigma(2) - sigma(1) * 2.0).norm() < 1e-6 * sigma(2).norm());
    assert_eq!(sigma(0), Vector3::zeros());
}
