//! The upload of the Falcon's firmware, under a hostile boot loader.

use super::Input;
use devices::falcon::boot::{self, HELLO_BACK, PIECE};
use devices::falcon::packet::{Command, Framer, Report};
use devices::falcon::{Firmware, Tries};
use devices::ftdi::{Control, Ftdi};
use devices::transport::Transport;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Length of the image: two pieces.
const IMAGE: usize = 70;
/// Numbers of tries.
const TRIES: Tries = Tries {
    handshakes: 3,
    uploads: 2,
};
/// Most transfers of a boot under a silent device: the packets before and after the uploads, the handshakes and the
/// pieces, each with its wait, and the requests. Each byte of the input may add one.
const TRANSFERS: usize = 1000;

struct World {
    input: Input,
    now_ns: u64,
    transfers: usize,
    written: Vec<u8>,
    /// What the chip holds for the host.
    waiting: Vec<u8>,
    packets: Framer,
}

#[derive(Clone)]
struct Line(Arc<Mutex<World>>);

impl Line {
    fn world(&self) -> MutexGuard<'_, World> {
        // Another panic is under way already.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl World {
    fn transfer(&mut self) {
        self.transfers += 1;
        self.now_ns += 1000;
    }

    /// What the boot loader answers to the bytes that were last written.
    fn answer(&mut self) -> Result<Vec<u8>, i32> {
        if self.input.is_over() {
            return Ok(Vec::new());
        }
        Ok(match self.input.byte() % 8 {
            0 => {
                let count = usize::from(self.input.byte()) % 70;
                self.input.some(count)
            }
            1 => Vec::new(),
            2 => HELLO_BACK.to_vec(),
            3 => Report::default().encode().to_vec(),
            4 => {
                // One byte is changed.
                let mut echo = std::mem::take(&mut self.written);
                let [place, change] = self.input.array();
                let place = usize::from(place) % echo.len().max(1);
                if let Some(byte) = echo.get_mut(place) {
                    *byte ^= change;
                }
                echo
            }
            5 => {
                // Some bytes are missing.
                let mut echo = std::mem::take(&mut self.written);
                echo.truncate(self.input.byte().into());
                echo
            }
            6 if self.input.byte() < 32 => {
                return Err([5, 19, 32, 110][usize::from(self.input.byte()) % 4]);
            }
            _ => std::mem::take(&mut self.written),
        })
    }
}

impl Transport for Line {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        let mut world = self.world();
        world.transfer();
        if world.waiting.is_empty() {
            world.waiting = world.answer()?;
        }
        let count = world.waiting.len().min(buffer.len());
        for (place, byte) in buffer.iter_mut().zip(world.waiting.drain(..count)) {
            *place = byte;
        }
        if count == 0 {
            world.now_ns += wait.as_nanos() as u64;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        let mut world = self.world();
        world.transfer();
        assert!(bytes.len() <= PIECE, "{} bytes at once", bytes.len());
        world.written = bytes.to_vec();
        for &byte in bytes {
            if let Some(packet) = world.packets.push(byte)
                && let Ok(command) = Command::decode(&packet)
            {
                assert_eq!(command.torques, [0; 3], "a torque before the firmware runs");
            }
        }
        Ok(())
    }
}

impl Ftdi for Line {
    fn control(&mut self, request: Control) -> Result<(), i32> {
        let mut world = self.world();
        world.transfer();
        if matches!(request, Control::Purge(_)) {
            world.waiting.clear();
        }
        Ok(())
    }
}

/// Runs the upload of the Falcon's firmware under a hostile boot loader. Returns the number of uploads, and one more
/// if the device then runs its firmware.
///
/// # Panics
/// If the upload does not end, or commands a torque.
pub fn falcon_boot(bytes: &[u8]) -> usize {
    let image: Vec<u8> = (0..IMAGE as u8).map(|k| k.wrapping_mul(37)).collect();
    let Ok(firmware) = Firmware::new(Path::new("hostile"), image) else {
        panic!("seventy bytes are an image");
    };
    let mut line = Line(Arc::new(Mutex::new(World {
        input: Input::new(bytes),
        now_ns: 0,
        transfers: 0,
        written: Vec::new(),
        waiting: Vec::new(),
        packets: Framer::new(),
    })));
    let clock = line.clone();
    let result = boot::boot(&mut line, &firmware, &TRIES, &mut || clock.world().now_ns);
    let world = line.world();
    // A read of a hostile device may pass a single byte of the seventy that a byte of the input makes.
    let most = TRANSFERS + 70 * bytes.len();
    assert!(world.transfers <= most, "{} transfers", world.transfers);
    match result {
        Ok(uploads) => {
            assert!(uploads <= TRIES.uploads);
            uploads as usize + 1
        }
        Err(error) => {
            assert!(!error.to_string().contains('\n'), "an error is one line");
            assert!(error.uploads <= TRIES.uploads);
            error.uploads as usize
        }
    }
}
