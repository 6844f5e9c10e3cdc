"""The keys of a clamped elastic box in a scene's [solid] table, as solid-sph reads them: the other solids take the same
table, so that swapping them is one line. Keys that steer solid-sph's own discretisation are accepted and ignored."""
SIDES = ("left", "top", "right", "bottom")
IGNORED = ("kind", "particles_across", "law", "steady", "clamp", "kernel", "placement", "stabilisation", "window_load", "density")


class BoxScene:
    def __init__(self, table, scene):
        box = table.take("box", None, dict)
        self.low, self.high = box.get("from", [0.0, 0.0]), box.get("to", [1.0, 1.0])
        if not all(a < b for a, b in zip(self.low, self.high)):
            table.problem("box", "'solid.box' needs from < to")
        self.young, self.poisson = table.take("young_modulus"), table.take("poisson_ratio")
        if not (self.young > 0 and -1 < self.poisson < 0.5):
            table.problem("young_modulus", "young_modulus has to be positive and poisson_ratio between -1 and 0.5")
        self.plane = table.take("plane", "strain", str)
        if self.plane not in ("strain", "stress"):
            table.problem("plane", "'solid.plane' is \"strain\" or \"stress\"")
        if table.take("law", "saint_venant_kirchhoff", str) != "saint_venant_kirchhoff":
            table.problem("law", "this solid knows law = \"saint_venant_kirchhoff\" only")
        self.clamped, self.wet = table.take("clamped", None, list), table.take("wet", [], list)
        for key, sides in (("clamped", self.clamped), ("wet", self.wet)):
            if not set(sides) <= set(SIDES):
                table.problem(key, f"'solid.{key}' names sides: {', '.join(SIDES)}")
        self.loads = []
        for load in table.take("load", [], list):
            if set(load) != {"side", "force"} or load["side"] not in SIDES:
                table.problem("load", "this solid knows loads with `side` and `force` only")
            else:
                self.loads.append((load["side"], load["force"]))
        for key in IGNORED:
            table.take(key, False, None)
        if scene.get("coupling", {}).get("mode", "steady") != "steady":
            table.problem("", "this solid finds equilibria only: coupling.mode has to be \"steady\"")
        self.watches = [watch for watch in scene.get("watch", []) if watch.get("participant") == "solid"]
