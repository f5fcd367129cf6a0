//! A publisher beside a plain body of the physics, without scene and engine: a cube of gelatine in two hands.

use host::engine::publisher::{Elastic, Publisher, Publishing};
use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, Condenser, Freedom, HandlePose, HandleSpec, SolidLaw, SolidMaterial,
    Vec3,
};
use rt_core::{Pose, Twist};

const EDGE: f64 = 0.1;
/// So long that inertia counts for nothing.
const PERIOD: f64 = 100.0;
const GELATINE: SolidMaterial = SolidMaterial {
    young: 2e4,
    poisson: 0.3,
    density: 1000.0,
};

/// A linear cube whose lower and upper faces are handles.
fn cube() -> Result<Body, Box<dyn std::error::Error>> {
    let mesh = solid_box([EDGE; 3], [3; 3])?;
    let handles = [-0.5, 0.5].map(|side| {
        let z: f64 = side * EDGE;
        let on_face = |x: &Vec3| (x.z - z).abs() < 1e-9;
        let vertices = (0..).zip(&mesh.positions);
        HandleSpec {
            vertices: vertices
                .filter_map(|(v, x)| on_face(x).then_some(v))
                .collect(),
            origin: Vec3::z() * z,
            freedom: Freedom::Rigid,
            border: Border::Hinged,
        }
    });
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        ..BodyConfig::default()
    };
    let law = SolidLaw::Linear;
    Ok(Body::solid(&mesh, &[GELATINE], law, config, &handles)?)
}

#[test]
fn a_plain_body_is_published_with_the_force_and_the_energy_of_its_hands()
-> Result<(), Box<dyn std::error::Error>> {
    let mut body = cube()?;
    let mut condenser = Condenser::new(&body)?;
    let publishing = Publishing {
        period: PERIOD,
        horizon: PERIOD,
        energy: true,
        ..Publishing::default()
    };
    let mut publisher = Publisher::new(&body, &[3, 1], publishing);
    let mut poses = [-0.5, 0.5].map(|side| HandlePose::at(Vec3::z() * (side * EDGE)));
    for (number, pressed) in [(1, 1e-3), (2, 2e-3)] {
        poses[1].position.z = 0.5 * EDGE - pressed;
        // Long steps without inertia: the body comes to rest.
        for _ in 0..3 {
            body.step(PERIOD, &poses)?;
        }
        let time_ns = number * 1_000_000;
        assert!(publisher.is_due(time_ns));
        body.assemble();
        publisher.take(condenser.condense(&body, PERIOD)?);
        let elastic = body.elastic_energy();
        let model = publisher.publish(&body, Elastic::Whole(elastic), time_ns);
        assert_eq!((model.head.sequence, model.head.time_ns), (number, time_ns));
        let devices: Vec<u8> = model.handles().map(|handle| handle.device).collect();
        assert_eq!(devices, [3, 1]);

        // The hands bear the force of the body, and what they stored is its energy: F u / 2 of a linear body.
        let force = model.handles[1].wrench.force;
        assert!((model.handles[0].wrench.force + force).norm() < 1e-3 * force.norm());
        let stored = 0.5 * force.z * pressed;
        assert!((elastic / stored - 1.0).abs() < 1e-3, "{elastic} {stored}");
        assert!((model.head.energy / stored - 1.0).abs() < 1e-3, "{model:?}");
        // The body stored nothing before its hands moved.
        assert!(model.head.released < 1e-12 * stored, "{model:?}");

        // Back where the body began, the model of a linear body has no force.
        let back = [-0.5, 0.5].map(|side| (Pose::at(Vec3::z() * (side * EDGE)), Twist::zero()));
        let wrenches = model.wrenches(&model.deviations(&back), 0.0);
        assert!(wrenches[1].force.norm() < 1e-3 * force.norm());
        // The tick would refuse a second model of the same time.
        assert!(!publisher.is_due(time_ns));
    }
    Ok(())
}

#[test]
fn the_first_model_states_the_energy_that_the_body_had_before_its_hands_moved()
-> Result<(), Box<dyn std::error::Error>> {
    let publishing = Publishing {
        period: PERIOD,
        horizon: PERIOD,
        energy: true,
        ..Publishing::default()
    };
    let energy_at = |body: &mut Body, pressed: f64| -> Result<f64, Box<dyn std::error::Error>> {
        let mut poses = [-0.5, 0.5].map(|side| HandlePose::at(Vec3::z() * (side * EDGE)));
        poses[1].position.z -= pressed;
        for _ in 0..3 {
            body.step(PERIOD, &poses)?;
        }
        body.assemble();
        Ok(body.elastic_energy())
    };
    // How far the cube is pressed before the hands take hold, and when the first and the second model come (m).
    for [before, first, second] in [
        [0.0, 2e-3, 1e-3],
        [1e-3, 2e-3, 3e-3],
        [2e-3, 1e-3, 0.0],
        [1e-3, -1e-3, 2e-3],
    ] {
        let mut body = cube()?;
        let mut condenser = Condenser::new(&body)?;
        let had = energy_at(&mut body, before)?;
        let mut publisher = Publisher::new(&body, &[0, 1], publishing.clone());
        let mut released = [0.0; 2];
        for ((number, pressed), released) in [(1, first), (2, second)].into_iter().zip(&mut released) {
            let elastic = energy_at(&mut body, pressed)?;
            publisher.take(condenser.condense(&body, PERIOD)?);
            let model = publisher.publish(&body, Elastic::Whole(elastic), number);
            *released = model.head.released;
            if number == 1 {
                // A cube that its hands let expand gave them this energy, and they cannot get it again.
                let wanted = had.min(elastic);
                let off = (model.head.released - wanted).abs();
                assert!(off <= 1e-3 * elastic, "{before} {first}: {off} of {elastic}");
            }
        }
        // Later motions of the hands are no energy of the body's own.
        assert!((released[1] - released[0]).abs() < 1e-12, "{released:?}");
    }
    Ok(())
}
