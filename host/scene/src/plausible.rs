//! The program refuses a value that no scene can mean, and warns of a value that few scenes mean. Both messages name the
//! likely cause.
//!
//! A number in the wrong unit is still a number: an organ of 80 m, an encoder that counts centimetres and a hand that
//! jumps by 400 mm all run, and give results that mean nothing. Each [`Quantity`] has two ranges. A value outside the
//! wide range, `allowed`, is an error of the scene. A value outside the narrow range, `usual`, is a [`Warning`]. The
//! narrow ranges contain the materials, devices and hands that the field uses, with some room.

use super::error::{SceneError, SourceLocation};
use super::recording::Sample;
use super::source::Source;
use super::spec::{Body, Contact, Device, Hand, Obstacle, Scene};
use physics::Vec3;
use rt_core::Axes;
use sim::DeviceModel;
use std::fmt;

/// A value that is possible, but that few scenes mean.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The field that gives the value.
    pub location: SourceLocation,
    /// The value, in words.
    pub found: String,
    /// The usual values, in words.
    pub usual: String,
    /// The likely cause, and what to do.
    pub advice: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            location,
            found,
            usual,
            advice,
        } = self;
        write!(to, "{location}: found {found}, usual: {usual}; {advice}")
    }
}

/// A quantity of a scene: its ranges, and the likely causes of a value outside them.
#[derive(Clone, Copy, Debug)]
pub struct Quantity {
    unit: &'static str,
    /// Beyond this range a value is warned of.
    usual: [f64; 2],
    /// Beyond this range a value is refused.
    allowed: [f64; 2],
    /// The likely cause of a value that is too small.
    small: &'static str,
    /// The likely cause of a value that is too large.
    large: &'static str,
}

impl Quantity {
    /// The quantity, usual up to `most`.
    pub fn up_to(self, most: f64) -> Self {
        let usual = [self.usual[0], most.min(self.allowed[1])];
        Self { usual, ..self }
    }

    /// Judges a `value` that the scene gives at `field`; `what` says in words of what the value is, or is empty.
    ///
    /// # Errors
    /// [`SceneError::Value`] for a value beyond the allowed range.
    pub fn judge(
        &self,
        source: &Source,
        field: &str,
        what: &str,
        value: f64,
    ) -> Result<Option<Warning>, SceneError> {
        let within = |[low, high]: [f64; 2]| low <= value && value <= high;
        if within(self.usual) {
            return Ok(None);
        }
        let advice = if value < self.usual[0] {
            self.small
        } else {
            self.large
        };
        let words = |range: [f64; 2]| in_words(range, self.unit);
        let found = format!("{}{what}", with_unit(value, self.unit));
        if !within(self.allowed) {
            let allowed = format!("{}; {advice}", words(self.allowed));
            return Err(source.error(field, found, allowed));
        }
        Ok(Some(Warning {
            location: source.location(field),
            found,
            usual: words(self.usual),
            advice: advice.to_owned(),
        }))
    }
}

/// A number as a user would write it: plain, or with an exponent if it is long.
fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || (1e-3..1e5).contains(&size) {
        // Six digits: sums and norms carry rounding errors.
        let digits = if size == 0.0 {
            0
        } else {
            (5.0 - size.log10().floor()).max(0.0) as usize
        };
        let text = format!("{value:.digits$}");
        if text.contains('.') {
            return text.trim_end_matches('0').trim_end_matches('.').to_owned();
        }
        return text;
    }
    let text = format!("{value:.5e}");
    match text.split_once('e') {
        Some((digits, exponent)) => {
            let digits = digits.trim_end_matches('0').trim_end_matches('.');
            format!("{digits}e{exponent}")
        }
        None => text,
    }
}

fn with_unit(value: f64, unit: &str) -> String {
    let text = format!("{} {unit}", number(value));
    text.trim_end().to_owned()
}

/// A range in words.
fn in_words([low, high]: [f64; 2], unit: &str) -> String {
    if high.is_infinite() {
        return format!("{} or above", with_unit(low, unit));
    }
    if low <= 0.0 {
        return format!("up to {}", with_unit(high, unit));
    }
    format!("{} to {}", number(low), with_unit(high, unit))
}

/// Makes the quantities of a table. A row is a name; the unit, the usual range and the allowed range; the likely causes of a
/// value that is too small, and of one that is too large.
macro_rules! quantities {
    ($($(#[$doc:meta])* $vis:vis $name:ident: $unit:expr, $usual:expr, $allowed:expr, $small:expr, $large:expr;)*) => {
        $($(#[$doc])*
        $vis const $name: Quantity = Quantity {
            unit: $unit,
            usual: $usual,
            allowed: $allowed,
            small: $small,
            large: $large,
        };)*

        #[cfg(test)]
        const ALL: &[Quantity] = &[$($name),*];
    };
}

quantities! {
    /// The longest side of a mesh from a file, after `mesh.scale`.
    pub EXTENT_OF_FILE: "m", [1e-3, 3.0], [1e-6, 20.0],
        "is the mesh in metres already? leave out mesh.scale",
        "is the mesh in millimetres (set mesh.scale = 0.001) or in centimetres (0.01)?";
    /// The longest side of a built-in mesh.
    pub EXTENT: "m", [1e-3, 3.0], [1e-6, 20.0],
        "lengths are in metres: 1 mm is 0.001", "is the value in millimetres? lengths are in metres: 1 mm is 0.001";
    POSITION: "m", [0.0, 10.0], [0.0, 1e3],
        "", "is the value in millimetres? positions are in metres";
    DISPLACEMENT: "m", [0.0, 1.0], [0.0, 20.0],
        "", "is the value in millimetres? displacements are in metres";
    GRAVITY: "m/s2", [0.0, 30.0], [0.0, 1e3],
        "", "is the value in mm/s2? gravity on earth is 9.81 m/s2";
    YOUNG_OF_SOLID: "Pa", [100.0, 1e9], [1e-3, 1e13],
        "is the value in kPa or MPa? tissue has 1e3 to 1e6 Pa, rubber 1e6 to 1e8 Pa",
        "is the exponent right? tissue has 1e3 to 1e6 Pa, rubber 1e6 to 1e8 Pa";
    YOUNG_OF_SHEET: "Pa", [1e3, 1e10], [1e-3, 1e13],
        "is the value in kPa, MPa or N/m? rubber has 1e6 to 1e8 Pa, cloth 1e5 to 1e9 Pa",
        "is the exponent right? rubber has 1e6 to 1e8 Pa, cloth 1e5 to 1e9 Pa, paper 3e9 Pa";
    YOUNG_OF_THREAD: "Pa", [1e3, 3e11], [1e-3, 1e13],
        "is the value in kPa, MPa or GPa? rubber has 1e6 to 1e8 Pa, nylon 3e9 Pa, steel 2e11 Pa",
        "is the exponent right? nylon has 3e9 Pa, steel 2e11 Pa";
    DENSITY: "kg/m3", [5.0, 2.5e4], [1e-3, 1e6],
        "is the value in g/cm3? 1 g/cm3 is 1000 kg/m3", "is the value in g/m3? water has 1000 kg/m3, lead 11300 kg/m3";
    THICKNESS: "m", [1e-6, 0.05], [1e-9, 10.0],
        "1 mm is 0.001 m", "is the value in millimetres? 1 mm is 0.001 m";
    FRICTION: "", [0.0, 2.0], [0.0, 100.0],
        "", "is the value in percent? a coefficient of friction is mostly 0 to 1";
    AREA: "m2", [1e-12, 1e-2], [1e-18, 100.0],
        "1 mm2 is 1e-6 m2", "is the value in mm2? 1 mm2 is 1e-6 m2";
    MOTION_SCALE: "", [0.01, 100.0], [1e-6, 1e6],
        "the scale is metres in the scene per metre of the device",
        "the scale is metres in the scene per metre of the device";
    MAX_SPEED: "m/s", [0.01, 20.0], [0.0, f64::INFINITY],
        "a hand that explores moves at 0.1 to 0.5 m/s", "is the value in mm/s? a hand moves at up to 5 m/s";
    MAX_REACH: "m", [1e-3, 3.0], [0.0, f64::INFINITY],
        "the force fades beyond this reach, so the hand would feel almost no force",
        "is the value in millimetres? reaches are in metres";
    /// The distance of a hand's aim from its start. The usual range ends at the workspace of the device.
    REACH: "m", [0.0, 2.0], [0.0, 2.0],
        "", "is the value in millimetres? motions of hands are in metres of the device";
    /// The distance of a handle at rest from the origin of its device. The usual range ends at the workspace of the device.
    pub START: "m", [0.0, 2.0], [0.0, f64::INFINITY],
        "", "set device.mounting.origin such that the handle lies in the workspace of its device, or omit the field";
    ARM_MASS: "kg", [0.01, 10.0], [1e-6, 1e3],
        "the relaxed grip has 0.1 kg", "is the value in grams? the grips have 0.1 to 2 kg";
    ARM_STIFFNESS: "N/m", [0.0, 1e5], [0.0, 1e9],
        "", "the rigid grip has 2000 N/m";
    ARM_DAMPING: "N s/m", [0.0, 1e3], [0.0, 1e7],
        "", "the rigid grip has 60 N s/m";
    TREMOR: "m", [0.0, 5e-3], [0.0, 0.5],
        "", "is the value in millimetres? a steady hand has 1e-4 m";
    TASK_SPEED: "m/s", [1e-4, 5.0], [0.0, f64::INFINITY],
        "a hand that explores moves at 0.05 to 0.5 m/s",
        "is the value in mm/s? a hand that explores moves at 0.05 to 0.5 m/s";
    STRENGTH: "Pa", [100.0, 1e10], [1e-3, 1e13],
        "is the exponent right? tissue bears 1e4 to 1e7 Pa, paper 1e7 to 1e8 Pa",
        "is the exponent right? tissue bears 1e4 to 1e7 Pa, paper 1e7 to 1e8 Pa";
    /// The strength as a fraction of Young's modulus. Beyond a tenth, strains are no longer small before the sheet tears.
    STRENGTH_RATIO: "of `young`", [1e-6, 0.1], [0.0, f64::INFINITY],
        "the sheet would tear under its weight: is the exponent right?",
        "the sheet stretches by more than 10 % before it tears, and its law is for small strains";
    TOUGHNESS: "J/m^2", [0.1, 1e6], [1e-9, 1e12],
        "is the exponent right? tissue takes 10 to 1e4 J/m^2, paper 1e3 to 3e4 J/m^2",
        "is the exponent right? tissue takes 10 to 1e4 J/m^2, paper 1e3 to 3e4 J/m^2";

    // The numbers of a device file, with the ranges of the devices that are sold.
    DEVICE_POSITION_STEP: "m", [1e-8, 1e-3], [1e-12, 5e-3],
        "haptic devices count 1e-6 to 1e-4 m", "is the value in millimetres? haptic devices count 1e-6 to 1e-4 m";
    DEVICE_MASS: "kg", [5e-3, 20.0], [1e-6, 1e3],
        "the handle of a haptic device moves with 0.01 to 2 kg",
        "is the value in grams? the handle of a haptic device moves with 0.01 to 2 kg";
    DEVICE_DAMPING: "N s/m", [0.0, 100.0], [0.0, 1e6],
        "", "haptic devices have up to 5 N s/m";
    DEVICE_FRICTION: "N", [0.0, 20.0], [0.0, 1e6],
        "", "haptic devices have up to 2 N";
    DEVICE_MAX_FORCE: "N", [0.1, 300.0], [1e-6, 1e6],
        "haptic devices exert 1 to 100 N", "haptic devices exert 1 to 100 N";
    DEVICE_WORKSPACE_RADIUS: "m", [5e-3, 2.0], [1e-4, 20.0],
        "haptic devices move by 0.02 to 0.5 m", "is the value in millimetres? haptic devices move by 0.02 to 0.5 m";
    DEVICE_DRIVER_STIFFNESS: "N/m", [10.0, 1e5], [1e-3, 1e6],
        "is the value in N/mm? 1 N/mm is 1000 N/m", "drivers recommend 300 to 20000 N/m";
}

/// A number of a device file: its name, its value in a model, and its quantity.
type DeviceNumber = (&'static str, fn(&DeviceModel) -> f64, Quantity);

/// The numbers of a device file.
const DEVICE: [DeviceNumber; 7] = [
    (
        "position_step",
        |model| model.position_step,
        DEVICE_POSITION_STEP,
    ),
    ("mass", |model| model.mass, DEVICE_MASS),
    ("damping", |model| model.damping, DEVICE_DAMPING),
    ("friction", |model| model.friction, DEVICE_FRICTION),
    ("max_force", |model| model.max_force, DEVICE_MAX_FORCE),
    (
        "workspace_radius",
        |model| model.workspace_radius,
        DEVICE_WORKSPACE_RADIUS,
    ),
    (
        "driver_stiffness",
        |model| model.driver_stiffness,
        DEVICE_DRIVER_STIFFNESS,
    ),
];

/// The quantity of a material that a field of the mesh or the scene gives by `name`; `None` for a quantity that has a
/// strict range of its own.
pub fn of_material(body: &Body, name: &str) -> Option<&'static Quantity> {
    // Threads alone have a cross-section, and sheets alone a thickness: the material was checked, or will be.
    let material = &body.material;
    Some(match name {
        "young" if material.area.is_some() => &YOUNG_OF_THREAD,
        "young" if material.thickness.is_some() => &YOUNG_OF_SHEET,
        "young" => &YOUNG_OF_SOLID,
        "density" => &DENSITY,
        "thickness" => &THICKNESS,
        "area" => &AREA,
        _ => return None,
    })
}

/// Collects the warnings of a file; refuses at the first impossible value.
struct Judge<'a> {
    source: &'a Source,
    warnings: Vec<Warning>,
}

type Check = Result<(), SceneError>;

impl Judge<'_> {
    fn see(&mut self, quantity: &Quantity, field: &str, value: f64) -> Check {
        self.describe(quantity, field, "", value)
    }

    fn given(&mut self, quantity: &Quantity, field: &str, value: Option<f64>) -> Check {
        value.map_or(Ok(()), |value| self.see(quantity, field, value))
    }

    fn describe(&mut self, quantity: &Quantity, field: &str, what: &str, value: f64) -> Check {
        let warning = quantity.judge(self.source, field, what, value)?;
        self.warnings.extend(warning);
        Ok(())
    }

    fn body(&mut self, at: &str, body: &Body) -> Check {
        self.see(&POSITION, &format!("{at}.position"), norm(body.position))?;
        let material = &body.material;
        let materials = [(
            format!("{at}.material"),
            [
                ("young", Some(material.young)),
                ("density", Some(material.density)),
                ("thickness", material.thickness),
                ("area", material.area),
            ],
        )];
        let regions = body.regions.iter().enumerate().map(|(number, region)| {
            (
                format!("{at}.region[{number}]"),
                [
                    ("young", region.young),
                    ("density", region.density),
                    ("thickness", region.thickness),
                    ("area", region.area),
                ],
            )
        });
        for (at, values) in materials.into_iter().chain(regions) {
            for (name, value) in values {
                if let Some(quantity) = of_material(body, name) {
                    self.given(quantity, &format!("{at}.{name}"), value)?;
                }
            }
        }
        if let (Some(weave), Some(young)) = (material.weave, of_material(body, "young")) {
            let at = format!("{at}.material.weave");
            self.see(young, &format!("{at}.young_weft"), weave.young_weft)?;
        }
        let thickness = body.contact_thickness;
        self.given(&THICKNESS, &format!("{at}.contact_thickness"), thickness)?;
        for (number, support) in body.supports.iter().enumerate() {
            let field = format!("{at}.support[{number}].displacement");
            self.see(&DISPLACEMENT, &field, norm(support.displacement))?;
        }
        let Some(tear) = &body.tear else {
            return Ok(());
        };
        let field = format!("{at}.tear.strength");
        self.see(&STRENGTH, &field, tear.strength)?;
        self.see(&STRENGTH_RATIO, &field, tear.strength / material.young)?;
        self.see(&TOUGHNESS, &format!("{at}.tear.toughness"), tear.toughness)
    }

    fn obstacle(&mut self, at: &str, obstacle: &Obstacle) -> Check {
        let field = |name: &str| format!("{at}.{name}");
        let position = obstacle.position.map(norm);
        self.given(&POSITION, &field("position"), position)?;
        self.given(&EXTENT, &field("radius"), obstacle.radius)?;
        self.given(&EXTENT, &field("length"), obstacle.length)?;
        let longest = obstacle.size.map(|size| Vec3::from(size).max());
        self.given(&EXTENT, &field("size"), longest)?;
        self.given(&FRICTION, &field("friction"), obstacle.friction)
    }

    fn contact(&mut self, at: &str, contact: &Contact) -> Check {
        self.given(&FRICTION, &format!("{at}.friction"), contact.friction)?;
        self.given(&THICKNESS, &format!("{at}.thickness"), contact.thickness)
    }

    fn device(
        &mut self,
        at: &str,
        device: &Device,
        model: &DeviceModel,
        recording: Option<&[Sample]>,
    ) -> Check {
        self.see(
            &MOTION_SCALE,
            &format!("{at}.motion_scale"),
            device.motion_scale,
        )?;
        let origin = device.mounting.origin.map(norm);
        self.given(&POSITION, &format!("{at}.mounting.origin"), origin)?;
        self.given(&MAX_SPEED, &format!("{at}.max_speed"), device.max_speed)?;
        self.given(&MAX_REACH, &format!("{at}.max_reach"), device.max_reach)?;
        match &device.hand {
            Some(hand) => {
                self.moves(at, hand, model)?;
                // A box says no more of a motion's length than its diagonal.
                let diagonal =
                    |[low, high]: [[f64; 3]; 2]| (Vec3::from(high) - Vec3::from(low)).norm();
                let reach = device.workspace.map_or(model.workspace_radius, diagonal);
                self.hand(&format!("{at}.hand"), hand, reach, recording)
            }
            None => Ok(()),
        }
    }

    /// A task moves its hand along at least one axis of the device. The mechanism bears the force across the axes.
    fn moves(&self, at: &str, hand: &Hand, model: &DeviceModel) -> Check {
        let Some((axes, direction)) = model.axes.zip(hand.direction) else {
            return Ok(());
        };
        if axes.part(&Vec3::from(direction)) != Vec3::zeros() {
            return Ok(());
        }
        let allowed = format!("a direction with {}", part_along(axes));
        let field = format!("{at}.hand.direction");
        Err(self.source.error(&field, format!("{direction:?}"), allowed))
    }

    fn hand(&mut self, at: &str, hand: &Hand, reach: f64, recording: Option<&[Sample]>) -> Check {
        let field = |name: &str| format!("{at}.{name}");
        self.given(&ARM_MASS, &field("mass"), hand.mass)?;
        self.given(&ARM_STIFFNESS, &field("stiffness"), hand.stiffness)?;
        self.given(&ARM_DAMPING, &field("damping"), hand.damping)?;
        self.see(&TREMOR, &field("tremor"), hand.tremor)?;
        self.given(&TASK_SPEED, &field("speed"), hand.speed)?;
        let reach = REACH.up_to(reach);
        let from = " from the start of the hand";
        for (name, distance) in [("depth", hand.depth), ("width", hand.width)] {
            if let Some(distance) = distance {
                self.describe(&reach, &field(name), from, distance)?;
            }
        }
        let rows = hand.waypoints.iter().enumerate();
        let farthest = rows.map(|(row, [_, x, y, z])| (row, norm([*x, *y, *z])));
        if let Some((row, distance)) = farthest.max_by(|a, b| a.1.total_cmp(&b.1)) {
            self.describe(&reach, &field(&format!("waypoints[{row}]")), from, distance)?;
        }
        for (number, sine) in hand.sines.iter().enumerate() {
            let field = field(&format!("sines[{number}].amplitude"));
            self.describe(&reach, &field, from, norm(sine.amplitude))?;
        }
        let samples = recording.unwrap_or_default().iter();
        let farthest = samples.map(|(time, position)| (*time, norm(*position)));
        if let Some((time, distance)) = farthest.max_by(|a, b| a.1.total_cmp(&b.1)) {
            let what = format!("{from}, at time {}", with_unit(time, "s"));
            self.describe(&reach, &field("recording"), &what, distance)?;
        }
        Ok(())
    }
}

fn norm([x, y, z]: [f64; 3]) -> f64 {
    x.hypot(y).hypot(z)
}

/// What moves a device along `axes`, in words.
pub(super) fn part_along(axes: Axes) -> String {
    let names = ["x", "y", "z"].into_iter().zip(axes.free());
    let names: Vec<_> = names
        .filter_map(|(name, free)| free.then_some(name))
        .collect();
    let names = names.join(" and ");
    format!("a part along {names}, the axes along which this device moves")
}

/// The warnings about the fields of a scene. Those that need a mesh are in `host::world::World::warnings`.
///
/// # Errors
/// [`SceneError::Value`] for the first value that no scene can mean.
pub(super) fn check(
    scene: &Scene,
    source: &Source,
    models: &[DeviceModel],
    recordings: &[Option<Vec<Sample>>],
) -> Result<Vec<Warning>, SceneError> {
    let mut judge = Judge {
        source,
        warnings: Vec::new(),
    };
    judge.see(&GRAVITY, "gravity", norm(scene.gravity))?;
    for (index, body) in scene.bodies.iter().enumerate() {
        judge.body(&format!("body[{index}]"), body)?;
    }
    for (index, obstacle) in scene.obstacles.iter().enumerate() {
        judge.obstacle(&scene.field_of_obstacle(index), obstacle)?;
    }
    for (index, contact) in scene.contacts.iter().enumerate() {
        judge.contact(&format!("contact[{index}]"), contact)?;
    }
    let devices = scene.devices.iter().zip(models).zip(recordings).enumerate();
    for (index, ((device, model), recording)) in devices {
        judge.device(
            &format!("device[{index}]"),
            device,
            model,
            recording.as_deref(),
        )?;
    }
    Ok(judge.warnings)
}

/// The warnings about a device file, with its lines.
///
/// # Errors
/// [`SceneError::Value`] for the first value that no device has.
pub(super) fn check_device_file(
    source: &Source,
    model: &DeviceModel,
) -> Result<Vec<Warning>, SceneError> {
    let mut judge = Judge {
        source,
        warnings: Vec::new(),
    };
    for (field, value, quantity) in DEVICE {
        judge.see(&quantity, field, value(model))?;
    }
    Ok(judge.warnings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_users_write_them() {
        for (value, text) in [
            (0.0, "0"),
            (80.0, "80"),
            (0.001, "0.001"),
            (5e9, "5e9"),
            (1.5e-7, "1.5e-7"),
            (0.1 + 0.2, "0.3"),
            (-3.25, "-3.25"),
            (99_999.0, "99999"),
            (1e5, "1e5"),
            (12.012_345_678, "12.0123"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn the_allowed_range_contains_the_usual_one_and_each_side_has_advice() {
        for quantity in ALL {
            let Quantity { usual, allowed, .. } = quantity;
            assert!(
                allowed[0] <= usual[0] && usual[0] < usual[1] && usual[1] <= allowed[1],
                "{quantity:?}"
            );
            assert!(!quantity.large.is_empty(), "{quantity:?}");
            assert_eq!(quantity.small.is_empty(), usual[0] == 0.0, "{quantity:?}");
        }
    }

    #[test]
    fn every_built_in_device_is_usual() {
        let source = Source::new("built in", "");
        for (name, model) in DeviceModel::all() {
            assert_eq!(check_device_file(&source, &model).unwrap(), [], "{name}");
        }
    }
}
