#!/usr/bin/env python3
"""Draws the feed by rough and by fine periods around a corner: look-ahead-rough.py ROUGH.csv FINE.csv > PICTURE.svg"""
import csv
import math
import sys

WIDTH, HEIGHT, LEFT, FROM_S, TO_S, MOST = 640, 150, 52, 0.40, 0.54, 2400
rough, fine = (list(csv.DictReader(open(file))) for file in sys.argv[1:])
ROUGH_S = float(rough[1]["t_s"]) - float(rough[0]["t_s"])


def staircase(steps):
    """Points of (start, length, feed in mm/min)."""
    for start, length, feed in steps:
        if start + length > FROM_S and start < TO_S:
            for time in (max(start, FROM_S), min(start + length, TO_S)):
                yield LEFT + WIDTH * (time - FROM_S) / (TO_S - FROM_S), feed


def rough_steps():
    for row in rough:
        way = math.hypot(float(row["x_displacement_mm"]), float(row["y_displacement_mm"]))
        yield float(row["t_s"]), ROUGH_S, way / ROUGH_S * 60


def fine_steps():
    period = float(fine[1]["t_s"]) - float(fine[0]["t_s"])
    for row in fine[1:]:
        yield float(row["t_s"]) - period, period, float(row["feed_mm_s"]) * 60


total = 2 * (HEIGHT + 24) + 20
print(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {LEFT + WIDTH + 10} {total}" font-family="sans-serif" font-size="12">')
print(f'<rect width="{LEFT + WIDTH + 10}" height="{total}" fill="white"/>')
for place, (title, steps) in enumerate([("(a) rough loop: feed, mm/min", rough_steps()), ("(b) fine loop", fine_steps())]):
    floor = (place + 1) * (HEIGHT + 24) - 8
    print(f'<path d="M{LEFT} {floor - HEIGHT}V{floor}H{LEFT + WIDTH}" fill="none" stroke="#999"/>')
    print(f'<text x="{LEFT + 150}" y="{floor - HEIGHT + 12}">{title}</text>')
    for value in (MOST / 2, MOST):
        print(f'<text x="{LEFT - 6}" y="{floor - HEIGHT * value / MOST + 4:.1f}" text-anchor="end">{value:g}</text>')
    points = " ".join(f"{x:.2f},{floor - HEIGHT * feed / MOST:.2f}" for x, feed in staircase(steps))
    print(f'<polyline points="{points}" fill="none" stroke="#2471a3" stroke-width="1.2"/>')
print(f'<text x="{LEFT + WIDTH}" y="{total - 4}" text-anchor="end">time, s: {FROM_S:g} to {TO_S:g}</text></svg>')
