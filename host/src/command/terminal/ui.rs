//! What the user sees while a verb runs: text, progress and log on stderr; stdout carries results only.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use console::Style;
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use tracing_subscriber::filter::LevelFilter;

use crate::failure::Failure;
use crate::link::printable;
use crate::recording::{LogLevel, LogLine};

/// Options that every verb takes.
#[derive(Debug, clap::Args)]
pub(in crate::command) struct Args {
    /// Log more: -v what the program does, -vv its details
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    /// Say nothing but warnings and errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
}

/// The verb's way to speak. Progress is drawn only on a terminal; text and log lines go around it.
#[derive(Debug)]
pub struct Ui {
    bars: MultiProgress,
    quiet: bool,
}

impl Ui {
    /// Sets up log, error printing and progress for this process. To be called once.
    pub(in crate::command) fn new(args: &Args) -> Self {
        let terminal = io::stderr().is_terminal();
        let target = if terminal && !args.quiet { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bars = MultiProgress::with_draw_target(target);
        let level = match args.verbose {
            0 => LevelFilter::WARN,
            1 => LevelFilter::INFO,
            2 => LevelFilter::DEBUG,
            _ => LevelFilter::TRACE,
        };
        let around = bars.clone();
        // An earlier subscriber or hook (a test's) may stay: neither is worth failing for.
        let _ = tracing_subscriber::fmt()
            .with_max_level(level)
            .with_ansi(terminal)
            .with_target(false)
            .with_writer(move || AroundBars(around.clone()))
            .try_init();
        let _ = miette::set_hook(Box::new(move |_| {
            // A pipe gets each message in one line, whatever its length: programs search in it.
            Box::new(miette::MietteHandlerOpts::new().terminal_links(false).wrap_lines(terminal).build())
        }));
        Self { bars, quiet: args.quiet }
    }

    /// One line for the human reader, to stderr. Silent under `--quiet`.
    pub fn say(&self, line: impl std::fmt::Display) {
        if !self.quiet {
            self.line(format_args!("{line}"));
        }
    }

    /// What the user should know although the work goes on, and what to do about it. Said under `--quiet` as well.
    pub fn warn(&self, what: impl std::fmt::Display, advice: &str) {
        let word = Style::new().for_stderr().yellow().apply_to("warning:");
        self.line(format_args!("{word} {what}\n    {advice}"));
    }

    /// A line that the firmware logged: device time, level, message, place. Under `--quiet` only warnings and errors.
    pub fn firmware(&self, line: &LogLine) {
        if self.quiet && line.level < LogLevel::Warn {
            return;
        }
        let style = Style::new().for_stderr();
        let colour = match line.level {
            LogLevel::Error => style.clone().red(),
            LogLevel::Warn => style.clone().yellow(),
            LogLevel::Info => style.clone().green(),
            LogLevel::Debug | LogLevel::Trace => style.clone().dim(),
        };
        let level = colour.apply_to(format!("{:<5}", line.level.name().to_uppercase()));
        let place = line.place.as_ref().map(|place| format!("  {}", style.dim().apply_to(place)));
        let t_s = line.t_us as f64 * 1e-6;
        // What a device sends is printed, never obeyed by the terminal.
        let message = printable(&line.message);
        self.line(format_args!("{t_s:>12.6} {level} {message}{}", place.unwrap_or_default()));
    }

    fn line(&self, line: std::fmt::Arguments<'_>) {
        // A closed stderr leaves nobody to tell.
        let _ = self.bars.suspend(|| writeln!(io::stderr(), "{line}"));
    }

    /// Text to stdout. A reader that went away (`| head`) is no failure.
    pub fn print(&self, text: &str) -> Result<(), Failure> {
        let mut stdout = io::stdout().lock();
        match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
            Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Failure::device(error)),
            _ => Ok(()),
        }
    }

    /// A bar that counts to `total`; `what` says what is being done ("reading").
    pub fn progress(&self, what: &str, total: u64) -> Progress {
        let style = ProgressStyle::with_template("{prefix:>12} {bar:30} {percent:>3} % {msg} ({eta} left)")
            .expect("the template is a constant that a test draws");
        let bar = self.bars.add(ProgressBar::new(total).with_style(style));
        bar.set_prefix(what.to_owned());
        Progress(bar)
    }

    /// A sign of life for work of unknown length.
    pub fn busy(&self, what: &str) -> Progress {
        let style = ProgressStyle::with_template("{prefix:>12} {spinner} {msg} ({elapsed})")
            .expect("the template is a constant that a test draws");
        let bar = self.bars.add(ProgressBar::new_spinner().with_style(style));
        bar.set_prefix(what.to_owned());
        bar.enable_steady_tick(Duration::from_millis(120));
        Progress(bar)
    }

    /// Prints a failure with its causes and advice.
    pub(in crate::command) fn failure(&self, failure: Failure) {
        let report = miette::Report::new(failure);
        let _ = self.bars.suspend(|| writeln!(io::stderr(), "{report:?}"));
    }
}

/// A progress line on the terminal; it vanishes when dropped. Cheap to call from an inner loop.
#[derive(Debug)]
pub struct Progress(ProgressBar);

impl Progress {
    /// Moves to an absolute position.
    pub fn at(&self, position: u64) {
        self.0.set_position(position);
    }

    /// Text behind the bar ("cost 1.5e5", "3 lost").
    pub fn note(&self, text: impl Into<String>) {
        self.0.set_message(text.into());
    }

    /// Another name in front of the bar ("fast stage").
    pub fn stage(&self, what: &str) {
        self.0.set_prefix(what.to_owned());
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// Log lines that do not tear the progress lines apart.
struct AroundBars(MultiProgress);

impl Write for AroundBars {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.suspend(|| io::stderr().write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_progress_lines_draw() {
        let ui = Ui { bars: MultiProgress::with_draw_target(ProgressDrawTarget::hidden()), quiet: false };
        let bar = ui.progress("reading", 10);
        bar.at(5);
        bar.note("half");
        ui.busy("thinking").stage("still thinking");
    }
}
