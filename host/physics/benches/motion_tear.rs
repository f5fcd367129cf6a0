//! Times of the realtime step on a cloth of 1,400 triangles and a banknote of 1,936 that two hands tear, on one thread:
//! before the first edit, and from the first edit on. The sheet that cannot tear shows what following edits costs. The
//! local model is computed with all shapes, and with one shape at a time.
//!
//! `cargo bench -p palpate-physics --bench motion_tear`

use physics::mesh::TriMesh;
use physics::mesh::generate::{Pattern, sheet};
use physics::tear::{TearLaw, TearMaterial};
use physics::topology::{Edit, Growth, NONE, Reserve};
use physics::{
    Body, BodyConfig, Border, Condensed, Freedom, HandlePose, HandleSpec, Material, ShapeOptions,
    Shapes, Starts, Stepper, StepperOptions, TearOptions, Tearing, Vec3,
};
use std::error::Error;
use std::time::Instant;

/// Length of a step (s), and steps from one local model to the next.
const H: f64 = 1e-3;
const EVERY: u32 = 4;
const STEPS: u32 = 2000;
/// Steps between factors, of the same or of a new topology.
const RENEWAL: u32 = 20;
/// Most vertices that tears add.
const ROOM: usize = 200;

struct Sheet {
    name: &'static str,
    mesh: TriMesh,
    material: Material,
    config: BodyConfig,
    toughness: f64,
    /// The ends of the notch (m).
    notch: [Vec3; 2],
    handles: [HandleSpec; 2],
    /// Velocity of the second hand (m/s); the first has the opposite one.
    speed: Vec3,
}

fn held(mesh: &TriMesh, low: [f64; 2], high: [f64; 2]) -> HandleSpec {
    let inside = |x: &Vec3| (0..2).all(|i| (low[i]..high[i]).contains(&x[i]));
    let held = (0_u32..).zip(&mesh.positions).filter(|(_, x)| inside(x));
    let vertices: Vec<u32> = held.map(|(vertex, _)| vertex).collect();
    let sum: Vec3 = vertices.iter().map(|&v| mesh.positions[v as usize]).sum();
    HandleSpec {
        origin: sum / vertices.len() as f64,
        vertices,
        freedom: Freedom::Translation,
        border: Border::Hinged,
    }
}

fn cloth() -> Result<Sheet, Box<dyn Error>> {
    let mesh = sheet(0.2, 0.2, 28, 25, Pattern::Alternating)?;
    Ok(Sheet {
        name: "cloth",
        material: Material {
            young: 2e7,
            poisson: 0.3,
            thickness: 5e-4,
            density: 400.0,
        },
        config: BodyConfig {
            gravity: Vec3::new(0.0, -9.81, 0.0),
            mass_damping: 0.5,
            stiffness_damping: 5e-4,
            bending: 1.0,
            ..BodyConfig::default()
        },
        toughness: 4000.0,
        notch: [Vec3::new(0.0, 0.1, 0.0), Vec3::new(0.0, 0.052, 0.0)],
        handles: [
            held(&mesh, [-0.03, 0.083], [-0.013, 0.101]),
            held(&mesh, [0.013, 0.083], [0.03, 0.101]),
        ],
        speed: Vec3::new(0.011, 0.0, 0.0),
        mesh,
    })
}

fn banknote() -> Result<Sheet, Box<dyn Error>> {
    let mesh = sheet(0.132, 0.066, 44, 22, Pattern::Alternating)?;
    Ok(Sheet {
        name: "banknote",
        material: Material {
            young: 3e9,
            poisson: 0.3,
            thickness: 1e-4,
            density: 900.0,
        },
        config: BodyConfig {
            gravity: Vec3::zeros(),
            mass_damping: 1.0,
            stiffness_damping: 1e-4,
            bending: 1.0,
            ..BodyConfig::default()
        },
        toughness: 16e3,
        notch: [Vec3::new(-0.066, 0.0, 0.0), Vec3::new(0.006, 0.0, 0.0)],
        handles: [
            held(&mesh, [-0.0605, -0.0245], [-0.0595, -0.0235]),
            held(&mesh, [-0.0605, 0.0235], [-0.0595, 0.0245]),
        ],
        speed: Vec3::new(0.0, 0.0042, 0.0),
        mesh,
    })
}

/// Opens the edges between two points, and returns the tip.
fn notch(body: &mut Body, [from, to]: [Vec3; 2]) -> Result<u32, Box<dyn Error>> {
    let nearest = |body: &Body, x: Vec3| {
        let far = |v: &u32| (body.rest_positions()[*v as usize] - x).norm();
        (0..body.rest_positions().len() as u32)
            .min_by(|a, b| far(a).total_cmp(&far(b)))
            .unwrap_or(0)
    };
    let (mut tip, end) = (nearest(body, from), nearest(body, to));
    let goal = body.rest_positions()[end as usize];
    while (body.rest_positions()[tip as usize] - goal).norm() > 1e-9 {
        let rest = body.rest_positions();
        let surface = body.surface().ok_or("no surface")?;
        let next = surface
            .fan(tip)
            .flat_map(|corner| [corner.from, corner.to])
            .min_by(|&a, &b| {
                let far = |v: u32| (rest[v as usize] - goal).norm();
                far(a).total_cmp(&far(b))
            });
        let next = next.ok_or("no edge")?;
        let done = body.edit(&Edit::grow(tip, Growth::Open { to: next }))?;
        if done.surface.tips[0] == NONE {
            break;
        }
        tip = done.surface.tips[0];
    }
    Ok(tip)
}

/// The times (us) and counts of some steps.
#[derive(Default)]
struct Row {
    step: Vec<f64>,
    tear: Vec<f64>,
    model: Vec<f64>,
    iterations: usize,
    most: usize,
    shape_iterations: usize,
    /// Errors of the force at the end of a period (N).
    errors: Vec<f64>,
}

fn quantiles<const N: usize>(values: &mut [f64], fractions: [f64; N]) -> [f64; N] {
    values.sort_by(f64::total_cmp);
    let at = |fraction: f64| (fraction * values.len() as f64) as usize;
    fractions.map(|fraction| values.get(at(fraction)).copied().unwrap_or_default())
}

impl Row {
    fn print(&mut self, what: &str) {
        let [a, b] = quantiles(&mut self.step, [0.1, 0.5]);
        let [c, d] = quantiles(&mut self.tear, [0.1, 0.5]);
        let [e, f] = quantiles(&mut self.model, [0.1, 0.5]);
        let [g, h] = quantiles(&mut self.errors, [0.5, 0.99]);
        println!(
            "{what:<20} {:>5} {a:>6.0} {b:>6.0} {:>6.2} {:>5} {c:>6.0} {d:>6.0} {e:>7.0} {f:>7.0} {:>6.1} {g:>9.1e} {h:>9.1e}",
            self.step.len(),
            self.iterations as f64 / self.step.len().max(1) as f64,
            self.most,
            self.shape_iterations as f64 / self.model.len().max(1) as f64,
        );
    }
}

/// By how much the forces of two models differ after a period in which the hands move at `speed` (m/s).
fn error(found: &Condensed, exact: &Condensed, speed: &Vec3) -> f64 {
    let moved = |column: usize| match column {
        0..3 => -speed[column],
        6..9 => speed[column - 6],
        _ => 0.0,
    };
    let force = |row: usize| {
        let change = |column| found.stiffness[(row, column)] - exact.stiffness[(row, column)];
        let sum: f64 = (0..12).map(|column| change(column) * moved(column)).sum();
        sum.abs() * f64::from(EVERY) * H
    };
    (0..12).map(force).fold(0.0, f64::max)
}

/// The body with its notch, and the tip.
fn notched(sheet: &Sheet) -> Result<(Body, u32), Box<dyn Error>> {
    let room = Reserve {
        vertices: ROOM,
        triangles: 2 * ROOM,
    };
    let make = |mesh: &TriMesh| Body::sheet(mesh, &[sheet.material], sheet.config, &sheet.handles);
    let mut body = make(&sheet.mesh)?;
    body.make_tearable(room)?;
    let tip = notch(&mut body, sheet.notch)?;
    let mut mesh = sheet.mesh.clone();
    mesh.triangles = body.surface().ok_or("no surface")?.triangles().to_vec();
    mesh.positions = body.rest_positions().to_vec();
    Ok((make(&mesh)?, tip))
}

fn tears_of(sheet: &Sheet, body: &mut Body, tip: u32) -> Result<Tearing, Box<dyn Error>> {
    body.make_tearable(Reserve {
        vertices: ROOM,
        triangles: 2 * ROOM,
    })?;
    let options = TearOptions {
        material: TearMaterial {
            strength: 1e9,
            toughness: sheet.toughness,
            thickness: sheet.material.thickness,
            young: sheet.material.young,
            poisson: sheet.material.poisson,
            law: TearLaw::Toughness,
        },
        starts: Starts::Tips,
        snapping: 0.3,
        skips: true,
    };
    Ok(Tearing::new(body, options, &[tip])?)
}

fn run(
    what: &str,
    sheet: &Sheet,
    tears: bool,
    options: &ShapeOptions,
) -> Result<(), Box<dyn Error>> {
    let (mut body, tip) = notched(sheet)?;
    let mut tearing = None;
    if tears {
        tearing = Some(tears_of(sheet, &mut body, tip)?);
    }
    // New factors are made in the background.
    let stepping = StepperOptions {
        refresh: false,
        ..StepperOptions::default()
    };
    let mut stepper = Stepper::<f64>::new(&body, stepping)?;
    stepper.reserve_pairs(16);
    stepper.prepare(&body, H)?;
    let (mut shapes, mut exact) = (Shapes::default(), Shapes::default());
    let tight = ShapeOptions {
        tolerance: 1e-7,
        ..ShapeOptions::default()
    };
    let origins = [0, 1].map(|i| sheet.handles[i].origin);
    let mut rows: [Row; 2] = core::array::from_fn(|_| Row::default());
    // The sheet that cannot tear stops before it would have torn.
    for step in 1..=if tears { STEPS } else { STEPS / 4 } {
        // The hands begin to move gently.
        let time = H * f64::from(step);
        let way = sheet.speed * (time - 0.2 * (1.0 - (-time / 0.2).exp()));
        let targets = [
            HandlePose::at(origins[0] - way),
            HandlePose::at(origins[1] + way),
        ];
        let begun = Instant::now();
        let report = stepper.step(&mut body, H, &targets, || false)?;
        let stepped = begun.elapsed().as_secs_f64() * 1e6;
        let begun = Instant::now();
        let torn = tearing.as_mut().is_some_and(|tearing| {
            let report = tearing.advance(&mut body, &mut stepper);
            report.opened > 0
        });
        let tore = begun.elapsed().as_secs_f64() * 1e6;
        if step % RENEWAL == 0 && stepper.has_grown() {
            let mut mirror = body.copy_with_room();
            mirror.reassemble();
            let mut fresh = Stepper::new(&mirror, stepping)?;
            fresh.reserve_pairs(16);
            fresh.prepare(&mirror, H)?;
            fresh.adopt(&mut stepper, &mut body)?;
            stepper = fresh;
        } else if step % RENEWAL == 0
            && let Some(mut refresher) = stepper.lend()
        {
            refresher.work()?;
            stepper.give_back(refresher);
        }
        let row = &mut rows[usize::from(torn)];
        // The first steps find no memory in the caches.
        let counts = step > RENEWAL;
        if counts {
            row.step.push(stepped);
            row.tear.push(tore);
            row.iterations += report.iterations;
            row.most = row.most.max(report.iterations);
        }
        if step % EVERY == 0 {
            let period = f64::from(EVERY) * H;
            let begun = Instant::now();
            let (found, report) = shapes.condense(&mut stepper, &body, period, options)?;
            let took = begun.elapsed().as_secs_f64() * 1e6;
            if counts {
                let found = found.clone();
                let (exact, _) = exact.condense(&mut stepper, &body, period, &tight)?;
                row.errors.push(error(&found, exact, &sheet.speed));
                row.model.push(took);
                row.shape_iterations += report.iterations;
            }
        }
    }
    let [before, after] = &mut rows;
    before.print(what);
    if !after.step.is_empty() {
        after.print("  from the first edit");
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "                           step (us)                    tear (us)     model (us)              error (N)"
    );
    println!(
        "                     steps   10 %    med   iter  most   10 %    med    10 %     med   iter       med      99 %"
    );
    let all = ShapeOptions::default();
    let one = ShapeOptions {
        tolerance: 1e-3,
        max_iterations: 3,
        at_a_time: 1,
        bound: 1e-2,
    };
    for sheet in [cloth()?, banknote()?] {
        println!("{}", sheet.name);
        run("cannot tear", &sheet, false, &all)?;
        run("tears, all shapes", &sheet, true, &all)?;
        run("tears, one shape", &sheet, true, &one)?;
    }
    Ok(())
}
