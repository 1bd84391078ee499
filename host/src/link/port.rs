//! Opening a serial device or pseudo-terminal, and listing those there are.

use std::time::Duration;

use serialport::{SerialPort, SerialPortType};

use super::LinkError;

/// How long a read waits for a byte and a write for room. Threads look for the end of their work this often.
pub(super) const PATIENCE: Duration = Duration::from_millis(50);

/// Opens a port for this program alone: 8 bits, no parity, one stop bit, no flow control.
pub(super) fn open(port: &str, baud: u32) -> Result<Box<dyn SerialPort>, LinkError> {
    serialport::new(port, baud)
        .timeout(PATIENCE)
        .open()
        .map_err(|source| LinkError::Open { port: port.to_owned(), source })
}

/// A serial port of this machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PortInfo {
    /// Path, as `--port` takes it.
    pub path: String,
    /// What is known of it, for people; empty if nothing is.
    pub about: String,
}

/// The serial ports of this machine, sorted by path.
///
/// # Errors
/// The operating system's, if it cannot list them.
pub fn list() -> Result<Vec<PortInfo>, serialport::Error> {
    let mut ports: Vec<_> = serialport::available_ports()?
        .into_iter()
        .map(|port| PortInfo { path: port.port_name, about: about(&port.port_type) })
        .collect();
    ports.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(ports)
}

fn about(kind: &SerialPortType) -> String {
    match kind {
        SerialPortType::UsbPort(usb) => {
            let names = [&usb.manufacturer, &usb.product, &usb.serial_number];
            let names: Vec<_> = names.into_iter().flatten().map(String::as_str).collect();
            format!("USB {:04x}:{:04x} {}", usb.vid, usb.pid, names.join(" ")).trim_end().to_owned()
        }
        SerialPortType::BluetoothPort => "Bluetooth".to_owned(),
        SerialPortType::PciPort => "built in".to_owned(),
        SerialPortType::Unknown => String::new(),
    }
}
