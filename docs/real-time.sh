#!/bin/sh
# Prints the table of docs/real-time.md: tandem latency beside cyclictest in the same seconds, idle and under load.
# Usage, as root, from the root of the repository: docs/real-time.sh [SECONDS]
# Leaves histograms and pages in target/real-time.
set -eu

seconds=${1:-30}
tandem=${TANDEM:-target/release/tandem}
out=target/real-time
longer=$((seconds + 1))
mkdir -p "$out"
[ -x "$tandem" ] || cargo build --release -p tandem
command -v cyclictest >/dev/null || { echo "cyclictest is missing: apt-get install rt-tests" >&2; exit 1; }

# One row: the figures that a line "p50 A, p99 B, p99.9 C, max D us" gives.
row() {
    figures=$(sed -E 's/.*p50 ([0-9.]+), p99 ([0-9.]+), p99.9 ([0-9.]+), max ([0-9.]+) us.*/\1 | \2 | \3 | \4/')
    echo "| $1 | $figures | $2 |"
}

missed() {
    sed -nE 's/^periods ([0-9]+) .*missed ([0-9]+),.*/\2 of \1/p' "$1"
}

# Both programs in the same seconds, each on a core of its own: tandem takes the last, cyclictest the first.
measure() {
    name=$1
    shift
    cyclictest="cyclictest -m -p80 -i1000 -t1 -a 0 -q -D $seconds -h 20000"
    $cyclictest >"$out/$name.cyclictest" 2>/dev/null &
    "$tandem" latency --duration "$longer" --cyclictest "$out/$name.cyclictest" --report "$out/$name.html" "$@" \
        >"$out/$name.txt" 2>"$out/$name.notes" || { cat "$out/$name.notes" >&2; exit 1; }
    wait
    grep '^p50' "$out/$name.txt" | row "\`tandem latency --duration $longer${*:+ $*}\`" "$(missed "$out/$name.txt")"
    grep '^cyclictest' "$out/$name.txt" | row "\`$cyclictest\`, in the same seconds" ""
}

uname -srvm
echo "cores: $(nproc), load average before: $(cut -d' ' -f1-3 /proc/loadavg)"
echo
echo "| | p50 | p99 | p99.9 | max | missed periods |"
echo "|---|---|---|---|---|---|"
measure idle
measure load --load
