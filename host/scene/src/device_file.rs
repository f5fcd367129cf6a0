//! A device by its name or by its file, outside of a scene: for studies of devices.

use super::error::SceneError;
use super::load::{read, read_device};
use super::plausible::Warning;
use super::source::Source;
use sim::models::FILES;
use sim::{DeviceFile, DeviceModel};
use std::path::{Path, PathBuf};

/// A device with its numbers and with the text that states the numbers.
#[derive(Clone, Debug)]
pub struct NamedDevice {
    /// The name of a built-in device; otherwise the name that the device file states.
    pub name: String,
    /// The numbers of the device.
    pub model: DeviceModel,
    /// The contents of the device file.
    pub file: DeviceFile,
    /// The device file; none for a built-in device.
    pub path: Option<PathBuf>,
    /// The text of the device file, for errors that are found later: see [`Source::error`].
    pub source: Source,
    /// Values of the device file that few devices have.
    pub warnings: Vec<Warning>,
}

impl NamedDevice {
    /// The built-in devices, in the order of their files.
    pub fn built_in() -> impl Iterator<Item = Self> {
        FILES.iter().filter_map(|(name, text)| {
            let file = DeviceFile::named(name)?;
            Some(Self {
                name: (*name).to_owned(),
                model: file.model,
                file,
                path: None,
                source: Source::new(*name, *text),
                warnings: Vec::new(),
            })
        })
    }

    /// The device that `text` names: a built-in device, or a device file.
    ///
    /// # Errors
    /// [`SceneError`] if `text` is neither the name of a built-in device nor the path of a file that can be read; with
    /// line and field if the file is no device file, or states a number that no device has.
    ///
    /// ```
    /// use scene::NamedDevice;
    ///
    /// assert_eq!(NamedDevice::load("touch")?.name, "touch");
    /// let error = NamedDevice::load("tuch").expect_err("there is no such device");
    /// assert!(error.to_string().contains("falcon, touch"));
    /// # Ok::<(), scene::SceneError>(())
    /// ```
    pub fn load(text: &str) -> Result<Self, SceneError> {
        if let Some(found) = Self::built_in().find(|device| device.name == text) {
            return Ok(found);
        }
        let path = Path::new(text);
        let is_file = path.extension().is_some_and(|ending| ending == "toml");
        if !is_file && !path.exists() {
            let known: Vec<_> = FILES.iter().map(|(name, _)| *name).collect();
            return Err(SceneError::NoDevice {
                found: text.to_owned(),
                known: known.join(", "),
            });
        }
        let content = read(path).map_err(|source| SceneError::DeviceFile {
            path: path.to_owned(),
            source,
        })?;
        let (file, source, warnings) = read_device(text.to_owned(), content)?;
        Ok(Self {
            name: file.name.clone(),
            model: file.model,
            file,
            path: Some(path.to_owned()),
            source,
            warnings,
        })
    }
}
