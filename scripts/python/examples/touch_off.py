"""Finds the top of a workpiece with a probe and makes it Z0 of a coordinate system: touch_off.py [G54 [PLATE_MM]]

The probe goes down at most 50 mm from where it stands, once fast and once slowly; PLATE_MM is the height of a touch plate.
"""

from __future__ import annotations

import sys

from tandem_client import Client, Refused

REACH_MM = 50.0
"""How far the probe looks for the workpiece."""


def main(system: str = "G54", plate_mm: float = 0.0) -> int:
    """Probes, and touches off; exit status 1 where nothing is found."""
    with Client() as machine:
        try:
            # Fast, then back and onto it slowly: what is caught then does not depend on how far the machine needs to stop.
            # A line behind a probe is judged with what the probe has found, so each probe is waited for.
            for lines in ([system, f"G21 G91 G38.2 Z-{REACH_MM} F300"], ["G0 Z2", "G38.2 Z-4 F30"]):
                job = machine.mdi(*lines)
                if not job.is_done:
                    print(job.fault or "it was aborted", file=sys.stderr)
                    return 1
            # The place where the machine stands is called its distance from the surface.
            machine.mdi(f"G10 L20 P0 Z[#5422 - #5063 + {plate_mm}]", "G0 Z5", "G90")
        except Refused as refused:
            print(refused, file=sys.stderr)
            return 1
        print(f"{system} Z0 is {plate_mm:g} mm below where the probe touched")
    return 0


if __name__ == "__main__":
    system, plate = [*sys.argv[1:], *["G54", "0"][len(sys.argv) - 1 :]]
    sys.exit(main(system, float(plate)))
