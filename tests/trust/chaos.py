"""Jobs in a hostile world: killed, without room, with links in the way, two at once, a mad clock.

``PYTHONPATH=tests:. python tests/trust/chaos.py --rounds 500 --seed 1`` disturbs one job after the
other, each in one to three ways at once, then runs it undisturbed. A job may end with the right
distances, with one typed error, or killed; nothing of others may change on the way, and in the end
the distances must be right.
"""

import argparse
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
from cases import sphere_template, surfaces
from trust.faults import Changes, turn_back_the_clock

from riemhuman.errors import RiemhumanError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.retrieval import pairwise_job

MEMORY = 60_000
FILES = ("job.lock", "manifest.json", "manifest.json.part", "digests.npy", "features_0.npy") + (
    *("features_1.npy", "points.npy", "checksums.npy", "done.npy", "D.unfinished.npy", "D.npy"),
    *("D.unfinished.npy.part", "done.npy.part", "points.npy.part"),
)
LEFT = {"job.lock", "manifest.json", "digests.npy", "D.npy", "notes.txt"}
WAYS = ("kill", "full disk", "link", "two writers", "clock")
FINISHED, REFUSED, CRASHED, WRONG = 0, 2, 3, 4
_SECONDS = 60


class Planter(Changes):
    """Puts a link in the way at the moment of a change of a file, besides what `Changes` does.

    Parameters
    ----------
    folder : Path
        Folder of the job.
    fatal : int or None
        Before which change to die.
    plant : callable or None
        Puts the link there.
    moment : int
        Before which change.
    """

    def __init__(self, folder, fatal, plant, moment):
        super().__init__(folder, fatal, 0)
        self._plant, self._moment = plant, moment

    def __call__(self, event, arguments):
        super().__call__(event, arguments)
        if self._plant is not None and self.count >= self._moment:
            plant, self._plant = self._plant, None
            plant()


class Chaos:
    """Disturbs jobs.

    Parameters
    ----------
    scratch : Path
        Folder to work in.
    seed : int
        Decides what happens.
    """

    def __init__(self, scratch, seed):
        template = sphere_template()
        self.points = surfaces(template, 23, rng=1)
        self.points[5] = self.points[2] * (1 + 1e-9)
        self.metric = ElasticMetric(AlignedSurfaces(template, equip=False), 1.0, 0.1, 0.1)
        # Children inherit what is compiled here.
        self.expected = self.metric.dist_pairwise(self.points)
        self.random = random.Random(seed)
        self.folder = scratch / "job"
        self.others = scratch / "others"
        self.others.mkdir()
        self.ends, self.faults = Counter(), []
        self.n_changes = 220
        self._run(())

    def round(self, number):
        """Disturb a job, then let it come to its end."""
        ways = self.random.sample(WAYS, self.random.choice((1, 1, 2, 3)))
        if (self.folder / "manifest.json").exists():
            (self.folder / "notes.txt").write_text("years of work", encoding="utf-8")
        self.in_the_way = self.folder / self.random.choice(FILES)
        self._put_something_precious(number)
        kept = self._of_others()
        for code in self._run(ways):
            self.ends[code] += 1
            if code in (CRASHED, WRONG) or (code < 0 and code not in _KILLS):
                self.faults.append(f"round {number}, {' and '.join(ways)}: a job ended with {code}")
        if self._of_others() != kept:
            self.faults.append(
                f"round {number}, {' and '.join(ways)}: a file of others has changed"
            )
        self._clear_away_links()
        # What the job is, somebody has taken away: nobody can go on with it.
        names = ("manifest.json", "digests.npy")
        if not all((self.folder / name).exists() for name in names):
            shutil.rmtree(self.folder, ignore_errors=True)
        if self.random.random() < 0.4:
            self._finish(number)

    def _finish(self, number):
        (code,) = self._run(())
        left = {entry.name for entry in self.folder.iterdir()}
        if code != FINISHED or not left <= LEFT:
            self.faults.append(f"round {number}: a job left alone ended with {code}, {left}")
        shutil.rmtree(self.folder)

    def _run(self, ways):
        n_processes = 2 if "two writers" in ways else 1
        plant = self._link() if "link" in ways else None
        children = []
        for _ in range(n_processes):
            fatal = self.random.randrange(1, self.n_changes) if "kill" in ways else None
            moment = self.random.choice((1, self.random.randrange(1, self.n_changes)))
            room = self.random.choice((1, 300, 2000, 5000)) if "full disk" in ways else None
            dies = self.random.random() < 0.5
            clock = 3600.0 if "clock" in ways else None
            child = os.fork()
            if child == 0:
                watch = Planter(str(self.folder), fatal, plant, moment)
                self._child(watch, room, dies, clock)
            children.append(child)
        return [_exit_code(child) for child in children]

    def _child(self, watch, room, dies, clock):
        code = CRASHED
        try:
            warnings.simplefilter("ignore")
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            if clock is not None:
                turn_back_the_clock(clock)
            if room is not None:
                signal.signal(signal.SIGXFSZ, signal.SIG_DFL if dies else signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))
            sys.addaudithook(watch)
            found = pairwise_job(self.metric, self.points, self.folder, memory=MEMORY)
            code = FINISHED if np.array_equal(found, self.expected) else WRONG
        except RiemhumanError as error:
            code = REFUSED if str(self.folder) in str(error) else CRASHED
        finally:
            if code == CRASHED:
                traceback.print_exc()
            os._exit(code)

    def _link(self):
        """Return a function that puts a link to something precious in the place of a file."""
        path, target = self.in_the_way, self.others / "precious"
        make = self.random.choice((os.symlink, os.link))

        def plant():
            if path.parent.exists():
                path.unlink(missing_ok=True)
                make(target, path)

        return plant

    def _put_something_precious(self, number):
        """Write what links lead to: sometimes something that could pass for a file of the job."""
        target = self.others / "precious"
        target.unlink(missing_ok=True)
        if self.in_the_way.is_file() and self.random.random() < 0.7:
            target.write_bytes(self.in_the_way.read_bytes())
        else:
            target.write_text(f"years of work, {number}", encoding="utf-8")

    def _of_others(self):
        notes = self.folder / "notes.txt"
        files = [self.others / "precious", *([notes] if notes.exists() else [])]
        return {file: (file.read_bytes(), file.stat().st_mtime_ns) for file in files}

    def _clear_away_links(self):
        for file in self.folder.glob("*") if self.folder.exists() else ():
            if file.is_symlink() or file.stat().st_nlink > 1:
                file.unlink()


_KILLS = (-signal.SIGKILL, -signal.SIGXFSZ)


def _exit_code(child):
    deadline = time.monotonic() + _SECONDS
    while time.monotonic() < deadline:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.002)
    os.kill(child, signal.SIGABRT)
    os.waitpid(child, 0)
    return -signal.SIGABRT


def disturb(scratch, n_rounds, seed):
    """Run rounds; return how jobs ended, and what went wrong."""
    chaos = Chaos(Path(scratch), seed)
    for number in range(n_rounds):
        chaos.round(number)
    return chaos.ends, chaos.faults


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        ends, faults = disturb(scratch, options.rounds, options.seed)
    for fault in faults:
        sys.stdout.write(f"{fault}\n")
    n_killed = sum(count for code, count in ends.items() if code < 0)
    sys.stdout.write(
        f"{options.rounds} rounds, seed {options.seed}: {ends.total()} jobs disturbed, of which "
        f"{ends[FINISHED]} finished, {ends[REFUSED]} refused and {n_killed} were killed; "
        f"{len(faults)} crashes, wrong numbers or files of others touched\n"
    )
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
