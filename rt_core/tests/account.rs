//! The account of energy in its particulars: which steps count, what a scaled device makes of work, what a force does
//! that cannot be taken away at once; and the cap where its account would be wrong, felt at the hand.
//!
//! These are tests of behaviour: of the energy that passes at the port and of the force that is felt, not of the cap's
//! formulas.
// The fence of `rt_core/clippy.toml` is around the law, not around its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use nalgebra::UnitQuaternion;
use rt_core::coupling::{Coupling, CouplingConfig};
use rt_core::{
    EnergyAccount, LocalModel, MAX_DEVICES, PassivityConfig, Port, Pose, Scheme, Twist, Vec3,
    Wrench,
};

const PERIOD: f64 = 1e-3;

fn coupling(scheme: Scheme, port: Port) -> Coupling {
    let mut passivity = PassivityConfig::new(PERIOD);
    passivity.ports[0] = port;
    Coupling::new(CouplingConfig {
        scheme,
        period: PERIOD,
        blend: 0.5,
        age_limit: 1e3,
        decay: 0.1,
        recovery: PERIOD,
        hold_damping: 0.0,
        passivity,
    })
}

/// A device that holds one wrench wherever it goes.
struct Held {
    coupling: Coupling,
    wrench: Wrench,
}

impl Held {
    fn new(port: Port, force: Vec3, moment: Vec3) -> Self {
        Self {
            coupling: coupling(Scheme::Linear, port),
            wrench: Wrench { force, moment },
        }
    }

    /// The account after a tick at a pose.
    fn at(&mut self, pose: Pose) -> EnergyAccount {
        self.coupling.tick(1, &[(pose, Twist::zero())]);
        let mut held = [Wrench::zero(); MAX_DEVICES];
        held[0] = self.wrench;
        self.coupling.hold(&held, &[1.0; MAX_DEVICES]);
        *self.coupling.energy()
    }
}

fn along(x: f64) -> Pose {
    Pose::at(Vec3::x() * x)
}

fn turned(angle: f64) -> Pose {
    Pose {
        rotation: UnitQuaternion::from_scaled_axis(Vec3::z() * angle),
        ..Pose::identity()
    }
}

#[test]
fn a_step_that_no_hand_can_make_is_no_work() {
    let port = Port {
        damping: 1.0,
        friction: 1.0,
        turning_damping: 1.0,
        turning_friction: 1.0,
        ..Port::UNKNOWN
    };
    // By 10 mm in a tick a hand may have moved its device, though it is quick: work is done on the way.
    let mut held = Held::new(port, Vec3::x(), Vec3::z());
    held.at(along(0.0));
    let before = held.at(along(0.01));
    assert!((before.supplied + 0.01).abs() < 1e-15, "{before:?}");
    // By 0.1 m and more it has not, nor by what is no number: nothing was given, taken or dissipated.
    for far in [0.12, -5.0, 1e300, f64::NAN, f64::INFINITY] {
        held.at(along(0.01));
        assert_eq!(held.at(along(far)), before, "{far} m in a tick");
        assert_eq!(held.at(along(0.01)), before, "and back from {far} m");
    }
    // The same of turning: 0.1 rad in a tick, and 1 rad.
    let mut held = Held::new(port, Vec3::x(), Vec3::z());
    held.at(turned(0.0));
    let before = held.at(turned(0.1));
    // Rounding of the rotation's logarithm.
    assert!((before.supplied + 0.1).abs() < 1e-12, "{before:?}");
    for far in [1.1, -3.0] {
        assert_eq!(held.at(turned(far)), before, "{far} rad in a tick");
        assert_eq!(held.at(turned(0.1)), before, "and back from {far} rad");
    }
}

#[test]
fn a_scaled_device_does_its_scale_of_work() {
    let work = |scale: f64| {
        let port = Port {
            force_scale: scale,
            ..Port::UNKNOWN
        };
        let mut held = Held::new(port, Vec3::x() * 2.0, Vec3::zeros());
        held.at(along(0.0));
        held.at(along(0.01)).supplied
    };
    // 2 N over 10 mm, on a device that renders a third or five times as much.
    for scale in [1.0 / 3.0, 1.0, 5.0] {
        let expected = -2.0 * 0.01 * scale;
        assert!((work(scale) - expected).abs() < 1e-15, "{scale}");
    }
}

#[test]
fn a_scaled_device_raises_its_scale_of_weight() {
    let weight = 2.0;
    for scale in [1.0 / 3.0, 1.0, 5.0] {
        let port = Port {
            force_scale: scale,
            ..Port::UNKNOWN
        };
        let mut coupling = coupling(Scheme::Linear, port);
        let mut model = LocalModel::empty();
        model.sequence = 1;
        model.time_ns = 1;
        model.period = PERIOD;
        model.handle_count = 1;
        model.handles[0].wrench.force.z = -weight;
        model.handles[0].weight.z = -weight;
        coupling.accept(&model).expect("a sound model");
        // `passed`: the share of the weight that the device was in the end told to hold.
        let mut at = |height: f64, passed: f64| {
            let hand = [(Pose::at(Vec3::z() * height), Twist::zero())];
            let [wrench, ..] = coupling.tick(2, &hand);
            let mut held = [Wrench::zero(); MAX_DEVICES];
            held[0] = wrench.scaled(passed);
            coupling.hold(&held, &[passed; MAX_DEVICES]);
            *coupling.energy()
        };
        for _ in 0..10 {
            at(0.0, 1.0);
        }
        // Lifted by 10 mm: all that the hands gave has been raised.
        let lifted = at(0.01, 1.0);
        let expected = scale * weight * 0.01;
        assert!(
            (lifted.raised - expected).abs() < 1e-15,
            "{scale} {lifted:?}"
        );
        assert!(
            (lifted.supplied - expected).abs() < 1e-15,
            "{scale} {lifted:?}"
        );
        // Taken away up there, nothing is raised any more; back again, it is, and somebody has to pay.
        let away = at(0.01, 0.0);
        assert!(away.raised.abs() < 1e-15, "{scale} {away:?}");
        let back = at(0.01, 1.0);
        assert!((back.raised - expected).abs() < 1e-15, "{scale} {back:?}");
        let paid = away.available - back.available;
        assert!((paid - expected).abs() < 1e-15, "{scale} {paid}");
    }
}
