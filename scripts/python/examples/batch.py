"""Runs programs one after the other and keeps a summary of each: batch.py FOLDER PROGRAM…

Ends at the first that is refused or does not come to its end, with exit status 1.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from tandem_client import Client, Refused


def main(folder: Path, programs: list[Path]) -> int:
    """Runs the programs; summaries lie in ``folder``, each called after its program."""
    folder.mkdir(parents=True, exist_ok=True)
    with Client() as machine:
        for program in programs:
            try:
                job = machine.run(program.read_text(), program.name)
            except Refused as refused:
                print(refused, file=sys.stderr)
                return 1
            (folder / f"{program.stem}.json").write_text(json.dumps(job.summary, indent=1))
            print(f"{program.name}: {job.outcome}, {job.summary['motion_time_s']:.3f} s")
            if not job.is_done:
                print(job.fault or "it was aborted", file=sys.stderr)
                return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]]))
