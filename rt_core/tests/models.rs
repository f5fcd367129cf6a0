//! The models that the coupling takes into use, and the forces that reach the hand. The coupling refuses a model of an
//! older topology, a contact never pulls, and a weight comes and goes with the trust in its model.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use nalgebra::{Quaternion, UnitQuaternion};
use rt_core::coupling::{Coupling, CouplingConfig, HostState, Passed};
use rt_core::local_model::{Lead, ModelFault, PackedModel, PublishedModel};
use rt_core::publication::Publication;
use rt_core::{
    LocalModel, MAX_DEVICES, MAX_HANDLES, PassivityConfig, Pose, Scheme, Twist, Vec3, Wrench,
};

const MS: u64 = 1_000_000;
const PERIOD: f64 = 1e-3;
/// Every scheme that reads the stiffness of a model.
const SCHEMES: [Scheme; 4] = [
    Scheme::Linear,
    Scheme::Proxy,
    Scheme::Classic,
    Scheme::Capped,
];

fn coupling(scheme: Scheme) -> Coupling {
    Coupling::new(CouplingConfig {
        scheme,
        period: PERIOD,
        blend: 0.5,
        age_limit: 0.05,
        decay: 0.1,
        recovery: PERIOD,
        hold_damping: [0.0; MAX_DEVICES],
        passivity: PassivityConfig::new(PERIOD),
    })
}

/// A model with one handle at the origin and no force.
fn model(sequence: u64, epoch: u32, time_ns: u64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.sequence = sequence;
    model.head.epoch = epoch;
    model.head.time_ns = time_ns;
    model.head.period = 0.004;
    model.head.handle_count = 1;
    model
}

/// One hand at a position (m) with a velocity (m/s).
fn at(position: Vec3, velocity: Vec3) -> [(Pose, Twist); 1] {
    let twist = Twist {
        linear: velocity,
        ..Twist::zero()
    };
    [(Pose::at(position), twist)]
}

/// One tick, after which the device holds the rendered wrench.
fn tick(coupling: &mut Coupling, now_ns: u64, hand: &[(Pose, Twist); 1]) -> Wrench {
    let [wrench, ..] = coupling.tick(now_ns, hand);
    let mut held = [Wrench::zero(); MAX_DEVICES];
    held[0] = wrench;
    coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
    wrench
}

#[test]
fn a_model_of_an_older_topology_is_refused_however_new_it_is() {
    let still = at(Vec3::zeros(), Vec3::zeros());
    for scheme in SCHEMES {
        let mut coupling = coupling(scheme);
        assert_eq!(coupling.accept(&model(1, 5, 10 * MS)), Ok(()));
        // Before the first model is taken into use, and after.
        for (refused, now) in [(1, 11), (2, 12)] {
            let older = model(1 + refused, 4, now * MS);
            assert_eq!(coupling.accept(&older), Err(ModelFault::Outdated));
            assert_eq!(coupling.counters().outdated, refused);
            tick(&mut coupling, now * MS, &still);
            assert_eq!(
                (coupling.model().head.epoch, coupling.model().head.sequence),
                (5, 1)
            );
        }
        // A model of the same epoch and one of a later epoch are taken.
        for (sequence, epoch) in [(4, 5), (5, 6)] {
            let newer = model(sequence, epoch, (20 + sequence) * MS);
            assert_eq!(coupling.accept(&newer), Ok(()));
            tick(&mut coupling, 30 * MS, &still);
            assert_eq!(coupling.model().head.sequence, sequence);
        }
        assert_eq!(coupling.counters().accepted, 3);
    }
}

/// The judgement of a model, which is the same for the model in a ring.
fn judged(model: &LocalModel) -> Result<(), ModelFault> {
    let handles: Vec<_> = model.handles().copied().collect();
    let blocks = model.blocks().collect::<Vec<_>>().concat();
    let found = model.check();
    if let Some(packed) = PackedModel::new(model.head, &handles, &blocks) {
        assert_eq!(PublishedModel::check(&packed), found);
    }
    found
}

/// Sets one number of a model.
type Set = fn(&mut LocalModel, f64);

#[test]
fn a_model_is_refused_for_any_number_in_use_that_is_not_finite() {
    // Two handles on two pieces, and a limit.
    let mut sound = model(1, 1, MS);
    sound.head.handle_count = 2;
    (sound.handles[1].device, sound.handles[1].piece) = (1, 1);
    sound.head.tear_limit.critical = 1.0;
    assert_eq!(judged(&sound), Ok(()));
    let in_use: [Set; 23] = [
        |model, x| model.head.period = x,
        |model, x| model.head.horizon = x,
        |model, x| model.head.energy = x,
        |model, x| model.head.released = x,
        |model, x| model.head.pieces[0].stored = x,
        |model, x| model.head.pieces[1].released = x,
        |model, x| model.head.tear_limit.root = x,
        |model, x| model.head.tear_limit.critical = x,
        |model, x| model.head.tear_limit.area = x,
        |model, x| model.handles[0].pose.position.y = x,
        |model, x| model.handles[1].pose.rotation = quaternion(x),
        |model, x| model.handles[0].twist.linear.z = x,
        |model, x| model.handles[1].twist.angular.x = x,
        |model, x| model.handles[0].wrench.force.x = x,
        |model, x| model.handles[1].wrench.moment.y = x,
        |model, x| model.handles[0].drift.force.y = x,
        |model, x| model.handles[1].drift.moment.z = x,
        |model, x| model.handles[1].contact.x = x,
        |model, x| model.handles[0].weight.z = x,
        |model, x| model.handles[1].tear_slope.b = x,
        |model, x| model.stiffness[0][1][(5, 3)] = x,
        |model, x| model.damping[1][0][(2, 5)] = x,
        |model, x| model.damping[1][1][(0, 0)] = x,
    ];
    for (which, set) in in_use.iter().enumerate() {
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut model = sound;
            set(&mut model, x);
            assert_eq!(judged(&model), Err(ModelFault::NotFinite), "{which}: {x}");
        }
    }
    // Numbers that are finite, but not allowed.
    let wrong: [Set; 3] = [
        |model, x| model.head.period = x,
        |model, x| model.head.horizon = x,
        // The damper of a touch would push.
        |model, x| {
            (model.head.tear_limit.root, model.head.tear_limit.area) = (1.0, x - 1e-300);
        },
    ];
    for (which, set) in wrong.iter().enumerate() {
        for x in [0.0, -1.0] {
            let mut model = sound;
            set(&mut model, x);
            assert_eq!(judged(&model), Err(ModelFault::NotFinite), "{which}: {x}");
        }
    }
}

#[test]
fn numbers_of_a_model_that_are_not_in_use_do_not_matter() {
    // A whole body in one hand, without a limit.
    let mut model = model(1, 1, MS);
    model.head.pieces[0].stored = f64::NAN;
    model.handles[0].tear_slope.x = f64::NAN;
    model.handles[1].weight.x = f64::NAN;
    (model.handles[1].device, model.handles[1].piece) = (200, 9);
    model.stiffness[0][1][(0, 0)] = f64::NAN;
    model.damping[1][0][(0, 0)] = f64::NAN;
    assert_eq!(judged(&model), Ok(()));
}

#[test]
fn a_model_is_refused_for_handles_devices_and_pieces_that_cannot_be() {
    let cases: [(u8, u8, u8, bool); 9] = [
        // Handles; device and piece of the last handle.
        (0, 0, 0, false),
        (1, 0, 0, true),
        (2, MAX_DEVICES as u8 - 1, 1, true),
        (2, MAX_DEVICES as u8, 0, false),
        (2, 255, 0, false),
        (2, 1, 2, false),
        (2, 1, 255, false),
        (MAX_HANDLES as u8, 7, MAX_HANDLES as u8 - 1, true),
        (MAX_HANDLES as u8 + 1, 7, 0, false),
    ];
    for (count, device, piece, sound) in cases {
        let mut model = model(1, 1, MS);
        model.head.handle_count = count;
        for (handle, device) in model.handles.iter_mut().zip(0..) {
            handle.device = device;
        }
        let last = usize::from(count).clamp(1, MAX_HANDLES) - 1;
        (model.handles[last].device, model.handles[last].piece) = (device, piece);
        let expected = if sound {
            Ok(())
        } else {
            Err(ModelFault::Handles)
        };
        assert_eq!(judged(&model), expected, "{count} {device} {piece}");
    }
}

fn quaternion(w: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(w, 0.0, 0.0, 0.0))
}

#[test]
fn a_contact_pushes_and_never_pulls() {
    // A wall along x, compliant in the tangent plane, that damps a handle inside it.
    let (k, sideways, b) = (1000.0, 200.0, 5.0);
    let mut wall = model(1, 0, MS);
    wall.handles[0].contact = Vec3::x();
    wall.stiffness[0][0][(0, 0)] = k;
    wall.stiffness[0][0][(1, 1)] = sideways;
    wall.damping[0][0][(0, 0)] = b;
    // The classic controller is left out: in the air it takes back the excess energy of the wall.
    for scheme in [Scheme::Linear, Scheme::Proxy, Scheme::Capped] {
        let mut coupling = coupling(scheme);
        coupling.accept(&wall).expect("a sound model");
        let mut force = |x: f64, y: f64, v: f64| {
            let hand = at(Vec3::new(x, y, 0.0), Vec3::x() * v);
            tick(&mut coupling, 2 * MS, &hand).force
        };
        for _ in 0..20 {
            force(0.0, 0.0, 0.0);
        }
        // The hand goes in slowly: a tenth of a millimetre in twenty ticks. The wall pushes.
        let mut deep = Vec3::zeros();
        for step in 1..=20 {
            deep = force(-5e-6 * f64::from(step), 0.0, 0.0);
        }
        // The cap's damper may add some of the stiffness of half a step.
        assert!(
            (deep.x / (k * 1e-4) - 1.0).abs() < 0.05,
            "{scheme:?} {deep}"
        );
        // Outside the wall, neither its spring nor its damper acts, up to the rounding of a blend.
        for step in 1..=20 {
            let x = 5e-6 * f64::from(step);
            let air = force(x, 0.0, 5e-3);
            assert!(air.x.abs() < 1e-12, "{scheme:?}: {air} at {x} m");
        }
        if scheme == Scheme::Capped {
            assert_eq!(coupling.energy().stored, 0.0, "air stores nothing");
        }
    }
}

#[test]
fn a_contact_stores_the_part_of_its_energy_that_does_not_pull() {
    let still = [Lead::none(); MAX_HANDLES];
    // Force at the reference (N), the part of the energy that is stored, and whether the contact damps.
    for (force, part, damps) in [
        (Vec3::new(4.0, 3.0, 0.0), 1.0, true),
        // Without a force along the normal, the handle still touches.
        (Vec3::new(0.0, 3.0, 0.0), 1.0, true),
        (Vec3::zeros(), 1.0, true),
        (Vec3::new(-4.0, 3.0, 0.0), 9.0 / 25.0, false),
        (Vec3::new(-4.0, 0.0, 0.0), 0.0, false),
    ] {
        let mut touched = model(1, 0, MS);
        touched.head.energy = 2.0;
        let handle = &mut touched.handles[0];
        (handle.contact, handle.wrench.force) = (Vec3::x(), force);
        touched.damping[0][0][(1, 1)] = 5.0;
        let deviations = touched.deviations(&at(Vec3::zeros(), Vec3::y()));
        let parts = touched.parts(&deviations, &still, 0.0);
        assert!(
            (parts.stored - 2.0 * part).abs() < 1e-15,
            "{force} {parts:?}"
        );
        let pushes = Vec3::new(force.x.max(0.0), force.y, force.z);
        assert_eq!(Wrench::from_stacked(&parts.elastic[0]).force, pushes);
        let damper = if damps { -5.0 } else { 0.0 };
        assert_eq!(parts.viscous[0].y, damper, "{force}");
    }
}

#[test]
fn a_contact_holds_sideways_also_where_it_would_pull() {
    let mut wall = model(1, 0, MS);
    wall.handles[0].contact = Vec3::x();
    wall.stiffness[0][0][(0, 0)] = 1000.0;
    wall.stiffness[0][0][(1, 1)] = 200.0;
    for scheme in SCHEMES {
        let mut coupling = coupling(scheme);
        coupling.accept(&wall).expect("a sound model");
        let mut force = Vec3::zeros();
        for step in 0..=40 {
            // First the trust in the model grows; then the hand goes sideways and out at once.
            let s = 1e-6 * f64::from((step - 20).max(0));
            let hand = at(Vec3::new(s, s, 0.0), Vec3::zeros());
            force = tick(&mut coupling, 2 * MS, &hand).force;
        }
        assert!(force.x.abs() < 1e-12, "{scheme:?} {force}");
        // Half a step's stiffness may act as a damper under the cap: 2.5 % of twenty steps.
        assert!(
            (force.y / (-200.0 * 20e-6) - 1.0).abs() < 0.03,
            "{scheme:?} {force}"
        );
    }
}

#[test]
fn weight_comes_and_goes_with_the_trust_in_its_model() {
    let weight = 2.0;
    for scheme in SCHEMES {
        let mut coupling = coupling(scheme);
        let mut hanging = model(1, 0, MS);
        hanging.handles[0].wrench.force.z = -weight;
        hanging.handles[0].weight.z = -weight;
        let mut now = MS;
        let mut tick = |coupling: &mut Coupling, height: f64| {
            let hand = at(Vec3::z() * height, Vec3::zeros());
            now += MS;
            tick(coupling, now, &hand).force.z
        };
        coupling.accept(&hanging).expect("a sound model");
        for _ in 0..40 {
            tick(&mut coupling, 0.0);
        }
        // No newer model comes. The model grows too old at 50 ms and fades for 100 ms, while the hand lifts the weight.
        // The raised energy is at each moment the weight times the height, whatever part of the weight is then held.
        let (mut faded, mut seen) = (0, [false; 2]);
        for step in 1..=200 {
            let height = 1e-4 * f64::from(step);
            let fraction = tick(&mut coupling, height) / -weight;
            let raised = coupling.energy().raised;
            let expected = weight * height;
            // Sums of two hundred terms, each of some hundredths of a joule, in double precision.
            assert!(
                (raised - expected).abs() < 1e-12,
                "{scheme:?} step {step}: {raised} {expected}"
            );
            match coupling.state() {
                HostState::Live => {
                    assert!((fraction - 1.0).abs() < 1e-12, "{scheme:?}");
                    seen[0] = true;
                }
                HostState::Fading => {
                    assert!(fraction < 1.0 && fraction > 0.0, "{scheme:?} {fraction}");
                    faded += 1;
                }
                HostState::Held => {
                    // No weight is held any more; `raised` has been checked above.
                    assert_eq!(fraction, 0.0, "{scheme:?}");
                    seen[1] = true;
                }
                HostState::Waiting => panic!("a model is in use"),
            }
        }
        assert!(faded > 90 && seen == [true; 2], "{faded} {seen:?}");
    }
}

#[test]
fn a_drift_acts_up_to_the_horizon_and_levels_off_within_another() {
    let mut model = LocalModel::empty();
    model.head.time_ns = 5 * MS;
    model.head.horizon = 0.02;
    let ahead = |age_ms: f64| model.ahead(5 * MS + (age_ms * 1e6) as u64);
    // A model of the future has no age yet. The tolerance covers the rounding of hundredths of a second.
    assert_eq!(model.ahead(0), 0.0);
    for (age_ms, expected) in [
        (0.0, 0.0),
        (7.0, 0.007),
        (20.0, 0.02),
        (30.0, 0.0275),
        (40.0, 0.03),
        (1e6, 0.03),
    ] {
        assert!(
            (ahead(age_ms) - expected).abs() < 1e-15,
            "{age_ms} ms: {}",
            ahead(age_ms)
        );
    }
    // The slope is continuous: it is one before the horizon, and falls evenly to zero.
    let slope = |age_ms: f64| (ahead(age_ms + 0.01) - ahead(age_ms - 0.01)) / 2e-5;
    for (age_ms, expected) in [(19.9, 1.0), (20.0, 1.0), (25.0, 0.75), (40.0, 0.0)] {
        // The second derivative jumps by 50 per second; the difference spans a hundredth of a millisecond.
        assert!(
            (slope(age_ms) - expected).abs() < 5e-4,
            "{age_ms} ms: {}",
            slope(age_ms)
        );
    }
}
