//! The commands of the golden vectors, made of reports field by field.

use super::{hex, run};
use firmware_proto::report::{
    CapabilitiesReport, Condition, EncodersReport, FirmwareVersion, GeometryReport, HelloReport,
    JointReport, LENGTH, Mode, Model, Quantity, Report, Sends, StateReport, WrenchReport, axes,
    fault, flags, kinematics, status,
};
use firmware_proto::stream::packet;

const SESSION: u32 = 0xCAFE_F00D;

/// The golden vectors: the name of each file and its text.
pub(crate) fn vectors() -> [(&'static str, String); 3] {
    [
        ("reports.txt", run(&reports())),
        ("stream.txt", run(&streams())),
        ("device.txt", run(&device())),
    ]
}

/// A text of commands.
struct Text(String);

impl Text {
    fn new(head: &str) -> Self {
        Self(format!(
            "# {head}\n# Written by `cargo run -p palpate-firmware-proto --example vectors`; see ../tests/transcript/mod.rs.\n"
        ))
    }

    fn note(&mut self, note: &str) {
        self.line("");
        self.line(&format!("# {note}"));
    }

    fn line(&mut self, line: &str) {
        self.0 += line;
        self.0 += "\n";
    }

    fn decode(&mut self, note: &str, bytes: &[u8]) {
        self.note(note);
        self.line(format!("decode {}", hex(bytes)).trim_end());
    }
}

/// A report with some bytes from `place` on replaced, and a matching check sum.
fn changed(report: &Report, place: usize, values: &[u8]) -> [u8; LENGTH] {
    let mut bytes = report.encode();
    bytes[place..place + values.len()].copy_from_slice(values);
    sealed(bytes)
}

/// The check sum, bit by bit: not the code that is tested.
fn sealed(mut bytes: [u8; LENGTH]) -> [u8; LENGTH] {
    let sum = bytes[..62].iter().fold(0xFFFF_u16, |crc, &byte| {
        (0..8).fold(crc ^ u16::from(byte) << 8, |crc, _| {
            if crc & 0x8000 == 0 {
                crc << 1
            } else {
                crc << 1 ^ 0x1021
            }
        })
    });
    bytes[62..].copy_from_slice(&sum.to_le_bytes());
    bytes
}

fn condition() -> Condition {
    Condition {
        time_us: 2_000_000,
        since_us: 1_999_400,
        wrench: 512,
        buttons: 5,
        status: status::CALIBRATED | status::POWERED | status::IN_FORCE,
        mode: Mode::Active,
        refused: 3,
        fault: 0,
    }
}

pub(crate) fn state() -> StateReport {
    StateReport {
        sequence: 4660,
        session: SESSION,
        condition: condition(),
        position: [100_000, -200_000, 1],
        orientation: [23170, 0, 0, 23170],
        velocity: [50_000, 0, -1],
        angular_velocity: [0, -1, 1500],
    }
}

pub(crate) fn encoders() -> EncodersReport {
    EncodersReport {
        sequence: 65535,
        session: SESSION,
        condition: condition(),
        counts: [1, -2, 300_000, 0, 0, 0, 0, 0],
        number: 3,
    }
}

pub(crate) fn capabilities(sends: Sends) -> CapabilitiesReport {
    CapabilitiesReport {
        sequence: 1,
        session: SESSION,
        hello: 0,
        hello_time_us: 1_500_000,
        watchdog_us: 10_000,
        model: Model {
            sensed: axes::TRANSLATIONS,
            actuated: axes::TRANSLATIONS,
            firmware: FirmwareVersion {
                major: 1,
                minor: 2,
                patch: 345,
            },
            max_force: 5_000_000,
            max_moment: 0,
            workspace_radius: 1_000_000,
            position_step_nm: 60_000,
            rate: [500, 2000],
            sends,
            name: *b"WoodenHaptics\0\0\0",
        },
    }
}

pub(crate) fn geometry() -> GeometryReport {
    GeometryReport {
        sequence: 2,
        session: SESSION,
        kinematics: kinematics::WOODEN_HAPTICS,
        number: 6,
        parameters: [
            800_000, 2_050_000, 2_450_000, 2_200_000, 0, 800_000, 0, 0, 0, 0, 0, 0,
        ],
    }
}

/// 2,000 counts a turn, a capstan of 10 mm on a body of 160 or 120 mm: 32,000 or 24,000 counts a turn of the joint.
pub(crate) fn joint(encoder: u8) -> JointReport {
    let scale = match encoder {
        0 => 5_092_958_179,
        1 => -3_819_718_634,
        _ => 3_819_718_634,
    };
    JointReport {
        sequence: 3 + u16::from(encoder),
        session: SESSION,
        encoder,
        quantity: Quantity::Angle,
        scale,
        offset: 0,
    }
}

pub(crate) fn wrench(sequence: u16, answers: u16, force: i32) -> WrenchReport {
    WrenchReport {
        sequence,
        session: SESSION,
        answers,
        force: [force, -2, 3],
        moment: [0; 3],
        flags: flags::ENABLE,
    }
}

pub(crate) fn hello(sequence: u16, session: u32, watchdog_us: u32) -> HelloReport {
    HelloReport {
        sequence,
        session,
        newest: 2,
        watchdog_us,
    }
}

fn reports() -> String {
    let mut text = Text::new("Reports: the fields of valid ones, and why others are refused.");
    let counts = Sends::Counts { encoders: 3 };
    let valid = [
        ("A state", Report::State(state())),
        ("A state after a fault, before any session", {
            let mut state = state();
            state.session = 0;
            state.condition = Condition {
                mode: Mode::Fault,
                fault: fault::EMERGENCY_STOP.get(),
                ..Condition::default()
            };
            Report::State(state)
        }),
        ("The counts of three encoders", Report::Encoders(encoders())),
        (
            "Capabilities of a device that sends counts",
            Report::Capabilities(capabilities(counts)),
        ),
        (
            "Capabilities of a device that sends poses",
            Report::Capabilities(capabilities(Sends::Poses)),
        ),
        ("A geometry", Report::Geometry(geometry())),
        (
            "A joint whose count falls as its angle grows",
            Report::Joint(joint(1)),
        ),
        ("A wrench", Report::Wrench(wrench(512, 4660, 1_500_000))),
        ("The largest numbers", {
            let mut wrench = wrench(65535, 0, i32::MIN);
            wrench.moment = [i32::MAX; 3];
            wrench.flags = flags::KNOWN;
            Report::Wrench(wrench)
        }),
        ("A hello", Report::Hello(hello(0, SESSION, 0))),
        (
            "A hello that asks for a watchdog of 5 ms, from a host that also speaks version 3",
            Report::Hello(HelloReport {
                newest: 3,
                ..hello(7, 1, 5_000)
            }),
        ),
    ];
    for (note, report) in &valid {
        text.decode(note, &report.encode());
    }
    let [state, .., hello] = valid.map(|(_, report)| report);
    let (encoders, caps) = (
        Report::Encoders(encoders()),
        Report::Capabilities(capabilities(counts)),
    );
    let (geometry, joint) = (Report::Geometry(geometry()), Report::Joint(joint(0)));
    let wrench = Report::Wrench(wrench(1, 2, 3));
    let bytes = state.encode();
    text.decode("No bytes", &[]);
    text.decode("A byte too few", &bytes[..63]);
    text.decode("A byte too many", &[&bytes[..], &[0]].concat());
    text.decode("Zeros", &[0; LENGTH]);
    text.decode("Ones", &[0xFF; LENGTH]);
    let mut flipped = bytes;
    flipped[30] ^= 0x10;
    text.decode("A bit flipped in transit", &flipped);
    text.decode("A state of version 1", &changed(&state, 0, &[1]));
    text.decode("A report of version 3", &changed(&state, 0, &[3]));
    let cases: [(&str, &Report, usize, &[u8]); 37] = [
        ("No kind of version 2", &state, 1, &[0x55]),
        (
            "A bit of the status that is not defined",
            &state,
            20,
            &[0x20],
        ),
        ("No mode", &state, 21, &[5]),
        (
            "A fault in another mode than that of a fault",
            &state,
            23,
            &[1],
        ),
        ("No fault in the mode of a fault", &state, 21, &[4]),
        ("An orientation that is too short", &state, 36, &[0, 0]),
        ("An orientation that is too long", &state, 38, &[0, 0x80]),
        ("No encoder", &encoders, 56, &[0]),
        ("Nine encoders", &encoders, 56, &[9]),
        ("A count without its encoder", &encoders, 36, &[1]),
        ("A reserved byte", &encoders, 57, &[1]),
        ("A reserved byte", &encoders, 61, &[255]),
        ("Capabilities of no session", &caps, 4, &[0; 4]),
        ("No axis", &caps, 10, &[0]),
        ("A seventh axis", &caps, 10, &[0x40]),
        ("A seventh axis", &caps, 11, &[0x41]),
        ("A rate of zero", &caps, 32, &[0, 0]),
        ("A greatest rate below the least", &caps, 34, &[0xF3, 0x01]),
        (
            "A watchdog that is too long",
            &caps,
            36,
            &[0xA1, 0x86, 0x01, 0],
        ),
        ("No form of states", &caps, 44, &[3]),
        ("Poses with encoders", &caps, 44, &[1]),
        ("Counts without encoders", &caps, 44, &[2, 0]),
        ("No name", &caps, 46, &[0; 16]),
        ("A letter behind the end of the name", &caps, 61, b"x"),
        ("A name that is not printable", &caps, 47, &[0x1F, 0x7F]),
        ("Thirteen parameters", &geometry, 10, &[13]),
        ("A parameter too many", &geometry, 56, &[1]),
        ("A reserved byte", &geometry, 11, &[1]),
        ("A reserved byte", &geometry, 60, &[1]),
        ("A ninth encoder", &joint, 8, &[8]),
        ("No quantity", &joint, 9, &[2]),
        ("No counts per unit", &joint, 12, &[0; 8]),
        ("A bit of the flags that is not defined", &wrench, 10, &[5]),
        ("A wrench of no session", &wrench, 4, &[0; 4]),
        ("A reserved byte", &wrench, 36, &[1]),
        ("A host that speaks no version 2", &hello, 8, &[1]),
        ("A watchdog that is too short", &hello, 12, &[0xCF, 0x07]),
    ];
    for (note, report, place, values) in cases {
        text.decode(note, &changed(report, place, values));
    }
    // Squared lengths of 1,052,310,130 to 1,095,257,182 are allowed.
    for (note, orientation) in [
        ("An orientation just too short", [32439, 146, 9, 3]),
        ("The shortest orientation", [32439, 146, 9, 4]),
        ("The longest orientation", [32767, 4645, 69, 10]),
        ("An orientation just too long", [32767, 4645, 69, 11]),
    ] {
        let state = StateReport {
            orientation,
            ..self::state()
        };
        text.decode(note, &state.encode());
    }
    text.decode("A reserved byte", &changed(&hello, 9, &[1]));
    text.decode("A reserved byte", &changed(&joint, 24, &[1]));
    text.0
}

fn streams() -> String {
    let mut text = Text::new("Reports in a stream of bytes.");
    let state = state().encode();
    let wrench = wrench(1, 2, 3).encode();
    let of = |report: &[u8; LENGTH]| hex(&packet(report));
    let push = |bytes: &str| format!("push {bytes}");
    text.note("Packets");
    for report in [&state, &wrench, &[0; LENGTH], &[0xFF; LENGTH]] {
        text.line(&format!("packet {}", hex(report)));
    }
    text.note("Two packets, in pieces");
    text.line("stream");
    let two = of(&state) + &of(&wrench);
    for piece in [&two[..2], &two[2..140], &two[140..]] {
        text.line(&push(piece));
    }
    text.note("Garbage, then a zero, then a packet");
    text.line("stream");
    text.line(&push("0102fffe03"));
    text.line(&push("00"));
    text.line(&push(&of(&state)));
    text.note("Garbage without a zero costs the packet behind it, not the next");
    text.line(&push("5a"));
    text.line(&push(&of(&state)));
    text.line(&push(&of(&wrench)));
    text.note("Zeros between packets are nothing");
    text.line(&push("000000"));
    text.line(&push(&of(&wrench)));
    text.note("A packet cut short, and a packet that is too long");
    text.line(&push(&(of(&state)[..100].to_string() + "00")));
    text.line(&push(&("41".to_string() + &"22".repeat(65) + "00")));
    text.line(&push(&of(&wrench)));
    text.note("A distance that reaches beyond the end");
    text.line(&push(&("42".to_string() + &"22".repeat(64) + "00")));
    text.0
}

fn device() -> String {
    let mut text =
        Text::new("The device's side: what it makes of reports, and the force at each time.");
    let model = |sends| hex(&capabilities(sends).encode());
    let measured = hex(&state().encode());
    let report = |now: u32| format!("report {now} 5 1 0 {measured}");
    let receive = |now: u32, report: Report| format!("receive {now} {}", hex(&report.encode()));
    let of = |sequence, answers, force| Report::Wrench(wrench(sequence, answers, force));
    text.note("From the start to a force");
    text.line(&format!("device {}", model(Sends::Poses)));
    for line in [
        report(1000),
        "homed".into(),
        "home".into(),
        report(2000),
        receive(2100, Report::Hello(hello(0, SESSION, 0))),
        receive(2200, of(1, 0, 1_000_000)),
        report(3000),
        report(4000),
        receive(4100, of(2, 3, 1_000_000)),
        "homed".into(),
        receive(4200, of(2, 3, 1_000_000)),
        report(4300),
        "actuate 4500".into(),
        report(5000),
        "actuate 5500".into(),
        report(6000),
    ] {
        text.line(&line);
    }
    text.note("Repeated, older, stale, of another session, too large, damaged");
    let mut other = wrench(3, 5, 1);
    other.session = 1;
    let mut damaged = of(3, 5, 1).encode();
    damaged[12] ^= 1;
    for line in [
        receive(6100, of(2, 5, 1)),
        receive(6100, of(1, 5, 1)),
        receive(6100, of(3, 99, 1)),
        receive(6100, Report::Wrench(other)),
        receive(6100, of(3, 5, 5_000_002)),
        receive(6100, of(3, 5, i32::MIN)),
        format!("receive 6100 {}", hex(&damaged)),
        receive(6100, Report::State(state())),
        receive(6100, Report::Hello(hello(9, 1, 0))),
        "receive 6100 0102".into(),
        format!("receive 6100 {}", hex(&changed(&of(3, 5, 1), 0, &[1]))),
        format!("receive 6100 {}", hex(&changed(&of(3, 5, 1), 10, &[9]))),
        "actuate 6200".into(),
        "counters".into(),
    ] {
        text.line(&line);
    }
    text.note("The watchdog");
    for line in [
        "actuate 14199".into(),
        "actuate 14200".into(),
        report(14_300),
        receive(14_400, of(4, 4, 7)),
        receive(14_400, of(4, 7, 7)),
        "actuate 14500".into(),
        report(15_000),
    ] {
        text.line(&line);
    }
    text.note("Letting go, and another watchdog");
    let mut release = wrench(5, 0, 0);
    release.flags = 0;
    for line in [
        receive(15_100, Report::Wrench(release)),
        "actuate 15200".into(),
        receive(15_300, Report::Hello(hello(6, SESSION, 2000))),
        report(16_000),
        report(17_000),
        receive(17_100, of(7, 10, 9)),
        "actuate 19099".into(),
        "actuate 19100".into(),
    ] {
        text.line(&line);
    }
    text.note("A fault, and the start from new");
    for line in [
        receive(19_100, of(8, 10, 9)),
        "fault 1".into(),
        "fault 5".into(),
        "actuate 19200".into(),
        report(20_000),
        receive(20_100, of(9, 11, 9)),
        "home".into(),
        "reset".into(),
        report(21_000),
        receive(21_100, of(10, 12, 9)),
        "home".into(),
        "homed".into(),
        "counters".into(),
    ] {
        text.line(&line);
    }
    text.note("The oldest state that a wrench may answer, and the longest step of its number");
    text.line(&format!("device {}", model(Sends::Poses)));
    text.line("home");
    text.line("homed");
    text.line(&receive(0, Report::Hello(hello(0, SESSION, 0))));
    for line in [
        report(0),
        report(100),
        receive(10_101, of(1, 1, 9)),
        receive(10_100, of(1, 1, 9)),
        report(10_200),
        receive(10_300, of(0x8001, 2, 9)),
        receive(10_300, of(0x8000, 2, 9)),
        receive(10_300, of(0xFFFF, 2, 9)),
        receive(10_300, of(0x7FFE, 2, 9)),
    ] {
        text.line(&line);
    }
    text.note("A device that sends counts, whose clock wraps");
    let counts = hex(&encoders().encode());
    let joints: Vec<_> = (0..3)
        .map(|encoder| hex(&joint(encoder).encode()))
        .collect();
    text.line(&format!(
        "device {} {} {}",
        model(Sends::Counts { encoders: 3 }),
        hex(&geometry().encode()),
        joints.join(" ")
    ));
    text.line("home");
    text.line("homed");
    text.line(&receive(4_294_960_000, Report::Hello(hello(0, SESSION, 0))));
    for now in 0..6 {
        text.line(&format!(
            "report {} 0 0 1 {counts}",
            4_294_961_000_u32 + now * 1000
        ));
    }
    for line in [
        receive(4_294_966_500, of(1, 5, 4)),
        "actuate 4294967000".into(),
        format!("report 200 0 0 0 {counts}"),
        "actuate 9203".into(),
        "actuate 9204".into(),
    ] {
        text.line(&line);
    }
    text.0
}
