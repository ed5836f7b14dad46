//! Which golden blobs open is a matter of the forms that the library was built for: with any set of features.

use ray_runtime::{Aligned, OpenError, RayBlob};

macro_rules! golden {
    ($($name:literal),*) => {
        [$((
            $name,
            &Aligned(*include_bytes!(concat!("../../data/golden/", $name, ".rays"))) as &Aligned<[u8]>,
        )),*]
    };
}

/// Every form alone, and those that are mixed with splines.
static GOLDEN: [(&str, &Aligned<[u8]>); 5] = golden![
    "central-v3-fast",
    "non-central-v3-fast",
    "central-v3-small",
    "non-central-v3-cubic",
    "stereo-v2"
];

#[test]
fn blobs_of_forms_that_are_left_out_are_refused_as_such() {
    for (name, bytes) in GOLDEN {
        let opened = RayBlob::open(&bytes.0);
        let is_read = match name {
            "stereo-v2" => cfg!(feature = "old-versions"),
            _ if name.ends_with("fast") => cfg!(feature = "patches"),
            _ => cfg!(feature = "quantized"),
        };
        match opened {
            Ok(blob) => {
                assert!(is_read, "{name}");
                blob.run_self_tests().unwrap();
            }
            // Versions that are not read at all are refused as such.
            Err(error @ OpenError::WrongVersion { found: 2, .. }) => {
                assert_eq!((name, is_read, error.code()), ("stereo-v2", false, 3));
            }
            Err(error @ OpenError::FormLeftOut { camera: 0, .. }) => {
                assert!(!is_read, "{name}");
                assert_eq!(error.code(), 17);
            }
            Err(error) => panic!("{name}: {error}"),
        }
    }
}
