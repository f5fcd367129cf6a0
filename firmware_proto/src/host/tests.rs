use super::*;
use crate::device::{Device, Geometry, Inputs, Measured};
use crate::report::{Model, axes};
use proptest::prelude::*;
use std::string::ToString;
use std::vec::Vec;

const SESSION: NonZeroU32 = NonZeroU32::new(0xCAFE).unwrap();

fn model(sends: Sends) -> Model {
    Model {
        sensed: axes::ALL,
        actuated: axes::ALL,
        max_force: 5_000_000,
        max_moment: 100_000,
        rate: [100, 1000],
        sends,
        name: *b"paddle\0\0\0\0\0\0\0\0\0\0",
        ..Model::default()
    }
}

fn device(sends: Sends) -> Device {
    let mut device = Device::new(model(sends), Geometry::default());
    assert!(device.home() && device.homed());
    device
}

fn pose() -> Measured {
    Measured::Pose {
        position: [0; 3],
        orientation: [32767, 0, 0, 0],
        velocity: [0; 3],
        angular_velocity: [0; 3],
    }
}

fn push() -> WrenchSi {
    WrenchSi {
        force: [1.0, 0.0, 0.0],
        moment: [0.0; 3],
    }
}

fn report(device: &mut Device, now_us: u32) -> [u8; LENGTH] {
    device.report(now_us, Inputs::default(), &pose())
}

/// A host and a device that have greeted each other at time 0 of both clocks.
fn greeted() -> (Host, Device) {
    let (mut host, mut device) = (Host::new(SESSION, 0), device(Sends::Poses));
    device.receive(&host.hello(0), 0).expect("it is accepted");
    host.receive(&report(&mut device, 0), 0)
        .expect("it is valid");
    assert!(host.ready());
    (host, device)
}

#[test]
fn a_host_is_ready_when_the_whole_answer_has_come() {
    let (mut host, mut device) = (Host::new(SESSION, 0), device(Sends::Counts { encoders: 2 }));
    let counts = Measured::Counts {
        counts: [0; 8],
        number: 2,
    };
    let next = |device: &mut Device| device.report(0, Inputs::default(), &counts);
    // States before the greeting are of no session.
    let error = host.receive(&next(&mut device), 0).unwrap_err();
    assert_eq!(error, HostError::Session { found: 0 });
    device.receive(&host.hello(0), 0).expect("it is accepted");
    for part in 0..4 {
        assert!(!host.ready() && host.wrench(&push(), 0).is_none(), "{part}");
        host.receive(&next(&mut device), 0).expect("it is valid");
    }
    assert!(host.ready() && host.geometry().is_some());
    assert_eq!(host.joints().iter().flatten().count(), 2);
    // There is no state to answer yet.
    assert!(host.wrench(&push(), 0).is_none());
    let event = host.receive(&next(&mut device), 0);
    assert!(matches!(event, Ok(Event::Encoders { .. })));
    assert!(host.wrench(&push(), 0).is_some());
}

#[test]
fn motion_to_force_is_that_of_the_state_that_was_answered() {
    let (mut host, mut device) = greeted();
    // The device's clock wraps between motion and force.
    let start = u32::MAX - 150;
    host.receive(&report(&mut device, start), 0)
        .expect("it is valid");
    let wrench = host.wrench(&push(), 0).expect("the device is ready");
    // A newer state, which the wrench does not answer.
    host.receive(&report(&mut device, start + 100), 0)
        .expect("it is valid");
    device
        .receive(&wrench, start + 140)
        .expect("it is accepted");
    device.actuate(start.wrapping_add(400));
    let event = host.receive(&report(&mut device, start.wrapping_add(1000)), 0);
    let Ok(Event::State {
        motion_to_force, ..
    }) = event
    else {
        panic!("{event:?}");
    };
    let expected = MotionToForce {
        wrench: 1,
        state: 1,
        delay_us: 400,
    };
    assert_eq!(motion_to_force, Some(expected));
    // The motion to force is reported once.
    let event = host.receive(&report(&mut device, start.wrapping_add(2000)), 0);
    assert!(matches!(
        event,
        Ok(Event::State {
            motion_to_force: None,
            ..
        })
    ));
}

#[test]
fn reports_of_another_session_old_ones_and_those_of_a_host_are_refused() {
    let (mut host, mut device) = greeted();
    let old = report(&mut device, 10);
    let new = report(&mut device, 20);
    assert!(host.receive(&new, 0).is_ok());
    assert_eq!(host.receive(&new, 0), Err(HostError::Sequence));
    assert_eq!(host.receive(&old, 0), Err(HostError::Sequence));
    assert_eq!(host.lost(), 1);
    let own = host.release();
    let unexpected = HostError::Report(ReportError::UnexpectedKind { found: 0x81 });
    assert_eq!(host.receive(&own, 0), Err(unexpected));
    let mut other = Host::new(NonZeroU32::MAX, 0);
    device.receive(&other.hello(0), 0).expect("it is accepted");
    let error = host.receive(&report(&mut device, 30), 0).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the device serves the session 0xffffffff of another host; end that host"
    );
    assert!(host.ready(), "the device is another host's for now");
}

#[test]
fn a_device_that_was_restarted_is_greeted_again() {
    let (mut host, _) = greeted();
    let mut device = device(Sends::Poses);
    let error = host.receive(&report(&mut device, 5), 1_000).unwrap_err();
    assert_eq!(error, HostError::Session { found: 0 });
    assert!(!host.ready() && host.offset().is_none());
    device
        .receive(&host.hello(2_000), 7)
        .expect("it is accepted");
    host.receive(&report(&mut device, 8), 3_000)
        .expect("it is valid");
    assert!(host.ready());
}

#[test]
fn a_hello_is_repeated_until_the_answer_has_come() {
    let (mut host, mut device) = (Host::new(SESSION, 0), device(Sends::Poses));
    let sent = [0, 1, HELLO_NS - 1, HELLO_NS, 2 * HELLO_NS - 1, 2 * HELLO_NS]
        .map(|now_ns| host.command(&push(), now_ns).is_some());
    assert_eq!(sent, [true, false, false, true, false, true]);
    let hello = host.hello(3 * HELLO_NS);
    device.receive(&hello, 0).expect("it is accepted");
    host.receive(&report(&mut device, 0), 0)
        .expect("it is valid");
    assert!(host.command(&push(), 0).is_none(), "no state has come");
    host.receive(&report(&mut device, 0), 0)
        .expect("it is valid");
    let wrench = host.command(&push(), 0).expect("a state has come");
    assert!(device.receive(&wrench, 0).is_ok());
}

#[test]
fn a_device_of_version_1_is_named() {
    let mut bytes = Host::new(SESSION, 0).hello(0);
    bytes[0] = 1;
    let crc = crc::Crc::<u16>::new(&crc::CRC_16_IBM_3740).checksum(&bytes[..62]);
    bytes[62..].copy_from_slice(&crc.to_le_bytes());
    let error = Host::new(SESSION, 0).receive(&bytes, 0).unwrap_err();
    assert_eq!(error, HostError::Report(ReportError::Version { found: 1 }));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Delays of both ways, a drift of up to 200 ppm, and clocks that start anywhere: the true offset is in the bound,
    /// and the bound is at most half of the round trip just made and the widths of the clocks.
    #[test]
    fn the_offset_is_within_half_the_round_trip(
        start_us in 0..1_000_000_u64,
        ppm in -200..=200_i64,
        trips in prop::collection::vec((1..3_000_u64, 1..3_000_u64, 0..2_000_u64), 1..60),
    ) {
        let (mut host, mut device) = (Host::new(SESSION, 0), device(Sends::Poses));
        // The device's time (ns) at a time of the host.
        let true_ns = |now_ns: u64| {
            let drift = i128::from(now_ns) * i128::from(ppm) / 1_000_000;
            (i128::from(start_us) * 1000 + i128::from(now_ns) + drift) as u64
        };
        let counter = |now_ns: u64| (true_ns(now_ns) / 1000) as u32;
        let mut now_ns = 1_000_000;
        device.receive(&host.hello(now_ns), counter(now_ns + 500_000)).expect("it is accepted");
        now_ns += 1_000_000;
        host.receive(&report(&mut device, counter(now_ns)), now_ns).expect("it is valid");
        for (there_us, back_us, kept_us) in trips {
            host.receive(&report(&mut device, counter(now_ns)), now_ns).expect("it is valid");
            let sent_ns = now_ns;
            let wrench = host.wrench(&push(), sent_ns).expect("the device is ready");
            now_ns += there_us * 1000;
            device.receive(&wrench, counter(now_ns)).expect("it is accepted");
            device.actuate(counter(now_ns));
            now_ns += kept_us * 1000;
            let state = report(&mut device, counter(now_ns));
            now_ns += back_us * 1000;
            host.receive(&state, now_ns).expect("it is valid");
            let found = host.offset().expect("both ways were made");
            let offset = true_ns(now_ns) as i64 - now_ns as i64;
            // The offset itself moves during the trip by the drift of at most 8 ms: 1.6 µs. Rounding adds 2 ns.
            let error = (found.offset_ns - offset).unsigned_abs();
            prop_assert!(error <= found.bound_ns + 1_602, "{found:?}, {offset}");
            // The round trip without the time in the device; both readings are whole microseconds.
            let half = (there_us + back_us) * 500;
            prop_assert!(found.bound_ns <= half + 2_000 + 1_602, "{found:?}, {half}");
        }
    }

    #[test]
    fn no_bytes_panic(
        bytes in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..70), 0..20),
        now_ns: u64,
    ) {
        let (mut host, _) = greeted();
        for bytes in bytes {
            prop_assert!(host.receive(&bytes, now_ns).is_err());
        }
    }
}

#[test]
fn device_time_counts_on_over_wraps_and_restarts() {
    let mut clock = DeviceClock::default();
    let times: Vec<_> = [4_294_000_000, 32_704, 33_704, 100, 1_100]
        .map(|counter| clock.advance(counter))
        .into();
    // A restarted device sets its counter back by a little: the time continues from there.
    let expected = [
        4_294_000_000_000,
        4_295_000_000_000,
        4_295_001_000_000,
        4_295_001_000_000,
        4_295_002_000_000,
    ];
    assert_eq!(times, expected);
}
