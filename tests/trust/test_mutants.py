"""The table of mistakes follows the code; the long job makes the mistakes, see `mutants.py`."""

import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from lengths import FULL
from trust.mutants import MUTANTS, lost

ROOT = Path(__file__).parents[2]


def test_every_mistake_can_be_made():
    assert [f"{mutant.file}: {mutant.old}" for mutant in lost()] == []
    assert len(MUTANTS) >= 40
    assert len({(mutant.file, mutant.old, mutant.new) for mutant in MUTANTS}) == len(MUTANTS)
    for mutant in MUTANTS:
        assert (ROOT / "tests" / shlex.split(mutant.tests)[0]).exists(), mutant.tests


@pytest.mark.skipif(not FULL, reason="takes minutes: part of .ci/nightly")
def test_mistakes_are_noticed():
    done = subprocess.run(
        [sys.executable, "tests/trust/mutants.py"], cwd=ROOT, capture_output=True, text=True
    )
    sys.stdout.write(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr
