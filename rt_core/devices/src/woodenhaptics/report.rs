//! The reports of the device and of the host: seven little-endian integers of 16 bits each way.
//!
//! A device on an mbed board has reports of 14 bytes. A device on a Teensy board has reports of 64 bytes, of which the
//! first 14 are the same.

/// Length of the part with numbers (bytes).
pub const LENGTH: usize = 14;
/// Length of a long report (bytes).
pub const LONG: usize = 64;
/// Number of integers in a report.
const WORDS: usize = 7;

/// The length of a device's reports, both ways.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// 14 bytes (USB 1234:0006).
    #[default]
    Short,
    /// 64 bytes (USB 16c0:0486).
    Long,
}

impl Form {
    /// Length of a report (bytes).
    pub fn length(self) -> usize {
        match self {
            Self::Short => LENGTH,
            Self::Long => LONG,
        }
    }
}

/// The bytes have the wrong length for a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a report of {expected} bytes was expected, {found} came")]
pub struct LengthError {
    /// Number of bytes that came.
    pub found: usize,
    /// Number of bytes of a report of that form.
    pub expected: usize,
}

/// A report of the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EncoderReport {
    /// Counters of the six encoders. The first three are those of the motors a, b, c. They wrap.
    pub encoders: [i16; 6],
    /// [`EncoderReport::CALIBRATE`] once the button for calibration was pressed, until counters are set.
    pub info: i16,
}

/// A report of the host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CurrentReport {
    /// Currents of the motors a, b, c (mA). Under [`CurrentReport::SET_COUNTERS`], the counters d, e, f.
    pub currents: [i16; 3],
    /// [`CurrentReport::CURRENTS`] or [`CurrentReport::SET_COUNTERS`].
    pub command: i16,
    /// Under [`CurrentReport::SET_COUNTERS`], the counters a, b, c.
    pub attributes: [i16; 3],
}

impl EncoderReport {
    /// The flag of the button for calibration.
    pub const CALIBRATE: i16 = 1;
    /// The number that a long report adds to the counter of encoder d while the button of the handle is pressed.
    pub const PRESSED: i16 = 10_000;

    /// The bytes. A report of a form is the first [`Form::length`] of them.
    pub fn encode(&self) -> [u8; LONG] {
        let [a, b, c, d, e, f] = self.encoders;
        bytes([a, b, c, d, e, f, self.info])
    }

    /// Reads a report.
    ///
    /// # Errors
    /// [`LengthError`] if the length is not that of `form`.
    pub fn decode(bytes: &[u8], form: Form) -> Result<Self, LengthError> {
        let [a, b, c, d, e, f, info] = words(bytes, form)?;
        Ok(Self {
            encoders: [a, b, c, d, e, f],
            info,
        })
    }

    /// Counters of the motors a, b, c.
    pub fn motors(&self) -> [i16; 3] {
        let [a, b, c, ..] = self.encoders;
        [a, b, c]
    }

    /// Whether the button of the handle is pressed. A short report has no such button.
    pub fn is_pressed(&self, form: Form) -> bool {
        let [_, _, _, d, ..] = self.encoders;
        form == Form::Long && d > Self::PRESSED / 2
    }
}

impl CurrentReport {
    /// The command to hold the currents.
    pub const CURRENTS: i16 = 0;
    /// The command to set the counters.
    pub const SET_COUNTERS: i16 = 1;

    /// The report that sets the counters a, b, c, and makes the counters d, e, f zero.
    pub fn set_counters(counters: [i16; 3]) -> Self {
        Self {
            currents: [0; 3],
            command: Self::SET_COUNTERS,
            attributes: counters,
        }
    }

    /// The bytes. A report of a form is the first [`Form::length`] of them.
    pub fn encode(&self) -> [u8; LONG] {
        let ([a, b, c], [x, y, z]) = (self.currents, self.attributes);
        bytes([a, b, c, self.command, x, y, z])
    }

    /// Reads a report.
    ///
    /// # Errors
    /// [`LengthError`] if the length is not that of `form`.
    pub fn decode(bytes: &[u8], form: Form) -> Result<Self, LengthError> {
        let [a, b, c, command, x, y, z] = words(bytes, form)?;
        Ok(Self {
            currents: [a, b, c],
            command,
            attributes: [x, y, z],
        })
    }
}

/// The integers as bytes, followed by zeros.
fn bytes(words: [i16; WORDS]) -> [u8; LONG] {
    let mut report = [0; LONG];
    let all = words.into_iter().flat_map(i16::to_le_bytes);
    for (byte, from) in report.iter_mut().zip(all) {
        *byte = from;
    }
    report
}

/// The integers at the start of a report.
fn words(bytes: &[u8], form: Form) -> Result<[i16; WORDS], LengthError> {
    if bytes.len() != form.length() {
        return Err(LengthError {
            found: bytes.len(),
            expected: form.length(),
        });
    }
    let mut words = [0; WORDS];
    let (pairs, _) = bytes.as_chunks();
    for (word, pair) in words.iter_mut().zip(pairs) {
        *word = i16::from_le_bytes(*pair);
    }
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_bytes_are_those_of_the_protocol() {
        let sent = EncoderReport {
            encoders: [1, -1, 0x1234, i16::MIN, i16::MAX, 0],
            info: EncoderReport::CALIBRATE,
        };
        let golden = [
            0x01, 0x00, 0xff, 0xff, 0x34, 0x12, 0x00, 0x80, 0xff, 0x7f, 0, 0, 1, 0,
        ];
        assert_eq!(sent.encode()[..LENGTH], golden);
        assert_eq!(sent.encode()[LENGTH..], [0; LONG - LENGTH]);
        assert_eq!(EncoderReport::decode(&golden, Form::Short), Ok(sent));

        let command = CurrentReport {
            currents: [3000, -3000, 7],
            command: CurrentReport::CURRENTS,
            attributes: [0; 3],
        };
        let golden = [0xb8, 0x0b, 0x48, 0xf4, 7, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        assert_eq!(command.encode()[..LENGTH], golden);
        let set = CurrentReport::set_counters([0, -1313, 2533]);
        let golden = [0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0xdf, 0xfa, 0xe5, 0x09];
        assert_eq!(set.encode()[..LENGTH], golden);
        assert_eq!(CurrentReport::decode(&golden, Form::Short), Ok(set));
    }

    #[test]
    fn only_a_long_report_has_the_button_of_the_handle() {
        let with = |d| EncoderReport {
            encoders: [0, 0, 0, d, 0, 0],
            info: 0,
        };
        assert!(with(5001).is_pressed(Form::Long) && !with(5000).is_pressed(Form::Long));
        assert!(!with(10_000).is_pressed(Form::Short));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_bytes_of_the_right_length_are_a_report(
            bytes in prop::collection::vec(any::<u8>(), 0..100), long in any::<bool>(),
        ) {
            let form = if long { Form::Long } else { Form::Short };
            let right = bytes.len() == form.length();
            match EncoderReport::decode(&bytes, form) {
                Ok(report) => prop_assert_eq!(&report.encode()[..LENGTH], &bytes[..LENGTH]),
                Err(error) => prop_assert_eq!((error.found, right), (bytes.len(), false)),
            }
            match CurrentReport::decode(&bytes, form) {
                Ok(report) => prop_assert_eq!(&report.encode()[..LENGTH], &bytes[..LENGTH]),
                Err(error) => prop_assert_eq!((error.expected, right), (form.length(), false)),
            }
        }

        #[test]
        fn both_forms_carry_the_same_numbers(
            words in prop::array::uniform7(any::<i16>()),
        ) {
            let [a, b, c, d, e, f, g] = words;
            let sent = EncoderReport { encoders: [a, b, c, d, e, f], info: g };
            let command = CurrentReport { currents: [a, b, c], command: d, attributes: [e, f, g] };
            for form in [Form::Short, Form::Long] {
                let bytes = sent.encode();
                prop_assert_eq!(EncoderReport::decode(&bytes[..form.length()], form), Ok(sent));
                let bytes = command.encode();
                prop_assert_eq!(CurrentReport::decode(&bytes[..form.length()], form), Ok(command));
            }
        }
    }
}
