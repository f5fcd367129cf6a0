"""The tables of contact: `contact_table.py FOLDER`, for `run`."""

import json
import pathlib
import sys


def lines(path):
    if not path.exists():
        return []
    return [json.loads(text) for text in path.read_text().splitlines() if text.startswith("{")]


def main():
    folder = pathlib.Path(sys.argv[1])
    pairs = lines(folder / "ipctk_pairs.jsonl")
    if pairs:
        print("\nPairs nearer than 1 mm, 24 steps of each motion, one thread; times are medians of a step\n")
        print(
            "| scene | triangles | program | candidates ms | contacts ms | candidates | pairs "
            "| Palpate ms | Palpate's pairs | missed by Palpate | missed by the program |"
        )
        print("|---|---|---|---|---|---|---|---|---|---|---|")
        for row in pairs:
            print(
                f"| {row['scene'].replace('_', ' ')} | {row['triangles']} | {row['method']} | {row['candidates_ms']:.3f} "
                f"| {row['contacts_ms']:.3f} | {row['candidates']} | {row['pairs']} | {row['ours_ms']:.3f} | {row['ours']} "
                f"| {row['missed_by_ours']} | {row['missed_by_theirs']} |"
            )
    cloth = lines(folder / "palpate_cloth.jsonl") + lines(folder / "mujoco_cloth.jsonl")
    if cloth:
        print("\nCloth on a sphere, one thread\n")
        print("| program | setting | triangles | step, median ms | worst ms | second ms | deepest um | mean um | at the end um | contacts |")
        print("|---|---|---|---|---|---|---|---|---|---|")
        for row in cloth:
            print(
                f"| {row['program']} | {row['setting']} | {row['triangles']} | {row['median_ms']:.2f} | {row['worst_ms']:.2f} "
                f"| {row['second_ms']:.0f} | {row['deepest_um']:.1f} | {row['mean_um']:.1f} | {row['end_um']:.1f} | {row['contacts']} |"
            )


main()
