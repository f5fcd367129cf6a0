"""MuJoCo: a flex of tetrahedra, implicit in positions (integrator "discrete"), Newton's method or CG."""

import mujoco

import cube

# (solver, tolerance): the defaults, the other solver, and a looser tolerance.
SETTINGS = [("Newton", 1e-8), ("CG", 1e-8), ("CG", 1e-4), ("CG", 1e-2)]
# Mass of the plate (kg). An external force balances the force of the cube in the last step, so that only the change
# over a step accelerates the plate: by 2e-8 m per step at most, except in the first. A heavier plate would spoil the
# relative residual of the solver.
PLATE = 1e3


def model(mesh, solver, tolerance):
    """Free vertices are bodies with three sliders each. Those of the plates are fixed in the world and in one body."""
    names, vertices, bodies = [], [], []
    top, bottom = set(mesh.top), set(mesh.bottom)
    for number, x in enumerate(mesh.positions):
        place = " ".join(f"{c:.17g}" for c in x)
        if number in bottom or number in top:
            names.append("world" if number in bottom else "plate")
            vertices.append(place)
            continue
        names.append(f"v{number}")
        vertices.append("0 0 0")
        m = mesh.mass[number]
        slides = "".join(
            f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1")
        )
        bodies.append(
            f'<body name="v{number}" pos="{place}">'
            f'<inertial pos="0 0 0" mass="{m:.17g}" diaginertia="1e-6 1e-6 1e-6"/>{slides}</body>'
        )
    elements = " ".join(str(v) for v in mesh.cells.ravel())
    xml = f"""
<mujoco>
  <option timestep="{cube.STEP}" gravity="0 0 0" integrator="discrete" solver="{solver}"
          tolerance="{tolerance}" jacobian="sparse"/>
  <worldbody>
    <body name="plate">
      <inertial pos="0 0 0" mass="{PLATE}" diaginertia="1 1 1"/>
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
      <joint name="down" type="slide" axis="0 0 1"/>
    </body>
    {"".join(bodies)}
  </worldbody>
  <deformable>
    <flex name="cube" dim="3" radius="1e-5" body="{" ".join(names)}" vertex="{" ".join(vertices)}" element="{elements}">
      <contact selfcollide="none" contype="0" conaffinity="0"/>
      <elasticity young="{cube.YOUNG}" poisson="{cube.POISSON}" damping="{cube.STIFFNESS_DAMPING}"/>
    </flex>
  </deformable>
</mujoco>"""
    return mujoco.MjModel.from_xml_string(xml)


def press(mesh, setting):
    made = model(mesh, *setting)
    data = mujoco.MjData(made)
    plate = made.joint("down").dofadr[0] - 2  # the three sliders of the plate are its first degrees of freedom
    times, forces = [], []
    elastic = lambda: mesh.force_on_top(data.flexvert_xpos, cube.saint_venant_kirchhoff)
    for step in range(cube.STEPS):
        here, there = cube.depth(step), cube.depth(step + 1)
        data.qpos[plate : plate + 3] = [0, 0, -here]
        data.qvel[plate : plate + 3] = [0, 0, -(there - here) / cube.STEP]
        data.qfrc_applied[plate : plate + 3] = -data.qfrc_passive[plate : plate + 3]
        times.append(cube.timed(lambda: mujoco.mj_step(made, data)))
        # Only this call updates the positions to the end of the step.
        mujoco.mj_kinematics(made, data)
        mujoco.mj_flex(made, data)
        forces.append(elastic())
    return times, forces[: cube.MOVING], forces[-1]


def main():
    for n in cube.sizes():
        mesh = cube.Mesh(n)
        rest = cube.force_at_rest(n, cube.saint_venant_kirchhoff)
        for setting in SETTINGS:
            name, strictest = ("{}, tolerance {:g}".format(*one) for one in (setting, SETTINGS[0]))
            program, law = f"MuJoCo {mujoco.__version__}", "Saint Venant-Kirchhoff"
            cube.report(program, name, strictest, law, mesh, *press(mesh, setting), rest)


main()
