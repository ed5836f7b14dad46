//! The application of `ray-device` behind the board's UART.

use ray_device::app::Device;
use ray_device::session::Session;
use ray_device::storage::trust::Trust;

use crate::machine;
use crate::ports::{Timer, Uart, flash_regions};

/// Serves for as long as there is power.
pub fn run(trust: Trust) -> ! {
    if let Some(mut regions) = flash_regions() {
        let mut uart = Uart::start();
        let mut device = Device::new("firmware-sim cortex-m", Timer::start()).trusting(trust);
        let mut session = Session::new();
        loop {
            // A UART never closes and never breaks, so this lasts until another blob is active.
            let mut epoch = device.epoch(&mut regions);
            let Ok(_) = session.serve(&mut uart, &mut epoch);
        }
    }
    // Not reached: the flash has not been taken before.
    loop {
        machine::uart_wait();
    }
}
