"""Frames of an evolution over ranks as files of ParaView: a PVD that names a PVTU, with a piece of every rank, each."""

from __future__ import annotations

from pathlib import Path

from hemivar.basics.disk import make_folder, try_output
from hemivar.engines.petsc.evolution import EvolutionOnRanks
from hemivar.evolution import Frame
from hemivar.files.series import Series
from hemivar.files.snapshot import snapshot
from hemivar.report.on_ranks import pieces_of, write_frame_on_ranks

__all__ = ["SeriesOnRanks"]


class SeriesOnRanks(Series):
    """A :class:`hemivar.files.series.Series` that all ranks write together; what fails on one fails on all.

    ``run.pvd`` and ``run_contact.pvd`` name ``run/run_000005.pvtu`` and the like, whose pieces
    ``run/run_000005_RANK.vtu`` hold the cells of one rank.

    Parameters
    ----------
    path : str or Path
        Ends in ``.pvd``.
    discrete : EvolutionOnRanks

    Raises
    ------
    ProblemError, FileError
        On all ranks: the name does not end in ``.pvd``; the folder cannot be made, or written to.
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
        return tuple(
            write_frame_on_ranks(self.discrete.body, snapshot(self.discrete, frame), path.with_suffix(".pvtu"))
        )

    def _parts(self, file: Path) -> list[str]:
        return [piece.name for piece in pieces_of(file, self.ranks.size)]

    def _clear(self, named: set[str]) -> None:
        self.ranks.agree(lambda: super(SeriesOnRanks, self)._clear(named) if self.ranks.rank == 0 else None)

    def _list(self) -> None:
        self.ranks.agree(lambda: super(SeriesOnRanks, self)._list() if self.ranks.rank == 0 else None)
