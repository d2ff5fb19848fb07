"""Makes docs/notebook.ipynb, with what its cells show.

python -m benchmarks.documents.notebook (needs nbclient and ipykernel).
"""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CELLS = (
    "# A warm-up test in a notebook\n\nWhere each sensor will settle; and what to do when the model fails.",
    '%matplotlib inline\nimport thermofast as tf\n\nrun = tf.read("sample_runs/spindle.csv")\nrun.notes',
    "Steady state and settling time from the first 60 of 400 minutes; the record goes on, so the error ahead is shown too.",
    'result = tf.identify(run, until=60)\ncolumns = ["channel", "steady_state_c", "steady_state_lo_c", "steady_state_hi_c", '
    '"t95_min", "status"]\nresult.to_frame()[columns].round(3)',
    'figure = tf.identify(tf.read("sample_runs/spindle.csv", channels=["T1", "T5", "T8"]), until=60).plot()\nfigure',
    "How short may the test be? The paper's rule and the width of the interval.",
    'tf.sweep(tf.read("sample_runs/spindle.csv", channels=["T5"]), windows=[40, 45, 50, 55], tolerance=0.5).to_frame()'
    '[["window_min", "best_time_min", "rmse_c", "shortest_time_min"]]',
    "## When the model does not fit\n\nThis machine hides something. Where does the model fail, and what is missing?",
    'hidden = tf.read("sample_runs/hidden.csv")\ntf.compare(hidden, until=120).plot()',
    "found = tf.diagnose(hidden)\nprint(found[0].verdict)\nprint(found[0].message)",
    "Add it, watch the error fall on readings that the fit did not see, and keep the model.",
    "learnt = tf.improve(hidden, auto=True)\nlearnt.plot()",
    "The proof is another run of the same machine, from its first hour.",
    'second = tf.read("sample_runs/hidden_second_run.csv")\nahead = tf.compare(second, until=60, model=learnt.model)\n'
    'ahead.to_frame()[["channel", "effects", "rmse_fit_c", "rmse_ahead_c", "noise_c", "status"]].round(3)',
)


def main() -> None:
    """Write the notebook with its outputs."""
    import nbformat
    from nbclient import NotebookClient

    code = ("%", "result", "figure", "tf.", "hidden =", "found", "learnt", "second")
    book = nbformat.v4.new_notebook()
    for k, text in enumerate(CELLS):
        cell = nbformat.v4.new_code_cell(text) if text.startswith(code) else nbformat.v4.new_markdown_cell(text)
        cell["id"] = f"cell-{k}"
        book.cells.append(cell)
    NotebookClient(book, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(ROOT)}}).execute()
    for cell in book.cells:
        cell.metadata.pop("execution", None)
    book.metadata = {"language_info": {"name": "python"}}
    nbformat.write(book, ROOT / "docs" / "notebook.ipynb")


if __name__ == "__main__":
    main()
