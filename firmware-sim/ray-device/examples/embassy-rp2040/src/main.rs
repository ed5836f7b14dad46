//! A measuring device on an RP2040: it measures in one task while another talks to a workstation and takes new blobs.
//!
//! UART0 (GP0, GP1), 115200 baud, is the link: `calib-offline flash rig.rays --device
//! serial:/dev/ttyUSB0`. Compiled by `tests/run bare`; not run on a board.

#![no_std]
#![no_main]

mod flash;

use embassy_executor::Spawner;
use embassy_futures::select::select;
use embassy_rp::uart::{BufferedInterruptHandler, BufferedUart, Config};
use embassy_rp::{bind_interrupts, peripherals};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_time::Instant;
use panic_halt as _;
use ray_device::app::Device;
use ray_device::port::{Clock, Regions};
use ray_device::protocol::Rig;
use ray_device::session::Session;
use ray_runtime::{PixelPoint, RayBlob, Triangulation};
use static_cell::StaticCell;

bind_interrupts!(struct Irqs {
    UART0_IRQ => BufferedInterruptHandler<peripherals::UART0>;
});

/// Matched pixels of the first and the second camera, from whatever finds them.
static MATCHES: Channel<CriticalSectionRawMutex, [PixelPoint; 2], 16> = Channel::new();

/// Their points, for whatever acts on them; none where the pixels see none.
static POINTS: Channel<CriticalSectionRawMutex, Option<Triangulation>, 16> = Channel::new();

struct Uptime;

impl Clock for Uptime {
    fn uptime_ms(&mut self) -> u64 {
        Instant::now().as_millis()
    }

    fn step(&mut self) {
        // Here a watchdog is petted: `Watchdog::feed`.
    }
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) -> ! {
    let board = embassy_rp::init(embassy_rp::config::Config::default());
    let slots = flash::slots(board.FLASH);
    let mut regions = Regions {
        // A device that knows its cameras takes blobs for no other: `Some(Rig { serial, cameras })`, from the flash chip's unique id, say.
        factory: None::<Rig>,
        slots,
    };

    static BUFFERS: StaticCell<[[u8; 256]; 2]> = StaticCell::new();
    let [tx, rx] = BUFFERS.init([[0; 256]; 2]);
    let mut uart = BufferedUart::new(
        board.UART0,
        board.PIN_0,
        board.PIN_1,
        Irqs,
        tx,
        rx,
        Config::default(),
    );

    let mut device = Device::new("example rp2040", Uptime);
    let mut session = Session::new();
    loop {
        // As after a restart: one blob is active, and everything below borrows it.
        let mut epoch = device.epoch(&mut regions);
        let blob = epoch.blob().ok();
        // `serve_async` ends when another blob has become active; with it ends the task that measures by the old one.
        select(measure(blob), session.serve_async(&mut uart, &mut epoch)).await;
    }
}

/// Answers matches for as long as this blob is active.
async fn measure(blob: Option<RayBlob<'_>>) {
    loop {
        let [first, second] = MATCHES.receive().await;
        let point = blob.and_then(|blob| blob.triangulate((0, first), (1, second)).ok());
        POINTS.send(point).await;
    }
}
