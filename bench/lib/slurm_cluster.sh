# A Slurm of one node on this machine, for as long as a script runs: slurmctld, slurmd and munged in a
# scratch folder, ended and removed by cluster_stop. Needs root and Debian's slurmctld, slurmd, munge and
# slurm-client. Source it; afterwards sbatch, srun and the others find it through SLURM_CONF.
#
#     cluster_start FOLDER CPUS MEMORY_MIB
cluster_pids=()

cluster_start() {
	local folder=$1 cpus=$2 mib=$3 node
	node=$(hostname -s)
	mkdir -p "$folder"/{munge,state,spool,log,tmp}
	chown munge "$folder/munge"
	chmod 755 "$folder" "$folder/munge"
	dd if=/dev/urandom of="$folder/munge/key" bs=1024 count=1 status=none
	chown munge "$folder/munge/key"
	chmod 600 "$folder/munge/key"
	setpriv --reuid=munge --regid=munge --clear-groups munged --foreground --force \
		--key-file="$folder/munge/key" --socket="$folder/munge/socket" \
		--pid-file="$folder/munge/pid" --seed-file="$folder/munge/seed" \
		--log-file="$folder/munge/log" >"$folder/log/munged" 2>&1 &
	cluster_pids+=($!)
	cat >"$folder/prolog" <<END
#!/bin/bash
mkdir -p $folder/tmp/\$SLURM_JOB_ID
echo export SLURM_TMPDIR=$folder/tmp/\$SLURM_JOB_ID
END
	chmod +x "$folder/prolog"
	cat >"$folder/slurm.conf" <<END
ClusterName=scratch
SlurmctldHost=$node(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge/socket
CredType=cred/munge
CryptoType=crypto/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/log/slurmctld
SlurmdLogFile=$folder/log/slurmd
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/filetxt
JobCompLoc=$folder/log/jobs
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerParameters=sched_interval=2,bf_interval=2,sched_min_interval=100000
SlurmdParameters=config_overrides
TaskProlog=$folder/prolog
ReturnToService=2
MpiDefault=none
KillWait=10
MinJobAge=3600
DefMemPerNode=256
NodeName=$node NodeAddr=127.0.0.1 CPUs=$cpus Boards=1 SocketsPerBoard=1 CoresPerSocket=$cpus ThreadsPerCore=1 RealMemory=$mib State=UNKNOWN
PartitionName=all Nodes=$node Default=YES MaxTime=INFINITE State=UP OverSubscribe=NO
END
	export SLURM_CONF=$folder/slurm.conf
	local i
	for ((i = 0; i < 50; i++)); do
		[ -S "$folder/munge/socket" ] && break
		sleep 0.1
	done
	slurmctld -D >"$folder/log/slurmctld.out" 2>&1 &
	cluster_pids+=($!)
	slurmd -D >"$folder/log/slurmd.out" 2>&1 &
	cluster_pids+=($!)
	for ((i = 0; i < 100; i++)); do
		[ "$(sinfo -h -o %t 2>/dev/null)" = idle ] && return 0
		sleep 0.2
	done
	echo "the cluster does not come up: see $folder/log" >&2
	return 1
}

cluster_stop() {
	[ ${#cluster_pids[@]} -eq 0 ] && return
	scancel --user=root 2>/dev/null || true
	kill "${cluster_pids[@]}" 2>/dev/null
	wait "${cluster_pids[@]}" 2>/dev/null
	cluster_pids=()
}
