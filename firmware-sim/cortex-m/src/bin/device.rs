//! The device: the application of `firmware-sim` behind the board's UART.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware_cortex_m::machine;
use firmware_cortex_m::ports::{Timer, Uart, flash_regions};
use firmware_sim::app::Device;
use firmware_sim::session::Session;

#[entry]
fn main() -> ! {
    if let Some(mut regions) = flash_regions() {
        let mut uart = Uart::start();
        let mut device = Device::new("firmware-sim cortex-m", Timer::start());
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

/// No panic is reachable in this image: if one were, it would not have linked.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    machine::refuse_to_link()
}
