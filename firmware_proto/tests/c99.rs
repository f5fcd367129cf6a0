//! The implementation in C99 (`c/`) gives the same answers as this crate, both to the golden vectors and to random
//! transcripts. The tests need gcc, or the compiler that the environment variable `CC` names.

mod transcript;

use firmware_proto::device::Device;
use firmware_proto::report::{LENGTH, Report, Sends, WrenchReport};
use firmware_proto::stream::packet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use transcript::{Transcript, golden, hex, run};

/// The program of `c/transcript.c`; `None` if there is no compiler.
fn program() -> Option<&'static Path> {
    static PROGRAM: OnceLock<Option<PathBuf>> = OnceLock::new();
    let built = PROGRAM.get_or_init(|| {
        let compiler = std::env::var("CC").unwrap_or_else(|_| "gcc".into());
        let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("c");
        let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("transcript");
        let status = Command::new(&compiler)
            .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1"])
            .arg("-o")
            .arg(&program)
            .args(["palpate_proto.c", "transcript.c"].map(|name| sources.join(name)))
            .status();
        match status {
            Ok(status) => {
                assert!(status.success(), "{compiler} refuses the sources in firmware_proto/c");
                Some(program)
            }
            Err(error) => {
                let _ = writeln!(
                    std::io::stderr(),
                    "\n!! SKIPPED: the firmware protocol in C99: {compiler}: {error} (apt-get install gcc)"
                );
                None
            }
        }
    });
    built.as_deref()
}

/// The transcript of `text` by the program in C99.
fn run_c99(program: &Path, text: &str) -> String {
    let mut child = Command::new(program)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program was just built");
    let mut input = child.stdin.take().expect("a pipe");
    let output = std::thread::scope(|scope| {
        scope.spawn(move || input.write_all(text.as_bytes()));
        child.wait_with_output().expect("the program ends")
    });
    assert!(output.status.success(), "{}", output.status);
    String::from_utf8(output.stdout).expect("ASCII")
}

fn same(found: &str, expected: &str) {
    let before: Vec<_> = expected.lines().collect();
    for (number, (found, expected)) in found.lines().zip(expected.lines()).enumerate() {
        let above = before[number.saturating_sub(12)..number].join("\n");
        assert_eq!(found, expected, "line {number}, after\n{above}");
    }
    assert_eq!(found.len(), expected.len());
}

#[test]
fn the_golden_vectors_hold_in_c99() {
    let Some(program) = program() else { return };
    for (_, text) in golden::vectors() {
        same(&run_c99(program, &text), &text);
    }
}

/// Numbers at random: SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    fn one_in(&mut self, count: u64) -> bool {
        self.below(count) == 0
    }
}

/// The report with some bytes changed, often with a matching check sum, now and then with another length.
fn damaged(random: &mut Random, report: [u8; LENGTH]) -> Vec<u8> {
    let mut bytes = report.to_vec();
    for _ in 0..=random.below(3) {
        bytes[random.below(62) as usize] = random.next() as u8;
    }
    if !random.one_in(4) {
        let sum = crc::Crc::<u16>::new(&crc::CRC_16_IBM_3740).checksum(&bytes[..62]);
        bytes[62..].copy_from_slice(&sum.to_le_bytes());
    }
    if random.one_in(10) {
        bytes.truncate(random.below(64) as usize);
    }
    bytes
}

/// A random transcript of `lines` commands to one device, with the answers of this crate. The commands follow the
/// device, so that most wrenches are accepted.
fn random_transcript(seed: u64, lines: usize) -> String {
    let random = &mut Random(seed);
    let mut transcript = Transcript::default();
    let mut all = String::new();
    let encoders = random.below(4) as u8;
    let sends = match encoders {
        0 => Sends::Poses,
        encoders => Sends::Counts { encoders },
    };
    let mut parts = vec![
        golden::capabilities(sends).encode(),
        golden::geometry().encode(),
    ];
    parts.extend((0..encoders).map(|encoder| golden::joint(encoder).encode()));
    let parts: Vec<_> = parts.iter().map(|part| hex(part)).collect();
    let first = format!("device {}", parts.join(" "));
    let measured = match sends {
        Sends::Poses => golden::state().encode(),
        Sends::Counts { .. } => golden::encoders().encode(),
    };
    let mut now = random.next() as u32;
    let (mut sequence, mut newest) = (random.next() as u16, 0_u16);
    let mut line = first;
    for _ in 0..lines {
        let answers = transcript.answer(&line);
        all += &line;
        all += "\n";
        for answer in &answers {
            all += "  ";
            all += answer;
            all += "\n";
        }
        if line.starts_with("report") {
            newest = u16::from_str_radix(&answers[0][6..8], 16).expect("hexadecimal") << 8
                | u16::from_str_radix(&answers[0][4..6], 16).expect("hexadecimal");
        }
        let longest = if random.one_in(30) { 20_000 } else { 800 };
        now = now.wrapping_add(random.below(longest) as u32);
        let session = transcript.device.as_ref().map_or(0, Device::session);
        line = match random.below(100) {
            0 => "home".into(),
            1..5 => "homed".into(),
            5 => format!("fault {}", 1 + random.below(255)),
            6..8 => "reset".into(),
            8..12 => {
                let session = if random.one_in(3) {
                    1 + random.below(3) as u32
                } else {
                    session.max(1)
                };
                let watchdog = [0, 2_000, 5_000, 100_000][random.below(4) as usize];
                let mut bytes = golden::hello(random.next() as u16, session, watchdog)
                    .encode()
                    .to_vec();
                if random.one_in(8) {
                    let report = golden::hello(0, session, 0).encode();
                    bytes = damaged(random, report);
                }
                format!("receive {now} {}", hex(&bytes))
            }
            12..45 => {
                let step = if random.one_in(8) {
                    random.next() as u16
                } else {
                    1
                };
                let back = if random.one_in(8) {
                    random.below(40)
                } else {
                    random.below(3)
                } as u16;
                let force = match random.below(10) {
                    0 => random.next() as i32,
                    1 => 5_000_000 + random.below(3) as i32,
                    _ => random.below(8_000_000) as i32 - 4_000_000,
                };
                let report = WrenchReport {
                    session: if random.one_in(12) {
                        random.next() as u32
                    } else {
                        session.max(1)
                    },
                    flags: if random.one_in(12) {
                        random.below(4) as u8
                    } else {
                        1
                    },
                    ..golden::wrench(
                        sequence.wrapping_add(step),
                        newest.wrapping_sub(back),
                        force,
                    )
                };
                if step < 0x8000 && random.one_in(2) {
                    sequence = report.sequence;
                }
                let bytes = if random.one_in(10) {
                    damaged(random, report.encode())
                } else {
                    report.encode().to_vec()
                };
                format!("receive {now} {}", hex(&bytes)).trim_end().into()
            }
            45..70 => format!("actuate {now}"),
            70..96 => {
                let (buttons, powered) = (random.next() as u16, random.below(2));
                format!(
                    "report {now} {buttons} {powered} {} {}",
                    random.below(2),
                    hex(&measured)
                )
            }
            96 => {
                let report = [
                    Report::State(golden::state()),
                    Report::Encoders(golden::encoders()),
                    Report::Capabilities(golden::capabilities(sends)),
                    Report::Geometry(golden::geometry()),
                    Report::Joint(golden::joint(1)),
                ][random.below(5) as usize];
                let bytes = damaged(random, report.encode());
                format!("decode {}", hex(&bytes)).trim_end().into()
            }
            97 => {
                let mut bytes =
                    packet(&golden::wrench(1, 2, random.next() as i32).encode()).to_vec();
                if random.one_in(2) {
                    let place = random.below(66) as usize;
                    bytes[place] = random.next() as u8;
                }
                format!("push {}", hex(&bytes))
            }
            _ => "counters".into(),
        };
    }
    all
}

#[test]
fn random_transcripts_are_the_same_in_c99() {
    let Some(program) = program() else { return };
    let all: Vec<_> = (0..40).map(|seed| random_transcript(seed, 500)).collect();
    let expected = all.concat();
    // The transcripts must reach every outcome often. A generator that makes only refusals would prove little.
    for answer in [
        "accepted hello",
        "accepted wrench",
        "accepted release",
        "refused busy",
        "refused session",
        "refused mode",
        "refused sequence",
        "refused age",
        "refused limit",
        "refused length",
        "refused check sum",
        "refused version",
        "refused kind",
        "refused sum of the reserved bytes",
    ] {
        let count = expected.matches(&format!("\n  {answer}")).count();
        assert!(count >= 5, "{answer}: {count}");
    }
    // The stream decoder continues over transcripts in both implementations.
    same(&run_c99(program, &expected), &run(&expected));
}
