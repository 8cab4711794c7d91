"""Operations that write, run in processes that are killed at a chosen moment.

Processes are forked from a server that has imported the library and run every operation once, so
that hundreds of deaths take seconds. Each counts its changes of files, as Python's audit events
tell: every file opened for writing, renamed or removed, every folder made or removed; and every
write to a table of a job.
"""

import multiprocessing
import os
import signal
import sys

from cases import sphere_template, surfaces

from riemhuman.cli import main
from riemhuman.io import save_mesh
from riemhuman.io.job_folder import JobFolder

_CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate")
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


OPERATIONS = {function.__name__: function for function in (resumable_matrix, align)}


def make_inputs(folder, seed):
    """Write meshes of three people in two poses, with their labels."""
    template = sphere_template()
    folder.mkdir(parents=True)
    rows = ["file,subject,pose"]
    for number, points in enumerate(surfaces(template, 6, rng=seed, size=0.1)):
        save_mesh(folder / f"body_{number}.ply", points, template.faces)
        rows.append(f"body_{number}.ply,person {number // 2},pose {number % 2}")
    (folder / "labels.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")


class Changes:
    """Counts changes of files below a folder; before one of them, a signal ends the process."""

    def __init__(self, folder, fatal):
        self.count, self._folder, self._fatal = 0, str(folder), fatal

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
        if self.count == self._fatal:
            os.kill(os.getpid(), signal.SIGKILL)


def child(operation, inputs, outputs, kill_at, said, pipe):
    """Run an operation, and end the process with its code, or before a change of a file."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT), 2)
    changes = Changes(outputs, kill_at)
    sys.addaudithook(changes)
    write = JobFolder.write
    JobFolder.write = lambda *arguments: (changes.add(), write(*arguments))
    code = OPERATIONS[operation](inputs, outputs)
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

    def run(self, operation, outputs, inputs=None, kill_at=None):
        """Run an operation, which dies before the change of a file with the number `kill_at`.

        Returns the exit code or minus the signal, what was written to standard error, and the
        number of changes.
        """
        outputs.mkdir(parents=True, exist_ok=True)
        said = self._folder / "said"
        said.write_text("")
        ours, theirs = self._context.Pipe(duplex=False)
        task = operation, inputs or self.inputs, outputs, kill_at, said, theirs
        process = self._context.Process(target=child, args=task)
        process.start()
        theirs.close()
        process.join()
        changes = 0 if process.exitcode < 0 else ours.recv()
        return process.exitcode, said.read_text(), changes
