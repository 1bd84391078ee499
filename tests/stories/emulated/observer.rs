//! The observer on a Cortex-M4F: the machine code in the emulator says the same bytes as the same code on this machine, and how much a tick takes.

use std::fmt::Write as _;

use host::calibrate::{Preset, calibrate};
use host::export::Exported;
use host::observe::{Numbers, Sensors};
use host::recording::Recording;
use host::robot::Robot;
use host::simulate::{Direct, Options, SHORT_MOTION};
use observer::{Input, Observer, TableModel, Tape};
use solve::levenberg::Settings;
use tests::machine::{observer_image, said};
use tests::observed::MOVING_DUTY;

/// Ticks that are played, from the first motor that moves.
const TICKS: usize = 100;
/// SysTick counts at 168 MHz, the emulator takes 8 ns an instruction.
const INSTRUCTIONS_PER_CYCLE: f64 = 1e3 / (168.0 * 8.0);
/// Cycles of an instruction that are reckoned with, as in the firmware's budget, and those of a tick.
const CYCLES_PER_INSTRUCTION: f64 = 2.5;
const CYCLES_PER_TICK: f64 = 168_000.0;
/// The document rounds, and another compiler counts otherwise.
const RTOL: f64 = 0.03;
/// Room on this machine.
const ROOM: usize = 32;

/// What a calibration of a simulated Doggy says, and some ticks of its motion.
struct Played {
    numbers: Numbers,
    readings: Vec<Vec<f32>>,
    inputs: Vec<Vec<f32>>,
}

impl Played {
    fn doggy() -> Self {
        let robot = Robot::builtin("doggy").unwrap();
        let recording = Direct::record_nth(&Options::new(robot.clone()), SHORT_MOTION, 1).unwrap().recording;
        let settings = Settings::default();
        let calibration = calibrate(&robot, &[&recording], Preset::Default, &settings, |_, _| {}).unwrap();
        let numbers = Numbers::of(&Exported::of(&calibration).unwrap()).unwrap();
        let moves = |k: &usize| recording.duty.iter().any(|duty| duty[*k].abs() > MOVING_DUTY);
        let first = (0..recording.len()).find(moves).unwrap();
        let ticks = first..first + TICKS;
        let row = |of: &dyn Fn(&Recording, usize) -> Vec<f32>| ticks.clone().map(|k| of(&recording, k)).collect();
        Played {
            readings: row(&|of, k| of.channels.iter().map(|channel| channel.values[k] as f32).collect()),
            inputs: row(&|of, k| of.duty.iter().map(|duty| duty[k] as f32).collect()),
            numbers,
        }
    }

    /// The bits of the last estimate, on this machine.
    fn here(&self) -> Vec<u32> {
        let (table, settings) = (self.numbers.table(), self.numbers.settings(Sensors::Both));
        let mut model = TableModel::new(table, vec![0.0_f32; table.memory()]).unwrap();
        let mut observer = Observer::<f32, ROOM, ROOM>::new(&model, settings, &self.readings[0]).unwrap();
        for (k, (readings, u)) in self.readings.iter().zip(&self.inputs).enumerate() {
            let input = Input { u, time_s: k as f32 * settings.period_s };
            observer.update(&mut model, readings, input);
            observer.predict(&mut model, input, settings.period_s);
        }
        observer.state().iter().map(|x| x.to_bits()).collect()
    }

    /// All numbers as the image includes them.
    fn source(&self) -> String {
        let (table, settings) = (self.numbers.table(), self.numbers.settings(Sensors::Both));
        let number = |value: &f32| format!("f32::from_bits({:#x})", value.to_bits());
        let numbers = |values: &[f32]| values.iter().map(number).collect::<Vec<_>>().join(", ");
        let rows =
            |rows: &[Vec<f32>]| rows.iter().map(|row| format!("[{}]", numbers(row))).collect::<Vec<_>>().join(", ");
        let tape = |tape: &Tape<'_, f32>| {
            let instructions = tape.instructions.iter().map(|does| {
                let (operation, operands) = (does.operation, does.operands);
                format!("Instruction {{ operation: Operation::{operation:?}, operands: {operands:?} }}")
            });
            let outputs = tape.outputs.iter().map(|o| format!("Output {{ place: {}, value: {} }}", o.place, o.value));
            let (instructions, outputs): (Vec<_>, Vec<_>) = (instructions.collect(), outputs.collect());
            format!(
                "Tape {{ constants: &[{}], instructions: &[{}], outputs: &[{}] }}",
                numbers(tape.constants),
                instructions.join(", "),
                outputs.join(", ")
            )
        };
        let start = settings.start.iter().map(|start| {
            format!(
                "Start {{ reading: {:?}, value: {}, sigma: {} }}",
                start.reading,
                number(&start.value),
                number(&start.sigma)
            )
        });
        let mut source = String::new();
        let (states, count, inputs) = (table.states, table.readings, table.inputs);
        writeln!(source, "const MEMORY: usize = {};", table.memory()).unwrap();
        writeln!(source, "const STATES: usize = {states};\nconst COUNT: usize = {count};").unwrap();
        writeln!(source, "static READINGS: [[f32; {count}]; {TICKS}] = [{}];", rows(&self.readings)).unwrap();
        writeln!(source, "static INPUTS: [[f32; {inputs}]; {TICKS}] = [{}];", rows(&self.inputs)).unwrap();
        writeln!(
            source,
            "const TABLE: Table<'static, f32> = Table {{ moving: {}, states: {states}, inputs: {inputs}, readings: {count}, rates: {}, rates_slopes: {}, readings_slopes: {} }};",
            table.moving,
            tape(&table.rates),
            tape(&table.rates_slopes),
            tape(&table.readings_slopes)
        )
        .unwrap();
        writeln!(
            source,
            "const SETTINGS: Settings<'static, f32> = Settings {{ period_s: {}, sigma: &[{}], is_gyro: &{:?}, process: &[{}], start: &[{}], sensors: Sensors::Both }};",
            number(&settings.period_s),
            numbers(settings.sigma),
            settings.is_gyro,
            numbers(settings.process),
            start.collect::<Vec<_>>().join(", ")
        )
        .unwrap();
        source
    }
}

/// The instructions and the share of a tick, %, that the document tells of a row of its table.
fn documented(row: &str) -> [f64; 2] {
    let document = include_str!("../../../host/doc/observer.md");
    let cells = document.lines().find_map(|line| line.strip_prefix(&format!("| {row} | "))).unwrap();
    let mut cells = cells.split('|').take(2).map(|cell| cell.replace([',', ' ', '%'], "").parse().unwrap());
    [cells.next().unwrap(), cells.next().unwrap()]
}

/// What the image says in the emulator.
fn on_chip(source: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("numbers.rs");
    std::fs::write(&file, source).unwrap();
    said(&observer_image(&file))
}

#[test]
fn the_machine_code_estimates_to_the_bit_what_a_pc_does_and_says_what_a_tick_takes() {
    let played = Played::doggy();
    let said = on_chip(&played.source());
    let state = said.lines().find_map(|line| line.strip_prefix("state ")).unwrap_or_else(|| panic!("{said}"));
    let bits: Vec<u32> = state.split(' ').map(|word| u32::from_str_radix(word, 16).unwrap()).collect();
    assert_eq!(bits, played.here());
    let ticks: Vec<[f64; 2]> = said
        .lines()
        .filter_map(|line| {
            let words: Vec<&str> = line.split(' ').collect();
            let ["tick", _, "update", update, "predict", predict] = words[..] else { return None };
            Some([update, predict].map(|cycles| cycles.parse::<f64>().unwrap() * INSTRUCTIONS_PER_CYCLE))
        })
        .collect();
    assert_eq!(ticks.len(), TICKS);
    let worst = |of: fn(&[f64; 2]) -> f64| ticks.iter().map(of).fold(0.0, f64::max);
    let [update, predict, both] = [worst(|t| t[0]), worst(|t| t[1]), worst(|t| t[0] + t[1])];
    println!(
        "{} components, {} readings: instructions of the worst tick: update {update:.0}, prediction {predict:.0}, both {both:.0}",
        played.numbers.table().states,
        played.numbers.table().readings
    );
    for (row, found) in [("update", update), ("prediction", predict), ("both", both)] {
        let [told, percent] = documented(row);
        assert!(
            (told / found - 1.0).abs() < RTOL,
            "host/doc/observer.md tells {told} instructions of {row}: {found:.0}"
        );
        let of_tick = 100.0 * told * CYCLES_PER_INSTRUCTION / CYCLES_PER_TICK;
        assert!((percent - of_tick).abs() <= 0.5, "host/doc/observer.md tells {percent} % of {row}: {of_tick:.1} %");
    }
}
