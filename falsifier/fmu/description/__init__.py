"""What FMUs say of themselves, and what is in their files, without loading anything."""

from falsifier.fmu.description.archive import UNREADABLE, file_hash, open_archive
from falsifier.fmu.description.dependencies import inputs_of_outputs
from falsifier.fmu.description.libraries import misnamed_text, missing_binary_text
from falsifier.fmu.description.model_description import Description, describe, read_description, read_info
from falsifier.fmu.description.needs import binary_remarks
from falsifier.fmu.description.remarks import needed_tool_text
from falsifier.fmu.description.slot import Slot
from falsifier.fmu.description.structure import Structure, read_structure
from falsifier.fmu.description.units import Unit, Units, conversion, is_known, read_units
from falsifier.fmu.description.xml import read_xml

__all__ = [
    "UNREADABLE",
    "Description",
    "Slot",
    "Structure",
    "Unit",
    "Units",
    "binary_remarks",
    "conversion",
    "describe",
    "file_hash",
    "inputs_of_outputs",
    "is_known",
    "misnamed_text",
    "missing_binary_text",
    "needed_tool_text",
    "open_archive",
    "read_description",
    "read_info",
    "read_structure",
    "read_units",
    "read_xml",
]
