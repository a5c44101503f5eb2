#!/bin/sh
# The table of docs/machining-time.md: estimates against the planners themselves, calibrated by the tool.
# Needs target/release/tandem. Prints, for each machine, the error of each model in percent.
set -eu
tandem=${TANDEM:-target/release/tandem}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
overlap="--set planner.plugin=block-overlap --set planner.options.corner_control=off --set planner.options.limits=off
  --set guard.mode=count"

program() { # feed, name: a program of the examples at another feed, or the zig-zag over a surface
  if [ "$2" = zigzag ]; then
    awk -F, -v feed="$1" 'NR == 1 { print "G21 G90 G64\nF" feed; next }
      { print (NR == 2 ? "G0" : "G1") " X" $1 " Y" $2 " Z" $3 } END { print "M2" }' \
      tests/fixtures/cases/tie_zigzag_points.csv
  else
    sed "s/^F[0-9.]*/F$1/" "examples/programs/$2.ngc"
  fi
}

seconds() { # model and machine
  "$tandem" estimate "$work"/*.ngc --json --model "$@" | sed -n 's/.*"estimated_s": \([0-9.e-]*\).*/\1/p'
}

for name in raster serpentine spiral square zigzag; do
  for feed in 1000 2000 3000 5000; do program $feed $name > "$work/$name-$feed.ngc"; done
done

table() { # title, "forms", machine
  title=$1 forms=$2
  shift 2
  seconds simulate "$@" > "$work/true"
  columns=$work/true
  for form in $forms; do
    "$tandem" calibrate "$@" --model "$form" --out "$work/$form.toml" > "$work/log"
    seconds "$work/$form.toml" "$@" > "$work/$form"
    columns="$columns $work/$form"
  done
  echo "$title: program, time s, error % of $forms"
  ls "$work"/*.ngc | sed 's:.*/::; s:.ngc::' | paste - $columns |
    awk '{ printf "| %s | %.3f |", $1, $2; for (i = 3; i <= NF; i++) printf " %+.2f |", 100 * ($i / $2 - 1); print "" }'
}

mill="--machine examples/machines/mill-3axis.toml"
table "look-ahead, axis" look-ahead $mill
table "look-ahead, tangent" look-ahead $mill --set planner.options.junction=tangent --set guard.mode=count
table "overlap, 30 ms" "regression overlap" $mill $overlap --set motion.time_constant_ms=30
table "overlap, 50 ms" "regression overlap" $mill $overlap
