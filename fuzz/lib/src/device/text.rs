//! Texts: connections in a scene, what the kernel tells of a device, and profiles.

use devices::DeviceFile;
use devices::found::Which;
use devices::found::listed::{HidFacts, Listed};
use devices::found::which::Alike;
use devices::hid::HidSelector;
use devices::identify::{AxisIdentified, Estimate, Identified};
use devices::registry::Connection;
use devices::serial::connect::{is_port, line};
use devices::woodenhaptics::connect::Address;
use std::sync::OnceLock;

/// Reads the connection of a device in a scene, by every driver. Returns the number of drivers that accept the address.
/// No device is opened.
///
/// # Panics
/// If a connection does not come back from its own text.
pub fn connection(text: &str) -> usize {
    let connection = Connection::parse(text);
    // A text that ends with its first colon has an empty address, and the colon is gone.
    let again = Connection::parse(&connection.to_string());
    assert_eq!(again, connection);
    let mut accepted = 0;
    for address in [text, &connection.address] {
        if let Some(selector) = HidSelector::parse(address) {
            accepted += 1;
            let shown = selector.to_string();
            match selector {
                HidSelector::Path(path) => assert_eq!(path, address),
                HidSelector::Numbers { vid, pid, which } => {
                    let numbers = format!("{vid:04x}:{pid:04x}");
                    assert!(
                        shown.starts_with(&numbers) && !shown.contains('\n'),
                        "{shown}"
                    );
                    let again = HidSelector::parse(&which.connection(&numbers));
                    assert_eq!(again, Some(HidSelector::Numbers { vid, pid, which }));
                }
            }
        }
        if let Some((path, baud)) = line(address) {
            accepted += 1;
            assert!(path.starts_with('/') && path.len() > 1 && baud > 0);
        }
        accepted += usize::from(is_port(address));
        accepted += usize::from(Address::parse(address).is_some());
    }
    accepted
}

/// Reads what the kernel tells of a HID device. Returns one if the text names a device.
///
/// # Panics
/// If a text that a person is shown has a control character, or a device that is found cannot be named in a scene.
pub fn sysfs(text: &str) -> usize {
    let Some(facts) = HidFacts::parse(text) else {
        return 0;
    };
    for text in [&facts.name, &facts.serial] {
        assert!(!text.chars().any(char::is_control), "{text:?}");
    }
    let (vid, pid) = facts.numbers;
    let one = Listed {
        numbers: facts.numbers,
        serial: facts.serial,
        port: "1-1".to_owned(),
        ..Listed::default()
    };
    let kind = format!("hid:{vid:04x}:{pid:04x}");
    // Alone, and beside a second device that states the same.
    for count in [1, 2] {
        let mut devices = vec![one.clone(); count];
        for other in devices.iter_mut().skip(1) {
            other.port = String::from("1-2");
        }
        let alike = Alike {
            kind: &kind,
            by_path: Some("hid"),
            devices,
        };
        let connect = alike.connection(&one);
        let selector = HidSelector::parse(&Connection::parse(&connect).address);
        let Some(HidSelector::Numbers { which, .. }) = selector else {
            panic!("{connect} names no device");
        };
        let named = alike.devices.iter().filter(|device| which.is(device));
        assert_eq!(named.collect::<Vec<_>>(), [&one], "{connect}");
        assert!(
            count == 1 || which == Which::Port("1-1".to_owned()),
            "{connect}"
        );
    }
    1
}

/// The profile in which a text that is no profile is the date.
static BUILT_IN: OnceLock<Option<DeviceFile>> = OnceLock::new();

/// Reads the profile of a device, and writes identified numbers into it, with the text as their date. A text that is no
/// profile is the date in that of a built-in device. Returns one if the text is a profile.
///
/// # Panics
/// If the profile with the identified numbers cannot be read again, or has lost its name.
pub fn profile(text: &str) -> usize {
    let (base, is_profile) = match DeviceFile::parse(text) {
        Ok(base) => (base, 1),
        Err(error) => {
            assert!(!error.to_string().contains('\n'), "an error is one line");
            let built_in = BUILT_IN.get_or_init(|| DeviceFile::named("falcon"));
            let Some(base) = built_in else { return 0 };
            (base.clone(), 0)
        }
    };
    let found = |value: f64| Estimate {
        value,
        low: 0.9 * value,
        high: 1.1 * value,
    };
    let (mass, damping, friction) = (found(0.3), found(1.5), found(0.7));
    let axis = AxisIdentified {
        axis: 1,
        mass,
        damping,
        friction,
        bias: 0.0,
        swings: 9,
        residual: 1e-6,
    };
    let identified = Identified {
        mass,
        damping,
        friction,
        position_step: 1e-5,
        delay_periods: Some(1.25),
        period: 1e-3,
        axes: vec![axis],
    };
    let written = identified.profile(&base, text);
    let again = match DeviceFile::parse(&written) {
        Ok(again) => again,
        Err(error) => panic!("{error} in {written}"),
    };
    let plain: String = base.name.chars().filter(|c| !c.is_control()).collect();
    assert_eq!((again.name, again.model.mass), (plain, 0.3));
    is_profile
}
