//! The springs against the series of body and springs, solved directly.

use super::*;
use nalgebra::{SMatrix, SVector, UnitQuaternion};
use proptest::prelude::*;
use rt_core::{Mat6, PieceEnergy, TearLimit, Twist};

/// Two handles, and the stiffnesses that their devices can render.
const LIMITS: [Renderable; 2] = [
    Renderable {
        stiffness: 2e3,
        turning: 3.0,
        calm: 0.4,
        ..Renderable::ANY
    },
    Renderable {
        stiffness: 5e3,
        ..Renderable::ANY
    },
];
const SIZE: usize = 12;

type Matrix = SMatrix<f64, SIZE, SIZE>;
type Vector = SVector<f64, SIZE>;

fn springs() -> SeriesSprings {
    SeriesSprings::of(&[0, 1], &LIMITS).expect("devices with limits")
}

/// The limits by motion; a large one if there is none.
fn limits() -> Vector {
    Vector::from_fn(|slot, _| {
        let limit = LIMITS[slot / 6];
        if slot % 6 < 3 {
            limit.stiffness
        } else {
            limit.turning
        }
    })
}

/// The rendered multiple of the limit, for that of the body.
fn rendered(l: f64) -> f64 {
    if l <= 1.0 {
        l
    } else {
        (1.0 - (l - 1.0) * 0.6 / 0.1).max(0.4)
    }
}

/// A symmetric positive matrix of numbers in the metric of the limits, times `most`. The identity bounds its condition by
/// `100 SIZE^2` there: rounding grows with the condition of a matrix that is inverted.
fn positive(numbers: &[f64], most: f64) -> Matrix {
    let half = Matrix::from_fn(|i, j| numbers[SIZE * j + i]);
    let scale = limits().map(|limit| if limit.is_finite() { limit.sqrt() } else { 1.0 });
    let metric = Matrix::from_diagonal(&scale);
    metric * (half * half.transpose() + Matrix::identity() * 0.01) * metric * (most / SIZE as f64)
}

fn blocks(matrix: &Matrix, write: &mut [[Mat6; MAX_HANDLES]; MAX_HANDLES]) {
    for i in 0..2 {
        for j in 0..2 {
            write[i][j] = Mat6::from_fn(|r, c| matrix[(6 * i + r, 6 * j + c)]);
        }
    }
}

fn matrix(blocks: &[[Mat6; MAX_HANDLES]; MAX_HANDLES]) -> Matrix {
    Matrix::from_fn(|i, j| blocks[i / 6][j / 6][(i % 6, j % 6)])
}

fn vector(of: impl Fn(&HandleReference) -> Vec6, model: &LocalModel) -> Vector {
    Vector::from_iterator(
        model
            .handles()
            .flat_map(|handle| of(handle).iter().copied().collect::<Vec<_>>()),
    )
}

fn model(stiffness: &Matrix, damping: &Matrix, numbers: &[f64]) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.handle_count = 2;
    blocks(stiffness, &mut model.stiffness);
    blocks(damping, &mut model.damping);
    model.head.energy = 0.3;
    let vec6 = |from: usize| Vec6::from_iterator(numbers[from..from + 6].iter().copied());
    for (i, handle) in model.handles.iter_mut().enumerate().take(2) {
        handle.device = i as u8;
        handle.wrench = Wrench::from_stacked(&vec6(6 * i));
        handle.drift = Wrench::from_stacked(&vec6(12 + 6 * i));
        handle.twist = Twist {
            linear: 0.1 * Vec3::from_column_slice(&numbers[24 + 3 * i..27 + 3 * i]),
            angular: Vec3::zeros(),
        };
        handle.weight = Vec3::new(0.0, 0.0, -0.4);
        handle.tear_slope = 10.0 * vec6(30 + 6 * i);
    }
    let slope = vector(|handle| handle.tear_slope, &model);
    let area = stiffness
        .cholesky()
        .map_or(0.0, |factor| 1.0 / slope.dot(&factor.solve(&slope)));
    model.head.tear_limit = TearLimit {
        root: 2.0,
        critical: 3.0,
        area,
    };
    model.head.pieces[0] = PieceEnergy {
        stored: 0.3,
        released: 0.0,
    };
    model
}

/// The wrenches without weights and dampers.
fn elastic(model: &LocalModel) -> Vector {
    let speeds = vector(|handle| handle.twist.stacked(), model);
    vector(HandleReference::unweighted, model) + matrix(&model.damping) * speeds
}

fn numbers() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-1.0..1.0, 2 * SIZE * SIZE + 42)
}

proptest! {
    #[test]
    fn devices_feel_body_and_springs_in_series(numbers in numbers(), most in 1.0..300.0) {
        let (first, rest) = numbers.split_at(SIZE * SIZE);
        let (second, rest) = rest.split_at(SIZE * SIZE);
        let body = model(&positive(first, most), &positive(second, 1e-3), rest);
        let mut springs = springs();
        let Some(out) = springs.through(&body, 0.0).copied() else {
            return Ok(());
        };
        let k = matrix(&body.stiffness);
        let after = matrix(&out.stiffness);
        let root = limits().map(|limit| 1.0 / limit.sqrt());
        let e = Matrix::from_diagonal(&root);

        // The stiffnesses beyond the limits become the limits.
        let sorted = |matrix: Matrix| {
            let mut values: Vec<f64> = matrix.symmetric_eigenvalues().iter().copied().collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let found = sorted(e * after * e);
        let mut expected: Vec<f64> = sorted(e * k * e).into_iter().map(rendered).collect();
        expected.sort_by(f64::total_cmp);
        for (found, expected) in found.iter().zip(expected) {
            prop_assert!((found - expected).abs() < 1e-8, "{found} {expected}");
        }

        // The compliance of the springs, by its definition.
        let eigen = (e * k * e).symmetric_eigen();
        let compliances = eigen.eigenvalues.map(|l| if l > 1.0 { 1.0 / rendered(l) - 1.0 / l } else { 0.0 });
        let compliance = e * eigen.eigenvectors * Matrix::from_diagonal(&compliances)
            * eigen.eigenvectors.transpose() * e;
        // Wherever the devices are, the springs pass on what the body does at the proxies.
        let a = elastic(&body);
        // A device that senses no rotation never turns its handle.
        let d = limits().zip_map(&Vector::from_fn(|i, _| first[i]), |limit, number| {
            if limit.is_finite() { 1e-3 * number } else { 0.0 }
        });
        let proxies = (Matrix::identity() + compliance * k)
            .lu()
            .solve(&(d + compliance * a))
            .expect("positive");
        let passed = a - k * proxies;
        let felt = elastic(&out) - after * d;
        prop_assert!((felt - passed).amax() < 1e-8 * (1.0 + a.amax()), "{felt} {passed}");

        // The model states the energy of body and springs there.
        let energy = |model: &LocalModel, k: &Matrix, a: &Vector, x: &Vector| {
            model.head.energy - a.dot(x) + 0.5 * x.dot(&(*k * *x))
        };
        let whole = energy(&body, &k, &a, &proxies) + 0.5 * passed.dot(&(compliance * passed));
        if out.head.energy > 0.0 {
            let stated = energy(&out, &after, &elastic(&out), &d);
            prop_assert!((whole - stated).abs() < 1e-9, "{whole} {stated}");
            prop_assert!((out.head.pieces[0].stored - out.head.energy).abs() < 1e-12);
        }

        // The damping keeps its sign, and moves with the proxies.
        let damping = matrix(&out.damping);
        let least = damping.symmetric_eigenvalues().min();
        prop_assert!(least > -1e-9, "{least}");
        // The tear feels the proxies.
        let slope = |model: &LocalModel| vector(|handle| handle.tear_slope, model);
        let at_proxies = body.head.tear_limit.root + slope(&body).dot(&proxies);
        let at_devices = out.head.tear_limit.root + slope(&out).dot(&d);
        prop_assert!((at_proxies - at_devices).abs() < 1e-8, "{at_proxies} {at_devices}");
        if let (Some(factor), true) = (after.cholesky(), body.head.tear_limit.area > 0.0) {
            let q = slope(&out);
            let inverse = q.dot(&factor.solve(&q));
            // A body that is much softer than the limits loses nearly all of its own term. Zero stands for none.
            let area = out.head.tear_limit.area;
            let stated = if area > 0.0 { 1.0 / area } else { 0.0 };
            let rounding = 1e-9 * (1.0 / body.head.tear_limit.area + inverse);
            prop_assert!((stated - inverse).abs() < rounding, "{stated} {inverse}");
        }

        // The handles go where the proxies are.
        let mut targets: Vec<HandlePose> = (0..2)
            .map(|handle| HandlePose {
                position: Vec3::new(d[6 * handle], d[6 * handle + 1], d[6 * handle + 2]),
                rotation: UnitQuaternion::from_scaled_axis(Vec3::new(
                    d[6 * handle + 3],
                    d[6 * handle + 4],
                    d[6 * handle + 5],
                )),
            })
            .collect();
        springs.aim(&mut targets, &body, 0.0);
        for (handle, target) in targets.iter().enumerate() {
            for axis in 0..3 {
                prop_assert!((target.position[axis] - proxies[6 * handle + axis]).abs() < 1e-9);
            }
            let turn = target.rotation.scaled_axis();
            for axis in 0..3 {
                prop_assert!((turn[axis] - proxies[6 * handle + 3 + axis]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_body_that_its_devices_can_render_stays_as_it_is(numbers in numbers(), most in 0.01..0.2) {
        // Numbers below one: the largest eigenvalue of their squares is below a sum of squares, SIZE^2 / SIZE.
        let (first, rest) = numbers.split_at(SIZE * SIZE);
        let (second, rest) = rest.split_at(SIZE * SIZE);
        let body = model(&positive(first, most / SIZE as f64), &positive(second, 1.0), rest);
        let mut springs = springs();
        prop_assert!(springs.through(&body, 0.0).is_none());
        prop_assert!(springs.stiffest().is_none());
        let mut target = [HandlePose {
            position: Vec3::x(),
            rotation: UnitQuaternion::identity(),
        }; 2];
        let before = target;
        springs.aim(&mut target, &body, 0.0);
        prop_assert_eq!(before[0].position, target[0].position);
    }
}

/// A body of one handle that is `ratio` times as stiff along an axis as its device can render.
fn along(axis: Vec3, ratio: f64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.handle_count = 1;
    let stiffness = axis * axis.transpose() * (ratio * LIMITS[0].stiffness);
    model.stiffness[0][0]
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&stiffness);
    model
}

#[test]
fn springs_fade_after_the_body_has_become_softer() {
    let mut springs = SeriesSprings::of(&[0], &LIMITS).expect("a limit");
    let axis = Vec3::new(0.6, 0.0, 0.8);
    springs.through(&along(axis, 5.0), 0.0).expect("springs");
    let found = springs.stiffest().expect("a stiff direction");
    assert!((found.ratio - 5.0 / 0.4).abs() < 1e-12);
    assert_eq!((found.handle, found.turns), (0, false));
    assert!((found.direction.dot(&axis).abs() - 1.0).abs() < 1e-12);
    assert!((found.rendered - 0.4 * LIMITS[0].stiffness).abs() < 1e-9);

    let soft = along(axis, 0.5);
    let mut last = 0.0;
    let mut models = 0;
    while let Some(out) = springs.through(&soft, 0.01) {
        let stiffness = out.stiffness[0][0][(0, 0)];
        assert!(stiffness > last && stiffness < soft.stiffness[0][0][(0, 0)]);
        last = stiffness;
        models += 1;
    }
    // The ratio falls from 5 towards 0.5 by a tenth a model: 4.5 x 0.9^n < 0.5 after 21 models.
    assert_eq!(models, 20);
    // A body that becomes stiff again is bounded at once.
    let out = springs.through(&along(axis, 9.0), 0.01).expect("springs");
    let found = axis.dot(&(out.stiffness[0][0].fixed_view::<3, 3>(0, 0) * axis));
    assert!((found - 0.4 * LIMITS[0].stiffness).abs() < 1e-9);
}

#[test]
fn a_stiffness_that_is_not_finite_is_passed_on_and_forgotten() {
    let mut springs = SeriesSprings::of(&[0], &LIMITS).expect("a limit");
    let stiff = along(Vec3::x(), 5.0);
    let expected = *springs.through(&stiff, 0.0).expect("springs");
    for wrong in [f64::NAN, f64::INFINITY] {
        let mut broken = stiff;
        broken.stiffness[0][0][(0, 0)] = wrong;
        assert!(springs.through(&broken, 0.01).is_none());
        assert!(springs.model().is_none());
        assert_eq!(springs.through(&stiff, 0.01), Some(&expected));
    }
}

#[test]
fn devices_without_a_limit_have_no_springs() {
    assert!(SeriesSprings::of(&[3], &LIMITS).is_none());
    assert!(SeriesSprings::of(&[0], &[Renderable::ANY]).is_none());
    assert!(SeriesSprings::of(&[0], &[]).is_none());
}
