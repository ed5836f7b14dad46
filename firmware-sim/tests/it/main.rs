//! The device from outside: its application on a simulated flash, over TCP and a serial line, as a process
//! that is killed, and as an image in QEMU; what images cost.

mod adoption;
mod app;
#[path = "../../../ray-runtime/tests/it/c_build.rs"]
mod c_build;
mod c_device;
mod parts;
mod power_cuts;
mod rig;
mod slot_image;
mod snapshots;
mod tcp;

#[cfg(feature = "command")]
mod cost;
#[cfg(feature = "command")]
mod flashing;
#[cfg(feature = "command")]
mod float_modes;
#[cfg(feature = "command")]
mod integer;
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
