//! Opens the devices of a scene, each with the driver that it names.
use crate::scene::drivers::drivers;
use crate::scene::{LoadedScene, SceneError};
use crate::world::{World, build_hand};
use devices::registry::Notes;
use devices::replay::fed;
use devices::{AnyDevice, Kind, OpenError, Registry, Request};
use rt_core::Reading;
use rt_core::{Capabilities, Vec3};
use runner::ThreadPlace;
use runner::schedule::DEVICE_PRIORITY;
use sim::protocol::Protocol;
use sim::{Hand, Held};
use std::sync::mpsc::Sender;

/// Opens a scene's devices for a run with `seed`. Real devices are opened only under the real clock (`real`), and emulated
/// devices only in virtual time. The threads of the devices run as `threads` says. Also returns what the drivers tell, one
/// sentence each.
///
/// # Errors
/// [`SceneError`], naming the file, line and field that cannot be opened.
pub(super) fn open(
    world: &World<'_>,
    seed: u64,
    real: bool,
    threads: &ThreadPlace,
) -> Result<(Vec<AnyDevice>, Vec<String>), SceneError> {
    let loaded = world.loaded;
    let registry = registry(world, seed)?;
    let mut told = Vec::new();
    let confined = threads.confine();
    told.extend(confined.as_ref().err().map(ToString::to_string));
    let opened = loaded.scene.devices.iter().enumerate();
    let opened = opened.map(|(index, spec)| {
        let driver = registry.driver(&spec.connect.driver);
        let needs_real = driver.is_some_and(|driver| driver.kind() == Kind::Real);
        let allowed = match real {
            false if needs_real => Some(format!(
                "a simulated device, as this command runs in virtual time: `--device {}=sim` simulates the device, and \
                 `palpate run --clock real` uses the real one",
                spec.name
            )),
            // Its protocol is computed within the tick, and allocates there.
            true if spec.is_emulated() => Some(format!(
                "an emulated device needs virtual time (`--clock virtual`); for the real clock, give the connection that \
                 `palpate device emulate` prints, or `--device {}=sim`",
                spec.name
            )),
            _ => None,
        };
        if let Some(allowed) = allowed {
            let field = format!("device[{index}].connect");
            return Err(loaded.source.error(&field, spec.connect.to_string(), allowed));
        }
        accepted(loaded, &registry, index)?;
        let notes = Notes::default();
        let device = open_one(loaded, &registry, index, threads.priority, &notes)?;
        let notes = notes.into_vec().into_iter();
        told.extend(notes.map(|note| format!("device {:?}: {note}", spec.name)));
        Ok(device)
    });
    let opened = opened.collect::<Result<_, _>>()?;
    drop(confined);
    Ok((opened, told))
}

/// Checks the devices of a scene as far as that is possible without real devices: no real device is opened.
///
/// # Errors
/// As [`open`].
pub(super) fn check(world: &World<'_>) -> Result<(), SceneError> {
    let loaded = world.loaded;
    let registry = registry(world, loaded.scene.seed)?;
    for (index, spec) in loaded.scene.devices.iter().enumerate() {
        accepted(loaded, &registry, index)?;
        let driver = registry.driver(&spec.connect.driver);
        if driver.is_none_or(|driver| driver.kind() != Kind::Real) {
            open_one(loaded, &registry, index, DEVICE_PRIORITY, &Notes::default())?;
        }
    }
    Ok(())
}

/// Checks that the driver of a device accepts the profile of the device.
fn accepted(loaded: &LoadedScene, registry: &Registry, index: usize) -> Result<(), SceneError> {
    let spec = &loaded.scene.devices[index];
    match registry.driver(&spec.connect.driver) {
        Some(driver) => {
            let accepted = driver.accepts(&loaded.profiles[index]);
            accepted.map_err(|error| located(loaded, index, error))
        }
        None => Ok(()),
    }
}

/// Opens a device with the driver that it names. The thread of the device takes `priority`. The driver adds its notes to `notes`.
fn open_one(
    loaded: &LoadedScene,
    registry: &Registry,
    index: usize,
    priority: u8,
    notes: &Notes,
) -> Result<AnyDevice, SceneError> {
    let spec = &loaded.scene.devices[index];
    let firmware = spec.firmware.as_ref().map(|file| loaded.beside(file));
    let request = Request {
        address: &spec.connect.address,
        firmware: firmware.as_deref(),
        notes: Some(notes),
        priority,
        ..request(loaded, index)
    };
    let device = registry.open(&spec.connect.driver, &request);
    device.map_err(|error| located(loaded, index, error))
}

/// Recorded devices in place of a scene's devices, whatever their drivers, and the ends that feed them their readings.
/// `limits` are those of the devices as they were driven; a device without an entry has those of its profile.
pub(super) fn replayed(
    loaded: &LoadedScene,
    limits: &[Capabilities],
) -> (Vec<Sender<Reading>>, Vec<AnyDevice>) {
    let models = loaded.models.iter().enumerate();
    let devices = models.map(|(index, model)| {
        let stated = limits.get(index).copied();
        let (feed, device) = fed(stated.unwrap_or_else(|| model.capabilities()));
        (feed, Box::new(device) as AnyDevice)
    });
    devices.unzip()
}

/// The program's drivers, with the hands of a scene's simulated devices.
fn registry(world: &World<'_>, seed: u64) -> Result<Registry, SceneError> {
    let loaded = world.loaded;
    let held = loaded.scene.devices.iter().enumerate();
    let held = held.map(|(index, spec)| {
        let (hand, start) = simulated_hand(world, index, seed)?;
        Ok(Held {
            hand,
            wired: spec.wire.unwrap_or(true),
            protocol: protocol(loaded.profiles[index].protocol.as_deref()),
            start,
        })
    });
    let held = held.collect::<Result<_, SceneError>>()?;
    Ok(drivers(held, &loaded.beside("")))
}

/// The hand that holds the simulated device number `index` of a scene in a run with `seed` (`None` without a hand), and
/// where the device starts (m, device axes).
///
/// # Errors
/// [`SceneError`], naming the file, line and field that no hand can follow.
pub fn simulated_hand(
    world: &World<'_>,
    index: usize,
    seed: u64,
) -> Result<(Option<Hand>, Vec3), SceneError> {
    let start = world.mounts[index].start;
    Ok((build_hand(world.loaded, index, seed)?, start))
}

/// The protocol of the device whose profile names it so. A profile that names none is that of a device with the firmware
/// protocol.
fn protocol(name: Option<&str>) -> Protocol {
    match name {
        Some("woodenhaptics") => Protocol::WoodenHaptics,
        Some("falcon") => Protocol::Falcon,
        _ => Protocol::Reports,
    }
}

fn request(loaded: &LoadedScene, index: usize) -> Request<'_> {
    Request {
        index,
        name: &loaded.profiles[index].name,
        period: 1.0 / loaded.scene.realtime.rate,
        ..Request::new(&loaded.models[index], "")
    }
}

/// A driver's error, with the place in the scene that the error concerns.
fn located(loaded: &LoadedScene, index: usize, error: OpenError) -> SceneError {
    let at = |field: &str| format!("device[{index}]{field}");
    match error {
        OpenError::UnknownDriver { found, known } => {
            loaded.source.error(&at(".connect"), found, known)
        }
        OpenError::Address { found, allowed } => {
            loaded.source.error(&at(".connect"), found, allowed)
        }
        OpenError::Profile { found, protocol } => {
            let allowed = format!("a device file with `protocol = \"{protocol}\"`");
            loaded.source.error(&at(".model"), found, allowed)
        }
        OpenError::Refused { source, .. } => loaded.source.problem(&at(""), source.to_string()),
    }
}
