#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What the pictures of `landslide` show on the terrain are the depths of maps.csv, each where it lies, whatever the size of
the cells beside that of the terrain's.

    maps.py

Needs numpy and matplotlib.
"""
import pathlib
import sys
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "examples"))
import plotting

WEST, SOUTH = 632000.5, 5094000.5  # m, in UTM
TERRAIN = 5.0                      # m, edge of a cell


def drawn(folder, cell, first):
    """Writes a terrain of 60 m x 40 m, and a map that has material in 4 x 3 cells from the cell `first` on; what is drawn
    of it: x and y of the middles, and the depths."""
    x, y = (start + cell * (at + np.arange(count) + 0.5) for start, at, count in zip((WEST, SOUTH), first, (4, 3)))
    depth = 1.0 + np.arange(12).reshape(3, 4)
    heights = "\n".join(" ".join(str(100 + i + j) for i in range(12)) for j in range(8))
    (folder / "terrain.asc").write_text(f"ncols 12\nnrows 8\nxllcorner {WEST}\nyllcorner {SOUTH}\ncellsize {TERRAIN}\n"
                                        f"NODATA_value -9999\n{heights}\n")
    rows = [f"0,{x[i]!r},{y[j]!r},{depth[j, i]!r},0" for j in range(3) for i in range(4) if (i, j) != (0, 0)]
    (folder / "maps.csv").write_text("time_s,x_m,y_m,depth_m,speed_m_s\n" + "\n".join(rows) + "\n")
    figure, axes = plt.subplots()
    image = plotting.GroundMap(folder).draw(axes, 0)
    plt.close(figure)
    expected = np.ma.masked_array(depth, mask=False)
    expected[0, 0] = np.ma.masked
    corners = image.get_coordinates()
    return x, y, expected, corners, image.get_array().reshape(corners.shape[0] - 1, -1)


def main():
    for cell in (TERRAIN, TERRAIN / 2, TERRAIN / 4, 2 * TERRAIN, 3.0, 7.5):
        for first in ((0, 0), (1, 1)):
            with tempfile.TemporaryDirectory() as folder:
                x, y, expected, corners, image = drawn(pathlib.Path(folder), cell, first)
            what = f"cells of {cell} m on a terrain of {TERRAIN} m, from {first} on"
            assert image.shape == expected.shape, f"{what}: {image.shape} cells are drawn, not {expected.shape}"
            assert np.array_equal(np.ma.getmaskarray(image), np.ma.getmaskarray(expected)), f"{what}: holes at other places"
            assert np.array_equal(image.compressed(), expected.compressed()), f"{what}: other depths"
            assert np.allclose(corners[0, :-1, 0] + cell / 2, x, atol=1e-6), f"{what}: not at its x"
            assert np.allclose(corners[:-1, 0, 1] + cell / 2, y, atol=1e-6), f"{what}: not at its y"
    print("maps: drawn where they are")


if __name__ == "__main__":
    main()
