//! The device from outside: its application on a simulated flash, over TCP and a serial line, as a process
//! that is killed, and as an image in QEMU; what images cost.

mod app;
#[cfg(feature = "signed")]
mod attacks;
#[cfg(feature = "signed")]
mod owner;
mod parts;
mod power_cuts;
#[cfg(feature = "command")]
mod qemu;
#[cfg(feature = "signed")]
mod requests;
mod rig;
mod snapshots;
mod tcp;

#[cfg(feature = "command")]
mod cost;
#[cfg(feature = "command")]
mod flashing;
#[cfg(all(feature = "command", feature = "signed"))]
mod owned;
#[cfg(feature = "command")]
mod running;
#[cfg(feature = "command")]
mod same_bits;
#[cfg(all(feature = "serial", unix))]
mod serial;
