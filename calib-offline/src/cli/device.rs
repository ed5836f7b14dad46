//! `device`: how a device is, whether it computes what the packing host did, and back to the blob before.

use super::Outcome;
use super::error::Error;
use super::key_file;
use super::output::Console;
use super::usage_error::UsageError;
use crate::device::{DeviceError, DeviceState, connect, state_in_words};
use calib_recording::dataset::identity::hex;
use clap::{Args, Subcommand};
use firmware_sim::client::{ClientError, DeviceClient};
use ray_device::manifest::{Action, OrderText};
use ray_device::protocol::{Arithmetic, Order, Refusal, SlotState};
use ray_device::storage::trust::KeyId;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Duration;

const EXAMPLE: &str = "\
Example:
  calib-offline device --device tcp:127.0.0.1:7777 status
  calib-offline device --device serial:/dev/ttyACM0 selftest
  calib-offline device --device tcp:127.0.0.1:7777 rollback
  calib-offline device --device tcp:127.0.0.1:7777 rollback --key key.pem";

const FORMATS: &str = "\
status    what it measures with, what its two slots hold, and whether the calibration still fits: the
          gaps between the rays of what it has measured, with sign and unit, beside those that the
          blob predicts. Gaps do not see an error of scale or of the cameras' distance.
selftest  the blob's self-tests, computed on the device; they must give the packing host's bits. A device that
          computes in integers compares those that the blob states for integers (pack --arithmetic integer)
rollback  the blob in the other slot, after a check of all of it, becomes the one in use; a device with an
          owner does so only on an order that is signed with --key, for this device and this moment
abort     an update that is under way is given up, on a device with an owner with --key

Exit code 1: the gaps say that the cameras have moved, or a self-test gave other bits. Exit code 3: the blob
states no self-tests for what the device computes in.

With --json, status, schema calib-offline/device-status/1:
  device, firmware, uptime_ms, answered, refused, updates, rollbacks, max_blob_bytes
  blob (identity, bytes, camera_count, cameras (name, width_px, height_px)), open_error
  slots (state, is_active, sequence, bytes, checksum, identity, version, open_error)
                 state: empty, receiving, holds (all but open_error) or unusable (sequence,
                 open_error); version: null without an owner
  update (identity, bytes, received_bytes)
  owner (keys, newest_version, least_version, retired_below)
                 null: anybody may change it; keys: the first 16 digits of each, or null
  rig (serial, cameras (name, width_px, height_px))
  arithmetic     what it computes points in: f32 or integer
  gaps (verdict, points, mean_signed_mm, mean_size_mm, within_95_mm, predicted (points,
    mean_sigma_mm, shift, spread))
                 verdict: fits, shifted, scattered, too_few_points or nothing_predicted
With --json, selftest, schema calib-offline/device-selftest/1:
  tests, equal, unanswered, worst_mm, worst_direction
With --json, rollback, schema calib-offline/device-rollback/1:
  slot, sequence, bytes, identity
With --json, abort, schema calib-offline/device-abort/1:
  was_under_way";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct DeviceArgs {
    /// The device: tcp:HOST:PORT or serial:PORT@BAUD
    #[arg(long, value_name = "ADDRESS", global = true)]
    pub device: Option<String>,
    /// How long an answer may take, s
    #[arg(long, value_name = "SECONDS", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=600), global = true)]
    pub timeout: u16,
    /// What to ask
    #[command(subcommand)]
    pub question: Question,
}

/// What to ask.
#[derive(Debug, Clone, PartialEq, Eq, Subcommand)]
pub enum Question {
    /// How it is, and whether its calibration still fits
    Status,
    /// Whether it computes the bits of the host that packed its blob
    Selftest,
    /// Go back to the blob in the other slot
    Rollback(OrderArgs),
    /// Give up an update that is under way
    Abort(OrderArgs),
}

/// What the owner of a device orders.
#[derive(Debug, Clone, PartialEq, Eq, Args)]
pub struct OrderArgs {
    /// The owner's private key, for a device that has one
    #[arg(long, value_name = "KEY.pem")]
    pub key: Option<PathBuf>,
}

/// What `--json` prints of the status.
#[derive(Debug, Serialize)]
struct StatusObject {
    schema: &'static str,
    #[serde(flatten)]
    state: DeviceState,
}

/// What `--json` prints of the self-test.
#[derive(Debug, Serialize)]
struct SelfTestObject {
    schema: &'static str,
    tests: u16,
    equal: u16,
    unanswered: u16,
    worst_mm: f32,
    worst_direction: f32,
}

/// What `--json` prints of a rollback.
#[derive(Debug, Serialize)]
struct RollbackObject {
    schema: &'static str,
    slot: u8,
    sequence: u32,
    bytes: u32,
    identity: String,
}

/// What `--json` prints of an update that was given up.
#[derive(Debug, Serialize)]
struct AbortObject {
    schema: &'static str,
    was_under_way: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Error`].
pub fn run(args: &DeviceArgs, console: &Console) -> Result<Outcome, Error> {
    let address = args
        .device
        .as_deref()
        .ok_or(Error::Usage(UsageError::NoDevice))?;
    let mut client = connect(address, Duration::from_secs(args.timeout.into()))?;
    match &args.question {
        Question::Status => status(&mut client, console),
        Question::Selftest => selftest(&mut client, console),
        Question::Rollback(args) => rollback(args, &mut client, console),
        Question::Abort(args) => abort(args, &mut client, console),
    }
}

fn status(client: &mut DeviceClient, console: &Console) -> Result<Outcome, Error> {
    let status = client.status().map_err(DeviceError::Client)?;
    let state = DeviceState::new(client.greeting(), &status);
    let words = state_in_words(&state);
    let is_shifted = state.is_shifted();
    let object = StatusObject {
        schema: "calib-offline/device-status/1",
        state,
    };
    console.result(&words, &object);
    Ok(outcome(!is_shifted))
}

fn selftest(client: &mut DeviceClient, console: &Console) -> Result<Outcome, Error> {
    let report = client.self_test().map_err(DeviceError::Client)?;
    let object = SelfTestObject {
        schema: "calib-offline/device-selftest/1",
        tests: report.tests,
        equal: report.equal,
        unanswered: report.unanswered,
        worst_mm: report.worst_mm,
        worst_direction: report.worst_direction,
    };
    let is_equal = report.equal == report.tests;
    let words = if report.tests == 0 {
        let status = client.status().map_err(DeviceError::Client)?;
        no_self_tests(status.arithmetic)
    } else if is_equal {
        format!(
            "all {} self-tests gave the bits of the host that packed the blob",
            report.tests
        )
    } else {
        format!(
            "{} of {} self-tests gave other bits than the host that packed the blob ({} no answer); worst difference {:e} mm, \
             {:e} of a direction: do not measure with this firmware",
            report.tests - report.equal.min(report.tests),
            report.tests,
            report.unanswered,
            report.worst_mm,
            report.worst_direction
        )
    };
    console.result(&words, &object);
    Ok(match report.tests {
        0 => Outcome::Undetermined,
        _ => outcome(is_equal),
    })
}

/// That nothing was tested, and what to do.
fn no_self_tests(arithmetic: Arithmetic) -> String {
    match arithmetic {
        Arithmetic::Integer => {
            "nothing was tested: the device computes in integers, and its blob states no self-tests for integers; \
             pack it with calib-offline pack --arithmetic integer and flash it"
        }
        Arithmetic::Float => {
            "nothing was tested: the blob states no self-tests; pack it anew with calib-offline pack and flash it"
        }
    }
    .to_owned()
}

/// An order of the key's owner to the device as it is now; `None` without a key.
fn order(
    action: Action,
    args: &OrderArgs,
    client: &mut DeviceClient,
) -> Result<Option<Order>, Error> {
    let Some(path) = &args.key else {
        return Ok(None);
    };
    let key = key_file::private(path)?;
    let status = client.status().map_err(DeviceError::Client)?;
    let Some(owner) = status.owner else {
        return Err(DeviceError::Client(ClientError::Refused(Refusal::NoOwner)).into());
    };
    let public = key.public().to_bytes();
    let is_it = |id: &Option<KeyId>| id.is_some_and(|id| public.starts_with(&id));
    let number = owner.keys.iter().position(is_it).ok_or_else(|| {
        let found = key.public().to_string().chars().take(16).collect();
        Error::Usage(UsageError::NotTheOwner { found })
    })?;
    let active = status.slots.iter().find_map(|slot| match slot {
        SlotState::Holds(stored) if status.active_slot == Some(stored.slot) => Some(stored),
        _ => None,
    });
    let (update, checksum) = match action {
        Action::Rollback => (0, active.map_or(0, |active| active.checksum)),
        Action::Abort => {
            let update = status.update;
            update.map_or((0, 0), |update| (update.number, update.checksum))
        }
    };
    Ok(Some(key.sign_order(&OrderText {
        action,
        key: number as u8,
        serial: status.rig.as_ref().map_or("", |rig| rig.serial.as_str()),
        sequence: active.map_or(0, |active| active.sequence),
        update,
        checksum,
    })))
}

fn abort(args: &OrderArgs, client: &mut DeviceClient, console: &Console) -> Result<Outcome, Error> {
    let status = client.status().map_err(DeviceError::Client)?;
    match order(Action::Abort, args, client)? {
        Some(order) => client.order(&order).map(|_| ()),
        None => client.abort_update(),
    }
    .map_err(DeviceError::Client)?;
    let object = AbortObject {
        schema: "calib-offline/device-abort/1",
        was_under_way: status.update.is_some(),
    };
    let words = if object.was_under_way {
        "the update was given up; the blob in use stays"
    } else {
        "no update was under way"
    };
    console.result(words, &object);
    Ok(Outcome::Done)
}

fn rollback(
    args: &OrderArgs,
    client: &mut DeviceClient,
    console: &Console,
) -> Result<Outcome, Error> {
    let stored = match order(Action::Rollback, args, client)? {
        Some(order) => client.order(&order).and_then(|stored| {
            stored.ok_or(ClientError::BadReply {
                asked: "rollback",
                found: "an answer to the end of an update".to_owned(),
            })
        }),
        None => client.rollback(),
    };
    let stored = stored.map_err(DeviceError::Client)?;
    let object = RollbackObject {
        schema: "calib-offline/device-rollback/1",
        slot: stored.slot,
        sequence: stored.sequence,
        bytes: stored.length,
        identity: hex(&stored.identity),
    };
    let words = format!(
        "blob {} ({} bytes) in slot {} is in use again, as number {}",
        object.identity, object.bytes, object.slot, object.sequence
    );
    console.result(&words, &object);
    Ok(Outcome::Done)
}

const fn outcome(is_good: bool) -> Outcome {
    if is_good {
        Outcome::Done
    } else {
        Outcome::VerdictFail
    }
}
