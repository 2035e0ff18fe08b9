"""Every notebook of the examples runs from its first to its last cell."""

from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat")
NotebookClient = pytest.importorskip("nbclient").NotebookClient
for module in ("cv2", "pandas", "matplotlib", "ipykernel"):
    pytest.importorskip(module)

FOLDER = Path(__file__).resolve().parents[3] / "examples" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


def test_there_are_notebooks():
    assert len(NOTEBOOKS) >= 4


#: A cell after the last one, which checks what a figure says.
CHECKS = {
    "own_camera": "in_mm = corrector.correct_to_mm(depth, unit_mm=UNIT_MM) - depth * UNIT_MM\n"
    "# Corrected depth is rounded to steps.\n"
    "assert np.nanmax(np.abs(change - np.where(depth > 0, in_mm, np.nan))) <= 0.51 * UNIT_MM"
}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert all(not cell.get("outputs") for cell in notebook.cells), f"{path.name} is stored with outputs: clear them"
    if path.stem in CHECKS:
        notebook.cells.append(nbformat.v4.new_code_cell(CHECKS[path.stem]))
    NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in outputs), "no figure was drawn"
    errors = [output for output in outputs if output.output_type == "stream" and output.name == "stderr"]
    # What the engine warns of is for readers of the notebook.
    errors = [output for output in errors if "DepthcalWarning" not in output.text]
    assert not errors, errors
