"""Operations that write, run in processes that die, lack room or race at a chosen moment.

A server imports the library once and runs every operation in a child of its own, so that hundreds
of deaths take seconds. A child counts what it asks of the file system, as Python's audit events
tell: every file opened for writing, renamed or removed, every folder made or removed.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import pickle
import resource
import signal
import subprocess
import sys
import time
import traceback
from collections import Counter
from pathlib import Path
from unittest import mock

ROOT = Path(__file__).parents[2]
_CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.truncate")
_FOR_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


def cli(*arguments):
    from riemhuman.cli import main

    return main([str(argument) for argument in arguments])


def matrix(inputs, outputs):
    files = ("-o", outputs / "D.npz", "--csv", outputs / "D.csv", "--force", "--pose")
    return cli("matrix", inputs / "scans", *files, "-q", "--jobs", 1)


def resumable_matrix(inputs, outputs):
    files = ("-o", outputs / "D.npz", "--resume", outputs / "work", "--force", "--pose")
    return cli("matrix", inputs / "scans", *files, "-q", "--jobs", 1)


def basis(inputs, outputs):
    options = ("-n", 2, "--step", 1, "-o", outputs / "basis.npz", "--force", "-q")
    return cli("basis", inputs / "scans", *options)


def geodesic(inputs, outputs):
    from riemhuman.cli import _paths

    ends = (inputs / "scans" / "body_0.ply", inputs / "scans" / "body_1.ply")
    options = ("--n-nodes", 3, "--n-components", 4, "--force", "-q")
    # Drawing takes most of the time, and is part of `picture`.
    with mock.patch.dict(_paths._WRITERS, {".png": _paths._write_npz}):
        return cli("geodesic", *ends, "-o", f"{outputs / 'path'}/", *options)


def picture(inputs, outputs):
    ends = (inputs / "scans" / "body_0.ply", inputs / "scans" / "body_1.ply")
    options = ("--n-nodes", 3, "--n-components", 4, "--force", "-q")
    return cli("geodesic", *ends, "-o", outputs / "path.png", *options)


def components(inputs, outputs):
    meshes = [inputs / "scans" / f"body_{number}.ply" for number in range(2)]
    options = ("-n", 1, "-o", outputs / "components", "--force", "-q")
    return cli("components", *meshes, *options)


def mean(inputs, outputs):
    options = ("--n-components", 4, "-o", outputs / "mean.ply", "--force", "-q")
    return cli("mean", inputs / "scans", *options)


def transfer(inputs, outputs):
    onto = ("--onto", inputs / "scans" / "body_1.ply")
    return cli("transfer", inputs / "scans", *onto, "-o", outputs / "moved.glb", "--force", "-q")


def transfer_folder(inputs, outputs):
    onto = ("--onto", inputs / "scans" / "body_1.ply")
    return cli("transfer", inputs / "scans", *onto, "-o", outputs / "moved", "--force", "-q")


def convert_model(inputs, outputs):
    options = ("-o", outputs / "model.npz", "--n-betas", 2, "--force", "-q")
    return cli("convert-model", inputs / "model.pkl", *options)


def neighbors(inputs, outputs):
    from riemhuman.datasets import RegisteredMeshes, find_meshes
    from riemhuman.errors import RiemhumanError
    from riemhuman.geometry import AlignedSurfaces, ElasticMetric
    from riemhuman.retrieval import NearestNeighbors
    from riemhuman.surfaces import Template

    files = find_meshes(inputs / "scans")
    metric = ElasticMetric(AlignedSurfaces(Template.from_file(files[0])), a=0.0, lam=0.0, c=1.0)
    neighbors = NearestNeighbors(metric, 2, n_pivots=2).fit(RegisteredMeshes(files))
    try:
        neighbors.save(outputs / "index.npz")
    except RiemhumanError as error:
        sys.stderr.write(f"riemhuman: {error}\n")
        return 2
    return 0


def report(inputs, outputs):
    from riemhuman.report import _page

    figure = _page.Output.figure

    def undrawn(self, name, alt, caption, draw, *arguments, wide=False):
        def draw_nothing(*arguments):
            return draw.__name__

        draw_nothing.__name__ = draw.__name__
        return figure(self, name, alt, caption, draw_nothing, *arguments, wide=wide)

    def undrawn_picture(name):
        return f'<svg viewBox="0 0 4 3">{name}</svg>', name.encode()

    # Drawing takes nearly all of the time, and is part of `picture`.
    with (
        mock.patch.object(_page.Output, "figure", undrawn),
        mock.patch.object(_page, "figure_files", undrawn_picture),
    ):
        return cli(
            "report", "--quick", "--bodies", inputs / "scans", "-o", outputs / "report", "-q"
        )


OPERATIONS = {
    function.__name__: function
    for function in (
        *(matrix, resumable_matrix, basis, geodesic, picture, components, mean, transfer),
        *(transfer_folder, convert_model, neighbors, report),
    )
}


def make_inputs(folder, seed):
    """Write what the operations read: meshes of three people in two poses, and a body model."""
    import numpy as np
    from cases import sphere_template, surfaces

    from riemhuman.io import save_mesh

    template = sphere_template()
    (folder / "scans").mkdir(parents=True)
    rows = ["file,subject,pose"]
    for number, points in enumerate(surfaces(template, 6, rng=seed, size=0.1)):
        save_mesh(folder / "scans" / f"body_{number}.ply", points, template.faces)
        rows.append(f"body_{number}.ply,person {number // 2},pose {number % 2}")
    (folder / "scans" / "labels.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")

    rng = np.random.default_rng(seed)
    n_vertices, n_joints = template.n_vertices, 3
    weights = rng.random((n_vertices, n_joints))
    model = {
        "v_template": template.vertices,
        "f": template.faces,
        "shapedirs": rng.normal(size=(n_vertices, 3, 4)),
        "J_regressor": np.full((n_joints, n_vertices), 1 / n_vertices),
        "weights": weights / weights.sum(axis=1, keepdims=True),
        "kintree_table": np.array([[-1, 0, 1], [0, 1, 2]]),
    }
    (folder / "model.pkl").write_bytes(pickle.dumps(model, protocol=2))


class Changes:
    """Counts changes of files below a folder, and ends the process at one of them.

    Parameters
    ----------
    folder : Path
        The folder.
    fatal : int or None
        Before which change to die.
    pause : float
        Seconds to wait before every change, for other processes.
    """

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
        if isinstance(path, int) or not os.fsdecode(path).startswith(self._folder):
            return
        self.count += 1
        if self.count == self._fatal:
            os.kill(os.getpid(), signal.SIGKILL)
        if self._pause:
            time.sleep(self._pause)


def _child(task, said, complained, changed):
    """Run an operation as asked for, and end the process."""
    os.dup2(said, 1)
    os.dup2(complained, 2)
    changes = Changes(task["outputs"], task["kill_at"], task["pause"])
    sys.addaudithook(changes)
    if task["room"] is not None:
        fate = signal.SIG_DFL if task["fatal_room"] else signal.SIG_IGN
        signal.signal(signal.SIGXFSZ, fate)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (task["room"], task["room"]))
    if task["alarm"] is not None:
        signal.setitimer(signal.ITIMER_REAL, task["alarm"])
    if task["clock"] is not None:
        turn_back_the_clock(task["clock"])
    code = 99
    try:
        code = OPERATIONS[task["operation"]](Path(task["inputs"]), Path(task["outputs"]))
    finally:
        if sys.exception() is not None:
            traceback.print_exc()
        sys.stdout.flush()
        sys.stderr.flush()
        os.write(changed, str(changes.count).encode())
        os._exit(code)


def turn_back_the_clock(seconds):
    """Make every look at the time of day show an earlier one than the last."""
    now = [time.time() + 1e6]

    def earlier():
        now[0] -= seconds
        return now[0]

    time.time = earlier
    time.time_ns = lambda: int(earlier() * 1e9)


def _answer(value):
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def _read(descriptor):
    with open(descriptor, encoding="utf-8") as stream:
        return stream.read()


def serve():
    """Run the tasks that are read from standard input, one a line, until there are no more."""
    import matplotlib as mpl

    mpl.use("agg")
    scratch = Path(sys.argv[1])
    for seed, name in enumerate(("inputs", "others")):
        make_inputs(scratch / name, seed)
    # What children inherit they need not import or compile.
    with contextlib.redirect_stdout(io.StringIO()):
        for name, operation in OPERATIONS.items():
            (scratch / name).mkdir()
            operation(scratch / "inputs", scratch / name)
    _answer(str(scratch / "inputs"))
    for line in sys.stdin:
        children = []
        for task in json.loads(line):
            # What is said here fits into a pipe.
            pipes = [os.pipe() for _ in range(3)]
            child = os.fork()
            if child == 0:
                _child(task, *(end for _, end in pipes))
            for _, end in pipes:
                os.close(end)
            children.append((child, [end for end, _ in pipes]))
        answers = []
        for child, ends in children:
            _, status = os.waitpid(child, 0)
            out, err, changes = map(_read, ends)
            code = os.waitstatus_to_exitcode(status)
            answers.append({"code": code, "out": out, "err": err, "changes": int(changes or 0)})
        _answer(answers)


class Server:
    """The other end of `serve`.

    Parameters
    ----------
    scratch : Path
        Folder for its files.

    Attributes
    ----------
    ends : Counter
        How often processes ended with each exit code, or minus the signal.
    """

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
        self.inputs = Path(json.loads(self._process.stdout.readline()))
        self.others = self.inputs.with_name("others")
        self.ends = Counter()

    def run(self, operation, outputs, **options):
        """Run an operation, and return what became of its process, see `race`."""
        return self.race(operation, outputs, 1, **options)[0]

    def race(self, operation, outputs, n_processes, **options):
        """Run an operation in processes of its own, and return what became of them.

        Parameters
        ----------
        operation : str
            Name of the operation.
        outputs : Path
            Folder it writes into.
        n_processes : int
            How many run at once.
        **options : object
            `inputs`: folder it reads from. `kill_at`: before which change of a file the process
            kills itself. `room`: bytes that a file may have at most; `fatal_room`: whether the
            process dies, in the middle of a write, where a file gets larger. `pause`: seconds
            before each change of a file. `clock`: seconds the clock goes back at every look.
            `alarm`: seconds after which the system ends the process, whatever it is doing.

        Returns
        -------
        list of dict
            The exit `code` or minus the signal, `out`, `err`, and the number of `changes`.
        """
        task = dict.fromkeys(("kill_at", "room", "clock", "alarm")) | {
            "pause": 0,
            "fatal_room": False,
        }
        task |= {"operation": operation, "inputs": self.inputs, "outputs": outputs} | options
        outputs.mkdir(parents=True, exist_ok=True)
        self._process.stdin.write(json.dumps([task] * n_processes, default=str) + "\n")
        self._process.stdin.flush()
        answers = json.loads(self._process.stdout.readline())
        self.ends.update(answer["code"] for answer in answers)
        return answers

    def close(self):
        """End the server."""
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()


if __name__ == "__main__":
    serve()
