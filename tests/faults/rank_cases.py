"""A fluid that several processes share: memory that ends on one of them, damaged checkpoints, another picture on another host."""
import glob
import json
import os
import shutil
import time
import zlib

from driver import PROGRAMS, ROOT, Run, expect, expect_same, finished

os.environ |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}

WIDE = """dimension = 2
[coupling]
mode = "transient"
window = 0.02
end_time = 0.1
connect_timeout = 10.0
[fluid]
size = [60.0, 60.0]
spacing = 0.05
density = 1.0
viscosity = 0.02
reference_velocity = 1.0
lattice_velocity = 0.1
ranks = 2
threads = 1
solver = "{solver}"
[fluid.sides.left]
type = "velocity"
velocity = ["1", "0"]
[fluid.sides.right]
type = "outflow"
[output]
frames = false
"""


def without_mpirun():
    return None if shutil.which("mpirun") else "NOT TESTED: there is no mpirun"


def on_the_second_rank(place, command):
    """A program of ranks that does something else first on one of them, as if it were another machine."""
    folder = place.folder / "programs"
    folder.mkdir(exist_ok=True)
    program = folder / "fluid-lbm-mpi"
    program.write_text(f'#!/bin/bash\nif [[ $OMPI_COMM_WORLD_RANK == 1 ]]; then {command}; fi\nexec {PROGRAMS}/fluid-lbm-mpi "$@"\n')
    program.chmod(0o755)
    return program


def address_space_of_a_rank(place):
    """The most that one of the fluid's processes has mapped in an undisturbed run, as ulimit counts it [kB]."""
    run = Run(place.write("whole.toml", WIDE.format(solver=PROGRAMS / "fluid-lbm")), place.folder / "whole", "--no-report", limit=60)
    most = {}
    while run.process.poll() is None:
        for status in glob.glob("/proc/[0-9]*/status"):
            try:
                with open(status.replace("status", "cmdline")) as words, open(status) as lines:
                    if f"{place.folder}/whole/fluid" in words.read():
                        most[status] = next(int(line.split()[1]) for line in lines if line.startswith("VmPeak"))
            except (OSError, StopIteration):
                continue
        time.sleep(0.005)
    run.expect_end(0)
    expect(len(most) >= 2, f"{len(most)} processes of the fluid were seen")
    return max(most.values())


def case_out_of_memory_on_a_rank(place):
    """However far it gets: the line says so, and nobody waits for ever. Less and less of what it maps when it may, until three limits were felt."""
    if why := without_mpirun():
        return why
    whole = address_space_of_a_rank(place)
    felt = []
    for percent in (110, *range(85, 40, -5)):
        solver = on_the_second_rank(place, f"ulimit -v {whole * percent // 100}")
        run = Run(place.write("wide.toml", WIDE.format(solver=solver)), place.folder / f"out-{percent}", "--no-report", limit=60)
        status = run.end()
        said = run.said() + (run.out / "log/fluid.log").read_text()
        expect(status in (0, 4) and not run.participants(), f"{percent} % of {whole} kB: exit status {status}, {run.participants()}: {said}")
        expect(status == 4 or not felt, f"{percent} % of {whole} kB were enough, {felt[-1:]} were not")
        # Where not even MPI can begin, that is what is said.
        expect(status == 0 or "out of memory" in said or felt, f"{percent} % of {whole} kB: {said}")
        felt += [percent] if status == 4 else []
        if len(felt) == 3:
            break
    expect(len(felt) == 3 and felt[0] < 110, f"felt: {felt} % of {whole} kB")
    return f"felt at {felt} % of {whole} kB"


def halfway(scene, out, *options):
    """Interrupted, and the fluid's newest checkpoint damaged."""
    run = Run(scene, out, *options)
    run.wait_for_window(90)
    run.process.send_signal(2)
    run.expect_end(130)
    newest = max((out / "checkpoint").glob("set-*.json"), key=lambda path: json.loads(path.read_text())["window"])
    file = out / "fluid" / f"checkpoint-{newest.stem.split('-')[1]}.h5"
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 0x10
    file.write_bytes(content)
    return newest, file


def case_damaged_checkpoint_of_ranks(place):
    """By its checksum, and by what is inside when the checksum is right: the first rank's file, of which the others know nothing."""
    if why := without_mpirun():
        return why
    scene = ROOT / "configs/grains/settling-disc.toml"
    options = ("--no-report", "--set", "coupling.end_time=0.02", "--set", "recovery.every=20", "--set", "fluid.threads=1", "--set", "grains.threads=1")
    undisturbed = place.folder / "undisturbed"
    status = Run(scene, undisturbed, *options).end()  # too short for its checks
    ranks = (*options, "--set", "fluid.ranks=2")
    out = place.folder / "out"
    halfway(scene, out, *ranks)
    finished(scene, out, *ranks, "--resume", status=status, line="is damaged")
    expect_same(out, undisturbed)
    out = place.folder / "believed"
    newest, file = halfway(scene, out, *ranks)
    text = json.loads(newest.read_text())
    found = [entry for entry in entries(text) if entry.get("bytes") == file.stat().st_size]
    expect(len(found) == 1, f"{text}")
    found[0]["crc32"] = type(found[0]["crc32"])(zlib.crc32(file.read_bytes()))
    newest.write_text(json.dumps(text))
    finished(scene, out, *ranks, "--resume", status=status, line="cannot be used: participant 'fluid'")
    expect_same(out, undisturbed)


def entries(value):
    if isinstance(value, dict):
        yield value
    for below in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from entries(below)


def case_another_picture_on_another_host(place):
    """Every rank reads it where it is."""
    if why := without_mpirun():
        return why
    other = place.folder / "elsewhere/configs/fluid"
    other.mkdir(parents=True)
    picture = (ROOT / "configs/fluid/trabecular-bone.png").read_bytes()
    text = (ROOT / "configs/fluid/rabbit-bone.toml").read_text()
    for where, line in (("there is none", "cannot be opened"), ("another", "are not those that the first rank has read")):
        if where == "another":
            (other / "trabecular-bone.png").write_bytes(darkened(picture))
        solver = on_the_second_rank(place, f"cd {place.folder}/elsewhere")
        scene = place.write("bone.toml", text.replace("[fluid]", f'[fluid]\nranks = 2\nthreads = 1\nsolver = "{solver}"', 1))
        run = Run(scene, place.folder / where.replace(" ", "-"), "--no-report", limit=60)
        status = run.end()
        said = run.said() + (run.out / "log/fluid.log").read_text()
        expect(status == 4 and line in said, f"{where}: exit status {status}: {said}")
        expect(not run.participants(), "processes were left behind")
    return None


def darkened(png):
    """The same picture with its first rows black: its image data packed anew."""
    place, chunks, data = 8, [], b""
    while place < len(png):
        length = int.from_bytes(png[place:place + 4], "big")
        name, body = png[place + 4:place + 8], png[place + 8:place + 8 + length]
        if name == b"IDAT":
            data += body
        chunks.append((name, body))
        place += 12 + length
    rows = zlib.decompress(data)
    data = zlib.compress(bytes(len(rows) // 2) + rows[len(rows) // 2:])
    result, packed = png[:8], False
    for name, body in chunks:
        if name == b"IDAT":
            if packed:
                continue
            body, packed = data, True
        result += len(body).to_bytes(4, "big") + name + body + zlib.crc32(name + body).to_bytes(4, "big")
    return result
