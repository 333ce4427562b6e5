#!/bin/bash
# Reduces a mesh by Slurm job arrays: submits a job for each stage of the run, each after the one
# before it. The parts of a stage are the tasks of an array.
#
# usage: array.sh IN OUT FACES PARTS [OPTION...]
#     array.sh scan.ply small.ply 1% 16 --fast
#
# Run it on a login node; it reads no more than the header of IN. OPTION...: those of whittle reduce.
# What sbatch takes from the environment holds for all jobs (SBATCH_PARTITION, SBATCH_ACCOUNT,
# SBATCH_TIMELIMIT, ...), besides:
#
#     WHITTLE           the command (whittle)
#     WHITTLE_CPUS      for each task (1)
#     WHITTLE_MEM       for each task, as sbatch --mem takes it (the cluster's default)
#     WHITTLE_RUN_DIR   OUT.run by default; on the file system that all nodes share
#     WHITTLE_RESTARTS  how often a task that was stopped is queued again (20)
#
# Tasks that are preempted, or reach the time limit, are queued again, and go on or do their part
# again. The job numbers are printed; the last one finishes the run. A stage that fails for good ends
# the chain: what is done is kept, and the same command goes on from there.
set -euo pipefail

# ---- in a job ----

# The memory of the task for whittle: nine tenths, as programs beside it take some, too.
memory_option() {
	local mib=${SLURM_MEM_PER_NODE:-0}
	[ "$mib" -gt 0 ] || mib=$((${SLURM_MEM_PER_CPU:-0} * ${SLURM_CPUS_PER_TASK:-1}))
	[ "$mib" -eq 0 ] || echo "--memory $((mib * 9 / 10))M"
}

# A task that Slurm warned of its end is queued again. (One that is preempted for that purpose Slurm
# queues again itself; one that is cancelled is not to be.)
requeue() {
	local job=${SLURM_ARRAY_JOB_ID:+${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID}
	if [ "${SLURM_RESTART_COUNT:-0}" -ge "${WHITTLE_RESTARTS:-20}" ]; then
		echo "stopped, and queued again ${SLURM_RESTART_COUNT:-0} times before: giving up" >&2
		return
	fi
	scontrol requeue "${job:-$SLURM_JOB_ID}" && sleep 60 # until Slurm ends this one
}

# run_task WORDS...: one stage, or the plan
run_task() {
	local status=0 warned=0 part=()
	[ -z "${SLURM_ARRAY_TASK_ID:-}" ] || part=(--part "$SLURM_ARRAY_TASK_ID")
	[ -z "${SLURM_TMPDIR:-}" ] || [ -d "$SLURM_TMPDIR" ] || unset SLURM_TMPDIR
	export OMP_NUM_THREADS=${SLURM_CPUS_PER_TASK:-1}
	# in the background, so that the shell is told of signals, and passes them on
	# shellcheck disable=SC2046
	srun --ntasks=1 "$@" "${part[@]}" $(memory_option) &
	trap 'kill -TERM $! 2>/dev/null' TERM
	trap 'warned=1; kill -USR1 $! 2>/dev/null' USR1
	wait $! || status=$?
	# the wait that a signal ended is not the end of the task
	while kill -0 $! 2>/dev/null; do wait $! || status=$?; done
	[ $status -eq 0 ] || [ $warned -eq 0 ] || requeue
	exit $status
}

if [ "${1:-}" = --task ]; then
	shift
	run_task "$@"
fi

# ---- where it is submitted ----

if [ $# -lt 4 ] || [ "$1" = -h ] || [ "$1" = --help ]; then
	sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"
	exit $(($# < 4 ? 2 : 0))
fi
input=$1 output=$2 faces=$3 parts=$4
shift 4
whittle=${WHITTLE:-whittle}
run_dir=${WHITTLE_RUN_DIR:-$output.run}
rounds=$("$whittle" plan "$input" --faces "$faces" "$@" | awk '$1 == "rounds" { print $2 }')

# submit AFTER NAME ARRAY WORDS...: a job after another one (0: none), an array when ARRAY is not 0;
# prints its number
submit() {
	local after=$1 name=$2 array=$3 options=()
	shift 3
	[ "$after" = 0 ] || options+=(--dependency="afterok:$after" --kill-on-invalid-dep=yes)
	[ "$array" = 0 ] || options+=(--array="1-$array")
	[ -z "${WHITTLE_MEM:-}" ] || options+=(--mem="$WHITTLE_MEM")
	sbatch --parsable --requeue --open-mode=append --signal=B:USR1@90 \
		--cpus-per-task="${WHITTLE_CPUS:-1}" --ntasks=1 --job-name="$name" \
		"${options[@]}" "$0" --task "$@"
}

job=$(submit 0 whittle-plan 0 "$whittle" plan "$input" -o "$output" --faces "$faces" \
	--run-dir "$run_dir" --parts "$parts" "$@")
echo "plan $job"
job=$(submit "$job" whittle-ingest "$parts" "$whittle" stage ingest --run-dir "$run_dir")
echo "ingest $job"
for ((round = 1; round <= ${rounds:-0}; round++)); do
	job=$(submit "$job" whittle-join 0 "$whittle" stage join --run-dir "$run_dir")
	echo "join $job"
	job=$(submit "$job" "whittle-round-$round" "$parts" "$whittle" stage decimate \
		--run-dir "$run_dir" --round "$round")
	echo "decimate $job"
done
job=$(submit "$job" whittle-finish 0 "$whittle" stage finish --run-dir "$run_dir")
echo "finish $job"
