"""The one reader and the one writer of files."""

from __future__ import annotations

import fcntl
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from hemivar.basics import disk
from hemivar.errors import FileError


@pytest.mark.parametrize("name", ["", " ", None])
def test_a_file_has_a_name(name: str) -> None:
    with pytest.raises(FileError, match=f"the name of a file is {name!r}; give its path"):
        disk.path_of(name)


def test_what_fails_leaves_the_old_file_and_nothing_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")

    def fail() -> None:
        with disk.whole_file(path) as name:
            name.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.json"]


def test_what_killed_processes_left_is_removed_and_nothing_else(tmp_path: Path) -> None:
    """Leftovers of the same file, of regular files that are old and that no process has locked."""
    path = tmp_path / "a.json"
    left = tmp_path / f".a-{'0' * 12}.json"
    others = [".a-0.json", f".a-{'0' * 13}.json", f".a-{'G' * 12}.json", f"a-{'0' * 12}.json", f".b-{'0' * 12}.json"]
    for name in (left.name, *others, f".a-{'3' * 12}.json", f".a-{'4' * 12}.json"):
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (0, 0))
    os.utime(tmp_path / f".a-{'3' * 12}.json")  # young
    (tmp_path / f".a-{'1' * 12}.json").mkdir()
    (tmp_path / f".a-{'2' * 12}.json").symlink_to(tmp_path / "target")
    os.mkfifo(tmp_path / f".a-{'5' * 12}.json")
    before = set(os.listdir(tmp_path))
    code = (
        "import os, sys\nfrom pathlib import Path\nfrom hemivar.basics import disk\n"
        "with disk.whole_file(sys.argv[1]) as name:\n os.utime(name, (0, 0)); print(flush=True); sys.stdin.read()"
    )
    with open(tmp_path / f".a-{'4' * 12}.json") as locked:
        fcntl.flock(locked, fcntl.LOCK_EX)
        with subprocess.Popen([sys.executable, "-c", code, path], stdin=-1, stdout=-1) as process:
            assert process.stdout is not None
            process.stdout.readline()
            (living,) = set(os.listdir(tmp_path)) - before
            disk.write_text(path, "new")
            assert set(os.listdir(tmp_path)) == before - {left.name} | {path.name, living}
            process.kill()
        disk.write_text(path, "new")
    assert set(os.listdir(tmp_path)) == before - {left.name} | {path.name}


def test_a_disk_error_is_told_though_another_hides_it(tmp_path: Path) -> None:
    def stumble() -> None:
        with disk.whole_file(tmp_path / "a"):
            try:
                raise OSError(28, "No space left on device")
            finally:
                raise AttributeError("pos")

    def elsewhere() -> None:
        try:
            raise OSError(28, "No space left on device")
        except OSError:
            with disk.whole_file(tmp_path / "a"):
                raise AttributeError("pos") from None

    with pytest.raises(FileError, match="no space left on device"):
        stumble()
    with pytest.raises(AttributeError):
        elsewhere()
    assert os.listdir(tmp_path) == []


def test_trying_an_output_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "old").write_text("old")
    os.mkfifo(tmp_path / "pipe")
    before = sorted(os.listdir(tmp_path))
    disk.try_output(tmp_path / "new")
    disk.try_output(tmp_path / "old")
    for name in ("nowhere/a", "a\0b", ".", "pipe", 300 * "a"):
        with pytest.raises(FileError, match="cannot write"):
            disk.try_output(tmp_path / name)
    assert sorted(os.listdir(tmp_path)) == before
    assert (tmp_path / "old").read_text() == "old"


def test_long_names_can_be_written(tmp_path: Path) -> None:
    name = 80 * "\u4e2d" + ".json"  # 245 bytes
    disk.write_text(tmp_path / name, "text")
    assert os.listdir(tmp_path) == [name]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_protected_file_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("old")
    (tmp_path / "kept").chmod(0o400)
    with pytest.raises(FileError, match="write-protected"):
        disk.write_text(tmp_path / "kept", "new")


def test_files_read_are_noted(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("a")
    disk.read_text(tmp_path / "a")
    with disk.noting_files_read() as files:
        disk.read_text(tmp_path / "a")
        with pytest.raises(FileError):
            disk.read_text(tmp_path / "nowhere")
    disk.read_text(tmp_path / "a")
    assert files == [tmp_path / "a"]


def test_size_limit_names_the_file_and_keeps_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")
    code = (
        "import resource, signal, sys; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "from hemivar.basics import disk\n"
        "try: disk.write_text(sys.argv[1], 'x' * 5000)\n"
        "except Exception as error: print(type(error).__name__, error)"
    )
    assert resource.RLIMIT_FSIZE is not None
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert done.stdout.startswith(f"FileError cannot write {path}: ")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.json"]


def test_links_are_followed_and_permissions_kept(tmp_path: Path) -> None:
    target, link = tmp_path / "target.txt", tmp_path / "link.txt"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    disk.write_text(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert target.stat().st_mode & 0o777 == 0o640


def test_a_new_file_obeys_the_umask(tmp_path: Path) -> None:
    old = os.umask(0o027)
    try:
        disk.write_text(tmp_path / "a", "text")
    finally:
        os.umask(old)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o640


def test_what_cannot_be_replaced_is_written_to(tmp_path: Path) -> None:
    disk.write_text("/dev/null", "text")
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE, text=True)
    disk.write_text(pipe, "text")
    assert reader.communicate(timeout=10)[0] == "text"


@pytest.mark.parametrize("name", ["nowhere/a.txt", "a\0b", "loop", "."])
def test_names_that_cannot_be_written(tmp_path: Path, name: str) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(FileError, match="cannot write"):
        disk.write_text(tmp_path / name, "text")


@pytest.mark.parametrize("name", ["nowhere", "a\0b", "loop", ".", "pipe"])
def test_names_that_cannot_be_read(tmp_path: Path, name: str) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileError, match="cannot read law table"):
        disk.read_text(tmp_path / name, "law table")


def test_devices_sizes_and_encodings_are_looked_at_first(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="not a regular file"):
        disk.read_text("/dev/zero")
    (tmp_path / "a").write_bytes(b"\xff11")
    with pytest.raises(FileError, match="not UTF-8"):
        disk.read_text(tmp_path / "a")
    with pytest.raises(FileError, match="at most 0 MiB"):
        disk.read_text(tmp_path / "a", most_bytes=2)
    (tmp_path / "b").write_bytes("\ufeffa\r\nb".encode())
    assert disk.read_text(tmp_path / "b") == "a\nb"


def test_reading_takes_the_memory_of_the_file_not_of_the_limit(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("1,2\n")
    code = (
        "import resource, sys\n"
        "from hemivar.basics import disk\n"
        "resource.setrlimit(resource.RLIMIT_AS, (2**29, 2**29))\n"
        "print(disk.read_text(sys.argv[1], most_bytes=2**36))"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path / "a")], capture_output=True, text=True, check=True)
    assert done.stdout == "1,2\n\n"


def test_one_file_by_two_names(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    assert disk.same_file(tmp_path / "a", tmp_path / "b")
    assert disk.same_file(tmp_path / "new", tmp_path / "." / "new")
    assert not disk.same_file(tmp_path / "a", tmp_path / "new")
