"""The stress intensities of a crack in the middle of a square sheet, by finite elements that share nothing with Palpate's.

The elements are six-node triangles in plane stress (Gmsh), whose nodes beside a tip are at the quarter points (Barsoum 1976).
The intensities are interaction integrals (Yau, Wang and Corten 1980).

    pip install gmsh numpy scipy
    python3 docs/figures/intensity.py 4 10

prints for a side of 4 cracks:

- the intensities over S sqrt(pi a), a half the crack, under a stress S across the crack, a shear stress S, and a stress S along
  the crack;
- for each angle between pull and crack the kink of the largest hoop stress, and the direction of the tear behind a kink of a
  tenth of the crack (degrees).
"""

import sys

import gmsh
import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sl

POISSON = 0.3
MATRIX = np.array([[1, POISSON, 0], [POISSON, 1, 0], [0, 0, (1 - POISSON) / 2]]) / (1 - POISSON**2)
# Points and weights of degree 5 on a triangle (Dunavant 1985).
A, B, C, D = 0.059715871789770, 0.470142064105115, 0.797426985353087, 0.101286507323456
WEIGHTS = [0.225] + [0.132394152788506] * 3 + [0.125939180544827] * 3
POINTS = [(1 / 3, 1 / 3), (A, B), (B, A), (B, B), (C, D), (D, C), (D, D)]
# The even stresses: across the crack, shear, along the crack.
LOADS = [(0, 0, 1), (0, 1, 0), (1, 0, 0)]


def mesh(side, crack, near):
    """Nodes, six-node triangles, and the tips of a crack along the points `crack`. `near`: length of the edges there."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Verbosity", 0)
    geo, half = gmsh.model.geo, side / 2
    corners = [(-half, -half), (half, -half), (half, half), (-half, half)]
    ring = [geo.addPoint(*p, 0, side / 30) for p in corners]
    stops = [geo.addPoint(*p, 0, near) for p in crack]
    loop = [geo.addLine(a, b) for a, b in zip(ring, ring[1:] + ring[:1])]
    lines = [geo.addLine(a, b) for a, b in zip(stops, stops[1:])]
    surface = geo.addPlaneSurface([geo.addCurveLoop(loop)])
    geo.synchronize()
    gmsh.model.mesh.embed(1, lines, 2, surface)
    gmsh.model.mesh.generate(2)
    gmsh.model.mesh.setOrder(2)
    tags, at, _ = gmsh.model.mesh.getNodes()
    place = {int(tag): k for k, tag in enumerate(tags)}
    at = at.reshape(-1, 3)[:, :2].copy()

    def elements(dimension, tag, nodes):
        found = gmsh.model.mesh.getElements(dimension, tag)[2][0]
        return np.array([place[int(k)] for k in found]).reshape(-1, nodes)

    tri = elements(2, surface, 6)
    along = np.vstack([elements(1, line, 3) for line in lines])
    gmsh.finalize()
    tips = [int(np.argmin(np.hypot(*(at - p).T))) for p in (crack[0], crack[-1])]
    # About each node of the crack but its tips, the triangles on one of the two sides get a copy of the node.
    edges = {frozenset(map(int, edge[:2])) for edge in along}
    outline = [set(map(int, t[:3])) for t in tri]
    for k in sorted(set(map(int, along.ravel())) - set(tips)):
        about = list(np.where((tri == k).any(1))[0])
        one, todo = {about[0]}, [about[0]]
        while todo:
            t = todo.pop()
            for other in about:
                common = frozenset(outline[t] & outline[other])
                if other not in one and len(common) == 2 and common not in edges:
                    one.add(other)
                    todo.append(other)
        at = np.vstack([at, at[k]])
        for t in set(about) - one:
            tri[t][tri[t] == k] = len(at) - 1
    for tip in tips:
        for t in np.where((tri[:, :3] == tip).any(1))[0]:
            k = list(tri[t, :3]).index(tip)
            for middle, other in ((3 + k, (k + 1) % 3), (3 + (k + 2) % 3, (k + 2) % 3)):
                at[tri[t, middle]] = 0.75 * at[tip] + 0.25 * at[tri[t, other]]
    return at, tri, tips


def shape(at, tri, point):
    """At a point of each triangle: the shape functions, their gradients, and the determinant of the map."""
    r, s = point
    t = 1 - r - s
    n = np.array([t * (2 * t - 1), r * (2 * r - 1), s * (2 * s - 1), 4 * t * r, 4 * r * s, 4 * s * t])
    d = np.array(
        [
            [1 - 4 * t, 4 * r - 1, 0, 4 * (t - r), 4 * s, -4 * s],
            [1 - 4 * t, 0, 4 * s - 1, -4 * r, 4 * r, 4 * (t - s)],
        ]
    )
    jacobian = np.einsum("ak,eki->eai", d, at[tri])
    return n, np.einsum("eia,ak->eik", np.linalg.inv(jacobian), d), np.linalg.det(jacobian)


def solve(at, tri, side):
    """The displacements under the tractions of each load on the border."""
    count = len(tri)
    stiffness = np.zeros((count, 12, 12))
    for weight, point in zip(WEIGHTS, POINTS):
        _, g, det = shape(at, tri, point)
        b = np.zeros((count, 3, 12))
        b[:, 0, 0::2], b[:, 1, 1::2] = g[:, 0], g[:, 1]
        b[:, 2, 0::2], b[:, 2, 1::2] = g[:, 1], g[:, 0]
        stiffness += (0.5 * weight * det)[:, None, None] * np.einsum("eai,ab,ebj->eij", b, MATRIX, b)
    dof = np.stack([2 * tri, 2 * tri + 1], 2).reshape(count, 12)
    rows, columns = np.repeat(dof, 12, 1).ravel(), np.tile(dof, (1, 12)).ravel()
    matrix = sp.csc_matrix((stiffness.ravel(), (rows, columns)))
    force = np.zeros((2 * len(at), len(LOADS)))
    for t in tri:
        for a, middle, b in ((0, 3, 1), (1, 4, 2), (2, 5, 0)):
            p, q = at[t[a]], at[t[b]]
            for axis in (0, 1):
                if abs(abs(p[axis]) - side / 2) > 1e-9 or abs(p[axis] - q[axis]) > 1e-9:
                    continue
                normal = np.sign(p[axis]) * np.eye(2)[axis] * np.hypot(*(q - p))
                for load, (xx, xy, yy) in enumerate(LOADS):
                    whole = np.array([[xx, xy], [xy, yy]]) @ normal
                    for node, part in ((t[a], 1 / 6), (t[middle], 4 / 6), (t[b], 1 / 6)):
                        force[2 * node : 2 * node + 2, load] += part * whole
    left, right = (int(np.argmin(np.abs(at - [x, -side / 2]).sum(1))) for x in (-side / 2, side / 2))
    free = np.setdiff1d(np.arange(2 * len(at)), [2 * left, 2 * left + 1, 2 * right + 1])
    u = np.zeros_like(force)
    u[free] = sl.splu(matrix[free][:, free].tocsc()).solve(force[free])
    return u.reshape(len(at), 2, -1)


def known(x, y):
    """Stress and slope along x of the fields of modes I and II of intensity 1 about a tip at the origin (E = 1)."""
    kappa = (3 - POISSON) / (1 + POISSON)

    def displacements(x, y):
        r, angle = np.hypot(x, y), np.arctan2(y, x)
        c, s, cosine = np.cos(angle / 2), np.sin(angle / 2), np.cos(angle)
        b = (1 + POISSON) * np.sqrt(r / (2 * np.pi))
        return np.array(
            [
                [b * c * (kappa - cosine), b * s * (kappa - cosine)],
                [b * s * (kappa + 2 + cosine), -b * c * (kappa - 2 + cosine)],
            ]
        )

    r, angle = np.hypot(x, y), np.arctan2(y, x)
    c, s, c3, s3 = np.cos(angle / 2), np.sin(angle / 2), np.cos(1.5 * angle), np.sin(1.5 * angle)
    stresses = np.array(
        [
            [c * (1 - s * s3), c * s * c3, c * (1 + s * s3)],
            [-s * (2 + c * c3), c * (1 - s * s3), s * c * c3],
        ]
    ) / np.sqrt(2 * np.pi * r)
    step = 1e-6 * r
    slopes = (displacements(x + step, y) - displacements(x - step, y)) / (2 * step)
    return zip(stresses, slopes)


def intensities(at, tri, u, tip, ahead, radius):
    """K_I and K_II of each load at a tip whose crack has the direction `ahead` (rad)."""
    turn = np.array([[np.cos(ahead), np.sin(ahead)], [-np.sin(ahead), np.cos(ahead)]])
    at, u = at @ turn.T, np.einsum("ij,njc->nic", turn, u)
    q = np.clip(2 - np.hypot(*(at - at[tip]).T) / (0.5 * radius), 0, 1)
    tri = tri[(q[tri].max(1) > 0) & (q[tri].min(1) < 1)]
    found = np.zeros((len(LOADS), 2))
    for weight, point in zip(WEIGHTS, POINTS):
        n, g, det = shape(at, tri, point)
        place = np.einsum("k,ekj->ej", n, at[tri]) - at[tip]
        dq = np.einsum("eik,ek->ei", g, q[tri])
        for load in range(len(LOADS)):
            du = np.einsum("eik,ekj->eji", g, u[tri][:, :, :, load])
            strain = np.array([du[:, 0, 0], du[:, 1, 1], du[:, 0, 1] + du[:, 1, 0]])
            xx, yy, xy = MATRIX @ strain
            for mode, (own, slope) in enumerate(known(*place.T)):
                mixed = own[0] * strain[0] + own[1] * strain[2] + own[2] * strain[1]
                first = xx * slope[0] + xy * slope[1] + own[0] * du[:, 0, 0] + own[1] * du[:, 1, 0] - mixed
                second = xy * slope[0] + yy * slope[1] + own[1] * du[:, 0, 0] + own[2] * du[:, 1, 0]
                found[load, mode] += (0.25 * weight * det * (first * dq[:, 0] + second * dq[:, 1])).sum()
    return found


def factors(side, crack, near):
    """K_I and K_II of each load at the last point of a crack, whose straight part has the length 1, over S sqrt(pi / 2)."""
    crack = [np.array(p, float) for p in crack]
    at, tri, tips = mesh(side, crack, near)
    last = crack[-1] - crack[-2]
    radius = 0.6 * np.hypot(*last) / (2 if len(crack) == 2 else 1)
    found = intensities(at, tri, solve(at, tri, side), tips[-1], np.arctan2(last[1], last[0]), radius)
    return found / np.sqrt(np.pi / 2)


def kink(k1, k2):
    """The angle of the largest hoop stress (degrees; Erdogan and Sih 1963)."""
    half = np.radians(np.linspace(-90, 90, 18001)) / 2
    hoop = np.cos(half) ** 2 * (k1 * np.cos(half) - 3 * k2 * np.sin(half))
    return np.degrees(2 * half[np.argmax(hoop)])


if __name__ == "__main__":
    side, edges = float(sys.argv[1]), float(sys.argv[2])
    straight = factors(side, [(-0.5, 0), (0.5, 0)], 1 / 120)
    for name, row in zip(("across", "shear", "along"), straight):
        print(f"{name}: K_I {row[0]:.4f}, K_II {row[1]:.4f}")
    for angle in (15, 30, 45, 60, 75, 90, "shear"):
        load = np.array([0, 1, 0])
        if angle != "shear":
            sine, cosine = np.sin(np.radians(angle)), np.cos(np.radians(angle))
            load = np.array([sine * sine, sine * cosine, cosine * cosine])
        first = kink(*(load @ straight))
        x, y = np.cos(np.radians(first)) / edges, np.sin(np.radians(first)) / edges
        kinked = factors(side, [(-0.5 - x, -y), (-0.5, 0), (0.5, 0), (0.5 + x, y)], 1 / edges / 12)
        print(f"{angle}: kink {first:.1f}, behind it {first + kink(*(load @ kinked)):.1f}")
