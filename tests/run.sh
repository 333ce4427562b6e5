#!/bin/bash
# Builds whittle in every way that has to work and runs all tests; installs what is missing.
#
# usage: tests/run.sh [CTEST-OPTION ...]      for example: tests/run.sh -R reduce
#
# Five builds (see CMakePresets.json) in build/ci, one run of ctest over all of them; a test's
# name begins with the build it belongs to. Its closing lines come last, its status is ours.
set -euo pipefail
cd "$(dirname "$0")/.."

jobs=$(nproc)
builds=(release release-clang debug tsan plain)

# What runs in a build that does not run everything: tests in which threads meet, and tests
# that show the command whole without threads and hwloc.
threads='exec|bvh|test_compare|ingest|inspect|test_reduce|round|ply_body|ply_source|synth|store|check$'
plain='cli_(reduce|check|generate|report)$'
# Sanitizers: all but what has no code of ours in it, asks for memory as it is without them, or is
# long and has its parts in other tests.
debug='test_|cli_(attributes|check|compare|formats|hygiene|mpi|offset|reduce|render|resume|stages|topology)'
# Another compiler: what computes. The command around it is the same C in both.
clang='test_|cli_(reduce|check|generate|topology|offset|modulemap|install)'

# build PRESET CMAKE-OPTION...
build() {
	local preset=$1 dir=build/ci/$1
	shift
	echo "== building: $preset"
	cmake --preset "$preset" -B "$dir" -G Ninja --log-level=WARNING \
		-DWHITTLE_TEST_PREFIX="$preset." "$@" >/dev/null
	cmake --build "$dir" -j "$jobs" -- --quiet
}

# Some kernels spread addresses wider than ThreadSanitizer of clang 14 can map.
without_random_addresses() {
	if build/ci/tsan/whittle --version >/dev/null 2>&1; then
		"$@"
	else
		setarch "$(uname -m)" -R "$@"
	fi
}

run_all() {
	local b
	for b in "${builds[@]}"; do
		echo "subdirs($b)"
	done >build/ci/CTestTestfile.cmake
	without_random_addresses ctest --test-dir build/ci -j "$jobs" --output-on-failure "$@"
}

tools/packages.sh test
build release -DWHITTLE_TIDY=ON
build release-clang -DWHITTLE_TESTS_ONLY="$clang"
build debug -DWHITTLE_TESTS_ONLY="$debug"
build tsan -DWHITTLE_TESTS_ONLY="$threads"
build plain -DWHITTLE_TESTS_ONLY="$plain"
echo "== testing"
run_all "$@"
