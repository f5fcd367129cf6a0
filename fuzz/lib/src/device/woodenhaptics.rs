//! The driver of WoodenHaptics, under a hostile device.

use super::Input;
use devices::woodenhaptics::driver::QUEUE;
use devices::woodenhaptics::report::LONG;
use devices::woodenhaptics::{
    CurrentReport, EncoderReport, Form, WoodenHaptics, WoodenHapticsConfig,
};
use devices::{Exchange, Transport};
use rt_core::{DeviceError, DeviceState, Vec3, Wrench};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Time of a transfer (ns).
const TRANSFER_NS: u64 = 1000;
/// Most transfers of one exchange: two queues, and the report of the host.
const TRANSFERS: usize = 2 * QUEUE + 1;
/// Longest time of an exchange (ns): the waits of the first discarding and of the answer, and the transfers.
const LONGEST_NS: u64 = 20_000_000 + TRANSFERS as u64 * TRANSFER_NS;
/// Most exchanges of a run.
const EXCHANGES: usize = 200;

struct World {
    input: Input,
    form: Form,
    now_ns: u64,
    transfers: usize,
    waiting: VecDeque<Vec<u8>>,
    /// The counters that the device shows.
    counters: [i16; 3],
    currents: Option<[i16; 3]>,
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
    fn report(&self, info: i16) -> Vec<u8> {
        let [a, b, c] = self.counters;
        let report = EncoderReport {
            encoders: [a, b, c, 0, 0, 0],
            info,
        };
        report.encode()[..self.form.length()].to_vec()
    }

    /// What the device answers to a report of the host.
    fn answer(&mut self) {
        if self.input.is_over() {
            return;
        }
        match self.input.byte() % 8 {
            // The counters turn a little.
            0..=2 => {
                for counter in &mut self.counters {
                    let turn = self.input.byte().cast_signed();
                    *counter = counter.wrapping_add(i16::from(turn / 4));
                }
                let report = self.report(0);
                self.waiting.push_back(report);
            }
            // The counters jump.
            3 => {
                for counter in &mut self.counters {
                    *counter = self.input.i16();
                }
                let report = self.report(0);
                self.waiting.push_back(report);
            }
            4 => {
                let info = self.input.byte();
                let report = self.report(info.into());
                self.waiting.push_back(report);
            }
            // Any bytes.
            5 => {
                let count = usize::from(self.input.byte()) % (LONG + 8);
                let report = self.input.some(count);
                self.waiting.push_back(report);
            }
            // A flood.
            6 => {
                let report = self.report(0);
                let count = usize::from(self.input.byte());
                self.waiting.extend((0..count).map(|_| report.clone()));
            }
            // Nothing, and time passes.
            _ => self.now_ns += u64::from(self.input.u16()) * 10_000,
        }
    }

    fn transfer(&mut self) -> Result<(), i32> {
        self.transfers += 1;
        self.now_ns += TRANSFER_NS;
        if !self.input.is_over() && self.input.bytes.get(self.input.at) == Some(&0xEE) {
            self.input.at += 1;
            return Err([5, 19][usize::from(self.input.byte()) % 2]);
        }
        Ok(())
    }
}

impl Transport for Link {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        let mut world = self.world();
        world.transfer()?;
        let Some(bytes) = world.waiting.pop_front() else {
            world.now_ns += wait.as_nanos() as u64;
            return Ok(0);
        };
        for (place, byte) in buffer.iter_mut().zip(&bytes) {
            *place = *byte;
        }
        Ok(bytes.len().min(buffer.len()))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        let mut world = self.world();
        world.transfer()?;
        let Ok(report) = CurrentReport::decode(bytes, world.form) else {
            panic!("the driver wrote {bytes:?}");
        };
        match report.command {
            CurrentReport::CURRENTS => world.currents = Some(report.currents),
            CurrentReport::SET_COUNTERS => {
                // A device takes the counters, if it is one.
                if !world.input.is_over() && world.input.byte() < 0xC0 {
                    world.counters = report.attributes;
                }
            }
            other => panic!("the driver sent the command {other}"),
        }
        world.answer();
        Ok(())
    }
}

/// Runs the parsers and the driver of WoodenHaptics, under a hostile device. Returns the number of states that the driver
/// passed on.
///
/// # Panics
/// If a state is no state, an exchange does not end, or currents are commanded without a position.
pub fn woodenhaptics(bytes: &[u8]) -> usize {
    parsers(bytes);
    let mut input = Input::new(bytes);
    let form = if input.byte().is_multiple_of(2) {
        Form::Short
    } else {
        Form::Long
    };
    let link = Link(Arc::new(Mutex::new(World {
        input,
        form,
        now_ns: 0,
        transfers: 0,
        waiting: VecDeque::new(),
        counters: [0; 3],
        currents: None,
    })));
    let setup = WoodenHapticsConfig {
        form,
        home: Some(Vec3::zeros()),
        ..WoodenHapticsConfig::default()
    };
    let (near, clock) = (link.clone(), link.clone());
    let opened = WoodenHaptics::open(
        &setup,
        move || Ok(near.clone()),
        move || clock.world().now_ns,
    );
    let Ok(mut driver) = opened else {
        panic!("the default geometry is sound");
    };
    let most = driver.kinematics().most_current();
    let geometry = &setup.geometry;
    let reach = geometry.lengths.iter().sum::<f64>() + geometry.origin.norm();
    let push = Wrench {
        force: Vec3::new(2.0, -1.0, 30.0),
        moment: Vec3::zeros(),
    };
    // Whether the position is known, and whether the last report agreed.
    let mut known = driver.calibrate(&Vec3::zeros()).is_ok();
    let (mut states, mut clock_ns) = (0, 0);
    for _ in 0..EXCHANGES {
        let (transfers, start_ns) = {
            let mut world = link.world();
            world.currents = None;
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
            // The device lets time pass on its own, once.
            let took_ns = world.now_ns - start_ns;
            assert!(
                took_ns <= LONGEST_NS + 655_350_000,
                "an exchange took {took_ns} ns"
            );
            if let Some(currents) = world.currents {
                assert!(
                    known || currents == [0; 3],
                    "{currents:?} at an unknown place"
                );
                assert!(
                    currents
                        .iter()
                        .all(|current| f64::from(*current).abs() <= most)
                );
            }
        }
        match result {
            Ok(state) => {
                check(&state, reach);
                assert!(state.device_time_ns >= clock_ns, "its clock went back");
                clock_ns = state.device_time_ns;
                states += 1;
                known = true;
            }
            Err(DeviceError::Disconnected(_)) => {
                known = false;
                clock_ns = 0;
                if driver.reopen().is_err() && link.world().input.is_over() {
                    break;
                }
            }
            Err(DeviceError::Corrupt(rt_core::Corruption::Range)) => known = false,
            Err(_) => {}
        }
        if link.world().input.is_over() && result.is_err() {
            break;
        }
    }
    // Nothing comes through, or zero.
    link.world().currents = None;
    driver.release();
    assert_eq!(link.world().currents.unwrap_or_default(), [0; 3]);
    states
}

fn check(state: &DeviceState, reach: f64) {
    assert!(state.is_finite(), "{state:?}");
    assert!(state.pose.position.norm() <= reach, "{state:?}");
    assert_eq!(state.pose.rotation.scaled_axis(), Vec3::zeros());
    assert_eq!(state.twist.angular, Vec3::zeros());
}

/// The parsers alone, on the bytes as they are.
fn parsers(bytes: &[u8]) {
    for form in [Form::Short, Form::Long] {
        if let Ok(report) = EncoderReport::decode(bytes, form) {
            let again = report.encode();
            assert_eq!(
                EncoderReport::decode(&again[..form.length()], form),
                Ok(report)
            );
        }
        if let Ok(report) = CurrentReport::decode(bytes, form) {
            let again = report.encode();
            assert_eq!(
                CurrentReport::decode(&again[..form.length()], form),
                Ok(report)
            );
        }
    }
}
