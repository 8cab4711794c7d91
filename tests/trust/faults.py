"""Operations that write, run in processes that die or race at a chosen moment.

A server imports the library once and runs every operation in a child of its own, so that hundreds
of deaths take seconds. A child counts its changes of files, as Python's audit events tell: every
file opened for writing, renamed or removed, every folder made or removed; and every write to a
table of a job.
"""

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from riemhuman.io.job_folder import JobFolder

ROOT = Path(__file__).parents[2]
_CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate")
_FOR_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


def cli(*arguments):
    from riemhuman.cli import main

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
    from cases import sphere_template, surfaces

    from riemhuman.io import save_mesh

    template = sphere_template()
    folder.mkdir(parents=True)
    rows = ["file,subject,pose"]
    for number, points in enumerate(surfaces(template, 6, rng=seed, size=0.1)):
        save_mesh(folder / f"body_{number}.ply", points, template.faces)
        rows.append(f"body_{number}.ply,person {number // 2},pose {number % 2}")
    (folder / "labels.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")


class Changes:
    """Counts changes of files below a folder, and kills the process before one of them."""

    def __init__(self, folder, fatal, pause):
        self.count = 0
        self._folder, self._fatal, self._pause = str(folder), fatal, pause

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
        time.sleep(self._pause)


def _child(task, err, changed):
    """Run an operation with its faults, and end the process."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(err, 2)
    changes = Changes(task["outputs"], task["kill_at"], task["pause"])
    sys.addaudithook(changes)
    write = JobFolder.write
    JobFolder.write = lambda *arguments: (changes.add(), write(*arguments))
    code = 99
    try:
        code = OPERATIONS[task["operation"]](Path(task["inputs"]), Path(task["outputs"]))
    finally:
        sys.stderr.flush()
        os.write(changed, str(changes.count).encode())
        os._exit(code)


def _answer(value):
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def _read(descriptor):
    with open(descriptor, encoding="utf-8") as stream:
        return stream.read()


def serve():
    """Run the tasks that are read from standard input, a list of those at once in each line."""
    scratch = Path(sys.argv[1])
    for seed, name in enumerate(("inputs", "others")):
        make_inputs(scratch / name, seed)
    # Children inherit imports and compiled functions.
    with contextlib.redirect_stdout(io.StringIO()):
        for name, operation in OPERATIONS.items():
            (scratch / name).mkdir()
            operation(scratch / "inputs", scratch / name)
    _answer(str(scratch))
    for line in sys.stdin:
        children = []
        for task in json.loads(line):
            pipes = [os.pipe() for _ in range(2)]
            child = os.fork()
            if child == 0:
                _child(task, *(end for _, end in pipes))
            for _, end in pipes:
                os.close(end)
            children.append((child, [end for end, _ in pipes]))
        answers = []
        for child, ends in children:
            _, status = os.waitpid(child, 0)
            err, changes = map(_read, ends)
            code = os.waitstatus_to_exitcode(status)
            answers.append({"code": code, "err": err, "changes": int(changes or 0)})
        _answer(answers)


class Server:
    """The other end of `serve`, with two folders of inputs."""

    def __init__(self, scratch):
        environment = os.environ | {
            "PYTHONPATH": os.pathsep.join([str(ROOT / "tests"), str(ROOT)]),
            "OPENBLAS_NUM_THREADS": "1",
            "OMP_NUM_THREADS": "1",
            "MPLBACKEND": "agg",
        }
        self._process = subprocess.Popen(
            [sys.executable, __file__, str(scratch)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            text=True,
        )
        folder = Path(json.loads(self._process.stdout.readline()))
        self.inputs, self.others = folder / "inputs", folder / "others"

    def run(self, operation, outputs, **options):
        """Run an operation, and return how its process ended, see `race`."""
        return self.race(operation, outputs, 1, **options)[0]

    def race(self, operation, outputs, n_processes, **options):
        """Run an operation in some processes at once, and return how they ended.

        Options: `inputs`, folder to read; `kill_at`, change of a file before which the process
        dies; `pause`, seconds before each change of a file. The answers are the exit `code` or
        minus the signal, `err`, and the number of `changes`.
        """
        task = {"kill_at": None, "pause": 0}
        task |= {"operation": operation, "inputs": self.inputs, "outputs": outputs} | options
        outputs.mkdir(parents=True, exist_ok=True)
        self._process.stdin.write(json.dumps([task] * n_processes, default=str) + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())

    def close(self):
        """End the server."""
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()


if __name__ == "__main__":
    serve()
