# Two devices of one kind at once, as a person with two hands holds them.
# $PAIRS: the kinds, as PLACE:MODEL. $PAIR_TICKS: number of ticks.
. /bin/common.sh
. /bin/settings
for device in $PAIRS; do
    place=${device%%:*}
    model=${device##*:}
    firmware=
    [ "$model" != falcon ] || firmware=/bin/pair.toml
    cp /bin/pair.toml /tmp/scene.toml
    both=
    for hand in left right; do
        emulate "$hand" "$model" --on "$place" --serial "$hand" --tremor 0.0005 ${firmware:+--firmware "$firmware"}
        both="$both $emulator:$said"
        {
            echo "[[device]]"
            echo "name = \"$hand\""
            echo "model = \"$model\""
            echo "connect = \"$connect\""
            [ -z "$firmware" ] || echo "firmware = \"$firmware\""
            echo 'engage = { arm = "start" }'
        } >>/tmp/scene.toml
    done
    hold "$PAIR_TICKS" --strict=syscalls
    missed=$(field "$json" tick missed_deadlines)
    [ "$missed" = 0 ] || fail "two of $model on $place: $missed missed deadlines"
    for one in $both; do
        emulator=${one%%:*} said=${one#*:}
        end_emulator
    done
done
exit "$failures"
