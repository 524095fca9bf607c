"""What FMUs say of themselves, and what is in their files, without loading anything."""

from falsifier.fmu.description.archive import (
    UNREADABLE,
    WINDOWS,
    extract,
    file_hash,
    library_file,
    open_archive,
    this_platform,
)
from falsifier.fmu.description.libraries import (
    HOW_TO_INSTALL,
    find_wine,
    windows_path,
)
from falsifier.fmu.description.model_description import (
    Description,
    describe,
    needed_tool_text,
    read_description,
    read_info,
)
from falsifier.fmu.description.structure import (
    Structure,
    Unit,
    Units,
    conversion,
    is_known,
    read_structure,
    read_units,
)
from falsifier.fmu.description.variables import Slot, is_true
from falsifier.fmu.description.xml import read_xml

__all__ = [
    "HOW_TO_INSTALL",
    "UNREADABLE",
    "WINDOWS",
    "Description",
    "Slot",
    "Structure",
    "Unit",
    "Units",
    "conversion",
    "describe",
    "extract",
    "file_hash",
    "find_wine",
    "is_known",
    "is_true",
    "library_file",
    "needed_tool_text",
    "open_archive",
    "read_description",
    "read_info",
    "read_structure",
    "read_units",
    "read_xml",
    "this_platform",
    "windows_path",
]
