//! `host watch`: what a device shows at the moment.

use std::fmt::Write as _;
use std::io::{self, IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, channel, sync_channel};
use std::time::{Duration, Instant};

use super::connection::{Connection, link_failure};
use super::record::losses;
use crate::command::{Exit, Failure, Ui, interrupt};
use crate::failure::simulate_failure;
use crate::link::{Device, printable};
use crate::watch::{Picture, Watch};

/// How long one look at the device waits for a sample.
const LOOK: Duration = Duration::from_millis(20);
/// How long a screen that stands still is waited for at the end.
const LAST_WORDS: Duration = Duration::from_secs(1);

/// Show live what a robot's sensors read
///
/// Counts, angles, gyro words and rates, flags, the stop input, jitter, execution time and losses. On a terminal the view
/// is drawn in place, into a pipe go lines. Nothing is driven, a motion that runs is stopped, a fault stays as it is. It
/// ends with Ctrl-C.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    connection: Connection,
    /// End by itself after so long, s
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    duration: Option<Duration>,
    /// Time from one view to the next, s [default: 0.1 on a terminal, 0.5 in a pipe]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    every: Option<Duration>,
    /// Print each view as a line of JSON
    #[arg(long)]
    json: bool,
}

fn seconds(text: &str) -> Result<Duration, &'static str> {
    let wrong = "a number of seconds from 0.001 to 1000000";
    let seconds: f64 = text.parse().map_err(|_| wrong)?;
    if (0.001..=1e6).contains(&seconds) { Ok(Duration::from_secs_f64(seconds)) } else { Err(wrong) }
}

/// Connects and shows until the end.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let over = Arc::new(AtomicBool::new(false));
    let heard = Arc::clone(&over);
    interrupt::instead(move || heard.store(true, Relaxed));
    let simulated = args.connection.simulated(false)?;
    let connecting = ui.busy("connecting");
    let mut device = args.connection.open(simulated.as_ref())?;
    let status = device.halt().map_err(link_failure)?;
    device.stream().map_err(link_failure)?;
    drop(connecting);
    let identity = &device.hello().identity;
    ui.say(format_args!(
        "{}: {}, firmware {}; Ctrl-C ends it",
        args.connection.port,
        printable(&identity.robot),
        printable(&identity.firmware_version)
    ));

    let in_place = io::stdout().is_terminal() && !args.json;
    let every = args.every.unwrap_or(Duration::from_millis(if in_place { 100 } else { 500 }));
    let (pictures, screen) = Screen { in_place, json: args.json }.start()?;
    let ended = look(&device, &mut Watch::new(device.hello(), &status), &pictures, every, args.duration, &over);
    drop(pictures);
    // A screen that stands still (a full pipe, Ctrl-S) is left standing.
    let drawn = match screen.recv_timeout(LAST_WORDS) {
        Ok(drawn) => drawn,
        Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => Ok(()),
    };
    ended.map_err(link_failure)?;
    device.end_stream().map_err(link_failure)?;
    while device.next(Duration::ZERO).map_err(link_failure)?.is_some() {}
    ui.say(format_args!("{} samples, {}", device.balance().received, losses(&device.balance())));
    drop(device);
    if let Some((simulator, ..)) = simulated {
        simulator.finish().map_err(simulate_failure)?;
    }
    drawn?;
    Ok(Exit::Ok)
}

/// Takes everything that the device sends and offers a picture now and then. It waits for nothing but the device: while
/// the screen is busy, pictures are left out.
fn look(
    device: &Device,
    watch: &mut Watch,
    pictures: &SyncSender<Picture>,
    every: Duration,
    duration: Option<Duration>,
    over: &AtomicBool,
) -> Result<(), crate::link::LinkError> {
    let begun = Instant::now();
    let mut due = begun + every;
    while !over.load(Relaxed) && duration.is_none_or(|duration| begun.elapsed() < duration) {
        if let Some(arrival) = device.next(LOOK)? {
            watch.take(&arrival);
        }
        if Instant::now() >= due
            && let Some(picture) = watch.picture(device.balance())
        {
            due = Instant::now() + every;
            let _ = pictures.try_send(picture);
        }
    }
    Ok(())
}

/// How the drawing went.
type Drawn = Result<(), Failure>;

/// Where pictures go.
struct Screen {
    in_place: bool,
    json: bool,
}

impl Screen {
    /// A thread that draws what it is given until nothing more comes, and then tells how that went.
    fn start(self) -> Result<(SyncSender<Picture>, Receiver<Drawn>), Failure> {
        let (pictures, given) = sync_channel::<Picture>(1);
        let (done, ended) = channel();
        let draw = move || {
            let mut lines = 0;
            let outcome = given.iter().try_for_each(|picture| self.draw(&picture, &mut lines));
            // A reader that went away (`| head`) is no failure.
            let outcome = match outcome {
                Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Failure::device(error)),
                _ => Ok(()),
            };
            // Nobody listens any more if it took too long.
            let _ = done.send(outcome);
        };
        std::thread::Builder::new().name("screen".to_owned()).spawn(draw).map_err(Failure::device)?;
        Ok((pictures, ended))
    }

    /// Draws one picture; `lines` is how many the last one took.
    fn draw(&self, picture: &Picture, lines: &mut usize) -> io::Result<()> {
        let mut stdout = io::stdout().lock();
        if self.json {
            let line = serde_json::to_string(picture).map_err(io::Error::other)?;
            return writeln!(stdout, "{line}").and_then(|()| stdout.flush());
        }
        if !self.in_place {
            return writeln!(stdout, "{}", line(picture)).and_then(|()| stdout.flush());
        }
        let text = view(picture);
        // Up to where the last picture began, and each line anew.
        let up = if *lines > 0 { format!("\x1b[{lines}A") } else { String::new() };
        *lines = text.lines().count();
        let drawn: String = text.lines().fold(up, |drawn, line| drawn + "\x1b[2K" + line + "\n");
        stdout.write_all(drawn.as_bytes()).and_then(|()| stdout.flush())
    }
}

/// One picture in a line.
fn line(picture: &Picture) -> String {
    let mut text = format!("{:.3} s  {}", picture.t_s, picture.state);
    // Writing to a string cannot fail.
    for encoder in &picture.encoders {
        let _ = write!(text, "  {}{}: {} {:+.4} rad", encoder.side, encoder.joint, encoder.counts, encoder.angle_rad);
    }
    for (index, gyro) in picture.gyros.iter().enumerate() {
        let [x, y, z] = gyro.rate_rad_s;
        let _ = write!(text, "  gyro{}: {x:+.4} {y:+.4} {z:+.4} rad/s", index + 1);
    }
    let stop = if picture.stop_pressed { "PRESSED" } else { "released" };
    let Picture { rate_hz, jitter_max_us, execution_max_us, balance, .. } = picture;
    let _ = write!(
        text,
        "  stop {stop}  {rate_hz:.0} Hz, jitter {jitter_max_us} us, execution {execution_max_us} us, {} lost",
        balance.missing
    );
    text
}

/// One picture as a view of several lines.
fn view(picture: &Picture) -> String {
    let mut text = String::new();
    let stop = if picture.stop_pressed { "PRESSED" } else { "released" };
    let _ = writeln!(text, "{:>12.3} s   {}   stop input: {stop}", picture.t_s, picture.state);
    let from = if picture.zeroed { "from zero" } else { "since the start" };
    let _ = writeln!(text, "  encoder         counts   rad {from:<16}  rad/s      duty");
    for encoder in &picture.encoders {
        let duty = picture.duty.get(usize::from(encoder.joint - 1)).copied().unwrap_or(0.0);
        let _ = writeln!(
            text,
            "  {} {:<7} {:>12}   {:>+12.5}      {:>+12.4}   {:>+7.4}",
            encoder.joint, encoder.side, encoder.counts, encoder.angle_rad, encoder.speed_rad_s, duty
        );
    }
    let _ = writeln!(text, "  gyro      words x, y, z              rad/s");
    for (index, gyro) in picture.gyros.iter().enumerate() {
        let ([a, b, c], [x, y, z]) = (gyro.words, gyro.rate_rad_s);
        let _ = writeln!(text, "  {} (on {}) {a:>7}{b:>7}{c:>7}   {x:>+9.4}{y:>+9.4}{z:>+9.4}", index + 1, gyro.body);
    }
    let Picture { rate_hz, jitter_max_us, execution_mean_us, execution_max_us, .. } = picture;
    let _ = writeln!(
        text,
        "  {rate_hz:.0} Hz   jitter at most {jitter_max_us} us   execution {execution_mean_us:.0} us, at most {execution_max_us} us"
    );
    let _ = writeln!(text, "  {} samples, {}", picture.balance.received, losses(&picture.balance));
    let flags = if picture.flags.is_empty() { "none".to_owned() } else { picture.flags.join(", ") };
    let _ = writeln!(text, "  flags: {flags}");
    text
}
