//! Checks across several fields: whether the parts of a scene are consistent.

use super::drivers::drivers;
use super::spec::body::BorderName;
use super::spec::{
    Body, Device, Hand, Handle, Host, MeshSource, Notch, Realtime, Rotation, Scene, SolverName,
    Starts, TaskName, Tear,
};
use rt_core::{MAX_BODIES, MAX_DEVICES, MAX_HANDLES, Vec3};
use sim::TaskKind;
use std::collections::BTreeMap;
use std::path::Path;

/// Largest number of cells of a generated mesh.
const MOST_CELLS: u64 = 1_000_000;
/// Longest name, in characters.
const LONGEST_NAME: usize = 64;
/// Relative tolerance within which a ratio of rates counts as a whole number.
const WHOLE: f64 = 1e-9;

/// A field that contradicts the rest of its scene.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Conflict {
    pub(super) field: String,
    pub(super) found: String,
    pub(super) allowed: String,
}

pub(super) type Check = Result<(), Conflict>;

/// Fails with a conflict at `field` unless `holds`.
pub(super) fn require(
    holds: bool,
    field: &str,
    found: impl Into<String>,
    allowed: impl Into<String>,
) -> Check {
    if holds {
        return Ok(());
    }
    Err(Conflict {
        field: field.to_owned(),
        found: found.into(),
        allowed: allowed.into(),
    })
}

/// Checks a scene; stops at the first conflict.
pub(super) fn check(scene: &Scene) -> Check {
    name("name", &scene.name)?;
    rates(&scene.realtime, &scene.host)?;
    let has_touch = !scene.tools.is_empty() && !scene.given_obstacles().is_empty();
    require(
        !scene.bodies.is_empty() || has_touch,
        "body",
        "no body",
        format!("1 to {MAX_BODIES} bodies, or a tool and an obstacle that it touches"),
    )?;
    at_most("body", scene.bodies.len(), MAX_BODIES)?;
    at_most("device", scene.devices.len(), MAX_DEVICES)?;
    names("body", scene.bodies.iter().map(|body| &body.name))?;
    names("device", scene.devices.iter().map(|device| &device.name))?;
    for (index, body) in scene.bodies.iter().enumerate() {
        check_body(&format!("body[{index}]"), body)?;
        check_tear(&format!("body[{index}]"), body, &scene.host)?;
    }
    check_holding(scene)?;
    for (index, device) in scene.devices.iter().enumerate() {
        check_driver(&format!("device[{index}]"), device)?;
        check_held(&format!("device[{index}]"), device)?;
        check_mounting(&format!("device[{index}]"), device)?;
        check_heat(&format!("device[{index}]"), device)?;
        check_square_wave(&format!("device[{index}]"), device, scene.realtime.rate)?;
    }
    Ok(())
}

fn rates(realtime: &Realtime, host: &Host) -> Check {
    let (step, publish) = (host.step_rate, host.publish_rate);
    require(
        step <= realtime.rate,
        "host.step_rate",
        format!("{step:?}"),
        format!("at most loop.rate, {:?}", realtime.rate),
    )?;
    let ratio = step / publish;
    require(
        ratio >= 1.0 - WHOLE && (ratio - ratio.round()).abs() <= WHOLE * ratio,
        "host.publish_rate",
        format!("{publish:?}"),
        format!("host.step_rate, {step:?}, divided by a whole number"),
    )
}

pub(super) fn at_most(field: &str, found: usize, most: usize) -> Check {
    require(
        found <= most,
        field,
        format!("{found} entries"),
        format!("up to {most} entries"),
    )
}

fn name(field: &str, name: &str) -> Check {
    let fits = !name.trim().is_empty()
        && name.chars().count() <= LONGEST_NAME
        && !name.chars().any(char::is_control);
    require(
        fits,
        field,
        format!("{name:?}"),
        format!("a name of 1 to {LONGEST_NAME} characters"),
    )
}

/// Checks the names of a list's members: each can be printed, and no two are equal.
pub(super) fn names<'a>(list: &str, members: impl Iterator<Item = &'a String>) -> Check {
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for (index, member) in members.enumerate() {
        let field = format!("{list}[{index}].name");
        name(&field, member)?;
        let first = *seen.entry(member).or_insert(index);
        let allowed = format!("another name than that of {list}[{first}]");
        require(first == index, &field, format!("{member:?}"), allowed)?;
    }
    Ok(())
}

fn check_body(at: &str, body: &Body) -> Check {
    let cells = |field: &str, cells: &[u32]| {
        let total = cells.iter().map(|&n| u64::from(n)).product::<u64>();
        let found: Vec<_> = cells.iter().map(u32::to_string).collect();
        let found = format!("{} = {total}", found.join(" x "));
        let allowed = format!("up to {MOST_CELLS} cells in all");
        let field = format!("{at}.mesh.{field}");
        require(total <= MOST_CELLS, &field, found, allowed)
    };
    match &body.mesh.source {
        MeshSource::Sheet { cells: n, .. } => cells("sheet.cells", n)?,
        MeshSource::Box { cells: n, .. } => cells("box.cells", n)?,
        MeshSource::Thread { segments, .. } => cells("thread.segments", &[*segments])?,
        MeshSource::Plate { plate, .. } => cells("plate.cells", &[plate.around, plate.outward])?,
        MeshSource::File(file) => file_name(&format!("{at}.mesh.file"), file)?,
    }
    require(
        body.mesh.flat_pattern.is_none() || matches!(body.mesh.source, MeshSource::File(_)),
        &format!("{at}.mesh.flat_pattern"),
        "a pattern for a mesh that is built in",
        "`file` with an OBJ file, whose texture coordinates are the pattern",
    )?;
    require(
        body.mesh.merge.is_none() || matches!(body.mesh.source, MeshSource::File(_)),
        &format!("{at}.mesh.merge"),
        "a distance for a mesh that is built in",
        "`file`: a built-in mesh has no doubled vertices",
    )?;
    require(
        body.mesh.scale.is_none() || matches!(body.mesh.source, MeshSource::File(_)),
        &format!("{at}.mesh.scale"),
        "a scale for a mesh that is built in",
        "`file`: the lengths of a built-in mesh are in metres",
    )?;
    check_rotation(&format!("{at}.rotation"), body.rotation)?;
    for (index, region) in body.regions.iter().enumerate() {
        check_where(
            &format!("{at}.region[{index}]"),
            region.group.as_ref(),
            region.in_box,
        )?;
    }
    names(
        &format!("{at}.handle"),
        body.handles.iter().map(|handle| &handle.name),
    )?;
    check_supports(at, body)?;
    check_loads(at, body)?;
    for (index, handle) in body.handles.iter().enumerate() {
        check_where(
            &format!("{at}.handle[{index}]"),
            handle.group.as_ref(),
            handle.in_box,
        )?;
    }
    Ok(())
}

/// A rotation has an axis.
pub(super) fn check_rotation(at: &str, rotation: Option<Rotation>) -> Check {
    require(
        rotation.is_none_or(|rotation| rotation.axis != [0.0; 3]),
        &format!("{at}.axis"),
        "[0, 0, 0]",
        "a direction: any length but 0",
    )
}

fn check_supports(at: &str, body: &Body) -> Check {
    names(
        &format!("{at}.support"),
        body.supports.iter().map(|support| &support.name),
    )?;
    for (index, support) in body.supports.iter().enumerate() {
        let mut handles = body.handles.iter();
        let same = handles.position(|handle| handle.name == support.name);
        require(
            same.is_none(),
            &format!("{at}.support[{index}].name"),
            format!("{:?}", support.name),
            format!(
                "another name than that of {at}.handle[{}]",
                same.unwrap_or(0)
            ),
        )?;
        let at = format!("{at}.support[{index}]");
        check_where(&at, support.group.as_ref(), support.in_box)?;
        let all = support.axes == [true; 3];
        require(
            all || support.rotation.is_none(),
            &format!("{at}.axes"),
            "some axes, and a rotation",
            "all axes for a support that is turned",
        )?;
        require(
            all || support.border == BorderName::Hinged,
            &format!("{at}.axes"),
            "some axes, and a clamped border",
            "all axes for a support that clamps the border",
        )?;
        for axis in 0..3 {
            require(
                support.axes[axis] || support.displacement[axis] == 0.0,
                &format!("{at}.displacement[{axis}]"),
                format!("{:?}", support.displacement[axis]),
                "0 along an axis that is free",
            )?;
        }
    }
    Ok(())
}

fn check_loads(at: &str, body: &Body) -> Check {
    names(
        &format!("{at}.load"),
        body.loads.iter().map(|load| &load.name),
    )?;
    for (index, load) in body.loads.iter().enumerate() {
        let at = format!("{at}.load[{index}]");
        check_where(&at, load.group.as_ref(), load.in_box)?;
        let found = match (load.force, load.traction) {
            (None, None) => "neither `force` nor `traction`",
            (Some(_), Some(_)) => "both `force` and `traction`",
            _ => continue,
        };
        require(false, &at, found, "exactly one of the two")?;
    }
    Ok(())
}

/// A body that tears is an isotropic sheet without clamped borders, and its law has its values.
fn check_tear(at: &str, body: &Body, host: &Host) -> Check {
    let Some(tear) = &body.tear else {
        return Ok(());
    };
    let field = |name: &str| format!("{at}.tear{name}");
    require(
        body.material.weave.is_none(),
        &field(""),
        "the tear of a woven sheet",
        "no such table, because only isotropic sheets tear",
    )?;
    let clamped = |border: BorderName| border == BorderName::Clamped;
    let handles = body.handles.iter().map(|handle| handle.border);
    let supports = body.supports.iter().map(|support| support.border);
    for (list, clamps) in [
        ("handle", handles.map(clamped).collect::<Vec<_>>()),
        ("support", supports.map(clamped).collect()),
    ] {
        if let Some(index) = clamps.iter().position(|&clamps| clamps) {
            let allowed = "\"hinged\" for a body that tears";
            require(
                false,
                &format!("{at}.{list}[{index}].border"),
                "\"clamped\"",
                allowed,
            )?;
        }
    }
    require(
        tear.starts != Some(Starts::Tips) || !tear.notches.is_empty(),
        &field(".starts"),
        "\"tips\" without a notch",
        "\"anywhere\", or a `[[body.tear.notch]]` that has a tip",
    )?;
    check_notches(&field(".notch"), tear)?;
    let allowed = format!(
        "\"auto\" or \"frozen\", because the body {:?} tears",
        body.name
    );
    require(
        host.solver != SolverName::Incomplete,
        "host.solver",
        "\"incomplete\"",
        allowed,
    )
}

/// A notch has two ends, and a row of cuts has a step.
fn check_notches(at: &str, tear: &Tear) -> Check {
    for (index, notch) in tear.notches.iter().enumerate() {
        let at = format!("{at}[{index}]");
        let Notch {
            from,
            to,
            count,
            step,
        } = notch;
        let found = format!("{to:?}");
        require(
            from != to,
            &format!("{at}.to"),
            found,
            "another point than `from`",
        )?;
        match step {
            None => require(
                *count == 1,
                &format!("{at}.count"),
                format!("{count} cuts without a `step`"),
                "1, or a `step` from each cut to the next",
            )?,
            Some(step) => {
                let field = format!("{at}.step");
                let found = format!("{step:?}");
                require(
                    *step != [0.0; 3],
                    &field,
                    found.as_str(),
                    "any step but [0, 0, 0]",
                )?;
                let allowed = "no such field for one cut: give a `count` above 1";
                require(*count > 1, &field, found, allowed)?;
            }
        }
    }
    Ok(())
}

/// A rotated device has an axis of rotation, and the corners of a workspace are in order.
fn check_mounting(at: &str, device: &Device) -> Check {
    check_rotation(&format!("{at}.mounting.rotation"), device.mounting.rotation)?;
    device.workspace.map_or(Ok(()), |corners| {
        check_box(&format!("{at}.workspace"), corners)
    })
}

/// The continuous force of the motors must exceed the weight of the grip.
fn check_heat(at: &str, device: &Device) -> Check {
    let weight = Vec3::from(device.grip_weight.unwrap_or_default()).norm();
    device.continuous_force.map_or(Ok(()), |force| {
        let allowed = format!("a force above the weight of the grip, {weight:?} N");
        let field = format!("{at}.continuous_force");
        require(force > weight, &field, format!("{force:?}"), allowed)
    })
}

/// A square wave holds each of its forces for a tick at least.
fn check_square_wave(at: &str, device: &Device, rate: f64) -> Check {
    device.square_wave.map_or(Ok(()), |wave| {
        let allowed = format!("a tick at least, {:?} s", 1.0 / rate);
        let field = format!("{at}.square_wave.half_period");
        let found = wave.half_period;
        require(found * rate >= 1.0, &field, format!("{found:?}"), allowed)
    })
}

/// Checks the selection of a part of a mesh: by group or by box, not both.
fn check_where(at: &str, group: Option<&String>, in_box: Option<[[f64; 3]; 2]>) -> Check {
    let allowed = "exactly one of the two";
    match (group, in_box) {
        (None, None) => require(false, at, "neither `group` nor `box`", allowed),
        (Some(_), Some(_)) => require(false, at, "both `group` and `box`", allowed),
        (Some(group), None) => name(&format!("{at}.group"), group),
        (None, Some(corners)) => check_box(&format!("{at}.box"), corners),
    }
}

/// The corners of a box are in order.
fn check_box(field: &str, [low, high]: [[f64; 3]; 2]) -> Check {
    for (axis, (low, high)) in ["x", "y", "z"].iter().zip(low.into_iter().zip(high)) {
        let found = format!("{axis} from {low:?} to {high:?}");
        let allowed = "the lowest corner first, then the highest corner";
        require(low <= high, field, found, allowed)?;
    }
    Ok(())
}

pub(super) fn file_name(field: &str, file: &str) -> Check {
    let fits = !file.trim().is_empty() && !file.chars().any(char::is_control);
    require(fits, field, format!("{file:?}"), "the name of a file")
}

/// Checks that each handle names a device of the scene. Handles of one body that name the same device are one rigid
/// handle, so they treat the border alike.
fn check_holding(scene: &Scene) -> Check {
    for (index, body) in scene.bodies.iter().enumerate() {
        let mut held: Vec<(usize, &Handle)> = Vec::new();
        for (number, handle) in body.handles.iter().enumerate() {
            let at = format!("body[{index}].handle[{number}]");
            let exists = scene
                .devices
                .iter()
                .any(|device| device.name == handle.device);
            require(
                exists,
                &format!("{at}.device"),
                format!("{:?}", handle.device),
                device_names(&scene.devices),
            )?;
            let same = held.iter().find(|(_, other)| other.device == handle.device);
            let Some((first, other)) = same else {
                held.push((number, handle));
                continue;
            };
            require(
                handle.border == other.border,
                &format!("{at}.border"),
                format!("another border than that of body[{index}].handle[{first}]"),
                format!(
                    "the same border: the device {:?} holds both, as one rigid handle",
                    handle.device
                ),
            )?;
        }
        at_most(&format!("body[{index}].handle"), held.len(), MAX_HANDLES)?;
    }
    Ok(())
}

pub(super) fn device_names(devices: &[Device]) -> String {
    let names: Vec<_> = devices
        .iter()
        .map(|device| format!("{:?}", device.name))
        .collect();
    names.join(", ")
}

/// The driver is one of this program's.
fn check_driver(at: &str, device: &Device) -> Check {
    let known = drivers(Vec::new(), Path::new(""));
    let names = || known.names().collect::<Vec<_>>().join(", ");
    let found = device.connect.driver.as_str();
    // The path of a serial port, or its name under Windows.
    let meant = if found.starts_with("/dev/") {
        format!("; did you mean \"tty:{found}\"?")
    } else if found.starts_with("COM") {
        "; a serial port is a path, such as \"tty:/dev/ttyACM0\"".to_owned()
    } else {
        String::new()
    };
    let allowed = || names() + &meant;
    let at = format!("{at}.connect");
    require(known.driver(found).is_some(), &at, found, allowed())
}

/// A simulated device is in a hand, and needs no firmware. Any other device has neither a hand nor a wire of ours.
fn check_held(at: &str, device: &Device) -> Check {
    let simulated = device.is_simulated();
    let none = |kind: &str, what: &str| format!("no such field: only a {kind} device has {what}");
    let connection = format!("the connection \"{}\"", device.connect);
    let field = |name: &str| format!("{at}.{name}");
    require(
        (simulated && !device.is_emulated()) || device.wire.is_none(),
        &field("wire"),
        connection.as_str(),
        "no such field: only a device with `connect = \"sim\"` has `wire`",
    )?;
    require(
        !simulated || device.firmware.is_none(),
        &field("firmware"),
        connection.as_str(),
        none("real", "a firmware file"),
    )?;
    let Some(hand) = &device.hand else {
        let allowed = "the hand that holds this simulated device (`hand = {}` suffices)";
        return require(!simulated, &field("hand"), "none", allowed);
    };
    let allowed = none("simulated", "a hand");
    require(simulated, &field("hand"), connection, allowed)?;
    check_hand(&field("hand"), hand)
}

fn check_hand(at: &str, hand: &Hand) -> Check {
    check_rows(&format!("{at}.waypoints"), &hand.waypoints)?;
    check_rows(&format!("{at}.turns"), &hand.turns)?;
    for (index, [_, x, y, z]) in hand.turns.iter().enumerate() {
        let angle = x.hypot(*y).hypot(*z);
        require(
            angle <= std::f64::consts::PI,
            &format!("{at}.turns[{index}]"),
            format!("an angle of {angle:.2} rad"),
            "half a turn from the start at most; angles are in rad",
        )?;
    }
    for (index, press) in hand.presses.iter().enumerate() {
        check_times(&format!("{at}.presses[{index}]"), [press.from, press.to])?;
    }
    for (index, trace) in hand.traces.iter().enumerate() {
        let field = format!("{at}.traces[{index}]");
        check_times(&field, [trace.from, trace.to])?;
        for (name, vector) in [("direction", trace.direction), ("heading", trace.heading)] {
            require(
                vector != [0.0; 3],
                &format!("{field}.{name}"),
                format!("{vector:?}"),
                "a vector that is not zero",
            )?;
        }
        require(
            hand.arm().stiffness > 0.0,
            &field,
            "an arm without stiffness",
            "a `stiffness` above 0 of the hand: its spring presses the surface",
        )?;
    }
    check_task(at, hand)?;
    hand.recording
        .iter()
        .try_for_each(|file| file_name(&format!("{at}.recording"), file))
}

/// The end is after the start.
fn check_times(at: &str, [from, to]: [f64; 2]) -> Check {
    let allowed = format!("a time after {from:?}");
    require(to > from, &format!("{at}.to"), format!("{to:?}"), allowed)
}

/// Checks the times of rows, and that the first row is the start.
fn check_rows(at: &str, rows: &[[f64; 4]]) -> Check {
    let mut last = None;
    for (index, row) in rows.iter().enumerate() {
        let (field, time) = (format!("{at}[{index}]"), row[0]);
        let found = format!("time {time:?}");
        match last {
            None => {
                require(time >= 0.0, &field, found, "a time not below 0")?;
                require(
                    row[1..] == [0.0; 3],
                    &field,
                    format!("{row:?}, where the path begins"),
                    "zeros after the time of the first row, because the rows are relative to where the hand starts: \
                     begin with the row [0, 0, 0, 0], and let this row come later",
                )?;
            }
            Some(last) => require(time > last, &field, found, format!("a time after {last:?}"))?,
        }
        last = Some(time);
    }
    Ok(())
}

/// Checks that a task has a direction, and that the hand has no field that its task does not use.
fn check_task(at: &str, hand: &Hand) -> Check {
    let kind = hand.task.map(TaskName::kind);
    let has_speed = kind.is_none_or(TaskKind::has_speed);
    let has_width = kind.is_none_or(TaskKind::has_width);
    let has_frequency = kind.is_none_or(TaskKind::has_frequency);
    let number = |x: Option<f64>| x.map(|x| format!("{x:?}"));
    for (name, given, used) in [
        ("direction", hand.direction.map(|d| format!("{d:?}")), true),
        ("depth", number(hand.depth), true),
        ("speed", number(hand.speed), has_speed),
        ("pause", number(hand.pause), has_speed),
        ("width", number(hand.width), has_width),
        ("frequency", number(hand.frequency), has_frequency),
        ("variation", number(hand.variation), true),
    ] {
        let Some(found) = given else { continue };
        let allowed = match kind {
            None => "no such field without a `task`".to_owned(),
            Some(kind) => format!("no such field: the task {} has no {name}", kind.name()),
        };
        require(
            used && kind.is_some(),
            &format!("{at}.{name}"),
            found,
            allowed,
        )?;
    }
    require(
        kind.is_none() || hand.direction.is_some(),
        &format!("{at}.task"),
        "a task without a `direction`",
        "a task with a `direction`",
    )
}
