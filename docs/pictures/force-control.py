#!/usr/bin/env python3
"""Draws torque, feed and depth over the path: force-control.py NAME=TRACE.csv ... > picture.svg"""
import csv
import sys

WIDTH, HEIGHT, LEFT = 640, 170, 52
COLOURS = ["#c0392b", "#2471a3", "#1e8449", "#7d3c98"]
PLOTS = [("torque, N·m", "sig_true_torque_nm", 1, 0.16), ("feed, mm/min", "feed_mm_s", 60, 320), ("depth, mm", "sig_depth_mm", 1, 5)]


def rows(file):
    # One row in 20 is more than the picture has room for.
    return list(csv.DictReader(open(file)))[::20]


runs = [(name, rows(file)) for name, file in (argument.split("=", 1) for argument in sys.argv[1:])]
end = max(float(run[-1]["x_fb_mm"]) for _, run in runs)
total = len(PLOTS) * (HEIGHT + 22) + 20
print(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH + LEFT + 10} {total}" font-family="sans-serif" font-size="12">')
print(f'<rect width="{WIDTH + LEFT + 10}" height="{total}" fill="white"/>')
for place, (title, column, scale, top) in enumerate(PLOTS):
    floor = (place + 1) * (HEIGHT + 22) - 8
    print(f'<path d="M{LEFT} {floor - HEIGHT}V{floor}H{LEFT + WIDTH}" fill="none" stroke="#999"/>')
    print(f'<text x="{LEFT + 6}" y="{floor - HEIGHT + 12}">{title}</text>')
    for value in (top / 2, top):
        y = floor - HEIGHT * value / top
        print(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    if column == "sig_true_torque_nm":
        y = floor - HEIGHT * 0.1 / top
        print(f'<path d="M{LEFT} {y:.1f}h{WIDTH}" stroke="#999" stroke-dasharray="4 4"/>')
    for index, (name, run) in enumerate(runs if column != "sig_depth_mm" else runs[:1]):
        points = ((float(row["x_fb_mm"]), min(float(row[column]) * scale, top)) for row in run)
        text = " ".join(f"{LEFT + WIDTH * x / end:.1f},{floor - HEIGHT * y / top:.1f}" for x, y in points)
        print(f'<polyline points="{text}" fill="none" stroke="{COLOURS[index % 4]}" stroke-width="1.3"/>')
        if place == 0:
            print(f'<text x="{LEFT + 110 + 130 * index}" y="{floor - HEIGHT + 12}" fill="{COLOURS[index % 4]}">{name}</text>')
print(f'<text x="{LEFT + WIDTH}" y="{total - 4}" text-anchor="end">path, mm: 0 to {end:.0f}</text></svg>')
