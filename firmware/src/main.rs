//! The firmware's image: the control core on a board, as interrupt tasks.
//!
//! ```text
//!   priority   t_k                        t_k + 600 µs                              t_{k+1}
//!   4          │ period                   │ tick ─▶ control loop ─▶ duty kept       │ period: duty active
//!   5          supply_fell, whenever it does: motors off
//!   4          │   bus_event burst_over … │   │ every 1 ms              ▲           │
//!   2          │                          │   ╰─▶ telemetry ─▶ DMA      │           │      frames to the line
//!   1          │                          │   ╰──────▶ commands ────────╯ queue     │      bytes from the line
//!   0          │ idle: looks for gyros that are missing, sleeps                     │
//! ```
//!
//! A task of a higher priority preempts a lower one. The two tasks of the tick have the same priority and share the pins
//! without a lock; with the others they share queues of one writer and one reader, and a few atomics. Telemetry and
//! commands run in every tick, whether there is something to do or not, and check in; the tick feeds the watchdog only
//! while both do.
#![cfg_attr(target_os = "none", no_std, no_main)]
#![allow(unsafe_code, reason = "the boards touch registers, and the framework resources")]

#[cfg(target_os = "none")]
mod board;

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "This is the firmware of a microcontroller. Flash it with
    cargo run -p firmware --release --target thumbv7em-none-eabihf"
    );
    std::process::exit(2);
}

#[cfg(target_os = "none")]
#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use core::mem::MaybeUninit;
    use core::sync::atomic::{AtomicU32, Ordering};

    use firmware::queues::{Queues, TelemetryEnds, TickEnds};
    use firmware::wiring::check_in::{CheckIns, Task};
    use firmware::wiring::{LineIn as _, LineOut as _, Pins as _, Watchdog as _};
    use firmware::{ControlLoop, Receiver, Telemetry, robot};
    use heapless::spsc::Producer;
    use protocol::{Fault, State, ToDevice};
    use stm32f4xx_hal::pac::Interrupt;

    use crate::board;

    /// Times 64 bytes that `commands` takes in a tick.
    const READS_PER_TICK: usize = 3;

    #[shared]
    struct Shared {
        #[lock_free]
        pins: board::Pins,
        /// Device time t_k of the present period, µs.
        now_us: AtomicU32,
        /// Who lives.
        check_ins: CheckIns,
    }

    #[local]
    struct Local {
        control: &'static mut ControlLoop,
        tick_ends: TickEnds<'static>,
        watchdog: board::Watchdog,
        store: board::Store,
        telemetry: &'static mut Telemetry,
        telemetry_ends: TelemetryEnds<'static>,
        line_out: board::LineOut,
        commands: Producer<'static, ToDevice>,
        line_in: board::LineIn,
        search: board::gyro::Search<board::Bus>,
    }

    #[init(local = [
        queues: Queues = Queues::new(),
        control_room: MaybeUninit<ControlLoop> = MaybeUninit::uninit(),
        telemetry_room: MaybeUninit<Telemetry> = MaybeUninit::uninit(),
    ])]
    fn init(ctx: init::Context) -> (Shared, Local) {
        let board = board::start(ctx.core, ctx.device);
        let (reset, panic) = board.started;
        defmt::info!("firmware {=str} started: {}", env!("CARGO_PKG_VERSION"), reset);
        if let Some(place) = &panic {
            defmt::error!("it had panicked at {=str}:{=u32}", place.file.as_str(), place.line);
        }
        let (tick_ends, telemetry_ends, commands) = ctx.local.queues.split();
        let mut store = board.store;
        let mut config = robot::doggy();
        robot::HARDWARE.start(&mut config, &mut store, tick_ends.description);
        config.started_by(reset, panic).code_crc(board::code_crc()).stop_test(board::STOP_TEST);
        match (config.descriptions().running, config.descriptions().stored) {
            (Some(stamp), _) => defmt::info!("runs the stored description {=u32}", stamp.sequence),
            (None, Some(stamp)) => {
                defmt::error!("this board cannot run the stored description {=u32}", stamp.sequence)
            }
            (None, None) => {}
        }
        (
            Shared { pins: board.pins, now_us: AtomicU32::new(0), check_ins: CheckIns::new() },
            Local {
                control: keep(ctx.local.control_room, || ControlLoop::new(&config)),
                tick_ends,
                watchdog: board.watchdog,
                store,
                telemetry: keep(ctx.local.telemetry_room, || Telemetry::new(&config)),
                telemetry_ends,
                line_out: board.line_out,
                commands,
                line_in: board.line_in,
                search: board.search,
            },
        )
    }

    /// Makes a large value where it is to stay; on its own, so that its passage over the stack is over when it returns.
    #[inline(never)]
    fn keep<T>(room: &'static mut MaybeUninit<T>, make: impl FnOnce() -> T) -> &'static mut T {
        room.write(make())
    }

    /// t_k.
    #[task(binds = SysTick, priority = 4, shared = [pins, &now_us])]
    fn period(ctx: period::Context) {
        let now_us = ctx.shared.pins.begin();
        ctx.shared.now_us.store(now_us, Ordering::Relaxed);
        board::log::tick(now_us);
    }

    /// The tick: see [`ControlLoop::tick`] for its contract.
    #[task(
        binds = TIM5,
        priority = 4,
        shared = [pins, &now_us, &check_ins],
        local = [control, tick_ends, watchdog, store, fault: Option<Fault> = None, starving: bool = false],
    )]
    fn tick(ctx: tick::Context) {
        let inputs = ctx.shared.pins.collect();
        let now_us = ctx.shared.now_us.load(Ordering::Relaxed);
        let outputs = ctx.local.control.tick(now_us, &inputs, ctx.local.tick_ends);
        ctx.shared.pins.apply(&outputs);
        let all_here = ctx.shared.check_ins.all_here();
        if all_here {
            ctx.local.watchdog.feed();
        }
        rtic::pend(Interrupt::DMA2_STREAM7);
        rtic::pend(Interrupt::USART1);

        // For whoever reads the log, when it changes.
        let fault = match ctx.local.control.state() {
            State::Fault(fault) => Some(fault),
            _ => None,
        };
        if *ctx.local.fault != fault {
            *ctx.local.fault = fault;
            match fault {
                Some(fault) => defmt::error!("fault: {}", fault),
                None => defmt::info!("fault cleared"),
            }
        }
        if !all_here && !*ctx.local.starving {
            defmt::error!("a task does not check in, the watchdog will bite");
        }
        *ctx.local.starving = !all_here;
        if outputs.store {
            // The drivers are off, and nothing moves. The core may stand still for most of a second: the next tick comes late,
            // and feeds the watchdog with its usual time.
            ctx.local.watchdog.lengthen();
            ctx.local.control.store(&robot::HARDWARE, ctx.local.store, ctx.local.tick_ends);
        }
        if let Some(frames) = board::log::take_lost() {
            defmt::warn!("{=u32} frames of the log found no room", frames);
        }
    }

    /// An event of the I²C bus.
    #[task(binds = I2C1_EV, priority = 4, shared = [pins])]
    fn bus_event(ctx: bus_event::Context) {
        ctx.shared.pins.bus_event();
    }

    /// An error on the I²C bus.
    #[task(binds = I2C1_ER, priority = 4, shared = [pins])]
    fn bus_error(ctx: bus_error::Context) {
        ctx.shared.pins.bus_event();
    }

    /// The end of the burst on SPI.
    #[task(binds = DMA2_STREAM0, priority = 4, shared = [pins])]
    fn burst_over(ctx: burst_over::Context) {
        ctx.shared.pins.burst_over();
    }

    /// The supply falls below the detector's level.
    #[task(binds = PVD, priority = 5)]
    fn supply_fell(_: supply_fell::Context) {
        board::supply_fell();
    }

    /// Frames to the line, as soon as it is free; the log when there is nothing else.
    #[task(binds = DMA2_STREAM7, priority = 2, shared = [&check_ins], local = [telemetry, telemetry_ends, line_out])]
    fn telemetry(ctx: telemetry::Context) {
        ctx.shared.check_ins.here(Task::Telemetry);
        let Some(room) = ctx.local.line_out.room() else { return };
        let telemetry = ctx.local.telemetry;
        let mut len = telemetry.transmit(room, ctx.local.telemetry_ends);
        if len == 0 {
            len = telemetry.transmit_log(room, board::log::take);
        }
        if len > 0 {
            ctx.local.line_out.send(len);
        }
    }

    /// Bytes from the line become messages for the tick.
    #[task(
        binds = USART1,
        priority = 1,
        shared = [&check_ins],
        local = [receiver: Receiver = Receiver::new(), commands, line_in],
    )]
    fn commands(ctx: commands::Context) {
        ctx.shared.check_ins.here(Task::Commands);
        let mut bytes = [0; 64];
        // A tick's worth of the line is 92 bytes; what more there is waits for the next.
        for _ in 0..READS_PER_TICK {
            let n = ctx.local.line_in.read(&mut bytes);
            ctx.local.receiver.receive(&bytes[..n], ctx.local.commands);
        }
    }

    /// Looks for gyros that are missing, and sleeps until the next interrupt.
    #[idle(local = [search])]
    fn idle(ctx: idle::Context) -> ! {
        loop {
            ctx.local.search.step(board::log::now_us());
            rtic::export::wfi();
        }
    }
}
