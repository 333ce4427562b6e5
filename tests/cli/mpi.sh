# whittle reduce by several processes of an MPI job: the bytes of one, for any number of them; and
# what happens when one of them fails.
here=$(realpath "$(dirname "$0")")
. "$(dirname "$0")/lib.sh"
if ! "$WHITTLE" --version | grep -q MPI; then
	echo "skipped: built without MPI"
	exit 77
fi
if ! mpirun --version 2>/dev/null | grep -q 'Open MPI'; then
	echo "skipped: there is no mpirun of Open MPI"
	exit 77
fi
mkdir temp
export TMPDIR=$dir/temp
run=(mpirun --oversubscribe --bind-to none)
[ "$(id -u)" -ne 0 ] || run+=(--allow-run-as-root)
faces=100K moments=3 several=("2 2" "4 1")
[ -z "${WHITTLE_SANITIZE:-}" ] || faces=30K moments=0 several=("2 2")
case ${WHITTLE_SANITIZE:-} in
*address*)
	# Whose a leak is cannot be told when Open MPI has unloaded its plugins: they stay.
	echo 'int dlclose(void *module) { return module == 0; }' >keep.c
	"$CC" -shared -fPIC -o keep.so keep.c || exit 1
	run+=(-x "LD_PRELOAD=$("$CC" -print-file-name=libasan.so):$dir/keep.so")
	export LSAN_OPTIONS=suppressions=$here/../openmpi.supp:print_suppressions=0
	export ASAN_OPTIONS=fast_unwind_on_malloc=0
	;;
esac
"$WHITTLE" generate -q -o in.ply --faces $faces --order shuffled || exit 1
options="--cluster-faces 10K --micro-faces 4K --final-faces 8K"
# shellcheck disable=SC2086
"$WHITTLE" reduce in.ply -o plain.ply -q $options --faces 15% || exit 1

# ranks N THREADS OPTION...
ranks() {
	local n=$1 threads=$2
	shift 2
	# shellcheck disable=SC2086
	timeout 120 "${run[@]}" -n "$n" "$WHITTLE" reduce in.ply -o out.ply --no-progress $options --faces 15% \
		--threads "$threads" "$@" >out 2>err
}
whole() {
	cmp plain.ply out.ply || fail "other bytes: $*: $(cat err)"
	rm -f out.ply
}
for n in "${several[@]}"; do
	# shellcheck disable=SC2086
	ranks $n --report "report${n% *}.json" --measure || fail "$n: $(cat err)"
	whole "$n"
	[ ! -e out.ply.run ] || fail "$n: the run directory is left"
	grep -q "\"ranks\": ${n% *}" "report${n% *}.json" || fail "$n: ranks in the report"
	[ "$(grep -c '^measured: RMS ' out)" -eq 1 ] || fail "$n: not measured once: $(cat out)"
	[ "$(grep -c 'faces ->' out)" -eq 1 ] || fail "$n: not one summary: $(cat out)"
done

# ---- one fails ----
# a run directory that is in the way of one rank: no space in its folder of temporary files
ranks 2 1 --run-dir run --temp-dir "$dir/nowhere" && fail "no temporary folder is no failure"
grep -q 'process [01] of 2, on .*, ends the run' err || fail "who has failed: $(cat err)"
grep -q 'nowhere' err || fail "what has failed: $(cat err)"
ranks 3 1 --run-dir run && fail "going on without --resume"
# killed as soon as there is something to go on with
rm -rf run
ranks 3 1 --run-dir "$dir/run" &
pid=$!
for ((i = 0; i < 3000; i++)); do
	[ -e run/whittle-run/scan ] && break
	sleep 0.01
done
for victim in $(pgrep -f "reduce in.ply .*--run-dir $dir/run"); do
	if read -r name <"/proc/$victim/comm" && [ "$name" = "$(basename "$WHITTLE")" ]; then
		kill -9 "$victim"
		break
	fi
done
wait $pid && fail "a killed process is no failure"
ranks 2 1 --run-dir run --resume -v || fail "resumed by fewer: $(cat err)"
whole "resumed by fewer"
[ -s run/log-rank-00001 ] || fail "no log: $(ls run)"
[ ! -e run/whittle-run ] || fail "left: $(ls run/whittle-run)"

# one of up to three, killed at any moment, resumed by another number of them
# shellcheck disable=SC2086
[ $moments -eq 0 ] || timeout 120 "$here/../../bench/kill" "$WHITTLE" kills $moments 1 in.ply 3 -- \
	$options --faces 15% >out || fail "kills: $(cat out)"

# a launcher that was there, for one process alone, or for a program that is no reduce
OMPI_COMM_WORLD_SIZE=1 expect 0 "$WHITTLE" reduce in.ply -f -q -o out.ply --faces 1K
OMPI_COMM_WORLD_SIZE=4 expect 0 "$WHITTLE" info in.ply
[ "$failures" -eq 0 ] && echo "ranks make no difference"
exit $((failures > 0))
