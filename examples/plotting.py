# SPDX-License-Identifier: MIT
"""What the plot scripts of the examples share: tables, and sections of a flow as pictures."""
import csv
import math
import pathlib
import sys
import warnings

import matplotlib
import matplotlib.colors
import numpy as np

# From sand at rest to dark blue; it starts away from white, which means: no material.
SPEED = matplotlib.colors.LinearSegmentedColormap.from_list(
    "speed", matplotlib.colormaps["YlGnBu"](np.linspace(0.1, 1, 256)))


def read_table(path, columns, optional=()):
    """The columns of a CSV file, by name; of the optional ones those that are there."""
    with open(path, newline="") as file:
        names = next(csv.reader(file), [])
        missing = [c for c in columns if c not in names]
        if missing:
            raise ValueError(f"{path}: no column {', '.join(missing)}")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # an empty table is reported below
                values = np.loadtxt(file, delimiter=",", ndmin=2)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from error
    if values.size == 0:
        raise ValueError(f"{path}: no rows")
    return {c: values[:, names.index(c)] for c in [*columns, *optional] if c in names}


def read_sections(path, row=None):
    """The table sections.csv, of one row across: the one at y = row (m), else the middle one."""
    table = read_table(path, ["time_s", "x_m", "z_m", "volume_fraction", "speed_m_s"], ["y_m"])
    if "y_m" not in table:  # 2-D
        return table
    y = np.unique(table["y_m"])
    here = table["y_m"] == (y[len(y) // 2] if row is None else y[np.argmin(np.abs(y - row))])
    return {name: column[here] for name, column in table.items()}


def at_time(table, time):
    """The rows of the instant of the table that is nearest to `time`."""
    times = table["time_s"]
    rows = times == times[np.argmin(np.abs(times - time))]
    return {name: column[rows] for name, column in table.items()}


def number(values, key):
    """values[key] if it is a finite number, else None."""
    value = (values or {}).get(key)
    usable = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if usable and math.isfinite(value) else None


def choose_times(times, rest_time, count=6):
    """About `count` of `times`: spread over the flow, plus the last."""
    last = times[-1]
    end = rest_time if rest_time is not None and times[0] < rest_time < last else last
    wanted = np.append(np.linspace(times[0], end, count - 1 if end < last else count), last)
    return np.unique([times[np.argmin(np.abs(times - t))] for t in wanted])


def refined(x, z, fraction, speed, factor=8):
    """Bilinear refinement of nodal data, so that the outline of the material is smooth. The speed
    is weighted by the fraction: empty nodes have none that means anything."""
    weight = np.nan_to_num(fraction)
    momentum = weight * np.nan_to_num(speed)
    fine_x = np.linspace(x[0], x[-1], factor * (len(x) - 1) + 1)
    fine_z = np.linspace(z[0], z[-1], factor * (len(z) - 1) + 1)

    def interpolate(values):
        rows = np.array([np.interp(fine_x, x, row) for row in values])
        return np.array([np.interp(fine_z, z, column) for column in rows.T]).T

    weight, momentum = interpolate(weight), interpolate(momentum)
    with np.errstate(divide="ignore", invalid="ignore"):
        fine_speed = momentum / weight
    return fine_x, fine_z, np.ma.masked_where(~(weight >= 0.5), fine_speed)


def section_image(section):
    """The speed of a section (m/s) on a refined grid, masked outside the material."""
    x, column = np.unique(section["x_m"].round(9), return_inverse=True)
    z, row = np.unique(section["z_m"].round(9), return_inverse=True)
    fraction, speed = np.zeros((len(z), len(x))), np.zeros((len(z), len(x)))
    fraction[row, column] = section["volume_fraction"]
    speed[row, column] = section["speed_m_s"]
    return refined(x, z, fraction, speed)


def round_ticks(highest):
    """0 and round numbers up to `highest`, far enough apart on a square-root scale."""
    decade = 10 ** math.floor(math.log10(highest))
    ticks = []
    for tick in (m * decade / d for d in (1, 10, 100) for m in (8, 5, 3, 2, 1)):
        above = ticks[-1] if ticks else math.inf
        if tick <= highest and (
                math.sqrt(above) - math.sqrt(tick) > 0.11 * math.sqrt(highest)):
            ticks.append(float(f"{tick:.3g}"))
    return [0, *(t for t in reversed(ticks) if t > 0.01 * highest)]


def run(usage, data, draw, font_size=13):
    """The main program of a plot script: draws what is in the folder that is its one argument.
    usage: its docstring; data: the file that says what to draw; draw(folder): the figure and the name
    of its file."""
    script = pathlib.Path(sys.argv[0]).name
    if len(sys.argv) != 2 or sys.argv[1] in ("-h", "--help"):
        sys.exit(usage)
    folder = pathlib.Path(sys.argv[1])
    matplotlib.rcParams.update({"font.size": font_size, "axes.spines.top": False, "axes.spines.right": False})
    try:
        figure, name = draw(folder)
        figure.savefig(folder / name, dpi=100)
    except OSError as error:
        sys.exit(f"{script}: {error.filename}: {error.strerror}")
    except KeyError as error:
        sys.exit(f"{script}: {folder / data}: no entry {error}")
    except ValueError as error:
        sys.exit(f"{script}: {error}")
    print(folder / name)
