#!/bin/sh
# Corrects the slot and the blade (as RAPID and as CL data), a contour in FANUC TP, a part on a turntable and along a track, a thin wall, closes the loop on the measured sample, and judges each
# corrected program against its original. Programs, reports and pages are left in samples/out/.
set -eu
cd "$(dirname "$0")"
mkdir -p out
cargo build --release
# Where cargo puts it: CARGO_TARGET_DIR or a configuration may say.
target=$(cargo metadata --no-deps --format-version 1 | sed -n 's/.*"target_directory":"\([^"]*\)".*/\1/p')
deflex=$target/release/deflex

for program in slot/slot.mod blade/blade.mod blade/blade.aptsource; do
    folder=$(dirname "$program")
    name=$(basename "$program" | tr . _)
    echo
    echo "== $program"
    "$deflex" compensate "$program" --cell "$folder/cell.toml" -o "out/$name.corrected.mod" \
        --report "out/$name.report.csv" --html "out/$name.html"
    # The targets only: `compensate` has reported above what remains between them, most of it where the cutter enters.
    "$deflex" check "out/$name.corrected.mod" --cell "$folder/cell.toml" --against "$program" --at-targets --max-error 0.001
done

echo
echo "== fanuc/contour.ls"
"$deflex" compensate fanuc/contour.ls --cell fanuc/cell.toml -o out/contour.corrected.ls --report out/contour.report.csv
# Three decimals of a millimetre and of a degree are left.
"$deflex" check out/contour.corrected.ls --cell fanuc/cell.toml --against fanuc/contour.ls --at-targets --max-error 0.005

echo
echo "== ur/contour.script: URScript, with arcs and a feature"
"$deflex" compensate ur/contour.script --cell ur/cell.toml -o out/contour.corrected.script --report out/contour_ur.report.csv
"$deflex" check out/contour.corrected.script --cell ur/cell.toml --against ur/contour.script --at-targets --max-error 0.001

echo
echo "== yaskawa/CONTOUR.JBI: INFORM, with circles in a user frame"
"$deflex" compensate yaskawa/CONTOUR.JBI --cell yaskawa/cell.toml -o out/CONTOUR.corrected.JBI --report out/contour_jbi.report.csv
"$deflex" check out/CONTOUR.corrected.JBI --cell yaskawa/cell.toml --against yaskawa/CONTOUR.JBI --at-targets --max-error 0.003

echo
echo "== kuka/ring.src: KRL, with the points of ring.dat"
"$deflex" compensate kuka/ring.src --cell kuka/cell.toml --out-dir out/kuka --report out/kuka.report.csv
"$deflex" check out/kuka/ring.src --cell kuka/cell.toml --against kuka/ring.src --at-targets --max-error 0.002

echo
echo "== units/units.mod: a ring on a turntable, a beam along a track"
"$deflex" compensate units/units.mod --cell units/cell.toml -o out/units.corrected.mod --report out/units.report.csv
"$deflex" check out/units.corrected.mod --cell units/cell.toml --against units/units.mod --at-targets --max-error 0.001

echo
echo "== stock/part.mod: from the block, with two tools"
"$deflex" compensate stock/part.mod --cell stock/cell.toml -o out/stock.corrected.mod --report out/stock.report.csv
"$deflex" simulate out/stock.corrected.mod --cell stock/cell.toml --against stock/part.mod \
    --html out/stock.html --stl out/stock.stl --json out/stock.json

echo
echo "== wall/wall.mod: a thin wall that yields to the cutter"
"$deflex" compensate wall/wall.mod --cell wall/cell.toml -o out/wall.corrected.mod --report out/wall.report.csv
"$deflex" simulate wall/wall.mod --cell wall/cell.toml --json out/wall.before.json
"$deflex" simulate out/wall.corrected.mod --cell wall/cell.toml --against wall/wall.mod \
    --html out/wall.html --stl out/wall.stl --json out/wall.json

echo
echo "== closed-loop: which effect does the cell lack?"
"$deflex" identify --run closed-loop/part.mod closed-loop/measured.csv --cell closed-loop/cell.toml \
    -o out/extended.toml --report out/residuals.csv --json out/identification.json --html out/identification.html
"$deflex" compensate closed-loop/transfer.mod --cell out/extended.toml \
    --forces closed-loop/transfer_measured.csv -o out/transfer.corrected.mod --report out/transfer.report.csv
