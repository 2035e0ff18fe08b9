"""What the comparisons with other programs share: our examples are built, and a Python is asked what it can import."""
import json
import os
import subprocess
import sys

root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def build(*selection):
    """Builds examples, which are selected as for `cargo build`; returns the program that was built last."""
    command = ["cargo", "build", "--release", *selection, "--message-format", "json"]
    output = subprocess.run(command, cwd=root, capture_output=True, text=True)
    if output.returncode:
        sys.exit(output.stderr)
    found = [json.loads(line) for line in output.stdout.splitlines() if line.startswith("{")]
    return [m["executable"] for m in found if m.get("executable")][-1]


def has(python, module):
    """Whether a Python can import a module."""
    try:
        return subprocess.run([python, "-c", f"import {module}"], capture_output=True).returncode == 0
    except OSError:
        return False
