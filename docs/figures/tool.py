"""Draws the force of a tool over time: by the tick, beside a host that steps in every tick, and that force held between messages.

    palpate run host/scenes/touch.toml --csv tick.csv
    palpate run host/scenes/touch.toml --csv every.csv --set host.step_rate=1000 --set host.publish_rate=1000 --set host.latency=0
    python3 docs/figures/tool.py tick.csv every.csv ball x 0.3 3.3 rub.svg

The last command draws the force of the tool `ball` along x from 0.3 to 3.3 s. The force that is held is that of `every.csv` as a
host of 60 Hz and a latency of 4 ms would send it.
"""

import csv
import math
import sys

RATE, LATENCY = 60, 0.004
WIDTH, HEIGHT = 800, 320
LEFT, RIGHT, TOP, BOTTOM = 64, 784, 48, 272


def force(path, tool, axis):
    """Times (s) and forces (N) of the ticks."""
    with open(path, encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return [(float(row["time_s"]), float(row[f"{tool}_force_{axis}_N"])) for row in rows]


def held(points):
    """The corners of the last force that the host has sent."""
    tick = points[1][0]
    corners = [(0.0, 0.0)]
    for message in range(math.floor(points[-1][0] * RATE) + 1):
        time, value = points[math.floor(message / RATE / tick)]
        corners += [(time + LATENCY, corners[-1][1]), (time + LATENCY, value)]
    return corners


def round_numbers(least, most):
    """Some round numbers between two numbers."""
    step = 10 ** math.floor(math.log10((most - least) / 2))
    step *= next(factor for factor in (1, 2, 5, 10) if (most - least) / (factor * step) < 8)
    return [step * k for k in range(math.ceil(least / step), math.floor(most / step) + 1)]


def text(x, y, anchor, words):
    """A label."""
    font = 'font-family="DejaVu Sans, Helvetica, Arial, sans-serif" font-size="12"'
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="#222222" {font}>{words}</text>'


def way(points, colour, width):
    """A line through points, without those on a level stretch."""
    points = [(f"{x:.1f}", f"{y:.1f}") for x, y in points]
    beside = zip([(None, None), *points], points, [*points[1:], (None, None)])
    kept = [point for before, point, after in beside if not before[1] == point[1] == after[1]]
    corners = " ".join(",".join(point) for point in kept)
    return f'<polyline fill="none" stroke="{colour}" stroke-width="{width}" points="{corners}"/>'


def draw(curves, axis, start, end):
    """The picture of curves, each with name, colour, width (px) and points."""
    curves = [(*curve, [point for point in points if start <= point[0] <= end]) for *curve, points in curves]
    values = [value for *_, points in curves for _, value in points]
    room = 0.05 * (max(values) - min(values))
    low, high = min(values) - room, max(values) + room

    def place(time, value):
        across, up = (time - start) / (end - start), (value - low) / (high - low)
        return LEFT + across * (RIGHT - LEFT), BOTTOM - up * (BOTTOM - TOP)

    size = f'width="{WIDTH}" height="{HEIGHT}"'
    lines = [
        f'<svg {size} viewBox="0 0 {WIDTH} {HEIGHT}" stroke-linejoin="round" xmlns="http://www.w3.org/2000/svg">',
        f'<rect {size} fill="#FFFFFF"/>',
    ]
    for value in round_numbers(low, high):
        y = place(start, value)[1]
        lines += [way([(LEFT, y), (RIGHT, y)], "#E4E4E4", 1), text(LEFT - 8, y + 4, "end", f"{value:.3g}")]
    for time in round_numbers(start, end):
        x = place(time, low)[0]
        lines += [way([(x, TOP), (x, BOTTOM)], "#E4E4E4", 1), text(x, BOTTOM + 18, "middle", f"{time:.3g}")]
    middle = (TOP + BOTTOM) / 2
    lines += [
        text((LEFT + RIGHT) / 2, HEIGHT - 10, "middle", "Time (s)"),
        f'<g transform="rotate(270, 16, {middle})">{text(16, middle, "middle", f"Force along {axis} (N)")}</g>',
    ]
    for number, (name, colour, width, points) in enumerate(curves):
        x = LEFT + 240 * number
        lines += [
            way([(x, TOP - 24), (x + 32, TOP - 24)], colour, width),
            text(x + 40, TOP - 20, "start", name),
            way([place(*point) for point in points], colour, width),
        ]
    return "\n".join([*lines, "</svg>", ""])


def main():
    """Draws the picture that the arguments name."""
    tick, every, tool, axis, start, end, picture = sys.argv[1:]
    exact = force(every, tool, axis)
    curves = [
        ("a host in every tick", "#C0C0C0", 5, exact),
        (f"its force, held ({RATE} Hz)", "#E69F00", 1.2, held(exact)),
        (f"the tick ({RATE} Hz)", "#0072B2", 1.6, force(tick, tool, axis)),
    ]
    with open(picture, "w", encoding="utf-8") as file:
        file.write(draw(curves, axis, float(start), float(end)))


main()
