//! Checks of tools: whether each has a name and a device of its own, and the sizes of its shape.

use super::consistency::{Check, at_most, check_rotation, device_names, file_name, names, require};
use super::contact::check_sizes;
use super::spec::{Scene, Tool};
use rt_core::MAX_DEVICES;

/// Checks the tools of a scene; stops at the first conflict.
pub(super) fn check(scene: &Scene) -> Check {
    at_most("tool", scene.tools.len(), MAX_DEVICES)?;
    names("tool", scene.tools.iter().map(|tool| &tool.name))?;
    for (index, tool) in scene.tools.iter().enumerate() {
        let at = format!("tool[{index}]");
        let bodies = scene.bodies.iter().map(|body| ("body", &body.name));
        // The tools are obstacles for bodies, and follow those of the scene.
        let obstacles = scene.obstacles.iter().map(|one| ("obstacle", &one.name));
        let given = scene.given_obstacles().len();
        let mut others = bodies.chain(obstacles.take(given));
        let same = others.find(|(_, name)| **name == tool.name);
        require(
            same.is_none(),
            &format!("{at}.name"),
            format!("{:?}", tool.name),
            format!(
                "another name than that of a {}",
                same.map_or("", |(kind, _)| kind)
            ),
        )?;
        let field = format!("{at}.device");
        let found = format!("{:?}", tool.device);
        let exists = scene
            .devices
            .iter()
            .any(|device| device.name == tool.device);
        require(exists, &field, found.as_str(), device_names(&scene.devices))?;
        let mut before = scene.tools.iter().take(index);
        let first = before.position(|other| other.device == tool.device);
        require(
            first.is_none(),
            &field,
            found.as_str(),
            format!("another device than that of tool[{}]", first.unwrap_or(0)),
        )?;
        let mut handles = scene.bodies.iter().flat_map(|body| &body.handles);
        require(
            handles.all(|handle| handle.device != tool.device),
            &field,
            found,
            "a device that holds no handle",
        )?;
        let devices = || scene.devices.iter().filter(|one| one.name == tool.device);
        let stops = |button: &usize| devices().any(|one| one.engage.stop_button == Some(*button));
        if let Some(button) = tool.take_button.filter(stops) {
            require(
                false,
                &format!("{at}.take_button"),
                button.to_string(),
                "another button than the one that stops all devices",
            )?;
        }
        check_shape(&at, tool)?;
    }
    Ok(())
}

fn check_shape(at: &str, tool: &Tool) -> Check {
    let mesh = tool.mesh.as_ref().map(|mesh| format!("{:?}", mesh.file));
    let given = [
        ("length", tool.length.map(|length| format!("{length:?}"))),
        ("width", tool.width.map(|width| format!("{width:?}"))),
        ("size", tool.size.map(|size| format!("{size:?}"))),
        ("mesh", mesh),
    ];
    let has = tool.shape.sizes();
    check_sizes(at, tool.shape.name(), given.into_iter().zip(has))?;
    let thickest = tool
        .sides()
        .into_iter()
        .flatten()
        .fold(f64::INFINITY, f64::min);
    require(
        tool.radius <= 0.5 * thickest,
        &format!("{at}.radius"),
        format!("{:?}", tool.radius),
        format!(
            "half the shortest side of the {} at most",
            tool.shape.name()
        ),
    )?;
    check_rotation(&format!("{at}.rotation"), tool.rotation)?;
    match &tool.mesh {
        Some(mesh) => file_name(&format!("{at}.mesh.file"), &mesh.file),
        None => Ok(()),
    }
}
