//! Two pages on JSON are generated from the types that the program writes, and from their doc comments. `docs/src/json.md`
//! has every field of what a user's program reads, and `docs/report/src/files.md` lists the files of the studies. This test
//! fails if a page is out of date, or if a number of any file has no unit. To renew the pages:
//!
//! ```sh
//! PALPATE_RENEW=1 cargo test --release -p palpate --test json_page
//! ```

#[path = "json_page/page.rs"]
mod page;
#[path = "json_page/source.rs"]
mod source;

use page::{Output, list, page, unit};
use source::Source;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::path::Path;

/// The files that a user's program reads, in the order of the book's page.
const OUTPUTS: [Output; 7] = [
    Output {
        title: Cow::Borrowed("`palpate run --json`"),
        schema: "palpate.run/4",
        about: "The summary of a run.",
        root: "host::run::summary::RunSummary",
    },
    Output {
        title: Cow::Borrowed("`palpate run --replay LOG --json`"),
        schema: "palpate.replay/1",
        about: "The comparison of a replay with its log.",
        root: "host::run::replay::ReplayReport",
    },
    Output {
        title: Cow::Borrowed("`palpate compare --json`"),
        schema: "palpate.compare/1",
        about: "A scene under several force schemes.",
        root: "study::compare::Comparison",
    },
    Output {
        title: Cow::Borrowed("`palpate solve --json`"),
        schema: "palpate.solve/1",
        about: "Equilibrium or motion without devices.",
        root: "host::solve::result::Solution",
    },
    Output {
        title: Cow::Borrowed("`palpate device list --json`"),
        schema: "palpate.devices/1",
        about: "The devices that are connected.",
        root: "palpate::device::list::DeviceList",
    },
    Output {
        title: Cow::Borrowed("`palpate device probe --json`"),
        schema: "palpate.probe/2",
        about: "The states of a device.",
        root: "study::probe::Probed",
    },
    Output {
        title: Cow::Borrowed("`palpate device identify --json`"),
        schema: "palpate.identified/1",
        about: "The mechanics of a device, each number with its interval.",
        root: "palpate::device::identify::IdentifiedJson",
    },
];

/// The files of the studies, in the report's order. The studies of the registry stand before the one at [`AFTER`].
const STUDIES: [Output; 16] = [
    Output {
        title: Cow::Borrowed("`palpate sweep --json`"),
        schema: "",
        about: "A line for each run.",
        root: "study::sweep::Swept",
    },
    Output {
        title: Cow::Borrowed("`palpate bench accuracy --json`"),
        schema: "palpate.accuracy/2",
        about: "Distances from exact solutions.",
        root: "study::accuracy::Accuracy",
    },
    Output {
        title: Cow::Borrowed("`palpate bench contact --json`"),
        schema: "palpate.contact/1",
        about: "Contact against the aims of its design.",
        root: "study::contact::ContactStudy",
    },
    Output {
        title: Cow::Borrowed("`palpate bench extrapolation --json`"),
        schema: "palpate.extrapolation/1",
        about: "Errors of the force schemes between publications.",
        root: "study::extrapolation::Extrapolation",
    },
    Output {
        title: Cow::Borrowed("`palpate bench speed --json`"),
        schema: "palpate.speed/1",
        about: "Run time against error.",
        root: "study::speed::Speed",
    },
    Output {
        title: Cow::Borrowed("`palpate bench stability --json`"),
        schema: "palpate.stability/1",
        about: "Bodies under extreme conditions.",
        root: "study::stability::Report",
    },
    Output {
        title: Cow::Borrowed("`palpate bench tearing --json`"),
        schema: "palpate.tearing/1",
        about: "Tears of sheets against fracture mechanics.",
        root: "study::tearing::TearingStudy",
    },
    Output {
        title: Cow::Borrowed("`palpate bench tearing --part figure --json` (and `table`, `feel`)"),
        schema: "palpate.tearing_runs/1",
        about: "Tears in whole runs of scenes.",
        root: "study::tearing::runs::TearingRuns",
    },
    Output {
        title: Cow::Borrowed("`palpate bench velocity --json`"),
        schema: "palpate.velocity/1",
        about: "Errors of the estimate of velocity.",
        root: "study::velocity::VelocityStudy",
    },
    Output {
        title: Cow::Borrowed("`palpate settings --json`"),
        schema: "palpate.settings/1",
        about: "The settings of the machine, each with what gives it.",
        root: "palpate::settings::SettingsJson",
    },
    Output {
        title: Cow::Borrowed("`palpate plan --json`"),
        schema: "palpate.plan/2",
        about: "The stages of a host step.",
        root: "palpate::plan::PlanJson",
    },
    Output {
        title: Cow::Borrowed("`palpate doctor --json`"),
        schema: "palpate.doctor/1",
        about: "What the machine lacks for a steady tick.",
        root: "palpate::doctor::DoctorJson",
    },
    Output {
        title: Cow::Borrowed("`palpate status --json`"),
        schema: "palpate.status/1",
        about: "What a program that serves does.",
        root: "palpate::serve::status::Status",
    },
    Output {
        title: Cow::Borrowed("`palpate latency --json`"),
        schema: "palpate.latency/1",
        about: "How late the loop is, how often, and where from.",
        root: "study::latency::result::Latency",
    },
    Output {
        title: Cow::Borrowed("`palpate latency --cyclictest --json`"),
        schema: "palpate.cyclictest/1",
        about: "The wake-up of the loop beside that of cyclictest.",
        root: "palpate::latency::compare::Comparison",
    },
    Output {
        title: Cow::Borrowed("`palpate stress seeds --json`"),
        schema: "palpate.seeds/1",
        about: "A study over several seeds. The file is not JSON Lines.",
        root: "study::stress::seeds::Seeds",
    },
];

/// Versions of data that no command writes with `--json`: the messages to viewers (`host/src/live`), and the overview at
/// the end of a log (`host/src/log/overview.rs`). Their types describe them.
const OTHERS: [&str; 2] = ["palpate.view/1", "palpate.overview/1"];

/// The crates whose types are written, by name and folder.
const CRATES: [(&str, &str); 11] = [
    ("host", "host/src"),
    ("scene", "host/scene/src"),
    ("plot", "host/plot/src"),
    ("palpate", "host/program/src"),
    ("study", "host/study/src"),
    ("physics", "host/physics/src"),
    ("sim", "sim/src"),
    ("rt_core", "rt_core/src"),
    ("runner", "rt_core/runner/src"),
    ("devices", "rt_core/devices/src"),
    ("doctor", "host/doctor/src"),
];

/// The title before which the studies stand.
const AFTER: &str = "`palpate stress seeds --json`";

/// [`STUDIES`], and those of the registry.
fn studies() -> Vec<Output> {
    let studies = study::stress::STUDIES.iter().map(|study| Output {
        title: format!("`palpate stress {} --json`", study.name).into(),
        schema: "",
        about: "A line for each cell.",
        root: (study.outcome)(),
    });
    let mut all = STUDIES.to_vec();
    let after = all.iter().position(|output| output.title == AFTER);
    let after = after.unwrap_or(all.len());
    all.splice(after..after, studies);
    all
}

const RENEW: &str = "PALPATE_RENEW=1 cargo test --release -p palpate --test json_page";

#[test]
fn the_pages_on_json_are_up_to_date_and_every_number_has_a_unit() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let source = Source::read(&root, &CRATES);
    let named = OUTPUTS.iter().chain(&STUDIES).map(|output| output.schema);
    let named: BTreeSet<_> = named.chain(OTHERS).collect();
    let missing: Vec<_> = source.schemas().difference(&named).copied().collect();
    assert!(
        missing.is_empty(),
        "the pages lack the outputs of these schemas: add them to tests/json_page.rs: {missing:?}"
    );
    let studies = studies();
    let book = page(&source, &OUTPUTS);
    // The report does not print the fields of the studies, whose types describe them. Their units are checked as well.
    let fields = page(&source, &studies);
    let lacks = |of: fn(&page::Page) -> &Vec<String>| [of(&book).as_slice(), of(&fields)].concat();
    let without_unit = lacks(|page| &page.without_unit);
    assert!(
        without_unit.is_empty(),
        "these numbers name no unit: end the doc comment of the field (or of its type) with one in parentheses, such as \
         (m), or say that the number is a fraction, a factor or relative:\n{}",
        without_unit.join("\n")
    );
    let without_words = lacks(|page| &page.without_words);
    assert!(
        without_words.is_empty(),
        "these fields have no doc comment:\n{}",
        without_words.join("\n")
    );
    for (name, text) in [
        ("docs/src/json.md", &book.text),
        ("docs/report/src/files.md", &list(&source, &studies)),
    ] {
        let path = root.join(name);
        if std::env::var_os("PALPATE_RENEW").is_some() {
            std::fs::write(&path, text).expect("the page can be written");
            continue;
        }
        let found = std::fs::read_to_string(&path).unwrap_or_default();
        let differs = found.lines().zip(text.lines()).find(|(a, b)| a != b);
        assert!(
            found == *text,
            "{name} is out of date: {differs:?}. Renew it with\n\n  {RENEW}\n"
        );
    }
}

#[test]
fn a_unit_is_read_from_the_field_before_its_type() {
    let of = |field, definition| unit(field, definition).unwrap_or_default();
    assert_eq!(of("The largest force (N), at a time.", "All in (s)."), "N");
    assert_eq!(of("Median.", "A distribution of times (s)."), "s");
    assert_eq!(
        of("Damping: by mass (1/s) and by stiffness (s).", ""),
        "1/s, s"
    );
    assert_eq!(of("A fraction of the force.", "Forces (N)."), "1");
    assert_eq!(of("The value, in `unit`.", ""), "see there");
    assert_eq!(of("The time (see below).", "A thing."), "");
}
