# SPDX-License-Identifier: MIT
# Run B00 of Rousseau et al. 2023 in 2-D, and a picture of it: B00.png.
import matplotlib.pyplot as plt
import my_talus

sim = my_talus.Simulation2(
    size=(1.52, 0.15), cells=(76, 15), density=1470, gravity=(0, -9.81), time_step=1.66e-3, friction=0.44,
    lower=(0.23, "no_slip"), upper=(0.23, "open"), boxes=[((0, 0), (1.52, 0.02)), ((0, 0.02), (0.22, 0.13))],
    gate=my_talus.Gate(position=0.22, bottom=0.02, friction=0.23))
figure, axes = plt.subplots(4, figsize=(10, 8), layout="constrained", subplot_kw={"aspect": 1, "xlim": (0, 0.8)})
for panel, time in zip(axes, (0.1, 0.3, 0.5, 1.5)):
    while sim.time < time:
        sim.step()
    points = panel.scatter(*sim.position.T, c=(sim.velocity**2).sum(1)**0.5, s=2, vmin=0, vmax=1)
    panel.set(ylabel="z (m)", title=f"t = {sim.time:.2f} s, run-out {sim.front(0.022) - 0.22:.3f} m")
figure.supxlabel("x (m)")
figure.colorbar(points, ax=axes, label="speed (m/s)")
figure.savefig("B00.png")
