//! A torn body in the tick. The account of energy parts with the pieces, weights change without a jump, the force of a
//! hand whose handle is gone fades, and the extrapolation stops at the load at which the tear grows. A whole body
//! renders fixed bytes, which the code for tears must not change.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use proptest::prelude::*;
use rt_core::coupling::{Coupling, CouplingConfig, Passed};
use rt_core::local_model::{Lead, ModelFault};
use rt_core::{
    LocalModel, MAX_DEVICES, MAX_HANDLES, PassivityConfig, PieceEnergy, Pose, Scheme, TearLimit,
    Twist, Vec3, Vec6, Wrench,
};

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
    coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
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
            (model.head.sequence, model.head.time_ns) = (tick + 1, now);
            (model.head.period, model.head.horizon) = (4e-3, 5e-3);
            model.head.handle_count = 2;
            model.head.energy = 1e-3 * (1.0 + numbers.next());
            model.head.released = 1e-6 * tick as f64;
            if tick == 0 {
                // Such a body begins with no energy of its own, as its first model says.
                model.head.energy = 0.0;
            }
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
    let schemes = [Scheme::Linear, Scheme::Classic, Scheme::Capped];
    let expected = [
        0xc7a5_cfd4_c0b5_475b,
        0xead7_5c33_fe85_568f,
        0x1fdf_5548_8a12_f9ce,
    ];
    let found = schemes.map(hash_of_a_whole_body);
    assert_eq!(found, expected, "{found:#018x?}");
}

/// A body in two hands that pulls them together with `pull` (N), and stores `energy` (J).
fn stretched(sequence: u64, now: u64, pull: f64, energy: f64) -> LocalModel {
    let mut model = LocalModel::empty();
    (model.head.sequence, model.head.time_ns) = (sequence, now);
    (model.head.period, model.head.horizon) = (4e-3, 5e-3);
    model.head.handle_count = 2;
    model.head.energy = energy;
    model.head.released = energy;
    for i in 0..2 {
        let handle = &mut model.handles[i];
        handle.device = i as u8;
        handle.pose = Pose::at(place(i));
        handle.wrench.force = -place(i).normalize() * pull;
    }
    model
}

/// The body after it has parted into a piece for each hand, which store `energies` (J).
fn parted(mut model: LocalModel, energies: [f64; 2]) -> LocalModel {
    model.head.epoch = 1;
    model.head.energy = energies[0] + energies[1];
    for (i, stored) in energies.into_iter().enumerate() {
        model.handles[i].piece = i as u8;
        model.head.pieces[i] = PieceEnergy {
            stored,
            released: 0.0,
        };
    }
    model
}

/// A coupling whose force has come in full, at rest, and the time of its next tick (ns).
fn settled(scheme: Scheme, model: &LocalModel) -> (Coupling, u64) {
    let mut coupling = Coupling::new(config(scheme));
    let mut model = *model;
    let mut now = 0;
    for tick in 0..40 {
        now = (1 + tick) * MS;
        if tick % 4 == 0 {
            (model.head.sequence, model.head.time_ns) = (tick + 1, now);
            coupling.accept(&model).expect("a sound model");
        }
        held_tick(&mut coupling, now, &at_rest());
    }
    (coupling, now + MS)
}

fn at_rest() -> [(Pose, Twist); 2] {
    hands([Vec3::zeros(); 2], [Vec3::zeros(); 2])
}

#[test]
fn the_credits_of_the_pieces_add_up_to_that_of_the_body() {
    for energies in [[3e-3, 1e-3], [1e-3, 0.0], [0.0, 0.0]] {
        let whole = stretched(1, 0, 0.5, 5e-3);
        let (mut coupling, now) = settled(Scheme::Capped, &whole);
        let before = coupling.energy().available;
        let mut model = parted(whole, energies);
        model.head.time_ns = now;
        coupling.accept(&model).expect("a sound model");
        held_tick(&mut coupling, now, &at_rest());
        let after = coupling.energy().available;
        // Rounding of sums. The credit is no more than twice the energy and the allowance, so none is forgotten before
        // the parting; in the tick of the parting the blended energy backs it still.
        assert!(
            (after - before).abs() < 1e-15,
            "{before} {after} {energies:?}"
        );
        assert_eq!(coupling.model().piece_count(), 2);
    }
}

#[test]
fn a_piece_gives_back_no_energy_that_the_tear_has_taken() {
    let whole = stretched(1, 0, 2.0, 5e-3);
    let (mut coupling, mut now) = settled(Scheme::Capped, &whole);
    let mut by = [Vec3::zeros(); 2];
    let (mut given, mut supplied) = ([0.0; 2], 0.0);
    let (mut stored, mut held) = (0.0, [Wrench::zero(); MAX_DEVICES]);
    for tick in 0..400_u64 {
        // The hands pull the body apart for 0.2 s, and come back.
        let parts = tick >= 200;
        let speed = if parts { -0.1 } else { 0.1 };
        let v = [0, 1].map(|i| place(i).normalize() * speed);
        for i in 0..2 {
            let step = v[i] * PERIOD;
            by[i] += step;
            given[i] += held[i].force.dot(&step);
            supplied -= held[i].force.dot(&step);
        }
        if tick % 4 == 0 {
            // The force does not grow, as in a running tear: the models store 5 mJ throughout, while the hands supply 80.
            let mut model = if parts {
                parted(whole, [3e-3, 2e-3])
            } else {
                whole
            };
            for i in 0..2 {
                model.handles[i].pose.position += by[i];
            }
            (model.head.sequence, model.head.time_ns) = (100 + tick, now);
            coupling.accept(&model).expect("a sound model");
        }
        held = held_tick(&mut coupling, now, &hands(by, v));
        if tick == 200 {
            assert!(supplied > 75e-3, "{supplied}");
            stored = coupling.energy().stored;
            assert!((stored - 5e-3).abs() < 1e-3, "{stored}");
            given = [0.0; 2];
        }
        now += MS;
        if parts {
            for (given, share) in given.iter().zip([0.6, 0.4]) {
                // The allowance; there are no dampers.
                assert!(*given <= stored * share + 0.4e-3 + 1e-9, "{tick}: {given}");
            }
        }
    }
    // If the pieces gave nothing back, this test would show nothing.
    assert!(given.iter().sum::<f64>() > 1e-3, "{given:?}");
}

#[test]
fn other_pieces_in_the_same_epoch_are_refused() {
    let whole = stretched(1, 0, 0.5, 5e-3);
    let (mut coupling, now) = settled(Scheme::Capped, &whole);
    let mut model = parted(whole, [1e-3; 2]);
    (model.head.epoch, model.head.time_ns) = (0, now);
    assert_eq!(coupling.accept(&model), Err(ModelFault::Handles));
    // The number of a piece is below the number of handles.
    (model.head.epoch, model.handles[1].piece) = (1, 2);
    assert_eq!(coupling.accept(&model), Err(ModelFault::Handles));
    // The energies of pieces are numbers, but only if there are pieces.
    model.handles[1].piece = 1;
    model.head.pieces[1].stored = f64::NAN;
    assert_eq!(coupling.accept(&model), Err(ModelFault::NotFinite));
    (model.handles[1].piece, model.head.tear_limit.root) = (0, 0.0);
    assert_eq!(coupling.accept(&model), Ok(()));
}

#[test]
fn the_force_of_a_hand_on_a_piece_that_is_dropped_fades() {
    for scheme in [Scheme::Hold, Scheme::Linear, Scheme::Capped] {
        let whole = stretched(1, 0, 0.5, 5e-3);
        let (mut coupling, mut now) = settled(scheme, &whole);
        let mut model = parted(whole, [2e-3, 3e-3]);
        let mut last = 0.5;
        for tick in 0..140_u64 {
            if tick % 4 == 0 {
                if tick == 8 {
                    // The piece of the second hand is gone.
                    (model.head.epoch, model.head.handle_count) = (2, 1);
                }
                (model.head.sequence, model.head.time_ns) = (100 + tick, now);
                coupling.accept(&model).expect("a sound model");
            }
            let [left, right, ..] = held_tick(&mut coupling, now, &at_rest());
            now += MS;
            let (left, right) = (left.force.x, -right.force.x);
            // Rounding of blends.
            assert!((left - 0.5).abs() < 1e-12, "{scheme:?} {tick} {left}");
            // A smooth step of a hundred ticks is at most one and a half times as steep as a line.
            let most = if tick > 8 { 1.5 * 0.5 / 100.0 } else { 0.0 };
            assert!(
                (last - right).abs() <= most + 1e-12,
                "{scheme:?} {tick} {right}"
            );
            assert!(right <= last + 1e-12, "{scheme:?} {tick} {right}");
            last = right;
        }
        assert_eq!(last, 0.0, "{scheme:?}");
        assert_eq!(coupling.model().handles().count(), 1);
        assert_eq!(coupling.model().piece_count(), 1);
    }
}

#[test]
fn a_weight_that_is_found_anew_does_not_make_the_force_jump() {
    for scheme in [Scheme::Linear, Scheme::Capped] {
        let mut whole = stretched(1, 0, 0.5, 5e-3);
        for handle in &mut whole.handles[..2] {
            handle.weight.z = -0.4;
            handle.wrench.force.z = -0.4;
        }
        let (mut coupling, mut now) = settled(scheme, &whole);
        // The second piece is the heavier one, and the models claim more energy than the hands have supplied: the cap
        // withholds a part of the springs, but none of the weight.
        let mut model = parted(whole, [50e-3, 50e-3]);
        for (handle, weight) in model.handles[..2].iter_mut().zip([-0.1, -0.7]) {
            handle.weight.z = weight;
            handle.wrench.force.z = weight;
        }
        let mut last = [-0.4, -0.4];
        for tick in 0..40_u64 {
            if tick % 4 == 0 {
                (model.head.sequence, model.head.time_ns) = (100 + tick, now);
                coupling.accept(&model).expect("a sound model");
            }
            let wrenches = held_tick(&mut coupling, now, &at_rest());
            now += MS;
            for (last, wrench) in last.iter_mut().zip(&wrenches) {
                let force = wrench.force.z;
                // The blend takes two ticks.
                assert!(
                    (force - *last).abs() <= 0.15 + 1e-12,
                    "{scheme:?} {tick} {force}"
                );
                assert!(
                    tick > 0 || (force + 0.4).abs() < 1e-12,
                    "{scheme:?} {force}"
                );
                *last = force;
            }
        }
        assert!(
            (last[0] + 0.1).abs() < 1e-12 && (last[1] + 0.7).abs() < 1e-12,
            "{last:?}"
        );
        let capped = coupling.energy().capped > 0;
        assert_eq!(capped, scheme == Scheme::Capped);
    }
}

/// A body in three hands that pulls each with 0.5 N along x and weighs 1 N on each. The hands are 0.1 m apart.
fn carried() -> LocalModel {
    let mut model = stretched(1, 0, 0.5, 5e-3);
    model.head.handle_count = 3;
    for (i, handle) in model.handles[..3].iter_mut().enumerate() {
        handle.device = i as u8;
        handle.pose = Pose::at(Vec3::x() * 0.1 * i as f64);
        handle.wrench.force = Vec3::new(0.5, 0.0, -1.0);
        handle.weight = -Vec3::z();
    }
    model
}

#[test]
fn a_piece_owes_the_work_that_all_of_its_hands_were_spared_and_no_other_hand() {
    // The first two hands or the last two lift their handles while no device holds the weight. Then the devices hold it
    // again: the hands were spared 10 and 20 mJ.
    for (lifted, owes) in [([0.01, 0.02, 0.0], 0), ([0.0, 0.02, 0.01], 1)] {
        let mut coupling = Coupling::new(CouplingConfig {
            age_limit: 1e3,
            ..config(Scheme::Capped)
        });
        let mut now = 0;
        let mut tick = |coupling: &mut Coupling, heights: [f64; 3], passed: f64| {
            now += MS;
            let at = [0, 1, 2].map(|i| {
                let place = Vec3::new(0.1 * i as f64, 0.0, heights[i]);
                (Pose::at(place), Twist::zero())
            });
            let wrenches = coupling.tick(now, &at);
            let mut held = [Wrench::zero(); MAX_DEVICES];
            for (held, wrench) in held.iter_mut().zip(&wrenches).take(3) {
                *held = wrench.scaled(passed);
            }
            let passed = Passed {
                rendered: passed,
                ..Passed::WHOLE
            };
            coupling.hold(&held, &[passed; MAX_DEVICES]);
            [0, 1, 2].map(|i| wrenches[i].force.x)
        };
        coupling.accept(&carried()).expect("a sound model");
        for _ in 0..40 {
            tick(&mut coupling, [0.0; 3], 1.0);
        }
        let own = coupling.energy().available;
        tick(&mut coupling, [0.0; 3], 0.0);
        tick(&mut coupling, lifted, 0.0);
        tick(&mut coupling, lifted, 1.0);
        let before = coupling.energy().available;
        // Rounding of sums, here and below.
        assert!((own - before - 0.03).abs() < 1e-15, "{own} {before}");
        // The body parts between the two hands that lifted and the third.
        let mut model = carried();
        (model.head.epoch, model.head.time_ns) = (1, 1);
        for (i, handle) in model.handles[..3].iter_mut().enumerate() {
            handle.piece = u8::from(i == if owes == 0 { 2 } else { 0 });
            handle.pose.position.z = lifted[i];
        }
        for piece in &mut model.head.pieces[..2] {
            piece.stored = 2.5e-3;
        }
        coupling.accept(&model).expect("a sound model");
        tick(&mut coupling, lifted, 1.0);
        let after = coupling.energy().available;
        assert!((after - before).abs() < 1e-15, "{before} {after}");
        // Once the quick lift is forgotten, the third hand feels its spring in full, and the others feel none.
        for _ in 0..200 {
            tick(&mut coupling, lifted, 1.0);
        }
        let forces = tick(&mut coupling, lifted, 1.0);
        // The energy that hands owe is no credit, so the cap had nothing to forget.
        let later = coupling.energy().available;
        assert!((later - before).abs() < 1e-15, "{before} {later}");
        let free = if owes == 0 { 2 } else { 0 };
        for (i, force) in forces.into_iter().enumerate() {
            let whole = if i == free { 0.5 } else { 0.0 };
            assert!((force - whole).abs() < 1e-12, "{owes} {forces:?}");
        }
    }
}

/// A coupling of three hands at rest, which hold the rendered wrenches, and the time of its last tick (ns).
struct Rest {
    coupling: Coupling,
    now: u64,
}

impl Rest {
    fn new() -> Self {
        Self {
            coupling: Coupling::new(CouplingConfig {
                age_limit: 1e3,
                ..config(Scheme::Capped)
            }),
            now: 0,
        }
    }

    /// Takes a model with these pieces of the hands and energies of the pieces, and ticks. Returns the forces along x.
    fn take(
        &mut self,
        mut model: LocalModel,
        pieces: &[u8],
        energies: &[f64],
        ticks: u64,
    ) -> [f64; MAX_DEVICES] {
        self.now += MS;
        (model.head.sequence, model.head.time_ns) = (self.now, self.now);
        (model.head.epoch, model.head.handle_count) = ((self.now / MS) as u32, pieces.len() as u8);
        model.head.energy = energies.iter().sum();
        model.head.released = model.head.energy;
        for (handle, piece) in model.handles.iter_mut().zip(pieces) {
            handle.piece = *piece;
        }
        for (piece, energy) in model.head.pieces.iter_mut().zip(energies) {
            piece.stored = *energy;
        }
        self.coupling.accept(&model).expect("a sound model");
        let at = [0, 1, 2].map(|i| (Pose::at(Vec3::x() * 0.1 * f64::from(i)), Twist::zero()));
        let mut held = [Wrench::zero(); MAX_DEVICES];
        for _ in 0..ticks {
            self.now += MS;
            held = held_tick(&mut self.coupling, self.now, &at);
        }
        held.map(|wrench| wrench.force.x)
    }
}

#[test]
fn an_account_follows_its_hands_whatever_number_their_piece_has() {
    let mut body = Rest::new();
    // The first piece claims eight times the energy that its hands have supplied: they feel less than half of its force.
    body.take(carried(), &[0, 1, 1], &[2e-3, 2e-3], 40);
    let pull = |forces: [f64; MAX_DEVICES]| [forces[0], forces[1], forces[2]];
    let before = pull(body.take(carried(), &[0, 1, 1], &[16e-3, 2e-3], 40));
    let available = body.coupling.energy().available;
    assert!(before[0] < 0.25 && before[1..] == [0.5, 0.5], "{before:?}");
    let withheld = body.coupling.withheld();
    assert!((withheld.force + before[0] - 0.5).abs() < 1e-12);
    // The pieces get other numbers.
    let after = pull(body.take(carried(), &[1, 0, 0], &[2e-3, 16e-3], 40));
    for (before, after) in before.iter().zip(&after) {
        assert!((before - after).abs() < 1e-12, "{after:?}");
    }
    assert!((body.coupling.energy().available - available).abs() < 1e-15);
    assert!((body.coupling.withheld().force - withheld.force).abs() < 1e-12);
}

#[test]
fn the_largest_withheld_force_of_all_pieces_is_told() {
    // The second hand is on a piece of its own. Both pieces claim more than was supplied, one of them more than the other.
    for claims in [[9e-3, 12e-3], [12e-3, 9e-3]] {
        let mut body = Rest::new();
        body.take(carried(), &[0, 1], &[2e-3; 2], 40);
        let forces = body.take(carried(), &[0, 1], &claims, 40);
        let most = forces[0].min(forces[1]);
        assert!(forces[0] < 0.5 && forces[1] < 0.5, "{forces:?}");
        let withheld = body.coupling.withheld();
        assert_eq!(withheld.of, 0.5);
        assert!((withheld.force - (0.5 - most)).abs() < 1e-12, "{forces:?}");
    }
}

#[test]
fn a_piece_keeps_its_credit_while_another_parts() {
    let mut body = Rest::new();
    body.take(carried(), &[0, 1, 1], &[5e-3, 4e-3], 40);
    // The first piece stores less than its hands have supplied, as a body that gives way. Not all of its credit is
    // forgotten: twice the energy may be kept.
    body.take(carried(), &[0, 1, 1], &[3e-3, 4e-3], 40);
    let before = body.coupling.energy().available;
    assert!(before > 9e-3, "{before}");
    body.take(carried(), &[0, 1, 2], &[3e-3, 1e-3, 3e-3], 1);
    let after = body.coupling.energy().available;
    assert!((after - before).abs() < 1e-15, "{before} {after}");
}

#[test]
fn what_a_hand_without_force_was_spared_stays_with_the_larger_part_of_its_piece() {
    for (energies, larger) in [([1e-3, 4e-3], 1), ([4e-3, 1e-3], 0)] {
        let mut body = Rest::new();
        // The spring carries the weight of the third hand, so that hand has no force.
        let mut model = carried();
        model.handles[2].wrench.force = Vec3::zeros();
        body.take(model, &[0, 0, 0], &[5e-3], 40);
        let own = body.coupling.energy().available;
        // The device of the third hand drops the weight, is lifted by 10 mm, and then holds the weight again.
        for (height, passed) in [(0.0, 0.0), (0.01, 0.0), (0.01, 1.0)] {
            body.now += MS;
            let at = [0, 1, 2].map(|i| {
                let up = if i == 2 { height } else { 0.0 };
                let place = Vec3::new(0.1 * f64::from(i), 0.0, up);
                (Pose::at(place), Twist::zero())
            });
            let wrenches = body.coupling.tick(body.now, &at);
            let mut held = [Wrench::zero(); MAX_DEVICES];
            (held[0], held[1], held[2]) = (wrenches[0], wrenches[1], wrenches[2]);
            let mut all = [Passed::WHOLE; MAX_DEVICES];
            all[2].rendered = passed;
            body.coupling.hold(&held, &all);
        }
        let available = body.coupling.energy().available;
        // The lifted spring stores nothing for some ticks, in which a little credit is forgotten.
        assert!((own - available - 0.01).abs() < 2e-5, "{own} {available}");
        // The third hand lets go as the body parts between the other two.
        let forces = body.take(carried(), &[0, 1], &energies, 200);
        assert_eq!(body.coupling.model().handles().count(), 2);
        for (i, force) in forces[..2].iter().enumerate() {
            let wanted = if i == larger { 0.0 } else { 0.5 };
            assert!((force - wanted).abs() < 1e-12, "{energies:?} {forces:?}");
        }
    }
}

#[test]
fn a_hand_whose_piece_is_gone_pays_into_the_account_of_the_body_that_it_takes_hold_of_again() {
    let whole = stretched(1, 0, 0.5, 5e-3);
    let (mut coupling, mut now) = settled(Scheme::Capped, &whole);
    // The body parts, the piece of the second hand is dropped, and later both hands hold a whole body.
    let torn = parted(whole, [2e-3, 3e-3]);
    let (mut alone, mut again) = (torn, whole);
    (alone.head.epoch, alone.head.handle_count) = (2, 1);
    again.head.epoch = 3;
    let mut available = [0.0; 3];
    let phases = [(&torn, 42), (&alone, 140), (&again, 42)];
    for ((model, ticks), available) in phases.into_iter().zip(&mut available) {
        for tick in 0..ticks {
            // No model comes in the tick after the fade.
            if tick % 7 == 0 {
                let mut model = *model;
                (model.head.sequence, model.head.time_ns) = (now, now);
                coupling.accept(&model).expect("a sound model");
            }
            held_tick(&mut coupling, now, &at_rest());
            now += MS;
        }
        *available = coupling.energy().available;
    }
    // The credit of the second piece is gone with it: three fifths.
    assert!((available[1] - 0.4 * available[0]).abs() < 1e-15);
    assert_eq!(coupling.model().handles().count(), 2);
    // The second hand pulls its handle by a millimetre against half a newton.
    let before = *coupling.energy();
    let out = hands([Vec3::zeros(), Vec3::x() * 1e-3], [Vec3::zeros(); 2]);
    held_tick(&mut coupling, now, &out);
    let after = coupling.energy();
    let supplied = after.supplied - before.supplied;
    // Rounding of sums.
    assert!((supplied - 0.5e-3).abs() < 1e-15, "{supplied}");
    let paid = after.available - before.available;
    assert!((paid - supplied).abs() < 1e-15, "{paid}");
}

#[test]
fn a_piece_is_credited_what_it_released_as_far_as_its_hands_got_it() {
    let whole = stretched(1, 0, 0.5, 5e-3);
    let (mut coupling, mut now) = settled(Scheme::Capped, &whole);
    let mut x = -0.1;
    // The credit gained by a model that states these released energies after the first hand went `along` with its force.
    let mut gained = |coupling: &mut Coupling, along: f64, released: [f64; 2]| {
        let tick = |coupling: &mut Coupling, now: &mut u64, x: f64| {
            *now += MS;
            let [_, other] = at_rest();
            held_tick(
                coupling,
                *now,
                &[(Pose::at(Vec3::x() * x), Twist::zero()), other],
            );
            coupling.energy().available
        };
        tick(coupling, &mut now, x);
        x += along;
        let before = tick(coupling, &mut now, x);
        let mut model = parted(whole, [2.5e-3; 2]);
        (model.head.sequence, model.head.time_ns) = (now, now);
        for (piece, released) in model.head.pieces.iter_mut().zip(released) {
            piece.released = released;
        }
        coupling.accept(&model).expect("a sound model");
        // The account counts the credit of a model from the next tick on.
        tick(coupling, &mut now, x);
        tick(coupling, &mut now, x) - before
    };
    // The sums begin at the values that the first model after the parting states.
    for (along, released, expected) in [
        (0.0, [7.0, 9.0], 0.0),
        (1e-4, [7.0, 9.0], 0.0),
        // The hand got 0.1 mJ: 0.05 mJ before the last model, and 0.05 since then.
        (1e-4, [7.00003, 9.0], 0.03e-3),
        (1e-4, [8.0, 9.0], 0.05e-3),
        // The other piece released much, but its hand got nothing.
        (1e-4, [8.0, 10.0], 0.0),
        // Nothing was released since.
        (1e-4, [8.0, 10.0], 0.0),
        (0.0, [9.0, 11.0], 0.0),
        // A sum that falls is no release, nor is its return.
        (1e-4, [1.0, 11.0], 0.0),
        (1e-4, [9.0, 11.0], 0.0),
        (1e-4, [9.5, 11.0], 0.05e-3),
    ] {
        let found = gained(&mut coupling, along, released);
        // Rounding of released sums of some joules.
        assert!((found - expected).abs() < 1e-14, "{released:?} {found}");
    }
}

/// Any model of one handle, with an own energy of a joule.
fn any_piece(numbers: &mut Numbers, device: usize, by: Vec3) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.handle_count = 1;
    (model.head.period, model.head.horizon, model.head.energy) = (8e-3, 9e-3, 1.0);
    model.head.released = 1.0;
    let factor = nalgebra::Matrix6::from_fn(|_, _| 8.0 * numbers.next());
    model.stiffness[0][0] = factor * factor.transpose();
    let handle = &mut model.handles[0];
    handle.device = device as u8;
    handle.pose = Pose::at(place(device) + by + numbers.vector(1e-3));
    handle.weight = numbers.vector(1.0);
    handle.wrench.force = numbers.vector(2.0) + handle.weight;
    handle.drift.force = numbers.vector(50.0);
    handle.drift.moment = numbers.vector(1.0);
    if numbers.next() > 0.0 {
        handle.contact = numbers.vector(1.0).normalize();
    }
    model
}

#[test]
fn each_piece_of_a_torn_body_is_rendered_and_stores_what_it_would_as_a_body_alone() {
    for scheme in [Scheme::Linear, Scheme::Capped] {
        for seed in 1..=20 {
            let mut numbers = Numbers(seed * 0x9e37_79b9);
            let config = CouplingConfig {
                recovery: PERIOD,
                ..config(scheme)
            };
            let mut torn = Coupling::new(config);
            let mut alone = [0, 1].map(|_| Coupling::new(config));
            let mut by = [Vec3::zeros(); 2];
            // Models come after blends and during them.
            let every = if seed % 2 == 0 { 3 } else { 7 };
            for tick in 1..80_u64 {
                let now = tick * MS;
                if tick % every == 1 {
                    let mut pieces = [0, 1].map(|i| any_piece(&mut numbers, i, by[i]));
                    let mut both = pieces[0];
                    both.head.handle_count = 2;
                    both.head.energy = 2.0;
                    both.head.released = 2.0;
                    both.handles[1] = pieces[1].handles[0];
                    both.handles[1].piece = 1;
                    both.stiffness[1][1] = pieces[1].stiffness[0][0];
                    for piece in &mut both.head.pieces[..2] {
                        piece.stored = 1.0;
                    }
                    // The tear grows at the tip of one of the pieces.
                    let tip = usize::from(numbers.next() > 0.0);
                    let limit = TearLimit {
                        root: 1.0,
                        critical: 1.1,
                        area: 1e-4,
                    };
                    let slope = Vec6::from_fn(|_, _| 300.0 * numbers.next());
                    for (model, handle) in [(&mut both, tip), (&mut pieces[tip], 0)] {
                        model.head.tear_limit = limit;
                        model.handles[handle].tear_slope = slope;
                    }
                    both.head.time_ns = now;
                    torn.accept(&both).expect("a sound model");
                    for (coupling, mut model) in alone.iter_mut().zip(pieces) {
                        model.head.time_ns = now;
                        coupling.accept(&model).expect("a sound model");
                    }
                }
                for by in &mut by {
                    *by += numbers.vector(2e-4);
                }
                let at = hands(by, [Vec3::zeros(); 2]);
                let found = held_tick(&mut torn, now, &at);
                let wanted = [0, 1].map(|i| held_tick(&mut alone[i], now, &at)[i]);
                for i in 0..2 {
                    let off = (found[i].stacked() - wanted[i].stacked()).amax();
                    // Rounding of some newtons.
                    assert!(off < 1e-11, "{scheme:?} {seed} {tick} {i}: {off}");
                }
                if scheme == Scheme::Capped {
                    let stored: f64 = alone.iter().map(|alone| alone.energy().stored).sum();
                    let off = (torn.energy().stored - stored).abs();
                    assert!(off < 1e-12, "{seed} {tick}: {off}");
                }
            }
            assert_eq!(torn.energy().capped, 0);
        }
    }
}

#[test]
fn a_weight_that_stays_keeps_its_bytes_through_every_blend() {
    for (weight, period) in [(0.7, 6e-3), (0.1, 14e-3), (1.9, 10e-3)] {
        let mut whole = stretched(1, 0, 0.0, 5e-3);
        whole.head.period = period;
        for handle in &mut whole.handles[..2] {
            handle.weight.z = -weight;
            handle.wrench.force.z = -weight;
        }
        let (mut coupling, now) = settled(Scheme::Capped, &whole);
        (whole.head.sequence, whole.head.time_ns) = (100, now);
        coupling.accept(&whole).expect("a sound model");
        let lifted = 1.0 / 128.0;
        for tick in 0..10 {
            held_tick(&mut coupling, now + tick * MS, &at_rest());
            // A hand that lifts the weight now, by a power of two, raises exactly as much.
            let mut coupling = coupling.clone();
            let up = [Vec3::z() * lifted, Vec3::zeros()];
            let up = hands(up, [Vec3::zeros(); 2]);
            held_tick(&mut coupling, now + (tick + 1) * MS, &up);
            assert_eq!(coupling.energy().raised, weight * lifted, "{tick}");
        }
    }
}

#[test]
fn a_hand_keeps_the_account_of_its_piece_when_the_other_piece_is_gone() {
    for stays in [0, 1] {
        let mut body = Rest::new();
        // The hand on the poorer piece has no force, and lets go.
        let mut model = carried();
        model.handles[1 - stays].wrench.force = Vec3::zeros();
        model.handles[1 - stays].weight = Vec3::zeros();
        let mut energies = [1e-3; 2];
        energies[stays] = 8e-3;
        body.take(model, &[0, 1], &energies, 40);
        let before = body.coupling.energy().available;
        let mut alone = carried();
        alone.handles[0] = alone.handles[stays];
        let forces = body.take(alone, &[0], &[8e-3], 40);
        let after = body.coupling.energy().available;
        assert!(
            (after - before * 8.0 / 9.0).abs() < 1e-15,
            "{before} {after}"
        );
        assert!((forces[stays] - 0.5).abs() < 1e-12, "{forces:?}");
        assert_eq!(body.coupling.energy().capped, 0);
    }
}

/// Any model of the two pieces: wrong forces, stiffness, energies and limits.
fn wrong(numbers: &mut Numbers, mut model: LocalModel, by: [Vec3; 2]) -> LocalModel {
    let energies = [5e-3 * (1.0 + numbers.next()), 5e-3 * (1.0 + numbers.next())];
    model = parted(model, energies);
    model.head.tear_limit = TearLimit {
        root: 2.0 + numbers.next(),
        critical: 2.0 + numbers.next(),
        area: 1e-3 * (1.0 + numbers.next()),
    };
    for i in 0..2 {
        let handle = &mut model.handles[i];
        handle.pose = Pose::at(place(i) + by[i] + numbers.vector(1e-3));
        handle.wrench.force = numbers.vector(2.0);
        handle.drift.force = numbers.vector(20.0);
        handle.tear_slope = Vec6::from_fn(|r, _| if r < 3 { 300.0 * numbers.next() } else { 0.0 });
        for j in 0..2 {
            for axis in 0..3 {
                model.stiffness[i][j][(axis, axis)] = 500.0 * numbers.next();
                model.damping[i][j][(axis, axis)] = numbers.next();
            }
        }
    }
    model
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// For any claims of the models, the hand on a piece gets no more than the energy that it has supplied, the share
    /// of its piece, and the allowance by which dampers go into debt.
    #[test]
    fn the_hands_of_a_piece_get_no_more_than_they_supplied_and_the_share_of_the_piece(
        seed in 1..u64::MAX, part in 0.0..1.0, swing in 1..60_u64,
    ) {
        let mut numbers = Numbers(seed);
        let whole = stretched(1, 0, 0.5, 5e-3);
        let (mut coupling, start) = settled(Scheme::Capped, &whole);
        let mut by = [Vec3::zeros(); 2];
        let mut held = [Wrench::zero(); MAX_DEVICES];
        let mut directions = [Vec3::x(), Vec3::y()];
        let mut given = [0.0; 2];
        let mut shares = [0.0_f64; 2];
        for tick in 0..600_u64 {
            let now = start + tick * MS;
            // Both hands move at 0.1 m/s from before the parting on, so their reach is known.
            if tick % swing == 0 {
                directions = [0, 1].map(|_| numbers.vector(1.0).normalize());
            }
            for i in 0..2 {
                let step = directions[i] * 1e-4;
                by[i] += step;
                given[i] += held[i].force.dot(&step);
            }
            if tick % 4 == 0 {
                let mut model = match tick {
                    ..8 => whole,
                    8 => parted(whole, [5e-3 * part, 5e-3 * (1.0 - part)]),
                    _ => wrong(&mut numbers, whole, by),
                };
                (model.head.sequence, model.head.time_ns) = (100 + tick, now);
                coupling.accept(&model).expect("a sound model");
            }
            let at = hands(by, directions.map(|direction| direction * 0.1));
            held = held_tick(&mut coupling, now, &at);
            if tick == 8 {
                // The account before the wrenches of this tick do work.
                let available = coupling.energy().available;
                shares = [available * part, available * (1.0 - part)];
                given = [0.0; 2];
            }
            for i in 0..2 {
                // Rounding of sums of some hundred works of order 1e-4 J.
                let most = shares[i].max(0.0) + 0.4e-3 + 1e-9;
                prop_assert!(given[i] <= most, "{i} {tick}: {} {shares:?}", given[i]);
            }
        }
    }
}

/// A model of two handles with a tear limit: a stiffness between all displacements of both, with the slope and area that
/// belong together.
fn limited(root: f64, critical: f64) -> LocalModel {
    let mut numbers = Numbers(12_345);
    let mut factor = nalgebra::SMatrix::<f64, 12, 12>::from_fn(|_, _| 10.0 * numbers.next());
    for i in 0..12 {
        factor[(i, i)] += 20.0;
    }
    let stiffness = factor * factor.transpose();
    let slope = nalgebra::SVector::<f64, 12>::from_fn(|_, _| 300.0 * numbers.next());
    let softness = stiffness
        .cholesky()
        .expect("positive definite")
        .solve(&slope);
    let mut model = stretched(1, 0, 0.5, 0.1);
    model.head.tear_limit = TearLimit {
        root,
        critical,
        area: 1.0 / slope.dot(&softness),
    };
    for i in 0..2 {
        model.handles[i].tear_slope = slope.fixed_rows::<6>(6 * i).into();
        for j in 0..2 {
            model.stiffness[i][j] = stiffness.fixed_view::<6, 6>(6 * i, 6 * j).into();
        }
    }
    model
}

/// Wrenches and stored energy after both handles have moved from their references by `by`.
fn extrapolated(model: &LocalModel, by: &[Vec6; 2]) -> ([Vec6; 2], f64) {
    let mut deviations = model.deviations(&[]);
    for (deviation, by) in deviations.iter_mut().zip(by) {
        deviation.displacement = *by;
    }
    let wrenches = model.wrenches(&deviations, 0.0);
    let still = [Lead::none(); MAX_HANDLES];
    let parts = model.parts(&deviations, &still, 0.0);
    // Rounding of wrenches of some newtons.
    for (wrench, elastic) in wrenches.iter().zip(&parts.elastic).take(2) {
        assert!((wrench.stacked() - elastic).amax() < 1e-12);
    }
    ([0, 1].map(|i| wrenches[i].stacked()), parts.stored)
}

fn along_slope(model: &LocalModel, by: &[Vec6; 2]) -> f64 {
    let each = model.handles().zip(by);
    each.map(|(handle, by)| handle.tear_slope.dot(by)).sum()
}

#[test]
fn the_extrapolation_stops_where_the_tear_goes_on() {
    let (root, critical) = (1.0, 1.5);
    let model = limited(root, critical);
    let mut free = model;
    free.head.tear_limit = TearLimit::none();
    let mut numbers = Numbers(77);
    let mut beyond = 0;
    for _ in 0..200 {
        let by = [0, 1].map(|_| Vec6::from_fn(|_, _| 2e-3 * numbers.next()));
        let (found, _) = extrapolated(&model, &by);
        let excess = (root + along_slope(&model, &by) - critical).max(0.0);
        // The projection onto the half-space, by a solve instead of by the formula: the displacement moves along the
        // softness of the body until the tear's root is critical.
        let mut all = nalgebra::SMatrix::<f64, 12, 12>::zeros();
        let mut slope = nalgebra::SVector::<f64, 12>::zeros();
        for i in 0..2 {
            slope
                .fixed_rows_mut::<6>(6 * i)
                .copy_from(&model.handles[i].tear_slope);
            for j in 0..2 {
                let mut view = all.fixed_view_mut::<6, 6>(6 * i, 6 * j);
                view.copy_from(&model.stiffness[i][j]);
            }
        }
        let softness = all.cholesky().expect("positive definite").solve(&slope);
        let back = softness * (excess / slope.dot(&softness));
        let projected = [0, 1].map(|i| by[i] - back.fixed_rows::<6>(6 * i));
        let reached = root + along_slope(&model, &projected);
        assert!(reached <= critical + 1e-12, "{reached}");
        let (wanted, _) = extrapolated(&free, &projected);
        for (found, wanted) in found.iter().zip(&wanted) {
            // Rounding of a solve with a stiffness of order 1e3 N/m.
            assert!((found - wanted).amax() < 1e-9, "{found} {wanted}");
        }
        if excess == 0.0 {
            assert_eq!(found, extrapolated(&free, &by).0);
        } else {
            beyond += 1;
        }
    }
    assert!(
        beyond > 20 && beyond < 180,
        "both sides of the limit: {beyond}"
    );
}

#[test]
fn a_running_tear_yields_from_the_reference_on() {
    // The tip is beyond the limit at the reference: the reference wrench stays, and a further opening finds no more
    // stiffness along the slope.
    let model = limited(2.0, 1.5);
    let (rest, stored) = extrapolated(&model, &[Vec6::zeros(); 2]);
    assert_eq!(rest[0].x, 0.5);
    assert_eq!(stored, 0.1);
    // The displacement that a load along the slope causes: the wrench does not answer it at all.
    let mut slope = nalgebra::SVector::<f64, 12>::zeros();
    let mut all = nalgebra::SMatrix::<f64, 12, 12>::zeros();
    for i in 0..2 {
        slope
            .fixed_rows_mut::<6>(6 * i)
            .copy_from(&model.handles[i].tear_slope);
        for j in 0..2 {
            all.fixed_view_mut::<6, 6>(6 * i, 6 * j)
                .copy_from(&model.stiffness[i][j]);
        }
    }
    let softness = all.cholesky().expect("positive definite").solve(&slope);
    let opening = softness * (1.0 / slope.dot(&softness));
    let open = [0, 1].map(|i| Vec6::from(opening.fixed_rows::<6>(6 * i)) * 0.3);
    let (found, _) = extrapolated(&model, &open);
    for (found, rest) in found.iter().zip(&rest) {
        // Rounding of a solve.
        assert!((found - rest).amax() < 1e-9, "{found}");
    }
    // Closing finds the whole stiffness.
    let mut free = model;
    free.head.tear_limit = TearLimit::none();
    let closed = open.map(|by| by * -1.0);
    assert_eq!(extrapolated(&model, &closed), extrapolated(&free, &closed));
}

#[test]
fn the_wrench_is_continuous_at_the_limit_and_has_the_stored_energy_for_its_potential() {
    let model = limited(1.0, 1.2);
    let mut numbers = Numbers(5);
    for _ in 0..20 {
        let way = [0, 1].map(|_| Vec6::from_fn(|_, _| 3e-3 * numbers.next()));
        let at = |t: f64| extrapolated(&model, &way.map(|by| by * t));
        let steps = 1000;
        let (mut work, mut last) = (0.0, at(0.0));
        for step in 1..=steps {
            let next = at(f64::from(step) / f64::from(steps));
            for i in 0..2 {
                work += (last.0[i] + next.0[i]).dot(&way[i]) * 0.5 / f64::from(steps);
                // A step answers at most with the stiffness: rows of 1e4 N/m, 36 um at most.
                let jump = (next.0[i] - last.0[i]).amax();
                assert!(jump < 1e4 * 12.0 * 3e-6, "{jump}");
            }
            last = next;
        }
        // The trapezoidal rule is exact but for the one interval with the kink.
        let drop = 0.1 - last.1;
        assert!((drop - work).abs() < 1e-7, "{drop} {work}");
    }
}

#[test]
fn a_lead_answers_as_the_springs_answer_that_much_further_motion() {
    // Without dampers, the viscous part is that of the lead. Displacements before and beyond the limit, leads across it in
    // both directions, and a tear that runs from the reference on.
    for (root, critical) in [(1.0, 1.5), (2.0, 1.5)] {
        let model = limited(root, critical);
        let mut numbers = Numbers(99);
        let mut seen = [0; 4];
        for _ in 0..200 {
            let mut any = || [0, 1].map(|_| Vec6::from_fn(|_, _| 2e-3 * numbers.next()));
            let (by, further) = (any(), any());
            let mut lead = [Lead::none(); MAX_HANDLES];
            (lead[0].step, lead[1].step) = (further[0], further[1]);
            let mut deviations = model.deviations(&[]);
            for (deviation, by) in deviations.iter_mut().zip(&by) {
                deviation.displacement = *by;
            }
            let parts = model.parts(&deviations, &lead, 0.0);
            let viscous = parts.viscous;
            assert_eq!(parts.stored, extrapolated(&model, &by).1);
            let there = [0, 1].map(|i| by[i] + further[i]);
            let ((here, _), (ahead, _)) = (extrapolated(&model, &by), extrapolated(&model, &there));
            for i in 0..2 {
                // Rounding of wrenches of some newtons.
                assert!((viscous[i] - (ahead[i] - here[i])).amax() < 1e-12);
            }
            let room = f64::max(critical - root, 0.0);
            let [from, to] = [&by, &there].map(|by| along_slope(&model, by) > room);
            seen[2 * usize::from(from) + usize::from(to)] += 1;
        }
        assert!(seen.iter().all(|&times| times > 5), "{seen:?}");
        // A lead from the reference on.
        let mut lead = [Lead::none(); MAX_HANDLES];
        lead[0].step = model.handles[0].tear_slope * 1e-3;
        let parts = model.parts(&model.deviations(&at_rest()), &lead, 0.0);
        assert_eq!(parts.stored, 0.1);
    }
}

#[test]
fn a_limit_that_is_not_reached_or_is_none_leaves_every_byte() {
    let mut free = limited(1.0, 1.5);
    free.head.tear_limit = TearLimit::none();
    for (scheme, root, critical) in [
        (Scheme::Linear, 1.0, 1e3),
        (Scheme::Capped, 1.0, 1e3),
        // No critical root: there is no limit.
        (Scheme::Linear, 1.0, 0.0),
        (Scheme::Capped, 1.0, -1.0),
    ] {
        let far = limited(root, critical);
        let (mut one, start) = settled(scheme, &far);
        let (mut other, _) = settled(scheme, &free);
        for tick in 0..20 {
            let by = [Vec3::x() * 1e-5 * tick as f64, Vec3::y() * 1e-5];
            let at = hands(by, [Vec3::x() * 1e-2, Vec3::zeros()]);
            let now = start + tick * MS;
            assert_eq!(
                held_tick(&mut one, now, &at),
                held_tick(&mut other, now, &at)
            );
        }
        assert_eq!(one.energy(), other.energy());
    }
}
