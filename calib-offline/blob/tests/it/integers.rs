//! Matches measured in integers: the device's bits, and no standard deviations.

use calib_blob::matches::BlobSource;
use calib_blob::pack::read_aligned;
use calib_rays::measure::PointSource;
use ray_runtime::integer::Rig;
use ray_runtime::{PixelPoint, RayBlob};
use std::path::Path;

#[test]
fn a_blob_measures_in_integers_what_a_device_does() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/golden");
    let bytes = read_aligned(&folder.join("stereo-v4-integer-small.rays")).unwrap();
    let blob = RayBlob::open(&bytes).unwrap();
    let rig = Rig::<2>::prepare(&blob).unwrap();
    let floats = BlobSource::new(&blob, None).unwrap();
    let integers = BlobSource::new(&blob, None).unwrap().in_integers().unwrap();
    let (mut points, mut others) = (0, 0);
    for k in 0..200 {
        let a = [10.25 + (k % 20) as f32 * 2.0, 8.5 + (k / 20) as f32 * 3.0];
        let b = [a[0] + 3.0, a[1]];
        let match_ = [(0, a), (1, b)];
        let pixel = |[u, v]: [f32; 2]| PixelPoint::new(u, v);
        let device = rig.triangulate((0, pixel(a)), (1, pixel(b)));
        let Ok(found) = integers.point(&match_) else {
            assert!(device.is_err());
            continue;
        };
        points += 1;
        let device = device.unwrap().point_mm.map(f32::to_bits);
        assert_eq!(found.point_mm.map(f32::to_bits), device);
        assert_eq!(found.sigma_mm, None);
        let float = floats.point(&match_).unwrap();
        assert!(float.sigma_mm.is_some());
        others += u32::from(float.point_mm != found.point_mm);
    }
    assert!(points > 100 && others > 50, "{points} {others}");
}
