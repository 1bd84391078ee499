//! Gives the linker of the image its scripts. Nothing to do on a PC.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=../memory.x");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo gives a build script OUT_DIR"));
    fs::copy("../memory.x", out.join("memory.x")).expect("memory.x lies at the top of the workspace");
    println!("cargo::rustc-link-search={}", out.display());
    for script in ["link.x", "defmt.x"] {
        println!("cargo::rustc-link-arg-bins=-T{script}");
    }
    // Code must not share a page of the file with data: segments then say what the image takes.
    println!("cargo::rustc-link-arg-bins=--nmagic");
}
