"""Scenes that were damaged: each is read to an end, with problems or without, and nobody falls."""
import os
import random
import subprocess

from driver import PROGRAMS, ROOT, expect
from message_cases import field

VALUES = ("0", "-1", "1e308", "-1e-308", "nan", "inf", "1e9", "2147483648", "9223372036854775807", '""', '"x"', "[]", "[[]]", "{}", "true",
          "[1]", "[1, 2, 3]", "[[1, 2], [3]]", '["x", "y"]', '"/etc/passwd"', '"0/0"', '"sqrt(-1)"', "[nan, 1]", "'' ")


def damaged(text, source):
    lines = text.splitlines()
    for _ in range(source.choice((1, 1, 1, 2, 5))):
        at = source.randrange(len(lines))
        what = source.random()
        if "=" in lines[at] and what < 0.6:
            lines[at] = lines[at].split("=")[0] + "= " + source.choice(VALUES)
        elif what < 0.75:
            del lines[at]
        elif what < 0.85:
            lines.insert(at, source.choice(lines))
        elif what < 0.93:
            at_character = source.randrange(len(lines[at]) + 1)
            lines[at] = lines[at][:at_character] + source.choice("[]{}=\"'.,#\\0-e\x00\u00e9") + lines[at][at_character:]
        else:
            lines[at:at + source.randrange(4)] = []
        if not lines:
            return ""
    return "\n".join(lines)


def case_damaged_scenes(place, count=int(os.environ.get("ESTUARY_DAMAGED_SCENES", "300"))):
    """Checked as a server would: no signal, no endless loop, no more than 2 GB."""
    source = random.Random(11)
    scenes = [path for path in sorted(ROOT.glob("configs/*/*.toml")) if "studies" not in str(path)]
    found = {0: 0, 2: 0}
    for number in range(count):
        scene = source.choice(scenes)
        text = scene.read_text()
        roles = [(role, program) for role, program in (("fluid", "fluid-lbm"), ("solid", "solid-sph"), ("grains", "grains-dem"))
                 if f"[{role}]" in text]
        role, program = source.choice(roles)
        text = damaged(text, source)
        message = field(1, role.encode()) + field(2, b"scene.toml") + field(3, text.encode())
        done = subprocess.run(["prlimit", "--as=2000000000", str(PROGRAMS / program), "--check"], input=message, capture_output=True,
                              timeout=60, cwd=ROOT, env={**os.environ, "OMP_NUM_THREADS": "1"})
        if done.returncode not in (0, 2):
            place.write(f"scene-{number}.toml", text)
            expect(False, f"{program} ended with {done.returncode} on a damaged {scene.name} (kept as {place.folder}/scene-{number}.toml): "
                   f"{done.stderr.decode(errors='replace')[-500:]}")
        found[done.returncode] += 1
    return f"{count} scenes: {found[2]} refused, {found[0]} still sound"
