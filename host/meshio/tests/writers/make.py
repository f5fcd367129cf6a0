"""Writes the mesh files of this folder by other programs' writers, and what each holds by the same programs, to holds.tsv.

    pip install gmsh meshio numpy scipy trimesh vtk
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


def second_order(middles):
    """The points and the cells of second order: a vertex in the middle of each of the edges `middles` of a cell."""
    points = list(map(tuple, POINTS))
    cells = []
    for tet in TETS:
        cell = list(tet)
        for a, b in middles:
            middle = tuple((POINTS[tet[a]] + POINTS[tet[b]]) / 2)
            if middle not in points:
                points.append(middle)
            cell.append(points.index(middle))
        cells.append(cell)
    return np.array(points), np.array(cells)


def by_vtk():
    """Files of VTK: each format, version and encoding, Lagrange cells, and arrays that no mesh needs."""
    middles = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    points, quadratic = second_order(middles)
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


def gmsh_sheet():
    """A sheet with groups of its surfaces, curves and points, a line with a group, and what Gmsh's options change."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addRectangle(0, 0, 0, 0.2, 0.1)
    gmsh.model.occ.addRectangle(0.2, 0, 0, 0.1, 0.1)
    gmsh.model.occ.fragment([(2, 1)], [(2, 2)])
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [1], 1, "left half")
    gmsh.model.addPhysicalGroup(2, [1, 2], 2, "cloth")
    gmsh.model.addPhysicalGroup(1, [1], 3, "rim")
    gmsh.model.addPhysicalGroup(0, [1, 2], 4, "corners")
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.05)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.05)
    gmsh.model.mesh.generate(2)
    tags, nodes = gmsh.model.mesh.getElementsByType(2)
    groups = gmsh_groups(2)
    for version in (2.2, 4.1):
        for binary in (0, 1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            form = "binary" if binary else "text"
            name = f"gmsh{version}_sheet_{form}.msh"
            gmsh.write(name)
            hold(name, "sheet", len(set(nodes)), len(tags), 0.03, groups)
            # Every entity, whether in a group or not.
            gmsh.option.setNumber("Mesh.SaveAll", 1)
            # Version 2.2 then has the nodes in a section of another name, which is refused with advice.
            gmsh.option.setNumber("Mesh.SaveParametric", version > 4)
            name = f"gmsh{version}_all_{form}.msh"
            gmsh.write(name)
            # Version 2.2 then writes no element of a group.
            hold(name, "sheet", len(set(nodes)), len(tags), 0.03, groups if version > 4 else ())
            gmsh.option.setNumber("Mesh.SaveAll", 0)
            gmsh.option.setNumber("Mesh.SaveParametric", 0)
    for binary in (0, 1):
        form = "binary" if binary else "text"
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(f"gmsh_sheet_{form}.vtk")
        hold(f"gmsh_sheet_{form}.vtk", "sheet", len(set(nodes)), len(tags), 0.03)
        gmsh.write(f"gmsh_sheet_{form}.stl")
        # Gmsh names the one solid of a text file.
        named = [] if binary else [("Created by Gmsh", len(set(nodes)), len(tags))]
        hold(f"gmsh_sheet_{form}.stl", "sheet", len(set(nodes)), len(tags), 0.03, named)
    gmsh.clear()
    a, b, c = (gmsh.model.occ.addPoint(x, 0, 0) for x in (0, 0.1, 0.2))
    first, second = gmsh.model.occ.addLine(a, b), gmsh.model.occ.addLine(b, c)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(1, [first, second], 1, "thread")
    gmsh.model.addPhysicalGroup(1, [second], 2, "far half")
    gmsh.model.addPhysicalGroup(0, [c], 3, "end")
    gmsh.model.mesh.generate(1)
    tags, nodes = gmsh.model.mesh.getElementsByType(1)
    for version in (2.2, 4.1):
        for binary in (0, 1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            name = f"gmsh{version}_thread_{'binary' if binary else 'text'}.msh"
            gmsh.write(name)
            hold(name, "thread", len(set(nodes)), len(tags), 0.2, gmsh_groups(1))
    gmsh.clear()
    # Two faces of a box are periodic; a ball of second order has curved edges.
    gmsh.model.occ.addBox(0, 0, 0, 0.1, 0.1, 0.1)
    gmsh.model.occ.synchronize()
    shift = [1, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    gmsh.model.mesh.setPeriodic(2, [2], [1], shift)
    gmsh.model.addPhysicalGroup(3, [1], 1, "cell")
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.07)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.07)
    gmsh.model.mesh.generate(3)
    tags, nodes = gmsh.model.mesh.getElementsByType(4)
    for version in (2.2, 4.1):
        for binary in (0, 1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            name = f"gmsh{version}_periodic_{'binary' if binary else 'text'}.msh"
            gmsh.write(name)
            hold(name, "solid", len(set(nodes)), len(tags), 1e-3, gmsh_groups(3))
    gmsh.clear()
    gmsh.model.occ.addSphere(0, 0, 0, 0.1)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [1], 1, "ball")
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.15)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.15)
    gmsh.model.mesh.generate(3)
    _, corners = gmsh.model.mesh.getElementsByType(4)
    at = {int(tag): gmsh.model.mesh.getNode(tag)[0] for tag in set(corners)}
    ends = np.array([at[int(tag)] for tag in corners]).reshape(-1, 4, 3)
    size = np.abs(np.linalg.det(ends[:, 1:] - ends[:, :1])).sum() / 6
    gmsh.model.mesh.setOrder(2)
    tags, nodes = gmsh.model.mesh.getElementsByType(11)
    for binary in (0, 1):
        gmsh.option.setNumber("Mesh.Binary", binary)
        form = "binary" if binary else "text"
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.write(f"gmsh4.1_ball_{form}.msh")
        hold(f"gmsh4.1_ball_{form}.msh", "solid", len(set(nodes)), len(tags), size, gmsh_groups(3))
        gmsh.write(f"gmsh_ball_{form}.vtk")
        hold(f"gmsh_ball_{form}.vtk", "solid", len(set(nodes)), len(tags), size)
    gmsh.finalize()


def more_by_meshio():
    """Second order, version 4.1, compression and its absence, and two sheets beside each other."""
    middles = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    points, quadratic = second_order(middles)
    # meshio numbers the middles as VTK does.
    mesh = meshio.Mesh(points, [("tetra10", quadratic)])
    for version in ("2.2", "4.1"):
        for binary in (False, True):
            name = f"meshio{version}_order2_{'binary' if binary else 'text'}.msh"
            meshio.gmsh.write(name, mesh, version, binary=binary)
            hold(name, "solid", len(points), 6, VOLUME)
    for version in ("4.2", "5.1"):
        name = f"meshio{version}_order2_binary.vtk"
        mesh.write(name, file_format=f"vtk{version.replace('.', '')}", binary=True)
        hold(name, "solid", len(points), 6, VOLUME)
    meshio.vtu.write("meshio_order2.vtu", mesh)
    hold("meshio_order2.vtu", "solid", len(points), 6, VOLUME)
    bare = meshio.Mesh(POINTS, [("tetra", TETS)], cell_data={"E": [np.arange(6) / 3]})
    meshio.vtu.write("meshio_uncompressed.vtu", bare, compression=None)
    hold("meshio_uncompressed.vtu", "solid", 8, 6, VOLUME)
    meshio.vtu.write("meshio_uint64.vtu", bare, header_type="UInt64")
    hold("meshio_uint64.vtu", "solid", 8, 6, VOLUME)
    sheet = meshio.Mesh(
        POINTS,
        [("triangle", FACES)],
        cell_data={"gmsh:physical": [np.array([7, 7, 8, 8])], "gmsh:geometrical": [np.array([1, 1, 2, 2])]},
        field_data={"back": np.array([7, 2]), "front": np.array([8, 2])},
    )
    for binary in (False, True):
        name = f"meshio2.2_sheet_{'binary' if binary else 'text'}.msh"
        meshio.gmsh.write(name, sheet, "2.2", binary=binary)
        hold(name, "sheet", 8, 4, area(POINTS, FACES), [("back", 4, 2), ("front", 4, 2)])


def more_by_trimesh():
    """Normals, colours and textures beside the vertices, and two objects in one file."""
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    with open("trimesh_normals.obj", "w") as file:
        file.write(trimesh.exchange.obj.export_obj(box, include_normals=True, include_color=True))
    hold("trimesh_normals.obj", "sheet", len(box.vertices), len(box.faces), box.area)
    ball = trimesh.creation.icosphere(1, 0.1)
    ball.apply_translation((0.5, 0, 0))
    scene = trimesh.Scene({"box": box, "ball": ball})
    with open("trimesh_scene.obj", "w") as file:
        file.write(scene.export(file_type="obj"))
    both = len(box.vertices) + len(ball.vertices), len(box.faces) + len(ball.faces)
    groups = [(name, len(part.vertices), len(part.faces)) for name, part in (("box", box), ("ball", ball))]
    hold("trimesh_scene.obj", "sheet", *both, box.area + ball.area, groups)


def more_by_vtk():
    """Each way of the XML writers: byte order, length of headers, blocks, compression, appended data; solids and surfaces."""
    made = grid(POINTS, vtk.VTK_TETRA, TETS)
    arrays_nobody_asked_for(made.GetCellData(), len(TETS))
    # Values that fill several blocks of the smallest size.
    long = vtk.vtkDoubleArray()
    long.SetName("long")
    long.SetNumberOfComponents(3)
    for k in range(3 * len(POINTS)):
        long.InsertNextValue(k / 7)
    made.GetPointData().AddArray(long)
    large = finer(3)
    surface = vtk.vtkPolyData()
    surface.SetPoints(grid(POINTS, vtk.VTK_TRIANGLE, FACES).GetPoints())
    surface.SetPolys(grid(POINTS, vtk.VTK_TRIANGLE, FACES).GetCells())
    arrays_nobody_asked_for(surface.GetCellData(), len(FACES))

    def write(writer, data, name, mode="Appended", order="Little", header="UInt32", zlib=True, block=None, raw=True):
        getattr(writer, f"SetDataModeTo{mode}")()
        getattr(writer, f"SetByteOrderTo{order}Endian")()
        getattr(writer, f"SetHeaderTypeTo{header}")()
        writer.SetCompressorTypeToZLib() if zlib else writer.SetCompressorTypeToNone()
        writer.SetEncodeAppendedData(not raw)
        if block:
            writer.SetBlockSize(block)
        writer.SetFileName(name)
        writer.SetInputData(data)
        writer.Write()

    ways = {
        "appended_raw": {},
        "appended_base64": {"raw": False},
        "appended_raw_big": {"order": "Big", "header": "UInt64"},
        "appended_uncompressed": {"zlib": False},
        "inline_big": {"mode": "Binary", "order": "Big"},
        "inline_uint64": {"mode": "Binary", "header": "UInt64", "zlib": False},
    }
    for way, options in ways.items():
        write(vtk.vtkXMLUnstructuredGridWriter(), made, f"vtk_{way}.vtu", **options)
        hold(f"vtk_{way}.vtu", "solid", 8, 6, VOLUME)
        write(vtk.vtkXMLPolyDataWriter(), surface, f"vtk_{way}.vtp", **options)
        hold(f"vtk_{way}.vtp", "sheet", 8, 4, area(POINTS, FACES))
    points, cells = large.GetNumberOfPoints(), large.GetNumberOfCells()
    for way, options in (("blocks_inline", {"mode": "Binary"}), ("blocks_raw", {}), ("blocks_big", {"order": "Big"})):
        write(vtk.vtkXMLUnstructuredGridWriter(), large, f"vtk_{way}.vtu", block=512, **options)
        hold(f"vtk_{way}.vtu", "solid", points, cells, VOLUME)


def finer(n):
    """The box in n x n x n cells of six tetrahedra."""
    ends = np.array([[i / n, j / n, k / n] for i in range(n + 1) for j in range(n + 1) for k in range(n + 1)])
    corner = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    number = np.array([(n + 1) ** 2, n + 1, 1])
    firsts = [np.array([i, j, k]) for i in range(n) for j in range(n) for k in range(n)]
    cells = np.concatenate([((first + corner) @ number)[TETS] for first in firsts])
    return grid(ends * POINTS[-1], vtk.VTK_TETRA, cells)


gmsh_box()
unit_box()
by_meshio()
by_trimesh()
by_vtk()
gmsh_sheet()
more_by_meshio()
more_by_trimesh()
more_by_vtk()
with open("holds.tsv", "w") as file:
    file.write("\n".join(LINES) + "\n")
