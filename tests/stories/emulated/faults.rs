//! What stops the machine code in the emulator: how soon the pins show zero duty, and what the host is told.
//!
//! Ticks are counted at the pins of the simulated robot, from the tick in which the fault came.

use host::link::{self, LinkError};
use host::simulate::Fault;
use protocol::{Hello, ResetReason};
use tests::machine::{Emulated, FaultKind, Log, Options, REACH, Recorded, SWING, TimedFault};

/// Ticks after the start of the motion.
const AT: u32 = 400;

/// A machine whose motion was stopped.
struct Stopped {
    machine: Emulated,
    /// What `host record` said.
    said: String,
}

impl Stopped {
    /// Records the short motion with this fault, which must end it.
    fn by(kind: FaultKind) -> Self {
        Self::of(SWING, kind)
    }

    /// Records this motion with this fault, which must end it.
    fn of(motion: &str, kind: FaultKind) -> Self {
        Self::record(
            motion,
            Options { seed: 5, machine_faults: vec![TimedFault { at: AT, kind }], ..Options::default() },
        )
    }

    fn record(motion: &str, options: Options) -> Self {
        let machine = Emulated::start(&options);
        let Recorded { code, said, .. } = machine.record(&["--motion", motion]);
        assert_eq!(code, Some(3), "{said}");
        Self { machine, said }
    }

    /// What the device says of itself afterwards.
    fn hello(self) -> (Self, Hello) {
        match link::probe(&self.machine.port().display().to_string(), &link::Options::default()) {
            Ok(hello) => (self, hello),
            Err(error) => {
                self.machine.finish();
                panic!("{error}");
            }
        }
    }

    /// The same for a motor that was wrong from the start of a motion on, and not driven before the tick `at`.
    fn told_at(self, reason: &str, at: u32, ticks: std::ops::RangeInclusive<usize>) {
        assert!(self.said.contains(reason), "{}", self.said);
        let (log, _) = self.machine.finish();
        let to_zero = log.ticks_to_zero(at);
        eprintln!("{reason}: zero duty after {to_zero} ticks");
        assert!(ticks.contains(&to_zero), "{to_zero} ticks until zero duty, {ticks:?} expected");
    }

    /// The host was told so, and the motors are without duty after so many ticks.
    fn told(self, reason: &str, ticks: std::ops::RangeInclusive<usize>) -> Log {
        assert!(self.said.contains(reason), "{}", self.said);
        let (log, _) = self.machine.finish();
        let (driven, to_zero) = (log.motion_from(AT - 50), log.ticks_to_zero(AT));
        let moving = driven[..50].iter().all(|period| period.duty.iter().any(|duty| duty.0 != 0));
        assert!(moving, "the motors were driven before");
        eprintln!("{reason}: zero duty after {to_zero} ticks");
        assert!(ticks.contains(&to_zero), "{to_zero} ticks until zero duty, {ticks:?} expected");
        log
    }
}

/// Until the pins have shown so many periods. The machine goes on while a host speaks to it. A process that another test is starting has this one's files for a moment, and with
/// them the lock of a port that was closed.
fn wait_for(machine: &Emulated, periods: usize) {
    for _ in 0..1000 {
        if machine.so_far(|log| log.periods.len()) >= periods {
            return;
        }
        match link::probe(&machine.port().display().to_string(), &link::Options::default()) {
            Ok(_) => {}
            Err(LinkError::Open { .. }) => std::thread::sleep(std::time::Duration::from_millis(1)),
            Err(error) => panic!("it answers: {error}"),
        }
    }
    panic!("no {periods} periods");
}

/// The device waits for 100 ms since the last heartbeat, which came at most 60 ms before the line was cut.
#[test]
fn heartbeats_that_stay_away_stop_the_motion() {
    let cut = Fault::StallIn { duration_s: 1.0, at_s: 1e-3 * f64::from(AT) };
    let stopped = Stopped::record(SWING, Options { seed: 5, faults: vec![cut], ..Options::default() });
    stopped.told("the host's heartbeats stayed away", 38..=101);
}

/// Nonsense on a full line is no heartbeat.
#[test]
fn nonsense_in_a_motion_is_no_sign_of_life() {
    Stopped::by(FaultKind::Nonsense).told("the host's heartbeats stayed away", 38..=101);
}

#[test]
fn an_emergency_stop_acts_within_its_tick() {
    Stopped::by(FaultKind::EmergencyStop).told("emergency stop", 0..=0);
}

#[test]
fn a_supply_that_breaks_down_stops_the_motors_within_its_tick() {
    Stopped::by(FaultKind::BrownOut).told("the supply is too low", 0..=0);
}

/// The third tick without a reading is one too many.
#[test]
fn a_dead_gyro_stops_the_motion_in_the_third_tick() {
    Stopped::by(FaultKind::Gyro1Dead).told("gyro 1 does not answer", 2..=2);
}

/// Its noise moves the words of a gyro that lives; 50 repeats never happen.
#[test]
fn a_gyro_that_repeats_itself_stops_the_motion() {
    Stopped::by(FaultKind::Gyro2Stuck).told("gyro 2 is stuck at one reading", 50..=50);
}

#[test]
fn a_bus_that_hangs_stops_the_motion_in_the_third_tick() {
    Stopped::by(FaultKind::I2cHangs).told("the bus of gyro 2 hangs", 2..=2);
}

/// 1000 counts are 0.15 rad in a millisecond.
#[test]
fn an_encoder_that_jumps_stops_the_motion_within_its_tick() {
    Stopped::by(FaultKind::EncoderJumps { motor: 1, counts: 1000 }).told("encoder 2 jumped", 0..=0);
}

/// At a duty of at most 0.4 a push of 13.5 ms takes 40 ms and more, and the swing turns after 250.
#[test]
fn an_encoder_with_an_open_phase_stops_the_motion() {
    Stopped::by(FaultKind::OpenPhase { motor: 0 }).told("encoder 1 is stuck", 30..=250);
}

/// A slow move at a duty of 0.15.
#[test]
fn an_encoder_with_an_open_phase_stops_a_slow_move() {
    Stopped::of(REACH, FaultKind::OpenPhase { motor: 1 }).told("encoder 2 is stuck", 140..=160);
}

#[test]
fn an_encoder_that_counts_backwards_stops_a_slow_move() {
    let backwards = FaultKind::Counts { motor: 1, halves: -2 };
    // The gyro sees the difference of both speeds before the push against the duty is long enough.
    Stopped::of(REACH, backwards).told("gyro 2 measures another rotation than the encoders", 80..=150);
}

#[test]
fn a_motor_with_swapped_leads_goes_against_its_duty() {
    let swapped = Options { seed: 5, swapped_leads: Some(1), ..Options::default() };
    Stopped::record(REACH, swapped).told_at("joint 2 goes against its duty", 50, 140..=300);
}

/// Half of the steps at half a radian a second: a tenth of a radian and more after half a second.
#[test]
fn an_encoder_that_counts_half_is_told_by_the_gyro() {
    let half = FaultKind::Counts { motor: 1, halves: 1 };
    Stopped::of(REACH, half).told("gyro 2 measures another rotation than the encoders", 300..=900);
}

/// The tick after the one that ran too long stops.
#[test]
fn a_tick_that_overruns_its_period_stops_the_motion() {
    Stopped::by(FaultKind::Overrun(1300)).told("the control loop overran its period", 1..=1);
}

#[test]
fn a_panic_lets_go_of_the_motors_and_its_place_is_told() {
    let (stopped, hello) = Stopped::by(FaultKind::Panic).hello();
    assert_eq!(hello.reset, ResetReason::Panic);
    let place = hello.panic.expect("the place survived the reset");
    assert!(place.file.ends_with("board/emulated/line.rs") && place.line > 1, "{place:?}");
    let log = stopped.told("restarted (panic", 0..=0);
    assert_eq!(log.starts, [ResetReason::PowerOn, ResetReason::Software], "the processor reset itself, once");
}

/// The stack lies at the bottom of the RAM: the processor locks up, nothing is overwritten, and the watchdog resets it.
#[test]
fn a_stack_that_overflows_ends_in_a_reset() {
    let (stopped, hello) = Stopped::by(FaultKind::StackOverflows).hello();
    assert_eq!((hello.reset, hello.panic), (ResetReason::Watchdog, None));
    let log = stopped.told("restarted (watchdog", 0..=0);
    assert_eq!(log.starts, [ResetReason::PowerOn, ResetReason::Watchdog]);
}

/// The drivers are enabled from the start of the motion on, and let go half a second after a stop.
#[test]
fn drivers_are_enabled_for_a_motion_only() {
    let stopped = Stopped::by(FaultKind::EmergencyStop);
    let periods = stopped.machine.so_far(|log| log.periods.len());
    wait_for(&stopped.machine, periods + 600);
    let log = stopped.told("emergency stop", 0..=0);
    let start = log.motion.unwrap();
    assert!(log.periods[..start - 2].iter().all(|period| !period.armed), "before the start");
    let braking = log.motion_from(AT).iter().take_while(|period| period.armed).count();
    assert!(log.motion_from(0)[..AT as usize].iter().all(|period| period.armed));
    assert!((495..=505).contains(&braking), "{braking} ticks");
}

/// A gyro whose supply comes late is missing at the start, a motion is refused, and once it answers one is played.
#[test]
fn a_gyro_that_comes_late_is_set_up_from_idle() {
    let machine = Emulated::start(&Options { seed: 5, gyro1_from_tick: 700, ..Options::default() });
    let Recorded { code, said, .. } = machine.record(&["--motion", SWING]);
    assert!(code == Some(3) && said.contains("the sensors are not quiet"), "{said}");
    wait_for(&machine, 1700);
    let Recorded { code, said, .. } = machine.record(&["--motion", SWING]);
    assert_eq!(code, Some(0), "{said}");
    machine.finish();
}

/// The tick bears with a task for 10 ticks, then the watchdog is fed no more and bites after 16.
#[test]
fn a_task_that_hangs_is_found_by_the_watchdog() {
    let (stopped, hello) = Stopped::by(FaultKind::TelemetryHangs).hello();
    assert_eq!((hello.reset, hello.panic), (ResetReason::Watchdog, None));
    let log = stopped.told("restarted (watchdog", 26..=26);
    assert_eq!(log.starts, [ResetReason::PowerOn, ResetReason::Watchdog]);
}
