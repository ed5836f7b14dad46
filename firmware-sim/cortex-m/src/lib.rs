//! What the images share: the board's UART, timer and flash as ports of the application.
//!
//! These kinds of image are built from this crate:
//! - `src/bin/device.rs`, the device application. It links only if the compiler proved that no
//!   panic is reachable;
//! - `src/bin/device_signed.rs`, the same for the owner of a key, and `src/bin/counting_signature.rs`, which
//!   counts what verifying takes; both may contain panics of the crate that verifies;
//! - `src/bin/counting.rs` and `src/bin/footprint_*.rs`, which `firmware-sim cost` runs and reads.
//!   They link only without a panic, too;
//! - `src/bin/panic_by_*.rs`, which must not link;
//! - `src/bin/NAME.rs` with a `NAME.out` beside it, a check that prints over semihosting and is
//!   compared with that file.

#![no_std]

pub mod device;
pub mod machine;
pub mod ports;
