"""Newton (the engine on NVIDIA Warp): vertex block descent, single precision, kernels run on the processor."""

import newton
import numpy as np
import warp as wp

import cube

SWEEPS = [1, 3, 10, 100]
# With this many sweeps per step, only the steps in which the plate moves are computed.
LONG = 100
# Mass of each vertex of the plate (kg): half a newton moves it in a step by less than single precision resolves.
PLATE = 1e5
# Newton's damping stress is 4 times this value times the rate of the Green strain. Palpate's, for small strains, is
# 2 mu beta times that rate, plus a part that resists a change of volume, which Newton does not have.
DAMPING = 0.5 * cube.MU * cube.STIFFNESS_DAMPING


def model(mesh):
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    masses = mesh.mass.copy()
    # A particle without mass stays in place; a heavy particle keeps the velocity that was set.
    masses[mesh.bottom], masses[mesh.top] = 0.0, PLATE
    for x, mass in zip(mesh.positions, masses.tolist()):
        builder.add_particle(wp.vec3(*x), wp.vec3(0.0), mass, radius=1e-4)
    for cell in mesh.cells:
        builder.add_tetrahedron(*map(int, cell), cube.MU, cube.LAMBDA, DAMPING)
    builder.color()
    return builder.finalize(device="cpu")


def press(mesh, sweeps):
    made = model(mesh)
    solver = newton.solvers.SolverVBD(made, iterations=sweeps)
    now, then = made.state(), made.state()
    control = made.control()
    place = mesh.positions[mesh.top].astype(np.float32)
    times, forces = [], []
    for step in range(cube.MOVING if sweeps >= LONG else cube.STEPS):
        here, there = cube.depth(step), cube.depth(step + 1)
        x, v = now.particle_q.numpy(), now.particle_qd.numpy()
        x[mesh.top], v[mesh.top] = place - [0, 0, here], [0, 0, (here - there) / cube.STEP]
        now.particle_q.assign(x)
        now.particle_qd.assign(v)
        times.append(cube.timed(lambda: solver.step(now, then, control, None, cube.STEP)))
        now, then = then, now
        forces.append(mesh.force_on_top(now.particle_q.numpy().astype(float), cube.neo_hookean))
    end = forces[-1] if len(forces) == cube.STEPS else None
    return times, forces[: cube.MOVING], end


def main():
    for n in cube.sizes():
        mesh = cube.Mesh(n)
        rest = cube.force_at_rest(n, cube.neo_hookean)
        press(mesh, 1)  # compiles the kernels
        for sweeps in SWEEPS:
            name, strictest = (f"vertex block descent, {s} sweeps, f32" for s in (sweeps, SWEEPS[-1]))
            program, law = f"Newton {newton.__version__} on Warp", "stable Neo-Hookean"
            cube.report(program, name, strictest, law, mesh, *press(mesh, sweeps), rest)


main()
