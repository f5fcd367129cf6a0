//! The driver of the Falcon, under a hostile device behind a hostile FTDI chip.

use super::Input;
use devices::Exchange;
use devices::falcon::driver::STALE;
use devices::falcon::geometry::{TORQUE_LIMIT, WORKSPACE};
use devices::falcon::packet::{Command, Framer, LENGTH, Report};
use devices::falcon::{Falcon, Firmware, Settings, Tries};
use devices::ftdi::{Chip, PACKET, STATUS, SetupPacket, Usb, strip};
use rt_core::{DeviceError, DeviceState, Vec3, Wrench};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Time of a transfer (ns). An answer of a device that is sound does not come sooner.
const TRANSFER_NS: u64 = 150_000;
/// Most transfers of one exchange: the reads of two waits, the requests and the packet.
const TRANSFERS: u64 = 2 * 1000 + 3;
/// Longest time of an exchange (ns): both waits and their transfers.
const LONGEST_NS: u64 = 15_000_000 + 2 * TRANSFERS * TRANSFER_NS;
/// Most exchanges of a run.
const EXCHANGES: usize = 200;

/// What the device sends, and what the driver wrote.
struct World {
    input: Input,
    now_ns: u64,
    transfers: u64,
    /// The packets that wait at the chip.
    waiting: std::collections::VecDeque<Vec<u8>>,
    written: Framer,
    torques: Option<[i16; 3]>,
}

#[derive(Clone)]
struct Link(Arc<Mutex<World>>);

impl Link {
    fn world(&self) -> MutexGuard<'_, World> {
        // Another panic is under way already.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl World {
    /// What the device answers to a packet.
    fn answer(&mut self) -> Option<Vec<u8>> {
        if self.input.is_over() {
            return None;
        }
        let status = [0x31, 0x60];
        let [kind, homed] = self.input.array();
        let report = |input: &mut Input, near: bool| {
            let encoder = |raw: i16| if near { raw % 800 } else { raw };
            Report {
                encoders: std::array::from_fn(|_| encoder(input.i16())),
                buttons: homed >> 4,
                homed: [homed & 3 != 3, homed & 5 != 5, homed & 6 != 6],
            }
            .encode()
        };
        Some(match kind % 8 {
            0 => {
                let count = usize::from(homed) % (PACKET + 1);
                self.input.some(count)
            }
            1 => [&status[..], &report(&mut self.input, false)].concat(),
            2 => {
                // In two packets.
                let whole = report(&mut self.input, true);
                let (first, rest) = whole.split_at(usize::from(homed) % LENGTH);
                self.waiting.push_back([&status[..], first].concat());
                [&status[..], rest].concat()
            }
            3 => {
                // One letter is changed.
                let mut whole = report(&mut self.input, true);
                let [place, letter] = self.input.array();
                whole[usize::from(place) % LENGTH] = letter;
                [&status[..], &whole].concat()
            }
            4 => return None,
            5 => status[..usize::from(homed) % 3].to_vec(),
            6 => {
                let two = [report(&mut self.input, true), report(&mut self.input, true)];
                [&status[..], &two.concat()].concat()
            }
            _ => [&status[..], &report(&mut self.input, true)].concat(),
        })
    }

    fn error(&mut self) -> Result<(), i32> {
        self.transfers += 1;
        self.now_ns += TRANSFER_NS;
        // One transfer in so many fails, if the input says so.
        if !self.input.is_over() && self.input.bytes.get(self.input.at) == Some(&0xEE) {
            self.input.at += 1;
            return Err([5, 19, 32, 110][usize::from(self.input.byte()) % 4]);
        }
        Ok(())
    }
}

impl Usb for Link {
    fn request(&mut self, _setup: SetupPacket) -> Result<(), i32> {
        self.world().error()
    }

    fn bulk_in(&mut self, packet: &mut [u8; PACKET], wait: Duration) -> Result<usize, i32> {
        let mut world = self.world();
        world.error()?;
        let Some(bytes) = world.waiting.pop_front() else {
            world.now_ns += wait.as_nanos() as u64;
            return Ok(0);
        };
        for (place, byte) in packet.iter_mut().zip(&bytes) {
            *place = *byte;
        }
        Ok(bytes.len().min(PACKET))
    }

    fn bulk_out(&mut self, bytes: &[u8]) -> Result<(), i32> {
        let mut world = self.world();
        world.error()?;
        for &byte in bytes {
            if let Some(packet) = world.written.push(byte) {
                let Ok(command) = Command::decode(&packet) else {
                    panic!("the driver wrote {packet:?}");
                };
                world.torques = Some(command.torques);
            }
        }
        if let Some(answer) = world.answer() {
            world.waiting.push_back(answer);
        }
        Ok(())
    }
}

/// Runs the parsers of the Falcon's bytes and its driver, under a hostile device whose firmware runs. Returns the number
/// of states that the driver passed on.
///
/// # Panics
/// If a parser breaks its rules, a state is no state, an exchange does not end, or torque is commanded without a
/// position.
pub fn falcon(bytes: &[u8]) -> usize {
    parsers(bytes);
    let mut world = World {
        input: Input::new(bytes),
        now_ns: 0,
        transfers: 0,
        waiting: std::collections::VecDeque::new(),
        written: Framer::new(),
        torques: None,
    };
    // The firmware runs: it answers the first packet.
    let hello = Report::default().encode();
    world
        .waiting
        .push_back([&[0x31, 0x60][..], &hello].concat());
    let link = Link(Arc::new(Mutex::new(world)));
    let Ok(firmware) = Firmware::new(Path::new("hostile"), vec![0x5A; 70]) else {
        panic!("seventy bytes are an image");
    };
    let settings = Settings {
        firmware,
        tries: Tries {
            handshakes: 1,
            uploads: 1,
        },
        period: 1e-3,
    };
    let (near, clock) = (link.clone(), link.clone());
    let opened = Falcon::connect(
        move || Ok(Chip::new(near.clone())),
        move || clock.world().now_ns,
        settings,
    );
    let Ok(mut driver) = opened else { return 0 };
    let push = Wrench {
        force: Vec3::new(2.0, -1.0, 30.0),
        moment: Vec3::zeros(),
    };
    // Exchanges since the last state; none before the first.
    let mut since: Option<u32> = None;
    let (mut states, mut clock_ns) = (0, 0);
    for _ in 0..EXCHANGES {
        let (transfers, start_ns) = {
            let mut world = link.world();
            world.torques = None;
            (world.transfers, world.now_ns)
        };
        let result = driver.exchange(&push);
        {
            let world = link.world();
            let transfers = world.transfers - transfers;
            assert!(
                transfers <= TRANSFERS,
                "{transfers} transfers in one exchange"
            );
            let took_ns = world.now_ns - start_ns;
            assert!(took_ns <= LONGEST_NS, "an exchange took {took_ns} ns");
            if let Some(torques) = world.torques {
                let known = since.is_some_and(|since| since < STALE);
                assert!(
                    known || torques == [0; 3],
                    "{torques:?} at an unknown place"
                );
                assert!(
                    torques
                        .iter()
                        .all(|count| count.unsigned_abs() <= TORQUE_LIMIT.unsigned_abs())
                );
            }
        }
        since = match result {
            Ok(state) => {
                check(&state);
                assert!(state.device_time_ns >= clock_ns, "its clock went back");
                clock_ns = state.device_time_ns;
                states += 1;
                Some(0)
            }
            Err(DeviceError::Disconnected(_)) => {
                let back = driver.reopen().is_ok();
                clock_ns = 0;
                if !back && link.world().input.is_over() {
                    break;
                }
                None
            }
            Err(_) => since.map(|since| since + 1),
        };
        // What comes at the end is silence.
        if link.world().input.is_over() && result.is_err() {
            break;
        }
    }
    // Nothing comes through, or zero.
    link.world().torques = None;
    driver.release();
    assert_eq!(link.world().torques.unwrap_or_default(), [0; 3]);
    states
}

fn check(state: &DeviceState) {
    assert!(state.is_finite(), "{state:?}");
    assert!(state.pose.position.norm() <= 2.0 * WORKSPACE, "{state:?}");
    assert_eq!(state.pose.rotation.scaled_axis(), Vec3::zeros());
    assert_eq!(state.twist.angular, Vec3::zeros());
}

/// The parsers alone, on the bytes as they are.
fn parsers(bytes: &[u8]) {
    let mut transfer = bytes.to_vec();
    let kept = strip(&mut transfer);
    let data = bytes
        .chunks(PACKET)
        .flat_map(|packet| packet.iter().skip(STATUS));
    assert!(transfer.iter().take(kept).eq(data));
    let mut framer = Framer::new();
    let mut packets = 0;
    for &byte in bytes {
        let Some(packet) = framer.push(byte) else {
            continue;
        };
        packets += 1;
        if let Ok(report) = Report::decode(&packet) {
            let again = Report::decode(&report.encode());
            assert_eq!(again, Ok(report));
        }
        if let Ok(command) = Command::decode(&packet) {
            assert_eq!(Command::decode(&command.encode()), Ok(command));
        }
    }
    assert!(packets * LENGTH <= bytes.len());
}
