# shellcheck shell=bash
# Running suites of tests and counting them. Sourced after common.bash.

passed=0
failed=0
skipped=0
slow_cases=$logs/slow_cases

# count TITLE PASSED FAILED SKIPPED
count() {
  say "$1: $2 passed, $3 failed$( (($4 > 0)) && printf ', %d skipped' "$4")"
  passed=$((passed + $2))
  failed=$((failed + $3))
  skipped=$((skipped + $4))
}

# countStep TITLE LOG COMMAND...: one check, passed or failed.
countStep() {
  if runStep "$@"; then count "$1" 1 0 0; else count "$1" 0 1 0; fi
}

ctest=(ctest)
# AddressSanitizer's shadow memory and widely random addresses do not go together on newer kernels.
fixAddresses() {
  if setarch "$(uname -m)" -R true 2>/dev/null; then ctest=(setarch "$(uname -m)" -R ctest); fi
}

# runCtest FOLDER CTEST_ARGUMENTS...
# shellcheck disable=SC2317
runCtest() (
  cd "$1" && shift && "${ctest[@]}" --output-on-failure "$@"
)

# runSuite TITLE NAME FOLDER CTEST_ARGUMENTS...: counts the cases in the result files. A suite without a test is a
# failure: something has lost it.
runSuite() {
  local title=$1 log=$logs/$2.log counts=$logs/$2.counts folder=$3 numbers
  shift 3
  rm -rf "$counts" "$folder/test_results"
  runLogged "$title" "$log" runCtest "$folder" "$@"
  /usr/bin/python3 "$checkout/scripts/lib/test_summary.py" --build "$folder" --log "$log" --out "$counts" \
    --times "$slow_cases" -- "$@"
  if [[ -f $counts ]] && read -r -a numbers <"$counts"; then
    count "$title" "${numbers[@]}"
  else
    count "$title" 0 1 0
  fi
}

# noReports FOLDER: nothing that a sanitizer wrote.
# shellcheck disable=SC2317
noReports() {
  local found
  mapfile -t found < <(find "$1" -type f)
  if ((${#found[@]} == 0)); then return 0; fi
  cat "${found[@]}"
  return 1
}

# finish: where the time went, the line that readers of the results look for, and the exit status.
finish() {
  if [[ -s $slow_cases ]]; then
    say "Slowest tests:"
    LC_ALL=C sort -rn "$slow_cases" | head -n 12 | awk '{printf "  %7.1f s  %s\n", $1, $2}'
  fi
  say "Stages:"
  printf '%s\n' "${stages[@]}" | awk '$1 > 0 {s = $1; $1 = ""; printf "  %7d s %s\n", s, $0}'
  say "Everything took $(secondsAsText "$SECONDS")."
  printf '%d passed, %d failed' "$passed" "$failed"
  if ((skipped > 0)); then printf ', %d skipped' "$skipped"; fi
  printf '\n'
  if ((failed == 0 && passed > 0)); then exit 0; else exit 1; fi
}
