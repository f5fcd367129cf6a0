//! A model in a ring. A packed and copied model keeps every bit of its used part, and the controller judges it as it
//! judges the whole model.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use nalgebra::{Quaternion, UnitQuaternion};
use proptest::prelude::*;
use rt_core::coupling::{Coupling, CouplingConfig};
use rt_core::local_model::{PackedModel, PublishedModel};
use rt_core::publication::{Extent, Head, Publication};
use rt_core::{
    HandleReference, LocalModel, MAX_DEVICES, MAX_HANDLES, Mat6, PassivityConfig, PieceEnergy,
    Scheme, TearLimit, Vec3, Vec6, Wrench,
};

/// Numbers that are hard to keep, among any others: zeros of both signs, infinities, and NaN with and without payload.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => any::<u64>().prop_map(f64::from_bits),
        4 => -1.0..1.0,
        1 => Just(-0.0),
        1 => Just(f64::INFINITY),
        1 => Just(f64::from_bits(0x7ff4_0000_dead_beef)),
    ]
}

/// Usual numbers only, so that most models are sound.
fn usual() -> impl Strategy<Value = f64> {
    0.001..1.0
}

/// A model of these numbers, in its unused part, too. `sizes` are the number of handles and the first device.
fn filled(numbers: &[f64], sizes: (u8, u8), counts: (u64, u32, u64)) -> LocalModel {
    let mut numbers = numbers.iter().copied().cycle();
    let mut next = || numbers.next().unwrap_or_default();
    let mut model = LocalModel::empty();
    (model.head.sequence, model.head.epoch, model.head.time_ns) = counts;
    model.head.handle_count = sizes.0;
    model.head.period = next();
    model.head.horizon = next();
    model.head.energy = next();
    model.head.released = next();
    model.head.pieces = [(); MAX_HANDLES].map(|()| PieceEnergy {
        stored: next(),
        released: next(),
    });
    model.head.tear_limit = TearLimit {
        root: next(),
        critical: next(),
        area: next(),
    };
    for (handle, device) in model.handles.iter_mut().zip(sizes.1..) {
        let mut vector = || Vec3::from_fn(|_, _| next());
        *handle = HandleReference::zero();
        handle.device = device;
        // Some models are of torn bodies, and some have a piece that cannot be.
        handle.piece = if counts.1 > 0 { device % 3 } else { 0 };
        handle.pose.position = vector();
        (handle.twist.linear, handle.twist.angular) = (vector(), vector());
        (handle.wrench.force, handle.wrench.moment) = (vector(), vector());
        (handle.contact, handle.weight) = (vector(), vector());
        let (force, moment) = (vector(), vector());
        handle.drift = Wrench { force, moment };
        handle.tear_slope = Vec6::from_fn(|_, _| next());
        let turn = Quaternion::new(next(), next(), next(), next());
        handle.pose.rotation = UnitQuaternion::new_unchecked(turn);
    }
    for blocks in [&mut model.stiffness, &mut model.damping] {
        for block in blocks.iter_mut().flatten() {
            *block = Mat6::from_fn(|_, _| next());
        }
    }
    model
}

fn model(number: impl Strategy<Value = f64>) -> impl Strategy<Value = LocalModel> {
    let size = prop_oneof![8 => 0..=MAX_HANDLES as u8, 1 => any::<u8>()];
    let device = prop_oneof![8 => 0..4_u8, 1 => 0..=u8::MAX - MAX_HANDLES as u8];
    (
        proptest::collection::vec(number, 1331),
        (size, device),
        (any::<u64>(), 0..3_u32, 0..100_u64),
    )
        .prop_map(|(numbers, sizes, counts)| filled(&numbers, sizes, counts))
}

/// The used part of a model, bit by bit.
fn bits(model: &LocalModel) -> Vec<u64> {
    let mut bits = vec![
        model.head.sequence,
        u64::from(model.head.epoch),
        model.head.time_ns,
        u64::from(model.head.handle_count),
    ];
    let mut add = |numbers: &[f64]| bits.extend(numbers.iter().map(|x| x.to_bits()));
    add(&[
        model.head.period,
        model.head.horizon,
        model.head.energy,
        model.head.released,
    ]);
    for piece in &model.head.pieces {
        add(&[piece.stored, piece.released]);
    }
    let limit = &model.head.tear_limit;
    add(&[limit.root, limit.critical, limit.area]);
    for handle in model.handles() {
        add(&[f64::from(handle.device), f64::from(handle.piece)]);
        add(handle.tear_slope.as_slice());
        add(handle.pose.position.as_slice());
        add(handle.pose.rotation.coords.as_slice());
        for vector in [
            &handle.twist.linear,
            &handle.twist.angular,
            &handle.wrench.force,
            &handle.wrench.moment,
            &handle.contact,
            &handle.weight,
            &handle.drift.force,
            &handle.drift.moment,
        ] {
            add(vector.as_slice());
        }
    }
    let n = usize::from(model.head.handle_count).min(MAX_HANDLES);
    for blocks in [&model.stiffness, &model.damping] {
        for row in &blocks[..n] {
            row[..n].iter().for_each(|block| add(block.as_slice()));
        }
    }
    bits
}

/// The parts of a model in the order of a ring.
fn parts(model: &LocalModel) -> (Vec<HandleReference>, Vec<Mat6>) {
    let blocks = model.blocks().flatten().copied().collect();
    (model.handles().copied().collect(), blocks)
}

fn coupling() -> Coupling {
    let period = 1e-3;
    Coupling::new(CouplingConfig {
        scheme: Scheme::Linear,
        period,
        blend: 0.5,
        age_limit: 0.05,
        decay: 0.1,
        recovery: period,
        hold_damping: [0.0; MAX_DEVICES],
        passivity: PassivityConfig::new(period),
    })
}

proptest! {
    #[test]
    fn a_packed_model_keeps_every_bit(model in model(number()), other in model(number())) {
        let (handles, blocks) = parts(&model);
        let packed = PackedModel::new(model.head, &handles, &blocks).expect("its own parts");
        // The copy overwrites another model. The parts of that model stay if the new model has no such parts.
        let mut copy = other;
        copy.copy_used_from(&packed);
        prop_assert_eq!(bits(&copy), bits(&model));
        let mut direct = other;
        direct.copy_used_from(&model);
        let whole = |mut model: LocalModel| {
            model.head.handle_count = MAX_HANDLES as u8;
            bits(&model)
        };
        prop_assert_eq!(whole(copy), whole(direct));
    }

    #[test]
    fn a_packed_model_is_judged_as_the_whole_one(
        models in proptest::collection::vec(prop_oneof![3 => model(usual()), 1 => model(number())], 1..6),
    ) {
        let (mut one, mut other) = (coupling(), coupling());
        for model in &models {
            let (handles, blocks) = parts(model);
            let packed = PackedModel::new(model.head, &handles, &blocks).expect("its own parts");
            prop_assert_eq!(PublishedModel::check(&packed), model.check());
            prop_assert_eq!(one.accept(model), other.accept(&packed));
            prop_assert_eq!(one.counters(), other.counters());
            let (a, b) = (one.tick(0, &[]), other.tick(0, &[]));
            prop_assert_eq!(bits(one.model()), bits(other.model()));
            let bits = |w: &Wrench| w.stacked().map(f64::to_bits);
            prop_assert!(a.iter().map(bits).eq(b.iter().map(bits)));
        }
    }

    /// Any head with any numbers of parts: the parts are a model, or they are refused. Nothing panics.
    #[test]
    fn parts_that_are_too_few_or_too_many_are_no_model(
        model in model(number()), handles in 0..8_usize, blocks in 0..40_usize,
    ) {
        let held = vec![HandleReference::zero(); handles];
        let between = vec![Mat6::zeros(); blocks];
        let head = model.head;
        let packed = PackedModel::new(head, &held, &between);
        prop_assert_eq!(packed.is_some(), head.extent() == Extent { rows: handles, blocks });
        if let Some(packed) = packed {
            let _ = PublishedModel::check(&packed);
            LocalModel::empty().copy_used_from(&packed);
        }
    }
}
