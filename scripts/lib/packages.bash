# shellcheck shell=bash
# Debian packages: what is missing, and installing it. Sourced after common.bash.

package_lists=("$checkout/scripts/packages.txt")

# missingPackages: those of the lists that are not installed, one a line. One call for all of them takes 50 ms.
missingPackages() {
  local wanted
  wanted=$(sed -e 's/#.*//' -e 's/[[:space:]]//g' -e '/^$/d' "${package_lists[@]}" | LC_ALL=C sort -u)
  # dpkg-query complains of packages that it has never heard of: these are missing, which is what the list says.
  # shellcheck disable=SC2086
  LC_ALL=C comm -23 <(printf '%s\n' "$wanted") \
    <(dpkg-query -W -f='${db:Status-Status} ${Package}\n' $wanted 2>/dev/null | sed -n 's/^installed //p' | LC_ALL=C sort -u)
}

# asRoot COMMAND...
asRoot() {
  if ((EUID == 0)); then "$@"; else sudo "$@"; fi
}

# aptInstall PACKAGES...: the lists may be older than the packages, or not there at all; where the network is away,
# what is in apt's cache may still do, so a failed update does not end it.
aptInstall() {
  local apt=(env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 -o Dpkg::Use-Pty=0)
  asRoot "${apt[@]}" update || say "apt-get update failed; going on with the lists that are there"
  asRoot "${apt[@]}" install -y --no-install-recommends "$@"
}

installPackages() {
  command -v dpkg-query >/dev/null || stop "This needs Debian 12 (or a system with its packages): no dpkg-query here."
  local missing
  mapfile -t missing < <(missingPackages)
  if ((${#missing[@]} == 0)); then return 0; fi
  say "Missing Debian packages (${#missing[@]}): ${missing[*]}"
  if ((EUID != 0)); then
    if ! command -v sudo >/dev/null; then
      stop "To install them takes root, and there is no sudo. As root, run:
  apt-get update && apt-get install -y --no-install-recommends ${missing[*]}"
    fi
    # Asks for a password here, where the question can be seen, and not inside of a step that writes to a log.
    if ! sudo -n true 2>/dev/null && ! { [[ -t 0 ]] && sudo -v; }; then
      stop "To install them takes root, and sudo gives it neither without a password nor with one. As root, run:
  apt-get update && apt-get install -y --no-install-recommends ${missing[*]}"
    fi
  fi
  runStep "Installing them and what they need" "$logs/packages.log" aptInstall "${missing[@]}" ||
    stop "The packages could not be installed. Tested is Debian 12; ROS 1 comes with its own packages there."
  mapfile -t missing < <(missingPackages)
  if ((${#missing[@]} != 0)); then stop "Still missing after the installation: ${missing[*]}"; fi
}
