//! What an emulated device listens on: a pty, a TCP port, a HID device of the kernel, or a USB gadget.

use crate::uhid::{FILE, Identity, Uhid};
use crate::usb::{GadgetError, HidGadget};
use devices::Transport;
use devices::transport::Stream;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::io;
use std::net::{Ipv4Addr, TcpListener};
use std::time::Duration;

/// The reason why a listener could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ListenerError {
    /// The system gave no pty.
    #[error("the system gave no pty: {0}")]
    Pty(#[source] io::Error),
    /// The port is taken or may not be used.
    #[error(
        "cannot listen on port {port} of this machine: {source}; name another port, or 0 for any free one"
    )]
    Tcp {
        /// The port.
        port: u16,
        /// The error of the system.
        source: io::Error,
    },
    /// The kernel made no HID device.
    #[error(
        "cannot make a HID device through {FILE}: {0}. Load the kernel's module (`modprobe uhid`), and let your account \
         write to {FILE}; a container needs the file from its host"
    )]
    Uhid(#[source] io::Error),
    /// The kernel made no USB gadget.
    #[error(transparent)]
    Usb(#[from] GadgetError),
}

/// What a device listens on until a host comes.
#[derive(Debug)]
pub enum Listener {
    /// A pty.
    Pty {
        /// The end of the device.
        master: Stream,
        /// The path of the host's end.
        path: String,
    },
    /// A port that listens.
    Tcp {
        /// The listener.
        listener: TcpListener,
        /// The port.
        port: u16,
    },
    /// A HID device.
    Uhid {
        /// The device.
        device: Uhid,
        /// The identity that the device states.
        identity: Identity,
    },
    /// A HID device on USB.
    Usb {
        /// The gadget.
        gadget: HidGadget,
        /// The identity that the device states.
        identity: Identity,
    },
}

impl Listener {
    /// A new pty.
    ///
    /// # Errors
    /// [`ListenerError::Pty`].
    pub fn pty() -> Result<Self, ListenerError> {
        let made = || -> io::Result<Self> {
            let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
            grantpt(&master)?;
            unlockpt(&master)?;
            let path = ptsname(&master, Vec::new())?;
            let path = path.to_string_lossy().into_owned();
            // The line discipline must neither echo nor change bytes, from the first byte on. Its settings outlive this
            // opening. After this opening, the kernel tells whether a host has the other end open.
            let held = std::fs::OpenOptions::new()
                .read(true)
                .write(true)
                .open(&path)?;
            let mut settings = rustix::termios::tcgetattr(&held)?;
            settings.make_raw();
            rustix::termios::tcsetattr(&held, rustix::termios::OptionalActions::Now, &settings)?;
            Ok(Self::Pty {
                master: Stream::nonblocking(master)?,
                path,
            })
        };
        made().map_err(ListenerError::Pty)
    }

    /// A port of this machine alone; 0 for any free port.
    ///
    /// # Errors
    /// [`ListenerError::Tcp`].
    pub fn tcp(port: u16) -> Result<Self, ListenerError> {
        let made = || -> io::Result<Self> {
            let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
            listener.set_nonblocking(true)?;
            let port = listener.local_addr()?.port();
            Ok(Self::Tcp { listener, port })
        };
        made().map_err(|source| ListenerError::Tcp { port, source })
    }

    /// A HID device of the kernel.
    ///
    /// # Errors
    /// [`ListenerError::Uhid`].
    pub fn uhid(identity: Identity) -> Result<Self, ListenerError> {
        let device = Uhid::create(&identity).map_err(ListenerError::Uhid)?;
        Ok(Self::Uhid { device, identity })
    }

    /// A HID device on USB, as a gadget of the kernel.
    ///
    /// # Errors
    /// [`ListenerError::Usb`].
    pub fn usb(identity: Identity) -> Result<Self, ListenerError> {
        let gadget = HidGadget::create(&identity)?;
        Ok(Self::Usb { gadget, identity })
    }

    /// The text by which a scene connects to the device.
    pub fn connection(&self) -> String {
        match self {
            Self::Pty { path, .. } => format!("tty:{path}"),
            Self::Tcp { port, .. } => format!("tcp:localhost:{port}"),
            Self::Uhid { identity, .. } | Self::Usb { identity, .. } => format!(
                "hid:{:04x}:{:04x}:{}",
                identity.vid, identity.pid, identity.serial
            ),
        }
    }

    /// The end of the device, once a host has come; `None` if none has come within `wait`. A HID device needs no host.
    ///
    /// # Errors
    /// The error of the system.
    pub fn host(&mut self, wait: Duration) -> io::Result<Option<Box<dyn Transport + '_>>> {
        match self {
            Self::Pty { master, .. } => {
                if hung_up(master)? {
                    std::thread::sleep(wait);
                    return Ok(None);
                }
                Ok(Some(Box::new(master)))
            }
            Self::Uhid { device, .. } => Ok(Some(Box::new(device))),
            Self::Usb { gadget, .. } => Ok(Some(Box::new(gadget))),
            Self::Tcp { listener, .. } => match listener.accept() {
                Ok((stream, _)) => Ok(Some(Box::new(Stream::connected(stream)?))),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    std::thread::sleep(wait);
                    Ok(None)
                }
                Err(error) => Err(error),
            },
        }
    }
}

/// Whether no program has the other end of a pty open.
fn hung_up(master: &Stream) -> io::Result<bool> {
    let now = Timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    let mut ends = [PollFd::new(master, PollFlags::IN)];
    poll(&mut ends, Some(&now))?;
    Ok(ends[0].revents().contains(PollFlags::HUP))
}
