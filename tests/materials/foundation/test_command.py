from __future__ import annotations

import argparse
import errno
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from materials.foundation.command import add_common_flags, explain, run_command
from materials.foundation.errors import InputError

CHECKOUT = Path(__file__).parents[3]


def run(body, *words: str) -> int:
    parser = argparse.ArgumentParser(prog="wet")
    add_common_flags(parser)
    return run_command(parser, body, list(words))


def raising(error: BaseException):
    def body(args):
        raise error

    return body


def test_success_is_zero_and_silent(capsys):
    assert run(lambda args: None, "--quiet") == 0
    assert capsys.readouterr().err == ""


def test_an_unusable_input_is_one_line_and_code_two(capsys):
    assert run(raising(InputError("be positive", got=-1, file="a.json", key="fx", remedy="Mend it."))) == 2
    assert capsys.readouterr().err == "meniscus: a.json: fx must be positive, got -1. Mend it.\n"


def test_the_traceback_is_shown_on_demand():
    with pytest.raises(InputError):
        run(raising(InputError("be right", key="fx")), "--traceback")


def test_an_interrupt_is_code_130(capsys):
    assert run(raising(KeyboardInterrupt())) == 130
    assert "interrupted" in capsys.readouterr().err


def test_a_defect_of_ours_keeps_its_traceback():
    with pytest.raises(ZeroDivisionError):
        run(raising(ZeroDivisionError()))


def test_flags_that_do_not_exist_are_code_two_and_help_is_zero(capsys):
    assert run(lambda args: None, "--nonsense") == 2
    assert "--nonsense" in capsys.readouterr().err
    assert run(lambda args: None, "--help") == 0


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENOSPC, "x", "out.png"), "out.png: it must have space left on its disk. Free some space"),
        (OSError(errno.EDQUOT, "x"), "output: it must have space left in its quota."),
        (OSError(errno.EROFS, "x", "out"), "out: it must be on a disk that can be written to."),
        (PermissionError(errno.EACCES, "x", "out"), "out: it must be accessible."),
        (FileNotFoundError(errno.ENOENT, "x", "in"), "in: it must exist. Check the path."),
        (IsADirectoryError(errno.EISDIR, "x", "in"), "in: it must be a file, not a folder."),
        (OSError(errno.EIO, "Input/output error", "in"), "in: it must be usable, got Input/output error."),
        (MemoryError(), "the scene must fit into memory, got no memory left."),
    ],
)
def test_a_failure_of_the_system_is_worded_like_any_other(capsys, error, words):
    assert run(raising(error)) == 2
    assert capsys.readouterr().err.startswith(f"meniscus: {words}")


def test_what_is_not_known_is_not_explained():
    with pytest.raises(RuntimeError):
        explain(RuntimeError("bug"))


def test_the_handler_of_sigterm_is_given_back():
    before = signal.getsignal(signal.SIGTERM)
    run(lambda args: None)
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_command_may_run_outside_the_main_thread():
    codes: list[int] = []
    thread = threading.Thread(target=lambda: codes.append(run(lambda args: None)))
    thread.start()
    thread.join()
    assert codes == [0]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_killed_command_leaves_nothing_half_written(tmp_path, number):
    code = f"""
import argparse, sys, time
from materials.foundation.command import run_command
from materials.foundation.files import replacing
def body(args):
    with replacing({str(tmp_path / "a.txt")!r}) as temporary:
        temporary.write_text("half")
        print("ready", flush=True)
        time.sleep(60)
sys.exit(run_command(argparse.ArgumentParser(), body, []))
"""
    # Ctrl-C reaches a process that was started in the foreground; one started with SIGINT ignored would not listen.
    restore = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    process = subprocess.Popen(
        [sys.executable, "-c", restore + code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=CHECKOUT
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    os.kill(process.pid, number)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "interrupted" in err
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_while_modules_still_load_shows_no_traceback(tmp_path):
    # An entry point as the console scripts have it, whose import takes long; the script says when it is under way.
    (tmp_path / "slow.py").write_text("import time\nprint('loading', flush=True)\ntime.sleep(60)\n")
    code = """
import signal; signal.signal(signal.SIGINT, signal.default_int_handler)
import scene.entry
import slow
"""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(CHECKOUT)])}
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "loading\n"
    os.kill(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == -signal.SIGINT  # a shell says 130
    assert err == ""


def test_a_command_hears_ctrl_c_although_its_entry_was_silent():
    handlers = []
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        run(lambda args: handlers.append(signal.getsignal(signal.SIGINT)))
    finally:
        signal.signal(signal.SIGINT, before)
    assert handlers == [signal.default_int_handler]


def test_every_console_script_starts_at_an_entry_that_exists():
    import importlib
    import tomllib

    scripts = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]
    for name, target in scripts.items():
        module, function = target.split(":")
        # Importing an entry silences Ctrl-C, which a test session must hear.
        before = signal.getsignal(signal.SIGINT)
        try:
            assert callable(getattr(importlib.import_module(module), function)), name
        finally:
            signal.signal(signal.SIGINT, before)
        assert module.endswith(".entry"), f"{name} should start in its package's entry.py"


def test_a_reader_that_has_seen_enough_is_no_error():
    code = """
import argparse, sys
from materials.foundation.command import run_command
def body(args):
    for _ in range(100_000):
        print("line of text")
sys.exit(run_command(argparse.ArgumentParser(), body, []))
"""
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=CHECKOUT
    )
    assert process.stdout is not None and process.stderr is not None
    process.stdout.readline()
    process.stdout.close()
    err = process.stderr.read()
    process.stderr.close()
    assert process.wait(timeout=30) == 141
    assert err == ""
