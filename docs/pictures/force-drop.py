#!/usr/bin/env python3
"""Draws force and torque of a cut in which the feed drops, and says their means: force-drop.py TRACE.csv PICTURE.svg"""
import csv
import math
import sys

# Force per torque, N/(N·m): what the paper measured, and what a screw of 20 mm makes of it without loss.
PUBLISHED, SCREW = 317.945, 2 * math.pi / 0.020
WIDTH, HEIGHT, LEFT = 640, 150, 52
rows = [{key: float(value) for key, value in row.items() if key[0] in "tfs" and key != "state"} for row in csv.DictReader(open(sys.argv[1]))]
for row in rows:
    # The force that the cut puts on the table, as a dynamometer under it would see it.
    row["force"] = row["sig_true_torque_nm"] * SCREW


def mean(column, feed):
    """Mean of a column in the middle of the cut at a feed, mm/min, where the torque is steady."""
    cut = [row for row in rows if abs(row["feed_mm_s"] * 60 - feed) < 0.5 and row["sig_depth_mm"] > 2.99]
    middle = cut[len(cut) // 4 : -len(cut) // 10]
    return sum(row[column] for row in middle) / len(middle)


print("feed mm/min   force N   torque N·m   force/torque")
for feed in (100, 50):
    force, torque = mean("force", feed), mean("sig_torque_nm", feed)
    print(f"{feed:11d}   {force:7.2f}   {torque:10.4f}   {force / torque:12.1f}")

top = 2 * (HEIGHT + 24) + 20
text = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {LEFT + WIDTH + 10} {top}" font-family="sans-serif" font-size="12">']
text.append(f'<rect width="{LEFT + WIDTH + 10}" height="{top}" fill="white"/>')
end = rows[-1]["t_s"]
plots = [
    ("force on the table, N", "force", 30, [("published ratio × estimate", "#7d3c98", lambda row: row["sig_torque_nm"] * PUBLISHED), ("force", "#c0392b", lambda row: row["force"])]),
    ("torque at the motor, N·m", "sig_torque_nm", 0.1, [("estimate", "#2471a3", lambda row: row["sig_torque_nm"]), ("truth", "#1e8449", lambda row: row["sig_true_torque_nm"])]),
]
for place, (title, _, most, curves) in enumerate(plots):
    floor = (place + 1) * (HEIGHT + 24) - 8
    text.append(f'<path d="M{LEFT} {floor - HEIGHT}V{floor}H{LEFT + WIDTH}" fill="none" stroke="#999"/>')
    text.append(f'<text x="{LEFT + 6}" y="{floor - HEIGHT + 12}">{title}</text>')
    for value in (most / 2, most):
        text.append(f'<text x="{LEFT - 6}" y="{floor - HEIGHT * value / most + 4:.1f}" text-anchor="end">{value:g}</text>')
    for index, (name, colour, of) in enumerate(curves):
        points = " ".join(f'{LEFT + WIDTH * row["t_s"] / end:.1f},{floor - HEIGHT * min(of(row), most) / most:.1f}' for row in rows[::20])
        text.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.3"/>')
        text.append(f'<text x="{LEFT + 230 + 170 * index}" y="{floor - HEIGHT + 12}" fill="{colour}">{name}</text>')
text.append(f'<text x="{LEFT + WIDTH}" y="{top - 4}" text-anchor="end">time, s: 0 to {end:.0f}</text></svg>')
open(sys.argv[2], "w").write("\n".join(text) + "\n")
