#!/usr/bin/env bash
# What the action does: `deflex check` on PROGRAMS, findings into the file SARIF; its exit code is the answer.
set -euo pipefail
shopt -s globstar nullglob
PATH="${RUNNER_TEMP:-/nowhere}/deflex/bin:$PATH"

# Wildcards and words are the caller's to write: they are split here, and nothing of them is run.
# shellcheck disable=SC2153,SC2206
programs=($PROGRAMS)
# shellcheck disable=SC2206
arguments=(${ARGUMENTS:-})
[ ${#programs[@]} -gt 0 ] || { echo "no program matches: $PROGRAMS" >&2; exit 2; }
[ -z "${AGAINST:-}" ] || arguments+=(--against="$AGAINST")
echo "sarif=$SARIF" >>"${GITHUB_OUTPUT:-/dev/null}"
# Programs come last: after `--` everything is a name, whatever it begins with.
deflex check --cell="$CELL" --max-error="$MAX_ERROR" "${arguments[@]}" --output-format sarif -- "${programs[@]}" >"$SARIF"
