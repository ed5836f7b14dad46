//! The command line of the simulated device.

mod cost;

use std::error::Error;
use std::io::Write;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use cost::InQemu;
use firmware_cost::{CORES, Core};
use firmware_sim::simulated::flash_file::{self, FlashFile};
use firmware_sim::simulated::host::SimulatedDevice;
use firmware_sim::simulated::qemu::{self, QemuDevice};
use firmware_sim::simulated::sim_flash::{BadRules, Rules};
use firmware_sim::slot_image::Part;
use ray_device::protocol::{Arithmetic, CameraStatus, MAX_CAMERAS_LISTED, MAX_NAME, Rig, name};
use ray_device::storage::trust::{PublicKey, Trust};

/// A measuring device, simulated.
///
/// Example: firmware-sim host --listen 127.0.0.1:7777 --flash-file device.flash
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// The device on this computer.
    Host {
        #[command(flatten)]
        device: DeviceArguments,
        /// The rules of the part that its flash is: a part that slot images are made for, such as stm32h743, or, with commas between, unit=N and block=N, bytes that are programmed
        /// (1 to 512) and erased at once (8 and 4096 if not given); erased=00 or ff; ecc=error or fault: what a
        /// word that a cut of power spoiled does when it is read; blank=fault or undefined: the same of a
        /// blank word; log-block=N: logs lie in regions with erase blocks of their own; erase=none: no erase is
        /// needed; stall-ms=N: how long an erase takes. A flash file keeps its rules.
        #[arg(long, value_name = "RULES", value_parser = flash_rules)]
        flash_rules: Option<Rules>,
        /// What it computes points in; integer is for cores without a floating-point unit.
        #[arg(long, value_enum, default_value = "f32")]
        arithmetic: ArithmeticArg,
    },
    /// The same application as a Cortex-M4F image in QEMU; the image is built first when it is
    /// missing or stale.
    Qemu {
        #[command(flatten)]
        device: DeviceArguments,
        /// Run this image instead of building one; whose blobs it takes was settled when it was built.
        #[arg(long, value_name = "ELF", conflicts_with = "public_key")]
        image: Option<PathBuf>,
    },
    /// What the runtime costs on a Cortex-M4F, or on other cores: instructions counted in QEMU, stack, code. The images
    /// are built first when they are missing or stale.
    Cost {
        /// Count on the cores of this target alone, such as thumbv6m-none-eabi, and no code.
        #[arg(long, value_name = "TARGET", value_parser = Core::targets(), conflicts_with = "markdown")]
        target: Option<String>,
        /// Count this blob, instead of those that come with the sources.
        #[arg(long = "blob", value_name = "FILE")]
        blobs: Vec<PathBuf>,
        /// One JSON object instead of tables.
        #[arg(long)]
        json: bool,
        /// The document ray-runtime/COST.md instead of tables: with all cores, whose images take some minutes to build.
        #[arg(long, conflicts_with = "json")]
        markdown: bool,
    },
}

/// What a device computes in.
#[derive(Clone, Copy, clap::ValueEnum)]
enum ArithmeticArg {
    /// Numbers of 32 bits with a floating point
    F32,
    /// Integers: no standard deviations
    Integer,
}

#[derive(clap::Args)]
struct DeviceArguments {
    /// Where to listen: ADDRESS:PORT, or PORT on the loopback interface. Port 0 picks a free one.
    /// The first line on standard output says which.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:0", value_parser = listen_address)]
    listen: SocketAddr,
    /// Where the device keeps its flash, across restarts; made when there is none. A blob that
    /// `calib-offline calibrate` wrote can be given, too: the device starts with it, and the file stays
    /// as it is. Without it the flash is in memory, and empty.
    #[arg(long, value_name = "FILE")]
    flash_file: Option<PathBuf>,
    /// A camera that a new device is built with, such as left=1280x1024; once for each, in the blob's
    /// order. Such a device refuses blobs for other cameras.
    #[arg(long = "camera", value_name = "NAME=WIDTHxHEIGHT", value_parser = camera)]
    cameras: Vec<CameraStatus>,
    /// Take only blobs signed by the owner of this Ed25519 key; in QEMU, the image is built for it.
    #[arg(long, value_name = "64 HEX DIGITS", value_parser = public_key)]
    public_key: Option<PublicKey>,
    /// Serial number of a new device's rig.
    #[arg(long, value_name = "TEXT", requires = "cameras")]
    serial: Option<String>,
}

impl DeviceArguments {
    fn rig(&self) -> Result<Option<Rig>, Failure> {
        if self.cameras.is_empty() {
            return Ok(None);
        }
        let Ok(cameras) = heapless::Vec::from_slice(&self.cameras) else {
            return Err(format!("a device has {MAX_CAMERAS_LISTED} cameras at most").into());
        };
        let serial = name(self.serial.as_deref().unwrap_or_default());
        Ok(Some(Rig { serial, cameras }))
    }

    /// The flash that the device starts with, and the file that it is kept in.
    fn flash(&self, rules: Option<Rules>) -> Result<FlashFile, Failure> {
        let rig = self.rig()?;
        let Some(path) = &self.flash_file else {
            let flash = flash_file::blank_with(rules.unwrap_or_default(), rig.as_ref())?;
            return Ok(FlashFile::in_memory(flash));
        };
        let file = FlashFile::open_with(path, rules, rig.as_ref())?;
        if file.kept_in.is_none() {
            eprintln!(
                "firmware-sim: {} is a blob, not the flash of a device: it stays as it is, and what the device is sent is forgotten when it stops. To keep it: --flash-file device.flash, then calib-offline flash {0} --device tcp:ADDRESS:PORT",
                path.display()
            );
        }
        Ok(file)
    }
}

fn flash_rules(text: &str) -> Result<Rules, BadRules> {
    Part::of_name(text).map_or_else(|| text.parse(), |part| Ok(part.rules))
}

fn public_key(text: &str) -> Result<PublicKey, String> {
    PublicKey::from_hex(text)
        .ok_or_else(|| "give the key's 32 bytes as 64 hexadecimal digits".to_owned())
}

fn camera(text: &str) -> Result<CameraStatus, String> {
    let parse = || {
        let (camera, size) = text.rsplit_once('=')?;
        let (width, height) = size.split_once('x')?;
        let is_fit = !camera.is_empty() && camera.len() <= MAX_NAME;
        is_fit.then_some(CameraStatus {
            name: name(camera),
            width_px: width.parse().ok().filter(|&px| px > 0)?,
            height_px: height.parse().ok().filter(|&px| px > 0)?,
        })
    };
    parse().ok_or_else(|| "give NAME=WIDTHxHEIGHT, such as left=1280x1024".to_owned())
}

fn listen_address(text: &str) -> Result<SocketAddr, String> {
    if let Ok(port) = text.parse::<u16>() {
        return Ok(SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
    }
    text.parse()
        .map_err(|_| "give ADDRESS:PORT, such as 127.0.0.1:7777, or a port alone".to_owned())
}

/// What went wrong, with its causes.
type Failure = Box<dyn Error>;

/// An error and its causes in one line.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("firmware-sim: {}", chain(error.as_ref()));
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.command {
        Command::Host {
            device,
            flash_rules,
            arithmetic,
        } => run_on_host(device, *flash_rules, *arithmetic),
        Command::Qemu { device, image } => run_in_qemu(device, image.as_deref()),
        Command::Cost {
            target,
            blobs,
            json,
            markdown,
        } => {
            let usual = firmware_cost::usual(&firmware_cost::built_in());
            let all = if blobs.is_empty() {
                firmware_cost::built_in()
            } else {
                blobs.clone()
            };
            let text = if let Some(target) = target {
                let blobs = if blobs.is_empty() { &usual } else { blobs };
                let cores = Core::of_target(target);
                let across = firmware_cost::across(&InQemu, &cores, blobs)?;
                if *json {
                    serde_json::to_string_pretty(&across)? + "\n"
                } else {
                    across.to_text()
                }
            } else {
                let cost = firmware_cost::measure(&InQemu, &all)?;
                if *json {
                    serde_json::to_string_pretty(&cost)? + "\n"
                } else if *markdown {
                    let blobs = if blobs.is_empty() { &usual } else { blobs };
                    let across = firmware_cost::across(&InQemu, &CORES, blobs)?;
                    cost.to_markdown(&across)
                } else {
                    cost.to_text()
                }
            };
            std::io::stdout()
                .write_all(text.as_bytes())
                .map_err(no_output)
        }
    }
}

fn run_on_host(
    arguments: &DeviceArguments,
    rules: Option<Rules>,
    arithmetic: ArithmeticArg,
) -> Result<(), Failure> {
    let FlashFile { flash, kept_in } = arguments.flash(rules)?;
    let trust = arguments.public_key.map_or(Trust::Anybody, Trust::Signed);
    let arithmetic = match arithmetic {
        ArithmeticArg::F32 => Arithmetic::Float,
        ArithmeticArg::Integer => Arithmetic::Integer,
    };
    let device = SimulatedDevice::start_device(arguments.listen, flash, trust, arithmetic)
        .map_err(|error| format!("the device on {}: {error}", arguments.listen))?;
    announce(device.address())?;
    device.serve_forever();
    drop(kept_in);
    Err("the device stopped".into())
}

fn run_in_qemu(arguments: &DeviceArguments, image: Option<&Path>) -> Result<(), Failure> {
    // Before the image, whose first build takes a minute.
    qemu::require_qemu()?;
    let flash = arguments.flash(None)?;
    let image = if let Some(path) = image {
        path.to_owned()
    } else {
        eprintln!("firmware-sim: building the image, unless it is up to date");
        match &arguments.public_key {
            Some(key) => qemu::build_signed_image("device_signed", &key.to_string())?,
            None => qemu::build_image("device")?,
        }
    };
    let device = QemuDevice::start_with(arguments.listen, &image, flash)?;
    announce(device.address())?;
    let status = device.wait()?;
    Err(format!("QEMU stopped ({status})").into())
}

/// Says where the device can be reached. Whoever started this program may wait for the line, so it
/// must get out.
fn announce(address: SocketAddr) -> Result<(), Failure> {
    let mut output = std::io::stdout();
    writeln!(output, "listening on {address}")
        .and_then(|()| output.flush())
        .map_err(no_output)
}

fn no_output(error: impl Error) -> Failure {
    format!("standard output: {error}").into()
}
