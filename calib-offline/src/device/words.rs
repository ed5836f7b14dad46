//! A device's state for people.

use super::state::{CameraState, DeviceState, OwnerState, SlotState};
use ray_device::protocol::{OTHER_PART, OTHER_PART_WORDS};
use ray_device::storage::trust::Distrust;

/// What the device is, what it holds, and whether its calibration still fits: a few lines.
pub fn state_in_words(state: &DeviceState) -> String {
    let mut lines = vec![format!(
        "{}, firmware {}, up for {}; {} requests answered, {} refused; {} updates, {} rollbacks",
        state.device,
        state.firmware,
        duration(state.uptime_ms),
        state.answered,
        state.refused,
        state.updates,
        state.rollbacks
    )];
    lines.push(match (&state.blob, state.open_error) {
        (Some(blob), _) => format!(
            "measures with blob {} ({} bytes): {}{}",
            blob.identity,
            blob.bytes,
            cameras(&blob.cameras),
            match usize::from(blob.camera_count).saturating_sub(blob.cameras.len()) {
                0 => String::new(),
                more => format!(" and {more} more"),
            }
        ),
        (None, code) => format!(
            "measures nothing: {}",
            match code {
                Some(2) | None => "its flash holds no blob; send one with calib-offline flash".to_owned(),
                Some(code) if let Some(reason) = Distrust::from_code(code) => {
                    format!("the blob in its flash is not used: {reason} (code {code})")
                }
                Some(OTHER_PART) => format!("{} (code {OTHER_PART})", for_other_part("its slot")),
                Some(code) => format!(
                    "the blob in its flash cannot be opened (code {code}); send one with calib-offline flash"
                ),
            }
        ),
    });
    if state.arithmetic == "integer" {
        lines.push("computes in integers: points without standard deviations".to_owned());
    }
    for (number, slot) in state.slots.iter().enumerate() {
        lines.push(format!("slot {number}: {}", slot_in_words(slot)));
    }
    if let Some(update) = &state.update {
        lines.push(format!(
            "an update is under way: {} of {} bytes of blob {}",
            update.received_bytes, update.bytes, update.identity
        ));
    }
    if let Some(rig) = &state.rig {
        let serial = match rig.serial.as_str() {
            "" => String::new(),
            serial => format!(", rig {serial}"),
        };
        lines.push(format!(
            "takes blobs for its own cameras only: {}{serial}",
            cameras(&rig.cameras)
        ));
    }
    if let Some(owner) = &state.owner {
        lines.push(owner_in_words(owner));
    }
    lines.push(match &state.gaps {
        Some(gaps) => gaps.report.to_string(),
        None => "whether the calibration still fits is not known yet: nothing was measured since it started"
            .to_owned(),
    });
    lines.join("\n")
}

fn slot_in_words(slot: &SlotState) -> String {
    match slot {
        SlotState::Empty => "empty".to_owned(),
        SlotState::Receiving => "receives a blob".to_owned(),
        SlotState::Holds {
            is_active,
            sequence,
            bytes,
            identity,
            version,
            ..
        } => format!(
            "blob {identity} ({bytes} bytes), number {sequence}{}{}",
            match version {
                Some(version) => format!(", version {version}"),
                None => String::new(),
            },
            if *is_active {
                ", in use"
            } else {
                "; calib-offline device rollback makes it the one in use"
            }
        ),
        SlotState::Unusable {
            sequence,
            open_error,
        } => match Distrust::from_code(*open_error) {
            Some(reason) => {
                format!("blob number {sequence} is not used: {reason} (code {open_error})")
            }
            None if *open_error == OTHER_PART => {
                format!("{} (code {OTHER_PART})", for_other_part("what is in it"))
            }
            None => format!("what was number {sequence} is damaged (code {open_error})"),
        },
    }
}

/// What a slot with an image for another part says, and what to do.
fn for_other_part(what: &str) -> String {
    format!(
        "{what} {OTHER_PART_WORDS}; \
         write the image for this part (calib-offline export --format slot-image --part), or send a blob with calib-offline flash"
    )
}

fn owner_in_words(owner: &OwnerState) -> String {
    let keys = (0..).zip(&owner.keys).filter_map(|(number, key)| {
        let is_retired = number < owner.retired_below;
        let retired = if is_retired { " (retired)" } else { "" };
        key.as_ref()
            .map(|key| format!("key {number} {key}...{retired}"))
    });
    let keys = keys.collect::<Vec<_>>().join(", ");
    let versions = match owner.newest_version {
        0 => "nothing signed has been in use yet".to_owned(),
        newest => format!(
            "takes versions from {} on, goes back to {} at most",
            newest.saturating_add(1),
            owner.least_version.max(1)
        ),
    };
    format!("changed by its owner only: {keys}; {versions}")
}

fn cameras(cameras: &[CameraState]) -> String {
    let of_one = |camera: &CameraState| {
        format!("{} {} x {}", camera.name, camera.width_px, camera.height_px)
    };
    cameras.iter().map(of_one).collect::<Vec<_>>().join(", ")
}

fn duration(ms: u64) -> String {
    let seconds = ms / 1000;
    match seconds {
        0..=119 => format!("{seconds} s"),
        120..=7199 => format!("{} min", seconds / 60),
        7200..=172_799 => format!("{} h", seconds / 3600),
        _ => format!("{} days", seconds / 86400),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::state::{BlobState, GapState, RigState, UpdateState};
    use crate::snapshot::assert_snapshot;
    use ray_device::health::{GapReport, Predicted};

    #[test]
    fn times_are_told_in_fitting_units() {
        let told = [0, 119_999, 120_000, 7_200_000, 172_800_000].map(duration);
        assert_eq!(told, ["0 s", "119 s", "2 min", "2 h", "2 days"]);
    }

    fn cameras() -> Vec<CameraState> {
        let of_one = |name: &str| CameraState {
            name: name.to_owned(),
            width_px: 1280,
            height_px: 1024,
        };
        vec![of_one("left"), of_one("right")]
    }

    fn empty() -> DeviceState {
        DeviceState {
            device: "camera".to_owned(),
            firmware: "1.2".to_owned(),
            uptime_ms: 7_200_000,
            answered: 12,
            refused: 1,
            updates: 2,
            rollbacks: 0,
            max_blob_bytes: 65536,
            blob: None,
            open_error: None,
            slots: [SlotState::Empty, SlotState::Receiving],
            update: None,
            rig: None,
            gaps: None,
            owner: None,
            arithmetic: "f32",
        }
    }

    #[test]
    fn every_state_in_words() {
        let holds = |is_active, sequence| SlotState::Holds {
            is_active,
            sequence,
            bytes: 48320,
            checksum: "0badcafe".to_owned(),
            identity: "9f2c4e".to_owned(),
            version: None,
        };
        let measuring = DeviceState {
            blob: Some(BlobState {
                identity: "9f2c4e".to_owned(),
                bytes: 48320,
                camera_count: 3,
                cameras: cameras(),
            }),
            slots: [holds(true, 3), holds(false, 2)],
            update: Some(UpdateState {
                identity: "51ab".to_owned(),
                bytes: 1000,
                received_bytes: 512,
            }),
            rig: Some(RigState {
                serial: "A 17".to_owned(),
                cameras: cameras(),
            }),
            gaps: Some(GapState {
                verdict: "fits",
                report: GapReport {
                    points: 1000,
                    mean_signed_mm: -0.001,
                    mean_size_mm: 0.008,
                    within_95_mm: 0.02,
                    predicted: Some(Predicted {
                        points: 1000,
                        mean_sigma_mm: 0.01,
                        shift: -0.1,
                        spread: 1.02,
                    }),
                },
            }),
            ..empty()
        };
        let damaged = DeviceState {
            open_error: Some(5),
            slots: [
                SlotState::Unusable {
                    sequence: 4,
                    open_error: 5,
                },
                SlotState::Empty,
            ],
            ..empty()
        };
        let other_part = DeviceState {
            open_error: Some(OTHER_PART),
            slots: [
                SlotState::Unusable {
                    sequence: 1,
                    open_error: OTHER_PART,
                },
                SlotState::Empty,
            ],
            ..empty()
        };
        let owned = DeviceState {
            open_error: Some(160),
            slots: [
                SlotState::Unusable {
                    sequence: 4,
                    open_error: 160,
                },
                SlotState::Holds {
                    is_active: false,
                    sequence: 3,
                    bytes: 48320,
                    checksum: "0badcafe".to_owned(),
                    identity: "9f2c4e".to_owned(),
                    version: Some(7),
                },
            ],
            owner: Some(OwnerState {
                keys: [
                    Some("3d4017c3e843895a".to_owned()),
                    Some("fc51cd8e6218a1a3".to_owned()),
                ],
                newest_version: 7,
                least_version: 5,
                retired_below: 1,
            }),
            ..empty()
        };
        let states = [empty(), measuring, damaged, other_part, owned];
        let text = states.map(|state| state_in_words(&state));
        assert_snapshot("device_state", &text.join("\n\n"));
    }
}
