# SPDX-License-Identifier: MIT
"""Tests of the module my_talus: sh examples/python/run.sh --test [FOLDER]

FOLDER: a run of `collapse --case B00 --dim 2`, whose results are compared with the module's.
"""
import gc
import sys
import unittest
import weakref
from decimal import Decimal
from fractions import Fraction

import my_talus
import numpy as np

RUN = None  # FOLDER


def flow(friction=0.44, **changes):
    """A heap of sand that slumps on a rough floor, in 2-D."""
    options = dict(size=(0.6, 0.2), cells=(30, 10), density=1500, gravity=(0, -9.81), time_step=2e-3,
                   friction=friction, lower=("free_slip", "no_slip"), upper=("free_slip", "open"),
                   boxes=[((0, 0), (0.15, 0.15))])
    return my_talus.Simulation2(**{**options, **changes})


def flow3(**changes):
    options = dict(size=(0.4, 0.1, 0.2), cells=(8, 2, 8), density=1500, gravity=(0, 0, -9.81), time_step=2e-3,
                   friction=0.44, lower=("free_slip", 0.3, "no_slip"), upper=("free_slip", 0.3, "open"),
                   boxes=[((0, 0, 0), (0.2, 0.1, 0.1))])
    return my_talus.Simulation3(**{**options, **changes})


BEADS = my_talus.InertialNumber(grain_diameter=5e-4, density=1470, strain_factor=1)
VIEWS = ("position", "velocity", "affine", "volume", "id", "node_velocity", "node_stress_impulse")


def by_id(sim):
    """Positions and velocities, in the order of the ids: a refused step may leave another one."""
    order = np.argsort(sim.id)
    return np.hstack([sim.position[order], sim.velocity[order]])


def run(sim, steps=20):
    for _ in range(steps):
        sim.step()
    return sim


class ViewsTest(unittest.TestCase):
    def test_views_are_no_copies(self):
        sim = run(flow(), 2)
        for name in VIEWS:
            first, second = getattr(sim, name), getattr(sim, name)
            self.assertFalse(first.flags.owndata, name)
            self.assertEqual(first.__array_interface__["data"], second.__array_interface__["data"], name)
            self.assertTrue(np.shares_memory(first, second), name)

    def test_shapes_and_values(self):
        sim = run(flow())
        count = len(sim.id)
        self.assertEqual(count, 23 * 23)
        for name, shape in [("position", (count, 2)), ("velocity", (count, 2)), ("affine", (count, 2, 2)),
                            ("volume", (count,)), ("id", (count,)), ("node_velocity", (31, 11, 2)),
                            ("node_stress_impulse", (31, 11, 3))]:
            self.assertEqual(getattr(sim, name).shape, shape, name)
        self.assertEqual(sorted(sim.id), list(range(count)))
        self.assertAlmostEqual(sim.volume.sum(), 0.15**2)
        self.assertTrue(((sim.position >= 0) & (sim.position <= (0.6, 0.2))).all())

    def test_matrices_are_not_transposed(self):
        sim = my_talus.Simulation2(  # a flow down an incline: u_x grows with z alone
            size=(0.1, 0.1), cells=(5, 10), density=1500, gravity=(6, -9.81), time_step=2e-3, friction=0.3,
            lower=("periodic", "no_slip"), upper=("periodic", "open"), boxes=[((0, 0), (0.1, 0.05))], jitter=0)
        run(sim, 50)
        gradient = sim.affine.mean(axis=0)
        self.assertGreater(gradient[0, 1], 1)
        self.assertLess(abs(gradient[1, 0]), 0.1)

    def test_nodal_views_agree_with_what_is_computed(self):
        for sim in (run(flow()), run(flow3())):
            d = len(sim.axes)
            normal = sim.node_stress_impulse[..., 0]  # the first one: sqrt(d/2) times the mean
            fraction = np.minimum(1, sim.volume_fraction())
            np.testing.assert_allclose(fraction * normal * np.sqrt(2 / d) / sim.time_step, sim.pressure(), atol=1e-9)
            self.assertGreater(sim.pressure().max(), 100)
            np.testing.assert_allclose(np.trace(sim.stress(), axis1=-2, axis2=-1) / d, sim.pressure(), atol=1e-9)
            self.assertEqual(sim.pressure().shape, tuple(len(x) for x in sim.axes))
            # what is a layer of nodes around the box does not shine through
            self.assertEqual(np.abs(sim.node_velocity[..., 0, :]).max(), 0)
            self.assertGreater(np.abs(sim.node_velocity[..., 1, :]).max(), 0)
            del normal

    def test_nobody_writes_to_them(self):
        sim = run(flow(), 1)
        for name in VIEWS:
            view = getattr(sim, name)
            with self.assertRaises(ValueError):
                view[...] = 0
            with self.assertRaises(ValueError):
                view.flags.writeable = True

    def test_they_keep_the_simulation_alive(self):
        sim = run(flow(), 1)
        alive = weakref.ref(sim)
        expected = sim.position.copy()
        part = sim.position[3:, 0]  # a view of a view
        del sim
        gc.collect()
        self.assertIsNotNone(alive())
        np.testing.assert_array_equal(part, expected[3:, 0])
        del part
        self.assertIsNone(alive())

    def test_no_step_while_there_is_one(self):
        sim = run(flow(), 1)
        before, time = sim.position.copy(), sim.time
        for name in VIEWS:
            part = getattr(sim, name)[1:]
            with self.assertRaisesRegex(BufferError, rf"look at its memory \({name}\)"):
                sim.step()
            del part
        self.assertEqual(sim.time, time)
        np.testing.assert_array_equal(sim.position, before)
        kept = sim.position.copy()  # a copy does not matter
        computed = sim.pressure()  # nor what has memory of its own
        sim.step()
        self.assertGreater(sim.time, time)
        self.assertGreater(np.abs(sim.position - kept).max(), 0)
        self.assertTrue(computed.flags.owndata)

    def test_fields_belong_to_a_step(self):
        sim = flow()
        self.assertEqual(len(sim.position), 23 * 23)
        for name in ("node_velocity",):
            with self.assertRaisesRegex(ValueError, "allowed: at least 1"):
                getattr(sim, name)
        for name in ("pressure", "volume_fraction", "stress", "strain_rate", "profile"):
            with self.assertRaisesRegex(ValueError, "allowed: at least 1"):
                getattr(sim, name)()
        sim.step()  # what failed left nothing behind

    def test_an_empty_box(self):
        sim = run(flow(boxes=[]), 3)
        self.assertEqual(sim.position.shape, (0, 2))
        self.assertEqual(sim.pressure().max(), 0)


class FrictionTest(unittest.TestCase):
    def test_a_function_is_as_good_as_a_number(self):
        number, function = run(flow(0.44)), run(flow(lambda I: 0.44, inertial=BEADS))
        np.testing.assert_array_equal(by_id(number), by_id(function))

    def test_all_kinds_of_numbers(self):
        for value in (0.5, 1):
            expected = by_id(run(flow(value, lower=(value, "no_slip")), 5))
            for number in (np.float16, np.float32, np.float64, np.array, Fraction, Decimal):
                sim = flow(number(value), lower=(number(value), "no_slip"))
                np.testing.assert_array_equal(by_id(run(sim, 5)), expected, str(number))
                sim = flow(lambda I: number(value), inertial=BEADS, lower=(value, "no_slip"))
                np.testing.assert_array_equal(by_id(run(sim, 5)), expected, str(number))
        for number in (np.int64, np.uint8):
            sim = flow(number(1), lower=(number(1), "no_slip"))
            np.testing.assert_array_equal(by_id(run(sim, 5)), expected, str(number))

    def test_a_function_sees_the_inertial_number(self):
        seen = []

        def law(I):
            seen.append(I)
            return 0.38 + 0.26 / (1 + 0.279 / I) if I > 0 else 0.38

        sim = run(flow(law, inertial=BEADS))
        seen = np.array(seen)
        self.assertTrue(((seen > 1e-3) & (seen < 1)).any())
        self.assertTrue((seen >= 0).all())
        self.assertTrue(set(np.unique(sim.inertial_number())) <= {0, *seen})
        self.assertGreater(np.abs(by_id(sim) - by_id(run(flow(0.38)))).max(), 1e-6)

    def test_what_it_raises_arrives_and_the_run_goes_on(self):
        class Mine(Exception):
            pass

        raised = Mine("told so")
        broken = False

        def law(I):
            if broken:
                raise raised
            return 0.44

        sim = run(flow(law, inertial=BEADS), 10)
        before, time, pressure, steps = by_id(sim), sim.time, sim.pressure(), sim.steps
        for _ in range(3):
            broken = True
            with self.assertRaises(Mine) as caught:
                sim.step()
            self.assertIs(caught.exception, raised)
            broken = False
            self.assertEqual((sim.time, sim.steps), (time, steps))
            np.testing.assert_array_equal(by_id(sim), before)
            np.testing.assert_array_equal(sim.pressure(), pressure)
        run(sim, 10)
        np.testing.assert_allclose(by_id(sim), by_id(run(flow(0.44))), atol=1e-6)

    def test_it_must_give_a_number(self):
        answer = 0.44
        sim = run(flow(lambda I: answer, inertial=BEADS), 5)
        time = sim.time
        answer = "sand"
        with self.assertRaisesRegex(TypeError, r"friction\(.*\) gave 'sand'; allowed: a number >= 0"):
            sim.step()
        answer = True
        with self.assertRaisesRegex(TypeError, r"friction\(.*\) gave True; allowed: a number >= 0"):
            sim.step()
        for answer in (float("nan"), 10**400):
            with self.assertRaisesRegex(RuntimeError, "rheology.friction.I. gave no finite number"):
                sim.step()
        self.assertEqual(sim.time, time)
        answer = 0.44
        sim.step()
        with self.assertRaisesRegex(ValueError, "rheology.law at I = 0 is -1; allowed"):
            flow(lambda I: -1, inertial=BEADS)

    def test_it_cannot_use_the_simulation_that_calls_it(self):
        calls = []

        def law(I):
            for call in calls:
                call()
            return 0.44

        sim = run(flow(law, inertial=BEADS), 2)
        time = sim.time
        for call in (sim.step, lambda: sim.position, sim.pressure, lambda: sim.time, lambda: sim.set_gravity((0, 0))):
            calls[:] = [call]
            with self.assertRaisesRegex(RuntimeError, "is in a step"):
                sim.step()
        calls.clear()
        self.assertEqual(sim.time, time)
        sim.step()

    def test_it_runs_in_one_thread(self):
        with self.assertRaisesRegex(ValueError, "threads is 2; allowed: 1 with a friction law in Python"):
            flow(lambda I: 0.44, inertial=BEADS, threads=2)
        np.testing.assert_array_equal(by_id(run(flow(threads=2))), by_id(run(flow())))


class MistakesTest(unittest.TestCase):
    def test_they_are_named(self):
        for message, changes in [
                ("density is 0; allowed", dict(density=0)),
                (r"lower\[1\] is soft; allowed: no_slip", dict(lower=("open", "soft"))),
                ("faces in upper is 1; allowed: 2", dict(upper=("open",))),
                ("gate.friction is -1; allowed", dict(gate=my_talus.Gate(position=0.1, bottom=0, friction=-1))),
                ("gate.position is 9; allowed: in the box, 0 to 0.6",
                 dict(gate=my_talus.Gate(position=9, bottom=0, friction=0.1))),
                ("gate.position is -0.1; allowed", dict(gate=my_talus.Gate(position=-0.1, bottom=0, friction=0.1))),
                ("gate.position is nan; allowed",
                 dict(gate=my_talus.Gate(position=float("nan"), bottom=0, friction=0.1))),
                ("^friction is -1; allowed: a finite number >= 0", dict(friction=-1)),
                ("^friction is inf; allowed: a finite number >= 0", dict(friction=10**400)),
                ("^friction is -inf; allowed: a finite number >= 0", dict(friction=-10**5000)),
                ("lower.x.friction is inf; allowed: a finite number >= 0", dict(lower=(10**400, "open"))),
                (r"upper\[0\] is True; allowed: no_slip, .*, or a friction", dict(upper=(True, "open"))),
                ("grain_diameter is 0; allowed", dict(friction=lambda I: 0.4)),
                ("particles that are there already", dict(boxes=2 * [((0, 0), (0.1, 0.1))]))]:
            with self.assertRaisesRegex(ValueError, message):
                flow(**changes)
        for wrong in ("rough", "0.4", True, np.bool_(True), np.array("0.4"), np.array([0.4, 0.5]), 0.4 + 0j, None):
            with self.assertRaisesRegex(TypeError, "^friction is .*; allowed: a number >= 0, or a function"):
                flow(wrong)
        with self.assertRaises(TypeError):  # of another dimension
            flow(size=(1, 1, 1))
        with self.assertRaisesRegex(ValueError, "inertial is not given"):
            run(flow(), 1).inertial_number()
        with self.assertRaisesRegex(ValueError, "row is 9; allowed"):
            run(flow3(), 1).profile(row=9)
        with self.assertRaisesRegex(ValueError, "section_flux: position is 7; allowed"):
            run(flow(), 1).section_flux(axis=0, position=7)
        with self.assertRaisesRegex(ValueError, "static_speed is -1; allowed"):
            run(flow(), 1).profile(static_speed=-1)
        with self.assertRaisesRegex(ValueError, "level is nan; allowed"):
            run(flow(), 1).front(float("nan"))

    def test_a_step_that_fails_says_so(self):
        sim = flow()
        sim.set_gravity((0, -1e308))
        with self.assertRaisesRegex(RuntimeError, "the step was refused, all is as before it: the solver met numbers"):
            sim.step()
        self.assertEqual(sim.time, 0)


class MeasurementsTest(unittest.TestCase):
    def test_a_heap(self):
        sim = run(flow(), 100)
        profile = sim.profile()
        self.assertEqual(set(profile), {"x", "height", "static_height"})
        np.testing.assert_allclose(profile["x"], sim.axes[0])
        self.assertGreater(sim.front(0.01), 0.2)
        self.assertGreater(sim.step().sweeps, 0)
        before = sim.position[:, 0].mean()
        flux = sim.section_flux(axis=0, position=0.15)
        sim.step()
        self.assertGreater(flux, 0)
        self.assertGreater(sim.position[:, 0].mean(), before)
        self.assertEqual(sim.strain_rate().shape, (31, 11, 2, 2))

    def test_gravity(self):
        sim = flow()
        sim.set_gravity((0, 0))
        run(sim, 5)
        self.assertLess(np.abs(sim.velocity).max(), 1e-9)

    def test_the_program_gives_the_same(self):
        if RUN is None:
            self.skipTest("no run to compare with")
        import talus_results
        theirs = talus_results.Run(RUN)
        options = theirs.summary["inputs"]
        self.assertEqual((options["case"], options["dimension"]), ("B00", 2))
        sim = my_talus.Simulation2(
            size=(1.52, 0.15), cells=(76, 15), density=1470, gravity=(0, -9.81), time_step=1.66e-3, friction=0.44,
            lower=(0.23, "no_slip"), upper=(0.23, "open"), boxes=[((0, 0), (1.52, 0.02)), ((0, 0.02), (0.22, 0.13))],
            gate=my_talus.Gate(position=0.22, bottom=0.02, friction=0.23))
        run(sim, theirs.summary["steps"])
        particles = theirs.particles(sim.time)
        order, their_order = np.argsort(sim.id), np.argsort(particles["id"])
        np.testing.assert_allclose(sim.position[order], particles["points"][their_order][:, :2], atol=1e-6)
        height = theirs.profile(sim.time)["height_m"]
        np.testing.assert_allclose(sim.profile()["height"], height, atol=1e-5)


if __name__ == "__main__":
    if len(sys.argv) > 1 and not sys.argv[1].startswith("-"):
        RUN = sys.argv.pop(1)
    unittest.main()
