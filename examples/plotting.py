# SPDX-License-Identifier: MIT
"""What the plot scripts of the examples share: tables, and sections of a flow as pictures."""
import csv
import math
import pathlib
import sys
import warnings

import matplotlib
import matplotlib.colors
import matplotlib.ticker
import numpy as np

# From sand at rest to dark blue; it starts away from white, which means: no material.
SPEED = matplotlib.colors.LinearSegmentedColormap.from_list(
    "speed", matplotlib.colormaps["YlGnBu"](np.linspace(0.1, 1, 256)))

DEPTH = matplotlib.colors.LinearSegmentedColormap.from_list(
    "depth", matplotlib.colormaps["YlOrBr"](np.linspace(0.25, 1, 256)))

INTERFACE = "#D55E00"  # between materials, of Okabe and Ito
SOLID = "0.35"
SURFACE = 0.51  # solid fraction; not 1/2, which all nodes have on a section along a wall


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
    table = read_table(path, ["time_s", "x_m", "z_m", "volume_fraction", "speed_m_s"],
                       ["y_m", "solid_fraction", *(f"material_{m}_fraction" for m in range(1, 10))])
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


def section_image(section, factor=8, value="speed_m_s", everywhere=False):
    """A column of a section on a refined grid, masked outside the material unless it counts everywhere."""
    x, column = np.unique(section["x_m"].round(9), return_inverse=True)
    z, row = np.unique(section["z_m"].round(9), return_inverse=True)
    fraction, values = np.zeros((len(z), len(x))), np.zeros((len(z), len(x)))
    fraction[row, column] = 1 if everywhere else section["volume_fraction"]
    values[row, column] = section[value]
    return refined(x, z, fraction, values, factor)


class SectionPicture:
    """The speed on a section at one instant, with the outlines of the material, of the materials in it if
    there are several, and of what is rigid."""

    def __init__(self, section, factor=8):
        self.x, self.z, self.speed = section_image(section, factor)
        self.parts = [section_image(section, factor, name)[2] for name in section if name.startswith("material_")]
        self.solid = (section_image(section, factor, "solid_fraction", everywhere=True)[2]
                      if "solid_fraction" in section else None)

    def draw(self, axes, norm):
        """Returns the image, for a colour bar."""
        image = axes.pcolormesh(self.x, self.z, self.speed, norm=norm, cmap=SPEED, shading="nearest",
                                rasterized=True)
        if 0 < self.speed.count() < self.speed.size:
            axes.contour(self.x, self.z, (~np.ma.getmaskarray(self.speed)).astype(float), [0.5],
                         colors="black", linewidths=1)
        for part in self.parts:
            if part.count() > 0 and part.min() < 0.5 < part.max():
                axes.contour(self.x, self.z, part, [0.5], colors=INTERFACE, linewidths=1.5)
        if self.solid is not None and self.solid.max() > SURFACE:
            axes.contourf(self.x, self.z, self.solid, [SURFACE, 2], colors=[SOLID], zorder=3)
        axes.set(xlim=(self.x[0], self.x[-1]), ylim=(self.z[0], self.z[-1]), aspect="equal")
        return image


def round_ticks(highest, gap=0.11):
    """0 and round numbers up to `highest`, at least the share `gap` of a square-root scale apart."""
    decade = 10 ** math.floor(math.log10(highest))
    ticks = []
    for tick in (m * decade / d for d in (1, 10, 100) for m in (8, 5, 3, 2, 1)):
        above = ticks[-1] if ticks else math.inf
        if tick <= highest and (
                math.sqrt(above) - math.sqrt(tick) > gap * math.sqrt(highest)):
            ticks.append(float(f"{tick:.3g}"))
    return [0, *(t for t in reversed(ticks) if t > 0.01 * (gap / 0.11) ** 2 * highest)]


def read_grid(path):
    """An ESRI ASCII grid that talus wrote: x and y of the middle of its cells, and the values, #y
    by #x from the south, masked where there is none."""
    with open(path) as file:
        header = dict(next(file).lower().split() for _ in range(6))
        try:
            values = np.loadtxt(file, ndmin=2)[::-1]
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from error
    cell = float(header["cellsize"])
    x = float(header["xllcorner"]) + cell * (np.arange(values.shape[1]) + 0.5)
    y = float(header["yllcorner"]) + cell * (np.arange(values.shape[0]) + 0.5)
    return x, y, np.ma.masked_equal(values, float(header["nodata_value"]))


def colour_bar(figure, axes, image, label):
    """Of what is drawn with a square-root scale, with as many ticks as there is room for."""
    bar = figure.colorbar(image, cax=axes, extend="max")
    bar.set_label(label)
    height = axes.get_position().height * figure.get_figheight()  # inches
    bar.set_ticks(round_ticks(image.norm.vmax, max(0.11, 0.25 / height)))
    bar.ax.yaxis.set_major_formatter("{x:g}")
    bar.minorticks_off()


class GroundMap:
    """What lies on a terrain, drawn on its relief, in the coordinates of the map."""

    def __init__(self, folder):
        self.x, self.y, self.heights = read_grid(folder / "terrain.asc")
        self.table = read_table(folder / "maps.csv", ["time_s", "x_m", "y_m", "depth_m", "speed_m_s"])
        self.times = np.unique(self.table["time_s"])
        self.ratio = np.ptp(self.y) / np.ptp(self.x)
        self.norm = matplotlib.colors.PowerNorm(0.5, vmin=0, clip=True,
                                                vmax=np.percentile(self.table["depth_m"], 99.8))
        gaps = np.diff(np.unique(self.table["x_m"]))
        self.cell = gaps.min() if gaps.size else self.x[1] - self.x[0]

    def draw(self, axes, time):
        """At the snapshot nearest to `time`; returns the image, for colour_bar."""
        light = matplotlib.colors.LightSource(azdeg=315, altdeg=40)
        cell = self.x[1] - self.x[0]
        relief = light.hillshade(self.heights.filled(np.nan), dx=cell, dy=cell)
        half = cell / 2
        axes.imshow(relief, cmap="gray", vmin=-0.5, vmax=1.1, origin="lower", interpolation="bilinear",
                    extent=(self.x[0] - half, self.x[-1] + half, self.y[0] - half, self.y[-1] + half))
        lines = axes.contour(self.x, self.y, self.heights, 12, colors="0.35", linewidths=0.5)
        axes.clabel(lines, lines.levels[::3], fmt="%g", fontsize=8)
        now = at_time(self.table, time)
        # from the first cell that has something: the terrain's own may be larger or smaller
        column = np.rint((now["x_m"] - now["x_m"].min()) / self.cell).astype(int)
        row = np.rint((now["y_m"] - now["y_m"].min()) / self.cell).astype(int)
        depth = np.zeros((row.max() + 1, column.max() + 1))
        depth[row, column] = now["depth_m"]
        x = now["x_m"].min() + self.cell * np.arange(depth.shape[1])
        y = now["y_m"].min() + self.cell * np.arange(depth.shape[0])
        image = axes.pcolormesh(x, y, np.ma.masked_less_equal(depth, 0), norm=self.norm, cmap=DEPTH,
                                shading="nearest", alpha=0.85, rasterized=True)
        axes.set(xlim=(self.x[0] - half, self.x[-1] + half), ylim=(self.y[0] - half, self.y[-1] + half),
                 aspect="equal")
        for axis, count in ((axes.xaxis, 5), (axes.yaxis, 4)):
            axis.set_major_locator(matplotlib.ticker.MaxNLocator(count))
        axes.ticklabel_format(useOffset=False, style="plain")
        axes.set_title(f"t = {now['time_s'][0]:.1f} s", fontsize=12)
        return image


# What became of the energy: a band of the picture, and the columns of energy.csv that it sums up.
SINKS = [("friction of the medium", ["friction"]),
         ("floor and walls", ["face_"]),
         ("gate, obstacles", ["obstacle_"]),
         ("free bodies", ["body_"]),
         ("collisions of the medium", ["impact"]),
         ("room: voids, expansion", ["room", "cohesion"]),
         ("viscosity", ["viscosity"]),
         ("transfers", ["to_grid", "to_particles", "moved", "shifting", "held", "turning"]),
         ("solver's error", ["solver_error"])]
# of Okabe and Ito, then greys
SINK_COLOURS = ["#E69F00", "#D55E00", "#CC79A7", "#F0E442", "#009E73", "#56B4E9", "0.75", "0.5", "black"]


def read_energy(folder):
    """The table energy.csv (--budget), or None if there is none."""
    path = folder / "energy.csv"
    if not path.is_file():
        return None
    with open(path, newline="") as file:
        return read_table(path, next(csv.reader(file)))


def energy_panel(axes, energy, unit):
    """Stacked areas: what became of the energy that was released, and what still moves."""
    time = energy["time_s"]
    moving = energy["kinetic_J"] + energy["within_J"]
    bands = [("motion", "#0072B2", moving)]
    for (label, columns), colour in zip(SINKS, SINK_COLOURS):
        names = [n for n in energy if any(n == c + "_J" or (c[-1] == "_" and n.startswith(c)) for c in columns)]
        bands.append((label, colour, -np.sum([energy[n] for n in names], axis=0) if names else 0 * time))
    # what went in is all that is not in a band; it was in the motion from the start, or came by
    # gravity, bodies and particles
    released = np.sum([band for _, _, band in bands], axis=0)
    scale = np.abs(released).max()
    shown = [band for band in bands if np.abs(band[2]).max() > 0.002 * scale]
    up, down = np.zeros_like(time), np.zeros_like(time)
    for label, colour, values in shown:
        gain = values.max() <= 0.001 * scale  # a source: below the axis
        base = down if gain else up
        end = base + values
        axes.fill_between(time, base, end, color=colour, lw=0, label=label, zorder=2)
        if gain:
            down = end
        else:
            up = end
    axes.plot(time, released, color="black", lw=1.6, zorder=3, label="all that was released")
    axes.axhline(0, color="0.4", lw=0.8, zorder=3)
    axes.set(xlim=(time[0], time[-1]), xlabel="time (s)", ylabel=f"energy ({unit})")
    axes.margins(y=0.05)
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], labels[::-1], loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)


def run(usage, data, draw, font_size=13, files=False):
    """The main program of a plot script: draws what is in the folder that is its one argument.
    usage: its docstring; data: the file that says what to draw; draw(folder): the figure and the name
    of its file; files: more arguments are allowed, and given to draw as well."""
    script = pathlib.Path(sys.argv[0]).name
    if len(sys.argv) < 2 or (len(sys.argv) > 2 and not files) or sys.argv[1] in ("-h", "--help"):
        sys.exit(usage)
    folder = pathlib.Path(sys.argv[1])
    matplotlib.rcParams.update({"font.size": font_size, "axes.spines.top": False, "axes.spines.right": False})
    try:
        figure, name = draw(folder, *map(pathlib.Path, sys.argv[2:]))
        figure.savefig(folder / name, dpi=100)
    except OSError as error:
        sys.exit(f"{script}: {error.filename}: {error.strerror}")
    except KeyError as error:
        sys.exit(f"{script}: {folder / data}: no entry {error}")
    except ValueError as error:
        sys.exit(f"{script}: {error}")
    print(folder / name)
