#!/usr/bin/env bash
# Gates a folder of toolpaths: corrects every program, then judges the corrected ones against the originals.
#
#   gate.sh PROGRAMS CELL OUT [MAX_ERROR_MM]
#
# OUT receives the corrected programs, their reports and page, and what CI systems read: check.sarif, check.xml.
# Exit code: 0 all within tolerance; 1 some are not; 2 something could not be read or solved. DEFLEX names the binary.
set -uo pipefail
[ $# -ge 3 ] || { sed -n '2,7s/^# \{0,1\}//p' "$0" >&2; exit 2; }
programs=$1 cell=$2 out=$3 max_error=${4:-0.02}
deflex=${DEFLEX:-deflex}

shopt -s nullglob nocaseglob
files=("$programs"/*.mod)
[ ${#files[@]} -gt 0 ] || { echo "$programs: no RAPID modules (*.mod)" >&2; exit 2; }
mkdir -p "$out/corrected" || exit 2

"$deflex" compensate "${files[@]}" --cell "$cell" --quiet \
  --out-dir "$out/corrected" --report "$out/report.csv" --json "$out/summary.json" --html "$out/report.html" || exit 2

corrected=("$out/corrected"/*.mod)
judge() { "$deflex" check "${corrected[@]}" --cell "$cell" --against "$programs" --max-error "$max_error" --quiet "$@"; }
judge --format sarif > "$out/check.sarif"
code=$?
[ $code -le 1 ] || exit $code
judge --format junit > "$out/check.xml"
judge --format text
exit $code
