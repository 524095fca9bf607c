"""Compiles the C sources for every platform and packs the FMU; the same sources give the same bytes."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

from ..read.syntax import ExportError
from .description import GUID_MARK

RUNTIME = Path(__file__).parent.parent / "runtime"


_HEADERS = ("model.h", "instance.h", "step.h")


_COMMON = ("events.c", "lines.c", "integrate.c", "cosimulation.c", "instance.c")


_WARNINGS = (
    "-Wall",
    "-Wextra",
    "-Werror",
    "-Wno-parentheses-equality",
    "-Wno-unused",
    "-Wno-unused-parameter",
    "-Wno-type-limits",
)


# No fused multiply-adds (-ffp-contract=off): they round differently, so results would depend on the platform.
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden", "-shared", "-s")


@dataclass(frozen=True, slots=True)
class Platform:
    """Folder, file suffix and compiler target of one platform's binary."""

    folder2: str
    folder3: str
    suffix: str
    target: str
    extra: tuple[str, ...] = ()


PLATFORMS = {
    "linux64": Platform("linux64", "x86_64-linux", ".so", "x86_64-linux-gnu.2.17", ("-fPIC", "-lm")),
    "win64": Platform("win64", "x86_64-windows", ".dll", "x86_64-windows-gnu"),
    "darwin64": Platform("darwin64", "x86_64-darwin", ".dylib", "x86_64-macos.11.0", ("-fPIC",)),
}


@dataclass(frozen=True, slots=True)
class Contents:
    """The parts of an FMU before compilation."""

    identifier: str
    version: int
    description: str
    model_c: str
    sizes_h: str
    implicit: bool

    @property
    def c_files(self) -> list[str]:
        """The names of the files to compile."""
        return c_files(self.version)

    def sources(self) -> dict[str, str]:
        """Return all C files by name."""
        method = "implicit.h" if self.implicit else "explicit.h"
        names = (*_HEADERS, method, *(name for name in self.c_files if name != "model.c"))
        files = {name: (RUNTIME / name).read_text(encoding="utf-8") for name in names}
        return files | {"model.c": self.model_c, "sizes.h": self.sizes_h}

    def guid(self) -> str:
        """Return an identifier that depends only on the contents."""
        digest = hashlib.sha256(self.description.encode())
        for name, text in sorted(self.sources().items()):
            digest.update(f"\0{name}\0{text}".encode())
        h = digest.hexdigest()
        return f"{{{h[:8]}-{h[8:12]}-{h[12:16]}-{h[16:20]}-{h[20:32]}}}"


def c_files(version: int) -> list[str]:
    """Return the names of the files to compile."""
    return sorted(["model.c", *_COMMON, f"fmi{version}.c"])


def build(contents: Contents, target: Path, platforms: tuple[str, ...]) -> None:
    """Compile and write the FMU.

    Args:
        contents: description and sources.
        target: the .fmu file to write.
        platforms: names from PLATFORMS.
    """
    guid = contents.guid()
    files = contents.sources()
    files["model.c"] += f'\nconst char model_guid[] = "{guid}";\n'
    entries: dict[str, bytes] = {
        "modelDescription.xml": contents.description.replace(GUID_MARK, guid).encode()
    }
    entries |= {f"sources/{name}": text.encode() for name, text in files.items()}
    if contents.version == 3:
        entries["sources/buildDescription.xml"] = _build_description(contents).encode()
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        for name, text in files.items():
            (work / name).write_text(text, encoding="utf-8")
        for name in platforms:
            platform = PLATFORMS[name]
            place = platform.folder2 if contents.version == 2 else platform.folder3
            binary = _compile(contents, work, platform)
            entries[f"binaries/{place}/{binary.name}"] = binary.read_bytes()
    target.parent.mkdir(parents=True, exist_ok=True)
    _pack(entries, target)


def _compile(contents: Contents, work: Path, platform: Platform) -> Path:
    binary = work / (contents.identifier + platform.suffix)
    command = [sys.executable, "-m", "ziglang", "cc", "-target", platform.target, *_FLAGS]
    command += [*_WARNINGS, *contents.c_files, "-o", binary.name, *platform.extra]
    done = subprocess.run(command, cwd=work, capture_output=True, text=True, check=False)
    if done.returncode or not binary.is_file():
        keep = Path(tempfile.mkdtemp(prefix="export-failed-"))
        shutil.copytree(work, keep, dirs_exist_ok=True)
        raise ExportError(
            None, f"the C compiler failed for {platform.target} (sources kept in {keep}):\n{done.stderr}"
        )
    return binary


def _build_description(contents: Contents) -> str:
    files = "\n".join(f'      <SourceFile name="{name}"/>' for name in contents.c_files)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="{contents.identifier}">
    <SourceFileSet language="C99">
{files}
    </SourceFileSet>
  </BuildConfiguration>
</fmiBuildDescription>
"""


def _pack(entries: dict[str, bytes], target: Path) -> None:
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name in sorted(entries, key=lambda n: (n != "modelDescription.xml", n)):
            # A fixed date and fixed attributes: the archive depends only on its contents.
            info = zipfile.ZipInfo(name, (2000, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            info.create_system = 3
            archive.writestr(info, entries[name])
