//! What the two sides tell one another, overheard: whether a motion runs.

use protocol::frame::Decoder;
use protocol::message::{MAX_TO_DEVICE_FRAME, MAX_TO_HOST_FRAME, read_to_device, read_to_host};
use protocol::{Command, EventKind, Layout, Report, State, ToDevice, ToHost};

/// Listens to both directions.
pub(super) struct LineMonitor {
    layout: Layout,
    from_host: Decoder<MAX_TO_DEVICE_FRAME>,
    from_device: Decoder<MAX_TO_HOST_FRAME>,
    /// Id of the request for a start that is not answered yet.
    asked: Option<u8>,
    pub state: State,
    /// First tick of the last motion that began.
    pub motion_seq: Option<u32>,
}

impl LineMonitor {
    pub fn new(layout: Layout) -> Self {
        Self {
            layout,
            from_host: Decoder::new(),
            from_device: Decoder::new(),
            asked: None,
            state: State::Idle,
            motion_seq: None,
        }
    }

    pub fn host_says(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let Some(Ok(payload)) = self.from_host.feed(*byte) else { continue };
            if let Ok(ToDevice::Request { id, command: Command::Start { at_seq, .. } }) = read_to_device(payload)
                && matches!(self.state, State::Idle)
            {
                self.asked = Some(id);
                self.state = State::Waiting { at_seq: at_seq.unwrap_or_default() };
            }
        }
    }

    pub fn device_says(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let Some(Ok(payload)) = self.from_device.feed(*byte) else { continue };
            match read_to_host(payload, Some(&self.layout)) {
                Ok(ToHost::Report(Report::Event(event))) => match event.kind {
                    EventKind::MotionStarted(_) => {
                        self.motion_seq = Some(event.seq);
                        self.state = State::Running { phase: 0 };
                    }
                    EventKind::MotionEnded { .. } | EventKind::Started(_) | EventKind::FaultCleared => {
                        self.state = State::Idle;
                    }
                    EventKind::FaultRaised(fault) => self.state = State::Fault(fault),
                    EventKind::ZeroSet | EventKind::MoveTimedOut { .. } | EventKind::JogEnded { .. } => {}
                },
                Ok(ToHost::Report(Report::Refused { id, .. })) if self.asked == Some(id) => {
                    self.state = State::Idle;
                }
                _ => {}
            }
        }
    }

    /// The processor was reset: what it had begun to say is cut off.
    pub fn cut(&mut self) {
        (self.from_device, self.state) = (Decoder::new(), State::Idle);
    }
}
