//! The counted ticks of a tool that touches: far from the surface, and with one to sixteen contacts, also in the tick of a message.

use rt_core::geometry::Mat3;
use rt_core::hull::Hull;
use rt_core::tool::{Patch, Tool, ToolConfig, Triangle};
use rt_core::{Pose, Vec3};
use std::hint::black_box;

/// The period of the loop (s).
const PERIOD: f64 = 1e-3;
/// The stiffest spring of the device (N/m).
const STIFFEST: f64 = 3000.0;
/// Ticks before the counted one: the tool has come down, is pressed by 1 mm, and rubs.
const BEFORE: u32 = 300;
/// The distance of neighbouring sites (m), and the compliance of a site alone (m/N).
const SPACING: f64 = 4e-3;
const COMPLIANCE: f64 = 1.0 / 800.0;

/// One counted tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch {
    name: &'static str,
    /// Half the sides of a plate (m); zero for a ball.
    half: [f64; 2],
    /// Radius (m).
    radius: f64,
    turns: bool,
    /// The height of the tool over the place where it touches (m).
    above: f64,
    /// Whether a message comes in this tick.
    is_told: bool,
    /// The contacts that the tick has.
    contacts: usize,
}

impl Touch {
    const BALL: Self = Self {
        name: "far",
        half: [0.0; 2],
        radius: 2e-3,
        turns: false,
        above: -1e-3,
        is_told: false,
        contacts: 1,
    };
}

/// The ticks of the table.
pub(crate) const GATE: [Touch; 7] = [
    Touch {
        above: 0.05,
        contacts: 0,
        ..Touch::BALL
    },
    Touch {
        name: "ball",
        radius: 8e-3,
        ..Touch::BALL
    },
    Touch {
        name: "ball, deep",
        radius: 8e-3,
        above: -4.4e-3,
        contacts: 4,
        ..Touch::BALL
    },
    Touch {
        name: "plate",
        half: [3e-3, 1e-3],
        contacts: 8,
        ..Touch::BALL
    },
    Touch {
        name: "large plate",
        half: [5e-3, 4e-3],
        contacts: 16,
        ..Touch::BALL
    },
    Touch {
        name: "large plate, message",
        half: [5e-3, 4e-3],
        is_told: true,
        contacts: 16,
        ..Touch::BALL
    },
    Touch {
        name: "large plate that turns",
        half: [5e-3, 4e-3],
        turns: true,
        contacts: 16,
        ..Touch::BALL
    },
];

impl Touch {
    /// The name in the table.
    pub(crate) fn name(&self) -> String {
        format!("tool, {}, {}", self.name, self.contacts)
    }

    /// The state just before the tick.
    pub(crate) fn prepare(&self) -> Touching {
        let mut tool = Tool::new(ToolConfig {
            hull: self.hull(),
            turns: self.turns,
            radius: self.radius,
            period: PERIOD,
            stiffest: STIFFEST,
            most_damping: f64::INFINITY,
            parting: 0.02,
        });
        let mut patch = pad();
        tool.accept(&patch).expect("a sound patch");
        for tick in 0..BEFORE {
            tool.tick(&self.hand(tick));
        }
        patch.head.sequence += 1;
        Touching {
            touch: *self,
            tool,
            patch,
        }
    }

    fn hull(&self) -> Hull {
        let [x, y] = self.half;
        let corners = [[x, y], [-x, y], [-x, -y], [x, -y]].map(|[x, y]| Vec3::new(x, y, 0.0));
        if x == 0.0 {
            Hull::POINT
        } else {
            Hull::new(&corners).expect("four points")
        }
    }

    fn hand(&self, tick: u32) -> Pose {
        let time = f64::from(tick) * PERIOD;
        let height = self.radius + self.above + (5e-3 - 0.05 * time).max(0.0);
        let turn = 2.0 * core::f64::consts::PI * time;
        Pose::at(Vec3::new(
            1e-3 * turn.sin(),
            0.5e-3 * (2.0 * turn).sin(),
            height,
        ))
    }
}

/// A tick that is prepared to run.
#[derive(Clone)]
pub(crate) struct Touching {
    touch: Touch,
    tool: Tool,
    patch: Patch,
}

impl Touching {
    /// The tick. Returns whether it had the contacts that its name tells.
    pub(crate) fn run(&mut self) -> bool {
        measured_touch(black_box(self));
        self.contacts() == self.touch.contacts
    }

    /// The contacts after the tick.
    pub(crate) fn contacts(&self) -> usize {
        self.tool.contacts().len()
    }
}

/// The name of [`measured_touch`] in valgrind.
pub(crate) const MEASURED: &str = "instructions::touches::measured_touch";

/// The counted function.
#[inline(never)]
fn measured_touch(touching: &mut Touching) {
    if touching.touch.is_told {
        // The patch is sound, and newer than the last one.
        let _ = touching.tool.accept(&touching.patch);
    }
    touching.tool.tick(&touching.touch.hand(BEFORE));
}

/// Sixteen sites of a plane, and how they yield: the kernel of a half-space, smoothed over 3 mm.
fn pad() -> Patch {
    let mut patch = Patch::empty();
    patch.head.sequence = 1;
    patch.head.period = 0.016;
    patch.head.damping = 2e-3;
    (patch.head.site_count, patch.head.triangle_count) = (16, 18);
    patch.head.stiffness = 1.0 / COMPLIANCE;
    let at = |i: u8, j: u8| 4 * i + j;
    let cells = (0..3).flat_map(|i| (0..3).map(move |j| (i, j)));
    let corners = cells.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    for (triangle, corners) in patch.head.triangles.iter_mut().zip(corners) {
        *triangle = Triangle {
            corners,
            friction: 0.3,
        };
    }
    for (site, number) in patch.sites.iter_mut().zip(0_u8..) {
        let [i, j] = [number / 4, number % 4].map(|k| SPACING * (f64::from(k) - 1.5));
        (site.vertex, site.place) = (number.into(), Vec3::new(i, j, 0.0));
    }
    for (row, one) in patch.compliance.iter_mut().zip(&patch.sites) {
        for (block, other) in row.iter_mut().zip(&patch.sites) {
            let kernel = 3e-3 / (one.place - other.place).norm().hypot(3e-3);
            *block = Mat3::identity() * (COMPLIANCE * kernel);
        }
    }
    patch
}
