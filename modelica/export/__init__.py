"""Turns a Modelica model into an FMU: parse, flatten, sort, print C, link with the FMI runtime, pack."""
