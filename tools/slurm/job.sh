#!/bin/bash
# Reduces a mesh in one Slurm job, by as many processes as it has tasks when whittle was built with
# MPI, and else by the threads of one.
#
# usage: sbatch [-N 2 --ntasks-per-node=1 -c 16 --mem=32G ...] job.sh IN OUT FACES [OPTION...]
#     sbatch -n 1 -c 16 --mem=8G --time=2:00:00 job.sh scan.ply small.ply 1% --fast
#
# OPTION...: those of whittle reduce. WHITTLE: the command (whittle). WHITTLE_RUN_DIR: OUT.run by default,
# on the file system that all nodes share. WHITTLE_MPI: the kind of MPI for srun (pmix).
# WHITTLE_RESTARTS: how often a job that was stopped is queued again (20).
#
# A job that is preempted, or reaches its time limit, is queued again and goes on where it was.
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --signal=B:USR1@90
#SBATCH --job-name=whittle
set -euo pipefail

if [ $# -lt 3 ] || [ -z "${SLURM_JOB_ID:-}" ]; then
	sed -n '2,/^#SBATCH/{/^#SBATCH/d;s/^# \{0,1\}//;p}' "$0"
	exit 2
fi
input=$1 output=$2 faces=$3
shift 3
whittle=${WHITTLE:-whittle}
run_dir=${WHITTLE_RUN_DIR:-$output.run}

tasks=${SLURM_NTASKS:-1} mpi=(--mpi="${WHITTLE_MPI:-pmix}")
if ! "$whittle" --version | grep -q MPI; then
	tasks=1 mpi=(--mpi=none)
fi
# The memory of a task: nine tenths of its share of the node, as programs beside it take some, too.
mib=${SLURM_MEM_PER_NODE:-0}
if [ "$mib" -gt 0 ]; then
	on_node=${SLURM_NTASKS_PER_NODE:-$(((tasks + ${SLURM_NNODES:-1} - 1) / ${SLURM_NNODES:-1}))}
	mib=$((mib / (tasks > 1 ? on_node : 1)))
else
	mib=$((${SLURM_MEM_PER_CPU:-0} * ${SLURM_CPUS_PER_TASK:-1}))
fi
memory=()
[ "$mib" -eq 0 ] || memory=(--memory $((mib * 9 / 10))M)
export OMP_NUM_THREADS=${SLURM_CPUS_PER_TASK:-1}
[ -z "${SLURM_TMPDIR:-}" ] || [ -d "$SLURM_TMPDIR" ] || unset SLURM_TMPDIR

status=0 warned=0
# in the background, so that the shell is told of signals, and passes them on
srun --ntasks="$tasks" "${mpi[@]}" "$whittle" reduce "$input" -o "$output" --faces "$faces" \
	--run-dir "$run_dir" --resume "${memory[@]}" "$@" &
trap 'kill -TERM $! 2>/dev/null' TERM
trap 'warned=1; kill -USR1 $! 2>/dev/null' USR1
wait $! || status=$?
# the wait that a signal ended is not the end of the step
while kill -0 $! 2>/dev/null; do wait $! || status=$?; done
if [ $status -ne 0 ] && [ $warned -eq 1 ] &&
	[ "${SLURM_RESTART_COUNT:-0}" -lt "${WHITTLE_RESTARTS:-20}" ]; then
	scontrol requeue "$SLURM_JOB_ID" && sleep 60 # until Slurm ends this one
fi
exit $status
