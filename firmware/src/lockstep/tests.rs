use proptest::prelude::*;
use protocol::Duty;

use super::*;

fn transfer() -> impl Strategy<Value = Transfer> {
    prop::collection::vec(any::<u8>(), 0..=MAX_TRANSFER).prop_map(|bytes| Transfer::from_slice(&bytes).unwrap())
}

fn tick() -> impl Strategy<Value = Tick> {
    let counts = any::<([bool; 2], u32, u32, u16)>();
    (any::<[i16; MOTORS]>(), counts, any::<Option<[u8; 10]>>(), any::<Option<[u8; 2]>>()).prop_map(
        |(duty, counts, spi, i2c)| Tick {
            duty: duty.map(Duty),
            fed: counts.0[0],
            armed: counts.0[1],
            begin_cycles: counts.1,
            tick_cycles: counts.2,
            stack_bytes: counts.3,
            spi,
            i2c,
        },
    )
}

fn request() -> impl Strategy<Value = Request> {
    let kind = prop_oneof![
        Just(Kind::Start),
        any::<u32>().prop_map(|us| Kind::Delay { us }),
        transfer().prop_map(Kind::Spi),
        (any::<u8>(), any::<u8>(), transfer()).prop_map(|(address, read, written)| Kind::I2c {
            address,
            read,
            written
        }),
        tick().prop_map(Kind::Tick),
        Just(Kind::Stop),
    ];
    (any::<u32>(), kind).prop_map(|(t_us, kind)| Request { t_us, kind })
}

fn sensors() -> impl Strategy<Value = Sensors> {
    let injected = prop_oneof![
        Just(InjectedFault::None),
        any::<u16>().prop_map(InjectedFault::Delay),
        Just(InjectedFault::PanicInCommands),
        Just(InjectedFault::TelemetryHangs),
        Just(InjectedFault::Halt),
        Just(InjectedFault::StackOverflows),
    ];
    let bursts = any::<(Option<[u8; 10]>, Option<[u8; 16]>, [Option<u16>; GYROS])>();
    let host = prop::collection::vec(any::<u8>(), 0..=MAX_HOST_BYTES);
    (any::<[u16; MOTORS]>(), bursts, any::<u8>(), injected, host).prop_map(
        |(counters, (spi, i2c, ready_us), pins, injected, host)| Sensors {
            counters,
            spi,
            i2c,
            ready_us,
            pins,
            injected,
            host: heapless::Vec::from_slice(&host).unwrap(),
        },
    )
}

/// The message without its length, which must be right.
fn body(write: impl Fn(&mut [u8]) -> Result<usize, Malformed>) -> Vec<u8> {
    let mut out = [0xAA; MAX_MESSAGE];
    let n = write(&mut out).unwrap();
    assert_eq!(usize::from(out[0]), n - 1);
    assert_eq!(write(&mut out[..n - 1]), Err(Malformed), "one byte less is too small");
    out[1..n].to_vec()
}

proptest! {
    #[test]
    fn requests_come_back(request in request()) {
        prop_assert_eq!(Request::read(&body(|out| request.write(out))), Ok(request));
    }

    #[test]
    fn sensors_come_back(sensors in sensors()) {
        prop_assert_eq!(Sensors::read(&body(|out| sensors.write(out))), Ok(sensors));
    }

    #[test]
    fn answers_come_back(bytes in proptest::option::of(transfer())) {
        let answer = Answer::from(bytes);
        prop_assert_eq!(Answer::read(&body(|out| answer.write(out))), Ok(answer));
    }

    #[test]
    fn reset_flags_come_back(flags: u32) {
        prop_assert_eq!(Started::read(&body(|out| Started(flags).write(out))), Ok(Started(flags)));
    }

    #[test]
    fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..MAX_MESSAGE)) {
        let _ = (Request::read(&bytes), Sensors::read(&bytes), Answer::read(&bytes), Started::read(&bytes));
    }

    /// A message that was cut off is none.
    #[test]
    fn half_a_message_is_none(tick in tick(), sensors in sensors()) {
        let request = body(|out| Request { t_us: 1, kind: Kind::Tick(tick) }.write(out));
        let sensors = body(|out| sensors.write(out));
        for n in 0..request.len() {
            prop_assert_eq!(Request::read(&request[..n]), Err(Malformed));
        }
        for n in 0..sensors.len() {
            prop_assert_eq!(Sensors::read(&sensors[..n]), Err(Malformed));
        }
    }
}

#[test]
fn the_bytes_are_those_of_the_tables() {
    let tick = Tick {
        duty: [Duty(1), Duty(-2), Duty(3)],
        fed: true,
        armed: false,
        begin_cycles: 0x0403_0201,
        tick_cycles: 5,
        stack_bytes: 6,
        spi: Some([7; 10]),
        i2c: Some([0x68, 0x02]),
    };
    let bytes = body(|out| Request { t_us: 1000, kind: Kind::Tick(tick) }.write(out));
    let head = [4, 0xE8, 3, 0, 0, 1, 0, 0xFE, 0xFF, 3, 0, 1, 0, 1, 2, 3, 4, 5, 0, 0, 0, 6, 0];
    assert_eq!(bytes[..23], head);
    assert_eq!(bytes[23..], [1, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 1, 0x68, 2]);
    let sensors = Sensors {
        counters: [1, 2, 3],
        spi: Some([4; 10]),
        ready_us: [Some(0x0605), None],
        pins: PINS_BROWN_OUT,
        injected: InjectedFault::Delay(258),
        host: heapless::Vec::from_slice(&[9, 8]).unwrap(),
        ..Sensors::default()
    };
    let bytes = body(|out| sensors.write(out));
    assert_eq!(bytes[..8], [1, 0, 2, 0, 3, 0, 1, 4]);
    assert_eq!(bytes[17..], [[0; 17].as_slice(), &[1, 5, 6, 0, 0, 0], &[2, 1, 2, 1, 2, 9, 8]].concat());
}
