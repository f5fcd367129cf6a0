//! The book, the laboratory report and the README do what they say: their scenes load, their commands run, their output is
//! what the program prints, and their links lead somewhere.
//!
//! Every fenced block of TOML and of shell lines is checked, page by page, in a folder of the page's own that contains
//! `host` (a link to the sources) and what the page itself writes. A comment before a block says what the block is:
//!
//! - `<!-- file: NAME -->`: a file of this name, which later blocks use;
//! - `<!-- merged into SCENE -->`: fields of a scene; `palpate plan` must accept the scene that has them;
//! - `<!-- merged into SCENE at PATH -->`: fields of the table at a path such as `body.0`;
//! - `<!-- given: NAME = PATH -->`: the page assumes a copy of the file at this path of the sources; `, OLD -> NEW` after
//!   the path changes a text in it;
//! - `<!-- prints -->`: lines that the last command before the block prints, one after the other. Measured times may
//!   differ, and `...` stands for any lines;
//! - `<!-- ends with N -->`: the exit code of the block's last command.
//!
//! Every command runs. Those that take long, serve others, or need what a test does not have are listed in `book/ways.rs`,
//! with how they are run, or with the reason why their arguments alone are checked. Lines of `cargo` and of scripts are
//! checked for the targets and files that they name. A block of TOML without a comment, a command of an unknown program, and
//! a command of the list that no page has, is an error.

#[path = "book/markdown.rs"]
mod markdown;
#[path = "book/page.rs"]
mod page;
#[path = "book/ways.rs"]
mod ways;

use markdown::Page;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// The root of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The pages of the book and of the laboratory report, and the READMEs.
fn pages() -> Vec<PathBuf> {
    let folders = ["docs/src", "docs/report/src"].map(|folder| root().join(folder));
    let mut pages: Vec<PathBuf> = folders
        .iter()
        .flat_map(|folder| fs::read_dir(folder).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "md"))
        .collect();
    pages.sort();
    pages.extend(["README.md", "CONTRIBUTING.md"].map(|name| root().join(name)));
    pages
}

#[test]
fn every_block_of_every_page_does_what_it_says() {
    let pages = pages();
    let next = AtomicUsize::new(0);
    // Two pages at a time. Each page has a folder of its own.
    let check = || {
        let mut faults = Vec::new();
        while let Some(path) = pages.get(next.fetch_add(1, Ordering::Relaxed)) {
            let page = Page::read(path);
            // Pages with long commands of their own have tests of their own.
            if !["tutorial.md", "jobs.md"].contains(&page.name.as_str()) {
                faults.extend(page::check(&page, tempfile::tempdir().unwrap().path()));
            }
        }
        faults
    };
    let faults = thread::scope(|scope| {
        let other = scope.spawn(check);
        let mut faults = check();
        faults.extend(other.join().unwrap());
        faults
    });
    assert!(faults.is_empty(), "{}", faults.join("\n\n"));
}

/// A command that left the book leaves the list, too.
#[test]
fn every_listed_command_is_in_the_book() {
    let text: String = pages()
        .iter()
        .map(|path| fs::read_to_string(path).unwrap().replace("\\\n", " "))
        .collect();
    let lines: Vec<&str> = text
        .lines()
        .map(|line| line.split(" #").next().unwrap_or_default().trim())
        .collect();
    for (command, way) in ways::WAYS {
        assert!(lines.contains(command), "no page has: {command}");
        if let ways::Way::Arguments(reason) = way {
            assert!(!reason.is_empty(), "{command}: not run, without a reason");
        }
    }
}

/// Checks a page of commands, and returns the folder in which they ran.
fn job(name: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let faults = page::check(
        &Page::read(&root().join("docs/src").join(name)),
        folder.path(),
    );
    assert!(faults.is_empty(), "{}", faults.join("\n\n"));
    folder
}

/// The columns of a CSV file by name. Lines that begin with `#` are comments.
fn columns(path: &Path) -> Vec<(String, Vec<f64>)> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names = lines.next().unwrap().split(',');
    let mut columns: Vec<(String, Vec<f64>)> =
        names.map(|name| (name.to_owned(), vec![])).collect();
    for line in lines {
        for (column, value) in columns.iter_mut().zip(line.split(',')) {
            column.1.push(value.parse().unwrap_or(f64::NAN));
        }
    }
    columns
}

/// The column whose name begins with a text.
fn column<'a>(columns: &'a [(String, Vec<f64>)], name: &str) -> &'a [f64] {
    let found = columns.iter().find(|(column, _)| column.starts_with(name));
    let names: Vec<&String> = columns.iter().map(|(name, _)| name).collect();
    &found
        .unwrap_or_else(|| panic!("no column {name} among {names:?}"))
        .1
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn the_tutorial_leads_from_an_empty_folder_to_a_figure() {
    let folder = job("tutorial.md");
    let work = folder.path().join("tissue");
    for figure in [
        "press.svg",
        "above.svg",
        "beside.svg",
        "indent.svg",
        "schemes.svg",
    ] {
        let svg = fs::read_to_string(work.join(figure)).unwrap();
        assert!(svg.ends_with("</svg>\n"), "{figure}");
    }
    assert!(work.join("frames/frames.pvd").is_file());
    let press = columns(&work.join("press.csv"));
    assert_eq!(column(&press, "time_s").len(), 4000);
    // A stiffer place resists the same motion more.
    let strongest = |file: &str| {
        let columns = columns(&work.join(file));
        let forces = column(&columns, "omega_force_z_N").iter();
        forces.fold(0.0, |most: f64, force| most.max(*force))
    };
    let (above, beside) = (strongest("press.csv"), strongest("beside.csv"));
    assert!(above > 1.1 * beside, "{above} N above, {beside} N beside");
    // The table starts when the weight has settled and the indenter has not moved yet.
    let indent = columns(&work.join("indent.csv"));
    let depth = column(&indent, "tissue_indenter_displacement_z_m");
    assert_eq!((depth[0], depth[depth.len() - 1]), (0.0, -0.006));
    let schemes = json(&work.join("schemes.json"));
    let runs: Vec<_> = (schemes["runs"].as_array().unwrap().iter())
        .map(|run| run["scheme"].as_str().unwrap())
        .collect();
    assert_eq!(runs, ["hold", "linear", "capped"]);
}

#[test]
fn the_six_jobs_give_what_they_say() {
    let folder = job("jobs.md");
    let work = folder.path().join("work");
    // Force against displacement, as numbers and as a figure.
    assert!(column(&columns(&work.join("press.csv")), "omega_force_z_N").len() > 1000);
    assert!(work.join("press.svg").is_file());
    // The study of walls names the device of the file.
    let walls = fs::read_to_string(work.join("wall.jsonl")).unwrap();
    assert!(walls.contains("Our paddle"), "{walls}");
    assert!(work.join("wall.svg").is_file());
    // Every scheme has an error against the reference.
    let schemes = json(&work.join("schemes.json"));
    let runs = schemes["runs"].as_array().unwrap();
    assert_eq!(runs.len(), 3);
    for run in runs {
        let error = run["devices"][0]["error"]["rms"].as_f64().unwrap();
        assert!(error > 0.0 && error < 1.0, "{run}");
    }
    // Both measurements of the latency have the lateness of all ticks of a second.
    let latency = json(&work.join("latency.json"));
    let loads = latency["loads"].as_array().unwrap();
    assert!(loads.len() == 2 && loads.iter().all(|load| load["met"] == 1000));
    assert!(work.join("latency.svg").is_file() && work.join("latency.md").is_file());
    // Two bodies, four devices, six handles.
    let hands = json(&work.join("four_hands.json"));
    assert_eq!(hands["devices"].as_array().unwrap().len(), 4);
    assert_eq!(hands["energy"].as_array().unwrap().len(), 2);
    for device in hands["devices"].as_array().unwrap() {
        assert!(device["peak_force"].as_f64().unwrap() > 0.01, "{device}");
    }
    // The hand follows its recording: 5 mm, less what the block's force takes (the grip has 700 N/m, the block about as
    // much).
    let recorded = columns(&work.join("recorded.csv"));
    let path = column(&recorded, "omega_position_z_m");
    let depth = path[0] - path.iter().fold(f64::MAX, |least, z| least.min(*z));
    assert!(depth > 0.002 && depth < 0.005, "{depth} m");
}

/// GitHub and mdBook read the same formulas: `$` and `$$` in pairs, without a backslash before punctuation, which one
/// of the two takes for an escape.
#[test]
fn formulas_are_written_as_every_renderer_reads_them() {
    let mut formulas = 0;
    for path in pages() {
        let page = Page::read(&path);
        let prose = page.prose();
        assert_eq!(
            prose.matches('$').count() % 2,
            0,
            "{}: a single $",
            page.name
        );
        assert!(
            !prose.contains("\\\\("),
            "{}: \\\\( is read by mdBook alone",
            page.name
        );
        for formula in prose.replace("$$", "$").split('$').skip(1).step_by(2) {
            formulas += 1;
            let escape = formula
                .as_bytes()
                .windows(2)
                .find(|pair| pair[0] == b'\\' && !pair[1].is_ascii_alphabetic());
            assert_eq!(escape, None, "{}: {formula}", page.name);
            assert_eq!(
                formula.trim(),
                formula,
                "{}: blanks inside ${formula}$",
                page.name
            );
        }
    }
    assert!(formulas > 100, "only {formulas} formulas were found");
}

/// The anchor of a heading, as mdBook and GitHub make it.
fn anchor(heading: &str) -> String {
    let heading = heading.trim_start_matches('#').trim();
    let kept = heading.chars().filter_map(|c| match c {
        ' ' => Some('-'),
        '-' | '_' => Some(c),
        _ => c.is_alphanumeric().then(|| c.to_ascii_lowercase()),
    });
    kept.collect()
}

/// Links inside the repository, also between the two books, lead to files and headings that exist.
#[test]
fn links_lead_somewhere() {
    let mut links = 0;
    let mut faults = Vec::new();
    let paths = [pages(), vec![root().join("CHANGELOG.md")]].concat();
    for path in paths {
        let page = Page::read(&path);
        for link in page.prose().split("](").skip(1) {
            let link = link.split(')').next().unwrap_or_default();
            if link.contains("://") {
                continue;
            }
            links += 1;
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() {
                path.clone()
            } else {
                path.parent().unwrap().join(file)
            };
            let has = |text: &str| {
                let mut headings = text.lines().filter(|line| line.starts_with('#'));
                headings.any(|line| anchor(line) == heading)
            };
            let found = match heading {
                "" => target.exists(),
                _ => fs::read_to_string(&target).is_ok_and(|text| has(&text)),
            };
            if !found {
                faults.push(format!("{}: {link}", path.display()));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(links > 20, "only {links} links were found");
}
