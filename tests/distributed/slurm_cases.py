"""Runs inside an allocation of Slurm, and studies as job arrays: the same bits as without."""
import csv
import os
import shlex
import shutil
import signal
import subprocess
import time

from driver import PROGRAMS, ROOT, Failure, expect, expect_same, summary
from host_cases import expect_no_solvers, local_run
from slurm import Slurm, free_port

DISC = ("--set", "fluid.threads=1", "--set", "grains.threads=1", "--set", "recovery.every=20")


def scene_of(place, slurm):
    """The settling disc, both participants started by Slurm. On one node loopback is enough; others want keys."""
    text = (ROOT / "configs/grains/settling-disc.toml").read_text()
    for role, program in (("fluid", "fluid-lbm"), ("grains", "grains-dem")):
        text = text.replace(f"[{role}]\n", f'[{role}]\nsolver = "{PROGRAMS}/{program}"\n', 1)
        text += (f'[hosts.{role}]\nlaunch = "slurm"\nhost = "{slurm.host}"\naddress = "tcp://127.0.0.1:{free_port()}"\n'
                 f'folder = "{place.folder}/node/{role}"\n')
    return place.write("scene.toml", text)


def job(place, slurm, scene, *options, tasks=("--ntasks=3",)):
    words = [str(PROGRAMS / "coupler"), "run", str(scene), "--out", str(place.folder / "out"), "--no-report", *options]
    return slurm.submit("exec " + shlex.join(words), *tasks, "--job-name=coupled", "--chdir", str(ROOT), "--signal=TERM@1",
                        "--output", str(place.folder / "job-%j.txt"))


def wait_for_window(place, slurm, window, limit=120):
    rows = place.folder / "out/iterations.csv"
    deadline = time.monotonic() + limit
    while not rows.exists() or rows.read_bytes().count(b"\n") < window + 1:
        expect(time.monotonic() < deadline and slurm.ask("squeue", "--noheader"), f"window {window} was not reached:\n"
               + "\n".join(path.read_text() for path in place.folder.glob("job-*.txt")) + slurm.logs())
        time.sleep(0.01)


def elsewhere(place):
    return {role: place.folder / "node" / role for role in ("fluid", "grains")}


def case_coupled_job(place):
    options = ("--set", "coupling.end_time=0.02", *DISC)
    reference, status = local_run(place, "grains/settling-disc", *options)
    with Slurm(place.folder / "slurm") as slurm:
        number = job(place, slurm, scene_of(place, slurm), *options)
        slurm.wait_for()
        said = (place.folder / f"job-{number}.txt").read_text()
        expect(slurm.exit_status(number) == f"{status}:0", f"{slurm.exit_status(number)}: {said}{slurm.logs()}")
        files = expect_same(place.folder / "out", reference, elsewhere=elsewhere(place))
    index = summary(place.folder / "out")["participants"]["grains"]
    expect(index["folder"] == f"{place.folder}/node/grains", str(index))
    expect("serves run" in (place.folder / "out/log/grains.log").read_text(), "no log came back")
    return f"{files} files of fields; {summary(reference)['wall_s']:.1f} s without, {summary(place.folder / 'out')['wall_s']:.1f} s"


def case_ranks_inside_a_job(place):
    """A fluid of two ranks: mpirun in the participant's one task."""
    if shutil.which("mpirun") is None:
        raise Failure("there is no mpirun")
    options = ("--set", "coupling.end_time=0.02", *DISC)
    reference, status = local_run(place, "grains/settling-disc", *options)
    with Slurm(place.folder / "slurm") as slurm:
        slurm.environment |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
        number = job(place, slurm, scene_of(place, slurm), *options, "--set", "fluid.ranks=2")
        wait_for_window(place, slurm, 20)
        ranks = subprocess.run(["pgrep", "-f", f"^[^ ]*fluid-lbm-mpi .*{place.folder}/node/fluid"], capture_output=True, text=True).stdout.split()
        expect(len(ranks) == 2, f"{len(ranks)} processes of fluid-lbm-mpi")
        slurm.wait_for()
        said = (place.folder / f"job-{number}.txt").read_text()
        expect(slurm.exit_status(number) == f"{status}:0", f"{slurm.exit_status(number)}: {said}{slurm.logs()}")
        files = expect_same(place.folder / "out", reference, elsewhere=elsewhere(place))
    return f"{files} files of fields; {summary(reference)['wall_s']:.1f} s without, {summary(place.folder / 'out')['wall_s']:.1f} s"


def case_killed_inside_a_job(place):
    options = ("--set", "coupling.end_time=0.02", *DISC)
    reference, _ = local_run(place, "grains/settling-disc", *options)
    with Slurm(place.folder / "slurm") as slurm:
        # One task with several processors: its steps have to share them.
        job(place, slurm, scene_of(place, slurm), *options, tasks=("--ntasks=1", "--cpus-per-task=3"))
        wait_for_window(place, slurm, 100)
        found = subprocess.run(["pgrep", "-f", f"^[^ ]*grains-dem .*{place.folder}/node/grains"], capture_output=True, text=True)
        os.kill(int(found.stdout.split()[0]), signal.SIGKILL)
        slurm.wait_for()
        expect_same(place.folder / "out", reference, elsewhere=elsewhere(place))
        recovery = summary(place.folder / "out")["recovery"]
        expect(recovery["relaunches"] == 1, str(recovery))
        return f"recovered in {recovery['recovery_s']:.1f} s"


def case_cancelled_and_submitted_again(place):
    """As at the end of a job's time: what is there is saved, the next job goes on."""
    options = ("--set", "coupling.end_time=0.1", *DISC)
    reference, status = local_run(place, "grains/settling-disc", *options)
    with Slurm(place.folder / "slurm") as slurm:
        scene = scene_of(place, slurm)
        number = job(place, slurm, scene, *options, "--resume")
        wait_for_window(place, slurm, 150)
        slurm.run("scancel", "--signal=TERM", "--batch", number)
        slurm.wait_for()
        said = (place.folder / f"job-{number}.txt").read_text()
        expect("which is saved" in said, said)
        expect_no_solvers(place.folder)
        number = job(place, slurm, scene, *options, "--resume")
        slurm.wait_for()
        said = (place.folder / f"job-{number}.txt").read_text()
        expect("goes on after window" in said and slurm.exit_status(number) == f"{status}:0", said)
        expect_same(place.folder / "out", reference, elsewhere=elsewhere(place))


def table(path):
    """A study's table without what was measured by the clock."""
    with open(path) as file:
        rows = list(csv.DictReader(file))
    return [{key: value for key, value in row.items()
             if not any(word in key for word in ("_s", "time", "seconds", "spread", "rss", "bytes", "load", "beside", "on_front"))} for row in rows]


def case_study_as_a_job_array(place):
    study = place.write("cook.toml", f'title = "Cook"\nscene = "{ROOT}/configs/solid/cook.toml"\nrepeats = 1\n[set]\nsolid.threads = 1\n'
                                     '[[vary]]\nsolid.spacing = [8.0, 4.0, 2.0]\n')
    words = [str(PROGRAMS / "coupler"), "study", str(study)]
    done = subprocess.run([*words, "--out", str(place.folder / "local")], capture_output=True, text=True, cwd=ROOT)
    expect(done.returncode == 0, done.stdout + done.stderr)
    with Slurm(place.folder / "slurm") as slurm:
        said = slurm.run(*words, "--out", str(place.folder / "array"), "--slurm", cwd=ROOT)
        expect("3 tasks" in said, said)
        slurm.wait_for()
        expect((place.folder / "array/study.csv").exists(), said + slurm.logs() + "\n".join(
            path.read_text() for path in (place.folder / "array").glob("slurm-*.log")))
        ours, theirs = (table(place.folder / name / "study.csv") for name in ("array", "local"))
        expect(ours == theirs, f"{ours}\n{theirs}")
        return f"{len(ours)} cells, {len(ours[0])} columns compared"
