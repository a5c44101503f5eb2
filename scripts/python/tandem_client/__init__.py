"""A client of the CNC motion controller Tandem.

>>> with Client() as machine:                       # doctest: +SKIP
...     machine.home()
...     machine.mdi("G0 X10")
...     print(machine.run(Path("part.ngc").read_text()).summary["motion_time_s"])
"""

from .client import Client, Gone, Job, Refused, find_controller

__all__ = ["Client", "Gone", "Job", "Refused", "find_controller"]
