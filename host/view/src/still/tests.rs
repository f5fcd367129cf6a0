use super::*;
use fuzz_rules::synthetic::Synthetic;
use host::engine::Engine;
use host::live::Message;
use host::live::frame::FoldedHand;
use host::live::gather::{Gatherer, TickView};
use host::live::{BodyState, Source};
use host::plot::collisions;
use host::run::prepare::Options;
use host::run::session::Session;
use host::run::{Clock, RunOptions, facts};
use host::scene::Scene;
use host::world::World;
use std::path::Path;

type Outcome = Result<(), Box<dyn std::error::Error>>;

/// The state of a viewer after some messages.
struct Seen {
    hello: Hello,
    surfaces: Vec<Surface>,
    frame: Frame,
    history: History,
}

impl Seen {
    fn still(&self) -> Still<'_> {
        Still {
            hello: &self.hello,
            surfaces: &self.surfaces,
            frame: &self.frame,
            history: &self.history,
        }
    }
}

fn synthetic(frames: u64) -> Seen {
    let mut seen = Seen {
        hello: Hello::default(),
        surfaces: Vec::new(),
        frame: Frame::default(),
        history: History::new(5.0),
    };
    for message in Synthetic::new(frames).messages() {
        match message {
            Message::Hello(hello) => seen.hello = *hello,
            Message::Surface(surface) => seen.surfaces.push(surface),
            Message::Frame(frame) => {
                seen.history.push(&frame.folded);
                seen.frame = *frame;
            }
            _ => break,
        }
    }
    seen
}

/// A scene at a time (s) of its run under virtual time.
fn run_to(scene: &str, time: f64) -> Result<Seen, Box<dyn std::error::Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let loaded = Scene::load(&folder.join(scene))?;
    let world = World::new(&loaded)?;
    let options = RunOptions::new(Clock::Virtual);
    let mut gatherer = Gatherer::new(&loaded, Clock::Virtual).with_obstacles(&world.obstacles);
    let mut history = History::new(10.0);
    let mut vertices = Vec::new();
    let mut frame = Frame::default();
    let mut session = Session::new(&world, &Options::new(time, 1))?;
    while let Some(telemetry) = session.tick() {
        gatherer.take(&TickView::from(&telemetry));
        if (telemetry.tick + 1).is_multiple_of(16) {
            frame = gatherer.frame();
            history.push(&frame.folded);
            let bodies = session.engine().into_iter().flat_map(Engine::bodies);
            vertices = bodies
                .map(|body| {
                    let points = body.body().positions();
                    let floats = points.flat_map(|p| [p.x as f32, p.y as f32, p.z as f32]);
                    let positions: Vec<_> = floats.collect();
                    Vertices {
                        epoch: body.body().epoch() as u32,
                        count: positions.len() as u32 / 3,
                        positions,
                        ..Vertices::default()
                    }
                })
                .collect();
        }
    }
    for (body, vertices) in frame.bodies.iter_mut().zip(vertices) {
        body.vertices = Some(vertices);
    }
    Ok(Seen {
        hello: Hello::new(Source::Run, &world, facts(&loaded, &options, 1)),
        surfaces: (0..)
            .zip(&world.bodies)
            .map(|(k, b)| Surface::of_mesh(k, b.body.epoch(), &b.mesh))
            .collect(),
        frame,
        history,
    })
}

/// The pictures of four scenes have no texts that collide, and show every triangle. With `PALPATE_MOMENTS=FOLDER`, the
/// test leaves them there.
#[test]
fn a_moment_is_drawn_whole() -> Outcome {
    for (scene, time) in [
        ("stretch.toml", 2.4),
        ("cloth.toml", 3.0),
        ("press.toml", 1.8),
        ("sheet_on_sphere.toml", 0.2),
    ] {
        let seen = run_to(scene, time)?;
        let picture = seen.still().picture();
        let svg = picture.svg();
        assert_eq!(collisions(&picture), Vec::<String>::new(), "{scene}");
        let triangles: u32 = seen.surfaces.iter().map(|s| s.triangle_count).sum();
        assert!(svg.matches("<polygon").count() > triangles as usize);
        let name = &seen.hello.scene;
        assert!(svg.contains(&format!("{name} at {:.3} s", seconds(seen.frame.time_ns))));
        let model = if name == "sheet_on_sphere" {
            "no model yet"
        } else {
            "model live"
        };
        assert!(svg.contains(model) && svg.contains("last stage normal"));
        // Obstacles are grey, and nothing else in the view is.
        let greys = svg.split("fill=\"#").skip(1).filter(|rest| {
            let [r, g, b] = [0, 2, 4].map(|at| rest.get(at..at + 2));
            r == g && g == b && r != Some("FF") && r != Some("00")
        });
        assert_eq!(greys.count() > 200, !seen.hello.obstacles.is_empty());
        let image = picture.png()?;
        assert!(image.starts_with(b"\x89PNG"));
        if let Some(folder) = std::env::var_os("PALPATE_MOMENTS") {
            std::fs::write(Path::new(&folder).join(format!("{name}.png")), &image)?;
            std::fs::write(Path::new(&folder).join(format!("{name}.svg")), &svg)?;
        }
    }
    Ok(())
}

#[test]
fn a_spike_is_drawn_and_a_body_without_vertices_is_not() {
    let mut seen = synthetic(40);
    let picture = seen.still().picture();
    let whole = picture.svg();
    assert_eq!(collisions(&picture), Vec::<String>::new());
    for piece in [true, false] {
        seen.frame.bodies = vec![BodyState::default(); usize::from(piece)];
        let svg = seen.still().picture().svg();
        assert!(svg.contains("this moment has no bodies"));
        assert!(svg.len() < whole.len() / 2);
    }
    // Without the spike, the axis of the forces ends lower.
    let mut flat = History::new(5.0);
    for piece in seen.history.pieces() {
        let mut piece = piece.clone();
        for hand in &mut piece.hands {
            hand.force_norm.most = hand.force_norm.least;
        }
        flat.push(&piece);
    }
    let spiked = seen.still().picture().svg();
    seen.history = flat;
    assert_ne!(spiked, seen.still().picture().svg());
}

#[test]
fn numbers_that_are_not_finite_do_not_spoil_the_picture() -> Outcome {
    let mut seen = synthetic(3);
    if let Some(vertices) = &mut seen.frame.bodies[0].vertices {
        vertices.positions[7] = f32::NAN;
        vertices.positions[100] = f32::INFINITY;
        vertices.positions.truncate(1000);
    }
    seen.frame.hands[0].position[0] = f64::NAN;
    seen.frame.hands[1].force[1] = 1e300;
    let mut piece = seen.frame.folded.clone();
    piece.hands = vec![FoldedHand::default()];
    seen.history.push(&piece);
    let picture = seen.still().picture();
    let svg = picture.svg();
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
    picture.png()?;
    let nothing = Seen {
        hello: Hello::default(),
        surfaces: Vec::new(),
        frame: Frame::default(),
        history: History::new(1.0),
    };
    nothing.still().picture().png()?;
    Ok(())
}

#[test]
fn the_table_of_vertices_has_the_positions_bit_for_bit() -> Outcome {
    let seen = synthetic(5);
    let text = seen.still().vertices_csv();
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("# synthetic: vertices of the bodies, positions in m")
    );
    assert_eq!(lines.next(), Some("# moment: 0.079000000 s, tick 79"));
    assert_eq!(lines.next(), Some("body,vertex,x,y,z,displacement"));
    let vertices = seen.frame.bodies[0].vertices.as_ref().ok_or("vertices")?;
    let mut found = Vec::new();
    for (row, line) in lines.enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!(cells[..2], ["sheet", row.to_string().as_str()]);
        for cell in &cells[2..5] {
            found.push(cell.parse::<f32>()?);
        }
        assert!(cells[5].parse::<f64>()? >= 0.0);
    }
    assert_eq!(found, vertices.positions);
    Ok(())
}

#[test]
fn the_table_of_curves_has_a_row_for_each_piece() -> Outcome {
    let seen = synthetic(40);
    let text = seen.still().curves_csv();
    let rows: Vec<&str> = text.lines().skip(3).collect();
    assert_eq!(rows.len(), 40);
    let head = text.lines().nth(2).ok_or("a head")?;
    assert!(head.starts_with("from,to,ticks,missed,left force least,left force greatest,left x"));
    let row: Vec<&str> = rows[30].split(',').collect();
    assert_eq!(row.len(), head.split(',').count());
    let folded = seen.history.pieces().nth(30).ok_or("a piece")?;
    assert_eq!(row[5].parse::<f64>()?, folded.hands[0].force_norm.most);
    assert_eq!(row[2], "16");
    Ok(())
}
