//! A step gives the same bytes for every team: alone, in the other order, and on two, three and four threads.

use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use physics::team::Work;
use physics::{
    Alone, Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Material, Precision,
    Preconditioner, SolidLaw, SolidMaterial, Stepper, StepperOptions, Team, Vec3,
};
use std::sync::Arc;

/// Does the second piece of work first.
#[derive(Debug)]
struct Turned;

impl Team for Turned {
    fn join(&self, one: &mut Work<'_>, other: &mut Work<'_>) {
        other();
        one();
    }
}

/// Does both pieces on the threads of the present pool.
#[derive(Debug)]
struct Pool;

impl Team for Pool {
    fn join(&self, one: &mut Work<'_>, other: &mut Work<'_>) {
        rayon_core::join(one, other);
    }
}

fn handle(vertices: &[u32], x: f64) -> HandleSpec {
    HandleSpec {
        vertices: vertices.to_vec(),
        origin: Vec3::x() * x,
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    }
}

fn solid(law: SolidLaw, cells: [u32; 3], quadratic: bool) -> Body {
    let mut mesh = solid_box([0.1, 0.05, 0.05], cells).unwrap();
    if quadratic {
        mesh = mesh.quadratic();
    }
    let handles = [("left", -0.05), ("right", 0.05)]
        .map(|(name, x)| handle(&mesh.group(name).unwrap().members, x));
    let material = SolidMaterial {
        young: 1e5,
        poisson: 0.3,
        density: 1000.0,
    };
    let config = BodyConfig {
        stiffness_damping: 0.01,
        ..BodyConfig::default()
    };
    Body::solid(&mesh, &[material], law, config, &handles).unwrap()
}

fn cloth() -> Body {
    let mesh = sheet(0.1, 0.1, 80, 80, Pattern::Alternating).unwrap();
    let handles = [("left", -0.05), ("right", 0.05)]
        .map(|(name, x)| handle(&mesh.group(name).unwrap().members, x));
    let material = Material {
        young: 1e6,
        poisson: 0.3,
        thickness: 1e-3,
        density: 1000.0,
    };
    Body::sheet(&mesh, &[material], BodyConfig::default(), &handles).unwrap()
}

/// The bits of the positions and of the force on the hand after some steps.
fn bits<T: Precision>(body: &Body, kind: Preconditioner, team: impl Team + 'static) -> Vec<u64> {
    let mut body = body.clone();
    let options = StepperOptions {
        preconditioner: kind,
        ..StepperOptions::default()
    };
    let mut stepper = Stepper::<T>::new(&body, options).unwrap();
    stepper.team = Arc::new(team);
    let mut poses = [
        HandlePose::at(Vec3::x() * -0.05),
        HandlePose::at(Vec3::x() * 0.05),
    ];
    let mut bits = Vec::new();
    for _ in 0..3 {
        poses[1].position += Vec3::new(-1e-3, 2e-3, 5e-4);
        let report = stepper.step(&mut body, 5e-3, &poses, || false).unwrap();
        assert!(report.iterations > 0, "{report:?}");
        let force = body.handle_report(1).unwrap().wrench_on_hand.force;
        bits.extend(force.iter().map(|x| x.to_bits()));
        bits.push(stepper.elastic_energy().to_bits());
    }
    let x = body.positions().flat_map(|x| [x.x, x.y, x.z]);
    bits.extend(x.map(f64::to_bits));
    bits
}

fn same_for_all<T: Precision>(name: &str, body: &Body, kind: Preconditioner) {
    let alone = bits::<T>(body, kind, Alone);
    assert_eq!(bits::<T>(body, kind, Turned), alone, "{name}");
    for threads in 2..=4 {
        let pool = rayon_core::ThreadPoolBuilder::new().num_threads(threads);
        let on_pool = pool
            .build()
            .unwrap()
            .install(|| bits::<T>(body, kind, Pool));
        assert_eq!(on_pool, alone, "{name}, {threads} threads");
    }
}

#[test]
fn every_team_gives_the_same_bytes() {
    let cells = [24, 10, 10];
    let complete = Preconditioner::Complete;
    let body = solid(SolidLaw::Corotational, cells, false);
    same_for_all::<f64>("corotational", &body, complete);
    same_for_all::<f32>("corotational, single", &body, complete);
    let body = solid(SolidLaw::Linear, cells, false);
    same_for_all::<f64>("linear", &body, Preconditioner::Incomplete);
    let body = solid(SolidLaw::StableNeoHookean, cells, false);
    same_for_all::<f64>("neo-Hookean", &body, Preconditioner::Incomplete);
}

#[test]
fn every_team_gives_the_same_bytes_for_other_elements() {
    let incomplete = Preconditioner::Incomplete;
    for law in [SolidLaw::Corotational, SolidLaw::StVenantKirchhoff] {
        let body = solid(law, [14, 7, 7], true);
        same_for_all::<f64>("quadratic", &body, incomplete);
    }
    same_for_all::<f64>("sheet", &cloth(), Preconditioner::Complete);
}
