//! The suite can fail: each check is given the fault that it must find.

use super::specimen::{Isotropic, Kind, quiet};
use super::trial::{Account, Method, Trial};
use super::{Case, Job, Outcome, Verdict};
use physics::{SolidLaw, Vec3};

const KIND: Kind = Kind::Linear(SolidLaw::Corotational);
const METHOD: Method = Method::ImplicitEuler;

fn trial() -> Trial {
    let shape = KIND.mesh(1).unwrap();
    let material = Isotropic::new(1e5, 0.3);
    let mut body = KIND.build(&shape, |_| material, quiet(), &[]).unwrap();
    body.set_velocities(&shape.kick(0.1)).unwrap();
    Trial::new(body, METHOD).unwrap()
}

fn verdict(outcome: Outcome) -> Case {
    Job::new("case".to_owned(), (KIND, METHOD), 1, || Ok(outcome)).run()
}

fn outcome(figure: f64, limit: Option<f64>) -> Outcome {
    Outcome {
        figure,
        limit,
        ..Outcome::default()
    }
}

#[test]
fn a_figure_above_its_limit_or_not_finite_fails() {
    assert_eq!(verdict(outcome(1.0, Some(1.0))).verdict, Verdict::Pass);
    assert_eq!(verdict(outcome(1.1, Some(1.0))).verdict, Verdict::Fail);
    assert_eq!(verdict(outcome(f64::NAN, Some(1.0))).verdict, Verdict::Fail);
    assert_eq!(verdict(outcome(1.1, None)).verdict, Verdict::Reported);
    assert_eq!(verdict(outcome(f64::NAN, None)).verdict, Verdict::Fail);
    assert_eq!(verdict(outcome(f64::INFINITY, None)).verdict, Verdict::Fail);
}

#[test]
fn created_energy_fails() {
    let run = |speed: f64| {
        let mut trial = trial();
        let outcome = Outcome::of_energy(&mut trial, KIND, METHOD, |trial| {
            trial.run(1e-3, 5, &[]);
            trial.ask(|body| {
                let v: Vec<Vec3> = body.velocities().map(|v| v * speed).collect();
                body.set_velocities(&v)
            });
            trial.run(1e-3, 5, &[]);
        });
        verdict(outcome)
    };
    assert_eq!(run(1.0).verdict, Verdict::Pass);
    // The energy exceeds its initial value.
    let case = run(2.0);
    assert_eq!(case.verdict, Verdict::Fail);
    assert!(case.figure > 0.1, "{}", case.figure);
    // The energy rises by a thousandth, far below its initial value: implicit Euler may not even do that.
    let case = run(1.0005);
    assert_eq!((case.verdict, case.figure), (Verdict::Fail, 0.0));
    assert!(case.reason.unwrap().contains("rise"));
}

#[test]
fn a_refusal_that_moves_the_body_fails() {
    let mut trial = trial();
    let granted = trial.ask(|body| {
        let x: Vec<Vec3> = body.positions().map(|x| x + Vec3::x() * 1e-12).collect();
        body.set_positions(&x).unwrap();
        Err::<(), _>("no")
    });
    assert!(!granted);
    let account = trial.account;
    assert_eq!((account.refused, account.error.as_deref()), (1, Some("no")));
    let outcome = Outcome {
        account,
        ..outcome(0.0, Some(1.0))
    };
    let case = verdict(outcome);
    assert_eq!(case.verdict, Verdict::Fail);
    assert!(case.reason.unwrap().contains("not kept"));
}

#[test]
fn a_refusal_that_keeps_the_body_does_not_fail() {
    let mut trial = trial();
    assert!(!trial.step(-1.0, &[]));
    let Account {
        refused, broken, ..
    } = trial.account;
    assert_eq!((refused, broken), (1, None));
}
