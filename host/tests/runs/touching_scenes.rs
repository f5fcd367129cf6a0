//! Scenes of bodies that touch, which tests of changes share.

/// Two devices, whose hands a test moves.
pub(crate) const DEVICES: &str = r#"
[[device]]
name = "left"
model = "omega3"
hand = {}

[[device]]
name = "right"
model = "omega3"
hand = {}
"#;

const SHEET: &str = r#"name = "torn"

[[obstacle]]
name = "floor"
shape = "plane"
friction = 0.5

[[body]]
name = "sheet"
position = [0.0, 0.0, 0.0003]
self_contact = true
mesh.sheet = { length = 0.06, width = 0.04, cells = [8, 6], pattern = "alternating" }
material = { young = 1e6, poisson = 0.3, thickness = 0.0005, density = 1000.0 }
damping = { mass = 1.0, stiffness = 0.002 }
TEAR
[[body.handle]]
name = "one"
group = "left"
device = "left"

[[body.handle]]
name = "other"
group = "right"
device = "right"
"#;

const TEAR: &str = r"
[body.tear]
strength = 2e5
toughness = 200.0

[[body.tear.notch]]
from = [0.0, 0.02, 0.0]
to = [0.0, 0.0066666666666666, 0.0]
";

/// A sheet on a floor between two hands, which tears from a notch if it `tears`.
pub(crate) fn sheet(tears: bool) -> String {
    let tear = if tears { TEAR } else { "" };
    format!("{}{DEVICES}", SHEET.replacen("TEAR", tear, 1))
}

/// A block on a block on a floor.
pub(crate) const BLOCKS: &str = r#"name = "blocks"

[[obstacle]]
name = "floor"
shape = "plane"
friction = 0.5

[[body]]
name = "lower"
position = [0.0, 0.0, 0.01502]
mesh.box = { size = [0.05, 0.05, 0.03], cells = [4, 4, 2] }
material = { young = 40e3, poisson = 0.3, density = 1000.0 }
damping = { mass = 5.0, stiffness = 0.02 }

[[body]]
name = "upper"
position = [0.002, 0.001, 0.04007]
mesh.box = { size = [0.03, 0.03, 0.02], cells = [2, 2, 2] }
material = { young = 40e3, poisson = 0.3, density = 1000.0 }
damping = { mass = 5.0, stiffness = 0.02 }

[[contact]]
between = ["lower", "upper"]
friction = 0.4
"#;
