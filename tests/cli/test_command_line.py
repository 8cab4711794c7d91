"""The command line as a whole: help, exit codes, one-line errors, interruption, pipes."""

import io
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import riemhuman
from riemhuman.cli import main
from riemhuman.cli._commands import COMMANDS, make_parser
from riemhuman.cli._terminal import as_json

PARSER = make_parser("", "", "")
COMMAND = (sys.executable, "-m", "riemhuman")


def test_help_of_every_command_has_examples_that_parse(capsys):
    for name in COMMANDS:
        with pytest.raises(SystemExit, match="0"):
            main([*name.split(), "--help"])
        described, examples = capsys.readouterr().out.split("\nexamples:\n")
        assert "--debug" in described, name
        commands = [re.sub(r"(#|\|).*", "", line).split() for line in examples.split("\n") if line]
        assert len(commands) >= 2, name
        for command in commands:
            assert command[: 1 + len(name.split())] == ["riemhuman", *name.split()]
            assert PARSER.parse_args(command[1:]).run


def test_help_loads_nothing_heavy():
    code = (
        "import sys\nfrom riemhuman.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'scipy', 'numba', 'autograd', 'matplotlib', 'trimesh'}\n"
        "print(sorted(heavy & sys.modules.keys()), file=sys.stderr)"
    )
    finished = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert finished.stderr == "[]\n"


def test_terminals_without_unicode(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    with pytest.raises(SystemExit, match="0"):
        main(["dist", "--help"])
    stream.flush()
    assert b"(a, ?, c) = (1, 0.0001, 0)" in stream.buffer.getvalue()


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (riemhuman.RiemhumanError("two\n lines"), 2, "two lines"),
        (MemoryError("8 GiB"), 2, "not enough memory; use fewer or coarser meshes: 8 GiB"),
        (ZeroDivisionError("by zero"), 2, "unexpected ZeroDivisionError: by zero; --debug"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_errors_take_one_line(run, scans, monkeypatch, error, code, message):
    def fail(path):
        raise error

    monkeypatch.setattr("riemhuman.load_mesh", fail)
    finished = run("info", scans / "body_0.ply")
    assert (finished.code, finished.out) == (code, "")
    assert finished.err.startswith(f"riemhuman: {message}")
    assert finished.err.count("\n") == 1
    if code != 130:
        for arguments in (["--debug", "info"], ["info", "--debug"]):
            with pytest.raises(type(error)):
                main([*arguments, str(scans / "body_0.ply")])


def test_json_keeps_all_digits_and_has_no_nan():
    record = {"a": 0.1 + 0.2, "b": np.float64(1 / 3), "c": np.array([np.nan, np.inf]), 1: True}
    assert as_json(record) == (
        '{\n  "a": 0.30000000000000004,\n  "b": 0.3333333333333333,\n'
        '  "c": [\n    null,\n    null\n  ],\n  "1": true\n}'
    )


def test_a_reader_that_leaves(scans):
    """As in `riemhuman info ... | head -1`: no traceback, and the code that shells give."""
    reads, writes = os.pipe()
    os.close(reads)
    finished = subprocess.run(
        [*COMMAND, "info", str(scans / "labels.csv")],
        stdout=writes,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(writes)
    assert (finished.returncode, finished.stderr) == (141, "")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
def test_an_interrupted_command(scans, tmp_path):
    """As Ctrl-C: the code, no traceback, nothing half-written."""
    many = tmp_path / "many"
    many.mkdir()
    bodies = sorted(scans.glob("*.ply"))
    for number in range(60):
        os.link(bodies[number % len(bodies)], many / f"{number}.ply")
    # Paths take minutes: no signal comes too late.
    command = [*COMMAND, "matrix", many, "--paths", "-q", "-o", tmp_path / "D.npz"]
    command += ["--resume", tmp_path / "work"]
    with subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        text=True,
        # Where the tests run in the background, shells have them ignore the signal.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        try:
            while not (tmp_path / "work" / "manifest.json").exists():
                assert process.poll() is None
                time.sleep(0.01)
            process.send_signal(signal.SIGINT)
            _, printed = process.communicate(timeout=120)
        finally:
            process.kill()
    assert process.returncode == 130
    assert "Traceback" not in printed
    assert printed.splitlines()[-1] == "riemhuman: interrupted"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["many", "work"]


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (["dist", "a.ply", "b.ply", "--aling"], "did you mean --align?"),
        (["tables", "--resolution", "corse"], "did you mean coarse?"),
        (["dist"], "usage: riemhuman dist"),
        (["dist", "a.ply", "."], "argument B: must be one mesh, but . is a folder"),
        (["dist", "a.ply", "walk.bvh"], "`riemhuman motions dist` compares motions"),
        (["register", "a.ply", "-o", "b.ply", "--model", "c", "--coarse"], "not allowed with"),
    ],
)
def test_what_may_have_been_meant(capsys, arguments, meant):
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    assert stopped.value.code == 2
    assert meant in capsys.readouterr().err


def test_the_shell_completes_names_and_options(tmp_path):
    pytest.importorskip("argcomplete")

    def completed(line):
        environment = os.environ | {
            "_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)),
            "_ARGCOMPLETE_STDOUT_FILENAME": str(tmp_path / "found"), "_ARGCOMPLETE_IFS": " ",
        }  # fmt: skip
        subprocess.run([sys.executable, "-m", "riemhuman"], env=environment, check=False)
        return (tmp_path / "found").read_text(encoding="utf-8").split()

    assert completed("riemhuman disent") == ["disentangle"]
    assert "--align" in completed("riemhuman dist --al")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="devices of Linux")
def test_a_full_disk_of_messages_costs_no_result(scans):
    """As in ``riemhuman ... 2>log``, where nothing more can be written to the log."""
    code = "import sys; from riemhuman.cli import _terminal, main; _terminal.note('full')\n"
    code += "sys.exit(main(sys.argv[1:]))"
    with open("/dev/full", "w") as full:
        finished = subprocess.run(
            [sys.executable, "-c", code, "info", scans / "labels.csv"],
            stdout=subprocess.PIPE,
            stderr=full,
        )
    assert finished.returncode == 0
    assert b"table of labels" in finished.stdout


def test_only_tables_go_to_standard_output(refused, scans, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for command in (["matrix", scans], ["geodesic", scans / "body_0.ply", scans / "body_1.ply"]):
        assert "--output cannot be standard output" in refused(*command, "-o", "-")
