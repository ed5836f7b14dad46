//! The board's registers and memory: the one file with `unsafe` in it.
//!
//! It is needed for three things that the language cannot check: volatile access to device
//! registers and flash at fixed addresses, views of the flash that the board maps into memory, and
//! switching an interrupt on. Each stands in a function of its own, with the reason why it is sound.
//!
//! The board is Arm's MPS2 with the AN386 image (Arm DAI 0386): CMSDK UART 0 at 0x40004000, dual
//! timer at 0x40002000, both clocked with 25 MHz; 16 MiB of PSRAM at 0x21000000, which here stand
//! for memory-mapped NOR flash. QEMU emulates all of them.
#![allow(unsafe_code)]

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;

/// Start of the emulated flash.
pub const FLASH_START: usize = 0x2100_0000;

/// Its length, bytes.
pub const FLASH_LENGTH: usize = 16 << 20;

const UART0: usize = 0x4000_4000;
const DUAL_TIMER: usize = 0x4000_2000;

/// The registers used here, each valid and word-aligned on this board.
#[derive(Clone, Copy)]
#[repr(usize)]
enum Register {
    UartData = UART0,
    UartState = UART0 + 0x04,
    UartControl = UART0 + 0x08,
    UartInterrupts = UART0 + 0x0c,
    UartBaudDivider = UART0 + 0x10,
    TimerLoad = DUAL_TIMER,
    TimerValue = DUAL_TIMER + 0x04,
    TimerControl = DUAL_TIMER + 0x08,
}

const STATE_TRANSMIT_FULL: u32 = 1 << 0;
const STATE_RECEIVE_FULL: u32 = 1 << 1;
const CONTROL_TRANSMIT: u32 = 1 << 0;
const CONTROL_RECEIVE: u32 = 1 << 1;
const CONTROL_RECEIVE_INTERRUPT: u32 = 1 << 3;
const INTERRUPT_RECEIVE: u32 = 1 << 1;
const TIMER_ENABLE: u32 = 1 << 7;
const TIMER_PRESCALE_256: u32 = 0b10 << 2;
const TIMER_32_BIT: u32 = 1 << 1;

/// Timer ticks in 32 ms: 25 MHz / 256 are 97,656.25 ticks a second.
pub const TIMER_TICKS_IN_32_MS: u32 = 3125;

fn read(register: Register) -> u32 {
    // SAFETY: every `Register` is the address of a word-aligned device register that exists on this
    // board. No Rust object lives there, and reading any of them cannot break memory safety.
    unsafe { (register as usize as *const u32).read_volatile() }
}

fn write(register: Register, value: u32) {
    // SAFETY: as for `read`; neither the UART nor the timer can access memory on its own.
    unsafe { (register as usize as *mut u32).write_volatile(value) }
}

/// The interrupt of UART 0's receiver.
#[derive(Clone, Copy)]
struct Uart0Receive;

// SAFETY: AN386 wires the receiver of UART 0 to interrupt 0, which is below the 32 that its NVIC
// has.
unsafe impl InterruptNumber for Uart0Receive {
    fn number(self) -> u16 {
        0
    }
}

/// Switches the UART on, with its receiver able to wake the processor.
///
/// Interrupts stay masked for good: a pending one ends [`uart_wait`] without any handler, so none
/// can come between the look at the receiver and the sleep.
pub fn uart_start() {
    cortex_m::interrupt::disable();
    // The emulated line has no rate; 16 is the least divider that the UART takes.
    write(Register::UartBaudDivider, 16);
    write(
        Register::UartControl,
        CONTROL_TRANSMIT | CONTROL_RECEIVE | CONTROL_RECEIVE_INTERRUPT,
    );
    // SAFETY: interrupts are masked, so unmasking this line starts no handler and breaks no
    // critical section.
    unsafe { NVIC::unmask(Uart0Receive) }
}

/// Takes a byte out of the receiver, if there is one.
pub fn uart_receive() -> Option<u8> {
    if read(Register::UartState) & STATE_RECEIVE_FULL == 0 {
        return None;
    }
    write(Register::UartInterrupts, INTERRUPT_RECEIVE);
    let [byte, ..] = read(Register::UartData).to_le_bytes();
    Some(byte)
}

/// Sleeps until the receiver may hold a byte.
pub fn uart_wait() {
    cortex_m::asm::wfi();
    // The line stays pending until it is cleared here; a byte that came meanwhile is seen by the
    // next look.
    NVIC::unpend(Uart0Receive);
}

/// Sends a byte, waiting until there is room for it.
pub fn uart_send(byte: u8) {
    while read(Register::UartState) & STATE_TRANSMIT_FULL != 0 {}
    write(Register::UartData, u32::from(byte));
}

/// Starts the timer, which runs freely at 25 MHz / 256 and wraps after 12.2 hours.
pub fn timer_start() {
    write(Register::TimerLoad, u32::MAX);
    write(
        Register::TimerControl,
        TIMER_ENABLE | TIMER_PRESCALE_256 | TIMER_32_BIT,
    );
}

/// Starts the timer at the full 25 MHz, to count instructions: it wraps after 171 s.
pub fn counter_start() {
    write(Register::TimerLoad, u32::MAX);
    write(Register::TimerControl, TIMER_ENABLE | TIMER_32_BIT);
}

/// Ticks of the timer, counted upwards.
pub fn timer_ticks() -> u32 {
    !read(Register::TimerValue)
}

/// The emulated flash, for an image that only reads it: one that calls [`flash_to_write`] must not
/// call this.
pub fn flash() -> &'static [u8] {
    // SAFETY: the board has 16 MiB of plain memory here, outside of what `memory.x` gives to the
    // program, so no other Rust object overlaps; nothing writes there while the image runs, and any
    // bytes are valid `u8`.
    unsafe { core::slice::from_raw_parts(FLASH_START as *const u8, FLASH_LENGTH) }
}

/// The emulated flash, for the image that writes it; `None` from the second call on. Whoever takes it
/// splits it into regions, so that none can be written while it is borrowed for reading.
pub fn flash_to_write() -> Option<&'static mut [u8]> {
    static IS_TAKEN: AtomicBool = AtomicBool::new(false);
    // A core without an atomic swap has one processor, and no interrupt comes between.
    let was_taken = cortex_m::interrupt::free(|_| {
        let was_taken = IS_TAKEN.load(Ordering::Relaxed);
        IS_TAKEN.store(true, Ordering::Relaxed);
        was_taken
    });
    if was_taken {
        return None;
    }
    // SAFETY: as for `flash`, and nobody else has a reference to it: this one is handed out once,
    // and the image that takes it calls `flash` nowhere.
    Some(unsafe { core::slice::from_raw_parts_mut(FLASH_START as *mut u8, FLASH_LENGTH) })
}

/// Writes to flash, byte by byte in this order, as long as there are both a place and a byte.
///
/// What is in flash must be there should the power go now, so the compiler may neither put a write
/// off nor swap two.
pub fn write_flash(place: &mut [u8], bytes: impl Iterator<Item = u8>) {
    for (place, byte) in place.iter_mut().zip(bytes) {
        // SAFETY: a valid place, borrowed for writing.
        unsafe { core::ptr::from_mut(place).write_volatile(byte) }
    }
}

/// Ends QEMU: well, or with a failure.
pub fn end(is_well: bool) -> ! {
    use cortex_m_semihosting::debug;
    let status = if is_well {
        debug::EXIT_SUCCESS
    } else {
        debug::EXIT_FAILURE
    };
    loop {
        debug::exit(status);
    }
}

/// Called by the panic handler of an image that must not contain one: the function that it calls
/// exists nowhere, so a panic that the compiler could not rule out ends the build with an undefined
/// symbol.
pub fn refuse_to_link() -> ! {
    unsafe extern "C" {
        fn a_panic_is_reachable_in_this_image() -> !;
    }
    // SAFETY: never linked, hence never called.
    unsafe { a_panic_is_reachable_in_this_image() }
}

/// A hundred instructions and no other.
#[inline(always)]
pub fn hundred_nops() {
    // SAFETY: `nop` does nothing.
    unsafe {
        core::arch::asm!(
            ".rept 100",
            "nop",
            ".endr",
            options(nomem, nostack, preserves_flags)
        );
    }
}

/// Where the stack ends now.
#[inline(always)]
fn stack_pointer() -> usize {
    let pointer: usize;
    // SAFETY: reads a register.
    unsafe {
        core::arch::asm!("mov {}, sp", out(reg) pointer, options(nomem, nostack, preserves_flags));
    }
    pointer
}

/// What the stack below is painted with, and how much of it, bytes. The stack has the 4 MiB of RAM
/// to itself but for the few bytes of statics at their other end.
const PAINT: u32 = 0x5ca1_ab1e;
const PAINTED_BYTES: usize = 16 << 10;

/// How many bytes of stack a call writes to below the frame of its caller, from the lowest word
/// that it changed; and what it returned. At most 16 KiB are seen.
#[inline(never)]
pub fn stack_bytes_of<T, R>(work: fn(&T) -> R, on: &T) -> (u32, R) {
    let end = stack_pointer();
    let start = end - PAINTED_BYTES;
    for address in (start..end).step_by(4) {
        // SAFETY: the words below the stack pointer are RAM that belongs to nobody: this
        // function has its whole frame above, calls nothing meanwhile, and interrupts are masked.
        unsafe { (address as *mut u32).write_volatile(PAINT) }
    }
    let result = work(on);
    let mut lowest = start;
    // SAFETY: as above; every address is painted, or was written by `work`.
    while lowest < end && unsafe { (lowest as *const u32).read_volatile() } == PAINT {
        lowest += 4;
    }
    ((end - lowest) as u32, result)
}
