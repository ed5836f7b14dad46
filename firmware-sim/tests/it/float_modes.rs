//! What modes of the floating-point unit do: those that change subnormal numbers, NaN or half precision change no bit
//! of any golden blob's answers; in another rounding mode none opens, and the error says which.

use std::fmt::Write as _;

use crate::same_bits::{blobs, digest_on_host};
use firmware_cost::same_bits::FLOAT_MODE_MATCHES;
use firmware_sim::simulated::qemu;

#[test]
fn equal_bits_in_every_harmless_mode_and_no_blob_in_another_rounding() {
    let image = qemu::build_image("float_modes").unwrap();
    for blob in blobs() {
        let name = blob.display();
        let output = qemu::DEVICE.run_to_end(&image, Some(&blob)).unwrap();
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{name}: {printed}");
        let host = format!("{:08x}", digest_on_host(&blob, FLOAT_MODE_MATCHES).checksum);
        let harmless = [
            "default",
            "flush-to-zero",
            "default-nan",
            "alternative-half",
            "all-three",
        ];
        let mut expected = String::new();
        for mode in harmless {
            writeln!(expected, "{mode} {host}").unwrap();
        }
        // The error's code, in blobs of every version.
        for mode in ["up", "down", "to-zero"] {
            writeln!(expected, "{mode} code 16").unwrap();
        }
        assert_eq!(printed, expected, "{name}");
    }
}
