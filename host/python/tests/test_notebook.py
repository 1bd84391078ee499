"""The notebook runs from its first cell to its last, and its diagnosis is the binary's."""

import json
import sys
import time
import unittest

import nbclient
import nbformat

from support import ROOT, host, scratch, without_times

NOTEBOOK = ROOT / "host/python/notebooks/doggy.ipynb"
LONGEST_S = 120.0
"""What a reader waits for at most."""


class Notebook(unittest.TestCase):
    def test_it_runs_in_two_minutes(self):
        folder = scratch() / "notebook"
        folder.mkdir()
        notebook = nbformat.read(NOTEBOOK, as_version=4)
        self.assertEqual(len(notebook.cells), 10)
        # The kernel is this interpreter.
        notebook.metadata.kernelspec.name = "python3"
        begin = time.monotonic()
        nbclient.NotebookClient(notebook, timeout=LONGEST_S, resources={"metadata": {"path": str(folder)}}).execute()
        took_s = time.monotonic() - begin
        print(f"the notebook took {took_s:.0f} s", file=sys.stderr)
        self.assertLess(took_s, LONGEST_S)
        shown = "".join(output.get("data", {}).get("text/html", "") for cell in notebook.cells for output in cell.get("outputs", []))
        self.assertIn("<iframe", shown)

        host("diagnose", "run.mcap", "--holdout", "other.mcap", "-o", "theirs.json", cwd=folder, codes=(10, 11, 12))
        ours, theirs = (json.loads((folder / name).read_text()) for name in ("diagnosis.json", "theirs.json"))
        self.assertEqual(json.dumps(without_times(ours)), json.dumps(without_times(theirs)))


if __name__ == "__main__":
    unittest.main()
