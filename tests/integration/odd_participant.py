#!/usr/bin/python3
"""A solid that does one thing wrong, named on its command line, for tests of `coupler run` and `coupler conform`."""
import sys
import estuary_participant as kit
from estuary_participant import Participant, check, payload, serve

FAULT = next((word[len("--fault="):] for word in sys.argv if word.startswith("--fault=")), "")
sys.argv = [word for word in sys.argv if not word.startswith("--fault=")]


class Odd(Participant):
    name, roles, dimensions = "odd", ["solid"], [2]
    capabilities = ["steady", "transient", "wet-surface", "rewind"]

    def configure(self, table, scene):
        self.stiffness = table.take("stiffness", 1.0)
        if FAULT == "no-grain-states":
            for key in table.values:
                table.take(key, 0, None)

    def start(self, initial):
        self.memory = 0.0
        positions = [0.0, 0.0, 1.0, 0.0] if FAULT != "surface-in-3d" else [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
        self.size = len(positions)
        dimension = 3 if FAULT == "surface-in-3d" else 2
        self.surface = payload.WetSurface(identity=5, dimension=dimension, reference_positions=positions, connectivity=range(dimension))
        if FAULT in ("no-surface", "no-grain-states"):
            return payload.Exchange()
        if FAULT == "no-start-displacements":
            return payload.Exchange(wet_surface=self.surface)
        if FAULT == "no-start-velocity":
            return payload.Exchange(wet_surface=self.surface, displacements=payload.Displacements(surface=5, displacement=[0.0] * self.size))
        return payload.Exchange(wet_surface=self.surface, displacements=self.motion([0.0] * self.size))

    def motion(self, values):
        return payload.Displacements(surface=5, displacement=values, velocity=[0.0] * len(values))

    def advance(self, window, inputs):
        force = list(inputs.forces.force)
        if FAULT != "takes-anything":
            check("inputs.forces", force, self.size, inputs.forces.surface, 5)
        if FAULT == "dies":
            import os
            os._exit(7)
        if FAULT == "forgets-to-rewind":
            self.memory += 1e-9
        values = [f / self.stiffness + self.memory for f in force]
        if FAULT == "no-displacements":
            return payload.Exchange(), {}
        if FAULT == "answers-nan" and values:
            values[-1] = float("nan")
        return payload.Exchange(displacements=self.motion(values)), {}


if FAULT.startswith("lacks-"):
    Odd.capabilities = [word for word in Odd.capabilities if word != FAULT[len("lacks-"):]]
if FAULT == "three-dimensional":
    Odd.dimensions = [3]
if FAULT == "another-role":
    Odd.roles = ["fluid"]
if FAULT == "no-grain-states":
    Odd.roles, Odd.capabilities = ["grains"], [*Odd.capabilities, "grains"]
if FAULT == "another-protocol":
    kit.PROTOCOL_VERSION = 2
serve(Odd())
