"""Long calls: progress, Ctrl-C, threads."""

import os
import signal
import subprocess
import sys
import textwrap
import threading

import pytest

import depthcal


def test_progress_is_told(points):
    events = []
    depthcal.calibrate(points, cross_validate=3, progress=lambda *event: events.append(event))
    begun = [event[1] for event in events if event[0] == "begin"]
    ended = [event[1] for event in events if event[0] == "end"]
    assert begun and sorted(begun) == sorted(ended)
    (job,) = [event for event in events if event[2] == "cross-validating"]
    assert job[3] == 3 and sum(event[:2] == ("advance", job[1]) for event in events) == 3


def test_bars_of_tqdm(points, capsys):
    pytest.importorskip("tqdm")
    depthcal.calibrate(points, cross_validate=3, progress=True)
    assert "cross-validating" in capsys.readouterr().err


def test_an_exception_of_the_progress_ends_the_work(points):
    def show(*_):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        depthcal.diagnose(points, progress=show)


def test_ctrl_c_ends_the_work():
    program = textwrap.dedent("""
        import os, signal, depthcal
        # Shells start programs in the background with SIGINT ignored.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        points = depthcal.simulate_points(frames=24, samples=400, effects=["cyclic_depth=6"], seed=1)
        begun = []
        def show(event, *rest):
            if event == "doing" and not begun:
                begun.append(True)
                os.kill(os.getpid(), signal.SIGINT)
        try:
            depthcal.diagnose(points, progress=show)
            print("finished")
        except KeyboardInterrupt:
            print("interrupted")
        print(len(depthcal.calibrate(points).calibration.parameters) > 5)
    """)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300, env=os.environ)
    assert done.stdout.split() == ["interrupted", "True"], done.stderr
    assert signal.getsignal(signal.SIGINT) is not signal.SIG_DFL


def test_calls_from_several_threads(points):
    results = {}

    def work(key):
        results[key] = list(depthcal.calibrate(points).calibration.parameters)

    threads = [threading.Thread(target=work, args=(key,)) for key in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results[0] == results[1] == results[2]


def test_threads_are_set_before_anything_else():
    program = "import depthcal; depthcal.set_threads(1); p = depthcal.simulate_points(frames=8); print(len(p))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "8"
    with pytest.raises(depthcal.InputError, match="at least 1"):
        depthcal.set_threads(0)
