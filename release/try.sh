#!/bin/sh
# Packs a release binary as a Debian package, unpacks it and runs what is in it, then packs the crate without publishing it:
#   release/try.sh target/release/deflex     (cargo install cargo-deb)
set -eu
cd "$(dirname "$0")/.."
binary=$1
folder=target/try
rm -rf "$folder"
mkdir -p "$folder" target/release
release/assets.sh "$binary" target/assets
[ "$binary" -ef target/release/deflex ] || cp "$binary" target/release/deflex
cargo deb --quiet --no-build --output "$folder/"
dpkg-deb -x "$folder"/deflex_*.deb "$folder/root"

deflex="$folder/root/usr/bin/deflex"
"$deflex" --version
"$deflex" compensate samples/slot/slot.mod --cell samples/slot/cell.toml --quiet -o "$folder/corrected.mod"
"$deflex" check "$folder/corrected.mod" --cell samples/slot/cell.toml --against samples/slot/slot.mod --max-error 0.001
for file in man/man1/deflex-compensate.1.gz bash-completion/completions/deflex zsh/vendor-completions/_deflex \
  fish/vendor_completions.d/deflex.fish doc/deflex/copyright doc/deflex/README.md; do
  test -s "$folder/root/usr/share/$file" || { echo "the package has no $file" >&2; exit 1; }
done

cargo publish --dry-run --allow-dirty --workspace --exclude deflex-python
