//! What a page promises: it is HTML, it says what it was told, it loads nothing, it stays small.

use html5gum::{DefaultEmitter, Token, Tokenizer};

use super::diagnosis::fixture;
use super::*;
use crate::diagnose::{Unexplained, Verdict};

const NASTY: &str = "</script><img src=x onerror=alert(1)> & \"q\" 'a' <!-- \u{0} 学";

fn text_of(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Every kind of block with text that tries to break out, over `n` samples.
fn full_page(n: usize) -> Page {
    let t: Vec<f64> = (0..n).map(|k| k as f64 * 1e-3).collect();
    let waves: Vec<Vec<f64>> = (0..6)
        .map(|s| {
            let wave = t.iter().enumerate().map(|(k, t)| {
                let noise = ((k * 7919 + s * 104_729) % 1009) as f64 / 1009.0 - 0.5;
                (t * (1.0 + 0.3 * s as f64)).sin() + 0.05 * noise
            });
            wave.collect()
        })
        .collect();
    let mut page = Page::new(NASTY).lead(NASTY).fact(NASTY, NASTY);
    for number in 0..6 {
        let mut section = Section::new(format!("{number} {NASTY}"));
        let mut plot = LinePlot::new(&t, "time (s)", format!("angle (rad) {NASTY}"))
            .zoom(53.0..54.0)
            .band(3.0..30.0, NASTY)
            .group("all")
            .caption(NASTY);
        for axis in 0..3 {
            plot = plot.series(Series::measured(NASTY, Colour::Axis(axis), &waves[axis])).series(Series::line(
                NASTY,
                Colour::Axis(axis),
                &waves[axis + 3],
            ));
        }
        section.plot(NASTY, plot);
        page.push(section);
    }
    let mut rest = Section::new("rest");
    rest.prose(NASTY);
    rest.heading(NASTY);
    rest.note(Tone::Warning, NASTY);
    rest.list([NASTY]);
    rest.figures([(NASTY, NASTY, Tone::Good)]);
    let mut table = Table::new().words(NASTY).numbers(NASTY, NASTY).caption(NASTY);
    table.row([NASTY.into(), Cell::toned(NASTY, Tone::Bad)]);
    rest.table(&table);
    rest.bars(NASTY, &BarChart::new(NASTY).bar(Bar::new(NASTY, 3.0)).threshold(1.0, NASTY).caption(NASTY));
    rest.scatter(NASTY, &Scatter::new(NASTY, NASTY).cloud(NASTY, Colour::Neutral, [(1.0, 2.0)]).caption(NASTY));
    page.push(rest);
    page
}

/// What a browser makes of a page: its text, and the JSON of its plots. Panics where a page is no HTML, or loads or runs what it should not.
fn parsed(html: &str) -> (String, Vec<String>) {
    let mut open: Vec<String> = Vec::new();
    let mut texts = String::new();
    let mut json = Vec::new();
    // Inside `script` and `style` text is no markup.
    let mut emitter: DefaultEmitter = DefaultEmitter::default();
    emitter.naively_switch_states(true);
    for Ok(token) in Tokenizer::new_with_emitter(html, emitter) {
        match token {
            Token::StartTag(tag) => {
                let name = text_of(&tag.name);
                assert_ne!(name, "img");
                for (key, value) in &tag.attributes {
                    let (key, value) = (text_of(key), text_of(value));
                    assert!(!key.starts_with("on"), "handler {key}={value}");
                    assert!(
                        !matches!(key.as_str(), "src" | "srcset" | "action" | "data")
                            && (key != "href" || value.starts_with('#')),
                        "{name} loads {value}"
                    );
                }
                if name != "meta" {
                    open.push(name);
                }
            }
            Token::EndTag(tag) => {
                assert_eq!(open.pop(), Some(text_of(&tag.name)), "wrong nesting");
            }
            Token::String(text) => {
                let text = text_of(&text);
                match open.last().map(String::as_str) {
                    Some("script") => json.extend(text.starts_with('{').then_some(text)),
                    Some("style") => {}
                    _ => {
                        texts.push_str(&text);
                        texts.push('\n');
                    }
                }
            }
            Token::Comment(comment) => panic!("comment {}", text_of(&comment)),
            Token::Doctype(_) => {}
            Token::Error(error) => panic!("{error:?}"),
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
    (texts, json)
}

#[test]
fn a_page_is_html_whatever_the_text_says() {
    let (texts, json) = parsed(&full_page(5000).to_html());
    let shown = NASTY.replace('\0', "\u{fffd}");
    assert!(texts.matches(&shown).count() > 30, "{}", texts.matches(&shown).count());
    assert_eq!(json.len(), 6);
    for plot in json {
        let plot: serde_json::Value = serde_json::from_str(&plot).unwrap();
        assert_eq!(plot["series"][0]["label"], NASTY);
    }
}

#[test]
fn a_diagnosis_says_first_whether_the_model_fits_then_causes_by_what_they_bring() {
    let diagnosed = fixture::diagnosis(0.7, NASTY);
    let (texts, json) = parsed(&diagnosis::page(&diagnosed).to_html());
    let shown = |text: &str| text.replace('\0', "\u{fffd}");
    let place = |text: &str| texts.find(&shown(text)).unwrap_or_else(|| panic!("{text} is not on the page"));
    let order = [
        "Diagnosis of doggy",
        &diagnosed.base_fit.sentence,
        "The model lacks something.",
        "Does the base model fit?",
        "1. Torque ripple of the motors (pitch)",
        "2. Friction that differs by direction (pitch)",
        "Rejected",
        "An encoder that reads at another time than the other sensors (yaw): predicts worse",
        "Over time, 500 ms ahead",
        "encoder2 (pitch): predicted less measured",
        "What the base model misses, as curves",
        "What is left over",
        "Link equation of pitch, as a function of the windup rate: 70 %",
        "All candidates",
        "Delay of the gyros' filters: </script>",
    ];
    let places: Vec<usize> =
        order.iter().map(|text| texts.rfind(&shown(text)).unwrap_or_else(|| place(text))).collect();
    assert!(places.is_sorted(), "{places:?}");
    for flag in fixture::FLAGS {
        assert!(texts.to_lowercase().contains(flag.words()), "{}", flag.words());
    }
    place("It acts like");
    place("28 % [21, 35]");
    // The whole motion, its errors, three worst moments, one curve.
    assert_eq!(json.len(), 6);
    assert!(
        json.iter().any(|plot| plot.contains("error (mrad)"))
            && json.iter().any(|plot| plot.contains("force") || plot.contains("torque (N m)"))
    );
    place("RMS error");
}

#[test]
fn numbers_that_are_none_render_as_nothing() {
    for number in [f64::NAN, f64::INFINITY, 0.0, -0.4] {
        let mut diagnosed = fixture::diagnosis(number, "x");
        let (texts, json) = parsed(&diagnosis::page(&diagnosed).to_html());
        assert!(!texts.contains("NaN") && !texts.contains("inf "), "{number}");
        for plot in json {
            serde_json::from_str::<serde_json::Value>(&plot).unwrap();
        }
        for finding in &mut diagnosed.findings {
            (finding.holdout_gain, finding.stability, finding.acts_like, finding.cv_gain.ci95) =
                (None, None, None, None);
        }
        if let Some(all) = &mut diagnosed.holdout_gain {
            all.ci95 = None;
            all.over_time[0].extended.truncate(3);
        }
        diagnosed.curves[0].at.truncate(3);
        diagnosed.base.robot_toml.clear();
        let (texts, json) = parsed(&diagnosis::page(&diagnosed).to_html());
        assert!(json.is_empty() && texts.contains("(joint 2)"), "{number}");
    }
}

#[test]
fn a_diagnosis_without_findings_is_a_page() {
    let mut diagnosed = fixture::diagnosis(1.0, "at all");
    diagnosed.findings.clear();
    diagnosed.rejected.clear();
    (diagnosed.holdout_gain, diagnosed.holdout) = (None, None);
    diagnosed.base_fit.fits = true;
    diagnosed.unexplained = Unexplained::default();
    (diagnosed.scan, diagnosed.curves, diagnosed.not_testable) = Default::default();
    for verdict in [Verdict::None, Verdict::Unknown] {
        diagnosed.verdict = verdict;
        let (texts, json) = parsed(&diagnosis::page(&diagnosed).to_html());
        assert!(texts.contains("Nothing was added to the model") && json.is_empty());
        assert!(texts.contains("the last third, which no fit has seen"));
        assert!(texts.contains("Nothing that looked like a cause was rejected."));
    }
}

#[test]
fn a_page_loads_nothing() {
    let html = full_page(5000).to_html();
    // Addresses that stay: the policy's `http-equiv`, uPlot's own first line.
    let addresses = html.matches("http").count();
    assert_eq!(addresses, 2, "an address crept in");
    assert!(html.contains("http-equiv=\"Content-Security-Policy\" content=\"default-src &#39;none&#39;"));
    for way in ["url(", "@import", "fetch(", "XMLHttpRequest", "WebSocket", "import(", "<link"] {
        assert!(!html.contains(way), "the page uses {way}");
    }
    assert!(html.contains("Copyright (c) 2022 Leon Sorokin"), "uPlot's licence is missing");
}

#[test]
fn six_plots_of_a_hundred_thousand_samples_stay_small() {
    let size = full_page(100_000).to_html().len();
    // Measured 0.51 MB: 6 plots × 4000 points × (4 + 6·2) B × 4/3, and 51 kB of uPlot.
    assert!((400_000..650_000).contains(&size), "{size} bytes");
    if let Ok(path) = std::env::var("REPORT_SAMPLE") {
        std::fs::write(path, full_page(100_000).to_html()).unwrap();
    }
}
