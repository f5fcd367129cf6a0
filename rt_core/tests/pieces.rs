//! A torn body in the tick: the account of energy parts with the pieces, weights change without a jump, the force of a
//! hand whose handle is gone fades, and the extrapolation stops where the tear goes on. A whole body renders the same
//! bytes as before bodies could tear.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use rt_core::coupling::{Coupling, CouplingConfig};
use rt_core::{LocalModel, MAX_DEVICES, PassivityConfig, Pose, Scheme, Twist, Vec3, Wrench};

const PERIOD: f64 = 1e-3;
const MS: u64 = 1_000_000;

fn config(scheme: Scheme) -> CouplingConfig {
    CouplingConfig {
        scheme,
        period: PERIOD,
        blend: 0.5,
        age_limit: 0.05,
        decay: 0.1,
        recovery: 0.02,
        hold_damping: [1.0; MAX_DEVICES],
        passivity: PassivityConfig::new(PERIOD),
    }
}

/// A sequence of numbers between minus one and one (xorshift, G. Marsaglia 2003).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self, scale: f64) -> Vec3 {
        Vec3::from_fn(|_, _| scale * self.next())
    }
}

/// Two hands at rest positions 0.2 m apart, moved by `by` (m) with the velocities `v` (m/s).
fn hands(by: [Vec3; 2], v: [Vec3; 2]) -> [(Pose, Twist); 2] {
    [0, 1].map(|i| {
        let twist = Twist {
            linear: v[i],
            ..Twist::zero()
        };
        (Pose::at(place(i) + by[i]), twist)
    })
}

fn place(handle: usize) -> Vec3 {
    Vec3::x() * if handle == 0 { -0.1 } else { 0.1 }
}

/// One tick, after which the devices hold the wrenches. Returns the wrenches by device.
fn held_tick(coupling: &mut Coupling, now: u64, at: &[(Pose, Twist)]) -> [Wrench; MAX_DEVICES] {
    let wrenches = coupling.tick(now, at);
    let mut held = [Wrench::zero(); MAX_DEVICES];
    for (handle, wrench) in coupling.model().handles().zip(&wrenches) {
        held[usize::from(handle.device)] = *wrench;
    }
    coupling.hold(&held, &[1.0; MAX_DEVICES]);
    held
}

/// A hash of all forces and of the account in a run of a whole body with random models and motions (FNV-1a).
fn hash_of_a_whole_body(scheme: Scheme) -> u64 {
    let mut numbers = Numbers(0x9e37_79b9_7f4a_7c15);
    let mut coupling = Coupling::new(config(scheme));
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut by = [Vec3::zeros(); 2];
    for tick in 0..2000_u64 {
        let now = (1 + tick) * MS;
        if tick % 4 == 0 {
            let mut model = LocalModel::empty();
            (model.sequence, model.time_ns) = (tick + 1, now);
            (model.period, model.horizon) = (4e-3, 5e-3);
            model.handle_count = 2;
            model.energy = 1e-3 * (1.0 + numbers.next());
            model.released = 1e-6 * tick as f64;
            let k = 200.0 + 100.0 * numbers.next();
            for (i, sign) in [(0, 1.0), (1, -1.0)] {
                let handle = &mut model.handles[i];
                handle.device = i as u8;
                handle.pose = Pose::at(place(i) + by[i]);
                handle.twist.linear = numbers.vector(0.01);
                handle.weight = Vec3::new(0.0, 0.0, -0.3);
                handle.wrench.force = numbers.vector(0.5) + handle.weight;
                handle.drift.force = numbers.vector(1.0);
                for axis in 0..3 {
                    model.stiffness[i][0][(axis, axis)] = sign * k;
                    model.stiffness[i][1][(axis, axis)] = -sign * k;
                    model.damping[i][i][(axis, axis)] = 0.5;
                }
            }
            coupling.accept(&model).expect("a sound model");
        }
        let steps = [numbers.vector(1e-4), numbers.vector(1e-4)];
        (by[0], by[1]) = (by[0] + steps[0], by[1] + steps[1]);
        let at = hands(by, steps.map(|step| step / PERIOD));
        let wrenches = held_tick(&mut coupling, now, &at);
        let energy = coupling.energy();
        let account = [energy.supplied, energy.raised, energy.least, energy.stored];
        let account = account
            .into_iter()
            .chain([energy.credited, energy.available]);
        let forces = wrenches[..2]
            .iter()
            .flat_map(|w| [w.force.x, w.force.y, w.force.z]);
        for byte in forces.chain(account).flat_map(f64::to_le_bytes) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    hash
}

#[test]
fn a_whole_body_renders_the_bytes_that_it_rendered_before_bodies_could_tear() {
    let expected = [
        (Scheme::Linear, 0x1e7533d53401feb4),
        (Scheme::Classic, 0xa342cccfe89f19e6),
        (Scheme::Capped, 0x11789ac14de0efb2),
    ];
    for (scheme, hash) in expected {
        let found = hash_of_a_whole_body(scheme);
        assert_eq!(found, hash, "{scheme:?}: {found:#018x}");
    }
}
