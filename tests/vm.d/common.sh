# What the jobs of the virtual machine share. busybox's sh.

failures=0
fail() {
    echo "FAILED: $*"
    failures=$((failures + 1))
}

# emulate NAME MODEL [ARGUMENT...]: starts an emulated device in the background, and waits until it is there. Sets
# $emulator to its process and $connect to the connection that a scene names.
emulate() {
    said=/tmp/$1
    shift
    rm -f "$said.connect"
    palpate device emulate "$@" >"$said.connect" 2>"$said.said" &
    emulator=$!
    for _ in $(seq 100); do
        [ -s "$said.connect" ] && break
        usleep 100000
    done
    connect=$(sed -n 's/^connect = "\(.*\)"$/\1/p' "$said.connect")
    [ -n "$connect" ] || {
        fail "the emulator of $1 does not run"
        cat "$said.said"
    }
    # The kernel makes the hidraw file soon after the device.
    usleep 500000
}

# begin PLACE:MODEL: starts an emulated device and writes its scene. Sets $place and $model.
begin() {
    place=${1%%:*}
    model=${1##*:}
    # A rehearsal takes any file for the firmware of the maker.
    firmware=
    [ "$model" != falcon ] || firmware=/bin/scene.toml
    emulate "$place-$model" "$model" --on "$place" --tremor 0.0005 ${firmware:+--firmware "$firmware"}
    scene "$model"
    [ -z "$firmware" ] || echo "firmware = \"$firmware\"" >>/tmp/scene.toml
}

# hold TICKS [ARGUMENT...]: runs the scene of the last device under the real clock, and checks that all ticks were done
# without a failure. Sets $json to the summary.
hold() {
    count=$1
    shift
    json=/out/$place-$model.json
    rm -f "$json"
    palpate run /tmp/scene.toml --clock real --duration "$((count / 1000))" --json "$json" "$@" >/tmp/said 2>&1
    status=$?
    cat /tmp/said
    clean "$json" "$status" || fail "$model on $place: palpate run ended with $status, or its summary has failures"
    ticks=$(field "$json" tick count)
    [ "$ticks" = "$count" ] || fail "$model on $place: $ticks of $count ticks"
}

# Ends the emulator as Ctrl-C does, and waits for its last words.
end_emulator() {
    kill -INT "$emulator"
    wait "$emulator"
    cat "$said.said"
}

# scene MODEL: writes the scene of a device at $connect.
scene() { sed "s|MODEL|$1|; s|CONNECT|$connect|" /bin/scene.toml >/tmp/scene.toml; }

# field FILE NAME...: prints the value of a field of a JSON file that is printed one field a line, below the named tables.
field() {
    file=$1
    shift
    awk -v path="$*" '
        BEGIN { n = split(path, names, " "); at = 1 }
        index($0, "\"" names[at] "\":") {
            if (at == n) { sub(/^[^:]*: */, ""); sub(/,$/, ""); print; exit }
            at++
        }' "$file"
}

# clean FILE STATUS: whether a run that ended with a status has a summary without failures. Where time is not counted,
# another program on the computer may keep the device from its states: their number means nothing there.
clean() {
    [ -s "$1" ] || return 1
    found=$(awk '/"failures": \[\]/ { exit } /"failures": \[/ { on = 1; next } on && /\]/ { exit } on' "$1")
    if [ "$COUNTED" = no ]; then
        found=$(echo "$found" | grep -v "gave no usable reading")
    elif [ "$2" != 0 ]; then
        return 1
    fi
    [ -z "$found" ] && [ "$2" -le 1 ]
}

# figures FILE NAME: prints the distributions of a run in microseconds, one number a line.
figures() {
    for times in lateness duration read compute write motion_to_force; do
        for quantile in p50 p99 p99_9 max; do
            value=$(field "$1" "$times" "$quantile")
            awk -v name="$2 $times $quantile" -v value="${value:-absent}" \
                'BEGIN { if (value + 0 > 0) printf "%s %.2f us\n", name, value * 1e6 }'
        done
    done
}
