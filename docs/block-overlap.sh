#!/bin/sh
# The numbers of docs/block-overlap.md, from runs: docs/block-overlap.sh claim|picture|compare|corner.
# Needs target/release/tandem, or another one named by TANDEM; claim and picture need python3.
set -eu
tandem=${TANDEM:-target/release/tandem}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

run() { # program, further arguments
  program=$1
  shift
  "$tandem" run "$program" --machine examples/machines/mill-3axis.toml --summary "$work/summary.json" "$@" > "$work/log"
}

field() { # name in the summary, factor, format
  sed -n "s/^ *\"$1\": \([0-9.e-]*\).*/\1/p" "$work/summary.json" | awk -v by="$2" -v form="$3" '{ printf form, $1 * by }'
}

overlap="--set planner.plugin=block-overlap"
published="$overlap --set planner.options.corner_control=off --set planner.options.limits=off --set guard.mode=count"

claim() { # the four programs as published, by docs/pictures/block-overlap-claim.py
  for name in constant-50 sharp-20 sharp-and-gentle-20 sharp-20-gentle-80; do
    run examples/block-overlap/$name.ngc $published --trace "$work/$name.csv" --blocks "$work/$name.blocks.csv"
  done
  docs/pictures/block-overlap-claim.py "$1" "50 ms everywhere=$work/constant-50" \
    "20 ms at the sharp corners=$work/sharp-20" \
    "20 ms there and on the short chords=$work/sharp-and-gentle-20" \
    "20 ms there, 80 ms on the short chords=$work/sharp-20-gentle-80"
}

compare() { # the planners beside each other, and the four programs with the default options
  for name in raster serpentine spiral square two-step-arcs; do
    program=examples/programs/$name.ngc
    run $program $overlap
    printf '| `%s.ngc` | %s | %s |' $name "$(field motion_time_s 1 %.3f)" "$(field max_path_deviation_mm 1000 %.1f)"
    run $program
    printf ' %s |' "$(field motion_time_s 1 %.3f)"
    run $program --set planner.plugin=after-interpolation --set guard.mode=count
    printf ' %s |\n' "$(field motion_time_s 1 %.3f)"
  done
  for name in constant-50 sharp-20 sharp-and-gentle-20 sharp-20-gentle-80; do
    run examples/block-overlap/$name.ngc $overlap
    echo "$name, default options: $(field motion_time_s 1 %.3f) s, $(field max_path_deviation_mm 1000 %.1f) µm"
  done
}

corner() { # what a right angle costs beside a straight line of the same length
  seconds() { # mode, where the second block goes
    printf 'G21 G90 F5000\n%s\nG1 X40\nG1 %s\nM2\n' "$1" "$2" > "$work/corner.ngc"
    run "$work/corner.ngc" $overlap
    field motion_time_s 1 %.4f
  }
  straight=$(seconds "G64 P0.01" X80)
  for mode in "G61" "G64 P0.01"; do
    seconds "$mode" "X40 Y40" | awk -v mode="$mode" -v straight="$straight" \
      '{ printf "a right angle at F5000 with %s costs %.0f ms\n", mode, 1000 * ($1 - straight) }'
  done
}

case ${1:-} in
  claim) claim table ;;
  picture) claim picture ;;
  compare | corner) "$1" ;;
  *) echo "usage: docs/block-overlap.sh claim|picture|compare|corner" >&2; exit 2 ;;
esac
