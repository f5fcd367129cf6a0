//! How the commands of the book are run that cannot, or need not, run as they stand. A command that is not listed here runs
//! as it stands; a command that is listed and that no page has is an error.

/// How a command is run.
#[derive(Clone, Copy)]
pub(super) enum Way {
    /// With more arguments, if its length is not its point.
    With(&'static str),
    /// With other words: each text in the line, and what takes its place.
    Changed(&'static [(&'static str, &'static str)]),
    /// It serves others until a signal: it is ended after its first line.
    Served,
    /// As [`Way::Served`], beside a run that can be watched.
    Serving,
    /// Beside a run that can be watched, and until the end of that run.
    Watching,
    /// An emulated device, which serves the commands after it until the end of the page. The text is its port in the book,
    /// and a free port takes its place.
    Emulated(&'static str),
    /// With the connection of an emulated device in the place of a text; the emulator is run with these arguments.
    Against(&'static str, &'static str),
    /// Not at all: its arguments alone are checked. The reason is for the reader.
    Arguments(&'static str),
}

use Way::{Against, Arguments, Changed, Emulated, Served, Serving, Watching, With};

/// What a quick form of a study of many cells is in a test.
const CELLS: &str = "--quick --shard 1/100";

/// One run of each cell of the page's own scene, and on fewer cells of its mesh.
const COARSE: &str = "--runs 1 --schemes capped --set 'body[block].mesh.box.cells=[4, 4, 3]'";

/// The commands, without comments.
pub(super) const WAYS: &[(&str, Way)] = &[
    // Real devices, and emulated ones on the buses of the kernel.
    (
        "palpate device probe hid:1209:c0de --model touch",
        Against("hid:1209:c0de", "touch --on tcp"),
    ),
    (
        "palpate device identify hid:1209:c0de --model touch --date 2026-11-25 --profile mine.toml --nobody-holds-it",
        Arguments(
            "it moves the device for a minute; sim/tests/identify.rs identifies each device in virtual time",
        ),
    ),
    (
        "palpate device emulate woodenhaptics --on tcp:4000 --tremor 0.0005",
        Emulated("4000"),
    ),
    (
        "palpate run --set device[left].model=woodenhaptics --device left=woodenhaptics:tcp:localhost:4000 --clock real --armed",
        With("--duration 1"),
    ),
    (
        "palpate device emulate --scene host/scenes/stretch.toml --name left --on tcp:4001 --protocol firmware",
        Emulated("4001"),
    ),
    (
        "palpate device emulate --scene host/scenes/stretch.toml --name right --on tcp:4002 --protocol firmware",
        Emulated("4002"),
    ),
    (
        "palpate run host/scenes/stretch.toml --device left=tcp:localhost:4001 --device right=tcp:localhost:4002 --clock real --armed",
        With("--duration 1"),
    ),
    (
        "palpate device probe tcp:localhost:4000 --model falcon",
        Against("tcp:localhost:4000", "falcon --on tcp --protocol firmware"),
    ),
    (
        "sudo modprobe -a dummy_hcd libcomposite usb_f_hid usb_f_fs",
        Arguments("it loads modules of the kernel"),
    ),
    (
        "sudo palpate device emulate woodenhaptics --on usb",
        Arguments(
            "it needs root and modules of the kernel; sim/emulator/tests/kernel.rs runs it where they are",
        ),
    ),
    (
        "sudo palpate device emulate falcon --on usb --firmware novint.bin",
        Arguments(
            "it needs root and modules of the kernel; sim/emulator/tests/kernel.rs runs it where they are",
        ),
    ),
    // Viewers.
    ("palpate run --clock real --view", With("--duration 1")),
    ("palpate view", Watching),
    ("palpate view --lines", Watching),
    ("palpate view --web", Serving),
    ("palpate view --foxglove", Serving),
    (
        "palpate view --foxglove --allow-origin https://viewer.example",
        Serving,
    ),
    ("palpate view stretch.mcap", With("--speed 100")),
    ("palpate view stretch.mcap --web", Served),
    ("palpate view run.mcap", With("--speed 100")),
    // Runs whose length is not their point.
    (
        "palpate doctor",
        Arguments("its exit code is that of the machine"),
    ),
    (
        "palpate doctor --script tune.sh",
        Arguments("its exit code is that of the machine"),
    ),
    (
        "palpate latency --duration 300 --plot latency.svg --report latency.md",
        Changed(&[("300", "1")]),
    ),
    (
        "palpate latency --report latency.md",
        With("--duration 1 --load none"),
    ),
    (
        "palpate latency --duration 5 --plot latency.svg --report latency.md --json latency.json",
        Changed(&[("5", "1")]),
    ),
    (
        "palpate run --clock real --log run.mcap",
        With("--duration 1"),
    ),
    // Studies.
    (
        "palpate bench extrapolation --plot extrapolation.svg",
        Arguments("it takes a minute; host/study/tests/studies/extrapolation.rs runs a part"),
    ),
    (
        "palpate bench accuracy --quick",
        Arguments("host/program/tests/command/accuracy.rs runs it"),
    ),
    (
        "palpate bench accuracy --plot accuracy.svg",
        Arguments("host/program/tests/command/accuracy.rs runs it"),
    ),
    (
        "palpate bench contact --part aims --quick",
        Arguments("it takes ten seconds; host/study/tests/studies/contact.rs runs it"),
    ),
    (
        "palpate bench contact --part between",
        Arguments("it takes two minutes; host/study/tests/studies/contact_between.rs runs a part"),
    ),
    (
        "palpate bench contact --part hand --quick",
        Arguments("it takes ten seconds; host/study/tests/studies/contact.rs runs it"),
    ),
    (
        "palpate bench contact --part cost",
        Arguments("it takes ten minutes; host/study/tests/studies/contact.rs runs a part"),
    ),
    (
        "palpate bench velocity",
        Arguments("it takes half a minute; host/study/tests/studies/velocity.rs runs a part"),
    ),
    (
        "palpate bench tearing --part table",
        Arguments("it takes half a minute; host/study/tests/studies/tearing_runs.rs runs a part"),
    ),
    (
        "palpate bench stability --quick",
        Arguments("it takes a minute and more; host/study/tests/studies/stability.rs runs a part"),
    ),
    (
        "palpate bench stability --plot recovery.svg",
        Arguments("it takes a minute and more; host/study/tests/studies/stability.rs runs a part"),
    ),
    (
        "palpate bench speed --plot out",
        Arguments("host/program/tests/speed.rs runs it"),
    ),
    (
        "palpate bench speed --quick",
        Arguments("host/program/tests/speed.rs runs it"),
    ),
    (
        "palpate bench tearing --quick",
        Arguments("it takes minutes; host/study/tests/studies/tearing.rs runs a part"),
    ),
    (
        "palpate bench tearing --part figure --plot force.svg",
        Arguments("it takes half a minute; host/study/tests/studies/tearing_runs.rs runs a part"),
    ),
    (
        "palpate bench tearing --part feel",
        Arguments("it takes half a minute; host/study/tests/studies/tearing_runs.rs runs a part"),
    ),
    (
        "palpate run host/scenes/sheet_on_sphere.toml",
        With("--duration 0.2"),
    ),
    ("palpate run host/scenes/cloth.toml", With("--duration 1")),
    (
        "palpate run ../host/scenes/plate.toml --duration 2.4 --log plate.mcap --log-frames 25",
        With("--set 'body[block].mesh.box.cells=[5, 5, 3]'"),
    ),
    (
        "palpate solve host/scenes/twist.toml --vtu out",
        Arguments("the guide has the command with `--plot`, and that one runs"),
    ),
    (
        "palpate compare my_scene.toml --fault stall@1.5+0.5",
        With("--duration 2.1"),
    ),
    ("palpate stress faults", With(CELLS)),
    ("palpate stress faults my_device.toml", With(CELLS)),
    ("palpate stress connections", With(CELLS)),
    (
        "palpate stress endings",
        Arguments("host/program/tests/ways_out.rs runs it"),
    ),
    ("palpate compare", With("--duration 1")),
    ("palpate compare --plot schemes.svg", With("--duration 1")),
    (
        "palpate compare my_scene.toml --plot schemes.svg",
        With("--duration 1"),
    ),
    (
        "palpate compare my_scene.toml --schemes linear,capped --publish-rates 25,125",
        With("--duration 1"),
    ),
    ("palpate stress wall --plot wall.svg", With(CELLS)),
    (
        "palpate stress wall my_device.toml falcon --plot my_walls.svg",
        With(CELLS),
    ),
    ("palpate stress hold", With(CELLS)),
    ("palpate stress tearing", With(CELLS)),
    ("palpate stress contact", With("--quick --runs 1")),
    ("palpate stress contact --tools", With("--quick --runs 1")),
    ("palpate stress scene", With("--runs 1 --schemes capped")),
    (
        "palpate stress scene my_scene.toml --plot scene.svg",
        With(COARSE),
    ),
    ("palpate stress scene my_scene.toml --rate 90", With(COARSE)),
    (
        "palpate stress scene my_scene.toml --trouble stalls",
        With(COARSE),
    ),
    (
        "palpate stress scene my_scene.toml --rate 60,90 --trouble nothing,all --runs 40",
        Changed(&[("--runs 40", COARSE)]),
    ),
    (
        "palpate stress scene host/scenes/press.toml",
        With("--runs 1 --schemes capped"),
    ),
    (
        "palpate stress scene sheet.toml --runs 84 --json sheet.jsonl",
        Changed(&[("--runs 84", "--runs 1 --schemes capped")]),
    ),
    (
        "palpate stress scene sheet.toml --runs 420 --json sheet.jsonl",
        Changed(&[("--runs 420", "--runs 2 --schemes capped")]),
    ),
    (
        "palpate stress scene sheet.toml --runs 84 --seed $seed --json seed-$seed.jsonl",
        Arguments("the shell's loop around it is no line of its own"),
    ),
    (
        "for seed in 1 2 3; do",
        Arguments("the beginning of a loop"),
    ),
    ("done", Arguments("the end of a loop")),
    (
        "palpate stress seeds seed-1.jsonl seed-2.jsonl seed-3.jsonl --json seeds.json",
        Arguments("it reads the files of the loop before it; host/program/tests/command runs it"),
    ),
    (
        "sbatch --array=1-32 --wrap 'palpate stress scene sheet.toml --runs 10000 --shard $SLURM_ARRAY_TASK_ID/32 --json part-$SLURM_ARRAY_TASK_ID.jsonl'",
        Arguments("it needs a cluster"),
    ),
    (
        "cat part-*.jsonl > all.jsonl && palpate stress scene sheet.toml --runs 10000 --json all.jsonl --plot scene.svg",
        Arguments("it reads the files of the lines before it"),
    ),
    (
        "palpate stress endings --runs 1",
        Arguments("host/program/tests/ways_out.rs runs it"),
    ),
    (
        "cp crash fuzz/target/corpus/gmsh/name_of_the_case",
        Arguments("it copies a file that a fuzzer found"),
    ),
    // Other programs.
    (
        "gmsh -3 tissue.geo -format msh41 -o tissue.msh",
        Arguments("it needs Gmsh; the page has the mesh for those without it"),
    ),
];
