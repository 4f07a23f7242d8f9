# SPDX-License-Identifier: MIT
"""Tests of talus_results.py: sh examples/python/run.sh --test [FOLDER]

FOLDER: a run of `collapse` in 2-D with --vtk all, which is read, too.
"""
import json
import pathlib
import re
import sys
import tempfile
import unittest

import numpy as np
import talus_results

RUN = None  # FOLDER
ROOT = pathlib.Path(__file__).resolve().parents[2]
NAMES = {np.dtype(np.float64): "Float64", np.dtype(np.int64): "Int64", np.dtype(np.int32): "Int32",
         np.dtype(np.uint8): "UInt8"}


class VtkFile:
    """Writes what talus writes: XML, and the numbers behind it."""

    def __init__(self):
        self.blocks, self.offset = b"", 0

    def array(self, name, values):
        values = np.ascontiguousarray(values)
        bytes_ = values.tobytes()
        components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
        tag = f'<DataArray type="{NAMES[values.dtype]}" Name="{name}"{components} format="appended" offset="{self.offset}"/>\n'
        self.blocks += len(bytes_).to_bytes(8, "little") + bytes_
        self.offset = len(self.blocks)
        return tag

    def save(self, path, kind, body):
        head = f'<?xml version="1.0"?>\n<VTKFile type="{kind}" version="1.0" header_type="UInt64">\n{body}\n'
        path.write_bytes(head.encode() + b'<AppendedData encoding="raw">\n_' + self.blocks
                         + b"\n</AppendedData>\n</VTKFile>\n")


def write_particles(path, ids, points):
    file, ids, points = VtkFile(), np.array(ids, dtype=float), np.array(points, dtype=float)
    one = np.arange(len(ids))
    body = ("<UnstructuredGrid><Piece><PointData>" + file.array("id", ids) + file.array("velocity", 2 * points)
            + "</PointData><Points>" + file.array("position", points) + "</Points><Cells>"
            + file.array("connectivity", one) + file.array("offsets", one + 1)
            + file.array("types", np.ones(len(ids), np.uint8)) + "</Cells></Piece></UnstructuredGrid>")
    file.save(path, "UnstructuredGrid", body)


class ReadersTest(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def write(self, name, text):
        (self.folder / name).write_text(text)
        return self.folder / name

    def test_tables(self):
        table = talus_results.read_csv(self.write("a.csv", 'time_s,"what, then"\n0.5,"say ""x"""\n-1e-300,y\n'))
        np.testing.assert_array_equal(table["time_s"], [0.5, -1e-300])
        self.assertEqual(table["what, then"], ['say "x"', "y"])
        table = talus_results.read_csv(self.write("b.csv", "a,b\nnan,inf\n"))
        self.assertTrue(np.isnan(table["a"][0]) and np.isinf(table["b"][0]))
        with self.assertRaisesRegex(ValueError, "line 3 has 1 cells instead of 2"):
            talus_results.read_csv(self.write("c.csv", "a,b\n1,2\n3\n"))
        with self.assertRaisesRegex(ValueError, "it is empty"):
            talus_results.read_csv(self.write("d.csv", ""))

    def test_particles(self):
        write_particles(self.folder / "p.vtu", [4, 7], [[0.1, 0.2, 0], [1e-17, -3, 0]])
        frame = talus_results.read_vtk(self.folder / "p.vtu")
        np.testing.assert_array_equal(frame["id"], [4, 7])
        np.testing.assert_array_equal(frame["points"], [[0.1, 0.2, 0], [1e-17, -3, 0]])
        np.testing.assert_array_equal(frame["velocity"], 2 * frame["points"])
        self.assertEqual([list(cell) for cell in frame["cells"]], [[0], [1]])
        write_particles(self.folder / "none.vtu", [], np.zeros((0, 3)))
        self.assertEqual(talus_results.read_vtk(self.folder / "none.vtu")["points"].shape, (0, 3))
        with self.assertRaisesRegex(ValueError, "no file of talus"):
            talus_results.read_vtk(self.write("x.vtu", "<VTKFile/>"))

    def test_pieces_of_ranks(self):
        write_particles(self.folder / "p_0.vtu", [4], [[0.1, 0.2, 0]])
        write_particles(self.folder / "p_1.vtu", [], np.zeros((0, 3)))
        write_particles(self.folder / "p_2.vtu", [7, 5], [[1, 0, 0], [2, 0, 0]])
        pieces = "".join(f'<Piece Source="p_{rank}.vtu"/>' for rank in range(3))
        self.write("p.pvtu", f"<VTKFile><PUnstructuredGrid>{pieces}</PUnstructuredGrid></VTKFile>")
        frame = talus_results.read_vtk(self.folder / "p.pvtu")
        np.testing.assert_array_equal(frame["id"], [4, 7, 5])
        np.testing.assert_array_equal(frame["points"], [[0.1, 0.2, 0], [1, 0, 0], [2, 0, 0]])
        self.assertEqual([list(cell) for cell in frame["cells"]], [[0], [1], [2]])

    def test_image(self):
        file = VtkFile()
        values = np.array([[i, 10 * j, 0] for j in range(2) for i in range(3)], dtype=float)
        file.save(self.folder / "g.vti", "ImageData",
                  '<ImageData WholeExtent="0 2 0 1 0 0" Origin="1 2 0" Spacing="0.5 0.25 1"><Piece><PointData>'
                  + file.array("u", values) + file.array("f", values[:, 0]) + "</PointData></Piece></ImageData>")
        image = talus_results.read_vtk(self.folder / "g.vti")
        self.assertEqual(image["u"].shape, (3, 2, 1, 3))
        np.testing.assert_array_equal(image["u"][2, 1, 0], [2, 10, 0])
        self.assertEqual(image["f"][2, 1, 0], 2)
        np.testing.assert_array_equal(image["points"][2, 1, 0], [2, 2.25, 0])

    def make_run(self):
        self.write("summary.json", json.dumps({"program": "silo", "status": "completed", "measured": {"rate": 0.5}}))
        self.write("profiles.csv", "time_s,x_m,height_m\n0,0,1\n0,1,2\n0.5,0,3\n0.5,1,4\n")
        rows = [f"{t},{x},{y},{z},{t + 100 * x + 10 * y + z}" for t in (0, 0.1) for y in (0, 1, 2) for x in (0, 1)
                for z in (0, 2, 4)]
        self.write("sections.csv", "time_s,x_m,y_m,z_m,pressure_Pa\n" + "\n".join(rows) + "\n")
        write_particles(self.folder / "0.vtu", [3, 1, 2], [[3, 0, 0], [1, 0, 0], [2, 0, 0]])
        write_particles(self.folder / "1.vtu", [2, 3], [[2.5, 1, 0], [3.5, 1, 0]])
        frames = "".join(f'<DataSet timestep="{t}" part="0" file="{t}.vtu"/>' for t in (0, 1))
        self.write("particles.pvd", f"<VTKFile><Collection>{frames}</Collection></VTKFile>")
        return talus_results.Run(self.folder)

    def test_a_run(self):
        run = self.make_run()
        self.assertEqual(run.summary["measured"]["rate"], 0.5)
        self.assertEqual(run.tables(), ["profiles", "sections"])
        np.testing.assert_array_equal(run.times(), [0, 0.5])
        np.testing.assert_array_equal(run.profile(0.2)["height_m"], [1, 2])
        np.testing.assert_array_equal(run.profile()["height_m"], [3, 4])
        with self.assertRaisesRegex(FileNotFoundError, "front.csv is not there; there are: profiles, sections"):
            run.table("front")
        with self.assertRaises(FileNotFoundError):
            run.grid()
        with self.assertRaises(FileNotFoundError):
            talus_results.Run(self.folder / "none")

    def test_sections(self):
        run = self.make_run()
        section = run.section(0.08)
        self.assertEqual(section["pressure_Pa"].shape, (2, 3))
        self.assertAlmostEqual(section["pressure_Pa"][1, 2], 0.1 + 100 + 10 + 4)  # the middle row
        self.assertAlmostEqual(run.section(0, y=1.9)["pressure_Pa"][0, 1], 20 + 2)

    def test_trajectories(self):
        times, x = self.make_run().trajectories()
        np.testing.assert_array_equal(times, [0, 1])
        np.testing.assert_array_equal(x[:, :, 0], [[1, 2, 3], [np.nan, 2.5, 3.5]])  # particle 1 has left
        _, x = self.make_run().trajectories([3, 99])
        np.testing.assert_array_equal(x[:, :, 0], [[3, np.nan], [3.5, np.nan]])


class RunTest(unittest.TestCase):
    """What is read agrees with itself."""

    def setUp(self):
        if RUN is None:
            self.skipTest("no run to read")
        self.run_ = talus_results.Run(RUN)

    def test_particles_and_summary(self):
        run = self.run_
        particles = run.particles()
        self.assertEqual(len(particles["id"]), run.summary["inputs"]["particles"])
        self.assertAlmostEqual(particles["volume"].sum(), run.summary["measured"]["material_volume"])
        speed = np.linalg.norm(particles["velocity"], axis=1).max()
        self.assertAlmostEqual(speed, run.summary["measured"]["speed_end_m_s"])

    def test_trajectories_go_where_velocities_point(self):
        times, x = self.run_.trajectories()
        self.assertGreater(len(times), 2)
        self.assertFalse(np.isnan(x).any())
        last = self.run_.particles()
        velocity = last["velocity"][np.argsort(last["id"])]
        moved = (x[-1] - x[-2]) / (times[-1] - times[-2])
        fast = np.linalg.norm(velocity, axis=1) > 0.3
        self.assertTrue(fast.any())
        self.assertGreater(np.corrcoef(moved[fast, 0], velocity[fast, 0])[0, 1], 0.8)

    def test_grid_and_section_show_the_same(self):
        grid, section = self.run_.grid(), self.run_.section()
        i = np.searchsorted(section["x_m"], grid["points"][:, 0] - 1e-6)
        k = np.searchsorted(section["z_m"], grid["points"][:, 1] - 1e-6)
        stress, fraction = section["stress_xz_Pa"], section["volume_fraction"]
        np.testing.assert_array_equal(fraction[i, k], grid["volume_fraction"])
        np.testing.assert_array_equal(stress[i, k], grid["stress"][:, 1])
        np.testing.assert_array_equal(section["velocity_z_m_s"][i, k], grid["velocity"][:, 1])
        np.testing.assert_array_equal(section["pressure_Pa"][i, k], grid["pressure"])
        d = grid["strain_rate"].reshape(-1, 3, 3)
        np.testing.assert_allclose(section["strain_rate_1_s"][i, k], np.sqrt((d * d).sum((1, 2)) / 2))
        self.assertGreater(np.abs(d).max(), 1)
        rest = np.ones(fraction.shape, bool)
        rest[i, k] = False
        self.assertEqual(fraction[rest].max(), 0)  # all of the material is in the file
        self.assertLess(len(i), fraction.size / 2)  # and little else

    def test_profile_and_front(self):
        profile, front = self.run_.profile(), self.run_.table("front")
        level = self.run_.summary["inputs"]["bed_depth_m"] + 0.002
        last = profile["x_m"][np.nonzero(profile["height_m"] > level)[0][-1]]
        self.assertLess(abs(last - front["front_m"][-1]), 0.03)

    def test_docs_name_every_column_and_field(self):
        described = documented_tables()
        for name in self.run_.tables():
            self.assertLessEqual(set(self.run_.table(name)), described[f"{name}.csv"], name)
        text = (ROOT / "docs/tables.md").read_text(encoding="utf-8")
        for frame in (self.run_.particles(), self.run_.grid()):
            for field in set(frame) - {"points", "cells"}:
                self.assertIn(f"`{field}`", text)


def documented_tables():
    """What docs/tables.md says: the columns of each table, from the first column of its tables."""
    described, name = {}, None
    for line in (ROOT / "docs/tables.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            name = re.findall(r"`([\w.]+\.csv)`", line)
            for each in name:
                described.setdefault(each, set())
        elif name and line.startswith("| `"):
            for each in name:
                described[each].update(re.findall(r"`(\w+)`", line.split("|")[1]))
    return described


class DocsTest(unittest.TestCase):
    def test_every_table_of_the_programs_is_described(self):
        described, found = documented_tables(), 0
        for source in sorted((ROOT / "examples").glob("*.cpp")):
            text = source.read_text(encoding="utf-8")
            tables = re.findall(r'"(\w+\.csv)",\s*\{(.*?)\}', text, re.DOTALL)
            study = re.search(r"columns = \{(.*?)\};", text, re.DOTALL)
            if study:
                tables.append((f"{source.stem}.csv", study.group(1)))
            for table, columns in tables:
                found += 1
                names = set(re.findall(r'"(\w+)"', columns))
                self.assertIn(table, described, source.name)
                self.assertLessEqual(names, described[table], f"{table} of {source.name}")
        self.assertGreater(found, 15)


if __name__ == "__main__":
    if len(sys.argv) > 1 and not sys.argv[1].startswith("-"):
        RUN = sys.argv.pop(1)
    unittest.main()
