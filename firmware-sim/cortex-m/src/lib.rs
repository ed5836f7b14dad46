//! What the images share: the board's UART, timer and flash as ports of the application.
//!
//! Two kinds of image are built from this crate:
//! - `src/bin/device.rs`, the device application. It links only if the compiler proved that no
//!   panic is reachable;
//! - any other `src/bin/NAME.rs`, a check that prints over semihosting and is compared with
//!   `NAME.out` beside it.

#![no_std]

pub mod machine;
pub mod ports;
