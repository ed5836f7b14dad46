//! What was done to a simulated flash, and how much of it at a time.

use std::sync::atomic::{AtomicU64, Ordering};

/// What was done to a flash, counted, and how much of it since the watchdog was last fed.
#[derive(Debug, Default)]
pub struct Effort {
    read: AtomicU64,
    since_step: [AtomicU64; 3],
    most: [AtomicU64; 3],
}

/// Kinds of effort.
#[derive(Clone, Copy, Debug)]
pub enum Work {
    Read,
    Program,
    Erase,
}

impl Effort {
    /// To be called by the device's [`Clock::step`](ray_device::port::Clock::step).
    pub fn step(&self) {
        for count in &self.since_step {
            count.store(0, Ordering::Relaxed);
        }
    }

    /// Forgets what was between steps so far.
    pub fn start_watching(&self) {
        self.step();
        for most in &self.most {
            most.store(0, Ordering::Relaxed);
        }
    }

    /// Bytes read through the driver from any slot, so far.
    pub fn bytes_read(&self) -> u64 {
        self.read.load(Ordering::Relaxed)
    }

    /// Most bytes read, most bytes programmed, and most blocks erased between two steps.
    pub fn most_between_steps(&self) -> [u64; 3] {
        self.most
            .each_ref()
            .map(|most| most.load(Ordering::Relaxed))
    }

    pub(super) fn note(&self, work: Work, amount: u64) {
        if matches!(work, Work::Read) {
            self.read.fetch_add(amount, Ordering::Relaxed);
        }
        let kind = work as usize;
        let (Some(since), Some(most)) = (self.since_step.get(kind), self.most.get(kind)) else {
            return;
        };
        let sum = since.fetch_add(amount, Ordering::Relaxed) + amount;
        most.fetch_max(sum, Ordering::Relaxed);
    }
}
