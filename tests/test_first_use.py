"""Several threads that use the package first, and processes that are forked while another thread works."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.samples import sampled

PROBLEM = """
import os, sys, threading, time
import hemivar as hv
problem = hv.ContactProblem(
    mesh=hv.rectangle((1.0, 1.0), 4), material=hv.Material.lame(4, 4), supports={"left": hv.Clamped()},
    body_force=(0, -0.5),
    contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(q_max=0.3, p_const=2.0), hv.Tresca(0.5))},
)
"""

TOGETHER = """
s = hv.solve(hv.discretize(problem))
sys.setswitchinterval(1e-4)
uses = [s.plot, s._repr_html_, s.to_dict, problem.plot, lambda: hv.find_solutions(s.problem), lambda: hv.certify(s),
        lambda: hv.study, lambda: hv.bounds.exact_distance, lambda: hv.report.plot_problem]
turn = int(sys.argv[1])
uses = uses[turn:] + uses[:turn]
start, errors = threading.Barrier(len(uses)), []
def use(function):
    start.wait()
    try:
        function()
    except BaseException as error:
        errors.append(f"{type(error).__name__}: {error}")
threads = [threading.Thread(target=use, args=(function,)) for function in uses]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
import matplotlib
assert matplotlib.rcParams["font.size"] == matplotlib.rcParamsDefault["font.size"], "settings left behind"
print(errors or "fine")
"""

FORKS = """
done, w = threading.Event(), hv.systems.Workspace()
def work():
    while not done.is_set():
        w.forget()
        s = hv.solve(hv.discretize(problem), workspace=w)
        hv.certificates.smallness(s.problem, workspace=w)
s = hv.solve(hv.discretize(problem), workspace=w)
hv.certificates.smallness(s.problem)
thread = threading.Thread(target=work)
thread.start()
sys.setswitchinterval(1e-4)
children = []
for k in range(20):
    time.sleep(0.005)
    pid = os.fork()
    if pid == 0:
        s = hv.solve(hv.discretize(problem), workspace=w)
        hv.certificates.smallness(s.problem, workspace=w)
        os._exit(0 if s.status is hv.Status.CONVERGED else 3)
    children.append(pid)
done.set()
thread.join()
end, left = time.monotonic() + 30, set(children)
while left and time.monotonic() < end:
    for pid in list(left):
        ended, status = os.waitpid(pid, os.WNOHANG)
        if ended:
            assert status == 0, status
            left.discard(pid)
    time.sleep(0.02)
for pid in left:
    os.kill(pid, 9)
print(f"{len(left)} hang" if left else "fine")
"""


def ran(code: str, *arguments: str) -> str:
    environment = {**os.environ, "MPLBACKEND": "Agg", "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-c", PROBLEM + code, *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        env=environment,
        check=False,
    )
    return done.stdout.strip() or done.stderr


@pytest.mark.parametrize("turn", sampled(range(4), 4))
def test_threads_that_use_the_package_first_get_whole_modules(turn: int) -> None:
    assert ran(TOGETHER, str(2 * turn)) == "fine"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_child_forked_while_another_thread_solves_can_solve() -> None:
    assert ran(FORKS) == "fine"


def test_a_first_answer_loads_no_part_of_scipy_that_it_does_not_use() -> None:
    """They take a third of its time."""
    told = "print([m for m in ('scipy.optimize', 'scipy.spatial', 'scipy.interpolate') if m in sys.modules])"
    code = f"{PROBLEM}\nassert hv.solve(problem).status is hv.Status.CONVERGED\n{told}"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip() == "[]"
