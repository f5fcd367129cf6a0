//! A USB gadget, which is a folder of configfs: its numbers, its texts, one configuration with one function.
//!
//! The kernel makes the attributes of each folder. A gadget appears at its host when a program writes the name of a USB
//! device controller to the attribute `UDC`, and disappears when a program writes an empty line. The folders are
//! removed in the opposite order. The kernel removes the attributes with them.
//!
//! A program that was killed leaves its gadget behind. The next gadget removes it: the name of a gadget contains the
//! number of its process.
//!
//! Source: the kernel's documentation, *Linux USB gadget configured through configfs*.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// The kernel's folder of gadgets.
const GADGETS: &str = "/sys/kernel/config/usb_gadget";
/// The kernel's folder of device controllers.
const CONTROLLERS: &str = "/sys/class/udc";
/// Start of the names of our gadgets.
const NAME: &str = "palpate-";
/// The folder of texts in English.
const ENGLISH: &str = "strings/0x409";
/// The one configuration.
const CONFIGURATION: &str = "configs/c.1";
/// Longest text (bytes): the kernel refuses a longer one.
const TEXT: usize = 126;
/// The modules, as a user loads them.
const MODULES: &str = "sudo modprobe -a libcomposite usb_f_hid usb_f_fs dummy_hcd";

/// The reason why the kernel made no gadget.
#[derive(Debug, thiserror::Error)]
pub enum GadgetError {
    /// The kernel has no gadgets.
    #[error(
        "the kernel has no USB gadgets: {GADGETS} does not exist. Load its modules (`{MODULES}`), and mount configfs where \
         it is not mounted (`sudo mount -t configfs none /sys/kernel/config`)"
    )]
    NoGadgets,
    /// The account may not make a gadget.
    #[error(
        "this account may not make a USB gadget ({path}: {source}): only root may. Run the command with sudo; a container \
         needs the right to write to {GADGETS}",
        path = path.display()
    )]
    Permission {
        /// The file or folder.
        path: PathBuf,
        /// The error of the system.
        source: io::Error,
    },
    /// The kernel has no such function.
    #[error(
        "the kernel has no function {:?} for USB gadgets: {source}. Load its module (`sudo modprobe {}`)",
        function.name(), function.module()
    )]
    NoFunction {
        /// The function.
        function: Function,
        /// The error of the system.
        source: io::Error,
    },
    /// No device controller is free.
    #[error(
        "no USB device controller is free ({found}). Load the emulated controller of the kernel (`sudo modprobe \
         dummy_hcd`; for two devices at a time: `sudo modprobe dummy_hcd num=2`)"
    )]
    NoController {
        /// The controllers that were found.
        found: String,
    },
    /// The controller is there and does not take the gadget.
    #[error("the USB device controller {controller} does not take the gadget: {source}")]
    Refused {
        /// The controller.
        controller: String,
        /// The error of the system.
        source: io::Error,
    },
    /// The file of the function did not appear.
    #[error(
        "the kernel made the gadget, and its file {path} did not appear: {source}. In a container, pass /dev of the host on",
        path = path.display()
    )]
    NoFile {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: io::Error,
    },
    /// Another error of the system.
    #[error("{action} {path} failed: {source}", path = path.display())]
    System {
        /// The attempted action.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The error of the system.
        source: io::Error,
    },
}

impl GadgetError {
    /// The error of an action on a path.
    pub(crate) fn of(action: &'static str, path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
                Self::Permission { path, source }
            }
            _ => Self::System {
                action,
                path,
                source,
            },
        }
    }
}

/// The functions of the kernel for gadgets that this module uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// A HID device, whose reports pass through a file.
    Hid,
    /// FunctionFS: a program is the function.
    Program,
}

impl Function {
    /// Name of the function in configfs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hid => "hid",
            Self::Program => "ffs",
        }
    }

    /// Name of the kernel's module with the function.
    pub fn module(self) -> &'static str {
        match self {
            Self::Hid => "usb_f_hid",
            Self::Program => "usb_f_fs",
        }
    }
}

/// The numbers and texts that a USB device states.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Numbers {
    /// Vendor.
    pub vid: u16,
    /// Product.
    pub pid: u16,
    /// Release of the device, in decimal digits of four bits.
    pub release: u16,
    /// Name of the manufacturer, cut to 126 bytes.
    pub manufacturer: String,
    /// Name of the product, cut to 126 bytes.
    pub product: String,
    /// Serial number, cut to 126 bytes.
    pub serial: String,
    /// Whether the device is one of full speed, as a device of USB 1.1 is. A kernel before 5.10 ignores this setting.
    pub full_speed: bool,
}

/// One folder, file or link of a gadget, relative to its own folder.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Entry {
    Folder(String),
    /// A text or bytes in an attribute.
    Attribute(String, Vec<u8>),
    /// An attribute that older kernels have not.
    Newer(&'static str, &'static str),
}

/// The entries of a gadget in their order, with its function in the folder `functions/FUNCTION`.
fn entries(numbers: &Numbers, function: &str, attributes: &[(&str, Vec<u8>)]) -> Vec<Entry> {
    let number = |name: &str, value: u16| {
        Entry::Attribute(name.to_owned(), format!("{value:#06x}\n").into_bytes())
    };
    let text = |name: &str, text: &str| {
        Entry::Attribute(format!("{ENGLISH}/{name}"), cut(text).as_bytes().to_vec())
    };
    let mut entries = vec![
        number("idVendor", numbers.vid),
        number("idProduct", numbers.pid),
        number("bcdDevice", numbers.release),
        Entry::Folder(ENGLISH.to_owned()),
        text("manufacturer", &numbers.manufacturer),
        text("product", &numbers.product),
        text("serialnumber", &numbers.serial),
        Entry::Folder(CONFIGURATION.to_owned()),
        Entry::Folder(format!("functions/{function}")),
    ];
    if numbers.full_speed {
        entries.insert(3, Entry::Newer("max_speed", "full-speed\n"));
    }
    entries.extend(attributes.iter().map(|(name, bytes)| {
        Entry::Attribute(format!("functions/{function}/{name}"), bytes.clone())
    }));
    entries
}

/// A text that the kernel takes: no longer than [`TEXT`], in whole characters, on one line.
fn cut(text: &str) -> &str {
    let line = text.split(['\n', '\0']).next().unwrap_or_default();
    let mut end = line.len().min(TEXT);
    while !line.is_char_boundary(end) {
        end -= 1;
    }
    line.get(..end).unwrap_or_default()
}

/// A gadget, which lives as long as this value.
#[derive(Debug)]
pub struct Gadget {
    folder: PathBuf,
    name: String,
    function: String,
}

impl Gadget {
    /// Makes a gadget with one function, whose attributes are `attributes`. It appears at its host with
    /// [`bind`](Self::bind).
    ///
    /// # Errors
    /// [`GadgetError`], which names what is missing and the remedy.
    pub fn new(
        numbers: &Numbers,
        function: Function,
        attributes: &[(&str, Vec<u8>)],
    ) -> Result<Self, GadgetError> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let gadgets = Path::new(GADGETS);
        if !gadgets.is_dir() {
            return Err(GadgetError::NoGadgets);
        }
        remove_orphans(gadgets, Path::new("/proc"));
        let name = format!(
            "{NAME}{}-{}",
            std::process::id(),
            NUMBER.fetch_add(1, Ordering::Relaxed)
        );
        let new = Self {
            folder: gadgets.join(&name),
            function: format!("{}.{name}", function.name()),
            name,
        };
        fs::create_dir(&new.folder)
            .map_err(|source| GadgetError::of("making", &new.folder, source))?;
        // From here on, an error removes the folders again.
        let functions = new.folder.join("functions").join(&new.function);
        for entry in entries(numbers, &new.function, attributes) {
            match entry {
                Entry::Folder(folder) => {
                    let path = new.folder.join(folder);
                    fs::create_dir(&path).map_err(|source| match source.kind() {
                        ErrorKind::NotFound if path == functions => {
                            GadgetError::NoFunction { function, source }
                        }
                        _ => GadgetError::of("making", &path, source),
                    })?;
                }
                Entry::Attribute(file, bytes) => {
                    let path = new.folder.join(file);
                    fs::write(&path, bytes)
                        .map_err(|source| GadgetError::of("writing", &path, source))?;
                }
                Entry::Newer(file, text) => {
                    let _ = fs::write(new.folder.join(file), text);
                }
            }
        }
        Ok(new)
    }

    /// Name of the gadget, which is also that of its function.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The text of an attribute of the function, without its end of line.
    ///
    /// # Errors
    /// [`GadgetError::System`].
    pub fn attribute(&self, name: &str) -> Result<String, GadgetError> {
        let path = self.functions().join(name);
        let text = fs::read_to_string(&path);
        let text = text.map_err(|source| GadgetError::of("reading", &path, source))?;
        Ok(text.trim().to_owned())
    }

    /// Puts the function into the configuration, and binds the gadget to the first device controller that is free.
    ///
    /// # Errors
    /// [`GadgetError`], which names what is missing and the remedy.
    pub fn bind(&self) -> Result<(), GadgetError> {
        let link = self.link();
        std::os::unix::fs::symlink(self.functions(), &link)
            .map_err(|source| GadgetError::of("linking", &link, source))?;
        let mut controllers: Vec<_> = fs::read_dir(CONTROLLERS)
            .into_iter()
            .flatten()
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .collect();
        controllers.sort_unstable();
        let attribute = self.folder.join("UDC");
        for controller in &controllers {
            match fs::write(&attribute, format!("{controller}\n")) {
                Ok(()) => return Ok(()),
                Err(source) if source.kind() == ErrorKind::ResourceBusy => {}
                Err(source) => {
                    let controller = controller.clone();
                    return Err(GadgetError::Refused { controller, source });
                }
            }
        }
        let found = if controllers.is_empty() {
            "the kernel has none".to_owned()
        } else {
            format!("in use: {}", controllers.join(", "))
        };
        Err(GadgetError::NoController { found })
    }

    /// Takes the gadget from its host: all transfers of its function end.
    pub fn unbind(&self) {
        // The kernel refuses a gadget that is not bound.
        let _ = fs::write(self.folder.join("UDC"), "\n");
    }

    fn functions(&self) -> PathBuf {
        self.folder.join("functions").join(&self.function)
    }

    fn link(&self) -> PathBuf {
        self.folder.join(CONFIGURATION).join(&self.function)
    }
}

impl Drop for Gadget {
    fn drop(&mut self) {
        remove(&self.folder);
    }
}

/// Removes the gadgets of processes that have ended. `processes` has a folder for each process that lives.
fn remove_orphans(gadgets: &Path, processes: &Path) {
    for name in names(gadgets) {
        let owner = name
            .strip_prefix(NAME)
            .and_then(|rest| rest.split('-').next()?.parse::<u32>().ok());
        if owner.is_some_and(|owner| !processes.join(owner.to_string()).exists()) {
            remove(&gadgets.join(name));
        }
    }
}

/// Removes a gadget, or the parts of it that exist. A part that the kernel keeps stays.
fn remove(gadget: &Path) {
    let _ = fs::write(gadget.join("UDC"), "\n");
    let configuration = gadget.join(CONFIGURATION);
    for name in names(&configuration) {
        // The attributes are files, and folders other than the texts are links.
        let path = configuration.join(name);
        if path.is_symlink() {
            let _ = fs::remove_file(path);
        }
    }
    let _ = fs::remove_dir(&configuration);
    let functions = gadget.join("functions");
    for name in names(&functions) {
        let _ = fs::remove_dir(functions.join(name));
    }
    let _ = fs::remove_dir(gadget.join(ENGLISH));
    let _ = fs::remove_dir(gadget);
}

/// The names in a folder; none if it cannot be read.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers() -> Numbers {
        Numbers {
            vid: 0x1209,
            pid: 0x0001,
            release: 0x0400,
            manufacturer: "palpate".into(),
            product: "x".repeat(125) + "é and more",
            serial: "left\nand no second line".into(),
            full_speed: true,
        }
    }

    #[test]
    fn a_gadget_has_its_parts_in_the_order_of_the_kernel() {
        let entries = entries(&numbers(), "hid.a", &[("report_length", b"64\n".to_vec())]);
        let attribute =
            |name: &str, text: &str| Entry::Attribute(name.into(), text.as_bytes().to_vec());
        let expected = [
            attribute("idVendor", "0x1209\n"),
            attribute("idProduct", "0x0001\n"),
            attribute("bcdDevice", "0x0400\n"),
            Entry::Newer("max_speed", "full-speed\n"),
            Entry::Folder("strings/0x409".into()),
            attribute("strings/0x409/manufacturer", "palpate"),
            // The letter of two bytes would be cut in its middle.
            attribute("strings/0x409/product", &"x".repeat(125)),
            attribute("strings/0x409/serialnumber", "left"),
            Entry::Folder("configs/c.1".into()),
            Entry::Folder("functions/hid.a".into()),
            attribute("functions/hid.a/report_length", "64\n"),
        ];
        assert_eq!(entries, expected);
    }

    #[test]
    fn gadgets_of_processes_that_ended_are_removed_and_no_other() {
        let root = std::env::temp_dir().join(format!("palpate-gadgets-{}", std::process::id()));
        let (gadgets, processes) = (root.join("gadgets"), root.join("processes"));
        for process in ["10", "12"] {
            fs::create_dir_all(processes.join(process)).unwrap();
        }
        let all = [
            "palpate-10-0",
            "palpate-11-0",
            "palpate-11-1",
            "palpate-x",
            "g1",
        ];
        for name in all {
            let folder = gadgets.join(name);
            for part in ["configs/c.1", "functions/hid.a", "strings/0x409"] {
                fs::create_dir_all(folder.join(part)).unwrap();
            }
            let function = folder.join("functions/hid.a");
            std::os::unix::fs::symlink(function, folder.join("configs/c.1/hid.a")).unwrap();
        }
        remove_orphans(&gadgets, &processes);
        for name in all {
            let gone = name.starts_with("palpate-11");
            for part in [
                "configs/c.1/hid.a",
                "configs/c.1",
                "functions/hid.a",
                "strings/0x409",
            ] {
                let path = gadgets.join(name).join(part);
                assert_eq!(path.symlink_metadata().is_err(), gone, "{}", path.display());
            }
        }
        fs::remove_dir_all(&root).unwrap();
    }

    #[test]
    fn errors_say_what_is_missing_and_how_to_get_it() {
        let error = |number| io::Error::from_raw_os_error(number);
        let path = Path::new("/sys/kernel/config/usb_gadget/palpate-1-0");
        // EACCES, EROFS, EINVAL.
        let denied = GadgetError::of("making", path, error(13));
        let read_only = GadgetError::of("making", path, error(30));
        let other = GadgetError::of("writing", path, error(22));
        for (error, parts) in [
            (
                GadgetError::NoGadgets,
                ["modprobe", "libcomposite", "dummy_hcd", "mount -t configfs"],
            ),
            (denied, ["only root", "sudo", "palpate-1-0", "container"]),
            (read_only, ["only root", "sudo", "palpate-1-0", "container"]),
            (
                GadgetError::NoFunction {
                    function: Function::Program,
                    source: error(2),
                },
                ["modprobe", "usb_f_fs", "\"ffs\"", "No such file"],
            ),
            (
                GadgetError::NoController {
                    found: "in use: dummy_udc.0".into(),
                },
                ["dummy_udc.0", "dummy_hcd", "num=2", "free"],
            ),
            (other, ["writing", "palpate-1-0", "failed", "Invalid"]),
        ] {
            let text = error.to_string();
            for part in parts {
                assert!(text.contains(part), "{part} in {text}");
            }
        }
    }
}
