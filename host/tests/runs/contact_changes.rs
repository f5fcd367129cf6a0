//! Bodies that are changed while they touch.

use crate::rig::{MS, Still};
use host::engine::Engine;
use host::engine::build::{BuildOptions, bodies};
use host::engine::change::Edit;
use host::engine::contact::Contact;
use host::engine::pacer::Due;
use host::scene::{LoadedScene, Scene};
use host::world::World;
use physics::{Body, BodyMap, Vec3};
use rt_core::{Pose, TickRecord};
use std::collections::BTreeMap;

fn load(text: &str) -> LoadedScene {
    Scene::load_texts("x.toml", text, &BTreeMap::new()).expect("a scene")
}

/// An engine with contacts whose hands a test moves.
struct Table {
    engine: Engine,
    rest: Vec<Vec3>,
    steps: u64,
}

impl Table {
    fn new(text: &str, devices: &[[usize; 2]]) -> Self {
        let loaded = load(text);
        let world = World::new(&loaded).expect("a world");
        let built = bodies(&world, BuildOptions::default()).expect("bodies");
        let contact = Contact::new(&world, &built).expect("contacts");
        let engine = Engine::new(built).touching(contact);
        let rest = devices.iter().map(|[body, handle]| {
            let report = engine.bodies()[*body].body().handle_report(*handle);
            report.expect("a handle").pose.position
        });
        Self {
            rest: rest.collect(),
            engine,
            steps: 0,
        }
    }

    /// Makes a step of 4 ms with the hands displaced by `by` (m).
    fn step(&mut self, by: &[Vec3]) {
        self.steps += 1;
        let mut record = TickRecord::empty();
        record.tick = 4 * self.steps;
        record.time_ns = record.tick * MS;
        record.device_count = self.rest.len() as u8;
        for (proxy, (rest, by)) in record.proxies.iter_mut().zip(self.rest.iter().zip(by)) {
            proxy.0 = Pose::at(rest + by);
        }
        self.engine.follow(&record);
        let due = Due {
            time_ns: record.time_ns,
            publishes: true,
        };
        self.engine.step(due, &Still, &mut |_, _| {});
    }

    fn body(&self, body: usize) -> &Body {
        self.engine.bodies()[body].body()
    }

    fn contact(&self) -> &Contact {
        self.engine.contact().expect("contacts")
    }

    /// The force between two sides, on the first of them (N).
    fn force(&self, sides: [usize; 2]) -> Vec3 {
        let touching = self.contact().contacts().touching().iter();
        let found = touching.filter(|sum| sum.sides == sides);
        found.map(|sum| sum.force).sum()
    }

    fn assert_sound(&self) {
        let stats = self.engine.stats();
        assert_eq!((stats.faults, &stats.first_fault), (0, &None));
        let totals = self.contact().totals();
        assert_eq!((totals.squeezed, totals.dropped), (0, 0));
    }
}

const DEVICES: &str = r#"
[[device]]
name = "left"
model = "omega3"
hand = {}

[[device]]
name = "right"
model = "omega3"
hand = {}
"#;

/// A block on a block on a floor.
const BLOCKS: &str = r#"name = "blocks"

[[obstacle]]
name = "floor"
shape = "plane"
friction = 0.5

[[body]]
name = "lower"
position = [0.0, 0.0, 0.01502]
mesh.box = { size = [0.05, 0.05, 0.03], cells = [3, 3, 2] }
material = { young = 40e3, poisson = 0.3, density = 1000.0 }
damping = { mass = 2.0, stiffness = 0.01 }

[[body]]
name = "upper"
position = [0.002, 0.001, 0.04007]
mesh.box = { size = [0.03, 0.03, 0.02], cells = [2, 2, 2] }
material = { young = 40e3, poisson = 0.3, density = 1000.0 }
damping = { mass = 2.0, stiffness = 0.01 }

[[contact]]
between = ["lower", "upper"]
friction = 0.4
"#;

fn body_of(text: &str) -> Body {
    let loaded = load(text);
    let world = World::new(&loaded).expect("a world");
    let mut built = bodies(&world, BuildOptions::default()).expect("bodies");
    built.remove(0).body().clone()
}

fn settled(table: &mut Table, steps: usize) {
    for _ in 0..steps {
        table.step(&[]);
    }
}

#[test]
fn a_body_under_another_one_is_replaced_by_a_softer_one() {
    let text = format!("{BLOCKS}{DEVICES}");
    let mut table = Table::new(&text, &[]);
    settled(&mut table, 250);
    let upper = 9.81 * table.body(1).total_mass();
    let both = upper + 9.81 * table.body(0).total_mass();
    let height = |table: &Table| {
        let x = table.body(1).positions();
        x.map(|x| x.z).fold(f64::INFINITY, f64::min)
    };
    // The bodies sleep before they are at rest.
    let carries = |table: &Table, what: &str| {
        let [under, floor] = [table.force([0, 1]).z, table.force([0, 2]).z];
        assert!(
            (under / upper + 1.0).abs() < 5e-3,
            "{what}: {under} of {upper}"
        );
        assert!(
            (floor / both - 1.0).abs() < 5e-3,
            "{what}: {floor} of {both}"
        );
    };
    carries(&table, "before");
    let before = height(&table);
    let soft = body_of(&text.replacen("young = 40e3", "young = 10e3", 1));
    let replace = Edit::Replace(Box::new(move |old: Body| {
        let map = BodyMap::identity(&old);
        let mut body = soft;
        body.continue_from(&old, &map)?;
        Ok((body, map))
    }));
    table.engine.change(0, vec![replace]).expect("a change");
    settled(&mut table, 400);
    table.assert_sound();
    assert_eq!(table.engine.stats().changes, 1);
    carries(&table, "after");
    // The lower block is four times as soft: it bears the upper one and itself. The sum of its columns bears
    // density * g * height^2 / 2 and the weight above, which press it by some hundredths of a millimetre.
    let sunk = before - height(&table);
    assert!((1e-5..1e-3).contains(&sunk), "{sunk}");
}
