#!/usr/bin/env bash
# Gates a folder of toolpaths: corrects every program, then judges the corrected ones against the originals.
#
#   gate.sh PROGRAMS CELL OUT [MAX_ERROR_MM]
#
# OUT receives the corrected programs, their reports and page, and what CI systems read: check.sarif, check.xml.
# Exit code: 0 all within tolerance; 1 some are not, or cannot be reached; 2 something could not be read or solved.
# DEFLEX names the binary.
set -uo pipefail
[ $# -ge 3 ] || { sed -n '2,8s/^# \{0,1\}//p' "$0" >&2; exit 2; }
programs=$1 cell=$2 out=$3 max_error=${4:-0.02}
deflex=${DEFLEX:-deflex}

shopt -s nullglob nocaseglob
files=("$programs"/*.mod)
[ ${#files[@]} -gt 0 ] || { echo "$programs: no RAPID modules (*.mod)" >&2; exit 2; }
mkdir -p -- "$out/corrected" || exit 2
# Of a run before: nothing stale is published.
rm -f -- "$out"/corrected/* "$out/check.sarif" "$out/check.xml"

# Options first: after `--` everything is a name, whatever it begins with.
judge() { "$deflex" check --cell="$cell" --quiet "${how[@]}" --output-format "$1" -- "${judged[@]}"; }
if "$deflex" compensate --cell="$cell" --quiet --out-dir="$out/corrected" --report="$out/report.csv" \
  --json="$out/summary.json" --html="$out/report.html" -- "${files[@]}"; then
  # Only the targets: a correction alone removes their errors. The error between them needs `compensate --subdivide`.
  how=(--against="$programs" --max-error="$max_error" --at-targets)
  judged=("$out/corrected"/*.mod)
  failed=0
else
  # Nothing is corrected where one program fails: what is out of reach stands at its line, tolerances come later.
  how=(--max-error=1000)
  judged=("${files[@]}")
  failed=2
fi

judge sarif > "$out/check.sarif.new"
code=$?
if [ $code -gt 1 ]; then
  rm -- "$out/check.sarif.new"
  exit $code
fi
# Annotations belong to the originals, which the repository holds: a correction changes numbers and no line.
sed "s|\"uri\": \"${out#./}/corrected/|\"uri\": \"${programs#./}/|" "$out/check.sarif.new" > "$out/check.sarif"
rm -- "$out/check.sarif.new"
judge junit > "$out/check.xml"
judge text
[ $code -eq 0 ] || exit $code
exit $failed
