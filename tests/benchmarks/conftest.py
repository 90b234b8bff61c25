"""The benchmarks of this folder run only when asked for: `pytest tests/benchmarks --benchmark-only`."""
from pathlib import Path

import pytest

HERE = Path(__file__).parent


def pytest_collection_modifyitems(config, items):
    """Skip them in a run of all tests."""
    if not config.getoption("--benchmark-only", default=False):
        mark = pytest.mark.skip(reason="benchmarks run with --benchmark-only")
        for item in items:
            if HERE in item.path.parents:
                item.add_marker(mark)


def pytest_terminal_summary(terminalreporter):
    """The nanoseconds that the benchmarks worked out."""
    for report in terminalreporter.stats.get("passed", ()):
        for unit, figure in report.user_properties:
            if unit.startswith("ns "):
                terminalreporter.write_line(f"{figure:10.1f} {unit}   {report.nodeid.rpartition('::')[2]}")
