"""Python in the documents: it parses, and what it calls of depthcal exists and takes these arguments."""

import ast
import inspect
from pathlib import Path

import depthcal
import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGES = sorted([*(ROOT / "docs").glob("*.md"), ROOT / "README.md"])


def blocks(page):
    """The indented blocks of a page that call depthcal, without their indentation and without lines for a shell."""
    found, lines = [], []
    for line in [*page.read_text(encoding="utf-8").splitlines(), "end"]:
        if line.startswith("    ") or not line.strip():
            lines.append(line[4:])
        else:
            python = [line for line in lines if not line.startswith("pip install")]
            if any("depthcal." in line and not line.lstrip().startswith("#") for line in python):
                found.append("\n".join(python))
            lines = []
    return found


def is_python(block):
    return any(word in block for word in (" = depthcal.", "import depthcal", "@depthcal.", ", depthcal\n"))


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
