//! The board's registers and memory: the one file with `unsafe` in it.
//!
//! It is needed for three things that the language cannot check: volatile access to device
//! registers and flash at fixed addresses, views of the flash that the board maps into memory, and
//! switching an interrupt on. Each stands in a function of its own, with the reason why it is sound.
//!
//! The board of the device is Arm's MPS2 with the AN386 image (Arm DAI 0386): CMSDK UART 0 at 0x40004000, dual
//! timer at 0x40002000, both clocked with 25 MHz; 16 MiB of PSRAM at 0x21000000, which here stand
//! for memory-mapped NOR flash. QEMU emulates all of them. Images that only count and compare use nothing of a board but its
//! memory, and SysTick, which QEMU gives every core: they run on those of `memory/*.x`.
#![allow(unsafe_code)]

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
#[cfg(target_abi = "eabihf")]
use cortex_m::register::fpscr::Fpscr;

/// Start of the device's emulated flash.
pub const FLASH_START: usize = 0x2100_0000;

/// Its length, bytes.
pub const FLASH_LENGTH: usize = 16 << 20;

const UART0: usize = 0x4000_4000;
const DUAL_TIMER: usize = 0x4000_2000;
const SYST: usize = 0xe000_e010;

/// The registers used here, each valid and word-aligned on the boards whose images use it.
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
    SysTickControl = SYST,
    SysTickReload = SYST + 0x04,
    SysTickValue = SYST + 0x08,
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
const SYSTICK_ENABLE: u32 = 1 << 0;
const SYSTICK_PROCESSOR_CLOCK: u32 = 1 << 2;
const SYSTICK_HAS_COUNTED_TO_ZERO: u32 = 1 << 16;
const SYSTICK_MOST: u32 = 0x00ff_ffff;

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

/// Starts SysTick, to count instructions on any core.
pub fn stopwatch_start() {
    write(Register::SysTickReload, SYSTICK_MOST);
    write(
        Register::SysTickControl,
        SYSTICK_ENABLE | SYSTICK_PROCESSOR_CLOCK,
    );
}

/// Sets it to its start.
pub fn stopwatch_restart() {
    write(Register::SysTickValue, 0);
    // It goes to its start at the next tick. Reading the control register clears what it says of the last round.
    while read(Register::SysTickValue) == 0 {}
    let _ = read(Register::SysTickControl);
}

/// Its ticks, counted upwards in 24 bits.
pub fn stopwatch_ticks() -> u32 {
    SYSTICK_MOST - read(Register::SysTickValue)
}

/// Whether it has gone round since it was set to its start.
pub fn stopwatch_has_wrapped() -> bool {
    read(Register::SysTickControl) & SYSTICK_HAS_COUNTED_TO_ZERO != 0
}

/// What QEMU has loaded behind the program, for an image that only reads it.
pub fn flash() -> &'static [u8] {
    unsafe extern "C" {
        static _stored_start: u8;
        static _stored_end: u8;
    }
    let [start, end] = [&raw const _stored_start, &raw const _stored_end];
    // SAFETY: between these two symbols of `memory/*.x` the board has plain memory, outside of what the map gives to the
    // program, so no other Rust object overlaps; nothing writes there while the image runs, and any bytes are valid `u8`.
    unsafe { core::slice::from_raw_parts(start, end.addr().wrapping_sub(start.addr())) }
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
    // SAFETY: the board has 16 MiB of plain memory here, outside of what its map gives to the program, so no other Rust
    // object overlaps, and any bytes are valid `u8`. Nobody else has a reference to it: this one is handed out once.
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

/// Sets the mode that the floating-point unit computes in.
///
/// Rust takes it for granted that numbers are rounded to nearest, so code that runs in another mode may do
/// anything with numbers. It is for the image that shows what the runtime does then.
#[cfg(target_abi = "eabihf")]
pub fn set_float_mode(mode: Fpscr) {
    // SAFETY: a status and control register: writing it touches no memory. That numbers come out otherwise is what
    // it is for.
    unsafe { cortex_m::register::fpscr::write(mode) }
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

/// What the stack below is painted with, and how much of it at most, bytes. The stack has the RAM
/// to itself but for the few bytes of statics at its other end.
const PAINT: u32 = 0x5ca1_ab1e;
const PAINTED_BYTES: usize = 16 << 10;

/// How many bytes of stack a call writes to below the frame of its caller, from the lowest word
/// that it changed; and what it returned. At most 16 KiB are seen.
#[inline(never)]
pub fn stack_bytes_of<T, R>(work: fn(&T) -> R, on: &T) -> (u32, R) {
    unsafe extern "C" {
        /// Where `cortex-m-rt` says that the statics end.
        static __sheap: u32;
    }
    let end = stack_pointer();
    let start = (&raw const __sheap)
        .addr()
        .max(end.saturating_sub(PAINTED_BYTES));
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
