//! Devices without a device: [`ray_device`] with a simulated flash on the host, and as an image in QEMU.

#[cfg(feature = "simulated")]
pub mod flash_file;
#[cfg(feature = "simulated")]
pub mod host;
#[cfg(feature = "simulated")]
pub mod qemu;
pub mod sim_flash;
