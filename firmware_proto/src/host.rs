//! The host's side: the greeting, the state that each wrench answers, motion to force, and the offset between the
//! clocks.
//!
//! [`Host`] is pure: it reads no clock and no port. Times of the host are in ns, of any clock that never goes back.
//!
//! **Motion to force** is the time from the moment at which the device read its encoders to the moment at which the
//! wrench that answers this state came into force. Each wrench names the state that it answers. Each state names the
//! wrench in force and the time at which this wrench came into force. Both moments are in the device's clock, so their
//! difference is exact to the clock's resolution of 1 µs, whatever the transport.
//!
//! **The offset between the clocks** (device less host) cannot be measured as exactly. A wrench that was sent at $t_1$
//! and came into force at $t_2$ of the device shows that the offset is at most $t_2 - t_1$; a state that the device
//! measured at $t_3$ and that came at $t_4$ shows that the offset is at least $t_3 - t_4$. The offset lies between
//! both, and the estimate is the middle, with half the distance as its bound: half the round trip, less the time that
//! the device kept the wrench (Cristian 1989; Mills 1991). Successive intervals are intersected after the older one is
//! widened by the largest drift of two crystals, 200 ppm.

use crate::report::{
    CapabilitiesReport, Condition, ENCODERS, EncodersReport, GeometryReport, HelloReport,
    JointReport, Kind, LENGTH, Report, ReportError, Sends, StateReport, VERSION, WrenchReport,
    WrenchSi, flags,
};
use core::fmt;
use core::num::NonZeroU32;

/// The host repeats a hello that is not answered in full within this time (ns).
pub const HELLO_NS: u64 = 100_000_000;

/// Number of wrenches that the host remembers.
const WRENCHES: usize = 64;

/// One part in this many is the largest drift between two clocks: 200 ppm.
const DRIFT: u64 = 5000;

/// A device's own clock, extended beyond the range of its 32-bit counter, which wraps every 71 minutes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceClock {
    last: Option<u32>,
    time_us: u64,
}

impl DeviceClock {
    /// Takes the counter of the next report (us); returns the device's time (ns). The time starts at the first counter
    /// and never decreases. After a counter that jumps back (the device was restarted), time continues from there.
    ///
    /// ```
    /// let mut clock = firmware_proto::host::DeviceClock::default();
    /// assert_eq!(clock.advance(u32::MAX - 499), (u64::from(u32::MAX) - 499) * 1000);
    /// assert_eq!(clock.advance(500), (u64::from(u32::MAX) + 501) * 1000); // wrapped, 1 ms later
    /// ```
    pub fn advance(&mut self, counter_us: u32) -> u64 {
        let step = match self.last {
            None => counter_us,
            Some(last) => match counter_us.wrapping_sub(last) {
                // A difference of more than half the range means that the counter went back.
                step if step > u32::MAX / 2 => 0,
                step => step,
            },
        };
        self.last = Some(counter_us);
        self.time_us = self.time_us.saturating_add(u64::from(step));
        self.time_us.saturating_mul(1000)
    }
}

/// The time from a motion to the force that answers it, in the device's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionToForce {
    /// Sequence number of the wrench.
    pub wrench: u16,
    /// Sequence number of the state that the wrench answers.
    pub state: u16,
    /// From the reading of the encoders to the force (µs).
    pub delay_us: u32,
}

/// The offset between the clocks: the device's time less the host's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockOffset {
    /// The estimate (ns).
    pub offset_ns: i64,
    /// The true offset is at most this far from the estimate (ns), provided that the clocks drift by at most 200 ppm.
    pub bound_ns: u64,
}

/// The interval in which the offset between the clocks lies.
#[derive(Clone, Copy, Debug)]
struct Interval {
    low: i64,
    high: i64,
    at_ns: u64,
}

impl Interval {
    const UNKNOWN: Self = Self {
        low: i64::MIN,
        high: i64::MAX,
        at_ns: 0,
    };

    /// Intersects the interval with a newer one, of the time `now_ns` of the host.
    fn narrow(&mut self, now_ns: u64, low: i64, high: i64) {
        let elapsed = now_ns.saturating_sub(self.at_ns);
        let drift = signed(elapsed.div_ceil(DRIFT));
        let widened = |bound: i64, unknown: i64, moved: i64| match bound {
            bound if bound == unknown => unknown,
            _ => moved,
        };
        let old_low = widened(self.low, i64::MIN, self.low.saturating_sub(drift));
        let old_high = widened(self.high, i64::MAX, self.high.saturating_add(drift));
        self.at_ns = now_ns;
        (self.low, self.high) = (old_low.max(low), old_high.min(high));
        if self.low > self.high {
            // A clock was set, so the past intervals do not count.
            (self.low, self.high) = (low, high);
        }
    }

    fn offset(&self) -> Option<ClockOffset> {
        if self.low == i64::MIN || self.high == i64::MAX {
            return None;
        }
        let width = self.high.saturating_sub(self.low).unsigned_abs();
        let half = width.div_ceil(2);
        Some(ClockOffset {
            offset_ns: self.low.saturating_add(signed(width / 2)),
            bound_ns: half,
        })
    }
}

fn signed(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}

/// The content of a report that the host accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The pose of the device.
    State {
        /// The report.
        report: StateReport,
        /// Motion to force of the wrench in force, if this is the first state that names the wrench.
        motion_to_force: Option<MotionToForce>,
    },
    /// The counts of the device's encoders.
    Encoders {
        /// The report.
        report: EncodersReport,
        /// See `State`.
        motion_to_force: Option<MotionToForce>,
    },
    /// The capabilities of the device.
    Capabilities(CapabilitiesReport),
    /// The kinematics of the device.
    Geometry(GeometryReport),
    /// One encoder of the device.
    Joint(JointReport),
}

/// The reason why the host does not use a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HostError {
    /// The bytes are not a valid report to a host.
    Report(ReportError),
    /// The report is of another session: the device has not been greeted, has been restarted, or serves another host.
    Session {
        /// The session of the report; zero for none.
        found: u32,
    },
    /// The report is not newer than the last.
    Sequence,
}

impl fmt::Display for HostError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Report(error) => error.fmt(f),
            Self::Session { found: 0 } => {
                f.write_str("the device has no session; send a hello first")
            }
            Self::Session { found } => write!(
                f,
                "the device serves the session {found:#010x} of another host; end that host"
            ),
            Self::Sequence => f.write_str("the report is not newer than the last"),
        }
    }
}

impl core::error::Error for HostError {}

/// A wrench that was sent.
#[derive(Clone, Copy, Debug)]
struct Sent {
    sequence: u16,
    at_ns: u64,
    state: u16,
    state_time_us: u32,
}

/// The host's side of the protocol, for one device.
///
/// ```
/// use core::num::NonZeroU32;
/// use firmware_proto::device::{Device, Geometry, Inputs, Measured};
/// use firmware_proto::host::{Event, Host};
/// use firmware_proto::report::{Model, WrenchSi, axes};
///
/// let mut name = [0; 16];
/// name[..6].copy_from_slice(b"paddle");
/// let model = Model {
///     sensed: axes::X,
///     actuated: axes::X,
///     max_force: 5_000_000,
///     rate: [100, 1000],
///     name,
///     ..Model::default()
/// };
/// let mut device = Device::new(model, Geometry::default());
/// assert!(device.home() && device.homed());
/// let measured = Measured::Pose {
///     position: [0; 3],
///     orientation: [32767, 0, 0, 0],
///     velocity: [0; 3],
///     angular_velocity: [0; 3],
/// };
///
/// // The host greets the device, and the device answers.
/// let mut host = Host::new(NonZeroU32::new(0xCAFE).unwrap(), 0);
/// device.receive(&host.hello(0), 100).unwrap();
/// let report = device.report(1_000, Inputs::default(), &measured);
/// assert!(matches!(host.receive(&report, 950_000), Ok(Event::Capabilities(_))));
/// assert!(host.ready());
///
/// // A state, a wrench that answers the state, and the next state, which names the wrench in force.
/// let report = device.report(2_000, Inputs::default(), &measured);
/// host.receive(&report, 1_950_000).unwrap();
/// let push = WrenchSi { force: [1.0, 0.0, 0.0], moment: [0.0; 3] };
/// device.receive(&host.wrench(&push, 2_000_000).unwrap(), 2_150).unwrap();
/// assert_eq!(device.actuate(2_200).force, [1_000_000, 0, 0]);
/// let report = device.report(3_000, Inputs::default(), &measured);
/// let Ok(Event::State { motion_to_force: Some(measured), .. }) = host.receive(&report, 2_950_000)
/// else {
///     panic!("it is the first state with this wrench");
/// };
/// // The device read its encoders at 2,000 µs, and the force came at 2,200 µs.
/// assert_eq!(measured.delay_us, 200);
/// // The hello, sent at 0, came at 100 µs at the latest; the state of 3,000 µs came at 2,950 µs.
/// let offset = host.offset().unwrap();
/// assert!((50_000..=101_000).contains(&offset.offset_ns));
/// assert!(offset.bound_ns < 27_000);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Host {
    session: u32,
    watchdog_us: u32,
    /// Sequence number of the next report.
    sequence: u16,
    capabilities: Option<CapabilitiesReport>,
    geometry: Option<GeometryReport>,
    joints: [Option<JointReport>; ENCODERS],
    /// Sequence number of the device's last report.
    last: Option<u16>,
    lost: u64,
    /// Sequence number and time of the newest state.
    state: Option<(u16, u32)>,
    /// Sequence number and time of the last hello.
    hello: Option<(u16, u64)>,
    /// Wrenches of this session, each in the place of its sequence number.
    sent: [Option<Sent>; WRENCHES],
    /// The last wrench that a state named.
    named: Option<u16>,
    clock: DeviceClock,
    interval: Interval,
}

impl Host {
    /// A host that opens `session`, a number that it draws anew at each start, and asks for a watchdog of `watchdog_us`
    /// (see [`HelloReport::watchdog_us`]).
    pub fn new(session: NonZeroU32, watchdog_us: u32) -> Self {
        Self {
            session: session.get(),
            watchdog_us,
            sequence: 0,
            capabilities: None,
            geometry: None,
            joints: [None; ENCODERS],
            last: None,
            lost: 0,
            state: None,
            hello: None,
            sent: [None; WRENCHES],
            named: None,
            clock: DeviceClock::default(),
            interval: Interval::UNKNOWN,
        }
    }

    /// The capabilities of the device, once it has answered.
    pub fn capabilities(&self) -> Option<&CapabilitiesReport> {
        self.capabilities.as_ref()
    }

    /// The kinematics of the device, once it has come.
    pub fn geometry(&self) -> Option<&GeometryReport> {
        self.geometry.as_ref()
    }

    /// The encoders of the device that have come so far.
    pub fn joints(&self) -> &[Option<JointReport>; ENCODERS] {
        &self.joints
    }

    /// Number of the device's reports that never came.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Whether the device has answered the hello in full.
    pub fn ready(&self) -> bool {
        let Some(capabilities) = &self.capabilities else {
            return false;
        };
        match capabilities.model.sends {
            Sends::Poses => true,
            Sends::Counts { encoders } => {
                let mut joints = self.joints.iter().take(encoders.into());
                self.geometry.is_some() && joints.all(Option::is_some)
            }
        }
    }

    /// The offset between the clocks, once it is bounded on both sides.
    pub fn offset(&self) -> Option<ClockOffset> {
        self.interval.offset()
    }

    /// The report to send at `now_ns`: the wrench `si`, or a hello as long as the device is not ready, every
    /// [`HELLO_NS`]. `None` between two hellos, and before the first state.
    pub fn command(&mut self, si: &WrenchSi, now_ns: u64) -> Option<[u8; LENGTH]> {
        if self.ready() {
            return self.wrench(si, now_ns);
        }
        let due = self
            .hello
            .is_none_or(|(_, sent_ns)| now_ns.saturating_sub(sent_ns) >= HELLO_NS);
        due.then(|| self.hello(now_ns))
    }

    /// A hello to send at a time that is not known in the host's clock. This hello does not bound the offset.
    pub fn greet(&mut self) -> [u8; LENGTH] {
        let sequence = self.number();
        self.hello_report(sequence)
    }

    /// The hello to send at `now_ns`.
    pub fn hello(&mut self, now_ns: u64) -> [u8; LENGTH] {
        let sequence = self.number();
        self.hello = Some((sequence, now_ns));
        self.hello_report(sequence)
    }

    fn hello_report(&self, sequence: u16) -> [u8; LENGTH] {
        HelloReport {
            sequence,
            session: self.session,
            newest: VERSION,
            watchdog_us: self.watchdog_us,
        }
        .encode()
    }

    /// The report of a wrench that answers the newest state, to send at `now_ns`; `None` until the device is ready and
    /// a state has come. [`WrenchReport::from_si`] makes the report.
    pub fn wrench(&mut self, si: &WrenchSi, now_ns: u64) -> Option<[u8; LENGTH]> {
        let (state, state_time_us) = self.state.filter(|_| self.ready())?;
        let sequence = self.number();
        if let Some(place) = self.sent.get_mut(place(sequence)) {
            *place = Some(Sent {
                sequence,
                at_ns: now_ns,
                state,
                state_time_us,
            });
        }
        Some(WrenchReport::from_si(sequence, self.session, state, si, flags::ENABLE).encode())
    }

    /// The report that lets the device go.
    pub fn release(&mut self) -> [u8; LENGTH] {
        release(self.session, self.number())
    }

    /// Takes a report that came at `now_ns`.
    ///
    /// # Errors
    /// [`HostError`]. A report without a session, from a device that had answered before, shows that the device has been
    /// restarted: the host is then no longer [`ready`](Self::ready).
    pub fn receive(&mut self, bytes: &[u8], now_ns: u64) -> Result<Event, HostError> {
        let report = Report::decode(bytes).map_err(HostError::Report)?;
        let (sequence, session) = match &report {
            Report::State(report) => (report.sequence, report.session),
            Report::Encoders(report) => (report.sequence, report.session),
            Report::Capabilities(report) => (report.sequence, report.session),
            Report::Geometry(report) => (report.sequence, report.session),
            Report::Joint(report) => (report.sequence, report.session),
            Report::Wrench(_) => return Err(unexpected(Kind::Wrench)),
            Report::Hello(_) => return Err(unexpected(Kind::Hello)),
        };
        if session != self.session {
            if session == 0 && self.capabilities.is_some() {
                self.forget();
            }
            return Err(HostError::Session { found: session });
        }
        if let Some(last) = self.last {
            let step = sequence.wrapping_sub(last);
            if step == 0 || step > u16::MAX / 2 {
                return Err(HostError::Sequence);
            }
            self.lost = self.lost.saturating_add(u64::from(step.saturating_sub(1)));
        }
        self.last = Some(sequence);
        Ok(match report {
            Report::Capabilities(report) => {
                self.greeted(&report, now_ns);
                Event::Capabilities(report)
            }
            Report::Geometry(report) => {
                self.geometry = Some(report);
                Event::Geometry(report)
            }
            Report::Joint(report) => {
                if let Some(joint) = self.joints.get_mut(usize::from(report.encoder)) {
                    *joint = Some(report);
                }
                Event::Joint(report)
            }
            Report::State(report) => Event::State {
                report,
                motion_to_force: self.state(sequence, &report.condition, now_ns),
            },
            Report::Encoders(report) => Event::Encoders {
                report,
                motion_to_force: self.state(sequence, &report.condition, now_ns),
            },
            Report::Wrench(_) | Report::Hello(_) => return Err(unexpected(Kind::Wrench)),
        })
    }

    fn number(&mut self) -> u16 {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        sequence
    }

    /// Forgets the answer of a device that has been restarted.
    fn forget(&mut self) {
        self.capabilities = None;
        self.geometry = None;
        self.joints = [None; ENCODERS];
        self.last = None;
        self.state = None;
        self.hello = None;
        self.sent = [None; WRENCHES];
        self.named = None;
        self.interval = Interval::UNKNOWN;
    }

    fn greeted(&mut self, report: &CapabilitiesReport, now_ns: u64) {
        self.capabilities = Some(*report);
        // The answer was late, or lost. The time of another hello does not bound the offset.
        if let Some((sequence, sent_ns)) = self.hello
            && sequence == report.hello
        {
            let came_ns = self.clock.advance(report.hello_time_us);
            let (low, high) = bounds(came_ns, now_ns, came_ns, sent_ns);
            self.interval.narrow(now_ns, low, high);
        }
    }

    fn state(
        &mut self,
        sequence: u16,
        condition: &Condition,
        now_ns: u64,
    ) -> Option<MotionToForce> {
        self.state = Some((sequence, condition.time_us));
        let measured_ns = self.clock.advance(condition.time_us);
        let sent = condition
            .in_force()
            .filter(|&wrench| self.named != Some(wrench));
        let found = sent.and_then(|wrench| {
            self.named = Some(wrench);
            let sent = self.sent.get(place(wrench)).copied().flatten();
            sent.filter(|sent| sent.sequence == wrench)
        });
        let Some(sent) = found else {
            let low = signed(measured_ns).saturating_sub(signed(now_ns));
            self.interval.narrow(now_ns, low, i64::MAX);
            return None;
        };
        let age_us = condition.time_us.wrapping_sub(condition.since_us);
        let since_ns = measured_ns.saturating_sub(u64::from(age_us).saturating_mul(1000));
        let (low, high) = bounds(measured_ns, now_ns, since_ns, sent.at_ns);
        self.interval.narrow(now_ns, low, high);
        let delay_us = condition.since_us.wrapping_sub(sent.state_time_us);
        // A force before the motion that it answers is no measurement.
        (delay_us <= u32::MAX / 2).then_some(MotionToForce {
            wrench: sent.sequence,
            state: sent.state,
            delay_us,
        })
    }
}

/// The bounds of the offset: a state measured at `measured_ns` of the device came at `now_ns`, and a report sent at
/// `sent_ns` was there at `there_ns` of the device. The device's clock counts whole microseconds.
fn bounds(measured_ns: u64, now_ns: u64, there_ns: u64, sent_ns: u64) -> (i64, i64) {
    let low = signed(measured_ns).saturating_sub(signed(now_ns));
    let there = signed(there_ns).saturating_add(1000);
    (low, there.saturating_sub(signed(sent_ns)))
}

/// The report that lets the device of a session go, with any sequence number.
pub fn release(session: u32, sequence: u16) -> [u8; LENGTH] {
    WrenchReport {
        sequence,
        session,
        answers: 0,
        force: [0; 3],
        moment: [0; 3],
        flags: 0,
    }
    .encode()
}

fn unexpected(kind: Kind) -> HostError {
    HostError::Report(ReportError::UnexpectedKind { found: kind as u8 })
}

/// The place of a wrench among those that were sent.
fn place(sequence: u16) -> usize {
    usize::from(sequence) % WRENCHES
}

#[cfg(test)]
mod tests;
