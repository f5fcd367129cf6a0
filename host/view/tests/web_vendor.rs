//! The libraries of the page are those of their packages, and the content policy fits the page.

use std::path::Path;
use std::process::Command;
use view::web::assets::{ASSETS, POLICY, find};

/// SHA-256 (FIPS 180-4).
fn sha256(bytes: &[u8]) -> [u8; 32] {
    let primes: Vec<u32> = (2_u32..312)
        .filter(|n| (2..*n).take_while(|d| d * d <= *n).all(|d| n % d != 0))
        .collect();
    let fraction = |root: f64| ((root - root.floor()) * 4_294_967_296.0) as u32;
    let mut state: Vec<u32> = primes
        .iter()
        .take(8)
        .map(|p| fraction(f64::from(*p).sqrt()))
        .collect();
    let k: Vec<u32> = primes
        .iter()
        .map(|p| fraction(f64::from(*p).cbrt()))
        .collect();
    let mut padded = bytes.to_vec();
    padded.push(0x80);
    padded.resize(
        padded.len().next_multiple_of(64) + if padded.len() % 64 > 56 { 64 } else { 0 } - 8,
        0,
    );
    padded.extend((8 * bytes.len() as u64).to_be_bytes());
    for block in padded.as_chunks::<64>().0 {
        let mut w: Vec<u32> = block
            .as_chunks()
            .0
            .iter()
            .map(|four| u32::from_be_bytes(*four))
            .collect();
        for i in 16..64 {
            let s0 = w[i - 15].rotate_right(7) ^ w[i - 15].rotate_right(18) ^ (w[i - 15] >> 3);
            let s1 = w[i - 2].rotate_right(17) ^ w[i - 2].rotate_right(19) ^ (w[i - 2] >> 10);
            w.push(
                w[i - 16]
                    .wrapping_add(s0)
                    .wrapping_add(w[i - 7])
                    .wrapping_add(s1),
            );
        }
        let mut s = state.clone();
        for i in 0..64 {
            let s1 = s[4].rotate_right(6) ^ s[4].rotate_right(11) ^ s[4].rotate_right(25);
            let choice = (s[4] & s[5]) ^ (!s[4] & s[6]);
            let t1 = [s1, choice, k[i], w[i]]
                .iter()
                .fold(s[7], |sum, x| sum.wrapping_add(*x));
            let s0 = s[0].rotate_right(2) ^ s[0].rotate_right(13) ^ s[0].rotate_right(22);
            let majority = (s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]);
            s.rotate_right(1);
            s[4] = s[4].wrapping_add(t1);
            s[0] = t1.wrapping_add(s0).wrapping_add(majority);
        }
        state
            .iter_mut()
            .zip(s)
            .for_each(|(h, s)| *h = h.wrapping_add(s));
    }
    let mut sum = [0; 32];
    for (four, word) in sum.as_chunks_mut::<4>().0.iter_mut().zip(state) {
        *four = word.to_be_bytes();
    }
    sum
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes
        .iter()
        .fold(String::new(), |text, byte| text + &format!("{byte:02x}"))
}

fn base64(bytes: &[u8]) -> String {
    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let text = bytes.chunks(3).flat_map(|three| {
        let bits = (0..3).fold(0_u32, |bits, i| {
            (bits << 8) | u32::from(*three.get(i).unwrap_or(&0))
        });
        let kept = three.len() + 1;
        (0..4).map(move |i| {
            if i < kept {
                digits[(bits >> (18 - 6 * i)) as usize & 63] as char
            } else {
                '='
            }
        })
    });
    text.collect()
}

#[test]
fn the_sum_is_that_of_the_standard() {
    // FIPS 180-4, examples of one block and of two.
    let one = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
    assert_eq!(hexadecimal(&sha256(b"abc")), one);
    let two = "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1";
    let text = b"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq";
    assert_eq!(hexadecimal(&sha256(text)), two);
    assert_eq!(base64(b"any carnal pleas"), "YW55IGNhcm5hbCBwbGVhcw==");
}

#[test]
fn each_vendored_file_comes_from_its_package() {
    let table = include_str!("../src/web/page/vendor/VENDORED.md");
    let rows: Vec<Vec<&str>> = table
        .lines()
        .filter(|line| line.starts_with("| ") && !line.starts_with("| file "))
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
        .collect();
    let vendored = ASSETS
        .iter()
        .filter(|asset| asset.path.starts_with("vendor/"));
    assert_eq!(vendored.count(), rows.len());
    let packages = std::env::var_os("PALPATE_NODE_MODULES");
    if packages.is_none() {
        eprintln!(
            "SKIPPED: the comparison with the packages; PALPATE_NODE_MODULES names no folder with them"
        );
    }
    for row in rows {
        let &[file, package, version, path, sum] = row.as_slice() else {
            panic!("a row of VENDORED.md has other columns: {row:?}")
        };
        let asset = find(&format!("vendor/{file}")).expect(file);
        assert_eq!(hexadecimal(&sha256(asset.bytes)), sum, "{file}");
        let Some(packages) = &packages else { continue };
        let minifier = Path::new(packages).join(".bin/esbuild");
        let package = Path::new(packages).join(package);
        let original = package.join(path);
        let expected = if asset.media == "text/javascript" {
            let mut command = Command::new(minifier);
            let command = command.arg(&original);
            let made = command.args(["--minify", "--legal-comments=inline"]);
            made.output().expect("esbuild").stdout
        } else {
            std::fs::read(&original).unwrap()
        };
        assert!(expected == asset.bytes, "{file} differs from its package");
        let facts = std::fs::read_to_string(package.join("package.json")).unwrap();
        let facts: serde_json::Value = serde_json::from_str(&facts).unwrap();
        assert_eq!(facts["version"], version, "{file}");
    }
}

#[test]
fn the_policy_admits_the_import_map_of_the_page_and_nothing_inline_beside() {
    let page = std::str::from_utf8(find("").unwrap().bytes).unwrap();
    let (_, map) = page.split_once("<script type=\"importmap\">").unwrap();
    let (map, _) = map.split_once("</script>").unwrap();
    let source = format!("'sha256-{}'", base64(&sha256(map.as_bytes())));
    assert!(POLICY.contains(&source), "the policy needs {source}");
    assert!(!POLICY.contains("unsafe"));
    assert_eq!(page.matches("<script").count(), 2);
    for inline in ["<style", " style=", " onclick=", " onload="] {
        assert!(!page.contains(inline), "{inline}");
    }
}

#[test]
fn the_page_names_no_other_server() {
    for asset in ASSETS
        .iter()
        .filter(|asset| !asset.path.starts_with("vendor/"))
    {
        let text = std::str::from_utf8(asset.bytes).unwrap();
        assert!(!text.contains("://"), "{}", asset.path);
    }
}
