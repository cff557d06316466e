"""Results of a run over ranks as files: the JSON of the serial run, and VTU in pieces."""

from __future__ import annotations

import itertools
import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hemivar.basics.disk import make_folder, shown, try_output, whole_file
from hemivar.basics.rows import plain
from hemivar.basics.types import Array, IntArray
from hemivar.certificates import Certificate
from hemivar.errors import FileError
from hemivar.evolution.history import Frame
from hemivar.files.record import laid_out, prepared, result_record
from hemivar.files.series import Series
from hemivar.files.snapshot import Snapshot, snapshot
from hemivar.files.vtu import (
    WHOLE,
    body_fields,
    contact_quantities,
    field_data,
    region_numbers,
    three_components,
    write_grid,
)
from hemivar.ranks.body_on_ranks import BodyOnRanks, body_of
from hemivar.ranks.evolution import EvolutionOnRanks
from hemivar.ranks.files import one_writer
from hemivar.ranks.ranks import Ranks
from hemivar.solvers import Solution

__all__ = ["SeriesOnRanks", "pieces_of", "write_json_on_ranks", "write_vtu_on_ranks"]

#: Nodes that the first rank has at a time: 4 MiB of numbers.
_NODES_AT_A_TIME = 1 << 17


def write_json_on_ranks(
    solution: Solution,
    path: str | Path,
    certificate: Certificate | None,
    more: Mapping[str, object] | None = None,
) -> Path:
    """Write the record of :func:`hemivar.files.solution_record`, and ``more``; all ranks call this, rank 0 writes.

    Contact points and nodes are in the order of the serial run; reactions of supports are not known here, and null.
    Rank 0 holds the contact points, and the displacements portion by portion.
    """
    body = body_of(solution.problem)
    path, ranks = Path(path), body.ranks
    record = result_record(solution, certificate) | {"unknowns": body.unknowns}
    record["contact"] = _gathered(solution, record["contact"])  # type: ignore[arg-type]
    record |= {key: plain(value) for key, value in ({} if more is None else more).items()}
    owned = body.piece.owned(ranks)
    numbers, values = body.piece.numbers[owned], solution.displacement[owned]
    order = np.argsort(numbers)
    numbers, values = numbers[order], values[order]
    ranks.agree(lambda: None if ranks.rank else prepared(path, ".json"))
    with one_writer(ranks, path) as target:
        if target.open:
            target.write(f'{laid_out(record)[:-2]},\n "displacement": [')
        for start in range(0, body.piece.total, _NODES_AT_A_TIME):
            part = slice(*np.searchsorted(numbers, [start, start + _NODES_AT_A_TIME]))
            received, _, _ = ranks.exchange(
                np.zeros(part.stop - part.start, dtype=np.int64), np.column_stack([numbers[part], values[part]])
            )
            if target.open:
                received = received[np.argsort(received[:, 0]), 1:]
                target.write((", " if start else "") + json.dumps(plain(received), allow_nan=False)[1:-1])
        target.write("]\n}\n")
    return path


def _gathered(solution: Solution, columns: dict[str, list[object]]) -> dict[str, list[object]]:
    """Columns of the contact points of all ranks in the order of the serial run, on rank 0; those of the rank
    elsewhere."""
    body, contact = body_of(solution.problem), solution.contact
    gathered = body.ranks.mpi.gather((contact.boundary, body.piece.numbers[contact.node], columns))
    if gathered is None:
        return columns
    boundary, number = (np.concatenate([part[k] for part in gathered]) for k in range(2))
    order = np.lexsort((number, boundary)).tolist()
    rows = {name: list(itertools.chain.from_iterable(part[2][name] for part in gathered)) for name in columns}
    return {name: [values[k] for k in order] for name, values in rows.items()}


# ---- VTU -----------------------------------------------------------------------------------------------------


def write_vtu_on_ranks(solution: Solution, path: str | Path) -> list[Path]:
    """Write each rank's cells as a VTU file of its own, ``NAME_RANK.vtu``, and ``NAME.pvtu`` that names them.

    Fields are those of :func:`hemivar.files.write_vtu`; the contact boundaries are in ``NAME_contact.pvtu``.
    Old files are replaced once all new ones are written, the ``.pvtu`` files last.

    Returned: the ``.pvtu`` files.
    """
    return _write_pieces(body_of(solution.problem), Path(path), solution)


def _write_pieces(body: BodyOnRanks, path: Path, seen: Solution | Snapshot) -> list[Path]:
    """Write the piece of each rank; the ``.pvtu`` files."""
    ranks, mesh = body.ranks, body.piece.mesh
    fields, cell_fields = _fields(body, seen)
    kind = {2: "triangle", 3: "tetra"}[mesh.dim]
    whole = field_data(seen)
    grids = [_Grid("", three_components(mesh.points), {kind: mesh.cells}, fields, cell_fields, whole)]
    names = list(body.statement.contact)
    if names:
        facets = [mesh.boundaries[name] for name in names]
        number = np.concatenate([np.full(len(f), k, dtype=np.int32) for k, f in enumerate(facets)])
        used, row = np.unique(np.concatenate(facets).ravel(), return_inverse=True)
        chosen = {name: values[used] for name, values in fields.items() if name not in ("stress", "velocity")}
        cells = {{2: "line", 3: "triangle"}[mesh.dim]: row.reshape(-1, mesh.dim)}
        grids.append(_Grid("_contact", three_components(mesh.points[used]), cells, chosen, {"boundary": number}, whole))
    here = ranks.mpi.allgather([grid.count > 0 for grid in grids])
    with ExitStack() as pieces, ExitStack() as indices:
        # the stacks rename what was written when they end well: pieces first
        ranks.agree(lambda: _write_all(path, grids, here, ranks, pieces, indices))
        with _alone(path.parent) if ranks.rank == 0 else nullcontext():
            ranks.mpi.Barrier()
            ranks.agree(pieces.close)
            ranks.agree(indices.close)
    return [path.with_name(f"{path.stem}{grid.suffix}.pvtu") for grid in grids]


def pieces_of(path: Path, ranks: int) -> list[Path]:
    """All files that :func:`write_vtu_on_ranks` may write."""
    digits = len(str(ranks - 1))
    names = [f"{path.stem}{suffix}" for suffix in ("", "_contact")]
    pieces = [f"{name}_{rank:0{digits}d}.vtu" for name in names for rank in range(ranks)]
    return [path.with_name(name) for name in (*pieces, *(f"{name}.pvtu" for name in names))]


@dataclass(frozen=True, eq=False)
class _Grid:
    """Cells of this rank and what is known on them."""

    suffix: str
    points: Array
    cells: dict[str, IntArray]
    point_data: dict[str, Array]
    cell_data: dict[str, Array]
    field_data: dict[str, float]

    @property
    def count(self) -> int:
        return sum(map(len, self.cells.values()))


def _write_all(
    path: Path, grids: list[_Grid], here: list[list[bool]], ranks: Ranks, pieces: ExitStack, indices: ExitStack
) -> None:
    """Write this rank's pieces, and the files that name those of all, under names that are not theirs yet."""
    digits = len(str(ranks.size - 1))
    for number, grid in enumerate(grids):
        name = f"{path.stem}{grid.suffix}"
        files = [f"{name}_{rank:0{digits}d}.vtu" for rank in range(ranks.size) if here[rank][number]]
        own, index = path.with_name(f"{name}_{ranks.rank:0{digits}d}.vtu"), path.with_name(f"{name}.pvtu")
        if here[ranks.rank][number]:
            with _naming(own):
                there = pieces.enter_context(whole_file(own))
                write_grid(there, grid.points, grid.cells, grid.point_data, grid.cell_data, grid.field_data)
        if files and ranks.rank == [rank[number] for rank in here].index(True):
            with _naming(index):
                there = indices.enter_context(whole_file(index))
                there.write_text(_parallel_file(files, grid.point_data, grid.cell_data), encoding="utf-8")


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Errors name the file that is to be, not the one that is written for the time being."""
    try:
        yield
    except (OSError, FileError) as error:
        cause = error if isinstance(error, OSError) else error.__cause__
        reason = (getattr(cause, "strerror", None) or str(cause or error)).lower()
        raise FileError(f"cannot write {shown(path)}: {reason}") from error


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Let no other run rename its pieces into a folder at the same time, as far as the file system knows locks."""
    descriptor: int | None = None
    with suppress(ImportError, OSError):
        import fcntl

        descriptor = os.open(folder, os.O_RDONLY)
        for _ in range(50):
            with suppress(BlockingIOError):
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            time.sleep(0.1)
    try:
        yield
    finally:
        if descriptor is not None:
            os.close(descriptor)


def _fields(body: BodyOnRanks, seen: Solution | Snapshot) -> tuple[dict[str, Array], dict[str, Array]]:
    """Point and cell data of this rank's piece, as in the serial file."""
    ranks, piece, nodes = body.ranks, body.piece, body.piece.mesh.number_of_nodes
    point_data, cell_data = body_fields(seen, lambda values: piece.summed(ranks, values))
    cell_data = {"region": region_numbers(piece.mesh), **cell_data}
    if not body.statement.contact:
        return point_data, cell_data
    contact, quantities = seen.contact, contact_quantities(seen)
    columns = {name: values[:, None] if values.ndim == 1 else values for name, (values, _) in quantities.items()}
    table = np.hstack([np.full((nodes, columns[name].shape[1]), fill) for name, (_, fill) in quantities.items()])
    # a node of two contact boundaries carries the values of the first
    order = np.argsort(-contact.boundary, kind="stable")
    table[contact.node[order]] = np.hstack(list(columns.values()))[order]
    table = piece.of_owners(ranks, table)
    ends = np.cumsum([values.shape[1] for values in columns.values()])[:-1]
    for (name, (values, _)), part in zip(quantities.items(), np.split(table, ends, axis=1), strict=True):
        point_data[name] = part[:, 0] if values.ndim == 1 else part
    return point_data, cell_data


def _parallel_file(files: list[str], point_data: dict[str, Array], cell_data: dict[str, Array]) -> str:
    """The XML of a .pvtu file."""
    lines = ['<?xml version="1.0"?>', '<VTKFile type="PUnstructuredGrid" version="0.1" byte_order="LittleEndian">']
    lines.append('<PUnstructuredGrid GhostLevel="0">')
    for tag, data in (("PPointData", point_data), ("PCellData", cell_data)):
        lines.append(f"<{tag}>")
        for name, values in data.items():
            kind = "Int32" if name in WHOLE or values.dtype == np.int32 else "Float64"
            lines.append(f'<PDataArray type="{kind}" Name="{name}" NumberOfComponents="{_components(values)}"/>')
        lines.append(f"</{tag}>")
    lines.append('<PPoints><PDataArray type="Float64" Name="Points" NumberOfComponents="3"/></PPoints>')
    lines += [f'<Piece Source="{file}"/>' for file in files]
    return "\n".join([*lines, "</PUnstructuredGrid>", "</VTKFile>", ""])


def _components(values: Array) -> int:
    return int(values.shape[1]) if values.ndim == 2 else 1


# ---- frames of an evolution --------------------------------------------------------------------------------


class SeriesOnRanks(Series):
    """A :class:`hemivar.files.series.Series` that all ranks write together; what fails on one fails on all.

    ``run.pvd`` and ``run_contact.pvd`` name ``run/run_000005.pvtu`` and the like, whose pieces
    ``run/run_000005_RANK.vtu`` hold the cells of one rank.
    """

    discrete: EvolutionOnRanks

    def __init__(self, path: str | Path, discrete: EvolutionOnRanks) -> None:
        self.ranks = discrete.ranks
        super().__init__(path, discrete)

    def _made(self, folder: Path) -> Path:
        ranks = self.ranks
        ranks.agree(lambda: make_folder(folder) if ranks.rank == 0 else None)
        ranks.agree(lambda: try_output(folder / f"{folder.name}_{ranks.rank}.vtu"))
        return folder

    def _frame(self, frame: Frame, path: Path) -> tuple[Path, ...]:
        return tuple(_write_pieces(self.discrete.body, path.with_suffix(".pvtu"), snapshot(self.discrete, frame)))

    def _parts(self, file: Path) -> list[str]:
        return [piece.name for piece in pieces_of(file, self.ranks.size)]

    def _clear(self, named: set[str]) -> None:
        self.ranks.agree(lambda: super(SeriesOnRanks, self)._clear(named) if self.ranks.rank == 0 else None)

    def _list(self) -> None:
        self.ranks.agree(lambda: super(SeriesOnRanks, self)._list() if self.ranks.rank == 0 else None)
