"""A fluid whose lattice several processes share, with real processes and mpirun: every file of a run on 2 and 4 ranks is that of
one rank, to the last bit.

usage: ranks_test.py BUILD SOURCE [TestCase[.test]...]"""
import csv, filecmp, os, pathlib, shutil, signal, socket, subprocess, sys, tempfile, time, unittest

BUILD, SOURCE = (pathlib.Path(path).resolve() for path in sys.argv[1:3])
BIN = BUILD / "bin"
os.environ |= {"OMP_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
# What holds times, or the number of ranks itself.
TIMED = {"summary.json", "iterations.csv", "scene.toml", "run.lock"}

SIDES = """
[fluid.sides.left]
type = "velocity"
velocity = ["y * (1.6 - y)", 0{more}]
[fluid.sides.right]
type = "outflow"
"""
# Beyond a periodic side lie copies that nothing reads before they are made again: after nodes were left they may differ.
GHOSTS = ("fluid/checkpoint-0.h5", "fluid/checkpoint-1.h5")
# A cylinder on a spring in a stream: a moving wet surface, windows that are repeated, loads by momentum exchange.
SPRING = """
dimension = 2
[coupling]
mode = "transient"
scheme = "serial-implicit"
window = 0.05
end_time = 0.4
tolerance = 1e-3
[recovery]
every = 3
[fluid]
origin = [-2.0, -1.6]
size = [5.0, 3.2]
spacing = 0.1
density = 1.0
viscosity = 0.02
reference_velocity = 1.0
collision = "central-moment"
equilibrium = "compressible"
match_force = true
time_step = 0.005
[fluid.sides.left]
type = "velocity"
velocity = ["1", "0"]
[fluid.sides.right]
type = "outflow"
[fluid.sides.bottom]
type = "periodic"
[fluid.sides.top]
type = "periodic"
[fluid.initial]
velocity = ["1", "0"]
[solid]
kind = "rigid"
spacing = 0.1
mass = 2.0
spring = [0.0, 4.9]
held = ["x", "rotation"]
velocity = ["0", "1"]
wet = ["contour"]
window_load = "received"
[solid.disc]
centre = [0.0, 0.03]
radius = 0.5
[[watch]]
name = "flow"
participant = "fluid"
[[watch]]
name = "wake"
participant = "fluid"
line = [[0.7, -1.3], [2.5, 1.3]]
[output]
frame_interval = 4
"""
# A fin that bends: open wet surface with edges, beside a polygon whose links close gradually too.
FIN = (SOURCE / "configs/fsi/elastic-fin-transient.toml").read_text().split("[[check]]")[0] + """
[[fluid.obstacle]]
name = "block"
polygon = [[1.1, 0.3], [1.1, 0.4], [1.3, 0.4], [1.3, 0.3]]
[[watch]]
name = "block"
participant = "fluid"
obstacle = "block"
[recovery]
every = 2
[output]
frame_interval = 2
"""
# Bodies that leave nodes on both sides of the slabs' ends, and rules that look at nodes beside their own.
BODIES = """
dimension = 2
[coupling]
mode = "transient"
window = 0.02
end_time = 0.2
[fluid]
size = [3.2, 1.6]
spacing = 0.05
density = 1.0
viscosity = 0.02
reference_velocity = 1.0
lattice_velocity = 0.1
""" + SIDES.format(more="") + """
[[fluid.obstacle]]
name = "one"
disc = [0.8, 0.82, 0.2]
wall_rule = "quadratic"
displacement = ["0.1 * sin(10 * t)", "0.15 * sin(9 * t)"]
[[fluid.obstacle]]
name = "two"
disc = [1.6, 0.8, 0.2]
wall_rule = "one-point"
displacement = ["0", "-0.15 * sin(9 * t)"]
[[fluid.obstacle]]
name = "three"
disc = [2.4, 0.4, 0.15]
spin = 3.0
[[fluid.obstacle]]
name = "box"
box = [[2.3, 1.1], [2.6, 1.4]]
[[watch]]
name = "two"
participant = "fluid"
obstacle = "two"
[[watch]]
name = "behind"
participant = "fluid"
point = [2.0, 0.81]
[[watch]]
name = "part"
participant = "fluid"
from = [0.3, 0.3]
to = [2.0, 1.4]
"""
GRAINS = """
dimension = {dimension}
[coupling]
mode = "transient"
scheme = "serial-explicit"
window = 1e-3
end_time = 8e-3
[recovery]
every = 3
[fluid]
size = [{size}]
spacing = 1e-3
density = 1000.0
viscosity = 0.05
reference_velocity = 0.06
time_step = 1e-3
grains = "{grains}"
[grains]
density = 1250.0
normal_stiffness = 1e4
restitution = 0.5
gravity = [{gravity}]
walls = ["bottom", "top"]
[grains.fluid]
density = 1000.0
[grains.box]
from = [{corner}]
to = [{size}]
[[grains.group]]
positions = [{positions}]
radius = 0.003
[[watch]]
name = "flow"
participant = "fluid"
[output]
frame_interval = 4
"""
# In space: a sphere, open sides, a picture's worth of solid nodes by a box, single precision.
SPACE = """
dimension = 3
[coupling]
mode = "steady"
[fluid]
size = [1.6, 1.6, 1.8]
spacing = 0.1
density = 1.0
viscosity = 0.1
reference_velocity = 1.0
lattice_velocity = 0.05
{option}
[fluid.steady]
tolerance = 0.1
maximum_steps = 3000
""" + SIDES.format(more=", 0") + """
[fluid.sides.back]
type = "periodic"
[fluid.sides.front]
type = "periodic"
[[fluid.obstacle]]
name = "sphere"
sphere = [0.5, 0.8, 0.85, 0.31]
[[fluid.obstacle]]
name = "box"
box = [[1.0, 0.3, 1.2], [1.2, 1.0, 1.6]]
[[watch]]
name = "sphere"
participant = "fluid"
obstacle = "sphere"
[[watch]]
name = "box"
participant = "fluid"
obstacle = "box"
[[watch]]
name = "line"
participant = "fluid"
line = [[0.2, 0.3, 0.1], [1.3, 1.2, 1.7]]
samples = 30
[[watch]]
name = "flow"
participant = "fluid"
"""


def rows_without_times(path):
    with open(path) as file:
        return [{name: value for name, value in row.items() if not name.endswith("_s")} for row in csv.DictReader(file)]


class Case(unittest.TestCase):
    def setUp(self):
        self.assertIsNotNone(shutil.which("mpirun"), "there is no mpirun: install openmpi-bin, or nothing here is tested")
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.temporary.name)

    def tearDown(self):
        self.temporary.cleanup()

    def write(self, text):
        scene = self.folder / "scene.toml"
        scene.write_text(text)
        return scene

    def command(self, scene, out, ranks, *options):
        return [BIN / "coupler", "run", scene, "--out", self.folder / out, "--no-report", "--set", "fluid.threads=1",
                *(["--set", f"fluid.ranks={ranks}"] if ranks > 1 else []), *options]

    def run_scene(self, scene, out, ranks, *options, status=0):
        done = subprocess.run([str(word) for word in self.command(scene, out, ranks, *options)], cwd=SOURCE,
                              capture_output=True, text=True, timeout=250)
        log = self.folder / out / "log/fluid.log"
        done.all = done.stdout + done.stderr + (log.read_text() if log.exists() else "")
        self.assertEqual(done.returncode, status, done.all)
        return done

    def expect_same(self, out, expected, but=()):
        """Every file of one run is there in the other, with the same bits."""
        files = [sorted(str(path.relative_to(self.folder / run)) for path in (self.folder / run).rglob("*") if path.is_file())
                 for run in (out, expected)]
        self.assertEqual(*files)
        compared = 0
        for name in files[0]:
            if name in TIMED or name in but or name.startswith(("log/", "checkpoint/")):
                continue
            compared += 1
            mine, theirs = self.folder / out / name, self.folder / expected / name
            if name == "convergence.csv":
                self.assertEqual(rows_without_times(mine), rows_without_times(theirs), name)
            else:
                self.assertTrue(filecmp.cmp(mine, theirs, shallow=False), f"{name} of {out} differs from that of {expected}")
        self.assertGreater(compared, 3)

    def compare(self, text, *ranks, but=()):
        scene = self.write(text)
        self.run_scene(scene, "alone", 1)
        for count in ranks or (2, 4):
            self.run_scene(scene, f"on {count}", count)
            self.expect_same(f"on {count}", "alone", but)


class Plane(Case):
    def test_wet_surface_and_repeated_windows(self):
        self.compare(SPRING, but=GHOSTS)

    def test_the_program_of_ranks_as_one_process(self):
        scene = self.write(SPRING)
        self.run_scene(scene, "alone", 1)
        self.run_scene(scene, "one rank", 1, "--set", 'fluid.solver="fluid-lbm-mpi"')
        self.expect_same("one rank", "alone")

    def test_fin_beside_a_polygon(self):
        self.compare(FIN.replace("spacing = 0.02 ", "spacing = 0.025 ").replace("end_time = 12.0", "end_time = 0.1"))

    def test_moving_bodies_and_open_sides(self):
        self.compare(BODIES)


class WithGrains(Case):
    def grains(self, kind):
        return GRAINS.format(dimension=2, size="0.02, 0.03", corner="0, 0", gravity="0, -9.81", grains=kind,
                             positions="[0.006, 0.0152], [0.0131, 0.016], [0.01, 0.022], [0.006, 0.007]")

    def test_partially_saturated(self):
        self.compare(self.grains("partially-saturated"))

    def test_interpolated(self):
        self.compare(self.grains("interpolated"))

    def test_spheres(self):
        self.compare(GRAINS.format(dimension=3, size="0.012, 0.012, 0.024", corner="0, 0, 0", gravity="0, 0, -9.81",
                                   grains="partially-saturated", positions="[0.006, 0.006, 0.0122], [0.005, 0.006, 0.0185]"), 4)


class Space(Case):
    def test_sphere_and_solid_nodes_between_open_and_periodic_sides(self):
        self.compare(SPACE.format(option=""))

    def test_single_precision(self):
        self.compare(SPACE.format(option='storage = "float"'), 2)


class Picture(Case):
    def test_pores(self):
        text = (SOURCE / "configs/fluid/rabbit-bone.toml").read_text().replace("tolerance = 1e-6", "tolerance = 0.1")
        self.compare(text, 2)

    def over_the_network(self, picture):
        """A run with ranks that somebody else started: the scene may name files of their working folder only, and they run in another."""
        text = (SOURCE / "configs/fluid/rabbit-bone.toml").read_text().replace("tolerance = 1e-6", "tolerance = 0.1")
        scene = self.write(text.replace("configs/fluid/trabecular-bone.png", picture))
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        work = self.folder / "work"
        work.mkdir()
        shutil.copy(SOURCE / "configs/fluid/trabecular-bone.png", work / "bone.png")
        with open(self.folder / "ranks.log", "w+") as log:
            ranks = subprocess.Popen(["mpirun", "-n", "2", "--oversubscribe", "--bind-to", "none", BIN / "fluid-lbm-mpi", "--bind", address,
                                      f"--folder={work}", "--threads=1"], cwd="/", stdout=log, stderr=log)
            try:
                done = subprocess.run([BIN / "coupler", "run", scene, "--out", self.folder / "shared", "--no-report", "--set",
                                       f'fluid.connect="{address}"', "--set", "fluid.ranks=2"], cwd=SOURCE, capture_output=True, text=True, timeout=60)
                if done.returncode == 0:
                    ranks.wait(timeout=20)
            finally:
                ranks.terminate()
                ranks.wait(timeout=20)
            log.seek(0)
            done.all = done.stdout + done.stderr + log.read()
        return done

    def test_a_picture_in_the_working_folder(self):
        done = self.over_the_network("bone.png")
        self.assertEqual(done.returncode, 0, done.all)
        alone = (self.folder / "scene.toml").read_text().replace("bone.png", str(self.folder / "work/bone.png"), 1)
        self.run_scene(self.write(alone), "alone", 1)
        for name in ("flow", "inlet"):
            self.assertEqual(*((self.folder / run / f"watch/{name}.csv").read_bytes() for run in ("shared", "alone")), name)

    def test_a_picture_outside_of_it(self):
        done = self.over_the_network(str(SOURCE / "configs/fluid/trabecular-bone.png"))
        self.assertEqual(done.returncode, 2, done.all)
        self.assertIn("is not in the working folder", done.all)


class GoingOn(Case):
    def test_from_a_checkpoint_of_another_number_of_ranks(self):
        scene = self.write(SPRING)
        self.run_scene(scene, "alone", 1)
        for before, after in ((1, 4), (2, 1)):
            out = f"{before} then {after}"
            self.run_scene(scene, out, before, "--set", "coupling.end_time=0.2")
            self.run_scene(scene, out, after, "--resume")
            # The shorter run ended with a frame of its own.
            for name in ("watch/flow.csv", "watch/wake.csv", "solid/checkpoint-1.h5"):
                self.assertTrue(filecmp.cmp(self.folder / out / name, self.folder / "alone" / name, shallow=False),
                                f"{name} of {out}")

    def test_in_pores_after_odd_and_even_steps(self):
        """Solid nodes have no memory there, and what walls turn back lies elsewhere after an odd step than after an even one."""
        text = (SOURCE / "configs/fluid/rabbit-bone.toml").read_text().replace("relaxation_time = 1.0", "time_step = 4e-7")
        text = text.replace("[fluid.steady]\ntolerance = 1e-6\n", "").replace(
            'mode = "steady"', 'mode = "transient"\nwindow = 2.8e-6\nend_time = 5.6e-5\n[recovery]\nevery = 3')  # 7 steps a window
        scene = self.write(text)
        self.run_scene(scene, "alone", 1)
        for before, after, windows in ((1, 2, 9), (2, 1, 6), (2, 1, 9)):
            out = f"{before} then {after}, {windows}"
            self.run_scene(scene, out, before, "--set", f"coupling.end_time={2.8e-6 * windows!r}")
            self.run_scene(scene, out, after, "--resume")
            for name in ("flow", "inlet", "outlet"):
                self.assertTrue(filecmp.cmp(self.folder / out / f"watch/{name}.csv", self.folder / f"alone/watch/{name}.csv", shallow=False),
                                f"{name} of {out}")

    def test_after_the_death_of_a_rank(self):
        scene = self.write(SPRING.replace("end_time = 0.4", "end_time = 1.0"))
        self.run_scene(scene, "alone", 1)
        run = subprocess.Popen([str(word) for word in self.command(scene, "killed", 2)], cwd=SOURCE, stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, text=True)
        killed = self.kill_a_follower(run)
        output, _ = run.communicate(timeout=200)
        self.assertEqual(run.returncode, 0, output)
        self.assertTrue(killed, output)
        log = (self.folder / "killed/log/coupler.log")
        self.assertIn("launches", output + (log.read_text() if log.exists() else ""))
        self.expect_same("killed", "alone", GHOSTS)

    def kill_a_follower(self, run):
        """The youngest of the run's fluids, once a checkpoint is there; rank 0, which serves, is the oldest."""
        while run.poll() is None:
            found = subprocess.run(["pgrep", "-f", f"fluid-lbm-mpi.*{self.folder}"], capture_output=True, text=True).stdout.split()
            names = {pid: pathlib.Path(f"/proc/{pid}/comm") for pid in found}
            ranks = sorted(int(pid) for pid, name in names.items() if name.exists() and name.read_text().startswith("fluid"))
            if len(ranks) == 2 and (self.folder / "killed/checkpoint").exists():
                os.kill(ranks[-1], signal.SIGKILL)
                return True
            time.sleep(0.01)
        return False


class Launched(Case):
    def test_inside_one_task_of_slurm(self):
        """A processor for each rank's threads, and mpirun within it."""
        host = '[hosts.fluid]\nlaunch = "slurm"\naddress = "tcp://node1:7000"\nfolder = "/tmp"\n'
        scene = self.write("insecure = true\n" + SPRING.replace("[fluid]", host + "[fluid]\nranks = 2\nthreads = 3"))
        done = subprocess.run([BIN / "coupler", "run", "--dry-run", scene], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertRegex(done.stdout, r"srun --ntasks=1 .*--cpus-per-task=6 .*mpirun -n 2 .*fluid-lbm-mpi .*--threads 3")


class Refused(Case):
    def refused(self, text, *lines):
        done = subprocess.run([BIN / "coupler", "check", self.write(text)], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        for line in lines:
            self.assertIn(line, done.stdout + done.stderr)

    def test_slabs_that_are_too_thin(self):
        self.refused(SPRING.replace("[fluid]", "[fluid]\nranks = 9"), "9 ranks need 4 rows", "the grid has 32: at most 8 ranks")

    def test_a_rule_that_one_rank_alone_can_follow(self):
        text = BODIES.replace('"quadratic"', '"yin-zhang"').replace("[fluid]", '[fluid]\nequilibrium = "compressible"\nranks = 2')
        self.refused(text, "works on one rank only")

    def test_grains_on_several_ranks(self):
        text = WithGrains.grains(self, "interpolated").replace("[grains]", "[grains]\nranks = 2")
        self.refused(text, "only the fluid is shared among ranks")

    def test_a_solver_of_somebody_else(self):
        self.refused(SPRING.replace("[fluid]", '[fluid]\nranks = 2\nsolver = "python3 my.py"'), "only fluid-lbm is shared among ranks")

    def test_a_fluid_that_runs_alone(self):
        """Launched by hand, without mpirun."""
        scene = self.write(BODIES.replace("[fluid]", f'[fluid]\nranks = 2\nconnect = "ipc://{self.folder}/socket"'))
        fluid = subprocess.Popen([BIN / "fluid-lbm", "--bind", f"ipc://{self.folder}/socket", "--folder", self.folder / "fluid"],
                                 stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        done = subprocess.run([BIN / "coupler", "run", scene, "--out", self.folder / "out"], capture_output=True, text=True, timeout=60)
        fluid.wait(timeout=20)
        self.assertIn("this fluid runs as 1: start it with mpirun -n 2 fluid-lbm-mpi", done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
