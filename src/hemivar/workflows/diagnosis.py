"""What an installation can do: versions, optional parts and what they are for, threads, a problem that is solved."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import platform
import shutil
import time
from collections.abc import Generator
from dataclasses import dataclass

from hemivar.basics.arguments import number
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.machine import cores, import_fails, system
from hemivar.basics.memory import available_bytes
from hemivar.errors import ProblemError
from hemivar.kernels import kernels
from hemivar.kernels import threads as kernel_threads
from hemivar.workflows.events import Phase

__all__ = ["Diagnosis", "Part", "diagnose"]

#: Package, module, what it is for, how it is had; required ones have no way of their own.
_REQUIRED = (
    ("numpy", "numpy"),
    ("scipy", "scipy"),
    ("scikit-fem", "skfem"),
    ("pyamg", "pyamg"),
    ("threadpoolctl", "threadpoolctl"),
    ("meshio", "meshio"),
    ("matplotlib", "matplotlib"),
    ("typer", "typer"),
    ("rich", "rich"),
)
_OPTIONAL = (
    ("pypardiso", "pypardiso", "a faster factorisation, half the memory", "pip install pypardiso"),
    ("gmsh", "gmsh", "generating meshes (reading them needs nothing)", "pip install gmsh"),
    (
        "starlette",
        "starlette",
        "hemivar studio (with uvicorn and websockets)",
        "pip install starlette uvicorn websockets tomlkit",
    ),
    ("anywidget", "anywidget", "the studio in a notebook", "pip install anywidget tomlkit"),
    ("pandas", "pandas", "tables as DataFrames", "pip install pandas"),
    ("pyarrow", "pyarrow", "histories as Parquet", "pip install pyarrow"),
    ("petsc4py", "petsc4py", "the engine for clusters (with mpi4py)", "see docs/distributed.md"),
    ("mpi4py", "mpi4py", "the engine for clusters (with petsc4py)", "see docs/distributed.md"),
)
_PROGRAMS = (
    ("ffmpeg", "films as MP4 (GIF needs nothing)", "install ffmpeg"),
    ("mpirun", "running over several processes or machines", "install Open MPI or MPICH"),
)


@dataclass(frozen=True)
class Part:
    """A package or program that hemivar needs or can use.

    Attributes
    ----------
    name : str
    version : str or None
        None where it is not there.
    serves : str
        What it is for.
    remedy : str
        How it is had; empty where it is there and works.
    broken : str or None
        Why it does not work although it is there.
    """

    name: str
    version: str | None
    serves: str
    remedy: str = ""
    broken: str | None = None

    @property
    def works(self) -> bool:
        """Whether it is there and can be used."""
        return self.version is not None and self.broken is None


@dataclass(frozen=True)
class Diagnosis:
    """What :func:`diagnose` finds.

    Attributes
    ----------
    version, python, system : str
        Of hemivar, the interpreter, the machine.
    cores : int
        Processors that this process may use.
    memory : float or None
        Bytes that are free; None where the system does not say.
    required, optional : tuple of Part
    threads : tuple of (str, int)
        Libraries of dense linear algebra and how many threads each takes.
    kernels : int or None
        Threads that the compiled kernels take; None where they are not there.
    seconds : float or None
        Time to solve and certify a small problem; None where that failed.
    failed : str or None
        Why it failed.
    remarks : tuple of str
        What should be changed, worst first.
    """

    version: str
    python: str
    system: str
    cores: int
    memory: float | None
    required: tuple[Part, ...]
    optional: tuple[Part, ...]
    threads: tuple[tuple[str, int], ...]
    kernels: int | None
    seconds: float | None
    failed: str | None
    remarks: tuple[str, ...]

    @property
    def sound(self) -> bool:
        """Whether everything that is required works."""
        return self.failed is None and all(part.works for part in self.required)


def diagnose(*, limit: float = 30.0) -> Generator[Phase, bool | None, Diagnosis]:
    """Look at the installation; yields what is looked at.

    Parameters
    ----------
    limit : float
        Seconds that each optional package may take to be imported, in a process of its own: one that ends its process
        or hangs is reported as broken.

    Yields
    ------
    Phase
        What is looked at; the generator returns a :class:`Diagnosis`.

    Raises
    ------
    ProblemError
        ``limit`` is not a number of seconds above 0.
    """
    most = number(limit, "diagnose: limit", "give seconds")
    if not 0.0 < most < 1e9:
        raise ProblemError(f"diagnose: limit is {most:g}; give seconds > 0")
    with IMPORTS:
        from hemivar import __version__

    required = tuple(Part(name, _version(name), "needed", *_absent(name, module)) for name, module in _REQUIRED)
    optional = []
    for index, (name, module, serves, remedy) in enumerate(_OPTIONAL):
        version = _version(name) if importlib.util.find_spec(module) is not None else None
        if version is None:
            optional.append(Part(name, None, serves, remedy))
            continue
        yield Phase(f"importing {name}", index, len(_OPTIONAL) + 1)
        broken = import_fails(module, most)
        optional.append(Part(name, version, serves, remedy if broken else "", broken))
    for name, serves, remedy in _PROGRAMS:
        program = shutil.which(name)
        optional.append(Part(name, program, serves, "" if program else remedy))
    seconds: float | None = None
    failed: str | None = None
    if all(part.works for part in required):
        yield Phase("solving a small problem", len(_OPTIONAL), len(_OPTIONAL) + 1)
        seconds, failed = _tried()
    threads = _threads()
    return Diagnosis(
        version=__version__,
        python=platform.python_version(),
        system=system(),
        cores=cores(),
        memory=available_bytes(),
        required=required,
        optional=tuple(optional),
        threads=threads,
        kernels=None if kernels() is None else kernel_threads(),
        seconds=seconds,
        failed=failed,
        remarks=_remarks(required, tuple(optional), threads, cores(), failed),
    )


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _absent(package: str, module: str) -> tuple[str, str | None]:
    """Remedy and complaint of a required package."""
    if _version(package) is None:
        return f"pip install {package}", None
    missing = importlib.util.find_spec(module) is None
    return (f"pip install --force-reinstall {package}", f"module {module} cannot be found") if missing else ("", None)


def _threads() -> tuple[tuple[str, int], ...]:
    with IMPORTS:
        from threadpoolctl import threadpool_info

    return tuple(
        (f"{pool.get('internal_api', '?')} {pool.get('version') or ''}".strip(), int(pool["num_threads"]))
        for pool in threadpool_info()
        if pool.get("user_api") == "blas"
    )


def _tried() -> tuple[float | None, str | None]:
    """Seconds to solve and certify the survey's body, or why that fails."""
    with IMPORTS:
        from hemivar.certificates import certify
        from hemivar.gallery import survey
        from hemivar.solvers import Status, solve
        from hemivar.solvers.status import check_interrupt

    before = time.perf_counter()
    try:
        solution = solve(survey("5.1", 16))
        check_interrupt(solution.status)
        certificate = certify(solution)
    except Exception as error:
        return None, f"{type(error).__name__}: {error}"
    if solution.status is not Status.CONVERGED or not certificate.unique:
        return None, f"a problem with exactly one solution ended as {solution.status.value}, {certificate.unique=}"
    return time.perf_counter() - before, None


def _remarks(
    required: tuple[Part, ...],
    optional: tuple[Part, ...],
    threads: tuple[tuple[str, int], ...],
    available: int,
    failed: str | None,
) -> tuple[str, ...]:
    remarks = [f"{part.name} is missing or broken; {part.remedy}" for part in required if not part.works]
    if failed is not None:
        remarks.append(f"a small problem cannot be solved ({failed}); please report it with all of this")
    remarks += [f"{part.name} is there but cannot be used ({part.broken})" for part in optional if part.broken]
    for library, count in threads:
        if count > available:
            remarks.append(f"{library} takes {count} threads on {available} cores; set OMP_NUM_THREADS={available}")
    names = {part.name: part for part in optional}
    if names["petsc4py"].works != names["mpi4py"].works:
        lacking = "mpi4py" if names["petsc4py"].works else "petsc4py"
        remarks.append(f"the engine for clusters needs {lacking} too; see docs/distributed.md")
    return tuple(remarks)
