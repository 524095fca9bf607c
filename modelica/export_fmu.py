# /// script
# requires-python = ">=3.11"
# dependencies = ["pymoca==0.12.0", "antlr4-python3-runtime==4.13.2", "ziglang==0.17.0"]
# ///
"""Export Modelica models as FMUs: `python modelica/export_fmu.py ArchComp.AT --output AT.fmu`."""

import sys

from export.cli import main

if __name__ == "__main__":
    sys.exit(main())
