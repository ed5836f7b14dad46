//! Counts instructions and stack of the runtime's functions, for `firmware-sim cost`: takes a blob and
//! a job from the flash and writes records to standard output over semihosting.
//!
//! QEMU runs it with a fixed time per instruction, so SysTick counts instructions, exactly.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::hio::{self, HostStream};
use firmware_cortex_m::machine;
use firmware_cost::probes::{self, Machine, Task, Work};

struct Board(HostStream);

impl Machine for Board {
    #[inline(always)]
    fn restart() {
        machine::stopwatch_restart();
    }

    #[inline(always)]
    fn ticks() -> u32 {
        machine::stopwatch_ticks()
    }

    #[inline(always)]
    fn has_wrapped() -> bool {
        machine::stopwatch_has_wrapped()
    }

    fn stack_bytes_of(work: Work, task: &Task<'_>) -> u32 {
        machine::stack_bytes_of(work, task).0
    }

    #[inline(always)]
    fn hundred_nops() {
        machine::hundred_nops();
    }

    fn send(&mut self, record: &[u8]) -> Option<()> {
        self.0.write_all(record).ok()
    }
}

#[entry]
fn main() -> ! {
    cortex_m::interrupt::disable();
    machine::end(run().is_some())
}

fn run() -> Option<()> {
    machine::stopwatch_start();
    probes::run(&mut Board(hio::hstdout().ok()?), machine::flash())
}

/// No panic is reachable in this image: what it counts holds no path to one.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    machine::refuse_to_link()
}
