"""Processes: calls in forked and in spawned children, and data loaders. A hang is a failure: every program has a time limit."""

import os
import signal
import subprocess
import sys
import textwrap

import pytest

#: Seconds. A program needs some ten of them in a development build.
LIMIT = 240

needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")

COMMON = """
import hashlib, json, multiprocessing, os, threading, time
import numpy as np
import depthcal

def depth(seed=0):
    return np.random.default_rng(seed).integers(400, 4000, (480, 640), dtype=np.uint16)

def everything():
    # A call of every function that may use several threads; what they say, for comparison.
    points = depthcal.simulate_points(frames=10, samples=60, effects=["cyclic_depth=6"], seed=3)
    fit = depthcal.calibrate(points, cross_validate=3)
    evaluation = depthcal.evaluate(fit.calibration, points)
    comparison = depthcal.compare(points, models=["none", "projective"], folds=3)
    diagnosis = depthcal.diagnose(points, folds=3)
    corrector = depthcal.Corrector(fit.calibration)
    single = depthcal.Corrector(fit.calibration, threads=1)
    board = depthcal.Board.chessboard(4, 3, 20.0)
    markers = 40 + 80.0 * np.stack([np.arange(12) % 4, np.arange(12) // 4], axis=1)
    frame = depthcal.Frame(markers, depth())
    arrays = depthcal.Dataset.from_arrays(board, [frame], unit_mm=1.0)
    fit.calibration.export("opencv")
    texts = [fit.evaluation, evaluation.record, comparison.record["models"], diagnosis.record["verdict"], arrays.digest]
    texts += [fit.report.html is not None, [list(map(str, fit.calibration.parameters))]]
    said = json.dumps(texts, sort_keys=True).encode()
    for c in (corrector, single):
        for values in (depth(), depth().astype(np.float32)):
            said += c.correct(values).tobytes() + c.points(values).tobytes() + c.correct_to_mm(values, 0.25).tobytes()
    return hashlib.sha256(said).hexdigest()
"""


def ran(tmp_path, program):
    """What a program prints. It and its children are ended where they take too long."""
    file = tmp_path / "program.py"
    file.write_text(COMMON + textwrap.dedent(program))
    with open(tmp_path / "out", "w+") as out, open(tmp_path / "err", "w+") as err:
        process = subprocess.Popen([sys.executable, str(file)], stdout=out, stderr=err, start_new_session=True)
        try:
            code = process.wait(timeout=LIMIT)
        except subprocess.TimeoutExpired:
            code = None
        if code != 0 and hasattr(os, "killpg"):
            try:
                os.killpg(process.pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        process.kill()
        process.wait()
        out.seek(0)
        err.seek(0)
        assert code is not None, f"hangs after {LIMIT} s; it said {out.read()!r}\n{err.read()}"
        assert code == 0, err.read()
        return out.read().split()


@pytest.mark.parametrize("method", [pytest.param("fork", marks=needs_fork), "spawn"])
def test_all_functions_in_a_child_of_a_process_that_used_them(tmp_path, method):
    said = ran(
        tmp_path,
        f"""
        def child(answers):
            answers.put(everything())

        if __name__ == "__main__":
            context = multiprocessing.get_context({method!r})
            answers = context.Queue()
            print(everything())
            process = context.Process(target=child, args=(answers,))
            process.start()
            print(answers.get())
            process.join()
            # The parent goes on as before.
            print(everything(), process.exitcode)
        """,
    )
    assert len(said) == 4 and said[0] == said[1] == said[2] and said[3] == "0", said


@needs_fork
def test_a_data_loader_that_forks(tmp_path):
    """Workers inherit correctors that the parent has used, as those of a loader of images do; twice, as in two epochs."""
    said = ran(
        tmp_path,
        """
        correctors = []

        def load(seed):
            corrector = correctors[seed % len(correctors)]
            out = np.empty((480, 640), np.uint16)
            corrector.correct(depth(seed), out=out)
            metres = corrector.correct(depth(seed).astype(np.float32) / np.float32(1000), 1000.0)
            return hashlib.sha256(out.tobytes() + metres.tobytes() + corrector.points(depth(seed)).tobytes()).hexdigest()

        if __name__ == "__main__":
            fit = depthcal.calibrate(depthcal.simulate_points(frames=10, samples=60, seed=3))
            correctors += [depthcal.Corrector(fit.calibration), depthcal.Corrector(fit.calibration, threads=1)]
            correctors.append(depthcal.Corrector(fit.calibration, threads=3))
            expected = [load(seed) for seed in range(9)]
            for epoch in range(2):
                with multiprocessing.get_context("fork").Pool(2) as pool:
                    print(list(pool.imap(load, range(9), chunksize=2)) == expected)
                print([load(seed) for seed in range(9)] == expected)
        """,
    )
    assert said == ["True"] * 4


@needs_fork
def test_children_of_children_and_of_threads_at_work(tmp_path):
    """A child forks again, and a process forks while its other threads correct and calibrate."""
    said = ran(
        tmp_path,
        """
        def in_fork(work):
            child = os.fork()
            if child == 0:
                os._exit(0 if work() else 1)
            return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0

        if __name__ == "__main__":
            points = depthcal.simulate_points(frames=10, samples=60, seed=3)
            fit = depthcal.calibrate(points)
            corrector = depthcal.Corrector(fit.calibration)
            expected = corrector.correct(depth()).tobytes()
            stop = threading.Event()

            def correct():
                while not stop.is_set():
                    corrector.correct(depth(1))

            def calibrate():
                while not stop.is_set():
                    depthcal.calibrate(points)

            def right():
                return corrector.correct(depth()).tobytes() == expected

            print(in_fork(lambda: right() and in_fork(right) and right()))
            threads = [threading.Thread(target=work) for work in (correct, correct, calibrate)]
            for thread in threads:
                thread.start()
            print(all(in_fork(right) for _ in range(20)))
            print(in_fork(lambda: len(depthcal.calibrate(points).calibration.parameters) > 5))
            stop.set()
            for thread in threads:
                thread.join()
            print(right())
        """,
    )
    assert said == ["True"] * 4


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="this system does not list threads")
def test_threads_are_those_of_frames_alone(tmp_path):
    """Long calls leave no threads, and nothing starts rayon's global pool, which forked processes would wait for in vain."""
    said = ran(
        tmp_path,
        """
        def names():
            threads = []
            for task in os.listdir("/proc/self/task"):
                try:
                    threads.append(open(f"/proc/self/task/{task}/comm").read().strip())
                except FileNotFoundError:
                    pass  # It has ended meanwhile.
            return sorted(threads)

        if __name__ == "__main__":
            depthcal.set_threads(3)
            before = names()
            points = depthcal.simulate_points(frames=10, samples=60, seed=3)
            fit = depthcal.calibrate(points)
            # They have ended, but the system may list them for a moment.
            limit = time.monotonic() + 30
            while names() != before and time.monotonic() < limit:
                time.sleep(0.01)
            print(names() == before)
            everything()
            after = names()
            for name in before:
                after.remove(name)
            # Those that correctors share; threads of a corrector's own may be ending.
            shared = [name for name in after if name.startswith("depthcal-")]
            print(after == shared, set(shared) == {"depthcal-0", "depthcal-1", "depthcal-2"})
        """,
    )
    assert said == ["True"] * 3, said


def test_the_number_of_threads_may_change(tmp_path):
    said = ran(
        tmp_path,
        """
        if __name__ == "__main__":
            points = depthcal.simulate_points(frames=10, samples=60, seed=3)
            corrector = depthcal.Corrector(depthcal.calibrate(points).calibration)
            results = set()
            for threads in (1, 3, 2, 1):
                depthcal.set_threads(threads)
                fit = depthcal.calibrate(points, cross_validate=3)
                results.add(json.dumps(fit.evaluation).encode() + corrector.correct(depth()).tobytes())
            print(len(results))
        """,
    )
    assert said == ["1"]
