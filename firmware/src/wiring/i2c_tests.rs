//! The state machines against a peripheral and a part that keep the reference manual's rules: the clock is held at
//! SB, ADDR and BTF until the software has done what it must, and a byte that is acknowledged too much is an error.

use proptest::prelude::*;

use super::*;

/// The peripheral with a part on its bus; `bus` tells what happened there.
#[derive(Default)]
struct Bus {
    bus: String,
    events: Events,
    listening: bool,
    acknowledge: bool,
    /// The part's address; none answers if it is another.
    part: u8,
    /// Bytes that the part gives.
    gives: Vec<u8>,
    given: usize,
    /// Data and shift register while reading; the flag is whether the byte was acknowledged.
    held: Vec<u8>,
    reading: bool,
    last_refused: bool,
    stopped: bool,
    /// Looks at the status until a start that was ordered is made, and how many of them a start takes. Until then the
    /// event before it stands.
    start_in: Option<u32>,
    start_takes: u32,
}

impl Bus {
    fn new(gives: &[u8]) -> Self {
        Bus { part: 0x68, gives: gives.to_vec(), ..Bus::default() }
    }

    /// The bus goes on until the peripheral holds the clock.
    fn run(&mut self) {
        if self.reading && !self.events.address {
            while self.held.len() < 2 && !self.last_refused && !self.stopped {
                let byte = self.gives.get(self.given).copied().unwrap_or(0xEE);
                self.given += 1;
                self.held.push(byte);
                // Two bytes are in: with the second one the clock is held, before it is known whether it is wanted.
                self.last_refused = !self.acknowledge;
                self.bus += if self.acknowledge { " r+" } else { " r-" };
            }
            self.events.byte_finished = self.held.len() == 2;
        }
    }
}

impl Port for Bus {
    fn events(&mut self) -> Events {
        if let Some(left) = self.start_in {
            self.start_in = left.checked_sub(1);
            if self.start_in.is_none() {
                (self.reading, self.stopped) = (false, false);
                self.events = Events { start: true, ..Events::default() };
            }
        }
        let events = self.events;
        (self.events.no_acknowledge, self.events.arbitration_lost) = (false, false);
        events
    }

    fn start(&mut self, acknowledge: bool) {
        self.bus += " S";
        self.acknowledge = acknowledge;
        self.start_in = Some(self.start_takes);
    }

    fn pass_address(&mut self) {
        assert!(self.events.address);
        self.events.address = false;
    }

    fn write(&mut self, byte: u8) {
        self.bus += &format!(" {byte:02x}");
        if core::mem::take(&mut self.events.start) {
            self.reading = byte & 1 == 1;
            let there = byte >> 1 == self.part;
            (self.events.address, self.events.no_acknowledge) = (there, !there);
        } else {
            self.events.byte_finished = true;
        }
    }

    fn read(&mut self) -> u8 {
        self.events.byte_finished = false;
        self.held.remove(0)
    }

    fn refuse_next(&mut self) {
        self.acknowledge = false;
    }

    fn stop(&mut self) {
        self.bus += " P";
        self.stopped = true;
    }

    fn listen(&mut self, on: bool) {
        self.listening = on;
    }
}

#[test]
fn a_start_that_is_pending_is_waited_for() {
    let gives: Vec<u8> = (1..=16).collect();
    let mut bus = Bus { start_takes: 10, ..Bus::new(&gives) };
    assert_eq!(run(&mut bus, 0x68, &[0x02], 16).answer(), Some(gives.as_slice()));
}

/// Somebody holds the clock while a repeated start is ordered: the event of the last byte stands for ever.
#[test]
fn a_start_that_is_never_made_is_no_storm_of_interrupts() {
    let mut bus = Bus::new(&[7; 16]);
    let mut transfer = Transfer::default();
    transfer.begin(&mut bus, 0x68, &[0x02], 16);
    bus.start_takes = u32::MAX;
    let interrupts = (0..10_000)
        .take_while(|_| {
            transfer.step(&mut bus);
            bus.listening
        })
        .count();
    assert!(interrupts < 100, "{interrupts}");
    assert_eq!(transfer.state(), State::Busy, "not over in time, so the bus is recovered");
}

/// Interrupts until the transfer is over; idle calls in between must do no harm.
fn run(bus: &mut Bus, address: u8, out: &[u8], answer_len: usize) -> Transfer {
    let mut transfer = Transfer::default();
    transfer.begin(bus, address, out, answer_len);
    for _ in 0..100 {
        bus.run();
        if transfer.state() != State::Busy {
            break;
        }
        assert!(bus.listening);
        transfer.step(bus);
    }
    transfer
}

#[test]
fn a_burst_is_written_turned_and_read_with_the_last_byte_refused() {
    let gives: Vec<u8> = (1..=16).collect();
    let mut bus = Bus::new(&gives);
    let transfer = run(&mut bus, 0x68, &[0x02], 16);
    assert_eq!(transfer.answer(), Some(gives.as_slice()));
    assert_eq!(bus.bus, format!(" S d0 02 S d1{} r- P", " r+".repeat(15)));
    assert!(!bus.listening, "an interrupt that nobody waits for would come again and again");
}

#[test]
fn a_register_is_written_and_the_bus_released() {
    let mut bus = Bus::new(&[]);
    assert_eq!(run(&mut bus, 0x68, &[0x7e, 0xaf, 0xde], 0).state(), State::Done);
    assert_eq!(bus.bus, " S d0 7e af de P");
}

proptest! {
    #[test]
    fn every_length_comes_back_and_reads_no_byte_too_many(
        out in prop::collection::vec(any::<u8>(), 1..=MAX_OUT),
        gives in prop::collection::vec(any::<u8>(), MIN_ANSWER..=MAX_ANSWER),
    ) {
        let mut bus = Bus::new(&gives);
        let transfer = run(&mut bus, 0x68, &out, gives.len());
        prop_assert_eq!(transfer.answer(), Some(gives.as_slice()));
        prop_assert_eq!(bus.given, gives.len());
        prop_assert!(bus.last_refused && bus.stopped && bus.held.is_empty());
    }

    /// Whatever the peripheral says at whatever time: no panic, and an end that frees the interrupt.
    #[test]
    fn any_sequence_of_events_is_survived(
        answer_len in prop_oneof![Just(0), MIN_ANSWER..=MAX_ANSWER],
        events in prop::collection::vec(any::<[bool; 5]>(), 0..200),
    ) {
        let mut bus = Bus::new(&[0; 400]);
        let mut transfer = Transfer::default();
        transfer.begin(&mut bus, 0x68, &[1, 2], answer_len);
        for [start, address, byte_finished, no_acknowledge, arbitration_lost] in events {
            bus.held = vec![7; 3];
            bus.events = Events { start, address, byte_finished, no_acknowledge, arbitration_lost };
            // What the fake insists on: the address is passed only when it was sent.
            transfer.step(&mut bus);
            prop_assert!(!bus.listening || transfer.state() == State::Busy);
        }
    }
}

#[test]
fn a_part_that_is_not_there_ends_the_transfer_with_a_stop() {
    let mut bus = Bus::new(&[]);
    assert_eq!(run(&mut bus, 0x69, &[0x02], 16).state(), State::NotAcknowledged);
    assert_eq!(bus.bus, " S d2 P");
    assert!(!bus.listening);
}

#[test]
fn a_lost_bus_is_left_alone() {
    let mut bus = Bus::new(&[]);
    let mut transfer = Transfer::default();
    transfer.begin(&mut bus, 0x68, &[0x02], 16);
    bus.start_in = None;
    bus.events.arbitration_lost = true;
    transfer.step(&mut bus);
    assert_eq!((transfer.state(), bus.bus.as_str(), bus.listening), (State::ArbitrationLost, " S", false));
}

#[test]
fn lengths_that_no_transfer_has_are_refused_before_the_bus_is_touched() {
    for (out, answer_len) in [(&[][..], 4), (&[0; 5][..], 4), (&[0][..], 1), (&[0][..], 2), (&[0][..], 17)] {
        let mut bus = Bus::new(&[]);
        assert_eq!(run(&mut bus, 0x68, out, answer_len).state(), State::Unsuited, "{out:?} {answer_len}");
        assert_eq!(bus.bus, "");
    }
}

/// A part that holds the data line for so many more clocks.
struct Stuck {
    clocks_left: u32,
    clock: bool,
    data: bool,
    log: String,
}

impl Lines for Stuck {
    fn take(&mut self) {
        (self.clock, self.data) = (true, true);
        self.log += "take ";
    }
    fn give(&mut self) {
        self.log += "give";
    }
    fn clock(&mut self, high: bool) {
        if self.clock && !high {
            self.clocks_left = self.clocks_left.saturating_sub(1);
            self.log += "c";
        }
        self.clock = high;
    }
    fn data(&mut self, high: bool) {
        if self.clock && high && !self.data {
            self.log += " P ";
        }
        self.data = high;
    }
    fn data_is_low(&self) -> bool {
        self.clocks_left > 0 || !self.data
    }
}

#[test]
fn a_stuck_bus_is_clocked_until_it_is_free_nine_times_at_most() {
    for (held, clocks) in [(0, 1), (1, 1), (4, 4), (9, 9), (100, 9)] {
        let mut lines = Stuck { clocks_left: held, clock: true, data: true, log: String::new() };
        let mut recovery = Recovery::default();
        let steps = (1..).find(|_| recovery.step(&mut lines)).unwrap();
        assert!(steps <= MAX_RECOVERY_STEPS, "{steps} steps");
        // The last fall of the clock belongs to the stop condition.
        assert_eq!(lines.log, format!("take {} P give", "c".repeat(clocks + 1)), "held for {held} clocks");
    }
}
