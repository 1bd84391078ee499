//! Gives the linker of the images among the examples their scripts. Nothing to do on a PC.

use std::path::PathBuf;
use std::{env, fs};

/// Top of the first bank of SRAM of an STM32F405. The examples are no part of the firmware, whose share of it memory.x tells: their stack lies above it.
const STACK_START: u32 = 0x2001_C000;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=../../memory.x");
    println!("cargo::rerun-if-env-changed=OBSERVER_NUMBERS");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo gives a build script OUT_DIR"));
    fs::copy("../../memory.x", out.join("memory.x")).expect("memory.x lies at the top of the workspace");
    println!("cargo::rustc-link-search={}", out.display());
    println!("cargo::rustc-link-arg-examples=-Tlink.x");
    println!("cargo::rustc-link-arg-examples=--nmagic");
    println!("cargo::rustc-link-arg-examples=--defsym=_stack_start={STACK_START:#x}");
}
