//! A program that logs, as far as a host sees of it: an ELF file with texts, and the frames that name them.

use object::write::{Object, StandardSection, Symbol, SymbolSection};
use object::{Architecture, BinaryFormat, Endianness, SectionKind, SymbolFlags, SymbolKind, SymbolScope};

/// Texts by their index, with the tags that the logging macros give them.
pub const TEXTS: [(&str, &str); 4] = [
    ("defmt_timestamp", "{=u32:us}"),
    ("defmt_info", "started: {=str}, {=u16} parts"),
    ("defmt_warn", "gyro {=u8} answers late"),
    ("defmt_error", "tick {=u32} took {=u32:us} s"),
];

/// An ELF file with this code and [`TEXTS`], and the encoding that it names.
pub fn elf_with(code: &[u8], texts: &[(&str, &str)], encoding: &str) -> Vec<u8> {
    let mut elf = Object::new(BinaryFormat::Elf, Architecture::Arm, Endianness::Little);
    let text = elf.section_id(StandardSection::Text);
    elf.append_section_data(text, code, 4);
    let symbol = |elf: &mut Object<'_>, name: String, value: usize, section| {
        elf.add_symbol(Symbol {
            name: name.into_bytes(),
            value: value as u64,
            size: 1,
            kind: SymbolKind::Data,
            scope: SymbolScope::Linkage,
            weak: false,
            section,
            flags: SymbolFlags::None,
        });
    };
    symbol(&mut elf, "_defmt_version_ = 4".to_owned(), 0, SymbolSection::Absolute);
    symbol(&mut elf, format!("_defmt_encoding_ = {encoding}"), 0, SymbolSection::Absolute);
    if !texts.is_empty() {
        let section = elf.add_section(Vec::new(), b".defmt".to_vec(), SectionKind::Metadata);
        elf.append_section_data(section, &vec![0; texts.len()], 1);
        for (index, (tag, text)) in texts.iter().enumerate() {
            let name = format!(r#"{{"package":"p","tag":"{tag}","data":"{text}","disambiguator":"{index}"}}"#);
            symbol(&mut elf, name, index, SymbolSection::Section(section));
        }
    }
    elf.write().unwrap()
}

/// The ELF file of a program with this code.
pub fn elf(code: &[u8]) -> Vec<u8> {
    elf_with(code, &TEXTS, "rzcobs")
}

/// A frame with its delimiter: index of the text, device time, arguments.
pub fn frame(index: u16, t_us: u32, arguments: &[u8]) -> Vec<u8> {
    let plain = [&index.to_le_bytes()[..], &t_us.to_le_bytes(), arguments].concat();
    let mut frame = rzcobs::encode(&plain);
    frame.push(0);
    frame
}

/// "started: …" of [`TEXTS`].
pub fn started(t_us: u32, name: &str, parts: u16) -> Vec<u8> {
    frame(1, t_us, &[&(name.len() as u32).to_le_bytes()[..], name.as_bytes(), &parts.to_le_bytes()].concat())
}

/// "gyro … answers late" of [`TEXTS`].
pub fn late(t_us: u32, gyro: u8) -> Vec<u8> {
    frame(2, t_us, &[gyro])
}
