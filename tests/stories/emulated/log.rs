//! What the machine code in the emulator says of itself: its log, and how it started.

use host::recording::{self, LogLevel, Recording};
use tests::machine::{Emulated, FaultKind, Options, Recorded, SWING, TimedFault, image};
use tests::run_host;

/// Recordings that are begun until the robot rests.
const TRIES: usize = 400;

fn elf() -> &'static str {
    image().to_str().expect("the workspace has a plain path")
}

/// Records the short motion, with the texts of the image.
fn record(machine: &Emulated) -> (Recorded, Recording) {
    let recorded = machine.record(&["--motion", SWING, "--elf", elf()]);
    let recording = recording::read(&recorded.file).unwrap_or_else(|error| panic!("{error}\n{}", recorded.said));
    (recorded, recording)
}

#[test]
fn the_log_of_the_machine_code_is_shown_and_kept() {
    let machine = Emulated::start(&Options { seed: 3, ..Options::default() });
    let (Recorded { code, said, .. }, recording) = record(&machine);
    assert_eq!(code, Some(0), "{said}");
    let shown = said
        .lines()
        .find(|line| line.contains(" INFO  ") && line.contains(" started: "))
        .unwrap_or_else(|| panic!("{said}"));
    assert!(shown.contains("  main.rs:"), "{shown}");
    assert!(!said.contains("bytes lost"), "{said}");
    // It was said before anybody listened, in the device's time.
    let line =
        recording.log.iter().find(|line| line.message.contains(" started: ")).expect("the log is in the recording");
    assert_eq!(line.level, LogLevel::Info);
    assert!(line.t_us < recording.t_us[0], "{} µs, the first sample at {} µs", line.t_us, recording.t_us[0]);
    assert!(line.place.as_ref().is_some_and(|place| place.file == "main.rs"), "{line:?}");
    machine.finish();
}

#[test]
fn a_panic_is_told_at_once_and_in_the_next_recording() {
    let machine_faults = vec![TimedFault { at: 400, kind: FaultKind::Panic }];
    let machine = Emulated::start(&Options { seed: 5, machine_faults, ..Options::default() });
    let told = "warning: the device was restarted by a panic of the firmware at ";

    let (Recorded { code, said, .. }, _) = record(&machine);
    assert_eq!(code, Some(3), "{said}");
    let place = said.lines().find_map(|line| line.strip_prefix(told)).unwrap_or_else(|| panic!("{said}")).to_owned();
    assert!(place.contains("board/emulated/") && place.contains(".rs:"), "{place}");

    // The robot swings on for a while, and is not set to zero meanwhile: whoever stands beside it tries again.
    let swings = |recorded: &Recorded| recorded.said.contains("the sensors are not quiet");
    let recorded =
        (0..TRIES).map(|_| machine.record(&["--motion", SWING, "--elf", elf()])).find(|r| !swings(r)).unwrap();
    let recording = recording::read(&recorded.file).unwrap_or_else(|error| panic!("{error}\n{}", recorded.said));
    assert_eq!(recorded.code, Some(0), "{}", recorded.said);
    assert!(recorded.said.contains(&format!("{told}{place}")), "{}", recorded.said);
    let kept = recording.firmware.unwrap().restarted_by.unwrap();
    assert_eq!(kept, format!("a panic of the firmware at {place}"));
    let checked = run_host(["check".as_ref(), recorded.file.as_path()]);
    let checked = String::from_utf8_lossy(&checked.stdout).into_owned() + &String::from_utf8_lossy(&checked.stderr);
    assert!(checked.contains(&kept), "{checked}");
    machine.finish();
}
