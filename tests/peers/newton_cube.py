"""Newton (the engine on NVIDIA Warp): vertex block descent, single precision, kernels run on the processor."""

import newton
import numpy as np
import warp as wp

import cube

SWEEPS = [10, 100, 1000]
# Where a step takes so many sweeps, only the steps in which the plate moves are taken.
LONG = 1000
# Its damping stress is 4 times this times the rate of the Green strain; ours, for small strains, is 2 mu beta times
# it, and a part that resists the change of volume, which it has not.
DAMPING = 0.5 * cube.MU * cube.STIFFNESS_DAMPING


def model(mesh):
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    held = set(mesh.top) | set(mesh.bottom)
    for number, x in enumerate(mesh.positions):
        # A particle without mass stays where it is put.
        mass = 0.0 if number in held else float(mesh.mass[number])
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
    forces = []
    times = []
    for step in range(cube.MOVING if sweeps >= LONG else cube.STEPS):
        for state in (now, then):
            x = state.particle_q.numpy()
            x[mesh.top] = place - [0, 0, cube.depth(step + 1)]
            state.particle_q.assign(x)
        times.append(cube.timed(lambda: solver.step(now, then, control, None, cube.STEP)))
        now, then = then, now
        forces.append(mesh.force_on_top(now.particle_q.numpy().astype(float), cube.neo_hookean))
    end = forces[-1] if len(forces) == cube.STEPS else None
    return times, forces[min(cube.MOVING, len(forces)) - 1], end


def main():
    for n in cube.sizes():
        mesh = cube.Mesh(n)
        rest = cube.force_at_rest(n, cube.neo_hookean)
        press(mesh, 1)  # compiles its kernels
        for sweeps in SWEEPS:
            name, strictest = (f"vertex block descent, {n} sweeps, f32" for n in (sweeps, SWEEPS[-1]))
            cube.report(f"Newton {newton.__version__}", name, strictest, "stable Neo-Hookean", mesh, *press(mesh, sweeps), rest)


main()
