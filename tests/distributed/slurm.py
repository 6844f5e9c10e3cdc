"""A Slurm of one node in a scratch folder: munged, slurmctld and slurmd on ports and with a key of their own."""
import os
import pathlib
import shutil
import socket
import subprocess
import time

from driver import Failure, expect

CONFIGURATION = """ClusterName=estuary
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller}
SlurmdPort={daemon}
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SchedulerType=sched/builtin
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
ReturnToService=2
KillWait=5
NodeName={host} NodeAddr=127.0.0.1 CPUs=4 RealMemory=1000 State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def why_not():
    for program in ("munged", "mungekey", "slurmctld", "slurmd", "sbatch", "srun"):
        if shutil.which(program, path=os.environ["PATH"] + ":/usr/sbin") is None:
            return f"there is no {program} (packages of packages-distributed.txt)"
    return "only root may start slurmd" if os.geteuid() else None


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Slurm:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        for name in ("state", "spool"):
            (self.folder / name).mkdir(parents=True)
        self.folder.chmod(0o755)
        self.host = socket.gethostname().split(".")[0]
        self.file = self.folder / "slurm.conf"
        self.file.write_text(CONFIGURATION.format(host=self.host, folder=self.folder, controller=free_port(), daemon=free_port()))
        self.environment = {**os.environ, "SLURM_CONF": str(self.file), "PATH": os.environ["PATH"] + ":/usr/sbin"}
        self.daemons = []

    def begin(self, *words):
        log = open(self.folder / f"{words[0]}.txt", "w")
        self.daemons.append(subprocess.Popen(words, env=self.environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log))

    def __enter__(self):
        self.run("mungekey", "--create", "--keyfile", str(self.folder / "munge.key"))
        try:
            self.begin("munged", "--foreground", "--force", "--key-file", str(self.folder / "munge.key"), "--socket",
                       str(self.folder / "munge.socket"), "--pid-file", str(self.folder / "munged.pid"), "--log-file",
                       str(self.folder / "munged.log"), "--seed-file", str(self.folder / "munge.seed"))
            self.wait_until(lambda: (self.folder / "munge.socket").exists(), "munged")
            self.begin("slurmctld", "-D")
            self.begin("slurmd", "-D", "-N", self.host)
            self.wait_until(lambda: "idle" in self.ask("sinfo", "--noheader", "--format=%t"), "the node")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        self.ask("scancel", "--user=root")
        for daemon in reversed(self.daemons):
            daemon.terminate()
            try:
                daemon.wait(10)
            except subprocess.TimeoutExpired:
                daemon.kill()

    def wait_until(self, there, what, limit=30):
        deadline = time.monotonic() + limit
        while not there():
            for daemon in self.daemons:
                expect(daemon.poll() is None, f"{daemon.args[0]} has ended: {self.logs()}")
            expect(time.monotonic() < deadline, f"{what} did not come up within {limit} s: {self.logs()}")
            time.sleep(0.1)

    def logs(self):
        return "\n".join(f"{path.name}: {path.read_text(errors='replace')[-1500:]}" for path in sorted(self.folder.glob("*.log"))
                         + sorted(self.folder.glob("*.txt")))

    def ask(self, *words):
        return subprocess.run(words, env=self.environment, capture_output=True, text=True).stdout

    def run(self, *words, cwd=None):
        done = subprocess.run(words, env=self.environment, capture_output=True, text=True, cwd=cwd)
        if done.returncode:
            raise Failure(f"{' '.join(words)} ended with status {done.returncode}: {done.stdout}{done.stderr}")
        return done.stdout

    def submit(self, script, *options):
        """Number of the job."""
        return self.run("sbatch", "--parsable", *options, f"--wrap={script}").strip().split(";")[0]

    def wait_for(self, limit=240):
        """Until no job is left."""
        deadline = time.monotonic() + limit
        while queue := self.ask("squeue", "--noheader"):
            expect(time.monotonic() < deadline, f"jobs do not end: {queue}")
            time.sleep(0.2)

    def exit_status(self, job):
        text = self.run("scontrol", "show", "job", job)
        return next(word for word in text.split() if word.startswith("ExitCode=")).split("=")[1]
