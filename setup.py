"""What pyproject.toml cannot say: the README with links that work anywhere, and the compiled kernels.

The kernels are a plain library that Python opens by ctypes.  So one wheel serves every version of Python on a platform,
and where no compiler is found, or compiling fails, the package is pure and does without them.
"""

import re
import tomllib
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ModuleNotFoundError:  # setuptools before 70.1, which builds no wheels of this project, but may read this file
    bdist_wheel = object

HERE = Path(__file__).parent
KERNELS = "src/hemivar/kernels"


def readme() -> str:
    """The README, its relative links made absolute: pictures and pages of the repository that pyproject.toml names."""
    repository = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]["Repository"]
    text = (HERE / "README.md").read_text(encoding="utf-8")
    text = re.sub(r"(!\[[^\]]*\]\()(?!https?:)", rf"\g<1>{repository}/raw/main/", text)
    return re.sub(r"(?<!!)(\[[^\]]*\]\()(?!https?:|#)", rf"\g<1>{repository}/blob/main/", text)


class BuildKernels(build_ext):
    """The library has a name without the version of Python."""

    def get_ext_filename(self, name: str) -> str:
        """``hemivar/kernels/_compiled.kernels.so``, or ``.pyd``: no name of a module, as it is none."""
        suffix = Path(super().get_ext_filename(name)).suffix
        return str(Path(*name.split(".")).with_suffix(f".kernels{suffix}"))

    def build_extension(self, ext: Extension) -> None:
        """With the options of the compiler at hand."""
        if self.compiler.compiler_type == "msvc":
            ext.extra_compile_args = ["/std:c++17", "/O2", "/EHsc", "/fp:precise"]
        else:
            # Sums are not contracted or put into another order: the same bits on every processor of a kind.
            ext.extra_compile_args = [
                "-std=c++17", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden", "-pthread", "-g0",
            ]  # fmt: skip
            ext.extra_link_args = ["-pthread"]
        super().build_extension(ext)


class KernelsWheel(bdist_wheel):
    """For any Python 3 of this platform with the library, for any platform without it."""

    def run(self) -> None:
        """Build first: whether the library is there decides about the name."""
        self.run_command("build")
        built = self.get_finalized_command("build_ext")
        self.root_is_pure = not any(Path(path).is_file() for path in built.get_outputs())
        super().run()

    def get_tag(self) -> tuple[str, str, str]:
        """``py3-none-`` and the platform."""
        return ("py3", "none", "any" if self.root_is_pure else super().get_tag()[2])


kernels = Extension(
    "hemivar.kernels._compiled",
    sources=sorted(f"{KERNELS}/{path.name}" for path in (HERE / KERNELS).glob("*.cpp")),
    depends=sorted(f"{KERNELS}/{path.name}" for path in (HERE / KERNELS).glob("*.hpp")),
    language="c++",
    optional=True,
)

setup(
    long_description=readme(),
    long_description_content_type="text/markdown",
    ext_modules=[kernels],
    cmdclass={"build_ext": BuildKernels, "bdist_wheel": KernelsWheel},
)
