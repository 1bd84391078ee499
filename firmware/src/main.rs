//! The firmware's image: the control core on a board, as interrupt tasks.
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
    use firmware::wiring::{LineIn as _, LineOut as _, Pins as _, Watchdog as _};
    use firmware::{ControlLoop, Receiver, Telemetry, robot};
    use heapless::spsc::Producer;
    use protocol::ToDevice;
    use stm32f4xx_hal::pac::Interrupt;

    use crate::board;

    #[shared]
    struct Shared {
        #[lock_free]
        pins: board::Pins,
        /// Device time t_k of the present period, µs.
        now_us: AtomicU32,
    }

    #[local]
    struct Local {
        control: &'static mut ControlLoop,
        tick_ends: TickEnds<'static>,
        watchdog: board::Watchdog,
        telemetry: &'static mut Telemetry,
        telemetry_ends: TelemetryEnds<'static>,
        line_out: board::LineOut,
        commands: Producer<'static, ToDevice>,
        line_in: board::LineIn,
    }

    #[init(local = [
        queues: Queues = Queues::new(),
        control_room: MaybeUninit<ControlLoop> = MaybeUninit::uninit(),
        telemetry_room: MaybeUninit<Telemetry> = MaybeUninit::uninit(),
    ])]
    fn init(ctx: init::Context) -> (Shared, Local) {
        let board = board::start(ctx.core, ctx.device);
        let (reset, panic) = board.started;
        defmt::info!("started");
        let mut config = robot::doggy();
        config.started_by(reset, panic).code_crc(board::code_crc());
        let (tick_ends, telemetry_ends, commands) = ctx.local.queues.split();
        (
            Shared { pins: board.pins, now_us: AtomicU32::new(0) },
            Local {
                control: keep(ctx.local.control_room, || ControlLoop::new(&config)),
                tick_ends,
                watchdog: board.watchdog,
                telemetry: keep(ctx.local.telemetry_room, || Telemetry::new(&config)),
                telemetry_ends,
                line_out: board.line_out,
                commands,
                line_in: board.line_in,
            },
        )
    }

    /// Makes a large value where it is to stay; on its own, so that its passage over the stack is over when it returns.
    #[inline(never)]
    fn keep<T>(room: &'static mut MaybeUninit<T>, make: impl FnOnce() -> T) -> &'static mut T {
        room.write(make())
    }

    #[task(binds = SysTick, priority = 4, shared = [pins, &now_us])]
    fn period(ctx: period::Context) {
        let now_us = ctx.shared.pins.begin();
        ctx.shared.now_us.store(now_us, Ordering::Relaxed);
    }

    #[task(binds = TIM5, priority = 4, shared = [pins, &now_us], local = [control, tick_ends, watchdog])]
    fn tick(ctx: tick::Context) {
        let inputs = ctx.shared.pins.collect();
        let now_us = ctx.shared.now_us.load(Ordering::Relaxed);
        let outputs = ctx.local.control.tick(now_us, &inputs, ctx.local.tick_ends);
        ctx.shared.pins.apply(&outputs);
        ctx.local.watchdog.feed();
        if let Some(frames) = board::log::take_lost() {
            defmt::warn!("{} frames of the log found no room", frames);
        }
        rtic::pend(Interrupt::DMA2_STREAM7);
        rtic::pend(Interrupt::USART1);
    }

    #[task(binds = I2C1_EV, priority = 4, shared = [pins])]
    fn bus_event(ctx: bus_event::Context) {
        ctx.shared.pins.bus_event();
    }

    #[task(binds = I2C1_ER, priority = 4, shared = [pins])]
    fn bus_error(ctx: bus_error::Context) {
        ctx.shared.pins.bus_event();
    }

    #[task(binds = DMA2_STREAM7, priority = 2, local = [telemetry, telemetry_ends, line_out])]
    fn telemetry(ctx: telemetry::Context) {
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

    #[task(binds = USART1, priority = 1, local = [receiver: Receiver = Receiver::new(), commands, line_in])]
    fn commands(ctx: commands::Context) {
        let mut bytes = [0; 64];
        let n = ctx.local.line_in.read(&mut bytes);
        ctx.local.receiver.receive(&bytes[..n], ctx.local.commands);
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            rtic::export::wfi();
        }
    }
}
