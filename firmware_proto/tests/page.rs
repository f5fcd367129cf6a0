//! The page of the book and the documentation of `report` describe every byte, and the same fields.

use std::path::Path;

/// The tables with offsets in a text, each as its rows of offset and number of bytes, from the first byte behind the
/// session on.
fn tables(text: &str) -> Vec<Vec<(usize, usize)>> {
    let mut tables = Vec::new();
    let mut inside = false;
    for line in text.lines() {
        let line = line.strip_prefix("//! ").unwrap_or(line);
        let cells: Vec<_> = line.split('|').map(str::trim).collect();
        if cells.get(1..3) == Some(&["offset", "bytes"]) {
            tables.push(Vec::new());
            inside = true;
        } else if !line.starts_with('|') {
            inside = false;
        } else if inside && let (Ok(offset), Ok(bytes)) = (cells[1].parse(), cells[2].parse()) {
            let last: &mut Vec<_> = tables.last_mut().expect("it was just pushed");
            if (8..62).contains(&offset) {
                last.push((offset, bytes));
            }
        }
    }
    // The fields that all reports share.
    tables.retain(|table| !table.is_empty());
    tables
}

fn read(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    std::fs::read_to_string(path).expect("it is in the repository")
}

#[test]
fn the_tables_name_every_byte_once() {
    let page = tables(&read("../docs/src/protocol.md"));
    let [
        hello,
        capabilities,
        condition,
        pose,
        counts,
        geometry,
        joint,
        wrench,
    ] = &page[..]
    else {
        panic!("{} tables", page.len());
    };
    let mut code = tables(&read("src/report/mod.rs"));
    code.sort();
    let mut sorted = page.clone();
    sorted.sort();
    assert_eq!(sorted, code);
    let none = Vec::new();
    for (first, second) in [
        (hello, &none),
        (capabilities, &none),
        (condition, pose),
        (condition, counts),
        (geometry, &none),
        (joint, &none),
        (wrench, &none),
    ] {
        let mut end = 8;
        for &(offset, bytes) in first.iter().chain(second) {
            assert_eq!(offset, end, "in {first:?}");
            end += bytes;
        }
        assert_eq!(end, 62, "in {first:?}");
    }
}
