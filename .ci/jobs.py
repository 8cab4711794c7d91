"""Jobs of continuous integration beside README's test command: python .ci/jobs.py JOB [ARGUMENTS].

Each works in a copy of the tracked files, in a virtual environment of its own, or in the one that
--environment names; further arguments go to pytest, or to the part of `nightly`.

command      print the test command of README.md
pages        the Python of pages, tutorials and examples
site         the documentation site, its links and widths
kernels      the most iterative tests with other kernels of OpenBLAS and NumPy's plainest loops
oracles      agreement with geomstats, trec_eval, PyVista, meshio and ezc3d; training with PyTorch
oldest       the tests on the oldest releases that setup.cfg allows, with Python 3.11
nightly      one of these at full length: fuzz [READERS], tests [PATHS], benchmarks [PATHS],
             mutations [SUBPACKAGES], bounds [PATHS], where compiled loops check every index; what
             is random is so in other ways on another day
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from configparser import ConfigParser
from datetime import date
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NEWEST = {"PIP_CONSTRAINT": str(ROOT / ".ci" / "constraints.txt")}
ORACLES = [".[learned,meshes,statistics]", "ezc3d>=1.6", "mpmath", "pytest", "pytest-benchmark"]
ORACLES += ["geomstats==2.8.0", "numpy<2.4", "scikit-learn<1.10", "pytrec-eval-terrier==0.5.11"]
ORACLE_TESTS = ["tests/trust/against_geomstats.py", "tests/trust/against_trec_eval.py"]
ORACLE_TESTS += ["tests/trust/geomstats_signatures.py", "tests/io/test_meshes.py"]
ORACLE_TESTS += ["tests/mocap/test_c3d_files.py", "tests/learned/training.py"]
# Packages that tests skip without: those of no everyday extra, too.
NIGHTLY = ["riemhuman[anny,learned,meshes]", "ezc3d>=1.6", "smplcodec", "cosmic-ray>=8.4"]
COMPILED = [f"tests/{name}" for name in ("kernels", "terms", "geometry", "measurements")]
ITERATIVE = ("transfer", "path_search", "means", "lbfgs", "rounding")
EXTENSIONS = """import numpy
print(*numpy.show_config(mode="dicts")["SIMD Extensions"].get("found", []))"""


def call(*command: str | Path, **variables: str) -> None:
    """Run a command, with further variables; its failure ends the job."""
    subprocess.run(command, check=True, env=os.environ | variables)


def made(folder: Path, *requirements: str, python: str = sys.executable, **variables: str) -> str:
    """Return the Python of a virtual environment, made unless it is there."""
    interpreter = folder / "bin" / "python"
    if not interpreter.exists():
        call(python, "-m", "venv", folder)
        call(interpreter, "-m", "pip", "install", "-q", *requirements, **variables)
    return str(interpreter)


def test(python: str, *arguments: str, **variables: str) -> None:
    """Run pytest on the installed library."""
    call(Path(python).with_name("pytest"), "-q", "-p", "no:cacheprovider", *arguments, **variables)


def command() -> str:
    """Return the test command of README.md."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.search(r"<!-- test-command -->\n+```bash\n(.*?)\n```", text, re.DOTALL)[1]


def lower_bounds() -> list[str]:
    """Return the oldest release of every dependency that setup.cfg allows."""
    config = ConfigParser(interpolation=None)
    config.read("setup.cfg")
    extras = config["options.extras_require"]
    in_test = re.search(r"\[(.*)\]", extras["test"])[1].split(",")
    names = sorted({"test", "plot", *in_test})
    lines = [config["options"]["install_requires"], *(extras[name] for name in names)]
    bounds = re.findall(r"^([\w.-]+)>=([\d.]+)", "\n".join(lines), re.MULTILINE)
    return [f"{name}=={release}" for name, release in bounds]


def oldest(folder: Path) -> str:
    """Return the Python of an environment of the oldest releases."""
    pins = Path("oldest.txt")
    pins.write_text("\n".join(lower_bounds()), encoding="utf-8")
    return made(folder, ".[test]", "-c", str(pins), python="python3.11")


def pages(python: str, arguments: list[str]) -> None:
    tests = [f"tests/test_{name}.py" for name in ("readme", "tutorials", "examples")]
    test(python, "-m", "", "-n", "auto", "--dist", "worksteal", *tests, *arguments)


def site(python: str, arguments: list[str]) -> None:
    call(python, "-m", "pip", "install", "-q", "riemhuman[docs]", **NEWEST)
    test(python, "-n", "0", "-m", "", "tests/test_site.py", *arguments, CI="true")


def kernels(python: str, arguments: list[str]) -> None:
    asked = subprocess.run([python, "-c", EXTENSIONS], check=True, capture_output=True, text=True)
    oldest_kernels = os.environ.get("OPENBLAS_CORETYPE", "Prescott")
    plain = {"OPENBLAS_CORETYPE": oldest_kernels, "NPY_DISABLE_CPU_FEATURES": asked.stdout.strip()}
    call(python, "-m", "threadpoolctl", "-i", "numpy", "scipy.linalg", **plain)
    tests = [f"tests/solvers/test_{name}.py" for name in ITERATIVE]
    test(python, *(arguments or tests), **plain)


def nightly(python: str, arguments: list[str]) -> None:
    part, *names = arguments
    call(python, "-m", "pip", "install", "-q", *NIGHTLY)
    programs = os.pathsep.join([str(Path(python).parent), os.environ["PATH"]])
    day = date.today().toordinal()
    if part == "fuzz":
        numbers = ("--count", "15000", "--first", str(15000 * day))
        call(python, "tests/support/fuzz.py", *(names or ["all"]), *numbers)
    elif part == "mutations":
        for name in names or ("kernels", "terms", "geometry", "solvers"):
            call(python, "tests/support/mutations.py", name, "100", str(day), PATH=programs)
    elif part == "bounds":
        # Functions that were compiled without checks are kept elsewhere.
        checks = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": os.path.abspath("compiled")}
        test(python, *(names or COMPILED), **checks)
    elif part == "benchmarks":
        test(python, "-m", "", "-s", "--benchmark-enable", *(names or ["tests/benchmarks"]))
    else:
        test(python, "-m", "", "-s", "--durations", "10", *names, PATH=programs)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("job")
    parser.add_argument("--environment", type=Path)
    options, arguments = parser.parse_known_args()
    if options.job == "command":
        print(command())
        return
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True)
    with tempfile.TemporaryDirectory() as workspace:
        environment = (options.environment or Path(workspace) / "environment").absolute()
        for name in listed.stdout.decode().split("\0")[:-1]:
            target = Path(workspace, "copy", name)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, target)
        os.chdir(Path(workspace, "copy"))
        if options.job == "oracles":
            quiet = ("-W", "default::ImportWarning", "-W", "default::DeprecationWarning")
            test(made(environment, *ORACLES), *quiet, *(arguments or ORACLE_TESTS))
        elif options.job == "oldest":
            test(oldest(environment), "-W", "default::DeprecationWarning", *arguments)
        else:
            job = {"pages": pages, "site": site, "kernels": kernels, "nightly": nightly}[
                options.job
            ]
            job(made(environment, ".[test,docs]", **NEWEST), arguments)


if __name__ == "__main__":
    main()
