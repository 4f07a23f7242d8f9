# SPDX-License-Identifier: MIT
"""Reads what the example programs of talus leave in a folder. Needs numpy alone; copy it where you need it.

    import talus_results
    run = talus_results.Run("out/collapse")
    run.summary["measured"]["runout_m"]           # what summary.json says
    run.table("front")["runout_m"]                # a column of front.csv
    run.profile(0.5)["height_m"]                  # the rows of profiles.csv at the time nearest to 0.5 s
    run.section(0.5)["pressure_Pa"]               # sections.csv then, as arrays (along x, up)
    run.particles(0.5)["velocity"]                # the VTK frame then
    times, x = run.trajectories([17, 4])          # where two particles were, (times, 2, 3)

Columns and units: docs/tables.md. Or, for a look at a folder: python3 talus_results.py FOLDER
"""
import csv
import json
import pathlib
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np

TYPES = {"Float64": "<f8", "Float32": "<f4", "Int64": "<i8", "Int32": "<i4", "UInt8": "<u1"}


def read_csv(path):
    """The columns of a table by name: arrays of numbers, or lists of texts where a cell is no number."""
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    if not rows:
        raise ValueError(f"{path}: it is empty")
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(rows[0]):
            raise ValueError(f"{path}: line {number} has {len(row)} cells instead of {len(rows[0])}")
    columns = {}
    for c, name in enumerate(rows[0]):
        cells = [row[c] for row in rows[1:]]
        try:
            columns[name] = np.array(cells, dtype=float)
        except ValueError:
            columns[name] = cells
    return columns


def read_vtk(path):
    """The points and fields of a .vtu, .vtp, .vti or .pvtu file that talus wrote, by name: "points", (points, 3), m;
    "cells", a list of arrays of points (.vtu, .pvtu); fields, (points,) or (points, numbers each). Of an image (.vti) the fields have the
    shape (nodes along x, y, z) or (…, numbers each), and "points" (…, 3)."""
    data = pathlib.Path(path).read_bytes()
    if b"<PUnstructuredGrid" in data[:1000]:
        return _joined([read_vtk(pathlib.Path(path).with_name(piece.get("Source")))
                        for piece in ElementTree.fromstring(data).iter("Piece")])
    start = data.find(b"<AppendedData")
    if start < 0:
        raise ValueError(f"{path}: no data is appended: it is no file of talus")
    root = ElementTree.fromstring(data[:start] + b"</VTKFile>")
    appended = data.index(b"_", start) + 1

    def read(array):
        begin = appended + int(array.get("offset"))
        size = int.from_bytes(data[begin:begin + 8], "little")
        values = np.frombuffer(data, TYPES[array.get("type")], size // np.dtype(TYPES[array.get("type")]).itemsize, begin + 8)
        components = int(array.get("NumberOfComponents", 1))
        return values.reshape(-1, components) if components > 1 else values

    result = {array.get("Name"): read(array) for array in root.iterfind(".//PointData/DataArray")}
    image = root.find("ImageData")
    if image is None:
        result["points"] = read(root.find(".//Points/DataArray")).reshape(-1, 3)
        cells = {array.get("Name"): read(array) for array in root.iterfind(".//Cells/DataArray")}
        if cells:
            result["cells"] = np.split(cells["connectivity"], cells["offsets"][:-1]) if len(cells["offsets"]) else []
        return result
    extent, origin, spacing = (np.array(image.get(name).split(), dtype=float)
                               for name in ("WholeExtent", "Origin", "Spacing"))
    nodes = (extent[1::2] - extent[::2] + 1).astype(int)
    # the first axis is the fastest in the file
    result = {name: np.moveaxis(values.reshape(*nodes[::-1], *values.shape[1:]), (0, 1, 2), (2, 1, 0))
              for name, values in result.items()}
    axes = (origin[a] + spacing[a] * np.arange(nodes[a]) for a in range(3))
    result["points"] = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return result


def _joined(pieces):
    """The pieces of several ranks as one."""
    first = np.cumsum([0] + [len(piece["points"]) for piece in pieces])
    result = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0] if name != "cells"}
    result["cells"] = [cell + first[p] for p, piece in enumerate(pieces) for cell in piece["cells"]]
    return result


def read_pvd(path):
    """The frames of a time series: times (s), and the path of each file."""
    path = pathlib.Path(path)
    frames = ElementTree.parse(path).getroot().findall("./Collection/DataSet")
    return np.array([float(frame.get("timestep")) for frame in frames]), [path.parent / frame.get("file") for frame in frames]


def nearest(times, time, what):
    """The number of the time nearest to `time` (s); the last one for None."""
    if len(times) == 0:
        raise ValueError(f"{what}: there is nothing in it")
    return len(times) - 1 if time is None else int(np.argmin(np.abs(np.asarray(times) - time)))


class Run:
    """The results of one run. A time (s) that is asked for stands for the nearest one that is there, None for the last.
    Raises FileNotFoundError for what the run did not write, ValueError for what is no file of talus."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self._tables = {}
        with open(self.folder / "summary.json") as file:
            self.summary = json.load(file)

    def tables(self):
        """The names of the tables that are there."""
        return sorted(path.stem for path in self.folder.glob("*.csv"))

    def table(self, name):
        """The columns of NAME.csv, by name."""
        if name not in self._tables:
            path = self.folder / f"{name}.csv"
            if not path.is_file():
                raise FileNotFoundError(f"{path} is not there; there are: {', '.join(self.tables())}")
            self._tables[name] = read_csv(path)
        return self._tables[name]

    def times(self, name="profiles"):
        """The times of a table, s, each once."""
        return np.unique(self.table(name)["time_s"])

    def at(self, name, time=None):
        """The rows of NAME.csv at one time, as columns by name."""
        times = self.times(name)
        time = times[nearest(times, time, self.folder / f"{name}.csv")]
        here = self.table(name)["time_s"] == time
        return {column: values[here] for column, values in self.table(name).items()}

    def profile(self, time=None):
        """The surface at one time: x_m, height_m, static_height_m."""
        return self.at("profiles", time)

    def section(self, time=None, y=None):
        """sections.csv at one time, in the row across that is nearest to y (m; None: the middle one that is there): x_m and
        z_m, the nodes along each axis, and all other columns as arrays (len(x_m), len(z_m))."""
        rows = self.at("sections", time)
        if "y_m" in rows:
            across = np.unique(rows["y_m"])
            row = across[len(across) // 2 if y is None else nearest(across, y, "y")]
            rows = {name: values[rows["y_m"] == row] for name, values in rows.items()}
        x, i = np.unique(rows["x_m"], return_inverse=True)
        z, k = np.unique(rows["z_m"], return_inverse=True)
        section = {"x_m": x, "z_m": z}
        for name, values in rows.items():
            if name not in section:
                section[name] = np.full((len(x), len(z)), np.nan)
                section[name][i, k] = values
        return section

    def frames(self, kind="particles"):
        """The VTK frames of "particles" or "grid": times (s) and files."""
        return read_pvd(self.folder / f"{kind}.pvd")

    def particles(self, time=None):
        """The particles of one frame, see read_vtk."""
        return self._frame("particles", time)

    def grid(self, time=None):
        """The nodes of the cells with material of one frame, see read_vtk."""
        return self._frame("grid", time)

    def trajectories(self, ids=None):
        """Where particles were: the times of the frames, s, and an array (times, particles, 3), m, in the order of `ids`
        (None: those of the first frame, sorted); not a number where a particle is not there."""
        times, files = self.frames()
        nearest(times, None, self.folder / "particles.pvd")
        if ids is None:
            ids = np.sort(read_vtk(files[0])["id"])
        ids = np.asarray(ids, dtype=float)
        places = np.full((len(times), len(ids), 3), np.nan)
        for t, file in enumerate(files):
            frame = read_vtk(file)
            order = np.argsort(frame["id"])
            at = np.searchsorted(frame["id"], ids, sorter=order)
            there = at < len(order)
            there[there] = frame["id"][order[at[there]]] == ids[there]
            places[t, there] = frame["points"][order[at[there]]]
        return times, places

    def _frame(self, kind, time):
        times, files = self.frames(kind)
        return read_vtk(files[nearest(times, time, self.folder / f"{kind}.pvd")])


def main():
    if len(sys.argv) != 2 or sys.argv[1] in ("-h", "--help"):
        sys.exit(__doc__)
    run = Run(sys.argv[1])
    print(f"{run.summary['program']}: {run.summary['status']}, {run.summary.get('steps', '?')} steps")
    for key, value in run.summary.get("measured", {}).items():
        print(f"  {key} = {value}")
    for name in run.tables():
        columns = run.table(name)
        print(f"{name}.csv: {len(next(iter(columns.values())))} rows of {', '.join(columns)}")
    for kind in ("particles", "grid"):
        if (run.folder / f"{kind}.pvd").is_file() and len(run.frames(kind)[0]):
            frame, times = run._frame(kind, None), run.frames(kind)[0]
            print(f"{kind}.pvd: {len(times)} frames, {times[0]:g} to {times[-1]:g} s; fields: "
                  f"{', '.join(name for name in frame if name not in ('points', 'cells'))}")


if __name__ == "__main__":
    main()
