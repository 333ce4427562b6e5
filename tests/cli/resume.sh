# whittle reduce --run-dir, --resume: killed at random moments (bench/kill), disks that fill up,
# signals, the words and statuses. (test_resume.c stops at chosen ones and damages what is kept.)
kill_moments=$(realpath "$(dirname "$0")/../../bench/kill")
. "$(dirname "$0")/lib.sh"
use_temp
mkdir place
if ! python3 -c 'import subprocess' 2>/dev/null; then
	echo "skipped: there is no python3"
	exit 77
fi
faces=200K moments=6
[ -z "${WHITTLE_SANITIZE:-}" ] || faces=30K moments=3
"$WHITTLE" generate -q -o in.ply --faces "$faces" --order shuffled || exit 1
"$WHITTLE" generate -q -o text.ply --faces 40K --ascii || exit 1
options="--no-progress --cluster-faces 15K --micro-faces 5K --final-faces 8K"

# A height field of quadrilaterals, which are rewritten first.
python3 - <<'E2'
import math, struct
n = 120
with open("quads.ply", "wb") as f:
    f.write(("ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\n"
             "property float y\nproperty float z\nelement face %d\nproperty list uchar int "
             "vertex_indices\nend_header\n" % (n * n, (n - 1) * (n - 1))).encode())
    for i in range(n * n):
        x, y = i % n, i // n
        f.write(struct.pack("<3f", x, y, 5 * math.sin(x / 9) * math.cos(y / 7) + i * 7919 % 13 / 20))
    for i in range((n - 1) * (n - 1)):
        a = i // (n - 1) * n + i % (n - 1)
        f.write(struct.pack("<B4i", 4, a, a + 1, a + n + 1, a + n))
E2

# ---- kill -9 ----
# killed INPUT OPTIONS...
killed() {
	local input=$1
	shift
	# shellcheck disable=SC2086
	"$kill_moments" "$WHITTLE" place $moments 1 "$input" -- $options "$@" || fail "kills: $input $*"
	rm -rf place
	mkdir place
	[ -z "$(ls -A temp)" ] || fail "temporary files: $(ls -A temp)"
}
killed in.ply --faces 2K
killed in.ply --faces 12K
killed text.ply --faces 12K
killed quads.ply --faces 1K

# ---- signals ----
cat >signals.py <<'E2'
import os, shutil, signal, subprocess, sys, time
command = sys.argv[1:]
for s in (signal.SIGINT, signal.SIGHUP):
    signal.signal(s, signal.SIG_DFL)


def catches(pid, sig):
    with open("/proc/%d/status" % pid) as status:
        mask = next(int(line.split()[1], 16) for line in status if line.startswith("SigCgt"))
    return mask >> (sig - 1) & 1


bad = kept = 0
for sig, want in ((signal.SIGTERM, 143), (signal.SIGUSR1, 143), (signal.SIGINT, 130)) * 2:
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    while run.poll() is None and not catches(run.pid, sig):
        time.sleep(0.001)
    while run.poll() is None and not os.path.exists("place/my run/whittle-run/step-2"):
        time.sleep(0.001)  # until the first round begins
    sent = time.monotonic()
    run.send_signal(sig)
    words = run.communicate()[1]
    took = time.monotonic() - sent
    if run.returncode == 0:
        os.unlink("place/out.ply")
        continue
    kept += 1
    if run.returncode != want or took > 10 or "to go on:\n  whittle reduce --resume" not in words:
        print("FAILED: status %d after %.1f s: %s" % (run.returncode, took, words))
        bad = 1
    if os.listdir("place") != ["my run"]:
        print("FAILED: left", os.listdir("place"))
        bad = 1
    resume = words.split("to go on:\n  whittle ")[1].strip()  # what the words say, as they say it
    if subprocess.call(["sh", "-c", '"$WHITTLE" ' + resume + " >out 2>err"]) != 0:
        print("FAILED:", resume, open("err").read())
        bad = 1
    elif open("base.ply", "rb").read() != open("place/out.ply", "rb").read():
        print("FAILED: other bytes after", resume)
        bad = 1
    shutil.rmtree("place")
    os.mkdir("place")
print("%d of 6 signals came in time" % kept)
sys.exit(bad or kept < 2)
E2
# shellcheck disable=SC2086
expect 0 "$WHITTLE" reduce in.ply -o base.ply $options --faces 12K
# shellcheck disable=SC2086
python3 signals.py "$WHITTLE" reduce in.ply -o place/out.ply $options --faces 12K --run-dir 'place/my run' ||
	fail signals

# ---- full disks ----
# refuse ARGUMENTS...: what is needed, with status 5 where it was foreseen, and 1 where the disk filled
# up while the input was rewritten
refuse() {
	local status=0
	"$WHITTLE" reduce "$@" >out 2>err || status=$?
	if [ "$1" = in.ply ] || [ $status -eq 5 ]; then
		[ $status -eq 5 ] || fail "status $status: $(cat err)"
		grep -q "'small/run.* bytes free, and this run will need about [0-9]* .*--run-dir" err ||
			fail "words: $(cat err)"
	else
		[ $status -eq 1 ] || fail "status $status: $(cat err)"
		grep -q "no space left in 'small/run.*[0-9] more to come next.*--resume" err ||
			fail "words: $(cat err)"
	fi
}

# stop_in_first_round INPUT: with all the room there is
stop_in_first_round() {
	local status=0 pid
	mount -o remount,size=100m small
	while [ $status -eq 0 ]; do
		rm -f place/out.ply
		# shellcheck disable=SC2086
		"$WHITTLE" reduce "$1" -o place/out.ply $options --faces 12K --run-dir small/run \
			>out 2>err &
		pid=$!
		while kill -0 $pid 2>/dev/null && [ ! -e small/run/whittle-run/step-2 ]; do :; done
		kill -TERM $pid 2>/dev/null
		wait $pid
		status=$?
	done
	[ $status -eq 143 ] && grep -q 'to go on' err || fail "status $status: $(cat err)"
}

mkdir small
if mount -t tmpfs -o size=128k tmpfs small 2>/dev/null; then
	mounted=$dir/small
	for input in in.ply text.ply; do
		# shellcheck disable=SC2086
		expect 0 "$WHITTLE" reduce $input -f -o base.ply $options --faces 12K
		# Until the input is in, the disk fills up at three sizes. Then there is hardly any room
		# besides what is on it, more whenever nothing came of that: it fills up in every step.
		resumed=0 refusals=0 more=16 last='' at=''
		for kib in 128 256 512; do
			mount -o "remount,size=${kib}k" small
			# shellcheck disable=SC2086
			refuse $input -o place/out.ply $options --faces 12K --run-dir small/run
			[ -z "$(ls -A small)" ] || fail "left of $kib KiB: $(ls -A small)"
		done
		stop_in_first_round $input
		kib=$(du -sk small | cut -f 1)
		while [ $refusals -lt 200 ]; do
			mount -o "remount,size=${kib}k" small
			# shellcheck disable=SC2086
			"$WHITTLE" reduce $input -o place/out.ply $options --faces 12K --run-dir small/run \
				--resume --report report.json >out 2>err && break
			[ $? -eq 1 ] || fail "status with $kib KiB: $(cat err)"
			refusals=$((refusals + 1))
			grep -q "no space left in 'small/run.*--resume" err || fail "words: $(cat err)"
			[ -z "$(ls -A place temp | grep ply)" ] || fail "left outside: $(ls -A place temp)"
			[ -z "$(find small -name '*.part')" ] || fail "half done: $(find small)"
			grep -q 'to go on' err || fail "nothing is kept: $(cat err)"
			resumed=$((resumed + 1))
			steps=$(grep -c '^\[step' small/run/whittle-run/manifest)
			at="$at $steps"
			[ "$steps" = "$last" ] && more=$((more * 2)) || more=16
			last=$steps
			kib=$(($(du -sk small | cut -f 1) + more))
		done
		cmp -s base.ply place/out.ply || fail "other bytes after full disks: $input"
		[ -z "$(ls -A small)" ] || fail "left in the end: $(ls -A small)"
		[ $resumed -ge 4 ] || fail "only $resumed disks filled up on the way"
		grep -q '"resumed": [1-9]' report.json || fail "report: $(grep resumed report.json)"
		echo "$input: $refusals disks too small, after as many steps:$at"
		rm -f place/out.ply report.json
	done
	umount small
	mounted=
else
	echo "skipped: disks that fill up (nothing can be mounted)"
fi

# ---- words ----
expect 2 "$WHITTLE" reduce text.ply -o never.ply --faces 1K --resume
grep -q -- '--resume needs the --run-dir' err || fail "words: $(cat err)"
expect 1 "$WHITTLE" reduce text.ply -o never.ply --faces 1K --run-dir nowhere/run
grep -q "nowhere/run" err || fail "words: $(cat err)"
expect 0 "$WHITTLE" reduce text.ply -o - --faces 1K --run-dir run
cp out piped.ply
expect 0 "$WHITTLE" reduce text.ply -o direct.ply --faces 1K
cmp -s piped.ply direct.ply || fail "other bytes to standard output"
expect 0 "$WHITTLE" reduce text.ply -o copy.ply --faces 100% --run-dir run
cmp -s text.ply copy.ply || fail "a copy"
[ ! -e run ] || fail "a run directory after the end"
[ ! -e never.ply ] || fail "an output of a wrong command"

[ $failures -eq 0 ] || exit 1
echo "resume: ok"
