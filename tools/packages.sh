#!/bin/bash
# Installs the Debian packages that whittle needs and that are missing: the one list of them.
#
# usage: tools/packages.sh build | test | browser | bench
#
# "build" is enough for the command and the library, "test" adds what the tests use, "browser" what
# one test of whittle report does, which skips without (some 120 MiB), "bench" what bench/run
# compares with. Where everything is installed nothing is called and no network is needed.
set -euo pipefail

build_packages=(gcc libc6-dev make cmake pkg-config libxxhash-dev libjansson-dev libhwloc-dev
	libpng-dev libjpeg62-turbo-dev zlib1g-dev libzstd-dev libjs-three)
test_packages=(ninja-build clang libomp-dev libclang-rt-14-dev libcmocka-dev
	clang-format clang-tidy binutils python3 valgrind zstd libopenmpi-dev openmpi-bin)
browser_packages=(chromium chromium-driver)
# The last line is MeshLab, with a display and OpenGL of software, which its server wants; the one
# before it a cluster for bench/slurm.
bench_packages=(g++ python3 python3-matplotlib valgrind libmeshoptimizer-dev libopenmesh-dev
	libcgal-dev libeigen3-dev libvtk9-dev libgts-dev
	libopenmpi-dev openmpi-bin slurmctld slurmd slurm-client munge
	meshlab xvfb xauth libgl1-mesa-dri)

is_installed() {
	[ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

as_root() {
	if [ "$(id -u)" -eq 0 ]; then
		"$@"
	elif command -v sudo >/dev/null; then
		sudo "$@"
	else
		echo "please run as root: $*" >&2
		return 1
	fi
}

install_missing() {
	local p missing=()
	for p in "$@"; do
		is_installed "$p" || missing+=("$p")
	done
	[ ${#missing[@]} -eq 0 ] && return
	echo "installing Debian packages: ${missing[*]}"
	as_root apt-get update -qq
	as_root env DEBIAN_FRONTEND=noninteractive \
		apt-get install -y -qq --no-install-recommends "${missing[@]}"
}

case ${1:-} in
build) packages=("${build_packages[@]}") ;;
test) packages=("${build_packages[@]}" "${test_packages[@]}") ;;
browser) packages=("${build_packages[@]}" "${test_packages[@]}" "${browser_packages[@]}") ;;
bench) packages=("${build_packages[@]}" "${bench_packages[@]}") ;;
*)
	echo "usage: $0 build | test | browser | bench" >&2
	exit 2
	;;
esac
if command -v dpkg-query >/dev/null; then
	install_missing "${packages[@]}"
else
	echo "no Debian: taking for granted what these packages hold: ${packages[*]}"
fi
