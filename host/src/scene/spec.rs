//! What a scene file says, field by field, with its defaults. Units are SI.
//!
//! Each field that has a range checks it while it is read, so that the error carries the file's line and
//! the field's path.

use super::check;
use serde::Deserialize;

/// A whole scene.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Short name, used in logs and plots.
    pub name: String,
    /// One line for people.
    #[serde(default)]
    pub description: String,
    /// How long a run lasts (s), at most a day.
    #[serde(deserialize_with = "check::duration")]
    pub duration: f64,
    /// Fixes every random choice; `--seed` overrides it.
    #[serde(default)]
    pub seed: u64,
    /// The realtime loop.
    #[serde(default, rename = "loop", deserialize_with = "check::table")]
    pub realtime: Realtime,
    /// The host's physics.
    #[serde(default, deserialize_with = "check::table")]
    pub host: Host,
    /// Acceleration of gravity (m/s^2).
    #[serde(default = "earth", deserialize_with = "check::finite3")]
    pub gravity: [f64; 3],
    /// Deformable bodies.
    #[serde(rename = "body", deserialize_with = "check::tables")]
    pub bodies: Vec<Body>,
    /// Haptic devices and the hands that hold them.
    #[serde(rename = "device", deserialize_with = "check::tables")]
    pub devices: Vec<Device>,
}

fn earth() -> [f64; 3] {
    [0.0, 0.0, -9.81]
}

/// `[loop]`: the realtime loop and its force scheme.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Realtime {
    /// Ticks a second (Hz).
    #[serde(deserialize_with = "check::tick_rate")]
    pub rate: f64,
    /// Force between publications.
    #[serde(deserialize_with = "check::word")]
    pub scheme: SchemeName,
    /// `thesis` only: spring from handle to proxy (N/m).
    #[serde(deserialize_with = "check::not_negative")]
    pub thesis_stiffness: f64,
    /// `thesis` only: damping of the proxy (N s/m).
    #[serde(deserialize_with = "check::not_negative")]
    pub thesis_damping: f64,
    /// Share of a publication period over which a new model takes over.
    #[serde(deserialize_with = "check::share")]
    pub blend: f64,
    /// Age beyond which a model is not trusted (s).
    #[serde(deserialize_with = "check::positive")]
    pub age_limit: f64,
    /// Time in which the force then fades (s).
    #[serde(deserialize_with = "check::positive")]
    pub decay: f64,
    /// Time in which it comes back (s).
    #[serde(deserialize_with = "check::positive")]
    pub recovery: f64,
    /// Damping of the safe hold (N s/m).
    #[serde(deserialize_with = "check::not_negative")]
    pub hold_damping: f64,
}

impl Default for Realtime {
    fn default() -> Self {
        Self {
            rate: 1000.0,
            scheme: SchemeName::Linear,
            thesis_stiffness: 200.0,
            thesis_damping: 2.0,
            blend: 0.5,
            age_limit: 0.1,
            decay: 0.3,
            recovery: 0.2,
            hold_damping: 2.0,
        }
    }
}

/// Names of the force schemes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SchemeName {
    /// The published wrench, held.
    Hold,
    /// Held, plus a spring to the proxy and damping (thesis, equation 4.5).
    Thesis,
    /// The local model's extrapolation.
    Linear,
}

/// `[host]`: rates and solver.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Host {
    /// Physics steps a second (Hz).
    #[serde(deserialize_with = "check::rate")]
    pub step_rate: f64,
    /// Local models a second (Hz); at most `step_rate`, which it divides.
    #[serde(deserialize_with = "check::rate")]
    pub publish_rate: f64,
    /// Virtual clock: time from reading the hands to the model's arrival (s), at most 1.
    #[serde(deserialize_with = "check::latency")]
    pub latency: f64,
    /// Cut-off of the filter that smooths the handles' paths (Hz).
    #[serde(deserialize_with = "check::positive")]
    pub smoothing: f64,
    /// Solver: residual relative to the step's first.
    #[serde(deserialize_with = "check::tolerance")]
    pub tolerance: f64,
    /// Solver: most iterations a step.
    #[serde(deserialize_with = "check::iterations")]
    pub max_iterations: usize,
}

impl Default for Host {
    fn default() -> Self {
        Self {
            step_rate: 250.0,
            publish_rate: 250.0,
            latency: 0.004,
            smoothing: 30.0,
            tolerance: 1e-6,
            max_iterations: 1000,
        }
    }
}

/// `[[body]]`: a deformable sheet.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Name, unique among bodies.
    pub name: String,
    /// Where its triangles come from.
    #[serde(deserialize_with = "check::table")]
    pub mesh: MeshSource,
    /// What it is made of.
    #[serde(deserialize_with = "check::table")]
    pub material: Material,
    /// Parts made of something else; later ones win.
    #[serde(default, rename = "region", deserialize_with = "check::tables")]
    pub regions: Vec<Region>,
    /// Rayleigh damping.
    #[serde(default, deserialize_with = "check::table")]
    pub damping: Rayleigh,
    /// Bending stiffness, as a multiple of the thin plate's; zero switches bending off.
    #[serde(default = "one", deserialize_with = "check::not_negative")]
    pub bending: f64,
    /// Where hands hold it.
    #[serde(rename = "handle", deserialize_with = "check::tables")]
    pub handles: Vec<Handle>,
}

fn one() -> f64 {
    1.0
}

/// Where triangles come from.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "MeshFields")]
pub enum MeshSource {
    /// The built-in generator: a rectangle in the xy-plane, centred at the origin, its groups `left`,
    /// `right`, `bottom`, `top` the edges.
    Sheet {
        /// Extent in x (m).
        length: f64,
        /// Extent in y (m).
        width: f64,
        /// Cells in x and y, two triangles each.
        cells: [u32; 2],
    },
    /// A mesh file, its path relative to the scene file (`.obj`, legacy
    /// `.vtk`, `.vtu`, `.vtp`, or Gmsh 4.1 ASCII, `.msh`).
    File(String),
}

/// `mesh` as it is written: a table with one field of two.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MeshFields {
    #[serde(default, deserialize_with = "check::optional_table")]
    sheet: Option<SheetFields>,
    #[serde(default)]
    file: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SheetFields {
    #[serde(deserialize_with = "check::positive")]
    length: f64,
    #[serde(deserialize_with = "check::positive")]
    width: f64,
    #[serde(deserialize_with = "check::cells")]
    cells: [u32; 2],
}

impl TryFrom<MeshFields> for MeshSource {
    type Error = &'static str;

    fn try_from(fields: MeshFields) -> Result<Self, Self::Error> {
        match (fields.sheet, fields.file) {
            (
                Some(SheetFields {
                    length,
                    width,
                    cells,
                }),
                None,
            ) => Ok(Self::Sheet {
                length,
                width,
                cells,
            }),
            (None, Some(file)) => Ok(Self::File(file)),
            // Worded as serde words a wrong value.
            _ => Err("invalid mesh, expected a table with exactly one of `sheet` and `file`"),
        }
    }
}

/// An elastic material, plane stress.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Young's modulus (Pa).
    #[serde(deserialize_with = "check::positive")]
    pub young: f64,
    /// Poisson's ratio.
    #[serde(deserialize_with = "check::poisson")]
    pub poisson: f64,
    /// Thickness (m).
    #[serde(deserialize_with = "check::positive")]
    pub thickness: f64,
    /// Density (kg/m^3).
    #[serde(deserialize_with = "check::positive")]
    pub density: f64,
}

/// `[[body.region]]`: triangles of another material.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Which triangles: a group of the mesh, or those whose barycentre lies in the box.
    #[serde(default)]
    pub group: Option<String>,
    /// Instead of a group: lowest and highest corner of a box (m).
    #[serde(default, rename = "box", deserialize_with = "check::optional_box")]
    pub in_box: Option<[[f64; 3]; 2]>,
    /// Young's modulus there (Pa), if another.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub young: Option<f64>,
    /// Density there (kg/m^3), if another.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub density: Option<f64>,
    /// Thickness there (m), if another.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub thickness: Option<f64>,
}

/// Rayleigh damping `C = mass M + stiffness K`.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Rayleigh {
    /// Mass coefficient (1/s).
    #[serde(deserialize_with = "check::not_negative")]
    pub mass: f64,
    /// Stiffness coefficient (s).
    #[serde(deserialize_with = "check::not_negative")]
    pub stiffness: f64,
}

/// `[[body.handle]]`: vertices that move with a device.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Handle {
    /// Name, for summaries.
    pub name: String,
    /// Which vertices: a group of the mesh, or all inside the box.
    #[serde(default)]
    pub group: Option<String>,
    /// Instead of a group: lowest and highest corner of a box (m).
    #[serde(default, rename = "box", deserialize_with = "check::optional_box")]
    pub in_box: Option<[[f64; 3]; 2]>,
    /// Name of the device that holds it.
    pub device: String,
}

/// `[[device]]`: a haptic device and its hand.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Device {
    /// Name, unique among devices.
    pub name: String,
    /// Which simulated device.
    #[serde(deserialize_with = "check::word")]
    pub model: DeviceName,
    /// Whether its states and wrenches pass through the firmware protocol's 64-byte reports.
    #[serde(default = "yes")]
    pub wire: bool,
    /// Largest force to ask of it (N), if lower than its own.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub max_force: Option<f64>,
    /// Scene metres per device metre.
    #[serde(default = "one", deserialize_with = "check::positive")]
    pub motion_scale: f64,
    /// The hand that holds it.
    #[serde(deserialize_with = "check::table")]
    pub hand: Hand,
}

fn yes() -> bool {
    true
}

/// Simulated devices by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviceName {
    /// Novint Falcon.
    Falcon,
    /// 3D Systems Touch.
    Touch,
    /// Phantom Premium 1.5.
    PhantomPremium,
    /// omega.3.
    Omega3,
}

/// `[device.hand]`: an arm that follows a trajectory.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hand {
    /// Moving mass (kg).
    #[serde(default = "hand_mass", deserialize_with = "check::positive")]
    pub mass: f64,
    /// Stiffness towards the trajectory (N/m).
    #[serde(default = "hand_stiffness", deserialize_with = "check::not_negative")]
    pub stiffness: f64,
    /// Damping (N s/m).
    #[serde(default = "hand_damping", deserialize_with = "check::not_negative")]
    pub damping: f64,
    /// Root mean square of the tremor (m).
    #[serde(default, deserialize_with = "check::not_negative")]
    pub tremor: f64,
    /// Rows `[time, x, y, z]` joined by minimum-jerk segments (s, m from the start).
    #[serde(default, deserialize_with = "check::rows4")]
    pub waypoints: Vec<[f64; 4]>,
    /// Sinusoids added to it.
    #[serde(default, deserialize_with = "check::tables")]
    pub sines: Vec<Sine>,
    /// A recorded trajectory, its path relative to the scene file (CSV: time, x, y, z).
    #[serde(default)]
    pub recording: Option<String>,
}

fn hand_mass() -> f64 {
    0.554
}
fn hand_stiffness() -> f64 {
    135.0
}
fn hand_damping() -> f64 {
    6.45
}

/// One sinusoid of a hand's trajectory.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sine {
    /// Amplitude (m).
    #[serde(deserialize_with = "check::finite3")]
    pub amplitude: [f64; 3],
    /// Frequency (Hz), at most 5.
    #[serde(deserialize_with = "check::hand_frequency")]
    pub frequency: f64,
    /// Phase (rad).
    #[serde(default, deserialize_with = "check::finite")]
    pub phase: f64,
}
