//! The USB numbers of the devices that are known by name.

/// The numbers of a device, and its name for people.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Known {
    /// Vendor and product.
    pub(crate) numbers: (u16, u16),
    pub(crate) name: &'static str,
}

/// The Novint Falcon, whose vendor is that of its chip (FTDI).
pub(crate) const FALCON: Known = Known {
    numbers: (0x0403, 0xcb48),
    name: "Novint Falcon",
};
/// WoodenHaptics with reports of the short form.
const MBED: Known = Known {
    numbers: (0x1234, 0x0006),
    name: "WoodenHaptics (mbed)",
};
/// WoodenHaptics with reports of the long form.
pub(crate) const TEENSY: Known = Known {
    numbers: (0x16c0, 0x0486),
    name: "WoodenHaptics (Teensy)",
};

/// The board of WoodenHaptics with these numbers.
pub(crate) fn board(numbers: (u16, u16)) -> Option<Known> {
    [MBED, TEENSY]
        .into_iter()
        .find(|one| one.numbers == numbers)
}
