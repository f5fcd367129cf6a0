"""MuJoCo: a flex of triangles that falls on a sphere, at several stiffnesses of its soft contacts.

The scene is Palpate's `host/scenes/sheet_on_sphere.toml` without contact of the cloth with itself: 0.2 m x
0.2 m, E = 1 MPa, nu = 0.3, 0.3 mm, 1000 kg/m^3, a sphere of 5 cm, friction 0.4, a fall of 2 mm, steps of 4 ms, one second.
A depth is measured as in Palpate: how far the middle surface of the cloth is nearer to the sphere than half its thickness.
"""

import json
import time

import mujoco
import numpy as np

SIDE, CELLS, YOUNG, POISSON, THICKNESS, DENSITY = 0.2, 24, 1e6, 0.3, 3e-4, 1e3
RADIUS, FRICTION, HEIGHT, DAMPING = 0.05, 0.4, 0.052, 1e-3
DURATION = 1.0
# (step (s), time constant of the contacts (s), impedance of a contact at no depth and at a thickness, solver): MuJoCo wants
# a time constant of two steps at least.
SETTINGS = [
    (4e-3, 20e-3, (0.9, 0.95), "CG"),
    (4e-3, 8e-3, (0.9, 0.95), "CG"),
    (4e-3, 8e-3, (0.9, 0.95), "Newton"),
    (4e-3, 8e-3, (0.99, 0.999), "CG"),
    (1e-3, 2e-3, (0.9, 0.95), "CG"),
    (1e-3, 2e-3, (0.99, 0.999), "CG"),
    (0.25e-3, 0.5e-3, (0.99, 0.999), "CG"),
]


def model(step, constant, impedance, solver):
    """Each vertex is a body with three sliders, as a flex wants it."""
    along = np.linspace(-0.5 * SIDE, 0.5 * SIDE, CELLS + 1)
    number = lambda i, j: j * (CELLS + 1) + i
    triangles = []
    for j in range(CELLS):
        for i in range(CELLS):
            a, b, c, d = number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)
            triangles += [[a, b, c], [a, c, d]] if (i + j) % 2 == 0 else [[a, b, d], [b, c, d]]
    triangles = np.array(triangles)
    places = np.array([(x, y, HEIGHT) for y in along for x in along])
    mass = np.zeros(len(places))
    np.add.at(mass, triangles, DENSITY * THICKNESS * (SIDE / CELLS) ** 2 / 6)
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    bodies = "".join(
        f'<body name="v{n}" pos="{x:.17g} {y:.17g} {z:.17g}">'
        f'<inertial pos="0 0 0" mass="{mass[n]:.17g}" diaginertia="1e-9 1e-9 1e-9"/>{slides}</body>'
        for n, (x, y, z) in enumerate(places)
    )
    names = " ".join(f"v{n}" for n in range(len(places)))
    zeros = " ".join("0 0 0" for _ in places)
    low, high = impedance
    contact = f'solref="{constant} 1" solimp="{low} {high} {THICKNESS} 0.5 2" friction="{FRICTION} 0 0"'
    text = f"""
<mujoco>
  <option timestep="{step}" gravity="0 0 -9.81" integrator="discrete" solver="{solver}" tolerance="1e-8" jacobian="sparse"/>
  <size memory="1G"/>
  <worldbody>
    <geom name="ball" type="sphere" size="{RADIUS}" condim="3" {contact}/>
    {bodies}
  </worldbody>
  <deformable>
    <flex name="cloth" dim="2" radius="{0.5 * THICKNESS}" body="{names}" vertex="{zeros}"
          element="{' '.join(str(v) for v in triangles.ravel())}">
      <contact selfcollide="none" condim="3" {contact}/>
      <elasticity young="{YOUNG}" poisson="{POISSON}" thickness="{THICKNESS}" damping="{DAMPING}" elastic2d="both"/>
    </flex>
  </deformable>
</mujoco>"""
    return mujoco.MjModel.from_xml_string(text)


def run(setting):
    made = model(*setting)
    data = mujoco.MjData(made)
    times, depths = [], []
    for _ in range(round(DURATION / setting[0])):
        start = time.process_time()
        mujoco.mj_step(made, data)
        times.append(time.process_time() - start)
        away = np.linalg.norm(data.flexvert_xpos.reshape(-1, 3), axis=1)
        depths.append(max(0.0, float(RADIUS + 0.5 * THICKNESS - away.min())))
    step, constant, impedance, solver = setting
    return {
        "program": f"MuJoCo {mujoco.__version__}",
        "setting": f"{solver}, steps of {1e3 * step:g} ms, contacts {1e3 * constant:g} ms, {impedance[0]} to {impedance[1]}",
        "triangles": 2 * CELLS * CELLS,
        "median_ms": 1e3 * float(np.median(times)),
        "worst_ms": 1e3 * max(times),
        "second_ms": 1e3 * sum(times) / DURATION,
        "deepest_um": 1e6 * max(depths),
        "mean_um": 1e6 * float(np.mean(depths)),
        "end_um": 1e6 * depths[-1],
        "contacts": int(data.ncon),
    }


def main():
    for setting in SETTINGS:
        print(json.dumps(run(setting)), flush=True)


main()
