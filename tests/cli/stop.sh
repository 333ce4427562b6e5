# whittle reduce: signals at any moment, kill -9, pipes nobody reads, full disks, two runs at once,
# no threads to be had. It ends soon, says what happened, leaves nothing, and the input is as it was.
# (test_stop.c stops in every phase and lets every system call fail; here it is real.)
. "$(dirname "$0")/lib.sh"
use_temp
mkdir place
if ! python3 -c 'import subprocess' 2>/dev/null; then
	echo "skipped: there is no python3"
	exit 77
fi
faces=300K soon=2
if [ -n "${WHITTLE_SANITIZE:-}" ]; then
	faces=30K soon=10 # sanitizers are slow, and slower beside other tests
fi
"$WHITTLE" generate -q -o in.ply --faces "$faces" --order shuffled || exit 1
"$WHITTLE" generate -q -o small.ply --faces 20K || exit 1
"$WHITTLE" generate -q -o text.ply --faces 40K --ascii || exit 1
sum=$(cksum <in.ply)
options="--no-progress --faces 2K --cluster-faces 40K --micro-faces 5K --final-faces 8K"

# clean WHEN: no output, nothing temporary, the input as it was
clean() {
	[ -z "$(ls -A temp)" ] || fail "temporary files $1: $(ls -A temp)"
	[ -z "$(ls -A place)" ] || fail "left in the output's folder $1: $(ls -A place)"
	[ "$(cksum <in.ply)" = "$sum" ] || fail "the input changed $1"
	rm -rf temp place
	mkdir temp place
}

# ---- signals, at 20 moments spread over a run ----
cat >signals.py <<'E2'
import os, signal, subprocess, sys, time
soon, command = float(sys.argv[1]), sys.argv[2:]
quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
for s in (signal.SIGINT, signal.SIGHUP):
    signal.signal(s, signal.SIG_DFL)  # a job in the background starts with them ignored
whole = 1e9
for i in range(3):
    start = time.monotonic()
    subprocess.run(command, check=True, **quiet)
    whole = min(whole, time.monotonic() - start)
    os.unlink("place/never.ply")


def catches(pid, sig):
    """Whether the process has its handler for this signal."""
    with open("/proc/%d/status" % pid) as status:
        mask = next(int(line.split()[1], 16) for line in status if line.startswith("SigCgt"))
    return mask >> (sig - 1) & 1


stopped = bad = 0
slowest = 0.0
for i in range(20):
    sig = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)[i % 3]
    run = subprocess.Popen(command, **quiet)
    while run.poll() is None and not catches(run.pid, sig):
        time.sleep(0.001)  # a signal before that is the shell's business
    time.sleep(whole * (i + 0.5) / 20)
    sent = time.monotonic()
    run.send_signal(sig)
    words = run.communicate()[1]
    slowest = max(slowest, time.monotonic() - sent)
    left = os.listdir("temp") + os.listdir("place")
    if run.returncode == 0 and left == ["never.ply"]:
        os.unlink("place/never.ply")  # it was faster this time
        continue
    if left or run.returncode != 128 + sig or "interrupted" not in words:
        print("FAILED: after", sig.name, "at", i, "of 20: status", run.returncode, words, left)
        bad = 1
    stopped += 1
print("whole run %.2f s; %d of 20 stopped, the slowest in %.2f s" % (whole, stopped, slowest))
if stopped < 8 or slowest > soon:
    print("FAILED: too few or too slow")
    bad = 1
sys.exit(bad)
E2
# shellcheck disable=SC2086
python3 signals.py "$soon" "$WHITTLE" reduce in.ply -o place/never.ply $options || fail "signals"
clean "after signals"

# ---- pipes ----
mkfifo pipe
# piped WHEN: a run into the pipe is stopped by SIGTERM
piped() {
	timeout -k 30 0.5 "$WHITTLE" reduce in.ply -f -o pipe --ratio 0.9 --no-progress 2>err
	got=$?
	# the status of timeout, not 137 for a run that had to be killed
	[ $got -eq 124 ] || fail "status $got $1: $(cat err)"
	grep -q interrupted err || fail "words $1: $(cat err)"
	[ -p pipe ] || fail "the pipe is gone $1"
	clean "$1"
}
piped "when nobody reads"
exec 3<>pipe
piped "when the reader sleeps"
exec 3>&-
rm pipe
mkfifo pipe
timeout 60 cat pipe >piped.ply &
expect 0 "$WHITTLE" reduce text.ply -o pipe --faces 20K --report report.json
wait
expect 0 "$WHITTLE" reduce text.ply -o direct.ply --faces 20K
cmp -s piped.ply direct.ply || fail "other bytes through a pipe"
clean "after a pipe"

# ---- full disks ----
# refuse WORDS ARGUMENTS...: status 1, these words, and nothing left
refuse() {
	local words=$1
	shift
	expect 1 "$WHITTLE" reduce "$@"
	grep -q -- "$words" err || fail "no '$words' for $*: $(cat err)"
	clean "after $*"
}
if [[ ${WHITTLE_SANITIZE:-} == *thread* ]]; then
	echo "skipped: limits of a file's size (ThreadSanitizer cannot live with one)"
else
	# shellcheck disable=SC2086
	(ulimit -f 100 && refuse 'no space left.*--temp-dir' in.ply -o place/never.ply $options &&
		refuse 'no space left.*--temp-dir' text.ply -o place/never.ply $options &&
		refuse 'no space left.*never' small.ply -o place/never.ply --faces 18K --cluster-faces 3K &&
		exit $failures) || fail "limits of a file's size"
fi
mkdir small
if mount -t tmpfs -o size=128k tmpfs small 2>/dev/null; then
	mounted=$dir/small
	refusals=0
	for input in in.ply text.ply; do
		# ever larger, until it does: refused beforehand, or, where little is missing, on the way
		for ((kib = 128; kib < 100000; kib = kib * 3 / 2)); do
			mount -o "remount,size=${kib}k" small
			# shellcheck disable=SC2086
			"$WHITTLE" reduce $input -o place/never.ply $options --temp-dir small \
				>/dev/null 2>err && break
			got=$?
			refusals=$((refusals + 1))
			words="'small.* bytes free, and this run will need about [0-9]* .*--temp-dir"
			[ $got -eq 5 ] || words="no space left in 'small.*--temp-dir"
			[ $got -eq 5 ] || [ $got -eq 1 ] || fail "status $got for $kib KiB"
			grep -q "$words" err || fail "words for $kib KiB: $(cat err)"
			[ -z "$(ls -A small)" ] || fail "left of $kib KiB: $(ls -A small)"
			clean "on $kib KiB"
		done
		[ -e place/never.ply ] || fail "$input never got through"
		rm -f place/never.ply
	done
	[ $refusals -ge 6 ] || fail "only $refusals disks were too small"
	mount -o remount,size=128k small
	refuse 'no space left for .small/never' text.ply -o small/never.ply.gz --faces 36K
	expect 5 "$WHITTLE" reduce text.ply -o small/never.ply --faces 36K
	grep -q "folder of 'small/never.ply' has" err || fail "an output foreseen: $(cat err)"
	[ -z "$(ls -A small)" ] || fail "left of an output: $(ls -A small)"
	head -c 200000 /dev/zero >small/full 2>/dev/null
	expect 1 "$WHITTLE" reduce text.ply -o ok.ply --faces 1K --report small/report.json
	grep -q 'mesh was written.*no space left.*report.json' err || fail "report: $(cat err)"
	[ -s ok.ply ] || fail "the mesh was not written"
	[ "$(ls -A small)" = full ] || fail "left of a report: $(ls -A small)"
	umount small
	mounted=
else
	echo "skipped: disks that fill up (nothing can be mounted)"
fi
if [ -c /dev/full ]; then
	expect 1 "$WHITTLE" reduce text.ply -f -o ok.ply --faces 1K --report /dev/full
	grep -q 'report.*/dev/full' err || fail "a report to /dev/full: $(cat err)"
	refuse '/dev/full' text.ply -o /dev/full --faces 1K
fi

# ---- kill -9, and others at work in the same folders ----
rm -f direct.ply
expect 0 "$WHITTLE" reduce text.ply -o direct.ply --faces 1K
# shellcheck disable=SC2086
(timeout -s KILL 0.15 "$WHITTLE" reduce in.ply -o place/never.ply $options) >/dev/null 2>&1
left=$(ls -A temp place)
expect 0 "$WHITTLE" reduce text.ply -o place/never.ply --faces 1K
cmp -s direct.ply place/never.ply || fail "other bytes after kill -9"
rm place/never.ply
[ "$(ls -A temp place)" = "$left" ] || fail "what a killed run left: $(ls -A temp place), was $left"
rm -rf temp place
mkdir temp place
for i in 1 2 3; do
	"$WHITTLE" reduce text.ply -q -o place/$i.ply --faces 1K || fail "status beside others" &
done
wait
for i in 1 2 3; do
	cmp -s direct.ply place/$i.ply || fail "other bytes beside others"
	rm -f place/$i.ply
done
clean "beside others"
for i in 1 2 3; do
	"$WHITTLE" reduce text.ply -q -o place/one.ply --faces 1K 2>err$i
	echo $? >status$i &
done
wait
[ "$(sort status? | tr -d '\n')" = 022 ] || fail "three runs to one output: $(cat status? err?)"
cmp -s direct.ply place/one.ply || fail "other bytes of one of three"
rm -f place/one.ply
clean "after three runs to one output"

# ---- no threads ----
cat >threads.py <<'E2'
import os, resource, subprocess, sys
most, command = int(sys.argv[1]), sys.argv[2:]
def limit():
    if os.getuid() == 0:
        os.setgroups([])
        os.setgid(54321)
    resource.setrlimit(resource.RLIMIT_NPROC, (most, most))
    if os.getuid() == 0:
        os.setuid(54321)
sys.exit(subprocess.run(command, preexec_fn=limit).returncode)
E2
if [ -n "${WHITTLE_SANITIZE:-}" ]; then
	echo "skipped: a limit of threads (sanitizers start their own)"
elif chmod 755 . && chmod 777 temp place && python3 threads.py 50 "$WHITTLE" --version >/dev/null 2>&1; then
	for most in 1 2 3 4 5 6 7 9 12; do
		expect 0 python3 threads.py $most "$WHITTLE" reduce "$dir/text.ply" -f \
			-o "$dir/place/never.ply" --faces 1K --threads 6 --cluster-faces 8K
	done
	rm -f place/never.ply
	clean "without threads"
else
	echo "skipped: a limit of threads (another user cannot run the command)"
fi

[ $failures -eq 0 ] || exit 1
echo "stop: ok"
