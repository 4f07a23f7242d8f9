#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Reads VTK files with VTK's own readers and checks their values.

    check_vtk.py [--meshio] FILE.vtu|FILE.pvtu|FILE.vtp|FILE.vti|FILE.pvd|FOLDER ...

A table with the file's name and the ending .csv holds what must be read: columns x, y, z and one
for each number of each field (NAME, or NAME_0, NAME_1, ...), one row a point. All must be equal to
the last bit; without a table the file must only be readable. Of a series, every frame is checked
and the times must increase. A folder stands for all such files in it. With --meshio, meshio must read
the same from .vtu files (but empty ones), and there must be one.

The files of talus's own test are made by

    TALUS_VTK_SAMPLES=FOLDER talus_tests_unit --test-case='VTK: samples*'

Needs Python with numpy and VTK (Debian: python3-vtk9), and with --meshio meshio (python3-meshio).
"""
import csv
import pathlib
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy


def read(path):
    """The points (#, 3) and the fields {name: (#, components)} of a file, and its cells, each a tuple
    of its points (none of an image)."""
    reader = {".vtp": vtk.vtkXMLPolyDataReader, ".vti": vtk.vtkXMLImageDataReader,
              ".vtu": vtk.vtkXMLUnstructuredGridReader,
              ".pvtu": vtk.vtkXMLPUnstructuredGridReader}[path.suffix]()
    complaints = []
    for event in ("ErrorEvent", "WarningEvent"):
        reader.AddObserver(event, lambda *_: complaints.append(event))
    if not reader.CanReadFile(str(path)):
        raise ValueError("VTK cannot read it")
    reader.SetFileName(str(path))
    reader.Update()
    data = reader.GetOutput()
    if complaints:
        raise ValueError("VTK complains")
    count = data.GetNumberOfPoints()
    points = np.array([data.GetPoint(i) for i in range(count)]).reshape(count, 3)
    if path.suffix == ".vtp" and data.GetNumberOfVerts() != count:
        raise ValueError(f"{data.GetNumberOfVerts()} vertices for {count} points")
    arrays = data.GetPointData()
    fields = {}
    for i in range(arrays.GetNumberOfArrays()):
        array = arrays.GetArray(i)
        if array.GetNumberOfTuples() != count:
            raise ValueError(f"{array.GetName()}: {array.GetNumberOfTuples()} values for {count} points")
        fields[array.GetName()] = vtk_to_numpy(array).reshape(count, array.GetNumberOfComponents())
    cells = []
    if path.suffix in (".vtu", ".pvtu"):
        for c in range(data.GetNumberOfCells()):
            ids = data.GetCell(c).GetPointIds()
            cells.append(tuple(ids.GetId(i) for i in range(ids.GetNumberOfIds())))
    return points, fields, cells


def compare_with_meshio(path, points, fields, cells):
    """Raises ValueError unless meshio reads from a .vtu file what VTK read."""
    import meshio
    mesh = meshio.read(path)
    found = {name: values.reshape(len(points), -1) for name, values in mesh.point_data.items()}
    if not np.array_equal(mesh.points, points):
        raise ValueError("meshio reads other points")
    if [tuple(c) for block in mesh.cells for c in block.data] != cells:
        raise ValueError("meshio reads other cells")
    if set(found) != set(fields):
        raise ValueError(f"meshio reads the fields {sorted(found)} instead of {sorted(fields)}")
    for name, values in fields.items():
        if not np.array_equal(found[name], values, equal_nan=True):
            raise ValueError(f"meshio reads other values of {name}")


def check_data(path, with_meshio=False):
    points, fields, cells = read(path)
    if with_meshio and path.suffix == ".vtu" and cells:  # meshio fails on a mesh without cells
        compare_with_meshio(path, points, fields, cells)
    found = {"x": points[:, 0], "y": points[:, 1], "z": points[:, 2]}
    for name, values in fields.items():
        parts = values.shape[1]
        for c in range(parts):
            found[name if parts == 1 else f"{name}_{c}"] = values[:, c]
    table = path.with_suffix(".csv")
    if not table.exists():
        return f"{len(points)} points, fields: {', '.join(fields) or 'none'}; no table to compare with"
    with open(table, newline="") as lines:
        rows = list(csv.reader(lines))
    if set(rows[0]) != set(found):
        raise ValueError(f"columns {sorted(found)} instead of {sorted(rows[0])}")
    expected = np.array(rows[1:], dtype=float).reshape(-1, len(rows[0]))
    for c, name in enumerate(rows[0]):
        if not np.array_equal(found[name], expected[:, c], equal_nan=True):
            raise ValueError(f"{name} differs from {table.name}")
    return f"{len(points)} points, all values equal: {', '.join(rows[0])}"


def check_series(path, with_meshio=False):
    frames = ElementTree.parse(path).getroot().findall("./Collection/DataSet")
    times = [float(frame.get("timestep")) for frame in frames]
    if any(b <= a for a, b in zip(times, times[1:])):
        raise ValueError("the times do not increase")
    for frame in frames:
        check_data(path.parent / frame.get("file"), with_meshio)
    return f"{len(frames)} frames, times {times[:1]} to {times[-1:]}"


def main():
    names = [name for name in sys.argv[1:] if name != "--meshio"]
    with_meshio = len(names) < len(sys.argv) - 1
    if not names or names[0] in ("-h", "--help"):
        print(__doc__)
        return 2
    files = []
    for name in map(pathlib.Path, names):
        inside = [p for p in sorted(name.glob("*")) if p.suffix in (".vtu", ".vtp", ".vti", ".pvd")]
        files += inside if name.is_dir() else [name]
    failed = 0
    for path in files:
        try:
            check = check_series if path.suffix == ".pvd" else check_data
            print(f"ok      {path}: {check(path, with_meshio)}")
        except (OSError, KeyError, ValueError, ElementTree.ParseError) as error:
            failed += 1
            print(f"FAILED  {path}: {error}")
    if with_meshio:
        unstructured = sum(path.suffix == ".vtu" for path in files)
        print(f"{unstructured} files compared with what meshio reads")
        failed += unstructured == 0
    print(f"{len(files) - failed} passed, {failed} failed")
    return 1 if failed or not files else 0


if __name__ == "__main__":
    sys.exit(main())
