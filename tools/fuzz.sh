#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# fuzz.sh SECONDS [TARGET..]: every fuzzer of tests/fuzz (or those named) for that time, one per core, with clang 16
# (`tools/setup.sh fuzz`). STEMVO_FUZZ_SEED: of its choices; else each call has another. Ends with 1 and the file of the find, with the command that repeats it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly BUILD=build/fuzz
readonly FINDS=$BUILD/finds
readonly LIMITS=(-rss_limit_mb=2048 -malloc_limit_mb=1024 -timeout=10)

[[ "${1:-}" =~ ^[1-9][0-9]*$ ]] || { echo "usage: tools/fuzz.sh SECONDS [TARGET..]" >&2; exit 2; }
readonly SECONDS_EACH=$1
shift

mkdir -p "$FINDS"
cmake --preset fuzz --log-level=WARNING >"$BUILD/configure.log" || { cat "$BUILD/configure.log" >&2; exit 1; }
cmake --build --preset fuzz --parallel "$(nproc)" --target fuzzers >"$BUILD/build.log" || { tail -n 40 "$BUILD/build.log" >&2; exit 1; }
# Seeds are made again each time; what the fuzzers added to build/fuzz/corpora stays.
"$BUILD/tests/fuzz/fuzz_make_corpora" "$BUILD/corpora"

(($# > 0)) || set -- $(sed -n 's/^set(targets \(.*\))$/\1/p' tests/fuzz/CMakeLists.txt)
rm -f "$BUILD"/*.run.log

# fuzz_one TARGET: what libraries print of broken input is not shown (2: the program's stderr; reports stay).
fuzz_one() {
  local target=$1 program=$BUILD/tests/fuzz/fuzz_$1 log=$BUILD/$1.run.log find_file
  if ! "$program" "$BUILD/corpora/$target" -seed="${STEMVO_FUZZ_SEED:-0}" -max_total_time="$SECONDS_EACH" "${LIMITS[@]}" -close_fd_mask=2 \
    -artifact_prefix="$FINDS/${target}_" -print_final_stats=1 2>"$log"; then
    find_file=$(sed -n 's/.*Test unit written to //p' "$log" | tail -n 1)
    echo "fuzz: $target: $(grep -m1 -E 'ERROR:|runtime error|broken promise' "$log" || echo failed) (log: $log)" >&2
    echo "fuzz: repeat: $program ${find_file:-"$FINDS/${target}_*"}" >&2
    return 1
  fi
  echo "$target: $(sed -n 's/^stat::number_of_executed_units: *//p' "$log") executions"
}

failed=0
running=0
for target; do
  if ((running == $(nproc))); then
    wait -n || failed=1
    running=$((running - 1))
  fi
  fuzz_one "$target" &
  running=$((running + 1))
done
while ((running > 0)); do
  wait -n || failed=1
  running=$((running - 1))
done
awk '/^stat::number_of_executed_units:/ { total += $2 } END { print total + 0, "executions in all" }' "$BUILD"/*.run.log
exit "$failed"
