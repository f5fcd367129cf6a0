#!/usr/bin/env python3
"""Makes pull_left.csv and pull_right.csv: two hands that pull a sheet apart and let it return.

No hand was recorded for these files. They stand in for a recording, and are built to be irregular as a
hand is: point-to-point movements between waypoints (minimum jerk, Flash and Hogan 1985) with uneven
pauses and overshoot, plus slow wander on all axes, then a low-pass filter. Each file is the displacement
(m) of one hand relative to its start, at 100 Hz for 8 s. Run it here to write both files again, byte for
byte; it prints their peaks, top speeds and what part of the movement lies above 5 Hz.

Standard library only: python3 make_hands.py
"""

import cmath
import math
import random
from pathlib import Path

RATE = 100  # samples per second
DURATION = 8.0  # s
SAMPLES = int(RATE * DURATION) + 1
SIGMA = 0.08  # s, of the Gaussian low-pass filter: it passes 4 % at 5 Hz
REACH = int(3 * SIGMA * RATE)  # the filter's reach to either side, in samples
REST = 0.5  # s without movement at either end, before the filter
RESOLUTION = 1e-5  # m, what the files are rounded to

# Outward displacement (mm) of each hand and the time (s) at which it gets there. Equal neighbours are
# pauses; a peak before a lower plateau is overshoot, and so is the dip below zero on the way back.
WAYPOINTS = {
    "left": [
        (0.5, 0.0), (1.3, 4.6), (1.6, 4.1), (2.1, 4.1), (3.0, 9.4), (3.3, 8.8), (3.7, 8.8), (4.4, 12.3),
        (4.75, 11.5), (5.3, 11.5), (6.1, 5.2), (6.4, 5.2), (7.05, -0.7), (7.5, 0.0),
    ],
    "right": [
        (0.6, 0.0), (1.35, 3.7), (1.65, 3.4), (2.25, 3.4), (3.05, 8.7), (3.4, 8.1), (3.6, 8.1), (4.5, 12.5),
        (4.85, 11.8), (5.2, 11.8), (6.2, 4.4), (6.55, 4.4), (7.1, -0.5), (7.5, 0.0),
    ],
}
SEEDS = {"left": 20170614, "right": 20170615}
OUTWARD = {"left": -1.0, "right": 1.0}


def minimum_jerk(u):
    """From 0 to 1 with no speed and no acceleration at either end."""
    u = min(max(u, 0.0), 1.0)
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))


def along(waypoints, t):
    """The displacement (mm) at time t (s)."""
    (before, here), *rest = waypoints
    for at, there in rest:
        if t < at:
            return here + (there - here) * minimum_jerk((t - before) / (at - before))
        before, here = at, there
    return here


def wander(rng, amplitude):
    """A sum of twelve slow sines of random frequency and phase as a function of time, in mm."""
    parts = []
    for _ in range(12):
        frequency = 0.15 + 3.35 * rng.random() ** 2
        parts.append((1.0 / (1.0 + 2.0 * frequency), frequency, 2.0 * math.pi * rng.random()))
    scale = amplitude / math.sqrt(sum(a * a for a, _, _ in parts))
    return lambda t: scale * sum(a * math.sin(2.0 * math.pi * f * t + p) for a, f, p in parts)


def still_at_ends(t):
    """Zero during the rest at either end, one in between, smooth in 0.8 s."""
    return minimum_jerk((t - REST) / 0.8) * minimum_jerk((DURATION - REST - t) / 0.8)


def low_pass(values):
    """A Gaussian filter; beyond its ends a movement stays where it starts and stops."""
    kernel = [math.exp(-0.5 * (k / (SIGMA * RATE)) ** 2) for k in range(-REACH, REACH + 1)]
    total = math.fsum(kernel)
    held = [values[0]] * REACH + values + [values[-1]] * REACH
    return [
        math.fsum(w * v for w, v in zip(kernel, held[i : i + len(kernel)])) / total
        for i in range(len(values))
    ]


def hand(side):
    """The three axes of one hand (m), each a list of samples."""
    rng = random.Random(SEEDS[side])
    pull = WAYPOINTS[side]
    sway = [wander(rng, amplitude) for amplitude in (0.25, 1.5, 1.2)]
    times = [i / RATE for i in range(SAMPLES)]
    axes = [[sway[axis](t) * still_at_ends(t) for t in times] for axis in range(3)]
    axes[0] = [OUTWARD[side] * (along(pull, t) + x) for t, x in zip(times, axes[0])]
    return [[1e-3 * v for v in low_pass(axis)] for axis in axes]


def text(value):
    """A length in metres, rounded; no minus sign before zero."""
    steps = round(value / RESOLUTION)
    return f"{steps * RESOLUTION:.5f}" if steps else "0.00000"


def above_5_hz(values):
    """The amplitude of what lies above 5 Hz, over that of the whole movement (root mean squares)."""
    n = len(values)
    mean = math.fsum(values) / n
    power = [
        abs(sum((v - mean) * cmath.exp(-2j * math.pi * k * i / n) for i, v in enumerate(values))) ** 2
        for k in range(1, n // 2)
    ]
    high = sum(p for k, p in enumerate(power, start=1) if k * RATE / n > 5.0)
    return math.sqrt(high / sum(power))


def main():
    for side in ("left", "right"):
        axes = hand(side)
        rows = [",".join([f"{i / RATE:.2f}", *map(text, p)]) for i, p in enumerate(zip(*axes))]
        head = [
            f"# The {side} hand pulls a sheet apart and returns: displacement (m) relative to its start.",
            "# Not a recording: made by make_hands.py, seed " + str(SEEDS[side]) + "; see README.md.",
            "time,x,y,z",
        ]
        path = Path(__file__).resolve().parent / f"pull_{side}.csv"
        path.write_text("\n".join(head + rows) + "\n", encoding="ascii", newline="\n")

        written = [[float(row.split(",")[1 + axis]) for row in rows] for axis in range(3)]
        peaks = ", ".join(f"{n} {1e3 * max(v, key=abs):.2f}" for n, v in zip("xyz", written))
        top = max(math.dist(a, b) for a, b in zip(zip(*axes), list(zip(*axes))[1:])) * RATE
        high = max(map(above_5_hz, written))
        print(
            f"{path.name}: {len(rows)} samples, peaks (mm) {peaks}; "
            f"top speed {1e3 * top:.1f} mm/s; above 5 Hz {100 * high:.2f} %"
        )


if __name__ == "__main__":
    main()
