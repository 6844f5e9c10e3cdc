"""A box of eight-node quadrilaterals, and the outline of it that is wet."""


class BoxMesh:
    """`across` elements over the shorter side, nearly square ones along the other."""
    def __init__(self, low, high, across, along=0):
        size = [high[0] - low[0], high[1] - low[1]]
        short = 0 if size[0] <= size[1] else 1
        count = [0, 0]
        count[short] = across
        count[1 - short] = along or max(1, round(size[1 - short] / (size[short] / across)))
        self.count, self.low, self.high = count, low, high
        nx, ny = count
        # Corners and mid-sides lie on a grid of half elements; the middles of elements are no nodes.
        self.number, self.position = {}, []
        for j in range(2 * ny + 1):
            for i in range(2 * nx + 1):
                if i % 2 and j % 2:
                    continue
                self.number[i, j] = len(self.position)
                self.position.append((low[0] + size[0] * i / (2 * nx), low[1] + size[1] * j / (2 * ny)))
        around = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
        self.elements = [[self.number[2 * a + di, 2 * b + dj] for di, dj in around] for b in range(ny) for a in range(nx)]

    def side(self, name):
        """The nodes of a side, in the order in which the outline is walked clockwise."""
        i, j = 2 * self.count[0], 2 * self.count[1]
        walk = {"left": [(0, k) for k in range(j + 1)], "top": [(k, j) for k in range(i + 1)],
                "right": [(i, k) for k in range(j, -1, -1)], "bottom": [(k, 0) for k in range(i, -1, -1)]}
        return [self.number[place] for place in walk[name]]

    def outline(self, sides):
        """Nodes of the wet sides from end to end, clockwise, and whether they close."""
        order = ["left", "top", "right", "bottom"]
        if set(sides) == set(order):
            return [node for name in order for node in self.side(name)[:-1]], True
        start = next(name for name in order if name in sides and order[order.index(name) - 1] not in sides)
        names = [order[(order.index(start) + k) % 4] for k in range(4)]
        names = names[:next(k for k, name in enumerate(names + [""]) if name not in sides)]
        if len(names) != len(set(sides)):
            raise ValueError("the wet sides do not hang together")
        nodes = self.side(names[0])
        for name in names[1:]:
            nodes = nodes + self.side(name)[1:]
        return nodes, False

    def consistent_side_force(self, name, force):
        """Nodal forces of a uniform traction with this resultant on a quadratic side."""
        nodes = self.side(name)
        elements = (len(nodes) - 1) // 2
        loads = {node: [0.0, 0.0] for node in nodes}
        for e in range(elements):
            for node, share in zip(nodes[2 * e:2 * e + 3], (1 / 6, 4 / 6, 1 / 6)):
                for axis in range(2):
                    loads[node][axis] += share * force[axis] / elements
        return loads

    def displacement_at(self, point, moved):
        """Of the reference position `point`, by the element's own shape functions."""
        local, cell = [], []
        for axis in range(2):
            place = (point[axis] - self.low[axis]) / (self.high[axis] - self.low[axis]) * self.count[axis]
            cell.append(min(self.count[axis] - 1, max(0, int(place))))
            local.append(2 * (place - cell[axis]) - 1)
        x, y = local
        corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        shape = [0.25 * (1 + x * a) * (1 + y * b) * (x * a + y * b - 1) for a, b in corners]
        shape += [0.5 * (1 - x * x) * (1 - y), 0.5 * (1 + x) * (1 - y * y), 0.5 * (1 - x * x) * (1 + y), 0.5 * (1 - x) * (1 - y * y)]
        nodes = self.elements[cell[1] * self.count[0] + cell[0]]
        return [sum(s * moved[2 * node + axis] for s, node in zip(shape, nodes)) for axis in range(2)]
