//! The upload of the firmware to a Falcon.
//!
//! A Falcon that has just been powered runs a boot loader, which takes the firmware over the serial line of its FTDI
//! chip. The steps are those of libnifalcon (BSD):
//!
//! 1. [`Step::Line`]: buffers empty, latency 16 ms, 9600 baud, RTS low, DTR low and then high.
//! 2. [`Step::Handshake`]: `0a 43 0d` is answered by `0a 44 2c 0d`, at most after 100 tries.
//! 3. [`Step::Start`]: DTR low, 142,857 baud; `41` is answered by `41`.
//! 4. [`Step::Image`]: the image in pieces of at most 62 bytes. Each byte comes back and is compared.
//! 5. [`Step::Answer`]: 1.5 Mbaud, latency 1 ms, and packets ([`super::packet`]). The first answer shows that the
//!    firmware runs.
//!
//! Users report that uploads fail at first and succeed later (libnifalcon's issues 24, 45 and 67), so a failed upload
//! starts again from the first step, a bounded number of times. A clock of the caller and a largest number of reads
//! bound every wait, so a stopped clock cannot prolong a wait.
//!
//! The firmware is Novint's, and its licence forbids distribution. The user provides the file ([`Firmware::load`]).

use super::packet::{self, Command, Framer, Report};
use crate::ftdi::{Buffer, Control, Ftdi};
use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Largest firmware (bytes). The memory of the Falcon's processor is smaller.
pub const LARGEST: usize = 256 * 1024;
/// Largest number of bytes that are sent before their echo is compared: as many as one USB packet of the chip returns.
pub const PIECE: usize = 62;
/// Divisor of the chip for the handshake: 9600 baud.
pub const HANDSHAKE_DIVISOR: u16 = 0x4138;
/// Divisor of the chip for the image: 142,857 baud.
pub const IMAGE_DIVISOR: u16 = 0x15;
/// Divisor of the chip for packets: 1.5 Mbaud.
pub const PACKET_DIVISOR: u16 = 2;
/// The bytes that open the handshake.
pub const HELLO: [u8; 3] = [0x0a, 0x43, 0x0d];
/// The answer of the boot loader to [`HELLO`].
pub const HELLO_BACK: [u8; 4] = [0x0a, 0x44, 0x2c, 0x0d];
/// The byte that starts the upload. The boot loader answers with the same byte.
pub const BEGIN: u8 = 0x41;

/// Wait for an answer in the handshake: seven bytes at 9600 baud take 7 ms, and the latency timer 16 ms.
const HANDSHAKE_WAIT: Duration = Duration::from_millis(50);
/// Wait for the answer to [`BEGIN`], and for the echo of one piece, which takes 9 ms and the latency timer.
const ECHO_WAIT: Duration = Duration::from_millis(500);
/// Time for which old bytes are read and dropped before the first packet: three times the latency timer.
const DRAIN: Duration = Duration::from_millis(3);
/// Wait for the answer to one packet.
const ANSWER_WAIT: Duration = Duration::from_millis(20);
/// Number of packets to firmware that may run already.
const ANSWER_TRIES: u32 = 5;
/// Number of packets to firmware that has just been uploaded.
const START_TRIES: u32 = 50;
/// Most reads in one wait. A chip at work gives a packet every millisecond.
const READS: u32 = 10_000;
/// Error numbers of a device that is gone: ENOENT, ENXIO, EBADF, ENODEV, ESHUTDOWN.
const GONE: [i32; 5] = [2, 6, 9, 19, 108];

/// Whether the error number says that the device is gone, rather than that one transfer failed.
pub fn is_gone(number: i32) -> bool {
    GONE.contains(&number)
}

/// The reason why a file is no firmware.
#[derive(Debug, thiserror::Error)]
pub enum FirmwareError {
    /// The file cannot be read.
    #[error(
        "the Falcon's firmware {path} cannot be read: {source}. {HOW}",
        path = path.display()
    )]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The file has a size that no firmware has.
    #[error(
        "the Falcon's firmware {path} has {found} bytes, not 1 to {LARGEST}. {HOW}",
        path = path.display()
    )]
    Size {
        /// The file.
        path: PathBuf,
        /// Its size (bytes).
        found: u64,
    },
}

/// How to get the firmware.
const HOW: &str = "Name the firmware image of Novint's SDK, or the one in the folder `firmware` of a checkout of \
                   libnifalcon; Novint's licence forbids to deliver it with other programs";

/// A firmware image of the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Firmware {
    path: PathBuf,
    image: Vec<u8>,
}

impl Firmware {
    /// Reads the image in a file.
    ///
    /// # Errors
    /// [`FirmwareError`] if the file is missing, empty or too large. The error says how to get the file.
    pub fn load(path: &Path) -> Result<Self, FirmwareError> {
        let failed = |source| FirmwareError::Unreadable {
            path: path.to_owned(),
            source,
        };
        let mut file = crate::input::open(path).map_err(failed)?;
        // A wrong name may be that of a huge file, so the size is checked first.
        let found = file.metadata().map_err(failed)?.len();
        if found > LARGEST as u64 {
            return Err(FirmwareError::Size {
                path: path.to_owned(),
                found,
            });
        }
        let mut image = Vec::new();
        file.read_to_end(&mut image).map_err(failed)?;
        Self::new(path, image)
    }

    /// An image in memory, with the name of the file that it came from.
    ///
    /// # Errors
    /// [`FirmwareError::Size`] if it is empty or too large.
    pub fn new(path: &Path, image: Vec<u8>) -> Result<Self, FirmwareError> {
        let path = path.to_owned();
        if image.is_empty() || image.len() > LARGEST {
            let found = image.len() as u64;
            return Err(FirmwareError::Size { path, found });
        }
        Ok(Self { path, image })
    }

    /// The bytes of the image.
    pub fn image(&self) -> &[u8] {
        &self.image
    }
}

/// A step of the upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The settings of the serial line.
    Line,
    /// The handshake with the boot loader.
    Handshake,
    /// The start of the upload.
    Start,
    /// The upload of the image.
    Image,
    /// The first answer of the firmware.
    Answer,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Line => "the setting of the serial line",
            Self::Handshake => "the handshake with the boot loader",
            Self::Start => "the start of the upload",
            Self::Image => "the upload of the image",
            Self::Answer => "the first answer of the firmware",
        })
    }
}

/// The failure of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Problem {
    /// The system reported an error.
    #[error("the system reported error {0}")]
    System(i32),
    /// No answer came, after some tries.
    #[error("no answer came after {tries} tries")]
    Silent {
        /// Number of tries.
        tries: u32,
    },
    /// The echo of a byte of the image did not come.
    #[error("byte {at} of the image did not come back in time")]
    Missing {
        /// Index of the byte in the image.
        at: usize,
    },
    /// A byte of the image came back changed.
    #[error("byte {at} of the image was sent as {sent:#04x} and came back as {found:#04x}")]
    Changed {
        /// Index of the byte in the image.
        at: usize,
        /// The byte as it was sent.
        sent: u8,
        /// The byte as it came back.
        found: u8,
    },
}

/// The reason why a Falcon does not run its firmware: the failure of the last upload.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the Falcon does not run the firmware {file}: in the last of {uploads} uploads, {step} failed: {problem}. \
     {remedy}",
    file = file.display(),
    remedy = self.remedy()
)]
pub struct BootError {
    /// The firmware.
    pub file: PathBuf,
    /// Number of uploads that were begun.
    pub uploads: u32,
    /// The step that failed.
    pub step: Step,
    /// The failure.
    pub problem: Problem,
}

impl BootError {
    /// The remedy.
    pub fn remedy(&self) -> &'static str {
        match (self.step, self.problem) {
            (_, Problem::System(number)) if is_gone(number) => {
                "The device is gone: check its USB cable and its power supply"
            }
            (Step::Line, _) => {
                "Check that no other program uses the device, and plug its USB cable in again"
            }
            (Step::Handshake | Step::Start, _) => {
                "Check that the device's own power supply is connected, unplug power and USB for ten seconds, and try \
                 again"
            }
            (Step::Image, _) => {
                "Connect the device to the computer itself, without a hub, unplug its power for ten seconds, and try \
                 again"
            }
            (Step::Answer, _) => {
                "Check that the file is the firmware of the Falcon, unplug the device's power for ten seconds, and \
                 try again"
            }
        }
    }

    /// The error number of the system, if there is one.
    pub fn number(&self) -> Option<i32> {
        match self.problem {
            Problem::System(number) => Some(number),
            _ => None,
        }
    }
}

/// Numbers of tries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tries {
    /// Most handshakes in one upload.
    pub handshakes: u32,
    /// Most uploads.
    pub uploads: u32,
}

impl Default for Tries {
    /// 100 handshakes, as libnifalcon, and ten uploads.
    fn default() -> Self {
        Self {
            handshakes: 100,
            uploads: 10,
        }
    }
}

/// A monotonic clock (ns).
pub type Clock<'a> = &'a mut dyn FnMut() -> u64;

/// Sets the line for the packets of running firmware: 1.5 Mbaud, and no wait for the latency timer, because the end of
/// a packet is the event character.
///
/// # Errors
/// The error number of the system.
pub fn packet_mode<T: Ftdi + ?Sized>(link: &mut T) -> Result<(), i32> {
    for request in [
        Control::NoFlow,
        Control::EightNone,
        Control::Latency(1),
        Control::Divisor(PACKET_DIVISOR),
        Control::EventCharacter(Some(packet::END)),
        Control::Purge(Buffer::One),
        Control::Purge(Buffer::Two),
    ] {
        link.control(request)?;
    }
    Ok(())
}

/// Makes the device run its firmware, and sets the line for packets. Firmware that already runs is kept. Returns the
/// number of uploads: zero if the firmware ran already.
///
/// # Errors
/// [`BootError`] if the last upload failed, or if the device is gone.
pub fn boot<T: Ftdi + ?Sized>(
    link: &mut T,
    firmware: &Firmware,
    tries: &Tries,
    clock: Clock<'_>,
) -> Result<u32, BootError> {
    let mut line = Line { link, clock };
    let error = |uploads, (step, problem)| BootError {
        file: firmware.path.clone(),
        uploads,
        step,
        problem,
    };
    match line.answers(ANSWER_TRIES) {
        Ok(()) => return Ok(0),
        Err(Problem::System(number)) if is_gone(number) => {
            return Err(error(0, (Step::Answer, Problem::System(number))));
        }
        Err(_) => {}
    }
    let mut uploads = 0;
    loop {
        uploads += 1;
        match line.upload(&firmware.image, tries.handshakes) {
            Ok(()) => return Ok(uploads),
            Err(failure) => {
                let gone = matches!(failure.1, Problem::System(number) if is_gone(number));
                if gone || uploads >= tries.uploads {
                    return Err(error(uploads, failure));
                }
            }
        }
    }
}

/// The line, with a clock for its waits.
struct Line<'a, T: ?Sized> {
    link: &'a mut T,
    clock: Clock<'a>,
}

impl<T: Ftdi + ?Sized> Line<'_, T> {
    /// One upload from the first step to the last.
    fn upload(&mut self, image: &[u8], handshakes: u32) -> Result<(), (Step, Problem)> {
        self.reset().map_err(|problem| (Step::Line, problem))?;
        self.handshake(handshakes)
            .map_err(|problem| (Step::Handshake, problem))?;
        self.begin().map_err(|problem| (Step::Start, problem))?;
        self.send(image).map_err(|problem| (Step::Image, problem))?;
        self.answers(START_TRIES)
            .map_err(|problem| (Step::Answer, problem))
    }

    fn set(&mut self, requests: &[Control]) -> Result<(), Problem> {
        for request in requests {
            self.link.control(*request).map_err(Problem::System)?;
        }
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Problem> {
        self.link.write(bytes).map_err(Problem::System)
    }

    fn reset(&mut self) -> Result<(), Problem> {
        let dtr = |high| Control::Signals {
            dtr: Some(high),
            rts: None,
        };
        self.set(&[
            Control::Purge(Buffer::One),
            Control::Purge(Buffer::Two),
            Control::EventCharacter(None),
            Control::NoFlow,
            Control::Latency(16),
            Control::Divisor(HANDSHAKE_DIVISOR),
            Control::EightNone,
            Control::Signals {
                dtr: None,
                rts: Some(false),
            },
            dtr(false),
            dtr(true),
        ])
    }

    fn handshake(&mut self, tries: u32) -> Result<(), Problem> {
        let mut last = [0; HELLO_BACK.len()];
        for _ in 0..tries {
            self.write(&HELLO)?;
            // An answer may come late, after other bytes. It is recognized by its end.
            let found = self.find(HANDSHAKE_WAIT, |byte| {
                last.rotate_left(1);
                if let Some(place) = last.last_mut() {
                    *place = byte;
                }
                last == HELLO_BACK
            })?;
            if found {
                return Ok(());
            }
        }
        Err(Problem::Silent { tries })
    }

    fn begin(&mut self) -> Result<(), Problem> {
        self.set(&[
            Control::Signals {
                dtr: Some(false),
                rts: None,
            },
            Control::Divisor(IMAGE_DIVISOR),
        ])?;
        self.write(&[BEGIN])?;
        // Answers to earlier handshakes may still come before.
        if self.find(ECHO_WAIT, |byte| byte == BEGIN)? {
            Ok(())
        } else {
            Err(Problem::Silent { tries: 1 })
        }
    }

    fn send(&mut self, image: &[u8]) -> Result<(), Problem> {
        let mut at = 0;
        for piece in image.chunks(PIECE) {
            self.write(piece)?;
            let mut left = piece.iter();
            let mut changed = None;
            self.find(ECHO_WAIT, |found| {
                if let Some(&sent) = left.next()
                    && sent != found
                {
                    changed = Some((sent, found));
                    return true;
                }
                left.len() == 0
            })?;
            let came = at + piece.len() - left.len();
            if let Some((sent, found)) = changed {
                let at = came - 1;
                return Err(Problem::Changed { at, sent, found });
            }
            if left.len() > 0 {
                return Err(Problem::Missing { at: came });
            }
            at = came;
        }
        Ok(())
    }

    /// Sets the line for packets, and sends packets without force until one is answered.
    fn answers(&mut self, tries: u32) -> Result<(), Problem> {
        packet_mode(self.link).map_err(Problem::System)?;
        // The answer to an earlier host may wait in a buffer that no request to the chip empties. This answer would
        // count as the answer to the first packet, and each later answer would count as the answer to the next packet.
        self.find(DRAIN, |_| false)?;
        let mut framer = Framer::new();
        for _ in 0..tries {
            self.write(&Command::default().encode())?;
            let found = self.find(ANSWER_WAIT, |byte| {
                framer
                    .push(byte)
                    .is_some_and(|packet| Report::decode(&packet).is_ok())
            })?;
            if found {
                return Ok(());
            }
        }
        Err(Problem::Silent { tries })
    }

    /// Reads bytes one by one, at most for `wait`, until `is_last` accepts a byte. Returns whether that byte came.
    fn find(
        &mut self,
        wait: Duration,
        mut is_last: impl FnMut(u8) -> bool,
    ) -> Result<bool, Problem> {
        let start = (self.clock)();
        let wait_ns = wait.as_nanos() as u64;
        for _ in 0..READS {
            let passed = (self.clock)().saturating_sub(start);
            if passed >= wait_ns {
                return Ok(false);
            }
            let mut byte = [0];
            let left = Duration::from_nanos(wait_ns - passed);
            match self.link.read(&mut byte, left) {
                Ok(count) if count > 0 && is_last(byte[0]) => return Ok(true),
                Ok(_) => {}
                Err(number) => return Err(Problem::System(number)),
            }
        }
        Ok(false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Transport;

    /// A line without an answer, or with one error number as the answer to every call.
    struct Dead {
        error: Option<i32>,
        calls: u64,
    }

    impl Dead {
        fn call(&mut self) -> Result<(), i32> {
            self.calls += 1;
            self.error.map_or(Ok(()), Err)
        }
    }

    impl Transport for Dead {
        fn read(&mut self, _buffer: &mut [u8], _wait: Duration) -> Result<usize, i32> {
            self.call().map(|()| 0)
        }
        fn write(&mut self, _bytes: &[u8]) -> Result<(), i32> {
            self.call()
        }
    }

    impl Ftdi for Dead {
        fn control(&mut self, _request: Control) -> Result<(), i32> {
            self.call()
        }
    }

    fn firmware() -> Firmware {
        Firmware::new(Path::new("novint.bin"), vec![1, 2, 3]).unwrap()
    }

    #[test]
    fn a_missing_an_empty_and_a_huge_file_say_how_to_get_one() {
        let folder = std::env::temp_dir().join(format!("palpate-falcon-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("novint.bin");
        let error = |path: &Path| Firmware::load(path).unwrap_err().to_string();
        let missing = error(&path);
        std::fs::write(&path, []).unwrap();
        let empty = error(&path);
        std::fs::write(&path, vec![0; LARGEST + 1]).unwrap();
        let huge = error(&path);
        std::fs::write(&path, vec![7; LARGEST]).unwrap();
        let largest = Firmware::load(&path).map(|firmware| firmware.image().len());
        std::fs::write(&path, vec![7; 100]).unwrap();
        let small = Firmware::load(&path).map(|firmware| firmware.image().len());
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(largest.unwrap(), LARGEST);
        assert_eq!(small.unwrap(), 100);
        for (text, what) in [
            (&missing, "No such file"),
            (&empty, "has 0 bytes"),
            (&huge, "has 262145 bytes, not 1 to 262144"),
        ] {
            for part in [what, "novint.bin", "SDK", "libnifalcon"] {
                assert!(text.contains(part), "{part} in {text}");
            }
        }
    }

    #[test]
    fn silence_ends_by_the_clock_and_by_the_number_of_reads() {
        let tries = Tries {
            handshakes: 3,
            uploads: 2,
        };
        // A clock of a millisecond a look, and a clock that stands still.
        for step_ns in [1_000_000, 0] {
            let mut link = Dead {
                error: None,
                calls: 0,
            };
            let mut now = 0;
            let mut clock = || {
                now += step_ns;
                now
            };
            let error = boot(&mut link, &firmware(), &tries, &mut clock).unwrap_err();
            assert_eq!((error.uploads, error.step), (2, Step::Handshake));
            assert_eq!(error.problem, Problem::Silent { tries: 3 });
            let text = error.to_string();
            for part in ["novint.bin", "handshake", "3 tries", "power supply"] {
                assert!(text.contains(part), "{part} in {text}");
            }
            // Twelve waits.
            assert!(link.calls <= 12 * u64::from(READS) + 100);
        }
    }

    #[test]
    fn a_device_that_is_gone_ends_all_tries() {
        let mut link = Dead {
            error: Some(19),
            calls: 0,
        };
        let error = boot(&mut link, &firmware(), &Tries::default(), &mut || 0).unwrap_err();
        assert_eq!(
            (link.calls, error.uploads, error.number()),
            (1, 0, Some(19))
        );
        assert!(error.to_string().contains("USB cable"), "{error}");
        // Any other error is tried again.
        let mut link = Dead {
            error: Some(71),
            calls: 0,
        };
        let error = boot(&mut link, &firmware(), &Tries::default(), &mut || 0).unwrap_err();
        assert_eq!((error.uploads, error.step), (10, Step::Line));
        assert_eq!(error.problem, Problem::System(71));
        assert!(error.to_string().contains("no other program"), "{error}");
    }

    /// A boot loader that gives one byte in every second read.
    #[derive(Default)]
    struct Loader {
        divisor: u16,
        settings: Vec<Control>,
        /// Bytes that wait to be read.
        waits: std::collections::VecDeque<u8>,
        gives: bool,
        begun: bool,
        image: Vec<u8>,
        /// The byte of the image that comes back changed, and the first one that does not come back.
        changed: Option<usize>,
        missing: Option<usize>,
    }

    impl Transport for Loader {
        fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
            assert!(wait <= ECHO_WAIT);
            self.gives = !self.gives;
            let next = if self.gives {
                self.waits.pop_front()
            } else {
                None
            };
            buffer[0] = next.unwrap_or_default();
            Ok(next.iter().count())
        }
        fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
            match self.divisor {
                HANDSHAKE_DIVISOR if bytes == HELLO => {
                    self.waits.extend([0x0a, 0x44]);
                    self.waits.extend(HELLO_BACK);
                }
                // The whole answer was read before.
                IMAGE_DIVISOR if bytes == [BEGIN] && !self.begun && self.waits.is_empty() => {
                    self.begun = true;
                    self.waits.push_back(BEGIN);
                }
                IMAGE_DIVISOR if self.begun => {
                    for &byte in bytes {
                        let at = self.image.len();
                        self.image.push(byte);
                        if self.missing.is_none_or(|missing| at < missing) {
                            let change = if self.changed == Some(at) { 0x0f } else { 0 };
                            self.waits.push_back(byte ^ change);
                        }
                    }
                }
                PACKET_DIVISOR if !self.image.is_empty() => {
                    self.waits.extend(Report::default().encode());
                }
                _ => {}
            }
            Ok(())
        }
    }

    impl Ftdi for Loader {
        fn control(&mut self, request: Control) -> Result<(), i32> {
            self.settings.push(request);
            if let Control::Divisor(divisor) = request {
                self.divisor = divisor;
            }
            Ok(())
        }
    }

    /// Boots with one upload of an image of three pieces.
    fn booted(loader: &mut Loader) -> Result<u32, BootError> {
        let image: Vec<u8> = (0..2 * PIECE + 20).map(|k| k as u8).collect();
        let firmware = Firmware::new(Path::new("novint.bin"), image).unwrap();
        let tries = Tries {
            handshakes: 3,
            uploads: 1,
        };
        let mut now_ns = 0;
        boot(loader, &firmware, &tries, &mut || {
            now_ns += 100_000;
            now_ns
        })
    }

    #[test]
    fn the_image_is_uploaded_whole_and_a_device_that_runs_is_left_as_it_is() {
        let mut loader = Loader::default();
        assert_eq!(booted(&mut loader), Ok(1));
        let whole: Vec<u8> = (0..2 * PIECE + 20).map(|k| k as u8).collect();
        assert_eq!(loader.image, whole);
        let packets = [
            Control::NoFlow,
            Control::EightNone,
            Control::Latency(1),
            Control::Divisor(PACKET_DIVISOR),
            Control::EventCharacter(Some(packet::END)),
            Control::Purge(Buffer::One),
            Control::Purge(Buffer::Two),
        ];
        assert_eq!(loader.settings[loader.settings.len() - 7..], packets);
        assert_eq!(booted(&mut loader), Ok(0));
        assert_eq!(loader.image, whole);
    }

    #[test]
    fn a_byte_of_the_image_that_comes_back_changed_or_not_at_all_is_named() {
        for at in [0, 30, PIECE - 1, PIECE, 2 * PIECE + 19] {
            let mut changing = Loader {
                changed: Some(at),
                ..Loader::default()
            };
            let error = booted(&mut changing).unwrap_err();
            let (sent, found) = (at as u8, at as u8 ^ 0x0f);
            assert_eq!(error.problem, Problem::Changed { at, sent, found });
            let mut losing = Loader {
                missing: Some(at),
                ..Loader::default()
            };
            let error = booted(&mut losing).unwrap_err();
            assert_eq!(
                (error.step, error.problem),
                (Step::Image, Problem::Missing { at })
            );
        }
    }
}
