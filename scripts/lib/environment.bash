# shellcheck shell=bash
# Where the scripts build, and the environment of a terminal that uses that build. Wants the variable `checkout`.
# Sourced into the user's own terminal by scripts/setup.bash: it defines functions and runs nothing.

# The build lives outside of the checkout: rosrun searches the whole package folder, and would find everything twice.
# One folder for each checkout, so that two of them do not mix. It compares the first letters of paths alone, so that
# CHECKOUT_out would be in CHECKOUT.
outputFolder() {
  local cache=${XDG_CACHE_HOME:-${HOME:-/var/tmp}/.cache} folder
  folder=$cache/meshless_surgery/$(basename "$checkout")-$(printf '%s' "$checkout" | sha256sum | cut -c 1-8)
  folder=$(realpath -m "${MESHLESS_SURGERY_OUTPUT:-$folder}")
  if [[ $folder == "$checkout"* ]]; then
    printf '%s\n' "The build would go to $folder, whose path begins with that of the checkout, $checkout: rosrun would" \
      "find each script twice, and ask. Set MESHLESS_SURGERY_OUTPUT to a folder whose path begins otherwise." >&2
    return 1
  fi
  printf '%s\n' "$folder"
}

# Debian's ROS belongs to /usr/bin/python3; pyenv, conda and the like put another one before it.
preferSystemPython() {
  case $PATH in
    /usr/bin:*) ;;
    *) export PATH=/usr/bin:$PATH ;;
  esac
}

# One machine needs no network: the loopback works without a resolvable host name, and no one else can connect.
# Whoever has set a master has their own mind about the addresses too.
useLoopbackByDefault() {
  if [[ -z ${ROS_MASTER_URI:-} ]]; then
    export ROS_MASTER_URI=http://127.0.0.1:11311
    if [[ -z ${ROS_IP:-}${ROS_HOSTNAME:-} ]]; then export ROS_IP=127.0.0.1; fi
  fi
}

# useBuild OUTPUT: the ROS environment of that build. catkin's script does not hold under `set -eu`.
useBuild() {
  preferSystemPython
  useLoopbackByDefault
  local options=$-
  set +eu
  # shellcheck source=/dev/null
  source "$1/devel/setup.bash"
  if [[ $options == *e* ]]; then set -e; fi
  if [[ $options == *u* ]]; then set -u; fi
}
