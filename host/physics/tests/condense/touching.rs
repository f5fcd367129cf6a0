//! Local models of bodies that touch, against moving the hand and waiting.

use physics::contact::{Meeting, Skin};
use physics::mesh::{Mesh, generate_box::solid_box};
use physics::motion::contacts::{Contacts, MOST_BODIES, Member, Side};
use physics::{
    Around, Beside, Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, ShapeOptions,
    Shapes, SolidLaw, SolidMaterial, Stepper, StepperOptions, Vec3,
};

/// Length of a step (s).
const H: f64 = 4e-3;
/// The time over which the models predict (s): the bodies are at rest long before.
const PERIOD: f64 = 10.0;
/// The distance of contact (m).
const DISTANCE: f64 = 0.5e-3;

/// Two soft blocks on each other: a hand holds the lower one below, and the other hand the upper one above. Their meshes do not
/// match.
struct Blocks {
    bodies: Vec<Body>,
    steppers: Vec<Stepper<f64>>,
    contacts: Contacts,
    hands: [HandlePose; 2],
    steps: u32,
}

impl Blocks {
    fn new(friction: f64) -> Self {
        let mut blocks = Self {
            bodies: Vec::new(),
            steppers: Vec::new(),
            contacts: Contacts::new(),
            hands: [HandlePose::at(Vec3::zeros()); 2],
            steps: 0,
        };
        let sides = [
            ([0.06, 0.06, 0.04], [5, 5, 3], 20e3),
            ([0.05, 0.05, 0.04], [4, 4, 3], 40e3),
        ];
        for (number, (size, cells, young)) in sides.into_iter().enumerate() {
            let mut mesh = solid_box(size, cells).unwrap();
            let up = if number == 0 { -1.0 } else { 1.0 };
            for x in &mut mesh.positions {
                x.z += up * (0.02 + 0.5 * DISTANCE);
            }
            let far = up * (0.04 + 0.5 * DISTANCE);
            let held = mesh.positions.iter().enumerate();
            let held = held.filter(|(_, x)| (x.z - far).abs() < 1e-9);
            let vertices: Vec<u32> = held.map(|(vertex, _)| vertex as u32).collect();
            let handle = HandleSpec {
                vertices,
                origin: Vec3::new(0.0, 0.0, far),
                freedom: Freedom::Rigid,
                border: Border::Hinged,
            };
            blocks.hands[number] = HandlePose::at(handle.origin);
            let material = SolidMaterial {
                young,
                poisson: 0.3,
                density: 1000.0,
            };
            let config = BodyConfig {
                gravity: Vec3::zeros(),
                stiffness_damping: 0.01,
                ..BodyConfig::default()
            };
            let body = Body::solid(
                &mesh,
                &[material],
                SolidLaw::Corotational,
                config,
                &[handle],
            )
            .unwrap();
            let options = StepperOptions {
                tolerance: 1e-9,
                sleep_speed: 0.0,
                ..StepperOptions::default()
            };
            let mut stepper = Stepper::new(&body, options).unwrap();
            stepper.prepare(&body, H).unwrap();
            let skin = Skin {
                radius: 0.5 * DISTANCE,
                touches_itself: false,
                is_obstacle: false,
            };
            let mesh = Mesh::Solid(mesh);
            blocks.contacts.add_body(number, &body, mesh, skin).unwrap();
            blocks.bodies.push(body);
            blocks.steppers.push(stepper);
        }
        blocks.contacts.complete(&|one, other| match (one, other) {
            (Side::Body(a), Side::Body(b)) if a != b => Some(Meeting {
                distance: DISTANCE,
                friction,
                pressure: f64::INFINITY,
                force: f64::INFINITY,
            }),
            _ => None,
        });
        blocks
    }

    fn step(&mut self) {
        let each = self.bodies.iter_mut().zip(&mut self.steppers);
        for ((body, stepper), hand) in each.zip(&self.hands) {
            if self.steps.is_multiple_of(5) {
                stepper.prepare(body, H).unwrap();
            }
            stepper.predict(body, H).unwrap();
            stepper.constrain(body, &[*hand]).unwrap();
        }
        let each = self.bodies.iter().zip(&mut self.steppers);
        let members = each.map(|(body, stepper)| Member {
            body,
            stepper: Some(stepper),
        });
        let mut members: Vec<Member<'_, f64>> = members.collect();
        let time = f64::from(self.steps) * H;
        self.contacts.begin(&members, [time, time + H], H);
        self.contacts.solve(&mut members, &mut |_| false);
        for member in &mut members {
            let stepper = member.stepper.as_mut().unwrap();
            if !stepper.is_solved() {
                stepper.solve(|| false).unwrap();
            }
        }
        self.contacts.certify(&mut members);
        drop(members);
        for (body, stepper) in self.bodies.iter_mut().zip(&mut self.steppers) {
            stepper.finish(body, || false).unwrap();
        }
        self.steps += 1;
    }

    /// Moves the upper hand by `way` in 50 steps, and waits.
    fn move_by(&mut self, way: Vec3) {
        for _ in 0..50 {
            self.hands[1].position += way / 50.0;
            self.step();
        }
        (0..150).for_each(|_| self.step());
    }

    /// The force of the upper block on its hand (N).
    fn force(&self) -> Vec3 {
        self.bodies[1]
            .handle_report(0)
            .unwrap()
            .wrench_on_hand
            .force
    }

    /// The stiffness of the upper block (N/m) along x and z, as the models state it, and the way (m) along `way` up to their
    /// limit, of the time over which the models predict the `period` (s).
    fn model(&mut self, responds: bool, way: Vec3) -> ([f64; 2], f64) {
        self.contacts.hold();
        let mut shapes = Shapes::default();
        let [below, above] = &mut *self.steppers else {
            panic!("two steppers");
        };
        let mut others: [Option<Beside<'_, f64>>; MOST_BODIES] = [const { None }; MOST_BODIES];
        if responds {
            others[0] = Some(Beside {
                body: &self.bodies[0],
                stepper: below,
            });
        }
        let ([springs, coming], room) = self.contacts.held(1);
        let mut around = Around {
            number: 1,
            springs,
            coming,
            others,
            room,
        };
        let options = ShapeOptions {
            max_iterations: 2000,
            ..ShapeOptions::default()
        };
        let body = &self.bodies[1];
        let condensed = shapes.condense_among(above, body, PERIOD, &options, Some(&mut around));
        let (condensed, report) = condensed.unwrap();
        println!("{report:?}");
        assert!(report.residual < 1e-4);
        let found = [condensed.stiffness[(0, 0)], condensed.stiffness[(2, 2)]];
        let mut slopes = [0.0; 6];
        let limit = shapes.limit(&around, &mut slopes).unwrap();
        let along = Vec3::new(slopes[0], slopes[1], slopes[2]).dot(&way);
        (found, (limit.critical - limit.root) / along)
    }
}

#[test]
fn a_block_on_a_block_is_as_stiff_as_both_in_series() {
    // The tangent of a corotational element leaves out the turn of a strained element: a tenth of the shear at a strain of 4 %.
    const PRESSED: f64 = 0.5e-3;
    for friction in [0.5, 3.0] {
        let mut blocks = Blocks::new(friction);
        blocks.move_by(Vec3::new(0.0, 0.0, -PRESSED));
        let (held, _) = blocks.model(false, Vec3::z());
        let (model, release) = blocks.model(true, Vec3::z());
        let before = blocks.force();
        let small = 20e-6;
        blocks.move_by(Vec3::new(0.0, 0.0, -small));
        let pressed = (blocks.force() - before).z / small;
        let before = blocks.force();
        blocks.move_by(Vec3::new(small, 0.0, 0.0));
        let sheared = -(blocks.force() - before).x / small;
        let errors = [model[1] / pressed - 1.0, model[0] / sheared - 1.0];
        println!("friction {friction}: press {pressed:.1} N/m, shear {sheared:.1} N/m");
        println!("model {model:?}, errors {errors:?}, other held {held:?}");
        println!("parts after {:.3} mm", 1e3 * release);
        // The aim of the design.
        assert!(errors[0].abs() < 0.01, "{errors:?}");
        assert!(errors[1].abs() < 0.025, "{errors:?}");
        assert!(held[1] > 2.0 * pressed, "the other body responds");
        // The way by which the blocks were pressed. Their force grows a little faster than the way.
        assert!((release / PRESSED - 1.0).abs() < 0.05, "{release}");
    }
}

#[test]
fn a_contact_that_closes_before_the_next_model_is_foreseen() {
    const GAP: f64 = 0.3e-3;
    const STEP: f64 = 10e-6;
    let mut blocks = Blocks::new(0.5);
    blocks.move_by(Vec3::new(0.0, 0.0, GAP));
    for _ in 0..10 {
        blocks.hands[1].position.z -= STEP;
        blocks.step();
    }
    blocks.contacts.hold();
    let each = blocks.bodies.iter().zip(&mut *blocks.steppers);
    let members = each.map(|(body, stepper)| Member {
        body,
        stepper: Some(stepper),
    });
    let members: Vec<Member<'_, f64>> = members.collect();
    // The rest of the gap takes 20 steps.
    blocks.contacts.foresee(&members, 10.0 * H);
    drop(members);
    let held = |contacts: &mut Contacts| contacts.held(1).0.map(<[_]>::len);
    assert_eq!(
        held(&mut blocks.contacts),
        [0, 0],
        "too late for this model"
    );
    let each = blocks.bodies.iter().zip(&mut *blocks.steppers);
    let members = each.map(|(body, stepper)| Member {
        body,
        stepper: Some(stepper),
    });
    let members: Vec<Member<'_, f64>> = members.collect();
    blocks.contacts.foresee(&members, 30.0 * H);
    drop(members);
    let [below, above] = &mut *blocks.steppers else {
        panic!("two steppers");
    };
    let mut others: [Option<Beside<'_, f64>>; MOST_BODIES] = [const { None }; MOST_BODIES];
    others[0] = Some(Beside {
        body: &blocks.bodies[0],
        stepper: below,
    });
    let ([springs, coming], room) = blocks.contacts.held(1);
    assert!(springs.is_empty() && !coming.is_empty());
    let mut around = Around {
        number: 1,
        springs,
        coming,
        others,
        room,
    };
    let options = ShapeOptions {
        max_iterations: 2000,
        ..ShapeOptions::default()
    };
    let [mut open, mut closed] = [Shapes::default(), Shapes::default()];
    let body = &blocks.bodies[1];
    open.condense_among(above, body, PERIOD, &options, Some(&mut around))
        .unwrap();
    around.springs = coming;
    let (condensed, _) = closed
        .condense_among(above, body, PERIOD, &options, Some(&mut around))
        .unwrap();
    let stiffness = condensed.stiffness[(2, 2)];
    let mut slopes = [0.0; 6];
    let touch = closed.touch(&open, &around, &mut slopes).unwrap();
    assert!(touch.is_touch && touch.root <= 0.0, "{touch:?}");
    // The hand has gone 10 steps of the gap; the lower layer of the block lags behind it by less than a step.
    let left = touch.critical / -slopes[2];
    println!("{touch:?} {slopes:?} left {left}");
    assert!((left - (GAP - 10.0 * STEP)).abs() < STEP, "{left}");
    // A block that is free has no stiffness, so that the touch has all of it.
    assert!((slopes[2] * slopes[2] / stiffness - 1.0).abs() < 0.01);
}
