"""Writes the mesh files of this folder by other programs' writers, and what each holds by the same programs, to holds.tsv.

    pip install gmsh meshio numpy trimesh vtk
    python make.py

A line of holds.tsv: file, kind, vertices, cells, volume or area (m3, m2), then groups as name=vertices,cells.
"""
import gmsh
import meshio
import numpy as np
import trimesh
import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

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


POINTS, TETS, FACES = None, None, None


def unit_box():
    """Six tetrahedra of a box of 0.1 x 0.2 x 0.3 m, and the triangles of two of its faces."""
    global POINTS, TETS, FACES
    POINTS = np.array([[i * 0.1, j * 0.2, k * 0.3] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    paths = [(1, 3), (1, 5), (2, 3), (2, 6), (4, 5), (4, 6)]
    tets = []
    for a, b in paths:
        tet = [0, a, b, 7]
        x = POINTS[tet]
        if np.linalg.det(x[1:] - x[0]) < 0:
            tet[1], tet[2] = tet[2], tet[1]
        tets.append(tet)
    TETS = np.array(tets)
    FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5]])


def area(points, triangles):
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


VOLUME = 0.1 * 0.2 * 0.3


def by_meshio():
    """Files of meshio: physical groups without entities, as scripts write them."""
    mesh = meshio.Mesh(
        POINTS,
        [("tetra", TETS), ("triangle", FACES)],
        cell_data={
            "gmsh:physical": [np.array([1, 1, 1, 2, 2, 2]), np.array([3, 3, 4, 4])],
            "gmsh:geometrical": [np.zeros(6, int), np.zeros(4, int)],
        },
        field_data={
            "stiff": np.array([1, 3]),
            "soft": np.array([2, 3]),
            "wall": np.array([3, 2]),
            "free": np.array([4, 2]),
        },
    )
    groups = [("stiff", 0, 3), ("soft", 0, 3), ("wall", 4, 0), ("free", 4, 0)]
    for binary in (False, True):
        name = f"meshio2.2_{'binary' if binary else 'text'}.msh"
        meshio.gmsh.write(name, mesh, "2.2", binary=binary)
        hold(name, "solid", 8, 6, VOLUME, groups)
    bare = meshio.Mesh(POINTS, [("tetra", TETS)], cell_data={"E": [np.arange(6) / 3]})
    for binary in (False, True):
        form = "binary" if binary else "text"
        for version in ("4.2", "5.1"):
            name = f"meshio{version}_{form}.vtk"
            bare.write(name, file_format=f"vtk{version.replace('.', '')}", binary=binary)
            hold(name, "solid", 8, 6, VOLUME)
        name = f"meshio_{form}.vtu"
        meshio.vtu.write(name, bare, binary=binary)
        hold(name, "solid", 8, 6, VOLUME)
        name = f"meshio_{form}.stl"
        sheet = meshio.Mesh(POINTS, [("triangle", FACES)])
        meshio.stl.write(name, sheet, binary=binary)
        # meshio names no solid in a text file.
        hold(name, "sheet", 8, 4, area(POINTS, FACES))
    sheet = meshio.Mesh(POINTS, [("triangle", FACES)])
    sheet.write("meshio.obj")
    hold("meshio.obj", "sheet", 8, 4, area(POINTS, FACES))


def by_trimesh():
    """Files of trimesh."""
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    for form, name in (("stl", "trimesh_binary.stl"), ("stl_ascii", "trimesh_text.stl"), ("obj", "trimesh.obj")):
        box.export(name, file_type=form)
    for name in ("trimesh_binary.stl", "trimesh_text.stl", "trimesh.obj"):
        groups = []
        hold(name, "sheet", len(box.vertices), len(box.faces), box.area, groups)


def grid(points, kind, cells):
    points_of = vtk.vtkPoints()
    points_of.SetDataTypeToDouble()
    points_of.SetData(numpy_to_vtk(points, deep=True))
    made = vtk.vtkUnstructuredGrid()
    made.SetPoints(points_of)
    array = vtk.vtkCellArray()
    ids = np.hstack([np.full((len(cells), 1), cells.shape[1]), cells]).ravel()
    array.SetCells(len(cells), numpy_to_vtkIdTypeArray(ids.astype(np.int64), deep=True))
    made.SetCells(kind, array)
    return made


def arrays_nobody_asked_for(data, count):
    """Arrays of text, bits and values that are not known."""
    notes = vtk.vtkStringArray()
    notes.SetName("notes")
    for k in range(count):
        notes.InsertNextValue("" if k == 1 else f"cell {k}")
    bits = vtk.vtkBitArray()
    bits.SetName("inside")
    for k in range(count):
        bits.InsertNextValue(k % 2)
    unknown = vtk.vtkDoubleArray()
    unknown.SetName("quality")
    for k in range(count):
        unknown.InsertNextValue(float("nan") if k % 2 else float("inf"))
    known = vtk.vtkDoubleArray()
    known.SetName("young")
    for k in range(count):
        known.InsertNextValue(1000.0 + k)
    for array in (notes, bits, unknown, known):
        data.AddArray(array)


def by_vtk():
    """Files of VTK: each format, version and encoding, Lagrange cells, and arrays that no mesh needs."""
    middles = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    points = list(map(tuple, POINTS))
    quadratic = []
    for tet in TETS:
        cell = list(tet)
        for a, b in middles:
            middle = tuple((POINTS[tet[a]] + POINTS[tet[b]]) / 2)
            if middle not in points:
                points.append(middle)
            cell.append(points.index(middle))
        quadratic.append(cell)
    points, quadratic = np.array(points), np.array(quadratic)
    for name, kind, at, cells in (
        ("linear", vtk.VTK_TETRA, POINTS, TETS),
        ("quadratic", vtk.VTK_QUADRATIC_TETRA, points, quadratic),
        ("lagrange1", vtk.VTK_LAGRANGE_TETRAHEDRON, POINTS, TETS),
        ("lagrange2", vtk.VTK_LAGRANGE_TETRAHEDRON, points, quadratic),
    ):
        made = grid(at, kind, cells)
        arrays_nobody_asked_for(made.GetCellData(), len(cells))
        arrays_nobody_asked_for(made.GetFieldData(), 3)
        arrays_nobody_asked_for(made.GetPointData(), len(at))
        for binary in (False, True):
            form = "binary" if binary else "text"
            for version, number in (("4.2", 42), ("5.1", 51)):
                writer = vtk.vtkUnstructuredGridWriter()
                writer.SetFileVersion(number)
                writer.SetFileTypeToBinary() if binary else writer.SetFileTypeToASCII()
                file = f"vtk{version}_{name}_{form}.vtk"
                writer.SetFileName(file)
                writer.SetInputData(made)
                writer.Write()
                hold(file, "solid", len(at), len(cells), VOLUME)
            writer = vtk.vtkXMLUnstructuredGridWriter()
            writer.SetDataModeToBinary() if binary else writer.SetDataModeToAscii()
            # The ending of a legacy file.
            file = f"vtk_{name}_{form}.vtk" if name == "linear" else f"vtk_{name}_{form}.vtu"
            writer.SetFileName(file)
            writer.SetInputData(made)
            writer.Write()
            hold(file, "solid", len(at), len(cells), VOLUME)
    surface = vtk.vtkPolyData()
    surface.SetPoints(grid(POINTS, vtk.VTK_TRIANGLE, FACES).GetPoints())
    surface.SetPolys(grid(POINTS, vtk.VTK_TRIANGLE, FACES).GetCells())
    arrays_nobody_asked_for(surface.GetCellData(), len(FACES))
    size = area(POINTS, FACES)
    for binary in (False, True):
        form = "binary" if binary else "text"
        for writer, file in (
            (vtk.vtkPolyDataWriter(), f"vtk_sheet_{form}.vtk"),
            (vtk.vtkSTLWriter(), f"vtk_sheet_{form}.stl"),
        ):
            writer.SetFileTypeToBinary() if binary else writer.SetFileTypeToASCII()
            writer.SetFileName(file)
            writer.SetInputData(surface)
            writer.Write()
            groups = []
            if file == "vtk_sheet_text.stl":
                # VTK names the solid.
                groups = [("Visualization Toolkit generated SLA File", 8, 4)]
            hold(file, "sheet", 8, 4, size, groups)


gmsh_box()
unit_box()
by_meshio()
by_trimesh()
by_vtk()
with open("holds.tsv", "w") as file:
    file.write("\n".join(LINES) + "\n")
