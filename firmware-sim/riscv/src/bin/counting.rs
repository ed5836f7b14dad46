//! Counts instructions and stack of the runtime's functions on RISC-V, for `firmware-sim cost`: takes a blob and a job from
//! memory and writes records to the host's standard output.

#![no_std]
#![no_main]

use firmware_cost::probes::{self, Machine, Task, Work};
use firmware_riscv::{
    HostOutput, end, hundred_nops, instructions_retired, refuse_to_link, stack_bytes_of, stored,
};

struct Virt(HostOutput);

impl Machine for Virt {
    #[inline(always)]
    fn restart() {}

    #[inline(always)]
    fn ticks() -> u32 {
        instructions_retired()
    }

    /// After 16 million instructions it would have, more than any other core's counter holds.
    #[inline(always)]
    fn has_wrapped() -> bool {
        false
    }

    fn stack_bytes_of(work: Work, task: &Task<'_>) -> u32 {
        stack_bytes_of(work, task).0
    }

    #[inline(always)]
    fn hundred_nops() {
        hundred_nops();
    }

    fn send(&mut self, record: &[u8]) -> Option<()> {
        self.0.write_all(record)
    }
}

#[allow(
    unsafe_code,
    reason = "the name by which the start calls it; no other function has it"
)]
#[unsafe(no_mangle)]
extern "C" fn rust_main() -> ! {
    end(run().is_some())
}

fn run() -> Option<()> {
    probes::run(&mut Virt(HostOutput::open()?), stored())
}

/// No panic is reachable in this image: what it counts holds no path to one.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    refuse_to_link()
}
