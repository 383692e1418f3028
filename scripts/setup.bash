# shellcheck shell=bash
# To be sourced: rosrun, roslaunch, rosservice and Python clients in this terminal find the build of scripts/train.
#   source scripts/setup.bash

if [ -z "${BASH_VERSION:-}" ]; then
  echo "scripts/setup.bash is for bash: start one first." >&2
  return 1
fi

_meshlessSurgerySetup() {
  local checkout output
  checkout=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
  # shellcheck source=scripts/lib/environment.bash
  source "$checkout/scripts/lib/environment.bash"
  output=$(outputFolder) || return 1
  if [[ -f $output/devel/setup.bash ]]; then
    useBuild "$output"
  else
    echo "Nothing is built yet: run $checkout/scripts/train --build-only first." >&2
    return 1
  fi
}
_meshlessSurgerySetup
_meshless_surgery_status=$?
unset -f _meshlessSurgerySetup outputFolder preferSystemPython useLoopbackByDefault useBuild
if ((_meshless_surgery_status == 0)); then unset _meshless_surgery_status; else
  unset _meshless_surgery_status
  # shellcheck disable=SC2317
  return 1 2>/dev/null || exit 1
fi
