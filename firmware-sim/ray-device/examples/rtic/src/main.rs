//! Measures in one task while another talks to a workstation and takes new blobs, under RTIC.
//!
//! The blob in use is borrowed from one slot of the flash and handed to the task of the camera; the other slot belongs to the task of the
//! link. Both borrow for as long as the program runs, so when another blob has become active the device restarts, which takes some
//! milliseconds. (On an executor with scopes it need not: see the example for Embassy.)
//!
//! The board is that of `firmware-sim/cortex-m`, whose UART, timer and flash it uses.

#![no_std]
#![no_main]

mod board;

#[rtic::app(device = crate::board, peripherals = false)]
mod app {
    use cortex_m::peripheral::SCB;
    use firmware_cortex_m::machine;
    use firmware_cortex_m::ports::{FlashRegion, Timer, Uart, flash_regions};
    use panic_halt as _;
    use ray_device::app::{Device, Epoch};
    use ray_device::port::{Link, Regions};
    use ray_device::session::Responder;
    use ray_device::session::Session;
    use ray_runtime::{PixelPoint, RayBlob, Triangulation};

    use crate::board::Interrupt;

    #[shared]
    struct Shared {
        /// The last point.
        last: Option<Triangulation>,
    }

    #[local]
    struct Local {
        blob: Option<RayBlob<'static>>,
        epoch: Epoch<'static, FlashRegion, Timer>,
        session: Session,
        uart: Uart,
    }

    #[init(local = [regions: Option<Regions<FlashRegion>> = None, device: Option<Device<Timer>> = None])]
    fn init(context: init::Context) -> (Shared, Local) {
        let Some(regions) = flash_regions() else {
            machine::end(false);
        };
        let regions = context.local.regions.insert(regions);
        let device = Device::new("example rtic", Timer::start());
        let device = context.local.device.insert(device);
        // Decides which blob is active, and opens it.
        let epoch = device.epoch(regions);
        let local = Local {
            blob: epoch.blob().ok(),
            epoch,
            session: Session::new(),
            uart: Uart::start(),
        };
        (Shared { last: None }, local)
    }

    /// The task that measures interrupts the one that updates.
    #[task(binds = CAMERA, priority = 2, local = [blob], shared = [last])]
    fn measure(mut context: measure::Context) {
        // Where a camera's matches would come from.
        let (first, second) = (PixelPoint::new(30.0, 20.5), PixelPoint::new(33.0, 21.0));
        let blob = context.local.blob.as_ref();
        let point = blob.and_then(|blob| blob.triangulate((0, first), (1, second)).ok());
        context.shared.last.lock(|last| *last = point);
    }

    /// Answers the workstation byte by byte; an update programs and erases here.
    #[task(binds = UART0, priority = 1, local = [epoch, session, uart])]
    fn serve(context: serve::Context) {
        let serve::LocalResources {
            epoch,
            session,
            uart,
            ..
        } = context.local;
        while let Some(byte) = machine::uart_receive() {
            if let Some(frame) = session.feed(byte, epoch) {
                let Ok(()) = uart.write_all(frame);
            }
            if epoch.is_over() {
                SCB::sys_reset();
            }
        }
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            rtic::pend(Interrupt::CAMERA);
            cortex_m::asm::wfi();
        }
    }
}
