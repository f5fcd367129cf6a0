//! A step on several threads allocates nothing.
//!
//! This test has a process of its own. The pool's threads free, now and then, what threads of other pools of the same
//! process left behind when they ended, and the count would contain those calls.

use alloc_count::calls::{Counting, count};
use physics::mesh::generate_box::solid_box;
use physics::team::Work;
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, SolidLaw, SolidMaterial, Stepper,
    StepperOptions, Team, Vec3,
};
use std::sync::Arc;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Does both pieces on the threads of the present pool.
#[derive(Debug)]
struct Pool;

impl Team for Pool {
    fn join(&self, one: &mut Work<'_>, other: &mut Work<'_>) {
        rayon_core::join(one, other);
    }
}

fn solid() -> Body {
    let mesh = solid_box([0.1, 0.05, 0.05], [24, 10, 10]).unwrap();
    let handles = [("left", -0.05), ("right", 0.05)].map(|(name, x)| HandleSpec {
        vertices: mesh.group(name).unwrap().members.clone(),
        origin: Vec3::x() * x,
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    });
    let material = SolidMaterial {
        young: 1e5,
        poisson: 0.3,
        density: 1000.0,
    };
    let config = BodyConfig {
        stiffness_damping: 0.01,
        ..BodyConfig::default()
    };
    Body::solid(&mesh, &[material], SolidLaw::Corotational, config, &handles).unwrap()
}

#[test]
fn steps_on_several_threads_allocate_nothing() {
    let mut body = solid();
    let pool = rayon_core::ThreadPoolBuilder::new().num_threads(3);
    let found = pool.build().unwrap().install(|| {
        let mut stepper = Stepper::<f64>::new(&body, StepperOptions::default()).unwrap();
        stepper.team = Arc::new(Pool);
        let mut poses = [
            HandlePose::at(Vec3::x() * -0.05),
            HandlePose::at(Vec3::x() * 0.05),
        ];
        let mut run = |steps| {
            for _ in 0..steps {
                poses[1].position.y += 1e-5;
                stepper.step(&mut body, 5e-3, &poses, || false).unwrap();
            }
        };
        run(3);
        count(|| run(10))
    });
    assert_eq!(found, 0);
    assert_eq!(count(|| drop(std::hint::black_box(Box::new(7)))), 2);
}
