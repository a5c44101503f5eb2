#!/usr/bin/env python3
"""Draws what the planner smooth does at a corner of 90 degrees.

usage: smooth-planner.py TRACE.csv > smooth-planner.svg

The trace is one of examples/programs/square.ngc. Left: the corner at X20 Y0 with its tolerance and the samples of 1 ms.
Right: path speed, acceleration and jerk of X and Y around it, as differences of the samples, with their limits.
"""

import csv
import math
import sys

CORNER, TOLERANCE, PERIOD = (20.0, 0.0), 0.01, 1e-3
COLOURS = {"x": "#1f77b4", "y": "#d62728"}


def read(path):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    return [tuple(float(row[f"{axis}_cmd_mm"]) for axis in "xy") for row in rows]


def differences(values):
    return [(b - a) / PERIOD for a, b in zip(values, values[1:])]


def polyline(points, colour):
    joined = " ".join(f"{x:.2f},{y:.2f}" for x, y in points)
    return f'<polyline points="{joined}" fill="none" stroke="{colour}" stroke-width="1.4"/>'


def text(x, y, words, size=12):
    return f'<text x="{x}" y="{y}" font-size="{size}">{words}</text>'


def corner(samples):
    left, top, side, reach = 20, 40, 380, 0.06

    def place(point):
        x = left + side / 2 + (point[0] - CORNER[0]) / reach * side / 2
        y = top + side / 2 - (point[1] - CORNER[1]) / reach * side / 2
        return x, y

    middle = place(CORNER)
    radius = TOLERANCE / reach * side / 2
    near = [p for p in samples if abs(p[0] - CORNER[0]) < reach and abs(p[1] - CORNER[1]) < reach]
    parts = [text(left, 24, "corner, 0.12 mm wide: path, tolerance 0.01 mm, samples of 1 ms")]
    parts.append(f'<rect x="{left}" y="{top}" width="{side}" height="{side}" fill="none" stroke="#bbb"/>')
    parts.append(f'<path d="M{left} {middle[1]} H{middle[0]} V{top}" fill="none" stroke="#fc9" stroke-width="{2 * radius:.2f}" '
                 'stroke-linejoin="round"/>')
    parts.append(f'<path d="M{left} {middle[1]} H{middle[0]} V{top}" fill="none" stroke="#333"/>')
    parts += [f'<circle cx="{x:.2f}" cy="{y:.2f}" r="2" fill="#060"/>' for x, y in map(place, near)]
    return parts


def plot(row, title, lines, most, times):
    left, top, width, height = 450, 40 + 130 * row, 520, 105

    def place(t, v):
        return left + width * (t - times[0]) / (times[1] - times[0]), top + height / 2 * (1 - v / (1.1 * most))

    parts = [text(left, top - 6, title)]
    parts.append(f'<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" stroke="#bbb"/>')
    for limit in (-most, 0, most):
        y = place(times[0], limit)[1]
        parts.append(f'<path d="M{left} {y:.2f} h{width}" stroke="#999" stroke-dasharray="4 3"/>')
    for colour, values in lines:
        parts.append(polyline([place(t, v) for t, v in values if times[0] <= t <= times[1]], colour))
    return parts


def main():
    samples = read(sys.argv[1])
    nearest = min(range(len(samples)), key=lambda n: math.dist(samples[n], CORNER))
    times = ((nearest - 90) * PERIOD, (nearest + 90) * PERIOD)
    speed, acceleration, jerk = [], [], []
    velocities = {}
    for index, axis in enumerate("xy"):
        v = differences([p[index] for p in samples])
        a = differences(v)
        j = differences(a)
        velocities[axis] = v
        for rows, values in ((speed, v), (acceleration, a), (jerk, j)):
            rows.append((COLOURS[axis], [(n * PERIOD, value) for n, value in enumerate(values)]))
    path = [math.hypot(x, y) for x, y in zip(velocities["x"], velocities["y"])]
    speed.append(("#060", [(n * PERIOD, value) for n, value in enumerate(path)]))
    parts = corner(samples)
    parts += plot(0, "speed of X (blue), Y (red) and of the path (green), limit: F5000", speed, 5000 / 60, times)
    parts += plot(1, "acceleration of X and Y, limit 1000 mm/s²", acceleration, 1000, times)
    parts += plot(2, "jerk of X and Y, limit 20 000 mm/s³; 180 ms around the corner", jerk, 20000, times)
    print('<svg xmlns="http://www.w3.org/2000/svg" width="990" height="440" font-family="sans-serif">')
    print('<rect width="990" height="440" fill="white"/>')
    print("\n".join(parts))
    print("</svg>")


main()
