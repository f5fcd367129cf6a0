# Devices that are held, one after the other, with figures where time is counted.
# $TICKS: number of ticks. $STRICT: the value of --strict. $COUNTED: whether time is counted, and means something.
# $DEVICES: the devices, as PLACE:MODEL.
. /bin/common.sh
. /bin/settings
for device in $DEVICES; do
    begin "$device"
    hold "$TICKS" --strict="$STRICT"
    calls=$(field "$json" tick allocator_calls)
    [ "$calls" = 0 ] || fail "$model on $place: the tick called the allocator ${calls:-an unknown number of} times"
    if [ "$COUNTED" = yes ]; then
        missed=$(field "$json" tick missed_deadlines)
        [ "$missed" = 0 ] || fail "$model on $place: $missed missed deadlines"
        figures "$json" "$place $model" | tee -a /out/figures
    fi
    end_emulator
done
exit "$failures"
