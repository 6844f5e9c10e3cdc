"""The wet surface of a solid as LAMMPS can have it: every grain near it has a plane of its own, which touches the polyline in the
point nearest to the grain and moves and turns with it through the window. A grain therefore touches the surface in one place."""
import math
from estuary_participant import Refused


class Plane:
    """Nearest point and its displacement in the window, direction to the grain (angle) and how much it turns; the segment."""
    def __init__(self, segment, share, point, move, angle, turn, distance):
        self.segment, self.share, self.point, self.move = segment, share, point, move
        self.angle, self.turn, self.distance = angle, turn, distance


class WetPlanes:
    def __init__(self, surface):
        self.reference = list(surface.reference_positions)
        ends = list(surface.connectivity)
        self.segments = list(zip(ends[0::2], ends[1::2]))

    def node(self, displacement, k):
        return (self.reference[2 * k] + displacement[2 * k], self.reference[2 * k + 1] + displacement[2 * k + 1])

    def nearest(self, grain, centre, radius, begin, end):
        """The plane of a grain: `begin` and `end` are the nodes' displacements at the window's ends."""
        feet = []
        for a, b in self.segments:
            p, q = self.node(begin, a), self.node(begin, b)
            along = (q[0] - p[0], q[1] - p[1])
            share = ((centre[0] - p[0]) * along[0] + (centre[1] - p[1]) * along[1]) / (along[0] ** 2 + along[1] ** 2)
            share = min(1.0, max(0.0, share))
            foot = (p[0] + share * along[0], p[1] + share * along[1])
            feet.append((math.dist(foot, centre), share, foot, along, (a, b)))
        distance, share, foot, along, (a, b) = min(feet)
        towards = (centre[0] - foot[0], centre[1] - foot[1])
        inside = 0 < share < 1
        if distance == 0 or (inside and along[0] * towards[1] - along[1] * towards[0] < 0):
            raise Refused(f"grain {grain} has passed through the wet surface", "DIVERGED", "position", "a shorter window, or a larger normal_stiffness")
        for other, _, place, _, _ in feet:
            if other < radius and (place[0] - centre[0]) * -towards[0] + (place[1] - centre[1]) * -towards[1] < 0.5 * other * distance:
                raise Refused(f"grain {grain} touches the wet surface in two places, LAMMPS's planes here in one", "FAILED",
                              advice="grains.solver = \"grains-dem\"")
        p, q = self.node(end, a), self.node(end, b)
        after = (q[0] - p[0], q[1] - p[1])
        move = (p[0] + share * after[0] - foot[0], p[1] + share * after[1] - foot[1])
        turn = math.atan2(along[0] * after[1] - along[1] * after[0], along[0] * after[0] + along[1] * after[1]) if inside else 0.0
        return Plane((a, b), share, foot, move, math.atan2(towards[1], towards[0]), turn, distance)

    def add_force(self, plane, force, nodal):
        """Of a grain on the surface: divided between the two nodes of the segment."""
        for node, share in zip(plane.segment, (1 - plane.share, plane.share)):
            for axis in range(2):
                nodal[2 * node + axis] += share * force[axis]


def commands(plane, grain, window, steps, first_step, law):
    """The plane as a region of LAMMPS that moves evenly. LAMMPS takes a region's velocity from where it was one step before:
    the region is therefore made where the plane would have been one step before the window."""
    back = 1.0 / steps
    x, y = (place - back * move for place, move in zip(plane.point, plane.move))
    angle = plane.angle - back * plane.turn
    passed = f"(step-{first_step - 1})"
    # A region of another name in every window: one that LAMMPS knows from the restart file would go on from its old place.
    name = f"wet{grain}at{window}"
    return [f"variable wx{grain} equal {plane.move[0] * back:.17g}*{passed}", f"variable wy{grain} equal {plane.move[1] * back:.17g}*{passed}",
            f"variable wt{grain} equal {plane.turn * back:.17g}*{passed}",
            f"region {name} plane {x:.17g} {y:.17g} 0 {math.cos(angle):.17g} {math.sin(angle):.17g} 0 "
            f"move v_wx{grain} v_wy{grain} NULL rotate v_wt{grain} {x:.17g} {y:.17g} 0 0 0 1",
            f"fix wet{grain} touch{grain} wall/gran/region {law} region {name} contacts"]
