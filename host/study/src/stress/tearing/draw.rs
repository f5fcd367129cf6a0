//! The draw of a cell of random tears, and its scene.

use crate::chance::Chance;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

/// Length and width of the sheet (m).
const SIDE: f64 = 0.1;
/// Length of a run (s), and the time in which the hands move.
const DURATION: f64 = 0.6;
const MOVES: [f64; 2] = [0.05, 0.5];

/// Where the hands hold the sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hold {
    /// Beside a notch in the upper border.
    Beside,
    /// At the left and the right border.
    Ends,
}

/// A cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Draw {
    /// Cells of the mesh along and across.
    pub cells: [usize; 2],
    /// Whether the diagonals alternate.
    pub alternating: bool,
    /// Young's modulus times thickness (N/m), toughness times thickness (N), thickness (m), mass per area (kg/m^2).
    pub stretching: f64,
    /// Toughness times thickness (N).
    pub tearing: f64,
    /// Thickness (m).
    pub thickness: f64,
    /// Mass per area (kg/m^2).
    pub mass: f64,
    /// Strength, as a fraction of that which a slit of the length of an edge has.
    pub strength: f64,
    /// Whether the law is that of the thesis.
    pub thesis: bool,
    /// Whether tears start anywhere.
    pub anywhere: bool,
    /// The largest displacement by which a vertex snaps onto the path, as a fraction of the shortest edge at it.
    pub snapping: f64,
    /// Where the hands hold the sheet.
    pub hold: Hold,
    /// Whether the hands stay in the plane of the sheet, and do not tremble.
    pub flat: bool,
    /// Depth of the notch in cells of the mesh; zero for none.
    pub notch: usize,
    /// Displacement of the left and the right hand (m).
    pub moves: [[f64; 3]; 2],
    /// Steps and publications a second (Hz).
    pub rates: [f64; 2],
    /// Latency of the host (s).
    pub latency: f64,
    /// Start and duration of a stall of the host (s).
    pub stall: Option<[f64; 2]>,
    /// Damping by mass (1/s) and by stiffness (s).
    pub damping: [f64; 2],
    /// Seed of the hands.
    pub seed: u64,
}

impl Draw {
    /// The draw of a cell.
    pub fn new(seed: u64, cell: u64) -> Self {
        let chance = Chance::new(seed, cell);
        let of = |name: &str| chance.of(name);
        let unit = |name: &str| of(name).unit(0);
        let log = |name: &str, low: f64, high: f64| {
            libm::exp(of(name).between(0, libm::log(low), libm::log(high)))
        };
        let count = |name: &str, low: f64, high: f64| of(name).between(0, low, high) as usize;
        let hold = if unit("hold") < 0.6 {
            Hold::Beside
        } else {
            Hold::Ends
        };
        let notched = hold == Hold::Beside || unit("notched") < 0.7;
        let cells = [2 * count("along", 3.0, 6.0), count("across", 8.0, 14.0)];
        let flat = unit("flat") < 0.5;
        let notch = if notched {
            count("notch", 2.0, 0.6 * cells[1] as f64).max(2)
        } else {
            0
        };
        let moves = [-1.0, 1.0].map(|side: f64| {
            let of = of(if side < 0.0 { "left" } else { "right" });
            [
                side * of.between(0, 0.01, 0.05),
                of.between(1, -0.02, 0.02),
                if flat {
                    0.0
                } else {
                    of.between(2, -0.03, 0.03)
                },
            ]
        });
        // Few runs have the highest rate, which takes most of the time.
        let step_rate = [125.0, 250.0, 250.0, 500.0, 500.0, 1000.0][count("step rate", 0.0, 6.0)];
        let every = [1.0, 2.0, 4.0][count("every", 0.0, 3.0)];
        let stall = of("stall");
        Self {
            cells,
            alternating: unit("pattern") < 0.5,
            stretching: log("stretching", 300.0, 1e5),
            tearing: log("tearing", 0.05, 5.0),
            thickness: log("thickness", 1e-4, 1e-3),
            mass: log("mass", 0.05, 1.0),
            strength: log("strength", 0.3, 3.0),
            thesis: unit("law") < 0.2,
            anywhere: !notched || unit("anywhere") < 0.5,
            snapping: [0.0, 0.3, 0.5][count("snapping", 0.0, 3.0)],
            hold,
            flat,
            notch,
            moves,
            rates: [step_rate, step_rate / every],
            latency: of("latency").between(0, 0.0, 2e-3),
            stall: (stall.unit(0) < 0.4)
                .then(|| [stall.between(1, 0.05, 0.45), stall.between(2, 0.01, 0.15)]),
            damping: [
                of("damping").between(0, 0.0, 2.0),
                of("damping").between(1, 1e-5, 1e-3),
            ],
            seed: 1 + (unit("seed") * 1e6) as u64,
        }
    }

    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        2 * self.cells[0] * self.cells[1]
    }

    /// The scene, as `palpate run` reads it.
    pub fn scene(&self) -> String {
        let spacing = self.cells.map(|cells| SIDE / cells as f64);
        let young = self.stretching / self.thickness;
        let toughness = self.tearing / self.thickness;
        // Irwin's stress at a slit of two edges.
        let slit = std::f64::consts::PI * spacing[0];
        let strength = self.strength * (young * toughness / slit).sqrt();
        let half = 0.5 * SIDE;
        let (along, across) = (0.4 * spacing[0], 0.4 * spacing[1]);
        let boxes = match self.hold {
            // Two vertices of the border, one edge from the notch.
            Hold::Beside => [-1.0, 1.0].map(|side: f64| {
                let ends = [side * spacing[0], side * 2.0 * spacing[0]];
                let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
                [low - along, half - across, high + along, half + across]
            }),
            Hold::Ends => [-1.0, 1.0].map(|side: f64| {
                let x = side * half;
                [x - along, -0.6 * half, x + along, 0.6 * half]
            }),
        };
        let mut text = format!(
            r#"name = "tear"
duration = {DURATION}
seed = {}
gravity = [0.0, 0.0, 0.0]

[host]
step_rate = {:?}
publish_rate = {:?}
latency = {:?}

[[body]]
name = "sheet"
damping = {{ mass = {:?}, stiffness = {:?} }}

[body.mesh]
sheet = {{ length = {SIDE:?}, width = {SIDE:?}, cells = [{}, {}], pattern = "{}" }}

[body.material]
young = {young:?}
poisson = 0.3
thickness = {:?}
density = {:?}

[body.tear]
law = "{}"
strength = {strength:?}
toughness = {toughness:?}
starts = "{}"
snapping = {:?}
"#,
            self.seed,
            self.rates[0],
            self.rates[1],
            self.latency,
            self.damping[0],
            self.damping[1],
            self.cells[0],
            self.cells[1],
            if self.alternating {
                "alternating"
            } else {
                "regular"
            },
            self.thickness,
            self.mass / self.thickness,
            if self.thesis { "thesis" } else { "toughness" },
            if self.anywhere { "anywhere" } else { "tips" },
            self.snapping,
        );
        if self.notch > 0 {
            let depth = half - self.notch as f64 * spacing[1];
            let _ = write!(
                text,
                "\n[[body.tear.notch]]\nfrom = [0.0, {half:?}, 0.0]\nto = [0.0, {depth:?}, 0.0]\n"
            );
        }
        for (name, [x0, y0, x1, y1]) in ["left", "right"].into_iter().zip(boxes) {
            let _ = write!(
                text,
                "\n[[body.handle]]\nname = \"{name}\"\nbox = [[{x0:?}, {y0:?}, -0.001], [{x1:?}, {y1:?}, 0.001]]\n\
                 device = \"{name}\"\n"
            );
        }
        let [from, to] = MOVES;
        let tremor = if self.flat { 0.0 } else { 0.0001 };
        for (name, [x, y, z]) in ["left", "right"].into_iter().zip(self.moves) {
            let _ = write!(
                text,
                "\n[[device]]\nname = \"{name}\"\nmodel = \"omega3\"\n\n[device.hand]\ngrip = \"firm\"\n\
                 tremor = {tremor:?}\nwaypoints = [[{from:?}, 0.0, 0.0, 0.0], [{to:?}, {x:?}, {y:?}, {z:?}]]\n"
            );
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene;
    use super::*;

    #[test]
    fn every_draw_is_a_scene() {
        for cell in 0..200 {
            let draw = Draw::new(1, cell);
            assert!((90..=260).contains(&draw.triangles()), "{draw:?}");
            let found = scene(1, cell);
            assert!(
                found.is_ok(),
                "{cell}: {}",
                found.err().map_or(String::new(), |e| e.to_string())
            );
        }
    }
}
