#!/bin/bash
# One scene on several nodes of a Slurm cluster:
#   sbatch --nodes=4 --cpus-per-task=16 samples/slurm.sh photos/ --out runs/photos --time 10m
# The arguments are those of `pipeline run`; pictures and run folder lie where all nodes see them. After a failure the same
# command continues, on any number of nodes. Many scenes need no ranks but an array:
#   sbatch --array=0-9 --wrap='scenes=(scenes/*/); pipeline run "${scenes[$SLURM_ARRAY_TASK_ID]}"'
#SBATCH --job-name=pipeline
#SBATCH --nodes=2
#SBATCH --ntasks-per-node=1
set -euo pipefail

MASTER_ADDR=$(scontrol show hostnames "$SLURM_JOB_NODELIST" | head -n 1)
export MASTER_ADDR
export MASTER_PORT=$((20000 + SLURM_JOB_ID % 10000))  # two jobs on one node do not meet
export WORLD_SIZE=$SLURM_NTASKS
cpus=${SLURM_CPUS_PER_TASK:-1}  # told to the program as well: not every cluster binds tasks to their processors
# shellcheck disable=SC2016  # each task has a rank of its own
exec srun --kill-on-bad-exit=1 --cpus-per-task="$cpus" \
  bash -c 'RANK=$SLURM_PROCID exec pipeline run "$@"' pipeline --threads "$cpus" "$@"
