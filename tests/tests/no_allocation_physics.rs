//! A step of the physics allocates nothing, for every body, law and scheme: patterns and buffers are fixed and made
//! once.

use alloc_count::calls::{Counting, count};
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, Condenser, Equilibrium, EquilibriumOptions, Freedom, HandlePose,
    HandleSpec, Integrator, IntegratorOptions, Material, Phase, Precision, Preconditioner,
    ShapeOptions, Shapes, SheetLawName, SolidLaw, SolidMaterial, Stepper, StepperOptions,
    TimeScheme, Vec3, Weave,
};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const CONFIG: BodyConfig = BodyConfig {
    gravity: Vec3::new(0.0, 0.0, -9.81),
    mass_damping: 0.5,
    stiffness_damping: 0.002,
    bending: 0.0,
    tolerance: 1e-8,
    absolute_tolerance: 1e-12,
    max_iterations: 2000,
};

fn handle(vertices: &[u32], origin: Vec3) -> HandleSpec {
    HandleSpec {
        vertices: vertices.to_vec(),
        origin,
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    }
}

/// Each kind of body with two handles, of which the second moves, and a support along one axis.
fn bodies() -> Vec<(String, Body, [Vec3; 2])> {
    let mut all = Vec::new();
    let linear = solid_box([0.1, 0.04, 0.04], [3, 2, 2]).unwrap();
    let ends = [Vec3::x() * -0.05, Vec3::x() * 0.05];
    for mesh in [linear.quadratic(), linear] {
        let handles: Vec<_> = ["left", "right"]
            .iter()
            .zip(ends)
            .map(|(name, end)| handle(&mesh.group(name).unwrap().members, end))
            .collect();
        for law in [
            SolidLaw::Linear,
            SolidLaw::Corotational,
            SolidLaw::StVenantKirchhoff,
            SolidLaw::StableNeoHookean,
        ] {
            let material = SolidMaterial {
                young: 1e5,
                poisson: 0.4,
                density: 1000.0,
            };
            let mut body = Body::solid(&mesh, &[material], law, CONFIG, &handles).unwrap();
            let held = |v: &u32| handles.iter().any(|handle| handle.vertices.contains(v));
            let bottom = mesh.group("bottom").unwrap().members.iter();
            let guided: Vec<u32> = bottom.copied().filter(|v| !held(v)).collect();
            body.add_support(&guided, [false, true, false]).unwrap();
            all.push((format!("{law:?} {}", mesh.positions.len()), body, ends));
        }
    }
    let mesh = sheet(0.1, 0.04, 6, 4, Pattern::Alternating).unwrap();
    let handles: Vec<_> = ["left", "right"]
        .iter()
        .zip(ends)
        .map(|(name, end)| handle(&mesh.group(name).unwrap().members, end))
        .collect();
    let material = Material {
        young: 1e6,
        poisson: 0.3,
        thickness: 1e-3,
        density: 1000.0,
    };
    let bent = BodyConfig {
        bending: 1.0,
        ..CONFIG
    };
    for border in [Border::Hinged, Border::Clamped] {
        let held = handles.iter().cloned();
        let held: Vec<_> = held.map(|spec| HandleSpec { border, ..spec }).collect();
        let mut body = Body::sheet(&mesh, &[material], bent, &held).unwrap();
        if border == Border::Clamped {
            let bottom = mesh.group("bottom").unwrap().members.iter();
            let inner = bottom.filter(|v| mesh.positions[**v as usize].x.abs() < 0.02);
            body.add_clamp(&inner.copied().collect::<Vec<u32>>())
                .unwrap();
        }
        all.push((format!("sheet {border:?}"), body, ends));
    }
    let weave = Weave {
        warp: Vec3::x(),
        young_warp: 1e6,
        young_weft: 4e5,
        poisson: 0.2,
        shear: 1e5,
        thickness: 1e-3,
        density: 300.0,
        rigidity: physics::Rigidity::default(),
    };
    for law in [SheetLawName::Corotational, SheetLawName::StVenantKirchhoff] {
        let body = Body::woven(&mesh, &[weave], law, CONFIG, &handles).unwrap();
        all.push((format!("woven {law:?}"), body, ends));
    }
    all
}

/// Poses of the handles after step `k`: the second handle is pulled, lifted and turned, evenly.
fn targets(ends: [Vec3; 2], k: usize) -> [HandlePose; 2] {
    let count = k as f64;
    let mut pulled = HandlePose::at(ends[1] + Vec3::new(1e-4, 0.0, 1e-4) * count);
    pulled.rotation = nalgebra::UnitQuaternion::from_scaled_axis(Vec3::x() * (2e-3 * count));
    [HandlePose::at(ends[0]), pulled]
}

#[test]
fn linearized_steps_and_condensations_allocate_nothing() {
    for (name, mut body, ends) in bodies() {
        let mut condenser = Condenser::new(&body).unwrap();
        let mut run = |steps: std::ops::Range<usize>| {
            for k in steps {
                body.assemble();
                body.solve(2e-3, &targets(ends, k)).unwrap();
                body.assemble();
                condenser.condense(&body, 1e-2).unwrap();
            }
        };
        run(0..2);
        assert_eq!(count(|| run(2..12)), 0, "{name}");
    }
}

/// The fast step allocates nothing, either, with local models, new factors, waking and falling asleep.
fn fast_steps_allocate_nothing<T: Precision>(preconditioner: Preconditioner) {
    for (name, mut body, ends) in bodies() {
        let options = StepperOptions {
            preconditioner,
            refresh: false,
            patience: 0,
            // The incomplete factor needs more iterations.
            max_iterations: 1000,
            ..StepperOptions::default()
        };
        let mut stepper = Stepper::<T>::new(&body, options).unwrap();
        let mut shapes = Shapes::default();
        let mut factors = 0;
        let mut run = |steps: std::ops::Range<usize>| {
            for k in steps {
                stepper
                    .step(&mut body, 2e-3, &targets(ends, k.min(12)), || false)
                    .unwrap();
                shapes
                    .condense(&mut stepper, &body, 1e-2, &ShapeOptions::default())
                    .unwrap();
                if let Some(mut refresher) = stepper.lend() {
                    refresher.work().unwrap();
                    while !refresher.read_ahead(2) {}
                    stepper.give_back(refresher);
                    factors += 1;
                }
                if k % 50 == 1 {
                    stepper.repeat(Phase::Refresh).unwrap();
                }
            }
        };
        run(0..2);
        assert_eq!(count(|| run(2..200)), 0, "{name}");
        // A new incomplete factor is not requested while the old one is as good.
        let least = if preconditioner == Preconditioner::Complete {
            3
        } else {
            0
        };
        assert!(factors >= least, "{name}");
    }
}

#[test]
fn fast_steps_of_either_precision_allocate_nothing() {
    for preconditioner in [Preconditioner::Complete, Preconditioner::Incomplete] {
        fast_steps_allocate_nothing::<f64>(preconditioner);
        fast_steps_allocate_nothing::<f32>(preconditioner);
    }
}

#[test]
fn steps_to_a_tolerance_allocate_nothing() {
    for scheme in [TimeScheme::ImplicitEuler, TimeScheme::TrBdf2] {
        for (name, mut body, ends) in bodies() {
            let options = IntegratorOptions {
                scheme,
                ..IntegratorOptions::default()
            };
            let mut integrator = Integrator::new(&body, options).unwrap();
            let mut run = |steps: std::ops::Range<usize>| {
                for k in steps {
                    integrator.step(&mut body, 2e-3, &targets(ends, k)).unwrap();
                }
            };
            run(0..2);
            assert_eq!(count(|| run(2..8)), 0, "{name}, {scheme:?}");
        }
    }
}

#[test]
fn equilibrium_allocates_nothing() {
    for (name, mut body, ends) in bodies() {
        let mut equilibrium = Equilibrium::new(&body, EquilibriumOptions::default()).unwrap();
        let mut run = |steps: std::ops::Range<usize>| {
            for k in steps {
                equilibrium
                    .solve(&mut body, &targets(ends, 10 * k), 1.0)
                    .unwrap();
            }
        };
        run(0..2);
        assert_eq!(count(|| run(2..5)), 0, "{name}");
    }
}
