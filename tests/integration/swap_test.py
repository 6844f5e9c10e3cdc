"""Swapping solvers, with real processes: what the coupler refuses and why, `coupler conform`, participants in Python and C,
solvers of other houses where they are installed, the page on writing a solver, and the import of preCICE configurations.

usage: swap_test.py BUILD SOURCE [TestCase[.test]...]"""
import ctypes.util, csv, json, math, os, pathlib, re, shutil, socket, subprocess, sys, tempfile, time, unittest

BUILD, SOURCE = (pathlib.Path(path).resolve() for path in sys.argv[1:3])
BIN = BUILD / "bin"
os.environ["PYTHONPATH"] = str(BIN)
os.environ["OMP_NUM_THREADS"] = "1"
ODD = SOURCE / "tests/integration/odd_participant.py"


class Case(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.temporary.name)

    def tearDown(self):
        self.temporary.cleanup()

    def coupler(self, *words):
        done = subprocess.run([BIN / "coupler", *map(str, words)], cwd=self.folder, capture_output=True, text=True, timeout=100)
        done.all = done.stdout + done.stderr
        return done

    def run_scene(self, *words):
        return self.coupler("run", *words, "--out", self.folder / "out")

    def summary(self):
        return json.loads((self.folder / "out/summary.json").read_text())

    def write(self, text, name="scene.toml"):
        (self.folder / name).write_text(text)
        return self.folder / name

    def springs(self, solid, coupling='mode = "transient"\nwindow = 0.1\nend_time = 0.3', dimension=2, fluid="given-pressure"):
        return self.write(f'dimension = {dimension}\n[coupling]\n{coupling}\n[fluid]\nsolver = "{fluid}"\n'
                          f'pressure = 2.0\n[solid]\nsolver = "{solid}"\n')

    def masses(self):
        return self.write('dimension = 2\n[coupling]\nmode = "transient"\nwindow = 0.014\nend_time = 0.7\ntolerance = 1e-8\n'
                          '[fluid]\nsolver = "oscillator"\n[solid]\nsolver = "mass-on-spring"\nspring = 39.47841760435743\nplace = 1.0\n'
                          '[[watch]]\nname = "right"\nparticipant = "fluid"\n')

    def conform(self, scene, role, status=0, *words):
        done = self.coupler("conform", "--scene", scene, "--role", role, *words)
        self.assertEqual(done.returncode, status, done.all)
        self.assertEqual("FAILS" in done.stdout, status != 0, done.all)
        return done.stdout


class Refusals(Case):
    """Exit 2, one line with who, what and why, one with what to change, and no window was computed."""
    def refused(self, fault, *expected, **scene):
        done = self.run_scene(self.springs(f"{ODD} --fault={fault}", **scene))
        self.assertEqual(done.returncode, 2, done.all)
        for text in expected:
            self.assertIn(text, done.stderr)
        self.assertEqual(self.summary()["windows"], 0)

    def test_what_a_scene_needs_is_asked_before_anything_is_computed(self):
        self.refused("lacks-rewind", 'solid: odd 1', 'lacks "rewind"', 'coupling.scheme = "serial-explicit"')
        self.refused("lacks-transient", 'lacks "transient"', 'coupling.mode = "steady"')
        self.refused("lacks-steady", 'lacks "steady"', 'coupling.mode = "transient"', coupling='mode = "steady"')
        self.refused("lacks-wet-surface", 'lacks "wet-surface"', "--set fluid=off")
        self.refused("three-dimensional", "does not compute in 2 dimensions; it does in: 3", "dimension = 3")
        self.refused("another-role", "cannot play this part; it can be: fluid", "solid.solver")
        self.refused("another-protocol", "protocol version", "the messages of this coupler")
        self.refused("no-surface", "brings no wet surface", "name its wet sides")
        self.refused("surface-in-3d", "in 3 dimensions to a scene in 2")

    def test_a_field_that_is_missing_at_the_start_is_named(self):
        self.refused("no-start-displacements", "no displacement of its nodes", "answer to Start has to hold `displacements`")
        self.refused("no-start-velocity", "no velocity of its nodes", "zeros at rest")
        done = self.run_scene(SOURCE / "configs/grains/settling-disc.toml", "--set", f"grains.solver={ODD} --fault=no-grain-states")
        self.assertEqual(done.returncode, 2, done.all)
        self.assertIn("'grains' brings no states of its grains", done.stderr)
        self.assertIn("`grain_states`", done.stderr)
        self.assertEqual(self.summary()["windows"], 0)

    def test_a_field_that_is_missing_is_named(self):
        done = self.run_scene(self.springs(f"{ODD} --fault=no-displacements"))
        self.assertEqual(done.returncode, 4, done.all)
        self.assertRegex(done.stderr, "'solid' at window 1, iteration 1: Displacements")

    def test_without_rewind_an_explicit_scheme_runs(self):
        scene = self.springs(f"{ODD} --fault=lacks-rewind",
                             coupling='mode = "transient"\nscheme = "serial-explicit"\nwindow = 0.1\nend_time = 0.3')
        self.assertEqual(self.run_scene(scene).returncode, 0)


class Conform(Case):
    def test_finds_what_is_wrong(self):
        # The last two fail wherever something is computed.
        for fault, count, line in (
                ("", 0, "[0-9]+ hold, 0 fail"), ("forgets-to-rewind", 1, "rewinds to the same bits .*FAILS"),
                ("takes-anything", 2, "refuses wrong inputs and stays up .*FAILS.*forces.force not a number"),
                ("answers-nan", 4, "computes .*FAILS .*not finite"), ("no-displacements", 4, "computes .*FAILS .*no displacements")):
            text = self.conform(self.springs(f"{ODD} --fault={fault}"), "solid", 1 if fault else 0)
            self.assertRegex(text, line)
            self.assertEqual(text.count("FAILS"), count, text)
        done = self.coupler("conform", "--scene", self.springs(f"{ODD} --fault=dies"), "--role", "solid")
        self.assertEqual(done.returncode, 4, done.all)
        self.assertRegex(done.stdout, "goes on answering +FAILS +ended with exit status 7")

    def test_a_running_participant_is_asked_without_a_scene(self):
        address = f"ipc://{self.folder}/socket"
        process = subprocess.Popen([BIN / "spring-cylinder", "--bind", address, "--folder", self.folder])
        try:
            done = self.coupler("conform", address)
            self.assertEqual(done.returncode, 0, done.all)
            self.assertIn("refuses another protocol version", done.stdout)
            self.assertIn("spring-cylinder", self.coupler("ping", address).stdout)
        finally:
            process.kill()
            process.wait()

    def test_test_participants(self):
        springs = self.write('dimension = 2\n[coupling]\nmode = "steady"\n[fluid]\nsolver = "linear-participant"\npressure = 3.0\nslope = 0.5\n'
                             '[solid]\nsolver = "linear-participant"\nstiffness = 1.0\n')
        for role in ("fluid", "solid"):
            self.conform(springs, role)
            self.conform(SOURCE / "configs/fsi/two-masses-three-springs.toml", role)

    def test_solvers_of_the_house(self):
        channel = SOURCE / "configs/fsi/elastic-fin.toml"
        coarse = ["--set", "fluid.spacing=0.05", "--set", "solid.particles_across=4"]
        in_time = [*coarse, "--set", "coupling.mode=transient", "--set", "coupling.window=0.01", "--set", "coupling.end_time=1.0"]
        for role in ("fluid", "solid"):
            self.conform(channel, role, 0, *coarse)
            self.assertRegex(self.conform(channel, role, 0, *in_time), "rewinds to the same bits +ok")
        for scene in ("grains/settling-disc", "three-way/grains-on-elastic-plate"):
            for role in ("fluid", "grains"):
                self.conform(SOURCE / f"configs/{scene}.toml", role)

    def test_participants_in_python_and_c(self):
        cylinder = SOURCE / "configs/fsi/viv-cylinder.toml"
        text = self.conform(cylinder, "solid", 0, "--launch", "spring-cylinder")
        self.assertRegex(text, "rewinds to the same bits +ok")
        self.assertRegex(text, "goes on from a checkpoint with the same bits +ok")
        self.conform(self.springs(ODD), "fluid")
        self.conform(self.masses(), "solid")


class CInterface(Case):
    """Two masses and three springs: the left mass is the C example, with steps of its own in every window."""

    def error(self, *words):
        done = self.run_scene(self.masses(), *words)
        self.assertEqual(done.returncode, 0, done.all)
        return self.summary()["watch"]["right"]["error"]["last"]

    def test_converges_to_the_exact_motion_at_second_order(self):
        coarse, fine = self.error(), self.error("--set", "coupling.window=0.007")
        self.assertLess(coarse, 0.02)
        self.assertAlmostEqual(math.log2(coarse / fine), 2.0, delta=0.3)

    def test_compiled_by_hand_against_what_is_installed(self):
        there = self.folder / "there"
        subprocess.run(["cmake", "--install", BUILD, "--prefix", there], check=True, stdout=subprocess.DEVNULL)
        subprocess.run(["cc", SOURCE / "participant/examples/mass_on_spring.c", "-I", there / "include", "-L", there / "lib", "-lestuary", "-lm",
                        f"-Wl,-rpath,{there}/lib", "-o", self.folder / "my-solver"], check=True)
        names = subprocess.run(["nm", "--dynamic", "--defined-only", there / "lib/libestuary.so"], capture_output=True, text=True, check=True).stdout
        self.assertEqual({line.split()[-1] for line in names.splitlines() if "estuary_" not in line}, set())
        done = self.run_scene(self.masses(), "--set", f"solid.solver={self.folder}/my-solver")
        self.assertEqual(done.returncode, 0, done.all)
        elsewhere = subprocess.run([there / "bin/coupler", "check", SOURCE / "configs/fsi/viv-cylinder.toml", "--set", "solid.solver=spring-cylinder"],
                                   capture_output=True, text=True, env={"PATH": os.environ["PATH"]})
        self.assertEqual(elsewhere.returncode, 0, elsewhere.stdout + elsewhere.stderr)

    def test_the_scene_is_checked_like_any_other(self):
        done = self.coupler("check", self.masses(), "--set", "solid.sprin=2.0")
        self.assertEqual(done.returncode, 2, done.all)
        self.assertIn("spring", done.stderr)
        self.assertEqual(self.coupler("check", self.masses()).returncode, 0)

    def test_a_coupler_that_dies_ends_it(self):
        process = subprocess.Popen([BIN / "coupler", "run", self.masses(), "--out", self.folder / "out", "--set", "coupling.window=1e-5",
                                    "--set", "coupling.end_time=1.0"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        iterations = self.folder / "out/convergence.csv"
        for _ in range(500):
            if iterations.exists() and iterations.stat().st_size > 2000:
                break
            time.sleep(0.02)
        process.kill()
        process.wait()
        deadline = time.monotonic() + 10
        here = lambda: subprocess.run(["pgrep", "-f", str(self.folder / "out")], capture_output=True).stdout
        while here() and time.monotonic() < deadline:
            time.sleep(0.05)
        self.assertFalse(here())


class Keys(Case):
    """Participants in Python and in C at an address that other machines reach: encrypted, with lists of who may come."""
    def address(self):
        hosts = [word for word in subprocess.run(["hostname", "-I"], capture_output=True, text=True).stdout.split() if "." in word]
        with socket.socket() as one:
            one.bind(("", 0))
            return f"tcp://{hosts[0] if hosts else '127.0.0.1'}:{one.getsockname()[1]}"

    def serve(self, program, address, *options):
        log = open(self.folder / f"{program}.log", "w")
        process = subprocess.Popen([BIN / program, "--bind", address, "--folder", self.folder / program, *options], stdout=log, stderr=log)
        self.addCleanup(lambda: (process.kill(), process.wait(), log.close()))

    def setUp(self):
        super().setUp()
        for name in ("server", "coupler", "stranger"):
            self.assertEqual(self.coupler("keys", name).returncode, 0)
        self.keys = ["--key", self.folder / "server.key", "--allow", self.folder / "coupler.pub"]

    def run_with(self, scene, address, *words, key="coupler"):
        hosts = f'[hosts.coupler]\nkey = "{key}.key"\n[hosts.solid]\npublic_key = "server.pub"\n'
        text = re.sub(r'\[solid\]\nsolver = ".*"', f'[solid]\nconnect = "{address}"', scene.read_text()) + hosts
        return self.run_scene(self.write(text.replace("[coupling]", "[coupling]\nconnect_timeout = 3.0"), "remote.toml"), *words)

    def test_python(self):
        address = self.address()
        self.serve("spring-cylinder", address, *self.keys)
        scene = self.write('dimension = 2\n[coupling]\nmode = "transient"\nwindow = 0.1\nend_time = 0.5\n[fluid]\nsolver = "given-pressure"\n'
                           '[solid]\nsolver = "spring-cylinder"\nmass = 2.0\nheld = ["x", "rotation"]\n[solid.disc]\nradius = 0.5\n')
        refused = self.run_with(scene, address, key="stranger")
        self.assertEqual(refused.returncode, 4, refused.all)
        self.assertIn("refused a connection: its key is not on the list (1 so far)", (self.folder / "spring-cylinder.log").read_text())
        done = self.run_with(scene, address)
        self.assertEqual(done.returncode, 0, done.all)

    def test_c(self):
        address = self.address()
        self.serve("mass-on-spring", address, *self.keys)
        done = self.run_with(self.masses(), address)
        self.assertEqual(done.returncode, 0, done.all)

    def test_without_keys_it_is_refused_and_secrets_stay_secret(self):
        def says(*words):
            done = subprocess.run([BIN / "spring-cylinder", "--folder", self.folder / "x", *words], capture_output=True, text=True, timeout=20)
            self.assertIn(done.returncode, (1, 2))
            return done.stderr
        there = ["--bind", "tcp://0.0.0.0:5555"]
        self.assertIn("give --key and --allow", says(*there))
        self.assertIn("belong together", says(*there, "--key", "server.key"))
        (self.folder / "server.key").chmod(0o644)
        self.assertIn("others than its owner", says(*there, *self.keys))
        broken = self.write('public_key = "abc"\nsecret_key = "SECRETSECRET"\n', "broken.key")
        broken.chmod(0o600)
        text = says(*there, "--key", broken, "--allow", self.folder / "coupler.pub")
        self.assertIn("holds no `public_key`", text)
        self.assertNotIn("SECRET", text)


class Page(Case):
    """participant/WRITE-A-SOLVER.md, word for word."""
    def test_what_the_page_says_works(self):
        page = (SOURCE / "participant/WRITE-A-SOLVER.md").read_text()
        blocks = re.findall(r"```(\w+)\n(.*?)```", page, re.S)
        program = "\n".join(text for language, text in blocks if language == "python")
        without_blank = lambda text: [line for line in text.splitlines() if line.strip()]
        self.assertEqual(without_blank(program), without_blank((SOURCE / "participant/python/spring-cylinder").read_text()))
        self.assertIn(f"{len((SOURCE / 'participant/python/spring-cylinder').read_text().splitlines())} lines", page)
        self.write(program, "my-cylinder")
        self.write(next(text for language, text in blocks if language == "toml"), "my-scene.toml")
        (self.folder / "build").symlink_to(BUILD)
        (self.folder / "configs").symlink_to(SOURCE / "configs")
        commands = [text for language, text in blocks if language == "sh"]
        self.assertGreaterEqual(len(commands), 4)
        done = subprocess.run(["bash", "-euo", "pipefail", "-c", "\n".join(commands)], cwd=self.folder, capture_output=True, text=True, timeout=100)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("1 of 1 checks hold", done.stdout)


@unittest.skipUnless(shutil.which("ccx"), "CalculiX is not installed")
class CalculiX(Case):
    def test_large_deflection_of_a_cantilever(self):
        scene = SOURCE / "configs/solid/cantilever-large.toml"
        done = self.run_scene(scene, "--set", "solid.solver=calculix-solid", "--set", "solid.elements_across=2")
        self.assertEqual(done.returncode, 0, done.all)
        self.assertAlmostEqual(self.summary()["watch"]["tip"]["displacement_y"]["last"] / 0.08256, 1.0, delta=0.01)  # solid-sph and CalculiX on fine meshes

    def test_keeps_the_contract_and_says_where_it_cannot(self):
        fin = SOURCE / "configs/fsi/elastic-fin.toml"
        self.conform(fin, "solid", 0, "--launch", "calculix-solid", "--set", "solid.elements_across=1")
        done = self.coupler("check", fin, "--set", "solid.solver=calculix-solid", "--set", "coupling.mode=transient",
                            "--set", "coupling.window=0.1", "--set", "coupling.end_time=1.0")
        self.assertEqual(done.returncode, 2, done.all)
        self.assertIn("equilibria only", done.stderr)


@unittest.skipUnless(ctypes.util.find_library("lammps"), "LAMMPS is not installed")
class Lammps(Case):
    def scene(self, solver):
        return self.write('dimension = 2\n[coupling]\nmode = "transient"\nwindow = 1e-3\nend_time = 0.1\n'
                          f'[grains]\nsolver = "{solver}"\ndensity = 1500.0\nnormal_stiffness = 1e4\nrestitution = 0.5\n'
                          'gravity = [0.0, -9.81]\nwalls = ["left", "right", "bottom", "top"]\n[grains.box]\nfrom = [0.0, 0.0]\n'
                          'to = [0.02, 0.06]\n[[grains.group]]\npositions = [[0.01, 0.02]]\nradius = 0.00125\n'
                          '[[watch]]\nname = "disc"\nparticipant = "grains"\ngrain = 0\n')

    def test_a_disc_falls_and_bounces_as_in_grains_dem(self):
        heights = []
        for solver in ("lammps-grains", "grains-dem"):
            self.assertEqual(self.run_scene(self.scene(solver)).returncode, 0)
            with open(self.folder / "out/watch/disc.csv") as file:
                heights.append([float(row["position_y"]) for row in csv.DictReader(file)])
        for k in range(55):  # free fall
            self.assertAlmostEqual(heights[0][k], heights[1][k], delta=1e-12)
        self.assertAlmostEqual(max(heights[0][70:]), max(heights[1][70:]), delta=4e-4)

    def test_falls_onto_an_elastic_plate_as_grains_dem_does(self):
        """Windows that are repeated, ten planes that move with the plate, and the forces on it."""
        plate = SOURCE / "configs/three-way/grains-on-elastic-plate.toml"
        sag = []
        for solver in ("lammps-grains", "grains-dem"):
            self.run_scene(plate, "--set", f"grains.solver={solver}", "--set", "grains.steps_per_contact=200", "--set", "fluid=off",
                           "--set", "coupling.end_time=0.014", "--set", "output.frames=false", "--no-report")
            self.assertEqual(self.summary()["windows"], 28)
            sag.append(self.summary()["watch"]["middle"]["displacement_y"]["last"])
        self.assertLess(sag[1], -5e-5)
        self.assertAlmostEqual(sag[0] / sag[1], 1.0, delta=0.01)

    def test_keeps_the_contract_and_says_where_it_cannot(self):
        for scene, line in (("grains/settling-disc", "goes on from a checkpoint with the same bits +ok"),
                            ("three-way/grains-on-elastic-plate", "rewinds to the same bits +ok")):
            self.assertRegex(self.conform(SOURCE / f"configs/{scene}.toml", "grains", 0, "--launch", "lammps-grains"), line)
        done = self.coupler("check", SOURCE / "configs/three-way/grains-on-elastic-plate.toml", "--set", "grains.solver=lammps-grains",
                            "--set", "grains.rolling_law=viscous", "--set", "coupling.mode=steady")
        self.assertEqual(done.returncode, 2, done.all)
        self.assertIn("'grains.rolling_law' is \"spring\" or \"none\" here", done.stderr)
        self.assertIn('coupling.mode has to be "transient"', done.stderr)


class Import(Case):
    """A preCICE configuration of version 3, one of version 2, and what is wrong with some."""
    def test_parallel_implicit_with_iqn(self):
        config = self.write("""<?xml version="1.0"?>
<precice-configuration>
  <log><sink filter="%Severity% > debug"/></log>
  <data:vector name="Force"/> <data:vector name="Displacement"/> <data:scalar name="Temperature"/>
  <mesh name="Fluid-Mesh" dimensions="2"><use-data name="Force"/></mesh>
  <mesh name="Solid-Mesh" dimensions="2"><use-data name="Displacement"/></mesh>
  <participant name="Fluid">
    <provide-mesh name="Fluid-Mesh"/> <receive-mesh name="Solid-Mesh" from="Solid"/>
    <write-data name="Force" mesh="Fluid-Mesh"/> <read-data name="Displacement" mesh="Fluid-Mesh"/>
    <mapping:rbf direction="write" from="Fluid-Mesh" to="Solid-Mesh" constraint="conservative">
      <basis-function:compact-polynomial-c2 support-radius="0.25"/>
    </mapping:rbf>
    <mapping:nearest-neighbor direction="read" from="Solid-Mesh" to="Fluid-Mesh" constraint="consistent"/>
  </participant>
  <participant name="Solid">
    <provide-mesh name="Solid-Mesh"/> <write-data name="Displacement" mesh="Solid-Mesh"/>
    <read-data name="Force" mesh="Solid-Mesh"/> <write-data name="Temperature" mesh="Solid-Mesh"/>
    <watch-point mesh="Solid-Mesh" name="Flap Tip" coordinate="0.0;1"/>
    <export:vtu directory="out" every-n-time-windows="5"/>
  </participant>
  <m2n:sockets acceptor="Fluid" connector="Solid" exchange-directory=".."/>
  <coupling-scheme:parallel-implicit>
    <time-window-size value="0.01"/> <max-time value="5"/>
    <participants first="Fluid" second="Solid"/>
    <exchange data="Force" mesh="Solid-Mesh" from="Fluid" to="Solid"/>
    <exchange data="Displacement" mesh="Solid-Mesh" from="Solid" to="Fluid"/>
    <max-iterations value="60"/>
    <relative-convergence-measure limit="5e-3" data="Displacement" mesh="Solid-Mesh"/>
    <relative-convergence-measure limit="2e-3" data="Force" mesh="Solid-Mesh"/>
    <acceleration:IQN-ILS>
      <data name="Displacement" mesh="Solid-Mesh"/> <data name="Force" mesh="Solid-Mesh"/>
      <preconditioner type="residual-sum"/> <filter type="QR2" limit="1e-2"/>
      <initial-relaxation value="0.4"/> <max-used-iterations value="90"/> <time-windows-reused value="15"/>
    </acceleration:IQN-ILS>
  </coupling-scheme:parallel-implicit>
</precice-configuration>
""", "precice-config.xml")
        done = self.coupler("import", config, "--out", "scene.toml")
        self.assertEqual(done.returncode, 0, done.all)
        self.assertIn("precice-config.xml:13: <mapping:nearest-neighbor>", done.stderr)
        self.assertIn("'Temperature' does not travel here", done.stderr)
        self.assertIn("<m2n:sockets>", done.stderr)
        import tomllib
        scene = tomllib.loads((self.folder / "scene.toml").read_text())
        self.assertEqual(scene["coupling"], {
            "mode": "transient", "window": 0.01, "end_time": 5, "scheme": "parallel-implicit", "acceleration": "iqn-ils", "max_iterations": 60,
            "relaxation": 0.4, "max_used_iterations": 90, "time_windows_reused": 15, "filter": "qr2", "filter_limit": 1e-2,
            "preconditioner": "residual-sum", "mapping": {"kind": "wendland-c2", "support_radius": 0.25, "loads": "forces"},
            "convergence": [{"field": "displacement", "measure": "relative", "limit": 5e-3}, {"field": "force", "measure": "relative", "limit": 2e-3}]})
        self.assertEqual(scene["watch"], [{"name": "Flap_Tip", "participant": "solid", "point": [0.0, 1]}])
        self.assertEqual(scene["output"], {"frame_interval": 5})
        # With programs in place of theirs, it is a scene that runs.
        names = ["--set", "fluid.solver=given-pressure", "--set", f"solid.solver={ODD}", "--set", "coupling.end_time=0.05"]
        done = self.run_scene("scene.toml", *names)
        self.assertEqual(done.returncode, 0, done.all)

    def test_version_2_serial_with_aitken_and_integral(self):
        config = self.write("""<precice-configuration><solver-interface dimensions="2">
  <participant name="Left"><write-data name="Stress" mesh="A"/>
    <mapping:rbf-thin-plate-splines direction="write" from="A" to="B" constraint="consistent"/></participant>
  <participant name="Right"><write-data name="DisplacementDelta" mesh="B"/><watch-integral mesh="B" name="all"/></participant>
  <coupling-scheme:serial-implicit>
    <participants first="Right" second="Left"/> <time-window-size value="1e-3"/> <max-time-windows value="10"/>
    <exchange data="DisplacementDelta" mesh="B" from="Right" to="Left"/>
    <residual-relative-convergence-measure limit="1e-4" data="DisplacementDelta" mesh="B"/>
    <acceleration:aitken><data name="DisplacementDelta" mesh="B"/><initial-relaxation value="0.1"/></acceleration:aitken>
  </coupling-scheme:serial-implicit>
</solver-interface></precice-configuration>""", "old.xml")
        done = self.coupler("import", config)
        self.assertEqual(done.returncode, 0, done.all)
        for text in ('scheme = "serial-implicit"', "end_time = 0.01", 'acceleration = "aitken"', "relaxation = 0.1", 'measure = "residual-relative"',
                     'kind = "thin-plate-spline"', 'loads = "pressures"', 'participant = "coupling"', 'solver = "left"', 'solver = "right"'):
            self.assertIn(text, done.stdout)
        self.assertIn("increments", done.stderr)
        self.assertIn("the fluid computes first here", done.stderr)

    def test_three_participants_with_what_has_no_counterpart(self):
        config = self.write("""<precice-configuration experimental="true">
  <data:vector name="Pressure"/> <data:vector name="Displacement"/> <data:vector name="Drag-Force"/> <data:global-scalar name="Angle"/>
  <mesh name="F" dimensions="2"/> <mesh name="S" dimensions="2"/> <mesh name="P" dimensions="2"/>
  <participant name="LBM"><provide-mesh name="F"/><write-data name="Drag-Force" mesh="P"/><write-data name="Pressure" mesh="F"/>
    <mapping:rbf-pum-direct direction="write" from="F" to="S" constraint="conservative"><basis-function:compact-polynomial-c6 support-radius=".3"/></mapping:rbf-pum-direct>
    <action:multiply-by-area timing="write-mapping-post" mesh="F"/> </participant>
  <participant name="Beam"><write-data name="Displacement" mesh="S"/><watch-point mesh="S" name="mid span" coordinate="0.02;0."/></participant>
  <participant name="DEM-Particles"><write-data name="Particle-Velocity" mesh="P"/></participant>
  <m2n:mpi acceptor="LBM" connector="Beam" use-two-level-initialization="true"/>
  <coupling-scheme:serial-explicit><participants first="LBM" second="DEM-Particles"/><time-window-size value="5e-4"/>
    <exchange data="Drag-Force" mesh="P" from="LBM" to="DEM-Particles"/></coupling-scheme:serial-explicit>
  <coupling-scheme:multi><participant name="LBM" control="yes"/><participant name="Beam"/>
    <time-window-size value="5.e-4"/> <max-time-windows value="600"/>
    <exchange data="Pressure" mesh="S" from="LBM" to="Beam"/> <exchange data="Displacement" mesh="S" from="Beam" to="LBM"/>
    <absolute-or-relative-convergence-measure abs-limit="1e-9" rel-limit="1.E-4" data="Displacement" mesh="S"/>
    <relative-convergence-measure limit="1e-3" data="Drag-Force" mesh="P"/> <relative-convergence-measure limit="a few" data="Pressure" mesh="S"/>
    <acceleration:IQN-IMVJ><initial-relaxation value=".3"/><filter type="QR1-absolute" limit="1e-9"/></acceleration:IQN-IMVJ>
  </coupling-scheme:multi>
</precice-configuration>""", "three.xml")
        done = self.coupler("import", config, "--out", "scene.toml")
        self.assertEqual(done.returncode, 0, done.all)
        for text in ("three.xml:10: <coupling-scheme:serial-explicit>: a scene has one coupling scheme for all its participants: the multi of line 12",
                     "'Drag-Force' is no field of the wet surface, which alone is measured", "`limit` is no number: 'a few'", "<action:multiply-by-area>: is not needed",
                     "<data:global-scalar>", "'compact-polynomial-c6' is not known; wendland-c4 is taken", "the relative one is taken", "a parallel scheme has to measure the forces"):
            self.assertIn(text, done.stderr)
        import tomllib
        scene = tomllib.loads((self.folder / "scene.toml").read_text())
        self.assertEqual([scene[role]["solver"] for role in ("fluid", "solid", "grains")], ["lbm", "beam", "dem-particles"])
        self.assertEqual(scene["coupling"], {
            "mode": "transient", "window": 5e-4, "end_time": 0.3, "scheme": "parallel-implicit", "acceleration": "iqn-imvj", "relaxation": 0.3, "filter": "qr1",
            "filter_limit": 1e-6, "mapping": {"kind": "wendland-c4", "support_radius": 0.3, "loads": "forces"},
            "convergence": [{"field": "displacement", "measure": "relative", "limit": 1e-4}, {"field": "force", "measure": "relative", "limit": 1e-3}]})
        self.assertEqual(scene["watch"], [{"name": "mid_span", "participant": "solid", "point": [0.02, 0]}])
        # With our own participants' tables in place of theirs it is a right scene.
        ours = (SOURCE / "configs/three-way/grains-on-elastic-plate.toml").read_text()
        text = (self.folder / "scene.toml").read_text()
        text = text[:text.index("[fluid]")] + ours[ours.index("[fluid]"):ours.index("[[watch]]")] + text[text.index("[[watch]]"):]
        done = self.coupler("check", self.write(text, "ours.toml"))
        self.assertEqual(done.returncode, 0, done.all)

    def test_the_names_of_version_2(self):
        config = self.write("""<precice-configuration><solver-interface dimensions="3">
  <participant name="Fluid"><write-data name="Forces0" mesh="F"/></participant> <participant name="Calculix"><read-data name="Forces0" mesh="S"/></participant>
  <coupling-scheme:serial-implicit><participants first="Fluid" second="Calculix"/> <max-timesteps value="100"/> <timestep-length value="1e-4"/>
    <relative-convergence-measure limit="1e-3" data="DisplacementDeltas0" mesh="S"/>
    <post-processing:IQN-IMVJ><preconditioner type="value"/><timesteps-reused value="1"/></post-processing:IQN-IMVJ>
  </coupling-scheme:serial-implicit></solver-interface></precice-configuration>""", "tube.xml")
        done = self.coupler("import", config)
        self.assertEqual(done.returncode, 0, done.all)
        for text in ("window = 0.0001", "end_time = 0.01", 'acceleration = "iqn-imvj"', "time_windows_reused = 1", 'solver = "calculix"', "dimension = 3"):
            self.assertIn(text, done.stdout)
        self.assertIn("a wet surface has two dimensions here", done.stderr)
        self.assertIn("'value' is not known", done.stderr)

    def test_what_cannot_be_read_is_said_with_its_line(self):
        done = self.coupler("import", self.write("<precice-configuration>\n<oops\n", "bad.xml"))
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"bad.xml:\d: ")
        done = self.coupler("import", self.write('<precice-configuration>\n<participant name="A"/>\n<participant name="B"/></precice-configuration>', "parts.xml"))
        self.assertEqual(done.returncode, 2)
        self.assertIn("parts.xml:2: cannot tell which part 'A' plays", done.stderr)
        self.assertIn("--role A=", done.stderr)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
