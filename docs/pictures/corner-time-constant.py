#!/usr/bin/env python3
"""Draws a corner of examples/policies/corners.ngc from traces: corner-time-constant.py NAME=TRACE.csv ... > picture.svg"""
import csv
import sys

CORNER, HALF_MM, SIZE = (67.016, 30.793), 0.75, 420
BEFORE, AFTER = (57.016, 13.473), (67.016, 50.793)
COLOURS = ["#c0392b", "#2471a3", "#1e8449"]


def place(x, y):
    return (x - CORNER[0] + HALF_MM) / (2 * HALF_MM) * SIZE, (CORNER[1] + HALF_MM - y) / (2 * HALF_MM) * SIZE


def line(points, colour, width, dash=""):
    text = " ".join(f"{px:.2f},{py:.2f}" for px, py in points)
    return f'<polyline points="{text}" fill="none" stroke="{colour}" stroke-width="{width}" stroke-dasharray="{dash}"/>'


print(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {SIZE} {SIZE}" font-family="sans-serif" font-size="13">')
print(f'<rect width="{SIZE}" height="{SIZE}" fill="white"/>')
print(line([place(*BEFORE), place(*CORNER), place(*AFTER)], "#999", 1, "5 4"))
for index, (name, file) in enumerate(argument.split("=", 1) for argument in sys.argv[1:]):
    rows = [(float(row["x_cmd_mm"]), float(row["y_cmd_mm"])) for row in csv.DictReader(open(file))]
    near = [p for p in rows if abs(p[0] - CORNER[0]) < 2 * HALF_MM and abs(p[1] - CORNER[1]) < 2 * HALF_MM]
    print(line([place(*p) for p in near], COLOURS[index % 3], 1.6))
    print(f'<text x="12" y="{24 + 18 * index}" fill="{COLOURS[index % 3]}">{name}</text>')
scale = 0.1 / (2 * HALF_MM) * SIZE
print(f'<path d="M12 {SIZE - 16}h{scale:.1f}" stroke="black" stroke-width="2"/>')
print(f'<text x="{18 + scale:.1f}" y="{SIZE - 12}">0.1 mm</text></svg>')
