use super::*;
use std::fs;
use std::sync::atomic::AtomicU64;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Square {
    x: f64,
    name: String,
}

fn header() -> Header {
    Header {
        study: "squares".to_owned(),
        schema: 1,
        seed: 7,
        cells: 23,
        settings: serde_json::json!({"scale": 0.1, "quick": true}),
    }
}

/// Numbers whose shortest decimal form is long: the file must preserve every bit.
fn square(cell: u64) -> Square {
    Square {
        x: (cell as f64 * 0.1).powi(2) / 3.0,
        name: format!("{{{cell}}}"),
    }
}

fn options((index, count): (u64, u64), threads: usize, file: &Path) -> Options {
    Options {
        shard: Shard::new(index, count).expect("a shard"),
        threads: NonZero::new(threads),
        file: Some(file.to_owned()),
    }
}

fn run_all(options: &Options) -> Result<BTreeMap<u64, Square>, JobError> {
    whole_file(run(&header(), options, &square, &mut |_| {}))
}

/// The cells of a run whose file holds all of them.
fn whole_file(found: Result<Cells<Square>, JobError>) -> Result<BTreeMap<u64, Square>, JobError> {
    let found = found?;
    found.unwritten.map_or(Ok(found.cells), Err)
}

fn whole() -> BTreeMap<u64, Square> {
    (0..23).map(|cell| (cell, square(cell))).collect()
}

/// The cells as text, to the last bit.
fn summary(cells: &BTreeMap<u64, Square>) -> String {
    format!("{cells:?}")
}

#[test]
fn any_number_of_threads_gives_the_same_cells() {
    for threads in [1, 2, 7, 50] {
        let options = Options {
            threads: NonZero::new(threads),
            ..Options::default()
        };
        let mut steps = Vec::new();
        let found = run(&header(), &options, &square, &mut |at| {
            steps.push((at.done, at.of));
        });
        assert_eq!(summary(&found.expect("cells").cells), summary(&whole()));
        let expected: Vec<_> = (0..=23).map(|done| (done, 23)).collect();
        assert_eq!(steps, expected);
    }
}

#[test]
fn shards_add_up_to_the_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let merged = folder.path().join("merged.jsonl");
    let mut text = Vec::new();
    let mut count = 0;
    for shard in [(1, 3), (2, 3), (3, 3)] {
        let path = folder.path().join(format!("{}of{}", shard.0, shard.1));
        let cells = run_all(&options(shard, 2, &path)).expect("cells");
        count += cells.len();
        text.extend(fs::read(&path).expect("a file"));
    }
    assert_eq!(count, 23);
    fs::write(&merged, &text).expect("merged");
    // No cell is left to be run.
    let never = |cell| -> Square { panic!("cell {cell} was there") };
    let found = run(&header(), &options((1, 1), 2, &merged), &never, &mut |_| {}).expect("cells");
    assert_eq!(summary(&found.cells), summary(&whole()));
    assert_eq!(read::<Square>(&merged, &header()).expect("cells"), whole());
    assert_eq!(fs::read(&merged).expect("merged"), text);
}

#[test]
fn a_run_cut_off_at_any_byte_is_resumed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("results.jsonl");
    run_all(&options((1, 1), 1, &path)).expect("cells");
    let text = fs::read(&path).expect("the file");
    for cut in 0..=text.len() {
        fs::write(&path, &text[..cut]).expect("what is left");
        let whole_lines = text[..cut].split(|byte| *byte == b'\n').count() - 1;
        let ran = AtomicU64::new(0);
        let counted = |cell| {
            ran.fetch_add(1, Ordering::Relaxed);
            square(cell)
        };
        let found =
            run(&header(), &options((1, 1), 1, &path), &counted, &mut |_| {}).expect("cells");
        assert_eq!(summary(&found.cells), summary(&whole()), "cut at {cut}");
        // No cell of the file is run again, except one whose line may be incomplete.
        let left = 24 - whole_lines.max(1) as u64;
        let ran = ran.into_inner();
        assert!(
            (left.saturating_sub(1)..=left).contains(&ran),
            "{ran} after {cut}"
        );
        // On one thread the cells come in order, so the file is the same, too.
        assert_eq!(fs::read(&path).expect("the file"), text, "cut at {cut}");
    }
}

#[test]
fn lines_that_an_editor_or_a_mailer_padded_are_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("results.jsonl");
    run_all(&options((1, 3), 1, &path)).expect("cells");
    let text = fs::read_to_string(&path).expect("a file");
    let padded = text.replace('\n', " \r\n");
    fs::write(&path, &padded).expect("written");
    let cells = run_all(&options((1, 1), 2, &path)).expect("the rest");
    assert_eq!(summary(&cells), summary(&whole()));
    // No line is lost, and each cell occurs once.
    let after = fs::read_to_string(&path).expect("a file");
    assert!(after.starts_with(&padded));
    assert_eq!(after.lines().count(), 1 + 23);
}

#[test]
fn headers_that_differ_are_refused_and_nothing_is_run_or_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("results.jsonl");
    run_all(&options((1, 2), 1, &path)).expect("cells");
    let text = fs::read(&path).expect("the file");
    let never = |cell| -> Square { panic!("cell {cell} of another study") };
    let others = [
        Header {
            seed: 8,
            ..header()
        },
        Header {
            schema: 2,
            ..header()
        },
        Header {
            study: "cubes".to_owned(),
            ..header()
        },
        Header {
            settings: serde_json::json!({"scale": 0.1}),
            ..header()
        },
    ];
    for other in others {
        let refused = run(&other, &options((2, 2), 1, &path), &never, &mut |_| {});
        assert!(
            matches!(refused, Err(JobError::Header { line: 1, .. })),
            "{refused:?}"
        );
        assert_eq!(fs::read(&path).expect("the file"), text);
    }
    // A header that differs in the middle of a merged file: both lines are named.
    let mut merged = text;
    let other = Header {
        seed: 8,
        ..header()
    };
    merged.extend(serde_json::to_vec(&other).expect("a header"));
    merged.push(b'\n');
    fs::write(&path, &merged).expect("merged");
    let refused =
        run(&header(), &options((1, 1), 1, &path), &never, &mut |_| {}).expect_err("refused");
    let said = refused.to_string();
    assert!(
        said.contains(
            "line 14: the results are not those of line 1: seed: found 8, expected 7; results"
        ),
        "{said}"
    );
}

#[test]
fn a_file_of_fewer_cells_is_extended_and_its_cells_stay_as_they_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("results.jsonl");
    let few = Header {
        cells: 9,
        ..header()
    };
    let all = options((1, 1), 1, &path);
    run(&few, &all, &square, &mut |_| {}).expect("nine cells");
    let short = fs::read_to_string(&path).expect("the file");
    // The nine cells are not run again.
    let beyond = |cell| {
        assert!(cell >= 9, "cell {cell} was there");
        square(cell)
    };
    let found = whole_file(run(&header(), &all, &beyond, &mut |_| {})).expect("the rest");
    assert_eq!(summary(&found), summary(&whole()));
    let long = fs::read_to_string(&path).expect("the file");
    let added = long.strip_prefix(&short).expect("the older lines are kept");
    // Nothing differs from the file of one run but the second header.
    let fresh = folder.path().join("fresh.jsonl");
    run_all(&options((1, 1), 1, &fresh)).expect("cells");
    let fresh = fs::read_to_string(&fresh).expect("a file");
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<Vec<_>>();
    let [header_line, cells @ ..] = &lines(&fresh)[..] else {
        panic!("a header");
    };
    assert_eq!(lines(added)[0], *header_line);
    assert_eq!([&lines(&short)[1..], &lines(added)[1..]].concat(), cells);
    // A run of fewer cells finds its own, and leaves the file as it is.
    let never = |cell| -> Square { panic!("cell {cell} was there") };
    let found = whole_file(run(&few, &all, &never, &mut |_| {})).expect("nine cells");
    assert_eq!(found.len(), 9);
    assert_eq!(fs::read_to_string(&path).expect("the file"), long);
    assert_eq!(header_of(&path).expect("a header"), header());
    assert_eq!(read::<Square>(&path, &few).expect("cells").len(), 9);
}

#[test]
fn lines_that_are_no_results_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("results.jsonl");
    let head = serde_json::to_string(&header()).expect("a header");
    let good = r#"{"cell":3,"x":1.0,"name":"a"}"#;
    let cases = [
        (format!("{head}\n{{\"cell\":3,\"x\":1.{head}\n{good}\n"), 2),
        (format!("{head}\n{{\"cell\":3}}\n"), 2),
        (
            format!("{head}\n{good}\n{{\"cell\":3,\"x\":2.0,\"name\":\"a\"}}\n"),
            3,
        ),
        (
            format!("{head}\n{good}\n{{\"cell\":23,\"x\":2.0,\"name\":\"a\"}}\n"),
            3,
        ),
        (format!("{good}\n"), 1),
    ];
    for (text, at) in cases {
        fs::write(&path, &text).expect("a file");
        let refused = run_all(&options((1, 1), 1, &path)).expect_err("refused");
        assert!(
            matches!(refused, JobError::Line { line, .. } if line == at),
            "{refused}"
        );
        assert_eq!(fs::read_to_string(&path).expect("the file"), text);
    }
}

#[test]
fn a_file_has_one_writer() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("results.jsonl");
    let _held = file::open(&path, &header(), &mut BTreeMap::<u64, Square>::new()).expect("a file");
    let refused = run_all(&options((1, 1), 1, &path));
    assert!(matches!(refused, Err(JobError::Busy { .. })), "{refused:?}");
}

#[test]
fn a_result_that_json_cannot_hold_is_an_error() {
    let nan = |cell| Square {
        x: if cell == 5 { f64::NAN } else { 0.0 },
        name: String::new(),
    };
    let refused = run(&header(), &Options::default(), &nan, &mut |_| {});
    assert!(
        matches!(refused, Err(JobError::Result { cell: 5, .. })),
        "{refused:?}"
    );
}

#[test]
fn a_shard_holds_its_cells_and_shards_that_do_not_exist_are_refused() {
    let shard = Shard::new(2, 3).expect("a shard");
    let held: Vec<_> = (0..8).filter(|cell| shard.holds(*cell)).collect();
    assert_eq!(held, [1, 4, 7]);
    for (index, count) in [(0, 3), (4, 3), (1, 0), (0, 0)] {
        assert_eq!(Shard::new(index, count), None, "{index}/{count}");
    }
}
