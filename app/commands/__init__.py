"""The commands of the command line: one file each. Listed once, here.

A command has NAME, HELP in one line, `arguments(parser)` and `run(args, parser) -> exit code`. None of them imports Qt, but for the plots
of the reports where it is there.
"""
from app.commands import bench, check, convergence, plan, render, stability, warm

COMMANDS = (render, plan, convergence, stability, bench, check, warm)
