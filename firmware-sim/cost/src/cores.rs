//! The cores that are counted: what each image is compiled for, and which of QEMU's machines runs it.

/// A core, and how an image is made and run for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Core {
    /// What its maker calls it.
    pub name: &'static str,
    /// The target that the images are compiled for.
    pub target: &'static str,
    /// What is given to the compiler besides.
    pub flags: &'static str,
    /// QEMU's program.
    pub emulator: &'static str,
    /// QEMU's machine.
    pub machine: &'static str,
    /// QEMU's name of the core.
    pub cpu: &'static str,
    /// Where what an image reads is loaded: `_stored_start` in the target's memory map.
    pub stored_at: u32,
    /// A tick of the counter that the image looks at, ps of QEMU's time.
    pub tick_ps: u64,
}

/// The core of the device's image, and of the tables in detail.
pub const CORTEX_M4F: Core = Core {
    name: "Cortex-M4F",
    target: "thumbv7em-none-eabihf",
    flags: "",
    emulator: "qemu-system-arm",
    machine: "mps2-an386",
    cpu: "cortex-m4",
    stored_at: 0x0004_0000,
    // 25 MHz.
    tick_ps: 40_000,
};

const CORTEX_M33: Core = Core {
    name: "Cortex-M33",
    target: "thumbv8m.main-none-eabihf",
    machine: "mps2-an505",
    cpu: "cortex-m33",
    stored_at: 0x1004_0000,
    // 20 MHz.
    tick_ps: 50_000,
    ..CORTEX_M4F
};

const DSP: &str = "-C target-feature=+dsp";

/// All of them.
pub const CORES: [Core; 8] = [
    Core {
        name: "Cortex-M0",
        target: "thumbv6m-none-eabi",
        machine: "microbit",
        cpu: "cortex-m0",
        stored_at: 0x0002_0000,
        // 16 MHz.
        tick_ps: 62_500,
        ..CORTEX_M4F
    },
    Core {
        name: "Cortex-M3",
        target: "thumbv7m-none-eabi",
        machine: "mps2-an385",
        cpu: "cortex-m3",
        ..CORTEX_M4F
    },
    CORTEX_M4F,
    Core {
        name: "Cortex-M7",
        machine: "mps2-an500",
        cpu: "cortex-m7",
        ..CORTEX_M4F
    },
    CORTEX_M33,
    Core {
        name: "Cortex-M33 with DSP",
        flags: DSP,
        ..CORTEX_M33
    },
    Core {
        name: "Cortex-M55",
        flags: DSP,
        machine: "mps3-an547",
        cpu: "cortex-m55",
        // 32 MHz.
        tick_ps: 31_250,
        ..CORTEX_M33
    },
    Core {
        name: "riscv32imac",
        target: "riscv32imac-unknown-none-elf",
        flags: "",
        emulator: "qemu-system-riscv32",
        machine: "virt",
        cpu: "rv32",
        stored_at: 0x8010_0000,
        // The counter of instructions, which QEMU makes of its own time.
        tick_ps: 1000,
    },
];

impl Core {
    /// The cores whose images are compiled for this target.
    pub fn of_target(target: &str) -> Vec<Self> {
        let cores = CORES.into_iter();
        cores.filter(|core| core.target == target).collect()
    }

    /// The targets of all cores, each once.
    pub fn targets() -> Vec<&'static str> {
        let mut targets: Vec<_> = CORES.iter().map(|core| core.target).collect();
        targets.dedup();
        targets
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_target_has_its_cores() {
        let targets = Core::targets();
        assert_eq!(targets.len(), 5);
        let cores = targets.iter().map(|target| Core::of_target(target).len());
        assert_eq!(cores.sum::<usize>(), CORES.len());
        assert!(Core::of_target("x86_64-unknown-linux-gnu").is_empty());
    }

    /// The counter's ticks are short enough to tell one instruction from the next.
    #[test]
    fn an_instruction_takes_two_ticks_at_least() {
        for core in CORES {
            assert!(
                1000 << crate::count::TIME_SHIFT >= 2 * core.tick_ps,
                "{core:?}"
            );
        }
    }
}
