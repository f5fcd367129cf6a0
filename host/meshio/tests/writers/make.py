"""Writes the mesh files of this folder by other programs' writers, and what each holds by the same programs, to holds.tsv.

    pip install gmsh meshio numpy
    python make.py

A line of holds.tsv: file, kind, vertices, cells, volume or area (m3, m2), then groups as name=vertices,cells.
"""
import gmsh
import numpy as np

LINES = []


def hold(file, kind, vertices, cells, size, groups=()):
    words = [file, kind, str(vertices), str(cells), repr(float(size))]
    words += [f"{name}={v},{c}" for name, v, c in sorted(groups)]
    LINES.append("\t".join(words))


def gmsh_groups(dim):
    found = []
    for d, tag in gmsh.model.getPhysicalGroups():
        name = gmsh.model.getPhysicalName(d, tag)
        nodes, _ = gmsh.model.mesh.getNodesForPhysicalGroup(d, tag)
        cells = 0
        if d == dim:
            for entity in gmsh.model.getEntitiesForPhysicalGroup(d, tag):
                cells += sum(map(len, gmsh.model.mesh.getElements(d, entity)[1]))
        # Groups of a solid's cells make no group of vertices.
        found.append((name, 0 if d == 3 else len(nodes), cells))
    return found


def gmsh_box():
    """Two boxes in contact with groups that overlap, solid or as their surface, in each version, linear and quadratic."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addBox(0, 0, 0, 0.1, 0.1, 0.1)
    gmsh.model.occ.addBox(0.1, 0, 0, 0.1, 0.1, 0.1)
    gmsh.model.occ.fragment([(3, 1)], [(3, 2)])
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [1], 1, "stiff")
    gmsh.model.addPhysicalGroup(3, [1, 2], 2, "whole")
    gmsh.model.addPhysicalGroup(2, [1], 3, "wall")
    gmsh.model.addPhysicalGroup(2, [1, 2], 4, "two walls")
    gmsh.model.addPhysicalGroup(0, [1], 5, "corner")
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.1)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.1)
    gmsh.model.mesh.generate(3)

    def write(name, version, binary):
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(name)

    for order, code in ((1, 4), (2, 11)):
        gmsh.model.mesh.setOrder(order)
        tags, nodes = gmsh.model.mesh.getElementsByType(code)
        view = gmsh.view.add("number")
        gmsh.view.addModelData(
            view, 0, gmsh.model.getCurrent(), "ElementData", list(tags), [[float(k)] for k in range(len(tags))]
        )
        for version in (2.2, 4.1):
            for binary in (0, 1):
                name = f"gmsh{version}_order{order}_{'binary' if binary else 'text'}.msh"
                write(name, version, binary)
                gmsh.option.setNumber("PostProcessing.SaveMesh", 0)
                gmsh.view.write(view, name, append=True)
                hold(name, "solid", len(set(nodes)), len(tags), 2e-3, gmsh_groups(3))
    gmsh.model.mesh.setOrder(1)
    tags, nodes = gmsh.model.mesh.getElementsByType(4)
    groups = gmsh_groups(3)
    gmsh.model.mesh.partition(3)
    for version in (2.2, 4.1):
        for binary in (0, 1):
            name = f"gmsh{version}_parts_{'binary' if binary else 'text'}.msh"
            write(name, version, binary)
            hold(name, "solid", len(set(nodes)), len(tags), 2e-3, groups)
    gmsh.finalize()


gmsh_box()
with open("holds.tsv", "w") as file:
    file.write("\n".join(LINES) + "\n")
