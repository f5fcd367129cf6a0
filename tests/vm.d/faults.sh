# Faults of an emulated device of the firmware protocol, and of the program, over each transport.
# $FAULTED: the transports, as `palpate device emulate --on` names them. $ROUNDS: how often each fault is made, each time at another moment. $COUNTED: whether time is counted. Where it is not,
# another program on the computer may keep the machine from its ticks, so their number means nothing.
. /bin/common.sh
. /bin/settings

# Starts a run of $1 seconds in the background; its summary goes to $2, and its log to /tmp/run.mcap.
start_run() {
    rm -f "$2" /tmp/run.mcap
    palpate run /tmp/scene.toml --clock real --duration "$1" --json "$2" --log /tmp/run.mcap >/tmp/run.said 2>&1 &
    run=$!
}

# Ends a run, and checks that all of it was done without a failure, that less than 1 mJ came out at the hand, and that
# nothing is lost in the log: its ticks, computed again, are the same bit for bit.
end_run() {
    wait "$run"
    status=$?
    clean "$1" "$status" || {
        fail "$what: palpate run ended with $status, or its summary has failures"
        cat /tmp/run.said
    }
    net=$(field "$1" energy most_out)
    awk -v net="${net:-absent}" 'BEGIN { exit !(net != "absent" && net < 0.001) }' || fail "$what: net energy ${net:-absent} J"
    palpate run --replay /tmp/run.mcap >/tmp/replay.said 2>&1 || {
        fail "$what: the log does not replay"
        cat /tmp/replay.said
    }
}

# Ends the emulator in mid-push. A device on uhid, a pty or a socket goes with its process. A gadget on USB belongs to the
# kernel, and the emulator pulls it out as it ends.
unplug() {
    signal=KILL
    [ "$place" != usb ] || signal=INT
    kill -"$signal" "$emulator"
}

# Stops a process for 0.3 s.
hold_up() {
    kill -STOP "$1"
    usleep 300000
    kill -CONT "$1"
}

# Sleeps for a time between 1 and 1.5 s, another one in each round. A run has begun by then.
sleep_some() { usleep $((1000000 + (round * 317033) % 500000)); }

# The watchdog of the device let go, at once: its loop looks every 50 us. Where time is not counted, a device on a busy
# computer may not have been given a force at all.
let_go() {
    line=$(grep -o "the watchdog let go .*" "$said.said")
    echo "$line" | awk -v counted="$COUNTED" '
        $5 == "0" && counted == "no" { held = 1 }
        $5 >= 1 && $9 >= 10 && $9 <= 10.06 { held = 1 }
        END { exit !held }' ||
        fail "$what: ${line:-nothing was said of the watchdog}"
}

# without_reading FILE LEAST: checks that a number of ticks had no reading.
without_reading() {
    missed=$(field "$1" devices missed_reads)
    [ "$COUNTED" = no ] || [ "${missed:-0}" -ge "$2" ] || fail "$what: only $missed ticks had no reading"
}

for place in $FAULTED; do
    round=0
    while [ "$round" -lt "$ROUNDS" ]; do
        round=$((round + 1))

        what="the device is unplugged in mid-push and plugged in again, $place, $round"
        emulate unplugged touch --on "$place" --tremor 0.001
        scene touch
        start_run 3 /out/unplugged.json
        sleep_some
        unplug
        usleep 300000
        emulate again touch --on "$place" --tremor 0.001
        end_run /out/unplugged.json
        without_reading /out/unplugged.json 300
        end_emulator
        received=$(sed -n 's/.* \([0-9]*\) commands received.*/\1/p' "$said.said")
        least=200
        [ "$COUNTED" = yes ] || least=1
        [ "${received:-0}" -ge "$least" ] || fail "$what: the device that came back was given $received commands"
        echo "done: $what"

        what="the device is stopped and goes on, $place, $round"
        emulate stopped touch --on "$place" --tremor 0.001
        scene touch
        start_run 2 /out/stopped.json
        sleep_some
        hold_up "$emulator"
        end_run /out/stopped.json
        without_reading /out/stopped.json 250
        end_emulator
        echo "done: $what"

        what="palpate is stopped and goes on, $place, $round"
        emulate held touch --on "$place" --tremor 0.001
        scene touch
        start_run 2 /out/held.json
        sleep_some
        hold_up "$run"
        end_run /out/held.json
        end_emulator
        let_go
        echo "done: $what"

        what="palpate is killed, and started again, $place, $round"
        emulate killed touch --on "$place" --tremor 0.001
        scene touch
        start_run 3 /out/killed.json
        sleep_some
        kill -KILL "$run"
        wait "$run" 2>/dev/null
        usleep 100000
        start_run 1 /out/killed.json
        end_run /out/killed.json
        end_emulator
        let_go
        echo "done: $what"
    done
done
exit "$failures"
