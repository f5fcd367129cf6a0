"""The cube that every program compresses: mesh, motion, laws, and the equilibrium force under each law.

10 cm, 1 kg, E = 20 kPa, nu = 0.3, Rayleigh damping by mass 0.1 and by stiffness 0.1, no gravity, bonded to two
plates. The upper plate moves down by a tenth in 0.5 s and rests for 1.5 s, in steps of 10 ms. This is the scene
"press" of `palpate bench speed --quick`.
"""

import argparse
import json
import time

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

EDGE, YOUNG, POISSON, DENSITY = 0.1, 2e4, 0.3, 1000.0
MASS_DAMPING, STIFFNESS_DAMPING = 0.1, 0.1
STEP, MOVING, STEPS = 0.01, 50, 200
PRESS = 0.1 * EDGE
MU = YOUNG / (2 * (1 + POISSON))
LAMBDA = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))


def depth(step):
    """Displacement of the plate after a number of steps (m)."""
    return PRESS * min(step / MOVING, 1.0)


class Mesh:
    """n x n x n grid cells, each cut into six tetrahedra around the same diagonal."""

    def __init__(self, n):
        self.n = n
        grid = np.arange(n + 1)
        z, y, x = np.meshgrid(grid, grid, grid, indexing="ij")
        place = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
        self.positions = EDGE * (place / n - 0.5)
        number = lambda p: (p[2] * (n + 1) + p[1]) * (n + 1) + p[0]
        cells = []
        for corner in np.ndindex(n, n, n):
            for path in [(0, 1, 2), (1, 2, 0), (2, 0, 1), (1, 0, 2), (0, 2, 1), (2, 1, 0)]:
                at = np.array(corner[::-1])
                cell = [number(at)]
                for axis in path:
                    at = at + np.eye(3, dtype=int)[axis]
                    cell.append(number(at))
                odd = path in [(1, 0, 2), (0, 2, 1), (2, 1, 0)]
                cells.append([cell[0], cell[2], cell[1], cell[3]] if odd else cell)
        self.cells = np.array(cells)
        self.bottom = np.flatnonzero(place[:, 2] == 0)
        self.top = np.flatnonzero(place[:, 2] == n)
        self.free = np.flatnonzero((place[:, 2] > 0) & (place[:, 2] < n))
        edges = self.positions[self.cells[:, 1:]] - self.positions[self.cells[:, :1]]
        edges = edges.transpose(0, 2, 1)  # columns
        self.volume = np.linalg.det(edges) / 6
        assert (self.volume > 0).all()
        inverse = np.linalg.inv(edges)
        # Gradients of the four shape functions, one per row.
        self.gradient = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        self.mass = np.zeros(len(self.positions))
        np.add.at(self.mass, self.cells, np.repeat(self.volume[:, None] * DENSITY / 4, 4, axis=1))

    def deformation(self, x):
        return np.einsum("eai,eaj->eij", x[self.cells], self.gradient)

    def element_forces(self, x, stress):
        """Elastic forces on the vertices of each tetrahedron (N), from the first Piola-Kirchhoff stress of a law."""
        p = stress(self.deformation(x))
        return -np.einsum("e,eij,eaj->eai", self.volume, p, self.gradient)

    def forces(self, x, stress):
        total = np.zeros_like(x)
        np.add.at(total, self.cells, self.element_forces(x, stress))
        return total

    def force_on_top(self, x, stress):
        """Force of the cube on the plate (N)."""
        return self.forces(x, stress)[self.top, 2].sum()


def rotations(f):
    u, _, vt = np.linalg.svd(f)
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    return u @ vt


def corotational(f):
    r = rotations(f)
    trace = np.einsum("eij,eij->e", r, f) - 3
    return 2 * MU * (f - r) + LAMBDA * trace[:, None, None] * r


def neo_hookean(f):
    """Stable Neo-Hookean without the barrier (Smith, de Goes and Kim, 2018), as in Newton."""
    bulk = LAMBDA + MU
    alpha = 1 + MU / bulk
    columns = [f[:, :, k] for k in range(3)]
    cofactor = np.stack([np.cross(columns[(k + 1) % 3], columns[(k + 2) % 3]) for k in range(3)], axis=2)
    return MU * f + (bulk * (np.linalg.det(f) - alpha))[:, None, None] * cofactor


def saint_venant_kirchhoff(f):
    strain = 0.5 * (f.transpose(0, 2, 1) @ f - np.eye(3))
    trace = np.trace(strain, axis1=1, axis2=2)
    return f @ (2 * MU * strain + LAMBDA * trace[:, None, None] * np.eye(3))


def force_at_rest(n, stress):
    """The force of the compressed cube in equilibrium (N): Newton's method, tangents by central differences."""
    mesh = Mesh(n)
    x = mesh.positions.copy()
    x[:, 2] -= PRESS * (x[:, 2] / EDGE + 0.5)
    unknown = (3 * mesh.free[:, None] + np.arange(3)).ravel()
    dofs = (3 * mesh.cells[:, :, None] + np.arange(3)).reshape(len(mesh.cells), 12)
    rows, columns = np.repeat(dofs, 12, axis=1).ravel(), np.tile(dofs, (1, 12)).ravel()
    for _ in range(20):
        force = mesh.forces(x, stress).ravel()[unknown]
        if np.linalg.norm(force) < 1e-9:
            break
        tangent = np.empty((len(mesh.cells), 12, 12))
        corners = x[mesh.cells]
        for k in range(12):
            small = np.zeros((4, 3))
            small[k // 3, k % 3] = 1e-7
            ends = []
            for sign in (1, -1):
                f = np.einsum("eai,eaj->eij", corners + sign * small, mesh.gradient)
                ends.append(-np.einsum("e,eij,eaj->eai", mesh.volume, stress(f), mesh.gradient))
            tangent[:, :, k] = ((ends[1] - ends[0]) / 2e-7).reshape(-1, 12)
        matrix = sp.csc_matrix((tangent.ravel(), (rows, columns)), shape=(x.size, x.size))
        matrix = matrix[unknown][:, unknown]
        x.ravel()[unknown] += splu(matrix.tocsc()).solve(force)
    return mesh.force_on_top(x, stress)


def sizes():
    """Grid cells along the edge, from the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cells", type=int, nargs="+", default=[6, 8, 10])
    return parser.parse_args().cells


def report(program, setting, strictest, law, mesh, times, moving, end, rest):
    """One line for the table: processor times of all steps (s), elastic force on the plate after each step in which it
    moves, at the end, and in equilibrium by the same law (N). `strictest`: the reference setting for the errors."""
    times = np.sort(times[:MOVING])
    line = {
        "program": program,
        "setting": setting,
        "strictest": strictest,
        "law": law,
        "tetrahedra": len(mesh.cells),
        "median_ms": 1e3 * times[(len(times) - 1) // 2],
        "worst_ms": 1e3 * times[-1],
        "moving": moving,
        "force": end,
        "at_rest": rest,
    }
    print(json.dumps(line), flush=True)


def timed(step):
    """Processor time of a call (s), of all threads."""
    start = time.process_time()
    step()
    return time.process_time() - start
