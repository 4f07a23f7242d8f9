# SPDX-License-Identifier: MIT
# A heap slumps with one friction coefficient, and with a law that is a Python function: where the fronts come to.
import my_talus


def mu_of_i(I):
    """0 <= I <= infinity; called once a node and step, and once more for each friction update."""
    return 0.38 if I == 0 else 0.38 + 0.26 / (1 + 0.279 / I)


def front(**law):
    sim = my_talus.Simulation2(
        size=(0.6, 0.2), cells=(60, 20), density=1470, gravity=(0, -9.81), time_step=1e-3,
        lower=("free_slip", "no_slip"), upper=("free_slip", "open"), boxes=[((0, 0), (0.15, 0.15))], **law)
    while sim.time < 1:
        sim.step()
    return sim.front(level=0.01)


beads = my_talus.InertialNumber(grain_diameter=5e-4, density=1470, strain_factor=1)
print(f"constant: {front(friction=0.44):.3f} m, mu(I): {front(friction=mu_of_i, inertial=beads):.3f} m")
