"""Python in the documents: what it calls of depthcal exists and takes these arguments, and it runs."""

import ast
import inspect
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import depthcal

ROOT = Path(__file__).resolve().parents[3]
PAGES = sorted([*(ROOT / "docs").glob("*.md"), ROOT / "README.md", ROOT / "crates/python/README.md"])


def blocks(page):
    """The indented blocks of a page that call depthcal, without their indentation and without lines for a shell."""
    text = page.read_text(encoding="utf-8")
    found, lines = [block for block in re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)], []
    for line in [*re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE).splitlines(), "end"]:
        if line.startswith("    ") or not line.strip():
            lines.append(line[4:])
        else:
            python = [line for line in lines if not line.startswith("pip install")]
            if any(("depthcal." in line or "solver." in line) and not line.lstrip().startswith("#") for line in python):
                found.append("\n".join(python))
            lines = []
    return found


def is_python(block):
    return any(
        word in block
        for word in (" = depthcal.", "depthcal import", "import depthcal", "@depthcal.", ", depthcal\n", "solver.")
    )


SNIPPETS = [(page.name, block) for page in PAGES for block in blocks(page) if is_python(block)]


def resolve(node):
    """What `depthcal.NAME…` is; None for other expressions."""
    if isinstance(node, ast.Name):
        return depthcal if node.id == "depthcal" else None
    if isinstance(node, ast.Attribute):
        owner = resolve(node.value)
        if owner is not None:
            assert hasattr(owner, node.attr), f"{owner} has no {node.attr}"
            return getattr(owner, node.attr)
    return None


def test_there_are_snippets():
    assert len(SNIPPETS) >= 3


@pytest.mark.parametrize("snippet", [block for _, block in SNIPPETS], ids=[page for page, _ in SNIPPETS])
def test_snippet_fits_the_package(snippet):
    tree = ast.parse(snippet)
    for node in ast.walk(tree):
        resolve(node)
        if not isinstance(node, ast.Call):
            continue
        called = resolve(node.func)
        starred = any(isinstance(a, ast.Starred) for a in node.args) or any(k.arg is None for k in node.keywords)
        if called is None or starred:
            continue
        inspect.signature(called).bind(*node.args, **{k.arg: k.value for k in node.keywords})


def bundle():
    """Two cameras that see points: start values and observations of the snippet of the solver."""
    random = np.random.default_rng(4)
    points = random.uniform([-1, -1, 4], [1, 1, 6], (30, 3))
    moved = np.array([0.5, 0.1, 0.0])
    seen = np.concatenate([(points + t)[:, :2] / (points + t)[:, 2:] for t in (np.zeros(3), moved)])
    start = np.zeros((2, 7))
    start[:, 0] = 1.0
    start[1, 4:] = moved
    return {
        "start_poses": start,
        "start_points": points + random.normal(0, 0.05, points.shape),
        "of_camera": np.repeat([0, 1], 30),
        "of_point": np.tile(np.arange(30), 2),
        "seen": seen + random.normal(0, 0.001, seen.shape),
    }


@pytest.fixture(scope="module")
def names(folder, images, corners, dataset, fit):
    """What the snippets have besides what they make."""
    board = depthcal.Board.chessboard(9, 6, 25.0)
    in_mm = {name: (depth * dataset.unit_mm).astype(np.uint16) for name, (_, depth) in images.items()}
    frames = [depthcal.Frame(corners[name], in_mm[name], gray, name) for name, (gray, _) in images.items()]
    grey = [depthcal.Frame(corners[name], None, gray, name) for name, (gray, _) in images.items()]
    x = np.linspace(0, 1, 20)
    return {
        "depthcal": depthcal,
        "numpy": np,
        "captures": [(gray, in_mm[name]) for name, (gray, _) in images.items()],
        "board": board,
        "frames": frames,
        "dataset": dataset,
        "depth": next(iter(in_mm.values())),
        "infrared": depthcal.Dataset.from_arrays(board, frames, unit_mm=1.0),
        "colour": depthcal.Dataset.from_arrays(board, grey),
        "solver": depthcal.solver,
        "x": x,
        "y": 1 + 2 * x + np.random.default_rng(1).normal(0, 0.1, 20),
        **bundle(),
    }


def test_the_snippets_run_from_page_to_page(names, folder, fit, tmp_path, monkeypatch):
    pytest.importorskip("cv2", reason="SKIPPED: snippets of documents; OpenCV is not installed")
    pytest.importorskip("pandas")
    monkeypatch.chdir(tmp_path)
    shutil.copytree(folder, "captures")
    for place in ("better", "result"):
        fit.save(place)
    for page in PAGES:
        given = dict(names)
        for block in (block for block in blocks(page) if is_python(block)):
            exec(compile(block, str(page), "exec"), given)
        if page.name == "python.md":
            assert given["solution"].converged
