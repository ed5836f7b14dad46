//! Flash by the driver, with every failure told: erasing, programming whole lines, reading.

use super::layout::aligned;
use crate::frame::RunningChecksum;
use crate::port::{Clock, Flash, Geometry};
use crate::protocol::{FlashOperation, Refusal};

/// Bytes that are read or programmed between two looks at the watchdog: the longest line.
const PIECE: usize = Geometry::MAX_UNIT as usize;

/// A refusal that says where in the device's flash.
fn failed<R: Flash>(flash: &R, operation: FlashOperation, address: u32) -> Refusal {
    Refusal::FlashFailed {
        operation,
        address: flash.start().saturating_add(address),
    }
}

/// Erases the blocks from `start` to `end`, both multiples of the block; nothing on a part that needs no
/// erase.
///
/// # Errors
/// [`Refusal::FlashFailed`].
#[inline(never)]
pub fn erase<R: Flash, C: Clock>(
    flash: &mut R,
    start: u32,
    end: u32,
    clock: &mut C,
) -> Result<(), Refusal> {
    let Geometry {
        block, needs_erase, ..
    } = flash.geometry();
    let mut at = start;
    while needs_erase && at < end {
        clock.step();
        let next = at.saturating_add(block);
        flash
            .erase(at, next)
            .map_err(|_| failed(flash, FlashOperation::Erase, at))?;
        at = next;
    }
    Ok(())
}

/// Makes the lines from `start` to `end` read as erased, on any part.
///
/// # Errors
/// [`Refusal::FlashFailed`].
#[inline(never)]
pub fn clear<R: Flash, C: Clock>(
    flash: &mut R,
    start: u32,
    end: u32,
    clock: &mut C,
) -> Result<(), Refusal> {
    let geometry = flash.geometry();
    if geometry.needs_erase {
        return erase(flash, start, end, clock);
    }
    let mut at = start;
    while at < end {
        program(flash, at, &[geometry.erased], clock)?;
        at = at.saturating_add(geometry.line());
    }
    Ok(())
}

/// Programs `bytes` at `start`, a multiple of the line, and reads them back. They may end inside a line: the
/// rest of it stays as erased.
///
/// # Errors
/// [`Refusal::FlashFailed`].
#[inline(never)]
pub fn program<R: Flash, C: Clock>(
    flash: &mut R,
    start: u32,
    bytes: &[u8],
    clock: &mut C,
) -> Result<(), Refusal> {
    let Geometry { erased, .. } = flash.geometry();
    let line = flash.geometry().line().max(1) as usize;
    let mut buffer = [erased; PIECE];
    for (address, bytes) in (start..).step_by(line).zip(bytes.chunks(line)) {
        let rejected = failed(flash, FlashOperation::Program, address);
        let Some(buffer) = buffer.get_mut(..line) else {
            return Err(rejected);
        };
        let wanted = || bytes.iter().copied().chain(core::iter::repeat(erased));
        for (place, byte) in buffer.iter_mut().zip(wanted()) {
            *place = byte;
        }
        clock.step();
        flash.write(address, buffer).map_err(|_| rejected)?;
        read(flash, address, buffer)?;
        if !wanted()
            .zip(&*buffer)
            .all(|(wanted, &found)| wanted == found)
        {
            return Err(rejected);
        }
    }
    Ok(())
}

/// Reads whole lines, or whatever else the driver reads at once.
///
/// # Errors
/// [`Refusal::FlashFailed`].
pub fn read<R: Flash>(flash: &mut R, start: u32, bytes: &mut [u8]) -> Result<(), Refusal> {
    flash
        .read(start, bytes)
        .map_err(|_| failed(flash, FlashOperation::Read, start))
}

/// The checksum of the `length` bytes at `start`, a multiple of the line, as the driver reads them, every
/// line that they touch to its end.
///
/// # Errors
/// [`Refusal::FlashFailed`].
#[inline(never)]
pub fn checksum<R: Flash, C: Clock>(
    flash: &mut R,
    start: u32,
    length: u32,
    clock: &mut C,
) -> Result<u32, Refusal> {
    let line = flash.geometry().line();
    let mut sum = RunningChecksum::default();
    let mut buffer = [0; PIECE];
    let mut at = 0;
    while at < length {
        let wanted = (length - at).min(PIECE as u32);
        let Some(piece) = buffer.get_mut(..aligned(wanted, line) as usize) else {
            break;
        };
        clock.step();
        read(flash, start.saturating_add(at), piece)?;
        sum.add(piece.get(..wanted as usize).unwrap_or_default());
        at = at.saturating_add(wanted);
    }
    Ok(sum.finish())
}
