//! The device: the application of `firmware-sim` behind the board's UART.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware_cortex_m::machine;
use firmware_cortex_m::ports::{Flash, Timer, Uart};
use firmware_sim::app::Device;
use firmware_sim::session::Session;

#[entry]
fn main() -> ! {
    let flash = Flash;
    let mut uart = Uart::start();
    let mut device = Device::boot("firmware-sim cortex-m", &flash, Timer::start());
    let mut session = Session::new();
    loop {
        // A UART never closes and never breaks, so one round of this lasts as long as the device is
        // on.
        let Ok(()) = session.serve(&mut uart, &mut device);
    }
}

/// No panic is reachable in this image: if one were, it would not have linked.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    machine::refuse_to_link()
}
