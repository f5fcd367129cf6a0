use super::*;
use crate::device::Rendering;
use crate::engage::{EngageConfig, Engaged};
use crate::geometry::{Pose, Vec3, Wrench};
use crate::safety::SafetyConfig;

const MS: u64 = 1_000_000;
/// Motion of the hand in a tick (m).
const STEP: f64 = 1e-3;

/// One device, its last stage and its clutch. The hand moves in every tick.
struct Rig {
    limiter: Limiter,
    clutch: Clutch,
    frame: DeviceFrame,
    state: DeviceState,
    now_ns: u64,
}

impl Rig {
    fn new(engage: EngageConfig) -> Self {
        let limiter = Limiter::new(SafetyConfig {
            patience: 2,
            decay: 0.004,
            recovery: 0.008,
            max_speed: 1.0,
            engage,
            ..SafetyConfig::unlimited(1e-3)
        });
        Self {
            clutch: Clutch::before(&limiter),
            limiter,
            frame: DeviceFrame::at(Vec3::zeros()),
            state: DeviceState::resting(),
            now_ns: 0,
        }
    }

    /// One tick, whose reading `alter` changes. Returns the motion of the proxy in steps of the hand.
    fn tick(&mut self, alter: impl Fn(&mut DeviceState)) -> f64 {
        self.now_ns += MS;
        self.limiter.begin(self.now_ns);
        let mut state = DeviceState {
            pose: Pose::at(self.state.pose.position + Vec3::x() * STEP),
            ..DeviceState::resting()
        };
        alter(&mut state);
        self.limiter.hear(state.rendering);
        let before = self.frame.to_scene(&self.state).0.position.x;
        let clutch = &mut self.clutch;
        clutch.follow(&self.limiter, &mut self.frame, &self.state, &state);
        self.state = state;
        self.limiter.pass(&Wrench::zero(), Some(&state));
        (self.frame.to_scene(&self.state).0.position.x - before) / STEP
    }

    fn silence(&mut self) {
        self.now_ns += MS;
        self.limiter.begin(self.now_ns);
        self.limiter.pass(&Wrench::zero(), None);
    }
}

/// A change that takes the whole force of a device away.
type Loss = (&'static str, fn(&mut Rig));

const LOSSES: [Loss; 4] = [
    ("silent", |rig| (0..4).for_each(|_| rig.silence())),
    ("let go", |rig| {
        rig.tick(|state| state.rendering = Rendering::LetGo);
    }),
    ("stopped", |rig| {
        rig.limiter.engage(Engaged::Stopped);
        // The force is gone at the end of the first tick.
        rig.tick(|_| {});
        rig.tick(|_| {});
        rig.limiter.engage(Engaged::Yes);
    }),
    ("stood still", |rig| {
        // The proxy does not follow the motion of the pause either.
        rig.now_ns += 100 * MS;
        assert!(rig.tick(|_| {}).abs() < 1e-11);
    }),
];

#[test]
fn the_proxy_follows_by_the_fraction_of_the_force_until_the_whole_force_is_back() {
    for (loss, lose) in LOSSES {
        let mut rig = Rig::new(EngageConfig::default());
        // Rounding of places of a few steps.
        let near = |found: f64, expected: f64| (found - expected).abs() < 1e-11;
        assert!(near(rig.tick(|_| {}), 1.0) && !rig.clutch.is_open());
        lose(&mut rig);
        let mut fraction = 0.0;
        for k in 0..8 {
            assert!(near(rig.tick(|_| {}), fraction), "{loss} {k}");
            assert!(rig.clutch.is_open(), "{loss} {k}");
            fraction = rig.limiter.fraction();
            assert_eq!(rig.clutch.fraction(&rig.limiter), fraction);
        }
        assert_eq!(fraction, 1.0, "{loss}");
        assert!(near(rig.tick(|_| {}), 1.0) && !rig.clutch.is_open());
        assert_eq!(rig.clutch.fraction(&rig.limiter), 1.0);
    }
}

#[test]
fn the_clutch_stays_closed_while_the_force_of_a_fast_device_fades_and_returns() {
    let mut rig = Rig::new(EngageConfig::default());
    for speed in [2.0, 0.0] {
        for _ in 0..20 {
            let moved = rig.tick(|state| state.twist.linear.y = speed);
            assert!((moved - 1.0).abs() < 1e-12 && !rig.clutch.is_open());
            assert_eq!(rig.clutch.fraction(&rig.limiter), 1.0);
        }
        assert_eq!(rig.limiter.fraction() == 0.0, speed > 1.0);
    }
}

#[test]
fn the_clutch_is_open_from_the_start_where_the_force_has_yet_to_come_in() {
    for (armed, ramp) in [(true, 0.0), (false, 0.0), (true, 0.1)] {
        let rig = Rig::new(EngageConfig {
            armed,
            ramp,
            ..EngageConfig::default()
        });
        let waits = !armed || ramp > 0.0;
        assert_eq!(rig.clutch.is_open(), waits);
        assert!(!Clutch::new().is_open());
    }
}
