# Devices that are held while other programs of ordinary priority keep the processor busy, with figures. The time of a
# transport whose bytes pass a thread of the kernel with ordinary priority depends on them.
# $LOADED: the devices, as PLACE:MODEL. $LOAD_TICKS: number of ticks.
. /bin/common.sh
. /bin/settings

# Two programs compute, and a third copies memory through the kernel.
begin_load() {
    (while :; do :; done) &
    load=$!
    (while :; do :; done) &
    load="$load $!"
    (while :; do dd if=/dev/zero of=/tmp/copy bs=64k count=16 2>/dev/null; done) &
    load="$load $!"
}

for device in $LOADED; do
    for with in idle busy; do
        begin "$device"
        [ "$with" = idle ] || begin_load
        hold "$LOAD_TICKS"
        [ "$with" = idle ] || kill -KILL $load
        figures "$json" "$place $model $with" | tee -a /out/load
        missed=$(field "$json" devices missed_reads)
        echo "$place $model $with ticks without a state: ${missed:-unknown} of $LOAD_TICKS" | tee -a /out/load
        missed=$(field "$json" tick missed_deadlines)
        [ "$missed" = 0 ] || fail "$model on $place, $with: $missed missed deadlines"
        end_emulator
    done
done
exit "$failures"
