#!/bin/sh
# Tries slurm.sh on one machine: two nodes by name, an array of shards, one of them killed and
# requeued, the merge, and the merged file against that of a run without a cluster.
#   apt-get install slurm-wlm    # Debian's, with munge; run as root
#   cargo build --release -p trepan-trials --bin validate
#   crates/trials/cluster/slurm-here.sh volume
# Suites are the arguments. Everything lies in a temporary folder; the daemons end with it.
set -eu
program="$PWD/target/release/validate"
[ -x "$program" ] || { echo "build $program first: cargo build --release -p trepan-trials --bin validate"; exit 1; }
[ $# -gt 0 ] || set -- volume
folder="$(mktemp -d)"
export SLURM_CONF="$folder/slurm.conf"
ended() { pkill -F "$folder/ctld.pid" 2>/dev/null; for node in a b; do pkill -F "$folder/$node.pid" 2>/dev/null; done; sleep 1; rm -rf "$folder"; }
trap ended EXIT
pgrep -x munged > /dev/null || { mkdir -p /run/munge && chown munge: /run/munge && runuser -u munge -- munged; }
host="$(hostname -s)"
cat > "$SLURM_CONF" <<CONF
ClusterName=here
SlurmctldHost=$host
SlurmUser=root
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool-%n
SlurmctldPidFile=$folder/ctld.pid
SlurmdPidFile=$folder/%n.pid
SlurmctldPort=6827
SlurmctldLogFile=$folder/ctld.log
SlurmdLogFile=$folder/%n.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
MpiDefault=none
ReturnToService=2
NodeName=a NodeHostname=$host Port=6828 CPUs=1 RealMemory=4000
NodeName=b NodeHostname=$host Port=6829 CPUs=1 RealMemory=4000
PartitionName=all Nodes=a,b Default=YES State=UP
CONF
mkdir "$folder/state" "$folder/spool-a" "$folder/spool-b"
slurmctld
slurmd -N a
slurmd -N b
until [ "$(sinfo -h -t idle -o %D)" = 2 ]; do sleep 1; done
"$program" --quick --jobs 1 --out "$folder/alone" "$@" > "$folder/alone.log" 2>&1 || true
cat > "$folder/job.sh" <<JOB
#!/bin/sh
#SBATCH --array=1-4
#SBATCH --requeue
#SBATCH --output=$folder/shard-%a.log
#SBATCH --open-mode=append
echo "shard \$SLURM_ARRAY_TASK_ID on \$SLURMD_NODENAME, restart \${SLURM_RESTART_COUNT:-0}"
# The first time one shard dies before its end.
[ "\$SLURM_ARRAY_TASK_ID-\${SLURM_RESTART_COUNT:-0}" != 2-0 ] || exec sleep 600
"$program" --quick --shard "\$SLURM_ARRAY_TASK_ID/4" --out "$folder/runs/\$SLURM_ARRAY_TASK_ID" $* || true
JOB
job="$(sbatch --parsable "$folder/job.sh")"
until squeue -h -j "${job}_2" -t running -o %i 2>/dev/null | grep -q .; do sleep 0.2; done
echo "killing shard 2"
scontrol requeue "${job}_2"
# A requeued job waits for two minutes by itself; that is for a cluster's nodes to recover.
until squeue -h -j "$job" -t pending -o %r 2>/dev/null | grep -q BeginTime || ! squeue -h -j "$job" -o %i 2>/dev/null | grep -q .; do sleep 0.2; done
scontrol update "jobid=${job}_2" StartTime=now 2>/dev/null || true
while squeue -h -j "$job" -o %i 2>/dev/null | grep -q .; do sleep 0.5; done
cat "$folder"/shard-*.log | grep "^shard\|^volume\|judged\|missing" | sort
"$program" merge "$folder"/runs/* --out "$folder/all" 2>&1 | tail -3 || true
for file in "$folder"/alone/*.json; do
    name="$(basename "$file")"
    case "$name" in durations*) continue ;; esac
    python3 - "$file" "$folder/all/$name" <<'PYTHON'
import json, sys
def rows(path):
    found = json.load(open(path))
    # Times differ from run to run, whoever runs them.
    timed = lambda name: any(word in name for word in ("ms", "us", "_s", "seconds", "time", "per_s", "mb", "speed", "ns", "cost"))
    return [(row["scene"], row["method"], sorted((k, v) for k, v in row["metrics"].items() if not timed(k.lower()))) for row in found["rows"]]
alone, merged = map(rows, sys.argv[1:])
apart = [pair for pair in zip(alone, merged) if pair[0] != pair[1]]
assert alone and alone == merged, f"{len(alone)} rows alone, {len(merged)} merged: {apart}"
print(f"{sys.argv[1].rsplit('/', 1)[1]}: {len(alone)} rows, the same merged from 4 shards as in one run")
PYTHON
done
rm -r "$folder/runs/3"
"$program" merge "$folder"/runs/* --out "$folder/part" 2>&1 | grep -i "missing\|lack\|shard" || { echo "a missing shard was not named"; exit 1; }
