"""Frames of an evolution as files of ParaView: a PVD with a VTU for every frame, written while it is computed."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from hemivar.basics.disk import make_folder, remove_file, try_output, write_text
from hemivar.errors import FileError
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.history import Frame, History
from hemivar.files.record import prepared
from hemivar.files.snapshot import snapshot
from hemivar.files.vtu import write_vtu

__all__ = ["Series", "numbered", "write_pvd"]


class Series:
    """A PVD file that grows: each frame is written whole, then the list of all frames, whole again.

    ``run.pvd`` names the bodies, ``run_contact.pvd`` the contact boundaries; the VTU lie in the folder ``run`` beside
    them and are numbered by the steps of the march, so that frames of a march that goes on fall on their own names.
    """

    def __init__(self, path: str | Path, discrete: DiscreteEvolution) -> None:
        self.path = prepared(path, ".pvd")
        self.discrete = discrete
        self.folder = self._made(self.path.with_suffix(""))
        #: For each step its time and the names of its files.
        self._written: dict[int, tuple[float, tuple[Path, ...]]] = {}

    @property
    def lists(self) -> tuple[Path, ...]:
        """The list of the bodies, and that of the contact boundaries where frames have files of them."""
        both = self.path, self.path.with_name(f"{self.path.stem}_contact.pvd")
        return both[: max((len(files) for _, files in self._written.values()), default=1)]

    def add(self, frames: Iterable[tuple[int, Frame]]) -> None:
        """Write frames, each with the number of its step, and then the lists."""
        for step, frame in frames:
            self._written[step] = frame.time, self._frame(frame, self.folder / f"{self.path.stem}_{step:06d}.vtu")
        self._list()

    def finish(self, frames: Iterable[tuple[int, Frame]]) -> tuple[Path, ...]:
        """Let the lists name exactly these frames; writes those that are missing, and removes the others in the folder.

        Returned: the lists.
        """
        kept = dict(frames)
        missing = [(step, frame) for step, frame in kept.items() if step not in self._written]
        self._written = {step: entry for step, entry in self._written.items() if step in kept}
        self.add(missing)
        self._clear({name for _, files in self._written.values() for file in files for name in self._parts(file)})
        return self.lists

    # ---- what is different where many processes write ------------------------------------------------------------

    def _made(self, folder: Path) -> Path:
        return make_folder(folder)

    def _frame(self, frame: Frame, path: Path) -> tuple[Path, ...]:
        """Write a frame; the files that the lists name.  A pipe of that name, which may have no reader, is refused."""
        try_output(path)
        return tuple(file for file in write_vtu(snapshot(self.discrete, frame), path) if file is not None)

    def _parts(self, file: Path) -> list[str]:
        """Names of the files that one consists of."""
        return [file.name]

    def _clear(self, named: set[str]) -> None:
        """Remove frames, and pieces of frames, but those that are named."""
        stem = re.escape(self.path.stem)
        own = re.compile(stem + r"_\d{6,}(_contact)?(_\d+)?\.p?vtu")
        unfinished = re.compile(
            r"\." + stem + r"_\d{6,}(_contact)?(_\d+)?-[0-9a-f]{12}\.p?vtu"
        )  # by one that was killed
        for file in self.folder.iterdir():
            if unfinished.fullmatch(file.name) or (own.fullmatch(file.name) and file.name not in named):
                with contextlib.suppress(FileError):  # one that was read stays
                    remove_file(file)

    def _list(self) -> None:
        for number, path in enumerate(self.lists):
            lines = [
                f'<DataSet timestep="{time!r}" group="" part="0" '
                f"file={quoteattr(f'{self.folder.name}/{files[number].name}')}/>"
                for _, (time, files) in sorted(self._written.items())
            ]
            write_text(
                path,
                '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
                "<Collection>\n" + "".join(f"{line}\n" for line in lines) + "</Collection>\n</VTKFile>\n",
            )


def numbered(history: History) -> list[tuple[int, Frame]]:
    """The frames of a history, each with the number of its step."""
    times = history.times
    return [(int(np.searchsorted(times, frame.time)), frame) for frame in history.frames]


def write_pvd(history: History, path: str | Path) -> tuple[Path, ...]:
    """Write the frames of a history as a PVD with VTU files, see :class:`Series`; returns the lists."""
    return Series(path, history.discrete).finish(numbered(history))
