//! Stories of commands as users meet them: files, refusals, exit codes, the documents' worked examples.

mod command_line;
mod observe;
mod plan;
#[path = "../program/mod.rs"]
mod program;
mod recordings;
mod verify;

/// The commands of a block of a document, counted from 0, without the program's name.
fn commands_of(document: &str, block: usize) -> Vec<Vec<String>> {
    let block = document.split("```sh\n").nth(block + 1).and_then(|rest| rest.split("```").next()).unwrap();
    block.lines().map(|line| line.split_whitespace().skip(1).map(str::to_owned).collect()).collect()
}
