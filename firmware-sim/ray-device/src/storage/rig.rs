//! What a device knows of its own cameras: a record in the flash's first block, written when the
//! device is made.
//!
//! ```text
//! magic u32 | length of the message u32 | its checksum u32 | postcard message, a `Rig`
//! ```

use ray_runtime::RayBlob;

use super::access;
use super::layout::aligned;
use crate::frame::{MAX_MESSAGE, checksum};
use crate::port::{Clock, Flash};
use crate::protocol::{Refusal, Rig, RigPart};

const MAGIC: [u8; 4] = *b"RigF";
const HEAD_LENGTH: usize = 12;

/// The factory record at the start of this region, if there is a whole one.
#[inline(never)]
pub fn read<R: Flash>(factory: &mut R) -> Option<Rig> {
    let mut record = [0; aligned((HEAD_LENGTH + MAX_MESSAGE) as u32, 8) as usize];
    if factory.is_blank(0, factory.geometry().line()).ok()? {
        return None;
    }
    // Reads are whole multiples of 8 from the start, which every driver takes.
    access::read(factory, 0, record.first_chunk_mut::<16>()?).ok()?;
    let &[a, b, c, d, l0, l1, l2, l3, s0, s1, s2, s3] = record.first_chunk()?;
    if [a, b, c, d] != MAGIC {
        return None;
    }
    let end = u32::from_le_bytes([l0, l1, l2, l3]).saturating_add(HEAD_LENGTH as u32);
    access::read(factory, 0, record.get_mut(..aligned(end, 8) as usize)?).ok()?;
    let message = record.get(HEAD_LENGTH..end as usize)?;
    if checksum(message) != u32::from_le_bytes([s0, s1, s2, s3]) {
        return None;
    }
    postcard::from_bytes(message).ok()
}

/// Writes the factory record to a blank region. No request leads here.
///
/// # Errors
/// [`Refusal::FlashFailed`].
pub fn write<R: Flash, C: Clock>(factory: &mut R, rig: &Rig, clock: &mut C) -> Result<(), Refusal> {
    let mut record = [0; HEAD_LENGTH + MAX_MESSAGE];
    let (head, message) = record.split_at_mut(HEAD_LENGTH);
    // It is part of every status, which fits such a buffer.
    let message = postcard::to_slice(rig, message).map_err(|_| Refusal::BadFrame)?;
    let length = message.len();
    let numbers = [length as u32, checksum(message)].map(u32::to_le_bytes);
    let bytes = MAGIC.iter().chain(numbers.as_flattened());
    for (place, &byte) in head.iter_mut().zip(bytes) {
        *place = byte;
    }
    let record = record.get(..HEAD_LENGTH + length).unwrap_or_default();
    access::program(factory, 0, record, clock)
}

/// Compares a blob with the device's cameras: how many, and of each in order the name and the size
/// of the sensor. A blob carries no serial number.
///
/// # Errors
/// [`Refusal::OtherRig`] with the first difference.
#[inline(never)]
pub fn compare(blob: &RayBlob<'_>, rig: &Rig) -> Result<(), Refusal> {
    let other = |camera: usize, what, expected, found| {
        Err(Refusal::OtherRig {
            camera: camera as u8,
            what,
            expected,
            found,
        })
    };
    let (expected, found) = (rig.cameras.len(), blob.camera_count());
    if expected != found {
        return other(0, RigPart::Count, expected as u32, found as u32);
    }
    for (index, own) in rig.cameras.iter().enumerate() {
        let Some(camera) = blob.camera(index) else {
            continue;
        };
        if camera.name != own.name.as_str() {
            return other(index, RigPart::Name, 0, 0);
        }
        if camera.sensor_width != own.width_px {
            return other(index, RigPart::Width, own.width_px, camera.sensor_width);
        }
        if camera.sensor_height != own.height_px {
            return other(index, RigPart::Height, own.height_px, camera.sensor_height);
        }
    }
    Ok(())
}
