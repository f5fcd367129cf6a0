//! Tests of springs in series against known results.

use super::{Spring, VirtualCoupling};
use nalgebra::{SMatrix, SVector, SymmetricEigen};
use rt_core::local_model::{Deviation, PairBlocks};
use rt_core::{HandleReference, LocalModel, MAX_HANDLES, Mat6, Twist, Vec3, Vec6, Wrench};

const LINK: Spring = Spring {
    stiffness: 3000.0,
    damping: 20.0,
};
const LENGTH: f64 = 0.05;
const SIZE: usize = 6 * MAX_HANDLES;

/// A matrix over all handles; zero if there is no handle.
type Whole = SMatrix<f64, SIZE, SIZE>;
type Stacked = SVector<f64, SIZE>;

/// Time over which the drift acts (s).
const AHEAD: f64 = 0.02;

/// A model of a moving body with `handles` handles. Its stiffness is `J^T J`; `J` has `rows` rows. Its
/// damping is a hundredth of the stiffness, in seconds.
fn model(handles: usize, rows: usize, scale: f64) -> LocalModel {
    let size = 6 * handles;
    // Numbers without a pattern, the same everywhere.
    let number = |k: usize| ((k * 7919 + 104_729) % 1009) as f64 / 1009.0 - 0.5;
    let lever = |c: usize| if c % 6 < 3 { 1.0 } else { LENGTH };
    let mut stiffness = Whole::zeros();
    for row in 0..rows {
        let shape = Stacked::from_fn(|c, _| {
            if c < size {
                scale.sqrt() * lever(c) * number(row * size + c)
            } else {
                0.0
            }
        });
        stiffness += shape * shape.transpose();
    }
    let mut model = LocalModel::empty();
    model.head.sequence = 1;
    model.head.energy = 1.0;
    model.head.handle_count = handles as u8;
    for i in 0..handles {
        model.handles[i].device = i as u8;
        model.handles[i].twist = Twist {
            linear: Vec3::new(0.1, -0.2, 0.05),
            angular: Vec3::new(1.0, 0.5, -0.3),
        };
        model.handles[i].wrench = Wrench {
            force: Vec3::new(1.0, -2.0, 0.5 + i as f64),
            moment: Vec3::new(0.02, 0.01, -0.03),
        };
        model.handles[i].drift = Wrench {
            force: Vec3::new(5.0 * i as f64, -3.0, 1.0),
            moment: Vec3::new(0.1, -0.2, 0.3),
        };
        for j in 0..handles {
            model.stiffness[i][j] = Mat6::from_fn(|r, c| stiffness[(6 * i + r, 6 * j + c)]);
            model.damping[i][j] = model.stiffness[i][j] * 0.01;
        }
    }
    model
}

fn through(model: &LocalModel, link: Spring) -> LocalModel {
    let mut coupling = VirtualCoupling::new(vec![link; usize::from(model.head.handle_count)]);
    coupling.set_length(LENGTH);
    *coupling.through(model)
}

fn whole(blocks: &PairBlocks) -> Whole {
    Whole::from_fn(|i, j| blocks[i / 6][j / 6][(i % 6, j % 6)])
}

fn stacked(model: &LocalModel, of: impl Fn(&HandleReference) -> Vec6) -> Stacked {
    Stacked::from_fn(|k, _| of(&model.handles[k / 6])[k % 6])
}

/// The springs' stiffness in a body's coordinates.
fn springs(link: Spring) -> Whole {
    let each = |c, _| link.stiffness * if c % 6 < 3 { 1.0 } else { LENGTH * LENGTH };
    Whole::from_diagonal(&Stacked::from_fn(each))
}

fn largest(matrix: &Whole) -> f64 {
    matrix.iter().fold(0.0, |most, x| x.abs().max(most))
}

#[test]
fn a_spring_before_a_spring_is_both_in_series() {
    let mut model = LocalModel::empty();
    model.head.handle_count = 1;
    model.stiffness[0][0][(0, 0)] = 1000.0;
    model.damping[0][0][(0, 0)] = 4.0;
    model.handles[0].wrench.force = Vec3::new(-2.0, 0.5, 0.0);
    let coupled = through(&model, LINK);
    // k1 k2 / (k1 + k2), and the body's fraction of the displacement k2 / (k1 + k2) = 3 / 4. The bound allows for the
    // rounding of a few operations.
    let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-12 * wanted.abs());
    near(coupled.stiffness[0][0][(0, 0)], 750.0);
    near(coupled.damping[0][0][(0, 0)], 4.0 * 0.5625 + 20.0 * 0.0625);
    near(coupled.handles[0].wrench.force.x, -1.5);
    // If the body does not resist, the proxy coincides with the device.
    assert_eq!(coupled.handles[0].wrench.force.y, 0.5);
    assert_eq!(coupled.stiffness[0][0][(1, 1)], 0.0);
    assert_eq!(coupled.damping[0][0][(1, 1)], 0.0);
}

#[test]
fn the_devices_render_the_wrench_of_proxies_in_balance() {
    // Three bodies resist every motion, and the last one resists few. One body is softer than the springs.
    for (handles, rows, scale) in [(1, 6, 1e3), (2, 12, 1e5), (4, 24, 1e4), (4, 5, 1e6)] {
        let model = model(handles, rows, scale);
        let coupled = through(&model, LINK);
        let (body, springs) = (whole(&model.stiffness), springs(LINK));
        let way = Stacked::from_fn(|k, _| {
            let used = k < 6 * handles;
            if used {
                1e-3 * (k as f64 - 3.0).sin()
            } else {
                0.0
            }
        });
        // At rest the dampers exert no wrench, so their part is removed from the published wrench.
        let speed = stacked(&model, |handle| handle.twist.stacked());
        let wrench = stacked(&model, |handle| handle.wrench.stacked());
        let drift = stacked(&model, |handle| handle.drift.stacked());
        let held = wrench + whole(&model.damping) * speed + drift * AHEAD;
        // (K + Kc) q = a + Kc d, solved as it stands.
        let proxies = (body + springs)
            .cholesky()
            .expect("springs make it definite")
            .solve(&(held + springs * way));
        let wanted = springs * (proxies - way);
        let mut deviations = coupled.deviations(&[]);
        for (i, deviation) in deviations.iter_mut().enumerate().take(handles) {
            *deviation = Deviation {
                displacement: Vec6::from_fn(|r, _| way[6 * i + r]),
                velocity: -coupled.handles[i].twist.stacked(),
            };
        }
        for (i, found) in coupled
            .wrenches(&deviations, AHEAD)
            .iter()
            .enumerate()
            .take(handles)
        {
            for (r, found) in found.stacked().iter().enumerate() {
                let wanted = wanted[6 * i + r];
                // The springs' forces are differences of positions: a thousandth of newtons times the condition, 1e4.
                assert!((found - wanted).abs() < 1e-9, "{handles}: {found} {wanted}");
            }
        }
    }
}

#[test]
fn it_is_symmetric_and_positive_and_no_stiffer_than_body_or_springs() {
    for (handles, rows, scale) in [(1, 2, 1e6), (2, 12, 1e5), (4, 24, 1e3), (4, 7, 1e7)] {
        let model = model(handles, rows, scale);
        let coupled = through(&model, LINK);
        let (body, springs) = (whole(&model.stiffness), springs(LINK));
        let stiffness = whole(&coupled.stiffness);
        let damping = whole(&coupled.damping);
        // The bound allows for the rounding of sums of the body's largest numbers.
        let small = 1e-12 * largest(&body);
        let positive = |what: &str, matrix: Whole| {
            assert_eq!(matrix, matrix.transpose(), "{what}");
            let least = SymmetricEigen::new(matrix).eigenvalues.min();
            assert!(least > -small, "{what}: {least}, {handles} handles");
        };
        positive("stiffness", stiffness);
        positive("damping", damping);
        positive("body", body - stiffness);
        positive("springs", springs - stiffness);
    }
}

#[test]
fn stiff_springs_leave_the_body_as_it_is() {
    let model = model(2, 12, 1e4);
    let body = whole(&model.stiffness);
    let error = |stiffness: f64| {
        let link = Spring {
            stiffness,
            damping: 20.0,
        };
        let coupled = through(&model, link);
        let stiffness = largest(&(whole(&coupled.stiffness) - body)) / largest(&body);
        let damping = whole(&coupled.damping) - whole(&model.damping);
        let damping = largest(&damping) / (0.01 * largest(&body));
        let wrench = |m: &LocalModel| stacked(m, |handle| handle.wrench.stacked());
        let wrench = (wrench(&coupled) - wrench(&model)).norm() / wrench(&model).norm();
        [stiffness, damping, wrench]
    };
    for (coarse, fine) in error(1e8).into_iter().zip(error(1e9)) {
        // The error is of first order in the compliance: it falls to a tenth. The next term is 1e-4 of the first.
        assert!(
            fine > 0.0 && (coarse / fine - 10.0).abs() < 0.01,
            "{coarse} {fine}"
        );
        assert!(fine < 1e-3);
    }
}

#[test]
fn a_body_without_stiffness_is_rendered_unchanged() {
    let free = model(3, 0, 1.0);
    let mut wanted = free;
    wanted.head.energy = 0.0;
    assert_eq!(through(&free, LINK), wanted);
}
