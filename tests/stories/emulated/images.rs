//! The two images of the firmware: what they take of the chip, and whether they know the robot that the host knows.

use std::io::Write;
use std::path::Path;

use host::robot::Robot;
use host::simulate::{Board, Plant, Truth, World};
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind};
use tests::machine::image::{Kind, image_of};

/// What `memory.x` grants.
const FLASH: u64 = 96 * 1024;
const RAM: u64 = 24 * 1024;

/// Bytes of an image.
#[derive(Debug)]
struct Taken {
    flash: u64,
    /// Without the stack.
    data: u64,
    stack: u64,
}

fn taken(file: &Path) -> Taken {
    let bytes = std::fs::read(file).unwrap();
    let elf = object::File::parse(&*bytes).unwrap();
    let symbol = |name| elf.symbols().find(|symbol| symbol.name() == Ok(name)).unwrap().address();
    let stack = symbol("_stack_start") - symbol("_stack_end");
    let mut taken = Taken { flash: 0, data: 0, stack };
    for section in elf.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else { panic!("an ELF file") };
        if sh_flags & u64::from(object::elf::SHF_ALLOC) == 0 {
            continue;
        }
        let in_ram = section.address() >= 0x2000_0000;
        let loaded = !matches!(section.kind(), SectionKind::UninitializedData);
        taken.flash += if !in_ram || loaded { section.size() } else { 0 };
        taken.data += if in_ram { section.size() } else { 0 };
    }
    taken
}

/// The linker refuses what is larger than `memory.x` grants; this holds the figures of the firmware's README, from both
/// sides, and prints them.
#[test]
fn the_images_fit_their_budgets() {
    // Past the test's capture, so that every run of the tests says it.
    let mut out = std::io::stderr();
    writeln!(out, "image: flash, RAM without stack, stack (bytes)").unwrap();
    for (kind, board) in [(Kind::F405, "f405"), (Kind::Emulated, "emulated")] {
        let [flash, data] = told(board);
        let taken = taken(image_of(kind));
        writeln!(out, "{kind:?}: {}, {}, {}", taken.flash, taken.data, taken.stack).unwrap();
        assert!(taken.flash <= FLASH && taken.data + taken.stack <= RAM, "{taken:?}");
        let near = |is: u64, said: u64| is.abs_diff(said) * 100 <= said * 3;
        assert!(near(taken.flash, flash) && near(taken.data, data), "{kind:?}: the README says otherwise: {taken:?}");
    }
}

/// What the firmware's README says of a board's image: flash and RAM without stack, bytes. Measured with Rust 1.95; another
/// compiler moves them by a few per cent.
fn told(board: &str) -> [u64; 2] {
    let readme = include_str!("../../../firmware/README.md");
    let row = readme.lines().find_map(|line| line.strip_prefix(&format!("| {board} | "))).expect("a row of the table");
    let mut figures = row.split(" | ").map(|figure| figure.replace(',', "").parse().expect("bytes"));
    std::array::from_fn(|_| figures.next().expect("flash and RAM"))
}

/// Scales, limits, ranges: the robot that the image is built for is the one that the host describes, bit for bit.
#[test]
fn the_images_doggy_is_the_hosts() {
    let robot = Robot::builtin("doggy").unwrap();
    let plant = Plant::new(&robot, &Truth::nominal(&robot), Vec::new()).unwrap();
    let board = Board::new(&robot, World::new(&robot, plant, 1).unwrap().with_real_gyros(&robot, 1, true)).unwrap();
    assert_eq!(*board.config(), firmware::robot::doggy());
}
