//! What RTIC asks of a board: its interrupts. A crate of registers (`stm32h7::stm32h743`, say) has all of this.
#![allow(unsafe_code)]

use cortex_m::interrupt::InterruptNumber;
// The vectors of the core and the start-up code.
use cortex_m_rt as _;

/// Bits of a priority in the AN386 image.
pub const NVIC_PRIO_BITS: u8 = 3;

/// The interrupts used here.
#[derive(Clone, Copy, Debug)]
#[repr(u16)]
pub enum Interrupt {
    /// A byte has arrived.
    UART0 = 0,
    /// A frame has been matched: an interrupt that is free on this board stands for that of a camera.
    CAMERA = 1,
}

/// The name that generated crates of registers give it, too.
pub use self::Interrupt as interrupt;

// SAFETY: both are below the 32 that the NVIC of AN386 has.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

unsafe extern "C" {
    fn UART0();
    fn CAMERA();
}

/// Their handlers, behind those of the core.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
pub static __INTERRUPTS: [unsafe extern "C" fn(); 2] = [UART0, CAMERA];
