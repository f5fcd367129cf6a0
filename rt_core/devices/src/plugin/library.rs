//! Loads a plug-in and calls its functions. Only this module trusts foreign code, and only the process of the plug-in
//! calls this module.
#![allow(unsafe_code)]

use super::abi::{self, ABI, ENTRY};
use std::ffi::{CStr, CString, c_int};
use std::path::{Path, PathBuf};
use std::ptr::null_mut;

/// Longest message of a plug-in (bytes).
const MESSAGE: usize = 256;

/// The reason why a plug-in or its device could not be opened.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PluginError {
    /// The path or the address contains a zero byte.
    #[error("the name of a plug-in and its address must not contain a zero byte")]
    Zero,
    /// The system could not load the file.
    #[error("the plug-in {path} cannot be loaded: {problem}", path = .path.display())]
    Load {
        /// The file.
        path: PathBuf,
        /// The message of the dynamic linker.
        problem: String,
    },
    /// The file is a library, but no plug-in.
    #[error(
        "{path} is no plug-in for devices: it does not export `palpate_plugin_entry` (see plugin/palpate_device.h)",
        path = .path.display()
    )]
    NoEntry {
        /// The file.
        path: PathBuf,
    },
    /// The plug-in has another version of the interface, or lacks a function.
    #[error(
        "the plug-in {path} has {found}, expected version {ABI} of the interface with all functions; build it again \
         with the plugin/palpate_device.h of this version",
        path = .path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// The version or the lack that was found.
        found: String,
    },
    /// The system gave no process.
    #[error("the system gave no process for the plug-in {path}: {problem}", path = .path.display())]
    Start {
        /// The file.
        path: PathBuf,
        /// The message of the system.
        problem: String,
    },
    /// The process of the plug-in ended.
    #[error(
        "the plug-in {path} ended its process while it was loaded or opened its device ({how}). After SIGBUS or SIGSEGV the \
         file may be damaged or cut off: copy or build the file again",
        path = .path.display()
    )]
    Ended {
        /// The file.
        path: PathBuf,
        /// The end of the process.
        how: String,
    },
    /// The plug-in does not open its device.
    #[error(
        "the plug-in {path} has neither opened its device nor refused within {} s: it hangs. Check the device, its power and \
         the maker's library",
        super::process::OPEN.as_secs(), path = .0.display()
    )]
    Silent(PathBuf),
    /// The message of the process of the plug-in.
    #[error("{0}")]
    Refused(String),
    /// The plug-in could not open its device.
    #[error("the plug-in {path} cannot open the device {address:?}: {message} (error {code})", path = .path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// The address in the scene.
        address: String,
        /// The message of the plug-in.
        message: String,
        /// The result of the plug-in.
        code: i32,
    },
}

/// The functions of a loaded plug-in. The library stays loaded until the process ends: a plug-in may have threads of its
/// own, and vendors' libraries rarely survive being unloaded.
#[derive(Clone, Debug)]
pub(super) struct Library {
    path: PathBuf,
    name: String,
    open: unsafe extern "C" fn(
        *const std::ffi::c_char,
        *mut abi::Device,
        *mut abi::Capabilities,
        *mut std::ffi::c_char,
        usize,
    ) -> c_int,
    exchange: unsafe extern "C" fn(abi::Device, *const abi::Wrench, *mut abi::State) -> c_int,
    close: unsafe extern "C" fn(abi::Device),
}

impl Library {
    /// Loads the plug-in in a file.
    pub(super) fn load(path: &Path) -> Result<Self, PluginError> {
        // The linker searches its own folders for a name without a slash, and not the folder of the scene.
        let mut name = path.to_path_buf();
        if name.components().count() == 1 {
            name = Path::new(".").join(path);
        }
        let text =
            CString::new(name.as_os_str().as_encoded_bytes()).map_err(|_| PluginError::Zero)?;
        // SAFETY: the name ends with a zero byte. The constructors of the library run, which is the wish of the user
        // who named the library in the scene.
        let handle = unsafe { libc::dlopen(text.as_ptr(), libc::RTLD_NOW | libc::RTLD_LOCAL) };
        if handle.is_null() {
            return Err(PluginError::Load {
                path: path.to_owned(),
                problem: linker_problem(),
            });
        }
        // SAFETY: the handle is that of a loaded library, and the name ends with a zero byte.
        let entry = unsafe { libc::dlsym(handle, ENTRY.as_ptr()) };
        if entry.is_null() {
            return Err(PluginError::NoEntry {
                path: path.to_owned(),
            });
        }
        // SAFETY: the header of the interface gives the function of this name this type.
        let entry: unsafe extern "C" fn() -> *const abi::Plugin =
            unsafe { std::mem::transmute(entry) };
        // SAFETY: the function takes nothing.
        let table = unsafe { entry() };
        let refused = |found: String| PluginError::Version {
            path: path.to_owned(),
            found,
        };
        if table.is_null() {
            return Err(refused("no table of functions".into()));
        }
        // SAFETY: every version of the interface begins with its number, which is valid for reads.
        let found = unsafe { (*table).abi };
        if found != ABI {
            return Err(refused(format!("version {found} of the interface")));
        }
        // SAFETY: a plug-in of this version points to a whole table, which lives as long as the library.
        let table = unsafe { *table };
        let (Some(open), Some(exchange), Some(close)) = (table.open, table.exchange, table.close)
        else {
            return Err(refused("a function that is missing".into()));
        };
        let name = if table.name.is_null() {
            String::new()
        } else {
            // SAFETY: the name of a plug-in ends with a zero byte and lives as long as the library.
            unsafe { CStr::from_ptr(table.name) }
                .to_string_lossy()
                .into_owned()
        };
        Ok(Self {
            path: path.to_owned(),
            name,
            open,
            exchange,
            close,
        })
    }

    /// The name that the plug-in gives its device.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// Opens the device with this address.
    pub(super) fn open(&self, address: &str) -> Result<(Opened, abi::Capabilities), PluginError> {
        let text = CString::new(address).map_err(|_| PluginError::Zero)?;
        let mut device: abi::Device = null_mut();
        let mut capabilities = abi::Capabilities::default();
        let mut message = [0_u8; MESSAGE];
        // SAFETY: all pointers are valid for the call, and the length is that of the message.
        let code = unsafe {
            (self.open)(
                text.as_ptr(),
                &raw mut device,
                &raw mut capabilities,
                message.as_mut_ptr().cast(),
                MESSAGE,
            )
        };
        if code != abi::OK {
            let text = CStr::from_bytes_until_nul(&message).map(CStr::to_string_lossy);
            return Err(PluginError::Open {
                path: self.path.clone(),
                address: address.to_owned(),
                message: text.unwrap_or_default().replace(char::is_control, " "),
                code,
            });
        }
        let library = self.clone();
        Ok((Opened { library, device }, capabilities))
    }
}

/// An open device of a plug-in. Dropping it closes the device.
#[derive(Debug)]
pub(super) struct Opened {
    library: Library,
    device: abi::Device,
}

impl Opened {
    /// Commands a wrench. Returns the result of the plug-in and the state that it filled in.
    pub(super) fn exchange(&mut self, wrench: &abi::Wrench) -> (c_int, abi::State) {
        let mut state = abi::State::default();
        // SAFETY: the device is open, and both structures are valid for the call.
        let code = unsafe { (self.library.exchange)(self.device, wrench, &raw mut state) };
        (code, state)
    }
}

impl Drop for Opened {
    fn drop(&mut self) {
        // SAFETY: the device is open, and nothing uses it afterwards.
        unsafe { (self.library.close)(self.device) };
    }
}

/// The dynamic linker's last message.
fn linker_problem() -> String {
    // SAFETY: the call takes nothing, and its result is null or a text that is valid until the next call of the linker
    // by this thread.
    let text = unsafe { libc::dlerror() };
    if text.is_null() {
        return "the system gives no reason".into();
    }
    // SAFETY: as above; the text ends with a zero byte.
    unsafe { CStr::from_ptr(text) }
        .to_string_lossy()
        .into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The linker searches its own folders, in which it would find another file of this name.
    #[test]
    fn a_name_without_a_folder_is_that_of_a_file_here() {
        for (name, sought) in [("none.so", "./none.so"), ("a/none.so", "a/none.so")] {
            match Library::load(Path::new(name)) {
                Err(PluginError::Load { problem, .. }) => {
                    assert!(problem.starts_with(&format!("{sought}: ")), "{problem}");
                }
                other => panic!("{other:?}"),
            }
        }
    }
}
