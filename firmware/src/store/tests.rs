use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use proptest::prelude::*;

use super::*;

const AREA: usize = 1024;

/// A flash that loses its power after so many bytes were written or erased, in the middle of the next one. `W` is what it
/// writes at a time. What is torn is drawn: some bits have changed, others not.
#[derive(Clone)]
struct Dying<const W: usize> {
    bytes: Vec<u8, { 2 * AREA }>,
    /// Bytes until it dies; none for never.
    left: Option<usize>,
    dead: bool,
    /// Bytes that it has written and erased.
    worked: usize,
    drawn: u64,
    /// An erase takes the bytes from the last to the first.
    backwards: bool,
}

#[derive(Debug)]
struct Dead;

impl NorFlashError for Dead {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl<const W: usize> Dying<W> {
    fn new(fill: u8) -> Self {
        let bytes = [fill; 2 * AREA].into_iter().collect();
        Dying { bytes, left: None, dead: false, worked: 0, drawn: 1, backwards: false }
    }

    fn draw(&mut self) -> u8 {
        self.drawn = self.drawn.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.drawn >> 56) as u8
    }

    /// The power comes back for good.
    fn revive(&mut self) {
        (self.left, self.dead) = (None, false);
    }

    /// The byte becomes this, or what a torn step leaves of it.
    fn step(&mut self, at: usize, to: u8) -> Result<(), Dead> {
        if self.left == Some(0) {
            self.dead = true;
            let changed = (self.bytes[at] ^ to) & self.draw();
            self.bytes[at] ^= changed;
            return Err(Dead);
        }
        self.left = self.left.map(|left| left - 1);
        self.worked += 1;
        self.bytes[at] = to;
        Ok(())
    }
}

impl<const W: usize> ErrorType for Dying<W> {
    type Error = Dead;
}

impl<const W: usize> ReadNorFlash for Dying<W> {
    const READ_SIZE: usize = W;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Dead> {
        let from = offset as usize;
        assert!(from.is_multiple_of(W) && bytes.len().is_multiple_of(W));
        if self.dead {
            return Err(Dead);
        }
        bytes.copy_from_slice(&self.bytes[from..from + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const W: usize> NorFlash for Dying<W> {
    const WRITE_SIZE: usize = W;
    const ERASE_SIZE: usize = AREA;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Dead> {
        let places = from as usize..to as usize;
        assert!(places.start.is_multiple_of(AREA) && places.end.is_multiple_of(AREA));
        if self.backwards {
            places.rev().try_for_each(|at| self.step(at, 0xFF))
        } else {
            places.into_iter().try_for_each(|at| self.step(at, 0xFF))
        }
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Dead> {
        let from = offset as usize;
        assert!(from.is_multiple_of(W) && bytes.len().is_multiple_of(W));
        for (at, byte) in (from..).zip(bytes) {
            assert_eq!(self.bytes[at], 0xFF, "only what is erased is written");
            self.step(at, *byte)?;
        }
        Ok(())
    }
}

fn loaded<F: ReadNorFlash>(flash: &mut F) -> Option<(u32, std::vec::Vec<u8>)> {
    let mut bytes = Bytes::new();
    load(flash, &mut bytes).map(|stamp| (stamp.sequence, bytes.to_vec()))
}

fn filled(len: usize, seed: u8) -> std::vec::Vec<u8> {
    (0..len).map(|i| (i as u8).wrapping_mul(31) ^ seed).collect()
}

/// Power is lost at every byte of a push, in erases too, and drawn bits of the byte under way are torn: what counts
/// afterwards is the old description or the new one, and the next push succeeds.
fn every_loss_of_power<const W: usize>(before: usize, backwards: bool) {
    let mut flash = Dying::<W>::new(0x5A);
    flash.backwards = backwards;
    for push in 0..before {
        save(&mut flash, &filled(300 + push, push as u8)).unwrap();
    }
    let old = loaded(&mut flash);
    let new = filled(317, 99);
    let mut whole = flash.clone();
    whole.worked = 0;
    let stamp = save(&mut whole, &new).unwrap();
    assert!(whole.worked > AREA + 317);
    let (mut olds, mut news) = (0, 0);
    for left in 0..=whole.worked {
        for draw in 0..3 {
            let mut flash = Dying::<W> { left: Some(left), drawn: (left * 3 + draw) as u64, ..flash.clone() };
            let outcome = save(&mut flash, &new);
            flash.revive();
            let found = loaded(&mut flash);
            if found == old {
                olds += 1;
                assert!(outcome.is_err(), "at {left}");
            } else {
                news += 1;
                assert_eq!(found, Some((stamp.sequence, new.clone())), "at {left}");
            }
            let next = filled(400, 7);
            let sequence = save(&mut flash, &next).unwrap().sequence;
            assert_eq!(loaded(&mut flash), Some((sequence, next)), "the push after that at {left}");
        }
    }
    assert!(olds > 3 * AREA && news >= 3, "{olds} {news}");
}

#[test]
fn power_lost_at_any_byte_leaves_the_old_or_the_new_one() {
    for before in 0..4 {
        for backwards in [false, true] {
            every_loss_of_power::<1>(before, backwards);
            every_loss_of_power::<4>(before, backwards);
            every_loss_of_power::<8>(before, backwards);
        }
    }
}

/// Losses of power one after the other, as a supply that flickers.
#[test]
fn power_lost_again_and_again_leaves_one_that_was_pushed() {
    let mut flash = Dying::<4>::new(0xFF);
    let mut good = filled(200, 0);
    save(&mut flash, &good).unwrap();
    for push in 1..2000_usize {
        let new = filled(200 + push % 50, push as u8);
        flash.left = Some(push * 7919 % 1400);
        let outcome = save(&mut flash, &new);
        flash.revive();
        let found = loaded(&mut flash).unwrap().1;
        assert!(found == good || found == new, "push {push}");
        assert!(outcome.is_err() || found == new, "push {push} was said to be stored");
        good = found;
    }
}

#[test]
fn an_empty_flash_holds_nothing_and_the_longest_fits() {
    for fill in [0x00, 0xFF, 0x5A] {
        let mut flash = Dying::<8>::new(fill);
        assert_eq!(loaded(&mut flash), None);
        let longest = filled(MAX_DESCRIPTION_BYTES, 3);
        assert_eq!(save(&mut flash, &longest).unwrap().sequence, 1);
        assert_eq!(loaded(&mut flash), Some((1, longest)));
        assert_eq!(save(&mut flash, &[0; MAX_DESCRIPTION_BYTES + 1]), Err(StoreError::Unsuited));
    }
}

#[test]
fn what_is_there_already_is_not_written_again() {
    let mut flash = Dying::<4>::new(0xFF);
    let stamp = save(&mut flash, &filled(300, 1)).unwrap();
    let worked = flash.worked;
    assert_eq!(save(&mut flash, &filled(300, 1)), Ok(stamp));
    assert_eq!(flash.worked, worked);
}

/// A flash that cannot be read is not taken for an empty one: nothing is erased.
#[test]
fn a_flash_that_cannot_be_read_is_left_alone() {
    let mut flash = Dying::<4>::new(0xFF);
    save(&mut flash, &filled(300, 1)).unwrap();
    let (old, worked) = (loaded(&mut flash), flash.worked);
    flash.dead = true;
    assert_eq!(save(&mut flash, &filled(300, 2)), Err(StoreError::Flash));
    flash.revive();
    assert_eq!((loaded(&mut flash), flash.worked), (old, worked));
}

#[test]
fn numbers_may_wrap() {
    let mut flash = RamFlash([0xFF; 2 * AREA_BYTES]);
    let bytes = filled(100, 1);
    let last = Stamp::new(u32::MAX, &bytes);
    write(&mut flash, HEADER, &bytes).unwrap();
    write(&mut flash, 0, &header(last, 100)).unwrap();
    assert_eq!(loaded(&mut flash), Some((u32::MAX, bytes)));
    assert_eq!(save(&mut flash, &filled(100, 2)).unwrap().sequence, 0);
    assert_eq!(loaded(&mut flash), Some((0, filled(100, 2))));
}

#[test]
fn a_flash_that_is_too_small_or_takes_too_long_pieces_is_refused() {
    assert_eq!(save(&mut RamFlash([0xFF; 1000]), &[1]), Err(StoreError::Unsuited));
    assert_eq!(save(&mut Dying::<16>::new(0xFF), &[1]), Err(StoreError::Unsuited));
}

/// A cell that does not take its bits: read back, the copy does not count, and the old one is kept.
#[test]
fn a_worn_cell_is_found_when_the_copy_is_read_back() {
    struct Worn(RamFlash<[u8; 2 * AREA_BYTES]>);
    impl ErrorType for Worn {
        type Error = OutOfBounds;
    }
    impl ReadNorFlash for Worn {
        const READ_SIZE: usize = 1;
        fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), OutOfBounds> {
            self.0.read(offset, bytes)
        }
        fn capacity(&self) -> usize {
            self.0.capacity()
        }
    }
    impl NorFlash for Worn {
        const WRITE_SIZE: usize = 1;
        const ERASE_SIZE: usize = AREA_BYTES;
        fn erase(&mut self, from: u32, to: u32) -> Result<(), OutOfBounds> {
            self.0.erase(from, to)
        }
        fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), OutOfBounds> {
            self.0.write(offset, bytes)?;
            self.0.0[AREA_BYTES + HEADER + 50] = 0xFF;
            Ok(())
        }
    }
    let mut flash = Worn(RamFlash([0xFF; 2 * AREA_BYTES]));
    let first = save(&mut flash, &[1; 100]).unwrap();
    assert_eq!(save(&mut flash, &[2; 100]), Err(StoreError::ReadBack));
    assert_eq!(stamp(&mut flash), Some(first));
}

proptest! {
    /// Whatever is in the flash, reading it never panics and never gives what does not agree with its checksum.
    #[test]
    fn any_content_is_survived(bytes in prop::collection::vec(any::<u8>(), 2 * AREA_BYTES), len: u32) {
        let mut flash = RamFlash(bytes);
        prop_assert_eq!(loaded(&mut flash), None);
        flash.0[..HEADER].copy_from_slice(&header(Stamp::new(1, &[]), len as usize));
        if let Some((_, found)) = loaded(&mut flash) {
            prop_assert!(found.is_empty());
        }
    }
}
