# shellcheck shell=bash
# Where things are, and how a long step shows what it does. Sourced by scripts/train and scripts/check.

checkout=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd -P)

# shellcheck source=scripts/lib/environment.bash
source "$checkout/scripts/lib/environment.bash"

output=$(outputFolder) || exit 2
logs=$output/logs

say() { printf '%s\n' "$*"; }
complain() { printf '%s\n' "$*" >&2; }
stop() {
  complain "$*"
  exit 1
}

# secondsAsText SECONDS: 75 -> 1 min 15 s
secondsAsText() {
  if (($1 < 60)); then printf '%d s' "$1"; else printf '%d min %d s' $(($1 / 60)) $(($1 % 60)); fi
}

# lastLine LOG: what the step is at, cut to fit on the line; nothing while the log is empty.
lastLine() {
  tail -c 2000 "$1" 2>/dev/null | tr '\r' '\n' | tr -cd '\n\40-\176' | grep -v '^ *$' | tail -n 1 | cut -c 1-70
}

# Seconds that a step may take in silence: what has nothing to do is done by then.
quiet_seconds=6

# showProgress TITLE LOG PARENT: a line that counts up on a terminal, a line every 30 s in a file or a pipe.
showProgress() {
  local title=$1 log=$2 parent=$3 seconds=0
  while sleep 1 >/dev/null && kill -0 "$parent" 2>/dev/null; do
    seconds=$((seconds + 1))
    if ((seconds < quiet_seconds)); then continue; fi
    if [[ -t 1 ]]; then
      printf '\r\033[K%s: %s  %s' "$title" "$(secondsAsText "$seconds")" "$(lastLine "$log")"
    elif ((seconds == quiet_seconds)); then
      say "$title ..."
    elif ((seconds % 30 == 0)); then
      say "$title: $(secondsAsText "$seconds")  $(lastLine "$log")"
    fi
  done
}

progress_process=
stopProgress() {
  if [[ -n $progress_process ]]; then
    kill "$progress_process" 2>/dev/null
    wait "$progress_process" 2>/dev/null
    progress_process=
    if [[ -t 1 ]]; then printf '\r\033[K'; fi
  fi
  return 0
}
trap stopProgress EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

# What took how long: "SECONDS TITLE" for each logged command.
stages=()

# runLogged TITLE LOG COMMAND...: runs the command with its output in LOG and shows its progress; the command's status,
# and its time in step_seconds and stages. (File 9 is the lock of a build; who shows its progress shall not hold it.)
runLogged() {
  local title=$1 log=$2 status=0 start=$SECONDS
  shift 2
  mkdir -p "$(dirname "$log")" || stop "Cannot make the folder $(dirname "$log"): set MESHLESS_SURGERY_OUTPUT to another."
  : >"$log"
  showProgress "$title" "$log" $$ 9>&- &
  progress_process=$!
  "$@" >"$log" 2>&1 </dev/null || status=$?
  stopProgress
  step_seconds=$((SECONDS - start))
  stages+=("$step_seconds $title")
  return "$status"
}

# runStep TITLE LOG COMMAND...: as runLogged; silent when the command is short and succeeds. Where it fails, shows the
# errors and the end of the log, and names it.
runStep() {
  local status=0
  runLogged "$@" || status=$?
  if ((status != 0)); then
    complain "$1: failed after $(secondsAsText "$step_seconds")"
    showFailure "$2" >&2
  elif ((step_seconds > quiet_seconds)); then
    say "$1: done in $(secondsAsText "$step_seconds")"
  fi
  return "$status"
}

# showFailure LOG: a parallel build goes on for a while after an error, so the errors come first, then the end.
showFailure() {
  local errors
  errors=$(grep -n -m 10 -E '(^E: |error:|Error [0-9]|CMake Error|undefined reference)' "$1")
  if [[ -n $errors ]]; then printf '%s\n  ...\n' "$errors" | cut -c 1-300; fi
  tail -n 20 "$1" | cut -c 1-300
  say "The whole log: $1"
}
