"""The notebook of the examples runs from its first cell to its last."""

from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).parents[2] / "examples" / "from_training_to_rules.ipynb"


@pytest.mark.long
def test_it_runs_from_training_to_rules_to_a_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import nbformat  # a dependency of nbclient
    from nbclient import NotebookClient

    # The kernel imports this package also where it isn't installed.
    monkeypatch.setenv("PYTHONPATH", str(NOTEBOOK.parents[1]), prepend=":")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    ).execute()
    outputs = [out for cell in notebook.cells for out in cell.get("outputs", [])]
    pictures = [out for out in outputs if "image/png" in out.get("data", {})]
    assert len(pictures) == 2
    text = "".join(out.get("text", "") for out in outputs)
    assert "if bearing is far_left then steer" in text
    assert (tmp_path / "outputs" / "notebook" / "report.html").is_file()
