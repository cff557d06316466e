"""Factors made in a thread of their own: what becomes of them at the end of the process."""

from __future__ import annotations

import subprocess
import sys

ENDING = """
import atexit
import threading
import numpy as np
import scipy.sparse as sp
found = []
atexit.register(lambda: print(found[0].solve(np.array([4.0, 9.0]))))
from hemivar.linear.superlu import superlu
matrix = sp.csc_array(np.diag([2.0, 3.0]))
thread = threading.Thread(target=lambda: found.append(superlu(matrix, "NATURAL")))
thread.start()
thread.join()
"""


def test_factors_last_until_the_last_thread_has_ended() -> None:
    """A thread that still computes while the process ends found them taken away."""
    done = subprocess.run([sys.executable, "-c", ENDING], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "[2. 3.]\n", "")
