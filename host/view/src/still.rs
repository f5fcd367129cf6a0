//! A still of a display: what it shows at one time, as a picture (SVG, PNG) and as tables (CSV).

use crate::history::History;
use host::live::{Folded, Frame, Hello, ObstacleState, Range, ToolState, Vertices};
use host::plot::{HandMark, Obstacle, Picture, Ribbons, Shape, StillPicture, ToolMark, still};
use host::record::Surface;
use host::table::quoted;
use std::fmt::Write as _;

/// The names of the axes of the scene.
const AXES: [&str; 3] = ["x", "y", "z"];

/// A still: the state that a display shows at one time.
#[derive(Clone, Copy, Debug)]
pub struct Still<'a> {
    /// The facts of the stream.
    pub hello: &'a Hello,
    /// The surfaces so far. Of one body and topology epoch, the last one counts.
    pub surfaces: &'a [Surface],
    /// The frame, with the vertices of every body: if a frame came without them, those of the frame before.
    pub frame: &'a Frame,
    /// The curves around the moment.
    pub history: &'a History,
}

/// A still that owns its data.
#[derive(Clone, Debug)]
pub struct Shown {
    /// The facts of the stream.
    pub hello: Hello,
    /// The surfaces so far.
    pub surfaces: Vec<Surface>,
    /// The frame, with the vertices of every body.
    pub frame: Frame,
    /// The curves around the moment.
    pub history: History,
}

impl Shown {
    /// The still.
    pub fn still(&self) -> Still<'_> {
        Still {
            hello: &self.hello,
            surfaces: &self.surfaces,
            frame: &self.frame,
            history: &self.history,
        }
    }
}

impl Still<'_> {
    /// The still as a picture: on the left the bodies, coloured by their displacement from rest, with the obstacles, the
    /// hands, the tools and their forces, on the right the curves, and below the states.
    pub fn picture(&self) -> Picture {
        let (hello, frame) = (self.hello, self.frame);
        let hands = frame.hands.iter().enumerate();
        let hands = hands.map(|(index, hand)| HandMark {
            name: self.device(index),
            position: hand.position,
            force: hand.force,
        });
        let shapes = self.bodies().map(|(_, surface, vertices)| Shape {
            positions: points(&vertices.positions).collect(),
            values: displacements(surface, vertices)
                .map(|moved| 1e3 * moved)
                .collect(),
            triangles: surface.triangles.as_chunks().0.to_vec(),
            lines: surface.lines.as_chunks().0.to_vec(),
        });
        let obstacles = hello.obstacles.iter().zip(&frame.obstacles);
        let obstacles = obstacles.map(|(info, state)| Obstacle {
            positions: (info.placed(state).into_iter())
                .map(|point| point.map(f64::from))
                .collect(),
            triangles: info.triangles.as_chunks().0.to_vec(),
            plane: info.shape == "plane",
        });
        still(&StillPicture {
            title: format!("{} at {:.3} s", hello.scene, seconds(frame.time_ns)),
            subtitle: format!(
                "Tick {}, {} Hz, {} clock, scheme {}. So far {} deadlines missed, {} trips.",
                frame.folded.last,
                hello.tick_rate,
                hello.clock,
                hello.scheme,
                frame.totals.missed,
                frame.totals.trips
            ),
            color_label: "Displacement from rest (mm)".to_owned(),
            shapes: shapes.collect(),
            obstacles: obstacles.collect(),
            hands: hands.collect(),
            tools: self.tools().collect(),
            time: seconds(frame.time_ns),
            charts: self.charts(),
            states: self.states(),
        })
    }

    /// The vertices of all bodies as a table: body, vertex, position (m) and distance from the position at rest (m). The
    /// lines that begin with `#` name the scene, the time and the units.
    pub fn vertices_csv(&self) -> String {
        let mut text = self.head("vertices of the bodies, positions in m");
        text.push_str("body,vertex,x,y,z,displacement\n");
        for (body, surface, vertices) in self.bodies() {
            let name = self.hello.bodies.get(body).map(|body| body.name.as_str());
            let name = quoted(name.unwrap_or_default());
            let rows = points(&vertices.positions).zip(displacements(surface, vertices));
            for (vertex, ([x, y, z], moved)) in rows.enumerate() {
                // Writing to a string does not fail. The positions are those of the frame: `f32`.
                let [x, y, z] = [x as f32, y as f32, z as f32];
                let _ = writeln!(text, "{name},{vertex},{x:?},{y:?},{z:?},{moved:.6e}");
            }
        }
        text
    }

    /// The curves around the moment as a table: for each piece of time the least and the greatest force (N) on each hand,
    /// and the least and the greatest coordinates (m) of its position. The lines that begin with `#` name the scene, the
    /// time and the units.
    pub fn curves_csv(&self) -> String {
        let mut text =
            self.head("least and greatest values of the ticks in each piece of time; s, N, m");
        text.push_str("from,to,ticks,missed");
        for index in 0..self.devices() {
            let name = self.device(index);
            for curve in ["force", "x", "y", "z"] {
                for side in ["least", "greatest"] {
                    let _ = write!(text, ",{}", quoted(&format!("{name} {curve} {side}")));
                }
            }
        }
        text.push('\n');
        for piece in self.history.pieces() {
            let (from, to) = (seconds(piece.from_ns), seconds(piece.to_ns));
            let _ = write!(text, "{from:.9},{to:.9},{},{}", piece.ticks, piece.missed);
            for index in 0..self.devices() {
                for range in hand_ranges(piece, index) {
                    for value in [range.least, range.most] {
                        // A curve without values has an empty cell.
                        let _ = if value.is_finite() {
                            write!(text, ",{value:e}")
                        } else {
                            write!(text, ",")
                        };
                    }
                }
            }
            text.push('\n');
        }
        text
    }

    fn head(&self, content: &str) -> String {
        // A line break in a name would end the comment.
        let scene = self.hello.scene.replace(['\n', '\r'], " ");
        format!(
            "# {scene}: {content}\n# moment: {:.9} s, tick {}\n",
            seconds(self.frame.time_ns),
            self.frame.folded.last
        )
    }

    /// Number of devices.
    fn devices(&self) -> usize {
        self.hello.devices.len().max(self.frame.hands.len())
    }

    fn device(&self, index: usize) -> String {
        let device = self.hello.devices.get(index);
        device.map_or_else(|| format!("device {index}"), |device| device.name.clone())
    }

    /// The bodies that have vertices: index, surface of the same topology epoch, vertices.
    fn bodies(&self) -> impl Iterator<Item = (usize, &Surface, &Vertices)> {
        let bodies = self.frame.bodies.iter().enumerate();
        bodies.filter_map(|(index, body)| {
            let vertices = body.vertices.as_ref()?;
            let fits = |surface: &&Surface| {
                surface.body as usize == index && surface.epoch == vertices.epoch
            };
            Some((index, self.surfaces.iter().rev().find(fits)?, vertices))
        })
    }

    /// The marks of the tools.
    fn tools(&self) -> impl Iterator<Item = ToolMark> {
        self.frame.tools.iter().filter_map(|tool| {
            let info = self.hello.obstacle_of(tool.device)?;
            let [x, y, z, ..] = self.frame.obstacles.get(info)?.pose;
            let [a, b, c, ..] = tool.led;
            let led = ObstacleState {
                pose: tool.led,
                ..ObstacleState::default()
            };
            let shape = self.hello.obstacles.get(info)?;
            Some(ToolMark {
                hand: tool.device as usize,
                at: [x, y, z],
                led: [a, b, c],
                ghost: (shape.placed(&led).into_iter())
                    .map(|point| point.map(f64::from))
                    .collect(),
                force: tool.force,
                sites: tool.sites.iter().map(|site| site.map(f64::from)).collect(),
            })
        })
    }

    /// The force, and the displacement from the beginning of the curves, along the axis along which the hands moved most.
    fn charts(&self) -> [Ribbons; 2] {
        let curve = |index: usize, pick: &dyn Fn(&[Range; 4]) -> [f64; 2]| {
            let pieces = self.history.pieces();
            let rows = pieces.map(|piece| {
                let [least, most] = pick(&hand_ranges(piece, index));
                let middle = 0.5 * (seconds(piece.from_ns) + seconds(piece.to_ns));
                [middle, least, most]
            });
            rows.collect::<Vec<_>>()
        };
        let devices = 0..self.devices();
        let axis = self.main_axis();
        [
            Ribbons {
                label: "Force (N)".to_owned(),
                curves: devices
                    .clone()
                    .map(|index| curve(index, &|ranges| [ranges[0].least, ranges[0].most]))
                    .collect(),
            },
            Ribbons {
                label: format!("Displacement along {} (mm)", AXES[axis]),
                curves: devices
                    .map(|index| {
                        // The displacement from the beginning of the curves.
                        let first = self.history.pieces().next();
                        let start = first.map_or(Range::EMPTY, |p| hand_ranges(p, index)[1 + axis]);
                        curve(index, &|ranges| {
                            let range = ranges[1 + axis];
                            [range.least, range.most].map(|position| 1e3 * (position - start.least))
                        })
                    })
                    .collect(),
            },
        ]
    }

    /// The axis along which a hand moved most.
    fn main_axis(&self) -> usize {
        let mut moved = [0.0_f64; 3];
        for index in 0..self.devices() {
            let mut whole = [Range::EMPTY; 3];
            for piece in self.history.pieces() {
                for (whole, range) in whole.iter_mut().zip(&hand_ranges(piece, index)[1..]) {
                    whole.merge(range);
                }
            }
            for (moved, range) in moved.iter_mut().zip(&whole) {
                *moved = moved.max(range.most - range.least);
            }
        }
        let greatest = moved.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        greatest.map_or(0, |(axis, _)| axis)
    }

    /// A line for each hand, and for each body and tool.
    fn states(&self) -> [Vec<String>; 2] {
        let hands = self.frame.hands.iter().enumerate().map(|(index, hand)| {
            let [x, y, z] = hand.force;
            let force = x.hypot(y).hypot(z);
            let force = if force < 1e4 {
                format!("{force:.2} N")
            } else {
                format!("{force:.1e} N")
            };
            format!(
                "{}: {force}, last stage {}{}",
                self.device(index),
                words(&hand.safety),
                if hand.fresh { "" } else { ", no reading" }
            )
        });
        let bodies = self.frame.bodies.iter().enumerate().map(|(index, body)| {
            let name = self.hello.bodies.get(index).map(|body| body.name.as_str());
            let name = name.unwrap_or("body");
            if body.sequence == 0 {
                return format!("{name}: no model yet");
            }
            format!(
                "{name}: model {}, {:.1} ms old, trust {:.2}",
                words(&body.state),
                1e3 * body.age,
                body.trust
            )
        });
        let tools = self.frame.tools.iter().map(|tool| self.touch(tool));
        [hands.collect(), bodies.chain(tools).collect()]
    }

    /// A line for a tool.
    fn touch(&self, tool: &ToolState) -> String {
        let obstacle = self.hello.obstacle_of(tool.device);
        let info = obstacle.and_then(|number| self.hello.obstacles.get(number));
        let name = info.map_or("tool", |info| &info.name);
        let [x, y, z] = tool.force;
        let force = x.hypot(y).hypot(z);
        let (contacts, sites) = (tool.contacts, tool.sites.len());
        format!("{name}: {force:.2} N, contacts within reach: {contacts}, sites: {sites}")
    }
}

/// The force and the three coordinates of a hand in a piece of time.
fn hand_ranges(piece: &Folded, index: usize) -> [Range; 4] {
    piece.hands.get(index).map_or([Range::EMPTY; 4], |hand| {
        let [x, y, z] = hand.position;
        [hand.force_norm, x, y, z]
    })
}

fn points(positions: &[f32]) -> impl Iterator<Item = [f64; 3]> + '_ {
    positions
        .as_chunks()
        .0
        .iter()
        .map(|p: &[f32; 3]| p.map(f64::from))
}

/// The distance of each vertex from its position at rest (m).
fn displacements<'a>(
    surface: &'a Surface,
    vertices: &'a Vertices,
) -> impl Iterator<Item = f64> + 'a {
    let pairs = points(&vertices.positions).zip(points(&surface.rest));
    pairs.map(|([x, y, z], [a, b, c])| ((x - a).powi(2) + (y - b).powi(2) + (z - c).powi(2)).sqrt())
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}

/// The name of a state as words.
fn words(state: &str) -> String {
    state.replace('_', " ")
}

#[cfg(test)]
mod tests;
