//! A Falcon with its operator, in virtual time: homing whenever the device asks for it, and the times of its packets.

use devices::DeviceModel;
use devices::falcon::boot::{
    BEGIN, HANDSHAKE_DIVISOR, HELLO, HELLO_BACK, IMAGE_DIVISOR, PACKET_DIVISOR,
};
use devices::falcon::packet::{Command, Framer, LENGTH, Report};
use devices::ftdi::{Control, PACKET, STATUS};
use sim::emulate::falcon::{Falcon, Settings};
use sim::emulate::{Emulator, Operated};
use sim::{Arm, Hand, SimDevice, Trajectory};

const MS: u64 = 1_000_000;
const IMAGE: [u8; 5] = [1, 2, 3, 4, 5];

fn operated() -> Operated {
    let model = DeviceModel::named("falcon").unwrap();
    let hand = Hand::new(Trajectory::still()).with_arm(Arm::FIRM);
    let device = SimDevice::new(model, Some(hand), 1e-3).unwrap();
    Operated::new(Falcon::new(device, &IMAGE, Settings::default()))
}

/// A host that calls the device at the times that the device names, or every microsecond.
struct Host {
    device: Operated,
    now_ns: u64,
    every_us: bool,
    /// The packets of the chip.
    packets: Vec<Vec<u8>>,
}

impl Host {
    fn new(every_us: bool) -> Self {
        Self {
            device: operated(),
            now_ns: 0,
            every_us,
            packets: Vec::new(),
        }
    }

    /// Lets time pass, and takes the packets of the chip. Each comes at the time that was named, or at the first look
    /// after it.
    fn run(&mut self, ns: u64) {
        let end_ns = self.now_ns + ns;
        // Bytes and requests of the host come before the call.
        let mut due_ns = None;
        loop {
            let mut packet = [0; PACKET];
            while let Some(count) = self.device.send(self.now_ns, &mut packet) {
                if let Some(due_ns) = due_ns.take() {
                    assert!(due_ns <= self.now_ns && self.now_ns < due_ns + 1000);
                }
                self.packets.push(packet[..count].to_vec());
            }
            if self.now_ns >= end_ns {
                return;
            }
            let due = self.device.falcon().due_ns();
            assert!(due > self.now_ns, "a packet that was due did not come");
            due_ns = Some(due);
            let next_ns = if self.every_us {
                self.now_ns + 1000
            } else {
                due
            };
            self.now_ns = next_ns.min(end_ns);
        }
    }

    fn set(&mut self, controls: &[Control]) {
        for control in controls {
            self.device.control(control.setup(), self.now_ns).unwrap();
        }
    }

    fn write(&mut self, bytes: &[u8]) {
        self.device.receive(bytes, self.now_ns);
    }

    /// The bytes without status since the last call.
    fn bytes(&mut self) -> Vec<u8> {
        let packets = self.packets.drain(..);
        packets
            .flat_map(|packet| packet[STATUS..].to_vec())
            .collect()
    }

    fn boot(&mut self) {
        let dtr = |high| Control::Signals {
            dtr: Some(high),
            rts: Some(false),
        };
        self.set(&[Control::Divisor(HANDSHAKE_DIVISOR), dtr(false), dtr(true)]);
        self.write(&HELLO);
        self.run(50 * MS);
        assert_eq!(self.bytes(), HELLO_BACK);
        self.set(&[dtr(false), Control::Divisor(IMAGE_DIVISOR)]);
        self.write(&[BEGIN]);
        self.run(50 * MS);
        assert_eq!(self.bytes(), [BEGIN]);
        self.write(&IMAGE);
        self.run(50 * MS);
        assert_eq!(self.bytes(), IMAGE);
        self.set(&[
            Control::Divisor(PACKET_DIVISOR),
            Control::Latency(1),
            Control::EventCharacter(Some(b'>')),
        ]);
    }

    /// One packet out, and the report that comes back within a millisecond.
    fn exchange(&mut self, homing: bool) -> Report {
        let command = Command {
            homing,
            ..Command::default()
        };
        self.write(&command.encode());
        self.run(MS);
        let mut framer = Framer::new();
        let bytes = self.bytes();
        let mut reports = bytes.into_iter().filter_map(|byte| framer.push(byte));
        let report = reports.next().expect("an answer");
        assert!(reports.next().is_none());
        Report::decode(&report).expect("a whole packet")
    }
}

#[test]
fn the_operator_homes_the_device_whenever_it_asks() {
    let mut host = Host::new(false);
    host.run(100 * MS);
    host.boot();
    for round in 0..2 {
        // Before the host asks, there is no homing, and the hand does not move.
        for _ in 0..500 {
            assert_ne!(host.exchange(false).homed, [true; 3]);
        }
        // Friction holds the grip at the place at which the hand has left it.
        assert!(host.device.falcon().device().position().norm() < 1e-3);
        let mut asked = 0;
        let farthest = (0..3000)
            .map(|_| {
                if host.exchange(true).homed != [true; 3] {
                    asked += 1;
                }
                host.device.falcon().device().position().z
            })
            .fold(0.0, f64::max);
        // 0.3 s of notice, and the references are 10 mm out of the way of 25 mm.
        assert!((300..1300).contains(&asked), "{asked} in round {round}");
        assert!((0.02..0.03).contains(&farthest), "{farthest}");
        assert_eq!(host.device.falcon().homed(), [true; 3]);
        // The hand is back, and stays.
        assert!(host.device.falcon().device().position().norm() < 1e-3);
        // Without power, the device loses its references.
        let now_ns = host.now_ns;
        host.device.falcon_mut().power(false, now_ns);
        host.device.falcon_mut().power(true, now_ns);
        host.packets.clear();
        host.boot();
    }
}

#[test]
fn a_packet_comes_at_the_time_that_was_named_and_no_earlier() {
    for every_us in [true, false] {
        let mut host = Host::new(every_us);
        host.boot();
        for k in 0..100 {
            host.write(&Command::default().encode());
            // Not in step with the latency timer.
            host.run(400_000 + k * 13_000);
        }
        // One host looks before a packet is due, and the other never does: `run` checks both.
        assert_eq!(host.bytes().len(), 100 * LENGTH);
    }
}

#[test]
fn a_process_that_was_stopped_does_not_catch_up() {
    let mut device = operated();
    device.receive(&[], 100 * MS);
    let before = device.falcon().device().moved_s();
    device.receive(&[], 20_000 * MS);
    let moved = device.falcon().device().moved_s() - before;
    // 0.2 s in steps, and the first step over the gap, which a simulated device bounds by 0.1 s.
    assert!((0.1..=0.31).contains(&moved), "{moved} s");
}
