"""ipctk: candidates of its broad phases and their distances, on the meshes and motions that Palpate wrote.

`tests/detection` writes the files (its `dump.rs` names them). A motion has 24 steps. A pair is found if it is nearer than
1 mm. Both programs find vertex-face and edge-edge pairs; the table says what each finds that the other does not.
"""

import json
import pathlib
import sys
import time

import ipctk
import numpy as np

NEED = 1e-3
# Distances differ by rounding: pairs this near to NEED may be of one set only (m).
ROUNDING = 1e-9
BROAD = [("hash grid", ipctk.HashGrid), ("LBVH", ipctk.LBVH), ("sweep and prune", ipctk.SweepAndPrune)]


class Scene:
    """The files of a motion."""

    def __init__(self, folder, name):
        read = lambda kind, dtype, width: np.fromfile(folder / f"{name}.{kind}", dtype).reshape(-1, width)
        self.name = name
        self.parts = read("parts", "<u4", 3)
        self.triangles = np.asfortranarray(read("triangles", "<u4", 3), dtype=np.int32)
        self.edges = np.asfortranarray(read("edges", "<u4", 2), dtype=np.int32)
        vertices = int(self.parts[:, 1].max())
        self.x = [np.asfortranarray(x) for x in np.fromfile(folder / f"{name}.x", "<f8").reshape(-1, vertices, 3)]
        self.pairs = read("pairs", "<u4", 4)
        self.times = np.fromfile(folder / f"{name}.times", "<f8")

    def mesh(self):
        mesh = ipctk.CollisionMesh(self.x[0], self.edges, self.triangles)
        if not self.parts[:, 2].all():
            # Two sheets that touch each other, not themselves.
            mesh.can_collide = ipctk.make_connected_components_filter(self.triangles)
        return mesh


def timed(call):
    start = time.process_time()
    call()
    return time.process_time() - start


def of_method(scene, label, method):
    mesh, broad = scene.mesh(), method()
    seconds, candidate_count, theirs = [], [], set()
    for step, x in enumerate(scene.x):
        candidates = ipctk.Candidates()
        seconds.append(timed(lambda: candidates.build(mesh, x, 0.5 * NEED, broad)))
        candidate_count.append(len(candidates))
        for kind, found in ((0, candidates.fv_candidates), (1, candidates.ee_candidates)):
            for one in found:
                ends = (one.vertex_id, one.face_id) if kind == 0 else sorted((one.edge0_id, one.edge1_id))
                squared = one.compute_distance(x, scene.edges, scene.triangles)
                theirs.add((step, kind, *ends, squared**0.5))
    # The library's contacts within the distance: what its barrier would act on.
    collisions = ipctk.NormalCollisions()
    contacts = [timed(lambda: collisions.build(mesh, x, NEED, 0, broad)) for x in scene.x]
    ours = {tuple(int(n) for n in row) for row in scene.pairs}
    near = {one[:4] for one in theirs if one[4] <= NEED - ROUNDING}
    all_theirs = {one[:4] for one in theirs if one[4] <= NEED + ROUNDING}
    return {
        "scene": scene.name,
        "triangles": len(scene.triangles),
        "method": f"ipctk {ipctk.__version__}, {label}",
        "candidates_ms": 1e3 * float(np.median(seconds)),
        "contacts_ms": 1e3 * float(np.median(contacts)),
        "candidates": int(np.median(candidate_count)),
        "pairs": len(near),
        "ours_ms": 1e3 * float(np.median(scene.times[2:])),
        "ours": len(ours),
        "missed_by_ours": len(near - ours),
        "missed_by_theirs": len(ours - all_theirs),
    }


def main():
    folder = pathlib.Path(sys.argv[1])
    ipctk.set_num_threads(1)
    for name in ("rigid_turn", "torsion", "jump", "fold", "poke"):
        scene = Scene(folder, name)
        for label, method in BROAD:
            print(json.dumps(of_method(scene, label, method)), flush=True)


main()
