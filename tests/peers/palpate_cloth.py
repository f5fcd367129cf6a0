"""Palpate: the cloth of `mujoco_cloth.py`, at several tolerances: `palpate_cloth.py PALPATE SCENE FOLDER`."""

import csv
import json
import os
import pathlib
import subprocess
import sys

DURATION = 1.0
TOLERANCES = [1e-6, 1e-4, 1e-3]


def spent(palpate, scene, tolerance, duration, *more):
    """Processor time of a run (s), of all its threads."""
    command = [palpate, "run", scene, "--duration", str(duration), *more]
    command += ["--set", "body[0].self_contact=false", "--set", f"host.tolerance={tolerance}"]
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    if status:
        raise SystemExit(f"{command}: status {status}")
    return usage.ru_utime + usage.ru_stime


def run(palpate, scene, folder, tolerance):
    told, table = folder / "palpate_cloth.json", folder / "palpate_cloth.csv"
    # A run begins with the equilibrium under weight, which is no part of the second.
    second = spent(palpate, scene, tolerance, DURATION, "--json", told, "--csv", table)
    second -= spent(palpate, scene, tolerance, 0.01)
    found = json.loads(told.read_text())
    with table.open() as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    depth = next(name for name in rows[0] if name.endswith("_depth_m"))
    contacts = next(name for name in rows[0] if name.endswith("_contacts"))
    host = found["host"]
    return {
        "program": f"Palpate {found['machine']['version']}",
        "setting": f"tolerance {tolerance:g}, steps of 4 ms",
        "triangles": host["elements"],
        "median_ms": 1e3 * host["solve"]["p50"],
        "worst_ms": 1e3 * host["solve"]["max"],
        # The ticks, their records and the background factors are in it.
        "second_ms": 1e3 * second / DURATION,
        "deepest_um": 1e6 * max(pair["depth"] for pair in found["contact"]["pairs"]),
        "mean_um": 1e6 * sum(float(row[depth]) for row in rows) / len(rows),
        "end_um": 1e6 * float(rows[-1][depth]),
        "contacts": int(rows[-1][contacts]),
    }


def main():
    palpate, scene, folder = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
    for tolerance in TOLERANCES:
        print(json.dumps(run(palpate, scene, folder, tolerance)), flush=True)


main()
