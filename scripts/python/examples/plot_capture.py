"""Captures signals of every fine period while a line is driven, and draws them: plot_capture.py OUT.svg LINE SIGNAL…

As in: plot_capture.py x.svg "G91 G0 X10" x_cmd_mm x_following_mm
"""

from __future__ import annotations

import sys
from pathlib import Path
from xml.sax.saxutils import escape

from tandem_client import Client, Refused

WIDTH, HEIGHT, EDGE = 900, 160, 30
"""Of each signal's plot, and around it, pixels."""


def svg(names: list[str], ticks_s: list[float], rows: list[list[float]]) -> str:
    """A plot of each signal over time, one below the other."""
    parts = []
    for at, name in enumerate(names):
        values = [row[at] for row in rows]
        low, high = min(values), max(values)
        across = WIDTH / max(ticks_s[-1] - ticks_s[0], 1e-9)
        up = HEIGHT / (high - low if high > low else 1.0)
        top = EDGE + at * (HEIGHT + 2 * EDGE)
        points = " ".join(
            f"{EDGE + (t - ticks_s[0]) * across:.2f},{top + HEIGHT - (value - low) * up:.2f}"
            for t, value in zip(ticks_s, values)
        )
        text = f"{escape(name)}  {low:g} to {high:g}, {ticks_s[0]:g} s to {ticks_s[-1]:g} s"
        parts.append(f'<text x="{EDGE}" y="{top - 8}" font-family="sans-serif" font-size="13">{text}</text>')
        parts.append(f'<polyline fill="none" stroke="#0b5" points="{points}"/>')
    height = len(names) * (HEIGHT + 2 * EDGE)
    size = f'width="{WIDTH + 2 * EDGE}" height="{height}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{"".join(parts)}</svg>\n'


def main(out: Path, line: str, names: list[str]) -> int:
    """Drives the line, and writes the plot; exit status 1 where either comes to nothing."""
    with Client() as machine:
        try:
            period_s = machine.request("capture", signals=names, after_s=60.0)["period_s"]
            job = machine.mdi(line)
            rows = machine.captured()
        except Refused as refused:
            print(refused, file=sys.stderr)
            return 1
    if not rows:
        print("nothing was driven", file=sys.stderr)
        return 1
    out.write_text(svg(names, [at * period_s for at in range(len(rows))], rows))
    print(f"{out}: {len(rows)} samples of {', '.join(names)}; {job.outcome}")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2], sys.argv[3:]))
