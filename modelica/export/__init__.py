"""Exports a Modelica model as an FMU: parse, flatten, sort, print C, compile with the FMI runtime, pack."""
