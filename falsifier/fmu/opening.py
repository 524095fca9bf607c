"""Unpacking and loading what a worker simulates."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from falsifier.errors import ModelError
from falsifier.fmu.description import archive
from falsifier.fmu.instance import FmuInstance
from falsifier.fmu.library import LogSink
from falsifier.fmu.session import Session
from falsifier.fmu.worker_order import Order


def unpack(order: Order, folder: Path) -> None:
    """Extract the FMU to a folder; the FMUs of a system to its subfolders.

    Two components with the same FMU get a folder each: a library that is loaded from two files has its static
    data twice.

    Raises:
        ModelError: if a file has changed since the model was loaded, or cannot be unpacked.
    """
    if order.network is None:
        _extract(order.path, order.sha256, folder)
        return
    for member in order.network.members:
        _extract(member.path, member.sha256, folder / member.folder)


def extracted(order: Order, root: Path) -> Path:
    """Return the folder below a root to which the FMU or system is extracted; extract it if necessary.

    Raises:
        ModelError: as for ``unpack``.
    """
    folder = root / order.sha256[:16]
    if not folder.is_dir():
        partial = folder.with_suffix(".partial")
        unpack(order, partial)
        partial.rename(folder)
    return folder


def open_session(
    order: Order,
    folder: Path,
    log: LogSink,
    announce: Callable[[int], None] = lambda _: None,
) -> Session:
    """Load what an order asks for from the folder to which it was unpacked.

    Args:
        order: what to load.
        folder: where it was unpacked.
        log: called with each message of an FMU.
        announce: called with the position of each component of a system before it is loaded.

    Raises:
        ModelError: if it cannot be loaded.
    """
    if order.network is not None:
        # Its loops take seconds to compile and are not needed for a single FMU.
        from falsifier.fmu.system_instance import SystemInstance

        return Session(partial(SystemInstance, order.network, folder, log, announce, logging=order.logging))
    return Session(
        partial(FmuInstance, order.description, folder, order.interface, log, logging=order.logging)
    )


def _extract(path: Path, sha256: str, folder: Path) -> None:
    if archive.file_hash(path) != sha256:
        raise ModelError(f"{path}: the file has changed since the model was loaded; load the model again")
    archive.extract(path, folder)
