"""Makes the meshes of this folder: the unit square in N cells a side, by Gmsh's algorithms and from random points.

    pip install gmsh==4.15.2 numpy scipy && python3 make.py
"""

import gmsh
import numpy as np
from scipy.spatial import Delaunay

ALGORITHMS = {"meshadapt": 1, "delaunay": 5, "frontal": 6}


def by_gmsh(cells, algorithm):
    gmsh.initialize()
    gmsh.option.setNumber("General.Verbosity", 0)
    gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.Algorithm", algorithm)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 1 / cells)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1 / cells)
    gmsh.model.mesh.generate(2)
    tags, points, _ = gmsh.model.mesh.getNodes()
    place = {tag: number for number, tag in enumerate(tags)}
    triangles = gmsh.model.mesh.getElements(2)[2][0]
    triangles = np.array([place[tag] for tag in triangles]).reshape(-1, 3)
    gmsh.finalize()
    return points.reshape(-1, 3)[:, :2], triangles


def by_random_points(cells, seed=13):
    """Points inside at least 0.55 cells apart, half a cell from the border; their Delaunay triangulation."""
    random = np.random.default_rng(seed)
    size = 1 / cells
    side = np.linspace(0, 1, cells + 1)
    points = [[s, end] for end in (0, 1) for s in side]
    points += [[end, s] for end in (0, 1) for s in side[1:-1]]
    border, inside = len(points), (cells - 1) ** 2
    for _ in range(60 * inside):
        point = random.random(2) * (1 - size) + size / 2
        if len(points) == border + inside:
            break
        if all(np.hypot(*(point - other)) > 0.55 * size for other in points[border:]):
            points.append(list(point))
    points = np.array(points)
    return points, Delaunay(points).simplices


def write(name, points, triangles):
    used = np.unique(triangles)
    number = {vertex: index + 1 for index, vertex in enumerate(used)}
    with open(name, "w") as file:
        for x, y in points[used]:
            file.write(f"v {x:.6g} {y:.6g} 0\n")
        for a, b, c in triangles:
            (ax, ay), (bx, by), (cx, cy) = points[[a, b, c]]
            if (bx - ax) * (cy - ay) < (by - ay) * (cx - ax):
                b, c = c, b
            file.write(f"f {number[a]} {number[b]} {number[c]}\n")


for cells in (8, 16):
    for name, algorithm in ALGORITHMS.items():
        write(f"{name}_{cells}.obj", *by_gmsh(cells, algorithm))
for cells in (8, 16, 32):
    write(f"random_points_{cells}.obj", *by_random_points(cells))
