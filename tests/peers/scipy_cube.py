"""The textbook's corotational step in NumPy and SciPy: assembled, factorized by SuperLU in each step.

No program of its own, but the same equation as Palpate's step, written independently: the forces have to agree.
"""

import numpy as np
import scipy
import scipy.sparse as sp
from scipy.sparse.linalg import splu

import cube


class Step:
    """Implicit Euler with one linearization, the stiffness turned with each tetrahedron."""

    def __init__(self, mesh):
        self.mesh = mesh
        b = np.zeros((len(mesh.cells), 6, 12))
        for a in range(4):
            gx, gy, gz = mesh.gradient[:, a].T
            for row, column, value in [
                (0, 0, gx), (1, 1, gy), (2, 2, gz), (3, 0, gy), (3, 1, gx),
                (4, 1, gz), (4, 2, gy), (5, 0, gz), (5, 2, gx),
            ]:  # fmt: skip
                b[:, row, 3 * a + column] = value
        law = np.zeros((6, 6))
        law[:3, :3] = cube.LAMBDA
        law += cube.MU * np.diag([2, 2, 2, 1, 1, 1])
        stiffness = np.einsum("e,eki,kl,elj->eij", mesh.volume, b, law, b)
        self.stiffness = stiffness.reshape(-1, 4, 3, 4, 3)
        dofs = (3 * mesh.cells[:, :, None] + np.arange(3)).reshape(-1, 12)
        size = mesh.positions.size
        rows, columns = np.repeat(dofs, 12, axis=1).ravel(), np.tile(dofs, (1, 12)).ravel()
        # Where each entry of each tetrahedron goes in the assembled matrix's values.
        pattern = sp.csc_matrix((np.ones(len(rows)), (rows, columns)), shape=(size, size))
        pattern.sort_indices()
        key = pattern.indices + size * np.repeat(np.arange(size), np.diff(pattern.indptr))
        self.place = np.searchsorted(key, rows + size * columns)
        self.pattern = pattern
        self.unknown = (3 * mesh.free[:, None] + np.arange(3)).ravel()
        self.mass = np.repeat(mesh.mass, 3)
        self.x, self.v = mesh.positions.copy(), np.zeros_like(mesh.positions)

    def take(self, moves):
        mesh, h = self.mesh, cube.STEP
        r = rotations = cube.rotations(mesh.deformation(self.x))
        turned = np.einsum("eij,eajbk,elk->eaibl", rotations, self.stiffness, r)
        entries = turned.reshape(-1)
        values = np.bincount(self.place, entries, minlength=self.pattern.nnz)
        k = sp.csc_matrix((values, self.pattern.indices, self.pattern.indptr), self.pattern.shape)
        back = np.einsum("eji,eaj->eai", r, self.x[mesh.cells]) - mesh.positions[mesh.cells]
        force = np.zeros_like(self.x)
        local = np.einsum("eaibj,ebj->eai", self.stiffness, back)
        np.add.at(force, mesh.cells, -np.einsum("eij,eaj->eai", r, local))
        mass_factor = 1 / h**2 + cube.MASS_DAMPING / h
        a = k * (1 + cube.STIFFNESS_DAMPING / h) + sp.diags(mass_factor * self.mass, format="csc")
        u = np.zeros(self.x.size)
        u.reshape(-1, 3)[mesh.top] = moves
        right = (self.mass * self.v.ravel() / h + force.ravel() - a @ u)[self.unknown]
        inner = a[self.unknown][:, self.unknown].tocsc()
        u[self.unknown] = splu(inner, "MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(right)
        self.x += u.reshape(-1, 3)
        self.v = u.reshape(-1, 3) / h


def press(mesh):
    body = Step(mesh)
    times, forces = [], []
    for step in range(cube.STEPS):
        down = cube.depth(step) - cube.depth(step + 1)
        times.append(cube.timed(lambda: body.take([0, 0, down])))
        forces.append(mesh.force_on_top(body.x, cube.corotational))
    return times, forces[: cube.MOVING], forces[-1]


def main():
    for n in cube.sizes():
        mesh = cube.Mesh(n)
        rest = cube.force_at_rest(n, cube.corotational)
        name = "SuperLU in each step"
        cube.report(f"SciPy {scipy.__version__}", name, name, "corotational", mesh, *press(mesh), rest)


main()
