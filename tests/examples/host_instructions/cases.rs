//! The counted calls: steps of the fast path, the work beside them, the assembled step, a whole step of the host, and the
//! springs of a publication.
//!
//! The number of iterations is fixed at the number that a tolerance of 1e-6 needs here, to within one. Counts then
//! depend on the code only, and do not jump where rounding moves a residual below its tolerance. The remaining residual
//! is checked against [`MOST_RESIDUAL`], so that every counted call solves its problem.

use host::engine::Engine;
use host::engine::build::{BuildOptions, bodies};
use host::engine::contact::Contact;
use host::engine::pacer::Due;
use host::engine::stats::Stopwatch;
use host::engine::stiff::{Renderable, SeriesSprings};
use host::scene::Scene;
use host::world::World;
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, Budget, Freedom, HandlePose, HandleSpec, Material, Precision,
    ShapeOptions, Shapes, SolidLaw, SolidMaterial, Stepper, StepperOptions, Vec3,
};
use rt_core::{LocalModel, Mat6, Pose, TickRecord};
use std::collections::BTreeMap;
use std::error::Error;
use std::hint::black_box;

/// Length of a step (s).
const H: f64 = 1e-2;
/// Steps before the counted step: the guess needs the previous step, and rotations start from the previous ones.
const SETTLE: u32 = 50;
/// Age of the factor (steps).
const AGE: u32 = 10;
/// Speed at which one end is pulled (m/s).
const SPEED: f64 = 0.01;

/// Iterations of a fast step.
const ITERATIONS: usize = 2;
/// Iterations for each shape of a local model.
const SHAPE_ITERATIONS: usize = 1;
/// Iterations of an assembled step.
const ASSEMBLED_ITERATIONS: usize = 42;
/// Largest residual after the iterations, as a fraction of the forces: far above the residuals here.
const MOST_RESIDUAL: f64 = 1e-5;

/// Time from one model to the next (s).
const PERIOD: f64 = 4e-3;

type Failure = Box<dyn Error>;

/// Prepares a call.
pub(crate) type Prepare = fn() -> Result<Case, Failure>;

/// Name and preparation of each case of the table: the kinds of elements, the laws, the precisions, a model, a factor,
/// and the springs of a publication at their largest number.
pub(crate) const GATE: [(&str, Prepare); 14] = [
    ("step, solid, f64", || step::<f64>(solid(6, false)?)),
    ("step, solid, f32", || step::<f32>(solid(6, false)?)),
    ("step, quadratic solid, f64", || {
        step::<f64>(solid(3, true)?)
    }),
    ("step, St. Venant-Kirchhoff solid, f64", || {
        step::<f64>(solid_of(SolidLaw::StVenantKirchhoff, 6, false)?)
    }),
    ("step, neo-Hookean solid, f64", || {
        step::<f64>(solid_of(SolidLaw::StableNeoHookean, 6, false)?)
    }),
    ("step, neo-Hookean solid, f32", || {
        step::<f32>(solid_of(SolidLaw::StableNeoHookean, 6, false)?)
    }),
    ("step, quadratic neo-Hookean solid, f64", || {
        step::<f64>(solid_of(SolidLaw::StableNeoHookean, 3, true)?)
    }),
    ("step, sheet, f64", || step::<f64>(strip()?)),
    ("local model, solid, f64", local_model),
    ("factor, solid, f64", factor),
    ("host step, solid alone", || host_step(false)),
    ("host step, solid and an obstacle far away", || {
        host_step(true)
    }),
    ("springs, 8 soft handles", || springs(8, SOFT)),
    ("springs, 8 stiff handles", || springs(8, STIFF)),
];

/// The cases that are counted on demand.
const OTHERS: [(&str, Prepare); 9] = [
    ("step, small strains, f64", || {
        step::<f64>(solid_of(SolidLaw::Linear, 6, false)?)
    }),
    ("step, sheet, f32", || step::<f32>(strip()?)),
    ("assembled step, solid", assembled),
    ("springs, 1 soft handle", || springs(1, SOFT)),
    ("springs, 2 soft handles", || springs(2, SOFT)),
    ("springs, 4 soft handles", || springs(4, SOFT)),
    ("springs, 1 stiff handle", || springs(1, STIFF)),
    ("springs, 2 stiff handles", || springs(2, STIFF)),
    ("springs, 4 stiff handles", || springs(4, STIFF)),
];

/// All cases.
pub(crate) fn all() -> Vec<(&'static str, Prepare)> {
    GATE.into_iter().chain(OTHERS).collect()
}

/// Stiffness along the body as a multiple of what the devices render.
const SOFT: f64 = 0.1;
const STIFF: f64 = 20.0;

/// Steps under laws of large strains, and the corotational steps on the same meshes.
pub(crate) const LAWS: [(&str, &str); 4] = [
    ("step, St. Venant-Kirchhoff solid, f64", "step, solid, f64"),
    ("step, neo-Hookean solid, f64", "step, solid, f64"),
    ("step, neo-Hookean solid, f32", "step, solid, f32"),
    (
        "step, quadratic neo-Hookean solid, f64",
        "step, quadratic solid, f64",
    ),
];

/// A host step of a scene in which nothing touches, and the same step without the obstacle.
pub(crate) const NOTHING_NEAR: [&str; 2] = [
    "host step, solid and an obstacle far away",
    "host step, solid alone",
];

/// A counted call.
pub(crate) struct Case {
    pub(crate) elements: usize,
    call: Box<dyn FnMut() -> Result<usize, Failure>>,
}

impl Case {
    fn new(elements: usize, call: impl FnMut() -> Result<usize, Failure> + 'static) -> Self {
        let call = Box::new(call);
        Self { elements, call }
    }

    /// Makes the call. Returns the number of its iterations.
    ///
    /// # Errors
    /// The error of the call.
    pub(crate) fn run(&mut self) -> Result<usize, Failure> {
        black_box(measured(black_box(&mut *self.call)))
    }
}

/// The name of [`measured`] in valgrind.
pub(crate) const MEASURED: &str = "host_instructions::cases::measured";

/// The counted function.
#[inline(never)]
fn measured(call: &mut dyn FnMut() -> Result<usize, Failure>) -> Result<usize, Failure> {
    black_box(call())
}

/// A body held at both ends. The second end is pulled.
struct Pulled {
    body: Body,
    axis: Vec3,
    poses: [HandlePose; 2],
}

impl Pulled {
    /// Moves the pulled hand by one step.
    fn pull(&mut self) {
        self.poses[1].position += self.axis * (SPEED * H);
    }
}

/// The ends of a body of `length` along `axis`.
fn ends(positions: &[Vec3], axis: Vec3, length: f64, freedom: Freedom) -> [HandleSpec; 2] {
    [-0.5, 0.5].map(|side| HandleSpec {
        vertices: (0_u32..)
            .zip(positions)
            .filter(|(_, position)| (position.dot(&axis) - side * length).abs() < 1e-9)
            .map(|(vertex, _)| vertex)
            .collect(),
        origin: axis * (side * length),
        freedom,
        border: Border::Hinged,
    })
}

/// A cube of `n` cells along each edge, six corotational tetrahedra each.
fn solid(n: u32, quadratic: bool) -> Result<Pulled, Failure> {
    solid_of(SolidLaw::Corotational, n, quadratic)
}

/// The same under another law.
fn solid_of(law: SolidLaw, n: u32, quadratic: bool) -> Result<Pulled, Failure> {
    let (length, axis) = (0.1, Vec3::z());
    let mesh = solid_box([length; 3], [n; 3])?;
    let mesh = if quadratic { mesh.quadratic() } else { mesh };
    let soft = SolidMaterial {
        young: 2e4,
        poisson: 0.3,
        density: 1000.0,
    };
    let handles = ends(&mesh.positions, axis, length, Freedom::Translation);
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        mass_damping: 0.1,
        stiffness_damping: 0.1,
        ..BodyConfig::default()
    };
    let body = Body::solid(&mesh, &[soft], law, config, &handles)?;
    let poses = handles.map(|handle| HandlePose::at(handle.origin));
    Ok(Pulled { body, axis, poses })
}

/// A strip of 480 triangles with bending.
fn strip() -> Result<Pulled, Failure> {
    let (length, axis) = (0.1, Vec3::x());
    let mesh = sheet(length, 0.06, 20, 12, Pattern::Alternating)?;
    let rubber = Material {
        young: 1e6,
        poisson: 0.4,
        thickness: 1e-3,
        density: 1000.0,
    };
    let handles = ends(&mesh.positions, axis, length, Freedom::Rigid);
    let config = BodyConfig {
        mass_damping: 0.5,
        stiffness_damping: 1e-3,
        bending: 1.0,
        ..BodyConfig::default()
    };
    let body = Body::sheet(&mesh, &[rubber], config, &handles)?;
    let poses = handles.map(|handle| HandlePose::at(handle.origin));
    Ok(Pulled { body, axis, poses })
}

/// A stepper in steady motion, with a factor that is [`AGE`] steps old, and a fixed number of further iterations.
fn settled<T: Precision>(pulled: &mut Pulled) -> Result<Stepper<T>, Failure> {
    let options = StepperOptions {
        // The refresh is counted by itself.
        refresh: false,
        // With this patience, any step with an iteration lends the refresher.
        patience: 0,
        sleep_speed: 0.0,
        ..StepperOptions::default()
    };
    let mut stepper = Stepper::<T>::new(&pulled.body, options)?;
    stepper.prepare(&pulled.body, H)?;
    for _ in 0..SETTLE {
        pulled.pull();
        stepper.step(&mut pulled.body, H, &pulled.poses, || false)?;
    }
    let mut refresher = stepper.lend().ok_or("the steps took no iteration")?;
    refresher.work()?;
    stepper.give_back(refresher);
    for _ in 0..AGE {
        pulled.pull();
        stepper.step(&mut pulled.body, H, &pulled.poses, || false)?;
    }
    stepper.options.tolerance = 0.0;
    stepper.options.max_iterations = ITERATIONS;
    Ok(stepper)
}

fn solved(residual: f64) -> Result<(), Failure> {
    if residual <= MOST_RESIDUAL {
        return Ok(());
    }
    Err(format!(
        "the iterations left a residual of {residual:e} of the forces, at most {MOST_RESIDUAL:e} is allowed"
    )
    .into())
}

fn step<T: Precision>(mut pulled: Pulled) -> Result<Case, Failure> {
    let mut stepper = settled::<T>(&mut pulled)?;
    pulled.pull();
    Ok(Case::new(pulled.body.element_count(), move || {
        let report = stepper.step(&mut pulled.body, H, &pulled.poses, || false)?;
        solved(report.residual / report.reference)?;
        Ok(report.iterations)
    }))
}

/// All shapes of the previous model are renewed after a step.
fn local_model() -> Result<Case, Failure> {
    let mut pulled = solid(6, false)?;
    let mut stepper = settled::<f64>(&mut pulled)?;
    let options = ShapeOptions {
        tolerance: 0.0,
        max_iterations: SHAPE_ITERATIONS,
        ..ShapeOptions::default()
    };
    // The first model has no shapes to start from.
    let mut shapes = Shapes::default();
    shapes.condense(&mut stepper, &pulled.body, H, &ShapeOptions::default())?;
    pulled.pull();
    stepper.step(&mut pulled.body, H, &pulled.poses, || false)?;
    Ok(Case::new(pulled.body.element_count(), move || {
        let (model, report) = shapes.condense(&mut stepper, &pulled.body, H, &options)?;
        black_box(model);
        solved(report.residual)?;
        Ok(report.iterations)
    }))
}

fn factor() -> Result<Case, Failure> {
    let mut pulled = solid(6, false)?;
    let mut stepper = settled::<f64>(&mut pulled)?;
    let mut refresher = stepper.lend().ok_or("the steps took no iteration")?;
    Ok(Case::new(pulled.body.element_count(), move || {
        refresher.work()?;
        Ok(0)
    }))
}

fn assembled() -> Result<Case, Failure> {
    let mut pulled = solid(6, false)?;
    for _ in 0..SETTLE + AGE {
        pulled.pull();
        pulled.body.step(H, &pulled.poses)?;
    }
    pulled.body.set_budget(Budget {
        tolerance: 0.0,
        absolute_tolerance: 0.0,
        max_iterations: ASSEMBLED_ITERATIONS,
    })?;
    pulled.pull();
    Ok(Case::new(pulled.body.element_count(), move || {
        let report = pulled.body.step(H, &pulled.poses)?;
        solved(report.relative_residual())?;
        Ok(report.iterations)
    }))
}

/// A step of the host without a publication: a cube of 1,296 tetrahedra that a hand pulls. The obstacle, if there is one, is
/// half a metre from the cube.
fn host_step(has_obstacle: bool) -> Result<Case, Failure> {
    let obstacle =
        "[[obstacle]]\nname = \"floor\"\nshape = \"plane\"\nposition = [0.0, 0.0, -0.55]\n";
    let text = format!("{SCENE}{}", if has_obstacle { obstacle } else { "" });
    let loaded = Scene::load_texts("cube.toml", &text, &BTreeMap::new())?;
    let world = World::new(&loaded)?;
    let bodies = bodies(&world, BuildOptions::default())?;
    let elements = bodies[0].body().element_count();
    let places: Vec<Pose> = (0..2)
        .filter_map(|handle| bodies[0].body().handle_report(handle))
        .map(|report| Pose::at(report.pose.position))
        .collect();
    let contact = Contact::new(&world, &bodies)?;
    if contact.is_some() != has_obstacle {
        return Err("an obstacle has contacts, and a body alone has none".into());
    }
    let mut engine = Engine::new(bodies).touching(contact);
    let mut tick = 0_u32;
    let mut step = move || {
        for _ in 0..TICKS {
            tick += 1;
            let mut record = TickRecord::empty();
            record.time_ns = u64::from(tick) * 1_000_000;
            record.device_count = 2;
            for (proxy, place) in record.proxies.iter_mut().zip(&places) {
                proxy.0 = *place;
            }
            record.proxies[1].0.position.x += SPEED * 1e-3 * f64::from(tick);
            engine.follow(&record);
        }
        let due = Due {
            time_ns: u64::from(tick) * 1_000_000,
            publishes: false,
        };
        engine.step(due, &NoTime, &mut |_, _| {});
        match &engine.stats().first_fault {
            Some(fault) => Err(fault.clone()),
            None => Ok(()),
        }
    };
    for _ in 0..SETTLE {
        step()?;
    }
    Ok(Case::new(elements, move || {
        step()?;
        Ok(0)
    }))
}

/// Ticks of a host step.
const TICKS: u32 = 10;

/// The scene of [`host_step`].
const SCENE: &str = r#"
name = "cube"
gravity = [0.0, 0.0, 0.0]
[host]
step_rate = 100.0
publish_rate = 100.0
[[body]]
name = "cube"
mesh.box = { size = [0.1, 0.1, 0.1], cells = [6, 6, 6] }
material = { young = 20e3, poisson = 0.3, density = 1000.0 }
damping = { mass = 0.1, stiffness = 0.1 }
[[body.handle]]
name = "left end"
group = "left"
device = "left"
[[body.handle]]
name = "right end"
group = "right"
device = "right"
[[device]]
name = "left"
model = "falcon"
[device.hand]
waypoints = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
[[device]]
name = "right"
model = "falcon"
[device.hand]
waypoints = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
"#;

/// A clock that stands still: the reading of a clock is no part of the counts.
struct NoTime;

impl Stopwatch for NoTime {
    fn now_ns(&self) -> u64 {
        0
    }
}

/// The springs of a body with handles in a row, whose devices drive turns, too: the second model. Each handle has a stiffness
/// of `along` times the limit along the row to either neighbour, and half the limit in every other motion. The elements of
/// the case are its handles.
fn springs(handles: u8, along: f64) -> Result<Case, Failure> {
    let limit = Renderable {
        stiffness: 2e3,
        turning: 3.0,
        calm: 0.5,
        ..Renderable::ANY
    };
    let devices: Vec<u8> = (0..handles).collect();
    let mut springs = SeriesSprings::of(&devices, &vec![limit; devices.len()])
        .ok_or("the devices have limits")?;
    let mut model = LocalModel::empty();
    model.head.handle_count = handles;
    let (own, link) = (0.5 * limit.stiffness, along * limit.stiffness);
    for (i, row) in model.stiffness.iter_mut().enumerate().take(devices.len()) {
        for (j, block) in row.iter_mut().enumerate().take(devices.len()) {
            if i == j {
                let turn = 0.5 * limit.turning;
                let motions = [own + 2.0 * link, own, own, turn, turn, turn];
                *block = Mat6::from_diagonal(&motions.into());
            } else if i.abs_diff(j) == 1 {
                block[(0, 0)] = -link;
            }
        }
    }
    let acts = springs.through(&model, 0.0).is_some();
    if acts != (along > 1.0) {
        return Err("springs act where they need not, or do not act where they must".into());
    }
    Ok(Case::new(devices.len(), move || {
        black_box(springs.through(&model, PERIOD));
        Ok(0)
    }))
}
