//! The application's ports on this board.

use core::convert::Infallible;

use firmware_sim::port::{BlobStore, Clock, Link};

use crate::machine;

/// The UART. The line has no notion of closing, so reading never returns 0 bytes.
#[derive(Debug)]
pub struct Uart(());

impl Uart {
    /// Switches it on.
    pub fn start() -> Self {
        machine::uart_start();
        Self(())
    }
}

impl Link for Uart {
    type Error = Infallible;

    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let mut count = 0;
        while count == 0 {
            for place in buffer.iter_mut() {
                let Some(byte) = machine::uart_receive() else {
                    break;
                };
                *place = byte;
                count += 1;
            }
            if count == 0 {
                machine::uart_wait();
            }
        }
        Ok(count)
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), Infallible> {
        for &byte in bytes {
            machine::uart_send(byte);
        }
        Ok(())
    }
}

/// The memory-mapped flash, with the blob at its start.
#[derive(Debug)]
pub struct Flash;

impl BlobStore for Flash {
    fn active_blob(&self) -> &[u8] {
        machine::flash()
    }
}

/// The board's timer as the device's clock. It counts on across the timer's wrap as long as it is
/// read at least once in 12 hours.
#[derive(Debug)]
pub struct Timer {
    last_ticks: u32,
    total_ticks: u64,
}

impl Timer {
    /// Starts it at zero.
    pub fn start() -> Self {
        machine::timer_start();
        Self {
            last_ticks: machine::timer_ticks(),
            total_ticks: 0,
        }
    }
}

impl Clock for Timer {
    fn uptime_ms(&mut self) -> u64 {
        let ticks = machine::timer_ticks();
        self.total_ticks += u64::from(ticks.wrapping_sub(self.last_ticks));
        self.last_ticks = ticks;
        self.total_ticks * 32 / u64::from(machine::TIMER_TICKS_IN_32_MS)
    }
}
