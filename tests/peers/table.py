"""One table of what every program printed: `table.py FOLDER`, for `run`."""

import json
import pathlib
import sys


def lines(folder):
    """What the peers' scripts printed."""
    for path in sorted(folder.glob("*.jsonl")):
        for text in path.read_text().splitlines():
            if text.startswith("{"):
                yield json.loads(text)


def ours(found, at_rest):
    """Palpate's rows of the same press, as the peers write theirs."""
    for row in found["cube"]:
        if row["scene"] == "press":
            yield {
                "program": "Palpate",
                "setting": row["path"],
                "law": "corotational",
                "tetrahedra": row["elements"],
                "median_ms": 1e3 * row["times"]["median"],
                "worst_ms": 1e3 * row["times"]["worst"],
                # Newton's method is its own reference.
                "motion_error": row["solver_error"] or None,
                "force": row["force"],
                "at_rest": at_rest.get(("corotational", row["elements"])),
            }


def main():
    folder = pathlib.Path(sys.argv[1])
    rows = list(lines(folder))
    at_rest = {(row["law"], row["tetrahedra"]): row["at_rest"] for row in rows}
    for row in rows:
        same = [r for r in rows if (r["program"], r["tetrahedra"]) == (row["program"], row["tetrahedra"])]
        strict = next((r for r in same if r["setting"] == row["strictest"]), row)
        pairs = zip(row["moving"], strict["moving"])
        error = max(abs(a - b) for a, b in pairs) / max(map(abs, strict["moving"]))
        row["motion_error"] = None if strict is row else error
    found = json.loads((folder / "palpate.json").read_text())
    rows += ours(found, at_rest)
    rows.sort(key=lambda row: (row["tetrahedra"], row["median_ms"]))
    machine = found["machine"]
    print(f"{machine['processor']}; small kernel {1e6 * machine['calibration']:.2f} us; one thread each.\n")
    print("| tetrahedra | program | setting | law | median ms | worst ms | error in motion | force N | off its law's |")
    print("|---|---|---|---|---|---|---|---|---|")
    share = lambda value: "" if value is None else f"{value:.1e}"
    for row in rows:
        force, rest = row["force"], row["at_rest"]
        off = None if force is None or rest is None else abs(force / rest - 1)
        force = "" if force is None else f"{force:.4f}"
        print(
            f"| {row['tetrahedra']} | {row['program']} | {row['setting']} | {row['law']} | {row['median_ms']:.2f} "
            f"| {row['worst_ms']:.2f} | {share(row['motion_error'])} | {force} | {share(off)} |"
        )


main()
