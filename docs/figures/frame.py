"""Draws a frame of `palpate solve --vtu` with VTK, as ParaView would: the deformed body, coloured by stress.

    pip install pyvista
    palpate solve host/scenes/twist.toml --vtu out
    python3 docs/figures/frame.py out/bar_0020.vtu docs/src/images/twist.png
"""

import sys

import pyvista as pv

frame, picture = sys.argv[1:3]
body = pv.read(frame)
# The rest shape as an outline: positions in the file are those of the deformed body.
rest = body.copy()
rest.points = body.points - body["displacement"]
plotter = pv.Plotter(off_screen=True, window_size=(1000, 560))
plotter.add_mesh(
    body,
    scalars="von_mises",
    cmap="viridis",
    show_edges=True,
    line_width=0.5,
    scalar_bar_args={
        "title": "von Mises stress (Pa)\n",
        "fmt": "%.0f",
        "title_font_size": 18,
        "label_font_size": 16,
        "width": 0.5,
        "position_x": 0.25,
        "position_y": 0.04,
    },
)
plotter.add_mesh(rest.extract_feature_edges(30), color="gray", line_width=1.5)
plotter.view_vector((0.35, -1.0, 0.55), viewup=(0, 0, 1))
plotter.camera.zoom(1.35)
plotter.screenshot(picture)
