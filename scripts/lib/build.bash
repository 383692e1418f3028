# shellcheck shell=bash
# Configuring and building, out of the checkout. Sourced after common.bash.

# parallelJobs: as many as there are processors, but each with 2 GB: a file with CGAL's Delaunay takes 1 GB and more.
parallelJobs() {
  local processors kilobytes limit jobs
  processors=$(nproc)
  kilobytes=$(awk '/^MemAvailable:/ {print $2}' /proc/meminfo)
  limit=$(cat /sys/fs/cgroup/memory.max 2>/dev/null)
  if [[ $limit =~ ^[0-9]+$ ]] && ((limit / 1024 < kilobytes)); then kilobytes=$((limit / 1024)); fi
  jobs=$((kilobytes / 2000000))
  if ((jobs > processors)); then jobs=$processors; fi
  if ((jobs < 1)); then jobs=1; fi
  printf '%d\n' "$jobs"
}

# inCleanEnvironment COMMAND...: a build does not depend on which workspace the terminal has sourced before.
inCleanEnvironment() {
  env -u CMAKE_PREFIX_PATH -u ROS_PACKAGE_PATH -u PYTHONPATH -u PYTHONHOME -u ROS_ROOT -u MAKEFLAGS -u MAKELEVEL "$@"
}

# What every build here goes by: a linker and a compiler cache that are used where they are installed.
commonArguments() {
  printf '%s\n' -G Ninja
  if command -v ld.lld >/dev/null; then
    printf '%s\n' -DCMAKE_EXE_LINKER_FLAGS=-fuse-ld=lld -DCMAKE_SHARED_LINKER_FLAGS=-fuse-ld=lld
  fi
  if command -v ccache >/dev/null; then printf '%s\n' -DCMAKE_CXX_COMPILER_LAUNCHER=ccache; fi
}
# No messages for Lisp: a process for each of them, and nothing here reads what it writes.
export ROS_LANG_DISABLE=${ROS_LANG_DISABLE-genlisp}
export CCACHE_SLOPPINESS=${CCACHE_SLOPPINESS:-pch_defines,time_macros,include_file_mtime,include_file_ctime}

# configure FOLDER CMAKE_ARGUMENTS...: where it has not been done with these arguments yet. Changed CMake files are
# ninja's business.
configure() {
  local folder=$1 arguments
  shift
  arguments=$(printf '%s\n' "$@")
  if [[ -f $folder/build.ninja && $(cat "$folder/configured_with" 2>/dev/null) == "$arguments" ]]; then return 0; fi
  mkdir -p "$folder" || return
  rm -f "$folder/configured_with"
  if [[ ! -f $folder/build.ninja ]]; then rm -rf "$folder/CMakeCache.txt" "$folder/CMakeFiles"; fi  # another generator's
  if ! inCleanEnvironment cmake -S "$checkout" -B "$folder" "$@"; then
    rm -f "$folder/CMakeCache.txt"  # it remembers what was missing
    return 1
  fi
  printf '%s\n' "$arguments" >"$folder/configured_with"
}

# build TITLE FOLDER TARGETS... -- CMAKE_ARGUMENTS...: one build at a time in the output folder, by a lock on file 9.
build() {
  local title=$1 folder=$2 targets=() common log status=0
  mapfile -t common < <(commonArguments)
  shift 2
  while (($# > 0)) && [[ $1 != -- ]]; do
    targets+=("$1")
    shift
  done
  shift
  if [[ $checkout == *[[:space:]]* ]]; then stop "ROS 1 does not build in a path with spaces: $checkout"; fi
  mkdir -p "$folder" "$logs" || stop "Cannot write to $output: set MESHLESS_SURGERY_OUTPUT to another folder."
  exec 9>"$output/lock"
  if ! flock -n 9; then
    say "Waiting for another build in $output"
    flock 9
  fi
  log=$logs/$(basename "$folder")
  runStep "Configuring $title" "$log.configure.log" configure "$folder" "${common[@]}" "$@" &&
    runStep "Building $title" "$log.build.log" \
      inCleanEnvironment ninja -C "$folder" -j "$(parallelJobs)" "${targets[@]}" ||
    status=1
  exec 9>&-
  return "$status"
}

# buildPackage TARGETS...: the node, the tools and, with the target `tests`, the tests.
buildPackage() {
  # catkin freezes the tests' environment at the first configuring, and leaves out folders that are not there yet.
  mkdir -p "$output/devel/lib/python3/dist-packages" || stop "Cannot write to $output."
  build "the package" "$output/build" "$@" -- -DCATKIN_DEVEL_PREFIX="$output/devel" -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_INSTALL_PREFIX="$output/install" \
    -DPYTHON_EXECUTABLE=/usr/bin/python3 -DPython3_EXECUTABLE=/usr/bin/python3
}

# buildSanitized ON|OFF TARGETS...: the core and its tests under AddressSanitizer and UndefinedBehaviorSanitizer, without ROS; with
# or without what takes longest: see MESHLESS_SURGERY_SANITIZE_ALL.
buildSanitized() {
  build "the core with sanitizers" "$output/sanitized" "${@:2}" -- -DMESHLESS_SURGERY_CORE_ONLY=ON \
    -DMESHLESS_SURGERY_SANITIZE=ON "-DMESHLESS_SURGERY_SANITIZE_ALL=$1" -DBUILD_TESTING=ON \
    -DCMAKE_UNITY_BUILD=OFF -DCMAKE_BUILD_TYPE=RelWithDebInfo "-DCMAKE_CXX_FLAGS_RELWITHDEBINFO=-O1 -g1"
}

# buildSanitizedNode: the node and the replay under the same two, in a folder that rostest can be run from.
buildSanitizedNode() {
  local folder=$output/node_sanitized
  mkdir -p "$folder/devel/lib/python3/dist-packages" || stop "Cannot write to $output."
  build "the node with sanitizers" "$folder" deformer_node replay meshless_surgery_generate_messages -- \
    -DCATKIN_DEVEL_PREFIX="$folder/devel" -DMESHLESS_SURGERY_SANITIZE=ON -DMESHLESS_SURGERY_SANITIZE_ALL=ON \
    -DCMAKE_BUILD_TYPE=RelWithDebInfo "-DCMAKE_CXX_FLAGS_RELWITHDEBINFO=-O1 -g1" \
    -DPYTHON_EXECUTABLE=/usr/bin/python3 -DPython3_EXECUTABLE=/usr/bin/python3
}

# The rostests that it is put through: all but those that look at the clock, and large scenes.
sanitized_node_tests='_rostest_test_ros_(session|services|streams|topics|contacts|parameters|stations|fuzz|robust|'
sanitized_node_tests+='tools)\.test$'

# The rooms whose tests use more than one thread.
thread_tests='^(world|dynamics|stress)$'

# buildThreadSanitized: those under ThreadSanitizer, without ROS.
buildThreadSanitized() {
  build "the core with ThreadSanitizer" "$output/tsan" all -- -DMESHLESS_SURGERY_CORE_ONLY=ON \
    -DMESHLESS_SURGERY_TSAN=ON -DBUILD_TESTING=ON -DCMAKE_UNITY_BUILD=OFF -DCMAKE_BUILD_TYPE=RelWithDebInfo \
    "-DCMAKE_CXX_FLAGS_RELWITHDEBINFO=-O1 -g1"
}

# buildFuzzers: the libFuzzer targets, with clang.
buildFuzzers() {
  build "the fuzzers" "$output/fuzz" fuzz_mesh_file fuzz_scene_file fuzz_cut_plane -- -DMESHLESS_SURGERY_CORE_ONLY=ON \
    -DMESHLESS_SURGERY_FUZZ=ON -DBUILD_TESTING=OFF -DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++ \
    -DCMAKE_BUILD_TYPE=RelWithDebInfo "-DCMAKE_CXX_FLAGS_RELWITHDEBINFO=-O1 -g1"
}
