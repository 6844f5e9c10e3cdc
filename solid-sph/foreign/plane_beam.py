"""Beams as the solid of a steady scene. TimoshenkoBeam deforms in bending, shear and stretch: the plane, geometrically exact form of Timoshenko's theory
(Reissner, J. Appl. Math. Phys. 23, 1972; Simo, Comput. Methods Appl. Mech. Eng. 49, 1985), linear elements with one
integration point, so that thin ones do not lock. Cross-sections stay plane and carry the wet nodes on the outline. HingedBar is rigid and turns on
a spring at its foot, the least that a fin can be."""
import math
from box_scene import BoxScene
from estuary_participant import Participant, Refused, check, payload

AXES = {"bottom": (0, 1), "top": (0, -1), "left": (1, 0), "right": (-1, 0)}  # of a beam clamped there
OPPOSITE = {"bottom": "top", "top": "bottom", "left": "right", "right": "left"}


def solve_banded(rows, right, half):
    """Gaussian elimination of a symmetric band matrix; rows[i][k] is the entry of column i + k."""
    n = len(rows)
    for i in range(n):
        pivot = rows[i][0]
        for k in range(1, min(half, n - i - 1) + 1):
            factor = rows[i][k] / pivot
            if factor:
                for j in range(k, min(half, n - i - 1) + 1):
                    rows[i + k][j - k] -= factor * rows[i][j]
                right[i + k] -= factor * right[i]
    for i in reversed(range(n)):
        right[i] = (right[i] - sum(rows[i][k] * right[i + k] for k in range(1, min(half, n - i - 1) + 1))) / rows[i][0]
    return right


class TimoshenkoBeam(Participant):
    name, roles, capabilities = "timoshenko-beam", ["solid"], ["steady", "wet-surface"]

    def configure(self, table, scene):
        self.scene = box = BoxScene(table, scene)
        self.elements = int(table.take("elements", 50, int))
        correction = table.take("shear_correction", 5 / 6)
        if not 2 <= self.elements <= 10000:
            table.problem("elements", "'solid.elements' is between 2 and 10000")
        if len(box.clamped) != 1:
            table.problem("clamped", "a beam is clamped at one side")
        if table.problems:
            return {}
        self.clamp = box.clamped[0]
        if box.wet and set(box.wet) != set(AXES) - {self.clamp}:
            table.problem("wet", "a beam is wet on its three free sides, or on none")
        self.tip = OPPOSITE[self.clamp]
        for side, _ in box.loads:
            if side != self.tip:
                table.problem("load", f"a beam is loaded at its tip, \"{self.tip}\", or by the fluid")
        size = [high - low for low, high in zip(box.low, box.high)]
        self.axis = AXES[self.clamp]
        self.normal = (-self.axis[1], self.axis[0])
        along = 0 if self.axis[0] else 1
        self.length, self.thickness = size[along], size[1 - along]
        middle = [0.5 * (low + high) for low, high in zip(box.low, box.high)]
        self.foot = [m - 0.5 * self.length * a for m, a in zip(middle, self.axis)]
        young = box.young / (1 - box.poisson ** 2) if box.plane == "strain" else box.young
        shear = box.young / (2 * (1 + box.poisson))
        self.stretching, self.bending = young * self.thickness, young * self.thickness ** 3 / 12
        self.shearing = correction * shear * self.thickness
        return {"beam": f"{self.elements} elements, length {self.length:g} m, thickness {self.thickness:g} m",
                "bending stiffness": f"{self.bending:.6g} N m"}

    def start(self, initial):
        self.state = [0.0] * (3 * self.elements + 3)  # along, across, rotation of each cross-section
        h, n = 0.5 * self.thickness, self.elements
        tip = max(2, round(self.thickness / (self.length / n)))  # segments over the tip
        # Clockwise: up the side to which the normal points, over the tip, down the other one.
        self.wet = [(i, h) for i in range(n)] + [(n, h - k * self.thickness / tip) for k in range(tip)] + [(i, -h) for i in range(n, -1, -1)]
        self.force = [0.0] * (2 * len(self.wet))
        if not self.scene.wet:
            return payload.Exchange()
        surface = payload.WetSurface(identity=1, dimension=2, closed=False)
        for node, offset in self.wet:
            s = self.length * node / n
            surface.reference_positions.extend(self.foot[c] + s * self.axis[c] + offset * self.normal[c] for c in range(2))
        for k in range(len(self.wet) - 1):
            surface.connectivity.extend([k, k + 1])
        return payload.Exchange(wet_surface=surface, displacements=self.motion())

    def moved(self, u, w, theta, offset, s):
        """Displacement of the point at `s` along the axis and `offset` from it, in the scene's frame."""
        along, across = u - offset * math.sin(theta), w + offset * (math.cos(theta) - 1)
        return [along * self.axis[c] + across * self.normal[c] for c in range(2)]

    def motion(self):
        displacement = [value for node, offset in self.wet for value in self.moved(*self.state[3 * node:3 * node + 3], offset, self.length * node / self.elements)]
        return payload.Displacements(surface=1, displacement=displacement, velocity=[0.0] * len(displacement))

    def local(self, force):
        return [sum(force[c] * direction[c] for c in range(2)) for direction in (self.axis, self.normal)]

    def residual(self, state, share):
        """Loads less internal forces, the tangent's band, and the strain energy."""
        n, length = self.elements, self.length / self.elements
        out, band, energy = [0.0] * (3 * n + 3), [[0.0] * 6 for _ in range(3 * n + 3)], 0.0
        for e in range(n):
            u1, w1, t1, u2, w2, t2 = state[3 * e:3 * e + 6]
            du, dw, kappa, t = (u2 - u1) / length, (w2 - w1) / length, (t2 - t1) / length, 0.5 * (t1 + t2)
            c, s = math.cos(t), math.sin(t)
            stretch, gamma = (1 + du) * c + dw * s, -(1 + du) * s + dw * c
            N, Q, M = self.stretching * (stretch - 1), self.shearing * gamma, self.bending * kappa
            energy += 0.5 * length * (N * (stretch - 1) + Q * gamma + M * kappa)
            # Changes of u', w', theta (and kappa) with the element's six degrees of freedom.
            d = [[-1 / length, 0, 0, 1 / length, 0, 0], [0, -1 / length, 0, 0, 1 / length, 0], [0, 0, 0.5, 0, 0, 0.5]]
            b_n = [c * d[0][k] + s * d[1][k] + gamma * d[2][k] for k in range(6)]
            b_q = [-s * d[0][k] + c * d[1][k] - stretch * d[2][k] for k in range(6)]
            b_m = [0, 0, -1 / length, 0, 0, 1 / length]
            a = [(-N * s - Q * c) * d[0][k] + (N * c - Q * s) * d[1][k] for k in range(6)]
            g = -N * stretch - Q * gamma
            for i in range(6):
                out[3 * e + i] -= length * (N * b_n[i] + Q * b_q[i] + M * b_m[i])
                for k in range(i, 6):
                    band[3 * e + i][k - i] += length * (
                        self.stretching * b_n[i] * b_n[k] + self.shearing * b_q[i] * b_q[k] + self.bending * b_m[i] * b_m[k] +
                        a[i] * d[2][k] + d[2][i] * a[k] + g * d[2][i] * d[2][k])
        for place, (node, offset) in enumerate(self.wet):
            fx, fy = self.local(self.force[2 * place:2 * place + 2])
            c, s = math.cos(state[3 * node + 2]), math.sin(state[3 * node + 2])
            out[3 * node] += share * fx
            out[3 * node + 1] += share * fy
            out[3 * node + 2] -= share * offset * (c * fx + s * fy)
            band[3 * node + 2][0] -= share * offset * (s * fx - c * fy)
        for _, force in self.scene.loads:
            fx, fy = self.local(force)
            out[3 * n] += share * fx
            out[3 * n + 1] += share * fy
        return out, band, energy

    def equilibrium(self, state, share):
        """Newton's method from `state`; nothing when it does not get there."""
        scale = None
        for _ in range(50):
            out, band, self.energy = self.residual(state, share)
            self.reaction = [-value for value in out[:3]]
            free, rows = out[3:], band[3:]
            size = math.sqrt(sum(value * value for value in free))
            if not math.isfinite(size):
                return None
            step = solve_banded(rows, free, 5)
            state = state[:3] + [value + change for value, change in zip(state[3:], step)]
            largest = max(map(abs, step))
            scale = max(map(abs, state)) or 1.0
            if not math.isfinite(largest) or largest > 10 * max(self.length, math.pi):
                return None
            if largest <= 1e-11 * scale or size == 0:
                return state
        return None

    def advance(self, window, inputs):
        if self.scene.wet:
            self.force = check("inputs.forces", inputs.forces.force, 2 * len(self.wet), inputs.forces.surface, 1)
        found = self.equilibrium(self.state, 1.0)
        steps = 4
        while found is None and steps <= 256:  # brings the load on in parts, from rest
            found = [0.0] * len(self.state)
            for k in range(1, steps + 1):
                found = found and self.equilibrium(found, k / steps)
            steps *= 4
        if found is None:
            raise Refused("the beam finds no equilibrium under this load", "NOT_CONVERGED", advice="a smaller load")
        self.state = found
        outputs = payload.Exchange(displacements=self.motion()) if self.scene.wet else payload.Exchange()
        return outputs, {watch["name"]: self.watch(watch) for watch in self.scene.watches}

    def watch(self, watch):
        if "point" not in watch:
            reaction = [self.reaction[0] * self.axis[c] + self.reaction[1] * self.normal[c] for c in range(2)]
            return {"internal_energy": self.energy, "reaction_x": reaction[0], "reaction_y": reaction[1]}
        s, offset = self.local([point - foot for point, foot in zip(watch["point"], self.foot)])
        node = min(self.elements - 1, max(0, int(s / self.length * self.elements)))
        share = s / self.length * self.elements - node
        before, after = self.state[3 * node:3 * node + 3], self.state[3 * node + 3:3 * node + 6]
        x, y = self.moved(*((1 - share) * a + share * b for a, b in zip(before, after)), offset, s)
        return {"displacement_x": x, "displacement_y": y, "displacement": math.hypot(x, y)}


class HingedBar(TimoshenkoBeam):
    """One degree of freedom. The spring 4 E' I / L gives an evenly loaded bar the tip of an evenly loaded cantilever, while both bend little."""
    name = "hinged-bar"

    def configure(self, table, scene):
        spring = table.take("rotation_spring", 0.0)  # N m per metre of depth
        if (plan := super().configure(table, scene)) and not table.problems:
            self.spring = spring or 4 * self.bending / self.length
            plan["spring"] = f"{self.spring:.6g} N m"
        return plan

    def moved(self, u, w, theta, offset, s):
        """The foot stays on the floor, and what would turn into the floor ends at it: no fluid gets below the bar."""
        if s == 0:
            return [0.0, 0.0]
        along, across = u - offset * math.sin(theta), w + offset * (math.cos(theta) - 1)
        along = max(along, -s)
        return [along * self.axis[c] + across * self.normal[c] for c in range(2)]

    def equilibrium(self, state, share):
        """Newton's method for the angle: spring times angle is the moment of the loads about the foot."""
        step, angle = self.length / self.elements, state[2]
        points = [(step * node, offset, *self.local(self.force[2 * k:2 * k + 2])) for k, (node, offset) in enumerate(self.wet)]
        points += [(self.length, 0.0, *self.local(force)) for _, force in self.scene.loads]
        for _ in range(50):
            c, s = math.cos(angle), math.sin(angle)
            moment = sum((c * x - s * y) * fy - (s * x + c * y) * fx for x, y, fx, fy in points)
            change = sum(-(s * x + c * y) * fy - (c * x - s * y) * fx for x, y, fx, fy in points)
            move = (share * moment - self.spring * angle) / (self.spring - share * change)
            angle += move
            if not abs(angle) < math.pi:
                return None
            if abs(move) <= 1e-12 * max(abs(angle), 1e-6):
                self.energy, self.reaction = 0.5 * self.spring * angle ** 2, [-share * sum(p[k] for p in points) for k in (2, 3)]
                sections = [step * node for node in range(self.elements + 1)]
                return [value for x in sections for value in (x * (math.cos(angle) - 1), x * math.sin(angle), angle)]
        return None
