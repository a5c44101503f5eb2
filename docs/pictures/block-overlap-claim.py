#!/usr/bin/env python3
"""What time constants cost and save, from runs: block-overlap-claim.py table|picture NAME=RUN ...

RUN stands for RUN.csv, the trace, and RUN.blocks.csv, the blocks of that run. The first run is the one to compare with.
"""
import csv
import math
import sys

SHARP_DEG, ZOOM_MM, TILE, GAP, TOP, STRIP = 30, 0.8, 250, 14, 30, 74
COLOURS = ["#555555", "#c0392b", "#2471a3", "#1e8449"]


def rows(file):
    with open(file, encoding="utf-8") as lines:
        return list(csv.DictReader(lines))


class Run:
    """A trace, and what it makes of the sharp corners of its program."""

    def __init__(self, name, file):
        samples = rows(file + ".csv")
        self.name = name
        self.points = [(float(row["x_cmd_mm"]), float(row["y_cmd_mm"])) for row in samples]
        self.period_s = float(samples[1]["t_s"]) - float(samples[0]["t_s"])
        # From the last sample at rest to the first one at the end.
        self.ticks = next(i for i, point in enumerate(self.points) if point == self.points[-1])
        self.ticks -= max(i for i, point in enumerate(self.points[: self.ticks]) if point == self.points[0])
        ends = [(float(row["x_end_mm"]), float(row["y_end_mm"])) for row in rows(file + ".blocks.csv")]
        self.path = [self.points[0]] + ends
        self.corners = [at for at in range(1, len(ends)) if self.turn_deg(at) > SHARP_DEG]
        self.errors_um = [1e3 * min(map(self.from_corner(at), self.points)) for at in self.corners]
        self.acceleration = max(map(self.acceleration_at, self.corners))

    def turn_deg(self, at):
        (ax, ay), (bx, by), (cx, cy) = self.path[at - 1 : at + 2]
        before, after = math.atan2(by - ay, bx - ax), math.atan2(cy - by, cx - bx)
        return abs(math.degrees(math.remainder(after - before, math.tau))) if (bx, by) != (cx, cy) else 0

    def from_corner(self, at):
        return lambda point: math.dist(point, self.path[at])

    def acceleration_at(self, at):
        middle = min(range(1, len(self.points) - 1), key=lambda i: math.dist(self.points[i], self.path[at]))
        before, here, after = self.points[middle - 1 : middle + 2]
        return math.hypot(*(a - 2 * b + c for a, b, c in zip(before, here, after))) / self.period_s**2

    def speeds(self):
        return [math.dist(a, b) / self.period_s for a, b in zip(self.points, self.points[1:])]

    def errors(self):
        return ", ".join(f"{error:.1f}" for error in self.errors_um)

    def beside(self, first):
        return f"{self.errors_um[0] / first.errors_um[0]:.3f}", f"{100 * (self.ticks / first.ticks - 1):+.1f} %"


def table(runs):
    print("| time constants | time, periods | beside the first | sharp corners lose, µm | × the first | turning, mm/s² |")
    print("|---|---|---|---|---|---|")
    for run in runs:
        ratio, longer = run.beside(runs[0])
        print(f"| {run.name} | {run.ticks} | {longer} | {run.errors()} | {ratio} | {run.acceleration:.0f} |")


def polyline(points, colour, width, dash=""):
    text = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{text}" fill="none" stroke="{colour}" stroke-width="{width}" stroke-dasharray="{dash}"/>'


def text(x, y, words, colour="#222"):
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}">{words}</text>'


def corner(runs, index, left):
    """A tile around one sharp corner, to scale."""
    center = runs[0].path[runs[0].corners[index]]
    scale = TILE / (2 * ZOOM_MM)
    place = lambda p: (left + TILE / 2 + (p[0] - center[0]) * scale, TOP + TILE / 2 - (p[1] - center[1]) * scale)
    near = lambda points: [place(p) for p in points if math.dist(p, center) < 2 * ZOOM_MM]
    at = runs[0].corners[index]
    yield f'<svg x="{left}" y="{TOP}" width="{TILE}" height="{TILE}" viewBox="{left} {TOP} {TILE} {TILE}">'
    yield f'<rect x="{left}" y="{TOP}" width="{TILE}" height="{TILE}" fill="#f6f6f6"/>'
    yield polyline([place(p) for p in runs[0].path[at - 1 : at + 2]], "#999", 1, "5 4")
    for number, run in enumerate(runs):
        # The last three lie on each other here: dashes let each of them be seen.
        dash = "" if number == 0 else f"6 {6 * (len(runs) - 2)}"
        yield polyline(near(run.points), COLOURS[number], 2.4, dash).replace(
            "/>", f' stroke-dashoffset="{-6 * (number - 1)}"/>'
        )
    first, second = runs[0].errors_um[index], runs[1].errors_um[index]
    yield "</svg>"
    yield text(left, TOP - 8, f"{runs[0].turn_deg(at):.0f}°: {first:.1f} → {second:.1f} µm")
    bar = 0.2 * scale
    yield f'<path d="M{left + TILE - 66 - bar:.1f} {TOP + TILE - 10}h{bar:.1f}" stroke="black" stroke-width="2"/>'
    yield text(left + TILE - 60, TOP + TILE - 6, "0.2 mm")


def extremes(values, several=24):
    """The lowest and the highest of several values in a row, with their places."""
    for start in range(0, len(values), several):
        few = range(start, min(start + several, len(values)))
        yield from ((i, values[i]) for i in sorted({min(few, key=values.__getitem__), max(few, key=values.__getitem__)}))


def strip(runs, number, width):
    """The speed of one run over time, all runs on the same axis."""
    run, speeds = runs[number], runs[number].speeds()
    base = TOP + TILE + (number + 1) * (STRIP + 24)
    longest, fastest = max(r.ticks for r in runs), max(speeds)
    points = [(GAP + i / longest * width, base - v / fastest * STRIP * 0.75) for i, v in extremes(speeds[: run.ticks + 1])]
    ratio, longer = run.beside(runs[0])
    words = f"{run.name}: {run.ticks} periods ({longer}), sharp corners × {ratio}, {run.acceleration:.0f} mm/s²"
    yield polyline(points, COLOURS[number], 1.2)
    yield f'<path d="M{GAP} {base}h{width}" stroke="#ccc"/>'
    yield text(GAP, base - STRIP * 0.75 - 7, words, COLOURS[number])


def picture(runs):
    tiles = len(runs[0].corners)
    width = tiles * (TILE + GAP) + GAP
    height = TOP + TILE + len(runs) * (STRIP + 24) + 26
    print(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13">')
    print(f'<rect width="{width}" height="{height}" fill="white"/>')
    for index in range(tiles):
        print("\n".join(corner(runs, index, GAP + index * (TILE + GAP))))
    for number in range(len(runs)):
        print("\n".join(strip(runs, number, width - 2 * GAP)))
    print(text(GAP, height - 10, f"speed over time, 0 to {max(run.ticks for run in runs)} periods of {runs[0].period_s * 1e3:g} ms"))
    print("</svg>")


all_runs = [Run(*argument.split("=", 1)) for argument in sys.argv[2:]]
(table if sys.argv[1] == "table" else picture)(all_runs)
