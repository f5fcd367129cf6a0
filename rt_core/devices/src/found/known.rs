//! The USB numbers of the devices that are known by name.

/// The numbers of a device, and its name for people.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Known {
    /// Vendor and product.
    pub numbers: (u16, u16),
    /// Its name.
    pub name: &'static str,
}

/// The Novint Falcon, whose vendor is that of its chip (FTDI).
pub const FALCON: Known = Known {
    numbers: (0x0403, 0xcb48),
    name: "Novint Falcon",
};
/// WoodenHaptics with reports of the short form.
const MBED: Known = Known {
    numbers: (0x1234, 0x0006),
    name: "WoodenHaptics (mbed)",
};
/// WoodenHaptics with reports of the long form.
pub const TEENSY: Known = Known {
    numbers: (0x16c0, 0x0486),
    name: "WoodenHaptics (Teensy)",
};

/// The board of WoodenHaptics with these numbers.
pub fn board(numbers: (u16, u16)) -> Option<Known> {
    [MBED, TEENSY]
        .into_iter()
        .find(|one| one.numbers == numbers)
}
