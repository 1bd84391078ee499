//! How far belts read off on a robot whose base gives way, against the stiffness of its bearing: the map, as a table and as a page.
//!
//! ```sh
//! cargo run --release -p tests --bin riddle                    # the table of host/doc/bearing.md; the page is riddle.html
//! ```

use std::process::ExitCode;

use host::calibrate::Preset;
use host::report::{Colour, Page, Scatter, Section};
use tests::riddle::{Belts, OnBearing, STIFFNESS};

const PAGE: &str = "riddle.html";

fn main() -> ExitCode {
    println!("| bearing, N m/rad | `default`: k_s 1, 2, 3 | `paper`: k_s 1, 2, 3 |\n|---|---|---|");
    let mut map: Vec<(f64, [Belts; 2])> = Vec::new();
    for stiffness in STIFFNESS {
        let robot = OnBearing::new(stiffness);
        let belts = [Preset::Default, Preset::Paper].map(|preset| robot.belts_of_a_rigid_base(preset));
        let [default, paper] = belts.map(|belts| belts.map(|share| format!("{:+.1}", 100.0 * share)).join(", "));
        println!("| {stiffness} | {default} % | {paper} % |");
        map.push((stiffness, belts));
    }
    match std::fs::write(PAGE, page(&map).to_html()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{PAGE}: {error}");
            ExitCode::from(3)
        }
    }
}

fn page(map: &[(f64, [Belts; 2])]) -> Page {
    let mut page = Page::new("The riddle of the bearing")
        .lead("How far belts read off when the base gives way and the model does not know it.");
    for (preset, name) in ["default", "paper"].into_iter().enumerate() {
        let mut scatter = Scatter::new("log10 of the bearing's stiffness (N m/rad)", "k_s, off by (%)");
        for joint in 0..3 {
            let points = map.iter().map(|(stiffness, belts)| (stiffness.log10(), 100.0 * belts[preset][joint]));
            let name = format!("joint {}", joint + 1);
            scatter = scatter.curve(name, Colour::Axis(joint), points);
        }
        let mut section = Section::new(format!("Preset {name}"));
        section.scatter("Belts against bearing", &scatter);
        page.push(section);
    }
    page
}
