//! A certified displacement gives a body no energy: neither by its shortening, nor by a solution that goes too far.

use physics::mesh::generate_box::solid_box;
use physics::{Body, BodyConfig, SolidLaw, SolidMaterial, Stepper, StepperOptions, Vec3};
use proptest::prelude::*;

const H: f64 = 2e-3;

/// A free bar with velocities of its nodes (m/s), at the end of the solve of its first step.
fn solved(velocity: impl Fn(usize, &Vec3) -> Vec3) -> (Body, Stepper<f64>) {
    let mesh = solid_box([0.2, 0.05, 0.05], [4, 1, 1]).unwrap();
    let rubber = SolidMaterial {
        young: 2e5,
        poisson: 0.4,
        density: 1000.0,
    };
    let config = BodyConfig::default();
    let mut body = Body::solid(&mesh, &[rubber], SolidLaw::Corotational, config, &[]).unwrap();
    let x = body.node_positions().to_vec();
    let v: Vec<Vec3> = x
        .iter()
        .enumerate()
        .map(|(node, x)| velocity(node, x))
        .collect();
    body.set_velocities(&v).unwrap();
    let mut stepper = Stepper::new(&body, StepperOptions::default()).unwrap();
    stepper.predict(&body, H).unwrap();
    stepper.constrain(&mut body, &[]).unwrap();
    stepper.solve(|| false).unwrap();
    (body, stepper)
}

fn elastic_energy_after(mut body: Body, mut stepper: Stepper<f64>, fraction: f64) -> f64 {
    stepper.certify(&|_| fraction, &mut |_, _| {}).unwrap();
    stepper.finish(&mut body, || false).unwrap();
    body.elastic_energy()
}

/// The work (J) of the forces that shorten the displacement.
fn work(stepper: &mut Stepper<f64>, fraction: &dyn Fn(u32) -> f64) -> f64 {
    let mut sum = 0.0;
    stepper
        .certify(fraction, &mut |_, work| sum += work)
        .unwrap();
    sum
}

proptest! {
    #[test]
    fn shortening_does_no_work(
        velocities in prop::collection::vec([-1.0..1.0, -1.0..1.0, -1.0..1.0], 20),
        fractions in prop::collection::vec(0.0..1.0, 20),
    ) {
        let (_, mut stepper) = solved(|node, _| Vec3::from(velocities[node]));
        let by = stepper.fraction_without_gain(&|node| fractions[node as usize]);
        prop_assert!((0.0..=1.0).contains(&by));
        let work = work(&mut stepper, &|node| by * fractions[node as usize]);
        // The kinetic energy is of the order of 0.1 J.
        prop_assert!(work <= 1e-9, "{work:e}");
    }
}

#[test]
fn a_node_that_goes_on_beside_one_that_stops_gives_energy() {
    let fraction = |node: u32| f64::from(node % 2);
    let upwards = |_: usize, _: &Vec3| Vec3::z();
    let (_, mut stepper) = solved(upwards);
    let by = stepper.fraction_without_gain(&fraction);
    assert!(by < 0.9, "{by}");
    assert!(work(&mut stepper, &fraction) > 1e-3);
}

#[test]
fn a_solution_that_turns_too_far_is_held_back() {
    let turning = |rate: f64| move |_: usize, x: &Vec3| Vec3::z().cross(x) * rate;
    let nothing = |_: f64| 0.0;
    let (body, mut stepper) = solved(turning(10.0));
    assert_eq!(stepper.fraction_of_least(&body, &|_| 1.0, &nothing), 1.0);
    // By 1.5 radians in a step.
    let (body, mut stepper) = solved(turning(1.5 / H));
    let by = stepper.fraction_of_least(&body, &|_| 1.0, &nothing);
    assert!(by < 1.0);
    let held = elastic_energy_after(body, stepper, by);
    let (body, stepper) = solved(turning(1.5 / H));
    let whole = elastic_energy_after(body, stepper, 1.0);
    assert!(held < 0.5 * whole, "{held} {whole}");
}
