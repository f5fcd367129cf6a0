# Devices that are held, one after the other, with figures where time is counted.
# $TICKS: number of ticks. $STRICT: the value of --strict. $COUNTED: whether time is counted, and means something.
# $DEVICES: the devices, as PLACE:MODEL.
. /bin/common.sh
. /bin/settings
for device in $DEVICES; do
    place=${device%%:*}
    model=${device##*:}
    firmware=
    [ "$model" != falcon ] || firmware=/bin/scene.toml
    emulate "$place-$model" "$model" --on "$place" --tremor 0.0005 ${firmware:+--firmware "$firmware"}
    scene "$model"
    # A rehearsal takes any file for the firmware of the maker.
    [ -z "$firmware" ] || echo "firmware = \"$firmware\"" >>/tmp/scene.toml
    json=/out/$place-$model.json
    palpate run /tmp/scene.toml --clock real --strict="$STRICT" --duration "$((TICKS / 1000))" --json "$json" >/tmp/said 2>&1
    status=$?
    cat /tmp/said
    clean "$json" "$status" || fail "$model on $place: palpate run ended with $status, or its summary has failures"
    ticks=$(field "$json" tick count)
    [ "$ticks" = "$TICKS" ] || fail "$model on $place: $ticks of $TICKS ticks"
    if [ "$COUNTED" = yes ]; then
        missed=$(field "$json" tick missed_deadlines)
        [ "$missed" = 0 ] || fail "$model on $place: $missed missed deadlines"
        figures "$json" "$place $model" | tee -a /out/figures
    fi
    end_emulator
done
exit "$failures"
