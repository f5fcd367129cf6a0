//! The script that mends and undoes: one file for the POSIX shell, which a person reads and runs.
//!
//! `mend` keeps what each file was before its first change, and notes what it made. `undo` puts everything back, also what
//! scripts of earlier reports changed. The kept state lies in one folder, which the undoing removes last, so both
//! modes may be run again, and after a run that was broken off. Values of the running kernel come from the files at the
//! next start of the machine; they are not set by hand, so that nothing needs to be remembered for them.

use crate::check::Verdict;
use crate::report::Report;
use crate::step::Step;
use std::fmt::Write;

/// The script before its steps.
const BEGIN: &str = r#"set -eu
umask 022
# A folder in place of the machine: files are changed below it, and no command is run.
ROOT=${ROOT:-}
KEPT=$ROOT/var/lib/palpate/doctor
made=

# Runs a command of the machine. A command that fails or is missing is named, and the script goes on.
run() {
    if [ -n "$ROOT" ]; then echo "left out below $ROOT: $*"
    elif command -v "$1" > /dev/null; then "$@" || echo "this command failed: $*" >&2
    else echo "this machine does not have the command: $*" >&2
    fi
}

# Makes a folder, and notes it.
folder() {
    if [ ! -d "$ROOT$1/" ]; then
        folder "${1%/*}"
        mkdir "$ROOT$1"
        made="$1
$made"
    fi
}

# Keeps what is at a path, unless it has been kept.
keep() {
    if grep -Fqx "$1" "$KEPT/changed" 2> /dev/null; then return; fi
    if [ -e "$ROOT$1" ] || [ -L "$ROOT$1" ]; then
        mkdir -p "$KEPT/files${1%/*}"
        rm -f "$KEPT/files$1"
        cp -pP "$ROOT$1" "$KEPT/files$1"
    fi
    echo "$1" >> "$KEPT/changed"
}

# Writes the standard input to a path, whole.
put() {
    begin
    keep "$1"
    folder "${1%/*}"
    note
    cat > "$ROOT$1.palpate-new"
    mv -f "$ROOT$1.palpate-new" "$ROOT$1"
}

# Makes a link at a path.
link() {
    begin
    keep "$2"
    folder "${2%/*}"
    note
    ln -sfn "$1" "$ROOT$2"
}

# Makes the folder of the kept state.
begin() {
    if [ ! -d "$KEPT" ]; then folder /var/lib/palpate/doctor; fi
    note
}

# Notes the folders that were made, the innermost first.
note() {
    if [ -n "$made" ]; then
        touch "$KEPT/folders"
        { printf %s "$made"; cat "$KEPT/folders"; } > "$KEPT/folders.new"
        mv -f "$KEPT/folders.new" "$KEPT/folders"
        made=
    fi
}

# Installs a package that is not installed, and notes it.
package() {
    if [ -n "$ROOT" ] || ! dpkg -s "$1" > /dev/null 2>&1; then
        begin
        echo "$1" >> "$KEPT/packages"
        run apt-get install -y "$1"
    fi
}

# Makes a group that does not exist, and notes it.
group() {
    if [ -n "$ROOT" ] || ! getent group "$1" > /dev/null; then
        begin
        echo "$1" >> "$KEPT/groups"
        run groupadd --system "$1"
    fi
}

undo() {
    if [ ! -d "$KEPT" ]; then
        echo "nothing to undo"
        return
    fi
    if [ -f "$KEPT/changed" ]; then
        while IFS= read -r path; do
            if [ -e "$KEPT/files$path" ] || [ -L "$KEPT/files$path" ]; then
                cp -pP "$KEPT/files$path" "$ROOT$path.palpate-new"
                mv -f "$ROOT$path.palpate-new" "$ROOT$path"
            else
                rm -f "$ROOT$path"
            fi
        done < "$KEPT/changed"
    fi
    for list in packages groups; do
        if [ -f "$KEPT/$list" ]; then
            sort -u "$KEPT/$list" | while IFS= read -r name; do
                case $list in
                    packages) run apt-get remove -y "$name" < /dev/null ;;
                    groups) run groupdel "$name" ;;
                esac
            done
        fi
    done
    reload
    folders=
    if [ -f "$KEPT/folders" ]; then folders=$(cat "$KEPT/folders"); fi
    rm -rf "$KEPT"
    # A folder in which another program has put a file stays.
    printf '%s\n' "$folders" | while IFS= read -r path; do
        if [ -n "$path" ] && [ -d "$ROOT$path" ]; then rmdir "$ROOT$path" 2> /dev/null || true; fi
    done
    echo "undone: restart the machine"
}

# Lets the machine read the files again.
reload() {
    run systemctl daemon-reload
    run udevadm control --reload
    run update-grub
}
"#;

/// The script after its steps.
const END: &str = r#"
case ${1:-} in
    mend | undo)
        if [ -z "$ROOT" ] && [ "$(id -u)" != 0 ]; then
            echo "found an ordinary account, allowed: root (sudo sh $0 $1)" >&2
            exit 2
        fi
        "$1"
        ;;
    *)
        echo "found ${1:-no word}, allowed: mend or undo (sudo sh $0 mend)" >&2
        exit 2
        ;;
esac
"#;

/// The script with the steps of a report.
pub fn script(report: &Report) -> String {
    let mut body = String::new();
    let mut hand = String::new();
    let mut seen: Vec<&Step> = Vec::new();
    for check in report.with(Verdict::Lacking) {
        for step in &check.steps {
            if seen.contains(&step) {
                continue;
            }
            seen.push(step);
            let text = match step {
                Step::ByHand(text) => {
                    // A line of a comment for the shell, whatever the machine has put into the text.
                    let text = text.replace(|c: char| c.is_control() || c == '\'', "?");
                    // Writing to a string does not fail.
                    let _ = writeln!(hand, "    printf '  %s\\n' '{}: {text}'", check.name);
                    continue;
                }
                Step::File { path, text } => {
                    let put = format!("    put {path} <<'EOF'\n{text}EOF\n");
                    match step.unit() {
                        Some(unit) => format!("{put}    link ../{unit} {WANTS}/{unit}\n"),
                        None => put,
                    }
                }
                Step::Mask(unit) => {
                    format!("    link /dev/null /etc/systemd/system/{unit}\n")
                }
                Step::Package(name) => format!("    package {name}\n"),
                Step::Group(name) => format!("    group {name}\n"),
            };
            let _ = write!(body, "    # {}\n{text}", check.id);
        }
    }
    let (core, priority) = (report.core, report.priority);
    let mut script = format!(
        "#!/bin/sh\n# Written by `palpate doctor --script` for core {core} and priority {priority}.\n#   sudo sh FILE mend   \
         makes the changes of the function `mend`; they take effect when the machine restarts\n#   sudo sh FILE undo   puts \
         back all that this script, and any earlier one of palpate doctor, has changed\n{BEGIN}\nmend() {{\n{body}"
    );
    if !body.is_empty() {
        script +=
            "    reload\n    echo \"mended: restart the machine, then run palpate doctor again\"\n";
    }
    if !hand.is_empty() {
        // Writing to a string does not fail.
        let _ = write!(script, "    echo \"left to you:\"\n{hand}");
    } else if body.is_empty() {
        script += "    echo \"nothing to mend\"\n";
    }
    script + "}\n" + END
}

/// The folder of the units that a start of the machine wants.
const WANTS: &str = "/etc/systemd/system/multi-user.target.wants";
