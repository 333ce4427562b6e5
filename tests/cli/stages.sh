# whittle plan --run-dir and whittle stage: the bytes of a plain run, whatever the parts, their order
# and their accidents; and the words when something is missing.
. "$(dirname "$0")/lib.sh"
use_temp
faces=100K
[ -z "${WHITTLE_SANITIZE:-}" ] || faces=70K
"$WHITTLE" generate -q -o in.ply --faces "$faces" --order shuffled || exit 1
"$WHITTLE" generate -q -o text.ply --faces 20K --ascii || exit 1
sizes="--cluster-faces 10K --micro-faces 4K --final-faces 8K"

# plain INPUT OPTIONS...: the result of one process, plain.ply
plain() {
	local input=$1
	shift
	# shellcheck disable=SC2086
	"$WHITTLE" reduce "$input" -o plain.ply -f -q $sizes "$@" || fail "plain: $*"
}
# plan INPUT PARTS OPTIONS...: a new run directory, run; its stages in the file stages
plan() {
	local input=$1 parts=$2
	shift 2
	rm -rf run staged.ply
	# shellcheck disable=SC2086
	expect 0 "$WHITTLE" plan "$input" -o staged.ply --run-dir run --parts "$parts" $sizes "$@"
	grep -o 'whittle stage .*' out | cut -d' ' -f3- >stages
}
# stage WORDS...: one of them, with I for all parts from the last to the first
stage() {
	local line=$* i
	case $line in
	*I/*)
		for ((i = ${line##*I/}; i > 0; i--)); do
			# shellcheck disable=SC2086
			expect 0 "$WHITTLE" stage ${line/I\//$i/}
		done
		;;
	*) expect 0 "$WHITTLE" stage "$@" ;;
	esac
}
# whole: the run is done, as the plain one, and nothing is left
whole() {
	cmp plain.ply staged.ply || fail "not the bytes of a plain run: $*"
	[ ! -e run ] || fail "the run directory is still there: $*: $(ls -R run)"
	[ -z "$(ls -A temp)" ] || fail "temporary files: $*: $(ls -A temp)"
}
# all_stages WORDS...
all_stages() {
	local line
	while read -r line; do
		# shellcheck disable=SC2086
		stage $line
	done <stages
	whole "$*"
}

expect 2 "$WHITTLE" stage ingest --run-dir run --part 0/3
grep -q "'0/3' is not a part such as 3/16" err || fail "what a part is: $(cat err)"

# ---- bytes ----
# one mesh in memory at the end, by more parts than there are pieces of the input (below: streamed)
for run in "6 --faces 4K"; do
	# shellcheck disable=SC2086
	plain in.ply ${run#* }
	# shellcheck disable=SC2086
	plan in.ply $run
	all_stages "$run"
done
# text is rewritten, and ingested by the join; a copy has nothing to share
for run in "text.ply --faces 1K" "in.ply --faces 100%"; do
	# shellcheck disable=SC2086
	plain $run
	# shellcheck disable=SC2086
	plan ${run%% *} 2 ${run#* }
	! grep -q ingest stages || fail "$run: an ingest in parts is planned"
	all_stages "$run"
done
for scan in horse.ply mouse_C57BL_10J.ply; do
	if [ ! -r "$WHITTLE_DATA/scans/$scan" ]; then
		echo "no $scan: not tried"
		continue
	fi
	[ -z "${WHITTLE_SANITIZE:-}" ] || [ $scan = horse.ply ] || continue
	plain "$WHITTLE_DATA/scans/$scan" --faces 4%
	plan "$WHITTLE_DATA/scans/$scan" 2 --faces 4%
	all_stages "$scan"
done

# ---- accidents ----
plain in.ply --faces 20K
plan in.ply 4 --faces 20K
# planning again changes nothing; nor do other parts or another target come into the run
# shellcheck disable=SC2086
expect 0 "$WHITTLE" plan in.ply -o staged.ply --run-dir run --parts 4 $sizes --faces 20K
# shellcheck disable=SC2086
expect 2 "$WHITTLE" plan in.ply -o staged.ply --run-dir run --parts 5 $sizes --faces 20K
# shellcheck disable=SC2086
expect 2 "$WHITTLE" plan in.ply -o staged.ply --run-dir run --parts 4 $sizes --faces 2K
expect 2 "$WHITTLE" stage ingest --run-dir run --part 1/5
expect 2 "$WHITTLE" stage ingest --run-dir run --part 5
expect 1 "$WHITTLE" stage decimate --run-dir run --part 1/4 --round 1
grep -q 'cannot begin' err || fail "a round before its time: $(cat err)"
expect 1 "$WHITTLE" stage finish --run-dir run
grep -q 'missing of ingest: 1-4 of 4' err || fail "all parts are missing: $(cat err)"
expect 0 "$WHITTLE" stage ingest --run-dir run --part 2/4
# twice at once
"$WHITTLE" stage ingest --run-dir run --part 4/4 -q --no-progress &
"$WHITTLE" stage ingest --run-dir run --part 4/4 -q --no-progress || fail "one of two"
wait $! || fail "the other of two"
expect 1 "$WHITTLE" stage join --run-dir run
grep -q 'missing of ingest: 1, 3 of 4' err || fail "some parts are missing: $(cat err)"
# killed at work
"$WHITTLE" stage ingest --run-dir run --part 1/4 -q --no-progress &
sleep 0.02
kill -9 $!
wait $! 2>/dev/null
rm -rf temp/*
stage ingest --run-dir run --part 1/4
stage ingest --run-dir run --part 3/4 --memory 64M --threads 1
stage join --run-dir run
grep -q 'next: whittle stage decimate --round 1' out || fail "what is next: $(cat out)"
stage join --run-dir run
stage ingest --run-dir run --part 3/4 # long done
stage decimate --run-dir run --part 3/4 --round 1
expect 1 "$WHITTLE" stage decimate --run-dir run --part 3/4 --round 2
"$WHITTLE" stage decimate --run-dir run --part 1/4 --round 1 -q --no-progress &
"$WHITTLE" stage decimate --run-dir run --part 1/4 --round 1 -q --no-progress || fail "one of two"
wait $! || fail "the other of two"
"$WHITTLE" stage decimate --run-dir run --part 2/4 --round 1 -q --no-progress &
sleep 0.02
kill -9 $!
wait $! 2>/dev/null
for stage in join finish; do
	expect 1 "$WHITTLE" stage $stage --run-dir run
	grep -q 'missing of round 1: \(2, \)\?4 of 4\|round 1: 2, 4 of 4' err || fail "missing: $(cat err)"
done
stage decimate --run-dir run --round 1 --part I/4
# a cluster that is lost after it was done
rm -f run/whittle-run/round1-000005
stage join --run-dir run
for round in 2 3; do
	stage decimate --run-dir run --round $round --part I/4
	[ $round -eq 3 ] || stage join --run-dir run
done
stage finish --run-dir run
whole "accidents"

# ---- logs, another folder, going on alone ----
mkdir elsewhere
plan in.ply 2 --faces 20K
(cd elsewhere && expect 0 "$WHITTLE" stage ingest --run-dir ../run --part 1 -v --report part.json &&
	[ $failures -eq 0 ]) || fail elsewhere
# its half of 100 K or 70 K faces of 13 bytes, which it reads twice, with their vertices and the sample
bytes=$(grep -A 20 '"ingest": {' elsewhere/part.json | grep -o '"bytes_read": [0-9]*' | cut -d' ' -f2)
[ "${bytes:-0}" -gt $((${faces%K} * 13000)) ] || fail "report of a part: $(cat elsewhere/part.json)"
before=$(cksum <in.ply)
for taken in in.ply staged.ply elsewhere/part.json; do
	expect 2 "$WHITTLE" stage ingest --run-dir run --part 2 --report $taken
done
expect 2 "$WHITTLE" stage ingest --run-dir run --part 2 --report in.ply -f
[ "$before" = "$(cksum <in.ply)" ] || fail "the input was written over"
expect 1 "$WHITTLE" stage ingest --run-dir run --part 2 --report nowhere/part.json
[ "$(wc -l <err)" -eq 1 ] || fail "a report without a folder: $(cat err)"
stage ingest --run-dir run --part 2 --temp-dir elsewhere -v --report elsewhere/part.json -f
grep -q 'ingest .* s' run/log-ingest-part-00001 || fail "no log: $(ls run)"
stage join --run-dir run
stage decimate --run-dir run --part 1/2 --round 1
# shellcheck disable=SC2086
expect 0 "$WHITTLE" reduce in.ply -o staged.ply --run-dir run --resume $sizes --faces 20K
cmp plain.ply staged.ply || fail "going on alone changes the bytes"
[ "$(ls run)" = "$(printf 'log-ingest-part-00001\nlog-ingest-part-00002')" ] || fail "left: $(ls run)"
expect 1 "$WHITTLE" stage finish --run-dir run
grep -q 'holds no run in stages' err || fail "a run that is over: $(cat err)"

# ---- a disk that is full ----
if mkdir small && mount -t tmpfs -o size=5m none small 2>/dev/null; then
	mounted=$dir/small
	# what the plan foresees: too little room for clusters, or for the result, and none for a file
	small_plan() {
		local status=$1 output=$2 run_dir=$3 words=$4
		# shellcheck disable=SC2086
		expect "$status" "$WHITTLE" plan in.ply -o "$output" --run-dir "$run_dir" --parts 2 $sizes --faces 20K
		grep -q "$words" err || fail "words: $(cat err)"
		[ -z "$(ls small)" ] && [ ! -e elsewhere.run ] || fail "left: $(ls small)"
	}
	mount -o remount,size=100k small
	small_plan 5 staged.ply small/run "'small/run.*has [0-9]* bytes free.*need about [0-9]* .*--run-dir"
	small_plan 5 small/staged.ply elsewhere.run "folder of 'small/staged.ply' has [0-9]* bytes free.*will have [0-9]* or more"
	# shellcheck disable=SC2086
	expect 5 "$WHITTLE" reduce in.ply -o small/out.ply $sizes --faces 20K
	# shellcheck disable=SC2086
	expect 0 "$WHITTLE" reduce in.ply -o small/out.ply -q $sizes --faces 1K
	rm small/out.ply
	mount -o remount,size=5m,nr_inodes=1 small
	small_plan 1 staged.ply small/run "cannot make the folder 'small/run' (no inodes left"
	mount -o remount,nr_inodes=2 small
	small_plan 1 staged.ply small/run "cannot make the folder 'small/run/whittle-run' (no inodes left"
	mount -o remount,nr_inodes=3 small
	small_plan 1 staged.ply small/run "no inodes left for another file in 'small/run/whittle-run'"
	mount -o remount,nr_inodes=10000 small
	rm -f staged.ply
	# shellcheck disable=SC2086
	expect 0 "$WHITTLE" plan in.ply -o staged.ply --run-dir small/run --parts 2 $sizes --faces 20K
	full=0
	for stage in "ingest --part 1" "ingest --part 2" join "decimate --round 1 --part 1" \
		"decimate --round 1 --part 2" join "decimate --round 2 --part 1" \
		"decimate --round 2 --part 2" join "decimate --round 3 --part 1" \
		"decimate --round 3 --part 2" finish; do
		# as little room as the stage can be given: none, and then enough
		size=$(($(df --output=used -k small | tail -n 1) + 60))
		mount -o remount,size=${size}k small
		# shellcheck disable=SC2086
		if ! "$WHITTLE" stage $stage --run-dir small/run >out 2>err; then
			grep -q 'no space left in .* more to come' err || fail "$stage: $(cat err)"
			full=$((full + 1))
		fi
		mount -o remount,size=20m small
		# shellcheck disable=SC2086
		expect 0 "$WHITTLE" stage $stage --run-dir small/run
		[ "$stage" = finish ] && break
	done
	[ $full -ge 5 ] || fail "the disk was full in $full stages only"
	cmp plain.ply staged.ply || fail "full disks change the bytes"
	umount small
	mounted=
else
	echo "no tmpfs can be mounted: full disks are not tried"
fi

# ---- usage ----
expect 2 "$WHITTLE" stage
expect 2 "$WHITTLE" stage ingest --run-dir run
expect 2 "$WHITTLE" stage ingest --run-dir run --part 5/4
expect 2 "$WHITTLE" stage ingest --run-dir run --part 0/4
expect 2 "$WHITTLE" stage decimate --run-dir run --part 1/4
expect 2 "$WHITTLE" stage join --run-dir run --part 1/4
expect 2 "$WHITTLE" stage round --run-dir run
expect 2 "$WHITTLE" stage join --run-dir run --report ''
expect 2 "$WHITTLE" plan in.ply -o o.ply --faces 2K --run-dir run
expect 2 "$WHITTLE" plan in.ply --faces 2K --run-dir run --parts 3
expect 2 "$WHITTLE" reduce in.ply -o o.ply --faces 2K --parts 3
expect 0 "$WHITTLE" stage --help
[ "$failures" -eq 0 ] && echo "stages make no difference"
exit $((failures > 0))
