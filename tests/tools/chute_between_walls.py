#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Steady flow down a chute between side walls by the local law mu(I) in all of the section: what `chute --dim 3` should give.

    python3 tests/tools/chute_between_walls.py [ROWS]

Solves, per density, for the velocity u(y, z) along the slope, y across and z above the floor (Jop, Forterre & Pouliquen,
Nature 441, 2006):

    d/dy (eta du/dy) + d/dz (eta du/dz) + g sin(theta) = 0,   eta = mu(I) p/|grad u|,   p = g cos(theta) (H - z),
    u = 0 on the floor, no stress on the surface, |eta du/dy| <= mu_w p at the walls, equal where they are slid along.

Finite volumes over half of the width, ROWS rows (48), Picard's iteration; the options of `chute` by default. Prints heights
and mean velocities across. Needs numpy and scipy.
"""
import argparse

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

SLOPE, DEPTH, WIDTH = np.radians(26), 0.03, 0.04
DIAMETER, SHARE, MU_STATIC, MU_LIMIT, I_0, MU_WALL = 5.3e-4, 0.6, 0.38, 0.64, 0.279, 0.23
GRAVITY = 9.81


def viscosity(u, hy, hz, pressure, least):
    """eta in the cells; |grad u| is at least `least`, 1/s."""
    across = np.pad(u, ((1, 1), (0, 0)), mode="edge")
    along = np.hstack([-u[:, :1], u, u[:, -1:]])  # no slip below, no stress above
    rate = np.sqrt(((across[2:] - across[:-2]) / (2 * hy)) ** 2 + ((along[:, 2:] - along[:, :-2]) / (2 * hz)) ** 2 +
                   least ** 2)
    inertial = DIAMETER * rate / np.sqrt(SHARE * pressure)
    return (MU_STATIC + (MU_LIMIT - MU_STATIC) / (1 + I_0 / inertial)) * pressure / rate


def system(u, eta, hy, hz, pressure):
    """The matrix of the linear problem with this eta and these walls."""
    number = np.arange(u.size).reshape(u.shape)
    diagonal = np.zeros(u.shape)
    rows, columns, values = [], [], []
    for axis, weight in ((0, hz / hy), (1, hy / hz)):
        a = [slice(None)] * 2
        b = [slice(None)] * 2
        a[axis], b[axis] = slice(None, -1), slice(1, None)
        a, b = tuple(a), tuple(b)
        between = 2 * eta[a] * eta[b] / (eta[a] + eta[b]) * weight
        for one, other in ((a, b), (b, a)):
            diagonal[one] += between
            rows.append(number[one].ravel())
            columns.append(number[other].ravel())
            values.append(-between.ravel())
    diagonal[:, 0] += eta[:, 0] * hy / (hz / 2)
    diagonal[-1] += hz * np.minimum(eta[-1] / (hy / 2), MU_WALL * pressure / np.maximum(np.abs(u[-1]), 1e-9))
    rows.append(number.ravel())
    columns.append(number.ravel())
    values.append(diagonal.ravel())
    return coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))).tocsr()


def solve(rows):
    half = max(2, round(rows * WIDTH / 2 / DEPTH))
    hy, hz = WIDTH / 2 / half, DEPTH / rows
    z = (np.arange(rows) + 0.5) * hz
    pressure = GRAVITY * np.cos(SLOPE) * (DEPTH - z)
    u = np.tile(z / DEPTH, (half, 1))
    force = np.full(u.size, GRAVITY * np.sin(SLOPE) * hy * hz)
    for least in (0.3, 0.03, 0.003):
        for _ in range(2000):
            new = spsolve(system(u, viscosity(u, hy, hz, pressure, least), hy, hz, pressure), force).reshape(u.shape)
            change = np.abs(new - u).max()
            u = (u + new) / 2
            if change < 1e-6:
                break
        else:
            raise SystemExit(f"not converged: {change:.1e} m/s")
    return z, u.mean(0)


def main():
    parser = argparse.ArgumentParser(description="The chute of `chute --dim 3` by the local law in all of its section.")
    parser.add_argument("rows", type=int, nargs="?", default=48, help="over the depth, 4 or more")
    options = parser.parse_args()
    if options.rows < 4:
        parser.error(f"ROWS is {options.rows}; allowed: 4 or more")
    z, mean = solve(options.rows)
    print("height (mm), mean velocity across (m/s)")
    for height in np.linspace(0, DEPTH, 13):
        print(f"{1000 * height:6.1f} {np.interp(height, np.append(0, z), np.append(0, mean)):.4f}")
    surface = mean[-1] + (mean[-1] - mean[-2]) / 2
    print(f"surface {surface:.4f} m/s, flux {mean.mean() * DEPTH:.6f} m2/s")


if __name__ == "__main__":
    main()
