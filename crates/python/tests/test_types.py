"""The types of the package: a program of a user is clean by mypy and pyright, and a wrong one is not."""

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).with_name("typed.py")

CHECKERS = {"mypy": ["mypy", "--strict"], "pyright": ["pyright", "--pythonpath", sys.executable]}


def checked(checker, path, folder):
    pytest.importorskip(checker, reason=f"SKIPPED: types by {checker}; it is not installed")
    command = [sys.executable, "-m", *CHECKERS[checker], str(path)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder)
    if checker == "pyright" and "error: " not in done.stdout and done.returncode not in (0, 1):
        pytest.skip(f"SKIPPED: types by pyright; it cannot be run here: {done.stderr.strip().splitlines()[-1:]}")
    return done


@pytest.mark.parametrize("checker", CHECKERS)
def test_a_program_is_clean(checker, tmp_path):
    done = checked(checker, PROGRAM, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("checker", CHECKERS)
def test_a_wrong_program_is_not(checker, tmp_path):
    wrong = tmp_path / "wrong.py"
    wrong.write_text(
        "import depthcal\nfit = depthcal.calibrate(3)\nfit.calibration.parameters['x'].valu\n"
        "depthcal.calibrate('captures', folds=3)\n"
    )
    done = checked(checker, wrong, tmp_path)
    assert done.returncode == 1 and all(f":{line}" in done.stdout for line in (2, 3, 4)), done.stdout
