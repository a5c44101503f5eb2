#!/usr/bin/env python3
"""Draws the feed and the speeds of both motors of a CoreXY from a trace: kinematics.py TRACE.csv > picture.svg"""
import csv
import sys

WIDTH, HEIGHT, LEFT, TOP, MOST, LIMIT = 760, 300, 56, 16, 280.0, 250.0
rows = list(csv.DictReader(open(sys.argv[1])))
time_s = [float(row["t_s"]) for row in rows]
x, y = ([float(row[f"{axis}_cmd_mm"]) for row in rows] for axis in "xy")
feed = [float(row["feed_mm_s"]) for row in rows]


def speeds(joint):
    return [0.0] + [abs(b - a) / (time_s[1] - time_s[0]) for a, b in zip(joint, joint[1:])]


def place(t, v):
    return LEFT + t / time_s[-1] * (WIDTH - LEFT - 90), TOP + (1 - v / MOST) * (HEIGHT - TOP - 36)


def line(values, colour, dash=""):
    text = " ".join("{:.1f},{:.1f}".format(*place(t, v)) for t, v in zip(time_s, values))
    return f'<polyline points="{text}" fill="none" stroke="{colour}" stroke-width="1.8" stroke-dasharray="{dash}"/>'


print(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="13">')
print(f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>')
for level in range(0, 251, 50):
    (left, top), (right, _) = place(0, level), place(time_s[-1], level)
    colour = "#c0392b" if level == LIMIT else "#ddd"
    print(f'<path d="M{left:.1f} {top:.1f}H{right:.1f}" stroke="{colour}"/>')
    print(f'<text x="{left - 8:.1f}" y="{top + 4:.1f}" text-anchor="end">{level}</text>')
curves = [("feed", feed, "#222", "5 4"), ("motor A", speeds([a + b for a, b in zip(x, y)]), "#2471a3", ""),
          ("motor B", speeds([a - b for a, b in zip(x, y)]), "#1e8449", "")]
for index, (name, values, colour, dash) in enumerate(curves):
    print(line(values, colour, dash))
    print(f'<text x="{WIDTH - 80}" y="{TOP + 60 + 20 * index}" fill="{colour}">{name}</text>')
print(f'<text x="{WIDTH - 80}" y="{TOP + 32}" fill="#c0392b">limit</text>')
print(f'<text x="{LEFT}" y="{HEIGHT - 8}">mm/s over {time_s[-1]:.3f} s: along X, then on the diagonal</text></svg>')
