//! A step in four calls is the step in one call, whatever other bodies do between the calls.

use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, SolidLaw, SolidMaterial, StepError,
    Stepper, StepperOptions, Vec3,
};

const H: f64 = 2e-3;

fn bar(law: SolidLaw) -> Body {
    let mesh = solid_box([0.2, 0.05, 0.05], [6, 2, 2]).unwrap();
    let end = |right: bool| {
        let numbered = (0_u32..).zip(&mesh.positions);
        let held = numbered.filter(|(_, x)| {
            if right {
                x.x > 0.1 - 1e-9
            } else {
                x.x < -0.1 + 1e-9
            }
        });
        HandleSpec {
            vertices: held.map(|(vertex, _)| vertex).collect(),
            origin: Vec3::new(if right { 0.1 } else { -0.1 }, 0.0, 0.0),
            freedom: Freedom::Rigid,
            border: Border::Hinged,
        }
    };
    let rubber = SolidMaterial {
        young: 2e5,
        poisson: 0.4,
        density: 1000.0,
    };
    let config = BodyConfig {
        stiffness_damping: 1e-3,
        ..BodyConfig::default()
    };
    Body::solid(&mesh, &[rubber], law, config, &[end(false), end(true)]).unwrap()
}

fn poses(step: u32) -> [HandlePose; 2] {
    let lift = 2e-4 * f64::from(step.min(60));
    [
        HandlePose::at(Vec3::new(-0.1, 0.0, 0.0)),
        HandlePose::at(Vec3::new(0.1, 0.0, lift)),
    ]
}

fn bits(body: &Body) -> Vec<u64> {
    let vectors = body.positions().chain(body.velocities());
    vectors
        .flat_map(|v| [v.x.to_bits(), v.y.to_bits(), v.z.to_bits()])
        .collect()
}

/// The number of steps is large enough for bodies to fall asleep and wake up.
#[test]
fn four_calls_over_two_bodies_are_a_step_of_each() {
    let options = StepperOptions {
        sleep_speed: 1e-3,
        ..StepperOptions::default()
    };
    let laws = [SolidLaw::Corotational, SolidLaw::StableNeoHookean];
    let mut alone = laws.map(bar);
    let mut steppers = alone
        .each_ref()
        .map(|body| Stepper::<f64>::new(body, options).unwrap());
    let mut together = laws.map(bar);
    let mut staged = together
        .each_ref()
        .map(|body| Stepper::<f64>::new(body, options).unwrap());
    let mut slept = false;
    for step in 1..=400 {
        let targets = poses(if step < 350 { step } else { step - 340 });
        let mut expected = Vec::new();
        for (body, stepper) in alone.iter_mut().zip(&mut steppers) {
            expected.push(stepper.step(body, H, &targets, || false).unwrap());
        }
        for (body, stepper) in together.iter().zip(&mut staged) {
            stepper.predict(body, H).unwrap();
        }
        for (body, stepper) in together.iter_mut().zip(&mut staged) {
            stepper.constrain(body, &targets).unwrap();
        }
        for stepper in &mut staged {
            stepper.solve(|| false).unwrap();
        }
        for ((body, stepper), expected) in together.iter_mut().zip(&mut staged).zip(expected) {
            let report = stepper.finish(body, || false).unwrap();
            assert_eq!(report, expected, "step {step}");
            slept |= report.asleep;
        }
    }
    assert!(slept);
    for (one, other) in alone.iter().zip(&together) {
        assert!(bits(one) == bits(other));
    }
}

#[test]
fn calls_out_of_order_are_refused_and_move_nothing() {
    let mut body = bar(SolidLaw::Corotational);
    let before = bits(&body);
    let missing = |call, first| Err(StepError::Order { call, first });
    let mut stepper = Stepper::<f64>::new(&body, StepperOptions::default()).unwrap();
    let targets = poses(1);
    assert_eq!(
        stepper.constrain(&mut body, &targets),
        missing("constrain", "predict")
    );
    assert_eq!(stepper.solve(|| false), missing("solve", "constrain"));
    stepper.predict(&body, H).unwrap();
    assert_eq!(
        stepper.constrain(&mut body, &targets[..1]),
        Err(StepError::Targets {
            found: 1,
            expected: 2
        })
    );
    // After a refusal, the step must begin again.
    assert_eq!(
        stepper.constrain(&mut body, &targets),
        missing("constrain", "predict")
    );
    stepper.predict(&body, H).unwrap();
    stepper.constrain(&mut body, &targets).unwrap();
    stepper.solve(|| false).unwrap();
    // The release of a handle between two calls ends the step.
    let mut other = body.clone();
    other.release(1).unwrap();
    let finished = stepper.finish(&mut other, || false);
    assert_eq!(finished.map(|_| ()), missing("finish", "solve"));
    assert_eq!(bits(&body), before);
}
