# What cmake --install leaves is enough for a program of somebody else.
set -euo pipefail
build=${WHITTLE_BUILD:?the build folder}
cc=${CC:-cc}
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"

sanitize=()
[ -z "${WHITTLE_SANITIZE:-}" ] || sanitize=("-fsanitize=$WHITTLE_SANITIZE")

cat >reduce.c <<'END'
#include <stdio.h>
#include <whittle.h>

int main(int argc, char **argv)
{
	wh_mem mem = {0};
	wh_ctx ctx = {.mem = &mem};
	wh_reduce_params params = wh_reduce_defaults();
	wh_reduce_report report;
	if (argc != 3)
		return 2;
	params.input = argv[1];
	params.output = argv[2];
	params.faces = 500;
	if (wh_reduce(&ctx, &params, &report) != WH_OK) {
		fprintf(stderr, "%s\n", ctx.err.text);
		return 1;
	}
	printf("%llu\n", (unsigned long long)report.output_faces);
	return 0;
}
END

cmake --install "$build" --prefix "$dir/prefix" >log || { cat log && exit 1; }
pc=$(find prefix -name whittle.pc)
export PKG_CONFIG_PATH=$dir/${pc%/*}
read -ra flags <<<"$(pkg-config --cflags --libs whittle)"
"$cc" -std=c17 -Wall -Wextra -Werror "${sanitize[@]}" -o reduce reduce.c "${flags[@]}"

"$dir"/prefix/bin/whittle generate -q --faces 5K -o in.ply
[ "$(./reduce in.ply out.ply)" = 500 ] || { echo "FAILED: not 500 faces" && exit 1; }
version=$(pkg-config --modversion whittle)
[ "$("$dir"/prefix/bin/whittle --version | head -n 1)" = "whittle $version" ] ||
	{ echo "FAILED: whittle.pc says version $version" && exit 1; }
echo "a program built against the installed library works"
