#!/bin/sh
# The full validation on a Slurm cluster: 16 shards, then one job that merges them.
#   sbatch crates/trials/cluster/slurm.sh
#   sbatch --dependency=afterok:JOBID --wrap 'cargo xtask merge runs/* --out target/validation'
# Submit from the repository's root after `cargo build --release -p trepan-trials --bin validate`. A shard that was cut off goes on where it was when it is submitted again.
#SBATCH --job-name=trepan-validate
#SBATCH --array=1-16
#SBATCH --cpus-per-task=2
#SBATCH --exclusive=user
#SBATCH --mem=12G
#SBATCH --time=01:30:00
set -eu
exec target/release/validate --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT" --out "runs/$SLURM_ARRAY_TASK_ID"
