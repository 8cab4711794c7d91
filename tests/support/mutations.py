"""Mutation testing by cosmic-ray: python tests/support/mutations.py SUBPACKAGE [NUMBER] [SEED].

So many random changes of one operator or constant of a subpackage, each tested by the tests of that
subpackage. Prints the changes that no test noticed, and their share. Install '.[test]' and
'cosmic-ray>=8.4' first. Files are changed where they are, and restored.
"""

import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from cosmic_ray.work_db import use_db
from cosmic_ray.work_item import TestOutcome, WorkerOutcome, WorkResult

# "a | b" is a type most of the time, and decorators tell numba how to compile.
SETTINGS = """
[cosmic-ray]
module-path = "riemhuman/{subpackage}"
timeout = {timeout}
excluded-modules = []
test-command = "{tests}"
[cosmic-ray.distributor]
name = "local"
[cosmic-ray.filters.operators-filter]
exclude-operators = ["core/ReplaceBinaryOperator_BitOr_.*", "core/RemoveDecorator"]
"""

subpackage, number, seed = (*sys.argv[1:], *("12", "0")[len(sys.argv) - 2 :])
tests = [sys.executable, *f"-m pytest -x -q -p no:cacheprovider tests/{subpackage}".split()]
begin = time.monotonic()
subprocess.run(tests, check=True)
# A change may make tests endless, and others may use the machine meanwhile.
timeout = 60.0 + 4.0 * (time.monotonic() - begin)
with tempfile.TemporaryDirectory() as folder:
    settings, session = Path(folder, "mutations.toml"), Path(folder, "session.sqlite")
    chosen_settings = {"subpackage": subpackage, "timeout": timeout, "tests": " ".join(tests)}
    settings.write_text(SETTINGS.format(**chosen_settings))
    subprocess.run(["cosmic-ray", "init", settings, session], check=True)
    subprocess.run(["cr-filter-operators", session, settings], check=True)
    with use_db(str(session)) as database:
        waiting = sorted(item.job_id for item in database.pending_work_items)
        chosen = set(random.Random(int(seed)).sample(waiting, min(int(number), len(waiting))))
        skipped = WorkResult(worker_outcome=WorkerOutcome.SKIPPED)
        database.set_multiple_results([job for job in waiting if job not in chosen], skipped)
    subprocess.run(["cosmic-ray", "exec", settings, session], check=True)
    subprocess.run(["cr-report", "--surviving-only", "--show-diff", session], check=True)
    with use_db(str(session)) as database:
        results = [result for _, result in database.completed_work_items]
tried = [result for result in results if result.worker_outcome != WorkerOutcome.SKIPPED]
missed = sum(result.test_outcome == TestOutcome.SURVIVED for result in tried)
print(f"{missed} of {len(tried)} changes were noticed by no test")
