//! A write and read on the I²C master of the STM32F4 (the one with SR1 and SR2), step by step from its events, and how
//! a bus that hangs is clocked free.
//!
//! ```text
//!   start ─SB─▶ address+W ─ADDR─▶ byte ─BTF─▶ … ─BTF─▶ start ─SB─▶ address+R ─ADDR─▶ … ─BTF─▶ byte ─▶ last two
//!                                                 ╰──▶ stop, if nothing is read                      stop before them
//! ```
//!
//! Only events at which the clock is held low are used (BTF, not RXNE or TXE), so however late the interrupt comes, no
//! byte is lost; RM0090 27.3.3, closing communication with N > 2. At BTF two bytes wait, one in the data register
//! and one in the shift register. With three bytes to go the acknowledge is switched off before the first of them is
//! taken, so that the last one is not acknowledged; with two to go the stop is ordered before both are taken.
//!
//! The errata's spurious bus error in master mode is passed over: a transfer that it was not spurious for does not end
//! in time.

/// Status of the peripheral, as in its register SR1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Events {
    /// A start condition was made.
    pub start: bool,
    /// The address was sent and acknowledged.
    pub address: bool,
    /// Two bytes were received, or the last one was sent, and the clock is held low.
    pub byte_finished: bool,
    /// Nobody acknowledged.
    pub no_acknowledge: bool,
    /// Another master, or a short, won the bus.
    pub arbitration_lost: bool,
}

/// The peripheral's registers, as far as a transfer needs them.
pub trait Port {
    /// Reads the status; what is an error in it is cleared.
    fn events(&mut self) -> Events;
    /// Orders a start condition; `acknowledge` the bytes read after it.
    fn start(&mut self, acknowledge: bool);
    /// Goes on after the address, by reading the second status register.
    fn pass_address(&mut self);
    /// Writes the data register.
    fn write(&mut self, byte: u8);
    /// Reads the data register.
    fn read(&mut self) -> u8;
    /// Does not acknowledge the next byte.
    fn refuse_next(&mut self);
    /// Orders a stop condition.
    fn stop(&mut self);
    /// Lets the peripheral raise interrupts, or not.
    fn listen(&mut self, on: bool);
}

/// Interrupts in a row without a step after which the peripheral is silenced; the transfer is then not over in time and its
/// bus is recovered. Between an order of a start condition and its making the last event stands, and the interrupt comes
/// again at once: 2 to 3 µs, ten times at most. Of a bus whose clock is held it would never end, and no task of the same
/// priority ran. With half of it a start that is late costs a reading; twice takes 50 µs more of the tick.
pub const MAX_FRUITLESS: u8 = 64;

/// Most bytes written in a transfer: a register and a word.
pub const MAX_OUT: usize = 4;
/// Most bytes read in a transfer: the burst of a gyro.
pub const MAX_ANSWER: usize = 16;
/// Fewest bytes read in a transfer that reads: fewer need other sequences, which no part here asks for.
pub const MIN_ANSWER: usize = 3;

/// Where a transfer stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// Nothing was begun.
    #[default]
    Idle,
    /// Under way.
    Busy,
    /// Over; the answer is there.
    Done,
    /// Over: nobody acknowledged.
    NotAcknowledged,
    /// Over: the bus was lost to another.
    ArbitrationLost,
    /// Refused: more or fewer bytes than a transfer can have.
    Unsuited,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Addressing,
    Writing,
    Turning,
    Reading,
}

/// A transfer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Transfer {
    state: State,
    phase: Phase,
    address: u8,
    out: [u8; MAX_OUT],
    out_len: usize,
    answer: [u8; MAX_ANSWER],
    answer_len: usize,
    /// Bytes done in this phase.
    done: usize,
    /// Interrupts since the last step.
    fruitless: u8,
}

impl Transfer {
    /// Begins to write `out` (at least a byte) to the 7-bit address and then to read `answer_len` bytes, none or at
    /// least [`MIN_ANSWER`].
    pub fn begin(&mut self, port: &mut impl Port, address: u8, out: &[u8], answer_len: usize) {
        let reads = answer_len == 0 || (MIN_ANSWER..=MAX_ANSWER).contains(&answer_len);
        *self = Transfer { state: State::Unsuited, address, answer_len, ..Transfer::default() };
        let Some(room) = self.out.get_mut(..out.len()) else { return };
        if out.is_empty() || !reads {
            return;
        }
        room.copy_from_slice(out);
        self.out_len = out.len();
        self.state = State::Busy;
        port.start(true);
        port.listen(true);
    }

    /// Takes the next step, if there is one: to be called on every interrupt, and harmless at any other time.
    pub fn step(&mut self, port: &mut impl Port) {
        if self.state != State::Busy {
            return port.listen(false);
        }
        let events = port.events();
        if events.arbitration_lost {
            return self.end(port, State::ArbitrationLost);
        }
        if events.no_acknowledge {
            port.stop();
            return self.end(port, State::NotAcknowledged);
        }
        match self.phase {
            Phase::Addressing if events.start => port.write(self.address << 1),
            Phase::Addressing if events.address => {
                port.pass_address();
                // `begin` has refused to write nothing.
                port.write(self.out[0]);
                (self.phase, self.done) = (Phase::Writing, 1);
            }
            Phase::Writing if events.byte_finished && self.done < self.out_len => {
                port.write(self.out[self.done]);
                self.done += 1;
            }
            Phase::Writing if events.byte_finished && self.answer_len == 0 => {
                port.stop();
                self.end(port, State::Done);
            }
            Phase::Writing if events.byte_finished => {
                port.start(true);
                self.phase = Phase::Turning;
            }
            Phase::Turning if events.start => port.write(self.address << 1 | 1),
            Phase::Turning if events.address => {
                port.pass_address();
                (self.phase, self.done) = (Phase::Reading, 0);
            }
            Phase::Reading if events.byte_finished => match self.answer_len - self.done {
                2 => {
                    port.stop();
                    self.take(port);
                    self.take(port);
                    self.end(port, State::Done);
                }
                3 => {
                    port.refuse_next();
                    self.take(port);
                }
                _ => self.take(port),
            },
            _ => return self.wait(port),
        }
        self.fruitless = 0;
    }

    /// Nothing to do for this interrupt.
    fn wait(&mut self, port: &mut impl Port) {
        self.fruitless = self.fruitless.saturating_add(1);
        if self.fruitless >= MAX_FRUITLESS {
            port.listen(false);
        }
    }

    /// Where it stands.
    pub fn state(&self) -> State {
        self.state
    }

    /// What was read, if the transfer is done.
    pub fn answer(&self) -> Option<&[u8]> {
        (self.state == State::Done).then_some(&self.answer[..self.answer_len])
    }

    fn take(&mut self, port: &mut impl Port) {
        // `done` stays below `answer_len`, which is at most the answer's length.
        if let Some(byte) = self.answer.get_mut(self.done) {
            *byte = port.read();
            self.done += 1;
        }
    }

    fn end(&mut self, port: &mut impl Port, state: State) {
        port.listen(false);
        self.state = state;
    }
}

/// The two lines of the bus as plain pins, open drain.
pub trait Lines {
    /// Takes the pins from the peripheral, released.
    fn take(&mut self);
    /// Gives them back to a peripheral that was reset.
    fn give(&mut self);
    /// Releases the clock, or pulls it low.
    fn clock(&mut self, high: bool);
    /// Releases the data line, or pulls it low.
    fn data(&mut self, high: bool);
    /// Whether anybody holds the data line low.
    fn data_is_low(&self) -> bool;
}

/// Frees a bus whose data line a part holds low because it waits for the clocks of a byte: up to nine clocks, then a
/// stop condition. One edge a step, so that nobody waits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Recovery {
    /// Not under way.
    #[default]
    Off,
    /// After so many clocks, the clock line high.
    High(u8),
    /// The clock line low, before so many clocks are complete.
    Low(u8),
    /// Stop condition: clock low, data low.
    StopLow,
    /// Stop condition: clock high, data low.
    StopHigh,
}

/// Steps of the longest recovery.
pub const MAX_RECOVERY_STEPS: usize = 23;
const CLOCKS: u8 = 9;

impl Recovery {
    /// One edge, a few microseconds after the last at the earliest. True if it was the last.
    #[must_use]
    pub fn step(&mut self, lines: &mut impl Lines) -> bool {
        *self = match *self {
            Recovery::Off => {
                lines.take();
                Recovery::High(0)
            }
            Recovery::High(clocks) if clocks < CLOCKS && (clocks == 0 || lines.data_is_low()) => {
                lines.clock(false);
                Recovery::Low(clocks + 1)
            }
            Recovery::High(_) => {
                lines.clock(false);
                lines.data(false);
                Recovery::StopLow
            }
            Recovery::Low(clocks) => {
                lines.clock(true);
                Recovery::High(clocks)
            }
            Recovery::StopLow => {
                lines.clock(true);
                Recovery::StopHigh
            }
            Recovery::StopHigh => {
                lines.data(true);
                lines.give();
                Recovery::Off
            }
        };
        *self == Recovery::Off
    }
}

#[cfg(test)]
#[path = "i2c_tests.rs"]
mod tests;
