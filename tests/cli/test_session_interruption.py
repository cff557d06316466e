"""Ctrl-C, the time limit and a lack of memory: the best iterate so far, with a status that says what happened."""

from __future__ import annotations

import signal
from pathlib import Path

from tests.problem_files import block_file
from tests.solvers.test_controls_interruption import needs_linux, start


@needs_linux
def test_a_factorisation_is_left_at_once(tmp_path: Path) -> None:
    """A library that would compute for ever: the command ends with one line, and writes nothing."""
    (tmp_path / "part.toml").write_text(block_file(64, friction=None))
    process = start(
        """
        import sys, time
        from hemivar import cli
        from hemivar.linear import factorisation, superlu

        def splu(*arguments, **options):
            print("factorising", flush=True)
            time.sleep(300)

        superlu._QUICK = 10  # in a thread of its own, whatever the size
        factorisation.pardiso_available = lambda: False  # which would leave splu to the certificate
        superlu.spla.splu = splu
        sys.exit(cli.main(["solve", "part.toml", "--method", "newton", "--json", "a.json"]))
        """,
        tmp_path,
    )
    assert process.stdout is not None
    while process.stdout.readline().strip() != "factorising":
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert err == "hemivar: interrupted\n"
    assert not (tmp_path / "a.json").exists()
