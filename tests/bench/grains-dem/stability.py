#!/usr/bin/env python3
"""Limits of stability of the grains, dry and in the fluid: one line of CSV per run, with the symptom.

    tests/bench/grains-dem/stability.py --build build --out grains-dem/evidence/stability.csv [--only NAME]

Every case is a ladder from harmless to hopeless, run through `coupler run` as a person would; all steps are run, also beyond
the first failure. A step holds when the run ends and every bound of its case is kept: on the balance of energy, and on what is known of the
case by itself (a theory, a balance of forces, grains that have to touch). Symptoms: the program's own message (what diverged, where),
or the bound that was passed.
"""
import argparse
import csv
import json
import math
import pathlib
import re
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[3]

DRY = """
title = "stability"
dimension = {dimension}
[coupling]
mode = "transient"
window = {window}
end_time = {end}
[grains]
density = 2500.0
{law}
restitution = {restitution}
friction = {friction}
steps_per_contact = {steps}
walls = {walls}
[grains.box]
from = {low}
to = {high}
{groups}
[[watch]]
name = "all"
participant = "grains"
[[watch]]
name = "one"
participant = "grains"
grain = 0
[output]
frames = false
"""

GAS = """
[[grains.group]]
count = 300
from = [0.0, 0.0]
to = [0.2, 0.2]
radius = 0.003
random_velocity = 0.5
"""
SPHERES = """
[[grains.group]]
count = 200
from = [0.0, 0.0, 0.0]
to = [0.05, 0.05, 0.05]
radius = 0.003
random_velocity = 0.5
"""
OVERLAP = """
[[grains.group]]
lattice = "triangular"
from = [0.07, 0.07]
pitch = 0.003
counts = [20, 20]
radius = 0.003
"""
OVERLAP_IN_SPACE = """
[[grains.group]]
lattice = "square"
from = [0.09, 0.09, 0.09]
pitch = 0.003
counts = [7, 7, 7]
radius = 0.003
"""
HEAD_ON = """
[[grains.group]]
positions = {left}
radius = 0.003
velocity = {there}
[[grains.group]]
positions = {right}
radius = 0.003
velocity = {back}
"""

# A row of large grains between two layers of small ones, deposited; then the right wall pushes the bed together by a
# twentieth of its width. It is in contact and under load all along.
SIZES = """
title = "sizes"
dimension = {dimension}
[coupling]
mode = "transient"
window = 0.001
end_time = 0.06
[grains]
density = 2500.0
normal_stiffness = {stiffness}
restitution = 0.3
friction = 0.3
gravity = {gravity}
walls = {walls}
[grains.box]
from = {low}
to = {high}
[[grains.wall]]
name = "pushing"
point = {at}
normal = {against}
velocity = {push}
[[grains.group]]
count = {below}
from = {low}
to = {middle}
radius = {small}
[[grains.group]]
positions = {large}
radius = 0.005
[[grains.group]]
count = {above}
from = {over}
to = {high}
radius = {small}
seed = 2
[grains.deposit]
gravity = {gravity}
end_time = 3.0
tolerance = 0.01
[[watch]]
name = "all"
participant = "grains"
[output]
frames = false
"""

# 50 discs, deposited, through which water rises at a given part of the critical gradient.
BED_DISCS, BED_RADIUS, BED_WIDTH = 50, 2.5e-4, 0.003
BED = """
title = "dense bed"
dimension = 2
[coupling]
mode = "transient"
scheme = "serial-explicit"
window = {step}
end_time = {end}
[fluid]
size = [0.003, 0.006]
spacing = 5e-5
density = 1000.0
viscosity = 1e-3
reference_velocity = 0.05
time_step = {step}
[fluid.sides.left]
type = "periodic"
[fluid.sides.right]
type = "periodic"
[fluid.sides.bottom]
type = "pressure"
pressure = "{pressure}*min(1,t/0.02)"
[fluid.sides.top]
type = "pressure"
pressure = 0.0
[grains]
density = {density}
normal_stiffness = 1e4
restitution = 0.3
friction = 0.3
steps_per_contact = 200
contact_margin = 2.5e-5
gravity = [0.0, -9.81]
periodic = ["x"]
walls = ["bottom"]
[grains.box]
from = [0.0, 0.0005]
to = [0.003, 0.006]
[grains.fluid]
density = 1000.0
{virtual}
[[grains.group]]
count = 50
from = [0.0, 0.0006]
to = [0.003, 0.0105]
radius = 0.00025
[grains.deposit]
gravity = [0.0, -9.81]
end_time = 2.0
[[watch]]
name = "all"
participant = "grains"
[[watch]]
name = "floor"
participant = "grains"
wall = "bottom"
[[watch]]
name = "middle"
participant = "grains"
from = [0.0, 0.001]
to = [0.003, 0.004]
[output]
frames = false
"""


def dry(dimension=2, **changes):
    size = changes.pop("size", 0.2 if dimension == 2 else 0.05)
    values = dict(window=0.01, end=0.1, stiffness=1e5 if dimension == 2 else 1e4, restitution=0.8, friction=0.3, steps=20,
                  groups=GAS if dimension == 2 else SPHERES)
    values.update(changes)
    law = values.pop("law", None) or f"normal_stiffness = {values['stiffness']}"
    walls = ["left", "right", "bottom", "top", "back", "front"][:2 * dimension]
    return DRY.format(dimension=dimension, law=law, walls=json.dumps(walls), low=[0.0] * dimension, high=[size] * dimension,
                      **values)


def hertz(modulus, speed):
    return f'normal_law = "hertz"\nyoung_modulus = {modulus}\npoisson_ratio = 0.25\nimpact_speed = {speed}'


def head_on(dimension, speed, **changes):
    """Two grains of 3 mm that begin in touch."""
    size, groups = 0.2, HEAD_ON
    place = lambda x: [[x] + [0.1] * (dimension - 1)]
    way = lambda v: [v] + [0.0] * (dimension - 1)
    groups = groups.format(left=place(0.09699), right=place(0.10301), there=way(speed), back=way(-speed))
    return dry(dimension, size=size, groups=groups, friction=0, **changes)


def cut_restitution(restitution):
    """Of a contact that never pulls (Schwager & Poeschel 2007), from the restitution of one that may, below critical damping."""
    ratio = -math.log(restitution) / math.hypot(math.pi, math.log(restitution))
    frequency = math.sqrt(1 - ratio * ratio)
    angle = math.atan2(2 * ratio * frequency, frequency ** 2 - ratio ** 2)
    return math.exp(-ratio / frequency * (math.pi - angle))


def sizes(dimension, ratio):
    small = 0.005 / ratio
    width, depth = (0.06, 0.0) if dimension == 2 else (0.0265, 0.0125)
    if dimension == 2:
        share, solid, large = math.pi * small ** 2, 0.8, [0.008, 0.023, 0.038, 0.052]
        below, above = int(solid * width * 0.006 / share) or 1, int(solid * width * 0.010 / share)
    else:
        share, solid, large = 4 / 3 * math.pi * small ** 3, 0.58, [0.0065, 0.0195]
        below, above = int(solid * width * depth * 0.0015 / share) or 1, int(solid * width * depth * 0.007 / share)
    lower, upper = (0.016, 0.055) if dimension == 2 else (0.005 if ratio > 3 else 0.012, 0.045)
    vector = lambda x, up: [x, up] if dimension == 2 else [x, depth, up]
    flat = [0.0] * (dimension - 1)
    walls = ["left", "bottom"] if dimension == 2 else ["left", "bottom", "top", "back"]
    return SIZES.format(
        dimension=dimension, stiffness=1e6 if dimension == 2 else 2000.0, gravity=flat + [-9.81], walls=json.dumps(walls),
        low=[0.0] * dimension, high=vector(width, upper), at=vector(width, 0.0), against=[-1.0] + flat,
        push=json.dumps([f"{-width / 20 / 0.06:g}"] + ["0"] * (dimension - 1)), middle=vector(width, lower),
        over=([0.0] + ([0.0] if dimension == 3 else []) + [lower + 0.0102]), below=below, above=above, small=small,
        large=[[x] + ([depth / 2] if dimension == 3 else []) + [lower + 0.0051] for x in large]), below + above + len(large)


def bed(tau, density, part=0.5, virtual=""):
    """The bed, and its submerged weight."""
    step = float(f"{(tau - 0.5) / 3 * 5e-5 ** 2 / 1e-6:.6g}")
    weight = BED_DISCS * math.pi * BED_RADIUS ** 2 * (density - 1000) * 9.81
    return BED.format(step=step, end=f"{round(0.06 / step) * step:.9g}", density=density, pressure=f"{part * weight / BED_WIDTH:.6g}",
                      virtual=virtual), weight


def bessel_k(order, x):
    """Modified Bessel function of the second kind, from its integral over exp(-x cosh u) cosh(order u)."""
    steps, end = 2000, math.acosh(1 + 700 / x)
    value = lambda u: math.exp(-x * math.cosh(u)) * math.cosh(order * u)
    return end / steps * (0.5 * (value(0) + value(end)) + sum(value(k * end / steps) for k in range(1, steps)))


def speed_from_rest(density, t, radius=0.00125, fluid=1000.0, viscosity=1e-5):
    """Of a disc released in a viscous fluid while it is slow (Stokes 1851: its added mass and history by K1 / K0), by
    Stehfest's inverse of the Laplace transform of (m + m_f (1 + 4 K1(q) / (q K0(q)))) dv/dt = (m - m_f) g."""
    def transformed(s):
        q = radius * math.sqrt(s / viscosity)
        return (density - fluid) * 9.81 / s ** 2 / (density + fluid * (1 + 4 * bessel_k(1, q) / (q * bessel_k(0, q))))
    terms, total = 12, 0.0
    for k in range(1, terms + 1):
        weight = sum(j ** (terms // 2) * math.factorial(2 * j) /
                     (math.factorial(terms // 2 - j) * math.factorial(j) * math.factorial(j - 1) * math.factorial(k - j) *
                      math.factorial(2 * j - k)) for j in range((k + 1) // 2, min(k, terms // 2) + 1))
        total += (-1) ** (k + terms // 2) * weight * transformed(k * math.log(2) / t)
    return total * math.log(2) / t


def within(quantity, low, high, what):
    return quantity, low, high, what


def energy(bound):
    return within("all.energy_error.last", -bound, bound, "the energy does not balance: {:+.1%} of the largest entry")


def near(quantity, reference, share, what):
    low, high = sorted((reference * (1 - share), reference * (1 + share)))
    return within(quantity, low, high, what + " is {:.4g}, not " + f"{reference:.4g} within {share:.0%}")


def dry_cases():
    for steps in (50, 20, 10, 5, 4, 3, 2, 1.5, 1):
        yield "steps per contact, 300 elastic discs", steps, dry(steps=steps, restitution=1, friction=0), [], [energy(0.02)]
    for steps in (50, 20, 10, 5, 4, 3, 2, 1.5, 1):
        yield "steps per contact, 200 elastic spheres", steps, dry(3, steps=steps, restitution=1, friction=0), [], [energy(0.02)]
    for steps in (50, 20, 10, 5, 4, 3, 2, 1.5, 1):
        yield ("steps per contact, 200 elastic spheres, Hertz", steps,
               dry(3, steps=steps, restitution=1, friction=0, law=hertz(1e7, 2.0)), [], [energy(0.02)])
    restitution = math.exp(-0.1 * math.pi / math.sqrt(1 - 0.01))
    for name, dimension in (("discs", 2), ("spheres", 3)):
        for steps in (50, 20, 10, 5, 3, 2, 1.5, 1.2):
            yield (f"restitution of two {name}, steps per contact", steps,
                   head_on(dimension, 0.1, steps=steps, restitution=restitution), [],
                   [near("one.speed.last", 0.1 * cut_restitution(restitution), 0.05, "the speed after the collision")])
    for stiffness in (1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9):
        yield ("stiffness [N/m], 300 discs", stiffness,
               dry(stiffness=stiffness, groups=GAS.replace("0.5", "0.1")), [], [energy(0.02)])
    for stiffness in (1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8):
        yield ("stiffness [N/m], 200 spheres", stiffness,
               dry(3, stiffness=stiffness, groups=SPHERES.replace("0.5", "0.1")), [], [energy(0.02)])
    for friction in (0, 0.3):
        for modulus in (1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11):
            yield (f"Young's modulus [Pa], 200 spheres, Hertz, friction {friction}", modulus,
                   dry(3, law=hertz(modulus, 0.3), friction=friction, groups=SPHERES.replace("0.5", "0.1")), [], [energy(0.02)])
    for steps in (50, 20, 10, 5, 4, 3, 2):
        yield ("half a diameter of overlap, 400 discs, steps per contact", steps,
               dry(steps=steps, groups=OVERLAP, end=0.02, window=0.002), [], [energy(0.05)])
    for name, law in (("linear", None), ("Hertz", hertz(1e7, 2.0))):
        for steps in (50, 20, 10, 5, 4, 3, 2):
            yield (f"half a diameter of overlap, 343 spheres, {name}, steps per contact", steps,
                   dry(3, size=0.2, steps=steps, groups=OVERLAP_IN_SPACE, end=0.02, window=0.002, law=law), [], [energy(0.05)])
    for share in (0.1, 0.25, 0.5, 0.75, 0.9, 1.1):
        # Two discs head-on: overlap v sqrt(m* / k) with v = 2 speed.
        speed = 0.5 * share * 0.006 * math.sqrt(1e5 / (0.5 * 2500 * math.pi * 0.003 ** 2))
        yield ("speed of two discs head-on, overlap over the diameter", share, head_on(2, speed, restitution=1, end=0.004, window=0.004), [],
               [near("one.velocity_x.last", -speed, 0.05, "the velocity after the collision")])


def packed_cases():
    for dimension, ratios in ((2, (2, 5, 10, 20)), (3, (2, 5, 10))):
        for ratio in ratios:
            scene, count = sizes(dimension, ratio)
            # The watch takes an overlap over the mean diameter of its pair: of a small and a large grain that is (1 + ratio) / 2 of the small one's.
            yield (f"sizes 1:N, {'discs' if dimension == 2 else 'spheres'} packed and pushed together", ratio, scene, [],
                   [energy(0.02), within("all.coordination.last", 2, 99, "the grains are not in touch: {:.2f} contacts per grain"),
                    within("all.maximum_overlap.max", 0, 0.1, "overlap of {:.2f} mean diameters of a pair")])


def settling_cases():
    disc = ROOT / "configs/grains/settling-disc.toml"
    coarse = ["fluid.spacing=3.125e-4", "fluid.time_step=2e-4", "coupling.window=2e-4", "fluid.threads=1", "grains.threads=1"]
    slowest_drag = 0.9   # the least drag coefficient of a cylinder between Re = 100 and 2e5
    for mass in ("default", "0"):
        for density in (10, 50, 100, 500, 900, 1010, 1250, 2000, 10000):
            extra = [] if mass == "default" else ["grains.fluid.virtual_mass=0"]
            fastest = math.sqrt(math.pi * 0.0025 * 9.81 * abs(density / 1000 - 1) / (2 * slowest_drag))
            start = speed_from_rest(density, 0.02)
            yield (f"density of a disc in water [kg/m3], virtual mass {mass}", density, disc,
                   coarse + ["coupling.end_time=0.12", f"grains.density={density}"] + extra,
                   [near("disc.velocity_y@0.02", -start, 0.1, "the velocity after 0.02 s"),
                    within("disc.speed.max", 0, fastest, "{:.3g} m/s is faster than " + f"{fastest:.3g}, where a drag coefficient of 0.9 carries it")])


def bed_cases():
    def judged(density, tau, part=0.5, virtual="", options=()):
        scene, weight = bed(tau, density, part, virtual)
        return scene, ["fluid.threads=1", "grains.threads=1", *options], [
            energy(0.02), within("all.coordination.last", 2, 99, "the grains are not in touch: {:.2f} contacts per grain"),
            within("all.maximum_overlap.max", 0, 0.1, "overlap of {:.3f} diameters"),
            within("all.centre_y.change", -0.1 * 2 * BED_RADIUS, 0.1 * 2 * BED_RADIUS, "the bed moved by {:.3g} m"),
            near("floor.force_y.last", -(1 - part) * weight, 0.1, "the load of the floor")]
    for tau in (0.6, 0.53, 0.51):
        for density in (2600, 1100):
            yield f"dense bed of {density} kg/m3 at half the critical gradient, relaxation time", tau, *judged(density, tau)
    for tau in (0.51,):
        for virtual in (0, 2):
            yield (f"dense bed of 1100 kg/m3, virtual mass {virtual}, relaxation time", tau,
                   *judged(1100, tau, virtual=f"virtual_mass = {virtual}"))
    boiling = ROOT / "configs/grains/boiling-2d.toml"
    for steps in (1, 2, 5):
        yield ("steps of the fluid per exchange, boiling-2d, 0.9 of the critical gradient", steps, boiling,
               [f"coupling.window={steps * 2e-5:g}", "coupling.end_time=0.1", "fluid.sides.bottom.pressure=0.9*94.511*min(1,t/0.02)",
                "grains.steps_per_contact=100", "fluid.threads=1", "grains.threads=1", "output.frames=false"],
               [within("bed.energy_error.last", -0.02, 0.02, "the energy does not balance: {:+.1%} of the largest entry"),
                within("bed.centre_y.change", -6e-5, 6e-5, "the bed moved by {:.3g} m")])


def cases():
    """(case, value, scene text or file, --set options, bounds)."""
    yield from dry_cases()
    yield from packed_cases()
    yield from settling_cases()
    yield from bed_cases()


def run(build, scene, options, folder):
    if not isinstance(scene, pathlib.Path):
        file = folder / "scene.toml"
        file.write_text(scene)
        scene = file
    command = [build / "bin" / "coupler", "run", scene, "--out", folder / "out"]
    for option in options:
        command += ["--set", option]
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, timeout=600)
    summary = folder / "out" / "summary.json"
    return done.returncode, done.stdout + done.stderr, json.loads(summary.read_text()) if summary.exists() else {}


def measured(quantity, summary, folder):
    """WATCH.QUANTITY.STATISTIC of the summary; WATCH.QUANTITY.change from the first to the last row, WATCH.QUANTITY@TIME at the
    row next to a time."""
    watch, _, rest = quantity.partition(".")
    if "@" not in rest and not rest.endswith(".change"):
        value = summary.get("watch", {}).get(watch, {})
        for key in rest.split("."):
            value = value.get(key) if isinstance(value, dict) else None
        return value
    file = folder / "out" / "watch" / f"{watch}.csv"
    rows = list(csv.DictReader(file.open())) if file.exists() else []
    if not rows:
        return None
    if "@" in rest:
        key, at = rest.split("@")
        row = min(rows, key=lambda r: abs(float(r["time"]) - float(at)))
        return float(row[key]) if abs(float(row["time"]) - float(at)) < 1e-3 else None
    key = rest.removesuffix(".change")
    return float(rows[-1][key]) - float(rows[0][key])


def judge(code, text, summary, folder, bounds):
    """(holds, symptom)"""
    if code not in (0, 1):
        lines = [line.partition("field ")[2] or line for line in text.splitlines() if re.match("coupler: ", line)]
        symptom = (lines or text.splitlines()[-1:] or ["no message"])[0].strip()
        # What it says of the place of the run's files is nobody's limit.
        return False, re.sub(r"; fields are in \S+", "", symptom)[:160]
    for quantity, low, high, what in bounds:
        value = measured(quantity, summary, folder)
        if value is None or not low <= value <= high:
            return False, what.format(math.nan if value is None else value)
    return True, ""


def largest(summary, key):
    values = [watch[key]["max"] for watch in summary.get("watch", {}).values() if isinstance(watch.get(key), dict)]
    return max((v for v in values if v is not None), default=None)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--only", default="", help="cases whose name contains this")
    arguments = parser.parse_args()
    head = ["case", "value", "result", "energy_error", "largest_speed", "largest_overlap", "coordination", "compared", "found", "low", "high",
            "seconds", "symptom"]
    rows = []
    digits = lambda value: "" if value is None else f"{value:.4g}"
    for name, value, scene, options, bounds in cases():
        if arguments.only not in name:
            continue
        with tempfile.TemporaryDirectory() as path:
            folder = pathlib.Path(path)
            began = time.monotonic()
            code, text, summary = run(arguments.build.resolve(), scene, options, folder)
            seconds = time.monotonic() - began
            holds, symptom = judge(code, text, summary, folder, bounds)
            quantity, low, high, _ = bounds[-1]
            watched = summary.get("watch", {})
            totals = watched.get("all") or watched.get("bed") or {}
            rows.append([name, value, "holds" if holds else "fails", digits(totals.get("energy_error", {}).get("last")),
                         digits(largest(summary, "maximum_speed") or largest(summary, "speed")),
                         digits(totals.get("maximum_overlap", {}).get("max")), digits(totals.get("coordination", {}).get("min")),
                         quantity, digits(measured(quantity, summary, folder)), digits(low), digits(high), f"{seconds:.1f}", symptom])
        print(*rows[-1], sep=", ", flush=True)
        with arguments.out.open("w", newline="") as file:
            csv.writer(file).writerows([head, *rows])


if __name__ == "__main__":
    main()
