//! The device from outside: its application on a simulated flash, over TCP and a serial line, as a process
//! that is killed, and as an image in QEMU; what images cost.

mod app;
mod parts;
mod power_cuts;
mod rig;
mod snapshots;
mod tcp;

#[cfg(feature = "command")]
mod cost;
#[cfg(feature = "command")]
mod flashing;
#[cfg(feature = "command")]
mod qemu;
#[cfg(feature = "command")]
mod running;
#[cfg(feature = "command")]
mod same_bits;
#[cfg(all(feature = "serial", unix))]
mod serial;
#[cfg(feature = "signed")]
mod signed;
