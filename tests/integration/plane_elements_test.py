"""The finite elements of solid-sph/foreign/plane-elements against closed forms: patch test, standing wave, plastic flow.

usage: plane_elements_test.py BUILD SOURCE
"""

import importlib.machinery
import importlib.util
import math
import pathlib
import sys
import unittest

import numpy as np

BUILD, SOURCE = (pathlib.Path(path).resolve() for path in sys.argv[1:3])
sys.path.insert(0, str(BUILD / "bin"))
sys.dont_write_bytecode = True
loader = importlib.machinery.SourceFileLoader("plane_elements", str(SOURCE / "solid-sph" / "foreign" / "plane-elements"))
module = importlib.util.module_from_spec(importlib.util.spec_from_loader("plane_elements", loader))
loader.exec_module(module)


def plate(length, thickness, across, poisson, law="saint_venant_kirchhoff", yield_stress=0.0, clamped=True, spacing=0.0):
    solid = module.PlaneElements()
    solid.thickness, solid.density, solid.young, solid.poisson = thickness, 7800.0, 2e11, poisson
    solid.law, solid.yield_stress, solid.across, solid.spacing, solid.watches = law, yield_stress, across, spacing, []
    solid.clamped = clamped
    solid.make_mesh([[0.0, 0.0], [length, 0.0]])
    return solid


class PlaneElements(unittest.TestCase):
    def forces_of(self, solid, gradient):
        """Internal forces under an affine motion, and what a constant first Piola-Kirchhoff stress on the contour asks for."""
        return solid.forces(solid.places @ (gradient - np.eye(2)).T, solid.rest())

    def on_contour(self, solid, stress, length, thickness):
        """Simpson's rule along each side: the consistent force of a constant traction on quadratic edges, reversed."""
        force = np.zeros_like(solid.places)
        x, y = solid.places.T
        for chosen, along, normal, size in ((np.isclose(x, 0), y, (-1, 0), thickness), (np.isclose(x, length), y, (1, 0), thickness),
                                            (np.isclose(y, -thickness / 2), x, (0, -1), length),
                                            (np.isclose(y, thickness / 2), x, (0, 1), length)):
            nodes = np.flatnonzero(chosen)
            nodes = nodes[np.argsort(along[nodes])]
            weights = np.zeros(len(nodes))
            for k in range(0, len(nodes) - 1, 2):
                weights[k:k + 3] += np.array([1, 4, 1]) / 6 * size * 2 / (len(nodes) - 1)
            force[nodes] -= weights[:, None] * (stress @ normal)
        return force

    def test_an_affine_motion_loads_only_the_contour_and_stores_its_energy(self):
        length, thickness = 1.0, 0.25
        solid = plate(length, thickness, 2, 0.3)
        gradient = np.array([[1.03, 0.2], [-0.1, 0.94]])
        force, _, energy = self.forces_of(solid, gradient)
        strain = 0.5 * (gradient.T @ gradient - np.eye(2))
        lame, shear = 2e11 * 0.3 / (1.3 * 0.4), 2e11 / 2.6
        second = lame * np.trace(strain) * np.eye(2) + 2 * shear * strain
        expected = self.on_contour(solid, gradient @ second, length, thickness)
        self.assertLess(np.abs(force - expected).max(), 1e-12 * np.abs(expected).max() * len(force))
        self.assertAlmostEqual(energy / (0.5 * (second * strain).sum() * length * thickness), 1, 12)
        self.assertAlmostEqual(solid.mass.sum() / (7800 * length * thickness), 1, 12)
        angle = 0.7
        turned = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        self.assertLess(np.abs(self.forces_of(solid, turned)[0]).max(), 1e-12 * 2e11 * thickness)

    def test_a_free_block_keeps_what_it_receives_and_shows_affine_motions(self):
        for spacing in (0.0, 0.12):  # a wet node at every node, and at every other
            solid = plate(1.0, 0.5, 4, 0.3, clamped=False, spacing=spacing)
            gradient = np.array([[0.02, 0.3], [-0.1, 0.05]])
            shown = solid.on_surface(solid.places @ gradient.T).reshape(-1, 2)
            surface = np.reshape(solid.on_surface(solid.places), (-1, 2))
            self.assertLess(np.abs(shown - surface @ gradient.T).max(), 1e-14)
            area = 0.5 * sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(surface, np.roll(surface, -1, axis=0)))
            self.assertAlmostEqual(area, -0.5, 12)  # clockwise, all around
            solid.start(None)
            force = np.random.default_rng(2).standard_normal(len(surface) * 2)
            window = type("Window", (), {"duration": 5e-4})()
            inputs = module.payload.Exchange(forces=module.payload.NodalForces(surface=1, force=force.tolist()))
            _, values = solid.advance(window, inputs)
            watched = solid.watch({"name": "block"})
            for axis, name in enumerate(("momentum_x", "momentum_y")):
                self.assertAlmostEqual(watched[name] / (force[axis::2].sum() * 5e-4), 1, 9)

    def test_a_standing_wave_swings_with_its_frequency_to_second_order(self):
        # Without Poisson's effect u = sin(pi x / L) cos(w t), w = pi / L sqrt(E / rho), needs no force on the faces.
        length, thickness, speed, amplitude = 1.0, 0.25, math.sqrt(2e11 / 7800), 1e-7
        errors = []
        for across in (2, 4):
            solid = plate(length, thickness, across, 0.0)
            zero = np.zeros_like(solid.places)
            start = zero.copy()
            start[:, 0] = amplitude * np.sin(math.pi * solid.places[:, 0] / length)
            solid.state = solid.accepted = (start, zero, solid.rest(), 0.0, 0.0)
            window = type("Window", (), {"duration": 2 * length / speed / 3})()  # a third of the period
            inputs = module.payload.Exchange(forces=module.payload.NodalForces(surface=1, force=[0.0] * 2 * len(solid.wet)))
            solid.advance(window, inputs)
            moved = solid.state[0]
            self.assertLess(np.abs(moved[:, 1]).max(), 0.01 * amplitude)
            errors.append(float((moved * start).sum() / (start * start).sum()) + 0.5)
        self.assertLess(abs(errors[0]), 0.01)
        self.assertGreater(abs(errors[0]), 1e-5)
        self.assertAlmostEqual(math.log2(errors[0] / errors[1]), 2, delta=0.25)

    def test_an_isochoric_stretch_flows_at_its_yield_stress(self):
        length, thickness, limit, last = 1.0, 0.25, 4e8, 0.08
        solid = plate(length, thickness, 2, 0.3, "j2_plasticity", limit)
        shear, bound = 2e11 / 2.6, limit / math.sqrt(3)
        plastic = solid.rest()
        angle = 0.4
        turned = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        for stretch in np.linspace(0, last, 5):  # logarithmic
            gradient = turned @ np.diag([math.exp(stretch), math.exp(-stretch)])
            force, plastic, energy = solid.forces(solid.places @ (gradient - np.eye(2)).T, plastic)
        kirchhoff = turned @ np.diag([bound, -bound]) @ turned.T
        expected = self.on_contour(solid, kirchhoff @ np.linalg.inv(gradient).T, length, thickness)
        self.assertLess(np.abs(force - expected).max(), 1e-10 * np.abs(expected).max())
        first = bound / (2 * shear)  # where it begins to flow
        self.assertAlmostEqual(energy / (2 * shear * first ** 2 * length * thickness), 1, 9)
        self.assertAlmostEqual(plastic[4].mean() / (2 * bound * (last - first)), 1, 9)


unittest.main(argv=sys.argv[:1] + sys.argv[3:])
