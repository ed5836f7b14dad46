//! QEMU's RISC-V board `virt`: start, counter of instructions, and the host's services. The one file with `unsafe` in
//! it, for what the language cannot check: instructions, and memory at addresses that the linker gives.
//!
//! The image that is built from this crate links only if the compiler proved that no panic is reachable.

#![no_std]
#![allow(unsafe_code)]

use core::arch::{asm, global_asm};

// RAM is zero when QEMU starts, and the image holds its statics: nothing is left to do but to set the stack.
global_asm!(
    ".section .text.start, \"ax\"",
    ".global _start",
    "_start:",
    "la sp, _stack_end",
    "call rust_main",
    "1: j 1b",
);

unsafe extern "C" {
    static _stored_start: u8;
    static _stored_end: u8;
    static _stack_start: u8;
    fn a_panic_is_reachable_in_this_image() -> !;
}

/// What QEMU has loaded behind the program.
pub fn stored() -> &'static [u8] {
    let [start, end] = [&raw const _stored_start, &raw const _stored_end];
    // SAFETY: between these two symbols of `virt.ld` the board has plain memory that nothing else uses or writes, and
    // any bytes are valid `u8`.
    unsafe { core::slice::from_raw_parts(start, end.addr().wrapping_sub(start.addr())) }
}

/// The counter of instructions, lower half: under a fixed time per instruction QEMU gives its own time, ns.
#[inline(always)]
pub fn instructions_retired() -> u32 {
    let count: u32;
    // SAFETY: reads a counter.
    unsafe { asm!("csrr {}, minstret", out(reg) count, options(nomem, nostack)) }
    count
}

/// A hundred instructions and no other.
#[inline(always)]
pub fn hundred_nops() {
    // SAFETY: `nop` does nothing.
    unsafe {
        asm!(
            ".rept 100",
            "nop",
            ".endr",
            options(nomem, nostack, preserves_flags)
        );
    }
}

/// What the stack below is painted with, and how much of it, bytes.
const PAINT: u32 = 0x5ca1_ab1e;
const PAINTED_BYTES: usize = 16 << 10;

/// How many bytes of stack a call writes to below the frame of its caller, at most 16 KiB; and what it returned.
#[inline(never)]
pub fn stack_bytes_of<T, R>(work: fn(&T) -> R, on: &T) -> (u32, R) {
    let end: usize;
    // SAFETY: reads a register.
    unsafe { asm!("mv {}, sp", out(reg) end, options(nomem, nostack, preserves_flags)) }
    let start = (&raw const _stack_start)
        .addr()
        .max(end.saturating_sub(PAINTED_BYTES));
    for address in (start..end).step_by(4) {
        // SAFETY: the words below the stack pointer are RAM that belongs to nobody: this function has its whole frame
        // above, calls nothing meanwhile, and no interrupt is enabled.
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

/// Services of the host, by the numbers of Arm's semihosting, which RISC-V took over.
const OPEN: usize = 0x01;
const WRITE: usize = 0x05;
const EXIT: usize = 0x18;

fn host(service: usize, argument: usize) -> usize {
    let answer;
    // SAFETY: these three instructions, in this order and not compressed, ask the host for a service, which reads what
    // the argument points to.
    unsafe {
        asm!(
            ".option push",
            ".option norvc",
            ".balign 16",
            "slli x0, x0, 0x1f",
            "ebreak",
            "srai x0, x0, 7",
            ".option pop",
            inout("a0") service => answer,
            in("a1") argument,
            options(nostack)
        );
    }
    answer
}

/// The host's standard output.
#[derive(Debug)]
pub struct HostOutput(usize);

impl HostOutput {
    /// Opens it; `None` if there is no host.
    pub fn open() -> Option<Self> {
        const NAME: &core::ffi::CStr = c":tt";
        const FOR_WRITING: usize = 4;
        let block = [NAME.as_ptr().addr(), FOR_WRITING, NAME.count_bytes()];
        let handle = host(OPEN, block.as_ptr().addr());
        (handle != usize::MAX).then_some(Self(handle))
    }

    /// Writes all of the bytes; `None` if that fails.
    pub fn write_all(&mut self, bytes: &[u8]) -> Option<()> {
        let block = [self.0, bytes.as_ptr().addr(), bytes.len()];
        // What is left to write.
        (host(WRITE, block.as_ptr().addr()) == 0).then_some(())
    }
}

/// Ends QEMU: well, or with a failure.
pub fn end(is_well: bool) -> ! {
    const APPLICATION_EXIT: usize = 0x2_0026;
    const RUN_TIME_ERROR: usize = 0x2_0023;
    loop {
        host(
            EXIT,
            if is_well {
                APPLICATION_EXIT
            } else {
                RUN_TIME_ERROR
            },
        );
    }
}

/// Called by the panic handler: the function that it calls exists nowhere, so a panic that the compiler could not rule out
/// ends the build with an undefined symbol.
pub fn refuse_to_link() -> ! {
    // SAFETY: never linked, hence never called.
    unsafe { a_panic_is_reachable_in_this_image() }
}
