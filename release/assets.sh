#!/bin/sh
# Manual pages and completions of a binary, for packages: release/assets.sh BINARY FOLDER
set -eu
binary=$1
folder=$2
mkdir -p "$folder/man" "$folder/completions"
"$binary" generate man "$folder/man"
"$binary" generate completions bash >"$folder/completions/deflex.bash"
"$binary" generate completions zsh >"$folder/completions/_deflex"
"$binary" generate completions fish >"$folder/completions/deflex.fish"
"$binary" generate completions powershell >"$folder/completions/_deflex.ps1"
