//! An emulated Novint Falcon: its FTDI chip, its boot loader, its firmware, and its mechanism with a hand.
//!
//! - **Chip.** Bytes take ten bits each at the baud rate of the divisor. A packet goes to the host when 62 bytes wait,
//!   when the event character has come, or when the latency timer ends. A packet of the latency timer may have only its
//!   two status bytes.
//! - **Boot loader.** A rising DTR with RTS low resets the board. The handshake and the image must come at their baud
//!   rates; each byte is echoed. The firmware runs after the whole image has come unchanged.
//! - **Firmware.** The firmware answers each packet with one packet. An axis finds its reference when its arm passes
//!   the count zero while homing is on. Before that, its counter starts at zero at the position of the arm at power-on.
//! - **Mechanism.** The encoders count the arms by inverse kinematics. The torques of the motors act as the force that
//!   does the same work.
//!
//! [`Faults`] are those that users report. **Our choices**, which no document gives: the time to an answer, the time
//! for which torques are held without a new packet ([`Settings::hold_ns`]), the reference at the count zero, and a
//! board that ignores bytes at another baud rate.

use crate::device::SimDevice;
use crate::emulate::Emulator;
use devices::falcon::boot::{
    BEGIN, HANDSHAKE_DIVISOR, HELLO, HELLO_BACK, IMAGE_DIVISOR, PACKET_DIVISOR,
};
use devices::falcon::geometry::{CENTRE, Jacobian, TORQUE_LIMIT, count_of, inverse, torque_of};
use devices::falcon::packet::{Command, END, Framer, LENGTH, Lights, Report};
use devices::ftdi::{Buffer, Control, PACKET, STATUS, SetupPacket};
use rt_core::{Device, Vec3, Wrench};
use std::collections::VecDeque;

/// The status bytes of the chip: clear to send and data set ready; transmitter empty.
pub const MODEM: [u8; STATUS] = [0x31, 0x60];
/// Error number of a request that the chip does not know (EPIPE).
const STALLED: i32 = 32;
/// Longest step of the mechanism under one force (ns).
const STEP_NS: u64 = 1_000_000;
/// Longest time that the mechanism moves in one call (ns). A longer gap means that the process was stopped, or that the
/// machine is too slow. The mechanism then stands still for the rest of the gap, so that its delay never grows from
/// call to call.
const LONGEST_NS: u64 = 200_000_000;
/// Number of letters of a packet that has no status: 14 bytes in all.
const SHORT: usize = 13;

/// The point at which an upload fails.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UploadFault {
    /// The handshake is not answered.
    #[default]
    NoHandshake,
    /// The start of the upload is not answered.
    NoStart,
    /// This byte of the image comes back changed.
    Changed {
        /// Index of the byte.
        at: usize,
    },
    /// This byte of the image and all later ones do not come back.
    Missing {
        /// Index of the byte.
        at: usize,
    },
    /// The firmware does not run after the upload.
    NoAnswer,
}

/// The faults. A count of zero means never.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faults {
    /// Number of uploads that fail at first.
    pub failing_uploads: u32,
    /// The point at which these uploads fail.
    pub upload: UploadFault,
    /// Number of handshakes in each upload that are not answered at first.
    pub deaf_handshakes: u32,
    /// One answer in this number has 14 bytes: no status.
    pub short_every: u32,
    /// One answer in this number comes in two USB packets.
    pub split_every: u32,
    /// One answer in this number comes after a USB packet that has only status bytes.
    pub bare_every: u32,
    /// One answer in this number does not come.
    pub lost_every: u32,
    /// One answer in this number comes late.
    pub late_every: u32,
    /// The delay of a late answer (ns).
    pub late_ns: u64,
}

/// The settings of the emulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Time from the last byte of a packet to the first byte of its answer (ns).
    pub answer_ns: u64,
    /// Time for which the torques of the last packet are held (ns).
    pub hold_ns: u64,
    /// The faults.
    pub faults: Faults,
}

impl Default for Settings {
    /// An answer after 0.1 ms, torques for 0.1 s, and no faults.
    fn default() -> Self {
        Self {
            answer_ns: 100_000,
            hold_ns: 100_000_000,
            faults: Faults::default(),
        }
    }
}

/// The activity of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Board {
    /// The board has no power.
    Off,
    /// The boot loader waits for a handshake. `greeted` tells whether there was a handshake.
    Rom {
        last: [u8; HELLO.len()],
        deaf: u32,
        greeted: bool,
    },
    /// The boot loader takes the image. `next` is the number of bytes so far, `None` before the start.
    Loading { next: Option<usize>, good: bool },
    /// The firmware runs.
    Running,
    /// No program runs until the next reset.
    Hung,
}

impl Board {
    const RESET: Self = Self::Rom {
        last: [0; HELLO.len()],
        deaf: 0,
        greeted: false,
    };
}

/// A byte on its way to the host.
#[derive(Clone, Copy, Debug)]
struct Out {
    ready_ns: u64,
    byte: u8,
    /// Whether a USB packet ends here in any case.
    cut: bool,
    /// Whether a USB packet of status bytes alone comes before.
    bare: bool,
}

/// An emulated Falcon.
#[derive(Clone, Debug)]
pub struct Falcon {
    device: SimDevice,
    image: Vec<u8>,
    settings: Settings,
    now_ns: u64,
    // The chip.
    divisor: u16,
    latency_ns: u64,
    event: Option<u8>,
    dtr: bool,
    rts: bool,
    /// Time of the last USB packet to the host (ns).
    sent_ns: u64,
    outgoing: VecDeque<Out>,
    outgoing_free_ns: u64,
    /// Bytes on their way to the board: time of arrival (ns), divisor, byte.
    incoming: VecDeque<(u64, u16, u8)>,
    incoming_free_ns: u64,
    // The board.
    board: Board,
    framer: Framer,
    uploads: u32,
    answers: u32,
    command: Command,
    commanded_ns: Option<u64>,
    /// Whether an emergency stop keeps the motors without power.
    stopped: bool,
    buttons: u8,
    /// The true counts of the arms.
    counts: [i16; 3],
    /// The counts at power-on.
    zero: [i16; 3],
    homed: [bool; 3],
}

impl Falcon {
    /// A Falcon without firmware, whose mechanism and hand are `device`, and whose firmware is `image`. If the
    /// device starts out of reach of the mechanism, its encoders stay at zero until it is in reach.
    pub fn new(device: SimDevice, image: &[u8], settings: Settings) -> Self {
        let mut falcon = Self {
            device,
            image: image.to_vec(),
            settings,
            now_ns: 0,
            divisor: HANDSHAKE_DIVISOR,
            latency_ns: 16_000_000,
            event: None,
            dtr: false,
            rts: false,
            sent_ns: 0,
            outgoing: VecDeque::new(),
            outgoing_free_ns: 0,
            incoming: VecDeque::new(),
            incoming_free_ns: 0,
            board: Board::RESET,
            framer: Framer::new(),
            uploads: 0,
            answers: 0,
            command: Command::default(),
            commanded_ns: None,
            stopped: false,
            buttons: 0,
            counts: [0; 3],
            zero: [0; 3],
            homed: [false; 3],
        };
        falcon.count();
        falcon.zero = falcon.counts;
        falcon
    }

    /// The mechanism and the hand.
    pub fn device(&self) -> &SimDevice {
        &self.device
    }

    /// The mechanism and the hand, for code that guides the hand.
    pub fn device_mut(&mut self) -> &mut SimDevice {
        &mut self.device
    }

    /// The latency timer of the chip (ms).
    pub fn latency_ms(&self) -> u8 {
        // It was set in whole milliseconds, 255 at most.
        (self.latency_ns / 1_000_000) as u8
    }

    /// The earliest time (ns) at which the chip may have a packet for the host, from present knowledge. Bytes and
    /// requests of the host change this time, and so does the call of [`send`](Emulator::send) at this time.
    pub fn due_ns(&self) -> u64 {
        let timer = self.sent_ns.saturating_add(self.latency_ns);
        // The board answers after the last byte of a packet.
        let arrival = self.incoming.back().map(|(at_ns, ..)| *at_ns);
        let most = PACKET - STATUS;
        let complete = self
            .outgoing
            .iter()
            .take(most)
            .enumerate()
            .find(|(index, out)| {
                let event = *index > 0 && Some(out.byte) == self.event;
                event || out.cut || index + 1 == most
            });
        let complete = complete.map(|(_, out)| out.ready_ns);
        [arrival, complete]
            .into_iter()
            .flatten()
            .fold(timer, u64::min)
    }

    /// Number of resets for an upload.
    pub fn uploads(&self) -> u32 {
        self.uploads
    }

    /// Whether the firmware runs.
    pub fn is_running(&self) -> bool {
        self.board == Board::Running
    }

    /// Whether the firmware runs and the host asks for homing.
    pub fn is_homing(&self) -> bool {
        self.is_running() && self.command.homing
    }

    /// Whether each axis has found its reference.
    pub fn homed(&self) -> [bool; 3] {
        self.homed
    }

    /// The lights.
    pub fn lights(&self) -> Lights {
        self.command.lights
    }

    /// The torque counts that act now.
    pub fn torques(&self) -> [i16; 3] {
        let held = self
            .commanded_ns
            .is_some_and(|at| self.now_ns.saturating_sub(at) < self.settings.hold_ns);
        if held && self.board == Board::Running && !self.stopped {
            let limit = TORQUE_LIMIT;
            self.command.torques.map(|count| count.clamp(-limit, limit))
        } else {
            [0; 3]
        }
    }

    /// Presses the buttons of the grip, lowest bit first.
    pub fn press(&mut self, buttons: u8) {
        self.buttons = buttons;
    }

    /// Changes the faults from now on.
    pub fn fail(&mut self, faults: Faults) {
        self.settings.faults = faults;
    }

    /// Presses or releases an emergency stop in the supply of the motors. No packet reports the stop.
    pub fn stop(&mut self, stopped: bool, now_ns: u64) {
        self.advance(now_ns);
        self.stopped = stopped;
    }

    /// Switches the power supply of the board off or on. The chip has its power from USB.
    pub fn power(&mut self, on: bool, now_ns: u64) {
        self.advance(now_ns);
        self.reset(if on { Board::RESET } else { Board::Off });
        self.homed = [false; 3];
        self.zero = self.counts;
    }

    /// Takes a request on the control pipe.
    ///
    /// # Errors
    /// The error number of the system for a request that the chip does not know.
    pub fn control(&mut self, setup: SetupPacket, now_ns: u64) -> Result<(), i32> {
        self.advance(now_ns);
        match Control::from_setup(setup).ok_or(STALLED)? {
            Control::Purge(Buffer::One) => {
                self.outgoing.retain(|out| out.ready_ns > now_ns);
            }
            Control::Purge(Buffer::Two) => self.incoming.clear(),
            Control::Signals { dtr, rts } => {
                self.rts = rts.unwrap_or(self.rts);
                let before = self.dtr;
                self.dtr = dtr.unwrap_or(before);
                match (before, self.dtr) {
                    (false, true) if !self.rts && self.board != Board::Off => {
                        self.reset(Board::RESET);
                        self.uploads += 1;
                    }
                    (true, false) => {
                        if let Board::Rom { greeted: true, .. } = self.board {
                            self.board = Board::Loading {
                                next: None,
                                good: true,
                            };
                        }
                    }
                    _ => {}
                }
            }
            Control::NoFlow | Control::EightNone => {}
            Control::Divisor(divisor) => self.divisor = divisor,
            Control::EventCharacter(event) => self.event = event,
            Control::Latency(ms) => self.latency_ns = u64::from(ms.max(1)) * 1_000_000,
        }
        Ok(())
    }

    fn reset(&mut self, board: Board) {
        self.board = board;
        self.framer = Framer::new();
        self.command = Command::default();
        self.commanded_ns = None;
    }

    /// Time of one byte on the line (ns): ten bits.
    fn byte_ns(&self) -> u64 {
        // The divisor is that of 3 MHz, with eighths in its upper two bits (AN232B-05): 00, 1/2, 1/4, 1/8.
        let whole = u64::from(self.divisor & 0x3fff).max(1);
        let eighths = match self.divisor >> 14 {
            0 => 0,
            1 => 4,
            2 => 2,
            _ => 1,
        };
        (whole * 8 + eighths) * 10_000 / 24
    }

    /// Lets the bytes come and the mechanism move, up to `now_ns`.
    fn advance(&mut self, now_ns: u64) {
        while let Some((at_ns, divisor, byte)) = self.incoming.front().copied()
            && at_ns <= now_ns
        {
            self.incoming.pop_front();
            self.advance_mechanism(at_ns);
            self.take(at_ns, divisor, byte);
        }
        self.advance_mechanism(now_ns);
    }

    fn advance_mechanism(&mut self, to_ns: u64) {
        self.now_ns = self.now_ns.max(to_ns.saturating_sub(LONGEST_NS));
        while self.now_ns < to_ns {
            self.now_ns = to_ns.min(self.now_ns + STEP_NS);
            // The force of the step before acts up to now; then the motors act at the new place.
            let wrench = Wrench {
                force: self.force(),
                moment: Vec3::zeros(),
            };
            // A simulated device takes every wrench.
            let _ = self.device.write(self.now_ns, &wrench);
            self.count();
        }
    }

    /// The force of the motors on the hand at the present place (N).
    fn force(&self) -> Vec3 {
        let torques = self.torques();
        if torques == [0; 3] {
            return Vec3::zeros();
        }
        let place = CENTRE + self.device.position();
        let jacobian = inverse(&place).and_then(|angles| Jacobian::at(&place, &angles));
        jacobian.map_or_else(Vec3::zeros, |jacobian| {
            jacobian.force(&torques.map(torque_of))
        })
    }

    /// Counts the arms. An arm that passes its reference while homing is on is homed.
    fn count(&mut self) {
        let Some(angles) = inverse(&(CENTRE + self.device.position())) else {
            return;
        };
        let homing = self.board == Board::Running && self.command.homing;
        for ((count, homed), angle) in self.counts.iter_mut().zip(&mut self.homed).zip(angles) {
            let now = libm::round(count_of(angle)) as i16;
            if homing && (now >= 0) != (*count >= 0) {
                *homed = true;
            }
            *count = now;
        }
    }

    /// Takes a byte at the board.
    fn take(&mut self, at_ns: u64, divisor: u16, byte: u8) {
        let faults = self.settings.faults;
        let fails = (self.uploads <= faults.failing_uploads).then_some(faults.upload);
        match &mut self.board {
            Board::Off | Board::Hung => {}
            Board::Rom {
                last,
                deaf,
                greeted,
            } => {
                if divisor != HANDSHAKE_DIVISOR || !self.dtr || self.rts {
                    return;
                }
                last.rotate_left(1);
                if let Some(place) = last.last_mut() {
                    *place = byte;
                }
                if *last != HELLO || fails == Some(UploadFault::NoHandshake) {
                    return;
                }
                if *deaf < faults.deaf_handshakes {
                    *deaf += 1;
                    return;
                }
                *greeted = true;
                self.answer(at_ns, &HELLO_BACK);
            }
            Board::Loading { next, good } => {
                if divisor != IMAGE_DIVISOR {
                    return;
                }
                let Some(at) = *next else {
                    if byte == BEGIN && fails != Some(UploadFault::NoStart) {
                        *next = Some(0);
                        self.answer(at_ns, &[BEGIN]);
                    }
                    return;
                };
                *next = Some(at + 1);
                let echo = match fails {
                    Some(UploadFault::Changed { at: here }) if here == at => byte ^ 0x10,
                    _ => byte,
                };
                *good &= self.image.get(at) == Some(&echo);
                let good = *good;
                if at + 1 >= self.image.len() {
                    let runs = good && fails != Some(UploadFault::NoAnswer);
                    self.board = if runs { Board::Running } else { Board::Hung };
                }
                if !matches!(fails, Some(UploadFault::Missing { at: from }) if at >= from) {
                    self.answer(at_ns, &[echo]);
                }
            }
            Board::Running => {
                if divisor != PACKET_DIVISOR {
                    return;
                }
                let packet = self.framer.push(byte);
                if let Some(Ok(command)) = packet.map(|packet| Command::decode(&packet)) {
                    self.command = command;
                    self.commanded_ns = Some(at_ns);
                    self.report(at_ns);
                }
            }
        }
    }

    /// Answers a packet.
    fn report(&mut self, at_ns: u64) {
        self.answers = self.answers.wrapping_add(1);
        let faults = self.settings.faults;
        let answers = self.answers;
        let now = |every: u32| every > 0 && answers.is_multiple_of(every);
        if now(faults.lost_every) {
            return;
        }
        let mut encoders = self.counts;
        for ((count, zero), homed) in encoders.iter_mut().zip(self.zero).zip(self.homed) {
            if !homed {
                *count = count.wrapping_sub(zero);
            }
        }
        let packet = Report {
            encoders,
            buttons: self.buttons,
            homed: self.homed,
        }
        .encode();
        let late_ns = if now(faults.late_every) {
            faults.late_ns
        } else {
            0
        };
        let before = self.outgoing.len();
        let at_ns = at_ns + self.settings.answer_ns + late_ns;
        if now(faults.short_every) {
            let mut short = [END; SHORT + 1];
            for (place, byte) in short.iter_mut().zip(packet).take(SHORT) {
                *place = byte;
            }
            self.answer(at_ns, &short);
        } else {
            self.answer(at_ns, &packet);
        }
        if let Some(first) = self.outgoing.get_mut(before) {
            first.bare = now(faults.bare_every);
        }
        // The place of the cut moves over the packet from answer to answer.
        let cut = before + (answers / faults.split_every.max(1)) as usize % (LENGTH - 1);
        if now(faults.split_every)
            && let Some(last) = self.outgoing.get_mut(cut)
        {
            last.cut = true;
        }
    }

    /// Puts bytes on the line to the host from `at_ns` on.
    fn answer(&mut self, at_ns: u64, bytes: &[u8]) {
        let byte_ns = self.byte_ns();
        let mut free_ns = self.outgoing_free_ns.max(at_ns);
        for byte in bytes {
            free_ns += byte_ns;
            self.outgoing.push_back(Out {
                ready_ns: free_ns,
                byte: *byte,
                cut: false,
                bare: false,
            });
        }
        self.outgoing_free_ns = free_ns;
    }
}

impl Emulator for Falcon {
    fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.advance(now_ns);
        let byte_ns = self.byte_ns();
        let mut free_ns = self.incoming_free_ns.max(now_ns);
        for byte in bytes {
            free_ns += byte_ns;
            self.incoming.push_back((free_ns, self.divisor, *byte));
        }
        self.incoming_free_ns = free_ns;
    }

    /// One USB packet of the chip, with its status bytes.
    fn send(&mut self, now_ns: u64, report: &mut [u8; PACKET]) -> Option<usize> {
        self.advance(now_ns);
        let most = PACKET - STATUS;
        let waiting = self
            .outgoing
            .iter()
            .take(most)
            .take_while(|out| out.ready_ns <= now_ns);
        let (mut count, mut event, mut cut) = (0, false, None);
        for (index, out) in waiting.enumerate() {
            count = index + 1;
            event |= index > 0 && Some(out.byte) == self.event;
            if out.cut && cut.is_none() {
                cut = Some(count);
            }
        }
        let ends = now_ns.saturating_sub(self.sent_ns) >= self.latency_ns;
        if !(count == most || event || cut.is_some() || ends) {
            return None;
        }
        let bare = self
            .outgoing
            .front_mut()
            .is_some_and(|first| first.ready_ns <= now_ns && std::mem::take(&mut first.bare));
        let count = if bare { 0 } else { cut.unwrap_or(count) };
        self.sent_ns = now_ns;
        let (status, data) = report.split_at_mut(STATUS);
        status.copy_from_slice(&MODEM);
        for (place, out) in data.iter_mut().zip(self.outgoing.drain(..count)) {
            *place = out.byte;
        }
        Some(STATUS + count)
    }
}
