//! The figures of `palpate bench accuracy` on its coarse meshes, compared with theory.

use std::sync::LazyLock;
use study::Level;
use study::accuracy::{self, Accuracy, Series};

static FOUND: LazyLock<Accuracy> = LazyLock::new(|| {
    accuracy::run(Level::Quick, &mut |_| ()).expect("all benchmarks can be computed")
});

fn series(name: &str) -> &'static Series {
    FOUND.get(name).expect("the study has the series")
}

/// The order of convergence at the finest mesh.
fn order(name: &str) -> f64 {
    let last = series(name).finest().expect("it has points");
    last.order.expect("it has an order")
}

fn errors(name: &str) -> Vec<f64> {
    series(name)
        .points
        .iter()
        .map(|point| point.error)
        .collect()
}

#[test]
fn the_stress_at_a_hole_is_that_of_an_independent_program_and_converges() {
    for name in [
        "kirsch_graded_1.15",
        "kirsch_graded_1.3",
        "kirsch_uniform",
        "kirsch_uniform_wide",
    ] {
        for point in &series(name).points {
            let other = point.independent.expect("it is known for every mesh");
            // The law of the sheet is nonlinear, which changes the stress by a fraction of the order of the strain at
            // the hole, 3e-7, times the stretch. Positions resolve a strain of 1e-7 to 1e-16 over the size of the
            // smallest cell.
            assert!((point.ours / other - 1.0).abs() < 2e-6, "{name} {point:?}");
        }
    }
    // Published figures of these gradings: 1.2, 0.9 and 0.5 % low at 1.4, 1.9 and 3.3 thousand triangles.
    for (error, expected) in errors("kirsch_graded_1.15")
        .iter()
        .zip([0.012, 0.009, 0.005])
    {
        // The tolerance is that of the published digits.
        assert!((error + expected).abs() < 6e-4, "{error}");
    }
    for name in ["kirsch_graded_1.15", "kirsch_graded_1.3"] {
        assert!(
            errors(name)
                .windows(2)
                .all(|pair| pair[1].abs() < pair[0].abs())
        );
    }
}

#[test]
fn cook_s_membrane_converges_and_only_linear_tetrahedra_lock() {
    // For smooth solutions the convergence is of second order; the singularity at the held corner reduces the order.
    assert!(order("cook_sheet") > 1.8, "{}", order("cook_sheet"));
    assert!(errors("cook_sheet").iter().all(|error| *error < 0.0));
    // Other programs' triangles of constant strain have an error of one percent with 32 cells, too.
    assert!(errors("cook_sheet")[2] > -0.01);
    assert!(errors("cook_quadratic")[1] > -0.005);
    // On any mesh, nearly incompressible linear tetrahedra have less than a third of the deflection. Quadratic
    // tetrahedra have an error of two percent.
    let (linear, quadratic) = (
        errors("cook_incompressible_linear"),
        errors("cook_incompressible_quadratic"),
    );
    assert!(linear.iter().all(|error| *error < -2.0 / 3.0), "{linear:?}");
    assert!(quadratic[2].abs() < 0.025, "{quadratic:?}");
    // The singularity at the corner, not the elements, determines this order.
    assert!(order("cook_incompressible_quadratic") > 1.4);
}

#[test]
fn sheets_bend_as_thin_plates_on_any_mesh() {
    for problem in ["strip_end", "strip_press", "strip_wide", "plate"] {
        for cut in ["", "_moved", "_alternating"] {
            let name = format!("{problem}{cut}");
            // The second order, and the next term of the error on meshes of up to 32 cells.
            assert!((order(&name) - 2.0).abs() < 0.2, "{name} {}", order(&name));
            assert!(
                errors(&name).iter().all(|error| *error > 0.0),
                "{name}: too soft, never too stiff"
            );
            // The clamped plate of 32 cells a side errs most, by 1.2 %.
            assert!(errors(&name)[2] < 0.015, "{name} {:?}", errors(&name));
        }
    }
    // The strain of a quadratic tetrahedron is linear: deflections of a beam converge at least with the second order.
    assert!(
        order("strip_quadratic") > 1.9,
        "{}",
        order("strip_quadratic")
    );
    assert!(errors("strip_quadratic")[2].abs() < 1e-3);
}

#[test]
fn strips_pull_as_their_law_predicts() {
    // The force is exact, up to 1e-9 of the balanced forces (Newton's method).
    for name in ["strip_corotational", "strip_stvk"] {
        assert!(errors(name)[0].abs() < 1e-8, "{name} {:?}", errors(name));
    }
    // The tolerance is half of the last digit of the other program's figure.
    assert!((series("strip_clamped").points[0].ours - 8.138_05).abs() < 0.5e-5);
}

#[test]
fn linear_elements_converge_with_order_two_and_quadratic_ones_with_three() {
    let (linear, quadratic) = (
        order("manufactured_linear"),
        order("manufactured_quadratic"),
    );
    // The next term of the error is some percent of the first term on these meshes.
    assert!((linear - 2.0).abs() < 0.1, "{linear}");
    assert!((quadratic - 3.0).abs() < 0.1, "{quadratic}");
}

#[test]
fn near_incompressibility_locks_linear_elements_and_not_quadratic_ones() {
    let (linear, quadratic) = (errors("locking_linear"), errors("locking_quadratic"));
    // From nu = 0.3 to 0.4999 the exact deflection hardly changes.
    assert!(1.0 + linear[1] < 0.05 * (1.0 + linear[0]), "{linear:?}");
    // The held end, which may not contract, changes the deflection by a fraction of the order of nu^2 times the
    // slenderness.
    assert!(
        1.0 + quadratic[1] > 0.9 * (1.0 + quadratic[0]),
        "{quadratic:?}"
    );
    assert!(quadratic[0].abs() < 0.02, "{quadratic:?}");
}

#[test]
fn the_force_of_a_bonded_cube_is_that_of_an_independent_program() {
    for name in ["cube_linear", "cube_corotational"] {
        for point in &series(name).points {
            let other = point.independent.expect("it is known for every mesh");
            // The tolerance is half of the last of eight digits, plus the residual of Newton's method.
            assert!((point.ours - other).abs() < 1e-6, "{name} {point:?}");
        }
        assert!(errors(name)[1] < errors(name)[0]);
    }
    // Quadratic cells that are twice as wide as the linear ones have as many vertices, and less than half of the error.
    let (linear, quadratic) = (errors("cube_linear"), errors("cube_quadratic"));
    assert!(quadratic[0] > 0.0 && quadratic[0] < 0.5 * linear[0]);
}

#[test]
fn time_schemes_have_the_order_they_state() {
    let (euler, second) = (order("time_implicit_euler"), order("time_tr_bdf2"));
    // The steps of the reference are 8 times shorter, so its error is a sixty-fourth.
    assert!((euler - 1.0).abs() < 0.05, "{euler}");
    assert!((second - 2.0).abs() < 0.05, "{second}");
}

#[test]
fn a_local_model_predicts_one_step_exactly_and_with_its_drift_a_steady_motion() {
    let found = &FOUND.local_models;
    // The tolerance is 1e-12 of the linear solver, times the condition number of its matrix.
    assert!(found.exactness < 1e-9, "{:e}", found.exactness);
    for cell in found
        .predictions
        .iter()
        .filter(|cell| cell.motion == "steady")
    {
        // With the drift, the error is of second order in time.
        assert!(cell.error < 0.02, "{cell:?}");
        // Without the drift, the model of a short period attributes the steady motion to the displacement of the hand,
        // and is too stiff: it is condensed for a body that has no time to respond.
        if cell.period < 2.5e-3 {
            assert!(cell.error_without_drift > 10.0 * cell.error, "{cell:?}");
        }
    }
    // After a jump of the velocity, the model is better than none in every case.
    assert!(
        found
            .predictions
            .iter()
            .filter(|cell| cell.motion == "from_rest")
            .all(|cell| cell.error < 0.6)
    );
}
