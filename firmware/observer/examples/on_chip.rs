//! The observer on a Cortex-M4F: what a tick takes, and the bytes of the estimate.
//!
//! ```text
//!   OBSERVER_NUMBERS: a Rust file with a table, its noise, readings and inputs of some ticks ─▶ image ─▶ emulator
//!   out, by semihosting: `tick K update CYCLES predict CYCLES`, at the end `state BITS …` in hexadecimal
//! ```
//! `tests/stories/emulated/observer.rs` writes the file, builds the image and holds both to what the same code says on a PC.
#![cfg_attr(target_os = "none", no_std, no_main)]
#![cfg_attr(target_os = "none", allow(unsafe_code, reason = "what the entry point expands to"))]

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "This is an image for a microcontroller; `cargo test -p tests --test emulated_observer` builds and runs it."
    );
    std::process::exit(2);
}

#[cfg(target_os = "none")]
mod image {
    use core::panic::PanicInfo;

    use cortex_m::peripheral::SYST;
    use cortex_m::peripheral::syst::SystClkSource;
    use cortex_m::singleton;
    use cortex_m_semihosting::debug::{EXIT_FAILURE, EXIT_SUCCESS, exit};
    use cortex_m_semihosting::{hprint, hprintln};
    use observer::{
        Input, Instruction, Observer, Operation, Output, Sensors, Settings, Start, Table, TableModel, Tape,
    };

    include!(env!("OBSERVER_NUMBERS"));

    /// SysTick counts down from here, 24 bits.
    const RELOAD: u32 = 0x00FF_FFFF;

    #[panic_handler]
    fn panic(_: &PanicInfo<'_>) -> ! {
        end(false)
    }

    fn end(well: bool) -> ! {
        loop {
            exit(if well { EXIT_SUCCESS } else { EXIT_FAILURE });
        }
    }

    fn cycles(since: u32) -> u32 {
        since.wrapping_sub(SYST::get_current()) & RELOAD
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let Some(mut core) = cortex_m::Peripherals::take() else { end(false) };
        core.SYST.set_clock_source(SystClkSource::Core);
        core.SYST.set_reload(RELOAD);
        core.SYST.clear_current();
        core.SYST.enable_counter();
        let Some(memory) = singleton!(: [f32; MEMORY] = [0.0; MEMORY]) else { end(false) };
        let Ok(mut model) = TableModel::new(TABLE, memory) else { end(false) };
        let Ok(mut observer) = Observer::<f32, STATES, COUNT>::new(&model, SETTINGS, &READINGS[0]) else { end(false) };
        for (k, (readings, u)) in READINGS.iter().zip(&INPUTS).enumerate() {
            let input = Input { u, time_s: k as f32 * SETTINGS.period_s };
            let begin = SYST::get_current();
            observer.update(&mut model, readings, input);
            let update = cycles(begin);
            let begin = SYST::get_current();
            observer.predict(&mut model, input, SETTINGS.period_s);
            let predict = cycles(begin);
            hprintln!("tick {} update {} predict {}", k, update, predict);
        }
        hprint!("state");
        for x in observer.state() {
            hprint!(" {:08x}", x.to_bits());
        }
        hprintln!();
        end(true)
    }
}
