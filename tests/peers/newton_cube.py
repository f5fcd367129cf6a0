"""Newton (the engine on NVIDIA Warp): vertex block descent, single precision, kernels run on the processor."""

import newton
import numpy as np
import warp as wp

import cube

SWEEPS = [1, 3, 10, 100]
# Where a step takes so many sweeps, only the steps in which the plate moves are taken.
LONG = 100
# Of each of the plate's vertices (kg): half a newton moves it in a step by less than single precision tells.
PLATE = 1e5
# Its damping stress is 4 times this times the rate of the Green strain; ours, for small strains, is 2 mu beta times
# it, and a part that resists the change of volume, which it has not.
DAMPING = 0.5 * cube.MU * cube.STIFFNESS_DAMPING


def model(mesh):
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    masses = mesh.mass.copy()
    # A particle without mass stays where it is; one with much goes on as fast as it was set to.
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
        press(mesh, 1)  # compiles its kernels
        for sweeps in SWEEPS:
            name, strictest = (f"vertex block descent, {s} sweeps, f32" for s in (sweeps, SWEEPS[-1]))
            program, law = f"Newton {newton.__version__} on Warp", "stable Neo-Hookean"
            cube.report(program, name, strictest, law, mesh, *press(mesh, sweeps), rest)


main()
