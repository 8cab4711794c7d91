"""Operations that write, run in processes that die or race at a chosen moment.

Processes are forked from a server that has imported the library and run every operation once, so
that hundreds of deaths take seconds. Each counts its changes of files, as Python's audit events
tell: every file opened for writing, renamed or removed, every folder made or removed; and every
write to a table of a job.
"""

import multiprocessing
import os
import resource
import signal
import sys
import time
from dataclasses import dataclass

from cases import sphere_template, surfaces

from riemhuman.cli import main
from riemhuman.io import save_mesh
from riemhuman.io.job_folder import JobFolder

_CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate")
_PATIENCE = 120.0  # seconds; whatever takes longer will not come
_FOR_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


def cli(*arguments):
    return main([str(argument) for argument in arguments])


def resumable_matrix(inputs, outputs):
    """Fill the folder of a job, then write two files."""
    files = ("-o", outputs / "D.npz", "--csv", outputs / "D.csv", "--resume", outputs / "work")
    return cli("matrix", inputs, *files, "--force", "--pose", "-q", "--jobs", 1)


def align(inputs, outputs):
    """Write a folder of files."""
    return cli("align", inputs, "-o", outputs / "aligned", "--force", "-q")


def mean(inputs, outputs):
    """Write a mesh."""
    return cli("mean", inputs, "-o", outputs / "mean.ply", "--force", "-q", "--n-components", 4)


OPERATIONS = {function.__name__: function for function in (resumable_matrix, align, mean)}


def make_inputs(folder, seed):
    """Write meshes of three people in two poses, with their labels."""
    template = sphere_template()
    folder.mkdir(parents=True)
    rows = ["file,subject,pose"]
    for number, points in enumerate(surfaces(template, 6, rng=seed, size=0.1)):
        save_mesh(folder / f"body_{number}.ply", points, template.faces)
        rows.append(f"body_{number}.ply,person {number // 2},pose {number % 2}")
    (folder / "labels.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")


@dataclass(frozen=True)
class Faults:
    """What befalls a process.

    It is killed before the change of a file with the number `fatal_change`, and it cannot write a
    file of more than `largest_file` bytes.
    """

    fatal_change: int | None = None
    largest_file: int | None = None


class Changes:
    """Counts changes of files below a folder; before one of them, a signal ends the process."""

    def __init__(self, folder, faults, step):
        self.count = 0
        self._folder, self._faults, self._step = str(folder), faults, step

    def __call__(self, event, arguments):
        if event == "open":
            path, _, flags = arguments
            if not isinstance(flags, int) or not flags & _FOR_WRITING:
                return
        elif event in _CHANGES:
            path = arguments[0]
        else:
            return
        if not isinstance(path, int) and os.fsdecode(path).startswith(self._folder):
            self.add()

    def add(self):
        """Count a change that is about to be made."""
        self.count += 1
        if self.count == self._faults.fatal_change:
            os.kill(os.getpid(), signal.SIGKILL)
        self._step.wait(self.count)


class Lockstep:
    """Processes that change files in step: none makes a change that others will only come to."""

    def __init__(self, counts, number):
        self._counts, self._number = counts, number

    def wait(self, count):
        """Wait until every process has come to its change of this number, or has ended."""
        self._counts[self._number] = max(count, self._counts[self._number])
        give_up = time.monotonic() + _PATIENCE
        while min(self._counts) < count:
            if time.monotonic() > give_up:
                raise TimeoutError("another process makes no changes and does not end")
            time.sleep(0.001)

    def end(self):
        """Let the others go on without this process."""
        self._counts[self._number] = 2**31 - 1


def child(operation, inputs, outputs, faults, step, said, pipe):
    """Run an operation with its faults, and end the process with its code."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT), 2)
    if faults.largest_file is not None:
        # Beyond the limit, writing fails as on a full disk, and would end the process by a signal.
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (faults.largest_file,) * 2)
    changes = Changes(outputs, faults, step)
    sys.addaudithook(changes)
    write = JobFolder.write
    JobFolder.write = lambda *arguments: (changes.add(), write(*arguments))
    try:
        code = OPERATIONS[operation](inputs, outputs)
    finally:
        step.end()
    pipe.send(changes.count)
    sys.exit(code)


class Processes:
    """Starts operations on two folders of inputs, in forks of a server."""

    def __init__(self, folder):
        self.inputs, self.others = folder / "inputs", folder / "others"
        make_inputs(self.inputs, 0)
        make_inputs(self.others, 1)
        self._folder = folder
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(["pytest", "faults_server"])

    def run(self, operation, outputs, **options):
        """Run an operation, and return how its process ended, see `race`."""
        return self.race(operation, outputs, 1, **options)[0]

    def race(
        self,
        operation,
        outputs,
        n_processes,
        inputs=None,
        kill_at=None,
        largest_file=None,
    ):
        """Run an operation in some processes at once, and return how they ended.

        They make their changes of files in step. `kill_at` is the change of a file before which a
        process dies, and none can write a file of more than `largest_file` bytes. The answers are
        the exit code or minus the signal, what was written to standard error, and the number of
        changes.
        """
        outputs.mkdir(parents=True, exist_ok=True)
        started, counts = [], self._context.Array("i", n_processes, lock=False)
        faults = Faults(kill_at, largest_file=largest_file)
        for number in range(n_processes):
            said = self._folder / f"said_{number}"
            said.write_text("")
            ours, theirs = self._context.Pipe(duplex=False)
            step = Lockstep(counts, number)
            task = operation, inputs or self.inputs, outputs, faults, step, said, theirs
            process = self._context.Process(target=child, args=task)
            process.start()
            theirs.close()
            started.append((process, said, ours))
        answers = []
        for process, said, ours in started:
            process.join()
            changes = 0 if process.exitcode < 0 else ours.recv()
            answers.append((process.exitcode, said.read_text(), changes))
        return answers
