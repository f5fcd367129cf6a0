//! The devices of a study: the built-in ones, or a user's own.

use host::scene::{NamedDevice, SceneError};
use sim::DeviceModel;

/// A device of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyDevice {
    /// Its name in the tables: of a built-in device, or as its file states it.
    pub name: String,
    /// Its numbers.
    pub model: DeviceModel,
}

impl StudyDevice {
    /// The built-in devices that move along all three axes.
    pub fn built_in() -> Vec<Self> {
        let spatial = DeviceModel::spatial();
        spatial
            .map(|(name, model)| Self {
                name: name.to_owned(),
                model,
            })
            .collect()
    }

    /// The devices that a user chose. No two of them may have the same name.
    ///
    /// # Errors
    /// [`SceneError::Value`] with file and line of a name that is taken.
    pub fn chosen(devices: &[NamedDevice]) -> Result<Vec<Self>, SceneError> {
        for (index, device) in devices.iter().enumerate() {
            let mut others = devices[..index].iter();
            if let Some(other) = others.find(|other| other.name == device.name) {
                let allowed = format!(
                    "a name that {} does not have: the tables name devices by it",
                    other.source.name
                );
                let found = format!("{:?}", device.name);
                return Err(device.source.error("name", found, allowed));
            }
        }
        let each = devices.iter().map(|device| Self {
            name: device.name.clone(),
            model: device.model,
        });
        Ok(each.collect())
    }

    /// All numbers on which a result can depend, for the header of a file of results.
    pub(super) fn numbers(&self) -> Vec<f64> {
        let m = &self.model;
        let mut numbers = vec![
            f64::from(m.rate_hz),
            m.mass,
            m.damping,
            m.friction,
            m.position_step,
            m.max_force,
        ];
        if let Some(axes) = m.axes {
            numbers.extend(axes.free().map(|free| f64::from(u8::from(free))));
        }
        if let Some(turning) = &m.rotation {
            numbers.extend([
                turning.inertia,
                turning.damping,
                turning.friction,
                turning.step,
                turning.max_moment,
            ]);
        }
        numbers
    }
}

/// The devices by name, with their numbers, for the header of a file of results.
pub(super) fn settings(devices: &[StudyDevice]) -> serde_json::Value {
    let each = devices
        .iter()
        .map(|device| (device.name.clone(), device.numbers().into()));
    serde_json::Value::Object(each.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::Axes;

    /// Results of two devices must not mix if one number differs on which a result can depend.
    #[test]
    fn devices_along_different_axes_have_different_numbers() {
        let [x, y] = [[true, false, false], [false, true, false]].map(Axes::new);
        let numbers = [None, x, y].map(|axes| {
            let mut device = StudyDevice::built_in().remove(0);
            device.model.axes = axes;
            device.numbers()
        });
        for (index, one) in numbers.iter().enumerate() {
            assert!(!numbers[..index].contains(one), "{one:?}");
        }
    }
}
